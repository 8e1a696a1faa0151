"""Another log, run with the parameters that were found: from its start to its end."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.identification import fit, logs, start_states
from rparm.identification.logs import Recording, Segment
from rparm.identification.parameters import DELAY, Parameters
from rparm.identification.request import Checked, Request
from rparm.identification.residuals import Problem
from rparm.identification.simulator import Simulator

AWAY = 0.1  # of the range of what was measured: an error that is no longer followed


@dataclass(frozen=True, eq=False)
class Validation:
    """How a log is met that the parameters were not fitted to."""

    recording: Recording
    times: np.ndarray  # (rows,) s, of the part that is run in one go
    predicted: np.ndarray  # (rows, outputs): from the start state to the end
    measured: np.ndarray  # (rows, outputs)
    chi2: float  # of its segments, each from its own start state, by degrees of freedom

    @property
    def rms(self) -> np.ndarray:
        """Root mean square (outputs,) of predicted minus measured, in the outputs' units."""
        rows = np.isfinite(self.measured).all(axis=1)
        return np.sqrt(np.mean((self.predicted[rows] - self.measured[rows]) ** 2, axis=0))

    @property
    def follows(self) -> np.ndarray:
        """Time (outputs,) in s until the error is a tenth of the range of what was measured."""
        allowed = AWAY * np.ptp(self.measured[np.isfinite(self.measured).all(axis=1)], axis=0)
        away = ~(np.abs(self.predicted - self.measured) <= allowed) & np.isfinite(self.measured)
        first = np.where(away.any(axis=0), away.argmax(axis=0), len(self.times) - 1)
        return self.times[first] - self.times[0]


def validate(
    fmu: Fmu, request: Request, known: Checked, values: Mapping[str, float], noise: np.ndarray
) -> Validation:
    """Run the log `request.validation` with `values` of the parameters.

    Its start states are fitted: the first one for the run in one go, and each for chi2.
    """
    assert request.validation is not None
    time = request.columns.get("time", "time")
    recording = logs.read(request.validation, known.reals, known.switches, known.outputs, time)
    segments = logs.segments(recording, request.segment)
    states, outputs = start_states.states(fmu), list(known.outputs)
    fixed = {name: value for name, value in values.items() if name != DELAY}
    none = Parameters([], {})
    names = list(known.reals), list(known.switches), outputs
    with Simulator(
        fmu, [], states, *names, {**known.settings, **fixed}, request.tolerance
    ) as simulator:
        guessed = start_states.guess(fmu, segments, outputs, known.starts)
        guessed = start_states.admitted(simulator, segments, none, guessed)
        scales = start_states.scales(guessed)
        problem = Problem(simulator, none, segments, noise, scales, values.get(DELAY, 0.0))
        # the first rows show what was before the start, later by the delay
        found = fit.fit(problem, guessed / scales)
        whole = _whole(recording, segments[0])
        try:
            predicted = replace(problem, segments=[whole]).predicted(whole, found.z, found.x[0])
        except UserError:  # it has run away, too far for the FMU
            predicted = np.full(whole.measured.shape, np.nan)
    rows = sum(int(segment.counts.sum()) for segment in segments) * len(outputs)
    chi2 = found.cost / max(rows - found.x.size, 1)
    return Validation(recording, whole.times, predicted, whole.measured, chi2)


def _whole(recording: Recording, first: Segment) -> Segment:
    """From the start of the first segment to the next gap, or the end."""
    start = int(np.searchsorted(recording.times, first.times[0]))
    gaps = np.flatnonzero(np.diff(recording.times) > 10 * recording.step)
    end = next((int(gap) + 1 for gap in gaps if gap >= start), len(recording.times))
    return logs.segment_of(recording, start, start, end)
