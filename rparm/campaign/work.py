"""A campaign from its file to its runs, shared by command and programs, and one run again.

A run that is made again writes all its Real outputs and a page with its motion.
"""

import dataclasses
import multiprocessing
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rparm import files, project
from rparm.campaign import bases, campaign_file, planning, runs
from rparm.campaign.bases import Base
from rparm.campaign.campaign_file import Campaign
from rparm.campaign.job import Archive, Job
from rparm.campaign.planning import FAILURE, RUN, Points, plan
from rparm.campaign.results import Results
from rparm.campaign.runs import Rows, Runner, open_fmus
from rparm.errors import UserError
from rparm.interruption import temporary_folder
from rparm.report import motion, overview, pages
from rparm.report.motion import Recorded
from rparm.report.overview import RAN
from rparm.report.pages import PageTable, RunPage
from rparm.report.run_data import Plot, RunData, result_curve, thinned
from rparm.units import unit

if TYPE_CHECKING:
    from distributed import Client

FOLDER = overview.REPLAYS
DIED = "the run takes its process down"


@dataclass(frozen=True)
class Work:
    """A campaign, its job, and the folder of its results."""

    campaign: Campaign
    base: Base
    job: Job
    points: Points
    results: Results

    def begin(self) -> list[int]:
        """Return the blocks without results, after a check that they can be made and kept."""
        runs.check(self.job, self.base.archives, self.base.path)
        self.results.begin()
        return self.results.missing()

    def run(
        self,
        client: "Client",
        blocks: Sequence[int],
        progress: Callable[[int], object] = lambda _: None,
    ) -> None:
        """Make the runs of some blocks; `progress` is called with the number of those made."""
        from rparm.campaign.engine import Engine  # takes long

        given = self.campaign, self.job, self.base.archives, self.points, self.results
        Engine(client, *given).run(blocks, progress)

    def table(self) -> dict[str, np.ndarray]:
        """Read all columns, (runs,) each: parameters, measures, reasons of failures."""
        return self.results.table([RUN, *self.results.columns, FAILURE])


@contextmanager
def opened(
    file: Path,
    fmu: Path | None = None,
    output: Path | None = None,
    ask: Callable[[Sequence[str]], object] = lambda _: None,
) -> Iterator[Work]:
    """Open the work of a campaign's file; UserError if anything in it is wrong.

    By default, the FMU or SSP is the built one, and the file or the project names the folder.
    `ask` is called with questions to the user, about values that look like mistakes.
    """
    given = campaign_file.read(file)
    with bases.opened(given, fmu, file) as base:
        ask([*base.questions, *bases.questions(given, base)])
        campaign = bases.in_si(given, base, file)
        job = planning.plan(campaign, base, file)
        points = Points(campaign, planning.constants(campaign, base))
        if output is None:
            own = campaign.output
            output = project.campaign_folder(file.stem) if own is None else file.parent / own
        results = Results(output, campaign, job, file.read_text(encoding="utf-8"))
        yield Work(campaign, base, job, points, results)


# ---- One run again -------------------------------------------------------------------------------
@dataclass(frozen=True)
class Replay:
    parameters: dict[str, float]
    kept: dict[str, float]
    files: list[Path]  # values and page, if it ended
    failure: str  # why it did not, or nothing

    @property
    def lines(self) -> list[str]:
        """It as text, a number or a file each."""
        values = (*self.parameters.items(), *self.kept.items())
        return [*(f"{name} = {value!r}" for name, value in values), *map(str, self.files)]

    @property
    def page(self) -> Path | None:
        return self.files[-1] if self.files else None

    @property
    def document(self) -> dict[str, object]:
        return dataclasses.asdict(self)


def replay(
    campaign: Campaign, base: Base, points: Points, run: int, folder: Path, command: str
) -> Replay:
    """Make a run again by `command`, which its page shows; UserError if there is no such run."""
    if run >= campaign.count:
        raise UserError(f"no run {run}: the campaign has runs 0 to {campaign.count - 1}")
    job = plan(campaign, base, "replay", base.real_outputs())
    job = dataclasses.replace(job, trajectories=frozenset([run]))
    values = points.of(range(run, run + 1))
    rows = _apart(job, base.archives, run, points.targets(values, job))
    given = dict(zip(points.names, values[0].tolist(), strict=True))
    failure = rows.failures[0] if rows else DIED
    if failure:
        return Replay(given, {}, [], failure)
    columns = [measure.column for measure in job.measures]
    kept = dict(zip(columns, rows.measures[0].tolist(), strict=True))
    record = rows.trajectories[run]
    table = folder / FOLDER / f"run_{run}.csv"
    table.parent.mkdir(parents=True, exist_ok=True)
    files.write_trajectory(table, job.times, job.watched, record)
    report = project.results_folder(folder)
    page = RunPage(
        title=f"{campaign.title}: run {run}",
        description="One run of a campaign, made again.",
        status=RAN,
        facts=[("runs of the campaign", str(campaign.count)), ("steps", str(job.steps))],
        data=_data(base, job, given, record),
        tables=[
            PageTable("Parameters of this run", ("parameter", "value"), list(given.items())),
            PageTable("Kept of it", ("measure", "value"), list(kept.items())),
        ],
        csv=table.name,
        csv_note="It has all Real outputs.",
        again=command,
    )
    root = pages.root(report, table.parent)
    written = pages.write_run(table.with_suffix(".html"), page, root)
    entry = overview.entry_of(table.stem, page, base.path.stem)
    overview.record(report, overview.REPLAYS, [entry], table.parent)
    return Replay(given, kept, [table, written], "")


def _apart(job: Job, archives: Mapping[str, Archive], run: int, targets: np.ndarray) -> Rows | None:
    """Make a run in another process, which it may take down: None then."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there,), daemon=True)
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)  # in the other one: this one ends it
    try:
        process.start()
    finally:
        signal.signal(signal.SIGINT, handler)
    with temporary_folder() as folder:
        try:
            there.close()
            here.send((job, archives, folder, run, targets))
            rows = here.recv()
        except (EOFError, ConnectionError):
            return None
        finally:
            process.kill()
            process.join()
    if isinstance(rows, UserError):
        raise rows
    return rows


def _serve(connection: Connection) -> None:
    """Receive a run and send its rows, or the user's error."""
    job, archives, folder, run, targets = connection.recv()
    try:
        with open_fmus(archives, folder) as fmus, Runner(job, fmus) as runner:
            rows = runner.rows([run], targets)
    except UserError as error:
        rows = error
    connection.send(rows)


def _data(base: Base, job: Job, given: dict[str, float], record: np.ndarray) -> RunData:
    """Return plots of the states, and the motion; record: (n + 1, watched)."""
    outputs = dict(zip(job.watched, record.T, strict=True))
    curves = [result_curve(x, outputs[x]) for x in base.states() or list(outputs)]
    rows = thinned([curve.values for curve in curves])
    plots = [Plot(x.name, unit(base.variable(x.name)[1].unit), [x.at(rows)]) for x in curves]
    moving = motion.of_recorded(base.folder, _recorded(base, job, given, outputs), rows)
    return RunData("run", "", job.times[rows], plots, motion=moving)


def _recorded(
    base: Base, job: Job, given: dict[str, float], outputs: dict[str, np.ndarray]
) -> Recorded:
    """Return outputs and inputs of each row: of the step that ends there."""
    steps = np.maximum(np.arange(len(job.times)) - 1, 0)
    inputs = {
        name: values[steps]
        for group in (job.reals, job.switches)
        for name, values in zip(group.names, group.values.T, strict=True)
    }
    varied = {name: np.full(len(job.times), given[name]) for name in given if name in inputs}
    return Recorded(job.times, outputs | inputs | varied, {}, _values(base, job, given))


def _values(base: Base, job: Job, given: dict[str, float]) -> dict[str, object]:
    """Return start values of all variables in this run."""
    is_system = len(job.components) > 1
    fixed = {
        f"{component.name}.{name}" if is_system else name: value
        for component in job.components
        for name, value in component.values.items()
    }
    return base.start_values() | fixed | given
