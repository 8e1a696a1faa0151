"""Campaigns over FMUs of FMI 3.0: the same bits as over those of FMI 2.0, and what differs."""

import re
import zipfile
from pathlib import Path

import numpy as np

from rparm.campaign.job import LYAPUNOV
from rparm.campaign.runs import Rows
from tests.campaign.files import ARM, HEAD, campaign, write
from tests.campaign.runners import rows, runner
from tests.support.intercepted import intercept
from tests.support.rparm_project import BUILD, FMUS, Console, fmi3_fmu, repacked

ARM2 = FMUS["rp_manipulator"]
ARM3 = fmi3_fmu(ARM2)
EXPONENT = HEAD + (
    'scenario = "rubber_buffers"\nsampling = "random"\nruns = 3\ntime = { stop = 1.0 }\n'
    "[parameters.q1]\nuniform = [0.1, 1.0]\n[keep]\nlyapunov = true\ntrajectories = [0, 1, 2]\n"
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


def test_both_versions_give_the_same_exponent(tmp_path: Path) -> None:
    fmu = fmi3_fmu(FMUS["rp_plant"])
    assert_same_bits(made(tmp_path / "3", EXPONENT, fmu), made(tmp_path / "2", EXPONENT))


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


# ---- Failures ------------------------------------------------------------------------------------


def test_a_step_that_fails_says_why(tmp_path: Path) -> None:
    text = ARM.replace("[keep]", "[set]\nmax_internal_steps = 3\n[keep]")
    for version, fmu in ((2, ARM2), (3, ARM3)):
        for reason in made(tmp_path / str(version), text, fmu).failures:
            assert re.fullmatch(
                rf"hanging_swing: fmi{version}DoStep in the step from t = \S+ s failed "
                r"\(discard\): .* the integrator took all internal steps allowed "
                r"by max_internal_steps",
                reason,
            )


def test_a_run_that_the_fmu_ends_has_failed(tmp_path: Path) -> None:
    given = campaign(tmp_path)
    with runner(given, tmp_path, fmu=ARM3) as (runs, job, points):
        expected = rows(runs, job, points, [0, 1])
        final = set()

        def end(do_step, instance, time, length, last, event, terminates, early, reached):
            final.add(last)
            status = do_step(instance, time, length, last, event, terminates, early, reached)
            terminates[0] = time >= 0.5
            return status

        (component,) = runs.instantiate().loop.components
        kept = intercept(component, "fmi3DoStep", end)
        found = rows(runs, job, points, [0, 1])
        del kept
    assert final == {True}
    assert found.failures[0] == "hanging_swing: the FMU ends the simulation at t = 0.505 s"
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
