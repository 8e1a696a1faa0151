"""Energy of the built FMU: its change is the work of efforts and wrench less the losses.

Losses of friction, damping and compliant stops are quadratures here, in steps that end beside the
events; those of impacts and grasps are outputs. A payload brings its energy along, and takes it
away.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest
from rparm.models.rp_plant.references.equations import INPUTS

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.runs import simulation
from tests.rp_plant.fmu.plant_runs import AT_REST, COMPLIANT, RIGID, each_method, read, started
from tests.rp_plant.fmu.random_motions import Case, compliant_case, random_case
from tests.support.rparm_project import load, names_of

TOLERANCE, ALLOWED = 1e-8, 100.0  # error in tolerances of the largest energy
BESIDE = 1e-9  # s, from an event to the ends of the steps around it
BOOLE = np.array([7, 32, 12, 32, 7]) / 90
POWERS = ("actuator_power", "friction_power", "ee_vx", "ee_vy", "ee_rate")
STATES_AND_STOPS = ("q1", "q2", "dq1", "dq2", "stop_force1", "stop_force2")
ENERGIES = ("kinetic_energy", "potential_energy", "impact_loss", "grasp_loss")
# in the last two rigid ones a slide is lifted off its stop slowly
CASES = [*((random_case, n) for n in (0, 1, 2, 3, 10, 25)), *((compliant_case, n) for n in (1, 2))]


class Balance:
    """Steps an instance and adds up the work done on it less what friction, damping and compliant
    stops take (J).

    `drive(t)` sets the inputs of a step that begins at t, `wrench(t)` is that at the end effector;
    `values`: parameters.
    """

    def __init__(
        self,
        instance: Instance,
        drive: Callable[[float], None],
        wrench: Callable[[float], Sequence[float]],
        values: Mapping[str, float],
    ) -> None:
        self.work = 0.0
        self.largest = 0.0  # |K| + |P|
        self._instance, self._drive, self._wrench = instance, drive, wrench
        self._powers, self._energies = instance.reals(POWERS), instance.reals(ENERGIES)
        self._stops, self._values = instance.reals(STATES_AND_STOPS), values

    def energy(self) -> np.ndarray:
        """Kinetic and potential energy, losses of impacts and grasps."""
        self._energies.get()
        found = self._energies.view.copy()
        self.largest = max(self.largest, abs(found[0]) + abs(found[1]))
        return found

    def step(self, t: float, end: float) -> None:
        """From t to `end`, in parts without events and short ones around each."""
        while t < end:
            t = self._part(t, end)
        self.energy()

    def _part(self, t: float, end: float) -> float:
        saved = self._instance.saved_state()
        saved.take()
        try:
            while self._has_event(t, end):
                (event,) = read(self._instance, "last_event_time")
                saved.restore()
                if event <= t + 2 * BESIDE:
                    return self.jump(t, min(end, event + BESIDE))
                end = event - BESIDE
            saved.restore()
            self.work += self._quadrature(t, end)
            return end
        finally:
            saved.free()

    def jump(self, t: float, end: float) -> float:
        """A short step in which velocities may jump; return its end."""
        self._advance(t, end)
        self.work += (end - t) * self._power(end)
        return end

    def _has_event(self, t: float, end: float) -> bool:
        before = self._instance.integer("event_count")
        self._advance(t, end)
        return self._instance.integer("event_count") != before

    def _advance(self, t: float, end: float) -> None:
        self._drive(t)
        self._instance.do_step(t, end - t, goes_back=True)

    def _quadrature(self, t: float, end: float) -> float:
        nodes = np.linspace(t, end, 5).tolist()
        self._drive(t)
        powers = [self._power(t)]
        for at, then in zip(nodes, nodes[1:], strict=False):
            self._advance(at, then)
            powers.append(self._power(then))
        return (end - t) * float(BOOLE @ powers)

    def _power(self, t: float) -> float:
        self._powers.get()
        drives, friction, vx, vy, rate = self._powers.view
        fx, fy, mz = self._wrench(t)
        return drives - friction - self._stop_loss() + fx * vx + fy * vy + mz * rate

    def _stop_loss(self) -> float:
        """What compliant stops get and do not store, W."""
        self._stops.get()
        x, values, lost = self._stops.view, self._values, 0.0
        for i in (1, 2):
            if values[f"stops{i}"] == COMPLIANT:
                q, rate, force = x[i - 1], x[i + 1], x[i + 3]
                below, above = values[f"lower{i}"] - q, q - values[f"upper{i}"]
                stored = max(above, 0.0) - max(below, 0.0)
                lost -= (force + values[f"stop_stiffness{i}"] * stored) * rate
        return lost


def payload_energy(instance: Instance, values: Mapping[str, float], moves: bool) -> float:
    """Energy of the payload at the end effector, in motion with it or at rest, J."""
    angle, slide, spin, speed = read(instance, "q1", "q2", "dq1", "dq2")
    along, across = values["l1"] + slide + values["payload_z"], values["a"] + values["payload_x"]
    height = math.sin(angle) * along + math.cos(angle) * across
    energy = values["payload_mass"] * values["g"] * height
    if moves:
        square = (speed - across * spin) ** 2 + (along * spin) ** 2
        energy += (values["payload_mass"] * square + values["payload_inertia"] * spin**2) / 2
    return energy


def brought(instance: Instance, values: Mapping[str, float], attach: bool) -> float:
    """What a payload that is grasped brings, or one that is released takes (negative), J."""
    if not attach:
        return -payload_energy(instance, values, True)
    return payload_energy(instance, values, values["grasp"] != AT_REST)


def check(balance: Balance, start: np.ndarray, extra: float) -> None:
    change = balance.energy() - start
    missing = change[0] + change[1] - balance.work - extra + change[2] + change[3]
    assert abs(missing) <= ALLOWED * TOLERANCE * balance.largest


@pytest.mark.parametrize("name", names_of("rp_plant"))
def test_energy_of_a_scenario(fmi2_plant: Fmu, name: str) -> None:
    scenario = load(name)
    with fmi2_plant.instance(name) as instance:
        simulation.initialize(instance, scenario, scenario.tolerance)

        def drive(t: float) -> None:
            i = int(np.searchsorted(scenario.times, t, side="right")) - 1
            for name, values in scenario.inputs.items():
                if values.dtype != bool:
                    instance.set(name, values[i].item())

        values = scenario.start_values
        balance, extra = Balance(instance, drive, lambda _: (0.0, 0.0, 0.0), values), 0.0
        start = balance.energy()
        attached = scenario.input("payload_attached")
        for i, t in enumerate(scenario.times[:-1].tolist()):
            if i and attached[i] != attached[i - 1]:
                extra += brought(instance, values, attached[i])
                instance.set("payload_attached", bool(attached[i]))
                t = balance.jump(t, t + BESIDE)
            balance.step(t, float(scenario.times[i + 1]))
        assert balance.largest > 0.1
        check(balance, start, extra)


@each_method
@pytest.mark.parametrize(("draw", "number"), CASES)
def test_energy_of_a_random_motion(
    fmi2_plant: Fmu, draw: Callable[[np.random.Generator], Case], number: int, method: str
) -> None:
    """Inputs are ramps in about every second case."""
    case = draw(np.random.default_rng((15, number)))
    smooth = INPUTS if case.rates else ()
    with started(fmi2_plant, method, TOLERANCE, smooth, **case.values) as instance:
        check_random(instance, case, dict(fmi2_plant.model.start_values) | case.values)


def check_random(instance: Instance, case: Case, values: Mapping[str, float]) -> None:
    polynomials = instance.input_polynomials(list(INPUTS), 1) if case.rates else None

    def drive(t: float) -> None:
        now = case.inputs(t)
        if polynomials is not None:
            polynomials.view[:] = [[now[x] for x in INPUTS], [case.rates[x] for x in INPUTS]]
            polynomials.set()
        else:
            for name in INPUTS:
                instance.set(name, now[name])

    def wrench(t: float) -> list[float]:
        return [case.inputs(t)[name] for name in INPUTS[2:]]

    balance, extra = Balance(instance, drive, wrench, values), 0.0
    start = balance.energy()
    points = sorted({*(np.arange(1001) / 1000).tolist(), *(at for at, _ in case.changes if at < 1)})
    changes = dict(case.changes)
    for t, end in zip(points, points[1:], strict=False):
        if t in changes:
            attach = changes[t]["payload_attached"]
            extra += brought(instance, values, attach)
            instance.set("payload_attached", attach)
            t = balance.jump(t, t + BESIDE)
        balance.step(t, end)
    check(balance, start, extra)


@each_method
def test_elastic_impacts_keep_the_energy(fmi2_plant: Fmu, method: str) -> None:
    """Ten thousand of them, of a slide between its stops under gravity."""
    impacts, tolerance = 10_000, 1e-10
    values = {"a": 0.0, "q1": math.pi / 2, "q2": 0.1, "dq2": 6.0, "coulomb_friction1": 1000.0}
    stops = {"stops2": RIGID, "lower2": -0.2, "upper2": 0.3, "restitution2": 1.0}
    with started(fmi2_plant, method, tolerance, **values, **stops) as instance:
        (start,) = read(instance, "total_energy")
        t, count = 0.0, 0
        while count < impacts:
            instance.do_step(t, 8.0)
            t += 8.0
            count = instance.integer("event_count")
        end, loss = read(instance, "total_energy", "impact_loss")
        assert (end, loss) == (pytest.approx(start, rel=ALLOWED * tolerance), 0.0)
