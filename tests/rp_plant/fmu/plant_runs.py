"""Runs of the built FMUs of the plant: started by name, stepped, with the events they report."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import pytest
from fmpy.fmi1 import FMICallException

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu

METHODS = {"cvode_adams": 1, "cvode_bdf": 2, "erk": 3, "taylor": 4}
STEPS = {"1 ms": 1e-3, "10 ms": 1e-2, "1 s": 1.0}
NONE, RIGID, COMPLIANT = 1, 2, 3  # stops
KEEP_VELOCITY, AT_REST = 1, 2  # grasp
each_method = pytest.mark.parametrize("method", METHODS)
each_step = pytest.mark.parametrize("h", STEPS.values(), ids=STEPS)
FIRM = 1000.0  # N.m, N: dry friction that holds a joint whatever happens

# friction and stops that give events of all kinds
FRICTION = {
    "coulomb_friction1": 1.5, "breakaway_friction1": 2.0, "stribeck_velocity1": 0.2,
    "coulomb_friction2": 2.0, "breakaway_friction2": 2.6, "stribeck_velocity2": 0.1,
}  # fmt: skip
BOUNCY_STOPS = {
    "stops1": RIGID, "lower1": -0.6, "upper1": 0.9, "restitution1": 0.5, "stops2": RIGID,
    "lower2": -0.1, "upper2": 0.2, "restitution2": 0.7,
}  # fmt: skip


def near(x: float, bound: float = 1e-9) -> float:
    """Equal to x within a bound in its unit."""
    return pytest.approx(x, rel=0, abs=bound)


class Event(NamedTuple):
    """The last event at a communication point; several within one step are seen as the last."""

    count: int
    time: float  # s


@contextmanager
def started(
    fmu: Fmu,
    method: str = "cvode_adams",
    tolerance: float = 1e-10,
    smooth_inputs: tuple[str, ...] = (),
    **values: float | bool,
) -> Iterator[Instance]:
    """An instance at t = 0, with these parameters, start values and inputs."""
    with fmu.instance("plant", smooth_inputs) as instance:
        instance.set_up(0.0, None, tolerance)
        instance.set("solver_method", METHODS[method])
        for name, value in values.items():
            instance.set(name, value)
        instance.enter_initialization()
        instance.exit_initialization()
        try:
            yield instance
        except FMICallException as error:
            raise instance.failure(error, "in a call") from error


def read(instance: Instance, *names: str) -> list[float]:
    """Values of Real variables."""
    reals = instance.reals(names)
    reals.get()
    return reals.view.tolist()


def modes(instance: Instance) -> tuple[int | None, int | None]:
    return instance.integer("mode1"), instance.integer("mode2")


def last_event(instance: Instance) -> Event:
    return Event(instance.integer("event_count") or 0, *read(instance, "last_event_time"))


def events(
    instance: Instance, h: float, stop: float, slopes: dict[str, float] | None = None
) -> list[Event]:
    """Step by `h` (s) from 0 to `stop`: the last event of each step that had one.

    `slopes`: inputs that are slope times t (per s), which `started` was given as smooth ones.
    """
    slopes = slopes or {}
    polynomials = instance.input_polynomials(list(slopes), 1) if slopes else None
    time = instance.reals(["last_event_time"])
    found: list[Event] = []
    count, t = 0, 0.0
    for i in range(round(stop / h)):
        t = i * h
        if polynomials is not None:
            polynomials.view[:] = [[r * t for r in slopes.values()], list(slopes.values())]
            polynomials.set()
        instance.do_step(t, h)
        if instance.integer("event_count") != count:
            count = instance.integer("event_count") or 0
            time.get()
            found.append(Event(count, time.view.item()))
    return found
