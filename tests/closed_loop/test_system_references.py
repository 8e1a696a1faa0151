"""The references of the closed loop: physics, closed forms, made again.

test_coupling.py compares them with the FMUs, with every law and at the limits of the efforts.
"""

import tomllib

import numpy as np
import pytest
from rparm.models.closed_loop.references import closed_loop, equations, make_references
from rparm.models.closed_loop.references.closed_loop import (
    COLUMNS,
    STATE,
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


# -- equations --


def test_columns_are_the_outputs_of_the_models() -> None:
    outputs = [
        f"{component}.{name}"
        for component, folder in closed_loop.COMPONENTS.items()
        for name in declared(folder).real_outputs
    ]
    assert list(COLUMNS) == [*outputs, "controller.integral1", "controller.integral2"]


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
