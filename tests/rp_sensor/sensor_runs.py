"""Runs of the built FMUs of the sensor: started by name, moved along cubics, read."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from tests.support.paths import ROOT
from tests.support.rparm_project import declared

MODEL = ROOT / "models" / "rp_sensor"
INPUTS = ("q1", "q2")
OUTPUTS = ("q1_measured", "q2_measured", "dq1_measured", "dq2_measured")
COUNTS = ("counts1", "counts2")
DEGREE = 3

Cubic = Sequence[float]  # coefficients from order 0 on, rad or m per power of s
Shown = tuple[tuple[int, ...], tuple[float, ...]]  # COUNTS and OUTPUTS


def start_values() -> dict[str, float]:
    variables = declared(MODEL.name).variables
    return {name: v.start for name, v in variables.items() if v.causality == "parameter"}


def at(cubic: Cubic, t: Fraction) -> Fraction:
    """Exact value of a cubic."""
    return sum((Fraction(c) * t**k for k, c in enumerate(cubic)), Fraction(0))


def derivatives(cubic: Cubic, t: float) -> list[float]:
    """Value and derivatives of a cubic, orders 0 to 3, each rounded once."""
    result, rest = [], [Fraction(c) for c in cubic]
    for _ in range(DEGREE + 1):
        result.append(float(at(rest, Fraction(t))))
        rest = [k * c for k, c in enumerate(rest)][1:] or [Fraction(0)]
    return result


@contextmanager
def started(
    fmu: Fmu, start: float = 0.0, cubics: Sequence[Cubic] = ((0.0,), (0.0,)), **values: float
) -> Iterator[Instance]:
    """An instance at `start` (s) with these parameters, the inputs at their values there."""
    with fmu.instance("sensor", INPUTS) as instance:
        instance.set_up(start, None)
        for name, value in values.items():
            instance.set(name, value)
        instance.enter_initialization()
        for name, cubic in zip(INPUTS, cubics, strict=True):
            instance.set(name, derivatives(cubic, start)[0])
        instance.exit_initialization()
        yield instance


class Stepper:
    """Moves the inputs of an instance along cubics, which count the time from 0."""

    def __init__(self, instance: Instance, cubics: Sequence[Cubic]) -> None:
        self.instance, self.cubics = instance, cubics
        self._polynomials = instance.input_polynomials(INPUTS, DEGREE)

    def step(self, t: float, h: float) -> None:
        rows = zip(*(derivatives(cubic, t) for cubic in self.cubics), strict=True)
        self._polynomials.view[:] = list(rows)
        self._polynomials.set()
        self.instance.do_step(t, h, goes_back=True)


def shown(instance: Instance) -> Shown:
    reals = instance.reals(OUTPUTS)
    reals.get()
    return tuple(instance.integer(name) for name in COUNTS), tuple(reals.view.tolist())
