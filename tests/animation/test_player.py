"""The player: plays, goes to a time, obeys keys, and suits who looks at it."""

from collections.abc import Callable
from pathlib import Path

import pytest
from selenium.webdriver.common.keys import Keys

from tests.animation.player_page import show, synthetic
from tests.support.browser import Browser

LAST = 100  # row of `synthetic`


@pytest.fixture
def page(browser: Browser, tmp_path: Path) -> Browser:
    show(browser, tmp_path, synthetic())
    return browser


def row(page: Browser) -> int:
    return page.run("return player.row")


def label(page: Browser) -> str:
    return page.run("return document.querySelector('.player-toggle').ariaLabel")


def test_nothing_moves_before_it_is_asked_to(page: Browser) -> None:
    next_frame = "new Promise(done => requestAnimationFrame(done))"
    page.run(f"return {next_frame}.then(() => {next_frame})")
    assert row(page) == 0
    assert label(page) == "Play"


def test_it_plays_to_the_end_row_after_row(page: Browser) -> None:
    page.run("document.querySelector('.player-toggle').click()")
    assert label(page) == "Pause"
    page.wait("!player.playing")
    assert label(page) == "Play"
    rows = page.run("return events.map(event => event.row)")
    assert rows == sorted(set(rows))
    assert rows[-1] == LAST
    page.run("stopClock(); events.length = 0; player.play()")  # begins once more
    page.run("for (let n = 0; n <= 10; n++) pass(0.1)")
    assert page.run("return events.map(event => event.row)") == list(range(0, LAST + 1, 10))


def test_speed_is_that_of_the_clock(page: Browser) -> None:
    page.run(
        """
        stopClock();
        const select = document.querySelector('.player-speed select');
        select.value = '0.1';
        select.dispatchEvent(new Event('change'));
        player.play();
        for (const seconds of [7, 0.3, 0.1, 0.6]) pass(seconds); // it plays from the first frame
        """
    )
    assert page.run("return events.map(event => event.row)") == [0, 3, 4, 10]
    page.run("pass(60)")  # the page was in the background, and goes on as after a second
    assert row(page) == 20


def test_pause_stops(page: Browser) -> None:
    page.run("stopClock(); player.play(); pass(0); pass(0.3)")
    page.keys(".player-toggle", Keys.SPACE)
    assert not page.run("return player.playing")
    page.run("pass(0.3)")
    assert row(page) == 30


def test_a_click_on_the_drawing_plays_and_pauses(page: Browser) -> None:
    check_that_it_plays_and_pauses(page, page.driver.find_element("css selector", "canvas").click)


def check_that_it_plays_and_pauses(page: Browser, toggle: Callable[[], None]) -> None:
    page.run("stopClock()")
    for playing in (True, False):
        toggle()
        assert page.run("return player.playing") == playing
        page.run("pass(0); pass(0.2)")
        assert row(page) == 20


def test_the_slider_scrubs(page: Browser) -> None:
    page.run(
        """
        const slider = document.querySelector('.player-time');
        slider.value = 40;
        slider.dispatchEvent(new Event('input'));
        """
    )
    assert row(page) == 40
    assert page.run("return document.querySelector('.player-clock').textContent") == "0.400 s"
    assert page.run("return document.querySelector('.player-time').ariaValueText") == "0.400 s"
    assert page.run("return events.at(-1)") == {"time": 0.4, "row": 40}


def test_tab_goes_through_the_controls_and_shows_where_it_is(page: Browser) -> None:
    places = []
    for _ in range(3):
        page.driver.switch_to.active_element.send_keys(Keys.TAB)
        places.append(
            page.run(
                "const here = document.activeElement, {outlineStyle} = getComputedStyle(here);"
                "return [here.className || here.localName, outlineStyle]"
            )
        )
    assert places == [[name, "solid"] for name in ("player-toggle", "player-time", "select")]


@pytest.mark.parametrize("place", [".player-toggle", ".player-time"])
def test_keys(page: Browser, place: str) -> None:
    for key, expected in (
        (Keys.ARROW_RIGHT, 1),
        (Keys.ARROW_RIGHT, 2),
        (Keys.ARROW_LEFT, 1),
        (Keys.SHIFT + Keys.ARROW_RIGHT, 21),
        (Keys.END, LAST),
        (Keys.ARROW_RIGHT, LAST),
        (Keys.SHIFT + Keys.ARROW_LEFT, 80),
        (Keys.HOME, 0),
        (Keys.ARROW_LEFT, 0),
    ):
        page.keys(place, key)
        assert row(page) == expected
    check_that_it_plays_and_pauses(page, lambda: page.keys(place, Keys.SPACE))


def test_keys_of_the_list_of_speeds_stay_its_own(page: Browser) -> None:
    page.keys(".player-speed select", Keys.END)
    assert row(page) == 0
    assert page.run("return player.speed") == 4


@pytest.mark.parametrize(
    ("asked", "shown"), [(0.304, 30), (0.306, 31), (-5, 0), (7, LAST), (1, LAST), (0.5, 50)]
)
def test_seek_shows_the_nearest_row(page: Browser, asked: float, shown: int) -> None:
    page.run("player.seek(arguments[0])", asked)
    assert row(page) == shown
    assert page.run("return events.length") == 1 + (shown != 0)
    page.run("player.seek(arguments[0])", asked)
    assert page.run("return events.length") == 1 + (shown != 0)  # no event, as nothing changes


def test_times_far_away_and_uneven(browser: Browser, tmp_path: Path) -> None:
    late = synthetic(time=[1e6 + (row / 100) ** 2 for row in range(101)])
    show(browser, tmp_path, late)
    for asked, expected in ((1e6 + 0.251, 50), (1e6 + 0.99, 99), (0, 0)):
        browser.run("player.seek(arguments[0])", asked)
        assert row(browser) == expected


@pytest.mark.parametrize("count", [1, 2])
def test_few_rows(browser: Browser, tmp_path: Path, count: int) -> None:
    motion = synthetic(time=[0.0, 0.1][:count], q1=[0.3, 0.4][:count], q2=[0.0, 0.1][:count])
    show(browser, tmp_path, motion)
    browser.run("player.play()")
    browser.wait("!player.playing")
    assert row(browser) == count - 1
    browser.check_quiet()


def test_less_motion_is_a_picture_now_and_then(browser: Browser, tmp_path: Path) -> None:
    show(browser, tmp_path, synthetic(), reduced_motion=True)
    browser.run("stopClock(); player.play(); for (let n = 0; n <= 11; n++) pass(0.1)")
    assert browser.run("return events.map(event => event.row)") == [0, 50, LAST]
    assert not browser.run("return player.playing")


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [400, 1000])
def test_it_fits_and_is_accessible(
    browser: Browser, tmp_path: Path, dark: bool, width: int
) -> None:
    zeros, modes = [0.0] * 100, [0, 1] * 50
    motion = synthetic(
        tau1=[*zeros, 3.0],
        f2=[*zeros, 3.0],
        ee_fx=[*zeros, 3.0],
        mode1=[*modes, 2],
        mode2=[*modes, 2],
        payload_attached=[True] * 101,
    )
    motion["arm"] = motion["arm"] | {
        "stops": {"q1": [-1.0, 1.5], "q2": None},
        "wall": {"position": 0.0, "angle": 0.3, "tip_x": 0.0, "tip_z": 0.0},
        "payload": {"x": 0.0, "z": 0.1, "at_rest": False},
    }
    show(browser, tmp_path, motion, width=width, dark=dark)
    assert browser.overflow() == 0
    assert browser.violations() == []
    texts, right = browser.run(
        """
        const context = player.canvas.getContext('2d');
        context.font = '12px system-ui, sans-serif';
        const {entries, width} = player.view;
        return [entries.map(({text}) => text), Math.max(...entries.map(
          ({text, x, swatch}) => x + swatch + context.measureText(text).width - width))];
        """
    )
    assert right <= 0  # the legend ends within the canvas
    assert {"held by friction", "slides", "at its stop", "wall", "path", "gravity"} <= set(texts)
    paper = browser.run("return [colourAt([2, 2]), parsed(player.view.colours.paper)]")
    assert paper[0] == paper[1]
    assert (sum(paper[0]) < 200) == dark


def test_it_follows_the_width(page: Browser) -> None:
    before = page.run("return player.view.width")
    page.run("element.style.width = '320px'")
    page.wait("player.view.width === 320")
    assert before > 320
    assert page.run("return player.canvas.width") == 320


def test_it_waits_in_a_hidden_element(page: Browser) -> None:
    page.run(
        """
        const hidden = document.createElement('div');
        hidden.hidden = true;
        document.body.append(hidden);
        window.second = new Player(hidden, player.motion);
        second.show(50);
        hidden.hidden = false;
        """
    )
    page.wait("second.view")
    drawn = "return ({0}.show(50), {0}.canvas.toDataURL())"
    page.run("element.style.width = `${second.view.width}px`")
    page.wait("player.view.width === second.view.width")
    assert page.run(drawn.format("second")) == page.run(drawn.format("player"))


@pytest.mark.parametrize("scale", [1, 2])
def test_it_has_the_pixels_of_the_screen(browser: Browser, tmp_path: Path, scale: int) -> None:
    show(browser, tmp_path, synthetic(), scale=scale)
    width, pixels = browser.run("return [player.canvas.clientWidth, player.canvas.width]")
    assert pixels == scale * width
