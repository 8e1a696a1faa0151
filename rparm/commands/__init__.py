"""What the commands do: a module each.

Each has a DESCRIPTION for its help, `add_options`, and `run`, which takes the options.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from rparm.errors import UserError


@dataclass(frozen=True)
class Ended:
    code: int  # to exit with
    verdict: str  # the last line
    document: Mapping[str, object] = field(default_factory=dict)  # for programs
    error: UserError | None = None
    page: Path | None = None  # that --open shows
