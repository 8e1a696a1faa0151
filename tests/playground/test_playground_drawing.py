"""The drawings of the playground: hands that pull at the arm, what is seen, and how it looks."""

import re
from pathlib import Path

import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from tests.playground.opened_page import OpenedPage, choose, click, type_number
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
        "return [[x, view.width], [y, bottom]]"
        ".every(([at, end]) => at >= around && at <= end - around)",
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
const chart = window.tested.charts[arguments[0]];
chart.draw();
Object.assign(prototype, {fillText, lineTo});
return [texts, points, chart.canvas.clientWidth];
"""


@pytest.mark.parametrize("steps", [3000, 13000])
def test_the_chart_has_axes(browser: Browser, page: Path, steps: int) -> None:
    """The curves do not run through the numbers; those at the axis of time are where it is."""
    opened = OpenedPage(browser, page, width=400)
    opened.run(
        "window.tested.reset();"
        "for (let n = 1; n <= arguments[0]; n++) {"
        "  simulation.step();"
        "  if (n % 20 === 0) window.tested.charts.forEach(chart => chart.add(simulation.time));"
        "}",
        steps,
    )
    for chart in range(opened.run("return window.tested.charts.length")):
        texts, points, width = opened.run(CHART, chart)
        for _, left, right, top, bottom in texts:
            assert left >= 0 and right <= width
            assert not any(left <= x <= right and top <= y <= bottom for x, y in points)
        middles = {text: (left + right) / 2 for text, left, right, *_ in texts}
        times = [float(text[:-2]) for text in middles if text.endswith(" s")]
        assert len(times) >= 5 and max(times) <= max(10, steps / 1000)
        second = (middles[f"{times[-1]:g} s"] - middles[f"{times[0]:g} s"]) / (times[-1] - times[0])
        newest = middles[f"{times[0]:g} s"] + second * (steps / 1000 - times[0])
        assert max(x for x, _ in points) == pytest.approx(newest, abs=2)
        assert len(middles) - len(times) >= 2
    browser.check_quiet()


def test_joints_velocities_and_energies_are_plotted(opened: OpenedPage) -> None:
    """As the plant has them; each curve of a chart has its colour in the legend."""
    opened.run(
        "window.tested.reset(); simulation.step();"
        "for (const chart of window.tested.charts) chart.add(simulation.time)"
    )
    plotted, swatches = opened.run("""
        const {charts} = window.tested;
        const swatches = [...document.querySelectorAll('#charts li')].map(item => {
          const swatch = item.querySelector('.swatch');
          const style = getComputedStyle(swatch);
          return [item.textContent, swatch.clientWidth, style.borderTopWidth, style.borderTopStyle,
            style.borderTopColor];
        });
        return [charts.map(chart => [chart.names, chart.rows.at(-1).slice(1)]), swatches];
    """)
    values = {name: value for names, row in plotted for name, value in zip(names, row, strict=True)}
    energies = ["kinetic_energy", "potential_energy", "total_energy"]
    assert list(values) == ["q1", "q2", "dq1", "dq2", *energies]
    assert values == {name: opened.value(name) for name in values}
    assert [name for name, *_ in swatches] == energies
    assert [swatch[1:4] for swatch in swatches] == [
        [22, "3px", style] for style in ("solid", "solid", "dashed")
    ]
    assert len({colour for *_, colour in swatches}) == 3


@pytest.mark.parametrize("width", [400, 900, 1400])
def test_the_drawing_stays_in_view(each_browser: Browser, page: Path, width: int) -> None:
    """And whole, whichever control has the focus; it covers none of them."""
    opened = OpenedPage(each_browser, page, width=width)
    opened.run("document.querySelectorAll('#groups details').forEach(it => { it.open = true; })")
    hidden = opened.run("""
        const stage = document.getElementById('stage');
        const controls = document.querySelectorAll('#controls input, #controls select');
        return [...controls].filter(control => {
          control.focus();
          const {top, bottom} = stage.getBoundingClientRect();
          const {x, y, width, height} = control.getBoundingClientRect();
          const seen = document.elementFromPoint(x + width / 2, y + height / 2);
          return top < 0 || bottom > innerHeight || bottom - top < 200 || seen !== control;
        }).map(control => control.id);
    """)
    assert hidden == []


@pytest.mark.parametrize("width", [400, 900, 1400])
def test_a_refusal_moves_nothing(browser: Browser, page: Path, width: int) -> None:
    opened = OpenedPage(browser, page, width=width)
    choose(opened, "#setting", "Friction and stops")
    places = (
        "return [...document.querySelectorAll('main *, footer')].filter(it => !it.closest('#view'))"
        ".map(it => it.getBoundingClientRect().top + scrollY)"
    )
    before = opened.run(places)
    opened.run("window.tested.change('plant', plant.description.find('coulomb_friction1'), 5)")
    text = opened.text("#message")
    assert "breakaway_friction1 = 0.8 is refused" in text
    seen, after = opened.run(
        "const stage = document.getElementById('stage').getBoundingClientRect();"
        "const box = document.getElementById('message').getBoundingClientRect();"
        "return [box.height > 0 && box.top >= stage.top && box.bottom <= stage.bottom,"
        f"(() => {{ {places} }})()]"
    )
    assert seen and before == after


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
    colours = opened.run(
        "const canvas = document.getElementById('stage');"
        "const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;"
        "const found = new Set();"
        "for (let i = 0; i < data.length; i += 4) found.add(data.slice(i, i + 4).join());"
        "return found.size"
    )
    assert colours > 20
