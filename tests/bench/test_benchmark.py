"""The benchmark runs, and all solvers do the same work. Times are not tested."""

from __future__ import annotations

import json
import math
import operator
import os
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

import arm
import compare
import peers
import table

BUILD = Path(os.environ["RP_BUILD"])
FMU = BUILD / "RPManipulator.fmu"
BENCH = [str(path) for path in (BUILD / "tests/bench/bench", *compare.libraries(BUILD))]
GROUPS = {"steps", "against", "instances", "threads", "life", "plant"}
METHODS = {"cvode_adams", "cvode_bdf", "erk", "taylor"}
SHORT = arm.Work("1 ms steps, inputs changing", 1e-3, 50, "changing")
FREE = arm.Work("one step of 2 s, free motion", 2.0, 1, "zero")


@pytest.fixture(scope="module")
def result() -> dict:
    """Everything that bench measures, in short."""
    found = compare.run_bench(BENCH, "--quick", "--repeats", "1")
    return found | {"rows": compare.judge(compare.compared(found["rows"]))}


@pytest.fixture(scope="module")
def loaded_fmus(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[peers.LoadedFmu, peers.LoadedFmu]:
    """The FMU and that of pythonfmu."""
    folder = tmp_path_factory.mktemp("loaded_fmus")
    plant = peers.build_python_plant(folder)
    return peers.LoadedFmu(FMU, folder / "own"), peers.LoadedFmu(plant, folder / "plant")


def test_bench_writes_every_group(result: dict) -> None:
    assert {row["group"] for row in result["rows"]} == GROUPS
    assert result["repeats"] == 1
    assert result["machine"]["MuJoCo"], "MuJoCo is a requirement of the tests"
    runs = {
        group: {row["run"] for row in result["rows"] if row["group"] == group} for group in GROUPS
    }
    assert runs["steps"] >= METHODS | {"plain loop", "MuJoCo RK4", "MuJoCo implicitfast"}
    assert runs["life"] == runs["plant"] == METHODS
    assert runs["instances"] == runs["threads"] == METHODS - {"cvode_bdf"}


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


def test_targets_are_judged(result: dict) -> None:
    judged = [row for row in result["rows"] if "judged" in row]
    assert len(judged) > 40
    for row in judged:
        compared = {"<=": operator.le, ">=": operator.ge}[row["comparison"]]
        assert row["met"] == compared(row[row["judged"]], row["limit"]), row
    assert compare.find(judged, compare.CHANGING[0].name, "error of taylor")["met"]


def test_figures_are_finite(result: dict) -> None:
    for row in result["rows"]:
        numbers = {k: v for k, v in row.items() if isinstance(v, float | int)}
        assert all(math.isfinite(value) for value in numbers.values()), row
        assert all(row.get(name, 1.0) >= 0.0 for name in ("us", "ratio", "error")), row
        assert ("judged" in row) == ("met" in row)


def test_errors_of_the_fmu_are_those_of_its_tolerance(result: dict) -> None:
    rows = [row for row in result["rows"] if "effective_tolerance" in row]
    assert len(rows) > 40
    for row in rows:
        # the references of the scenarios: 20 times the tolerance
        assert row["error"] <= 20.0 * row["tolerance"], row
    for row in result["rows"]:
        if row["group"] in ("instances", "threads"):
            assert row["error"] <= 2e-7, row


def test_free_motion_meets_the_error_asked_for(result: dict) -> None:
    for bound, count in ((1e-8, 6), (1e-14, 1)):
        work = compare.FREE[bound].name
        rows = [row for row in result["rows"] if row["work"] == work]
        assert len(rows) == count
        assert all(row["error"] <= bound for row in rows)


def test_both_references_agree(result: dict) -> None:
    for work in (*compare.CHANGING, *compare.OTHERS, *compare.FREE.values()):
        row = compare.find(result["rows"], work.name, "taylor")
        end = np.array([row[f"end_{name}"] for name in arm.STATES])
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
    assert peer.work.error(peer.run(peer.work, peer.tolerance)[1]) <= bound
    coarser = peer.run(peer.work, peer.tolerance * 10.0**0.25)[1]
    assert peer.work.error(coarser) > bound


def test_python_peers_have_their_rows(
    result: dict, loaded_fmus: tuple[peers.LoadedFmu, peers.LoadedFmu]
) -> None:
    all_peers = compare.make_peers(FMU, *loaded_fmus, result["rows"])
    names = {
        work: {peer.name for peer in all_peers if peer.work.name == work}
        for work in {peer.work.name for peer in all_peers}
    }
    equal = "heyoka, error no larger than taylor's"
    for work in (*compare.CHANGING, *compare.OTHERS, compare.FREE[1e-8]):
        assert equal in names[work.name]
    for work in (*compare.CHANGING, *compare.FREE.values()):
        assert names[work.name] >= {"heyoka", "taylor, by fmpy"}
    for work in compare.CHANGING:
        assert "cvode_adams, by rparm" in names[work.name]

    peers_of_comparisons = [peer for peer in all_peers if peer.name.startswith("heyoka")]
    rows = compare.judge(compare.take_rounds(BENCH, peers_of_comparisons, 1, 1))
    for bound, work in compare.FREE.items():
        row = compare.find(rows, work.name, "taylor to heyoka")
        assert (row["judged"], row["comparison"], row["limit"]) == ("ratio", "<=", 0.9)
        assert max(row["error"], row["error_of_peer"]) <= bound
        assert row["met"] == (row["ratio"] <= 0.9)
    assert compare.find(rows, compare.FREE[1e-8].name, "erk to heyoka")["limit"] == 8.0
    for work in (*compare.CHANGING, *compare.OTHERS):
        row = compare.find(rows, work.name, f"taylor to {equal}")
        assert row["error_of_peer"] <= max(row["error"], compare.ROUNDING)
        assert "judged" not in row


def test_program_refuses_nonsense() -> None:
    for options in (["--only", "nothing"], ["--repeats", "0"], ["--repeats"], ["--fast"]):
        with pytest.raises(compare.subprocess.CalledProcessError):
            compare.run_bench(BENCH, *options)


def test_python_peers_do_the_same_work(
    loaded_fmus: tuple[peers.LoadedFmu, peers.LoadedFmu],
) -> None:
    own, plant = loaded_fmus
    # tolerance 1e-8: errors as measured, times five or more
    bounds = [
        (lambda work: peers.run_heyoka(work, 1e-10), 1e-10, 1e-8),
        (lambda work: peers.run_dop853(work, 1e-10), 1e-10, 1e-8),
        (lambda work: peers.run_model_exchange(own, work, 1e-8), 2e-4, 2e-5),
        (lambda work: peers.run_co_simulation(own, work, 1e-8, 1), 2e-8, 2e-8),
        (lambda work: peers.run_compiled(FMU, work, 1e-8), 2e-8, 2e-8),
        (lambda work: peers.run_co_simulation(own, work, 1e-8, 3), 1e-10, 1e-10),
        (lambda work: peers.run_co_simulation(own, work, 1e-8, 4), 1e-10, 1e-9),
        (lambda work: peers.run_co_simulation(plant, work, 1e-8), 1e-10, 1e-10),
        (lambda work: peers.run_mujoco(work, 1e-8), 1e-10, math.inf),  # one step of 2 s is none
    ]
    for run, changing, free in bounds:
        for work, bound in ((SHORT, changing), (FREE, free)):
            if math.isfinite(bound):
                seconds, states = run(work)
                assert seconds > 0.0
                assert work.error(states) <= bound


def test_error_is_of_the_worst_state() -> None:
    states = SHORT.reference.copy()
    states[10, 1] += 0.5
    assert SHORT.error(states) == pytest.approx(0.5 / np.abs(SHORT.reference[:, 1]).max())


def test_tables_replace_those_of_the_page() -> None:
    page = "# A\n\n## Ratios\n\nold\n\n## Next\n\ntext\n"
    assert compare.with_figures(page, "new\n") == page.replace("old", "new")
    readme = (Path(__file__).parent / "README.md").read_text()
    tables = readme.split("\n## Ratios\n\n")[1].split("\n## ")[0]
    assert compare.with_figures(readme, tables) == readme


def test_report_shows_all_rows_and_what_is_missed(result: dict) -> None:
    whole = json.loads(json.dumps(result))
    whole["machine"] |= compare.machine()
    for row in whole["rows"]:
        if "judged" in row:
            row["met"] = False
    judged = sum("judged" in row for row in whole["rows"])
    text = table.markdown(whole)
    assert f"{judged} of the targets missed" in text
    assert text.count("**MISSED**") == table.summary(whole).count("**MISSED**") == judged
    assert "Two threads with an instance each" in text
