"""What coupling by a master costs: the closed loop, stepped in several ways, and measured.

The same components, connections and parameters (ClosedLoop.ssp) run under cosim.master. Errors are
told against the closed loop in continuous time (models/closed_loop/references). What is expected,
and why, is on the page models/closed_loop/coupling.md.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.convergence import slope
from cosim.coupling.master import Master
from cosim.coupling.part import Part
from cosim.errors import UserError
from cosim.files import read_csv
from cosim.system import ssp
from cosim.system.ssp import Connection
from cosim.unit import Fmu

ROOT = Path(__file__).resolve().parents[2]
SYSTEM = ROOT / "build" / "ClosedLoop.ssp"
REFERENCES = ROOT / "models" / "closed_loop" / "references"

STATES = ("arm.q1", "arm.q2", "arm.dq1", "arm.dq2")
MASSES = tuple(("arm", name) for name in ("D11", "D12", "D22"))
STEPS = (8e-3, 4e-3, 2e-3, 1e-3, 5e-4)  # s
STOP = 6.0  # s, of the references
# variables of the components
NEEDED = {
    "trajectory": ("q1_ref", "dq1_ref", "ddq1_ref", "q2_ref", "dq2_ref", "ddq2_ref")
    + ("ee_x_ref", "ee_y_ref"),
    "controller": ("Kp1", "Kp2", "Kd1", "Kd2", "tau1", "f2", "integral1", "integral2"),
    "arm": ("q1", "q2", "dq1", "dq2", "D11", "D12", "D22", "ee_x", "ee_y", "total_energy")
    + ("m2", "a", "g"),
}
COMMON = 0.04  # s, all steps and the reference's rows divide it
LARGEST_DEVIATION = 0.2  # of a slope from the order expected

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


METHODS = (
    Method("Jacobi, held", "jacobi", "held"),
    Method("Gauss-Seidel, held", "gauss_seidel", "held"),
    Method("Jacobi, extrapolated", "jacobi", "extrapolated"),
    Method("Gauss-Seidel, extrapolated", "gauss_seidel", "extrapolated"),
)
FINEST = METHODS[-1]
REFERENCE_AHEAD = Method("Gauss-Seidel, trajectory first", "gauss_seidel", "held", TRAJECTORY_FIRST)


@dataclass(frozen=True, eq=False)
class Loop:
    """The closed loop's parts, unpacked and ready to run."""

    fmus: Mapping[str, Fmu]
    connections: Sequence[Connection]
    variants: Mapping[str, Mapping[str, Mapping[str, float]]]
    stop: float  # s

    def parameters(
        self, variant: str, changes: Mapping[str, Mapping[str, float | str]] | None = None
    ) -> dict[str, dict[str, float | str]]:
        """Values of a variant by component and name, with `changes` to them."""
        if variant not in self.variants:
            raise UserError(f"no variant {variant!r} (there are: {', '.join(self.variants)})")
        values = {name: dict(self.variants[variant].get(name, {})) for name in self.fmus}
        for name, changed in (changes or {}).items():
            values[name].update(changed)
        return values

    def master(self, method: Method) -> Master:
        """A master with the components in the order of the method."""
        fmus = {name: self.fmus[name] for name in method.sequence}
        also = [*MASSES, ("controller", "integral1"), ("controller", "integral2")]
        return Master(fmus, self.connections, method.order, method.inputs, also)

    def run(
        self,
        method: Method,
        step: float,
        variant: str = "nominal",
        stop: float | None = None,
        changes: Mapping[str, Mapping[str, float | str]] | None = None,
    ) -> tuple[Columns, int]:
        """Values at all communication points by name, with "time", and calls of fmi2DoStep."""
        stop = self.stop if stop is None else stop
        times = grid(stop, step)
        with self.master(method) as master:
            master.initialize(0.0, stop, self.parameters(variant, changes))
            rows = master.run(times)
            columns = dict(zip(master.names, rows.T, strict=True))
            return {"time": times} | columns, master.do_steps


@contextmanager
def opened(path: Path = SYSTEM) -> Iterator[Loop]:
    """Unpack the closed loop; everything is removed at the end."""
    if path == SYSTEM and not path.exists():
        raise UserError(f"{path}: no such file, ./run.sh builds it")
    with ExitStack() as stack:
        unpacked = stack.enter_context(ssp.unpacked(path))
        system = unpacked.system
        fmus = {c.name: stack.enter_context(Fmu(unpacked.fmu(c.name))) for c in system.components}
        for component in system.components:
            fmus[component.name].path = path / component.source  # told in messages
        loop = Loop(fmus, system.connections, system.parameter_sets, system.stop)
        _check(path, loop)
        yield loop


def _check(path: Path, loop: Loop) -> None:
    """Check that a system is the closed loop that the study knows."""
    for component, names in NEEDED.items():
        if component not in loop.fmus:
            raise UserError(f"{path}: has no component {component!r}, which the study needs")
        for name in names:
            if name not in loop.fmus[component].variables:
                raise UserError(
                    f"{path}: component {component!r} has no variable {name!r}, "
                    "which the study needs"
                )
    for variant in ("nominal", "heavy_payload", "heavy_payload_integral"):
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

    def failure(message: str, line: int | None) -> UserError:
        place = f"{path}, line {line}" if line else f"{path}"
        return UserError(f"{place}: {message}")

    names, table = read_csv(path, failure)
    if not set(STATES) <= set(names):
        raise failure("not a reference of the closed loop", 1)
    return dict(zip(names, table.T, strict=True))


# ---- Error against step ------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Convergence:
    """Runs of all methods with all steps; arrays are (methods, steps)."""

    methods: Sequence[Method]
    steps: np.ndarray  # s
    errors: np.ndarray  # of the arm's states, relative to the largest value of each
    energies: np.ndarray  # J, that the coupling adds to the arm
    calls: np.ndarray  # of fmi2DoStep

    def slopes(self, values: np.ndarray) -> list[float]:
        """Of log |values| over log steps, by method."""
        return [slope(self.steps, np.abs(row)) for row in values]

    def holds(self, i: int) -> bool:
        """Whether error and energy of a method fall as expected."""
        slopes = self.slopes(self.errors)[i], self.slopes(self.energies)[i]
        return all(abs(s - self.methods[i].power) <= LARGEST_DEVIATION for s in slopes)


def study_convergence(
    loop: Loop, steps: Sequence[float] = STEPS, methods: Sequence[Method] = METHODS
) -> Convergence:
    """Error against step on the nominal motion, which does not saturate."""
    exact = read_reference(REFERENCES / "nominal" / "monolithic.csv")
    shape = len(methods), len(steps)
    errors, energies, calls = np.empty(shape), np.empty(shape), np.empty(shape, int)
    for i, method in enumerate(methods):
        for j, step in enumerate(steps):
            columns, calls[i, j] = loop.run(method, step)
            errors[i, j] = state_error(columns, exact)
            energies[i, j] = created_energy(loop, columns)
    return Convergence(methods, np.array(steps), errors, energies, calls)


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


def created_energy(loop: Loop, columns: Columns) -> float:
    """What the arm's energy gained beyond the work of the efforts that the control law asks for.

    The law is evaluated at the arm's momentary motion; without coupling error nothing remains. J.
    """
    efforts = law(loop, columns)
    power = efforts[0] * columns["arm.dq1"] + efforts[1] * columns["arm.dq2"]
    gained = columns["arm.total_energy"][-1] - columns["arm.total_energy"][0]
    return float(gained - simpson(power, columns["time"][1] - columns["time"][0]))


def law(loop: Loop, columns: Columns) -> np.ndarray:
    """Efforts of the nominal controller for given references and measurements, (2, rows)."""
    sources = {
        c.end_connector: f"{c.start_component}.{c.start_connector}" for c in loop.connections
    }
    with Part(loop.fmus["controller"], "controller") as part:
        part.outputs = ["tau1", "f2"]
        part.inputs = [c.end_connector for c in loop.connections if c.end_component == "controller"]
        part.attach(bytearray(16), 0, np.empty(0))
        part.begin(0.0, None, loop.parameters("nominal")["controller"])
        part.end()
        rows = np.array([columns[sources[name]] for name in part.inputs]).T
        efforts = np.empty((2, len(rows)))
        for i, row in enumerate(rows):
            part.set_inputs(row)
            part.read()
            efforts[:, i] = part.out_view
    return efforts


def simpson(values: np.ndarray, step: float) -> float:
    """Integral over an even number of equal steps."""
    inner = 4 * values[1:-1:2].sum() + 2 * values[2:-1:2].sum()
    return float((values[0] + inner + values[-1]) * step / 3)


# ---- Delays ------------------------------------------------------------------------------------


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


def study_tracking(loop: Loop, step: float = 1e-3) -> list[Tracking]:
    """End effector on the nominal circle with held inputs, in the orders of stepping."""
    smooth = loop.run(FINEST, step)[0]
    found = []
    for method in (METHODS[0], METHODS[1], REFERENCE_AHEAD):
        columns = loop.run(method, step)[0]
        error = path_error(columns)
        found.append(
            Tracking(method, step, columns["time"], error, predicted_error(loop, smooth, method))
        )
    return found


def path_error(columns: Columns) -> np.ndarray:
    """Distance of the end effector from its reference at the same time, m."""
    return np.hypot(
        columns["arm.ee_x"] - columns["trajectory.ee_x_ref"],
        columns["arm.ee_y"] - columns["trajectory.ee_y_ref"],
    )


def predicted_error(loop: Loop, smooth: Columns, method: Method) -> np.ndarray:
    """First-order prediction of the end effector's error along a motion without coupling error.

    e'' + Kd e' + Kp e = D^-1 delta, where delta is what the efforts lack: those applied are the
    law's of references and measurements of other times, on the average over a step.
    """
    step = smooth["time"][1] - smooth["time"][0]
    ages = {  # mean ages of references and measurements in steps
        ("jacobi", CONTROLLER_FIRST): (1.5, 1.5),
        ("gauss_seidel", CONTROLLER_FIRST): (0.5, 0.5),
        ("gauss_seidel", TRAJECTORY_FIRST): (-0.5, 0.5),
    }[method.order, method.sequence]
    gains = np.array([[gain(loop, f"{kind}{i}") for i in (1, 2)] for kind in ("Kp", "Kd")])
    mass = np.array(
        [[smooth["arm.D11"], smooth["arm.D12"]], [smooth["arm.D12"], smooth["arm.D22"]]]
    )
    mass = np.moveaxis(mass, 2, 0)
    efforts = np.array([smooth["controller.tau1"], smooth["controller.f2"]]).T
    total = np.gradient(efforts, step, axis=0)  # by references and measurements together
    reference = [
        np.array([smooth[f"trajectory.{d}q{i}_ref"] for i in (1, 2)]).T for d in ("d", "dd")
    ]
    jerk = np.gradient(reference[1], step, axis=0)
    commanded = jerk + gains[1] * reference[1] + gains[0] * reference[0]
    by_reference = np.einsum("nij,nj->ni", mass, commanded)
    lacking = step * (ages[0] * by_reference + ages[1] * (total - by_reference))
    forcing = np.linalg.solve(mass, lacking[:, :, None])[:, :, 0]
    error = _error_motion(forcing, gains, step)
    along = np.array([-smooth["arm.ee_y"], smooth["arm.ee_x"]]) * error[:, 0]
    slide = np.array([np.cos(smooth["arm.q1"]), np.sin(smooth["arm.q1"])]) * error[:, 1]
    return np.hypot(*(along + slide))


def gain(loop: Loop, name: str) -> float:
    """A parameter of the controller in the nominal variant."""
    start = loop.fmus["controller"].variables[name].start
    return float(loop.parameters("nominal")["controller"].get(name, start))


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


# ---- Payload -----------------------------------------------------------------------------------

HOLD = 9.0  # s: the circle ends at 5.5 s, what is left of the motion has died out


@dataclass(frozen=True, eq=False)
class Payload:
    """Errors of the variants with the wrong payload in the controller."""

    largest: dict[str, float]  # m, end effector on the circle
    held: dict[str, np.ndarray]  # (2,) rad, m: errors of the joints at the end of the hold
    theory: np.ndarray  # (2,) of the one without integral action

    @property
    def passed(self) -> bool:
        """Whether the payload costs what theory gives, and integral action takes that away."""
        alone, helped = self.held["heavy_payload"], self.held["heavy_payload_integral"]
        return bool(
            self.largest["heavy_payload"] > 10 * self.largest["nominal"]
            and np.abs(alone - self.theory).max() <= 1e-6 * np.abs(self.theory).max()
            and np.abs(helped).max() <= 1e-6 * np.abs(alone).max()
        )


def study_payload(loop: Loop, step: float = 1e-3) -> Payload:
    """A payload that the controller does not know, with and without integral action."""
    largest, held = {}, {}
    for variant in ("nominal", "heavy_payload", "heavy_payload_integral"):
        columns = loop.run(METHODS[0], step, variant, stop=HOLD)[0]
        largest[variant] = float(path_error(columns).max())
        held[variant] = np.array(
            [columns[f"trajectory.q{i}_ref"][-1] - columns[f"arm.q{i}"][-1] for i in (1, 2)]
        )
        if variant == "heavy_payload":
            theory = _held_error(loop, columns)
    return Payload(largest, held, theory)


def _held_error(loop: Loop, columns: Columns) -> np.ndarray:
    """D^-1 (g_arm - g_controller) / Kp at the end, with the controller's D."""
    arm = {name: float(loop.fmus["arm"].variables[name].start) for name in ("m2", "a", "g")}
    excess = loop.parameters("heavy_payload")["arm"]["m2"] - arm["m2"]
    last = {name: float(column[-1]) for name, column in columns.items()}
    x, y, q1 = last["arm.ee_x"], last["arm.ee_y"], last["arm.q1"]
    mass = np.array([[last["arm.D11"], last["arm.D12"]], [last["arm.D12"], last["arm.D22"]]])
    mass -= excess * np.array([[x * x + y * y, -arm["a"]], [-arm["a"], 1.0]])
    weight = excess * arm["g"] * np.array([x, np.sin(q1)])
    return np.linalg.solve(mass, weight) / [gain(loop, "Kp1"), gain(loop, "Kp2")]
