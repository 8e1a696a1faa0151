"""Scenarios: what to simulate, read from models/<model>/scenarios/<name>.toml.

docs/scenarios.md documents the format. What a scenario says of its model is
checked against the description of the model's FMU. `template` writes a scenario to start from.
"""

import json
import math
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from rparm import project
from rparm.errors import UserError, WrongValueError, did_you_mean
from rparm.files import difference, is_file, missing, read_toml, show, toml_value
from rparm.fmi.model import INITIAL, INPUTS, PARAMETERS, TOLERANCE, Model, Value, Variable
from rparm.project import PROGRAM
from rparm.runs.inputs import MEASURED, InputReader, Logged, Reader, Signal
from rparm.units import SECONDS, number

MODEL, FMU = "model", "fmu"  # keys of a file that is in no model's folder: one of them
REQUIRED = ("title", "description", "tolerance", "time")
OPTIONAL = (MODEL, FMU, "reference_every", "panels", PARAMETERS, INITIAL, INPUTS, MEASURED)
TIMES = ("start", "stop", "step")
MAX_STEPS = 10_000_000
MAX_PATTERN = 1000  # step lengths in a pattern
ROUNDED = 4  # last digits of times and of their quotient
SLIVER = 1e-9  # a last step shorter than this fraction of its full length joins the one before
TEMPLATE_WIDTH = 100
USUAL_STOP, USUAL_TOLERANCE = 2.0, 1e-8  # s; relative
USUAL_STEPS = 200  # to the stop time, where the FMU proposes none


@dataclass(frozen=True, eq=False)
class Scenario:
    """A run of one model: parameters, initial state, communication points and inputs (SI units).

    What the file does not give has its start value. Arrays are read-only, of Booleans for Booleans.
    """

    name: str
    model: str  # folder name below models/, or path of the FMU that the file names
    path: Path
    title: str
    description: str
    parameters: dict[str, Value]  # an Enumeration's item as its number
    initial: dict[str, Value]
    start: float  # s
    stop: float  # s
    steps: tuple[float, ...]  # s, pattern of step lengths; one element: a constant step
    tolerance: float  # relative
    times: np.ndarray  # (n + 1,) communication points in s, from start to stop
    elapsed: np.ndarray  # (n + 1,) s since the start; exact where times are rounded
    signals: dict[str, Signal]  # inputs as functions of time
    inputs: dict[str, np.ndarray]  # (n + 1,) each, zero-order hold: over the step from times[i]
    reference_every: int  # every k-th communication point is in the reference
    defaults: dict[str, Value]  # start values in the FMU
    panels: tuple[tuple[str, ...], ...] = ()  # variables to draw beside the states, by diagram
    measured: dict[str, Logged] = field(default_factory=dict)  # outputs to compare with logs
    logs: dict[str, str] = field(default_factory=dict)  # SHA-256 of inputs' logs, by file as given
    # to ask the user: values that are hardly meant so, logs that look damaged
    questions: tuple[str, ...] = ()
    smallest_tolerance: float = 0.0  # relative; a smaller one makes no difference

    @property
    def start_values(self) -> dict[str, Value]:
        """Start values of all variables: those that the file gives, else those in the FMU."""
        return self.defaults | self.parameters | self.initial

    def input(self, name: str) -> np.ndarray:
        """Return the values of an input, (n + 1,), or its start value if the file has none."""
        if name in self.inputs:
            return self.inputs[name]
        return np.full(len(self.times), self.defaults[name])

    @property
    def reference_folder(self) -> Path:
        """models/<model>/references/<name>."""
        return project.reference_folder(self.path)

    @property
    def reference_rows(self) -> np.ndarray:
        """Indices (rows,) of the communication points in the reference: every k-th and the last."""
        last = len(self.times) - 1
        return np.append(np.arange(0, last, self.reference_every), last)

    @property
    def input_rows(self) -> np.ndarray:
        """Indices (rows,) into the inputs of the step that ends at each point in the reference."""
        return np.maximum(self.reference_rows - 1, 0)


def title(path: Path) -> str:
    """Read the title of the scenario at `path`; the rest of the file is not checked."""
    content = read_toml(path)
    reader = Reader(path)
    if "title" not in content:
        reader.fail("missing key 'title'")
    return reader.text(content["title"], "title")


def subject_of(path: Path) -> Path:
    """Return the FMU that the scenario's key `fmu` names, or the folder of its model.

    Without the key `model` it is the model in whose folder the file lies. UserError if the file
    cannot be read, or names nothing that is there.
    """
    content, reader = read_toml(path), Reader(path)
    project.refuse_other(path, content, "run")
    if FMU in content:
        if MODEL in content:
            reader.fail(f"has both {MODEL!r} and {FMU!r}: expected one of them")
        fmu = path.absolute().parent / reader.text(content[FMU], FMU)
        if not is_file(fmu):
            reader.fail(f"{FMU}: {content[FMU]!r:.200}: {missing(fmu)}")
        return fmu
    if MODEL not in content:
        if project.is_in_model(path):
            return project.model_folder(path)
        known = ", ".join(project.models())
        reader.fail(
            f"missing key {MODEL!r}, the name of what the scenario is of (known: {known}), or "
            f"{FMU!r}, the file of an FMU"
        )
    name = reader.text(content[MODEL], MODEL)
    try:
        return project.model(name)
    except UserError as error:
        reader.fail(f"{MODEL}: {error}")


def name_of(subject: Path) -> str:
    """Return `Scenario.model` for what `subject_of` gives."""
    return subject.name if subject.is_dir() else str(subject)


def load(path: Path, model: Model, times: Mapping[str, float] | None = None) -> Scenario:
    """Read and check a scenario; `times` replace its own. UserError if anything is wrong."""
    path = Path(path)
    content = read_toml(path)
    subject = subject_of(path)
    reader = _Reader(path)
    reader.keys(content, "", REQUIRED, OPTIONAL)
    tolerance = reader.number(content["tolerance"], "tolerance")
    if not 0 < tolerance < 1:
        reader.fail(f"tolerance: expected a number between 0 and 1, got {tolerance!r}")
    every = content.get("reference_every", 1)
    if type(every) is not int or every < 1:
        reader.fail(f"reference_every: expected a whole number from 1 on, got {show(every)}")

    start, stop, steps = reader.time(reader.table(content["time"], "[time]") | dict(times or {}))
    times, elapsed = reader.communication_points(start, stop, steps)
    parameters = reader.values(content, PARAMETERS, model)
    reader.tolerances(tolerance, parameters, model)
    initial = reader.values(content, INITIAL, model)
    inputs = InputReader(reader, model, times, elapsed)
    signals = inputs.inputs(content)
    logs = inputs.hashes  # without logs of measurements, which no run follows from
    measured = inputs.measured(content)
    return Scenario(
        name=path.stem, model=name_of(subject), path=path.absolute(),
        title=reader.text(content["title"], "title"),
        description=reader.text(content["description"], "description"), parameters=parameters,
        initial=initial, start=start, stop=stop, steps=steps, tolerance=tolerance, times=times,
        elapsed=elapsed, signals=signals, inputs=inputs.sampled(signals),
        reference_every=min(every, MAX_STEPS), defaults=model.start_values,
        panels=reader.panels(content, model), measured=measured, logs=logs,
        questions=(*reader.questions, *inputs.warnings),
        smallest_tolerance=model.smallest_tolerance(parameters),
    )  # fmt: skip


class _Reader(Reader):
    """Takes the sections of a scenario but its inputs."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.questions: list[str] = []

    # parameters and initial states

    def values(self, content: dict[str, Any], section: str, model: Model) -> dict[str, Value]:
        """Read section [parameters] or [initial]: name = value, as `Variable.checked` takes it."""
        result = {}
        for name, given in self.table(content.get(section, {}), f"[{section}]").items():
            with self.placed(f"[{section}]"):
                variable = model.find(name, section)
            with self.placed(f"[{section}] {name}"):
                result[name] = variable.checked(given)
            if question := variable.question(given):
                self.questions.append(f"[{section}] {name}: {question}")
        return result

    def tolerances(self, tolerance: float, parameters: dict[str, Value], model: Model) -> None:
        """Refuse what the method of integration cannot reach."""
        given = [("tolerance", tolerance)]
        if parameters.get(TOLERANCE):  # 0: the scenario's
            given.append((f"[{PARAMETERS}] {TOLERANCE}", parameters[TOLERANCE]))
        for key, value in given:
            with self.placed(key):
                model.check_tolerance(value, parameters)

    # pictures

    def panels(self, content: dict[str, Any], model: Model) -> tuple[tuple[str, ...], ...]:
        """Read key panels: lists of variables that are drawn into one diagram, of one unit."""
        if "panels" not in content:
            return ()
        drawn = [
            v.name
            for v in model.variables.values()
            if (v.causality == "output" and v.type in ("Real", "Integer"))
            or (v.causality == "input" and v.type == "Real")
        ]
        result = []
        for i, names in enumerate(self.array(content["panels"], "panels", "lists of variables")):
            key = f"panels[{i}]"
            for name in self.array(names, key, "variables"):
                if name not in drawn:
                    guess = did_you_mean(name, drawn) if isinstance(name, str) else ""
                    self.fail(f"{key}: {show(name)} cannot be drawn{guess}")
            variables = [model.variables[name] for name in names]
            if len({(variable.type, variable.unit) for variable in variables}) > 1:
                self.fail(f"{key}: expected variables of one type and unit")
            result.append(tuple(names))
        return tuple(result)

    # time

    def time(self, content: Any) -> tuple[float, float, tuple[float, ...]]:
        table = self.table(content, "[time]")
        self.keys(table, "[time]", required=TIMES)
        start = self.quantity(table["start"], "[time] start", SECONDS)
        stop = self.quantity(table["stop"], "[time] stop", SECONDS)
        if stop <= start or not math.isfinite(stop - start):
            self.fail(f"[time] stop: expected a time after start = {start!r}, got {stop!r}")
        given = table["step"]
        if isinstance(given, list):
            self.array(given, "[time] step", "numbers")
            if len(given) > MAX_PATTERN:
                count = len(given)
                self.fail(f"[time] step: has {count} lengths, expected at most {MAX_PATTERN}")
        else:
            given = [given]
        steps = tuple(self.quantity(step, "[time] step", SECONDS) for step in given)
        for step in steps:
            if step <= 0:
                self.fail(f"[time] step: expected more than 0 s, got {step!r}")
            if start + step == start or stop - step == stop:
                self.fail(f"[time] step: {step!r} s is lost in rounding between start and stop")
        try:
            count = (stop - start) / math.fsum(steps) * len(steps)
        except OverflowError:
            self.fail("[time] step: the sum of the pattern overflows")
        if count > MAX_STEPS:
            self.fail(f"[time] step: makes {count:.3g} steps, expected at most {MAX_STEPS}")
        return start, stop, steps

    def communication_points(
        self, start: float, stop: float, steps: tuple[float, ...]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return times (s) from start to stop, and since the start, from their numbers."""
        period = math.fsum(steps)
        cycles = math.ceil((stop - start) / period) + 1
        within = np.array([math.fsum(steps[:i]) for i in range(len(steps))])
        with np.errstate(over="ignore"):  # beyond stop
            elapsed = (np.arange(cycles)[:, None] * period + within).ravel()
            times = start + elapsed
        remainder = np.maximum(SLIVER * np.array(steps), 4 * np.spacing(max(abs(start), abs(stop))))
        kept = (stop - times >= np.tile(remainder, cycles)) & (times > start)
        times = np.concatenate(([start], times[kept], [stop]))
        if not np.all(np.diff(times) > 0):
            self.fail("[time] step: too short, communication points coincide")
        elapsed = np.concatenate(([0.0], elapsed[kept], [difference(stop, start)]))
        times.setflags(write=False)
        elapsed.setflags(write=False)
        return times, elapsed


def count_steps(start: float, stop: float, step: float) -> int:
    """Return the number of steps in s from start to stop; WrongValueError if it is not whole."""
    span = difference(stop, start)
    if span / step > MAX_STEPS:
        raise WrongValueError(f"step {step!r} s makes more than {MAX_STEPS} steps")
    if not are_whole(start, stop, step):
        given = f"{number(span)} s, got {number(step)} s"
        raise WrongValueError(f"step: expected a whole number of steps in {given}")
    return round(span / step)


def are_whole(start: float, stop: float, step: float) -> bool:
    """Return whether one step in s or several lead from start to stop, but for rounding."""
    count = difference(stop, start) / step
    of_times = math.ulp(max(abs(start), abs(stop))) / step
    distance = abs(count - max(round(count), 1))
    return distance <= ROUNDED * (of_times + math.ulp(count))


# ---- A scenario to start from --------------------------------------------------------------------
def template(
    name: str, key: str, subject: str, model: Model, begin: Mapping[str, Any] = MappingProxyType({})
) -> str:
    """Write the file, which runs as it is; `key` is `model`, or `fmu` with a path from the file.

    `begin` has values, by section, in place of start values.
    """
    from rparm.texts import rendered  # takes long

    known = [v for v in model.variables.values() if v.start is not None and v.type != "String"]
    sections = {PARAMETERS: "Parameters.", INITIAL: "State at the start."}
    inputs = [v for v in model.variables.values() if v.is_a(INPUTS)]
    times = {name: _toml_number(number) for name, number in _template_times(model).items()}
    return rendered(
        "new_scenario.toml", program=PROGRAM, key=key, subject=subject, name=name, begin=begin,
        panels=json.dumps([[output] for output in model.real_outputs[:2]]), **times,
        sections={k: (title, [v for v in known if v.is_a(k)]) for k, title in sections.items()},
        inputs=[v for v in inputs if v.type in ("Real", "Boolean")], comment=_template_comment,
    )  # fmt: skip


def _template_times(model: Model) -> dict[str, float]:
    """Return the default experiment of the FMU, as far as a scenario can have it."""
    given = model.experiment
    start = 0.0 if given.start is None else given.start
    stop = given.stop
    if stop is None or not start < stop or not math.isfinite(stop - start):
        stop = start + USUAL_STOP
    step = given.step
    if step is None or not (stop - start) / MAX_STEPS <= step <= stop - start:
        step = float(f"{(stop - start) / USUAL_STEPS:.0e}")
    if start + step == start or stop - step == stop:  # lost in rounding
        start, stop, step = 0.0, USUAL_STOP, USUAL_STOP / USUAL_STEPS
    tolerance = given.tolerance
    if tolerance is None or not 0 < tolerance < 1:
        tolerance = USUAL_TOLERANCE
    return {
        "start": start,
        "stop": stop,
        "step": step,
        "shorter": float(f"{step / 5:.6g}"),
        "tolerance": max(tolerance, model.smallest_tolerance({})),
    }


def _toml_number(number: float) -> str:
    """Write a number as TOML does, with all its digits."""
    return repr(number).replace("e-0", "e-")


def _template_comment(variable: Variable) -> str:
    """Write meaning and limits of a variable, above the line that may be uncommented."""
    limits = []
    if math.isfinite(variable.least) and variable.type == "Real":
        limits.append(f"at least {number(variable.least)}")
    if math.isfinite(variable.greatest) and variable.type == "Real":
        limits.append(f"at most {number(variable.greatest)}")
    if variable.items:
        limits.append("one of " + ", ".join(map(toml_value, variable.items)))
    meaning = "; ".join([" ".join(variable.description.split()) or variable.name, *limits])
    return textwrap.fill(meaning, TEMPLATE_WIDTH, initial_indent="#   ", subsequent_indent="#   ")
