"""Identification finds the parameters that made a log, and says how well it knows them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rparm
from rparm.fmi.fmu_file import Fmu
from rparm.identification import logs
from tests.identification.synthetic import (
    ARM,
    INPUTS,
    MEASURED,
    PLANT,
    STEP,
    Machine,
    efforts,
    identified,
    save,
    write,
)

# ---- what is found -------------------------------------------------------------------------------


@pytest.mark.parametrize("machine", [ARM, PLANT], ids=["arm", "plant"])
def test_parameters_are_found_from_20_percent_off(machine: Machine, tmp_path: Path) -> None:
    found = identified(machine, write(machine, tmp_path / "log.csv", 1), 1)
    assert found.has_converged and found.warnings == []
    assert 0.9 < found.chi2 < 1.1
    for name, true in machine.true.items():
        estimate = found.estimates[name]
        half = (estimate.high - estimate.low) / 2
        assert estimate.low < estimate.value < estimate.high
        assert abs(estimate.value - true) < 2 * half  # four standard deviations
        assert half < 0.02 * true


def test_exact_logs_give_exact_parameters(tmp_path: Path) -> None:
    machine = replace(ARM, noise=(0.0, 0.0), duration=4.0)
    found = identified(machine, write(machine, tmp_path / "log.csv", 3), 3)
    for name, true in machine.true.items():
        assert found.estimates[name].value == pytest.approx(true, rel=1e-6)


def test_several_logs_tell_more_than_one(tmp_path: Path) -> None:
    short = replace(ARM, duration=3.0)
    logs = [write(short, tmp_path / f"{seed}.csv", seed) for seed in (4, 5, 6)]
    one, three = identified(short, logs[0]), identified(short, logs)
    for name, true in ARM.true.items():
        narrow, wide = three.estimates[name], one.estimates[name]
        assert narrow.high - narrow.low < 0.8 * (wide.high - wide.low)
        assert abs(narrow.value - true) < narrow.high - narrow.low
    assert len(three.segments) == 3 * len(one.segments)


def test_times_that_are_never_the_same_step(tmp_path: Path) -> None:
    """No row is missing where a step is 1.6 of the usual one: its input is held, as all are."""
    fine, random = replace(ARM, duration=4.0), np.random.default_rng(8)
    true = ARM.true | {"solver_method": "taylor"}
    rows = 10 * np.arange(4001) + random.integers(-3, 4, 4001)
    rows = np.clip(rows, 0, 40000)
    held = rows[np.searchsorted(rows, np.arange(40001), side="right") - 1]
    times = 1e-4 * np.arange(40001)
    told = efforts(times[held], random)
    table = rparm.simulate(
        fine.fmu,
        stop_time=4.0,
        step=1e-4,
        start_values={**true, "q1": -1.2, "q2": 0.1},
        inputs=dict(zip(INPUTS, told.T, strict=True)),
        outputs=MEASURED,
    )
    seen = np.column_stack([table[name][rows] for name in MEASURED])
    seen += random.normal(size=seen.shape) * (1e-4, 1e-5)
    log = tmp_path / "log.csv"
    save(log, times[rows], told[rows], seen)
    found = identified(ARM, log, 8)
    assert found.warnings == [] and 0.9 < found.chi2 < 1.1
    np.testing.assert_allclose(found.noise, (1e-4, 1e-5), rtol=0.1)


def test_noise_is_the_same_whatever_rows_are_missing() -> None:
    random = np.random.default_rng(11)
    times = 1e-3 * np.arange(8001)
    smooth = np.sin(5 * times)[:, None]
    seen = smooth + 1e-5 * random.normal(size=smooth.shape)
    kept = random.random(len(times)) > 0.1
    found = [
        logs.noise([logs.Recording(Path(), times[rows], seen[rows], seen[rows], seen[rows], 1e-3)])
        for rows in (kept | True, kept)
    ]
    np.testing.assert_allclose(found, 1e-5, rtol=0.05)


def test_joints_that_start_at_a_stop(tmp_path: Path) -> None:
    # the slide strikes its stops and rests there: measured a hair beyond
    settings = {"stops2": "rigid", "restitution2": 0.3, "lower2": -0.3, "upper2": 0.3}
    machine = replace(PLANT, settings=settings, duration=6.0, amplitude=0.7)
    log = write(machine, tmp_path / "log.csv", 9)
    seen = np.loadtxt(log, delimiter=",", skiprows=1)[:, 4]
    assert np.count_nonzero(np.abs(seen) > 0.3) > 100
    found = identified(machine, log, 9)
    assert found.has_converged and 0.9 < found.chi2 < 1.1
    assert found.estimates["m2"].value == pytest.approx(1.1, rel=3e-3)


def test_breakaway_stays_above_sliding_friction(tmp_path: Path) -> None:
    true = {"coulomb_friction1": 0.3, "breakaway_friction1": 0.6}
    machine = Machine("rp_plant", true, {"stribeck_velocity1": 0.05}, duration=6.0, amplitude=0.6)
    log = write(machine, tmp_path / "log.csv", 10)
    found = identified(
        machine,
        log,
        parameters=["breakaway_friction1>coulomb_friction1", "coulomb_friction1"],
        start={"coulomb_friction1": 0.24, "breakaway_friction1": 0.3},
    )
    for name in true:
        assert found.estimates[name].value == pytest.approx(true[name], rel=0.05)
    assert found.estimates["breakaway_friction1"].value > found.estimates["coulomb_friction1"].value


def test_a_parameter_that_is_not_there_comes_to_its_limit(tmp_path: Path) -> None:
    machine = replace(ARM, model="rp_plant", duration=2.0)
    log = write(machine, tmp_path / "log.csv", 11)
    found = rparm.identify(
        machine.fmu,
        log,
        parameters=["m2", "coulomb_friction1"],
        inputs=INPUTS,
        measured=MEASURED,
        settings={name: true for name, true in ARM.true.items() if name != "m2"},
        start={"coulomb_friction1": 0.1},
    )
    assert found.estimates["coulomb_friction1"].value < 1e-3
    assert found.estimates["m2"].value == pytest.approx(1.1, rel=1e-3)


# ---- what is not known, and what is not right ----------------------------------------------------


@pytest.mark.parametrize(
    ("machine", "unknown"),
    [
        (Machine("rp_manipulator", {"m2": 1.0, "I1z": 0.1, "I2z": 0.05}), [["I1z", "I2z"]]),
        (
            Machine("rp_plant", {"armature1": 0.2, "I1z": 0.1, "m2": 1.0, "I2z": 0.05}),
            [["armature1", "I1z", "I2z"]],
        ),
        (
            Machine("rp_manipulator", {"m1": 2.0, "lc1": 0.25, "I1z": 0.1, "m2": 1.0}),
            [["m1", "lc1", "I1z"]],
        ),
        (
            Machine("rp_manipulator", {"m1": 2.0, "lc1": 0.25, "m2": 1.0}, {"g": 0.0}),
            [["m1", "lc1"]],
        ),
        (Machine("rp_plant", {"m2": 1.0, "payload_mass": 0.5}), [["payload_mass"]]),
        (
            Machine("rp_manipulator", {"m1": 2.0, "m2": 1.0, "I1z": 0.1}, amplitude=0.0),
            [["m1", "m2", "I1z"]],
        ),
        # nothing is invented where all can be known
        (Machine("rp_manipulator", {"m1": 2.0, "m2": 1.0, "I1z": 0.1, "a": 0.1, "g": 9.8}), []),
        (replace(PLANT, true={**PLANT.true, "armature2": 0.4, "l1": 0.5, "m1": 2.0}), []),
    ],
)
def test_what_cannot_be_known_is_named(
    machine: Machine, unknown: list[list[str]], tmp_path: Path
) -> None:
    machine = replace(machine, duration=4.0, noise=(1e-5, 1e-5))
    found = identified(machine, write(machine, tmp_path / "log.csv", 12), 12)
    assert [list(each.names) for each in found.combinations] == unknown
    for name, estimate in found.estimates.items():
        is_unknown = any(name in names for names in unknown)
        assert (estimate.low is None) == (estimate.high is None) == is_unknown


def test_a_sum_is_known_where_its_parts_are_not(tmp_path: Path) -> None:
    machine = Machine("rp_plant", {"armature1": 0.2, "I1z": 0.1, "m2": 1.0}, duration=4.0)
    found = identified(machine, write(machine, tmp_path / "log.csv", 13), 13)
    (name, total), *others = found.sums.items()
    assert name == "armature1 + I1z" and not others
    assert abs(total.value - 0.3) < total.high - total.low < 0.01


def test_noise_of_the_efforts_widens_the_intervals(tmp_path: Path) -> None:
    machine = replace(PLANT, effort_noise=0.02, noise=(1e-5, 1e-5))
    found = identified(machine, write(machine, tmp_path / "log.csv", 14), 14)
    assert found.covariances.ratio > 5
    assert any("not exact" in text for text in found.warnings)
    for name, true in machine.true.items():
        estimate = found.estimates[name]
        assert abs(estimate.value - true) < estimate.high - estimate.low


HEIGHT, PERIODS = 0.05, 12  # of a torque ripple: N.m, 1 a turn


def rippled(path: Path, seed: int) -> Path:
    """Write a log with white noise and a motor's cogging, a torque that the FMU does not have."""
    random = np.random.default_rng(seed)
    times = STEP * np.arange(round(ARM.duration / STEP) + 1)
    told = efforts(times, random)
    seen = np.empty((len(times), 2))
    with Fmu(ARM.fmu) as fmu, fmu.instance("arm") as instance:
        instance.set_up(0.0, None, 1e-8)
        for name, value in {**ARM.true, "q1": -1.2, "q2": 0.1}.items():
            instance.set(name, value)
        instance.enter_initialization()
        instance.exit_initialization()
        inputs, outputs = instance.reals(["tau1", "f2"]), instance.reals(MEASURED)
        for row, (start, given) in enumerate(zip(times, told, strict=True)):
            outputs.get()
            seen[row] = outputs.view
            inputs.view[:] = given + [HEIGHT * np.sin(PERIODS * outputs.view[0]), 0.0]
            inputs.set()
            instance.do_step(start, STEP)
    save(path, times, told, seen + random.normal(size=seen.shape) * ARM.noise)
    return path


def test_a_torque_ripple_is_not_white(tmp_path: Path) -> None:
    found = identified(ARM, rippled(tmp_path / "log.csv", 15), 15)
    assert found.whiteness["q1"].p < 1e-6
    assert any("not white" in text for text in found.warnings)


def test_a_second_log_is_run_from_start_to_end(tmp_path: Path) -> None:
    log = write(ARM, tmp_path / "log.csv", 16)
    second = write(replace(ARM, duration=3.0), tmp_path / "second.csv", 17)
    found = identified(ARM, log, 16, validate=second)
    assert 0.9 < found.validation.chi2 < 1.1
    assert (found.validation.rms < 3e-4).all() and (found.validation.follows == 3.0).all()
    other = write(replace(ARM, true={**ARM.true, "m2": 1.3}, duration=3.0), second, 17)
    wrong = identified(ARM, log, 16, validate=other)
    assert wrong.validation.chi2 > 100
