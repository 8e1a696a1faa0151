"""Friction and stops where something else happens at the same instant: closed forms."""

from collections.abc import Callable

import numpy as np
import pytest

from tests.contacts.test_closed_forms import EACH_METHOD, STUCK, UPPER
from tests.equations.examples import METHODS, made, simulated

BLOCK = """name = "Block"
{head}
[states]
x = {{ start = {x}, derivative = "v" }}
v = {{ start = {v}, derivative = "({push}) - F + P" }}
[discrete]
u = {{ start = {u} }}
count = {{}}
{more}
[friction.slide]
force = "F"
velocity = "v"
coulomb = "{coulomb}"
[stops.slide]
force = "P"
position = "x"
velocity = "v"
upper = "{upper}"
restitution = "{e}"
"""
USUAL = {
    "head": "",
    "x": 0,
    "v": 1,
    "push": "u",
    "u": 0,
    "more": "",
    "coulomb": 1,
    "upper": 9,
    "e": 0,
}


def run_of(method: str, stop: float = 3.0, **given: object) -> np.ndarray:
    fmu = made(BLOCK.format(**USUAL | given))
    also = ["event_count", "last_event_time"]
    start = {"solver_method": METHODS[method]}
    return simulated(fmu, stop, 0.1, start, relative_tolerance=1e-11, also=also)


def run_text(text: str, method: str, stop: float, step: float, **options: object) -> np.ndarray:
    options = {"relative_tolerance": 1e-10} | options
    return simulated(made(text), stop, step, {"solver_method": METHODS[method]}, **options)


def agree(run: np.ndarray, x: Callable, v: Callable) -> None:
    t = run["time"]
    assert run["x"] == pytest.approx(np.vectorize(x)(t), abs=1e-9)
    assert run["v"] == pytest.approx(np.vectorize(v)(t), abs=1e-9)


@EACH_METHOD
def test_a_tick_pushes_where_it_halts(method: str) -> None:
    """It halts at 1 s, where a sampler doubles the push: it goes on at once."""
    run = run_of(method, more='[sampled.law]\nevery = "1"\nset = { u = "2 if time > 0.5 else 0" }')
    agree(
        run,
        lambda t: t - t**2 / 2 if t < 1 else 0.5 + (t - 1) ** 2 / 2,
        lambda t: 1 - t if t < 1 else t - 1,
    )


@EACH_METHOD
@pytest.mark.parametrize("more", [1.0, 1.0000001, 0.9999999])
def test_an_effort_equal_to_its_friction(method: str, more: float) -> None:
    """It holds what is equal, to the last bit, and lets go of what is more."""
    run = run_of(method, v=0, u=1, push=f"u * (1 if time < 1 else {more})")
    a = max(0.0, more - 1)
    agree(run, lambda t: a * max(0, t - 1) ** 2 / 2, lambda t: a * max(0, t - 1))
    assert run["friction.slide.mode"].tolist() == [
        STUCK if t < 1 or not a else 3 for t in run["time"]
    ]


@EACH_METHOD
def test_a_force_that_is_switched_where_it_stops(method: str) -> None:
    """The condition x > 0.3 never holds: the stop is there. v^2 = 1 - 2 (1 - 0.5) x on the way."""
    run = run_of(method, push="-50 if x > 0.3 else 0.5", upper=0.3, e=0.5)
    first = 2 * (1 - np.sqrt(0.7))
    v = np.sqrt(0.7) / 2
    halts = first + v / 1.5
    rest = 0.3 - v**2 / 3

    def x(t: float) -> float:
        if t < first:
            return t - t**2 / 4
        s = min(t, halts) - first
        return 0.3 - v * s + 0.75 * s**2

    agree(run, x, lambda t: 1 - t / 2 if t < first else min(0, -v + 1.5 * (t - first)))
    assert run["x"][-1] == pytest.approx(rest, abs=1e-10) and run["event_count"][-1] == 2


@EACH_METHOD
def test_drag_turns_where_it_halts(method: str) -> None:
    """v' = -1 - 4 v |v|: v = tan(...) / 2, until 0."""
    run = run_of(method, push="-4 * v * abs(v)")
    begin = np.arctan(2)
    halts = begin / 2

    def x(t: float) -> float:
        return np.log(np.cos(begin - 2 * min(t, halts)) / np.cos(begin)) / 4

    agree(run, x, lambda t: np.tan(begin - 2 * min(t, halts)) / 2)


@EACH_METHOD
def test_events_see_modes_and_throw(method: str) -> None:
    """Each rest is an event that throws it again, half as fast, three times."""
    run = run_of(
        method, more="[events.rest]\nwhen = 'friction.slide.mode == \"stuck\"'\n"
        'set = { count = "count + 1" }\nreinit = { v = "0.5**(count + 1) if count < 3 else 0" }',
    )  # fmt: skip
    ends = np.cumsum([1, 0.5, 0.25, 0.125])
    clear = np.abs(run["time"][:, None] - ends).min(axis=1) > 1e-9
    counted = [(ends <= t).sum() for t in run["time"]]
    assert run["count"][clear].tolist() == np.array(counted)[clear].tolist()
    assert run["x"][-1] == pytest.approx(sum(0.25**k for k in range(4)) / 2, abs=1e-10)
    assert run["friction.slide.mode"][-1] == STUCK


@EACH_METHOD
def test_a_closed_stop_is_an_event(method: str) -> None:
    event = "[events.closed]\nwhen = 'stops.slide.mode == \"upper\"'\n"
    event += 'set = { count = "count + 1" }'
    run = run_of(method, push="1.5", upper=0.5, e=0.5, more=event)
    assert run["count"][-1] == 1 and run["stops.slide.mode"][-1] == UPPER
    assert run["stops.slide.loss"][-1] <= 0.5 + 0.5 * 1.5
    assert [run["x"][-1], run["v"][-1]] == [0.5, 0]
    forces = [run[f"{name}.slide.force"][-1] for name in ("friction", "stops")]
    assert forces == pytest.approx([1, -0.5])


@EACH_METHOD
def test_a_limit_that_switches_with_the_velocity(method: str) -> None:
    """coulomb = 1 above 0.5, 2 below: halts at 0.5 + 0.25 s."""
    run = run_of(method, coulomb="1 if v > 0.5 else 2")
    agree(
        run,
        lambda t: t - t**2 / 2 if t < 0.5 else 0.375 + 0.0625 - max(0, 0.75 - t) ** 2,
        lambda t: 1 - t if t < 0.5 else max(0, 2 * (0.75 - t)),
    )


@EACH_METHOD
def test_a_clutch_whose_limit_rises_from_0(method: str) -> None:
    """Nothing moves until 1 s; then a push s^2 meets limits of 3 s and 0.5."""
    text = """name = "Closing"
[where]
s = "time - 1 if time > 1 else 0"
[states]
v1 = { derivative = "s**2 - C" }
v2 = { derivative = "C - B" }
[friction.clutch]
force = "C"
velocity = "v1 - v2"
coulomb = "3 * s"
[friction.brake]
force = "B"
velocity = "v2"
coulomb = "0.5"
"""
    run = run_text(text, method, 4, 0.1, relative_tolerance=1e-11)
    s = np.maximum(np.sqrt(0.5), run["time"] - 1)
    v = (s**3 / 3 - s / 2 + np.sqrt(0.5) / 3) / 2
    assert run["v1"] == pytest.approx(v, abs=1e-9) and run["v2"] == pytest.approx(v, abs=1e-9)


def test_contacts_that_no_motion_fits() -> None:
    """Each of two stops drives the other one in."""
    text = """name = "Impossible"
[states]
x = { derivative = "v" }
v = { derivative = "-1 + P - 3 * Q" }
y = { derivative = "w" }
w = { derivative = "-1 - 3 * P + Q" }
[stops]
a = { force = "P", position = "x", velocity = "v", lower = "0", restitution = "0" }
b = { force = "Q", position = "y", velocity = "w", lower = "0", restitution = "0" }
"""
    said: list[str] = []

    def log(_environment: int, _name: bytes, _status: int, _category: bytes, text: bytes) -> None:
        said.append(text.decode())

    with pytest.raises(Exception, match="fmi2ExitInitializationMode"):
        simulated(made(text), 1, 0.1, {}, logger=log)
    assert said == ["at t = 0: no motion fits stops.a and stops.b"]


@EACH_METHOD
def test_an_impact_leaves_the_impulse_of_another_stop(method: str) -> None:
    """Uncoupled: v^2 = 2 3 0.02 at the first stop, 2 3 0.1 at the second one."""
    text = """name = "Apart"
[states]
x = { derivative = "v" }
v = { derivative = "P - 3" }
y = { start = -0.1, derivative = "w" }
w = { derivative = "Q + 3" }
[stops]
a = { force = "P", position = "x", velocity = "v", lower = "-0.02", restitution = "0" }
b = { force = "Q", position = "y", velocity = "w", upper = "0", restitution = "0" }
"""
    end = run_text(text, method, 1, 0.1, relative_tolerance=1e-11)[-1]
    for name, way, sign in (("a", 0.02, 1), ("b", 0.1, -1)):
        assert end[f"stops.{name}.impulse"] == pytest.approx(sign * np.sqrt(6 * way), abs=1e-9)


@EACH_METHOD
def test_two_stops_jam_a_mechanism(method: str) -> None:
    """The second one closes at 0.6325 s, the first one at rest: 1 + 0.5 Q = 0, P + Q = 0."""
    text = """name = "Jam"
[states]
x = { derivative = "v" }
y = { derivative = "w" }
v = { derivative = "1 + 0.5 * Q" }
w = { derivative = "P + Q" }
[stops.a]
force = "P"
position = "y"
velocity = "w"
lower = "-0.479"
restitution = "0"
[stops.b]
force = "Q"
position = "y + 0.5 * x"
velocity = "w + 0.5 * v"
upper = "0.1"
restitution = "0"
"""
    end = run_text(text, method, 2, 0.01)[-1]
    assert [end["x"], end["y"]] == pytest.approx([1.158, -0.479], abs=1e-9)
    assert [end["v"], end["w"]] == pytest.approx([0, 0], abs=1e-12)
    assert [end["stops.a.force"], end["stops.b.force"]] == pytest.approx([2, -2])


@EACH_METHOD
def test_velocities_that_follow_from_each_other_rest_together(method: str) -> None:
    """Friction on v1 - v2 and on v1 + v2 under a sine: as often as an event loop has it."""
    text = """name = "Cross"
[states]
v1 = { derivative = "3.95 * sin(6.3 * time + 1.07) + F - G" }
v2 = { derivative = "-F - G" }
[friction.difference]
force = "F"
velocity = "v2 - v1"
coulomb = "1.66"
[friction.sum]
force = "G"
velocity = "v1 + v2"
coulomb = "2"
"""
    also = ["event_count", "last_event_time"]
    run = run_text(text, method, 3, 0.01, also=also)
    times = np.unique(run["last_event_time"][run["event_count"] > 0])
    assert times[:3] == pytest.approx([0.263984, 0.487271, 0.763129], abs=1e-6)
    assert run["event_count"][-1] == 12


@EACH_METHOD
def test_friction_stops_on_a_closed_stop(method: str) -> None:
    """At rest F = t - 3 t / 2.05, below its limit."""
    text = """name = "Held"
[states]
x = { derivative = "v" }
y = { derivative = "w" }
v = { derivative = "time + P - F" }
w = { derivative = "-3 * time - 2.05 * P" }
[stops.a]
force = "P"
position = "x - 2.05 * y"
velocity = "v - 2.05 * w"
upper = "1"
restitution = "0"
[friction.a]
force = "F"
velocity = "v"
coulomb = "2"
"""
    run = run_text(text, method, 3, 0.01, also=["event_count"])
    end = run[-1]
    assert [end["v"], end["w"], end["friction.a.mode"], end["event_count"]] == [0, 0, STUCK, 2]
    forces = [end["friction.a.force"], end["stops.a.force"]]
    assert forces == pytest.approx([3 - 9 / 2.05, -9 / 2.05])


@EACH_METHOD
def test_an_effort_at_its_limit_that_falls_at_once(method: str) -> None:
    """It stays, without an event, though rounding puts it beyond."""
    run = run_of(method, v=0, push="(3 - 6 * time) / 0.5250000000000001",
                 coulomb="3 / 0.5250000000000001", stop=0.9)  # fmt: skip
    assert run["event_count"][-1] == 0 and run["x"][-1] == 0
