"""Where and how commands print: streams, stages, tables of at most 80 columns, progress."""

import json
import math
import os
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from contextlib import AbstractContextManager, ExitStack, contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import Any, TextIO

from rparm.errors import counted, shortened

_quiet = False
WIDTH = 80  # columns that a terminal has, if it has no fewer
LEAST = 20  # columns: in fewer, lines are left to the terminal to wrap
NARROWEST = 8  # a column of names
INDENT = "  "
NAMED = 5  # failed things in the last line
DELAY = 1.0  # s, shorter activities show nothing


# ---- Streams -------------------------------------------------------------------------------------
def is_quiet() -> bool:
    """Return whether the user wants to see the end only."""
    return _quiet


@contextmanager
def results_stream(as_json: bool, quiet: bool) -> Iterator[TextIO | None]:
    """Yield the stream of a command's result; all else goes to standard error, or is dropped."""
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


def json_line(content: Mapping[str, object]) -> str:
    """Return JSON in one line; numbers that are not finite become null."""
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


# ---- Lines and tables ----------------------------------------------------------------------------
def width() -> int:
    """Return the columns to fill: as many as the terminal has, within limits."""
    return max(min(WIDTH, shutil.get_terminal_size((WIDTH, 24)).columns), LEAST)


def stage(text: str) -> None:
    """Name the stage that begins, on a terminal."""
    if sys.stderr is not None and sys.stderr.isatty() and not is_quiet():
        print(f"{text} ...", file=sys.stderr, flush=True)


def messages(label: str, texts: Iterable[str]) -> None:
    """Print what an FMU or an engine has to say, to standard error."""
    for text in dict.fromkeys(texts):
        print(f"{label}: {text}", file=sys.stderr)


def titles(named: Sequence[Mapping[str, str]]) -> str:
    """Write lines with the "name" and the "title" of each thing."""
    room = width()
    column = min(max((len(entry["name"]) for entry in named), default=0), room // 2)
    lines = []
    for entry in named:
        wrapped = textwrap.wrap(entry["title"], room - column - 2) or [""]
        lines.append(f"{shortened(entry['name'], column):<{column}}  {wrapped[0]}")
        lines += [" " * (column + 2) + more for more in wrapped[1:]]
    return "\n".join(lines)


def verdict_line(failed: Iterable[str], done: Sized, name: str) -> str:
    """Write the last line of a command: how many things have passed, or which have failed."""
    names = list(dict.fromkeys(failed))
    if not names:
        return f"passed: {counted(done, name)}"
    some = [*names[:NAMED], f"{len(names) - NAMED} more"] if len(names) > NAMED + 1 else names
    text = f"failed: {counted(names, name)}"
    whole = f"{text}: {', '.join(some)}"
    return textwrap.shorten(whole, max(width(), len(text)), placeholder=" ...")


class PrintedTable:
    """Rows under a head, each printed when it is known.

    `names`, of all rows to come, set the width of the first column, which is cut if it has no room.
    `columns` are titles with widths, `gap` blanks apart; the last one is `result` wide (0: none).
    """

    def __init__(
        self,
        title: str,
        names: Iterable[str],
        columns: Mapping[str, int],
        gap: int = 2,
        result: int = 6,
    ) -> None:
        self._gap, self._columns = " " * gap, list(columns.values())
        taken = sum(self._columns) + gap * len(columns) + (len(INDENT) + result if result else 0)
        wanted = max(map(len, (title, *names)))
        self._width = min(wanted, max(width() - taken, NARROWEST))
        titles = [textwrap.wrap(text, columns[text]) or [""] for text in columns]
        height = max(map(len, titles), default=1)
        for i in range(height):
            last = i == height - 1
            cells = [([""] * height + lines)[len(lines) + i] for lines in titles]
            result_title = "result" if last and result else ""
            print(self._line(title if last else "", cells, result_title))
        print("-" * (self._width + taken), flush=True)

    def _line(self, name: str, cells: Sequence[str], result: str) -> str:
        name = shortened(name, self._width)
        padded = zip(cells, self._columns, strict=True)
        numbers = "".join(f"{self._gap}{cell:>{wide}}" for cell, wide in padded)
        return f"{name:<{self._width}}{numbers}{INDENT}{result}".rstrip()

    def row(self, name: str, cells: Sequence[str], result: str = "") -> None:
        print(self._line(name, cells, result), flush=True)


def plain_table(title: str, head: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print a table that is complete, under its title."""
    cells = [[str(cell) for cell in row] for row in (head, *rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    print(f"\n{title}")
    for row in cells:
        padded = [f"{cell:<{wide}}" for cell, wide in zip(row, widths, strict=True)]
        print((INDENT + INDENT.join(padded)).rstrip(), flush=True)


def remark(text: str) -> None:
    """Print a text, wrapped and indented."""
    indents = {"initial_indent": INDENT, "subsequent_indent": 2 * INDENT}
    wrapped = textwrap.wrap(text, width(), break_on_hyphens=False, **indents)
    print(*wrapped, sep="\n", flush=True)


# ---- Progress ------------------------------------------------------------------------------------
class Progress(AbstractContextManager["Progress"]):
    """Live bar on a terminal's stderr, after about a second; call it with the steps just done."""

    def __init__(self, label: str, total: int, counted: str = "steps") -> None:
        self._bar = None
        if sys.stderr.isatty() and not is_quiet():
            from tqdm import tqdm  # takes time

            unit = {"unit": f" {counted}", "unit_scale": total >= 10_000}
            self._bar = tqdm(total=total, desc=label, delay=DELAY, leave=False, **unit)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, done: int) -> None:
        if self._bar is not None:
            self._bar.update(done)
