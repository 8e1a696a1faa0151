"""The study of the coupling, run, printed and drawn; ../coupling.md says what is expected."""

from pathlib import Path

import numpy as np
from rparm.models.closed_loop.coupling import tables
from rparm.models.closed_loop.coupling.delays import study_tracking, tracking_passed
from rparm.models.closed_loop.coupling.figure import figure
from rparm.models.closed_loop.coupling.loop import opened
from rparm.models.closed_loop.coupling.payload import study_payload
from rparm.models.closed_loop.coupling.step_doubling import study_doubling
from rparm.models.closed_loop.coupling.step_errors import StepErrors, study_step_errors
from rparm.models.closed_loop.study import REST

from rparm.files import from_here, written
from rparm.linearization import largest_step
from rparm.report.pages import save_figure


def run(path: Path, ssp: Path) -> dict[str, dict[str, object]]:
    """Make the study, print its tables, draw its picture to `path`; the numbers of each part."""
    with opened(ssp) as loop:
        with written(path):  # a place that cannot be written shows before anything has run
            path.parent.mkdir(parents=True, exist_ok=True)
        step_errors = study_step_errors(loop)
        _print(tables.step_error_lines(step_errors))
        tracking = study_tracking(loop)
        _print(tables.tracking_lines(tracking))
        payload = study_payload(loop)
        _print(tables.payload_lines(payload))
        doubling = study_doubling(loop)
        _print(tables.doubling_lines(doubling))
        limits = largest_step.study_steps(ssp, REST)
    with written(path):
        save_figure(figure(step_errors, tracking, doubling), path)
    print(f"\npicture: {from_here(path)}")
    return {
        "step errors": {
            "steps": step_errors.steps.tolist(),
            "errors": _by_method(step_errors, step_errors.errors),
            "energies": _by_method(step_errors, step_errors.energies),
            "passed": step_errors.passed,
        },
        "tracking": {
            "errors": {t.method.name: t.largest for t in tracking},
            "predicted": {t.method.name: float(t.predicted.max()) for t in tracking},
            "passed": tracking_passed(tracking),
        },
        "payload": {
            "errors": payload.largest,
            "held": {name: held.tolist() for name, held in payload.held.items()},
            "passed": payload.passed,
        },
        "step doubling": {
            "tolerances": [d.tolerance for d in doubling],
            "errors": [d.error for d in doubling],
            "steps": [d.run.accepted for d in doubling],
            "fixed_steps": [d.fixed_steps for d in doubling],
            "passed": all(d.passed for d in doubling),
        },
        "largest steps": limits,
    }


def _by_method(study: StepErrors, values: np.ndarray) -> dict[str, list[float]]:
    names = (method.name for method in study.methods)
    return dict(zip(names, values.tolist(), strict=True))


def _print(lines: list[str]) -> None:
    """Print a table at once, after an empty line."""
    print("", *lines, sep="\n", flush=True)
