"""Campaigns over FMUs of FMI 3.0: the same bits as over those of FMI 2.0, and what differs."""

import re
import zipfile
from ctypes import CFUNCTYPE, POINTER, c_bool, c_double, c_int, c_size_t, c_uint32, c_void_p, cast
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from rparm.campaign.job import LYAPUNOV
from rparm.campaign.runs import Rows
from rparm.fmi.compiled_fmi3 import ADDRESSES
from rparm.fmi.compiled_loop import COLUMNS, DERIVATIVE, DO_STEP
from tests.campaign.cluster.processes import completed
from tests.campaign.files import ARM, HEAD, campaign, commands, write
from tests.campaign.runners import rows, runner
from tests.support.paths import ROOT
from tests.support.rparm_project import BUILD, FMUS, Console, fmi3_fmu, repacked

ARM2 = FMUS["rp_manipulator"]
ARM3 = fmi3_fmu(ARM2)
EVENTS = "'event_count', 'last_event_time', 'solver_steps'"
PLANT = HEAD + (
    'scenario = "grasp_at_rest"\nsampling = "random"\nruns = 3\n[parameters.payload_mass]\n'
    f"uniform = [0.5, 1.0]\n[keep]\nfinal = ['q1', {EVENTS}]\ntrajectories = [0, 1, 2]\n"
)
EXPONENT = HEAD + (
    'scenario = "rubber_buffers"\nsampling = "random"\nruns = 3\ntime = { stop = 1.0 }\n'
    "[parameters.q1]\nuniform = [0.1, 1.0]\n[keep]\nlyapunov = true\ntrajectories = [0, 1, 2]\n"
)
CLOSED_LOOP = HEAD + (
    'system = "closed_loop"\nvariant = "nominal"\nsampling = "random"\nruns = 3\n'
    "time = { stop = 1.0 }\n[parameters.'arm.m2']\nuniform = [0.9, 1.1]\n[keep]\n"
    "final = ['arm.q1', 'controller.tau1', 'arm.solver_steps']\ntrajectories = [0, 1, 2]\n"
)
MACHINE = HEAD + (
    'system = "machine"\nvariant = "pick_and_place"\nsampling = "random"\nruns = 1\n'
    "[parameters.'plant.payload_mass']\nvalues = [1.0]\n[keep]\n"
    "final = ['plant.q1', 'plant.q2', 'plant.solver_steps']\ntrajectories = [0]\n"
)


def made(folder: Path, text: str, fmu: Path | None = None) -> Rows:
    """All runs of a campaign."""
    folder.mkdir()
    given = campaign(folder, text)
    with runner(given, folder, fmu=fmu) as (runs, job, points):
        return rows(runs, job, points, range(given.count))


def assert_same_bits(found: Rows, expected: Rows) -> None:
    assert not any(expected.failures) and found.failures == expected.failures
    assert found.measures.tobytes() == expected.measures.tobytes()
    assert len(np.unique(found.measures, axis=0)) == len(found.runs)
    assert found.trajectories.keys() == expected.trajectories.keys()
    for run, record in expected.trajectories.items():
        assert found.trajectories[run].tobytes() == record.tobytes()


@pytest.mark.parametrize(
    ("text", "fmu"),
    [
        (ARM, ARM3),
        (PLANT, fmi3_fmu(FMUS["rp_plant"])),
        (EXPONENT, fmi3_fmu(FMUS["rp_plant"])),
        (CLOSED_LOOP, BUILD / "fmi3" / "ClosedLoop.ssp"),
    ],
    ids=["arm", "Boolean input", "exponent", "closed loop"],
)
def test_both_versions_give_the_same_bits(text: str, fmu: Path, tmp_path: Path) -> None:
    assert_same_bits(made(tmp_path / "3", text, fmu), made(tmp_path / "2", text))


def mixed(target: Path, newer: set[str]) -> Path:
    """The machine, with FMUs of FMI 3.0 of the models `newer` and of FMI 2.0 of the others."""
    old, new = (zipfile.ZipFile(x / "Machine.ssp") for x in (BUILD, BUILD / "fmi3"))
    with old, new, zipfile.ZipFile(target, "w") as archive:
        for name in old.namelist():
            source = new if Path(name).stem in newer else old
            archive.writestr(name, source.read(name))
    return target


def test_both_versions_in_one_system(tmp_path: Path) -> None:
    # the trajectory sends a Boolean to controller and plant
    expected = made(tmp_path / "2", MACHINE)
    for newer in ({"RPTrajectory", "RPSensor"}, {"RPPlant", "RPController", "RPActuator"}):
        path = mixed(tmp_path / f"{min(newer)}.ssp", newer)
        assert_same_bits(made(tmp_path / min(newer), MACHINE, path), expected)


def test_the_command_replays_what_its_page_says(
    tmp_path: Path, console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)  # commands of pages are for the project's folder
    file = write(tmp_path, changes=[("seed = 3", 'seed = 3\nworst = ["maximum(dq1)"]')])
    tables = [
        completed(file, tmp_path / name, "--workers", 1, "--fmu", fmu)
        for name, fmu in (("2", ARM2), ("3", ARM3))
    ]
    assert tables[0] == tables[1]
    page = (tmp_path / "3" / "index.html").read_text(encoding="utf-8")
    again = next(command for command in commands(page) if "--replay" in command)
    code, out, _ = console(*again[1:])
    assert code == 0
    printed = dict(line.split(" = ") for line in out.splitlines() if " = " in line)
    run = int(again[-1])
    table = pq.read_table(tmp_path / "3" / "blocks", filters=[("run", "=", run)])
    row = table.to_pylist()[0]
    assert row.keys() - printed.keys() == {"run", "failure"}
    assert all(float(value) == row[name] for name, value in printed.items())
    replayed = (tmp_path / "3" / "replays" / f"run_{run}.html").read_text(encoding="utf-8")
    assert again in commands(replayed) and '"motion"' in replayed


# ---- Failures ------------------------------------------------------------------------------------


def test_a_step_that_fails_says_why(tmp_path: Path) -> None:
    text = ARM.replace("[keep]", "[set]\nmax_internal_steps = 3\n[keep]")
    for version, fmu in ((2, ARM2), (3, ARM3)):
        for reason in made(tmp_path / str(version), text, fmu).failures:
            assert re.fullmatch(
                rf"hanging_swing: fmi{version}DoStep in the step from t = \S+ s failed "
                r"\(discard\): .* the integrator took all internal steps allowed",
                reason,
            )


STEP3 = CFUNCTYPE(
    *(c_int, c_void_p, c_double, c_double, c_bool), *(*[POINTER(c_bool)] * 3, POINTER(c_double))
)


def test_a_run_that_the_fmu_ends_has_failed(tmp_path: Path) -> None:
    given = campaign(tmp_path)
    with runner(given, tmp_path, fmu=ARM3) as (runs, job, points):
        expected = rows(runs, job, points, [0, 1])
        column = COLUMNS + 1 + DO_STEP  # for the adapter
        do_step = STEP3(int(runs._stepper.calls[0, column]))
        final = set()

        @STEP3
        def end(instance, time, length, last, event, terminates, early, reached):
            final.add(last)
            status = do_step(instance, time, length, last, event, terminates, early, reached)
            terminates[0] = time >= 0.5
            return status

        runs._stepper.calls[0, column] = cast(end, c_void_p).value
        found = rows(runs, job, points, [0, 1])
    assert final == {True}
    assert found.failures[0] == (
        "hanging_swing: the FMU ends the simulation in the step from t = 0.5 s"
    )
    assert np.isnan(found.measures[0]).all()
    assert not found.failures[1]  # by another instance, whose steps are its own
    assert np.array_equal(found.measures[1], expected.measures[1])


def test_an_exponent_needs_directional_derivatives(tmp_path: Path, console: Console) -> None:
    def change(xml: str) -> str:
        return re.sub(r'providesDirectionalDerivatives="true"', "", xml)

    fmu = repacked(ARM3, tmp_path / "none.fmu", change)
    file = write(tmp_path, changes=[("[keep]", f"[keep]\n{LYAPUNOV} = true")])
    expected = "[keep] lyapunov: the FMU gives no directional derivatives\n"
    assert console.refused("campaign", file, "--fmu", fmu).endswith(expected)


# ---- The adapter of a derivative -----------------------------------------------------------------


INSTANCE = 0x1234
COUNT = 3
REALS = POINTER(c_double)
SIZED = (POINTER(c_uint32), c_size_t)
DERIVATIVE_2 = CFUNCTYPE(c_int, c_void_p, *SIZED, *SIZED, REALS, REALS)
DERIVATIVE_3 = CFUNCTYPE(c_int, c_void_p, *SIZED, *SIZED, REALS, c_size_t, REALS, c_size_t)


def test_sizes_of_a_derivative() -> None:
    @DERIVATIVE_3
    def derive(instance: int, unknowns: Any, n: int, knowns: Any, m: int, *rest: Any) -> int:
        seed, seeds, sensitivity, sensitivities = rest
        if (instance, n, m, seeds, sensitivities) != (INSTANCE, 2, COUNT, COUNT, 2):
            return 3
        total = sum(a * x for a, x in zip(knowns[:m], seed[:m], strict=True))
        for i in range(n):
            sensitivity[i] = unknowns[i] * total
        return 0

    result = (c_double * 2)()
    adapter = DERIVATIVE_2(ADDRESSES[DERIVATIVE])
    knowns, unknowns = (c_uint32 * COUNT)(1, 2, 4), (c_uint32 * 2)(3, 5)
    direction = (c_double * COUNT)(0.5, 0.25, 2.0)
    given = (c_void_p * (1 + len(ADDRESSES)))(INSTANCE)  # in place of a component
    given[1 + DERIVATIVE] = cast(derive, c_void_p)
    assert adapter(given, unknowns, 2, knowns, COUNT, direction, result) == 0
    assert list(result) == [27.0, 45.0]
