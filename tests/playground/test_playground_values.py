"""Values in the playground: what the FMUs refuse changes nothing, and the page says why."""

import math

import pytest
from selenium.webdriver.common.keys import Keys

from tests.playground.native import Native
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
