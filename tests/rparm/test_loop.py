"""The loop in C that steps FMUs: interrupts, inputs from outside."""

import os
import signal
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rparm.fmi.fmu_file import Fmu
from rparm.fmi.loop import one_component
from rparm.runs.inputs import Polyline
from rparm.systems.connected_instance import begin_instance
from rparm.systems.master import Master
from rparm.systems.python_component import PythonComponent
from rparm.systems.structure import Connection
from tests.support.intercepted import intercept
from tests.support.rparm_project import FMUS, fmi3_fmu

H = 0.05
ADDER = """
class Adder:
    inputs, outputs = ["u"], ["y"]
    def step(self, t, h, inputs):
        return {"y": inputs["u"] + 1.0}
"""
PAIR = [Connection("p", "y", "q", "u"), Connection("q", "y", "p", "u")]


def python(folder: Path, text: str) -> PythonComponent:
    (folder / "code.py").write_text(text, encoding="utf-8")
    return PythonComponent.read("code.py", folder)


def test_an_interrupt_ends_a_run_wherever_it_comes(tmp_path: Path) -> None:
    """At the first instruction of what C calls, too, where ctypes would only print it."""
    adder = python(tmp_path, ADDER)
    for delay in np.linspace(0.002, 0.02, 12):
        with Master({"p": adder, "q": adder}, PAIR) as master:
            master.initialize(0.0)
            timer = threading.Timer(delay, os.kill, (os.getpid(), signal.SIGINT))
            timer.start()
            with pytest.raises(KeyboardInterrupt):
                master.run(np.arange(1_000_000) * H)
            timer.join()


def test_progress_and_interrupts_do_not_wait_for_slow_steps(tmp_path: Path) -> None:
    text = "import time\n" + ADDER.replace(
        "        return", "        time.sleep(0.03)\n        return"
    )
    slow, counted = python(tmp_path, text), list[int]()
    with Master({"p": slow}, []) as master:
        master.initialize(0.0)
        master.run(np.arange(5) * H, counted.append)
    assert counted == [1] * 4


def test_inputs_that_are_connected_and_inputs_that_move_in_one_component() -> None:
    rows, path = [], FMUS["rp_manipulator"]
    for each in (path, fmi3_fmu(path)):
        ends, wave = [Connection("a", "q1", "b", "tau1")], Polyline(((0.0, 0.0), (0.2, 3.0)))
        with (
            Fmu(each) as arm,
            Master(
                {"a": arm, "b": arm}, ends, inputs="extrapolated", signals={"b.f2": wave}
            ) as two,
        ):
            two.initialize(0.0, None, {"a": {"q1": 0.5}})
            rows.append(two.run(np.arange(21) * 0.01))
    assert np.ptp(rows[0][:, two.names.index("b.q1")]) > 0.01
    np.testing.assert_allclose(*rows, rtol=1e-9, atol=1e-9)


def test_a_boolean_is_set_only_where_its_schedule_changes() -> None:
    """And not after the last step: what an FMU refuses or ignores then is not the run's."""
    with Fmu(FMUS["rp_plant"]) as fmu, fmu.instance("one") as instance:
        begin_instance(instance, 0.0, None, {})
        instance.exit_initialization()
        loop = one_component(instance, [], ["payload_attached"], ["q1"])
        loop.start(0.0)
        given, calls = np.array([[0], [0], [1], [1], [0]]), []

        def count(function: Callable[..., int], *arguments: Any) -> int:
            calls.append(loop.state.time)
            return function(*arguments)

        kept = intercept(loop.components[0], "fmi2SetBoolean", count)
        loop.know_switches(given[0])
        loop.run(np.arange(1, 5) * 0.125, scheduled=given[:-1])
        del kept
    assert calls == [0.25]
