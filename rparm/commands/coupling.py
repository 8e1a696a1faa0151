"""`coupling`: what co-simulation of a system costs."""

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rparm import console, project
from rparm.command_line import Ended, file_or_name, retyped
from rparm.console import Progress
from rparm.errors import UserError
from rparm.files import check_writable, from_folder, written
from rparm.report import overview
from rparm.report.overview import FAILED, PASSED, RAN
from rparm.report.pages import PageTable, RunPage
from rparm.report.run_data import Axis, Curve, Plot, RunData
from rparm.systems import comparison
from rparm.systems.comparison import HALVINGS, CouplingStudy, Halved
from rparm.systems.master import INPUT_MODES, ORDERS
from rparm.systems.opened import SUFFIXES, given_file, opened, system_file
from rparm.systems.structure import WAYS, OpenedSystem
from rparm.units import duration, exponents, short
from rparm.units import verdict as passed_or_failed

PART = overview.COUPLING
ABOUT = "How far the system's co-simulation is from its limit for small communication steps."
ERRORS = (
    "An error is the largest distance of an output from the limit that the two smallest steps lead "
    "to, relative to the largest value of outputs in its unit. The order is the power of the step "
    "by which runs at three steps approach each other; the tolerance of the FMUs' integrators and "
    "events end it."
)


def do_coupling(options: argparse.Namespace) -> Ended:
    """Study the project's closed loop, or halve the step of the system that is named."""
    studied, known = comparison.coupling_study()
    what = options.what
    is_changed = options.step is not None or options.variant is not None
    if what is None or (what == studied.name and not is_changed):
        return _study(options, studied, known)
    path = given_file(what, options.ssp) or system_file(what, options.fmi)
    check_writable(options.report)
    with opened(path, options.step, options.fmi) as system:
        console.messages(str(path), system.notes)
        return _halved(system, system.variant(options.variant), options)


def _halved(system: OpenedSystem, variant: str, options: argparse.Namespace) -> Ended:
    name = system.system.name
    console.stage(f"halving the step of {name}, {variant}")
    ways = [(order, inputs) for inputs in INPUT_MODES for order in ORDERS]
    total = len(ways) * system.system.steps * (2 ** (HALVINGS + 1) - 1)
    with Progress(name, total) as progress:
        found = [comparison.halve(system, variant, way, progress) for way in ways]
    tables = [replace(_table(found), note=ERRORS)]
    limits, note = _limits(system, variant)
    if limits is not None:
        from rparm.linearization.page import STEPS

        tables.append(replace(limits, note=STEPS))
    for table in tables:
        console.plain_table(table.title, table.head, table.rows)
        console.remark(table.note)
    if note:
        console.remark(note)
    first = next(x for x in found if (x.order, x.inputs) == WAYS[system.system.order])
    title = f"{name}, {variant}: errors of the coupling"
    curves = [Curve(f"{x.order.replace('_', '-')}, {x.inputs}", x.errors[::-1]) for x in found]
    axis = Axis("communication step", "ms", log=True)
    plot = Plot("error of the coupling", "", curves, log=True)
    page = RunPage(
        title=title,
        description=ABOUT,
        status=RAN,
        facts=[("system", name), ("variant", variant)],
        data=RunData(title, "", 1e3 * first.steps[::-1], [plot], axis),
        tables=tables,
        notes=[note] if note else [],
        again=_again(options, [file_or_name(options.what, SUFFIXES), variant]),
    )
    index = _written(options, f"{name}_{variant}", page, name)
    order = f", order {first.orders[-1]:.2f}" if math.isfinite(first.orders[-1]) else ""
    verdict = f"coupling: error {short(float(first.errors[0]), 1)} at {duration(first.steps[0])}"
    document = {
        "variant": variant,
        "ways": [
            {"order": x.order, "inputs": x.inputs, "steps": x.steps.tolist(),
             "errors": x.errors.tolist(), "orders": _finite(x.orders.tolist()), "worst": x.worst}
            for x in found
        ],
        "page": index.absolute(),
    }  # fmt: skip
    return Ended(0, verdict + order, document, page=index)


def _again(options: argparse.Namespace, positional: Sequence[str | Path]) -> str:
    given = {"ssp": options.ssp, "step": options.step}
    given["fmi"] = options.fmi if options.fmi != project.VERSIONS[0] else None
    return retyped("coupling", positional, given)


def _written(options: argparse.Namespace, name: str, page: RunPage, group: str) -> Path:
    """Write a page into the folder of the results, and its line on the start page."""
    report = project.results_folder(options.report)
    with written(report):
        return overview.add_run(report, PART, name, page, group)


def _finite(numbers: Sequence[float]) -> list[float | None]:
    return [x if math.isfinite(x) else None for x in numbers]


def _table(found: Sequence[Halved]) -> PageTable:
    rows = []
    for x in found:
        orders = [*(f"{p:.2f}" if math.isfinite(p) else "–" for p in x.orders), "–", "–"]
        for step, error, p in zip(x.steps.tolist(), x.errors.tolist(), orders, strict=True):
            names = x.order.replace("_", "-"), x.inputs, duration(step)
            rows.append([*names, exponents(f"{error:.2g}"), p, x.worst])
    head = ["order", "inputs", "step", "error", "of order", "largest of"]
    return PageTable("Errors of the coupling", head, rows)


def _limits(system: OpenedSystem, variant: str) -> tuple[PageTable | None, str]:
    """Return the table of the largest stable steps, or why there is none."""
    from rparm.linearization import page, study

    try:
        found = study.of_system(system, study.Request(system.path, variant=variant)).largest
    except UserError as error:
        return None, f"No largest stable step: {error}."
    if not found:
        return None, "No largest stable step: the connections form no loop."
    return page.steps_table(list(found)), ""


def _study(options: argparse.Namespace, folder: Path, known: CouplingStudy) -> Ended:
    """Study the closed loop in depth, as its study.py defines."""
    from rparm.linearization.largest_step import study_steps

    path = options.ssp or project.built(folder, ".ssp", "--ssp", options.fmi)
    check_writable(options.report)
    console.stage(f"studying the coupling of {folder.name}")
    parts = known.study_coupling(path, options.report)
    for other, rest in comparison.rests().items():
        if other != folder and not options.ssp:
            ssp = project.built(other, ".ssp", version=options.fmi)
            parts[f"largest steps of {other.name}"] = study_steps(ssp, rest)
    failed = [name for name, part in parts.items() if not part["passed"]]
    rows = [[name, passed_or_failed(name not in failed)] for name in parts]
    picture = (options.report / known.COUPLING_PICTURE).absolute()
    report = project.results_folder(options.report)
    beside = from_folder(picture, report.absolute() / PART)
    page = RunPage(
        title=f"{folder.name}: errors of the coupling",
        description=ABOUT,
        status=FAILED if failed else PASSED,
        facts=[("system", folder.name)],
        data=None,
        tables=[PageTable("Parts", ["part", "result"], rows)],
        diagram=(beside, "Errors over the communication step"),
        again=_again(options, []),
    )
    index = _written(options, folder.name, page, path.stem)
    verdict = console.verdict_line(failed, parts, "part")
    document = {"parts": parts, "picture": picture, "page": index.absolute()}
    return Ended(1 if failed else 0, verdict, document, page=index)
