"""Random motions of the built FMU of the plant, event by event, against an independent simulation.

A case has friction, stops and a payload; it ends with its tenth event or after 4 s. It is drawn
again where events are closer than 1 us, where an indicator falls slower than SLOWEST, where a
decision at an event could as well have been another one, or with fewer than 3 events.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from rparm.models.rp_plant.references.equations import INPUTS, STATES
from rparm.models.rp_plant.references.motion import Event, Motion
from rparm.models.rp_plant.references.solver import Solver

from rparm.errors import UserError
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_model_exchange import model
from tests.rp_plant.fmu.plant_runs import (
    AT_REST,
    COMPLIANT,
    KEEP_VELOCITY,
    METHODS,
    NONE,
    RIGID,
    started,
)
from tests.support.rparm_project import fmi3_fmu

MOST_EVENTS, FEWEST_EVENTS = 10, 3
STOP = 4.0  # s
TOLERANCE = 1e-12
CLOSEST = 1e-6  # s, between events
SLOWEST = 0.05  # rad, m, N.m or N per s
CLEAREST = 1e-6  # of the forces: how far a decision is from another one
EXCHANGE = "model exchange"  # by fmpy's CVode, at the same tolerance
BOUNDS = dict.fromkeys(METHODS, (1e-9, 1e-8)) | {EXCHANGE: (1e-8, 1e-7)}  # s; rad, m, rad/s, m/s


@dataclass(frozen=True)
class Case:
    """A motion, and when its inputs jump."""

    values: dict[str, float]  # parameters, initial states, inputs at the start
    rates: dict[str, float]  # of the inputs, per s: all or none
    changes: tuple[tuple[float, dict[str, float]], ...]  # s, inputs from there on

    def inputs(self, t: float) -> dict[str, float]:
        """At a time that is not before the last change there."""
        found = {name: self.values[name] for name in (*INPUTS, "payload_attached")}
        for name, rate in self.rates.items():
            found[name] += rate * t
        for at, changed in self.changes:
            if at <= t:
                found |= {
                    name: x + self.rates.get(name, 0.0) * (t - at) for name, x in changed.items()
                }
        return found


def random_case(random: np.random.Generator) -> Case:
    """Moderate parameters, with each feature now and then left out."""

    def sometimes(draw: Callable[[], float], one_of: int = 4) -> float:
        value = draw()
        return 0.0 if random.integers(one_of) == 0 else value

    def within(low: float, high: float) -> float:
        return float(random.uniform(low, high))

    values: dict[str, float] = {"m1": within(0.5, 3), "m2": within(0.3, 2), "l1": within(0.3, 0.8)}
    values |= {"I1z": within(0.02, 0.3), "I2z": within(0.01, 0.2), "lc1": within(0, 0.5)}
    values |= {"a": sometimes(lambda: within(-0.3, 0.3)), "g": sometimes(lambda: 9.81)}
    for joint, size in (("1", 3.0), ("2", 4.0)):
        coulomb = sometimes(lambda size=size: within(0.1, 1) * size, 6)
        values[f"coulomb_friction{joint}"] = coulomb
        if coulomb > 0 and random.integers(3) > 0:
            values[f"breakaway_friction{joint}"] = coulomb * within(1, 1.8)
            values[f"stribeck_velocity{joint}"] = within(0.03, 0.5)
        values[f"damping{joint}"] = sometimes(lambda: within(0, 1), 2)
        values[f"armature{joint}"] = sometimes(lambda: within(0, 0.3), 2)
        values[f"stops{joint}"] = RIGID if random.integers(5) > 0 else NONE
        values[f"restitution{joint}"] = [0.0, within(0.1, 1), within(0.1, 1), 1.0][
            random.integers(4)
        ]
    values |= {"lower1": within(-1.2, -0.4), "upper1": within(0.4, 1.2)}
    values |= {"lower2": within(-0.25, -0.1), "upper2": within(0.1, 0.3)}
    values |= {"q1": within(-0.4, 0.4), "q2": within(-0.1, 0.1)}
    values |= {"dq1": sometimes(lambda: within(-4, 4)), "dq2": sometimes(lambda: within(-3, 3))}
    values |= {"payload_mass": within(0, 1.5), "payload_inertia": within(0, 0.05)}
    values |= {"payload_x": within(-0.1, 0.1), "payload_z": within(-0.1, 0.1)}
    values["grasp"] = int(random.choice([KEEP_VELOCITY, AT_REST]))
    values["payload_attached"] = bool(random.integers(2))

    efforts = {"tau1": within(-15, 15), "f2": within(-12, 12)}
    efforts |= {name: sometimes(lambda: within(-5, 5), 2) for name in ("ee_fx", "ee_fy")}
    values |= efforts | {"ee_mz": sometimes(lambda: within(-2, 2), 2)}
    slopes = (10.0, 10.0, 3.0, 3.0, 1.0)
    ramps = random.integers(2) == 0
    rates = dict(zip(INPUTS, random.uniform(-1, 1, 5) * slopes, strict=True)) if ramps else {}
    times = np.sort(np.round(random.uniform(0.02, 2, random.integers(3)) * 2**20) / 2**20)
    changes, attached = [], values["payload_attached"]
    for t in times.tolist():
        attached = not attached
        jump = {"payload_attached": attached, "tau1": within(-15, 15), "f2": within(-12, 12)}
        changes.append((t, jump))
    return Case(values, rates, tuple(changes))


def compliant_case(random: np.random.Generator) -> Case:
    """The same with compliant stops of joint 2, often of joint 1; a few motions start in one."""
    case = random_case(random)
    values = dict(case.values)
    for joint, stiffest in (("1", 4.0), ("2", 5.0)):
        if joint == "2" or random.integers(4) > 0:
            values[f"stops{joint}"] = COMPLIANT
        values[f"stop_stiffness{joint}"] = float(10 ** random.uniform(2, stiffest))
        values[f"stop_damping{joint}"] = float(random.choice([0.0, 0.3, 1.0, 5.0]))
        if random.integers(6) == 0 and values[f"stops{joint}"] == COMPLIANT:
            values[f"q{joint}"] = values[f"upper{joint}"] + 0.02
    return Case(values, case.rates, case.changes)


@dataclass(frozen=True)
class Truth:
    """What happens, as the independent simulation has it."""

    events: list[Event]
    points: list[float]  # s, communication points: one event at most between two of them
    states: np.ndarray  # (points, 4)
    modes: list[tuple[int, int]]


def simulate(solver: Solver, case: Case, start: Mapping[str, float]) -> Truth | str:
    """The motion, or why the case is drawn again; `start` has the FMU's start values."""
    values = dict(start) | case.values
    motion = Motion(solver, values, case.rates)
    for at, changed in (*case.changes, (STOP, {})):
        motion.advance(at, MOST_EVENTS)
        if len(motion.events) >= MOST_EVENTS:
            break
        if changed:
            motion.set_inputs(changed, case.rates)
    events = motion.events
    if len(events) < FEWEST_EVENTS:
        return "few events"
    end = float(motion.time)
    changes = [at for at, _ in case.changes if at < end]
    moments = np.sort([0.0, *changes, *(event.time for event in events), end + 2e-3])
    if np.min(np.diff(moments)) < CLOSEST:
        return "close events"
    if min(event.speed for event in events) < SLOWEST:
        return "slow crossing"
    if motion.margin < CLEAREST:
        return "unclear decision"
    between = (moments[:-1] + moments[1:]) / 2
    points = np.unique(np.round(np.concatenate((changes, between)) * 2**30) / 2**30).tolist()

    again = Motion(solver, values, case.rates)
    ahead = dict(case.changes)
    states, modes = [], []
    for point in points:
        again.advance(point)
        states.append(again.state.astype(float))
        modes.append(again.modes)
        if point in ahead:
            again.set_inputs(ahead[point], case.rates)
    return Truth(again.events, points, np.array(states), modes)


@dataclass(frozen=True)
class Errors:
    """The largest of one run; `wrong` says what is another thing altogether."""

    time: float  # s
    state: float  # rad, m, rad/s, m/s
    wrong: str = ""

    def pass_by(self, method: str) -> bool:
        """Return whether the errors are within the bounds of a method."""
        time, state = BOUNDS[method]
        return not self.wrong and self.time <= time and self.state <= state


def compare(fmu: Fmu, method: str, case: Case, truth: Truth) -> Errors:
    """Errors of the FMU at the communication points."""
    smooth = INPUTS if case.rates else ()
    with started(fmu, method, TOLERANCE, smooth, **case.values) as instance:
        try:
            return _step_through(instance, case, truth)
        except (FMICallException, UserError) as error:
            if isinstance(error, FMICallException):
                error = instance.failure(error, "in a step")
            return Errors(np.inf, np.inf, str(error))


def _step_through(instance: Instance, case: Case, truth: Truth) -> Errors:
    polynomials = instance.input_polynomials(list(INPUTS), 1) if case.rates else None
    states, time = instance.reals(STATES), instance.reals(["last_event_time"])
    times = np.array([event.time for event in truth.events])
    changes = dict(case.changes)
    t, late, off, seen = 0.0, 0.0, 0.0, 0
    for point, state, modes in zip(truth.points, truth.states, truth.modes, strict=True):
        if polynomials is not None:
            now = case.inputs(t)
            polynomials.view[:] = [[now[x] for x in INPUTS], [case.rates[x] for x in INPUTS]]
            polynomials.set()
        instance.do_step(t, point - t)
        states.get(), time.get()
        count = instance.integer("event_count")
        expected = int(np.searchsorted(times, point))
        found = (instance.integer("mode1"), instance.integer("mode2"))
        if count != expected:
            return Errors(late, off, f"{count} events, expected {expected} at {point!r} s")
        if found != modes:
            return Errors(late, off, f"modes {found}, expected {modes} at {point!r} s")
        off = max(off, float(np.max(np.abs(states.view - state))))
        if count > seen:
            late = max(late, abs(time.view.item() - times[count - 1]))
            seen = count
        for name, value in changes.get(point, {}).items():
            instance.set(name, value)
        t = point
    return Errors(late, off)


def exchange(path: Path, case: Case, truth: Truth) -> Errors:
    """Return the errors of Model Exchange, with discrete states updated twice at each event."""
    efforts = (lambda t: {name: case.inputs(t)[name] for name in INPUTS}) if case.rates else None
    names = (*STATES, "last_event_time", "event_count", "mode1", "mode2")
    with model(path, 2, **case.values) as plant:
        points, changes = np.array(truth.points), dict(case.changes)
        rows = plant.simulate(points, changes, TOLERANCE, names, efforts)
        if any(plant.jumps[1::2]):
            return Errors(np.inf, np.inf, "states jump at a second update")
    times = np.array([event.time for event in truth.events])
    expected = np.searchsorted(times, truth.points)
    if not np.array_equal(rows[:, 5:], np.column_stack((expected, truth.modes))):
        return Errors(np.inf, np.inf, "other events or modes")
    late = np.abs(rows[expected > 0, 4] - times[expected[expected > 0] - 1])
    return Errors(float(late.max(initial=0.0)), float(np.abs(rows[:, :4] - truth.states).max()))


@dataclass(frozen=True)
class Outcome:
    """A case with its errors by method."""

    number: int
    case: Case
    truth: Truth
    errors: dict[str, Errors]


def judge_all(
    fmu: Fmu,
    solver: Solver,
    count: int,
    seed: int,
    draw: Callable[[np.random.Generator], Case] = random_case,
) -> list[Outcome]:
    """Outcomes of random cases."""
    start = fmu.model.start_values
    outcomes: list[Outcome] = []
    number = 0
    while len(outcomes) < count:
        case = draw(np.random.default_rng((seed, number)))
        number += 1
        truth = simulate(solver, case, start)
        if isinstance(truth, str):
            continue
        errors = {method: compare(fmu, method, case, truth) for method in METHODS}
        if not (case.rates and case.changes):  # fmpy's CVode sees inputs that move jump too early
            path = fmu.path if number % 2 else fmi3_fmu(fmu.path)
            errors[EXCHANGE] = exchange(path, case, truth)
        outcomes.append(Outcome(number - 1, case, truth, errors))
    return outcomes


Outcomes = dict[str, list[Outcome]]


@pytest.fixture(scope="module")
def outcomes(fmi2_plant: Fmu) -> Outcomes:
    """Of cases with rigid stops, and with compliant ones."""
    solver = Solver()
    kinds = {"rigid": (24, 7, random_case), "compliant": (8, 14, compliant_case)}
    return {kind: judge_all(fmi2_plant, solver, *draws) for kind, draws in kinds.items()}


@pytest.mark.parametrize("method", BOUNDS)
@pytest.mark.parametrize("kind", ["rigid", "compliant"])
def test_events_and_states_agree(outcomes: Outcomes, kind: str, method: str) -> None:
    """Times to 1e-9 s, states to 1e-8 (in Model Exchange ten times that), and the same modes."""
    errors = [(x.number, x.errors[method]) for x in outcomes[kind] if method in x.errors]
    assert len(errors) >= 6 and [(n, e) for n, e in errors if not e.pass_by(method)] == []


def test_rigid_cases_are_worth_it(outcomes: Outcomes) -> None:
    """Joints come to rest, break away and strike both stops, with a payload that comes and goes."""
    cases = outcomes["rigid"]
    kinds = Counter(event.what for x in cases for event in x.truth.events)
    assert kinds["forward"] > len(cases) and kinds["lower"] + kinds["upper"] > len(cases)
    assert kinds["backward"] > 0
    assert sum(len(x.truth.events) == MOST_EVENTS for x in cases) > len(cases) / 2
    assert any(x.case.changes for x in cases) and any(x.case.rates for x in cases)


def test_compliant_cases_are_worth_it(outcomes: Outcomes) -> None:
    """Contacts begin and end at both stops, and one stop releases a joint."""
    cases = outcomes["compliant"]
    assert all(COMPLIANT in (x.case.values["stops1"], x.case.values["stops2"]) for x in cases)
    kinds = Counter(event.what for x in cases for event in x.truth.events)
    assert kinds["lower"] > len(cases) and kinds["upper"] > len(cases) and kinds["push"] > 0


@pytest.mark.long
@pytest.mark.parametrize(("count", "draw"), [(200, random_case), (100, compliant_case)])
def test_hundreds_of_others_agree(fmi2_plant: Fmu, count: int, draw: Callable) -> None:
    for outcome in judge_all(fmi2_plant, Solver(), count, 0, draw):
        for method, errors in outcome.errors.items():
            assert errors.pass_by(method), (method, errors, outcome)
