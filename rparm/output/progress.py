"""Progress bars on standard error."""

import sys
from contextlib import AbstractContextManager

from tqdm import tqdm

from rparm.output import streams

DELAY = 1.0  # s, shorter activities show nothing


class Progress(AbstractContextManager["Progress"]):
    """A live bar on stderr, once an activity has taken about a second; nothing if not a terminal.

    Call it with the number of steps (or of what `counted` names) done since the last call.
    """

    def __init__(self, label: str, total: int, counted: str = "steps") -> None:
        self._bar = None
        if sys.stderr.isatty() and not streams.is_quiet():
            self._bar = tqdm(
                total=total,
                desc=label,
                unit=f" {counted}",
                unit_scale=total >= 10_000,
                delay=DELAY,
                leave=False,
            )

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, done: int) -> None:
        if self._bar is not None:
            self._bar.update(done)
