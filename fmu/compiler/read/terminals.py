"""Terminals of a file with equations: inputs and outputs that are connected together."""

from declaration.load import reason
from declaration.schema import File, Terminal
from pydantic import ValidationError

from ..expressions.hints import meant
from .content import COUNTS, SWITCHES, ModelFile, ModelFileError, placed

OUTSIDE = ("inputs", "states", "outputs", SWITCHES, "discrete", COUNTS)  # inputs and outputs
FLOWING = OUTSIDE[:3]


def read(file: ModelFile, given: dict[str, object]) -> None:
    """Read [terminals]; ModelFileError where a member is no input or output."""
    try:
        file.terminals = File.model_validate({"terminals": given}).terminals
    except ValidationError as error:
        # a misspelt key comes before the one that is then missing
        mistakes = error.errors(include_url=False)
        mistake = min(mistakes, key=lambda m: m["type"] != "extra_forbidden")
        location, depth = [*map(str, mistake["loc"])], 2
        while location[depth : depth + 1] == ["terminals"] and len(location) > depth + 1:
            depth += 2
        why = reason(mistake, Terminal, ".".join(location[depth:]))
        raise ModelFileError(f"[{'.'.join(location[:depth])}]: {why}") from None
    for name, terminal in file.terminals.items():
        _check(file, f"terminals.{name}", terminal)


def _check(file: ModelFile, place: str, terminal: Terminal) -> None:
    """Check that members are inputs and outputs, and that flows are continuous."""
    known = {variable.name: variable for variable in file.of(*OUTSIDE)}
    for kind, member, name in terminal.members:
        with placed(f"[{place}]", f"{kind} {member}"):
            if name not in known:
                what = f"expected an input or output, got '{name}'"
                raise ModelFileError(what + meant(name, known))
            if kind != "signal" and known[name].section not in FLOWING:
                raise ModelFileError(f"expected a real number that flows, got '{name}'")
    for name, inner in terminal.terminals.items():
        _check(file, f"{place}.terminals.{name}", inner)
