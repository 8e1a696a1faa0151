"""The machine in continuous time: made again, and solved once more by hand."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from rparm.models.machine import continuous
from rparm.models.machine.continuous import SMALLEST, VARIANTS
from rparm.models.machine.references.machine import completed
from rparm.models.machine.references.make_references import variants
from rparm.models.machine.references.monolithic import COLUMNS, monolithic
from scipy.integrate import solve_ivp

from rparm.errors import UserError

STATES = ("plant.q1", "plant.q2", "plant.dq1", "plant.dq2")
CURRENTS = ("actuator.current1", "actuator.current2")

# times in s between which the motion is smooth: grasp, blending in and out of the circle, release
CORNERS = (0.0, 0.2005, 0.4, 1.4, 2.4, 3.4, 3.7005, 4.0)
TURN = -2 * math.pi * 0.125  # rad/s


def progress(time: float) -> tuple[float, float, float]:
    """Of the motion on the circle with its two derivatives, s, 1 and 1/s: ramps of 1 s."""
    if time < 0.4:
        return 0.0, 0.0, 0.0
    if time < 1.4:
        x = time - 0.4
        blend = 10 * x**3 - 15 * x**4 + 6 * x**5
        return 2.5 * x**4 - 3 * x**5 + x**6, blend, 30 * x**2 - 60 * x**3 + 30 * x**4
    if time < 2.4:
        return 0.5 + time - 1.4, 1.0, 0.0
    if time < 3.4:  # the first ramp backwards
        at, rate, bend = progress(0.4 + 3.4 - time)
        return 2.0 - at, rate, -bend
    return 2.0, 0.0, 0.0


def blocks(state: Sequence[float], payload: float) -> tuple[float, ...]:
    """D11, D12, D22, and Coriolis with gravity forces: sums over bodies at (X, Y) in link 1."""
    q1, q2, dq1, dq2 = state[:4]
    cosine, sine = math.cos(q1), math.sin(q1)
    D11, D12, D22, force1, force2 = 0.1 + 2 * 0.25**2, 0.0, 0.0, 9.81 * 2 * 0.25 * cosine, 0.0
    for m, inertia, X, Y in (
        (1.0, 0.05, 0.5 + q2, 0.1),
        (payload, 0.004 * payload, 0.5 + q2 + 0.05, 0.1 + 0.02),
    ):
        D11 += inertia + m * (X**2 + Y**2)
        D12 -= m * Y
        D22 += m
        force1 += 2 * m * X * dq1 * dq2 + 9.81 * m * (X * cosine - Y * sine)
        force2 += 9.81 * m * sine - m * X * dq1**2
    return D11, D12, D22, force1, force2


def rates(time: float, state: Sequence[float], carried: float, known: float) -> list[float]:
    """The differential equation: gains 400 and 40, motors of 1 ms, 5 N.m/A and 10 pi N/A."""
    q1, q2, dq1, dq2, current1, current2 = state
    at, rate, bend = progress(time)
    wanted1 = TURN * bend + 40 * (TURN * rate - dq1) + 400 * (TURN * at - q1)
    wanted2 = -40 * dq2 - 400 * q2
    D11, D12, D22, force1, force2 = blocks(state, known)
    command1 = (D11 * wanted1 + D12 * wanted2 + force1) / 5.0
    command2 = (D12 * wanted1 + D22 * wanted2 + force2) / (10 * math.pi)
    D11, D12, D22, force1, force2 = blocks(state, carried)
    left1, left2 = 5.0 * current1 - force1, 10 * math.pi * current2 - force2 - 20.0 * dq2
    determinant = D11 * D22 - D12 * D12
    ddq1 = (D22 * left1 - D12 * left2) / determinant
    ddq2 = (D11 * left2 - D12 * left1) / determinant
    return [dq1, dq2, ddq1, ddq2, (command1 - current1) / 1e-3, (command2 - current2) / 1e-3]


@pytest.mark.parametrize("variant", VARIANTS)
def test_two_derivations_and_integrators_agree(variant: str) -> None:
    """Against the equations by hand above, by scipy's DOP853."""
    expected = continuous.reference(variant)
    is_known = float(variant == "pick_and_place")
    state, rows = np.zeros(6), [np.zeros((6, 1))]
    for begin, end in zip(CORNERS, CORNERS[1:], strict=False):
        carried = float(CORNERS[1] <= begin < CORNERS[-2])
        inside = expected["time"][(expected["time"] > begin) & (expected["time"] <= end)]
        times = sorted({*inside, end})
        found = solve_ivp(
            lambda t, y, *masses: rates(t, y.tolist(), *masses),
            (begin, end), state, "DOP853", times,
            args=(carried, is_known * carried), rtol=1e-13, atol=1e-14,
        )  # fmt: skip
        assert found.success
        rows.append(found.y[:, : len(inside)])
        state = found.y[:, -1]
    for name, row in zip((*STATES, *CURRENTS), np.hstack(rows), strict=True):
        scale = max(np.abs(expected[name]).max(), SMALLEST)
        np.testing.assert_allclose(row, expected[name], rtol=0, atol=1e-9 * scale, err_msg=name)


@pytest.mark.parametrize("variant", VARIANTS)
def test_made_again_it_is_the_same(variant: str) -> None:
    expected = continuous.reference(variant)
    assert set(expected) == {"time", *COLUMNS}
    times = expected["time"][:60]
    assert times[-1] > 1.0
    for name, column in monolithic(variants()[variant], times).items():
        scale = max(np.abs(expected[name]).max(), 1e-3)
        assert np.abs(column - expected[name][:60]).max() <= 1e-13 * scale, name


def test_accelerations_are_those_of_the_equations_by_hand() -> None:
    """At the rows after the release."""
    c = continuous.reference("pick_and_place")
    for row in np.flatnonzero(c["time"] > CORNERS[-2]):
        state = [float(c[f"{n}"][row]) for n in (*STATES, *CURRENTS)]
        found = rates(float(c["time"][row]), state, 0.0, 0.0)[2:4]
        wanted = [c["plant.ddq1"][row], c["plant.ddq2"][row]]
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plant.coulomb_friction1": 0.1}, r"plant\.coulomb_friction1 has to be 0"),
        ({"controller.Ki2": 1.0}, r"controller\.Ki2 has to be 0"),
        ({"controller.mode": 1}, r"controller\.mode keeps its default"),
        ({"environment.position": 0.6}, r"the wall is touched"),
        ({"controller.tau1_max": 5.0}, r"controller\.tau1 reaches its limit 5\.0"),
        ({"actuator.voltage_max1": 0.1}, r"actuator\.voltage1 reaches its limit 0\.1"),
    ],
)
def test_what_the_equations_do_not_have_is_refused(changes: dict[str, float], message: str) -> None:
    with pytest.raises(UserError, match=message):
        monolithic(variants()["pick_and_place"] | changes, [0.0, 0.1, 0.3])


def test_times_must_ascend_from_0() -> None:
    for times in ([], [0.1, 0.2], [0.0, 0.2, 0.2]):
        with pytest.raises(UserError, match="times must ascend from 0"):
            monolithic(variants()["pick_and_place"], times)


def test_the_values_by_hand_are_those_of_the_variant() -> None:
    """What the equations above have as numbers."""
    values = completed(variants()["pick_and_place"])
    plant, actuator = values["plant"], values["actuator"]
    assert [plant[n] for n in ("m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g")] == [
        2.0, 1.0, 0.1, 0.05, 0.5, 0.25, 0.1, 9.81
    ]  # fmt: skip
    force = [actuator[f"torque_constant{i}"] * actuator[f"gear_ratio{i}"] for i in (1, 2)]
    assert force == pytest.approx([5.0, 10 * np.pi], rel=1e-15)
