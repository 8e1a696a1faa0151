"""Standard error, where HELICS writes on its own when connections end."""

import os
import sys
from contextlib import suppress

STDERR = 2  # file descriptor, to which libraries write
_is_apart = False


def apart() -> None:
    """Give Python its own standard error from now on: to be called as the program starts."""
    global _is_apart
    with suppress(OSError, ValueError, AttributeError):  # closed, or not of the system
        stream = sys.stderr
        if not _is_apart and stream.fileno() == STDERR:
            stream.flush()
            own = os.dup(STDERR)
            sys.stderr = os.fdopen(own, "w", 1, stream.encoding, stream.errors)
            _is_apart = True


def mute() -> None:
    """Discard what libraries write from now on, if Python's messages are `apart`."""
    if _is_apart:
        with suppress(OSError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, STDERR)
            os.close(nowhere)
