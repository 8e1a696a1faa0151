"""The page of a linear model: tables, texts and pictures."""

import math
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rparm.linearization.largest_step import LargestStep
from rparm.linearization.linear import Linear, zeros
from rparm.linearization.margins import Margins, closed, searched
from rparm.linearization.responses import frequencies, frequency_response
from rparm.linearization.study import Study
from rparm.report import pages
from rparm.units import milliseconds

Picture = tuple[str, str]  # file without its suffix, and its description
Part = tuple[pages.Table, str, list[Picture]]
NONE = "–"
LISTED = 12  # names in a sentence
REAL = 1e-6  # of a pole: a smaller real or imaginary part is rounding, as of poles that are equal
POLES = (  # of a continuous model, and of a sampled one
    "A deviation along a pole grows or dies out as e to the power of its real part times the time. "
    "Damping is 1 without oscillation, 0 if it does not decay, below 0 if it grows.",
    "From sample to sample a deviation along a pole is multiplied by it: it dies out within the "
    "unit circle. Damping and time are those of a continuous pole with the same samples.",
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
ABOUT = "How small deviations move about one point: x' = A x + B u, y = C x + D u."
POINT = (
    "Values about which the model is linearized. Far from them it is less accurate: compare it "
    "with a run."
)
EQUILIBRIUM = (
    "All derivatives are 0, except those of positions in a steady motion, and ticks of samplers "
    "change nothing. Where dry friction or a "
    "stop holds a joint, every value between the two ends is an equilibrium while the others stay "
    "as they are; the value shown is in the middle."
)
PICTURES = (
    "Bode: amplitude and phase of an output's oscillation relative to an input's. "
    "Dashed and dotted: the same, sampled, with inputs held between samples."
)
MATRICES = (
    "A row for each derivative of a state and each output, a column for each state and input. "
    "Units are those of the variables, and s.",
    "A row for each state one sample later and each output, a column for each state and input. "
    "Units are those of the variables.",
)
TEXTS = pages.STYLE | {"text.parse_math": False}
MOST_DRAWN = 2  # inputs and outputs that are drawn: with more, curves would share a colour
ROUNDING = 1e-12  # of the largest response: less is none
AROUND = 2.0  # decades beyond the poles that a Bode diagram shows
SETTLED = 6.0  # time constants of the slowest pole that a step shows
GROWN = 3.0  # time constants of the fastest pole that grows
FLATTEST = 0.1  # height of a picture of poles, of its width
POINTS = 600
MOST_DOTS = 10 * POINTS  # of samples, on one curve: more would only hide it
FARTHEST = 3.0  # from the origin that a Nyquist diagram shows
ON_AXIS = 1e-7  # damping below which the peak of a pole is infinite: its height says nothing
POLE_GAIN = 1e6  # gain beyond which a Nyquist diagram breaks its line: a pole may be on the axis


def write(folder: Path, found: Study, step: float | None, again: str, root: str = "") -> Path:
    """Write page and pictures into a folder; return the page. `again` makes them again.

    `root` leads from there to the start page, if there is one.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if not root:
        pages.write_assets(folder)
    linear = found.linear
    parts: list[Part] = []
    if found.trimmed:
        parts.append((equilibrium_table(found), EQUILIBRIUM, []))
    if found.margins is not None:
        parts.append((margins_table(found.margins), MARGINS, []))
    if found.largest:
        parts.append((steps_table(list(found.largest)), STEPS, []))
    if len(linear.states):
        pages.save_figure(poles_figure(linear, step, found.loop), folder / "poles.png")
        parts.append((poles_table(found), POLES[linear.dt > 0], [("poles", "Poles")]))
    if pictures := _pictures(folder, found, step):
        parts.append((pages.Table("Responses", [], []), PICTURES, pictures))
    parts.append((point_table(found), POINT, []))
    parts.append((matrices_table(found), MATRICES[linear.dt > 0], []))
    name = f"{found.path.stem}, {found.variant}" if found.variant else found.path.stem
    return pages.write_page(
        folder / pages.INDEX,
        "linearization.html",
        root=root,
        title=f"{name}: linear model",
        about=ABOUT,
        again=again,
        notes=[*notes(found), *_not_drawn(found)],
        parts=parts,
    )


def _pictures(folder: Path, found: Study, step: float | None) -> list[Picture]:
    """Draw Bode, Nyquist and steps: of the loop where it is broken, else of inputs and outputs."""
    if found.loop is not None:
        pages.save_figure(bode_figure(found.loop, step, found.margins), folder / "bode.png")
        pages.save_figure(nyquist_figure(found.loop, step), folder / "nyquist.png")
        pages.save_figure(steps_figure(closed(found.loop), None), folder / "steps.png")
        return [
            ("bode", "Bode diagram of the loop"),
            ("nyquist", "Nyquist diagram of the loop"),
            ("steps", "The closed loop after a step"),
        ]
    shown = drawn(found.linear)
    if not shown.inputs or not shown.outputs:
        return []
    pages.save_figure(bode_figure(shown, step), folder / "bode.png")
    pages.save_figure(steps_figure(shown, step), folder / "steps.png")
    return [("bode", "Bode diagram"), ("steps", "Step responses")]


def _not_drawn(found: Study) -> list[str]:
    linear = found.linear
    if found.loop is not None or max(len(linear.inputs), len(linear.outputs)) <= MOST_DRAWN:
        return []
    first = f"the first {MOST_DRAWN} outputs that respond, and inputs"
    return [f"Pictures show {first}; --inputs and --outputs choose."]


# ---- Tables and texts ----------------------------------------------------------------------------
def notes(found: Study) -> list[str]:
    """Say what has been left out, in a sentence each."""
    linear, texts = found.linear, []
    if found.python:
        texts.append(
            f"Sampled every {milliseconds(linear.dt)}, the communication step, because of Python: "
            f"{_names(found.python)}. States are those at its begin; inputs are held over it."
        )
    elif linear.dt:
        names = _names(list(dict.fromkeys(tick.name for tick in linear.ticks)))
        texts.append(
            f"Sampled every {milliseconds(linear.dt)} by {names}. States are those just before the "
            "first tick of a period, outputs those just after it; inputs are held in between."
            + (" Connections act at once: not a communication step late." if found.variant else "")
        )
    if linear.held:
        texts.append(
            f"Held: {_names(linear.held)}. They do not respond to small changes of the inputs, "
            "because of friction, a stop or a gain of 0, and are left out."
        )
    if linear.left_out:
        texts.append(f"Left out, as they are discrete: {_names(linear.left_out)}.")
    if linear.flat:
        texts.append(
            f"Without slope: {_names(linear.flat)}. These functions stay as they are at the point: "
            "a loop through them looks open."
        )
    if found.loop is not None and found.loop.dropped:
        texts.append(
            f"Not in the loop: {_names(found.loop.dropped)}. The break does not move them, or they "
            "do not come back to it, or others stand for them."
        )
        hidden = found.loop.rates_of(found.loop.hidden)
        growing = hidden[hidden.real > REAL * np.abs(hidden)]
        if len(growing):
            texts.append(
                f"They grow by e^({_short(float(growing.real.max()))} t) whatever the loop does: "
                "the margins do not say so."
            )
    if found.margins is not None and not found.margins.stable:
        texts.append("The closed loop is unstable here: it has no margins.")
    point = linear.between or linear
    least = 1e-8 * max(1.0, float(np.abs(linear.x).max(initial=0.0)))
    moving = [
        f"{name}' = {rate:.6g}"
        for name, rate, is_position in zip(
            point.states, point.rates, point.are_positions, strict=True)
        if abs(rate) > least and (is_position or not found.trimmed)  # else rounding
    ]  # fmt: skip
    moving += [
        f"{tick.name} changes {name} by {change:.6g}"
        for tick in point.ticks for name, change in tick.changes.items()
        if abs(change) > least and not found.trimmed
    ]  # fmt: skip
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


def point_table(found: Study) -> pages.Table:
    """Return the values of states and inputs."""
    rows = [[name, value, found.units.get(name, "")] for name, value in found.linear.at.items()]
    return pages.Table("The point", ["variable", "value", "unit"], rows)


def equilibrium_table(found: Study) -> pages.Table:
    """Return the trimmed values, and the range where friction or a stop leaves one."""
    rows = []
    for name in found.trimmed:
        ends = found.linear.intervals.get(name, (math.nan, math.nan))
        numbers = _short(found.linear.at[name]), *map(_or_none, ends)
        rows.append([name, *numbers, found.units.get(name, "")])
    return pages.Table("Equilibrium", ["variable", "value", "from", "to", "unit"], rows)


def poles_table(found: Study) -> pages.Table:
    """Return poles, conjugate pairs in one row."""
    linear, rows = found.linear, []
    for exact, exact_rate in zip(linear.poles, linear.rates_of(linear.poles), strict=True):
        pole, rate = _without_rounding(exact), _without_rounding(exact_rate)
        if pole.imag < 0:
            continue  # its conjugate stands for both
        rows.append(
            [
                _short(pole.real),
                f"± {_short(pole.imag)}" if pole.imag else NONE,
                _short(abs(rate.imag) / (2 * math.pi)) if rate.imag else NONE,
                _short(-rate.real / abs(exact_rate) + 0.0) if rate else NONE,
                _short(1 / abs(rate.real)) if rate.real else NONE,
            ]
        )
    head = ["real part (1/s)", "imaginary (rad/s)", "frequency (Hz)", "damping", "1/real (s)"]
    if linear.dt:
        head = ["real part", "imaginary", "frequency (Hz)", "damping", "time constant (s)"]
    return pages.Table("Poles" if found.loop is None else "Poles of the broken loop", head, rows)


def _without_rounding(pole: complex) -> complex:
    """Return a pole with 0 for a part that is rounding, or 0 for a rate that is not finite."""
    least = REAL * abs(pole)
    return complex(*(float(x) if abs(x) > least else 0.0 for x in (pole.real, pole.imag)))


def margins_table(found: Margins) -> pages.Table:
    """Return the margins of a loop; those that it does not have are "–"."""
    rows = [
        ["gain, up to times", _or_none(found.gain_up)],
        ["gain, down to times", _or_none(found.gain_down or math.inf)],
        ["further lag (degrees)", _or_none(found.phase)],
        ["further delay", milliseconds(found.delay) if math.isfinite(found.delay) else NONE],
    ]
    crossings = [f"{x.frequency / (2 * math.pi):.4g} Hz" for x in found.gain_crossings]
    rows.append(["the loop's gain is 1 at", ", ".join(crossings) or NONE])
    return pages.Table("Margins", ["margin", "value"], rows)


def steps_table(found: list[LargestStep] | tuple[LargestStep, ...]) -> pages.Table:
    """Return the largest stable step of each way to step."""
    rows = []
    for x in found:
        text = "none" if x.step == 0 else milliseconds(x.step)
        text = text if math.isfinite(x.step) else "no limit found"
        rows.append([x.order.replace("_", "-"), x.inputs, text, _or_none(x.frequency)])
    head = ["order", "inputs", "largest stable step", "frequency (Hz)"]
    return pages.Table("Largest stable communication step", head, rows)


def matrices_table(found: Study) -> pages.Table:
    """Return the matrix [A B; C D]."""
    linear = found.linear
    whole = np.block([[linear.A, linear.B], [linear.C, linear.D]])
    names = (*(name + "'+"[linear.dt > 0] for name in linear.states), *linear.outputs)
    pairs = zip(names, whole, strict=True)
    rows = [[name, *(_short(float(x)) for x in row)] for name, row in pairs]
    return pages.Table("A, B, C and D", ["", *linear.states, *linear.inputs], rows)


def _short(number: float) -> str:
    return f"{number:.6g}"


def _or_none(number: float) -> str:
    return f"{number:.6g}" if math.isfinite(number) else NONE


# ---- Pictures ------------------------------------------------------------------------------------
def bode_figure(model: Linear, step: float | None, found: Margins | None = None) -> Figure:
    """Draw gain and phase of each output by each input, with margins of a loop."""
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
                sampled = one.sampled(step)
                below = _below(grid, sampled)
                name = f"{label}, held for {milliseconds(step)}"
                response = frequency_response(sampled)(below)
                _bode(gain, phase, response, below, color, name, pages.DASHED)
        for axes, level in ((gain, 0.0), (phase, -180.0)):
            if step is not None:
                axes.axvline(0.5 / step, color=pages.MUTED, linewidth=0.8, linestyle=":")
            for crossing in found.gain_crossings if found else ():
                axes.axvline(crossing.frequency / (2 * math.pi), color=pages.INK, linewidth=0.8)
                axes.axhline(level, color=pages.INK, linewidth=0.8)
        gain.set_ylabel("gain (dB)")
        phase.set_ylabel("phase (degrees)")
        phase.set_xlabel("frequency (Hz)")
        gain.set_xlim(grid[0] / (2 * math.pi), grid[-1] / (2 * math.pi))
        if gain.get_legend_handles_labels()[0]:
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
    turned -= 360 * np.round((turned[0] + 90) / 360)
    phase.semilogx(hertz, turned, color=color, linestyle=line)


def nyquist_figure(loop: Linear, step: float | None) -> Figure:
    """Draw L along the frequencies; -1 is where it becomes unstable."""
    with mpl.rc_context(TEXTS):
        figure = Figure(figsize=(6, 6), layout="constrained")
        axes = figure.subplots()
        grid = searched(loop)
        _nyquist(axes, frequency_response(loop)(grid), "-", "sampled" if loop.dt else "continuous")
        if step is not None:
            sampled, name = loop.sampled(step), f"held for {milliseconds(step)}"
            response = frequency_response(sampled)(_below(grid, sampled))
            _nyquist(axes, response, pages.DASHED, name)
        circle = np.exp(1j * np.linspace(0, 2 * math.pi, 200))
        axes.plot(circle.real, circle.imag, color=pages.MUTED, linewidth=0.8, linestyle=":")
        axes.plot(-1, 0, "+", color=pages.ERROR_COLORS[0], markersize=14, markeredgewidth=2)
        axes.set_xlim(-FARTHEST, FARTHEST)
        axes.set_ylim(-FARTHEST, FARTHEST)
        axes.set_aspect("equal")
        axes.set_xlabel("real part of L")
        axes.set_ylabel("imaginary part of L")
        axes.legend(fontsize=8)
    return figure


def _nyquist(axes: Axes, values: np.ndarray, line: object, label: str) -> None:
    values = np.where(np.abs(values) < POLE_GAIN, values, np.nan)
    axes.plot(values.real, values.imag, color=pages.RUN_COLOR, linestyle=line, label=label)
    axes.plot(values.real, -values.imag, color=pages.RUN_COLOR, linestyle=line, alpha=0.35)


def steps_figure(model: Linear, step: float | None) -> Figure:
    """Answer of each output to a step of each input by 1."""
    with mpl.rc_context(TEXTS):
        count = len(model.outputs)
        figure = Figure(figsize=(9, 1.2 + 2 * count), layout="constrained")
        every = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
        end = _end(model, step)
        for axes, output in zip(every, model.outputs, strict=True):
            for name, color in zip(model.inputs, _colors(), strict=False):
                one = model.select([name], [output])
                style = {"color": color, "label": f"step of {name}"}
                style |= {"drawstyle": "steps-post", "marker": "."} if model.dt else {}
                axes.plot(*_step(one, end / POINTS, end), **style)
                if step is not None and end <= MOST_DOTS * step:
                    axes.plot(*_step(one, step, end), ".", color=color)
            axes.set_ylabel(output)
        every[0].legend(fontsize=8)
        every[-1].set_xlim(0, end)
        every[-1].set_xlabel("time (s)")
    return figure


def _step(model: Linear, length: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    model = model if model.dt else model.sampled(length)
    count = int(end / model.dt) + 1
    x, values = np.zeros(len(model.A)), np.empty(count)
    for i in range(count):
        values[i] = (model.C @ x + model.D[:, 0])[0]
        x = model.A @ x + model.B[:, 0]
    return model.dt * np.arange(count), values


def poles_figure(model: Linear, step: float | None, loop: Linear | None = None) -> Figure:
    """Draw poles in the plane of s, and of the sampled model in the plane of z."""
    with mpl.rc_context(TEXTS):
        figure = Figure(figsize=(9, 4.2), layout="constrained")
        if model.dt:
            text = f"sampled every {milliseconds(model.dt)}"
            _draw_sampled_poles(figure.subplots(), model.poles, text)
            return figure
        plain, sampled = figure.subplots(1, 2)
        plain.axvline(0, color=pages.INK, linewidth=0.8)
        style = {"color": pages.RUN_COLOR, "label": "poles", "markersize": 9}
        plain.plot(model.poles.real, model.poles.imag, "x", **style)
        height = FLATTEST * np.abs(model.poles).max(initial=1.0)
        low, high = plain.get_ylim()
        plain.set_ylim(min(low, -height), max(high, height))
        if loop is not None:
            found = closed(loop).poles
            style = {"color": pages.ERROR_COLORS[0], "label": "when it is closed", "markersize": 11}
            plain.plot(found.real, found.imag, "+", **style)
        plain.set_xlabel("real part (1/s): left of 0 dies out")
        plain.set_ylabel("imaginary part (rad/s)")
        plain.legend(fontsize=8)
        if step is None:
            sampled.set_visible(False)
        else:
            text = f"held for {milliseconds(step)}"
            _draw_sampled_poles(sampled, model.sampled(step).poles, text)
    return figure


def _draw_sampled_poles(axes: Axes, found: np.ndarray, text: str) -> None:
    circle = np.exp(1j * np.linspace(0, 2 * math.pi, 200))
    axes.plot(circle.real, circle.imag, color=pages.INK, linewidth=0.8)
    axes.plot(found.real, found.imag, "x", color=pages.RUN_COLOR, markersize=9)
    axes.set_aspect("equal")
    axes.set_xlabel(f"{text}: within the circle dies out")


def drawn(model: Linear) -> Linear:
    """Select what pictures show: the first outputs that respond, and inputs they respond to."""
    grid = frequencies(model.rates_of(model.poles), (), AROUND)
    s = model.points(grid)[:, None, None]
    states = np.linalg.solve(s * np.eye(len(model.A)) - model.A, model.B + 0 * s)
    answers = np.abs(model.C @ states + model.D).max(axis=0)  # (outputs, inputs)
    responds = answers > ROUNDING * answers.max(initial=0.0)
    outputs = np.flatnonzero(responds.any(axis=1))[:MOST_DRAWN]
    inputs = np.flatnonzero(responds[outputs].any(axis=0))[:MOST_DRAWN]
    return model.select([model.inputs[i] for i in inputs], [model.outputs[i] for i in outputs])


def _channels(model: Linear) -> Iterator[tuple[str, Linear]]:
    for output in model.outputs:
        for name in model.inputs:
            yield f"{output} by {name}", model.select([name], [output])


def _colors() -> Iterator[str]:
    while True:
        yield from (pages.RUN_COLOR, *pages.ERROR_COLORS)


def _grid(model: Linear, found: Margins | None = None) -> np.ndarray:
    """Choose frequencies in rad/s around the poles of a model, or of a loop, closed too."""
    crossings = [x.frequency for x in (found.gain_crossings if found else ())]
    poles = model.rates_of(np.array([*model.poles, *(closed(model).poles if found else ())]))
    fastest = [math.pi / model.dt] if model.dt else []
    every = np.abs([*poles[np.isfinite(poles) & (poles != 0)], *crossings, *fastest])
    low, high = every.min(initial=np.inf), every.max(initial=0.0)
    channels = [model.rates_of(zeros(one.A, one.B, one.C, one.D)) for _, one in _channels(model)]
    between = [p for some in channels for p in some if low <= abs(p) <= high]
    steep = [p for p in (*poles, *between) if abs(p.real) > ON_AXIS * abs(p)]
    grid = frequencies(steep, [*every, *crossings], AROUND)
    return _below(grid, model) if model.dt else grid


def _below(grid: np.ndarray, sampled: Linear) -> np.ndarray:
    """Choose frequencies below half the sampling rate, dense where sampled poles are."""
    poles = sampled.rates_of(sampled.poles)
    every = np.union1d(grid, frequencies(poles[np.isfinite(poles)], (), 0.0))
    return every[(every >= grid[0]) & (every < math.pi / sampled.dt)]


def _end(model: Linear, step: float | None) -> float:
    """Return how long a step is shown, s: until the slowest pole has settled."""
    poles = model.rates_of(model.poles)
    rates = np.abs(poles[np.isfinite(poles) & (poles != 0)])
    end = SETTLED / rates.min(initial=1.0 if not len(rates) else np.inf)
    fastest = poles.real.max(initial=0.0)
    end = min(end, MOST_DOTS * model.dt) if model.dt else end
    step = model.dt or step
    end = min(end, GROWN / fastest) if fastest > 0 else end
    return max(end, 20 * step) if step is not None else end
