"""The benchmark runs, and all solvers do the same work. Times are not tested."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

import by_models
import compare
from by_heyoka import STATES

BUILD = Path(os.environ["RP_BUILD"])
BENCH = [str(path) for path in (BUILD / "tests/bench/bench", *compare.libraries(BUILD))]
METHODS = {"cvode_adams", "cvode_bdf", "erk", "taylor"}


@pytest.fixture(scope="module")
def result() -> dict:
    """Everything that bench measures, in short."""
    found = compare.run_bench(BENCH, "--repeats", "1")
    return found | {"rows": compare.judge(compare.compared(found["rows"]))}


def test_bench_writes_every_group(result: dict) -> None:
    assert {row["group"] for row in result["rows"]} == {*compare.GROUPS} - {"models"}
    assert result["repeats"] == 1
    assert result["machine"]["MuJoCo"], "MuJoCo is a requirement of the tests"
    runs = {
        group: {row["run"] for row in result["rows"] if row["group"] == group}
        for group in compare.GROUPS
    }
    assert runs["steps"] >= METHODS | {"plain loop", "MuJoCo RK4", "MuJoCo implicitfast"}
    assert runs["life"] == runs["plant"] == METHODS


def test_every_method_does_every_work(result: dict) -> None:
    rows = [row for row in result["rows"] if row["group"] == "steps"]
    works = (*compare.CHANGING, *compare.OTHERS, *compare.FREE.values())
    assert {row["work"] for row in rows} == {work.name for work in works}
    for work in works:
        row = compare.find(rows, work.name, "taylor")
        assert (row["step"], row["steps"]) == (work.step, work.steps)
        if work is not compare.FREE[1e-14]:
            assert {row["run"] for row in rows if row["work"] == work.name} >= METHODS
    for work in (*compare.CHANGING, *compare.OTHERS[:2]):
        compare.find(rows, work.name, "taylor, FMI 3.0")


def test_figures_are_finite_and_targets_judged(result: dict) -> None:
    judged = [row for row in result["rows"] if "judged" in row]
    assert len(judged) > 40
    assert compare.find(judged, compare.CHANGING[0].name, "error of taylor")["met"]
    for row in result["rows"]:
        numbers = [value for value in row.values() if isinstance(value, float | int)]
        assert all(map(math.isfinite, numbers)), row
        assert all(row.get(name, 1.0) >= 0.0 for name in ("us", "ratio", "error")), row
        assert row.get("met") == (row[row["judged"]] <= row["limit"] if "judged" in row else None)


def test_errors_of_the_fmu_are_those_of_its_tolerance(result: dict) -> None:
    rows = [row for row in result["rows"] if "effective_tolerance" in row]
    assert len(rows) > 40
    for row in rows:
        # the references of the scenarios: 20 times the tolerance
        assert row["error"] <= 20.0 * row["tolerance"], row


def test_free_motion_meets_the_error_asked_for(result: dict) -> None:
    for bound, count in ((1e-8, 6), (1e-14, 1)):
        work = compare.FREE[bound].name
        rows = [row for row in result["rows"] if row["work"] == work]
        assert len(rows) == count
        assert all(row["error"] <= bound for row in rows)


def test_both_references_agree(result: dict) -> None:
    for work in (*compare.CHANGING, *compare.OTHERS, *compare.FREE.values()):
        row = compare.find(result["rows"], work.name, "taylor")
        end = np.array([row[f"end_{name}"] for name in STATES])
        largest = np.maximum(np.abs(work.reference).max(axis=0), 1e-3)
        # errors down to 1e-14 are measured by it
        assert np.abs((end - work.reference[-1]) / largest).max() <= 1e-15


def test_both_versions_of_fmi_do_the_same(result: dict) -> None:
    for work in compare.CHANGING:
        for method in ("cvode_adams", "erk", "taylor"):
            older = compare.find(result["rows"], work.name, method)
            newer = compare.find(result["rows"], work.name, f"{method}, FMI 3.0")
            for figure in ("error", "effective_tolerance", "internal_steps", "evaluations"):
                assert newer[figure] == older[figure]
            row = compare.find(result["rows"], work.name, f"{method}, FMI 3.0 to {method}")
            assert row["ratio"] > 0.0
            assert row["limit"] == 1.05


def test_peers_are_tuned_and_compared(result: dict) -> None:
    peer = compare.heyoka_like("taylor", compare.FREE[1e-8], result["rows"])
    bound = compare.find(result["rows"], compare.FREE[1e-8].name, "taylor")["error"]
    assert peer.error() <= bound
    peer.tolerance *= 10.0**0.25
    assert peer.error() > bound


def test_heyoka_has_its_rows(result: dict) -> None:
    peers = compare.make_peers(result["rows"])
    names = {
        work: {peer.name for peer in peers if peer.work.name == work}
        for work in {peer.work.name for peer in peers}
    }
    equal = "heyoka, error no larger than taylor's"
    for work in (*compare.CHANGING, *compare.OTHERS, compare.FREE[1e-8]):
        assert equal in names[work.name]
    for work in (*compare.CHANGING, *compare.FREE.values()):
        assert "heyoka" in names[work.name]

    rows = compare.judge(compare.take_rounds(BENCH, peers, 1, 1))
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


def test_program_refuses_nonsense() -> None:
    for options in (["--only", "nothing"], ["--repeats", "0"], ["--repeats"], ["--fast"]):
        with pytest.raises(subprocess.CalledProcessError):
            compare.run_bench(BENCH, *options)


def test_models_in_equations_do_the_same_as_their_peers() -> None:
    loops = BUILD / "tests/bench/libbench_loops.so"
    stars, *others, chain, adams, bdf, restarts = by_models.rows(1, loops)
    assert stars["error_of_peer"] <= stars["error"] < 1e-10
    assert all(row["error_of_peer"] <= row["error"] < 1e-8 for row in others)
    assert max(chain["error"], chain["error_of_peer"]) < 1e-3
    for row, bound in ((adams, 1e-6), (bdf, 1e-6), (restarts, 1e-4)):
        assert max(row["error"], row["error_of_peer"]) < bound
        assert 0.1 < row["error"] / row["error_of_peer"] < 10.0
    rows = json.loads(json.dumps(compare.judge([stars, chain])))  # as the report has them
    table = compare.summary({"rows": rows})
    assert f"| {stars['run']} |  |  |  |  |  | {compare.number(stars['ratio'])} |" in table
