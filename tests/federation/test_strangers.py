"""Who reaches a federation: other programs of the machine, of any user, and other hosts."""

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from rparm.federation import network
from rparm.federation.network import KEY
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
from tests.support.hosts import DEVICE, Network
from tests.support.paths import ROOT
from tests.support.programs import run
from tests.support.rparm_project import Console
from tests.support.ssp_files import SSP

# ---- On this machine -----------------------------------------------------------------------------


def said(address: str, user: int | None, *arguments: str) -> str:
    """What a stranger says."""
    _, port = network.check_address(address)
    environment = {name: value for name, value in os.environ.items() if name != KEY}
    who = (str(port), str(-1 if user is None else user), *arguments)
    command = (sys.executable, "-m", "tests.federation.stranger", *who)
    return run(*command, cwd=ROOT, env=environment, timeout=LIMIT, check=True).stdout


def test_strangers_change_nothing(start: Start, user: int | None) -> None:
    """Neither one that takes the place of the arm, nor one that only wants to see."""
    address = network.free_address()
    here = federation(start, "--listen", address, "--elsewhere", "arm")
    assert here.stdout.readline().startswith("waiting for: ")
    network.wait_for_listener(address, LIMIT, lambda: None)
    for arguments in (["arm"], ["arm", "--brokerkey=**"], ["other", "--observer"]):
        assert said(address, user, *arguments).startswith("refused: "), arguments
    there = start("federate", str(SSP), "nominal", "arm", "--broker", address)
    wait_for_steps(here)
    for arguments in (["arm"], ["other", "--observer"]):
        assert said(address, user, *arguments).startswith("refused: "), arguments
    for process in (here, there):
        ended(process)  # the values are those of the master


def test_a_federation_has_one_port_on_loopback(start: Start) -> None:
    address = network.free_address()
    here = federation(start, "--listen", address, "--elsewhere", "arm")
    there = start("federate", str(SSP), "nominal", "arm", "--broker", address)
    wait_for_steps(here)
    started = [psutil.Process(process.pid) for process in (here, there)]
    found = []
    for process in [*started, *(child for each in started for child in each.children(True))]:
        with suppress(psutil.NoSuchProcess):  # the trajectory runs ahead, and may have ended
            assert os.environ[KEY] not in " ".join(process.cmdline())
            found += [
                connection.laddr.ip
                for connection in process.net_connections(kind="inet")
                if connection.status in (psutil.CONN_LISTEN, psutil.CONN_NONE)  # of UDP
            ]
    assert found == ["127.0.0.1"]


@pytest.mark.parametrize("wrong", ["", "short", "with blanks and more", "**"])
def test_keys_that_can_be_guessed_are_refused(
    console: Console, monkeypatch: pytest.MonkeyPatch, wrong: str
) -> None:
    monkeypatch.setenv(KEY, wrong)
    said = f"error: {KEY}: expected 16 to 128 letters and digits in the environment\n"
    assert console.refused("federation", "nominal", "--ssp", SSP) == said


def test_a_component_elsewhere_needs_the_key(
    console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(KEY)
    said = f"error: {KEY}: not in the environment, copy the whole line of the federation\n"
    arguments = ("federate", SSP, "nominal", "arm", "--broker", "tcp://127.0.0.1:1")
    assert console.refused(*arguments) == said


# ---- Two hosts -----------------------------------------------------------------------------------


def apart_from_the_arm(
    start: Start, apart: Network, system: Path, *arguments: str
) -> tuple[Process, Process]:
    address = f"tcp://{apart.here.address}:23404"
    given = ("--listen", address, *arguments, "--elsewhere", "arm")
    here = federation(start, *given, system=system, host=apart.here)
    there = start(
        "federate", str(system), "nominal", "arm", "--broker", address, *arguments, host=apart.there
    )
    return here, there


def test_two_hosts_give_the_values_of_one(start: Start, apart: Network) -> None:
    """The command compares them with those of the master."""
    for process in apart_from_the_arm(start, apart, SSP):
        ended(process)


def test_a_lost_link_ends_both(start: Start, apart: Network, tmp_path: Path) -> None:
    here, there = apart_from_the_arm(start, apart, long(tmp_path), "--silence", SILENCE)
    wait_for_steps(here)
    apart.cut()
    for process, words in ((here, "arm has been silent"), (there, "23404 has been silent")):
        said = ended(process, 2).splitlines()[-1]
        # whichever notices first: ours, or HELICS by its broker
        assert f"{words} for 30 s" in said or "lost connection with broker" in said


def test_what_a_host_without_a_network_lacks_is_said(start: Start, apart: Network) -> None:
    command = ("ip", "address", "flush", "dev", DEVICE)
    subprocess.run([*apart.here.enter, *command], check=True)
    offline = federation(start, system=SSP, host=apart.here)
    assert "needs an IPv4 address besides 127.0.0.1" in ended(offline, 2).splitlines()[-1]
