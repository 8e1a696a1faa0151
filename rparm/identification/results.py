"""Results as tables, as a document for programs, and as files.

The files are a scenario that runs the log again, and the parameters as TOML and SSV.
"""

import json
from collections.abc import Iterator, Mapping
from math import ceil, isfinite, log10
from pathlib import Path
from xml.sax.saxutils import quoteattr

from rparm import project
from rparm.errors import UserError
from rparm.files import difference, from_folder, whole
from rparm.fmi.model import Model, Value
from rparm.identification.identify import Estimate, Identification
from rparm.identification.request import DELAY
from rparm.runs.scenario import toml_text

DIGITS = 6
SCENARIO, PARAMETERS, PARAMETER_SET = "scenario.toml", "parameters.toml", "parameters.ssv"
TYPES = ("Real", "Integer", "Boolean")  # of an SSV that all engines read


def document(found: Identification) -> dict[str, object]:
    """Return the document that --json prints."""
    validation = None
    if found.validation is not None:
        outputs = list(found.checked.outputs)
        validation = {
            "log": found.validation.recording.path,
            "chi2": found.validation.chi2,
            "rms": dict(zip(outputs, found.validation.rms.tolist(), strict=True)),
            "follows": dict(zip(outputs, found.validation.follows.tolist(), strict=True)),
        }
    return {
        "parameters": {
            name: _estimate(x) | {"start": start}
            for (name, x), start in zip(
                found.estimates.items(),
                (p.start for p in found.checked.parameters.every),
                strict=True,
            )
        },  # fmt: skip
        "sums": {name: _estimate(x) for name, x in found.sums.items()},
        "unidentifiable": [list(each.names) for each in found.combinations],
        "at_limit": list(found.at_limit),
        "chi2": found.chi2,
        "scatter_to_classical": found.covariances.ratio,
        "whiteness": {
            name: {"p": test.p, "statistic": test.statistic, "white": test.is_white}
            for name, test in found.whiteness.items()
        },
        "validation": validation,
        "segments": found.pieces,
        "one_run": found.is_one_run,
        "steps": found.steps,
        "converged": found.has_converged,
        "passed": found.passed,
        "warnings": found.warnings,
    }


def _estimate(x: Estimate) -> dict[str, object]:
    classical = None if x.classical is None else list(x.classical)
    return {"value": x.value, "low": x.low, "high": x.high, "classical": classical}


def rows(found: Identification, true: Mapping[str, float]) -> list[tuple[str, list[str], str]]:
    """Name, cells (value, interval and, if some are known, true value) and unit of each result."""
    units = {p.name: p.unit or "" for p in found.checked.parameters.every}
    every = [(name, x, units[name]) for name, x in found.estimates.items()]
    for each in found.combinations:
        if str(each) in found.sums:
            every.append((str(each), found.sums[str(each)], units[each.names[0]]))
    known = [text(true.get(name)) for name, _, _ in every]
    return [
        (name, [*texts(x)[:3], *([cell] if true else [])], unit)
        for (name, x, unit), cell in zip(every, known, strict=True)
    ]


def texts(x: Estimate) -> list[str]:
    """Write value, interval and classical interval, with digits that show how wide these are."""
    digits = DIGITS
    if x.low is not None and x.high is not None and x.value and isfinite(x.high - x.low):
        half = max((x.high - x.low) / 2, 1e-12 * abs(x.value))
        digits = min(max(ceil(log10(abs(x.value) / half)) + 2, 3), 12)
    return [text(each, digits) for each in (x.value, x.low, x.high, *(x.classical or (None, None)))]


def text(number: float | None, digits: int = DIGITS) -> str:
    """Write a number of a table; "–" if there is none."""
    return "–" if number is None or not isfinite(number) else f"{number:.{digits}g}"


# ---- Files ---------------------------------------------------------------------------------------
def write_files(found: Identification, folder: Path, model: Model) -> list[Path]:
    """Write the files; their paths."""
    values = {**found.checked.settings, **found.values}
    texts = {
        PARAMETERS: _parameters(values, model),
        PARAMETER_SET: _set(values, model),
        SCENARIO: "\n".join(_scenario(found, folder, model, values)),
    }
    for name, text in texts.items():
        with whole(folder / name) as path:
            path.write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in texts]


def _parameters(values: dict[str, Value], model: Model) -> str:
    lines = [f"{name} = {_toml(model.variables[name].written(x))}" for name, x in values.items()]
    return "\n".join(["[parameters]", *lines, ""])


def _toml(value: Value) -> str:
    return toml_text(value) if isinstance(value, str) else json.dumps(value)  # with all digits


def _set(values: dict[str, Value], model: Model) -> str:
    """Write a parameter set of SSP 1.0."""
    rows = [
        f"    <ssv:Parameter name={quoteattr(name)}>"
        f"<ssv:{kind} value={quoteattr(_toml(value))}/></ssv:Parameter>"
        for name, value in values.items()
        if (kind := model.variables[name].type) in TYPES
    ]
    head = (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<ssv:ParameterSet version="1.0" name="identified"\n'
        '    xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">\n'
    )
    body = "\n".join(["  <ssv:Parameters>", *rows, "  </ssv:Parameters>"])
    return f"{head}{body}\n</ssv:ParameterSet>\n"


def _scenario(
    found: Identification, folder: Path, model: Model, values: dict[str, Value]
) -> Iterator[str]:
    """Write a scenario over the first log, from its first segment's start state."""
    log, times = found.recordings[0], found.recordings[0].times
    start = float(found.segments[0].times[0])
    steps = max(round((float(times[-1]) - start) / log.step), 1)
    yield _subject(found, folder)
    yield f"title = {_toml(f'Identified: {log.path.name}')}"
    yield f"description = {_toml(f'Parameters fitted to {log.path.name}, compared with it')}"
    yield f"tolerance = {found.request.tolerance!r}"
    if DELAY in found.estimates:
        late = found.estimates[DELAY].value
        yield f"# what was measured is {late:.6g} s late: the comparison does not know it"
    yield f"\n[time]\nstart = {start!r}\nstop = {float(times[-1])!r}"
    yield f"step = {(float(times[-1]) - start) / steps:.12g}\n"
    yield _parameters(values, model)
    yield "[initial]"
    for name, value in zip(found.states, found.start_states[0].tolist(), strict=True):
        yield f"{name} = {value!r}"
    file, time = from_folder(log.path, folder), found.request.columns.get("time", "time")
    checked = found.checked
    for section, columns in (
        ("inputs", {**checked.reals, **checked.switches}),
        ("measured", checked.outputs),
    ):
        for name, column in columns.items():
            yield f"\n[{section}.{name}]\nfile = {_toml(file)}\ncolumn = {_toml(column.name)}"
            yield f"time = {_toml(time)}"
            if log.first:
                yield f"begin = {difference(log.first, -start)!r}"
            if section == "inputs":
                yield "hold = true"
            if column.one:
                yield f"scale = {_toml(column.one)}"
    yield ""


def _subject(found: Identification, folder: Path) -> str:
    try:
        return f"model = {_toml(project.model(found.model).name)}"
    except UserError:
        return f"fmu = {_toml(from_folder(found.fmu, folder))}"
