"""The page of the playground: how it runs, starts again and goes back in time."""

import math
from pathlib import Path

import pytest

from tests.playground.controls import choose, click, find, type_number
from tests.playground.opened_page import OpenedPage

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
    opened.run("""
        window.tested.reset();
        window.rows = [];
        const chart = window.tested.charts.at(-1), add = chart.add.bind(chart);
        chart.add = time => {
          window.rows.push([time, ...chart.source.get()]);
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
