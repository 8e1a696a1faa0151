"""The closed loop, stepped by the master of rparm in several ways.

The same components, connections and parameters as in Ecos (ClosedLoop.ssp). Errors are relative to
the closed loop in continuous time (../references). The page ../coupling.md says which results are
expected and why.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rparm.models.closed_loop.experiment import STOP

from rparm import files, project
from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import Value
from rparm.systems import ssp
from rparm.systems.master import Master
from rparm.systems.ssp import Connection

FOLDER = Path(__file__).resolve().parents[1]
REFERENCES = FOLDER / "references"

STATES = ("arm.q1", "arm.q2", "arm.dq1", "arm.dq2")
MASSES = tuple(("arm", name) for name in ("D11", "D12", "D22"))
# variables that the study reads or sets
NEEDED = {
    "trajectory": ("q1_ref", "dq1_ref", "ddq1_ref", "q2_ref", "dq2_ref", "ddq2_ref")
    + ("ee_x_ref", "ee_y_ref"),
    "controller": ("Kp1", "Kp2", "Kd1", "Kd2", "tau1", "f2", "integral1", "integral2"),
    "arm": ("q1", "q2", "dq1", "dq2", "D11", "D12", "D22", "ee_x", "ee_y", "total_energy")
    + ("m2", "a", "g"),
}
VARIANTS = ("nominal", "heavy_payload", "heavy_payload_integral")  # that it runs
LARGEST_DEVIATION = 0.2  # of a slope from the power expected

# The controller steps with what is measured and wanted now; the reference steps last.
CONTROLLER_FIRST = ("controller", "arm", "trajectory")
TRAJECTORY_FIRST = ("trajectory", "controller", "arm")

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Method:
    """One way to couple."""

    name: str
    order: str
    inputs: str
    sequence: tuple[str, ...] = CONTROLLER_FIRST

    @property
    def power(self) -> int:
        """Of the step, by which errors fall."""
        return 2 if self.inputs == "extrapolated" else 1

    def expects(self, slope: float) -> bool:
        """Whether a slope of log error over log step is near the power."""
        return abs(slope - self.power) <= LARGEST_DEVIATION


METHODS = (
    Method("Jacobi, held", "jacobi", "held"),
    Method("Gauss-Seidel, held", "gauss_seidel", "held"),
    Method("Jacobi, extrapolated", "jacobi", "extrapolated"),
    Method("Gauss-Seidel, extrapolated", "gauss_seidel", "extrapolated"),
)
FINEST = METHODS[-1]
REFERENCE_AHEAD = Method("Gauss-Seidel, trajectory first", "gauss_seidel", "held", TRAJECTORY_FIRST)


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """The components, unpacked and ready to run."""

    fmus: Mapping[str, Fmu]
    connections: Sequence[Connection]
    variants: Mapping[str, Mapping[str, Mapping[str, Value]]]
    stop: float  # s

    def parameters(
        self, variant: str, changes: Mapping[str, Mapping[str, Value]] | None = None
    ) -> dict[str, dict[str, Value]]:
        """Values of a variant by component and name, with `changes` to them."""
        if variant not in self.variants:
            raise UserError(f"no variant {variant!r} (there are: {', '.join(self.variants)})")
        values = {name: dict(self.variants[variant].get(name, {})) for name in self.fmus}
        for name, changed in (changes or {}).items():
            values[name].update(changed)
        return values

    def gain(self, name: str) -> float:
        """A parameter of the controller in the nominal variant."""
        start = self.fmus["controller"].model.variables[name].start
        return float(self.parameters("nominal")["controller"].get(name, start))

    def master(self, method: Method) -> Master:
        fmus = {name: self.fmus[name] for name in method.sequence}
        also = [*MASSES, ("controller", "integral1"), ("controller", "integral2")]
        return Master(fmus, self.connections, method.order, method.inputs, also)

    def run(
        self,
        method: Method,
        step: float,
        variant: str = "nominal",
        stop: float | None = None,
        changes: Mapping[str, Mapping[str, Value]] | None = None,
    ) -> tuple[Columns, int]:
        """Values at all communication points by name, with "time", and calls of DoStep."""
        stop = self.stop if stop is None else stop
        times = grid(stop, step)
        with self.master(method) as master:
            master.initialize(0.0, stop, self.parameters(variant, changes))
            rows = master.run(times)
            columns = dict(zip(master.names, rows.T, strict=True))
            return {"time": times} | columns, master.do_steps


@contextmanager
def opened(path: Path) -> Iterator[ClosedLoop]:
    """Unpack the closed loop from an SSP; everything is removed at the end."""
    with ssp.unpacked(path) as unpacked, unpacked.unpacked_fmus() as fmus:
        system = unpacked.system
        # the master connects Reals; that the payload is attached never changes
        real = [
            c
            for c in system.connections
            if unpacked.variable(f"{c.start_component}.{c.start_connector}").type == "Real"
        ]
        loop = ClosedLoop(fmus, real, system.parameter_sets, system.stop)
        _check(path, loop)
        yield loop


def _check(path: Path, loop: ClosedLoop) -> None:
    """Check that a system is the closed loop that the study knows."""
    for component, names in NEEDED.items():
        if component not in loop.fmus:
            raise UserError(
                f"{path}: has no component {component!r}, which the study needs; "
                f"`{project.PROGRAM} linearize` finds largest stable steps of any system"
            )
        for name in names:
            if name not in loop.fmus[component].model.variables:
                raise UserError(
                    f"{path}: component {component!r} has no variable {name!r}, "
                    "which the study needs"
                )
    for variant in VARIANTS:
        if variant not in loop.variants:
            raise UserError(f"{path}: has no variant {variant!r}, which the study needs")
    if loop.stop != STOP:
        raise UserError(f"{path}: stops at {loop.stop!r} s; the references are for {STOP!r} s")


def grid(stop: float, step: float) -> np.ndarray:
    """Communication points from 0 to `stop`, s, each rounded once or twice."""
    count = round(stop / step)
    per_second = round(1 / step)
    if abs(per_second * step - 1) < 1e-9:
        return np.arange(count + 1) / per_second
    return np.arange(count + 1) * step


def read_reference(path: Path) -> Columns:
    """Columns of a reference by name, with "time"."""
    wrong = files.csv_failure(path)
    names, table = files.read_trajectory(path, wrong)
    if not set(STATES) <= set(names):
        raise wrong("not a reference of the closed loop", 1)
    return dict(zip(names, table.T, strict=True))
