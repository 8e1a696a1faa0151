"""The machine in continuous time: one differential equation of arm, motors and controller.

The controller has its continuous form and reads the joints themselves; nothing is
sampled, counted, held or late. The motion is smooth between the corners of the reference motion and
the times of grasp and release, and heyoka starts again at each of them. The arm and what the
controller knows of it come from the Lagrangian of models/rp_plant/references, the reference motion
from rparm.models/closed_loop/references.
"""

from collections.abc import Iterable, Mapping, Sequence

import heyoka as hy
import numpy as np
import sympy as sp
from rparm.models.closed_loop.references import equations as motion
from rparm.models.closed_loop.references.closed_loop import prepare
from rparm.models.closed_loop.references.loop import COEFFICIENTS
from rparm.models.machine.references.components import UNKNOWN_TO_THE_CONTROLLER, Environment, real
from rparm.models.machine.references.machine import completed
from rparm.models.rp_plant.references import equations as plant
from rparm.models.rp_plant.references.equations import INPUTS, STATES

from rparm.errors import UserError
from rparm.fmi.model import Value

EFFORTS = ("tau1", "f2")
CURRENTS = ("current1", "current2")
EFFECTOR = ("ee_x", "ee_y", "ee_vx", "ee_vy")
STATE = (*STATES, *CURRENTS)
COLUMNS = (
    *(f"trajectory.{name}" for name in (*motion.REFERENCES, *motion.PATH)),
    *(f"controller.{name}" for name in EFFORTS),
    *(f"actuator.{name}" for name in (*EFFORTS, *CURRENTS, "voltage1", "voltage2")),
    *(f"plant.{name}" for name in (*STATES, "ddq1", "ddq2")),
    *(f"plant.{name}" for name in EFFECTOR),
)
# not in these equations: it has to be 0
LEFT_OUT = (
    *(f"plant.{kind}_friction{i}" for kind in ("coulomb", "breakaway") for i in (1, 2)),
    *("controller.Ki1", "controller.Ki2"),
)
# other items of these have other equations
DEFAULTS = ("trajectory.motion", "controller.mode", "plant.stops1", "plant.stops2", "plant.grasp")

Columns = dict[str, np.ndarray]


class Monolith:
    """The compiled equations of one variant; sample times, delay and sensor mean nothing here."""

    def __init__(self, parameters: Mapping[str, Value]) -> None:
        values = completed(parameters)
        for name in LEFT_OUT:
            component, _, variable = name.partition(".")
            if values[component][variable] != 0:
                raise UserError(f"{name} has to be 0 for the machine in continuous time")
        for name in DEFAULTS:
            if name in parameters:
                raise UserError(f"{name} keeps its default for the machine in continuous time")
        trajectory = {
            name: value
            for name, value in parameters.items()
            if name.startswith("trajectory.") and not name.endswith(("grasp_time", "release_time"))
        }
        loop, self._segments, _ = prepare(trajectory, real)
        self._numbers = {
            name: loop.values[place]
            for name, place in loop.place.items()
            if name.startswith(("trajectory.", "segment."))
        }
        for component in ("plant", "controller", "actuator"):
            for name, value in values[component].items():
                if not isinstance(value, str):
                    self._numbers[f"{component}.{name}"] = real(value)
        for name in plant.PARAMETERS:
            if name[:-1] in UNKNOWN_TO_THE_CONTROLLER:
                self._numbers[f"controller.{name}"] = real(0)
        self._numbers["attached"] = real(0)
        self._place = {name: i for i, name in enumerate(self._numbers)}
        times = [values["trajectory"][f"{name}_time"] for name in ("grasp", "release")]
        self._carried = tuple(map(real, times)) if times[0] < times[1] else (real(0), real(0))
        self._start = [*(values["plant"][n] for n in STATES)]
        self._start += [values["actuator"][n] for n in CURRENTS]
        self._wall = Environment(values["environment"])
        self._compile()

    def _par(self, name: str) -> hy.expression:
        return hy.par[self._place[name]]

    def _of(self, component: str) -> dict[sp.Symbol, hy.expression]:
        """Return parameters of the plant's equations as a component knows them."""
        known = {sp.Symbol(n): self._par(f"{component}.{n}") for n in plant.PARAMETERS}
        known |= {sp.Symbol(n): hy.expression(0.0) for n in (*INPUTS, *plant.SWITCHES)}
        return known | {sp.Symbol("attached"): self._par("attached")}

    def _compile(self) -> None:
        e = plant.derive()
        states = dict(zip(STATE, hy.make_vars(*STATE), strict=True))
        joints, currents = list(states.values())[:4], list(states.values())[4:]
        reference = self._reference()
        efforts = self._law(e, reference, states)
        moved, voltages, rates = self._motors(efforts, currents, joints[2:])
        ddq = self._accelerations(e, moved)
        numbers = self._of("plant")
        effector = [hy.from_sympy(sp.sympify(e.outputs[name]), numbers) for name in EFFECTOR]
        shown = [*reference.values(), *efforts, *moved, *currents, *voltages]
        shown += [*joints, *ddq, *effector]
        last = hy.par[len(self._place) - 1]  # so that the function takes all numbers
        self._outputs = hy.cfunc([*shown, last], vars=[*joints, *currents], fp_type=real)
        self._taylor = hy.taylor_adaptive(
            list(zip(states.values(), [*joints[2:], *ddq, *rates], strict=True)),
            np.zeros(len(STATE), real),
            compact_mode=True,
            fp_type=real,
        )

    def _reference(self) -> dict[str, hy.expression]:
        known = {
            sp.Symbol(name): self._par(name)
            for name in self._place
            if name.startswith(("trajectory.", "segment."))
        }
        known[motion.time] = hy.time
        outputs = motion.reference(self._path())
        return {name: hy.from_sympy(x, known) for name, x in outputs.items()}

    def _motors(self, efforts: list, currents: list, speeds: list) -> tuple[list, list, list]:
        """Return efforts of the motors, their voltages, and the rates of their currents."""
        moved, voltages, rates = [], [], []
        for j, i in enumerate((1, 2)):
            constant, gear, resistance, lag = (
                self._par(f"actuator.{name}{i}")
                for name in ("torque_constant", "gear_ratio", "resistance", "time_constant")
            )
            moved.append(constant * gear * currents[j])
            voltages.append(resistance * currents[j] + constant * gear * speeds[j])
            rates.append((efforts[j] / (constant * gear) - currents[j]) / lag)
        return moved, voltages, rates

    def _path(self) -> str:
        """The circle of the reference motion contains the axis of joint 1, or leaves it aside."""
        names = ("x_center", "y_center", "radius")
        x, y, radius = (self._numbers[f"trajectory.{name}"] for name in names)
        return "circle_around" if np.hypot(x, y) < radius else "circle_aside"

    def _law(
        self,
        e: plant.Equations,
        reference: Mapping[str, hy.expression],
        states: Mapping[str, hy.expression],
    ) -> list[hy.expression]:
        """Computed torque of the arm and the payload that the controller knows."""
        wanted = [
            reference[f"ddq{i}_ref"]
            + self._par(f"controller.Kp{i}") * (reference[f"q{i}_ref"] - states[f"q{i}"])
            + self._par(f"controller.Kd{i}") * (reference[f"dq{i}_ref"] - states[f"dq{i}"])
            for i in (1, 2)
        ]
        known = self._of("controller")
        D = [[hy.from_sympy(sp.sympify(e.inertia[i, j]), known) for j in (0, 1)] for i in (0, 1)]
        b = [hy.from_sympy(sp.sympify(x), known) for x in e.forces]
        return [D[i][0] * wanted[0] + D[i][1] * wanted[1] - b[i] for i in (0, 1)]

    def _accelerations(self, e: plant.Equations, moved: list) -> list[hy.expression]:
        known = self._of("plant")
        known |= {sp.Symbol(name): effort for name, effort in zip(EFFORTS, moved, strict=True)}
        D, b = e.inertia, e.forces
        determinant = D[0, 0] * D[1, 1] - D[0, 1] ** 2
        first = (D[1, 1] * b[0] - D[0, 1] * b[1]) / determinant
        second = (D[0, 0] * b[1] - D[0, 1] * b[0]) / determinant
        return [hy.from_sympy(x, known) for x in (first, second)]

    # ---- The motion ------------------------------------------------------------------------------

    def run(self, times: Sequence[float]) -> Columns:
        """Every one of `COLUMNS`, (times,), at `times` in s that ascend from 0."""
        times = np.asarray(times, real)
        if len(times) == 0 or times[0] != 0 or np.any(np.diff(times) <= 0):
            raise UserError("times must ascend from 0")
        corners = {corner for corner in (*self._segments[1:, 0], *self._carried) if corner > 0}
        taylor, rows = self._taylor, []
        taylor.time, taylor.state[:] = real(0), self._start
        taylor.pars[:] = self._at(taylor.time)
        for time in sorted({*times, *(corner for corner in corners if corner < times[-1])}):
            if taylor.propagate_until(time)[0] != hy.taylor_outcome.time_limit:
                raise UserError(f"the motion blows up near {float(taylor.time)!r} s")
            if time in corners:
                taylor.pars[:] = self._at(time)
            if time in times:
                rows.append(self._outputs(taylor.state, pars=taylor.pars, time=time)[:-1].copy())
        columns = dict(zip(COLUMNS, np.array(rows).T, strict=True))
        self._check_limits(columns)
        self._check_wall(columns)
        return columns

    def _at(self, time: real) -> np.ndarray:
        """Numbers from this time on."""
        self._numbers["attached"] = real(self._carried[0] <= time < self._carried[1])
        segment = self._segments[np.searchsorted(self._segments[1:, 0], time, side="right")]
        self._numbers |= dict(zip(COEFFICIENTS, segment, strict=True))
        return np.array(list(self._numbers.values()))

    def _check_limits(self, columns: Columns) -> None:
        """The equations hold below the limits of controller and motors only."""
        limits = {f"controller.{n}": f"controller.{n}_max" for n in EFFORTS}
        for kind in ("current", "voltage"):
            limits |= {f"actuator.{kind}{i}": f"actuator.{kind}_max{i}" for i in (1, 2)}
        for name, limit in limits.items():
            if np.abs(columns[name]).max() >= self._numbers[limit]:
                raise UserError(f"{name} reaches its limit {float(self._numbers[limit])!r}")

    def _check_wall(self, columns: Columns) -> None:
        """The equations hold without contact with the wall only."""
        sources = (*EFFECTOR, "q1", "dq1")
        for row in zip(*(columns[f"plant.{name}"] for name in sources), strict=True):
            found = self._wall.outputs(dict(zip(Environment.INPUTS, row, strict=True)))
            if found["penetration"] > 0:
                raise UserError("the wall is touched")


def monolithic(parameters: Mapping[str, Value], times: Iterable[float]) -> Columns:
    """The machine in continuous time: every one of `COLUMNS` at `times` in s, in long double."""
    return Monolith(parameters).run(list(times))
