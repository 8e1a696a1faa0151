"""The page of a linear model: tables, texts and charts."""

import math
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rparm.linearization.largest_step import LargestStep
from rparm.linearization.linear import Linear, closure, participations, zeros
from rparm.linearization.margins import (
    Crossing,
    Margins,
    Peak,
    closed,
    growing,
    lag,
    ringing,
    searched,
)
from rparm.linearization.responses import bounded_response, frequencies, frequency_response
from rparm.linearization.study import Study
from rparm.report import pages
from rparm.report.charts import Chart, Data
from rparm.texts import listed, rendered
from rparm.units import duration, exponents, unit

Part = tuple[pages.PageTable, str, list[Chart]]
NONE = "–"
REAL = 1e-6  # of a pole: a smaller real or imaginary part is rounding, as of poles that are equal
TEXTS = tomllib.loads(Path(__file__).with_name("texts.toml").read_text(encoding="utf-8"))
MARGINS, STEPS, EQUILIBRIUM = (TEXTS[name] for name in ("margins", "steps", "equilibrium"))
POLES, MATRICES = TEXTS["poles"], TEXTS["matrices"]  # of a continuous model, and of a sampled one
MOST_DRAWN = 2  # inputs and outputs that are drawn: with more, curves would share a colour
LOOKED = 40  # frequencies at which a response is looked for
AROUND = 2.0  # decades beyond the poles that a Bode diagram shows
SETTLED = 6.0  # time constants of the slowest pole that a step shows
GROWN = 3.0  # time constants of the fastest pole that grows
FLATTEST = 0.1  # height of a picture of poles, of its width
POINTS = 600
MOST_DOTS = 10 * POINTS  # of samples, on one curve: more would only hide it
FARTHEST = 3.0  # from the origin that a Nyquist diagram shows
ON_AXIS = 1e-7  # damping below which the peak of a pole is infinite: its height says nothing
POLE_GAIN = 1e6  # gain beyond which a Nyquist diagram breaks its line: a pole may be on the axis


MARGIN = {"up": "gain_up", "down": "gain_down"}  # attributes of Margins
LEAST_PART = 0.01  # of a state in a pole; less is not said
MOST_PARTS = 4  # states that are named of a pole


def write(folder: Path, found: Study, step: float | None, again: str, root: str = "") -> Path:
    """Write the page into a folder; return the page. The command `again` makes it again.

    `root` leads from there to the start page, if there is one.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if not root:
        pages.write_assets(folder)
    linear, loop = found.linear, found.loop
    parts: list[Part] = []
    if found.trimmed:
        parts.append((equilibrium_table(found), EQUILIBRIUM, []))
    if loop is not None and found.margins is not None:
        made = bode_chart(loop, step, found.margins), nyquist_chart(loop, step, found.margins)
        parts.append((margins_table(found.margins), MARGINS, [*made]))
        title = "Step response of the closed loop"
        made = [steps_chart(closed(loop), None, found.units, title)]
        parts.append((pages.PageTable(title, [], []), "", made))
    said = notes(found)
    if loop is None and linear.inputs and linear.outputs:
        answers = responding(linear)
        said += _not_drawn(linear, answers)
        if answers.any():
            shown = drawn(linear, answers)
            responses = [bode_chart(shown, step), steps_chart(shown, step, found.units)]
            parts.append((pages.PageTable("Responses", [], []), "", responses))
    if len(linear.states):
        table = poles_table(found)
        rows = zip(table.rows, _rows_of(linear, taking_part(linear)), strict=True)
        cells = [[*row, ", ".join(states)] for row, states in rows]
        table = replace(table, head=[*table.head, "states that take part"], rows=cells)
        parts.append((table, POLES[linear.dt > 0], poles_charts(linear, step, loop)))
    if found.largest:
        parts.append((steps_table(list(found.largest)), STEPS, []))
    name = f"{found.path.stem}, {found.variant}" if found.variant else found.path.stem
    rates = linear.rates_of(linear.poles)
    return pages.write_page(
        folder / pages.INDEX,
        "linearization.html",
        root=root,
        title=f"{name}: linear model",
        again=again,
        growing=int((rates.real > REAL * np.abs(rates)).sum()),
        found=found,
        notes=said,
        parts=parts,
        point=point_table(found),
        about_matrices=MATRICES[linear.dt > 0],
    )


def _not_drawn(linear: Linear, answers: np.ndarray) -> list[str]:
    """Say what is missing from charts of responses; `answers`: as `responding`."""
    texts, counts = [], [np.count_nonzero(answers.any(axis=axis)) for axis in (0, 1)]
    if max(counts) > MOST_DRAWN:
        first = f"the first {MOST_DRAWN} outputs that respond, and inputs"
        texts.append(f"Charts show {first}; --inputs and --outputs choose.")
    for names, axis, what in (
        (linear.outputs, 1, "outputs respond to no input"),
        (linear.inputs, 0, "inputs move no output"),
    ):
        if idle := [names[i] for i in np.flatnonzero(~answers.any(axis=axis))]:
            texts.append(f"These {what} and are not in the charts: {listed(idle)}.")
    return texts


# ---- Tables and texts ----------------------------------------------------------------------------
def notes(found: Study) -> list[str]:
    """Say what has been left out, a text each."""
    linear, loop = found.linear, found.loop
    every = {tick.name: tick.every for tick in linear.ticks}
    grow = ring = ()
    if loop is not None and loop.dropped:
        grow, ring = growing(loop), ringing(loop, loop.hidden)
    text = rendered(
        "linear_notes.txt",
        found=found,
        samplers=[*every],
        rates=[f"{name} ({duration(time)})" for name, time in every.items()],
        several_rates=min(every.values(), default=math.inf) < linear.dt / 1.5,
        growing=_short(float(grow.real.max())) if len(grow) else None,
        ringing=_short(float(np.abs(ring.imag).max()) / (2 * math.pi)) if len(ring) else None,
    )
    return text.splitlines()


def point_table(found: Study) -> pages.PageTable:
    """Return the values of states and inputs."""
    values = found.linear.at
    rows = [[name, value, unit(found.units.get(name))] for name, value in values.items()]
    return pages.PageTable("The point", ["variable", "value", "unit"], rows)


def equilibrium_table(found: Study) -> pages.PageTable:
    """Return the trimmed values, and the range where friction or a stop leaves one."""
    rows = []
    for name in found.trimmed:
        ends = found.linear.intervals.get(name, (math.nan, math.nan))
        numbers = _short(found.linear.at[name]), *map(_or_none, ends)
        rows.append([name, *numbers, unit(found.units.get(name))])
    return pages.PageTable("Equilibrium", ["variable", "value", "from", "to", "unit"], rows)


def poles_table(found: Study) -> pages.PageTable:
    """Return poles, conjugate pairs in one row."""
    linear = found.linear
    cells = [*map(_pole_cells, linear.poles, linear.rates_of(linear.poles))]
    first = ["real part", "imaginary"] if linear.dt else ["real part (1/s)", "imaginary (rad/s)"]
    head = [*first, "frequency (Hz)", "damping", "time constant (s)"]
    title = "Poles" if found.loop is None else "Poles of the broken loop"
    return pages.PageTable(title, head, _rows_of(linear, cells))


def _rows_of(linear: Linear, items: Sequence[list[str]]) -> list[list[str]]:
    """Leave out items of poles whose conjugate stands for both."""
    pairs = zip(linear.poles, items, strict=True)
    return [item for pole, item in pairs if _without_rounding(pole).imag >= 0]


def _pole_cells(exact: complex, exact_rate: complex) -> list[str]:
    pole, rate = _without_rounding(exact), _without_rounding(exact_rate)
    return [
        _short(pole.real),
        f"± {_short(abs(pole.imag))}" if pole.imag else NONE,
        _short(abs(rate.imag) / (2 * math.pi)) if rate.imag else NONE,
        _short(-rate.real / abs(exact_rate) + 0.0) if rate else NONE,
        _short(1 / abs(rate.real)) if rate.real else NONE,
    ]


def taking_part(linear: Linear) -> list[list[str]]:
    """Name the states that take part in each pole, and by how much, the most first."""
    found = []
    for parts in participations(linear.A, linear.poles):
        order = [i for i in np.argsort(-parts, kind="stable") if parts[i] >= LEAST_PART]
        found.append([f"{linear.states[i]} {100 * parts[i]:.0f} %" for i in order[:MOST_PARTS]])
    return found


def _without_rounding(pole: complex) -> complex:
    """Return a pole with 0 for a part that is rounding, or 0 for a rate that is not finite."""
    least = REAL * abs(pole)
    return complex(*(float(x) if abs(x) > least else 0.0 for x in (pole.real, pole.imag)))


def marks(found: Margins) -> dict[str, Crossing]:
    """Return where a loop has its margins: the crossing that each is measured at."""
    gains, turns = found.gain_crossings, found.phase_crossings
    every: dict[str, tuple[tuple[Crossing, ...], Callable[[Crossing], float], float]] = {
        "up": (turns, lambda x: 1 / abs(x.value), found.gain_up),
        "down": (turns, lambda x: 1 / abs(x.value), found.gain_down),
        "phase": (gains, lag, math.radians(found.phase)),
        "delay": (gains, lambda x: lag(x) / x.frequency, found.delay),
    }
    return {
        name: x for name, (crossings, value, margin) in every.items()
        for x in crossings if math.isclose(value(x), margin)
    }  # fmt: skip


def _marks(found: Margins | None) -> list[Data]:
    """Return the margins that have a place on a logarithmic axis, for the charts."""
    return [
        {"name": name, "margin": getattr(found, MARGIN.get(name, name)), "hertz": _hertz(x),
         "lag": math.degrees(lag(x)), "re": x.value.real, "im": x.value.imag}
        for name, x in (marks(found) if found else {}).items() if 0 < x.frequency < math.inf
    ]  # fmt: skip


def _hertz(at: Crossing | Peak) -> float:
    return at.frequency / (2 * math.pi)


def margins_table(found: Margins) -> pages.PageTable:
    """Return the margins of a loop; those that it does not have are "–"."""
    at = {name: _or_none(_hertz(x)) for name, x in marks(found).items()}
    delay = duration(found.delay) if math.isfinite(found.delay) else NONE
    rows = [
        ["gain margin, up (times)", _or_none(found.gain_up), at.get("up", NONE)],
        ["gain margin, down (times)", _or_none(found.gain_down or math.inf), at.get("down", NONE)],
        ["phase margin (degrees)", _or_none(found.phase), at.get("phase", NONE)],
        ["delay margin", delay, at.get("delay", NONE)],
        ["disk margin", _or_none(found.disk.value), _or_none(_hertz(found.disk))],
        *([name, _or_none(peak.value), _or_none(_hertz(peak))] for name, peak in (
            ("peak of the sensitivity", found.sensitivity),
            ("peak of the complementary one", found.complementary))),
        *(["the loop's gain is 1", NONE, _short(_hertz(x))] for x in found.gain_crossings),
    ]  # fmt: skip
    return pages.PageTable("Margins", ["margin", "value", "at (Hz)"], rows)


def steps_table(found: list[LargestStep] | tuple[LargestStep, ...]) -> pages.PageTable:
    """Return the largest stable step of each way to step."""
    rows = []
    for x in found:
        text = "none" if x.step == 0 else duration(x.step)
        text = text if math.isfinite(x.step) else "no limit found"
        rows.append([x.order.replace("_", "-"), x.inputs, text, _or_none(x.frequency)])
    head = ["order", "inputs", "largest stable step", "frequency (Hz)"]
    return pages.PageTable("Largest stable communication step", head, rows)


def matrices_table(found: Study) -> pages.PageTable:
    """Return the matrix [A B; C D]."""
    linear = found.linear
    whole = np.block([[linear.A, linear.B], [linear.C, linear.D]])
    names = (*(name + "'+"[linear.dt > 0] for name in linear.states), *linear.outputs)
    pairs = zip(names, whole, strict=True)
    rows = [[name, *(_short(float(x)) for x in row)] for name, row in pairs]
    return pages.PageTable("A, B, C and D", ["", *linear.states, *linear.inputs], rows)


def _short(number: float) -> str:
    return exponents(f"{number:.6g}")


def _or_none(number: float) -> str:
    return _short(number) if math.isfinite(number) else NONE


# ---- Charts -------------------------------------------------------------------------------------
def bode_chart(model: Linear, step: float | None, found: Margins | None = None) -> Chart:
    """Draw gain and phase of each output by each input, with margins of a loop."""
    grid = _grid(model, found)
    shown = [(label, one) for label, one in _channels(model) if responds(one, grid)]
    curves = []
    for i, (label, one) in enumerate(shown):
        curves.append(_bode(frequency_response(one)(grid), grid) | {"name": label, "colour": i})
        if step is not None:
            sampled = one.sampled(step)
            below = _below(grid, sampled)
            name = f"{label}, held for {duration(step)}"
            held = _bode(frequency_response(sampled)(below), below)
            curves.append(held | {"name": name, "colour": i, "dashed": True})
    data = {"curves": curves, "marks": _marks(found)}
    data |= {"ends": grid[[0, -1]] / (2 * math.pi), "half": step and 0.5 / step}
    data["crossings"] = [_hertz(x) for x in found.gain_crossings] if found else []
    text = f"Gain and phase over the frequency: {', '.join(label for label, _ in shown)}"
    return Chart("Bode diagram", text, "bode", data, height=30)


def _bode(values: np.ndarray, grid: np.ndarray) -> Data:
    grid, values = grid[np.isfinite(values)], values[np.isfinite(values)]
    with np.errstate(divide="ignore"):
        decibels = 20 * np.log10(np.abs(values))
    turned = np.degrees(np.unwrap(np.angle(values)))
    turned -= 360 * np.round((turned[0] + 90) / 360)
    return {"hertz": grid / (2 * math.pi), "gain": decibels, "phase": turned}


def nyquist_chart(loop: Linear, step: float | None, found: Margins | None = None) -> Chart:
    """Draw L along the frequencies; -1 is where it becomes unstable."""
    grid = searched(loop)
    name = "sampled" if loop.dt else "continuous"
    curves = [_nyquist(frequency_response(loop)(grid), grid) | {"name": name}]
    if step is not None:
        sampled = loop.sampled(step)
        below = _below(grid, sampled)
        held = _nyquist(frequency_response(sampled)(below), below)
        curves.append(held | {"name": f"held for {duration(step)}", "dashed": True})
    data = {"curves": curves, "marks": _marks(found)}
    text = "The loop L in the complex plane, along the frequencies, beside the critical point -1"
    return Chart("Nyquist diagram", text, "nyquist", data | {"reach": FARTHEST}, height=30)


def _nyquist(values: np.ndarray, grid: np.ndarray) -> Data:
    values = np.where(np.abs(values) < POLE_GAIN, values, np.nan)
    return {"hertz": grid / (2 * math.pi), "re": values.real, "im": values.imag}


def steps_chart(
    model: Linear, step: float | None, units: Mapping[str, str], title: str = "Step responses"
) -> Chart:
    """Draw the response of each output to a step of each input by 1."""
    curves, end = [], _end(model, step)
    lengths = [end / POINTS, *([step] if step is not None and end <= MOST_DOTS * step else [])]
    for i, output in enumerate(model.outputs):
        for k, name in enumerate(model.inputs):
            label = f"step of {name} by 1 {unit(units.get(name))}".rstrip()
            for dots, length in enumerate(lengths):
                times, values = _step(model.select([name], [output]), length, end)
                curves.append({"name": label, "output": i, "colour": k, "dots": bool(dots),
                               "held": model.dt > 0, "x": times, "y": values})  # fmt: skip
    texts = [(name, unit(units.get(name))) for name in model.outputs]
    outputs = [f"{name} ({text})" if text else name for name, text in texts]
    text = f"{title}: {', '.join(model.outputs)} over the time after a step of an input by 1"
    data = {"curves": curves, "outputs": outputs, "end": end}
    return Chart(title, text, "steps", data, height=8 + 11 * len(outputs))


def _step(model: Linear, length: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    model = model if model.dt else model.sampled(length)
    count = int(end / model.dt) + 1
    x, values = np.zeros(len(model.A)), np.empty(count)
    for i in range(count):
        values[i] = (model.C @ x + model.D[:, 0])[0]
        x = model.A @ x + model.B[:, 0]
    return model.dt * np.arange(count), values


def poles_charts(model: Linear, step: float | None, loop: Linear | None = None) -> list[Chart]:
    """Draw poles in the plane of s, and of the sampled model in the plane of z."""
    if model.dt:
        title = f"Poles, sampled every {duration(model.dt)}"
        return [_poles_chart(title, [("poles", model)], model.dt)]
    every = [("poles", model), *([("when the loop is closed", closed(loop))] if loop else [])]
    found = [_poles_chart("Poles", every, 0.0)]
    if step is not None:
        every = [("poles", model.sampled(step))]
        found.append(_poles_chart(f"Poles, held for {duration(step)}", every, step))
    return found


def _poles_chart(title: str, models: Sequence[tuple[str, Linear]], dt: float) -> Chart:
    poles = [
        {"name": name, "re": one.poles.real, "im": one.poles.imag, "states": taking_part(one),
         "cells": [*map(_pole_cells, one.poles, one.rates_of(one.poles))]}
        for name, one in models
    ]  # fmt: skip
    text = f"Poles in the complex plane: {', '.join(f'{x:.4g}' for x in models[0][1].poles)}"
    return Chart(title, text, "poles", {"poles": poles, "sampled": dt > 0, "flattest": FLATTEST})


def responds(one: Linear, grid: np.ndarray) -> bool:
    """Return whether an output responds to an input at some frequency, by more than rounding."""
    if not ((one.B.any(axis=1) @ closure(one.A.T != 0) & one.C.any(axis=0)).any() or one.D.any()):
        return False
    values, bounds = bounded_response(one)(grid[:: 1 + len(grid) // LOOKED])
    return bool((np.abs(values) > bounds).any())


def responding(model: Linear) -> np.ndarray:
    """Return which outputs respond to which inputs, (p, m)."""
    grid = frequencies(model.rates_of(model.poles), (), AROUND)
    every = [responds(one, grid) for _, one in _channels(model)]
    return np.reshape(np.array(every, bool), model.D.shape)


def drawn(model: Linear, answers: np.ndarray) -> Linear:
    """Select what pictures show: the first outputs that respond, and inputs they respond to."""
    outputs = np.flatnonzero(answers.any(axis=1))[:MOST_DRAWN]
    inputs = np.flatnonzero(answers[outputs].any(axis=0))[:MOST_DRAWN]
    return model.select([model.inputs[i] for i in inputs], [model.outputs[i] for i in outputs])


def _channels(model: Linear) -> Iterator[tuple[str, Linear]]:
    for output in model.outputs:
        for name in model.inputs:
            yield f"{output} by {name}", model.select([name], [output])


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
