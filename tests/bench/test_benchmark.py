"""The benchmark runs, and all solvers do the same work. Times are not tested."""

from __future__ import annotations

import json
import math
import os
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

import arm
import compare
import peers
import plots
import table

BENCH = [os.environ["RP_BENCH"], os.environ["RP_LIBRARY"], os.environ["RP_LIBRARY_FMI3"]]
FMU = Path(os.environ["RP_FMU"])
GROUPS = {"steps", "against", "precision", "step size", "instances", "threads", "calls", "life"}
SHORT = arm.Work("1 ms steps, inputs changing", 1e-3, 50, True)
FREE = arm.Work("one step of 2 s, free motion", 2.0, 1, False)


@pytest.fixture(scope="module")
def result() -> dict:
    """Everything that bench measures, in short."""
    return compare.run_bench(BENCH, "--quick", "--repeats", "1")


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
    assert result["machine"]["mujoco"], "MuJoCo is a requirement of the tests"
    for group in ("steps", "precision", "step size"):
        runs = {row["run"] for row in result["rows"] if row["group"] == group}
        assert runs >= {"plain loop", "cvode_adams", "cvode_bdf", "erk"}
    for group in ("steps", "precision"):
        runs = {row["run"] for row in result["rows"] if row["group"] == group}
        assert runs >= {"MuJoCo RK4", "MuJoCo implicitfast"}


def test_figures_are_finite(result: dict) -> None:
    for row in result["rows"]:
        numbers = {k: v for k, v in row.items() if isinstance(v, float | int)}
        assert all(math.isfinite(value) for value in numbers.values()), row
        assert all(row.get(name, 1.0) >= 0.0 for name in ("us", "ratio", "error")), row
        assert ("judged" in row) == ("met" in row)


def test_errors_of_the_fmu_are_those_of_its_tolerance(result: dict) -> None:
    rows = [row for row in result["rows"] if "effective_tolerance" in row]
    assert len(rows) > 50
    for row in rows:
        # the references of the scenarios: 20 times the tolerance
        assert row["error"] <= 20.0 * row["tolerance"], row
    for row in result["rows"]:
        if row["group"] in ("instances", "threads", "calls"):
            assert row["error"] <= 2e-7, row


def test_free_motion_meets_the_error_asked_for(result: dict) -> None:
    rows = [row for row in result["rows"] if row["work"] == compare.FREE.name]
    assert len(rows) == 5
    assert all(row["error"] <= compare.BOUND for row in rows)


def test_both_references_agree(result: dict) -> None:
    for work in (*compare.CHANGING, compare.FREE):
        row = compare.find(result["rows"], work.name, "erk")
        assert (row["step"], row["steps"]) == (work.step, work.steps)
        end = np.array([row[f"end_{name}"] for name in arm.STATES])
        np.testing.assert_allclose(end, work.reference[-1].astype(float), rtol=1e-12)


def test_both_versions_of_fmi_do_the_same(result: dict) -> None:
    for work in compare.CHANGING:
        for method in ("cvode_adams", "erk"):
            older = compare.find(result["rows"], work.name, method)
            newer = compare.find(result["rows"], work.name, f"{method}, FMI 3.0")
            for figure in ("error", "effective_tolerance", "internal_steps", "evaluations"):
                assert newer[figure] == older[figure]
            row = compare.find(result["rows"], work.name, f"{method}, FMI 3.0 to {method}")
            assert (row["judged"], row["comparison"], row["limit"]) == ("ratio", "<=", 1.05)


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
        (lambda work: peers.run_co_simulation(own, work, 1e-8, 3), 1e-10, 1e-10),
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
    page = "# A\n\n## Figures\n\nold\n\n## Next\n\ntext\n"
    assert compare.with_figures(page, "new\n") == page.replace("old", "new")
    readme = (Path(__file__).parent / "README.md").read_text()
    tables = readme.split("\n## Figures\n\n")[1].split("\n## ")[0]
    assert compare.with_figures(readme, tables) == readme


def test_report_shows_all_rows_and_what_is_missed(result: dict, tmp_path: Path) -> None:
    whole = json.loads(json.dumps(result))
    names = ("python", "fmpy", "heyoka", "scipy", "mujoco", "pythonfmu")
    whole["machine"] |= dict.fromkeys(names, "1")
    for row in whole["rows"]:
        if "judged" in row:
            row["met"] = False
    judged = sum("judged" in row for row in whole["rows"])
    text = table.markdown(whole)
    assert f"{judged} of the targets missed" in text
    assert text.count("**MISSED**") == judged
    pictures = plots.draw(result["rows"], tmp_path)
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in pictures)
    assert len(pictures) == 3
