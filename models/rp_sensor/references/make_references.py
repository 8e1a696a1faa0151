"""Makes the reference trajectories of the sensor, without the code that they check.

Positions, resolutions and times are fractions, so that counts and ticks are exact; the noise is the
hash of the page in Python's integers and a normal number in 40 digits. A scenario in which rounding
could decide a count or the step of a tick is refused.
"""

from collections.abc import Mapping
from fractions import Fraction

import mpmath as mp
import numpy as np

from rparm.models import reference_files
from rparm.runs.scenario import Scenario

DIGITS = 40
INPUTS = ("q1", "q2")
OUTPUTS = ("q1_measured", "q2_measured", "dq1_measured", "dq2_measured")
WORD = 2**64
MOST = 2**31 - 1  # counts
# Fractions of a count and of a sample time that doubles are sure to keep apart.
CLEAR = Fraction(1, 10**6)


def finalized(z: int) -> int:
    """Mix the bits of a word by Stafford's variant 13, as SplitMix64 does."""
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        z = (z ^ z >> shift) * factor % WORD
    return z ^ z >> 31


def fraction_of_draw(seed: int, joint: int, draw: int) -> Fraction:
    """Return the upper 53 bits of a draw as a number of [0, 1)."""
    state = finalized(seed % 2**32 * 2**32 + joint)
    word = finalized((state + (draw + 1) * 0x9E3779B97F4A7C15) % WORD)
    return Fraction(word >> 11, 2**53)


def noise(seed: int, joint: int, tick: int) -> mp.mpf:
    """Return the standard normal number of a joint (0 or 1) and a tick."""
    with mp.workdps(DIGITS):
        first = fraction_of_draw(seed, joint, 2 * tick) + Fraction(1, 2**53)
        second = fraction_of_draw(seed, joint, 2 * tick + 1)
        radius = mp.sqrt(-2 * mp.log(mp.mpf(first.numerator) / first.denominator))
        return radius * mp.cospi(2 * mp.mpf(second.numerator) / second.denominator)


class Encoder:
    """What both joints of the sensor sample and show, with the parameters `value` by name."""

    def __init__(self, value: Mapping[str, float]) -> None:
        self.seed = int(value["seed"])
        self.latency = int(value["latency"])
        self.sample_time = Fraction(value["sample_time"])  # s
        self.resolution = [Fraction(value[f"resolution{i}"]) for i in (1, 2)]  # rad, m
        self.deviation = [Fraction(value[f"noise{i}"]) for i in (1, 2)]  # rad, m
        self.samples: list[list[int]] = []

    @property
    def ticks(self) -> int:
        """Number of ticks so far; the next one comes after as many sample times."""
        return len(self.samples)

    def sample(self, positions: list[Fraction]) -> None:
        """Make a tick at both positions (rad, m)."""
        self.samples.append([self._count(i, Fraction(q)) for i, q in enumerate(positions)])

    def _count(self, joint: int, position: Fraction) -> int:
        if self.deviation[joint]:
            z = noise(self.seed, joint, self.ticks)
            position += self.deviation[joint] * Fraction(int(z * 10**30), 10**30)
        x = position / self.resolution[joint] + Fraction(1, 2)
        count = x.numerator // x.denominator
        is_exact = not self.deviation[joint] and x == count
        if not (is_exact or CLEAR < x - count < 1 - CLEAR):
            raise ValueError(f"rounding decides the count {count} of tick {self.ticks}")
        return max(-MOST, min(MOST, count))

    def counts(self) -> list[int]:
        """Return the counts shown after the last tick."""
        return self.samples[max(self.ticks - 1 - self.latency, 0)]

    def outputs(self) -> list[Fraction]:
        """Return the values of OUTPUTS after the last tick."""
        before = self.samples[max(self.ticks - 2 - self.latency, 0)]
        pairs = list(zip(self.counts(), before, self.resolution, strict=True))
        positions = [now * resolution for now, _, resolution in pairs]
        rates = [(now - last) * resolution / self.sample_time for now, last, resolution in pairs]
        return positions + rates


def outputs(scenario: Scenario) -> dict[str, np.ndarray]:
    """Return the columns of OUTPUTS, (n + 1,) each, with inputs held over each step."""
    encoder = Encoder(scenario.start_values)
    inputs = reference_files.input_table(scenario, INPUTS).tolist()
    times = [Fraction(t) for t in scenario.times.tolist()]
    encoder.sample(inputs[0])
    rows = [encoder.outputs()]
    for held, end in zip(inputs, times[1:], strict=False):
        while (next_tick := times[0] + encoder.ticks * encoder.sample_time) < end:
            encoder.sample(held)
        if next_tick - end < CLEAR * encoder.sample_time:
            raise ValueError(f"rounding decides the step of the tick at {float(end)} s")
        rows.append(encoder.outputs())
    table = np.array([[float(x) for x in row] for row in rows])
    return dict(zip(OUTPUTS, table.T, strict=True))
