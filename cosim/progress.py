"""How far an activity is, on standard error."""

import sys
import time

from tqdm import tqdm

DELAY = 1.0  # s, shorter activities show nothing
LINE_EVERY = 5.0  # s, if the output is not a terminal


class Progress:
    """Shows on stderr how far an activity is, once it has taken about a second.

    On a terminal that is a live bar, elsewhere a line every few seconds. Call it with the number
    of steps (or of what `counted` names) done since the last call.
    """

    def __init__(self, label: str, total: int, counted: str = "steps") -> None:
        self._label, self._total, self._done = label, total, 0
        self._start = time.monotonic()
        self._next_line = self._start + LINE_EVERY
        self._bar = None
        if sys.stderr.isatty():
            self._bar = tqdm(
                total=total,
                desc=label,
                unit=f" {counted}",
                unit_scale=total >= 10_000,
                delay=DELAY,
                leave=False,
            )

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, done: int) -> None:
        if self._bar is not None:
            self._bar.update(done)
            return
        self._done += done
        now = time.monotonic()
        if now >= self._next_line:
            self._next_line = now + LINE_EVERY
            percent = 100 * self._done // max(self._total, 1)
            elapsed = now - self._start
            print(f"{self._label}: {percent} %, {elapsed:.0f} s", file=sys.stderr, flush=True)
