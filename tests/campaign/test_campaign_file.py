"""Campaign files: mistakes, values with units, logs; the points that follow from them."""

import math
import re
from operator import itemgetter
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from scipy import stats

from rparm.campaign import bases, planning
from rparm.campaign.campaign_file import Campaign, Distribution, grid_value
from rparm.campaign.planning import Points, Sampler
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


# ---- Points of the runs --------------------------------------------------------------------------


SAMPLINGS = ("random", "sobol", "latin", "indices")
PARAMETERS = """[parameters.x]
uniform = [2.0, 5.0]
[parameters.y]
log_uniform = [0.01, 100.0]
[parameters.z]
normal = [1.0, 0.5]
[parameters.w]
values = [1.0, 4.0, 9.0]
"""
TEXT = ARM[: ARM.index("[parameters.m2]")] + PARAMETERS + ARM[ARM.index("[keep]") :]


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_points_do_not_depend_on_the_blocks(sampling: str, tmp_path: Path) -> None:
    given = campaign(tmp_path, TEXT, [("sobol", sampling), ("40", "64")])
    whole = Sampler(given).points(range(given.count))
    for size in (1, 7, 50):
        parts = [
            Sampler(given).points(range(i, min(i + size, given.count)))
            for i in range(0, given.count, size)
        ]
        assert np.array_equal(np.concatenate(parts), whole)
    sampler = Sampler(given)  # in another order
    for first in (40, 10, 12, 3, 60):
        assert np.array_equal(sampler.points(range(first, first + 2)), whole[first : first + 2])


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_another_seed_makes_other_points(sampling: str, tmp_path: Path) -> None:
    changes = [("sobol", sampling), ("40", "64")]
    first = Sampler(campaign(tmp_path, TEXT, changes)).points(range(10))
    other = campaign(tmp_path, TEXT, [*changes, ("seed = 3", "seed = 4")])
    assert not np.isin(Sampler(other).points(range(10))[:, :3], first).any()


@pytest.mark.parametrize("sampling", ("random", "sobol", "latin"))
def test_points_follow_their_distributions(sampling: str, tmp_path: Path) -> None:
    given = campaign(tmp_path, TEXT, [("sobol", sampling), ("40", "4096")])
    x, y, z, w = Sampler(given).points(range(4096)).T
    for values, distribution in (
        (x, stats.uniform(2, 3)),
        (y, stats.loguniform(0.01, 100)),
        (z, stats.norm(1, 0.5)),
    ):
        assert stats.kstest(values, distribution.cdf).pvalue > 1e-3
    counts = [np.count_nonzero(w == value) for value in (1, 4, 9)]
    assert sum(counts) == 4096 and stats.chisquare(counts).pvalue > 1e-3
    assert abs(stats.spearmanr(x, z).statistic) < 0.06


def test_a_latin_hypercube_has_a_point_in_every_slice(tmp_path: Path) -> None:
    given = campaign(tmp_path, TEXT, [("sobol", "latin")])
    x = Sampler(given).points(range(40))[:, 0]
    assert sorted(np.floor((x - 2) / 3 * 40).astype(int)) == list(range(40))


def test_a_grid_is_all_combinations(tmp_path: Path) -> None:
    changes = [("sobol", "grid"), ("runs = 40\n", ""), ("5.0]", "5.0]\npoints = 4")]
    changes += [("100.0]", "100.0]\npoints = 5"), ("normal = [1.0, 0.5]", "values = [7.0]")]
    given = campaign(tmp_path, TEXT, changes)
    points = Sampler(given).points(range(given.count))
    assert given.count == 60 and len(np.unique(points, axis=0)) == 60
    assert np.allclose(np.unique(points[:, 0]), [2, 3, 4, 5])
    assert np.allclose(np.unique(points[:, 1]), [0.01, 0.1, 1, 10, 100])
    assert np.array_equal(points[:3, 3], [1, 4, 9])


@pytest.mark.parametrize("kind", ["uniform", "log_uniform"])
def test_a_grid_has_both_limits_to_the_bit(kind: str) -> None:
    random = np.random.default_rng(1)
    for size in random.integers(2, 9, 2000).tolist():
        low, high = sorted(random.uniform(0.1, 5.0, 2).tolist())
        axis = Distribution.model_validate({kind: [low, high], "points": size})
        found = [grid_value(axis, place) for place in range(size)]
        assert found[0] == low and found[-1] == high
        assert found == sorted(found)


def test_blocks_of_a_long_grid_need_no_memory_for_it(tmp_path: Path) -> None:
    changes = [("sobol", "grid"), ("runs = 40\n", ""), ("5.0]", "5.0]\npoints = 1000000000")]
    changes += [("log_uniform = [0.01, 100.0]", "values = [1.0]")]
    changes += [("normal = [1.0, 0.5]", "values = [7.0]"), ("[1.0, 4.0, 9.0]", "[1.0]")]
    last = Sampler(campaign(tmp_path, TEXT, changes)).points(range(10**9 - 3, 10**9))
    assert last[-1, 0] == 5.0
    assert np.allclose(np.diff(last[:, 0]), 3e-9, rtol=1e-6)


def test_groups_for_indices_differ_in_one_parameter(tmp_path: Path) -> None:
    given = campaign(tmp_path, TEXT, [("sobol", "indices"), ("40", "64")])
    groups = Sampler(given).points(range(given.count)).reshape(64, 6, 4)[:, :, :3]
    for i in range(3):
        differing = groups[:, 1 + i] != groups[:, 0]
        assert np.array_equal(differing, np.tile(np.arange(3) == i, (64, 1)))


def test_derived_values(tmp_path: Path) -> None:
    derived = '[derived]\na = "x + g"\nb = "sqrt(a - 12.0)"\n[keep]'
    given = campaign(tmp_path, TEXT, [("[keep]", derived)])
    points = Points(given, {"g": 9.0})
    assert points.names == ["x", "y", "z", "w", "a", "b"]
    rows = points.of(range(40))
    assert np.array_equal(rows[:, 4], rows[:, 0] + 9)
    below = rows[:, 4] < 12
    assert 0 < np.count_nonzero(below) < 40
    assert np.isnan(rows[below, 5]).all()
    assert np.array_equal(rows[~below, 5], np.sqrt(rows[~below, 4] - 12))
