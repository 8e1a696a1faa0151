"""One FMU from several files: exact solutions, the same equations in one file, mistakes."""

import json
from collections.abc import Mapping
from pathlib import Path

import fmpy
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from tests.equations.compiled import ModelFileError, read
from tests.equations.examples import METHODS, quick
from tests.support.programs import RPARM, python
from tests.support.tables import tables

MODELS = tables(str(Path(__file__).with_name("algebraic")))


def written(folder: Path, texts: Mapping[str, str], **changed: str) -> Path:
    """The file of the whole, beside its components."""
    for name, text in {**texts, **changed}.items():
        suffix = {"c": "drive.c", "half": "half.c"}.get(name, f"{name}.toml")
        (folder / suffix).write_text(text, encoding="utf-8")
    return folder / "whole.toml"


def run(fmu: Path, method: str, stop: float, names: list[str], **start: float) -> np.ndarray:
    return fmpy.simulate_fmu(
        str(fmu),
        stop_time=stop,
        output_interval=stop / 100,
        relative_tolerance=1e-11,
        start_values={"solver_method": METHODS[method], **start},
        output=names,
    )


def levels(t: float) -> np.ndarray:
    """Levels (m) of two tanks with both pipes between them; the pump fills the first to 1.8 m."""
    flow, areas, most = 9.81 * 0.05 * 0.1 / 0.15, (2.0, 1.0), 0.2
    rates = np.array([[-flow, flow, 0.0], [flow, -flow, 0.0], [0.0, 0.0, 0.0]])
    rates[:2] /= np.array(areas)[:, None]
    rates[0, 2] = most / areas[0]
    start = np.array([1.5, 1.0, 1.0])
    full = brentq(lambda at: (expm(rates * at) @ start)[0] - 1.8, 0, 50, xtol=1e-14)
    if t < full:
        return (expm(rates * t) @ start)[:2]
    at_full = expm(rates * full) @ start
    rates[0, 2] = 0.0
    return (expm(rates * (t - full)) @ at_full)[:2]


@pytest.mark.parametrize("method", ["cvode_adams", "erk", "taylor"])
def test_two_tanks_and_a_junction_are_exact(method: str, tmp_path: Path) -> None:
    """The junction's pressure is an algebraic unknown; the pump switches off at an event."""
    fmu = quick(written(tmp_path, MODELS["hydraulics"]), tmp_path)
    rows = run(fmu, method, 10, ["left.h", "right.h", "p", "first.q", "second.q"])
    expected = np.array([levels(t) for t in rows["time"]])
    found = np.stack([rows["left.h"], rows["right.h"]], axis=1)
    assert np.max(np.abs(found - expected)) < 1e-10
    assert np.max(np.abs(rows["first.q"] - rows["second.q"])) < 1e-14


def test_components_have_the_bits_of_one_file(tmp_path: Path) -> None:
    texts = MODELS["machine"]
    whole = quick(written(tmp_path, texts), tmp_path)
    flat = quick(tmp_path / "flat.toml", tmp_path)
    same = {"axis.x[1]": "a1", "axis.x[2]": "a2", "other.x[1]": "b1", "axis.held": "ha"}
    for method in METHODS:
        parts, one = run(whole, method, 5, [*same]), run(flat, method, 5, [*same.values()])
        for name, other in same.items():
            np.testing.assert_array_equal(parts[name], one[other], err_msg=f"{method}: {name}")


LOOP = """
name = "Loop"
step = "10 ms"
stop = "3 s"
keep = ["left.h"]
[components]
left = "tank.toml"
right = "tank.toml"
pipe = "pipe.toml"
[connections]
left.inflow = "pipe.q"
"pipe.p1" = "right.p"
"pipe.p2" = "left.p"
[inputs]
"right.inflow" = 0.25
[parameters]
left.h = "150 cm"
right.A = 4
[variants.other]
left.h = 3
"""


def test_a_loop_file_becomes_one_fmu(tmp_path: Path) -> None:
    """Its parameters are starts, its stop is the end of the experiment; a lock file is written."""
    texts = MODELS["hydraulics"]
    path = written(tmp_path, texts, whole=LOOP)
    ended = python(*RPARM, "build", path, "--output", tmp_path, "--json")
    assert ended.returncode == 0, ended.stderr
    description = fmpy.read_model_description(tmp_path / "Loop.fmu")
    assert description.defaultExperiment.stopTime == "3.0"
    starts = {v.name: v.start for v in description.modelVariables}
    assert starts["left.h"] == "1.5" and starts["right.A"] == "4.0"
    causalities = {v.name: v.causality for v in description.modelVariables}
    assert causalities["right.inflow"] == "input" and causalities["left.inflow"] == "local"
    assert '"left.h" = ' in (tmp_path / "whole.lock.toml").read_text("utf-8")
    tank = texts["tank"].replace('start = 1, unit = "m"', 'start = 7, unit = "m"')
    (tmp_path / "tank.toml").write_text(tank)
    ended = python(*RPARM, "build", path, "--output", tmp_path, "--json")
    starts = fmpy.read_model_description(tmp_path / "Loop.fmu").modelVariables
    assert next(v.start for v in starts if v.name == "right.h") == "7.0"


OF_LOOPS = [
    ("[connections]", "[conections]", "unknown key 'conections', did you mean 'connections'?"),
    ('step = "10 ms"', 'step = "10 msec"', "line 3: step: unit 'msec'"),
    ('["left.h"]', '["left.hh"]', "keep: 'left.hh': there is no such variable"),
    ('"right.inflow" =', '"left.inflow" =', "[inputs]: left.inflow: is connected already"),
    ('"right.inflow" =', '"right.p" =', "[inputs]: right.p: is of [outputs], no input"),
    ('"right.inflow" =', '"right.inflw" =', "right.inflw: there is no such variable, did you mean"),
    ("left.h = 3", "left.hh = 3", "[variants.other]: left.hh: there is no such variable"),
    ('left = "tank.toml"', 'left = "tank"', "left: tank: only files with equations (.toml) can"),
    ('pipe = "pipe.toml"', 'pipe = "pipe.toml"\nder_left = "tank.toml"', "der_left.h: derivatives"),
]


@pytest.mark.parametrize(("old", "new", "message"), OF_LOOPS, ids=[m for *_, m in OF_LOOPS])
def test_a_mistake_in_a_loop_file(old: str, new: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ModelFileError) as refused:
        read(written(tmp_path, MODELS["hydraulics"], whole=LOOP.replace(old, new)))
    assert message in str(refused.value) and "\n" not in str(refused.value)


WHOLE = MODELS["hydraulics"]["whole"]
MISTAKES = [
    (
        'pump = "pump.toml"',
        'pump = "pmp.toml"',
        "[components]: pump: pmp.toml: there is no such file",
    ),
    ('pump = "pump.toml"', 'pump = "whole.toml"', "whole.toml contains itself"),
    ('pump = "pump.toml"', 'pump = "Pump.fmu"', "Pump.fmu: only files with equations (.toml) can"),
    (
        'pump = "pump.toml"',
        'pump = "law.py:law"',
        "law.py:law: only files with equations (.toml) can",
    ),
    (
        'pump = "pump.toml"',
        'pump = { file = "pump.toml", every = "20 ms" }',
        "every: a rate is for",
    ),
    ('"20000 cm2"', '"20000 cm"', "'20000 cm' does not have the unit of the variable"),
    ('"20000 cm2"', "-1", "A: -1 is outside [min, max]"),
    ("k = 0.05", "q = 0.05", "[components]: first: parameters: q: is of [outputs]: no parameter"),
    ("k = 0.05", "kk = 0.05", "kk: there is no such variable, did you mean 'first.k'?"),
    ('pump.level = "left.h"', 'pump.levl = "left.h"', "pump.levl: no such input, did you mean"),
    (
        'pump.level = "left.h"',
        'pump.q = "left.h"',
        "[connections]: pump.q: is of [outputs], no input",
    ),
    ('pump.level = "left.h"', 'pump.level = "left.p"', "expected unit m, got m2/s2"),
    (
        'pump.level = "left.h"',
        'pump.level = "left.hh"',
        "unknown name 'left.hh', did you mean 'left.h'?",
    ),
    (
        'pump.level = "left.h"',
        'pump.level = "left.h > 1"',
        "expected a number, '>' gives a condition",
    ),
    (
        'pump.level = "left.h"',
        'pump.level = "left.h"\n"pump.level" = "right.h"',
        "pump.level: is there twice",
    ),
    ("[components]\n", "[units]\nm2 = { m = 3 }\n[components]\n", "unit m2 has another meaning"),
]


@pytest.mark.parametrize(("old", "new", "message"), MISTAKES, ids=[m for *_, m in MISTAKES])
def test_a_mistake_is_one_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    path = written(tmp_path, MODELS["hydraulics"], whole=WHOLE.replace(old, new))
    with pytest.raises(ModelFileError) as refused:
        read(path)
    said = str(refused.value)
    assert message in said and "\n" not in said and len(said) < 500


def test_a_mistake_in_a_component_has_its_file_and_line(tmp_path: Path) -> None:
    wrong = MODELS["hydraulics"]["tank"].replace("g * h", "g * hh")
    with pytest.raises(ModelFileError) as refused:
        read(written(tmp_path, MODELS["hydraulics"], tank=wrong))
    assert (
        f"left: {tmp_path / 'tank.toml'}: line 10: [outputs]: p: value: column 5: unknown"
        in str(refused.value)
    )


def test_a_cycle_without_a_solution_is_where_it_begins(tmp_path: Path) -> None:
    """Two components that hand on each other's output, and a component that contradicts itself."""
    (tmp_path / "gain.toml").write_text(
        'name = "Gain"\n[inputs]\nu = {}\n[where]\nc = "c"\n[outputs]\ny = { value = "u" }\n'
    )
    path = tmp_path / "whole.toml"
    path.write_text('name = "W"\n[components]\na = "gain.toml"\n')
    with pytest.raises(ModelFileError) as refused:
        read(path)
    where = f"{path}: line 3: [components]: a: {tmp_path / 'gain.toml'}: line 5: [where]: c: "
    assert str(refused.value) == f"{where}a.c = c does not determine a.c"
    (tmp_path / "gain.toml").write_text(
        'name = "Gain"\n[inputs]\nu = {}\n[outputs]\ny = { value = "u" }\n'
    )
    path.write_text(
        'name = "W"\n[components]\na = "gain.toml"\nb = "gain.toml"\n'
        '[connections]\na.u = "b.y"\nb.u = "a.y"\n'
    )
    with pytest.raises(ModelFileError) as refused:
        read(path)
    assert str(refused.value).startswith(f"{path}: line 6: [connections]: a.u: a.u, b.u, ")


def test_names_that_are_one_in_c(tmp_path: Path) -> None:
    (tmp_path / "one.toml").write_text('name = "One"\n[parameters]\nb_c = { start = 1 }\n')
    (tmp_path / "two.toml").write_text('name = "Two"\n[parameters]\nc = { start = 1 }\n')
    whole = 'name = "Whole"\n[components]\na = "one.toml"\na_b = "two.toml"\n'
    (tmp_path / "whole.toml").write_text(whole)
    with pytest.raises(ModelFileError, match=r"a_b\.c: C has the same name for a\.b_c"):
        read(tmp_path / "whole.toml")


def test_the_true_coupling_error_is_of_first_order(tmp_path: Path) -> None:
    """As that of held inputs; the estimate by half the step is near to it."""
    loop = """
name = "Loop"
step = "{step} ms"
stop = "2 s"
[components]
left = "tank.toml"
right = "tank.toml"
pipe = "pipe.toml"
back = "pipe.toml"
[connections]
left.inflow = "pipe.q"
right.inflow = "back.q"
pipe.p1 = "right.p"
pipe.p2 = "left.p"
back.p1 = "left.p"
back.p2 = "right.p"
[parameters]
left.h = 2.5
"""
    found = []
    for step in (10, 5):
        path = written(tmp_path, MODELS["hydraulics"], whole=loop.replace("{step}", f"{step}"))
        ended = python(*RPARM, "system", path, "--exact", "--output", tmp_path / "r", "--json")
        assert ended.returncode == 0, ended.stderr
        (row,) = json.loads(ended.stdout)["variants"]
        assert abs(row["coupling_error"] / row["true_error"] - 1) < 0.1
        found.append(row["true_error"])
    assert abs(found[0] / found[1] - 2) < 0.05
    path.write_text(path.read_text().replace('back = "pipe.toml"', 'back = "back.py:flow"'))
    (tmp_path / "back.py").write_text("def flow(t, h, inputs):\n    return {'q': 0.0}\n")
    ended = python(*RPARM, "system", path, "--exact", "--output", tmp_path / "r", "--json")
    assert ended.returncode == 2 and "only files with equations (.toml) can be" in ended.stderr


def test_a_component_without_units_takes_any(tmp_path: Path) -> None:
    """Its own numbers are not checked; x' = 2 y - x with y' = -y is x = (1 + 2 t) exp(-t)."""
    part = 'name = "A"\n[inputs]\nu = {}\n[states]\nx = { start = 1, derivative = "u - x" }\n'
    (tmp_path / "a.toml").write_text(part)
    (tmp_path / "whole.toml").write_text("""
name = "Whole"
[components]
a = "a.toml"
[connections]
a.u = "2 * y"
[parameters]
T = { start = 1, unit = "s" }
[states]
y = { start = 1, unit = "m", derivative = "-y / T" }
[outputs]
s = { value = "a.x + y", unit = "m" }
""")
    rows = run(quick(tmp_path / "whole.toml", tmp_path), "erk", 1, ["a.x", "s"])
    assert abs(rows["a.x"][-1] - 3 * np.exp(-1)) < 1e-10
    assert abs(rows["s"][-1] - 4 * np.exp(-1)) < 1e-10


def test_the_true_error_has_that_of_held_inputs(tmp_path: Path) -> None:
    """x' = u - x with u = sin(2 pi t), held over steps of 0.1 s by the master."""
    (tmp_path / "lag.toml").write_text(
        'name = "Lag"\n[inputs]\nu = {}\n[states]\nx = { derivative = "u - x" }\n'
    )
    (tmp_path / "whole.toml").write_text(
        'name = "Whole"\nstep = "0.1 s"\nstop = "2 s"\n[components]\na = "lag.toml"\n'
        "[inputs]\na.u = { sines = [{ amplitude = 1, frequency = 1 }] }\n"
    )
    command = [*RPARM, "system", tmp_path / "whole.toml", "--exact", "--json"]
    ended = python(*command, "--output", tmp_path / "r")
    assert ended.returncode == 0, ended.stderr
    (row,) = json.loads(ended.stdout)["variants"]
    t, w = np.linspace(0, 2, 21), 2 * np.pi
    exact = (np.sin(w * t) - w * np.cos(w * t) + w * np.exp(-t)) / (1 + w**2)
    held = np.zeros(21)
    for k in range(20):
        held[k + 1] = np.exp(-0.1) * (held[k] - np.sin(w * t[k])) + np.sin(w * t[k])
    true = np.max(np.abs(held - exact)) / np.max(np.abs(exact))
    assert abs(row["true_error"] / true - 1) < 0.05
