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
from rparm.systems.structure import Connection

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
VARIANT = "nominal"  # that it runs
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
        """Return whether a slope of log error over log step is near the power."""
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
        """Return values of a variant by component and name, with `changes` to them."""
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
        """Return values at all communication points by name, with "time", and calls of DoStep."""
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
        real = [c for c in system.connections if unpacked.variable(c.start).type == "Real"]
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
                missing = f"component {component!r} has no variable {name!r}"
                raise UserError(f"{path}: {missing}, which the study needs")
    if VARIANT not in loop.variants:
        raise UserError(f"{path}: has no variant {VARIANT!r}, which the study needs")
    if loop.stop != STOP:
        raise UserError(f"{path}: stops at {loop.stop!r} s; the references are for {STOP!r} s")


def grid(stop: float, step: float) -> np.ndarray:
    """Return communication points from 0 to `stop`, s, each rounded once or twice."""
    count = round(stop / step)
    per_second = round(1 / step)
    if abs(per_second * step - 1) < 1e-9:
        return np.arange(count + 1) / per_second
    return np.arange(count + 1) * step


def read_reference(path: Path) -> Columns:
    """Return columns of a reference by name, with "time"."""
    wrong = files.csv_failure(path)
    names, table = files.read_trajectory(path, wrong)
    if not set(STATES) <= set(names):
        raise wrong("not a reference of the closed loop", 1)
    return dict(zip(names, table.T, strict=True))


# ---- Delays --------------------------------------------------------------------------------------
LARGEST_ERROR = 1e-3  # m, of the end effector on the circle at 1 ms in Jacobi order
PREDICTED_WITHIN = 0.1  # of the measured error


@dataclass(frozen=True, eq=False)
class Tracking:
    """Error of the end effector over time, measured and predicted by the delays of the order."""

    method: Method
    step: float  # s
    times: np.ndarray  # s
    measured: np.ndarray  # (rows,) m
    predicted: np.ndarray  # (rows,) m

    @property
    def largest(self) -> float:
        """Largest measured error, m."""
        return float(self.measured.max())

    @property
    def deviation(self) -> float:
        """Of the largest predicted error from the largest measured one, relative."""
        return float(self.predicted.max() / self.measured.max() - 1)

    @property
    def predicts(self) -> bool:
        """Whether the prediction is as close as expected."""
        return abs(self.deviation) <= PREDICTED_WITHIN


def study_tracking(loop: ClosedLoop, step: float = 1e-3) -> list[Tracking]:
    """End effector on the nominal circle with held inputs, in the orders of stepping."""
    smooth = loop.run(FINEST, step)[0]
    found = []
    for method in (METHODS[0], METHODS[1], REFERENCE_AHEAD):
        columns = loop.run(method, step)[0]
        error = path_error(columns)
        predicted = predicted_error(loop, smooth, method)
        found.append(Tracking(method, step, columns["time"], error, predicted))
    return found


def tracking_passed(tracking: Sequence[Tracking]) -> bool:
    """Return whether the errors are small, ordered and predicted."""
    jacobi, gauss_seidel, _ = tracking
    return (
        jacobi.largest < LARGEST_ERROR
        and gauss_seidel.largest < jacobi.largest
        and all(t.predicts for t in tracking)
    )


def path_error(columns: Columns) -> np.ndarray:
    """Return the distance of the end effector from its reference at the same time, m."""
    return np.hypot(
        columns["arm.ee_x"] - columns["trajectory.ee_x_ref"],
        columns["arm.ee_y"] - columns["trajectory.ee_y_ref"],
    )


def predicted_error(loop: ClosedLoop, smooth: Columns, method: Method) -> np.ndarray:
    """Predict the end effector's error along a motion without coupling error, to first order.

    e'' + Kd e' + Kp e = D^-1 delta, where the efforts lack delta, as they are the law's of
    references and measurements of other times, on the average over a step.
    """
    step = smooth["time"][1] - smooth["time"][0]
    ages = {  # mean ages of references and measurements in steps
        ("jacobi", CONTROLLER_FIRST): (1.5, 1.5),
        ("gauss_seidel", CONTROLLER_FIRST): (0.5, 0.5),
        ("gauss_seidel", TRAJECTORY_FIRST): (-0.5, 0.5),
    }[method.order, method.sequence]

    # gains (2, 2) by Kp and Kd, mass matrix (rows, 2, 2)
    gains = np.array([[loop.gain(f"{kind}{i}") for i in (1, 2)] for kind in ("Kp", "Kd")])
    D11, D12, D22 = (smooth[f"arm.{name}"] for _, name in MASSES)
    mass = np.moveaxis(np.array([[D11, D12], [D12, D22]]), 2, 0)

    # rate of the efforts, and the part of it that the references cause, (rows, 2)
    efforts = np.array([smooth["controller.tau1"], smooth["controller.f2"]]).T
    total = np.gradient(efforts, step, axis=0)
    reference = [
        np.array([smooth[f"trajectory.{d}q{i}_ref"] for i in (1, 2)]).T for d in ("d", "dd")
    ]
    jerk = np.gradient(reference[1], step, axis=0)
    commanded = jerk + gains[1] * reference[1] + gains[0] * reference[0]
    by_reference = np.einsum("nij,nj->ni", mass, commanded)

    # error of the joints
    lacking = step * (ages[0] * by_reference + ages[1] * (total - by_reference))
    forcing = np.linalg.solve(mass, lacking[:, :, None])[:, :, 0]
    error = _error_motion(forcing, gains, step)

    # error of the end effector: J(q) times the joints' error
    turn = np.array([-smooth["arm.ee_y"], smooth["arm.ee_x"]]) * error[:, 0]
    slide = np.array([np.cos(smooth["arm.q1"]), np.sin(smooth["arm.q1"])]) * error[:, 1]
    return np.hypot(*(turn + slide))


def _error_motion(forcing: np.ndarray, gains: np.ndarray, step: float) -> np.ndarray:
    """Solves e'' + Kd e' + Kp e = forcing from rest by the trapezoidal rule, (rows, 2)."""
    error, rate = np.zeros_like(forcing), np.zeros(2)
    half = step / 2
    for i in range(1, len(forcing)):
        before = error[i - 1]
        old = forcing[i - 1] - gains[1] * rate - gains[0] * before
        known = before + half * rate
        right = rate + half * (old + forcing[i] - gains[0] * known)
        rate = right / (1 + half * gains[1] + half**2 * gains[0])
        error[i] = known + half * rate
    return error
