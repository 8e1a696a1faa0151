"""Values in the playground: the bits of the native FMUs; what they refuse changes nothing."""

import math

import numpy as np
import pytest
from selenium.webdriver.common.keys import Keys

from tests.playground.native import INPUTS, OUTPUTS, Native, coupled_trajectory
from tests.playground.opened_page import OpenedPage, choose, click, find, type_number

# as the page's first scene has it
FRICTION = {"coulomb_friction1": 0.4, "breakaway_friction1": 0.8, "stribeck_velocity1": 0.1}


def test_a_refused_value_shows_the_message(opened: OpenedPage, plant: Native) -> None:
    type_number(opened, "plant-m2", "-1")
    said = plant.refusal({}, "m2", -1.0)
    assert "m2 = -1" in said
    assert opened.text("#message") == f"RPPlant refuses m2 = -1:\n{said}"
    assert opened.value("m2") == 1
    assert find(opened, "#plant-m2 + input").get_property("value") == "1"
    steps = opened.run("simulation.step(); return simulation.steps")
    assert steps > 0
    type_number(opened, "plant-m2", "3")
    assert find(opened, "#message").get_property("hidden")
    assert opened.value("m2") == 3


def test_values_that_do_not_fit_are_refused(opened: OpenedPage, plant: Native) -> None:
    type_number(opened, "plant-coulomb_friction1", "5")
    said = plant.refusal(FRICTION, "coulomb_friction1", 5.0)
    assert opened.text("#message").endswith(f"\n{said}")
    assert opened.value("coulomb_friction1") == 0.4


def test_a_refused_choice_goes_back(opened: OpenedPage, plant: Native) -> None:
    choose(opened, "#plant-stops1", "compliant")
    said = plant.refusal({}, "stops1", 3)
    assert opened.text("#message") == f"RPPlant refuses stops1 = compliant:\n{said}"
    assert find(opened, "#plant-stops1").get_property("value") == "1"


@pytest.mark.parametrize(
    ("identifier", "value"), [("plant-m1", "2"), ("plant-damping1", "0.1"), ("efforts-tau1", "0")]
)
def test_an_emptied_field_has_its_value_again(
    opened: OpenedPage, identifier: str, value: str
) -> None:
    type_number(opened, identifier, Keys.BACKSPACE)
    assert find(opened, f"#{identifier} + input").get_property("value") == value
    name = identifier.partition("-")[2]
    assert opened.text("#message") == f"{name} must be a number: it is still {value}"
    type_number(opened, identifier, "3")
    assert find(opened, "#message").get_property("hidden")


def refused(opened: OpenedPage, variable: str) -> bool:
    """Whether the message names the variable and has what the FMU says."""
    head, _, said = opened.text("#message").partition("\n")
    return head.startswith(f"RPPlant refuses {variable} = 1e+300:") and "step from t = " in said


def test_an_effort_that_is_too_large_is_refused(opened: OpenedPage) -> None:
    """As soon as it is typed: nothing changes, and the arm moves on."""
    numbers = "return [simulation.steps, plant.get('q1'), plant.get('solver_steps')]"
    for name in ("tau1", "f2"):
        before = opened.run(numbers)
        type_number(opened, f"efforts-{name}", "1e300")
        assert refused(opened, name)
        assert find(opened, f"#efforts-{name} + input").get_property("value") == "0"
        assert opened.run(numbers) == before
        type_number(opened, f"efforts-{name}", "2")
        assert find(opened, "#message").get_property("hidden")
        assert opened.run("return simulation.efforts")[name == "f2"] == 2
    opened.run("for (let n = 0; n < 50; n++) simulation.step()")
    assert opened.value("tau1") == 2


def test_a_set_point_that_is_too_far_is_refused(opened: OpenedPage) -> None:
    """Where the controller has no limits; while it is off, by turning it on, and it stays off."""
    opened.run("simulation.change('controller', 'tau1_max', 1e300)")
    choose(opened, "#law", "pd")
    type_number(opened, "set-point-q1_ref", "1e300")
    assert refused(opened, "q1_ref")
    assert opened.run("return simulation.reference") == [0, 0]
    choose(opened, "#law", "off")
    assert find(opened, "#message").get_property("hidden")
    type_number(opened, "set-point-q1_ref", "1e300")
    choose(opened, "#law", "pd")
    assert opened.text("#message").startswith("RPPlant refuses mode = pd:\n")
    assert find(opened, "#law").get_property("value") == "0"
    assert not opened.run("return simulation.isControlled")


def test_a_step_that_fails_says_so(opened: OpenedPage) -> None:
    """The page goes back to the last state that it kept, and stops."""
    opened.run("for (let n = 0; n < 120; n++) simulation.step();"
               "simulation.efforts[0] = 1e300; window.tested.play(true)")  # fmt: skip
    opened.browser.wait("!document.getElementById('message').hidden")
    assert not opened.run("return window.tested.isRunning")
    assert math.isfinite(opened.value("q1"))
    opened.run("simulation.efforts[0] = 0")
    click(opened, "#play")
    opened.browser.wait("window.tested.simulation.steps > 150")
    assert find(opened, "#message").get_property("hidden")


def test_method_and_controller(opened: OpenedPage) -> None:
    for name, value in (("cvode_bdf", 2), ("erk", 3), ("taylor", 4), ("cvode_adams", 1)):
        opened.run("for (let n = 0; n < 20; n++) simulation.step()")
        before = opened.run("return [simulation.time, plant.get('q1'), plant.get('dq2')]")
        choose(opened, "#plant-solver_method", name)
        assert opened.value("solver_method") == value
        assert opened.run("return [simulation.time, plant.get('q1'), plant.get('dq2')]") == before
    choose(opened, "#law", "computed_torque")
    type_number(opened, "set-point-q1_ref", "0.5")
    type_number(opened, "set-point-q2_ref", "0.1")
    opened.run("for (let n = 0; n < 3000; n++) simulation.step()")
    # friction, of which the controller knows nothing, keeps it off
    assert abs(opened.value("q1") - 0.5) < 0.05
    assert abs(opened.value("q2") - 0.1) < 0.05
    choose(opened, "#law", "off")
    opened.run("for (let n = 0; n < 3000; n++) simulation.step()")
    assert opened.value("q1") < -1


# ---- The bits of the native FMUs -----------------------------------------------------------------


STEPS = 2000  # of 1 ms
METHODS = {"cvode_adams": 1, "cvode_bdf": 2, "erk": 3, "taylor": 4}
# a swing with dry friction that holds, and impacts
PLANT = {
    "q1": 0.9, "dq1": -1.0, "damping1": 0.1, "coulomb_friction1": 0.4, "breakaway_friction1": 0.8,
    "stribeck_velocity1": 0.1, "coulomb_friction2": 2.0, "breakaway_friction2": 4.0,
    "stribeck_velocity2": 0.05, "stops2": 2, "lower2": -0.2, "upper2": 0.35, "restitution2": 0.4,
}  # fmt: skip


def efforts(columns: int) -> np.ndarray:
    """Rows (STEPS, columns) of inputs that change all the time, and stay for a while."""
    t = 1e-3 * np.arange(STEPS)
    rows = np.column_stack([(3.0 - i) * np.sin((5.0 + 2.0 * i) * t + i) for i in range(columns)])
    rows[700:1100] = rows[700]
    return rows


@pytest.mark.parametrize("method", METHODS)
def test_plant(opened: OpenedPage, plant: Native, method: str) -> None:
    values = PLANT | {"solver_method": METHODS[method]}
    inputs = efforts(len(INPUTS))
    expected = plant.trajectory(values, inputs)
    found = opened.doubles("trajectory", values, inputs.tolist(), OUTPUTS, INPUTS)
    assert len(expected) == 8 * STEPS * len(OUTPUTS)
    assert found == expected
    numbers = np.frombuffer(found).reshape(STEPS, -1)
    assert np.isfinite(numbers).all()
    assert len(np.unique(numbers[:, 0])) > 0.9 * STEPS  # it moves


@pytest.mark.parametrize("method", METHODS)
def test_serialized_state(opened: OpenedPage, plant: Native, method: str) -> None:
    """All that an instance keeps, the integrator's history too, has the same bytes."""
    values = PLANT | {"solver_method": METHODS[method]}
    inputs = efforts(len(INPUTS))[:300]
    expected = plant.state(values, inputs)
    found = bytes(opened.call("serialized", values, inputs.tolist(), OUTPUTS, INPUTS))
    assert len(expected) > 1000
    assert found == expected


@pytest.mark.parametrize(
    "controller_values",
    [{}, {"mode": 1, "Ki1": 200.0, "Ki2": 200.0, "tau1_max": 12.0}, {"sample_time": 0.007}],
    ids=["computed_torque", "pd", "sampled"],
)
def test_plant_and_controller(
    opened: OpenedPage, plant: Native, controller: Native, controller_values: dict[str, float]
) -> None:
    values = {"plant": PLANT, "controller": controller_values}
    reference, added = (0.6, 0.15), efforts(2)
    expected = coupled_trajectory(plant, controller, values, reference, added)
    assert opened.doubles("coupled", values, reference, added.tolist(), OUTPUTS) == expected


def test_drag(opened: OpenedPage, plant: Native) -> None:
    """What the hand makes of its pull is what the native FMU makes of the same forces."""
    found = np.frombuffer(opened.doubles("dragged", {"plant": PLANT}, OUTPUTS, INPUTS))
    inputs = found[: 1000 * len(INPUTS)].reshape(1000, -1)
    forces = np.hypot(inputs[:, 2], inputs[:, 3])
    assert forces[100] > 10 and (forces[:100] == 0).all() and (forces[700:] == 0).all()
    assert plant.trajectory(PLANT, inputs) == found[1000 * len(INPUTS) :].tobytes()


@pytest.mark.parametrize("way", ["saved", "kept", "method"])
def test_back_in_time(opened: OpenedPage, way: str) -> None:
    """A saved state, a kept one, and one from before a change of the method give the bits back."""
    numbers = opened.doubles("again", {"plant": PLANT, "controller": {}}, OUTPUTS, way)
    half = len(numbers) // 2
    assert half == 8 * 500 * len(OUTPUTS)
    assert numbers[:half] == numbers[half:]
    angles = np.frombuffer(numbers[:half]).reshape(500, -1)[:, 0]
    assert len(np.unique(angles)) > 400  # it moves until friction holds it
