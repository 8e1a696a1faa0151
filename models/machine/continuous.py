"""The machine in steps that become shorter, against its solution in continuous time.

The sensor is left out and the controller is in its continuous form, so that nothing but the
coupling is left between the co-simulation and references/monolithic.py. The errors fall with
the first power of the step where inputs are held, with the second where they are extrapolated.
What remains as the step goes to 0 is calculated from several steps by Richardson extrapolation.

    build/venv/bin/python -m rparm.models.machine.continuous

runs it in Ecos and under rparm's master, prints tables, and draws continuous.png beside this file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from rparm.models.machine.experiment import STOP
from rparm.models.machine.systems import SENSOR, SEQUENCE, direct, run_in_ecos

from rparm import files, project
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import Value
from rparm.report.pages import ERROR_COLORS, RUN_COLOR, STYLE, save_figure
from rparm.systems import ssp
from rparm.systems.master import Master
from rparm.systems.structure import OpenedSystem

FOLDER = Path(__file__).resolve().parent
VARIANTS = ("pick_and_place", "pick_and_place_untold")
ROWS_PER_SECOND = 50  # of the references, which all steps divide
BOUND = 1e-7  # of the largest value of a variable, or of SMALLEST where that is larger
SMALLEST = 1e-3  # in the unit of each variable

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Method:
    """A way to step the machine.

    The payload changes at 0.2005 s and 3.7005 s: points for the master, which passes it on at once;
    in the middle of a step for Ecos, whose times are sums of steps, so that it is half a step late.
    """

    name: str
    power: int  # of the step, by which errors fall
    per_second: tuple[int, ...]  # steps
    order: str = ""  # of the master; none: Ecos
    inputs: str = "held"


FEWER = (4000, 6000, 8000, 12000, 16000)  # steps per second
METHODS = (
    Method("Ecos", 1, (5000, 7000, 9000, 11000, 13000, 15000)),
    Method("Jacobi, inputs held", 1, (4000, 6000, 8000, 10000, 12000, 16000), "jacobi"),
    Method("Jacobi, inputs extrapolated", 2, FEWER, "jacobi", "extrapolated"),
    Method("Gauss-Seidel, inputs extrapolated", 2, FEWER, "gauss_seidel", "extrapolated"),
)


def parameters(opened: OpenedSystem, variant: str) -> dict[str, dict[str, Value]]:
    """Values of a variant by component and name, with the controller in its continuous form."""
    values = {name: dict(found) for name, found in opened.system.parameter_sets[variant].items()}
    del values[SENSOR]
    values["controller"] |= {"sample_time": 0.0, "delay": 0.0}
    return values


def reference(variant: str) -> Columns:
    """Return columns of the solution in continuous time, by name."""
    path = project.references(FOLDER) / variant / "monolithic.csv"
    names, table = files.read_trajectory(path, files.csv_failure(path))
    return dict(zip(names, table.T, strict=True))


def run(
    opened: OpenedSystem,
    fmus: Mapping[str, Fmu],
    method: Method,
    variant: str,
    per_second: int,
    stop: float = STOP,
) -> Columns:
    """Return values at the times of the reference up to `stop` in s, by name."""
    every = per_second // ROWS_PER_SECOND
    values = parameters(opened, variant)
    if not method.order:
        names = [name for name in reference(variant) if name != "time"]
        rows = run_in_ecos(opened, values, stop, 1 / per_second, names, with_sensor=False)
        return dict(zip(names, rows[::every].T, strict=True))
    with Master(fmus, direct(opened.system.connections), method.order, method.inputs) as master:
        master.initialize(0.0, stop, values)
        rows = master.run(np.arange(round(stop * per_second) + 1) / per_second)
        return dict(zip(master.names, rows[::every].T, strict=True))


def limit(runs: Sequence[Columns], per_second: Sequence[int], power: int) -> tuple[Columns, float]:
    """Return values for a step that goes to 0, and by which factor rounding of runs grows at most.

    The `runs` differ by their steps. Errors are a polynomial in the step from `power` on, with as
    many terms as there are runs but one.
    """
    steps = per_second[0] / np.array(per_second)
    terms = steps[:, None] ** np.array([0, *range(power, power + len(runs) - 1)])
    weights = np.linalg.solve(terms.T, np.eye(len(runs))[0])
    columns = {
        name: sum(w * found[name] for w, found in zip(weights, runs, strict=True))
        for name in runs[0]
    }
    return columns, float(np.abs(weights).sum())


def largest_error(columns: Columns, expected: Columns) -> tuple[float, str]:
    """Return the largest difference relative to the largest value of each variable, and its name.

    No error is relative to a sum, as in `rparm.runs.comparison`. `columns` may have fewer rows.
    """
    errors = {
        name: float(
            np.abs(columns[name] - values[: len(columns[name])]).max()
            / max(np.abs(values).max(), SMALLEST)
        )
        for name, values in expected.items()
        if name != "time"
    }
    worst = max(errors, key=errors.__getitem__)
    return errors[worst], worst


def tracking_error(columns: Columns) -> float:
    """Return the largest distance of the end effector from its reference, m."""
    away = (columns[f"plant.ee_{x}"] - columns[f"trajectory.ee_{x}_ref"] for x in "xy")
    return float(np.hypot(*away).max())


# ---- the picture ---------------------------------------------------------------------------------
def draw(measured: Mapping[tuple[str, str], tuple[list[float], float]]) -> Figure:
    """Errors over the step, and the error of the limit, by variant and method."""
    with mpl.rc_context(fname=STYLE):
        picture = Figure(figsize=(13, 6), layout="constrained")
        for variant, axes in zip(VARIANTS, picture.subplots(1, 2, sharey=True), strict=True):
            for color, method in zip((RUN_COLOR, *ERROR_COLORS[:3]), METHODS, strict=True):
                errors, left = measured[variant, method.name]
                steps = 1e3 / np.array(method.per_second)
                axes.loglog(steps, errors, "o-", color=color, label=method.name)
                axes.axhline(left, color=color, linestyle=":", linewidth=1.5)
            axes.axhline(BOUND, color="#6b7885", linewidth=1.0)
            axes.set_xlabel("communication step (ms)")
            axes.set_title(variant, loc="left", fontsize=11)
        picture.axes[0].set_ylabel("largest relative error of all variables")
        picture.axes[0].legend(loc="center right")
        picture.suptitle(
            "Machine without encoders and sampling: errors (points), and what is left of them for "
            "a step that goes to 0 (dotted), with the bound",
            x=0.015,
            ha="left",
            fontsize=12,
        )
    return picture


def main() -> None:
    measured: dict[tuple[str, str], tuple[list[float], float]] = {}
    with (
        ssp.unpacked(project.built(FOLDER, ".ssp")) as opened,
        opened.unpacked_fmus(SEQUENCE) as fmus,
    ):
        for variant in VARIANTS:
            expected = reference(variant)
            print(f"{variant}: tracking error {1e3 * tracking_error(expected):.4g} mm")
            for method in METHODS:
                runs = [run(opened, fmus, method, variant, n) for n in method.per_second]
                errors = [largest_error(columns, expected)[0] for columns in runs]
                at_zero, enlarged = limit(runs, method.per_second, method.power)
                left, worst = largest_error(at_zero, expected)
                measured[variant, method.name] = errors, left
                print(
                    f"  {method.name}: {', '.join(f'{x:.3g}' for x in errors)}; limit: {left:.3g} "
                    f"({worst}), rounding times {enlarged:.3g}, tracking error "
                    f"{1e3 * tracking_error(at_zero):.8g} mm",
                    flush=True,
                )
    save_figure(draw(measured), FOLDER / "continuous.png")


if __name__ == "__main__":
    main()
