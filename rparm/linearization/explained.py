"""What is found as tables, with what each number means: the same on pages and in the terminal."""

import math

import numpy as np

from rparm.linearization.largest_step import LargestStep
from rparm.linearization.margins import Margins
from rparm.linearization.study import Study
from rparm.report.pages import Table
from rparm.units import milliseconds

NONE = "–"
LISTED = 12  # names in a sentence
REAL = 1e-6  # of a pole: a smaller real or imaginary part is rounding, as of poles that are equal

POLES = (
    "A deviation along a pole grows or dies out as e to the power of its real part times the time. "
    "Damping is 1 without oscillation, 0 if it does not decay, below 0 if it grows."
)
MARGINS = (
    "Each says how far one quantity may change at the break, all else fixed, before the loop "
    "oscillates without decay. A gain of 2 means twice the effort; the delay is that of computing "
    "and transmission."
)
STEPS = (
    "Up to this communication step a small deviation dies out; beyond it the coupling makes it "
    "grow, though each component is integrated exactly. The frequency is that of the motion that "
    "grows."
)
POINT = (
    "Values about which the model is linearized. Far from them it is less accurate: compare it "
    "with a run."
)
EQUILIBRIUM = (
    "All derivatives are 0, except those of positions in a steady motion. Where dry friction or a "
    "stop holds a joint, every value between the two ends is an equilibrium while the others stay "
    "as they are; the value shown is in the middle."
)
PICTURES = (
    "Bode: amplitude and phase of an output's oscillation relative to an input's. "
    "Dashed and dotted: the same, sampled, with inputs held between samples."
)
MATRICES = (
    "A row for each derivative of a state and each output, a column for each state and input. "
    "Units are those of the variables, and s."
)


def notes(found: Study) -> list[str]:
    """What has been left out, in a sentence each."""
    linear, texts = found.linear, []
    if linear.held:
        texts.append(
            f"Held: {_names(linear.held)}. They do not respond to small changes of the inputs, "
            "because of friction, a stop or a gain of 0, and are left out."
        )
    if linear.left_out:
        texts.append(f"Left out, as they are discrete: {_names(linear.left_out)}.")
    if found.loop is not None and found.loop.dropped:
        texts.append(
            f"Not in the loop: {_names(found.loop.dropped)}. The break does not move them, or they "
            "do not come back to it, or others stand for them."
        )
        hidden = found.loop.hidden
        growing = hidden[hidden.real > REAL * np.abs(hidden)]
        if len(growing):
            texts.append(
                f"They grow by e^({_short(float(growing.real.max()))} t) whatever the loop does: "
                "the margins do not say so."
            )
    if found.margins is not None and not found.margins.stable:
        texts.append("The closed loop is unstable here: it has no margins.")
    moving = [
        f"{name}' = {rate:.6g}"
        for name, rate, may_move in zip(
            linear.states, linear.rates, linear.are_positions, strict=True
        )
        if abs(rate) > 1e-8 * max(1.0, float(np.abs(linear.x).max(initial=0.0)))
        and (may_move or not found.trimmed)  # else rounding
    ]
    if moving and found.trimmed:
        texts.append(f"In steady motion: {_names(moving)}.")
    elif moving:
        texts.append(
            f"This is no equilibrium: {_names(moving)}. Deviations are those from the motion that "
            "begins here; trim leads to an equilibrium."
        )
    return texts


def _names(names: list[str] | tuple[str, ...]) -> str:
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


def point(found: Study) -> Table:
    """Values of states and inputs."""
    rows = [[name, value, found.units.get(name, "")] for name, value in found.linear.at.items()]
    return Table("The point", ["variable", "value", "unit"], rows)


def equilibrium(found: Study) -> Table:
    """What was trimmed, and where friction or a stop leaves it."""
    rows = []
    for name in found.trimmed:
        ends = found.linear.intervals.get(name, (math.nan, math.nan))
        numbers = _short(found.linear.at[name]), *map(_or_none, ends)
        rows.append([name, *numbers, found.units.get(name, "")])
    return Table("Equilibrium", ["variable", "value", "from", "to", "unit"], rows)


def poles(found: Study) -> Table:
    """Poles, conjugate pairs in one row."""
    values = found.linear.poles
    rows = []
    for exact in values:
        size = abs(exact)
        pole = complex(
            *(part if abs(part) > REAL * size else 0.0 for part in (exact.real, exact.imag))
        )
        if pole.imag < 0:
            continue  # its conjugate stands for both
        is_pair = pole.imag > 0
        rows.append(
            [
                _short(float(pole.real)),
                f"± {_short(float(pole.imag))}" if is_pair else NONE,
                _short(float(abs(pole.imag)) / (2 * math.pi)) if is_pair else NONE,
                _short(-pole.real / size + 0.0) if size else NONE,
                _short(1 / abs(pole.real)) if pole.real else NONE,
            ]
        )
    head = ["real part (1/s)", "imaginary (rad/s)", "frequency (Hz)", "damping", "1/real (s)"]
    return Table("Poles" if found.loop is None else "Poles of the broken loop", head, rows)


def margins(found: Margins) -> Table:
    """Margins of a loop; those that it does not have are "–"."""
    rows = [
        ["gain, up to times", _or_none(found.gain_up)],
        ["gain, down to times", _or_none(found.gain_down or math.inf)],
        ["further lag (degrees)", _or_none(found.phase)],
        ["further delay", milliseconds(found.delay) if math.isfinite(found.delay) else NONE],
    ]
    crossings = [f"{x.frequency / (2 * math.pi):.4g} Hz" for x in found.gain_crossings]
    rows.append(["the loop's gain is 1 at", ", ".join(crossings) or NONE])
    return Table("Margins", ["margin", "value"], rows)


def largest(found: list[LargestStep] | tuple[LargestStep, ...]) -> Table:
    """The largest stable step of each way to step."""
    rows = []
    for x in found:
        text = "none" if x.step == 0 else milliseconds(x.step)
        text = text if math.isfinite(x.step) else "no limit found"
        rows.append([x.order.replace("_", "-"), x.inputs, text, _or_none(x.frequency)])
    head = ["order", "inputs", "largest stable step", "frequency (Hz)"]
    return Table("Largest stable communication step", head, rows)


def matrices(found: Study) -> Table:
    """[A B; C D]."""
    linear = found.linear
    whole = np.block([[linear.A, linear.B], [linear.C, linear.D]])
    names = (*(f"{name}'" for name in linear.states), *linear.outputs)
    rows = [
        [name, *(_short(float(x)) for x in row)] for name, row in zip(names, whole, strict=True)
    ]
    return Table("A, B, C and D", ["", *linear.states, *linear.inputs], rows)


def _short(number: float) -> str:
    return f"{number:.6g}"


def _or_none(number: float) -> str:
    return f"{number:.6g}" if math.isfinite(number) else NONE
