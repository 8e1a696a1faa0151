"""What the drawing shows is what was recorded: places, lengths, angles, marks, to scale."""

import cmath
import math
import random
from pathlib import Path
from typing import Any

import pytest

from tests.animation.player_page import ARM, show, synthetic
from tests.support.browser import Browser

CONSTANT = {"time": [0.0, 1.0, 2.0], "q1": [0.0] * 3, "q2": [0.2] * 3}  # nothing moves
NEAR = 12  # of 255: edges are smoothed

IN_PAGE = Path(__file__).with_name("drawn.js").read_text(encoding="utf-8")


def call(browser: Browser, function: str, *arguments: object) -> Any:
    """Value of a function of drawn.js."""
    return browser.run(f"{IN_PAGE} return {function}(...arguments)", *arguments)


def still(browser: Browser, folder: Path, **changes) -> None:
    """An arm at rest with the slide along x."""
    show(browser, folder, synthetic(**CONSTANT, **changes), width=800)


def alike(one: list[int], other: list[int]) -> bool:
    return all(abs(a - b) <= NEAR for a, b in zip(one, other, strict=True))


def test_the_end_effector_moves_where_the_motion_says(browser: Browser, tmp_path: Path) -> None:
    motion = synthetic()
    show(browser, tmp_path, motion)
    centres = {}
    for row in (0, 30, 60, 100):
        browser.run("player.show(arguments[0])", row)
        q1, L = motion["q1"][row], ARM["l1"] + motion["q2"][row]
        x = L * math.cos(q1) - ARM["a"] * math.sin(q1)
        y = L * math.sin(q1) + ARM["a"] * math.cos(q1)
        ring, good, centres[row] = call(browser, "ring", [x, y])
        assert sum(alike(colour, good) for colour in ring) >= 6, row
    browser.run("player.show(0)")
    [paper] = call(browser, "named", "paper")
    for row in (60, 100):  # the arm has left, or is not there yet
        assert alike(browser.run("return colourAt(arguments[0])", centres[row]), paper)


def test_links_join_their_points(browser: Browser, tmp_path: Path) -> None:
    show(browser, tmp_path, synthetic())
    for row in (50, 100):
        *link1, link2 = call(browser, "onLinks", row)
        paper, grid = call(browser, "named", "paper", "grid")
        assert link1[0] == link1[1] == link1[2]
        for colour in (link1[0], link2):
            assert not alike(colour, paper)
            assert not alike(colour, grid)
        assert not alike(link1[0], link2)


def test_the_trace_is_the_path_so_far(browser: Browser, tmp_path: Path) -> None:
    show(browser, tmp_path, synthetic())
    browser.run("player.show(60)")
    path, place, good = browser.run("return [player.scene.trace, player.path[57]]") + call(
        browser, "named", "good"
    )
    pixel = call(browser, "at", place)
    assert path == browser.run("return player.path.slice(0, 61)")
    browser.run("player.show(0)")
    before = call(browser, "at", place)
    assert not alike(before, good)
    assert not alike(before, pixel)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_force_is_as_long_as_it_is_large(browser: Browser, tmp_path: Path, sign: int) -> None:
    still(browser, tmp_path, f2=[20.0 * sign, 10.0 * sign, 0.0])
    sleeve, top, bar = call(browser, "sleeve")
    box = ("effort", sleeve - 90, round(top), sleeve + 90, round(top + 1.1 * bar))
    found = []
    for row in range(3):
        browser.run("player.show(arguments[0])", row)
        found.append(call(browser, "pixels", *box))
    end = "right" if sign > 0 else "left"
    assert sign * (found[0][end] - sleeve) == pytest.approx(72, abs=2)
    assert sign * (found[1][end] - sleeve) == pytest.approx(36, abs=2)
    assert found[2]["count"] == 0


@pytest.mark.parametrize("sign", [1, -1])
def test_a_torque_is_an_arc_of_its_size(browser: Browser, tmp_path: Path, sign: int) -> None:
    still(browser, tmp_path, tau1=[5.0 * sign, 2.5 * sign, 0.0])
    [effort] = call(browser, "named", "effort")

    def lit(degrees: float) -> bool:
        return alike(call(browser, "onArc", sign * math.radians(degrees)), effort)

    begin = math.degrees(0.35)
    angles = {0: 240, 1: 120}  # degrees, of the largest torque on the scale and of half of it
    for row, angle in angles.items():
        browser.run("player.show(arguments[0])", row)
        assert lit(begin + 5)
        assert lit(begin + angle - 8)
        assert not lit(begin + angle + 8)
    browser.run("player.show(2)")
    assert not any(lit(degrees) for degrees in range(25, 300, 5))


def test_a_force_on_the_tip_points_from_it(browser: Browser, tmp_path: Path) -> None:
    still(browser, tmp_path, ee_fx=[0.0, 3.0, 0.0], ee_fy=[0.0, 4.0, 0.0])
    [bad] = call(browser, "named", "bad")
    along = [call(browser, "fromTip", row) for row in (0, 1)]
    assert not any(alike(colour, bad) for colour in along[0])
    assert all(alike(colour, bad) for colour in along[1])


def test_a_stop_that_is_struck_is_filled(browser: Browser, tmp_path: Path) -> None:
    arm = ARM | {"stops": {"q1": None, "q2": [-0.1, 0.2]}}
    motion = synthetic(**CONSTANT | {"q2": [0.2, 0.1, -0.1]}, arm=arm)
    show(browser, tmp_path, motion, width=800)
    [stop] = call(browser, "named", "stop")
    filled = []
    for row, q2 in enumerate(motion["q2"]):
        colours = call(browser, "collars", row, q2)
        filled.append([alike(colour, stop) for colour in colours])
    assert filled == [[False, True], [False, False], [True, False]]


def test_link_1_lies_against_the_stop_that_it_strikes(browser: Browser, tmp_path: Path) -> None:
    limits = [-0.5, 0.8]
    arm = ARM | {"stops": {"q1": limits, "q2": None}}
    motion = synthetic(**CONSTANT | {"q1": [0.8, 0.0, -0.5]}, arm=arm)
    show(browser, tmp_path, motion, width=800)
    stop, paper = call(browser, "named", "stop", "paper")
    filled = []
    for row in range(3):
        colours = call(browser, "blocks", row, limits)
        assert not any(alike(colour, paper) for colour in colours)
        filled.append([alike(colour, stop) for colour in colours])
    assert filled == [[False, True], [False, False], [True, False]]


def test_modes_of_friction_have_marks(browser: Browser, tmp_path: Path) -> None:
    still(browser, tmp_path, mode1=[0, 1, 2], mode2=[2, 2, -1])
    counts = [call(browser, "marks", row) for row in range(3)]
    assert counts[0] > 40  # a padlock
    assert counts[1] > 20  # chevrons
    assert counts[2] == 0
    words = browser.run("return [...document.querySelectorAll('li span')].map(x => x.textContent)")
    assert words[-2:] == ["free", "slides backward"]


def test_the_payload_is_drawn_while_it_is_attached(browser: Browser, tmp_path: Path) -> None:
    arm = ARM | {"payload": {"x": 0.1, "z": 0.1, "at_rest": False}}
    attached = [False, True, False]
    for at_rest, shown in ((False, attached), (True, [True, True, False])):
        arm["payload"]["at_rest"] = at_rest
        still(browser, tmp_path, arm=arm, payload_attached=attached)
        [paper] = call(browser, "named", "paper")
        for row, expected in enumerate(shown):
            assert alike(call(browser, "payload", row), paper) != expected


def test_the_reference_is_another_outline(browser: Browser, tmp_path: Path) -> None:
    still(browser, tmp_path, reference={"q1": [0.4] * 3, "q2": [0.2] * 3})
    assert alike(*call(browser, "outline"))


def test_the_wall_is_where_its_parameters_say(browser: Browser, tmp_path: Path) -> None:
    wall = {"position": 0.06, "angle": math.pi / 2, "tip_x": 0.0, "tip_z": 0.0}
    still(browser, tmp_path, arm=ARM | {"wall": wall})
    [stop] = call(browser, "named", "stop")
    for y, expected in ((0.06, True), (0.08, False)):
        assert alike(call(browser, "at", [0.55, y]), stop) == expected


# ---- The arm has the parameters of the FMU, and is drawn to scale --------------------------------


FORWARD = """
  return arguments[0].map(([arm, q1, q2]) => Arm.forward(arm, q1, q2))
"""


def random_cases(count: int) -> list[tuple[dict, float, float]]:
    """Arms with joint variables, also far out."""
    numbers = random.Random(17)
    cases = []
    for _ in range(count):
        wall = {"position": 0.0, "angle": 0.0}
        wall |= {name: numbers.uniform(-0.2, 0.2) for name in ("tip_x", "tip_z")}
        arm = ARM | {
            "a": numbers.uniform(-0.5, 0.5),
            "l1": numbers.uniform(0, 2),
            "lc1": numbers.uniform(0, 2),
            "wall": wall,
            "payload": {"x": numbers.uniform(-0.2, 0.2), "z": numbers.uniform(-0.2, 0.2)},
        }
        cases.append((arm, numbers.uniform(-10, 10), numbers.uniform(-3, 3)))
    return cases


@pytest.fixture
def page(browser: Browser, tmp_path: Path) -> Browser:
    show(browser, tmp_path, synthetic())
    return browser


def test_points_are_where_the_notes_have_them(page: Browser) -> None:
    """In the complex plane z1 is exp(i q1), and x1 is a quarter turn ahead of it."""
    cases = random_cases(200)
    for (arm, q1, q2), points in zip(cases, page.run(FORWARD, cases), strict=True):
        z1 = cmath.exp(1j * q1)
        L = arm["l1"] + q2
        payload, wall = arm["payload"], arm["wall"]
        expected = {
            "pivot": 0,
            "elbow": arm["l1"] * z1,
            "sleeve": (arm["l1"] + 1j * arm["a"]) * z1,
            "mass1": arm["lc1"] * z1,
            "endEffector": (L + 1j * arm["a"]) * z1,
            "payload": (L + payload["z"] + 1j * (arm["a"] + payload["x"])) * z1,
            "tip": (L + wall["tip_z"] + 1j * (arm["a"] + wall["tip_x"])) * z1,
        }
        for name, point in expected.items():
            assert complex(*points[name]) == pytest.approx(point, rel=0, abs=1e-12), name


def test_a_view_is_to_scale_and_holds_the_motion(page: Browser) -> None:
    for width, height in ((400, 300), (900, 500), (300, 800)):
        view, pixels, back = page.run(
            """
            const view = Arm.fit(player.motion, arguments[0], arguments[1], {});
            const points = player.path.concat([[0, 0]]);
            const pixels = points.map(point => Arm.toPixel(view, point));
            return [view, pixels, pixels.map(pixel => Arm.toMetres(view, pixel))];
            """,
            width,
            height,
        )
        path = page.run("return player.path")
        assert back == [pytest.approx(point, abs=1e-9) for point in [*path, [0, 0]]]
        for (x, y), (left, top) in zip(path, pixels, strict=False):
            origin = pixels[-1]
            assert left - origin[0] == pytest.approx(view["scale"] * x, abs=1e-6)
            assert origin[1] - top == pytest.approx(view["scale"] * y, abs=1e-6)
            assert 0 < left < width
            assert 0 < top < height - view["strip"]


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e5])
def test_any_size_fits(page: Browser, size: float) -> None:
    box = {"left": -size, "right": size, "bottom": 0.0, "top": size}
    view = page.run("return Arm.fit(arguments[0], 400, 300, {})", box)
    assert 0 < view["scale"] * 2 * size <= 400
    assert 0 < view["scale"] * size <= 300 - view["strip"]
    assert 36 <= view["length"] * view["scale"] <= 90  # px, of the legend's bar


def test_scales_are_round_and_not_below_what_acts(page: Browser) -> None:
    rows = [0.0] * 100
    motion = synthetic(tau1=[*rows, -13.0], f2=[*rows, 4.9], ee_fx=[*rows, 3.0], ee_fy=[*rows, 4.0])
    view = page.run("return Arm.fit(arguments[0], 600, 400, {})", motion)
    assert (view["torque"], view["force"], view["contact"]) == (20, 5, 5)
    texts = [entry["text"] for entry in view["entries"]]
    assert texts[1:4] == ["τ₁ 10 N·m", "f₂ 2.5 N", "force on the tip 2.5 N"]


@pytest.mark.parametrize(
    ("q", "limits", "side"),
    [
        (0.2, [-1.0, 0.2], 1),
        (0.3, [-1.0, 0.2], 1),  # in a compliant stop
        (-1.0, [-1.0, 0.2], -1),
        (0.19, [-1.0, 0.2], 0),
        (5.0, None, 0),
    ],
)
def test_which_stop_a_joint_is_at(page: Browser, q: float, limits: list | None, side: int) -> None:
    assert page.run("return Arm.stopOf(arguments[0], arguments[1])", limits, q) == side
