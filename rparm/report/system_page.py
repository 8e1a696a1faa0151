"""The report's pages of systems: one a variant, with the diagram of the system."""

import re
import shlex
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rparm import files, project
from rparm.errors import UserError
from rparm.files import from_here, whole, write_text
from rparm.fmi.model import KINDS
from rparm.report import block_diagram, motion, overlay, overview, pages
from rparm.report.overview import FAILED, PASSED, RAN, SYSTEM, Entry
from rparm.report.pages import PageTable, RunPage
from rparm.report.run_data import Plot, RunData, result_curve, thinned
from rparm.report.scenario_page import cells, meanings
from rparm.runs.inputs import Log
from rparm.systems import comparison, ecos
from rparm.systems.comparison import BOUND, Diagram, Measure, Outcome, Study, load_study
from rparm.systems.feedthrough import loops, sequence
from rparm.systems.structure import OpenedSystem
from rparm.units import duration, exponents, seconds, short, unit

MOST_ROWS = 350  # of a file of values, which has many columns
DIGITS = 12  # there; errors have a bound of 1e-7
COLUMNS = 2  # of a picture
CURVES, DIAGRAMS = 6, 24  # most in a diagram, and on a page, of a system of a user


@dataclass(frozen=True)
class Section:
    """A system whose variants are run."""

    folder: Path | None  # of a system of the project; None: of a user
    ssp: OpenedSystem

    @cached_property
    def study(self) -> Study | None:
        """Module study.py of its folder."""
        return self.folder and load_study(self.folder)

    @property
    def measures(self) -> Sequence[Measure]:
        return self.study.MEASURES if self.study else ()

    @cached_property
    def diagrams(self) -> Sequence[Diagram]:
        """Diagrams of its folder; of a user's system, of what is kept by unit."""
        if self.study:
            return self.study.DIAGRAMS
        groups: dict[tuple[str, str | None], list[str]] = {}
        for name in comparison.kept(self.ssp):
            variable = self.ssp.variable(name)
            groups.setdefault((variable.type, variable.unit), []).append(name)
        parts = [
            names[i : i + CURVES] for names in groups.values() for i in range(0, len(names), CURVES)
        ]
        return [Diagram(", ".join(names), names) for names in parts[:DIAGRAMS]]

    @cached_property
    def animated(self) -> tuple[str, str] | None:
        """Return a component that has an animation, and the folder of its model."""
        for name, model in self.ssp.models.items():
            for folder in project.models().values():
                if project.is_built_from(model.name, folder) and motion.can_animate(folder.name):
                    return name, folder.name
        return None

    @property
    def names(self) -> list[str]:
        """Names to record: what is kept, and what the animation shows."""
        component = "" if self.folder or self.animated is None else self.animated[0]
        shown = self.ssp.models[component].variables.values() if component else ()
        moving = [
            f"{component}.{v.name}"
            for v in shown
            if v.causality in ("input", "output") and v.type in ("Real", "Integer", "Boolean")
        ]
        return list(dict.fromkeys([*comparison.kept(self.ssp), *moving]))

    def said(self, variant: str) -> str:
        """Return what the system says of a variant, or a user's of itself."""
        system = self.ssp.system
        return system.descriptions.get(variant, "" if self.folder else system.description)

    def page(self, variant: str) -> str:
        """Name the page of a variant, and its file of values."""
        return variant if self.folder else _file_name(f"{self.name}_{variant}")

    @property
    def variants(self) -> list[str]:
        return list(self.ssp.system.parameters)

    @property
    def name(self) -> str:
        return self.folder.name if self.folder else self.ssp.system.name

    @property
    def shown(self) -> str:
        """Its name on pages."""
        return self.ssp.path.stem if self.folder else self.name

    @property
    def title(self) -> str:
        """The system and the version of FMI of its components."""
        versions = sorted({model.fmi_version for model in self.ssp.models.values()})
        return f"{self.shown} (FMI {' and '.join(versions)})"


def write_picture(file: Path, section: Section, outcome: Outcome) -> None:
    """Draw the diagrams of a variant's page into a picture, for READMEs."""
    import matplotlib as mpl  # takes long
    from matplotlib.figure import Figure

    rows = -(-len(section.diagrams) // COLUMNS)
    with mpl.rc_context(fname=pages.STYLE):
        picture = Figure(figsize=(14, 2.2 * rows + 0.6), layout="constrained")
        panels = picture.subplots(rows, COLUMNS, sharex=True, squeeze=False).ravel()
        for axes, diagram in zip(panels, section.diagrams, strict=False):
            plot = _plot(section.ssp, outcome, diagram)
            axes.set_title(f"{plot.title} ({plot.unit})" if plot.unit else plot.title, loc="left")
            for color, curve in zip(pages.CURVE_COLORS, plot.curves, strict=False):
                if curve.reference is not None:
                    wide = {"color": pages.REFERENCE_COLOR, "linewidth": 5, "label": "reference"}
                    axes.plot(outcome.run.times, curve.reference, **wide)
                style = "steps-post" if curve.steps else "default"
                named = {"color": color, "label": curve.name, "drawstyle": style}
                axes.plot(outcome.run.times, curve.values, linewidth=1.3, **named)
            axes.legend(fontsize=8.5)
            axes.set_xlabel("time (s)")
        for axes in panels[len(section.diagrams) :]:
            axes.remove()
        found = ", ".join(f"{name} {text}" for name, text in _measures(section, outcome))
        picture.suptitle(f"{section.shown}, {outcome.variant}: {found}", x=0.015, ha="left")
    pages.save_figure(picture, file)


def remove(report: Path, system: str, names: Sequence[str]) -> None:
    """Remove what an earlier run left of these pages."""
    folder = report / SYSTEM
    overview.forget(report, SYSTEM, names)
    if not overview.read(report, SYSTEM):
        (folder / _file_name(f"{system}.svg")).unlink(missing_ok=True)
    for name in names:
        for suffix in (".csv", ".html"):
            (folder / f"{name}{suffix}").unlink(missing_ok=True)
    with suppress(OSError):  # not there, or there is more in it
        folder.rmdir()


def write_variant(
    report: Path, section: Section, outcome: Outcome, other: Log | None = None
) -> Entry:
    """Write page and values of a run, complete or not at all; return its line of the overview."""
    run, ssp, folder = outcome.run, section.ssp, _folder(report, section)
    rows, data = _data(section, outcome, other)
    failures = []
    if not outcome.passed:
        error = f"{outcome.error:.1e}"
        failures = [f"the error of {outcome.worst}, {error}, is above its bound {short(BOUND)}"]
    known = {"error": None, "bound": None, "detail": estimate(outcome)}
    if not outcome.is_estimate:
        error = float(outcome.error) if np.isfinite(outcome.error) else None
        known = {"error": error, "bound": BOUND, "detail": f"worst variable: {outcome.worst}"}
    page = RunPage(
        status=RAN if outcome.is_estimate else PASSED if outcome.passed else FAILED,
        facts=_facts(section, outcome),
        data=data,
        tables=[*_parameters(ssp, outcome.variant), *_solvers(ssp, run), *_errors(ssp, outcome)],
        notes=[
            *(f"{m.name.capitalize()}: {m.meaning}." for m in section.measures),
            "These numbers are of all steps, also of those that the file leaves out.",
        ],
        failures=[*failures, *run.messages],
        **_values(section, folder, outcome, rows),
        **_texts(section, outcome.variant),
    )
    return overview.write_page(
        folder,
        section.page(outcome.variant),
        page,
        section.title,
        title=section.said(outcome.variant),
        difference=data.other["largest"] if data.other else "",
        **known,
    )


def estimate(outcome: Outcome) -> str:
    """Say how large the coupling error is, or why that is not known."""
    if not outcome.errors:
        return f"coupling error not estimated: {outcome.why}"
    size = exponents(f"{outcome.error:.2g}")
    found = f"coupling error about {size} ({outcome.worst}), by half the step"
    if outcome.cheaper:
        order, error = outcome.cheaper
        found += f"; order {order} would have about {exponents(f'{error:.2g}')}"
    return found


def true_error(outcome: Outcome) -> str:
    """Say how far the run is from one of the same files as one FMU."""
    worst = max(outcome.exact_errors, key=outcome.exact_errors.__getitem__)
    size = exponents(f"{outcome.exact_errors[worst]:.2g}")
    return f"true coupling error {size} ({worst}), from the same files as one FMU"


def write_failed(report: Path, section: Section, variant: str, error: UserError) -> Entry:
    """Write the page of a variant that stopped early: what was recorded until then."""
    folder, system = _folder(report, section), section.ssp.system
    run = error.result
    facts = [("system", section.title), ("time", f"{system.start:g} to {system.stop:g} s")]
    data, values = None, {}
    if run is not None:
        outcome = Outcome(variant, len(run.times) - 1, run, {})
        rows, data = _data(section, outcome)
        values = _values(section, folder, outcome, rows)
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
    name, more = section.page(variant), {"title": section.said(variant), "detail": str(error)}
    return overview.write_page(folder, name, page, section.title, **more)


def _folder(report: Path, section: Section) -> Path:
    """Return the folder of the pages, with the assets that they share."""
    pages.write_assets(report)
    folder = report / SYSTEM
    folder.mkdir(parents=True, exist_ok=True)
    if section.folder is None:
        write_text(folder / _file_name(f"{section.name}.svg"), block_diagram.draw(section.ssp))
        return folder
    with whole(folder / _file_name(f"{section.name}.svg")) as path:
        path.write_bytes((section.folder / project.DIAGRAM).read_bytes())
    return folder


def _file_name(text: str) -> str:
    return re.sub(r"[^\w.-]", "_", text)


def _texts(section: Section, variant: str) -> dict[str, Any]:
    """Return the texts of a variant's page, however its run ended."""
    name = section.shown
    of_file = "" if section.folder else f"{shlex.quote(str(from_here(section.ssp.path)))} "
    return {
        "title": f"{name}: {variant}",
        "description": _description(section, variant),
        "diagram": (_file_name(f"{section.name}.svg"), f"Components of {name} and their signals"),
        "again": f"{project.PROGRAM} system {of_file}{variant}",
    }


def _data(
    section: Section, outcome: Outcome, other: Log | None = None
) -> tuple[np.ndarray, RunData]:
    """Return the rows of the file of values, and plots and motion at these."""
    times, ssp, over = outcome.run.times, section.ssp, None
    plots = [_plot(ssp, outcome, diagram) for diagram in section.diagrams]
    if other is not None:
        plots, over = overlay.lay(other, plots, times - ssp.system.start, ssp.system.start)
    rows = thinned([column for plot in plots for column in plot.columns], MOST_ROWS)
    plots = [plot.at(rows) for plot in plots]
    if section.folder:
        moving = motion.of_outcome(section.name, ssp, outcome, rows)
    else:
        component, model = section.animated or ("", "")
        moving = motion.of_outcome(model, ssp, outcome, rows, component)
    return rows, RunData(outcome.variant, "", times[rows], plots, motion=moving, other=over)


def _values(section: Section, folder: Path, outcome: Outcome, rows: np.ndarray) -> dict[str, str]:
    """Write the file of values, and return what the page says of it."""
    run, csv = outcome.run, f"{section.page(outcome.variant)}.csv"
    names = run.names if section.folder else comparison.kept(section.ssp)
    values = run.values[np.ix_(rows, [run.names.index(name) for name in names])]
    files.write_trajectory(folder / csv, run.times[rows], names, values, DIGITS, True)
    every = duration(np.diff(run.times[rows]).max(initial=0.0))
    note = f"It has a row every {every}, the extremes of the plots in between, and {DIGITS} digits."
    return {"csv": csv, "csv_note": note}


def _plot(ssp: OpenedSystem, outcome: Outcome, diagram: Diagram) -> Plot:
    curves = []
    for name in diagram.curves:
        wanted = diagram.references.get(name)
        reference = None if wanted is None else outcome.column(wanted)
        if outcome.exact is not None:
            reference = outcome.exact[:, outcome.run.names.index(name)]
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
        _error(outcome),
        *_true_error(outcome),
        *_measures(section, outcome),
        ("wall time", seconds(outcome.run.wall_time)),
    ]


def _error(outcome: Outcome) -> tuple[str, str]:
    if outcome.is_estimate:
        return "coupling error", estimate(outcome).removeprefix("coupling error ")
    return "worst error", f"{outcome.error:.1e} of {short(BOUND)} ({outcome.worst})"


def _true_error(outcome: Outcome) -> list[tuple[str, str]]:
    if not outcome.exact_errors:
        return []
    return [("true coupling error", true_error(outcome).removeprefix("true coupling error "))]


def _measures(section: Section, outcome: Outcome) -> list[tuple[str, str]]:
    return [(m.name, f"{m.value(outcome):.3g} {m.unit}") for m in section.measures]


def _description(section: Section, variant: str) -> str:
    """Describe the variant, and how it is run."""
    system, said = section.ssp.system, section.said(variant)
    why_not = "" if section.folder else ecos.unsuited(section.ssp)
    by = f"rparm's own master ({why_not})" if why_not else "Ecos"
    how = f"Run by {by} with steps of {duration(system.step)}."
    how += " ".join(["", *_coupled(section.ssp)])
    return f"{said.rstrip('.')}. {how}" if said else how


def _coupled(ssp: OpenedSystem) -> Iterator[str]:
    """Say in which order components step, at which rates, and what is solved for."""
    system = ssp.system
    if system.order == "gauss_seidel":
        names = sequence(ssp.models, system.connections, ssp.models)
        yield f"Components step one after the other, by direct feedthrough: {', '.join(names)}."
    elif system.order == "extrapolated":
        yield "Inputs are continued over each step, as lines."
    rates = [f"{name} every {duration(every)}" for name, every in system.rates.items()]
    if rates:
        yield f"Rates: {', '.join(rates)}."
    real = [c for c in system.connections if ssp.variable(c.start).type == "Real"]
    for loop in loops(real, ssp.models):
        yield (
            f"Solved together at each communication point, by Newton's method from the values "
            f"before: {', '.join(c.end for c in loop)}. Of several solutions it is the one that "
            "this leads to."
        )


def _parameters(ssp: OpenedSystem, variant: str) -> list[PageTable]:
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
            others.append(PageTable(title, ("name", "value", "unit", "meaning"), rest, folded=True))
    head = ("component", "name", "value", "unit", "meaning")
    own = [PageTable("Parameters of this variant", head, rows)] if rows else []
    return own + others


def _solvers(ssp: OpenedSystem, run: ecos.Run) -> list[PageTable]:
    """Return statistics of the components that integrate."""
    rows = []
    for component in ssp.models:
        values = [run.statistics.get(f"{component}.{name}") for name in ecos.STATISTICS]
        if any(value is not None for value in values):
            cells = ("–" if x is None else int(x) if x == int(x) else short(x) for x in values)
            rows.append((component, *cells))
    note = "Of components with a solver, from the start to the end of the run."
    return (
        [PageTable("Solvers", ("component", *ecos.STATISTICS.values()), rows, note)] if rows else []
    )


def _errors(ssp: OpenedSystem, outcome: Outcome) -> list[PageTable]:
    found = outcome.errors.items()
    tables = []
    if outcome.exact_errors:
        exact = [
            (name, unit(ssp.variable(name).unit), f"{error:.2e}")
            for name, error in outcome.exact_errors.items()
        ]
        note = "Largest difference from a run of the same files as one FMU, whose curves are the "
        note += "references in the plots, relative to the largest value of this unit."
        title, head = "True coupling errors of all variables", ("variable", "unit", "error")
        tables.append(PageTable(title, head, exact, note, folded=True))
    rows = [(name, unit(ssp.variable(name).unit), f"{error:.2e}") for name, error in found]
    note = "Largest difference from the reference of Ecos's order, relative to the variable's "
    note += "largest value."
    title = "Errors of all variables"
    if outcome.is_estimate:
        title = "Coupling errors of all variables"
        note = "Twice the largest difference from a run with half the step, as of an error of "
        note += "first order, relative to the largest value of all variables of this unit."
    head = "variable", "unit", "error"
    return tables + ([PageTable(title, head, rows, note, folded=True)] if rows else [])
