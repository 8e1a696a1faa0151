"""The smooth part of the plant against its Lagrangian, at random rationals."""

import subprocess
from collections.abc import Mapping
from pathlib import Path

import mpmath
import numpy as np
import pytest

from tests.rp_plant.fmu.plant_runs import COMPLIANT
from tests.support.symbolic import SmoothPlant

# ---- the plant's C functions, by the program plant_rows ------------------------------------------

ARM = ("m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g")
JOINT = (
    "armature", "damping", "coulomb_friction", "breakaway_friction", "stribeck_velocity", "lower",
    "upper", "restitution",
)  # fmt: skip
PAYLOAD = ("payload_mass", "payload_inertia", "payload_x", "payload_z")
INPUTS = ("tau1", "f2", "ee_fx", "ee_fy", "ee_mz")
STATES = ("q1", "q2", "dq1", "dq2")
BUFFERS = ("stop_stiffness1", "stop_stiffness2", "stop_damping1", "stop_damping2")
PARAMETERS = (*ARM, *(f"{name}{joint}" for name in JOINT for joint in (1, 2)), *PAYLOAD, *BUFFERS)
SWITCHES = ("attached", "mode1", "mode2", "contact1", "contact2", "stops1", "stops2")
KNOWNS = (*PARAMETERS, *INPUTS, *STATES, *SWITCHES)
RESULTS = (
    "ddq1", "ddq2", "ee_ax", "ee_ay", "kinetic_energy", "potential_energy", "D11", "D12", "D22",
    "coriolis1", "coriolis2", "gravity1", "gravity2", "f1_x", "f1_z", "tau1_y", "f2_x", "f2_z",
    "tau2_y", "friction1", "friction2", "stop_force1", "stop_force2",
)  # fmt: skip
FREE, STUCK = 2.0, 0.0
DEFAULT = {
    "m1": 2.0, "m2": 1.0, "I1z": 0.1, "I2z": 0.05, "l1": 0.5, "lc1": 0.25, "a": 0.1, "g": 9.81,
    "mode1": FREE, "mode2": FREE,
}  # fmt: skip


def evaluate(program: Path, cases: list[Mapping[str, float]]) -> list[dict[str, float]]:
    """Calculated values of the plant, in SI units; knowns that a case does not have are those of
    DEFAULT, or else 0."""
    values = [DEFAULT | dict(case) for case in cases]
    assert all(case.keys() <= set(KNOWNS) for case in values)
    rows = np.array([[case.get(name, 0.0) for name in KNOWNS] for case in values], dtype=np.float64)
    done = subprocess.run(program, input=rows.tobytes(), capture_output=True, check=True)
    found = np.frombuffer(done.stdout).reshape(len(rows), len(RESULTS))
    return [dict(zip(RESULTS, row, strict=True)) for row in found.tolist()]


# ---- cases ---------------------------------------------------------------------------------------

CASES = 400
Case = dict[str, float]


def random_case(random: np.random.Generator) -> Case:
    """Everything on, or off in one draw of four; numbers are multiples of 2^-12."""

    def uniform(low: float, high: float) -> float:
        return round(random.uniform(low, high) * 4096) / 4096

    def maybe(high: float) -> float:
        return 0.0 if random.integers(4) == 0 else uniform(0, high)

    return {
        "m1": maybe(5), "m2": uniform(0.1, 5), "I1z": uniform(0.05, 1), "I2z": maybe(1),
        "l1": maybe(2), "lc1": maybe(1), "a": uniform(-1, 1), "g": uniform(-10, 10),
        "armature1": maybe(2), "armature2": maybe(2), "damping1": maybe(5), "damping2": maybe(5),
        "payload_mass": maybe(4), "payload_inertia": maybe(1),
        "payload_x": uniform(-1, 1), "payload_z": uniform(-1, 1),
        "attached": float(random.integers(4) != 0),
        "tau1": uniform(-50, 50), "f2": uniform(-50, 50),
        "ee_fx": uniform(-50, 50), "ee_fy": uniform(-50, 50), "ee_mz": uniform(-50, 50),
        "q1": uniform(-4, 4), "q2": uniform(-2, 2), "dq1": uniform(-5, 5), "dq2": uniform(-5, 5),
    }  # fmt: skip


def in_stops(random: np.random.Generator, case: Case) -> Case:
    """The same with joints in compliant stops (contact 1, -1), let go by them (2, -2) or apart."""
    found = dict(case)
    for joint in (1, 2):
        contact = int(random.integers(-2, 3))
        depth = float(random.integers(1, 64)) / 256
        limit = "lower" if contact > 0 else "upper"
        found |= {f"contact{joint}": contact, f"stops{joint}": COMPLIANT}
        found |= {f"lower{joint}": -9.0, f"upper{joint}": 9.0}
        if contact != 0:
            found[f"{limit}{joint}"] = found[f"q{joint}"] + np.sign(contact) * depth
        found[f"stop_stiffness{joint}"] = float(random.integers(1, 500))
        found[f"stop_damping{joint}"] = float(random.integers(4)) / 4
    return found


def stop_force(case: Case, joint: int) -> mpmath.mpf:
    """Hunt's and Crossley's on joint 1 or 2, as the contact is."""
    contact = case[f"contact{joint}"]
    if abs(contact) != 1:
        return mpmath.mpf(0)
    pressed = case[f"stop_stiffness{joint}"] * mpmath.mpf(depth_of(case, joint))
    into = -contact * mpmath.mpf(case[f"dq{joint}"])
    return contact * pressed * (1 + case[f"stop_damping{joint}"] * into)


def depth_of(case: Case, joint: int) -> float:
    """Penetration, exact in binary; 0: apart."""
    contact, q = case[f"contact{joint}"], case[f"q{joint}"]
    if contact == 0:
        return 0.0
    return case[f"lower{joint}"] - q if contact > 0 else q - case[f"upper{joint}"]


@pytest.fixture(scope="module")
def exact() -> SmoothPlant:
    return SmoothPlant()


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    random = np.random.default_rng(15)
    return [random_case(random) for _ in range(CASES)]


def assert_close(actual: float, expected: mpmath.mpf, scale: mpmath.mpf, what: object) -> None:
    assert abs(mpmath.mpf(actual) - expected) <= mpmath.mpf("1e-13") * scale, what


def size(matrix: mpmath.matrix) -> mpmath.mpf:
    """The largest absolute value of the entries."""
    return max(abs(entry) for entry in matrix)


def assert_accelerations(exact: SmoothPlant, case: Case, found: Case) -> Case:
    """Both rows of D ddq = forces, or of one where the other joint is stuck."""
    D, applied = exact.evaluate("mass_matrix", case), exact.evaluate("applied", case)
    coriolis, gravity = exact.evaluate("coriolis", case), exact.evaluate("gravity", case)
    stops = mpmath.matrix([stop_force(case, i) if "contact1" in case else 0 for i in (1, 2)])
    forces = applied - coriolis - gravity + stops
    scale = 10 + size(applied) + size(coriolis) + size(gravity) + size(stops)
    moves = [i for i in range(2) if case.get(f"mode{i + 1}", FREE) == FREE]
    rows = mpmath.matrix([[D[i, j] for j in moves] for i in moves])
    inverse = rows**-1
    expected = inverse * mpmath.matrix([forces[i] for i in moves])
    ddq = mpmath.matrix(2, 1)
    for k, i in enumerate(moves):
        ddq[i] = expected[k]
    for i in range(2):
        assert_close(found[f"ddq{i + 1}"], ddq[i], size(inverse) * scale, (case, i))
    reaction = forces - D * ddq
    for i in range(2):
        bound = scale * (1 + size(D) * size(inverse))
        if i not in moves:
            assert_close(found[f"friction{i + 1}"], reaction[i], bound, (case, i))
    return case | {"ddq1": found["ddq1"], "ddq2": found["ddq2"]}


def assert_loads(exact: SmoothPlant, moved: Case, found: Case) -> None:
    """Those of Newton's and Euler's laws at the accelerations of `moved`."""
    loads = exact.evaluate("loads", moved)
    scale = 100 * (10 + abs(found["ddq1"]) + abs(found["ddq2"]))
    for i, name in enumerate(("f1_x", "f1_z", "tau1_y", "f2_x", "f2_z", "tau2_y")):
        assert_close(found[name], loads[i], scale, (name, moved))


def test_motion_is_that_of_the_lagrangian(
    program: Path, exact: SmoothPlant, cases: list[Case]
) -> None:
    for case, found in zip(cases, evaluate(program, cases), strict=True):
        assert_accelerations(exact, case, found)


@pytest.mark.parametrize("stuck", [1, 2])
def test_motion_beside_a_stuck_joint(
    program: Path, exact: SmoothPlant, cases: list[Case], stuck: int
) -> None:
    """A stuck joint is a constraint: one equation is left, and what holds is its multiplier."""
    held = {f"mode{stuck}": STUCK, f"coulomb_friction{stuck}": 1e3, f"dq{stuck}": 0.0}
    changed = [case | held for case in cases]
    for case, found in zip(changed, evaluate(program, changed), strict=True):
        assert_accelerations(exact, case, found)


def test_motion_in_compliant_stops(program: Path, exact: SmoothPlant, cases: list[Case]) -> None:
    """Forces, energies and joint loads; in every third case friction holds joint 1."""
    random = np.random.default_rng(16)
    changed = []
    for number, case in enumerate(cases):
        held = {"mode1": STUCK, "coulomb_friction1": 1e4, "dq1": 0.0} if number % 3 == 0 else {}
        changed.append(in_stops(random, case) | held)
    for case, found in zip(changed, evaluate(program, changed), strict=True):
        moved = assert_accelerations(exact, case, found)
        stored = mpmath.mpf(0)
        for joint in (1, 2):
            force = stop_force(case, joint)
            assert_close(found[f"stop_force{joint}"], force, 1 + abs(force), case)
            stored += case[f"stop_stiffness{joint}"] * mpmath.mpf(depth_of(case, joint)) ** 2 / 2
        energy = exact.evaluate("potential_energy", case) + stored
        assert_close(found["potential_energy"], energy, 100 + abs(energy), case)
        assert_loads(exact, moved, found)


def test_terms_and_energies(program: Path, exact: SmoothPlant, cases: list[Case]) -> None:
    for case, found in zip(cases, evaluate(program, cases), strict=True):
        D = exact.evaluate("mass_matrix", case)
        for name, entry in (("D11", D[0, 0]), ("D12", D[0, 1]), ("D22", D[1, 1])):
            assert_close(found[name], entry, size(D), (name, case))
        for name in ("coriolis", "gravity"):
            forces = exact.evaluate(name, case)
            for i in range(2):
                assert_close(found[f"{name}{i + 1}"], forces[i], 100 + size(forces), (name, case))
        for name in ("kinetic_energy", "potential_energy"):
            energy = exact.evaluate(name, case)
            assert_close(found[name], energy, 100 + abs(energy), (name, case))


def test_joint_loads_are_newtons(program: Path, exact: SmoothPlant, cases: list[Case]) -> None:
    for case, found in zip(cases, evaluate(program, cases), strict=True):
        # the accelerations are those found: their rounding is tested above
        assert_loads(exact, case | {"ddq1": found["ddq1"], "ddq2": found["ddq2"]}, found)


def test_acceleration_of_the_end_effector(
    program: Path, exact: SmoothPlant, cases: list[Case]
) -> None:
    for case, found in zip(cases, evaluate(program, cases), strict=True):
        moved = case | {"ddq1": found["ddq1"], "ddq2": found["ddq2"]}
        acceleration = exact.evaluate("acceleration", moved)
        scale = 10 * (10 + abs(found["ddq1"]) + abs(found["ddq2"]))
        assert_close(found["ee_ax"], acceleration[0], scale, case)
        assert_close(found["ee_ay"], acceleration[1], scale, case)
