"""The references of the closed loop: physics, closed forms, made again.

test_coupling.py compares them with the FMUs, with every law and at the limits of the efforts.
"""

import tomllib

import mpmath
import numpy as np
import pytest
from rparm.models.closed_loop.references import closed_loop, equations, make_references
from rparm.models.closed_loop.references.closed_loop import (
    COLUMNS,
    STATE,
    Columns,
    monolithic,
    sampled,
)

from rparm.errors import UserError
from tests.support.paths import ROOT
from tests.support.rparm_project import declared
from tests.support.ssp_files import read_csv

FOLDER = ROOT / "models" / "closed_loop" / "references"
VARIANTS = make_references.variants()
FILES = ("monolithic.csv", "sampled.csv", "ecos.csv")


def largest(columns: Columns, other: Columns, names: tuple[str, ...]) -> float:
    return float(max(np.max(np.abs(columns[name] - other[name])) for name in names))


# -- equations --


def test_columns_are_the_outputs_of_the_models() -> None:
    outputs = [
        f"{component}.{name}"
        for component, folder in closed_loop.COMPONENTS.items()
        for name in declared(folder).real_outputs
    ]
    assert list(COLUMNS) == [*outputs, "controller.integral1", "controller.integral2"]


def blended(x: mpmath.mpf) -> mpmath.mpf:
    x = min(max(x, mpmath.mpf(0)), mpmath.mpf(1))
    return 10 * x**3 - 15 * x**4 + 6 * x**5


def position(values: dict, t: mpmath.mpf) -> tuple[mpmath.mpf, mpmath.mpf]:
    """The end effector on its path, with the phase as the integral of its blended rate."""
    u = t - values["start_time"]
    if values["motion"] == "line":
        s = blended(u / values["duration"])
        return tuple(
            values[f"ee_{x}_from"] + (values[f"ee_{x}_to"] - values[f"ee_{x}_from"]) * s
            for x in "xy"
        )
    ramp, moved = values["ramp_time"], values["turns"] / abs(values["frequency"])
    corners = [mpmath.mpf(c) for c in (0, ramp, moved, moved + ramp)]
    past = [c for c in corners if c < u]
    phase = values["start_angle"] + 2 * mpmath.pi * values["frequency"] * mpmath.quad(
        lambda s: blended(s / ramp) * blended((moved + ramp - s) / ramp), [*past, u]
    ) * (u > 0)
    return (
        values["x_center"] + values["radius"] * mpmath.cos(phase),
        values["y_center"] + values["radius"] * mpmath.sin(phase),
    )


AROUND = {"x_center": 0.05, "y_center": -0.02, "radius": 0.4, "frequency": -0.6, "start_angle": 2.0}
CASES = {
    "circle": {},
    "circle_backward": {"branch": "backward", "x_center": -0.4, "turns": 1.5},
    "circle_around": AROUND,
    "line": {"motion": "line", "duration": 2.5},
    "line_backward": {"motion": "line", "branch": "backward", "ee_x_from": -0.5, "a": -0.1},
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_reference_follows_the_path(case: dict) -> None:
    """The end effector's position from the joints, and the derivatives, as seen by mpmath."""
    values = (
        declared("rp_trajectory").start_values | {"motion": "circle", "branch": "forward"} | case
    )
    times = [0.2, 0.9, 1.4, 2.7] if values["motion"] == "circle" else [0.2, 0.9, 1.4]
    column = monolithic({f"trajectory.{n}": v for n, v in case.items()}, times)
    column = {n.removeprefix("trajectory."): v for n, v in column.items() if "trajectory" in n}
    l1, a, sign = values["l1"], values["a"], 1 if values["branch"] == "forward" else -1

    def joints(t: mpmath.mpf) -> tuple[mpmath.mpf, mpmath.mpf]:
        x, y = position(values, t)
        slide = sign * mpmath.sqrt(x**2 + y**2 - mpmath.mpf(a) ** 2)
        return mpmath.atan2(y, x) - mpmath.atan2(a, slide), slide - l1

    for i, time in enumerate(times):
        t = mpmath.mpf(time)
        with mpmath.workdps(30):
            q1, q2 = joints(t)
            turns = (column["q1_ref"][i] - float(q1)) / (2 * np.pi)
            assert abs(turns - round(float(turns))) < 1e-15
            assert abs(column["q2_ref"][i] - float(q2)) < 1e-15
            for name, component in (("q1_ref", 0), ("q2_ref", 1)):
                for order, prefix in ((1, "d"), (2, "dd")):
                    exact = mpmath.diff(lambda s, c=component: joints(s)[c], t, order, h=1e-6)
                    assert abs(column[prefix + name][i] - float(exact)) < 1e-8, (name, order, time)
            for name, exact in zip(("ee_x_ref", "ee_y_ref"), position(values, t), strict=True):
                assert abs(column[name][i] - float(exact)) < 1e-15


def test_angle_is_continuous_and_principal_at_the_start() -> None:
    """Four turns about the axis of joint 1, with no jump of the angle."""
    circle = AROUND | {"turns": 4.0, "start_time": 0.0, "start_angle": 20.0}
    times = np.arange(801) / 100
    angle = monolithic({f"trajectory.{n}": v for n, v in circle.items()}, times)[
        "trajectory.q1_ref"
    ]
    assert -np.pi < angle[0] <= np.pi
    assert np.max(np.abs(np.diff(angle))) < 0.06
    assert abs(angle[-1] - angle[0] + 8 * np.pi) < 1e-14


# -- motion in continuous time --


@pytest.mark.parametrize("variant", ["nominal", "heavy_payload_integral", "limited_effort"])
def test_energy_changes_by_the_work_of_the_efforts(variant: str) -> None:
    """E(t) - E(0) is the integral of tau1 dq1 + f2 dq2, by Gauss's quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    edges = np.linspace(0, 2, 101)
    panels = (edges[:-1, None] + 0.01 * (nodes + 1)).ravel()
    times = np.sort(np.concatenate((panels, edges)))
    column = monolithic(VARIANTS[variant], times)
    inside = np.isin(times, panels)
    power = column["controller.tau1"] * column["arm.dq1"]
    power += column["controller.f2"] * column["arm.dq2"]
    assert np.array_equal(power, column["arm.actuator_power"])
    work = 0.01 * np.sum(power[inside].reshape(-1, 12) * weights, axis=1)
    energy = column["arm.total_energy"][~inside]
    kinks = 1e-14 if variant != "limited_effort" else 1e-5  # a panel may hold a switch
    assert np.max(np.abs(np.diff(energy) - work)) < kinks
    if variant == "limited_effort":  # all panels but those with a switch
        assert np.sum(np.abs(np.diff(energy) - work) > 1e-14) <= 8


def test_error_obeys_its_linear_equation() -> None:
    """e'' + Kd e' + Kp e + w = 0, w' = Ki e: by eigenvalues, for a start off the trajectory."""
    gains = {"1": (400.0, 40.0, 500.0), "2": (150.0, 18.0, 0.0)}
    parameters = {"controller.tau1_max": 1e9, "controller.f2_max": 1e9}
    for joint, values in gains.items():
        for name, value in zip(("Kp", "Kd", "Ki"), values, strict=True):
            parameters[f"controller.{name}{joint}"] = value
    times = 1.0 + np.arange(101) / 50
    on = monolithic({}, times)
    off = np.array([0.1, -0.05, 0.3, 0.2, 4.0, -3.0])  # of the errors, and the integral parts
    state = [float(on[f"trajectory.{n}"][0]) - o for n, o in zip(equations.REFERENCES, off[:4])]  # noqa: B905
    column = monolithic(parameters, times, [*state, *off[4:]])
    for i, (joint, (Kp, Kd, Ki)) in enumerate(gains.items()):
        system = np.array([[0, 1, 0], [-Kp, -Kd, -1], [Ki, 0, 0]])
        values, vectors = np.linalg.eig(system)
        weight = np.linalg.solve(vectors, off[i::2])
        exact = (vectors @ (weight[:, None] * np.exp(np.outer(values, times - 1.0)))).real
        for name, row in zip((f"q{joint}_error", f"dq{joint}_error"), exact[:2], strict=True):
            assert np.max(np.abs(column[f"controller.{name}"] - row)) < 1e-11
        assert np.max(np.abs(column[f"controller.integral{joint}"] - exact[2])) < 1e-10


def test_started_anywhere_the_motion_goes_on() -> None:
    """In the middle of a saturated stretch, and of a segment, to any grid of times."""
    parameters = VARIANTS["limited_effort"]
    whole = monolithic(parameters, np.arange(251) / 50)
    rows = slice(60, 251, 19)
    state = [whole[name][60] for name in STATE]
    part = monolithic(parameters, (np.arange(251) / 50)[rows], state)
    for name in COLUMNS:
        assert np.max(np.abs(part[name] - whole[name][rows])) < 1e-15, name


# -- sampled system --


@pytest.mark.parametrize("order", closed_loop.ORDERS)
def test_sampled_tends_to_monolithic_with_slope_one(order: str) -> None:
    parameters = VARIANTS["heavy_payload_integral"] | {"trajectory.start_time": 0.0}
    errors = []
    for per_second in (250, 500, 1000, 2000):
        times = np.arange(per_second + 1) / per_second
        exact = monolithic(parameters, times[:: per_second // 50])
        stepped = sampled(parameters, times, order=order)
        errors.append(
            max(
                np.max(np.abs(stepped[name][:: per_second // 50] - exact[name]))
                for name in STATE[:4]
            )
        )
    slopes = np.diff(-np.log2(np.array(errors, float)))
    assert np.all(np.abs(slopes - 1) < 0.1), (errors, slopes)


def test_rows_are_read_before_or_after_inputs_are_set() -> None:
    """Both readings are of the same motion; what was known to the controller differs."""
    times = np.arange(601) / 1000
    parameters = VARIANTS["heavy_payload_integral"] | {"trajectory.start_time": 0.0}
    before = sampled(parameters, times)
    after = sampled(parameters, times, read="after")
    same = [n for n in COLUMNS if n in STATE or n.startswith("trajectory.")]
    assert largest(before, after, tuple(same)) == 0
    for name in closed_loop.ERRORS:
        known = after[f"controller.{name}"]
        assert np.array_equal(before[f"controller.{name}"][1:], known[:-1])
        coordinate = name.removesuffix("_error")
        exact = after[f"trajectory.{coordinate}_ref"] - after[f"arm.{coordinate}"]
        assert np.array_equal(known, exact)
    assert_power_is_of(before, before, slice(None, -1))
    assert_power_is_of(after, before, slice(1, None))


def assert_power_is_of(column: Columns, commands: Columns, efforts: slice) -> None:
    """Whether the arm's power is that of these rows of the controller's efforts."""
    pairs = ("tau1", "dq1"), ("f2", "dq2")
    power = sum(commands[f"controller.{n}"][efforts] * column[f"arm.{v}"][1:] for n, v in pairs)
    assert np.max(np.abs(column["arm.actuator_power"][1:] - power)) < 1e-17


@pytest.mark.parametrize(("order", "newest"), [("gauss_seidel", 0), ("gauss_seidel_arm_first", 1)])
def test_gauss_seidel_gives_the_newest_outputs(order: str, newest: int) -> None:
    """To the controller always the new reference; the new motion only where the arm steps first."""
    times = np.arange(601) / 1000
    parameters = VARIANTS["heavy_payload_integral"] | {"trajectory.start_time": 0.0}
    column = sampled(parameters, times, order=order)
    measured = slice(1, None) if newest else slice(None, -1)
    for name in ("q1", "q2", "dq1", "dq2"):
        error = column[f"trajectory.{name}_ref"][1:] - column[f"arm.{name}"][measured]
        assert np.array_equal(column[f"controller.{name}_error"][1:], error)
    assert_power_is_of(column, column, slice(None, -1) if newest else slice(1, None))


# -- files --


@pytest.mark.long
@pytest.mark.parametrize("variant", VARIANTS)
def test_made_again_is_the_same(variant: str) -> None:
    made = make_references.make(VARIANTS[variant])
    assert {path.name for path in (FOLDER / variant).iterdir()} == set(FILES) == set(made)
    for file, (times, columns) in made.items():
        path = FOLDER / variant / file
        kept = read_csv(path)
        assert list(kept) == ["time", *COLUMNS]
        old = np.array([*kept.values()])
        assert path.stat().st_size < 1_000_000 and path.read_text().startswith('"time","traj')
        new = np.array([times, *(columns[name] for name in COLUMNS)], float)
        assert old.shape == new.shape and np.array_equal(old[0], times)
        scale = np.maximum(1, np.max(np.abs(old), axis=1, keepdims=True))
        assert np.max(np.abs(new - old) / scale) < 1e-12, file


def test_experiment_is_that_of_the_system() -> None:
    given = tomllib.loads((ROOT / "models" / "closed_loop" / "loop.toml").read_text())
    assert given["stop"] == make_references.STOP
    assert given["step"] == 1 / make_references.STEPS_PER_SECOND


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"arm.m9": 1.0}, "no parameter 'arm.m9'"),
        ({"arm.m2": np.nan}, "arm.m2: nan is no finite number"),
        ({"trajectory.motion": "spiral"}, "trajectory.motion: no 'spiral'"),
    ],
)
def test_bad_parameters_are_refused(parameters: dict, message: str) -> None:
    with pytest.raises(UserError, match=message):
        monolithic(parameters, [0.0, 1.0])
