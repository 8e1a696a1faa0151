"""Impacts in every method and kind of run: random models against an event loop, and closed forms.

HYBRID_MODELS: how many random models, and with all of their runs if there are more than 100.
"""

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
import pytest

from tests.equations.examples import METHODS, MODELS
from tests.equations.hybrid import failures
from tests.equations.hybrid_models import KINDS, Polynomial, hybrid
from tests.equations.hybrid_runs import Run, Unit, co_simulation, model_exchange

TEXTS = MODELS["hybrid"]
COUNT = int(os.environ.get("HYBRID_MODELS", "15"))
G = 9.81
EACH_METHOD = pytest.mark.parametrize("method", METHODS)
EACH_KIND = pytest.mark.parametrize("kind", [*METHODS, "model_exchange"])


def run_of(
    unit: Unit, kind: str, step: float, count: int,
    inputs: dict[str, Polynomial] | None = None, tolerance: float = 1e-8,
) -> Run:  # fmt: skip
    """A run by a method in Co-Simulation, or in Model Exchange."""
    if kind == "model_exchange":
        return model_exchange(unit, tolerance, step, count, inputs or {})
    return co_simulation(unit, kind, tolerance, step, count, inputs or {})


def test_random_models_follow_the_event_loop() -> None:
    """All kinds in turn, and two that had failed; a failure gives the command that repeats it."""
    seeds, judged = [*range(COUNT), 777, 812], partial(failures, is_full=COUNT > 100)
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        found = [failure for each in pool.map(judged, seeds) for failure in each]
    assert len(KINDS) <= COUNT
    lines = [f"{failure}\n    {failure.command}" for failure in found]
    texts = [hybrid(seed).text() for seed in sorted({failure.seed for failure in found})]
    assert not found, "\n".join([*lines, *texts])


@pytest.fixture(scope="module")
def unit(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Unit]:
    """Makes the FMUs of a text, once."""
    made: dict[str, Unit] = {}

    def find(text: str) -> Unit:
        if text not in made:
            folder = tmp_path_factory.mktemp("unit")
            made[text] = Unit(folder, text)
        return made[text]

    return find


def ball(size: float = 1.0, when: str = "h < 0", reinit: str = 'h = "0", v = "-v"') -> str:
    """The file of a ball that falls from this height."""
    return TEXTS["BOUNCING"].format(unit=size, g=-G * size, when=when, reinit=reinit)


@EACH_KIND
def test_each_impact_of_a_tiny_ball_is_an_event(unit: Callable, kind: str) -> None:
    """As its nominal; from its highest point it hits after sqrt(2 / G), then after twice that."""
    size, first, count = 1e-12, np.sqrt(2 / G), 250 if kind == "model_exchange" else 800
    run = run_of(unit(ball(size)), kind, 0.01, count)
    times = np.array(run.times)
    assert not run.failure and not run.differences
    assert run.counts == list((times + first) // (2 * first))
    assert run.counts[-1] == (9 if count == 800 else 3)
    flown = np.mod(times + first, 2 * first) - first  # since it was highest
    expected = 1 - G * flown**2 / 2
    assert np.max(np.abs(np.array(run.x)[:, 0] / size - expected)) < 1e-6
    if kind == "model_exchange":  # nor does the importer see more
        run = run_of(unit(ball(size, reinit='v = "-v"')), kind, 0.01, count)
        assert run.counts[-1] == len(run.events) == 3


@pytest.mark.parametrize("reinit", ['h = "0", v = "-0.5 * v"', 'v = "-0.5 * v"'])
@EACH_METHOD
def test_impacts_without_end_do_not_let_it_fall_through(
    unit: Callable, method: str, reinit: str
) -> None:
    """They accumulate at 3 sqrt(2 / G), 1.355 s."""
    run = co_simulation(unit(ball(1.0, reinit=reinit)), method, 1e-8, 0.01, 200, {})
    stays_above(run)


@pytest.mark.parametrize(
    ("reinit", "restitution"), [("", 0.2), ("", 0.5), *(('h = "0", ', e) for e in (0.2, 0.5, 0.8))]
)
def test_impacts_without_end_in_model_exchange(
    unit: Callable, reinit: str, restitution: float
) -> None:
    """They end in an error where flights become too low for the importer, or stay on the floor."""
    losing = unit(ball(1.0, reinit=f'{reinit}v = "-{restitution} * v"'))
    run = model_exchange(losing, 1e-8, 0.01, 420, {})
    total = np.sqrt(2 / G) * (1 + restitution) / (1 - restitution)
    assert min(x[0] for x in run.x) > -1e-4
    assert run.times[-1] > total - 0.04
    assert run.failure


def stays_above(run: Run) -> None:
    assert min(x[0] for x in run.x) > -1e-6
    assert run.times[-1] > 1.34
    assert run.failure or run.counts[-1] > 10


TOUCHES = """h < 0; 0 > h; h <= 0; 0 >= h; 2 - h > 2
h < low; h < -f; rises + falls < 0; h + ramp < ramp; h + time < time
ramp**2 < 0; 1 + ramp**2 < 1; 3 * time**2 - 3 * time + 0.75 < 0
rises < 3 * time + f""".splitlines()


def touch(conditions: str) -> str:
    """The file with an event for each condition."""
    head, event = TEXTS["TOUCH"].split("[events.touch]")
    events = (event.format(when=when) for when in conditions.split("; "))
    return head.format() + "".join(f"[events.touch{k}]{text}" for k, text in enumerate(events))


@pytest.mark.parametrize("conditions", TOUCHES)
@EACH_KIND
def test_a_touch_is_no_event(unit: Callable, kind: str, conditions: str) -> None:
    """h = 3 (t - 0.5)**2 is 0 at 0.5 s, up to errors that decide what is below 0."""
    f = Polynomial(-0.75 if "rises <" in conditions else 0.0, 0.0, 0.0)
    makes_no_event(unit(touch(conditions)), kind, f)


@pytest.mark.parametrize(("a", "m"), [(0.7, 0.5), (1.3, 0.3), (0.7e-9, 0.5)])
@EACH_KIND
def test_an_input_may_touch_up_to_its_rounding(
    unit: Callable, kind: str, a: float, m: float
) -> None:
    """As a sum, f = a (t - m)**2 falls up to 1e-16 a below 0; 1e-9 a below 0 it is an event."""
    touching = unit(touch("f < 0"))
    makes_no_event(touching, kind, Polynomial(a * m**2, -2 * a * m, 2 * a))
    below = Polynomial(a * m**2 - 1e-9 * a, -2 * a * m, 2 * a)
    assert run_of(touching, kind, 0.01, 100, {"f": below}).x[-1][-1] == 1.0


def makes_no_event(touching: Unit, kind: str, f: Polynomial) -> None:
    for step, tolerance in ((1e-3, 1e-5), (1e-3, 1e-11), (0.01, 1e-8), (0.1, 1e-5), (0.125, 1e-8)):
        run = run_of(touching, kind, step, round(1 / step), {"f": f}, tolerance)
        assert not run.failure
        assert run.x[-1][-1] == 0.0, (step, tolerance)


class Sine(Polynomial):
    """An input that passes 100 once upward in each period of 1 s."""

    def at(self, t: float) -> tuple[float, float, float]:
        size, w = self.value, 2 * np.pi
        return (
            100 - size * np.cos(w * t), size * w * np.sin(w * t), size * w**2 * np.cos(w * t),
        )  # fmt: skip


@pytest.mark.parametrize("size", [1.0, 1e-2])
@EACH_KIND
def test_an_input_that_moves_makes_an_event_a_period(
    unit: Callable, kind: str, size: float
) -> None:
    inputs = {"f": Sine(size, 0.0, 0.0)}
    run = run_of(unit(TEXTS["INPUT"]), kind, 0.01, 500, inputs, 1e-5)
    assert not run.failure
    assert run.x[-1][1] == 5.0


@pytest.mark.parametrize("step", [0.01, 0.003])
@pytest.mark.parametrize("limit", ["0", "0.1 * v"])
@EACH_KIND
def test_two_events_at_one_limit_fire_in_turn(
    unit: Callable, kind: str, limit: str, step: float
) -> None:
    """Of the two, only one's mode is on: x = cos t passes the limit once in pi."""
    turns = unit(TEXTS["TURNS"].format(rate="-x", limit=limit, reinit=""))
    run = run_of(turns, kind, step, round(20 / step))
    first = np.pi / 2 if limit == "0" else np.pi / 2 + np.arctan(0.1)  # cos t = -0.1 sin t
    assert not run.failure
    assert run.x[-1][2] == 1 + np.floor((20 - first) / np.pi + 1)


@EACH_KIND
def test_a_rocking_block_loses_speed_once_an_impact(unit: Callable, kind: str) -> None:
    """It turns back at 1 m/s2 on either side and keeps half its speed at each impact."""
    rate, reinit = "-1 if positive else 1", ', v = "0.5 * v"'
    run = run_of(unit(TEXTS["TURNS"].format(rate=rate, limit="0", reinit=reinit)), kind, 0.01, 400)
    speed = np.sqrt(2)
    impacts = [speed + 2 * speed * (1 - 0.5**k) for k in range(4)]  # then 2 v until the next
    assert not run.failure
    assert run.x[-1][2] == 1 + sum(impact < 4 for impact in impacts)
    flown, v = 4 - impacts[3], speed / 16
    assert run.x[-1][0] == pytest.approx(v * flown - flown**2 / 2, abs=1e-6)


@pytest.mark.parametrize("model", TEXTS["LEAVING"].values(), ids=TEXTS["LEAVING"])
@EACH_KIND
def test_what_leaves_its_limit_at_rest_leaves_it_once(
    unit: Callable, kind: str, model: dict
) -> None:
    """There an indicator is 0 with its rate: no error of a method decides which event follows."""
    text = model.get("text", TEXTS["LEAVING"]["table"]["text"])
    for old, new in model.get("changes", ()):
        text = text.replace(old, new)
    events = np.add.outer(model["events"], np.arange(10) * model["period"])
    for step in (1.0, 0.1, 0.01, 0.003):
        run = run_of(unit(text), kind, step, round(model["until"] / step), tolerance=1e-9)
        assert not run.failure
        for t, count in zip(run.times, run.counts, strict=True):
            assert np.sum(events < t - 1e-5) <= count <= np.sum(events < t + 1e-5), (step, t)


@pytest.mark.parametrize("limit, rate", [("x > 1", "1e-11"), ("x * y > 2", "1e-8")])
@pytest.mark.parametrize("kind", METHODS)
def test_what_creeps_off_its_limit_has_left_it(
    unit: Callable, kind: str, limit: str, rate: str
) -> None:
    """However slow it is: the slope is exact."""
    text = TEXTS["CREEPS"].replace("RATE", rate).replace("LIMIT", limit)
    run = run_of(unit(text), kind, 1.0, 20, tolerance=1e-4)
    assert not run.failure
    assert run.x[-1][1] == pytest.approx(19.0, abs=1e-9)


@EACH_KIND
def test_an_integrator_leaves_its_limit_where_its_rate_turns(unit: Callable, kind: str) -> None:
    """There rounding decides whether x' = cos t is above 0; x = sin t, less 1 / 2 after 1 / 2."""
    run = run_of(unit(TEXTS["CLAMP"]), kind, 0.1, 75)
    t, x = np.array(run.times), np.array(run.x)[:, 0]
    falls = np.maximum(np.sin(t) - 0.5, -0.5)
    rises = np.minimum(np.sin(t) + 0.5, 0.5)
    assert not run.failure
    expected = [np.minimum(np.sin(t), 0.5), falls, rises]
    assert x == pytest.approx(
        np.choose(np.searchsorted([np.pi / 2, 1.5 * np.pi], t), expected), abs=1e-6
    )


@pytest.mark.parametrize("step", [0.25, 0.1, 0.05])
@EACH_KIND
def test_conditions_behind_a_guard_switch(unit: Callable, kind: str, step: float) -> None:
    """At the end of the guard, s = 0, log(s) is infinite and the slope of the root, too."""
    run = run_of(unit(TEXTS["GUARDS"]), kind, step, round(3 / step))
    assert not run.failure
    w = 0.7 * 0.49 + (2**1.5 - 0.7**3) / 1.5
    assert run.x[-1] == pytest.approx([2.0, 1.75, w, 2 - np.exp(-1)], abs=1e-5)
