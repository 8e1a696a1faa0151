"""The report's pages of systems: one a variant, with the diagram of the system."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rparm import files, project
from rparm.errors import StoppedError, UserError
from rparm.files import whole
from rparm.fmi.model import KINDS
from rparm.report import motion, overview, pages
from rparm.report.overview import FAILED, PASSED, SYSTEM, Entry
from rparm.report.pages import RunPage, Table
from rparm.report.run_data import Plot, RunData, result_curve, thinned
from rparm.report.scenario_page import cells, meanings
from rparm.systems import ecos
from rparm.systems.comparison import BOUND, Diagram, Outcome, Study, load_study
from rparm.systems.structure import OpenedSystem, System
from rparm.units import milliseconds, short, unit

MOST_ROWS = 350  # of a file of values, which has many columns
DIGITS = 12  # there; errors have a bound of 1e-7


@dataclass(frozen=True)
class Section:
    """A system whose variants are run."""

    folder: Path
    ssp: OpenedSystem

    @cached_property
    def study(self) -> Study:
        """Module study.py of its folder."""
        return load_study(self.folder)

    @property
    def variants(self) -> list[str]:
        return list(self.ssp.system.parameters)

    @property
    def name(self) -> str:
        return self.folder.name

    @property
    def title(self) -> str:
        """The system and the version of FMI of its components."""
        versions = sorted({model.fmi_version for model in self.ssp.models.values()})
        return f"{self.ssp.path.stem} (FMI {' and '.join(versions)})"


def remove(report: Path, system: str, variants: Sequence[str]) -> None:
    """Remove what an earlier run left of these variants."""
    folder = report / SYSTEM
    overview.forget(report, SYSTEM, variants)
    if not overview.read(report, SYSTEM):
        (folder / f"{system}.svg").unlink(missing_ok=True)
    for variant in variants:
        for suffix in (".csv", ".html"):
            (folder / f"{variant}{suffix}").unlink(missing_ok=True)
    with suppress(OSError):  # not there, or there is more in it
        folder.rmdir()


def write_variant(report: Path, section: Section, outcome: Outcome) -> Entry:
    """Write the page and the values of a run, complete or not at all; its line in the overview."""
    run, ssp, folder = outcome.run, section.ssp, _folder(report, section)
    rows, data = _data(section, outcome)
    error = f"{outcome.error:.1e}"
    above = f"the error of {outcome.worst}, {error}, is above its bound {short(BOUND)}"
    page = RunPage(
        status=PASSED if outcome.passed else FAILED,
        facts=_facts(section, outcome),
        data=data,
        tables=[*_parameters(ssp, outcome.variant), *_solvers(ssp, run), _errors(ssp, outcome)],
        notes=[
            *(f"{m.name.capitalize()}: {m.meaning}." for m in section.study.MEASURES),
            "These numbers are of all steps, also of those that the file leaves out.",
        ],
        failures=[*([] if outcome.passed else [above]), *run.messages],
        **_values(folder, outcome, rows),
        **_texts(section, outcome.variant),
    )
    return overview.write_page(
        folder,
        outcome.variant,
        page,
        section.title,
        title=", ".join(f"{name} {value}" for name, value in _measures(section, outcome)),
        error=float(outcome.error) if np.isfinite(outcome.error) else None,
        bound=BOUND,
        detail=f"worst variable: {outcome.worst}",
    )


def write_failed(report: Path, section: Section, variant: str, error: UserError) -> Entry:
    """Write the page of a variant that stopped early: what was recorded until then."""
    folder, system = _folder(report, section), section.ssp.system
    run = error.result if isinstance(error, StoppedError) else None
    facts = [("system", section.title), ("time", f"{system.start:g} to {system.stop:g} s")]
    data, values = None, {}
    if run is not None:
        outcome = Outcome(variant, len(run.times) - 1, run, {})
        rows, data = _data(section, outcome)
        values = _values(folder, outcome, rows)
        facts.append(("results until", f"{run.times[-1]:g} s"))
    page = RunPage(
        status=FAILED,
        facts=facts,
        data=data,
        tables=_parameters(section.ssp, variant),
        failures=[str(error)],
        **values,
        **_texts(section, variant),
    )
    return overview.write_page(folder, variant, page, section.title, title="", detail=str(error))


def _folder(report: Path, section: Section) -> Path:
    """Return the folder of the pages, with the assets that they share."""
    pages.write_assets(report)
    folder = report / SYSTEM
    folder.mkdir(parents=True, exist_ok=True)
    with whole(folder / f"{section.name}.svg") as path:
        path.write_bytes((section.folder / project.DIAGRAM).read_bytes())
    return folder


def _texts(section: Section, variant: str) -> dict[str, Any]:
    """Return the texts of a variant's page, however its run ended."""
    stem = section.ssp.path.stem
    return {
        "title": f"{stem}: {variant}",
        "description": _description(section.ssp.system, variant),
        "diagram": (f"{section.name}.svg", f"Components of {stem} and the signals between them"),
        "again": f"{project.PROGRAM} system {variant}",
    }


def _data(section: Section, outcome: Outcome) -> tuple[np.ndarray, RunData]:
    """Return the rows of the file of values, and plots and motion at these."""
    times = outcome.run.times
    plots = [_plot(section.ssp, outcome, diagram) for diagram in section.study.DIAGRAMS]
    rows = thinned([column for plot in plots for column in plot.columns], MOST_ROWS)
    plots = [plot.at(rows) for plot in plots]
    moving = motion.of_outcome(section.name, section.ssp, outcome, rows)
    return rows, RunData(outcome.variant, "", times[rows], plots, motion=moving)


def _values(folder: Path, outcome: Outcome, rows: np.ndarray) -> dict[str, str]:
    """Write the file of values; what the page says of it."""
    run, csv = outcome.run, f"{outcome.variant}.csv"
    files.write_trajectory(folder / csv, run.times[rows], run.names, run.values[rows], DIGITS, True)
    every = milliseconds(np.diff(run.times[rows]).max(initial=0.0))
    note = f"It has a row every {every}, the extremes of the plots in between, and {DIGITS} digits."
    return {"csv": csv, "csv_note": note}


def _plot(ssp: OpenedSystem, outcome: Outcome, diagram: Diagram) -> Plot:
    curves = []
    for name in diagram.curves:
        wanted = diagram.references.get(name)
        reference = None if wanted is None else outcome.column(wanted)
        steps = ssp.variable(name).type != "Real"
        curves.append(result_curve(name, outcome.column(name), reference, steps))
    variables = [ssp.variable(name) for name in diagram.curves]
    meaning = meanings(variables)
    return Plot(diagram.title, unit(variables[0].unit), curves, note=meaning)


def _facts(section: Section, outcome: Outcome) -> list[tuple[str, str]]:
    system = section.ssp.system
    return [
        ("system", section.title),
        ("time", f"{system.start:g} to {system.stop:g} s"),
        ("steps", str(outcome.steps)),
        ("worst error", f"{outcome.error:.1e} of {short(BOUND)} ({outcome.worst})"),
        *_measures(section, outcome),
        ("wall time", f"{outcome.run.wall_time:.3f} s"),
    ]


def _measures(section: Section, outcome: Outcome) -> list[tuple[str, str]]:
    return [(m.name, f"{m.value(outcome):.3g} {m.unit}") for m in section.study.MEASURES]


def _description(system: System, variant: str) -> str:
    """Describe the variant, and how it is run."""
    said = system.descriptions.get(variant, "").rstrip(".")
    how = f"Run by Ecos with steps of {milliseconds(system.step)}."
    return f"{said}. {how}" if said else how


def _parameters(ssp: OpenedSystem, variant: str) -> list[Table]:
    """Return a table of the variant's values, then start values per component."""
    given = ssp.system.parameter_sets[variant]
    connected = {(x.end_component, x.end_connector) for x in ssp.system.connections}
    rows: list[Sequence[object]] = []
    others = []
    for component, model in ssp.models.items():
        values = given.get(component, {})
        rows += [(component, *cells(model.variables[name], values[name])) for name in values]
        rest = [
            cells(variable, value)
            for name, value in model.start_values.items()
            if name not in values and (component, name) not in connected
            for variable in [model.variables[name]]
            if any(variable.is_a(kind) for kind in KINDS)
        ]
        if rest:
            title = f"All other start values of {component}"
            others.append(Table(title, ("name", "value", "unit", "meaning"), rest, folded=True))
    head = ("component", "name", "value", "unit", "meaning")
    own = [Table("Parameters of this variant", head, rows)] if rows else []
    return own + others


def _solvers(ssp: OpenedSystem, run: ecos.Run) -> list[Table]:
    """Return statistics of the components that integrate."""
    rows = []
    for component in ssp.models:
        values = [run.statistics.get(f"{component}.{name}") for name in ecos.STATISTICS]
        if any(value is not None for value in values):
            cells = ("–" if x is None else short(x) if isinstance(x, float) else x for x in values)
            rows.append((component, *cells))
    note = "Of components with a solver, from the start to the end of the run."
    return [Table("Solvers", ("component", *ecos.STATISTICS.values()), rows, note)] if rows else []


def _errors(ssp: OpenedSystem, outcome: Outcome) -> Table:
    found = outcome.errors.items()
    rows = [(name, unit(ssp.variable(name).unit), f"{error:.2e}") for name, error in found]
    note = "Largest difference from the reference of Ecos's order, relative to the variable's "
    note += "largest value."
    return Table("Errors of all variables", ("variable", "unit", "error"), rows, note, folded=True)
