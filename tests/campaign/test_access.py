"""Who reaches the processes of a campaign: its own ones, and those with certificates."""

import json
import os
import re
import socket
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import dask
import psutil
import pytest
from distributed import Client

from rparm.campaign import engine
from rparm.errors import UserError
from tests.campaign.cluster import certificates, processes
from tests.campaign.cluster.processes import ENVIRONMENT
from tests.campaign.files import write
from tests.support.hosts import LOOPBACK
from tests.support.rparm_project import Console

# ---- On this machine -----------------------------------------------------------------------------


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
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/status", timeout=60) as answer:
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


# ---- A scheduler elsewhere -----------------------------------------------------------------------


Files = tuple[Path, Path, Path]
FEW = [("runs = 40", "runs = 8"), ("[3, 17]", "[3]")]
TLS, TCP = "tls://127.0.0.1:1", "tcp://127.0.0.1:1"


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return certificates.make(tmp_path_factory.mktemp("own") / "certificates")


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Files:
    """Of another authority."""
    return certificates.make(tmp_path_factory.mktemp("other") / "certificates")


def options(ca: Path, cert: Path, key: Path) -> list[str]:
    return ["--tls-ca", str(ca), "--tls-cert", str(cert), "--tls-key", str(key)]


def test_a_cluster_with_certificates(own: Files, other: Files, tmp_path: Path) -> None:
    file = write(tmp_path, changes=FEW)
    expected = processes.completed(file, tmp_path / "here", "--workers", 1)
    with processes.cluster(LOOPBACK, [LOOPBACK], own) as (address, *_):
        given = ("--scheduler", address, *options(*own))
        assert processes.completed(file, tmp_path / "elsewhere", *given) == expected
        plain = address.replace("tls", "tcp")
        for place, files in (
            (address, other),
            (address, (own[0], *other[1:])),
            (address, (other[0], *own[1:])),
            (plain, (None, None, None)),
        ):
            security = engine.security_for(place, *files)
            words = re.escape(f"{place}: the scheduler cannot be reached: ") + "[^\n]+$"
            with (
                pytest.raises(UserError, match=words),
                engine.opened_cluster(place, None, tmp_path, security),
            ):
                pass


def test_wrong_certificates_are_refused(
    own: Files, other: Files, tmp_path: Path, console: Console
) -> None:
    """Before anything runs, in one line."""
    ca, cert, key = own
    garbage, none = tmp_path / "garbage.pem", tmp_path / "none.pem"
    garbage.write_text("-----BEGIN CERTIFICATE-----\nx\n-----END CERTIFICATE-----\n")
    locked = certificates.make(tmp_path / "locked", b"secret")
    cases = [
        ([TLS], f"{TLS}: needs certificates: --tls-ca, --tls-cert, --tls-key, or those of Dask's"),
        ([TLS, "--tls-ca", str(ca)], "--tls-cert, --tls-key: missing, tls://127.0.0.1:1 needs"),
        ([TLS, *options(*own)[:4]], "--tls-key: missing"),
        ([TCP, *options(*own)], f"--tls-ca: {TCP} takes no certificates, expected an address as"),
        (["127.0.0.1:1", *options(*own)], "--tls-ca: 127.0.0.1:1 takes no certificates"),
        ([TLS, *options(none, cert, key)], f"{none}: no such file"),
        ([TLS, *options(ca, none, key)], f"{none}: no such file"),
        ([TLS, *options(ca, cert, none)], f"{none}: no such file"),
        ([TLS, *options(Path("/dev/zero"), cert, key)], "/dev/zero: cannot be read: is a device"),
        ([TLS, *options(tmp_path, cert, key)], f"{tmp_path}: is not the certificate of an auth"),
        ([TLS, *options(garbage, cert, key)], f"{garbage}: is not the certificate of an authority"),
        ([TLS, *options(ca, garbage, key)], f"{garbage}, {key}: are not a certificate and its"),
        ([TLS, *options(ca, cert, garbage)], f"{cert}, {garbage}: are not a certificate and its"),
        ([TLS, *options(ca, cert, other[2])], f"{cert}, {other[2]}: are not a certificate and its"),
        ([TLS, *options(*locked)], "private key without a password"),
        ([TCP, "--no-dashboard"], "--no-dashboard: a --scheduler has its own dashboard"),
        (["nonsense://x"], "nonsense://x: the scheduler cannot be reached"),
    ]
    command = ("campaign", write(tmp_path, changes=FEW), "--output", tmp_path / "out")
    for arguments, words in cases:
        assert words in console.failed(*command, "--scheduler", *arguments)
    assert "are for a --scheduler" in console.failed(*command, *options(*own))


def test_dasks_configuration_has_certificates(own: Files, other: Files) -> None:
    def configured(ca: Path, cert: Path, key: Path) -> dask.config.set:
        names = ("ca-file", "client.cert", "client.key")
        values = map(str, (ca, cert, key))
        return dask.config.set(
            {f"distributed.comm.tls.{n}": v for n, v in zip(names, values, strict=True)}
        )

    with configured(*own):
        made = engine.security_for(TLS, None, None, None)
        assert made.get_tls_config_for_role("client")["key"] == str(own[2])
        assert made.require_encryption
        given = engine.security_for(TLS, *other)  # those of the command line go before
        assert given.get_tls_config_for_role("client")["ca_file"] == str(other[0])
    with (
        configured(*own[:2], other[2]),
        pytest.raises(UserError, match="are not a certificate and its private key"),
    ):
        engine.security_for(TLS, None, None, None)
