"""Points of the runs: they follow their distributions, whatever blocks they are made in."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from rparm.campaign.campaign_file import Distribution, grid_value
from rparm.campaign.planning import Points, Sampler
from tests.campaign.files import ARM, campaign

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
