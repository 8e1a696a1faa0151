"""Algebraic loops of FMUs, subsystems, rates and orders, as a user meets them."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from scipy.linalg import expm

import rparm
from rparm import building
from rparm.campaign import work
from rparm.errors import UserError
from rparm.systems import ssp_writer
from rparm.systems.opened import opened
from tests.support.rparm_project import Console, repacked

# z = 1 + k u, and a memory: w' = u - w
GAIN = """
name = "Gain"
[parameters]
k = { start = 0.5 }
[inputs]
u = { start = 0.5 }
[states]
w = { derivative = "u - w" }
[outputs]
v = { value = "w" }
z = { value = "1 + k * u" }
"""
# z = u + c - u^2: with z = u the square root of c, or its negative
SQUARE = """
name = "Square"
[parameters]
c = { start = 2.0 }
[inputs]
u = { start = 0.5 }
[outputs]
z = { value = "u + c - u * u" }
"""
LOOP = """
name = "Loop"
step = 0.1
stop = 1.0
[components]
a = "NAME.fmu"
b = "fmi3/Gain.fmu"
[connections]
"a.u" = "b.z"
"b.u" = "a.z"
"""
# y = K e + I, I' = K e / T with e = r - x; x' = (u - x) / 0.5
PI = """
name = "Pi"
step = "100 ms"
stop = 5.0
[components]
law = "law.toml"
plant = "plant.toml"
[connections]
"law.x" = "plant.x"
"plant.u" = "law.u"
"""
LAW = """
name = "Law"
[inputs]
x = {}
[states]
i = { derivative = "2 * (1 - x) / 0.5" }
[outputs]
u = { value = "2 * (1 - x) + i" }
"""
PLANT = """
name = "Plant"
[inputs]
u = {}
[states]
y = { derivative = "(u - y) / 0.5" }
[outputs]
x = { value = "y" }
"""
CALLS = """
class Law:
    inputs, outputs = ["x"], ["t", "h", "seen"]
    def step(self, t, h, inputs):
        return {"t": t, "h": h, "seen": inputs["x"]}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("loops")
    texts = {"gain": GAIN, "square": SQUARE, "law": LAW, "plant": PLANT}
    for name, text in texts.items():
        (found / f"{name}.toml").write_text(text, encoding="utf-8")
        if name in ("gain", "square"):
            building.build(found / f"{name}.toml", output=found, lock=False)
    (found / "loop.toml").write_text(LOOP.replace("NAME", "Gain"), encoding="utf-8")
    (found / "pi.toml").write_text(PI, encoding="utf-8")
    (found / "calls.py").write_text(CALLS, encoding="utf-8")
    return found


# ---- Loops ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("order", ["jacobi", "gauss_seidel", "extrapolated"])
def test_a_loop_of_two_fmus_is_solved_in_each_command(
    folder: Path, order: str, tmp_path: Path, console: Console
) -> None:
    """a = b = 1 / (1 - k) = 2, of FMI 2.0 and 3.0, as a loop file and as an SSP."""
    text = LOOP.replace("NAME", "Gain").replace("step", f'order = "{order}"\nstep', 1)
    file = folder / f"{order}.toml"
    file.write_text(text, encoding="utf-8")
    with opened(file) as system:
        ssp_writer.write(tmp_path / "Loop.ssp", system)
    for given in (file, tmp_path / "Loop.ssp"):
        table = rparm.System(given).run()
        np.testing.assert_allclose([table["a.z"], table["b.z"]], 2.0, rtol=1e-14)
    code, out, _ = console("system", file, "--output", tmp_path / "report")
    page = (tmp_path / "report/system/Loop_default.html").read_text(encoding="utf-8")
    assert code == 0 and "Solved together at each communication point" in page
    code, out, _ = console("coupling", file, "--output", tmp_path / "report", "--json")
    assert code == 0 and all(max(way["errors"]) < 1e-7 for way in json.loads(out)["ways"])
    if order != "jacobi":
        return
    made = tmp_path / "campaign.toml"
    made.write_text(
        f'title = "Loop"\ndescription = "Gains"\nsystem = "{file}"\nsampling = "grid"\n'
        '[parameters."a.k"]\nvalues = [-3.0, 0.5, 1.5]\n[keep]\nfinal = ["b.z"]\n',
        encoding="utf-8",
    )
    assert console("campaign", made, "--output", tmp_path / "campaign")[0] == 0
    with work.opened(made, output=tmp_path / "campaign") as done:
        found = done.table()["final(b.z)"]
    # a = 1 + k b, b = 1 + a / 2
    np.testing.assert_allclose(found, [1.5 / (1 - k / 2) for k in (-3.0, 0.5, 1.5)], rtol=1e-14)


def test_a_loop_is_linearized(folder: Path) -> None:
    """w' = u - w, and a jump at a.u comes back by 1 / (1 - 1 / 4)."""
    found = rparm.linearize(folder / "loop.toml")
    a = found.outputs.index("a.z"), found.inputs.index("a.u")
    assert found.D[a] == pytest.approx(0.5 / 0.75, rel=1e-14)
    assert found.poles.tolist() == pytest.approx([-1.0, -1.0])


@pytest.mark.parametrize(("start", "root"), [("0.5", 2.0), ("-0.5", -2.0)])
def test_the_solution_is_the_one_next_to_the_start(
    folder: Path, tmp_path: Path, start: str, root: float
) -> None:
    """b.z = 1 + a.z and a.u = b.z: u = 1 + u + c - u^2."""
    text = SQUARE.replace("0.5", start)
    (tmp_path / "square.toml").write_text(text, encoding="utf-8")
    file = tmp_path / "loop.toml"
    ends = {"NAME.fmu": "square.toml", '"fmi3/Gain.fmu"': '{ file = "gain.toml" }'}
    text = LOOP + '[parameters]\n"b.k" = 1.0\n"a.c" = 3.0\n'
    for old, new in ends.items():
        text = text.replace(old, new)
    (tmp_path / "gain.toml").write_text(GAIN, encoding="utf-8")
    file.write_text(text, encoding="utf-8")
    np.testing.assert_allclose(rparm.System(file).run()["b.z"], root, rtol=1e-14)
    other = rparm.System(file).run(parameters={"a.u": -root})
    np.testing.assert_allclose(other["b.z"], -root, rtol=1e-14)
    with pytest.raises(UserError, match=r"^no solution of the algebraic loop .* is off by "):
        rparm.System(file).run(parameters={"a.c": -2.0})


@pytest.mark.parametrize("derivatives", [True, False])
@pytest.mark.parametrize("k", [0.5, -1e3, -1e6])
def test_a_loop_passes_through_zero(tmp_path: Path, derivatives: bool, k: float) -> None:
    """u = k u - 1 + t, of one FMU."""
    text = GAIN.replace('"1 + k * u"', '"k * u - 1 + time"').replace("1 + k u", "k u - 1 + t")
    (tmp_path / "gain.toml").write_text(text, encoding="utf-8")
    building.build(tmp_path / "gain.toml", output=tmp_path, lock=False)
    name = "Gain.fmu"
    if not derivatives:
        taken = 'providesDirectionalDerivative="true"'
        name = "Plain.fmu"
        repacked(tmp_path / "Gain.fmu", tmp_path / name, lambda text: text.replace(taken, ""))
    file = tmp_path / "loop.toml"
    file.write_text(
        f'name = "L"\nstep = 0.1\nstop = 2.0\n[components]\na = "{name}"\n'
        f'[connections]\n"a.u" = "a.z"\n[parameters]\n"a.k" = {k!r}\n',
        encoding="utf-8",
    )
    exact = (0.1 * np.arange(21) - 1) / (1 - k)
    bound = 4e-15 if k > 0 else 1e-15
    np.testing.assert_allclose(rparm.System(file).run()["a.z"], exact, rtol=0, atol=bound)


@pytest.mark.parametrize("equation", ["u + 1e-13", "u * u + 0.25 + 1e-11", "u + 1"])
def test_what_rounding_nearly_solves_has_no_solution(tmp_path: Path, equation: str) -> None:
    (tmp_path / "square.toml").write_text(SQUARE.replace("u + c - u * u", equation), "utf-8")
    file = tmp_path / "loop.toml"
    head = 'name = "L"\nstep = 0.1\nstop = 2.0\n[components]\na = "square.toml"\n'
    file.write_text(f'{head}[connections]\n"a.u" = "a.z"\n', encoding="utf-8")
    with pytest.raises(UserError, match=r"^no solution of the algebraic loop of 1 connection "):
        rparm.System(file).run()


# ---- Orders, rates, subsystems -------------------------------------------------------------------
def test_a_cascade_in_gauss_seidel_order_has_no_delay(folder: Path) -> None:
    """Three gains behind a memory, in the file before it."""
    components = "\n".join(f'{name} = "Gain.fmu"' for name in ("g3", "g2", "g1", "memory"))
    file = folder / "chain.toml"
    head = 'name = "Chain"\nstep = 0.1\nstop = 1.0\norder = "gauss_seidel"'
    ends = '"g1.u" = "memory.v"\n"g2.u" = "g1.z"\n"g3.u" = "g2.z"\n'
    file.write_text(f"{head}\n[components]\n{components}\n[connections]\n{ends}", encoding="utf-8")
    table = rparm.System(file).run()
    w = 0.5 * (1 - np.exp(-0.1 * np.arange(11)))
    np.testing.assert_allclose(table["g3.z"], 1 + (1 + (1 + w / 2) / 2) / 2, atol=1e-7)


def test_the_estimate_names_the_order_that_is_cheaper(
    folder: Path, tmp_path: Path, console: Console
) -> None:
    """The closed loop: y' = 4 - 6 y + 2 i, i' = 4 - 4 y."""
    _, out, _ = console("system", folder / "pi.toml", "--output", tmp_path, "--json")
    found = json.loads(out)["variants"][0]
    A = np.array([[-6.0, 2.0], [-4.0, 0.0]])
    rest = np.linalg.solve(A, [-4.0, -4.0])
    exact = np.array([rest - expm(A * t) @ rest for t in 0.1 * np.arange(51)])
    signals = {"plant.x": exact[:, 0], "law.i": exact[:, 1]}
    signals["law.u"] = 2 * (1 - exact[:, 0]) + exact[:, 1]
    size = max(np.abs(values).max() for values in signals.values())
    errors = {}
    for order in ("jacobi", "gauss_seidel", "extrapolated"):
        file = folder / "ordered.toml"
        file.write_text(PI.replace("step", f'order = "{order}"\nstep', 1), encoding="utf-8")
        run = rparm.System(file).run()
        errors[order] = max(np.abs(run[x] - signals[x]).max() for x in signals) / size
    named = found["cheaper_order"]
    assert errors[named] == min(errors.values()) < errors["jacobi"] / 2
    assert found["coupling_error"] == pytest.approx(errors["jacobi"], rel=0.4)
    assert found["cheaper_error"] == pytest.approx(errors[named], rel=0.6)


def test_a_component_steps_at_its_own_rate(folder: Path) -> None:
    """Every 250 ms at steps of 100 ms: at 0.2, 0.5, 0.7 and 1.0 s, as is said once."""
    text = PI.replace('law = "law.toml"', 'law = { file = "calls.py", every = "250 ms" }')
    text = text.replace("stop = 5.0", "stop = 1.0").replace('"plant.u" = "law.u"', "")
    file = folder / "rate.toml"
    file.write_text(text + '[parameters]\n"plant.y" = 2.0\n', encoding="utf-8")
    system = rparm.System(file)
    table = system.run()
    assert sum("every 0.25 s is no multiple of the step" in note for note in system.notes) == 1
    starts = [0, 0, 0, 0, 0, 0.2, 0.2, 0.5, 0.5, 0.5, 0.7]
    lengths = [0, 0, 0.2, 0.2, 0.2, 0.3, 0.3, 0.2, 0.2, 0.2, 0.3]
    np.testing.assert_allclose(table["law.t"], starts, atol=1e-15)
    np.testing.assert_allclose(table["law.h"], lengths, atol=1e-15)
    np.testing.assert_allclose(
        table["law.seen"][2:], 2 * np.exp(-2 * np.array(starts[2:])), atol=1e-6
    )


@pytest.mark.parametrize("order", ["jacobi", "gauss_seidel", "extrapolated"])
def test_python_does_the_same_in_an_ssp(folder: Path, tmp_path: Path, order: str) -> None:
    text = PI.replace('law = "law.toml"', 'law = { file = "law.py:Law", every = "200 ms" }')
    text = text.replace("step", f'order = "{order}"\nstep', 1)
    law = 'class Law:\n    inputs, outputs = ["x"], ["u"]\n    def step(self, t, h, inputs):\n'
    (folder / "law.py").write_text(f'{law}        return {{"u": 1 - inputs["x"] + t}}\n', "utf-8")
    (folder / "python.toml").write_text(text, encoding="utf-8")
    with opened(folder / "python.toml") as system:
        ssp_writer.write(tmp_path / "Pi.ssp", system)
    own, of_ssp = (rparm.System(x).run() for x in (folder / "python.toml", tmp_path / "Pi.ssp"))
    np.testing.assert_array_equal(own["plant.x"], of_ssp["plant.x"])


def test_the_whole_is_in_place_of_its_subsystems(folder: Path) -> None:
    """Inputs that a subsystem's file moves or sets, and its parameters."""
    inner = 'name = "In"\nstep = 0.1\nstop = 1.0\n[components]\ng = "gain.toml"\nh = "gain.toml"\n'
    inner += '[inputs]\n"g.u" = { constant = 3 }\n[parameters]\n"h.u" = 4.0\n"g.k" = 2.0\n'
    (folder / "in.toml").write_text(inner, encoding="utf-8")
    head = 'name = "Out"\nstep = 0.1\nstop = 1.0\n[components]\nb = "in.toml"\nc = "gain.toml"\n'
    file = folder / "out.toml"
    for more, g, h in (
        ("", 7.0, 3.0),
        ('[parameters]\nb.g.u = 1.0\n"b.g.k" = 1.0\n', 2.0, 3.0),
        ('[connections]\n"b.g.u" = "c.z"\n"b.h.u" = "c.z"\n', 3.5, 1.625),
        ('[inputs]\n"b.h.u" = { constant = 1 }\n', 7.0, 1.5),
    ):
        file.write_text(head + more, encoding="utf-8")
        found = rparm.System(file).run()
        assert (found["b.g.z"][0], found["b.h.z"][0]) == (g, h)
    given = 'b = { file = "in.toml", parameters = { g.k = 1.0, "h.k" = 3.0 } }'
    file.write_text(head.replace('b = "in.toml"', given) + "[parameters]\nb.h.k = 2.0\n", "utf-8")
    built = building.build(file, output=folder, lock=False)
    for values in (rparm.System(file).run(), rparm.simulate(built[0], stop_time=1.0)):
        assert values["b.h.z"][0] == 9.0


def test_subsystems_are_drawn_saved_and_built(
    folder: Path, tmp_path: Path, console: Console
) -> None:
    inner = PI.replace("step", 'order = "jacobi"\nstep', 1) + '[parameters]\n"plant.y" = 0.5\n'
    (folder / "inner.toml").write_text(inner, encoding="utf-8")
    whole = (
        'name = "Both"\nstep = "100 ms"\nstop = 1.0\norder = "gauss_seidel"\n[components]\n'
        'left = "inner.toml"\nright = { file = "inner.toml", parameters = { "plant.y" = 0.25 } }\n'
    )
    file = folder / "both.toml"
    file.write_text(whole, encoding="utf-8")
    with opened(file) as system:
        assert system.system.subsystems == ("left", "right")
        code, _, said = console("ssp", file, "--output", tmp_path)
        assert code == 0 and "order gauss_seidel: an annotation" in said
        assert any(
            "subsystem left, right: its file's order does not apply" in note
            for note in system.notes
        )
        ssp_writer.write(tmp_path / "Both.ssp", system)
    table = rparm.System(file).run()
    assert (table["left.plant.x"][0], table["right.plant.x"][0]) == (0.5, 0.25)
    again = rparm.System(tmp_path / "Both.ssp").run()
    for name in table:
        np.testing.assert_array_equal(table[name], again[name])
    assert console("system", file, "--exact", "--output", tmp_path)[0] == 0
    picture = etree.parse(str(tmp_path / "system/Both.svg"))
    texts = [text.text for text in picture.getroot().iterfind("{*}text")]
    assert {"left", "right", "1", "4", "Gauss-Seidel order, as numbered"} <= {*texts}
    file.write_text(whole.replace('"inner.toml", p', '"both.toml", p'), encoding="utf-8")
    assert "right: both.toml contains itself" in console.refused("system", file)
    file.write_text(
        whole.replace('"inner.toml", p', '"inner.toml", every = 0.2, p'), encoding="utf-8"
    )
    error = console.refused("build", file, "--output", tmp_path)
    assert "every: a rate is for co-simulation" in error


@pytest.mark.parametrize("version", [2, 3])
def test_a_component_that_ends_the_simulation_says_why(
    tmp_path: Path, console: Console, version: int
) -> None:
    """x' = -x, from 1: at ln 2."""
    decay = 'name = "Decay"\n[states]\nx = { start = 1, derivative = "-x" }\n[events.half]\n'
    decay += 'when = "x < 0.5"\nterminate = "half is gone"\n'
    (tmp_path / "decay.toml").write_text(decay, encoding="utf-8")
    file = tmp_path / "ends.toml"
    file.write_text('name = "E"\nstep = 0.1\nstop = 1\n[components]\na = "decay.toml"\n', "utf-8")
    _, _, said = console("system", file, "--fmi", version, "--output", tmp_path / "report")
    assert re.search(r"ends the simulation at t = 0\.693147.*: event half: half is gone", said)
    text = decay.replace("is gone", "is {gone}")
    (tmp_path / "decay.toml").write_text(text, encoding="utf-8")
    assert "[events.half]: terminate: {gone}: no such variable" in console.refused("system", file)
