"""Model Exchange at and around the roots of all event indicators, in both versions of FMI: wherever
the root finder of an importer ends, one update passes the event, and a second one changes nothing.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_model_exchange import STATES, PlantModel, model
from tests.rp_plant.fmu.plant_runs import COMPLIANT, RIGID

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
