"""A federation over two hosts, network namespaces with a link between them, and on one offline."""

import subprocess
from pathlib import Path

from tests.federation.processes import Process, Start, federation, wait_for_steps
from tests.support.hosts import DEVICE, Network
from tests.support.ssp_files import SSP, edited, replace

LIMIT = 90.0  # s


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
        text, _ = process.communicate(timeout=LIMIT)
        assert process.returncode == 0, text


def test_a_lost_link_ends_both(start: Start, apart: Network, tmp_path: Path) -> None:
    long = edited(
        SSP,
        tmp_path / "Long.ssp",
        {"SystemStructure.ssd": replace('stopTime="6"', 'stopTime="600"')},
    )
    here, there = apart_from_the_arm(start, apart, long, "--silence", "10")
    wait_for_steps(here)
    apart.cut()
    for process, words in ((here, "arm has been silent"), (there, "23404 has been silent")):
        text, _ = process.communicate(timeout=LIMIT)
        assert process.returncode == 2, text
        assert f"{words} for 10 s" in text.splitlines()[-1]


def test_what_a_host_without_a_network_lacks_is_said(start: Start, apart: Network) -> None:
    command = ("ip", "address", "flush", "dev", DEVICE)
    subprocess.run([*apart.here.enter, *command], check=True)
    offline = federation(start, system=SSP, host=apart.here)
    text, _ = offline.communicate(timeout=LIMIT)
    assert offline.returncode == 2
    assert "needs an IPv4 address besides 127.0.0.1" in text.splitlines()[-1]
