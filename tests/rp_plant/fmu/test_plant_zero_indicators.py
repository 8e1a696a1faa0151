"""Events where an indicator begins or ends at 0, which rounding may leave on either side: each one
comes once, at communication points, after long internal steps, and in Model Exchange wherever the
root finder of an importer ends."""

import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_model_exchange import STATES, PlantModel, model
from tests.rp_plant.fmu.plant_runs import (
    COMPLIANT,
    FIRM,
    METHODS,
    RIGID,
    each_method,
    events,
    last_event,
    modes,
    near,
    read,
    started,
)

# ---- At communication points, and after long internal steps --------------------------------------


@each_method
@pytest.mark.parametrize(
    ("effort", "rate", "h", "expected", "values"),
    [
        ("f2", 2.0, 1e-3, 1.65, {"coulomb_friction2": 3.3, "coulomb_friction1": FIRM}),
        ("f2", 2.0, 1e-2, 1.65, {"coulomb_friction2": 3.3, "coulomb_friction1": FIRM}),
        # at (24.9 + 11.772) / 12
        ("tau1", 12.0, 1e-3, 3.056, {"coulomb_friction1": 24.9, "coulomb_friction2": FIRM}),
    ],
)
def test_a_joint_breaks_away_once_at_a_communication_point(
    fmi2_plant: Fmu, method: str, effort: str, rate: float, h: float, expected: float, values: dict
) -> None:
    q2 = 0.2 if effort == "tau1" else 0.0
    with started(fmi2_plant, method, smooth_inputs=(effort,), q2=q2, **values) as instance:
        found = events(instance, h, round(expected + 0.1, 1), {effort: rate})
        assert found == [(1, near(expected))]


@each_method
def test_a_motion_continues_after_an_impact_that_ends_a_long_step(
    fmi2_plant: Fmu, method: str
) -> None:
    """Before it the motion is uniform, and internal steps grow to seconds."""
    stops = {"stops1": RIGID, "lower1": -0.5, "upper1": 0.5}
    values = {"g": 0.0, "a": 0.15, "dq1": 0.8, "coulomb_friction2": 2.0}
    with started(fmi2_plant, method, **stops, **values) as instance:
        instance.do_step(0.0, 0.5)
        instance.do_step(0.5, 0.5)
        # plastic: q1 stays, the slide moves at -a dq1 and friction stops it
        assert read(instance, "dq1", "dq2") == [0.0, 0.0]


@each_method
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_two_joints_pushed_onto_their_stops_come_to_rest(
    fmi2_plant: Fmu, method: str, e: float
) -> None:
    """Each impact of one kicks the other off its stop, and it comes back."""
    stops = {"stops1": RIGID, "lower1": -0.5, "restitution1": e}
    stops |= {"stops2": RIGID, "lower2": -0.5, "restitution2": e}
    with started(fmi2_plant, method, 1e-8, f2=-20.0, **stops) as instance:
        before, _ = read(instance, "total_energy", "impact_loss")
        for i in range(100):
            instance.do_step(i * 0.02, 0.02)
        assert modes(instance) == (0, 0)
        assert read(instance, "q1", "q2", "dq1", "dq2") == [-0.5, -0.5, 0.0, 0.0]
        after, loss = read(instance, "total_energy", "impact_loss")
        work = -20.0 * -0.5
        assert after == pytest.approx(before + work - loss, rel=0, abs=1e-6 * (before + work))
        # the stops carry gravity and f2
        gravity1, gravity2 = read(instance, "gravity1", "gravity2")
        forces = read(instance, "stop_force1", "stop_force2")
        assert forces == pytest.approx([gravity1, gravity2 + 20.0], rel=1e-12)


# ---- Events that must come once ------------------------------------------------------------------


def ramp(instance: Instance, begin: dict[str, float], rates: dict[str, float]) -> None:
    """Inputs of the next step, and their derivatives; `started` was given them as smooth ones."""
    polynomials = instance.input_polynomials(list(begin), 1)
    polynomials.view[:] = [list(begin.values()), [rates.get(name, 0.0) for name in begin]]
    polynomials.set()


@each_method
@pytest.mark.parametrize("others", [{"dq2": 0.5}, {"coulomb_friction2": 1.0}])
def test_efforts_at_their_limit_that_go_back(
    fmi2_plant: Fmu, method: str, others: dict[str, float]
) -> None:
    """A joint at exactly its friction stays where the effort falls, to break away backward."""
    friction, rate = 3.0, -6.0
    values = {"g": 0.0, "a": 0.0, "coulomb_friction1": friction, **others}
    with started(fmi2_plant, method, 1e-12, ("tau1",), **values) as instance:
        ramp(instance, {"tau1": friction}, {"tau1": rate})
        instance.do_step(0.0, 0.5)
        assert (modes(instance)[0], last_event(instance).count) == (0, 0)
        ramp(instance, {"tau1": 0.0}, {"tau1": rate})
        instance.do_step(0.5, 0.6)
        assert modes(instance)[0] == -1
        count, time = last_event(instance)
        assert (count, time) == (1, pytest.approx(2 * friction / -rate, rel=0, abs=1e-9))


@each_method
def test_a_slide_that_nothing_pushes_rests_on_its_stop(fmi2_plant: Fmu, method: str) -> None:
    with started(fmi2_plant, method, stops2=RIGID, lower2=0.0, g=0.0) as instance:
        instance.do_step(0.0, 1.0)
        assert (modes(instance)[1], last_event(instance).count) == (0, 0)


@each_method
@pytest.mark.parametrize("stops", [RIGID, COMPLIANT])
@pytest.mark.parametrize("limit", [0.3, 1000.0])
def test_a_joint_that_leaves_its_stop_does_not_meet_it(
    fmi2_plant: Fmu, method: str, stops: int, limit: float
) -> None:
    """Breaking away from it is the only event; the rounding of the limit is no contact."""
    friction, rate = 3.0, -4.0
    values = {"g": 0.0, "a": 0.0, "coulomb_friction1": FIRM, "coulomb_friction2": friction}
    stop = {"stops2": stops, "upper2": limit, "lower2": limit - 0.5, "stop_stiffness2": 1e4}
    with started(fmi2_plant, method, 1e-10, ("f2",), q2=limit, **values, **stop) as instance:
        ramp(instance, {"f2": 0.0}, {"f2": rate})
        instance.do_step(0.0, 1.0)
        count, time = last_event(instance)
        assert (count, time) == (1, pytest.approx(friction / -rate, rel=0, abs=1e-9))


# ---- Pulls at random -------------------------------------------------------------------------

MOST = 300  # events of a step; without repeated ones a step here has far fewer


def joint_values(chance: random.Random, joint: int) -> dict[str, float]:
    """Friction and stops of a joint that begins at 0, at its stops or between them."""
    values: dict[str, float] = {f"dq{joint}": chance.choice([0.0, chance.uniform(-2, 2)])}
    if chance.random() < 0.5:
        coulomb = chance.choice([1.0, 3.0, 1e-6, 1e6, chance.uniform(0.1, 5)])
        values[f"coulomb_friction{joint}"] = coulomb
        values[f"breakaway_friction{joint}"] = coulomb * chance.choice([1.0, 1.4])
        values[f"stribeck_velocity{joint}"] = 10 ** chance.uniform(-3, 0)
    if chance.random() < 0.9:
        values[f"stops{joint}"] = chance.choice([RIGID, COMPLIANT, COMPLIANT, COMPLIANT])
        values[f"lower{joint}"] = -chance.choice([0.0, 0.2, chance.uniform(0, 0.5)])
        values[f"upper{joint}"] = chance.choice([0.2, chance.uniform(1e-3, 0.5)])
        values[f"stop_stiffness{joint}"] = 10 ** chance.uniform(1, 6)
        values[f"stop_damping{joint}"] = chance.choice([0.0, 1.5, 10 ** chance.uniform(-2, 1)])
    return values


def test_pulls_at_random_end(fmi2_plant: Fmu) -> None:
    """At all indicators, with all methods and the tightest tolerances: no event repeats itself."""
    chance = random.Random(28)
    for _ in range(200):
        method = chance.choice(list(METHODS))
        values = joint_values(chance, 1) | joint_values(chance, 2)
        values |= {"g": chance.choice([0.0, 9.81]), "a": chance.choice([0.0, 0.1, -0.3])}
        tolerance = chance.choice([1e-12, 1e-12, 1e-11])
        values |= {"relative_tolerance": tolerance, "max_events": MOST}
        with started(fmi2_plant, method, tolerance, ("tau1", "f2"), **values) as instance:
            time = 0.0
            for _ in range(10):
                begin, rates = {}, {}
                for name in ("tau1", "f2"):
                    begin[name] = chance.choice([0.0, -3.0, 1.0, chance.uniform(-300, 300)])
                    size = 10 ** chance.uniform(0, 4)
                    rates[name] = chance.choice([0.0, math.copysign(size, chance.random() - 0.5)])
                ramp(instance, begin, rates)
                step = 10 ** chance.uniform(-3, -1)
                instance.do_step(time, step)
                time += step


# ---- Model Exchange at and around the roots of all indicators ------------------------------------

# Wherever a root finder ends, one update passes the event, and a second one changes nothing.
LOWER, UPPER = -0.2, 0.3
LOOSE = {"g": 0.0, "a": 0.0}  # the joints do not move each other
SOFT = {"stop_stiffness": 2e3, "stop_damping": 1.5}
AROUND = 1e-10  # so far from its root an importer may end, in the unit of an indicator and of what
# a force is compared with


class Root(NamedTuple):
    """A way on which one indicator falls to 0 with a slope of 1 or more."""

    joint: int
    indicator: str  # without the joint
    values: dict[str, float]  # parameters and efforts of the joint
    varied: str  # q, dq or effort of the joint
    start: float
    end: float
    state: dict[str, float] = {}  # other states of the joint, where it starts
    before: int = 2  # mode of the joint
    after: int = 2


def breakaways(joint: int) -> list[Root]:
    """Of friction, and of a stop without friction."""
    found = []
    for sign, way in (1, "forward"), (-1, "backward"):
        side = {"q": LOWER if sign > 0 else UPPER}
        for size in (3.0, 1e-3, 1e3):
            friction = {"coulomb_friction": size}
            found.append(
                Root(joint, f"slip_{way}", friction, "effort", 0.0, 2 * sign * size, {}, 0, sign)
            )
        stop = {"stops": RIGID, "lower": LOWER, "upper": UPPER}
        found.append(Root(joint, f"slip_{way}", stop, "effort", -sign, sign, side, 0, 2))
    return found


def moving(joint: int) -> list[Root]:
    """Of velocities and positions."""
    found = []
    for side in (1, -1):
        name = "lower" if side > 0 else "upper"
        limits = {"lower": LOWER, "upper": UPPER, "restitution": 0.5}
        limit, into = limits[name], -1.5 * side
        inside, outside = limit + 0.05 * side, limit - 0.05 * side
        soft = limits | SOFT | {"stops": COMPLIANT}
        contact = 1 / SOFT["stop_damping"]  # out of the stop: from here on it does not push
        found += [
            Root(joint, "slip_forward", {"coulomb_friction": 3.0}, "dq", side, -side, {}, side, 0),
            Root(joint, f"stop_{name}", limits | {"stops": RIGID}, "q", inside, outside,
                 {"dq": into}),
            Root(joint, f"stop_{name}", soft, "q", inside, outside, {"dq": into}),
            Root(joint, f"stop_{name}", soft, "q", outside, inside, {"dq": -into / 3}),
            Root(joint, "stop_push", soft | {"effort": 200.0 * side}, "dq", 0.0,
                 2 * side * contact, {"q": outside}),
            Root(joint, "stop_push", soft | {"effort": -200.0 * side}, "dq", 2 * side * contact,
                 0.0, {"q": outside}),
        ]  # fmt: skip
    return found


ROOTS = [root for joint in (1, 2) for root in (*breakaways(joint), *moving(joint))]


def name_of(root: Root) -> str:
    kind, _, which = root.indicator.partition("_")
    return f"{kind}{root.joint}_{which}"


class Way:
    """An instance that is put on the way of a root, from the same saved state again and again."""

    def __init__(self, plant: PlantModel, root: Root) -> None:
        self.plant, self.root = plant, root
        self.time = 0.5
        self.names = [n for n in plant.variables if n.startswith(("slip", "stop1_", "stop2_"))]
        self.move(root.start)
        plant.handle_event({})
        self.start = plant.fmu.getFMUState()

    def effort(self, value: float) -> None:
        self.plant.set("tau1" if self.root.joint == 1 else "f2", value)

    def move(self, value: float) -> float:
        """To a value of what is varied; the indicator there."""
        state = {"q": 0.0, "dq": 0.0} | self.root.state
        if self.root.varied == "effort":
            self.effort(value)
        else:
            state[self.root.varied] = value
        x = np.zeros(len(STATES))
        x[[self.root.joint - 1, self.root.joint + 1]] = state["q"], state["dq"]
        self.plant.fmu.setTime(self.time)
        self.plant.set_states(x)
        return self.plant.get(name_of(self.root))

    def put(self, value: float) -> float:
        """From the start to a value of what is varied; the indicator there."""
        self.plant.fmu.setFMUState(self.start)
        return self.move(value)

    def seen(self) -> list[float]:
        counted = ("event_count", "last_event_time", "mode1", "mode2", *STATES)
        return [self.plant.get(name) for name in (*counted, *self.names)]

    def update(self) -> list[float]:
        """All that follows one update, and each indicator is above 0; a second one does nothing."""
        self.plant.handle_event({})
        seen = self.seen()
        assert min(seen[-len(self.names) :]) > 0.0
        self.plant.handle_event({})
        assert self.seen() == seen
        return seen

    def root_of_indicator(self) -> tuple[float, float]:
        """Neighbours: the last value of what is varied with the indicator above 0, and the next."""
        above, below = self.root.start, self.root.end
        assert self.put(above) > 0.0 >= self.put(below)
        while math.nextafter(above, below) != below:
            middle = (above + below) / 2
            if middle in (above, below):
                middle = math.nextafter(above, below)
            if self.put(middle) > 0.0:
                above = middle
            else:
                below = middle
        return above, below


each_root = pytest.mark.parametrize("root", ROOTS, ids=lambda r: f"{name_of(r)}-{r.varied}")


def on_way(path: Path, root: Root, check: Callable[[Way], None]) -> None:
    values = dict(root.values)
    effort = values.pop("effort", 0.0)
    parameters = {f"{name}{root.joint}": value for name, value in values.items()}
    start = {f"{name}{root.joint}": value for name, value in root.state.items()}
    drive = {"tau1" if root.joint == 1 else "f2": effort}
    with model(path, **LOOSE, **parameters, **start, **drive) as plant:
        check(Way(plant, root))


def check_passes(way: Way) -> None:
    root = way.root
    above, below = way.root_of_indicator()
    direction = math.copysign(1.0, root.end - root.start)
    points = [above, below, math.nextafter(above, root.start), math.nextafter(below, root.end)]
    size = root.values.get("coulomb_friction", 1.0) if root.varied == "effort" else 1.0
    around = direction * AROUND * max(1.0, size)
    points += [below + s * around for s in (-0.6, -0.1, 0.1, 1.0, 1e4)]
    for point in points:
        way.put(point)
        before = way.seen()
        assert before[1 + root.joint] == root.before
        seen = way.update()
        assert seen[0] == before[0] + 1 and seen[1] == way.time, point
        assert seen[1 + root.joint] == root.after, point


def check_waits(way: Way) -> None:
    """A force at its limit holds, and its indicator is still above 0: its fall will be seen."""
    root = way.root
    points = [way.root_of_indicator()[0] + math.copysign(1e-6, root.start - root.end)]
    if root.varied == "effort":
        points = [(root.start + root.end) / 2]
    for point in points:
        assert way.put(point) > 0.0
        before = way.seen()
        assert way.update() == before


@each_root
def test_one_update_passes_an_event(plant: Fmu, root: Root) -> None:
    on_way(plant.path, root, check_passes)


def check_leaves_0(way: Way) -> None:
    _, below = way.root_of_indicator()
    way.put(below)
    before = way.seen()
    assert way.update()[0] == before[0] + 1


def test_an_indicator_does_not_stay_at_0(plant: Fmu) -> None:
    """The stop has just let go, and nothing pulls the slide on: a later fall would be unseen."""
    soft = SOFT | {"stops": COMPLIANT, "lower": LOWER, "upper": UPPER}
    root = Root(2, "stop_push", soft, "dq", 0.0, 1.0, {"q": LOWER - 0.05})
    on_way(plant.path, root, check_leaves_0)


@each_root
def test_an_update_before_the_root_changes_nothing(plant: Fmu, root: Root) -> None:
    on_way(plant.path, root, check_waits)
