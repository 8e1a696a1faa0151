"""Names in C that follow from a file and its variables."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from itertools import groupby

OF_VALUES = "_values.h"  # behind the stem of a file: the header that is made of it


def c_name(prefix: str, name: str) -> str:
    """Return the name in C of a variable or of an element, which no other has with the prefix."""
    base, *indexes = re.findall(r"\w+", name)
    return "_".join([f"{prefix}{len(indexes) or ''}", base, *indexes])


class Field(str):
    """The text in C of a field of the value structure; an element of an array has an index."""

    __slots__ = ("base", "index")

    def __new__(cls, base: str, index: int | None = None) -> Field:
        field = super().__new__(cls, base if index is None else f"{base}[{index}]")
        field.base, field.index = base, index
        return field


class OwnFields:
    """Fields in C by hand, which have the names of their variables."""

    def value(self, name: str) -> Field:
        """A variable of any kind."""
        return Field(name.replace(",", "]["))

    count = value


class Fields:
    """Names in C of variables: elements of one array that follow each other share an array of C."""

    def __init__(self, sections: Iterable[Iterable[str]]) -> None:
        self.suffixes: dict[str, tuple[str, int | None]] = {}
        for names in sections:
            for base, run in groupby(names, lambda name: name.partition("[")[0]):
                elements = [*run]
                for i, name in enumerate(elements):
                    is_element = "[" in name
                    own = c_name("", elements[0] if is_element else base)
                    self.suffixes[name] = own, i if is_element else None

    def _of(self, prefix: str, name: str) -> Field:
        own, index = self.suffixes[name]
        return Field(prefix + own, index)

    def value(self, name: str) -> Field:
        """A number."""
        return self._of("v", name)

    def count(self, name: str) -> Field:
        """A condition, whole number or enumeration."""
        return self._of("m", name)

    def rate(self, name: str) -> Field:
        """The derivative of a state."""
        return self._of("d", name)


class StructFields:
    """Names in C of variables in the struct of values of a header."""

    def __init__(self, places: Mapping[tuple[str | int, ...], str], rates: str, states: list[str]):
        self.places: dict[str, Field] = {}
        for place, name in places.items():
            names = ".".join(part for part in place if isinstance(part, str))
            indexes = [part for part in place if isinstance(part, int)]
            base = names + "".join(f"[{i}]" for i in indexes[:-1])
            self.places[name] = Field(base, indexes[-1] if indexes else None)
        self.rates = {name: Field(rates, i) for i, name in enumerate(states)}

    def value(self, name: str) -> Field:
        """A variable of any kind."""
        return self.places[name]

    count = value

    def rate(self, name: str) -> Field:
        """The derivative of a state."""
        return self.rates[name]
