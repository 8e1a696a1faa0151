"""The reference trajectories: made again they come out the same; each value: tests/prove. Equations
of the notes are in the headers once."""

import csv
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from rparm.models.reference_files import write_scenario
from rparm.models.rp_manipulator.references.make_references import (
    INPUTS,
    PARAMETERS,
    STATES,
    derive,
    outputs,
)

from rparm.models import make_references
from rparm.runs.scenario import Scenario
from tests.support.paths import ROOT
from tests.support.rparm_project import declared, load, names_of

MODEL = ROOT / "models" / "rp_manipulator"
FILES = ("RPManipulator_ref.csv", "RPManipulator_in.csv", "RPManipulator_ref.opt")
SCENARIOS = {name: load(name) for name in names_of(MODEL.name)}
SHORT = ("sixtieth", "irregular_steps")  # the others: ./test.sh --long
each_scenario = pytest.mark.parametrize("run", SCENARIOS.values(), ids=SCENARIOS.keys())


def read(path: Path) -> tuple[list[str], np.ndarray]:
    """Names and values, (rows, names), of a CSV file."""
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], np.array(rows[1:], dtype=float)


def assert_same(run: Scenario, made: Path) -> None:
    """The files of a reference, made in another order and folder, are those that are kept."""
    assert {path.name for path in made.iterdir()} == set(FILES)
    for file in FILES:
        old, new = run.reference_folder / file, made / file
        if old.read_bytes() == new.read_bytes():
            continue  # always so on one kind of machine
        assert file.endswith(".csv"), "the options differ"
        (old_names, old_values), (new_names, new_values) = read(old), read(new)
        assert old_names == new_names and old_values.shape == new_values.shape
        error = np.max(np.abs(new_values - old_values), axis=0)
        assert np.all(error <= 1e-14 * np.max(np.abs(old_values), axis=0)), file


@pytest.mark.parametrize(
    "name", [n if n in SHORT else pytest.param(n, marks=pytest.mark.long) for n in SCENARIOS]
)
def test_made_again_is_the_same(name: str, tmp_path: Path) -> None:
    run = SCENARIOS[name]
    write_scenario(run, tmp_path, "RPManipulator", INPUTS, outputs(run))
    assert_same(run, tmp_path)


def test_nothing_is_left_over() -> None:
    folders = [MODEL / "references" / name for name in SCENARIOS]
    assert sorted(p for p in (MODEL / "references").iterdir() if (p / FILES[0]).exists()) == folders
    for folder in folders:
        assert {path.name for path in folder.iterdir()} == set(FILES)


def test_the_program_makes_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ["make_references.py", MODEL.name, "early_start", "--output", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", arguments)
    make_references.main()
    assert_same(SCENARIOS["early_start"], tmp_path / "early_start")


def test_unknown_scenario_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["make_references.py", MODEL.name, "none"])
    with pytest.raises(SystemExit, match="^error: no reference 'none' \\(known: coasting, "):
        make_references.main()


@each_scenario
def test_files_have_the_cross_check_format(run: Scenario) -> None:
    real = [v for v in declared(MODEL.name).variables.values() if v.type == "Real"]
    kind = {
        FILES[0]: [v.name for v in real if v.causality == "output"],
        FILES[1]: [v.name for v in real if v.causality == "input"],
    }
    times = {FILES[0]: run.times[run.reference_rows], FILES[1]: run.times}
    for file, names in kind.items():
        path = run.reference_folder / file
        header = path.read_text().split("\n", 1)[0]
        assert header == ",".join(f'"{name}"' for name in ("time", *names))
        assert path.stat().st_size < 1_000_000
        values = read(path)[1]
        assert np.array_equal(values[:, 0], times[file])
        assert np.all(np.isfinite(values))
    options = dict(csv.reader((run.reference_folder / FILES[2]).read_text().splitlines()))
    assert {key: float(value) for key, value in options.items()} == {
        "StartTime": run.start,
        "StopTime": run.stop,
        "StepSize": run.steps[0] if len(run.steps) == 1 else 0.0,
        "RelTol": run.tolerance,
    }


def test_equations_agree_with_the_notes() -> None:
    """Equations (14) and (15) hold for the accelerations that follow from the positions."""
    equations = derive()
    ddq1, ddq2 = equations.accelerations
    m1, m2, i1, i2, l1, lc1, a, g = sp.symbols(PARAMETERS)
    q1, q2, dq1, dq2 = sp.symbols(STATES)
    tau1, f2 = sp.symbols(INPUTS)
    s, c = sp.sin(q1), sp.cos(q1)
    d11 = m2 * a**2 + m2 * l1**2 + 2 * m2 * l1 * q2 + m1 * lc1**2 + m2 * q2**2 + i1 + i2
    c211 = c121 = l1 * m2 + m2 * q2
    gravity1 = m1 * g * lc1 * c + m2 * g * (l1 * c - a * s + q2 * c)
    first = d11 * ddq1 - a * m2 * ddq2 + (c211 + c121) * dq1 * dq2 + gravity1 - tau1
    second = -a * m2 * ddq1 + m2 * ddq2 - c211 * dq1**2 + m2 * g * s - f2
    assert sp.simplify(first) == 0
    assert sp.simplify(second) == 0


# ---- Numbers of the notes ------------------------------------------------------------------------

# function: equations of the notes
STATED = {
    "arm_angular_jacobian": [1, 2], "arm_link1_jacobian": [3], "arm_mass_matrix": [4, 5, 6, 7, 8],
    "arm_christoffel": [9], "arm_potential_energy": [10], "arm_gravity_forces": [11],
    "arm_coriolis_matrix": [12], "arm_inverse_dynamics": [13, 14, 15], "link_motion": [16, 17, 18],
    "link2_loads": [19, 20, 24, 25], "link1_loads": [21, 22, 23], "loads_of_motion": [26, 27],
}  # fmt: skip
# such as "(4)-(8) Mass matrix", above this equation
COMMENT = re.compile(
    r"/\* (\(\d+\)(?:(?:-|, )\(\d+\))*) (?:[^*]|\*(?!/))*\*/\nstatic inline [^(]*?(\w+)\("
)


def numbers(text: str) -> list[int]:
    """Numbers of "(4)-(8)" or "(21)-(23), (27)"."""
    found = []
    for part in text.replace("(", "").replace(")", "").split(", "):
        first, _, last = part.partition("-")
        found += range(int(first), int(last or first) + 1)
    return found


def test_each_equation_of_the_notes_is_stated_once() -> None:
    texts = [(MODEL / name).read_text() for name in ("rp_equations.h", "rp_recursion.h")]
    stated = [
        (function, numbers(number)) for text in texts for number, function in COMMENT.findall(text)
    ]
    assert stated == list(STATED.items())
    assert sorted(sum(STATED.values(), [])) == list(range(1, 28))
