"""The page of the playground: what it shows and how it is used."""

import math
from pathlib import Path

import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from tests.playground.native import Native
from tests.playground.opened_page import OpenedPage
from tests.support.browser import Browser

LARGEST = 1_500_000  # bytes

# as the page's first scene has it
FRICTION = {"coulomb_friction1": 0.4, "breakaway_friction1": 0.8, "stribeck_velocity1": 0.1}


def find(opened: OpenedPage, selector: str):
    return opened.browser.driver.find_element(By.CSS_SELECTOR, selector)


def click(opened: OpenedPage, selector: str) -> None:
    opened.browser.run("document.querySelector(arguments[0]).click()", selector)


def choose(opened: OpenedPage, selector: str, text: str) -> None:
    opened.browser.run(
        "const box = document.querySelector(arguments[0]);"
        "box.value = [...box.options].find(option => option.text === arguments[1]).value;"
        "box.dispatchEvent(new Event('change'))",
        selector,
        text,
    )


def type_number(opened: OpenedPage, identifier: str, text: str) -> None:
    """Type a value into the number field beside a slider."""
    opened.browser.run("document.querySelectorAll('details').forEach(it => { it.open = true; })")
    field = find(opened, f"#{identifier} + input")
    field.send_keys(Keys.CONTROL + "a")
    field.send_keys(text, Keys.ENTER)


# ---- Running


def test_size(page: Path) -> None:
    assert page.stat().st_size < LARGEST
    assert [path.name for path in page.parent.iterdir()] == ["index.html"]


def test_licenses(opened: OpenedPage) -> None:
    """Of all whose code is in the modules, as they ask for."""
    text = opened.text("#licenses")
    for name in ("Lawrence Livermore", "Rich Felker", "Zig contributors", "wasi-libc", "cloudlibc"):
        assert name in text


def test_ten_seconds_have_finite_energy(opened: OpenedPage) -> None:
    """At real time, ten times as fast; without efforts friction and impacts only take energy."""
    choose(opened, "#speed", "10")
    opened.run("""
        window.tested.reset();
        window.rows = [];
        const {chart} = window.tested, add = chart.add.bind(chart);
        chart.add = time => {
          window.rows.push([time, ...chart.energies.get()]);
          add(time);
        };
        window.tested.play(true);
    """)
    opened.browser.wait("window.tested.simulation.time >= 10", 30)
    rows = opened.run("return window.rows")
    assert rows[-1][0] >= 9.99 and len(rows) >= 990
    assert all(math.isfinite(number) for row in rows for number in row)
    totals = [total for *_, total in rows]
    assert all(late <= early + 1e-9 for early, late in zip(totals, totals[1:], strict=False))
    assert totals[-1] < totals[0] - 1  # J
    assert opened.text("#message") == ""


def test_play_pause_and_reset(opened: OpenedPage) -> None:
    paused = opened.run("return simulation.time")
    assert opened.text("#play") == "Play"
    click(opened, "#play")
    opened.browser.wait(f"window.tested.simulation.time > {paused} + 0.2")
    click(opened, "#play")
    stopped = opened.run("return simulation.steps")
    assert opened.run("window.tested.stage.draw(); return simulation.steps") == stopped
    click(opened, "#reset")
    assert opened.run("return simulation.time") == 0
    assert opened.value("q1") == 0.9
    choose(opened, "#setting", "Horizontal plane")
    assert (opened.value("g"), opened.value("dq1")) == (0, 3)


SETTINGS = ("law", "plant-solver_method", "plant-m1", "controller-Kp1")
INPUTS = ("efforts-tau1", "efforts-f2", "set-point-q1_ref", "set-point-q2_ref")


def shown(opened: OpenedPage) -> list[str]:
    """What the controls show."""
    return opened.browser.run(
        "return arguments[0].map(id => document.getElementById(id).value)", SETTINGS + INPUTS
    )


def test_reset_brings_all_back(opened: OpenedPage) -> None:
    """Controller, set point, efforts and parameters."""
    numbers = "return [...simulation.motion.get(), ...simulation.inputs.get()]"
    motion = "for (let n = 0; n < 50; n++) simulation.step();" + numbers
    click(opened, "#reset")
    at_first, moved = shown(opened), opened.run(motion)
    choose(opened, "#law", "pd")
    choose(opened, "#plant-solver_method", "taylor")
    for identifier in (*INPUTS, "plant-m1", "controller-Kp1"):
        type_number(opened, identifier, "0.3")
    opened.run(motion)
    assert all(early != late for early, late in zip(at_first, shown(opened), strict=True))
    click(opened, "#reset")
    assert shown(opened) == at_first
    assert opened.run("return controller.get('mode')") == 3  # its start value
    assert opened.run(motion) == moved


def test_benchmark(opened: OpenedPage, capsys: pytest.CaptureFixture[str]) -> None:
    """It measures, and leaves everything as it was; the figure is printed."""
    lines = []
    # without friction nothing comes to rest, where a step costs nothing
    choose(opened, "#setting", "Without friction")
    for text in ("off", "computed_torque"):
        choose(opened, "#law", text)
        before = opened.run("return [simulation.time, plant.get('q1'), plant.get('solver_steps')]")
        result = opened.run("return window.tested.benchmark()")
        after = opened.run("return [simulation.time, plant.get('q1'), plant.get('solver_steps')]")
        assert before == after
        assert result["factor"] == pytest.approx(1e-3 / result["step"])
        lines.append(f"controller {text}: {result['factor']:.0f} times real time")
    with capsys.disabled():
        print(f"\nplayground, steps of 1 ms in Chromium, without drawing: {'; '.join(lines)}")
    click(opened, "#measure")
    assert "times real time" in opened.text("#factor")


def test_a_benchmark_that_fails(opened: OpenedPage) -> None:
    """Some steps on, the force is too large: all is as before, and nothing leaks."""
    click(opened, "#reset")
    state = "return [simulation.steps, ...simulation.motion.get(), simulation.efforts[0]]"
    before = opened.run(state)
    result = opened.run("""
        const {advance, save, free} = simulation, end = simulation.steps + 100;
        let count = 0;
        simulation.save = () => { count++; return save.call(simulation); };
        simulation.free = saved => { count--; free.call(simulation, saved); };
        simulation.advance = () => {
          if (simulation.steps === end) simulation.efforts[0] = 1e300;
          advance.call(simulation);
        };
        document.getElementById('measure').click();
        Object.assign(simulation, {advance, save, free});
        return count;
    """)
    assert result == 0
    assert opened.run(state) == before
    head, said = opened.text("#message").split("\n", 1)
    assert head == "The speed cannot be measured from here:"
    assert said
    assert opened.text("#factor") == ""


# ---- Values


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


# ---- Back in time


def test_save_and_restore(opened: OpenedPage) -> None:
    assert find(opened, "#restore").get_property("disabled")
    type_number(opened, "efforts-tau1", "2.5")
    before = opened.run("return [simulation.time, plant.get('q1')]")
    click(opened, "#save")
    type_number(opened, "efforts-tau1", "7")
    type_number(opened, "plant-m1", "4")
    opened.run("for (let n = 0; n < 300; n++) simulation.step()")
    click(opened, "#reset")
    click(opened, "#restore")
    assert opened.run("return [simulation.time, plant.get('q1')]") == before
    values = [
        find(opened, f"#{identifier} + input").get_property("value")
        for identifier in ("efforts-tau1", "plant-m1")
    ]
    assert values == ["2.5", "2"]


def test_a_state_knows_its_scene(opened: OpenedPage) -> None:
    """Reset starts the scene of the state that was restored."""
    choose(opened, "#setting", "Horizontal plane")
    click(opened, "#save")
    choose(opened, "#setting", "Without friction")
    assert opened.value("g") > 9
    click(opened, "#restore")
    assert find(opened, "#setting").get_property("value") == "Horizontal plane"
    opened.run("for (let n = 0; n < 50; n++) simulation.step()")
    click(opened, "#reset")
    assert (opened.value("g"), opened.value("dq1")) == (0, 3)


def test_history(opened: OpenedPage) -> None:
    opened.run("""
        window.tested.reset();
        window.q1 = [];
        for (let n = 0; n <= 1000; n++) {
          window.q1.push(plant.get('q1'));
          simulation.step();
        }
        window.tested.show();
    """)
    opened.browser.run(
        "const slider = document.getElementById('history');"
        "slider.value = 0.5; slider.dispatchEvent(new Event('input'))"
    )
    assert opened.run("return simulation.steps") == 500
    assert opened.value("q1") == opened.run("return window.q1[500]")
    click(opened, "#back")
    assert opened.run("return simulation.steps") == 300
    assert opened.value("q1") == opened.run("return window.q1[300]")


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
    mouse.pointer_action.move_to_location(x, y).pointer_down().move_to_location(x - 40, y + 60)
    mouse.perform()
    opened.run("simulation.step()")
    fx, fy = opened.value("ee_fx"), opened.value("ee_fy")
    assert fx < -1 and fy < -1
    opened.browser.driver.execute_cdp_cmd(
        "Input.dispatchMouseEvent",
        {"type": "mouseReleased", "x": x - 40, "y": y + 60, "button": "left", "clickCount": 1},
    )
    mouse.clear_actions()
    opened.run("simulation.step()")
    assert (opened.value("ee_fx"), opened.value("ee_fy")) == (0, 0)


def touch(opened: OpenedPage, kind: str, *points: tuple[float, float]) -> None:
    opened.browser.driver.execute_cdp_cmd(
        "Input.dispatchTouchEvent",
        {"type": kind, "touchPoints": [{"x": px, "y": py} for px, py in points]},
    )


def is_seen(opened: OpenedPage, x: float, y: float, bars: float = 0) -> bool:
    """Whether a point (m), and what is `bars` widths of link 1 around it, is in the drawing."""
    return opened.run(
        "const {view} = window.tested.stage, [x, y] = Arm.toPixel(view, arguments);"
        "const around = arguments[2] * view.bar, bottom = view.height - view.strip;"
        "return [[x, view.width], [y, bottom]].every(([at, end]) => at >= around && at <= end - around)",
        x,
        y,
        bars,
    )


def test_the_view_follows_the_arm(opened: OpenedPage) -> None:
    """Without stops, joint 2 goes as far as it likes; the end effector can be taken there, too."""
    choose(opened, "#setting", "Horizontal plane")
    scale = opened.run("return window.tested.stage.view.scale")
    choose(opened, "#plant-stops2", "none")
    for force in ("40", "-40"):
        type_number(opened, "efforts-f2", force)
        opened.run("for (let n = 0; n < 5000; n++) simulation.step(); window.tested.stage.draw()")
        assert abs(opened.value("q2")) > 20
        assert is_seen(opened, opened.value("ee_x"), opened.value("ee_y"))
    x, y = (round(number) for number in drag_place(opened))
    mouse = ActionChains(opened.browser.driver, duration=0).w3c_actions
    mouse.pointer_action.move_to_location(x, y).pointer_down().move_to_location(x - 30, y)
    mouse.perform()
    opened.run("for (let n = 0; n < 10; n++) simulation.step(); window.tested.stage.draw()")
    assert opened.value("ee_fx") < -1
    held = opened.run(
        "const box = document.getElementById('stage').getBoundingClientRect();"
        "return Arm.toPixel(window.tested.stage.view, simulation.hand.target)"
        ".map((at, i) => at + [box.left, box.top][i])"
    )
    assert held == pytest.approx([x - 30, y])
    opened.browser.driver.execute_cdp_cmd(
        "Input.dispatchMouseEvent",
        {"type": "mouseReleased", "x": x - 30, "y": y, "button": "left", "clickCount": 1},
    )
    mouse.clear_actions()
    click(opened, "#reset")
    assert opened.run("return window.tested.stage.view.scale") == scale


def test_the_ends_of_link_2_are_in_the_view(opened: OpenedPage) -> None:
    """It is as long as joint 2 has room, from the collar of one stop to that of the other."""
    for scene in ("Friction and stops", "Horizontal plane"):
        choose(opened, "#setting", scene)
        l1, lower, upper = (opened.value(name) for name in ("l1", "lower2", "upper2"))
        far = l1 + upper - lower
        for x, y in ((far, 0), (-far, 0), (0, far), (0, -far)):
            assert is_seen(opened, x, y, bars=1.75)  # half a sleeve and a collar


def test_drag_by_touch(opened: OpenedPage) -> None:
    x, y = drag_place(opened)
    touch(opened, "touchStart", (x, y))
    for way in range(10, 60, 10):  # far enough for a page to scroll
        touch(opened, "touchMove", (x + way, y - way))
    opened.run("simulation.step()")
    assert opened.value("ee_fx") > 1 and opened.value("ee_fy") > 1
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
    browser: Browser, page: Path, reduced: bool
) -> None:
    assert OpenedPage(browser, page, reduced_motion=reduced).was_running != reduced


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [400, 1200])
def test_readable(browser: Browser, page: Path, width: int, dark: bool) -> None:
    """No overflow and nothing that axe-core finds, with all groups open and a message shown."""
    opened = OpenedPage(browser, page, width=width, dark=dark)
    opened.run("document.querySelectorAll('details').forEach(it => { it.open = true; });"
               "window.tested.say('a message '.repeat(30))")  # fmt: skip
    assert browser.overflow() == 0
    assert browser.violations() == []
    browser.check_quiet()


# boxes of the texts that the chart draws, ends and middle of its height; points of its curves; px
CHART = """
const texts = [], points = [], {prototype} = CanvasRenderingContext2D;
const {fillText, lineTo} = prototype;
prototype.fillText = function(text, x, y) {
  const {actualBoundingBoxLeft: left, actualBoundingBoxRight: right,
    actualBoundingBoxAscent: up, actualBoundingBoxDescent: down} = this.measureText(text);
  texts.push([text, x - left, x + right, y - up, y + down]);
};
prototype.lineTo = function(x, y) { if (this.lineWidth === 2) points.push([x, y]); };
window.tested.chart.draw();
Object.assign(prototype, {fillText, lineTo});
return [texts, points, window.tested.chart.canvas.clientWidth];
"""


@pytest.mark.parametrize("steps", [3000, 13000])
def test_the_chart_has_axes(browser: Browser, page: Path, steps: int) -> None:
    """The curves do not run through the numbers; those at the axis of time are where it is."""
    opened = OpenedPage(browser, page, width=400)
    opened.run(
        "window.tested.reset();"
        "for (let n = 1; n <= arguments[0]; n++) {"
        "  simulation.step();"
        "  if (n % 20 === 0) window.tested.chart.add(simulation.time);"
        "}",
        steps,
    )
    texts, points, width = opened.run(CHART)
    for _, left, right, top, bottom in texts:
        assert 0 <= left and right <= width
        assert not any(left <= x <= right and top <= y <= bottom for x, y in points)
    middles = {text: (left + right) / 2 for text, left, right, *_ in texts}
    times = [float(text[:-2]) for text in middles if text.endswith(" s")]
    assert len(times) >= 5 and max(times) <= max(10, steps / 1000)
    second = (middles[f"{times[-1]:g} s"] - middles[f"{times[0]:g} s"]) / (times[-1] - times[0])
    newest = middles[f"{times[0]:g} s"] + second * (steps / 1000 - times[0])
    assert max(x for x, _ in points) == pytest.approx(newest, abs=2)
    assert sum(text.endswith(" J") for text in middles) >= 2
    browser.check_quiet()


def test_the_drawing_follows(opened: OpenedPage) -> None:
    """The picture of the arm and the chart change while it runs, and have more than one colour."""
    picture = "return ['stage', 'energy'].map(id => document.getElementById(id).toDataURL())"
    opened.run("for (let n = 0; n < 50; n++) simulation.step(); window.tested.stage.draw()")
    first = opened.run(picture)
    choose(opened, "#speed", "4")
    click(opened, "#play")
    opened.browser.wait("window.tested.simulation.time > 1.5")
    second = opened.run(picture)
    assert all(early != late for early, late in zip(first, second, strict=True))
    colours = opened.run(
        "const canvas = document.getElementById('stage');"
        "const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;"
        "const found = new Set();"
        "for (let i = 0; i < data.length; i += 4) found.add(data.slice(i, i + 4).join());"
        "return found.size"
    )
    assert colours > 20
