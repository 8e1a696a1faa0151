"""Results as tables, as a document for programs, and as files.

The files are a scenario that runs the log again, and the parameters as TOML and SSV.
"""

from collections.abc import Mapping
from math import ceil, isfinite, log10
from pathlib import Path

from rparm import project
from rparm.errors import UserError
from rparm.files import difference, from_folder, toml_value, whole
from rparm.fmi.model import Model, Value
from rparm.identification.identify import Estimate, Identification
from rparm.identification.request import DELAY
from rparm.systems.ssp_writer import parameter_set
from rparm.texts import rendered

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
    set_values = found.checked.settings | found.values
    values = {name: model.variables[name].written(x) for name, x in set_values.items()}
    texts = {
        PARAMETERS: rendered("identified.toml", scenario=False, values=values),
        PARAMETER_SET: _set(set_values, model),
        SCENARIO: _scenario(found, folder, values),
    }
    for name, text in texts.items():
        with whole(folder / name) as path:
            path.write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in texts]


def _set(values: dict[str, Value], model: Model) -> str:
    """Write a parameter set of SSP 1.0."""
    types = {name: model.variables[name].type for name in values}
    rows = [(n, types[n], toml_value(x), "") for n, x in values.items() if types[n] in TYPES]
    return parameter_set("identified", rows)


def _scenario(found: Identification, folder: Path, values: Mapping[str, Value]) -> str:
    """Write a scenario over the first log, from its first segment's start state."""
    log, checked = found.recordings[0], found.checked
    start, stop = float(found.segments[0].times[0]), float(log.times[-1])
    steps = max(round((stop - start) / log.step), 1)
    delay = found.estimates[DELAY].value if DELAY in found.estimates else None
    try:
        key, subject = "model", project.model(found.model).name
    except UserError:
        key, subject = "fmu", from_folder(found.fmu, folder)
    return rendered(
        "identified.toml", scenario=True, key=key, subject=subject, log=log, values=values,
        tolerance=found.request.tolerance, delay=delay, start=start, stop=stop,
        step=(stop - start) / steps, file=from_folder(log.path, folder),
        initial=dict(zip(found.states, found.start_states[0].tolist(), strict=True)),
        time=found.request.columns.get("time", "time"),
        begin=difference(log.first, -start) if log.first else None,
        sections={"inputs": checked.reals | checked.switches, "measured": checked.outputs},
    )  # fmt: skip
