"""The closed loop under the master: against the references, and what the study claims."""

import json
import os
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from rparm.models.closed_loop.coupling import loop as closed_loop
from rparm.models.closed_loop.coupling import report, study
from rparm.models.closed_loop.coupling.loop import METHODS, REFERENCE_AHEAD, REFERENCES, ClosedLoop
from rparm.models.closed_loop.coupling.study import (
    FAST_STOP,
    FastAndSlow,
    StepErrors,
)
from scipy.linalg import expm

from rparm.__main__ import main
from rparm.errors import UserError
from rparm.systems.master import Master
from rparm.systems.opened import opened
from tests.support.paths import ROOT
from tests.support.systems import CLOSED_LOOP

STEP = 1e-3  # s, of the sampled references
BOUND = 1e-7  # relative, at the relative tolerance of the variants, 1e-11
SMALLEST_SCALE = 1e-3


@pytest.fixture(scope="module")
def loop() -> Iterator[ClosedLoop]:
    """The built system."""
    build = Path(os.environ.get("RP_FMU", ROOT / "build" / "RPManipulator.fmu")).parent
    with closed_loop.opened(build / "ClosedLoop.ssp") as opened:
        yield opened


@pytest.fixture(scope="module")
def motion(loop: ClosedLoop) -> FastAndSlow:
    """The motion of the step-size control."""
    return FastAndSlow(loop)


def deviation(got: np.ndarray, expected: np.ndarray) -> float:
    expected = expected.astype(float)
    return float(np.abs(got - expected).max() / max(np.abs(expected).max(), SMALLEST_SCALE))


def flat(parameters: dict) -> dict:
    """By "component.name"."""
    return {
        f"{c}.{name}": value for c, values in parameters.items() for name, value in values.items()
    }


# ---- Against the references ----------------------------------------------------------------------


@pytest.mark.parametrize("variant", ["nominal", "limited_effort"])
def test_gauss_seidel_steps_meet_their_reference(loop: ClosedLoop, variant: str) -> None:
    """With the trajectory first, then the controller, then the arm."""
    from rparm.models.closed_loop.references.closed_loop import sampled

    columns, _ = loop.run(REFERENCE_AHEAD, STEP, variant, stop=1.0)
    expected = sampled(flat(loop.parameters(variant)), columns["time"], order="gauss_seidel")
    errors = {name: deviation(columns[name], expected[name]) for name in expected}
    assert max(errors.values()) <= BOUND, errors
    jacobi, _ = loop.run(METHODS[0], STEP, variant, stop=1.0)
    assert deviation(jacobi["arm.q1"], expected["arm.q1"]) > 1e2 * BOUND


@pytest.mark.parametrize("mode", ["pd", "pd_gravity", "computed_torque"])
def test_every_law_meets_its_reference_at_the_limits_of_its_efforts(
    loop: ClosedLoop, mode: str
) -> None:
    """From off the trajectory, so that both efforts come to their limits, both ways.

    Sampled, and in continuous time, which steps of second order come near to.
    """
    from rparm.models.closed_loop.references.closed_loop import STATE, monolithic, sampled

    modes = loop.fmus["controller"].model.variables["mode"].items
    limits = {"tau1": 9.0, "f2": 2.0}
    changes = {
        "arm": {"q1": 0.06, "q2": -0.03, "dq1": 0.4, "dq2": 0.3},
        "controller": {f"{name}_max": limit for name, limit in limits.items()}
        | {"mode": modes[mode], "integral1": 2.0, "integral2": -1.0},
    }
    columns, _ = loop.run(METHODS[0], STEP, "limited_effort", 0.2, changes)
    parameters = flat(loop.parameters("limited_effort", changes))
    expected = sampled(parameters, columns["time"])
    errors = {name: deviation(columns[name], expected[name]) for name in expected}
    assert max(errors.values()) <= BOUND, errors
    for name, limit in limits.items():
        efforts = expected[f"controller.{name}"]
        assert (min(efforts), max(efforts)) == (-limit, limit) and np.any(np.abs(efforts) < limit)
    finer, _ = loop.run(METHODS[3], STEP, "limited_effort", 0.2, changes)
    continuous = monolithic(parameters, finer["time"])
    assert max(deviation(finer[name], continuous[name]) for name in STATE) <= 1e-3


@pytest.mark.parametrize("variant", CLOSED_LOOP.variants)
def test_references_made_again_are_the_same(variant: str) -> None:
    from rparm.models.closed_loop.references import make_references
    from rparm.models.closed_loop.references.closed_loop import COLUMNS

    made = make_references.make(make_references.variants()[variant])
    assert {path.name for path in (REFERENCES / variant).iterdir()} == set(made)
    for file, (times, columns) in made.items():
        path = REFERENCES / variant / file
        kept = closed_loop.read_reference(path)
        assert list(kept) == ["time", *COLUMNS]
        old = np.array([*kept.values()])
        assert path.stat().st_size < 1_000_000 and path.read_text().startswith('"time","traj')
        new = np.array([times, *(columns[name] for name in COLUMNS)], float)
        assert old.shape == new.shape and np.array_equal(old[0], times)
        scale = np.maximum(1, np.max(np.abs(old), axis=1, keepdims=True))
        assert np.max(np.abs(new - old) / scale) < 1e-12, file


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"arm.m9": 1.0}, "no parameter 'arm.m9'"),
        ({"arm.m2": np.nan}, "arm.m2: nan is no finite number"),
        ({"trajectory.motion": "spiral"}, "trajectory.motion: no 'spiral'"),
    ],
)
def test_parameters_that_references_do_not_have_are_refused(parameters: dict, message: str) -> None:
    from rparm.models.closed_loop.references.closed_loop import monolithic

    with pytest.raises(UserError, match=message):
        monolithic(parameters, [0.0, 1.0])


# ---- The study -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def convergence(loop: ClosedLoop) -> StepErrors:
    return study.study_step_errors(loop, (8e-3, 4e-3, 2e-3, 1e-3))


def test_errors_and_energy_fall_with_the_order(convergence: StepErrors) -> None:
    for i, method in enumerate(convergence.methods):
        assert convergence.slopes(convergence.errors)[i] == pytest.approx(method.power, abs=0.2)
        assert convergence.slopes(convergence.energies)[i] == pytest.approx(method.power, abs=0.2)
        assert convergence.holds(i)
    assert [m.power for m in convergence.methods] == [1, 1, 2, 2]


def test_a_slope_that_is_off_is_seen(
    convergence: StepErrors, capsys: pytest.CaptureFixture[str]
) -> None:
    errors = convergence.errors * convergence.steps**0.5
    changed = StepErrors(
        convergence.methods, convergence.steps, errors, convergence.energies, convergence.calls
    )
    assert not any(changed.holds(i) for i in range(4))
    report.print_step_errors(changed)
    assert "FAILED" in capsys.readouterr().out


def test_the_law_is_the_controllers_own(loop: ClosedLoop) -> None:
    """In a step-0 limit the efforts are the law's at the momentary motion."""
    columns, _ = loop.run(METHODS[3], STEP, stop=1.2)
    efforts = study.law(loop, columns)
    applied = np.array([columns["controller.tau1"], columns["controller.f2"]])
    # the controller extrapolates the measurements over a step: second order
    assert np.abs(efforts - applied)[:, 1:].max() < 5e-5
    held, _ = loop.run(METHODS[0], STEP, stop=1.2)
    assert np.abs(study.law(loop, held)[0] - held["controller.tau1"]).max() > 3e-3


@pytest.mark.parametrize("step", [2e-3, 1e-3])
def test_the_end_effectors_error_is_what_the_delays_predict(loop: ClosedLoop, step: float) -> None:
    jacobi, gauss_seidel, ahead = tracking = closed_loop.study_tracking(loop, step)
    for found in tracking:
        assert abs(found.deviation) <= 0.1
        rms = np.sqrt(np.mean((found.measured - found.predicted) ** 2))
        assert rms <= 0.1 * found.largest  # along the whole motion
    assert jacobi.largest < 1e-3
    assert gauss_seidel.largest < jacobi.largest / 2
    assert ahead.largest > jacobi.largest
    assert closed_loop.tracking_passed(tracking)


# ---- Step doubling -------------------------------------------------------------------------------


def test_step_doubling_takes_fewer_steps(loop: ClosedLoop, motion: FastAndSlow) -> None:
    (found,) = study.study_doubling(loop, [1e-5])
    fixed = found.fixed_steps / (FAST_STOP / 0.1)
    assert motion.fixed_error(round(fixed)) <= found.error
    assert motion.fixed_error(round(0.9 * fixed)) > found.error
    assert found.fixed_steps >= 3 * found.run.accepted
    assert found.fixed_calls >= 3 * found.run.do_steps
    assert found.run.do_steps == 9 * (found.run.accepted + found.run.rejected)
    assert found.passed


def test_the_motion_meets_its_reference(motion: FastAndSlow) -> None:
    assert motion.check() <= 1e-6


# ---- The command ---------------------------------------------------------------------------------


def test_an_unknown_variant_is_named(loop: ClosedLoop) -> None:
    with pytest.raises(UserError, match="no variant 'light'.*nominal"):
        loop.run(METHODS[0], STEP, "light")


def test_any_loop_has_the_errors_of_its_exact_solution(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An oscillator that shakes another one, by the matrix exponential; orders 1, 1, 2 and 2."""
    file, fmu = tmp_path / "pair.toml", ROOT / "build" / "tests" / "oscillator" / "Oscillator.fmu"
    omega, start = (2.0, 3.0), np.array([1.0, 0.0, 0.2, -1.0])
    lines = [
        f'"{name}.{key}" = {value}'
        for i, name in enumerate("ab")
        for key, value in (
            ("omega", omega[i]), ("x", start[2 * i]), ("v", start[2 * i + 1]),
            ("relative_tolerance", 1e-11),
        )
    ]  # fmt: skip
    file.write_text(
        f'name = "Pair"\nstep = "40 ms"\nstop = 2\n[components]\na = "{fmu.as_posix()}"\n'
        f'b = "{fmu.as_posix()}"\n[connections]\n"b.u" = "a.a"\n[parameters]\n' + "\n".join(lines)
    )
    assert main(["coupling", str(file), "--json", "--report", str(tmp_path)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert Path(found["page"]).is_file()
    a, b = omega
    A = np.array([[0, 1, 0, 0], [-a * a, 0, 0, 0], [0, 0, 0, 1], [-a * a, 0, -b * b, 0]])
    times = 0.04 * np.arange(51)
    exact = np.array([expm(A * t) @ start for t in times])
    assert len(found["ways"]) == 4
    for way in found["ways"]:
        order, inputs = way["order"], way["inputs"]
        expected = 2.0 if inputs == "extrapolated" else 1.0
        assert way["orders"][-1] == pytest.approx(expected, abs=0.1)
        with (
            opened(file) as system,
            system.unpacked_fmus() as fmus,
            Master(fmus, system.system.connections, order, inputs) as master,
        ):
            master.initialize(0.0, 2.0, system.system.parameter_sets["default"])
            rows = master.run(times)
        errors = []
        for names, columns in (("xx", (0, 2)), ("vv", (1, 3))):
            own = [master.names.index(f"{c}.{n}") for c, n in zip("ab", names, strict=True)]
            apart = np.abs(rows[:, own] - exact[:, columns]).max()
            errors.append(apart / np.abs(exact[:, columns]).max())
        accelerations = exact @ A.T[:, [1, 3]]
        own = [master.names.index(f"{c}.a") for c in "ab"]
        errors.append(np.abs(rows[:, own] - accelerations).max() / np.abs(accelerations).max())
        energies = [(exact[:, [2 * i + 1]] ** 2 + (w * exact[:, [2 * i]]) ** 2) / 2
                    for i, w in enumerate(omega)]  # fmt: skip
        own = [master.names.index(f"{c}.energy") for c in "ab"]
        apart = np.abs(rows[:, own] - np.hstack(energies)).max()
        errors.append(apart / np.abs(energies).max())
        assert way["errors"][0] == pytest.approx(max(errors), rel=0.03)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["closed_lop"], "no system 'closed_lop', did you mean 'closed_loop'"),
        (["python.toml"], "halves of the step show no error of the coupling: law is Python"),
        (["python.toml", "heavy"], "python.toml: no variant 'heavy' (known: default)"),
    ],
)
def test_coupling_refuses(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("law.py").write_text("def step(t, h, inputs):\n    return {}\n")
    Path("python.toml").write_text('name = "P"\nstep = 1\nstop = 2\ncomponents.law = "law.py"\n')
    assert main(["coupling", *arguments, "--report", "report"]) == 2
    assert message in capsys.readouterr().err


def test_tables_and_picture(
    loop: ClosedLoop,
    convergence: StepErrors,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    doubling = study.study_doubling(loop, [1e-4])
    monkeypatch.setattr(report, "opened", lambda _: nullcontext(loop))
    monkeypatch.setattr(report, "study_step_errors", lambda _: convergence)
    monkeypatch.setattr(report, "study_doubling", lambda _: doubling)
    assert main(["coupling", "--report", str(tmp_path / "new")]) == 0
    assert (tmp_path / "new" / "coupling.png").stat().st_size > 50_000
    text = capsys.readouterr().out
    assert "FAILED" not in text and "\npassed: 5 parts; " in text
    assert text.count("passed") >= 18
    assert all(f"largest stable step, {system} " in text for system in ("ClosedLoop", "Machine"))
    lines = text.split("passed: 5")[0].splitlines()
    assert max(len(line) for line in lines if not line.startswith("picture: ")) <= 80
    assert main(["coupling", "--json", "--report", str(tmp_path / "new")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["parts"]) == 5 and all(part["passed"] for part in found["parts"].values())
    predicted = found["parts"]["largest steps of machine"]["predicted"]
    assert predicted["Jacobi, held"] == pytest.approx(12.892e-3, abs=1e-6)
