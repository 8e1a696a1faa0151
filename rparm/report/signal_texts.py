"""Inputs of a scenario as text."""

from rparm.runs.inputs import Constant, Logged, Signal, Sines, Switches
from rparm.units import number

MOST_POINTS = 8  # of a table, to be listed


def describe(signal: Signal) -> str:
    """An input as text."""
    if isinstance(signal, Constant):
        return f"constant {number(signal.value)}"
    if isinstance(signal, Sines):
        terms = [
            f"{number(amplitude)} sin(2π {number(frequency)} Hz t"
            + (f" {'+' if phase > 0 else '−'} {number(abs(phase))})" if phase else ")")
            for amplitude, frequency, phase in signal.terms
        ]
        return " + ".join(([number(signal.offset)] if signal.offset else []) + terms)
    if isinstance(signal, Logged):
        return f"{signal.source}, {'held' if signal.is_held else 'linear in between'}"
    if isinstance(signal, Switches):
        if len(signal.points) == 1:
            return str(signal.points[0][1]).lower()
        return ", ".join(f"{str(on).lower()} from {number(time)} s" for time, on in signal.points)
    if len(signal.points) <= MOST_POINTS:
        points = (f"{number(value)} at {number(time)} s" for time, value in signal.points)
        return ", ".join(points) + (", linear in between" if len(signal.points) > 1 else "")
    low, high = (f(value for _, value in signal.points) for f in (min, max))
    begin, end = signal.points[0][0], signal.points[-1][0]
    return (
        f"table of {len(signal.points)} points from {number(begin)} to {number(end)} s, values "
        f"from {number(low)} to {number(high)}, linear in between"
    )
