"""Names in C of the variables of a file."""

import re
from collections.abc import Iterable
from itertools import groupby


def c_name(prefix: str, name: str) -> str:
    """Return the name in C of a variable or of an element, which no other has with the prefix."""
    base, *indexes = re.findall(r"\w+", name)
    return "_".join([f"{prefix}{len(indexes) or ''}", base, *indexes])


class Fields:
    """Names in C of variables: elements of one array that follow each other share an array of C."""

    def __init__(self, sections: Iterable[Iterable[str]]) -> None:
        self.suffixes: dict[str, str] = {}
        for names in sections:
            for base, run in groupby(names, lambda name: name.partition("[")[0]):
                elements = [*run]
                for i, name in enumerate(elements):
                    place = f"[{i}]" if "[" in name else ""
                    self.suffixes[name] = c_name("", elements[0] if place else base) + place

    def value(self, name: str) -> str:
        """A number."""
        return f"v{self.suffixes[name]}"

    def count(self, name: str) -> str:
        """A condition, whole number or enumeration."""
        return f"m{self.suffixes[name]}"

    def rate(self, name: str) -> str:
        """The derivative of a state."""
        return f"d{self.suffixes[name]}"
