"""What the page of a scenario shows of its measurements: curves beside the simulated, a table."""

from collections.abc import Sequence
from dataclasses import replace

from rparm.fmi.model import Model
from rparm.report.pages import Table
from rparm.report.run_data import Plot, result_curve
from rparm.runs.comparison import Comparison
from rparm.units import unit


def with_measured(
    plots: Sequence[Plot], comparisons: Sequence[Comparison], model: Model
) -> list[Plot]:
    """`plots` with what was measured beside what was simulated, in new plots if need be."""
    result = list(plots)
    for compared in comparisons:
        name = compared.name
        drawn = (i for i, plot in enumerate(result) if name in [x.name for x in plot.curves])
        index = next(drawn, len(result))
        if index == len(result):
            simulated = result_curve(name, compared.simulated)
            result.append(Plot(name, unit(model.variables[name].unit), [simulated]))
        curve = result_curve(f"{name} measured", compared.measured)
        result[index] = replace(result[index], curves=[*result[index].curves, curve])
    return result


def measured_tables(comparisons: Sequence[Comparison], model: Model) -> list[Table]:
    """A table of how far the simulation is from what was measured; none without measurements."""
    if not comparisons:
        return []
    rows = [
        (c.name, unit(model.variables[c.name].unit), f"{c.rms:.4g}", f"{c.largest:.4g}", c.source)
        for c in comparisons
    ]
    return [
        Table(
            "Difference from what was measured",
            ("output", "unit", "RMS", "largest", "log"),
            rows,
            note="Simulated less measured, over the rows of the values that the log covers.",
        )
    ]
