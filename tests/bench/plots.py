"""Plots of the benchmark: work against precision, cost over the step size and over instances."""

from __future__ import annotations

import math
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


def precision(rows: list[dict]) -> Figure:
    """Time over error, one point a tolerance (MuJoCo: a time step)."""
    rows = [row for row in rows if row["group"] == "precision"]
    works = list(dict.fromkeys(row["work"] for row in rows))
    figure, all_axes = plt.subplots(1, len(works), figsize=(15, 5.8), layout="constrained")
    for axes, work in zip(all_axes, works, strict=True):
        for run in STYLES:
            points = [(row["error"], row["us"]) for row in rows
                      if (row["work"], row["run"]) == (work, run)]  # fmt: skip
            if points:
                curve(axes, run, [max(p[0], 1e-16) for p in points], [p[1] for p in points])
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.invert_xaxis()
        title = work[0].upper() + work[1:]
        frame(axes, title, "error, relative to the largest value (more exact to the right)", "")
    all_axes[0].set_ylabel("time of a communication step, us")
    legend_below(figure, list(all_axes), 5)
    return figure


def step_size(rows: list[dict]) -> Figure:
    """Time of a communication step over its size."""
    rows = [row for row in rows if row["group"] == "step size"]
    kinds = list(dict.fromkeys(row["work"].split(", ")[1] for row in rows))
    figure, all_axes = plt.subplots(
        1, len(kinds), figsize=(11, 5), sharey=True, layout="constrained"
    )
    for axes, kind in zip(all_axes, kinds, strict=True):
        for run in ("plain loop", "cvode_bdf", "cvode_adams", "erk", "taylor"):
            points = [(row["step"], row["us"]) for row in rows
                      if row["run"] == run and row["work"].endswith(kind)]  # fmt: skip
            curve(axes, run, *zip(*points, strict=True))
        axes.set_xscale("log")
        axes.set_yscale("log")
        frame(axes, f"{kind.capitalize()}, tolerance 1e-8", "communication step size, s", "")
    all_axes[0].set_ylabel("time of a communication step, us")
    legend_below(figure, list(all_axes), 5)
    return figure


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
          "time of a communication step, us")  # fmt: skip
    legend_below(figure, [axes], 2)
    return figure


def energy_drift(rows: list[dict]) -> Figure:
    """Drift of the energy over the number of steps, in motions without losses."""
    rows = [row for row in rows if row["group"] == "energy"]
    works = list(dict.fromkeys(row["work"] for row in rows))
    figure, all_axes = plt.subplots(
        1, len(works), figsize=(11, 5), sharey=True, layout="constrained"
    )
    for axes, work in zip(all_axes, works, strict=True):
        for run in ("MuJoCo RK4", "heyoka", "cvode_adams", "erk", "taylor"):
            points = [(row["steps"], row["drift"] or math.nan) for row in rows
                      if (row["work"], row["run"]) == (work, run)]  # fmt: skip
            if points:
                curve(axes, run, *zip(*points, strict=True))
        axes.set_xscale("log")
        axes.set_yscale("log")
        frame(axes, work[0].upper() + work[1:], "steps of 1 ms", "")
    all_axes[0].set_ylabel("|energy - energy at the start|, relative")
    legend_below(figure, list(all_axes), 5)
    return figure


def draw(rows: list[dict], folder: Path) -> list[Path]:
    """Write all plots as PNG; their paths."""
    paths = []
    for plot in (precision, step_size, instances, energy_drift):
        figure = plot(rows)
        paths.append(folder / f"{plot.__name__}.png")
        figure.savefig(paths[-1], dpi=130)
        plt.close(figure)
    return paths
