"""The benchmark runs, and all solvers do the same work. Times are not tested."""

import json
import math
import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import by_gradients
import by_models
import by_systems
import compare
from solvers import Solvers

BUILD = Path(os.environ["RP_BUILD"])
METHODS = {"cvode_adams", "cvode_bdf", "erk", "taylor"}


@pytest.fixture(scope="module")
def solvers() -> Solvers:
    return Solvers(BUILD)


@pytest.fixture(scope="module")
def rows(solvers: Solvers) -> list[dict]:
    """Everything but heyoka and the models in equations, in one turn."""
    steps = compare.rows_of([*compare.in_steps(solvers), *compare.in_free_motion(solvers)])
    rest = [*compare.plant_rows(solvers, 1), *compare.life_rows(solvers, 1)]
    return compare.judge([*compare.compared(steps), *rest])


def test_all_methods_and_peers_have_their_rows(rows: list[dict], solvers: Solvers) -> None:
    assert solvers.mujoco_version, "MuJoCo is a requirement of the tests"
    assert {row["group"] for row in rows} == {*compare.GROUPS} - {"models", "gradients", "loop"}
    runs = {group: {x["run"] for x in rows if x["group"] == group} for group in compare.GROUPS}
    assert runs["steps"] >= METHODS | {"plain loop", "MuJoCo RK4", "MuJoCo implicitfast"}
    assert runs["life"] == runs["plant"] == METHODS
    for work in (*compare.CHANGING, *compare.OTHERS, compare.FREE[1e-8]):
        assert {row["run"] for row in rows if row["work"] == work.name} >= METHODS
    assert len([row for row in rows if "judged" in row]) > 40
    assert compare.find(rows, compare.CHANGING[0].name, "error of taylor")["met"]


def test_figures_are_finite(rows: list[dict]) -> None:
    for row in rows:
        numbers = [value for value in row.values() if isinstance(value, float | int)]
        assert all(map(math.isfinite, numbers)), row
        assert all(row.get(name, 1.0) >= 0.0 for name in ("us", "ratio", "error")), row


def test_a_bounce_in_each_step_is_one_event(rows: list[dict]) -> None:
    bounces = [row for row in rows if row["work"] == "a bounce in each step"]
    assert [row["events"] for row in bounces] == [1000] * 4


def test_errors_of_the_fmu_are_those_of_its_tolerance(rows: list[dict]) -> None:
    of_fmu = [row for row in rows if "effective_tolerance" in row]
    assert len(of_fmu) > 40
    for row in of_fmu:
        # the references of the scenarios: 20 times the tolerance
        assert row["error"] <= 20.0 * row["tolerance"], row


def test_free_motion_meets_the_error_asked_for(rows: list[dict]) -> None:
    for bound, count in ((1e-8, 6), (1e-14, 1)):
        work = compare.FREE[bound].name
        errors = [row["error"] for row in rows if row["work"] == work and "us" in row]
        assert len(errors) == count and max(errors) <= bound


def test_another_method_comes_near_the_reference(rows: list[dict]) -> None:
    """The reference is by series, in extended precision; erk is a Runge-Kutta method."""
    assert compare.find(rows, compare.C1, "erk")["error"] <= 1e-14


def test_both_versions_of_fmi_do_the_same(rows: list[dict]) -> None:
    for work in compare.CHANGING:
        for method in ("cvode_adams", "erk", "taylor"):
            older = compare.find(rows, work.name, method)
            newer = compare.find(rows, work.name, f"{method}, FMI 3.0")
            for figure in ("error", "effective_tolerance", "internal_steps", "evaluations"):
                assert newer[figure] == older[figure]
            row = compare.find(rows, work.name, f"{method}, FMI 3.0 to {method}")
            assert row["ratio"] > 0.0
            assert row["limit"] == 1.05


def test_peers_are_tuned_and_compared(rows: list[dict]) -> None:
    peer = compare.heyoka_like("taylor", compare.FREE[1e-8], rows)
    bound = compare.find(rows, compare.FREE[1e-8].name, "taylor")["error"]
    assert peer.error() <= bound
    peer.tolerance *= 10.0**0.25
    assert peer.error() > bound


def test_heyoka_has_its_rows(rows: list[dict], solvers: Solvers) -> None:
    peers = compare.make_peers(rows)
    names = {
        work: {peer.name for peer in peers if peer.work.name == work}
        for work in {peer.work.name for peer in peers}
    }
    equal = "heyoka, error no larger than taylor's"
    for work in (*compare.CHANGING, *compare.OTHERS, compare.FREE[1e-8]):
        assert equal in names[work.name]
    for work in (*compare.CHANGING, *compare.FREE.values()):
        assert "heyoka" in names[work.name]

    others = [*compare.in_steps(solvers), *compare.in_free_motion(solvers)]
    rows = compare.judge(compare.take_rounds([*others, *peers], 1))
    for bound, work in compare.FREE.items():
        row = compare.find(rows, work.name, "taylor to heyoka")
        assert (row["judged"], row["limit"]) == ("ratio", 0.9)
        assert max(row["error"], row["error_of_peer"]) <= bound
        assert row["met"] == (row["ratio"] <= 0.9)
    assert compare.find(rows, compare.FREE[1e-8].name, "erk to heyoka")["limit"] == 8.0
    for work in (*compare.CHANGING, *compare.OTHERS):
        row = compare.find(rows, work.name, f"taylor to {equal}")
        assert row["error_of_peer"] <= max(row["error"], compare.ROUNDING)
        assert "judged" not in row


def test_models_in_equations_do_the_same_as_their_peers(solvers: Solvers) -> None:
    found = by_models.rows(1, solvers.library)
    stars, *others, chain, adams, bdf, restarts = found
    assert stars["error_of_peer"] <= stars["error"] < 1e-10
    assert all(row["error_of_peer"] <= row["error"] < 1e-8 for row in others)
    assert max(chain["error"], chain["error_of_peer"]) < 1e-3
    for row, bound in ((adams, 1e-6), (bdf, 1e-6), (restarts, 1e-4)):
        assert max(row["error"], row["error_of_peer"]) < bound
        assert 0.1 < row["error"] / row["error_of_peer"] < 10.0
    rows = json.loads(json.dumps(compare.judge([stars, chain])))  # as the report has them
    table = compare.summary({"rows": rows})
    assert f"| {stars['run']} |  |  |  |  |  | {compare.number(stars['ratio'])} |" in table


def test_gradients_are_measured_for_all_methods() -> None:
    found = compare.judge(by_gradients.rows(1))
    wanted = {(method, f"gradients by {n}") for method in METHODS for n in (1, 5, 20)}
    assert {(row["run"], row["work"]) for row in found} == wanted
    assert all(0.0 < row["ratio"] < 42.0 for row in found if row["run"] == "cvode_bdf")
    assert "gradients by 20: taylor" in "\n".join(compare.of_group(found, "gradients"))


def test_the_loop_is_measured_against_what_it_calls(solvers: Solvers, tmp_path: Path) -> None:
    found = compare.judge(by_systems.rows(1, BUILD, tmp_path, solvers))
    assert [row["us"] > 0.0 for row in found] == [True] * 4
    assert "rparm.simulate to a loop in C" in "\n".join(compare.of_group(found, "loop"))
