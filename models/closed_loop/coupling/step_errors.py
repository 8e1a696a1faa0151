"""Error against step: how the errors of the coupling fall with the communication step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rparm.models.closed_loop.coupling.loop import (
    METHODS,
    REFERENCES,
    STATES,
    ClosedLoop,
    Columns,
    Method,
    read_reference,
)

from rparm.runs.convergence import slope

STEPS = (8e-3, 4e-3, 2e-3, 1e-3, 5e-4)  # s
COMMON = 0.04  # s, all steps and the reference's rows divide it


@dataclass(frozen=True, eq=False)
class StepErrors:
    """Runs of all methods with all steps; arrays are (methods, steps)."""

    methods: Sequence[Method]
    steps: np.ndarray  # s
    errors: np.ndarray  # of the arm's states, relative to the largest value of each
    energies: np.ndarray  # J, that the coupling adds to the arm
    calls: np.ndarray  # of DoStep

    def slopes(self, values: np.ndarray) -> list[float]:
        """Of log |values| over log steps, by method."""
        return [slope(self.steps, np.abs(row)) for row in values]

    def holds(self, i: int) -> bool:
        """Whether error and energy of a method fall as expected."""
        slopes = self.slopes(self.errors)[i], self.slopes(self.energies)[i]
        return all(map(self.methods[i].expects, slopes))

    @property
    def passed(self) -> bool:
        """Whether all methods are as expected."""
        return all(self.holds(i) for i in range(len(self.methods)))


def study_step_errors(
    loop: ClosedLoop, steps: Sequence[float] = STEPS, methods: Sequence[Method] = METHODS
) -> StepErrors:
    """Error against step on the nominal motion, which does not saturate."""
    exact = read_reference(REFERENCES / "nominal" / "monolithic.csv")
    shape = len(methods), len(steps)
    errors, energies, calls = np.empty(shape), np.empty(shape), np.empty(shape, int)
    for i, method in enumerate(methods):
        for j, step in enumerate(steps):
            columns, calls[i, j] = loop.run(method, step)
            errors[i, j] = state_error(columns, exact)
            energies[i, j] = created_energy(loop, columns)
    return StepErrors(methods, np.array(steps), errors, energies, calls)


def state_error(columns: Columns, exact: Columns) -> float:
    """Largest error of the arm's states at the times that both have, multiples of COMMON."""
    rows = [np.round(c["time"][1] / COMMON, 12) for c in (columns, exact)]
    every = [round(1 / row) for row in rows]
    found = 0.0
    for name in STATES:
        wanted = exact[name][:: every[1]]
        got = columns[name][:: every[0]]
        found = max(found, np.abs(got - wanted).max() / np.abs(exact[name]).max())
    return float(found)


def created_energy(loop: ClosedLoop, columns: Columns) -> float:
    """What the arm's energy gained beyond the work of the efforts that the control law asks for.

    The law is evaluated at the arm's momentary motion; without coupling error nothing remains. J.
    """
    efforts = law(loop, columns)
    power = efforts[0] * columns["arm.dq1"] + efforts[1] * columns["arm.dq2"]
    gained = columns["arm.total_energy"][-1] - columns["arm.total_energy"][0]
    return float(gained - simpson(power, columns["time"][1] - columns["time"][0]))


def law(loop: ClosedLoop, columns: Columns) -> np.ndarray:
    """Efforts of the nominal controller for given references and measurements, (2, rows)."""
    sources = {
        c.end_connector: f"{c.start_component}.{c.start_connector}"
        for c in loop.connections
        if c.end_component == "controller"
    }
    with loop.fmus["controller"].instance("controller") as controller:
        efforts, inputs = controller.reals(["tau1", "f2"]), controller.reals(list(sources))
        controller.set_up(0.0, None)
        for name, value in loop.parameters("nominal")["controller"].items():
            controller.set(name, value)
        controller.enter_initialization()
        controller.exit_initialization()
        rows = np.array([columns[source] for source in sources.values()]).T
        found = np.empty((2, len(rows)))
        for i, row in enumerate(rows):
            inputs.view[:] = row
            inputs.set()
            efforts.get()
            found[:, i] = efforts.view
    return found


def simpson(values: np.ndarray, step: float) -> float:
    """Integral over an even number of equal steps."""
    inner = 4 * values[1:-1:2].sum() + 2 * values[2:-1:2].sum()
    return float((values[0] + inner + values[-1]) * step / 3)
