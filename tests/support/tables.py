"""Tables of tests, as TOML beside them."""

import tomllib
from pathlib import Path
from typing import Any


def tables(module: str) -> dict[str, Any]:
    """The tables of a test module, whose __file__ is given."""
    return tomllib.loads(Path(module).with_suffix(".toml").read_text(encoding="utf-8"))
