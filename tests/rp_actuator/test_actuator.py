"""RPActuator as a unit: what it refuses, its derivatives and dependencies, rollback, references.

The closed forms are in test_rp_actuator.c.
"""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from rparm.fmi.fmu_file import Fmu
from rparm.runs import comparison
from rparm.runs.comparison import Runs
from tests.support.instances import ERROR, OK, Instance, LoadedFmu, status_of
from tests.support.paths import ROOT
from tests.support.rparm_project import declared, load, names_of

UNIT = "RPActuator"

FOLDER = ROOT / "models" / "rp_actuator"
SCENARIOS = names_of(FOLDER.name)

PER_JOINT = (
    "torque_constant", "gear_ratio", "resistance", "current_max", "voltage_max", "time_constant",
)  # fmt: skip
PARAMETERS = tuple(f"{name}{joint}" for name in PER_JOINT for joint in (1, 2))
INPUTS = ("tau1_cmd", "f2_cmd", "dq1", "dq2")
STATES = ("current1", "current2")
OUTPUTS = ("tau1", "f2", *STATES, "voltage1", "voltage2")
RATES = ("dcurrent1", "dcurrent2")
LIMITED = ("current1_limited", "current2_limited")
KNOWNS = (*PARAMETERS, *INPUTS, *STATES)
LIMITS = ("command", "current", "voltage")

Values = dict[str, float]


# ---- Derivatives and dependencies ----------------------------------------------------------------


def random_point(limit: str, seed: int) -> Values:
    """A point at which the command or a limit decides both currents."""
    source = random.Random(f"{limit} {seed}")
    point = {name: source.uniform(0.5, 2.0) for name in KNOWNS}
    for joint in (1, 2):
        point[f"gear_ratio{joint}"] *= source.choice((-1.0, 1.0))
        point[f"dq{joint}"] *= source.choice((-1.0, 1.0))
        point[f"current_max{joint}"] *= 1e4 if limit == "voltage" else 32.0
        point[f"voltage_max{joint}"] *= 1e5 if limit == "current" else 128.0
    if limit != "command":
        for name in INPUTS[:2]:
            point[name] *= source.choice((-1e6, 1e6))
    return point


@contextmanager
def in_initialization_mode(loaded: LoadedFmu, point: Values) -> Iterator[Instance]:
    with Instance(loaded) as instance:
        instance.fmi.setupExperiment()
        instance.set(**point)
        instance.fmi.enterInitializationMode()
        yield instance


def expected(point: Values, limit: str) -> dict[str, float]:
    """All calculated variables where `limit` decides the currents."""
    result = {}
    for joint, (command, effort) in enumerate((("tau1_cmd", "tau1"), ("f2_cmd", "f2")), start=1):
        k, n, resistance, i_max, u_max, time_constant = (
            point[f"{name}{joint}"] for name in PER_JOINT
        )
        current, back_emf = point[f"current{joint}"], n * k * point[f"dq{joint}"]
        commanded = point[command] / (n * k)
        limited = {
            "command": commanded,
            "current": np.copysign(i_max, commanded),
            "voltage": (np.copysign(u_max, commanded) - back_emf) / resistance,
        }[limit]
        result |= {
            effort: n * k * current,
            f"current{joint}": current,
            f"voltage{joint}": resistance * current + back_emf,
            f"dcurrent{joint}": (limited - current) / time_constant,
            f"current{joint}_limited": limited,
        }
    return result


@pytest.mark.parametrize("limit", LIMITS)
def test_values_are_those_of_the_equations(loaded: LoadedFmu, limit: str) -> None:
    for seed in range(20):
        point = random_point(limit, seed)
        values = expected(point, limit)
        with in_initialization_mode(loaded, point) as instance:
            assert instance.get(*values) == pytest.approx([*values.values()], rel=1e-12)


@pytest.mark.parametrize("limit", LIMITS)
def test_directional_derivatives(loaded: LoadedFmu, limit: str) -> None:
    h = 2.0**-12
    for seed in range(5):
        point = random_point(limit, seed)
        with in_initialization_mode(loaded, point) as instance:
            unknowns = [*expected(point, limit)]
            references = [loaded.references[name] for name in unknowns]
            for known in KNOWNS:
                column = instance.fmi.getDirectionalDerivative(
                    references, [loaded.references[known]], [1.0]
                )
                # central, with one extrapolation: the next term is in the fourth power of h
                slopes = []
                for step in (h, 2 * h):
                    step *= abs(point[known])
                    ahead = expected(point | {known: point[known] + step}, limit)
                    behind = expected(point | {known: point[known] - step}, limit)
                    slopes.append(np.array([(ahead[n] - behind[n]) / (2 * step) for n in unknowns]))
                slope = (4 * slopes[0] - slopes[1]) / 3
                assert column == pytest.approx(slope, rel=1e-8, abs=1e-8), (known, seed)


def test_dependencies_are_those_of_the_equations(loaded: LoadedFmu) -> None:
    unknowns = (*OUTPUTS, *RATES)
    depends: dict[str, set[str]] = {name: set() for name in unknowns}
    references = [loaded.references[name] for name in unknowns]
    for limit in LIMITS:
        with in_initialization_mode(loaded, random_point(limit, 0)) as instance:
            for known in KNOWNS:
                column = instance.fmi.getDirectionalDerivative(
                    references, [loaded.references[known]], [1.0]
                )
                for name, entry in zip(unknowns, column, strict=True):
                    if entry != 0.0:
                        depends[name].add(known)

    structure = loaded.description
    listed = {u.variable.name: u for u in (*structure.outputs, *structure.derivatives)}
    assert set(listed) == set(unknowns)
    for name, unknown in listed.items():
        assert {v.name for v in unknown.dependencies} == depends[name] - set(PARAMETERS), name
    initial = {u.variable.name: u for u in structure.initialUnknowns}
    for name in set(unknowns) - set(STATES):
        assert {v.name for v in initial[name].dependencies} == depends[name], name


# ---- What is refused -----------------------------------------------------------------------------


def test_the_taylor_method_is_refused(loaded: LoadedFmu) -> None:
    with Instance(loaded) as instance:
        instance.fmi.setInteger([loaded.references["solver_method"]], [4])
        instance.fmi.setupExperiment()
        instance.fmi.enterInitializationMode()
        assert status_of(instance.fmi.exitInitializationMode) == ERROR
        text = instance.messages[-1].text
        assert "solver_method = 4 (taylor) is refused: RPActuator has no Taylor series" in text


# ---- With the arm --------------------------------------------------------------------------------


def run_up(drives: LoadedFmu, arm: LoadedFmu, stop: float, step: float) -> tuple[float, float]:
    """Current in A and velocity in m/s of joint 2 at `stop`, coupled every `step` (both in s)."""
    with Instance(drives) as drive, Instance(arm) as load:
        drive.initialize(f2_cmd=1e6, current_max2=1e3, voltage_max2=24.0, time_constant2=0.01)
        load.initialize(m2=20.0, g=0.0, a=0.0)
        for i in range(round(stop / step)):
            effort, velocity = drive.get("f2"), load.get("dq2")
            load.set(f2=effort[0])
            drive.set(dq2=velocity[0])
            drive.step(i * step, step)
            load.step(i * step, step)
        return drive.get("current2")[0], load.get("dq2")[0]


def test_a_run_up_on_full_voltage_is_that_of_a_dc_motor(
    fmu: Path, loaded: LoadedFmu, tmp_path: Path
) -> None:
    """T I' = (U - n k v) / R - I and m v' = n k I are linear; the coupling errs in order 1."""
    arm = LoadedFmu(fmu, tmp_path)
    nk, resistance, voltage, mass, time_constant = 0.05 * 200 * np.pi, 0.5, 24.0, 20.0, 0.01
    rates = np.array([[-1 / time_constant, -nk / (resistance * time_constant)], [nk / mass, 0]])
    end = np.array([0.0, voltage / nk])  # no current, no-load speed
    values, vectors = np.linalg.eig(rates)
    stop = 0.032
    decayed = np.exp(stop * values) * np.linalg.solve(vectors, -end)
    exact = end + (vectors @ decayed).real
    errors = [np.abs((run_up(loaded, arm, stop, h) - exact) / exact) for h in (4e-4, 2e-4, 1e-4)]
    assert (errors[2] < 0.01).all(), errors
    for coarse, fine in pairwise(errors):
        assert coarse / fine == pytest.approx([2.0, 2.0], abs=0.1), errors


# ---- As a unit -----------------------------------------------------------------------------------


def test_rollback_at_the_limits_is_exact(loaded: LoadedFmu) -> None:
    def run(instance: Instance, first: int, last: int) -> list[bytes]:
        seen = []
        for i in range(first, last):
            if i % 5 == 0:
                instance.set(tau1_cmd=60.0 if i % 2 else -20.0, dq1=0.2 * i, f2_cmd=50.0 * (i % 9))
            instance.set_input_derivatives(tau1_cmd=[4e3 * (-1) ** i], dq2=[50.0])
            instance.step(0.002 * i, 0.002)
            seen.append(instance.everything())
        return seen

    with Instance(loaded) as instance:
        instance.initialize(tolerance=1e-11)
        run(instance, 0, 33)
        state = instance.fmi.getFMUState()
        once = run(instance, 33, 80)
        instance.fmi.setFMUState(state)
        assert run(instance, 33, 80) == once
        assert status_of(instance.fmi.freeFMUState, state) == OK


def test_units_of_what_is_connected_are_those_of_arm_and_controller(
    fmu: Path, loaded: LoadedFmu, tmp_path: Path
) -> None:
    own = {v.name: v.unit for v in loaded.description.modelVariables}
    arm = {v.name: v.unit for v in LoadedFmu(fmu, tmp_path).description.modelVariables}
    for name in ("tau1", "f2", "dq1", "dq2"):
        assert own[name] == arm[name], name
    assert (own["tau1_cmd"], own["f2_cmd"]) == (arm["tau1"], arm["f2"])


# ---- References ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "joint", "limits"),
    [
        ("actuator_torque_steps", 2, {"current"}),
        ("actuator_torque_speed", 1, {"current", "voltage"}),
        ("actuator_torque_speed", 2, {"current", "voltage", "both"}),
        ("actuator_limits_irregular", 1, {"command", "current", "voltage"}),
        ("actuator_limits_irregular", 2, {"command", "current", "voltage"}),
    ],
)
def test_scenarios_meet_the_limits(name: str, joint: int, limits: set[str]) -> None:
    """Each limit decides at 5 communication points or more, and so it is left again."""
    scenario = load(name)
    value = scenario.start_values
    k, n, resistance, i_max, u_max, _ = (value[f"{p}{joint}"] for p in PER_JOINT)
    commanded = scenario.input("tau1_cmd" if joint == 1 else "f2_cmd") / (n * k)
    back_emf = n * k * scenario.input(f"dq{joint}")
    needed = resistance * np.clip(commanded, -i_max, i_max) + back_emf
    decides = {
        "both": np.abs(back_emf) > u_max + resistance * i_max,
        "voltage": (np.abs(needed) > u_max) & (np.abs(back_emf) < u_max + resistance * i_max),
        "current": (np.abs(commanded) > i_max) & (np.abs(needed) < u_max),
        "command": (np.abs(commanded) < i_max) & (np.abs(needed) < u_max),
    }
    for limit in limits:
        assert 5 <= decides[limit].sum() < len(commanded), limit


def test_currents_of_the_scenarios_end_within_their_limit() -> None:
    for name in SCENARIOS:
        scenario = load(name)
        table = comparison.load_reference(scenario, declared(FOLDER.name))
        for joint in (1, 2):
            limit = scenario.start_values[f"current_max{joint}"]
            settled = scenario.times[scenario.reference_rows] > scenario.start + 0.04
            assert np.abs(table.column(f"current{joint}")[settled]).max() <= limit * 1.0001


@pytest.mark.parametrize("name", SCENARIOS)
def test_scenarios_meet_their_references(path: Path, name: str) -> None:
    with Fmu(path) as opened:
        runs = Runs({FOLDER.name: opened})
        scenario = load(name)
        errors = [runs.run(scenario, tolerance).error for tolerance in (1e-5, 1e-8, 1e-11)]
    assert all(np.array(errors) <= [1e-6, 1e-8, 1e-10]), errors
