"""Identification in one call, from the request to the results, and validation by another log."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from rparm import gradients
from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import Value
from rparm.identification import fit, logs
from rparm.identification.fit import (
    Combination,
    Covariances,
    Effects,
    Problem,
    Reduced,
    Whiteness,
    combinations,
    covariances,
    reduced,
    whiteness,
)
from rparm.identification.logs import Recording, Segment
from rparm.identification.request import DELAY, Checked, Parameters, Request, checked
from rparm.identification.simulator import (
    Simulator,
    admitted_start,
    guess_start,
    start_scales,
    state_names,
)

CLEAR = 10.0  # in deviations of the noise squared: such a gain is no chance
SAME = 0.01  # of the noise: a difference that does not matter
ROUNDING = 1e-5  # of the range of an output: differences of two exact runs of a segment
AWAY = 0.1  # of the range of the measured values: an error that is no longer followed
LEAD = 0.1  # of a segment: the longest delay
WIDEST = np.log(1e6)  # of a distance from a limit: beyond, one end of an interval is not known
MOST_RESTARTS = 5  # of a fit
FEWEST_SEGMENTS = 5  # for intervals by scatter
SUSPICIOUS, BAD = 2.0, 10.0  # values of chi2
CAUSES = "usual causes are units, outliers, or a model that lacks something"


@dataclass(frozen=True, eq=False)
class Validation:
    """Comparison with a log that the parameters were not fitted to."""

    recording: Recording
    times: np.ndarray  # (rows,) s, of the part that is run in one go
    predicted: np.ndarray  # (rows, outputs): from the start state to the end
    measured: np.ndarray  # (rows, outputs)
    chi2: float  # of its segments, each from its own start state, by degrees of freedom

    @property
    def rms(self) -> np.ndarray:
        """Root mean square (outputs,) of predicted minus measured, in the outputs' units."""
        there = np.isfinite(self.measured)
        squares = np.where(there, (self.predicted - self.measured) ** 2, 0.0)
        return np.sqrt(squares.sum(axis=0) / np.maximum(there.sum(axis=0), 1))

    @property
    def follows(self) -> np.ndarray:
        """Time (outputs,) in s until the error is a tenth of the range of what was measured."""
        allowed = AWAY * (np.nanmax(self.measured, axis=0) - np.nanmin(self.measured, axis=0))
        away = ~(np.abs(self.predicted - self.measured) <= allowed) & np.isfinite(self.measured)
        first = np.where(away.any(axis=0), away.argmax(axis=0), len(self.times) - 1)
        return self.times[first] - self.times[0]


def validate(
    fmu: Fmu,
    request: Request,
    known: Checked,
    values: Mapping[str, float],
    noise: np.ndarray,
    is_one_run: bool,
) -> Validation:
    """Run a log with `values`: its first start state is fitted to one run, and each to chi2."""
    assert request.validation is not None
    recording = _read(request, known, request.validation)
    segments = logs.segments(recording, request.segment)
    settings = {**known.settings, **{n: value for n, value in values.items() if n != DELAY}}
    with _problem(fmu, request, known, segments, noise, Parameters([], {}), settings) as given:
        # the first rows show values from before the start, later by the delay
        problem, x = replace(given[0], delay=values.get(DELAY, 0.0)), given[1]
        if is_one_run:
            whole = logs.joined(recording, segments)
            problem, x = replace(problem, segments=[whole]), x[:1]
        else:
            whole = _whole(recording, segments[0])
        found = fit.fit(problem, x, np.empty(0))
        try:
            predicted = replace(problem, segments=[whole]).predicted(whole, found.z, found.x[0])
        except UserError:  # it has run away, too far for the FMU
            predicted = np.full(whole.measured.shape, np.nan)
    count = sum(int(segment.counts.sum()) for segment in problem.segments)
    chi2 = found.cost / max(count - found.x.size, 1)
    return Validation(recording, whole.times, predicted, whole.measured, chi2)


def _whole(recording: Recording, first: Segment) -> Segment:
    """Return the rows from the start of the first segment to the next gap, or the end."""
    start = int(np.searchsorted(recording.times, first.times[0]))
    gaps = np.flatnonzero(np.diff(recording.times) > 10 * recording.step)
    end = next((int(gap) + 1 for gap in gaps if gap >= start), len(recording.times))
    return logs.segment_of(recording, start, start, end)


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % intervals; None where it cannot be known."""

    value: float
    low: float | None
    high: float | None
    classical: tuple[float, float] | None


@dataclass(frozen=True, eq=False)
class Identification:
    """Result of an identification."""

    fmu: Path
    model: str
    request: Request
    checked: Checked
    recordings: Sequence[Recording]
    segments: Sequence[Segment]  # of all recordings
    of_first: int  # how many of them are of the first recording
    states: Sequence[str]
    start_states: np.ndarray  # (segments, states)
    predicted: Sequence[np.ndarray]  # (rows, outputs) of each segment
    estimates: Mapping[str, Estimate]  # of the parameters
    sums: Mapping[str, Estimate]  # of parameters of which only the sum is known
    combinations: Sequence[Combination]
    at_limit: Sequence[str]
    known: Sequence[str]  # that covariances are of
    covariances: Covariances
    pieces: int  # whose scatter gives the intervals: segments, or parts of runs
    is_one_run: bool  # each log, since the FMU remembers more than its states
    notes: Sequence[str]  # about how logs were used
    noise: np.ndarray  # (outputs,) of the measured values, whatever they follow
    whiteness: Mapping[str, Whiteness]
    validation: Validation | None
    steps: int
    has_converged: bool

    @property
    def values(self) -> dict[str, float]:
        """Values of the FMU's parameters that were estimated."""
        return {name: x.value for name, x in self.estimates.items() if name != DELAY}

    @property
    def chi2(self) -> float:
        """Sum of the squared residuals in their noise, by degrees of freedom; 1: only noise."""
        return self.covariances.variance

    @property
    def misfit(self) -> str:
        """Warning if chi2 of the logs, or of the second one, is far from 1; or nothing."""
        second = None if self.validation is None else self.validation.chi2
        for name, chi2 in (("chi2", self.chi2), ("chi2 of the second log", second)):
            if chi2 is not None and not chi2 < SUSPICIOUS:
                return f"{name} is {chi2:.3g} where noise has 1: {self._causes}"
        return ""

    @property
    def _causes(self) -> str:
        own = []
        if self.is_one_run:
            own.append("a log that begins in another mode or between ticks")
        if any(recording.filled is not None for recording in self.recordings):
            own.append("inputs in missing rows, which are guesses")
        return (
            ", ".join([CAUSES.replace(", or", ","), *own[:-1]]) + f", or {own[-1]}"
            if own
            else CAUSES
        )

    @property
    def passed(self) -> bool:
        """Whether the fit has converged, and what is left is not far above noise."""
        second = 0.0 if self.validation is None else self.validation.chi2
        return self.has_converged and max(self.chi2, second) <= BAD

    @property
    def warnings(self) -> list[str]:
        """Warnings for a reader of the results."""
        texts = [text for recording in self.recordings for text in recording.warnings]
        if self.validation is not None:
            texts += self.validation.recording.warnings
        if self.misfit:
            texts.append(f"{self.misfit[0].upper()}{self.misfit[1:]}.")
        if not self.has_converged:
            texts.append(f"The fit has not converged in {self.steps} steps.")
        if self.pieces < FEWEST_SEGMENTS:
            texts.append(
                f"Too few segments for intervals by scatter ({self.pieces}): "
                "a longer log, or a shorter segment, gives more."
            )
        if self.covariances.is_suspicious:
            texts.append(
                f"Intervals by scatter are {self.covariances.ratio:.1f} times as wide as the "
                "classical ones: efforts or model are not exact."
            )
        colored = [name for name, test in self.whiteness.items() if not test.is_white]
        if colored:
            texts.append(
                f"Residuals of {', '.join(colored)} are not white: more than noise is left."
            )
        texts += [f"{name} has come to its limit." for name in self.at_limit]
        texts += [f"Cannot be known: {combination}." for combination in self.combinations]
        return texts


@dataclass(frozen=True, eq=False)
class _Fitted:
    """Result of a fit, and its residuals."""

    recordings: Sequence[Recording]
    segments: Sequence[Segment]  # of all recordings
    of_first: int  # how many of them are of the first recording
    is_one_run: bool
    solution: fit.Solution
    start_states: np.ndarray  # (segments, states)
    predicted: Sequence[np.ndarray]  # (rows, outputs) of each segment
    pieces: Sequence[Reduced]  # of all segments
    rounding: float  # of the pieces' derivatives


def _read(request: Request, known: Checked, path: Path) -> Recording:
    time = request.columns.get("time", "time")
    return logs.read(path, known.reals, known.switches, known.outputs, time, request.segment)


def identify(fmu: Fmu, request: Request) -> Identification:
    """Fit parameters of an FMU to logs; UserError if the request, a log or a run is wrong."""
    with ExitStack() as stack:
        return _identified(fmu, request, stack)


def _identified(fmu: Fmu, request: Request, stack: ExitStack) -> Identification:
    known = checked(request, fmu)
    recordings = [_read(request, known, path) for path in request.logs]
    noise, notes = logs.noise(recordings), []
    with_gradients = None
    try:
        by = [*known.names, *map("start({})".format, state_names(fmu))]
        with_gradients = gradients.opened(fmu, [*known.outputs], by, stack)
    except UserError as error:
        notes.append(f"Derivatives are difference quotients: {error}.")
    known = replace(known, with_gradients=with_gradients)
    fitted = _fitted(fmu, request, known, recordings, noise)
    if any(recording.filled for recording in recordings):
        filled = [recording.filled or recording for recording in recordings]
        other = _fitted(fmu, request, known, filled, noise)
        if other.solution.cost < fitted.solution.cost - CLEAR:
            fitted = other
            notes.append("Missing inputs are taken as linear in between: held, they fit worse.")
    if fitted.is_one_run:
        notes.append(
            "Each log is one run: a start from its states would lose what else the FMU remembers, "
            "such as modes and samplers."
        )
    z, parameters = fitted.solution.z, known.parameters
    if request.with_delay:
        delay, lead = parameters.values(z)[parameters.names.index(DELAY)], _lead(request)
        if abs(delay) > lead:
            bound = f"{lead:.4g} s, a tenth of a segment"
            raise UserError(f"{DELAY}: {delay:.4g} s is longer than {bound}")

    # the known parameters
    at_limit = parameters.at_limit(z)
    effects = np.vstack([piece.by_parameters for piece in fitted.pieces])
    effects = Effects(np.where(at_limit, 0.0, effects), fitted.rounding)
    limits = [name for name, is_there in zip(parameters.names, at_limit, strict=True) if is_there]
    unknown = [
        each
        for each in combinations(effects, np.diag(parameters.slopes(z)), parameters.names)
        if not (len(each.names) == 1 and each.names[0] in limits)
    ]
    spread = covariances(fitted.pieces, effects.basis)
    estimates, sums = _estimates(parameters, z, effects.basis, spread, unknown)
    values = {name: x.value for name, x in estimates.items()}
    tests = whiteness(fitted.pieces, len(noise))
    second = request.validation and validate(fmu, request, known, values, noise, fitted.is_one_run)
    return Identification(
        fmu=fmu.path,
        model=fmu.model.name,
        request=request,
        checked=known,
        recordings=fitted.recordings,
        segments=fitted.segments,
        of_first=fitted.of_first,
        states=state_names(fmu),
        start_states=fitted.start_states,
        predicted=fitted.predicted,
        estimates=estimates,
        sums=sums,
        combinations=unknown,
        at_limit=limits,
        known=[parameters.names[i] for i in effects.basis],
        covariances=spread,
        pieces=len(fitted.pieces),
        is_one_run=fitted.is_one_run,
        notes=notes,
        noise=noise,
        whiteness=dict(zip(known.outputs, tests, strict=True)),
        validation=second,
        steps=fitted.solution.steps,
        has_converged=fitted.solution.has_converged,
    )


def _lead(request: Request) -> float:
    return LEAD * request.segment if request.with_delay else 0.0


def _fitted(
    fmu: Fmu, request: Request, known: Checked, recordings: Sequence[Recording], noise: np.ndarray
) -> _Fitted:
    """Fit parameters and start states: of each segment, or of each log as one run."""
    cut = [logs.segments(recording, request.segment, _lead(request)) for recording in recordings]
    segments = [segment for each in cut for segment in each]
    firsts = np.cumsum([0, *map(len, cut)])[:-1]
    z, given = np.zeros(len(known.parameters)), (known.parameters, known.settings)
    with _problem(fmu, request, known, segments, noise, *given) as (problem, x):
        runs = {
            logs.joined(recording, pieces): pieces
            for recording, pieces in zip(recordings, cut, strict=True)
        }
        is_one_run = _remembers(fmu, request, known, problem, runs, z, x[firsts])
        if not is_one_run:
            found = _restarted(fmu, request, known, problem, fit.fit(problem, x, z), z)
            is_one_run = _remembers(fmu, request, known, problem, runs, found.z, found.x[firsts])
        if is_one_run:
            found = _of_runs(problem, replace(problem, segments=list(runs)), x, x[firsts], z)
            problem = replace(problem, segments=list(runs))
        linear = problem.linear(found.z, found.x, True)
        pieces = [piece for each in linear for piece in reduced(each)]
        predicted = [
            problem.predicted(segment, found.z, state)
            for segment, state in zip(problem.segments, found.x, strict=True)
        ]
        of_first = 1 if is_one_run else len(cut[0])
        states, rounding = found.x * problem.scales, problem.rounding()
    return _Fitted(
        recordings, problem.segments, of_first, is_one_run, found, states, predicted, pieces,
        rounding,
    )  # fmt: skip


def _restarted(
    fmu: Fmu,
    request: Request,
    known: Checked,
    problem: Problem,
    found: fit.Solution,
    z: np.ndarray,
) -> fit.Solution:
    """Fit again from the parameters `z`, if segments are far off: these start as others end.

    What was guessed for a start across an impact may lead a segment, and with it the parameters,
    to another minimum.
    """
    states, segments = state_names(fmu), problem.segments
    names = list(known.reals), list(known.switches), states
    with Simulator(fmu, known.names, states, *names, known.settings, request.tolerance) as runs:

        def start(i: int) -> np.ndarray:
            before, segment = segments[i - 1 : i + 1] if i else (None, segments[0])
            with suppress(UserError):
                left = problem.residuals(segment, found.z, found.x[i])
                longer = before and logs.continued(before, segment)
                if longer and np.mean(left**2) > SUSPICIOUS:
                    values = np.append(problem.values(found.z)[0], found.x[i - 1] * problem.scales)
                    return runs.run(longer, values)[-1] / problem.scales
            return found.x[i]

        for _ in range(MOST_RESTARTS):
            count = sum(int(segment.counts.sum()) for segment in segments)
            if found.cost < SUSPICIOUS * count:
                break
            try:
                other = fit.fit(problem, np.array(runs.map(start, range(len(segments)))), z)
            except UserError:  # the FMU refuses such a start
                break
            if other.cost > found.cost - CLEAR:
                break
            found = other
    return found


def _of_runs(
    problem: Problem, one_run: Problem, x: np.ndarray, first: np.ndarray, z: np.ndarray
) -> fit.Solution:
    """Fit runs, from their states `first`; if that fails, from what their segments show."""
    found = fit.fit_growing(one_run, first, z)
    count = sum(int(segment.counts.sum()) for segment in one_run.segments)
    if found.cost < SUSPICIOUS * count:
        return found
    other = fit.fit_growing(one_run, first, fit.fit(problem, x, z).z)
    return min(found, other, key=lambda solution: solution.cost)


def _remembers(
    fmu: Fmu,
    request: Request,
    known: Checked,
    problem: Problem,
    runs: Mapping[Segment, Sequence[Segment]],
    z: np.ndarray,
    x: np.ndarray,
) -> bool:
    """Return whether pieces of `runs` lead elsewhere from the states that a run has there.

    The runs start from the states `x` (runs, states).
    """
    count, states = len(known.outputs), state_names(fmu)
    names = list(known.reals), list(known.switches), [*known.outputs, *states]
    values, _ = problem.values(z)
    given = known.names, states, *names, known.settings, request.tolerance
    with Simulator(fmu, *given) as simulator:

        def differs(run: Segment, record: np.ndarray, piece: Segment) -> bool:
            row = int(np.searchsorted(run.times, piece.times[0]))
            try:
                again = simulator.run(piece, np.append(values, record[row, count:]))
            except UserError:
                return False  # the FMU refuses the start
            allowed = SAME * problem.noise + ROUNDING * np.ptp(record[:, :count], axis=0)
            there = record[row : row + len(again), :count]
            return bool((np.abs(again[1:, :count] - there[1:]) > allowed).any())

        for (run, pieces), state in zip(runs.items(), x * problem.scales, strict=True):
            try:
                record = simulator.run(run, np.append(values, state))
            except UserError:
                continue  # it has run away
            if any(simulator.map(partial(differs, run, record), pieces)):
                return True
    return False


@contextmanager
def _problem(
    fmu: Fmu,
    request: Request,
    known: Checked,
    segments: Sequence[Segment],
    noise: np.ndarray,
    parameters: Parameters,
    settings: Mapping[str, Value],
) -> Iterator[tuple[Problem, np.ndarray]]:
    """Yield a problem with running instances, and first start states (segments, states)."""
    estimated = [name for name in parameters.names if name != DELAY]
    names = list(known.reals), list(known.switches), list(known.outputs)
    states = state_names(fmu)
    given = fmu, estimated, states, *names, settings, request.tolerance, known.with_gradients
    with Simulator(*given) as simulator:
        guessed = guess_start(fmu, segments, names[2], known.starts)
        guessed = admitted_start(simulator, segments, parameters, guessed)
        scales = start_scales(guessed)
        yield Problem(simulator, parameters, segments, noise, scales), guessed / scales


def _estimates(
    parameters: Parameters,
    z: np.ndarray,
    basis: np.ndarray,
    spread: Covariances,
    unknown: Sequence[Combination],
) -> tuple[dict[str, Estimate], dict[str, Estimate]]:
    """Estimate all parameters, and sums of them."""
    values, unclear = parameters.values(z), {name for each in unknown for name in each.names}
    widths = [np.zeros(len(z)), np.zeros(len(z))]
    for width, halves in zip(widths, (spread.halves, spread.classical_halves), strict=True):
        width[basis] = halves
    ends = [_ends(parameters, z, basis, *pair) for pair in zip(
        widths, (spread.scatter, spread.classical), strict=True)]  # fmt: skip
    found = {}
    for i, name in enumerate(parameters.names):
        is_known = i in basis and name not in unclear
        (low, high), classical = (tuple(each[i].tolist()) for each in ends)
        found[name] = (
            Estimate(float(values[i]), low, high, classical)
            if is_known
            else Estimate(float(values[i]), None, None, None)
        )
    sums = {}
    for each in unknown:
        shared = [other for other in unknown if set(other.names) & set(each.names)]
        if each.effects is None or len(each.names) == 1 or len(shared) > 1:
            continue
        indices = [parameters.names.index(name) for name in each.names]
        total = float(values[indices] @ np.sign(each.effects))
        known = next(i for i in indices if i in basis)
        sign = np.sign(each.effects[indices.index(known)])
        moved = [total + sign * (end[known] - values[known]) for end in ends]
        (low, high), classical = (tuple(sorted(each.tolist())) for each in moved)
        sums[str(each)] = Estimate(total, low, high, classical)
    return found, sums


def _ends(
    parameters: Parameters,
    z: np.ndarray,
    basis: np.ndarray,
    widths: np.ndarray,
    covariance: np.ndarray,
) -> np.ndarray:
    """Return the ends (parameters, 2) of intervals; `widths` and `covariance` (`basis`) of fits."""
    ends = np.empty((len(z), 2))
    slopes = parameters.slopes(z)[:, basis]
    deviations = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    for i, parameter in enumerate(parameters.every):
        moved = np.zeros(len(z))
        moved[i] = widths[i]
        ends[i] = sorted(parameters.values(z + sign * moved)[i] for sign in (-1, 1))
        if parameter.greatest == np.inf and parameters.is_limited[i] and widths[i] > WIDEST:
            ends[i, 1] = np.inf
        if parameter.above in parameters.names and i in basis:
            # it moves with the one that it is above
            factor = widths[i] / deviations[list(basis).index(i)]
            half = factor * np.sqrt(slopes[i] @ covariance @ slopes[i])
            ends[i] = parameters.values(z)[i] + np.array([-half, half])
    return ends
