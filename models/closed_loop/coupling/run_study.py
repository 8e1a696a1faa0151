"""The study of the coupling: run, printed and drawn.

The page ../coupling.md says which results are expected.
"""

from pathlib import Path

from cosim.output_files import from_here, written
from cosim.report.style import save
from models.closed_loop.coupling import tables
from models.closed_loop.coupling.delays import study_tracking, tracking_passed
from models.closed_loop.coupling.figure import figure
from models.closed_loop.coupling.loop import opened
from models.closed_loop.coupling.payload import study_payload
from models.closed_loop.coupling.step_doubling import study_doubling
from models.closed_loop.coupling.step_errors import study_step_errors

FILE = "coupling.png"


def run(report: Path, ssp: Path) -> bool:
    """Make the study, print its tables, write its picture; whether all verdicts are good.

    Raises
    ------
    UserError
        If the system or a reference is missing, an FMU fails, or the picture cannot be written.
    """
    path = Path(report) / FILE
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
    with written(path):
        save(figure(step_errors, tracking, doubling), path)
    print(f"\npicture: {from_here(path)}")
    good = all(d.passed for d in doubling)
    return step_errors.passed and tracking_passed(tracking) and payload.passed and good


def _print(lines: list[str]) -> None:
    """Print a table at once, after an empty line."""
    print("", *lines, sep="\n", flush=True)
