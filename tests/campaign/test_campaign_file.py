"""Campaign files: mistakes with place and reason; values with units; scenarios with logs."""

import math
import re
from operator import itemgetter
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from rparm.campaign import bases, planning
from rparm.campaign.campaign_file import Campaign
from rparm.campaign.planning import Points
from rparm.errors import UserError
from tests.campaign.files import ARM, FILES, HEAD, MISTAKES, campaign, write
from tests.campaign.runners import rows, runner
from tests.support.rparm_project import BUILD, FMUS, Console, assert_one_line

GRID, M2 = [("sobol", "grid"), ("runs = 40\n", "")], "[1.0, 3.0]"
Q1 = "normal = [-2.0, 0.2]"


def wrong(folder: Path, row: list[str]) -> Path:
    """The file of a row of mistakes."""
    return write(folder, changes=list(zip(row[:-1:2], row[1::2], strict=True)))


@pytest.mark.parametrize("row", MISTAKES["arm"]["rows"], ids=itemgetter(-1))
def test_a_mistake_is_refused(row: list[str], tmp_path: Path, console: Console) -> None:
    path, output = wrong(tmp_path, row), tmp_path / "output"
    error = console.refused("campaign", path, "--output", output)
    assert str(path) in error and row[-1] in error
    assert not output.exists()


def test_the_file_that_the_mistakes_are_made_in_is_right(tmp_path: Path) -> None:
    given = campaign(tmp_path)
    with bases.opened(given, None) as base:
        job = planning.plan(given, base, "test")
    assert [name for name, _ in job.targets] == ["m2", "q1"]
    assert job.steps == 200 and job.stop == 1.0
    assert [m.column for m in job.measures][:2] == ["final(q1)", "final(q2)"]


SYSTEM = HEAD + FILES["SYSTEM"]


@pytest.mark.parametrize(("old", "new", "message"), MISTAKES["system"]["rows"])
def test_a_mistake_of_a_system_is_refused(old: str, new: str, message: str, tmp_path: Path) -> None:
    with (
        pytest.raises(UserError, match=re.escape(message)),
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


# ---- Values with units ---------------------------------------------------------------------------


RIGHT_ANGLE = repr(math.pi / 2)
# with units, and the same in SI
PAIRS = [
    (
        "normal = [-2.0, 0.2]",
        'normal = ["-90 deg", "5deg"]',
        f"[-{RIGHT_ANGLE}, {math.radians(5)}]",
    ),
    ("normal = [-2.0, 0.2]", 'uniform = ["-90 deg", 0.5]', f"[-{RIGHT_ANGLE}, 0.5]"),
    ("normal = [-2.0, 0.2]", 'values = ["30 deg", "1 rad"]', f"[{math.radians(30)}, 1.0]"),
    ("stop = 1.0", 'stop = "1000 ms"', "1.0"),
    ("[keep]", '[set]\nq2 = "300 mm"\n[keep]', "0.3"),
    (
        "[keep]",
        '[keep.settling.s]\nvariable = "q1"\ntarget = "90 deg"\nband = "1 deg"\n[keep]',
        f"{RIGHT_ANGLE} {math.radians(1)}",
    ),
    ("[keep]", '[keep.crossings.c]\nvariable = "q2"\nlevel = "5 mm"\n[keep]', "0.005"),
]


def converted(given: Campaign) -> Campaign:
    with bases.opened(given, FMUS["rp_manipulator"]) as base:
        return bases.in_si(given, base, "test")


@pytest.mark.parametrize(("old", "new", "numbers"), PAIRS)
def test_a_value_with_a_unit_is_the_number_in_si(
    old: str, new: str, numbers: str, tmp_path: Path
) -> None:
    with_units = campaign(tmp_path, changes=[(old, new)])
    numbers_left, plain = iter(numbers.strip("[]").replace(",", " ").split()), new
    for text in new.split('"')[1::2]:
        if text[-1] != "]" and text[0] in "-0123456789":
            plain = plain.replace(f'"{text}"', next(numbers_left), 1)
    expected = campaign(tmp_path, changes=[(old, plain)])
    assert converted(with_units) == converted(expected) == expected


def test_the_points_of_a_grid(tmp_path: Path) -> None:
    changes = [("sobol", "grid"), ("runs = 40\n", ""), ("[1.0, 3.0]", "[1.0, 3.0]\npoints = 5")]
    grid = 'uniform = ["-180 deg", "90 deg"]\npoints = 4'
    given = converted(campaign(tmp_path, changes=[*changes, ("normal = [-2.0, 0.2]", grid)]))
    angles = Points(given, {}).of(range(4))[:, 1]
    assert angles == pytest.approx([-math.pi, -math.pi / 2, 0.0, math.pi / 2], abs=1e-15)
    assert (angles[0], angles[3]) == (-math.pi, math.pi / 2)


@pytest.mark.parametrize(("old", "new", "message"), MISTAKES["units"]["rows"])
def test_mistakes_get_one_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(UserError) as caught:
        converted(campaign(tmp_path, changes=[(old, new)]))
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_a_system_takes_units_too(tmp_path: Path) -> None:
    text = HEAD + (
        'system = "closed_loop"\nvariant = "nominal"\nsampling = "random"\nruns = 2\n'
        "[set]\n'arm.q1' = '-90 deg'\n[parameters.'arm.a']\nuniform = ['50 mm', 0.1]\n"
        "[keep]\nfinal = ['arm.q1']\n"
    )
    given = campaign(tmp_path, text)
    with bases.opened(given, BUILD / "ClosedLoop.ssp") as base:
        in_si = bases.in_si(given, base, "test")
    assert in_si.set == {"arm.q1": -math.pi / 2}
    assert in_si.parameters["arm.a"].numbers == [0.05, 0.1]


def test_an_angle_beyond_a_turn_is_asked_about(tmp_path: Path, console: Console) -> None:
    changes = [("[-2.0, 0.2]", "[90, 0.2]"), ("[1.0, 3.0]", '["1 lb", 2.0]')]
    path = write(tmp_path, changes=changes)
    code, _, err = console("campaign", path, "--fmu", FMUS["rp_manipulator"])
    asked, error = err.splitlines(keepends=True)
    assert code == 2
    assert asked.endswith("[parameters.q1]: 90 rad is 14.3 turns, is that meant? In degrees it is "
                          '"90 deg".\n')  # fmt: skip
    assert "[parameters.m2] uniform: unknown unit 'lb'" in error
    assert_one_line(error)


def test_a_campaign_runs_with_the_log_of_its_scenario(project: Path, tmp_path: Path) -> None:
    """A slide without gravity at f2 = 2 t, held over steps h: m2 dq2 is h times the sum of f2."""
    folder = project / "models" / "rp_manipulator" / "scenarios"
    (folder / "pushed.toml").write_text(
        "title = 'A'\ndescription = 'B'\ntolerance = 1e-10\n"
        "[time]\nstart = 0\nstop = 1\nstep = 0.125\n[parameters]\ng = 0\na = 0\n"
        "[inputs.f2]\nfile = 'log.csv'\ncolumn = 'f'\nscale = '1 kN'\n",
        encoding="utf-8",
    )
    (folder / "log.csv").write_text("time,f\n0,0\n1,0.002\n", encoding="utf-8")
    text = ARM.replace("hanging_swing", "pushed").replace("time = { stop = 1.0 }\n", "")
    text = text.replace('["q1", "q2"]', '["dq2"]').replace("trajectories = [3, 17]", "")
    given = campaign(tmp_path, text)
    with runner(given, tmp_path, fmu=FMUS["rp_manipulator"]) as (runs, job, points):
        found = rows(runs, job, points, range(3)).measures[:, 0]
        masses = points.of(range(3))[:, 0]
    impulse = 0.125 * np.sum(2 * np.arange(0, 1, 0.125))
    assert found == pytest.approx(impulse / masses, rel=1e-8)
    late = campaign(tmp_path, text.replace("seed = 3", "seed = 3\ntime = { stop = 9 }"))
    with (
        pytest.raises(
            UserError, match=r"f2\]: .*log\.csv: ends at 1\.0 s, the run needs it .* to 8"
        ),
        bases.opened(late, FMUS["rp_manipulator"]),
    ):
        pass
