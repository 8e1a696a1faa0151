"""Two hosts on this machine: network namespaces with a link of their own, or just loopback."""

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

TOOLS = ("ip", "nsenter", "unshare")
DEVICE = "veth"
REFUSED = 2  # exit code of ip: the kernel says no


@dataclass(frozen=True)
class Host:
    """Where programs run."""

    address: str
    enter: tuple[str, ...] = ()  # before the command of a program


LOOPBACK = Host("127.0.0.1")


class NotPermittedError(Exception):
    """The kernel permits no namespaces here."""


@dataclass(frozen=True)
class Network:
    """Two hosts and the link between them."""

    here: Host
    there: Host

    def cut(self) -> None:
        """Take the link down at the other host: no connection is closed."""
        _run(self.there, "ip", "link", "set", DEVICE, "down")

    def mend(self) -> None:
        """Bring it up again."""
        _run(self.there, "ip", "link", "set", DEVICE, "up")


def _run(host: Host, *command: str) -> None:
    try:
        subprocess.run([*host.enter, *command], check=True, capture_output=True, text=True)
    except subprocess.CalledProcessError as error:
        assert error.returncode == REFUSED, error.stderr
        raise NotPermittedError(error.stderr.strip()) from None


@contextmanager
def _namespace(*unshare: str) -> Iterator[int]:
    """A network namespace, by the process that keeps it."""
    keeper = subprocess.Popen(
        [*unshare, "--net", "cat"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with keeper:  # ends with its input, also if this process is killed
        try:
            with suppress(BrokenPipeError):
                print("made", file=keeper.stdin, flush=True)
            if keeper.stdout.readline() != "made\n":
                raise NotPermittedError(keeper.stderr.read().strip())
            yield keeper.pid
        finally:
            _kill_all_within(Path(f"/proc/{keeper.pid}/ns/net"))


def _kill_all_within(namespace: Path) -> None:
    """Kill all processes of a namespace, which ends it."""
    with suppress(OSError):
        which = namespace.readlink()
        for process in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                if (process / "ns/net").readlink() == which:
                    os.kill(int(process.name), signal.SIGKILL)


@contextmanager
def network() -> Iterator[Network]:
    """Two hosts that share no loopback.

    Raises
    ------
    FileNotFoundError
        If a tool is not installed.
    NotPermittedError
        If the kernel refuses.
    """
    for tool in TOOLS:
        if shutil.which(tool) is None:
            raise FileNotFoundError(f"{tool}: not installed")
    with ExitStack() as stack:
        # in a user namespace: needs no root
        first = stack.enter_context(_namespace("unshare", "--map-root-user"))
        within = ("nsenter", "--preserve-credentials", "--user", "--target")
        second = stack.enter_context(_namespace(*within, str(first), "unshare"))
        here, there = (
            Host(f"10.0.0.{i}", (*within, str(keeper), "--net"))
            for i, keeper in enumerate((first, second), 1)
        )
        pair = ("type", "veth", "peer", "name", DEVICE, "netns", str(second))
        _run(here, "ip", "link", "add", DEVICE, *pair)
        for host in (here, there):
            _run(host, "ip", "address", "add", f"{host.address}/24", "dev", DEVICE)
            for device in ("lo", DEVICE):
                _run(host, "ip", "link", "set", device, "up")
        yield Network(here, there)
