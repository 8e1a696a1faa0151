"""The drawings of the playground: hands that pull at the arm, what is seen, and how it looks."""

import re
from pathlib import Path

import pytest
from pytest import approx
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from tests.playground.opened_page import OpenedPage, choose, click
from tests.support.browser import Browser

# ---- Hands


def drag_place(opened: OpenedPage) -> tuple[float, float]:
    """Where the end effector is in the view, px."""
    return tuple(opened.run(
        "const canvas = document.getElementById('stage');"
        "canvas.scrollIntoView();"
        "const box = canvas.getBoundingClientRect(), [x, y] = simulation.tip.get();"
        "const at = Arm.toPixel(window.tested.stage.view, [x, y]);"
        "return [box.left + at[0], box.top + at[1]]"
    ))  # fmt: skip


def test_drag_by_mouse(opened: OpenedPage) -> None:
    x, y = (round(number) for number in drag_place(opened))
    mouse = ActionChains(opened.browser.driver, duration=0).w3c_actions
    mouse.pointer_action.move_to_location(x, y).pointer_down().move_to_location(x - 60, y + 150)
    mouse.perform()
    opened.run("simulation.step()")
    fx, fy = opened.value("ee_fx"), opened.value("ee_fy")
    assert fx < -1 and fy < -1
    opened.browser.driver.execute_cdp_cmd(
        "Input.dispatchMouseEvent",
        {"type": "mouseReleased", "x": x - 60, "y": y + 150, "button": "left", "clickCount": 1},
    )
    mouse.clear_actions()
    opened.run("simulation.step()")
    assert (opened.value("ee_fx"), opened.value("ee_fy")) == (0, 0)


def touch(opened: OpenedPage, kind: str, *points: tuple[float, float]) -> None:
    opened.browser.driver.execute_cdp_cmd(
        "Input.dispatchTouchEvent",
        {"type": kind, "touchPoints": [{"x": px, "y": py} for px, py in points]},
    )


def test_drag_by_touch(opened: OpenedPage) -> None:
    x, y = drag_place(opened)
    touch(opened, "touchStart", (x, y))
    for way in range(10, 60, 10):  # far enough for a page to scroll
        touch(opened, "touchMove", (x + way, y - way))
    opened.run("simulation.step()")
    assert opened.value("ee_fx") > 1
    assert opened.value("ee_fy") == approx(opened.value("ee_fx"), rel=1e-6)
    touch(opened, "touchEnd")
    opened.run("simulation.step()")
    assert (opened.value("ee_fx"), opened.value("ee_fy")) == (0, 0)


def test_a_finger_elsewhere_scrolls(opened: OpenedPage) -> None:
    x, y = drag_place(opened)
    before = opened.browser.run("return scrollY")
    for kind, way in (("touchStart", 0), ("touchMove", 30), ("touchMove", 60), ("touchMove", 120)):
        touch(opened, kind, (x - 150, y + 150 - way))
    touch(opened, "touchEnd")
    opened.browser.wait(f"scrollY > {before}")
    opened.run("simulation.step()")
    assert (opened.value("ee_fx"), opened.value("ee_fy")) == (0, 0)


def test_push_by_keys(opened: OpenedPage) -> None:
    opened.browser.run("document.getElementById('stage').focus()")
    driver = opened.browser.driver
    ActionChains(driver).key_down(Keys.ARROW_UP).key_down(Keys.ARROW_LEFT).perform()
    opened.run("simulation.step()")
    assert (opened.value("ee_fx"), opened.value("ee_fy")) == (-20, 20)
    ActionChains(driver).key_up(Keys.ARROW_UP).key_up(Keys.ARROW_LEFT).perform()
    opened.run("simulation.step()")
    assert (opened.value("ee_fx"), opened.value("ee_fy")) == (0, 0)


def test_keys_of_the_drawing(opened: OpenedPage) -> None:
    opened.run("for (let n = 0; n < 400; n++) simulation.step()")
    before = opened.run("return simulation.steps")
    opened.browser.keys("#stage", Keys.BACKSPACE)
    assert before - 250 <= opened.run("return simulation.steps") <= before - 200
    opened.browser.keys("#stage", " ")
    assert opened.text("#play") == "Pause"
    opened.browser.keys("#stage", " ")
    assert opened.text("#play") == "Play"


# ---- Looks


@pytest.mark.parametrize("reduced", [False, True])
def test_it_runs_at_once_unless_motion_is_unwanted(
    each_browser: Browser, page: Path, reduced: bool
) -> None:
    assert OpenedPage(each_browser, page, reduced_motion=reduced).was_running != reduced


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [400, 1200])
def test_readable(each_browser: Browser, page: Path, width: int, dark: bool) -> None:
    """No overflow and nothing that axe-core finds, with all groups open and a message shown."""
    opened = OpenedPage(each_browser, page, width=width, dark=dark)
    opened.run("document.querySelectorAll('details').forEach(it => { it.open = true; });"
               "window.tested.say('a message '.repeat(30))")  # fmt: skip
    assert each_browser.overflow() == 0
    assert each_browser.violations() == []
    each_browser.check_quiet()


def test_units_are_written_one_way(opened: OpenedPage) -> None:
    opened.run("document.querySelectorAll('details').forEach(it => { it.open = true; })")
    text = opened.browser.run("return document.querySelector('main').innerText")
    assert "N·m" in text and "kg·m²" in text and "m/s²" in text
    assert not re.search(r"N\.m|kg\.m|/s2", text)


def test_the_drawing_follows(opened: OpenedPage) -> None:
    """The picture of the arm and the chart change while it runs, and have more than one colour."""
    picture = "return [...document.querySelectorAll('canvas')].map(canvas => canvas.toDataURL())"
    opened.run("for (let n = 0; n < 50; n++) simulation.step(); window.tested.stage.draw()")
    first = opened.run(picture)
    choose(opened, "#speed", "4")
    click(opened, "#play")
    opened.browser.wait("window.tested.simulation.time > 1.5")
    second = opened.run(picture)
    assert all(early != late for early, late in zip(first, second, strict=True))
    assert opened.call("coloursOfStage") > 20
