"""The page of the playground: how it is built, runs, goes back in time and stands users."""

import base64
import math
import random
import re
import subprocess
import sys
from pathlib import Path

import pytest
from pytest import approx

from rparm.building import build as build_fmus
from tests.playground.opened_page import OpenedPage, choose, click, find, type_number
from tests.support.browser import Browser
from tests.support.paths import ROOT

LARGEST = 1_500_000  # bytes

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
    opened.call("recorded")
    opened.browser.wait("window.tested.simulation.time >= 10")
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


def test_a_benchmark_that_fails(opened: OpenedPage) -> None:
    """Some steps on, the force is too large: all is as before, and nothing leaks."""
    state = "return [simulation.steps, ...simulation.motion.get(), simulation.efforts[0]]"
    before = opened.run(state)
    assert opened.call("leaksOfBenchmark") == 0
    assert opened.run(state) == before
    head, said = opened.text("#message").split("\n", 1)
    assert head == "The speed cannot be measured from here:"
    assert said
    assert opened.text("#factor") == ""


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
    """After it is restored, Back stays in its scene, and Reset starts this."""
    steps = "for (let n = 0; n < 300; n++) simulation.step()"
    choose(opened, "#setting", "Horizontal plane")
    opened.run(steps)
    click(opened, "#save")
    choose(opened, "#setting", "Without friction")
    opened.run(steps)
    assert opened.value("g") > 9
    click(opened, "#restore")
    opened.run(steps)
    for back in (400, 300, 300):
        assert find(opened, "#setting").get_property("value") == "Horizontal plane"
        click(opened, "#back")
        assert (opened.run("return simulation.steps"), opened.value("g")) == (back, 0)
    click(opened, "#reset")
    assert (opened.value("g"), opened.value("dq1")) == (0, 3)


def test_history(opened: OpenedPage) -> None:
    opened.call("backInHistory", 0.5)
    assert opened.run("return simulation.steps") == 500
    assert opened.value("q1") == opened.run("return window.q1[500]")
    click(opened, "#back")
    assert opened.run("return simulation.steps") == 300
    assert opened.value("q1") == opened.run("return window.q1[300]")


# ---- Whatever users do ---------------------------------------------------------------------------


CHANGES = 250
WILD = (-1.0, 0.0, 1e-300, 1e9, 1e300)  # beside the values that sliders have


def changes(opened: OpenedPage, chance: random.Random) -> list[tuple[str, str, float]]:
    """Random values, most of them of sliders, for the variables that the page has controls for."""
    rows = []
    groups = opened.run("return Settings.groups")
    for _ in range(CHANGES):
        group = chance.choice(groups)
        name, *limits = chance.choice(group["controls"])
        if not limits:
            value = chance.randint(0, 3)
        elif chance.random() < 0.15:
            value = chance.choice(WILD)
        else:
            value = chance.uniform(limits[0], limits[1])
        rows.append((group["fmu"], name, value))
        if chance.random() < 0.1:
            rows.append(("plant", "solver_method", chance.randint(1, 4)))
        if chance.random() < 0.1:
            rows.append(("plant", "payload_attached", chance.randint(0, 1)))
    return rows


@pytest.mark.parametrize("seed", range(4))
def test_random_changes(opened: OpenedPage, seed: int) -> None:
    counts = opened.call("torture", changes(opened, random.Random(seed)))
    assert counts["accepted"] > 100
    assert counts["refused"] > 10
    assert counts["steps"] > 100
    assert math.isfinite(counts["energy"])


def test_memory_stays_as_large(opened: OpenedPage) -> None:
    """Once the history is full, states that are kept take the place of old ones."""
    sizes = opened.call("sizesOfMemory")
    assert sizes[0] == sizes[1] == sizes[2]
    assert max(sizes[0]) < 64e6


def test_a_page_that_cannot_start_says_why(browser: Browser, page: Path, tmp_path: Path) -> None:
    """Description and module of two builds: the FMU refuses the GUID."""
    other = tmp_path / "index.html"
    text, count = re.subn(r'guid="\{\w+-', 'guid="{00000000-', page.read_text(), count=1)
    assert count == 1
    other.write_text(text)
    browser.open(other)
    browser.wait("!document.getElementById('message').hidden")
    said = browser.run("return document.getElementById('message').textContent")
    assert said.startswith("The playground does not start: the GUID '{00000000-")
    browser.check_quiet()


# ---- FMUs of users -------------------------------------------------------------------------------
LAG = """
name = "Lag"
description = "First order"
experiment = { stop = 4.0, step = 0.01 }
[parameters]
T = { start = 0.5, unit = "s", min = 1e-3, max = 2 }
[inputs]
u = { unit = "m", min = -3, max = 3 }
[states]
x = { unit = "m", derivative = "(u - x) / T" }
"""


def drop(opened: OpenedPage, name: str, content: bytes) -> str:
    return opened.call("dropped", name, base64.b64encode(content).decode())


@pytest.mark.parametrize(("width", "version"), [(400, 0), (1200, 1)], ids=["2.0", "3.0"])
def test_an_own_model_is_felt_in_the_page(
    each_browser: Browser, page: Path, tmp_path: Path, width: int, version: int
) -> None:
    """A lag follows a step of its input as 1 - exp(-t / T), by sliders of both."""
    opened = OpenedPage(each_browser, page, width=width)
    (tmp_path / "lag.toml").write_text(LAG)
    fmu = build_fmus(tmp_path / "lag.toml", output=tmp_path, web=True)[version]
    assert drop(opened, "Lag.fmu", fmu.read_bytes()) == ""
    assert opened.call("slide", "u", 2) == 2 and opened.call("slide", "T", 0.803) == approx(
        0.8, 0.01
    )
    time, x, lag = opened.call("stepped", 150, ["x", "T"])
    assert time == approx(1.5) and x == approx(2 * (1 - math.exp(-1.5 / lag)), rel=1e-6)
    assert opened.text("#own h2") == "Lag" and "x (m)" in opened.text("#own figure")
    assert each_browser.overflow() == 0 and each_browser.violations() == []
    native = page.parents[1] / "RPSensor.fmu"
    told = {"a.fmu": (b"no zip", "is no ZIP archive")}
    told |= {"b.fmu": (native.read_bytes(), "has no WebAssembly: rparm build --web")}
    for name, (content, words) in told.items():
        assert f"{name}: {words}" in drop(opened, name, content)
    for file in (page.parents[1] / "platforms" / "wasm32-wasi").glob("*.fmu"):
        assert drop(opened, file.name, file.read_bytes()) == "", file
        assert opened.call("stepped", 5, [])[0] > 0
    each_browser.run("document.getElementById('arm').click()")
    assert each_browser.run("return document.getElementById('own').hidden")
    each_browser.check_quiet()


# ---- The program that writes the page ------------------------------------------------------------


PROGRAM = ROOT / "playground" / "build.py"


@pytest.fixture
def module(tmp_path: Path) -> Path:
    """A module of a few bytes, with a description beside it."""
    path = tmp_path / "Small.wasm"
    path.write_bytes(b"\x00asm\x01\x00\x00\x00")
    path.with_name("modelDescription.xml").write_text("<fmiModelDescription/>")
    return path


def build(module: Path) -> subprocess.CompletedProcess[str]:
    license_file = module.with_name("LICENSE")
    license_file.write_text("Copyright <someone>")
    command = [sys.executable, PROGRAM, module, "--license", f"Small & Co={license_file}"]
    command += ["--output", written(module)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def written(module: Path) -> Path:
    return module.parent / "out" / "index.html"


def test_the_page_holds_all_it_needs(module: Path) -> None:
    done = build(module)
    assert done.returncode == 0, done.stderr
    page = written(module).read_text()
    encoded = base64.b64encode(module.read_bytes()).decode()
    assert f'<script type="text/plain" id="Small-module">{encoded}</script>' in page
    assert "<fmiModelDescription/>" in page
    assert "<h3>Small &amp; Co</h3>\n<pre>Copyright &lt;someone&gt;</pre>" in page
    for script in (PROGRAM.parent / "page").glob("*.js"):
        assert script.read_text() in page, script.name
    assert not any(mark in page for mark in ("{{ styles", "{{ scripts", "{% for", "{{ name"))
    assert "src=" not in page


def test_a_text_that_ends_its_element_is_refused(module: Path) -> None:
    module.with_name("modelDescription.xml").write_text("<a></Script></a>")
    done = build(module)
    assert done.returncode != 0
    assert "Small: the text would end the element" in done.stderr
    assert not written(module).exists()


def test_a_page_that_is_too_large_is_refused(module: Path) -> None:
    module.write_bytes(bytes(1_500_000))
    done = build(module)
    assert done.returncode == 1
    assert "more than 1500000" in done.stderr
    assert not written(module).exists()
