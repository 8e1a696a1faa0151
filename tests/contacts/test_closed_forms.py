"""Friction and stops against closed forms: all methods, both versions of FMI, two tolerances."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.equations.examples import METHODS, quick, simulated

BUILT = TemporaryDirectory(prefix="rparm-contacts-")
EACH_METHOD = pytest.mark.parametrize("method", METHODS)
EACH_RUN = pytest.mark.parametrize(
    ("version", "tolerance"), [*product(["2.0", "3.0"], [1e-8, 1e-11])]
)
BACKWARD, STUCK, FORWARD = 1, 2, 3
FREE, LOWER, UPPER = 1, 2, 3


@cache
def fmus() -> dict[str, Path]:
    with ThreadPoolExecutor(2) as pool:
        files = Path(__file__).parent.glob("*.toml")
        return {fmu.stem: fmu for fmu in pool.map(lambda f: quick(f, Path(BUILT.name)), files)}


Run = Callable[..., np.ndarray]


@pytest.fixture
def run_of(method: str, version: str, tolerance: float) -> Run:
    def run(name: str, stop: float, step: float, **start: float) -> np.ndarray:
        fmu = fmus()[name]
        fmu = fmu if version == "2.0" else fmu.parent / "fmi3" / fmu.name
        start["solver_method"] = METHODS[method]
        also = ["event_count", "last_event_time"]
        return simulated(fmu, stop, step, start, relative_tolerance=tolerance, also=also)

    return run


def agree(run: np.ndarray, tolerance: float, **exact: np.ndarray) -> None:
    """Compare within a hundred times the tolerance."""
    for name, values in exact.items():
        worst = np.abs(run[name] - values).max()
        assert worst <= 100 * tolerance * max(1, np.abs(values).max()), (name, worst)


def has_events_at(run: np.ndarray, tolerance: float, *times: float) -> None:
    """The run has these events, and no others."""
    found = np.unique(run["last_event_time"][run["event_count"] > 0])
    assert run["event_count"][-1] == len(times)
    for t in found:
        assert np.abs(np.array(times) - t).min() <= 100 * tolerance


def pieces(t: np.ndarray, *pairs: tuple[float, Callable]) -> np.ndarray:
    """A function that is another one from each time on, of the time since."""
    value = np.empty_like(t)
    for begin, of in pairs:
        value[t >= begin] = of(t[t >= begin] - begin)
    return value


@EACH_RUN
@EACH_METHOD
def test_a_block_slips_on_its_belt(run_of: Run, tolerance: float) -> None:
    """At c / (k v), then it swings about c / k with the belt's speed as the largest."""
    run = run_of("Belt", 3.5, 0.07)
    slips = 3 / (8 * 0.5)
    x = pieces(run["time"], (0, lambda s: 0.5 * s), (slips, lambda s: 0.375 + 0.25 * np.sin(2 * s)))
    v = pieces(run["time"], (0, lambda s: 0.5 + 0 * s), (slips, lambda s: 0.5 * np.cos(2 * s)))
    agree(run, tolerance, x=x, v=v)
    has_events_at(run, tolerance, slips)
    assert run["friction.belt.mode"].tolist() == np.where(run["time"] < slips, 2, 1).tolist()
    held = run["time"] < slips
    assert run["friction.belt.force"][held] == pytest.approx(-8 * x[held], abs=100 * tolerance)


@EACH_RUN
@EACH_METHOD
def test_two_blocks_break_away_and_stick_again(run_of: Run, tolerance: float) -> None:
    """Relative motion: 2/3 s^2 from 1.5 s, back at 0 after 2 u^2 - 4 u - 2 = 0 from 2.5 s."""
    run, again = run_of("Blocks", 6.0, 0.04), 3.5 + np.sqrt(2)
    at = 2.5 + np.sqrt(2)

    def together(s: np.ndarray) -> np.ndarray:
        return at + (1 - np.sqrt(2)) * s - s**2 / 2

    end = together(5.5 - again)
    alike = [(0, lambda s: 0 * s), (0.5, lambda s: s**2 / 2)]
    v2 = [(1.5, lambda s: 0.5 + s), (again, together), (5.5, lambda s: end - s)]
    v1 = [
        (1.5, lambda s: 0.5 + s + 2 / 3 * s**2),
        (2.5, lambda s: 1.5 + 2 / 3 + (7 * s - 2 * s**2) / 3),
        (again, together),
        (5.5, lambda s: end - s - 2 / 3 * s**2),
    ]
    agree(run, tolerance, v1=pieces(run["time"], *alike, *v1), v2=pieces(run["time"], *alike, *v2))
    has_events_at(run, tolerance, 0.5, 1.5, 2.5, again, 5.5)
    top = pieces(run["time"], *((t, lambda s, m=m: m + 0 * s)
                                for t, m in ((0, 2), (1.5, 1), (again, 2), (5.5, 3))))  # fmt: skip
    assert run["friction.top.mode"].tolist() == top.tolist()


@EACH_RUN
@EACH_METHOD
def test_a_stack_comes_apart_from_above(run_of: Run, tolerance: float) -> None:
    run = run_of("Stack", 6.0, 0.05)
    third = [(0, lambda s: 0 * s), (2, lambda s: s**2 / 6), (3.5, lambda s: 0.375 + 0.5 * s)]
    second = [*third[:2], (3.5, lambda s: 0.375 + 0.5 * s + s**2 / 4)]
    first = [*second, (4.7, lambda s: 1.335 + 1.1 * s + s**2 / 2)]
    second.append((4.7, lambda s: 1.335 + 1.1 * s))
    exact = {f"v[{i}]": pieces(run["time"], *of) for i, of in enumerate((first, second, third), 1)}
    agree(run, tolerance, **exact)
    has_events_at(run, tolerance, 2, 3.5, 4.7)


@EACH_RUN
@EACH_METHOD
def test_a_clutch_locks_and_slips_under_load(run_of: Run, tolerance: float) -> None:
    """Locks at J1 J2 dw / ((J1 + J2) M - ...); slips where M = J2 T / (J1 + J2) + load / 4."""
    run, locks, slips = run_of("Clutch", 22.0, 0.1), 10 / 24, 21.0
    common = 10 / 3
    with_load = common + 2 * (3 - locks)
    common_part = [
        (locks, lambda s: common + 2 * s),
        (3, lambda s: with_load + 2 * s - s**2 / 2),
    ]
    end = with_load + 36 - 162
    w1 = [(0, lambda s: 10 - 16 * s), *common_part, (slips, lambda s: end - 16 * s)]
    w2 = [(0, lambda s: 8 * s), *common_part, (slips, lambda s: end - 16 * s - 2 / 3 * s**2)]
    agree(run, tolerance, w1=pieces(run["time"], *w1), w2=pieces(run["time"], *w2))
    has_events_at(run, tolerance, locks, 3, slips)
    locked = run["friction.plates.mode"] == STUCK
    is_clear = np.abs(run["time"] - slips) > 1e-9  # rounding decides where a point is at an event
    expected = (run["time"] > locks) & (run["time"] < slips)
    assert locked[is_clear].tolist() == expected[is_clear].tolist()
    load = 2 * np.maximum(0, run["time"] - 3)
    torque = 3 + load[locked] / 4
    assert run["friction.plates.force"][locked] == pytest.approx(torque, abs=1e3 * tolerance)


@EACH_RUN
@EACH_METHOD
def test_a_play_closes_after_infinitely_many_impacts(run_of: Run, tolerance: float) -> None:
    """They end at t1 + 2 e v / (a (1 - e)); rest comes early by 2 sqrt(2 tol / a) / (1 - e)."""
    run, first = run_of("Backlash", 1.0, 0.01), np.sqrt(0.02 / 3)
    v, t = 3 * first, run["time"]
    impacts = [first + 2 * v / 3 * sum(0.5**i for i in range(1, k + 1)) for k in range(12)]
    relative = [(0, lambda s: 1.5 * s**2)]
    speed = [(0, lambda s: 3 * s)]
    for k, at in enumerate(impacts):
        up = 0.5 ** (k + 1) * v
        relative.append((at, lambda s, up=up: 0.01 - up * s + 1.5 * s**2))
        speed.append((at, lambda s, up=up: -up + 3 * s))
    ends = first + 2 * v / 3
    known = (t < impacts[-1]) | (t > ends + 1e-9)
    far = np.where(t > ends, 0.01, pieces(t, *relative))
    fast = np.where(t > ends, 0, pieces(t, *speed))
    agree(run[known], tolerance, x1=(t**2 / 2 + 2 / 3 * far)[known])
    agree(run[known], tolerance, v1=(t + 2 / 3 * fast)[known], v2=(t - fast / 3)[known])
    assert run["stops.play.mode"][known].tolist() == np.where(t > ends, UPPER, FREE)[known].tolist()
    assert run["stops.play.loss"][-1] == pytest.approx(v**2 / 3, abs=100 * tolerance)
    assert run["stops.play.force"][-1] == pytest.approx(-2, abs=100 * tolerance)


@EACH_RUN
@EACH_METHOD
def test_a_pendulum_loses_what_friction_and_stop_take(run_of: Run, tolerance: float) -> None:
    """Turning points by energy; it sticks where |m g l sin(phi)| is below c at one."""
    run, weight, c, e, lower = run_of("Pendulum", 20.0, 0.02), 1.5 * 9.81 * 0.8, 0.4, 0.6, -0.3
    phi, loss, count = 1.2, 0.0, 0
    while weight * abs(np.sin(phi)) > c:
        sign = np.sign(phi)  # of the start of this swing

        def rest(to: float, phi: float = phi) -> float:
            return weight * (np.cos(to) - np.cos(phi)) - c * abs(to - phi)

        count += 1
        if sign > 0 and rest(lower) > 0:
            energy = rest(lower)
            loss += (1 - e**2) * energy
            count += 1

            def after(to: float, energy: float = energy) -> float:
                return e**2 * energy + weight * (np.cos(to) - np.cos(lower)) - c * (to - lower)

            phi = brentq(after, lower + 1e-12, 1.2, xtol=1e-15)
        else:
            phi = brentq(rest, -sign * 1.2, phi - sign * 1e-6, xtol=1e-15)
    assert run["phi"][-1] == pytest.approx(phi, abs=100 * tolerance)
    assert run["stops.end.loss"][-1] == pytest.approx(loss, abs=100 * tolerance)
    assert run["omega"][-1] == 0 and run["friction.bearing.mode"][-1] == STUCK
    assert run["event_count"][-1] == count
    held = weight * np.sin(phi)
    assert run["friction.bearing.force"][-1] == pytest.approx(-held, abs=1e3 * tolerance)


@EACH_RUN
@EACH_METHOD
def test_a_valve_with_stiction_opens_and_closes(run_of: Run, tolerance: float) -> None:
    """From rest under a ramp x = r / k (t - sin(w t) / w); at a stop friction helps to hold."""
    run = run_of("Valve", 14.0, 0.05)

    def moved(s: np.ndarray) -> np.ndarray:
        return (s - np.sin(2 * s) / 2) / 4

    way = brentq(lambda s: moved(s) - 0.5, 1, 3, xtol=1e-15)
    x = pieces(
        run["time"], (0, lambda s: 0 * s), (1, moved), (1 + way, lambda s: 0.5 + 0 * s),
        (9, lambda s: 0.5 - moved(s)), (9 + way, lambda s: 0 * s),
    )  # fmt: skip
    agree(run, tolerance, x=x)
    has_events_at(run, tolerance, 1, 1 + way, 5, 9, 9 + way)
    hit = (1 - np.cos(2 * way)) / 4
    assert run["stops.seat.impulse"][-1] == pytest.approx(hit, abs=100 * tolerance)
    assert run["stops.seat.loss"][-1] == pytest.approx(hit**2, abs=100 * tolerance)
    at = np.searchsorted(run["time"], 5 - 1e-9)  # the stop carries what friction does not
    forces = [run[f"{name}.force"][at] for name in ("friction.packing", "stops.seat")]
    assert forces == pytest.approx([1, -2], abs=100 * tolerance)


@EACH_RUN
@EACH_METHOD
@pytest.mark.parametrize(
    ("gap", "after", "count"), [(0.0, [-1 / 3, 2 / 3, 2 / 3], 1), (1e-6, [0, 0, 1], 2)]
)
def test_balls_of_a_cradle(
    run_of: Run, tolerance: float, gap: float, after: list[float], count: int
) -> None:
    """Touching balls are hit together: nothing approaches anything afterwards, energy stays."""
    run = run_of("Cradle", 1.0, 0.1, gap=gap)
    assert [run[f"v{i}"][-1] for i in (1, 2, 3)] == pytest.approx(after, abs=1e-12)
    has_events_at(run, tolerance, *[0.1, 0.1 + gap][:count])
