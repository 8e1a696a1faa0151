"""Runs of systems that the project's master steps: of other orders than Jacobi, rates, or loops."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rparm.campaign.job import Job
from rparm.fmi.fmu_file import Fmu
from rparm.systems.master import Master, in_order
from rparm.systems.structure import WAYS, split


@dataclass(frozen=True)
class _Held:
    """Values with zero-order hold, a signal of the master."""

    points: np.ndarray  # (n + 1,) s since the start
    rows: np.ndarray  # (n + 1,)

    def values(self, elapsed: np.ndarray) -> np.ndarray:
        places = np.abs(self.points - elapsed[:, None]).argmin(axis=1)
        return self.rows[places]


def run(
    job: Job, fmus: Mapping[str, Fmu], point: np.ndarray, held: np.ndarray, record: np.ndarray
) -> list[int]:
    """Make one run into `record`, with values (targets,) and held inputs; Integers at its end."""
    assert job.wiring is not None
    values = {component.name: dict(component.values) for component in job.components}
    models = {component.name: fmus[component.archive].model for component in job.components}
    for (_, target), value in zip(job.targets, point.tolist(), strict=True):
        name = job.components[target.component].name
        if target.held is None:
            is_whole = models[name].variables[target.variable].type == "Integer"
            values[name][target.variable] = int(value) if is_whole else value
    elapsed = job.times - job.start
    signals = {
        name: _Held(elapsed, column)
        for inputs, rows in ((job.reals, held), (job.switches, job.switches.values))
        for name, column in zip(inputs.names, rows.T, strict=True)
    }
    order, inputs = WAYS[job.wiring.order]
    connections = job.wiring.connections
    own = {component.name: fmus[component.archive] for component in job.components}
    with Master(
        in_order(own, connections, order), connections, order, inputs,
        also=[split(name, models) for name in job.watched],
        signals=signals, rates=job.wiring.rates,
    ) as master:  # fmt: skip
        master.initialize(job.start, job.stop, values)
        columns = [master.names.index(name) for name in job.watched]
        record[0] = master.values[columns]
        for row, end in enumerate(job.times[1:].tolist(), start=1):
            master.advance(end)
            record[row] = master.values[columns]
        components = [master.components[component.name] for component in job.components]
        found = [components[c].instance.integer(v) for c, v in job.integers.values()]
    return [value for value in found if value is not None]
