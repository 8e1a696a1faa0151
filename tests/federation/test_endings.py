"""How a federation ends that does not come to its end: by signals, silence or different systems."""

import shlex
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread
from types import SimpleNamespace

import numpy as np
import psutil
import pytest

from rparm.errors import UserError
from rparm.federation import component, network
from rparm.federation.component import parts
from rparm.federation.federation import run
from rparm.federation.network import KEY, Broker, Federate
from rparm.systems import ssp
from tests.federation.processes import (
    LIMIT,
    SILENCE,
    Process,
    Start,
    ended,
    federation,
    long,
    wait_for_steps,
)
from tests.support.paths import ROOT
from tests.support.ssp_files import SSP, edited, replace


def federate(start: Start, system: Path, variant: str, address: str) -> Process:
    return start("federate", str(system), variant, "arm", "--broker", address)


def components(process: Process, count: int) -> list[psutil.Process]:
    """Processes of components as soon as `count` of them are there and have joined."""
    until = time.monotonic() + LIMIT
    while time.monotonic() < until and process.poll() is None:
        found = psutil.Process(process.pid).children(recursive=True)
        # a thread of the command, its watcher and those of HELICS
        if len(found) == count and all(child.num_threads() > 5 for child in found):
            return found
        time.sleep(0.05)
    process.kill()
    raise AssertionError(f"the components have not started: {process.communicate()[0]}")


def gone(children: list[psutil.Process]) -> bool:
    _, left = psutil.wait_procs(children, timeout=30.0)
    return not left


@pytest.mark.parametrize(
    ("system", "variant", "words"),
    [
        (
            SSP,
            "heavy_payload",
            "its variant is 'heavy_payload', the federation's is 'nominal'",
        ),
        (None, "nominal", "its file is not the federation's"),
    ],
)
def test_something_else_elsewhere_is_refused_by_both(
    start: Start, tmp_path: Path, system: Path | None, variant: str, words: str
) -> None:
    """Another variant, or another SSP, in which the arm has another tolerance."""
    change = {"resources/arm_nominal.ssv": replace("1e-11", "1e-10")}
    other = system or edited(SSP, tmp_path / "Other.ssp", change)
    address = network.free_address()
    here = federation(start, "--listen", address, "--elsewhere", "arm")
    there = federate(start, other, variant, address)
    for process in (here, there):
        assert f"arm: {words}" in ended(process, 2)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_one_that_waits_for_others_can_be_stopped(
    start: Start, number: int, code: int, tmp_path: Path
) -> None:
    here = federation(start, "--listen", network.free_address(), "--elsewhere", "arm")
    children = components(here, 2)
    here.send_signal(number)
    ended(here, code)  # HELICS would wait without end
    assert gone(children)
    assert not list((tmp_path / "temporary").iterdir())


def test_components_end_with_the_process_that_is_killed(start: Start) -> None:
    here = federation(start, "--listen", network.free_address(), "--elsewhere", "arm")
    children = components(here, 2)
    here.kill()
    assert gone(children), "HELICS notices it after a minute"


def test_a_component_that_is_killed_leaves_no_files(start: Start, tmp_path: Path) -> None:
    here = federation(start)
    components(here, 3)[0].kill()
    text = ended(here, 2)
    assert "its process was ended by signal 9" in text
    assert "[error]" not in text, "HELICS writes too"
    assert not list((tmp_path / "temporary").iterdir())


def test_the_command_that_is_printed_steps_the_component(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With its key in the environment: other users see command lines."""
    monkeypatch.delenv(KEY)
    address = network.free_address()
    here = federation(start, "--listen", address, "--elsewhere", "arm")
    key, program, *arguments = shlex.split(here.stdout.readline().removeprefix("waiting for: "))
    assert program == "./run.sh"
    monkeypatch.setenv(*key.split("="))
    there = start(*arguments)
    for process in (here, there):
        ended(process)


def test_a_component_that_is_silent_is_named(start: Start) -> None:
    here = federation(start, "--silence", SILENCE)
    silent = next(c for c in components(here, 3) if "controller" in c.cmdline())
    silent.suspend()
    said = ended(here, 2).splitlines()[-1]
    assert said == "error: controller has been silent for 30 s (--silence)"


def test_a_broker_that_is_silent_is_named(start: Start, tmp_path: Path) -> None:
    address, system = network.free_address(), long(tmp_path)
    here = federation(start, "--listen", address, "--elsewhere", "arm", system=system)
    given = ("--broker", address, "--silence", SILENCE)
    there = start("federate", str(system), "nominal", "arm", *given)
    wait_for_steps(here)
    here.send_signal(signal.SIGSTOP)
    assert f"arm: the broker at {address} has been silent for 30 s" in ended(there, 2)


def test_a_standstill_is_ended() -> None:
    """The arm, here, takes part in one exchange only; what answers for it is HELICS."""
    address = network.free_address()
    with ssp.unpacked(SSP) as system:
        part = parts(system, "nominal")["arm"]
        arm = Federate("arm", address, ["controller"])

        def begin_only() -> None:
            for _ in range(9):  # until the broker is there, on a machine that is busy
                with suppress(UserError):
                    arm.join()
                    break
            arm.enter_initialization()
            arm.publish(np.zeros(len(part.published)))
            arm.exchange()

        Thread(target=begin_only, daemon=True).start()
        with pytest.raises(UserError, match="all answer, but nothing has moved for 40 s"):
            run(system, "nominal", address, elsewhere=["arm"], silence=20.0)


def test_a_component_that_cannot_join_ends_the_federation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also if what it says is what others say when the federation has ended."""
    monkeypatch.setattr("rparm.federation.federation.ABSENT", "(--help explains)")
    monkeypatch.setattr("rparm.federation.federation.arguments", lambda *_: ["no-command"])
    with ssp.unpacked(SSP) as system, pytest.raises(UserError, match="--help explains"):
        run(system, "nominal", network.free_address(), elsewhere=["arm"])


def test_a_broker_that_does_not_open_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rparm.federation.federation.Broker", lambda *_: Event().wait())
    address = network.free_address()
    words = f"no broker at {address}: HELICS has not returned for 1 s"
    with ssp.unpacked(SSP) as system, pytest.raises(UserError, match=words):
        run(system, "nominal", address, silence=1.0)


def test_a_broker_that_does_not_close_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    closing, end = Event(), Event()
    monkeypatch.setattr("helics.helicsBrokerDisconnect", lambda _: closing.set() or end.wait())
    monkeypatch.setattr("rparm.federation.network.ANSWER", 0.5)
    with Broker(2, network.free_address()):
        pass
    assert closing.is_set() and not end.is_set()
    end.set()


def test_an_fmu_that_does_not_return_is_named() -> None:
    end = Event()
    address = network.free_address()
    with ssp.unpacked(SSP) as system:
        part = parts(system, "nominal")["arm"]
    with (
        Broker(2, address) as broker,
        pytest.raises(UserError, match="arm: its FMU has not returned for 1 s"),
    ):
        broker.announce(part.system)
        hanging = SimpleNamespace(instance=lambda _: end.wait())
        component.run_component(part, hanging, address, 1.0)
    end.set()


def test_what_helics_writes_as_it_ends_is_nobodys_message() -> None:
    """Such as "asio system error in context loop", now and then after Ctrl-C."""
    code = (
        "import os, sys, threading;"
        "from rparm.federation import component, network;"
        "network.separate_messages();"
        "wait, noise = threading.Event().wait, lambda _: os.write(2, b'asio\\n');"
        "os.write(2, b'library\\n'); print('ours', file=sys.stderr)\n"
        "try: component.run_watched(wait, lambda: 1 / 0, noise)\n"
        "except ZeroDivisionError as error: print(error, file=sys.stderr)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert run.returncode == 0, run.stderr
    assert run.stderr.splitlines() == ["library", "ours", "division by zero"]


def test_signals_come_to_the_thread_that_watches() -> None:
    """HELICS starts its threads in the thread of the work: signals would interrupt them."""
    blocked = component.run_watched(
        lambda: signal.pthread_sigmask(signal.SIG_BLOCK, ()), lambda: None, lambda _: None
    )
    assert {signal.SIGINT, signal.SIGTERM, signal.SIGHUP} <= blocked
