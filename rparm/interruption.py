"""Signals that end the program: where they must wait, and temporary folders that they do not leave.

An exception of a signal comes between any two instructions: also between the making of a folder,
or of a process, and the assignment that remembers it.
"""

import os
import signal
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NoReturn

# Windows has no SIGHUP, SIGBREAK is its Ctrl-Break and closed console
ENDINGS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")

_received: list[int] = []  # since the handlers are there
_waiting: list[int] = []  # of these, those held back by a block
_depth = 0  # of blocks that signals must not interrupt


def handle_endings() -> list[int]:
    """Let `ENDINGS` raise from now on, in the main thread; the list gets what arrives."""
    for ending in (getattr(signal, name) for name in ENDINGS if hasattr(signal, name)):
        # else it is ignored: nohup does so
        if signal.getsignal(ending) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(ending, _stop)
    return _received


def arrived() -> bool:
    """Return whether a signal has arrived that ends the program."""
    return bool(_received)


def _stop(number: int, _: object) -> None:
    _received.append(number)
    if _depth:
        _waiting.append(number)
    else:
        _end(number)


def _end(number: int) -> NoReturn:
    raise KeyboardInterrupt if number == signal.SIGINT else SystemExit(128 + number)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let signals wait until the end of the block: for a few instructions that must be one."""
    global _depth
    _depth += 1
    try:
        yield
    finally:
        _depth -= 1
        if _waiting and not _depth:
            number = _waiting[0]
            _waiting.clear()
            _end(number)


@contextmanager
def temporary_folder(within: Path | None = None) -> Iterator[Path]:
    """Make a folder in `within`, or where temporary files are; it is removed in any end."""
    with uninterrupted():
        # Windows does not remove a library that is still loaded, as after a fatal error, nor files
        # that a program of a run that was interrupted still holds
        folder = TemporaryDirectory(prefix="rparm-", dir=within, ignore_cleanup_errors=True)
    try:
        yield Path(folder.name)
    finally:
        with uninterrupted():
            folder.cleanup()


def run_group(command: Sequence[object], **options: Any) -> subprocess.CompletedProcess:
    """Run a program as subprocess.run does; an interruption kills its whole process group."""
    child = None
    try:
        with uninterrupted():
            child = subprocess.Popen(
                command, process_group=0 if os.name == "posix" else None, **options
            )
        output, errors = child.communicate()
    except BaseException:
        if child is not None:
            with uninterrupted():
                _kill(child)
                child.communicate()
        raise
    return subprocess.CompletedProcess(command, child.returncode, output, errors)


def _kill(child: subprocess.Popen) -> None:
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError):  # it has just ended
            os.killpg(child.pid, signal.SIGKILL)
    else:
        child.kill()
