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
LABELS = {
    "cvode_adams": "FMU, cvode_adams",
    "cvode_bdf": "FMU, cvode_bdf",
    "erk": "FMU, erk",
    "taylor": "FMU, taylor",
    "plain loop": "plain CVODE loop",
    "heyoka": "heyoka (called from Python)",
    "model exchange, CVode of fmpy": "FMU as model exchange, CVode of fmpy",
}
LIGHT = {"color": "0.9", "linewidth": 0.8}


def curve(axes: Axes, run: str, x: list[float], y: list[float]) -> None:
    """Draw one solver."""
    color, marker, line = STYLES[run]
    axes.plot(x, y, line, color=color, marker=marker, markersize=5, linewidth=1.4,
              label=LABELS.get(run, run))  # fmt: skip


def frame(axes: Axes, title: str, x: str, y: str) -> None:
    """Title, labels, grid."""
    axes.set_title(title, fontsize=11)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(True, **LIGHT)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def legend_below(figure: Figure, axes: list[Axes], columns: int) -> None:
    """One legend for all axes, under them."""
    entries = {}
    for one in axes:
        handles, labels = one.get_legend_handles_labels()
        entries |= dict(zip(labels, handles, strict=True))
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=columns,
                  frameon=False)  # fmt: skip


Points = Callable[[dict], tuple[float, float]]


def panels(
    rows: dict[str, list[dict]], runs: Iterable[str], points: Points, x: str, y: str
) -> tuple[Figure, list[Axes]]:
    """Logarithmic plots side by side, by title: a curve for each run that has rows there."""
    figure, all_axes = plt.subplots(
        1, len(rows), figsize=(5.2 * len(rows), 5.4), sharey=True, layout="constrained"
    )
    for axes, (title, of_title) in zip(all_axes, rows.items(), strict=True):
        for run in runs:
            found = [points(row) for row in of_title if row["run"] == run]
            if found:
                curve(axes, run, *zip(*found, strict=True))
        axes.set_xscale("log")
        axes.set_yscale("log")
        frame(axes, title[0].upper() + title[1:], x, "")
    all_axes[0].set_ylabel(y)
    legend_below(figure, list(all_axes), 5)
    return figure, list(all_axes)


def by_title(rows: list[dict], group: str, start: int = 0) -> dict[str, list[dict]]:
    """Rows of a group by their work, or the part of its name from a comma on."""
    found: dict[str, list[dict]] = {}
    for row in rows:
        if row["group"] == group:
            found.setdefault(", ".join(row["work"].split(", ")[start:]), []).append(row)
    return found


TIME = "time of a communication step, us"


def precision(rows: list[dict]) -> Figure:
    """Time over error, one point a tolerance (MuJoCo: a time step)."""
    figure, all_axes = panels(
        by_title(rows, "precision"), STYLES, lambda row: (max(row["error"], 1e-16), row["us"]),
        "error, relative to the largest value (more exact to the right)", TIME,
    )  # fmt: skip
    for axes in all_axes:
        axes.invert_xaxis()
    return figure


def step_size(rows: list[dict]) -> Figure:
    """Time of a communication step over its size."""
    runs = ("plain loop", "cvode_bdf", "cvode_adams", "erk", "taylor")
    kinds = by_title(rows, "step size", start=1)
    return panels(
        kinds,
        runs,
        lambda row: (row["step"], row["us"]),
        "communication step size, s, at tolerance 1e-8",
        TIME,
    )[0]


def instances(rows: list[dict]) -> Figure:
    """Time of a step over the number of instances stepped in turn."""
    rows = [row for row in rows if row["group"] == "instances"]
    limits = {row["run"]: row["limit"] for row in rows if "limit" in row}
    figure, axes = plt.subplots(figsize=(7, 4.8), layout="constrained")
    for run in dict.fromkeys(row["run"] for row in rows):
        points = [(row["instances"], row["us"]) for row in rows if row["run"] == run]
        x, y = zip(*points, strict=True)
        curve(axes, run, x, y)
        if run in limits:
            axes.plot(x, [y[0] + limits[run]] * len(x), ":", color=STYLES[run][0], linewidth=1.2,
                      label=f"{run}: one alone + {limits[run]:g} us, the target")  # fmt: skip
    axes.set_xscale("log")
    axes.set_ylim(bottom=0.0)
    frame(axes, "Instances stepped by 1 ms in turn, inputs changing", "number of instances",
          TIME)  # fmt: skip
    legend_below(figure, [axes], 2)
    return figure


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
