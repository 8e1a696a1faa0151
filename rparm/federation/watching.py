"""Runs work that waits in HELICS in a thread: HELICS has no time limit and ignores signals."""

import os
import signal
import sys
from collections.abc import Callable
from concurrent.futures import Future, wait
from threading import Event, Thread
from typing import TypeVar

from rparm.federation import screen
from rparm.federation.network import Federate
from rparm.interruption import ENDINGS

Result = TypeVar("Result")

POLL = 0.05  # s, between two looks
LEAVE = 2.0  # s, for work and processes to end after a failure


def run(
    work: Callable[[], Result], look: Callable[[], None], end: Callable[[BaseException], None]
) -> Result:
    """Do `work`, and `look` now and then; `end` both if one fails or a signal arrives."""
    outcome: Future[Result] = Future()

    def do() -> None:
        if hasattr(signal, "pthread_sigmask"):  # also for the threads of HELICS that begin here
            endings = {getattr(signal, name) for name in ENDINGS if hasattr(signal, name)}
            signal.pthread_sigmask(signal.SIG_BLOCK, endings)
        try:
            outcome.set_result(work())
        except BaseException as error:
            outcome.set_exception(error)

    try:
        Thread(target=do, daemon=True).start()
        while not wait([outcome], POLL).done:
            look()
        return outcome.result()
    except BaseException as error:
        screen.mute()
        end(error)
        wait([outcome], LEAVE)
        raise


class Silence:
    """Detects calls of HELICS that take too long; counts polls, so suspension does not count."""

    def __init__(self, federate: Federate, limit: float) -> None:
        self._federate, self._limit = federate, limit
        self._calls, self._looks = federate.calls, 0

    def too_long(self) -> bool:
        """For each look: whether the limit is reached since the last call, or the last True."""
        is_new = self._federate.calls != self._calls
        self._calls, self._looks = self._federate.calls, 0 if is_new else self._looks + 1
        if self._looks * POLL < self._limit:
            return False
        self._looks = 0
        return True


def end_of_input() -> Event:
    """Set as soon as standard input is at its end: its other side has closed it, or is gone."""
    ended = Event()

    def read() -> None:
        # no buffer: the interpreter could not close one that a thread still reads
        while os.read(sys.__stdin__.fileno(), 1024):
            pass
        ended.set()

    Thread(target=read, daemon=True).start()
    return ended
