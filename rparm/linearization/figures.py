"""Pictures of linear models: Bode, Nyquist, steps and poles; sampled models beside continuous."""

import math
from collections.abc import Iterator

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rparm.linearization.linear import Linear, hold
from rparm.linearization.margins import Margins, closed, searched
from rparm.linearization.matrices import eigenvalues, zeros
from rparm.linearization.responses import frequencies, frequency_response, sampled_response
from rparm.report.pages import DASHED, ERROR_COLORS, INK, MUTED, RUN, STYLE
from rparm.units import milliseconds

TEXTS = STYLE | {"text.parse_math": False}
MOST = 2  # inputs and outputs that are drawn: with more, curves would share a colour
ROUNDING = 1e-12  # of the largest response: less is none
AROUND = 2.0  # decades beyond the poles that a Bode diagram shows
SETTLED = 6.0  # time constants of the slowest pole that a step shows
GROWN = 3.0  # those of the fastest one that grows
FLATTEST = 0.1  # height of a picture of poles, of its width
POINTS = 600
MOST_DOTS = 10 * POINTS  # of samples, on one curve: more would only hide it
FARTHEST = 3.0  # from the origin that a Nyquist diagram shows
ON_AXIS = 1e-7  # damping below which the peak of a pole is infinite: its height says nothing
POLE = 1e6  # gain beyond which a Nyquist diagram breaks its line: a pole may be on the axis


def bode(model: Linear, step: float | None, found: Margins | None = None) -> Figure:
    """Gain and phase of each output by each input, with margins of a loop."""
    with mpl.rc_context(TEXTS):
        figure = Figure(figsize=(9, 6), layout="constrained")
        gain, phase = figure.subplots(2, 1, sharex=True)
        grid = _grid(model, found)
        answers = [(label, one, frequency_response(one)(grid)) for label, one in _channels(model)]
        largest = max((np.abs(values).max() for _, _, values in answers), default=0.0)
        shown = [each for each in answers if np.abs(each[2]).max() > ROUNDING * largest]
        for (label, one, values), color in zip(shown, _colors(), strict=False):
            _bode(gain, phase, values, grid, color, label)
            if step is not None:
                below = _below(grid, one, step)
                name = f"{label}, held for {milliseconds(step)}"
                response = sampled_response(one, step)(below)
                _bode(gain, phase, response, below, color, name, DASHED)
        for axes, level in ((gain, 0.0), (phase, -180.0)):
            if step is not None:
                axes.axvline(0.5 / step, color=MUTED, linewidth=0.8, linestyle=":")
            for crossing in found.gain_crossings if found else ():
                axes.axvline(crossing.frequency / (2 * math.pi), color=INK, linewidth=0.8)
                axes.axhline(level, color=INK, linewidth=0.8)
        gain.set_ylabel("gain (dB)")
        phase.set_ylabel("phase (degrees)")
        phase.set_xlabel("frequency (Hz)")
        gain.set_xlim(grid[0] / (2 * math.pi), grid[-1] / (2 * math.pi))
        gain.legend(fontsize=8)
    return figure


def _bode(
    gain: Axes,
    phase: Axes,
    values: np.ndarray,
    grid: np.ndarray,
    color: str,
    label: str,
    line: object = "-",
) -> None:
    grid, values = grid[np.isfinite(values)], values[np.isfinite(values)]
    with np.errstate(divide="ignore"):
        decibels = 20 * np.log10(np.abs(values))
    hertz = grid / (2 * math.pi)
    gain.semilogx(hertz, decibels, color=color, linestyle=line, label=label)
    turned = np.degrees(np.unwrap(np.angle(values)))
    phase.semilogx(
        hertz, turned - 360 * np.round((turned[0] + 90) / 360), color=color, linestyle=line
    )


def nyquist(loop: Linear, step: float | None) -> Figure:
    """L along the frequencies; -1 is where it becomes unstable."""
    with mpl.rc_context(TEXTS):
        figure = Figure(figsize=(6, 6), layout="constrained")
        axes = figure.subplots()
        grid = searched(loop)
        _nyquist(axes, frequency_response(loop)(grid), "-", "continuous")
        if step is not None:
            below = _below(grid, loop, step)
            name = f"held for {milliseconds(step)}"
            _nyquist(axes, sampled_response(loop, step)(below), DASHED, name)
        circle = np.exp(1j * np.linspace(0, 2 * math.pi, 200))
        axes.plot(circle.real, circle.imag, color=MUTED, linewidth=0.8, linestyle=":")
        axes.plot(-1, 0, "+", color=ERROR_COLORS[0], markersize=14, markeredgewidth=2)
        axes.set_xlim(-FARTHEST, FARTHEST)
        axes.set_ylim(-FARTHEST, FARTHEST)
        axes.set_aspect("equal")
        axes.set_xlabel("real part of L")
        axes.set_ylabel("imaginary part of L")
        axes.legend(fontsize=8)
    return figure


def _nyquist(axes: Axes, values: np.ndarray, line: object, label: str) -> None:
    values = np.where(np.abs(values) < POLE, values, np.nan)
    axes.plot(values.real, values.imag, color=RUN, linestyle=line, label=label)
    axes.plot(values.real, -values.imag, color=RUN, linestyle=line, alpha=0.35)


def steps(model: Linear, step: float | None) -> Figure:
    """Answer of each output to a step of each input by 1."""
    with mpl.rc_context(TEXTS):
        count = len(model.outputs)
        figure = Figure(figsize=(9, 1.2 + 2 * count), layout="constrained")
        every = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
        end = _end(model, step)
        for axes, output in zip(every, model.outputs, strict=True):
            for name, color in zip(model.inputs, _colors(), strict=False):
                one = model.select([name], [output])
                axes.plot(*_step(one, end / POINTS, end), color=color, label=f"step of {name}")
                if step is not None and end <= MOST_DOTS * step:
                    axes.plot(*_step(one, step, end), ".", color=color)
            axes.set_ylabel(output)
        every[0].legend(fontsize=8)
        every[-1].set_xlim(0, end)
        every[-1].set_xlabel("time (s)")
    return figure


def _step(model: Linear, length: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    transition, forced, _ = hold(model.A, model.B, length)
    count = int(end / length) + 1
    x, values = np.zeros(len(model.A)), np.empty(count)
    for i in range(count):
        values[i] = (model.C @ x + model.D[:, 0])[0]
        x = transition @ x + forced[:, 0]
    return length * np.arange(count), values


def poles(model: Linear, step: float | None, loop: Linear | None = None) -> Figure:
    """Poles in the plane of s, and of the sampled model in the plane of z."""
    with mpl.rc_context(TEXTS):
        figure = Figure(figsize=(9, 4.2), layout="constrained")
        plain, sampled = figure.subplots(1, 2)
        plain.axvline(0, color=INK, linewidth=0.8)
        plain.plot(model.poles.real, model.poles.imag, "x", color=RUN, label="poles", markersize=9)
        height = FLATTEST * np.abs(model.poles).max(initial=1.0)
        low, high = plain.get_ylim()
        plain.set_ylim(min(low, -height), max(high, height))
        if loop is not None:
            found = closed(loop).poles
            style = {"color": ERROR_COLORS[0], "label": "when it is closed", "markersize": 11}
            plain.plot(found.real, found.imag, "+", **style)
        plain.set_xlabel("real part (1/s): left of 0 dies out")
        plain.set_ylabel("imaginary part (rad/s)")
        plain.legend(fontsize=8)
        if step is None:
            sampled.set_visible(False)
        else:
            circle = np.exp(1j * np.linspace(0, 2 * math.pi, 200))
            sampled.plot(circle.real, circle.imag, color=INK, linewidth=0.8)
            found = np.linalg.eigvals(hold(model.A, model.B, step)[0])
            sampled.plot(found.real, found.imag, "x", color=RUN, markersize=9)
            sampled.set_aspect("equal")
            sampled.set_xlabel(f"held for {milliseconds(step)}: within the circle dies out")
    return figure


def drawn(model: Linear) -> Linear:
    """What of a model pictures show: the first outputs that respond, and inputs they respond to."""
    s = 1j * frequencies(model.poles, (), AROUND)[:, None, None]
    states = np.linalg.solve(s * np.eye(len(model.A)) - model.A, model.B + 0 * s)
    answers = np.abs(model.C @ states + model.D).max(axis=0)  # (outputs, inputs)
    responds = answers > ROUNDING * answers.max(initial=0.0)
    outputs = np.flatnonzero(responds.any(axis=1))[:MOST]
    inputs = np.flatnonzero(responds[outputs].any(axis=0))[:MOST]
    return model.select([model.inputs[i] for i in inputs], [model.outputs[i] for i in outputs])


def _channels(model: Linear) -> Iterator[tuple[str, Linear]]:
    for output in model.outputs:
        for name in model.inputs:
            yield f"{output} by {name}", model.select([name], [output])


def _colors() -> Iterator[str]:
    while True:
        yield from (RUN, *ERROR_COLORS)


def _grid(model: Linear, found: Margins | None = None) -> np.ndarray:
    """Frequencies around the poles of a model, in rad/s: of a loop also when it is closed."""
    crossings = [x.frequency for x in (found.gain_crossings if found else ())]
    poles = np.array([*model.poles, *(closed(model).poles if found else ())])
    every = np.abs([*poles[poles != 0], *crossings])
    low, high = every.min(initial=np.inf), every.max(initial=0.0)
    channels = [zeros(one.A, one.B, one.C, one.D) for _, one in _channels(model)]
    between = [p for some in channels for p in some if low <= abs(p) <= high]
    steep = [p for p in (*poles, *between) if abs(p.real) > ON_AXIS * abs(p)]
    return frequencies(steep, [*every, *crossings], AROUND)


def _below(grid: np.ndarray, model: Linear, step: float) -> np.ndarray:
    """Frequencies below half the sampling rate, dense where sampled poles are."""
    z = eigenvalues(hold(model.A, model.B, step)[0])
    own = frequencies(np.log(z[z != 0]) / step, (), 0.0)
    every = np.union1d(grid, own)
    return every[(every >= grid[0]) & (every < math.pi / step)]


def _end(model: Linear, step: float | None) -> float:
    """How long a step is shown, s: until the slowest pole has settled."""
    rates = np.abs(model.poles[model.poles != 0])
    end = SETTLED / rates.min(initial=1.0 if not len(rates) else np.inf)
    fastest = model.poles.real.max(initial=0.0)
    end = min(end, GROWN / fastest) if fastest > 0 else end
    return max(end, 20 * step) if step is not None else end
