"""Terminals of a file with equations: inputs and outputs that are connected together."""

import re
from collections.abc import Mapping

from ..expressions.hints import meant
from ..interface import Terminal
from .content import COUNTS, SWITCHES, ModelFile, ModelFileError, Variable, placed, shown
from .keys import TERMINAL, entries

OUTSIDE = ("inputs", "states", "outputs", SWITCHES, "discrete", COUNTS)  # inputs and outputs
FLOWING = OUTSIDE[:3]
NAME = re.compile("[A-Za-z_][A-Za-z0-9_]*", re.ASCII)


def read(file: ModelFile, given: Mapping[str, object]) -> dict[str, Terminal]:
    """Read [terminals]; ModelFileError where a member is no input or output."""
    known = {variable.name: variable for variable in file.of(*OUTSIDE)}
    return _terminals("terminals", given, known)


def _terminals(
    above: str, given: Mapping[str, object], known: Mapping[str, Variable]
) -> dict[str, Terminal]:
    found = {}
    for name, entry in given.items():
        place = f"{above}.{name}"
        with placed(f"[{place}]"):
            _check_name(name)
            keys = entries(entry, TERMINAL, "rule")
            if "description" not in keys:
                raise ModelFileError("description is missing")
            inner = keys.pop("terminals", {})
            terminal = Terminal(**keys)
            if not (terminal.members or inner):
                raise ModelFileError("has no members and no terminals")
            _check_members(terminal, known)
        inner = _terminals(f"{place}.terminals", inner, known)
        found[name] = Terminal(**keys, terminals=inner)
    return found


def _check_members(terminal: Terminal, known: Mapping[str, Variable]) -> None:
    """Check that members are inputs and outputs, and that flows are continuous."""
    members: set[str] = set()
    for kind, member, name in terminal.members:
        with placed(f"{kind} {member}"):
            _check_name(member)
            if member in members:
                raise ModelFileError(f"member '{member}' is declared twice")
            members.add(member)
            if name not in known:
                what = f"expected an input or output, got {shown(name)}"
                raise ModelFileError(what + meant(name, known))
            if kind != "signal" and known[name].section not in FLOWING:
                raise ModelFileError(f"expected a real number that flows, got {shown(name)}")


def _check_name(name: str) -> None:
    if not NAME.fullmatch(name):
        raise ModelFileError("expected a name: a letter or _, then letters, digits, _")
