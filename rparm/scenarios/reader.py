"""Takes checked values from the TOML file of a scenario."""

from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NoReturn

from rparm.errors import UserError, hint, placed
from rparm.files import show
from rparm.units import Units, finite_number, quantity


class Reader:
    """Takes checked values from one file; errors name the file and the key."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def fail(self, message: str) -> NoReturn:
        raise UserError(f"{self.path}: {message}")

    def placed(self, key: str) -> AbstractContextManager[None]:
        """Where values are checked that this key has."""
        return placed(f"{self.path}: {key}")

    def number(self, value: Any, key: str) -> float:
        with self.placed(key):
            return finite_number(value)

    def quantity(self, value: Any, key: str, known: Units, is_difference: bool = False) -> float:
        """A number, or a text with a number and one of the `known` units."""
        with self.placed(key):
            return quantity(value, known, is_difference)

    def text(self, value: Any, key: str) -> str:
        if not isinstance(value, str) or not value.strip():
            self.fail(f"{key}: expected a text, got {show(value)}")
        return value.strip()

    def table(self, value: Any, key: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            self.fail(f"{key}: expected a table, got {show(value)}")
        return value

    def array(self, value: Any, key: str, of: str) -> list[Any]:
        if not isinstance(value, list) or not value:
            self.fail(f"{key}: expected a list of {of}, got {show(value)}")
        return value

    def keys(
        self, table: dict, where: str, required: Iterable[str] = (), optional: Iterable[str] = ()
    ) -> None:
        known = [*required, *optional]
        begin = f"{where}: " if where else ""
        for key in table:
            if key not in known:
                self.fail(f"{begin}unknown key {key!r}{hint(key, known)}")
        for key in required:
            if key not in table:
                self.fail(f"{begin}missing key {key!r}")
