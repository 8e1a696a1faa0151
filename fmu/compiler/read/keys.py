"""The keys of a file with equations: which there are, and how their values are read.

Every mistake is a ModelFileError or a ValueError, in one line.
"""

import re
from collections.abc import Callable, Collection, Iterable
from fractions import Fraction
from typing import Any

from ..expressions.expression import FUNCTIONS, finite_number
from ..expressions.kinds import CONDITION, WHOLE, Kind
from ..expressions.parser import FURTHER, NO_NAMES
from ..units import ANGLE, BASE, whole
from .content import (
    ALGEBRAIC,
    BOOLEAN,
    COUNTS,
    FOLLOWS,
    INTEGER,
    OPTIONS,
    SWITCHES,
    ModelFileError,
    instead_of,
    placed,
    shown,
)

MOST_ENTRIES = 1000
MOST_SIZE = 20_000
LONGEST_TEXT = 1000  # characters of a description
LONGEST_MESSAGE = 500  # bytes: src/instance/state.c has no room for more
NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,99}", re.ASCII)
FIELD = re.compile(r"([A-Za-z_][A-Za-z0-9_]*\.)*[A-Za-z_][A-Za-z0-9_]*(\[[0-9]\])*")
CODE = re.compile(r'[^\x00-\x1f\\"]+\.[ch]')
# files that Windows cannot have, with any suffix
DEVICE = re.compile("(?i:con|prn|aux|nul|com[1-9]|lpt[1-9])")
CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
RESERVED = {*FUNCTIONS, *NO_NAMES, "pi", "time", "GUID", "NAME", "TOKEN_FMI3"}
TAKEN = {*RESERVED, *FURTHER, "sum", "der"}  # no names of functions
NUMBERS = ("start", "min", "max", "nominal")
CALCULATED = ("where", "outputs")
OF_VALUES = ("value", "unit", "description", "start", "variability", "derivative_of", "field")
OF_COUNTS = ("type", "value", "min", "max", "description", "field")
OF_ALL = ("start", "unit", "min", "max", "description", "field")
SECTIONS = {  # keys of their entries, and the one that each needs
    "parameters": ((*OF_ALL, "type", "variability"), "start"),
    "inputs": ((*OF_ALL, "type"), ""),
    "states": ((*OF_ALL, "nominal", "derivative", "derivative_of", "causality"), "derivative"),
    "discrete": (("start", "unit", "description", "type", "shown", "field"), ""),
    ALGEBRAIC: (("equation", *OF_ALL[:-1], "nominal"), "equation"),
    "where": ((*OF_VALUES, "type", "shown"), "value"),  # or expressions
    "outputs": ((*OF_VALUES, "type"), "value"),
}
OWN_KEYS = {
    FOLLOWS: (("value", "unit", "description", "field"), "value"),
    OPTIONS: (("type", "start", "min", "max", "description", "variability", "field"), "start"),
    SWITCHES: (("type", "start", "description", "field"), ""),
    COUNTS: (("type", "start", "min", "max", "description", "shown", "field"), ""),
    "where": ((*OF_COUNTS, "shown"), "value"),
    "outputs": (OF_COUNTS, "value"),
}
FOLLOWING_COUNTS = OWN_KEYS["outputs"]  # parameters that follow, as outputs
NOT_REAL = {"parameters": OPTIONS, "inputs": SWITCHES, "discrete": COUNTS}
NOT_REAL |= {section: section for section in CALCULATED}
HEAD = (
    *("name", "description", "include", "experiment", "modes", "code", "sizes", "units", "tables"),
    *("functions", "sampled", "events", "friction", "stops", "check", "terminals", "hook"),
    *("components", "connections", "calculate", "gradients"),
    *SECTIONS,
)
EXPERIMENT = {"stop": 10.0, "step": 0.01, "tolerance": 1e-8}
TABLE = ("x", "y", "z", "file", "interpolation", "outside")
MEMBERS = ("signals", "inflows", "outflows")
TERMINAL = ("rule", "description", *MEMBERS, "terminals")
EVENT = ("when", "while", "where", "reinit", "set", "terminate")
EFFECTS = ("set", "reinit", "terminate")
FRICTION = ("force", "velocity", "coulomb", "breakaway", "stribeck", "while")
STOPS = ("force", "position", "velocity", "lower", "upper", "restitution", "while")
GRADIENTS = ("by", "of")
HOOK = ("sources", "indicators", "series", "reads", "reach")
SAMPLER = ("every", "offset", "while", "where", "reinit", "set")
LARGEST_INTEGER = 2**31 - 1
NO_TABLES = ("name", "description", "include", "modes", "code", "calculate")
# of a file without equations, whose variables C by hand calculates
BY_HAND = ("name", "description", "include", "experiment", "sizes", "units", "terminals")
BY_HAND += ("indicators", "time_events", *SECTIONS)
OF_EQUATIONS = ("value", "derivative", "shown")
TABLES = ("reinit", "set", *(key for key in HEAD if key not in NO_TABLES))


def _expect(what: str, kind: type, fits: Callable[[Any], object]) -> Callable[[Any], Any]:
    """Return a function that refuses values unless they are of a kind and fit."""

    def read(value: Any) -> Any:
        if type(value) is not kind or not fits(value):
            raise ValueError(f"expected {what}")
        return value

    return read


def reason(name: str, is_rate: bool) -> str:
    """Say what has a reserved name."""
    if is_rate:
        return "derivatives of states begin with der_"
    if name in FUNCTIONS:
        return "it is a function"
    if name in ("pi", "time", *NO_NAMES):
        return "expressions use it"
    return "the C code uses it" if name in RESERVED else "the FMU has a variable of this name"


def named(name: str) -> str:
    """Return a name as messages have it: in quotes if it is none."""
    return name if re.fullmatch(rf"{NAME.pattern}(\[[^]]+\].*)?", name) else shown(name)


def plain_text(value: object) -> str:
    """Return a text in one line."""
    TEXT(value)
    if CONTROL.search(value):
        raise ModelFileError("has a control character")
    return " ".join(value.split())


def message(value: object) -> str:
    """Return the text of a message in one line."""
    text = plain_text(value)
    if len(text.encode()) > LONGEST_MESSAGE:
        raise ModelFileError(f"expected a message of at most {LONGEST_MESSAGE} bytes")
    return text


def _end(value: object) -> str:
    text = message(value)
    if not text:
        raise ValueError("expected why the simulation ends")
    return text


def _unit(value: object) -> str:
    unit = plain_text(value)
    if not unit:
        raise ValueError("expected a unit, or leave the key out")
    return unit


def _exponent(value: object) -> int | Fraction:
    if type(value) not in (int, float) or not abs(value) < 100 or (2 * value) % 1:
        raise ValueError("expected an exponent that is whole or a half")
    return whole(Fraction(value))


TEXT = _expect(
    f"a text of at most {LONGEST_TEXT} characters", str, lambda text: len(text) <= LONGEST_TEXT
)
LIST = _expect("a list of names", list, lambda names: all(type(name) is str for name in names))
TRUTH = _expect("true or false", bool, lambda _: True)
NAMES = _expect("a table of names", dict, lambda table: all(type(x) is str for x in table.values()))


def _modes(value: Any) -> list[tuple[str, Any]]:
    """Return the modes with their values at the start, or tables of their elements."""
    if isinstance(value, dict) and all(type(start) in (bool, dict) for start in value.values()):
        return [*value.items()]
    try:
        return [(name, False) for name in LIST(value)]
    except ValueError:
        raise ValueError("expected a list of names, or a table of true and false") from None


class Items(tuple[str, ...]):
    """The items of an enumeration, with their descriptions."""

    descriptions: dict[str, str]

    def __new__(cls, given: Iterable[str]) -> "Items":
        """Take the items, of a table with their descriptions."""
        found = super().__new__(cls, given)
        texts = given if isinstance(given, dict) else {}
        found.descriptions = {item: plain_text(texts.get(item, item)) for item in found}
        return found


def _type(value: Any) -> Kind:
    """Return the kind of variables of a type."""
    if value in (BOOLEAN, INTEGER):
        return CONDITION if value == BOOLEAN else WHOLE
    are_texts = isinstance(value, list | dict) and value and all(type(x) is str for x in value)
    if are_texts and len({*value}) == len(value) and all(map(NAME.fullmatch, value)):
        return Items(value)
    raise ValueError(f'expected "{BOOLEAN}", "{INTEGER}" or a list of different names')


def _arguments(value: Any) -> dict[str, str]:
    """Return the arguments of a function with their units; of a list, these are empty."""
    if isinstance(value, dict) and all(type(unit) is str and unit for unit in value.values()):
        return value
    if isinstance(value, list) and all(type(name) is str for name in value):
        found = dict.fromkeys(value, "")
        if len(found) == len(value):
            return found
    raise ValueError("expected a list of names, each once, or a table of their units")


def _code(value: Any) -> list[str]:
    """Return the C files, of which one need not be a list."""
    names = value if isinstance(value, list) else [value]
    if names and all(type(name) is str and CODE.fullmatch(name) for name in names):
        return names
    raise ValueError("expected a C file such as crane.c, or a list of them")


READ = {
    **dict.fromkeys((*NUMBERS, *EXPERIMENT), finite_number),
    "start": lambda given: given if type(given) in (bool, str) else finite_number(given),
    "type": _type,
    "variability": TEXT,
    "causality": _expect('"local"', str, lambda value: value == "local"),
    **dict.fromkeys(("shown", "time_events"), TRUTH),
    "rule": _expect('"plug", "bus" or "none"', str, lambda rule: rule in ("plug", "bus", "none")),
    **dict.fromkeys(MEMBERS, NAMES),
    **dict.fromkeys(("follows", "indicators"), LIST),
    "description": plain_text,
    "terminate": _end,
    "unit": _unit,
    **dict.fromkeys(TABLES, _expect("a table", dict, lambda _: True)),
    **dict.fromkeys((*BASE, ANGLE), _exponent),
    "name": _expect("a letter, then letters, digits, _", str, NAME.fullmatch),
    "modes": _modes,
    "arguments": _arguments,
    "code": _code,
    "field": _expect("a field of C such as damping[0]", str, FIELD.fullmatch),
    **dict.fromkeys(("sources", "indicators", "series", "by", "of"), LIST),
    "reads": _expect("a table", dict, lambda _: True),
    "reach": _expect("true or false", bool, lambda _: True),
    **dict.fromkeys(("file", "derivative_of", "calculate"), TEXT),
}  # how values of keys are read; others are expressions


def entries(
    table: object, known: Collection[str], needed: str = "", what: str = "key"
) -> dict[str, Any]:
    """Check a table with these keys, and return its values as they are used."""
    if not isinstance(table, dict):
        example = needed or next(iter(known))
        raise ModelFileError(f"expected a table such as {{ {example} = ... }}, got {shown(table)}")
    for key in table:
        if key not in known:
            place = f"[{key}]: " if what == "section" else ""
            listed = f"unknown {what} {shown(key)}, expected one of {', '.join(known)}"
            raise ModelFileError(place + listed + instead_of(key))
    if needed and needed not in table:
        above = " above the first [section]" if what == "section" else ""
        raise ModelFileError(f"{needed} is missing{above}")
    return {key: _value(key, value, what) for key, value in table.items()}


def _value(key: str, value: object, what: str) -> Any:
    with placed(f"[{key}]" if what == "section" and key in TABLES else key):
        try:
            return READ[key](value) if key in READ else value
        except ValueError as error:
            raise ModelFileError(f"{error}, got {shown(value)}") from None
