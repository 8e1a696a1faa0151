"""Where commands print: tables and messages, apart from the one document that programs read."""

import json
import math
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import Any, TextIO

_quiet = False


def is_quiet() -> bool:
    """Whether the user wants to see the end only."""
    return _quiet


@contextmanager
def of_results(as_json: bool, quiet: bool) -> Iterator[TextIO | None]:
    """The stream for a command's result; all else goes to standard error, or nowhere if `quiet`."""
    global _quiet
    real, before, _quiet = sys.stdout, _quiet, quiet
    try:
        with ExitStack() as stack:
            if real is not None and (as_json or quiet):
                null = stack.enter_context(
                    Path(os.devnull).open(
                        "w", encoding="utf-8", errors="backslashreplace", newline="\n"
                    )
                )
                elsewhere = null if quiet or sys.stderr is None else sys.stderr
                real = stack.enter_context(_apart(real, elsewhere))
                stack.enter_context(redirect_stdout(elsewhere))
            yield real
    finally:
        _quiet = before


@contextmanager
def _apart(real: TextIO, elsewhere: TextIO) -> Iterator[TextIO]:
    """Lead standard output elsewhere, of compiled code and child processes too; a stream to it."""
    try:
        number, other = real.fileno(), elsewhere.fileno()
    except (OSError, ValueError):  # none of the system
        yield real
        return
    real.flush()
    kept = os.dup(number)
    out = os.fdopen(os.dup(kept), "w", encoding=real.encoding, errors=real.errors)
    os.dup2(other, number)
    try:
        yield out
    finally:
        with suppress(OSError):  # full, or nobody reads it: already reported
            out.close()
        os.dup2(kept, number)
        os.close(kept)


def document(content: Mapping[str, object]) -> str:
    """JSON in one line; numbers that are not finite become null."""
    return json.dumps(_plain(content), ensure_ascii=False)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "item"):  # of numpy
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, Path) else value
