"""Runs of a job on a worker: a runner per thread, whose instances are reset between runs.

A worker of Dask gets FMUs and job once, as a plugin, also if it starts later or again.
"""

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import cast

import numpy as np
from distributed import Worker, WorkerPlugin, get_worker

from rparm.campaign import mastered
from rparm.campaign.job import Archive, Job, Recorded, Target
from rparm.errors import UserError, one_line
from rparm.fmi.compiled_loop import Stepper, Tangent
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.systems.python_component import PythonComponent

LONGEST_REASON = 500  # characters


@dataclass(frozen=True)
class Rows:
    runs: np.ndarray  # (rows,) their numbers
    measures: np.ndarray  # (rows, measures); NaN in a run that failed
    failures: list[str]  # why each run failed, "" if it did not
    trajectories: dict[int, np.ndarray]  # (n + 1, watched) by number of the run


class Runner(AbstractContextManager["Runner"]):
    """Instances of all components, of FMUs by their hash; a context manager that frees them."""

    def __init__(self, job: Job, fmus: Mapping[str, Fmu]) -> None:
        self._job, self._fmus = job, fmus
        self._stack = ExitStack()
        self._instances: list[Instance] = []
        parts = [c.reals for c in job.components], [c.switches for c in job.components]
        self._stepper = Stepper(*parts, len(job.reals.names), len(job.switches.names))
        self._points = np.arange(1, job.steps + 1)
        self._held = job.reals.values.copy()
        self._record = np.empty((len(job.times), len(job.watched)))
        self._tangent = Tangent.none() if job.tangent is None else Tangent(*job.tangent)
        self._growth = np.empty(0 if job.tangent is None else job.steps)
        self._integers: list[int] = []  # at the end of the last run
        column = {name: i for names in (job.watched, job.integers) for i, name in enumerate(names)}
        self._columns = [[column[name] for name in m.variables] for m in job.measures]

    def __exit__(self, *error: object) -> None:
        self._stack.__exit__(*error)

    def instantiate(self) -> None:
        """Load the FMUs and make their instances; UserError if that fails."""
        for component in self._job.components:
            instance = self._fmus[component.archive].instance(component.name)
            self._instances.append(self._stack.enter_context(instance))
        self._stepper.connect(self._instances)

    def rows(self, numbers: Sequence[int], points: np.ndarray) -> Rows:
        """Make runs, with the values (runs, targets) of the job's targets."""
        job = self._job
        measures = np.full((len(numbers), len(job.measures)), np.nan)
        failures, trajectories = [], {}
        for i, (number, point) in enumerate(zip(numbers, points, strict=True)):
            failure = self._run(point)
            failures.append(failure)
            if failure:
                continue
            recorded = Recorded(job.times, self._record, self._growth, self._integers)
            for j, (measure, columns) in enumerate(zip(job.measures, self._columns, strict=True)):
                measures[i, j] = measure.value(recorded, columns)
            if number in job.trajectories:
                trajectories[number] = self._record.copy()
        return Rows(np.array(numbers, np.int64), measures, failures, trajectories)

    def _run(self, point: np.ndarray) -> str:
        """Make one run; why it failed, or an empty text."""
        try:
            if self._job.wiring is not None:
                self._run_in_master(point)
                return ""
            self._initialize(point)
            self._advance()
            self._integers = [self._instances[c].integer(v) for c, v in self._job.integers.values()]
            return ""
        except UserError as error:
            with suppress(UserError):  # the run has failed already: instances are not used again
                self._stack.close()
            self._instances = []
            return one_line(error)[:LONGEST_REASON]

    def _run_in_master(self, point: np.ndarray) -> None:
        for (_, target), value in zip(self._job.targets, point, strict=True):
            if not np.isfinite(value):
                raise UserError(f"{target.variable}: its value is not defined")
            if target.held is not None:
                self._held[:, target.held] = value
        self._integers = mastered.run(self._job, self._fmus, point, self._held, self._record)

    # ---- Initialization --------------------------------------------------------------------------

    def _initialize(self, point: np.ndarray) -> None:
        """Initialize new or used instances up to the first communication point, outputs read."""
        job = self._job
        if self._instances:
            for instance in self._instances:
                instance.reset()
        else:
            self.instantiate()
        for instance, component in zip(self._instances, job.components, strict=True):
            instance.set_up(job.start, job.stop, job.tolerance)
            for name, value in component.values.items():
                instance.set(name, value)
        for (_, target), value in zip(job.targets, point, strict=True):
            self._set_target(target, float(value))
        for instance in self._instances:
            instance.enter_initialization()
        self._propagate("in initialization")
        for instance in self._instances:
            instance.exit_initialization()
        start = f"at the start, t = {job.start!r} s,"
        if job.propagates:  # samplers that tick at the start have ticked
            self._propagate(start)
        self._stepper.read_outputs(start)
        self._record[0] = self._stepper.reals.values[job.columns]
        self._tangent.deviation[:] = 1 / np.sqrt(max(len(self._tangent.deviation), 1))

    def _set_target(self, target: Target, value: float) -> None:
        if not np.isfinite(value):
            raise UserError(f"{target.variable}: its value is not defined")
        if target.held is not None:
            self._held[:, target.held] = value
            return
        instance = self._instances[target.component]
        kind = instance.fmu.model.variables[target.variable].type
        instance.set(target.variable, int(value) if kind == "Integer" else value)

    def _propagate(self, when: str) -> None:
        """Set inputs at the start until no output follows any more."""
        stepper, reals, switches = self._stepper, self._stepper.reals, self._stepper.switches
        reals.values[: self._held.shape[1]] = self._held[0]
        switches.values[: self._job.switches.values.shape[1]] = self._job.switches.values[0]
        if not self._job.propagates:
            stepper.set_inputs(when)
            return
        before = None
        for _ in range(len(reals.to_set) + len(switches.to_set) + 2):
            stepper.read_outputs(when)
            found = np.concatenate([reals.values, switches.values])
            if before is not None and np.array_equal(before, found):
                return
            before = found
            stepper.set_inputs(when)
        raise UserError("the connections form an algebraic loop")

    # ---- Steps -----------------------------------------------------------------------------------

    def _advance(self) -> None:
        job = self._job
        given = job.times, self._held, job.switches.values, self._points, job.columns
        found = self._record[1:], self._tangent, self._growth
        _, failure = self._stepper.advance(*given, *found)
        if failure is not None:
            raise failure


@contextmanager
def open_fmus(archives: Mapping[str, Archive], folder: Path) -> Iterator[dict[str, Fmu]]:
    """Unpack FMUs by their hash, in a folder."""
    with ExitStack() as stack:
        fmus = {}
        for digest, content in archives.items():
            if isinstance(content, PythonComponent):
                fmus[digest] = cast(Fmu, content)
                continue
            path = _copy(folder, digest)
            path.write_bytes(content)
            fmus[digest] = stack.enter_context(Fmu(path, folder))
        yield fmus


def check(job: Job, archives: Mapping[str, Archive], path: Path) -> None:
    """Load the FMUs of a job and instantiate each; the UserError names `path` if that fails."""
    with TemporaryDirectory(prefix="rparm-") as name:
        folder = Path(name)
        try:
            with open_fmus(archives, folder) as fmus, Runner(job, fmus) as runner:
                runner.instantiate()
        except UserError as error:
            text = str(error)
            for digest in archives:
                text = text.replace(str(_copy(folder, digest)), str(path))
            raise UserError(text) from None


def _copy(folder: Path, digest: str) -> Path:
    return folder / f"{digest}.fmu"


class Workshop:
    """The FMUs of a job, unpacked on a worker, and a runner for each of its threads."""

    def __init__(self, job: Job, archives: Mapping[str, Archive], within: Path | None) -> None:
        self._job, self._local = job, threading.local()
        self._stack, self._runners = ExitStack(), []
        folder = self._stack.enter_context(TemporaryDirectory(prefix="rparm-", dir=within))
        self._fmus = self._stack.enter_context(open_fmus(archives, Path(folder)))

    def close(self) -> None:
        """Free the instances and remove the unpacked FMUs; nothing may run any more."""
        for runner in self._runners:
            with suppress(UserError):
                runner.__exit__(None, None, None)
        self._stack.close()

    def rows(self, numbers: Sequence[int], points: np.ndarray) -> Rows:
        """Make runs in this thread."""
        if not hasattr(self._local, "runner"):
            self._local.runner = Runner(self._job, self._fmus)
            self._runners.append(self._local.runner)
        return self._local.runner.rows(numbers, points)


# ---- Workers of Dask -----------------------------------------------------------------------------
class Plugin(WorkerPlugin):
    """FMUs and job of a campaign on a worker, which may serve others, too."""

    def __init__(self, name: str, job: Job, archives: Mapping[str, Archive]) -> None:
        self.name, self._job, self._archives = name, job, archives
        self._workshop: Workshop | None = None
        self._lock = threading.Lock()
        self._users = 0  # the worker, and threads that make runs

    def setup(self, worker: Worker) -> None:
        """Unpack the FMUs beside the worker's own files."""
        self._workshop = Workshop(self._job, self._archives, Path(worker.local_directory))
        self._users = 1

    def teardown(self, worker: Worker) -> None:
        """Remove them, after the runs that are under way."""
        if self._workshop is not None:
            self._leave()

    def rows(self, numbers: Sequence[int], points: np.ndarray) -> Rows:
        with self._lock:
            if not self._users:
                raise RuntimeError("the campaign has ended")
            self._users += 1
        try:
            return self._workshop.rows(numbers, points)
        finally:
            self._leave()

    def _leave(self) -> None:
        with self._lock:
            self._users -= 1
            is_last = not self._users
        if is_last:
            self._workshop.close()

    def __getstate__(self) -> tuple[str, Job, Mapping[str, Archive]]:
        return self.name, self._job, self._archives

    def __setstate__(self, state: tuple[str, Job, Mapping[str, Archive]]) -> None:
        self.__init__(*state)


def run_block(plugin: str, numbers: Sequence[int], points: np.ndarray) -> Rows:
    """Make runs with the values (runs, targets) of the targets of a plugin's job."""
    return get_worker().plugins[plugin].rows(numbers, points)
