"""The arm of the drawing is that of the FMU, and it is drawn to scale."""

import cmath
import random
from pathlib import Path

import pytest

from rparm.fmi.fmu_file import Fmu
from tests.animation.player_page import ARM, show, synthetic
from tests.support.browser import Browser

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


def test_the_end_effector_is_that_of_the_fmu(page: Browser, opened: Fmu) -> None:
    cases = random_cases(60)
    for (arm, q1, q2), points in zip(cases, page.run(FORWARD, cases), strict=True):
        with opened.instance("arm") as instance:
            instance.set_up(0.0, 1.0)
            for name, value in {"a": arm["a"], "l1": arm["l1"], "q1": q1, "q2": q2}.items():
                instance.set(name, value)
            instance.enter_initialization()
            instance.exit_initialization()
            outputs = instance.reals(["ee_x", "ee_y"])
            outputs.get()
            assert points["endEffector"] == pytest.approx(outputs.view.tolist(), rel=0, abs=1e-12)


def test_other_points_are_where_the_notes_have_them(page: Browser) -> None:
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
