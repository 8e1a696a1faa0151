"""Campaign files: what they mean, and what is refused with its place and reason."""

import re
from pathlib import Path
from zipfile import ZipFile

import pytest

from rparm.campaign import bases, planning
from rparm.errors import UserError
from tests.campaign.files import ARM, HEAD, campaign, write
from tests.support.rparm_project import FMUS, Console

GRID, M2 = [("sobol", "grid"), ("runs = 40\n", "")], "[1.0, 3.0]"
Q1 = "normal = [-2.0, 0.2]"
MISTAKES = [
    ([("seed = 3", "seed = ")], "not valid TOML"),
    ([("seed = 3", "sead = 3")], "unknown key 'sead', did you mean 'seed'?"),
    ([("uniform", "unifrom")], "parameters.m2: unknown key 'unifrom', did"),
    ([('title = "Test"\n', "")], "missing key 'title'"),
    ([("seed = 3", 'seed = "a"')], "seed: expected a valid integer, got 'a'"),
    ([('scenario = "hanging_swing"\n', "")], "exactly one of scenario, system"),
    ([("hanging_swing", "hanging_swim")], "did you mean 'hanging_swing'?"),
    ([("[1.0, 3.0]", "[1.0, 3.0]\nvalues = [1.0]")], "exactly one of"),
    ([("uniform = [1.0, 3.0]", "")], "parameters.m2: expected exactly one of"),
    ([("[1.0, 3.0]", "[3.0, 1.0]")], "a lower and an upper limit"),
    ([("[1.0, 3.0]", "[1.0, inf]")], "parameters.m2.uniform[1]: expected a finite"),
    ([("[-2.0, 0.2]", "[-2.0, 0.0]")], "a positive standard deviation, got 0.0"),
    ([("uniform = [1.0", "log_uniform = [-1.0")], "expected positive limits"),
    ([("[parameters.m2]", "[parameters.m4]")], "[parameters.m4]: the model"),
    ([("[1.0, 3.0]", "[-1.0, 3.0]")], "[parameters.m2] uniform: expected at least"),
    ([("[parameters.m2]", "[parameters.ee_x]")], "is not a parameter"),
    ([("runs = 40\n", "")], "missing key 'runs'"),
    ([("runs = 40", "runs = 2000000000")], "runs: makes 2e+09, expected at most"),
    ([("block = 8", "block = 0")], "block: expected greater than or equal"),
    ([("[1.0, 3.0]", "[1.0, 3.0]\npoints = 3")], "goes with a grid only"),
    (GRID, "[parameters.m2] points: is missing, for a grid"),
    ([*GRID, (M2, f"{M2}\npoints = 0")], "parameters.m2.points: expected greater than 0, got 0"),
    ([("sobol", "indices")], "runs: expected a power of 2"),
    ([(ARM[ARM.index("final") :], "")], "[keep]: keeps nothing of a run"),
    ([('"q1", "q2"', '"q3"')], "[keep] final: the model has no variable 'q3'"),
    (
        [('"q1", "q2"', '"solver_method"')],
        "[keep] final: 'solver_method' is not a Real or Integer variable",
    ),
    (
        [('maximum = ["dq1"]', 'maximum = ["solver_steps"]')],
        "[keep] maximum: 'solver_steps' is not a Real variable",
    ),
    (
        [*GRID, (M2, f"{M2}\npoints = 3000000000"), (Q1, "values = [-2.0]")],
        "runs: makes 3e+09, expected at most 1000000000",
    ),
    (
        [*GRID, (M2, f"{M2}\npoints = {2**62}"), (Q1, f"uniform = [-2.0, 0.2]\npoints = {2**62}")],
        "runs: makes 2.127e+37, expected at most 1000000000",
    ),
    ([('["q1", "q2"]', '"q1"')], "keep.final: expected a list, got 'q1'"),
    (
        [(f"uniform = {M2}", ""), ("[parameters.m2]", "[parameters]\nm2 = 1.0")],
        "parameters.m2: expected a table, got 1.0",
    ),
    ([(f"uniform = {M2}", "values = []")], "parameters.m2.values: expected a longer list, got []"),
    ([('"Test"', '"\\u001b[2J"')], "title: expected one line of text"),
    ([("[keep]", '[derived]\ndq1 = "1 / 0"\n[keep]')], "[derived] dq1: has no value: "),
    ([("[3, 17]", "[3, 40]")], "trajectories: expected runs from 0 to 39, got 40"),
    ([("seed = 3", 'worst = ["final(q3)"]')], "worst: no column 'final(q3)'"),
    ([("[keep]", '[derived]\ndq1 = "2 * q9"\n[keep]')], "unknown name 'q9'"),
    ([("[keep]", '[derived]\ndq1 = "2 *"\n[keep]')], "[derived] dq1: column 4: expected a number"),
    ([("[keep]", '[derived]\ndq1 = "open(1)"\n[keep]')], "column 1: no function 'open'"),
    (
        [("[keep]", '[parameters.run]\nuniform = [0.0, 1.0]\n[derived]\ndq1 = "run"\n[keep]')],
        "[parameters.run]: every table has a column of that name",
    ),
    (
        [("[keep]", '[derived]\nfailure = "1"\ndq1 = "failure"\n[keep]')],
        "[derived] failure: every table has a column of that name",
    ),
    ([("[keep]", "[set]\nm2 = 1.0\n[keep]")], "[set] m2: is in [parameters]"),
    ([("[keep]", "[set]\nm1 = -1.0\n[keep]")], "[set] m1: expected at least 0.0 kg"),
    ([("stop = 1.0", "stop = -1.0")], "[time] stop: expected a time after start"),
]


@pytest.mark.parametrize(("changes", "expected"), MISTAKES)
def test_a_mistake_is_refused(
    changes: list[tuple[str, str]], expected: str, tmp_path: Path, console: Console
) -> None:
    path, output = write(tmp_path, changes=changes), tmp_path / "output"
    error = console.refused("campaign", path, "--output", output)
    assert str(path) in error and expected in error
    assert not output.exists()


def test_the_file_that_the_mistakes_are_made_in_is_right(tmp_path: Path) -> None:
    given = campaign(tmp_path)
    with bases.opened(given, None) as base:
        job = planning.plan(given, base, "test")
    assert [name for name, _ in job.targets] == ["m2", "q1"]
    assert job.steps == 200 and job.stop == 1.0
    assert [m.column for m in job.measures][:2] == ["final(q1)", "final(q2)"]


SYSTEM = (
    HEAD
    + """system = "closed_loop"
variant = "nominal"
sampling = "random"
runs = 2
[parameters."arm.m2"]
uniform = [0.9, 1.1]
[keep]
final = ["arm.q1"]
"""
)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("closed_loop", "close_loop", "did you mean 'closed_loop'?"),
        ("nominal", "nominell", "did you mean 'nominal'?"),
        ('variant = "nominal"\n', "", "variant: missing key 'variant' (known: nominal, heavy"),
        ('system = "closed_loop"', 'scenario = "hanging_swing"', "variant: goes with system"),
        ("closed_loop", "none.ssp", "none.ssp: no such file"),
        ("arm.m2", "arm.m3", "the system has no variable 'arm.m3'"),
        ("arm.m2", "arm.tau1", "'arm.tau1' is not a parameter"),
        ("arm.q1", "q1", "the system has no variable 'q1'"),
        ("final", "lyapunov = true\nfinal", "lyapunov: goes with a scenario only"),
    ],
)
def test_a_mistake_of_a_system_is_refused(
    old: str, new: str, expected: str, tmp_path: Path
) -> None:
    with (
        pytest.raises(UserError, match=re.escape(expected)),
        bases.opened(given := campaign(tmp_path, SYSTEM, [(old, new)]), None) as base,
    ):
        planning.plan(given, base, "test")


def test_a_damaged_binary_is_that_of_the_file_of_the_user(tmp_path: Path, console: Console) -> None:
    fmu = tmp_path / "mine.fmu"
    with ZipFile(FMUS["rp_manipulator"]) as archive, ZipFile(fmu, "w") as copy:
        for name in archive.namelist():
            content = archive.read(name)
            copy.writestr(name, content[:64] + bytes(999) if name.endswith(".so") else content)
    assert console.failed("campaign", write(tmp_path), "--fmu", fmu).startswith(f"error: {fmu}: ")


def test_blocks_cover_all_runs(tmp_path: Path) -> None:
    given = campaign(tmp_path, changes=[("runs = 40", "runs = 43")])
    runs = [run for block in range(given.blocks) for run in given.block_range(block)]
    assert runs == list(range(43))


def test_a_run_is_counted_by_the_sampling(tmp_path: Path) -> None:
    assert campaign(tmp_path, changes=[("sobol", "indices"), ("40", "32")]).count == 32 * 4
    grid = [*GRID, (M2, f"{M2}\npoints = 20"), (Q1, "values = [1.0, 2.0]")]
    assert campaign(tmp_path, changes=grid).count == 40
