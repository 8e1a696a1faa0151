"""`identify`: find parameters of an FMU that fit logs of a machine."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rparm import console, project
from rparm.building import EQUATIONS
from rparm.command_line import Ended, file_or_name, names, pairs, retyped
from rparm.errors import UserError, placed
from rparm.files import check_writable, from_here, number_in, written
from rparm.report import overview, pages
from rparm.report.overview import FAILED, RAN, Entry, sparkline
from rparm.units import SECONDS, typed_quantity

if TYPE_CHECKING:
    from rparm.fmi.model import Model
    from rparm.identification.identify import Identification
    from rparm.identification.request import Request

PART = overview.IDENTIFICATIONS
SEGMENT = "0.4"  # s
SUFFIXES = (".fmu", EQUATIONS)
SEVERAL = "parameters", "inputs", "measured", "set", "start", "columns", "units"
GIVEN = *SEVERAL, "delay", "validate"


def do_identify(options: argparse.Namespace) -> Ended:
    """Identify, print a table, write page and files."""
    from rparm.fmi.fmu_file import Fmu
    from rparm.identification import identify, results

    check_writable(options.report)
    path, request, true = _asked(options)
    with Fmu(path) as fmu:
        console.stage("fitting")
        found, model = identify.identify(fmu, request), fmu.model
    _print(found, true)
    with written(options.report):
        options.report.mkdir(parents=True, exist_ok=True)
        files = results.write_files(found, options.report, model)
        files.append(_written(found, options, model, true))
    verdict = f"identified: {len(found.estimates)} parameters"
    if not found.has_converged:
        verdict = f"failed: the fit has not converged in {found.steps} iterations"
    elif found.misfit:
        verdict = f"{'identified' if found.passed else 'failed'}: {found.misfit}"
    document = results.document(found) | {"files": [file.absolute() for file in files]}
    return Ended(0 if found.passed else 1, verdict, document, page=files[-1])


def _written(
    found: "Identification", options: argparse.Namespace, model: "Model", true: dict[str, float]
) -> Path:
    """Write the page, and its line on the start page with the first output."""
    from rparm.identification import page

    again, first = _again(options), range(found.of_first)
    output = next(iter(found.checked.outputs))
    times = np.concatenate([found.segments[i].times for i in first])
    values = np.concatenate([found.predicted[i][:, 0] for i in first])
    entry = Entry(
        found.model, f"Parameters: {', '.join(found.estimates)}", found.model, pages.INDEX,
        RAN if found.passed else FAILED, command=again, line=sparkline(times, values),
        line_of=output, line_text=f"Simulated {output}",
    )  # fmt: skip
    report = project.results_folder(options.report)
    return overview.add(
        report, PART, entry, lambda to, root: page.write(found, to, model, true, again, root)
    )


def _asked(options: argparse.Namespace) -> tuple[Path, "Request", dict[str, float]]:
    """Return FMU and request of the options, and true values of the parameters, if known."""
    from rparm.identification.request import Request, make_demo

    if options.demo:
        _refuse_others(options)
        console.stage("making a log")
        folder = options.report
        with written(folder):
            folder.mkdir(parents=True, exist_ok=True)
        made = make_demo(folder)
        print(f"log: {from_here(made.request.logs[0])}")
        return made.fmu, made.request, dict(made.true)
    if not options.fmu or not options.logs:
        raise UserError("expected an FMU and a log (--help explains)")
    with placed("--segment"):
        segment = typed_quantity(options.segment, SECONDS)
    request = Request(
        logs=options.logs,
        parameters=names(options.parameters),
        inputs=names(options.inputs),
        measured=names(options.measured),
        settings=_values("--set", options.set),
        starts=_values("--start", options.start),
        columns=pairs("--columns", options.columns),
        units=pairs("--units", options.units),
        with_delay=options.delay,
        validation=options.validate,
        segment=segment,
    )
    return _fmu(options.fmu), request, {}


def _refuse_others(options: argparse.Namespace) -> None:
    """Refuse what the demo would ignore: it brings its own FMU, log and settings."""
    others = [f"--{name}" for name in GIVEN if getattr(options, name)]
    others += ["an FMU"] if options.fmu else []
    others += ["--segment"] if options.segment != SEGMENT else []
    if others:
        raise UserError(f"--demo: brings its own FMU, log and settings, got {', '.join(others)}")


def _fmu(given: str) -> Path:
    """Return a file .fmu or with equations, or the FMU of a model of the project."""
    path = Path(given)
    if path.suffix.lower() in SUFFIXES:
        return path
    if path.suffix:
        expected = "an FMU (.fmu), equations (.toml), or a model of the project"
        raise UserError(f"{given}: expected {expected}")
    return project.built(project.model(given), ".fmu")


def _again(options: argparse.Namespace) -> str:
    files = [file_or_name(options.fmu, SUFFIXES), *options.logs] if options.fmu else []
    given = {name: getattr(options, name) for name in (*SEVERAL, "validate")}
    given["segment"] = options.segment if options.segment != SEGMENT else None
    return retyped("identify", files, given | {"delay": options.delay, "demo": options.demo})


def _values(option: str, given: Sequence[str]) -> dict[str, Any]:
    return {name: _value(text) for name, text in pairs(option, given).items()}


def _value(text: str) -> float | bool | str:
    """Parse a number, a truth, or a text: with a unit, or the name of an item."""
    if text in ("true", "false"):
        return text == "true"
    try:
        return number_in(text)
    except ValueError:
        return text


def _print(found: "Identification", true: dict[str, float]) -> None:
    from rparm.identification import results

    rows = results.rows(found, true)
    titles = ["value", "low", "high", *(["true"] if true else [])]
    columns = dict.fromkeys(titles, 10) | {"unit": 9}
    table = console.PrintedTable("parameter", [row[0] for row in rows], columns, result=0)
    for name, cells, unit in rows:
        table.row(name, [*cells, unit])
    second = found.validation
    also = "" if second is None else f", of the second log {second.chi2:.3g}"
    print(f"chi2: {found.chi2:.3g}{also} (1: only noise is left)")
    for text in [*found.notes, *found.warnings]:
        console.remark(text)
