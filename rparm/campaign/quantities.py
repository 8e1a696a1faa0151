"""Values with units in a campaign: made numbers in the units of their variables."""

from collections.abc import Iterator
from typing import Any

from rparm.campaign.bases import Base
from rparm.campaign.campaign_file import Campaign, checked
from rparm.errors import WrongValueError, placed
from rparm.units import quantity


def in_si(campaign: Campaign, base: Base, where: object) -> Campaign:
    """The campaign with numbers for values with units; UserError, at `where`, if one is wrong."""
    converter = _Converter(base, where)
    content = campaign.model_dump(exclude_unset=True)
    for name, distribution in content["parameters"].items():
        for kind, given in distribution.items():
            if isinstance(given, list):
                place = f"[parameters.{name}] {kind}"
                is_deviation = kind == "normal"
                distribution[kind] = [
                    converter.number(number, name, place, is_deviation and i == 1)
                    for i, number in enumerate(given)
                ]
    for name, given in content.get("set", {}).items():
        if converter.is_real(name):
            content["set"][name] = converter.number(given, name, f"[set] {name}")
    for kind, key, is_difference in (
        ("settling", "target", False),
        ("settling", "band", True),
        ("crossings", "level", False),
    ):
        for name, table in content["keep"].get(kind, {}).items():
            place = f"[keep.{kind}.{name}] {key}"
            table[key] = converter.number(table[key], table["variable"], place, is_difference)
    return checked(content, where)


def questions(campaign: Campaign, base: Base) -> Iterator[str]:
    """Questions about start values: angles without a unit beyond one turn."""
    given = {name: (f"[set] {name}", [value]) for name, value in campaign.set.items()}
    for name, distribution in campaign.parameters.items():
        values = distribution.numbers[: 1 if distribution.kind == "normal" else None]
        given[name] = (f"[parameters.{name}]", values)
    for name, (place, values) in given.items():
        try:
            variable = base.variable(name)[1]
        except WrongValueError:  # of an expression, or refused later
            continue
        asked = next(filter(None, map(variable.question, values)), "")
        if asked:
            yield f"{place}: {asked}"


class _Converter:
    def __init__(self, base: Base, where: object) -> None:
        self._base, self._where = base, where

    def is_real(self, name: str) -> bool:
        """Whether it is a variable of type Real; others take texts that are no numbers."""
        try:
            return self._base.variable(name)[1].type == "Real"
        except WrongValueError:  # refused later
            return False

    def number(self, given: Any, name: str, place: str, is_difference: bool = False) -> Any:
        """What is given for a variable: a text with a unit as a number."""
        if not isinstance(given, str):
            return given
        with placed(f"{self._where}: {place}: without a variable no unit"):
            known = self._base.variable(name)[1].units
        with placed(f"{self._where}: {place}"):
            return quantity(given, known, is_difference)
