"""What struct model promises, of the plant at random points in all modes: derivatives are what
differences give, the Jacobian is what derivatives give, what is integrated is what is output,
nothing is read that is not given, and results are written as a whole, whatever stood there before.
Of other models: test_all_is_written.py."""

import random
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tests.equations.compiled import LENGTH
from tests.rp_plant.plant_in_c import (
    ATTACHED,
    COMPLIANT,
    FREE,
    NONE,
    RELEASED,
    RIGID,
    STUCK,
    UNDECIDED,
    PlantInC,
)
from tests.support.model_calls import (
    OF_MODEL,
    OF_STATE,
    SCALE,
    UNUSED,
    T,
    call,
    known_words,
    part,
    results,
    series,
)

POINTS = 1000
INPUTS = 5
EPS = 2.0**-52

# ---- Points --------------------------------------------------------------------------------------


def place(plant: Any, draw: random.Random, n: int) -> None:
    """Let the modes and stops of a plant fit its velocities; each feature is off now and then."""
    p, modes, is_undecided = plant.parameters, plant.modes, n % 5 == 0
    for feature in (p.armature, p.damping):
        feature[:] = [draw.choice((0.0, x, x, x)) for x in feature]
    for name in ("payload_mass", "payload_inertia", "payload_x", "payload_z"):
        setattr(p, name, draw.choice((0.0, *[getattr(p, name)] * 3)))
    plant.payload_attached = draw.randrange(2)
    modes.payload = ATTACHED if plant.payload_attached else RELEASED
    if is_undecided:  # modes follow from velocities
        modes.payload = UNDECIDED
    p.grasp = 1
    for i in range(2):
        p.breakaway_friction[i] = draw.choice((0.0, 2.0, 2.0)) * p.coulomb_friction[i]
        p.coulomb_friction[i] *= draw.randrange(3)
        p.breakaway_friction[i] += p.coulomb_friction[i]
        p.stops[i] = draw.choice((NONE, RIGID) if is_undecided else (NONE, RIGID, COMPLIANT))
        can_stick = p.breakaway_friction[i] > 0.0 or p.stops[i] == RIGID
        modes.joint[i] = draw.randint(-1, 2) if can_stick and not is_undecided else FREE
        if modes.joint[i] == STUCK:
            plant.dq[i] = 0.0
        if p.stops[i] == COMPLIANT:
            modes.contact[i] = draw.randint(-2, 2)
        p.lower[i] = plant.q[i] - (-0.25 if modes.contact[i] > 0 else 1.0)
        p.upper[i] = plant.q[i] + (-0.25 if modes.contact[i] < 0 else 1.0)


class Point:
    """Knowns of magnitudes 0.5 to 2, inputs and states with any sign, as the plant places them; a
    curve that changes each by half of its value in a unit of time at most, or only one of them."""

    def __init__(self, in_c: PlantInC, n: int) -> None:
        def word(of: Any, name: str) -> int:
            return getattr(of, name).offset // 8

        self.words, self.row_of_indicator = in_c.words, in_c.row_of_indicator
        self.plant, source = in_c.plant(), np.random.default_rng(n)
        self.values, self.known = np.frombuffer(self.plant), known_words(self.words)
        # nothing writes these
        self.known[[word(in_c.plant, "D") + 2, word(in_c.plant, "time")]] = True
        self.moves = np.zeros_like(self.known)
        for name in "pux":
            self.moves[part(self.words, name)] = True
        self.moves[[word(type(self.plant.parameters), name) for name in ("stops", "grasp")]] = False

        self.values[self.moves] = source.uniform(0.5, 2.0, np.count_nonzero(self.moves))
        for name in "ux":
            values = self.values[part(self.words, name)]
            values *= source.choice((-1.0, 1.0), len(values))
        place(self.plant, random.Random(n), n)
        chosen = self.moves & (
            (n % 2 == 0) | (np.cumsum(self.moves) == source.integers(1, self.moves.sum() + 1))
        )
        sizes = np.where(chosen, self.values, 0.0)
        self.curve = [sizes * source.uniform(-0.5, 0.5, len(sizes)) for _ in range(2)]
        self.inputs = source.uniform(-2.0, 2.0, (INPUTS, 4))
        self.inputs[:, 0] = self.values[part(self.words, "u")]

    def results(self, fill: float = 0.0) -> dict[str, np.ndarray]:
        """Return what all functions write, where `fill` stands elsewhere."""
        return results(self.words, self.values, self.curve, self.inputs, fill, self.known)

    def rests(self) -> np.ndarray:
        """True for states of a joint that is stuck."""
        return np.array([mode == STUCK for mode in self.plant.modes.joint] * 2)


@pytest.fixture(params=range(5))
def points(request: pytest.FixtureRequest, plant_in_c: PlantInC) -> Iterator[Point]:
    """Random ones."""
    return (Point(plant_in_c, n) for n in range(request.param, POINTS, 5))


# ---- Properties ----------------------------------------------------------------------------------


def test_results_are_whole_and_nothing_else_is_read(points: Iterator[Point]) -> None:
    for point in points:
        found, other = point.results(np.nan), point.results()
        for key, value in found.items():
            np.testing.assert_array_equal(value, other[key], key, strict=True)
        assert not any(np.isnan(found[key]).any() for key in ("z", "state rows"))
        assert np.all(found["reach"] >= 0.0)
        for i, z in enumerate(found["z"]):
            kind = found[f"kind of indicator {i}"]
            assert kind in (UNUSED, OF_STATE, OF_MODEL)
            assert kind != UNUSED or z == 1.0
            assert kind != OF_STATE or found[f"state of indicator {i}"] < 4
            assert kind != OF_STATE or found[f"rises of indicator {i}"] <= 1
            for name in ("factor", "offset"):
                assert np.isfinite(found.get(f"{name} of indicator {i}", 0.0))


def test_what_is_integrated_is_what_is_output(points: Iterator[Point]) -> None:
    """Rates to the bit; the Jacobian but for rounding, and a joint that is stuck rests."""
    for point in points:
        found, words = point.results(), point.words
        np.testing.assert_array_equal(found["dx"], found["outputs"][part(words, "d")])
        for j, rests in enumerate(point.rests()):
            column = np.zeros_like(point.values)
            column[part(words, "x").start + j] = 1.0
            call(words.derivatives, found["outputs"], T, 0.0, column, None)
            expected = np.zeros(4) if rests else column[part(words, "d")]
            slopes = found["J"][4 * j : 4 * j + 4]
            np.testing.assert_allclose(slopes, expected, rtol=1e-13, atol=1e-13)


def close_the_stop(plant: Any, i: int, is_upper: bool) -> None:
    """Put a joint at rest on a rigid stop."""
    plant.parameters.stops[i], plant.modes.joint[i], plant.dq[i] = RIGID, STUCK, 0.0
    (plant.parameters.upper if is_upper else plant.parameters.lower)[i] = plant.q[i]


@pytest.mark.parametrize("is_on_stop", [False, True])
def test_series_begin_with_the_rates_and_the_indicators(
    points: Iterator[Point], is_on_stop: bool
) -> None:
    """Any number of orders at once gives the same bits."""
    for n, point in enumerate(points):
        words = point.words
        if is_on_stop and point.plant.modes.payload != UNDECIDED:
            close_the_stop(point.plant, n % 2, n % 4 < 2)
        ends = sorted({*random.Random(n).sample(range(LENGTH - 1), n % LENGTH), LENGTH - 1})
        rows = series(words, point.values, point.inputs, np.nan, [LENGTH - 1])
        again = series(words, point.values, point.inputs, np.nan, ends)
        np.testing.assert_array_equal(rows, again)
        found = point.results()
        np.testing.assert_allclose(rows[:4, 1], found["dx"] * SCALE, rtol=1e-12, atol=1e-10)
        for i, z in enumerate(found["z"]):
            if found[f"kind of indicator {i}"] == OF_MODEL:
                row = rows[point.row_of_indicator[i]]
                np.testing.assert_allclose(row[0], z, rtol=1e-12, atol=1e-10)


# The slope of values at -4 H ... 4 H, by differences of order 8. Over this part of a curve knowns
# change by 0.2 percent, angles of a circle by some hundredths: what is left out is below 1e-16 of
# the values, so that the rounding of their terms counts, by 2.1 / H.
H, SPEED = 1 / 1024, 0.25  # SPEED: of the time
WEIGHTS = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])


@pytest.mark.parametrize("parameters_rest", [False, True])
def test_derivatives_are_those_of_differences(
    points: Iterator[Point], parameters_rest: bool
) -> None:
    """Second derivatives are those along curves on which parameters rest."""
    for point in points:
        words, (first, second) = point.words, point.curve
        if parameters_rest:
            for slope in point.curve:
                slope[part(words, "p")] = 0.0
        values, rates = np.zeros((2, len(WEIGHTS), len(first)))
        for n, (value, rate) in enumerate(zip(values, rates, strict=True)):
            t = (n - 4) * H
            value[:] = point.values
            value[point.moves] += (t * (first + 0.5 * t * second))[point.moves]
            rate[:] = first + t * second
            call(words.outputs, value, T + t * SPEED)
            call(words.derivatives, value, T + t * SPEED, SPEED, rate, None)
        found, curvature = first.copy(), second.copy()
        given = curvature if parameters_rest else None
        call(words.derivatives, values[4], T, SPEED, found, given)
        compared = [(values, found)] + [(rates, curvature)] * parameters_rest
        calculated = ~point.known
        # of the largest: fields are sums of terms that others show
        largest = [1.0, *(abs(x[calculated]).max() for x in (values[4], found, curvature))]
        bound = 128 * EPS / H * max(largest)
        for along, slope in compared:
            differences = WEIGHTS @ along[:, calculated] / H
            np.testing.assert_allclose(slope[calculated], differences, rtol=0, atol=bound)
