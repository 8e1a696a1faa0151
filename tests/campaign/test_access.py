"""Who reaches the processes of a campaign on this machine: nobody but its own processes."""

import json
import os
import re
import socket
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from distributed import Client

from rparm.campaign import engine
from tests.campaign.cluster import processes
from tests.campaign.cluster.processes import ENVIRONMENT
from tests.campaign.files import write

CHANGES = [("runs = 40", "runs = 240"), ("block = 8", "block = 6")]


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with engine.opened_cluster(None, 1, tmp_path_factory.mktemp("workers")) as client:
        yield client


def addresses(client: Client) -> list[str]:
    """Of scheduler, worker and nanny."""
    (worker,) = client.scheduler_info()["workers"].values()
    (address,) = client.scheduler_info()["workers"]
    return [client.scheduler.address, address, worker["nanny"]]


def test_strangers_are_refused(client: Client, user: int | None) -> None:
    places = [address.removeprefix("tls://") for address in addresses(client)]
    own = client.security
    given = {"user": user, "places": places, "cert": own.tls_client_cert, "key": own.tls_client_key}
    child = processes.python("tests.campaign.cluster.stranger", input=True)
    out, err = child.communicate(json.dumps(given))
    assert child.returncode == 0, err
    said = json.loads(out)
    assert said["user"] == (os.getuid() if user is None else user)
    expected = {
        "plain": False,
        "without certificate": False,
        "own certificate": False,
        "right certificate": True,
    }
    assert said["answers"] == dict.fromkeys(places, expected)


@pytest.mark.parametrize("scheme", ["tcp", "tls"])
def test_a_client_without_credentials_is_refused(client: Client, scheme: str) -> None:
    address = client.scheduler.address.replace("tls", scheme)
    with pytest.raises((OSError, TypeError)):
        Client(address, timeout=2)


def listening(process: psutil.Process) -> set[tuple[str, int]]:
    """Where a process and those that it started take messages from the network."""
    found = set()
    for each in [process, *process.children(recursive=True)]:
        for connection in each.net_connections(kind="inet"):
            is_udp = connection.type == socket.SOCK_DGRAM
            if is_udp or connection.status == psutil.CONN_LISTEN:
                found.add(tuple(connection.laddr))
    return found


def shows_pages(port: int) -> bool:
    """Whether a server of pages listens at a port."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/status", timeout=10) as answer:
            return answer.status == 200
    except urllib.error.HTTPError:  # it has another one
        return True
    except (OSError, ValueError):
        return False


@pytest.mark.parametrize("options", [(), ("--no-dashboard",)])
def test_only_this_machine_reaches_a_campaign(
    options: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setitem(ENVIRONMENT, "TMPDIR", str(temporary))
    file = write(tmp_path, changes=CHANGES)
    output = tmp_path / "output"
    process = processes.start(file, output, "--workers", 2, *options)
    processes.wait_for(lambda: processes.blocks(output) >= 1 or process.poll() is not None)
    found = listening(psutil.Process(process.pid))
    pages = {port for _, port in found if shows_pages(port)}
    for each in psutil.Process(process.pid).children(recursive=True):
        assert "PRIVATE" not in f"{each.cmdline()}{each.environ()}"
    for path in (*temporary.rglob("*"), *output.rglob("*")):
        assert not path.is_file() or b"PRIVATE KEY" not in path.read_bytes()
    processes.kill_group(process)
    out, err = process.communicate()
    assert {address for address, _ in found} == {"127.0.0.1"}, err
    printed = {int(port) for port in re.findall(r"dashboard: http://127\.0\.0\.1:(\d+)/", out)}
    assert pages == printed
    assert len(pages) == (0 if options else 1)
    assert len(found - {("127.0.0.1", port) for port in pages}) == 5  # scheduler, workers, nannies
