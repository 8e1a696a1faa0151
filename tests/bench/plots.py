"""Plots of the benchmark: work against precision, cost over the step size and over instances."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# color, marker, line: solid for the FMU, dashed for the others
STYLES = {
    "cvode_adams": ("tab:blue", "o", "-"),
    "cvode_bdf": ("tab:purple", "s", "-"),
    "erk": ("tab:red", "D", "-"),
    "taylor": ("deeppink", "o", "-"),
    "plain loop": ("black", "o", "--"),
    "MuJoCo RK4": ("tab:green", "^", "--"),
    "MuJoCo implicitfast": ("tab:olive", "v", "--"),
    "heyoka": ("tab:orange", "*", "--"),
    "scipy DOP853": ("tab:brown", "P", "--"),
    "model exchange, CVode of fmpy": ("tab:cyan", "X", "--"),
}
TIME = "time of a communication step, us"


Points = Callable[[dict], tuple[float, float]]


def panels(
    rows: dict[str, list[dict]], runs: Iterable[str], points: Points, x: str, y: str = TIME
) -> tuple[Figure, list[Axes]]:
    """Logarithmic plots side by side, by title: a curve for each run that has rows there."""
    figure, grid = plt.subplots(
        1, len(rows), figsize=(5.2 * len(rows), 5.4), sharey=True, layout="constrained",
        squeeze=False,
    )  # fmt: skip
    entries = {}
    for axes, (title, of_title) in zip(grid[0], rows.items(), strict=True):
        for run in runs:
            found = [points(row) for row in of_title if row["run"] == run]
            if found:
                color, marker, line = STYLES[run]
                (entries[run],) = axes.plot(
                    *zip(*found, strict=True), line, color=color, marker=marker, markersize=5
                )
        axes.set(xscale="log", yscale="log", xlabel=x, title=title[0].upper() + title[1:])
        axes.grid(True, color="0.9")
    grid[0, 0].set_ylabel(y)
    figure.legend(entries.values(), entries, loc="outside lower center", ncols=5, frameon=False)
    return figure, list(grid[0])


def by_title(rows: list[dict], group: str, start: int = 0) -> dict[str, list[dict]]:
    """Rows of a group by their work, or the part of its name from a comma on."""
    found: dict[str, list[dict]] = {}
    for row in rows:
        if row["group"] == group:
            found.setdefault(", ".join(row["work"].split(", ")[start:]), []).append(row)
    return found


def precision(rows: list[dict]) -> Figure:
    """Time over error, one point a tolerance (MuJoCo: a time step)."""
    figure, all_axes = panels(
        by_title(rows, "precision"), STYLES, lambda row: (max(row["error"], 1e-16), row["us"]),
        "error, relative to the largest value (more exact to the right)",
    )  # fmt: skip
    for axes in all_axes:
        axes.invert_xaxis()
    return figure


def step_size(rows: list[dict]) -> Figure:
    """Time of a communication step over its size."""
    runs = ("plain loop", "cvode_bdf", "cvode_adams", "erk", "taylor")
    return panels(
        by_title(rows, "step size", start=1), runs, lambda row: (row["step"], row["us"]),
        "communication step size, s, at tolerance 1e-8",
    )[0]  # fmt: skip


def instances(rows: list[dict]) -> Figure:
    """Time of a step over the number of instances stepped in turn."""
    mine = [row for row in rows if row["group"] == "instances"]
    title = "Instances stepped by 1 ms in turn, inputs changing"
    return panels(
        {title: mine}, STYLES, lambda row: (row["instances"], row["us"]), "number of instances"
    )[0]


def energy_drift(rows: list[dict]) -> Figure:
    """Drift of the energy over the number of steps, in motions without losses."""
    runs = ("MuJoCo RK4", "heyoka", "cvode_adams", "erk", "taylor")
    return panels(
        by_title(rows, "energy"), runs, lambda row: (row["steps"], row["drift"] or math.nan),
        "steps of 1 ms", "|energy - energy at the start|, relative",
    )[0]  # fmt: skip


def draw(rows: list[dict], folder: Path) -> list[Path]:
    """Write all plots as PNG; their paths."""
    paths = []
    for plot in (precision, step_size, instances, energy_drift):
        figure = plot(rows)
        paths.append(folder / f"{plot.__name__}.png")
        figure.savefig(paths[-1], dpi=130)
        plt.close(figure)
    return paths
