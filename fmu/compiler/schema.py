"""The JSON Schema of files with equations, by which editors complete and check them.

It is made of the tables by which files are read, and refuses what does not depend on the meaning of
texts: `rparm build` checks expressions, units and where names are defined.
"""

import re
import sys
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from .expressions.parser import LONGEST
from .graph.tables import INTERPOLATIONS, OUTSIDE
from .read import contacts
from .read import keys as reader
from .read.arrays import FOR
from .read.content import BOOLEAN, FOLLOWS, INTEGER, SWITCHES
from .read.file import solver_names
from .read.header import CALCULATED
from .read.include import INCLUDED
from .units import ANGLE, BASE

Schema = dict[str, Any]
PAGE = Path(__file__).parents[2] / "examples" / "models" / "README.md"
NAME = f"^{reader.NAME.pattern}$"
WITH_INDEXES = rf"{NAME}|^\s*{reader.NAME.pattern}\s*\[.+\]\s*$"
# without surrogates, which TOML has not, and not all readers of patterns
PLAIN = "^[^" + reader.CONTROL.pattern[1:].replace(r"\ud800-\udfff", "") + "*$"
EXPRESSION_PATTERN = r"""^[\sA-Za-z0-9_.,+\-*/<>=!()\[\]"']+$"""
LARGEST, LARGEST_INTEGER = sys.float_info.max, reader.LARGEST_INTEGER
DEFINITIONS: dict[str, Schema] = {
    "number": {"type": "number", "minimum": -LARGEST, "maximum": LARGEST},
    "whole": {"type": "integer", "minimum": -LARGEST_INTEGER, "maximum": LARGEST_INTEGER},
    "text": {"type": "string", "maxLength": reader.LONGEST_TEXT, "pattern": PLAIN},
    "expression": {"type": "string", "maxLength": LONGEST, "pattern": EXPRESSION_PATTERN},
}
NUMBER, WHOLE, TEXT, EXPRESSION = ({"$ref": f"#/$defs/{name}"} for name in DEFINITIONS)
IDENTIFIER = {"pattern": "^[A-Za-z_][A-Za-z0-9_]*$"}
TERMINALS = {"type": "object", "propertyNames": IDENTIFIER}
TERMINALS["additionalProperties"] = {"$ref": "#/$defs/terminal"}
CODE = TEXT | {"pattern": f"^{reader.CODE.pattern}$"}
ABOVE_0 = NUMBER | {"exclusiveMinimum": 0}
TRUTH = {"type": "boolean"}
WORD = {"type": "string", "pattern": NAME}
ITEMS = {"type": "array", "items": WORD, "minItems": 1, "uniqueItems": True}
DESCRIBED = {"type": "object", "propertyNames": WORD, "additionalProperties": TEXT}
ENUMERATION = {"anyOf": [ITEMS, DESCRIBED | {"minProperties": 1}]}
ROWS = {"type": "array", "items": NUMBER, "minItems": 2}
VALUE = {"type": "object", "properties": {"value": EXPRESSION, FOR: EXPRESSION}}
NEW = {"anyOf": [EXPRESSION, VALUE | {"required": ["value"], "additionalProperties": False}]}
KEYS: dict[str, Schema] = {  # start: by the type
    **dict.fromkeys(("min", "max"), NUMBER),
    **dict.fromkeys(("unit", "description", "file", "derivative_of"), TEXT),
    **dict.fromkeys(("x", "y"), {"anyOf": [ROWS, TEXT]}),  # lists, or columns of the file
    **dict.fromkeys(("reinit", "set"), {"type": "object", "additionalProperties": NEW}),
    "where": {"type": "object", "propertyNames": WORD, "additionalProperties": EXPRESSION},
    **dict.fromkeys(("derivative", "value", "equation", "when", "while"), EXPRESSION),
    **dict.fromkeys(("every", "offset", FOR), EXPRESSION),
    **dict.fromkeys((*reader.FRICTION, *reader.STOPS), EXPRESSION),
    "terminate": TEXT | {"minLength": 1, "maxLength": reader.LONGEST_MESSAGE},
    "nominal": ABOVE_0,
    "start": {},
    "variability": {"enum": ["fixed", "discrete"]},
    "causality": {"const": "local"},
    "shown": TRUTH,
    "derivative_of": WORD,
    "field": {"type": "string", "pattern": f"^{reader.FIELD.pattern}$"},
    "type": {"anyOf": [{"enum": [BOOLEAN, INTEGER]}, ENUMERATION]},
    "z": {"type": "array", "items": ROWS, "minItems": 2},
    "interpolation": {"enum": INTERPOLATIONS},
    "outside": {"enum": OUTSIDE},
}


def schema() -> Schema:
    """Return the schema, with descriptions from the page."""
    names = "|".join(sorted({*reader.RESERVED, *solver_names()}))
    named = {"not": {"pattern": rf"^\s*({names})\s*(\[|$)|^der_"}}
    rows = re.findall(r"^\| `\[?(\w+)[^|]*\| (.*) \|$", PAGE.read_text("utf-8"), re.MULTILINE)
    about = {key: re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text) for key, text in rows}
    properties = _further(named)
    properties |= {section: _by_name(_entry(section), named) for section in reader.SECTIONS}
    # entries of files that include others may be keys of theirs
    alone = {section: properties[section] for section in reader.SECTIONS}
    properties |= {section: _without_needs(own) for section, own in alone.items()}
    alone = {"if": {"not": {"required": ["include"]}}, "then": {"properties": alone}}
    found = {key: {"description": about.get(key, key)} | properties[key] for key in reader.HEAD}
    some = [
        {"required": [section], "properties": {section: {"minProperties": 1}}}
        for section in (*reader.SECTIONS, "components")
    ]
    dialect = "https://json-schema.org/draft/2020-12/schema"
    definitions = DEFINITIONS | {"terminal": _terminal()}
    head = {"$schema": dialect, "title": "File with equations", "$defs": definitions}
    with_value = dict.fromkeys(
        ("functions", *CALCULATED), {"additionalProperties": {"required": ["value"]}}
    )
    only_in_c = {"if": {"not": {"required": ["code"]}}, "then": {"properties": with_value}}
    return head | _table(found, "name") | {"anyOf": some, "allOf": [only_in_c, alone]}


def _without_needs(schema: Any) -> Any:
    """Return a schema of whose keys none is needed."""
    if isinstance(schema, dict):
        return {key: _without_needs(own) for key, own in schema.items() if key != "required"}
    return [*map(_without_needs, schema)] if isinstance(schema, list) else schema


def _further(named: Schema) -> dict[str, Schema]:
    """Return the schemas of all keys at the top but the sections of variables."""
    device = re.sub("[a-z](?!-)", lambda x: f"[{x[0]}{x[0].upper()}]", reader.DEVICE.pattern[4:-1])
    experiment = {key: ABOVE_0 | {"default": value} for key, value in reader.EXPERIMENT.items()}
    experiment["tolerance"] |= {"exclusiveMaximum": 1}
    mode = {"type": "string", "pattern": WITH_INDEXES, **named}
    modes = {"anyOf": [TRUTH, _table({"start": _start(TRUTH), FOR: EXPRESSION})]}
    exponent = NUMBER | {"multipleOf": 0.5, "minimum": -99.5, "maximum": 99.5}
    unit = _table(dict.fromkeys((*BASE, ANGLE), exponent))
    size = {"type": "integer", "minimum": 0, "maximum": reader.MOST_SIZE}
    of_functions = {"not": {"enum": sorted(reader.TAKEN)}}
    arguments = ITEMS | {"items": WORD | {"not": {"enum": sorted(reader.RESERVED)}}}
    with_units = {"type": "object", "additionalProperties": TEXT}
    of_function = {"arguments": {"anyOf": [arguments, with_units]}, "unit": TEXT}
    function = _table(of_function | {"value": EXPRESSION})
    check = {"propertyNames": {"maxLength": reader.LONGEST_MESSAGE, "pattern": PLAIN}}
    check["additionalProperties"] = {"anyOf": [EXPRESSION, _keys(["value"], "value")]}
    return {
        "name": WORD | {"not": {"pattern": f"^({device})$"}},
        "description": TEXT,
        "experiment": _table(experiment),
        "modes": {
            "anyOf": [_by_name(modes, named), {"type": "array", "items": mode, "uniqueItems": True}]
        },
        "include": {"type": "array", "items": TEXT | {"pattern": f"^{INCLUDED.pattern}$"}},
        "code": {"anyOf": [CODE, {"type": "array", "items": CODE, "minItems": 1}]},
        "calculate": TEXT,
        "sizes": _by_name(size, named, has_indexes=False),
        "units": {"type": "object", "additionalProperties": unit},
        "tables": _by_name(_data(), of_functions, has_indexes=False),
        "functions": _by_name(function, of_functions, has_indexes=False),
        "sampled": _by_name(_change(reader.SAMPLER), named),
        "events": _by_name(_change(reader.EVENT), named),
        "friction": _by_name(_friction(), {}),
        "stops": _by_name(_stops(), {}),
        "gradients": _gradients(),
        "check": {"type": "object"} | check,
        "terminals": TERMINALS,
        "hook": _hook(),
        "components": _components(),
        "connections": {"type": "object"},
    }


def _friction() -> Schema:
    """Return the schema of an element of [friction]: stribeck comes with breakaway."""
    needed = {"stribeck": ["breakaway"]}
    found = _keys(reader.FRICTION, *contacts.NEEDED[contacts.FRICTION])
    return found | {"dependentRequired": needed}


def _stops() -> Schema:
    found = _keys(reader.STOPS, *contacts.NEEDED[contacts.STOPS])
    return found | {"anyOf": [{"required": ["lower"]}, {"required": ["upper"]}]}


def _gradients() -> Schema:
    names = {"type": "array", "items": TEXT | {"minLength": 1}, "minItems": 1}
    return _table(dict.fromkeys(reader.GRADIENTS, names), reader.GRADIENTS[0])


def _components() -> Schema:
    file = TEXT | {"pattern": r"\.[tT][oO][mM][lL]$"}
    entry = {"anyOf": [file, _table({"file": file, "parameters": {"type": "object"}}, "file")]}
    return {"type": "object", "propertyNames": WORD, "additionalProperties": entry}


def _hook() -> Schema:
    names = {"type": "array", "items": WORD, "uniqueItems": True}
    sources = names | {"items": TEXT | {"pattern": f"^{reader.CODE.pattern}$"}}
    reads = {"type": "object", "additionalProperties": names}
    lists = {"sources": sources, "indicators": names, "series": names}
    return _table(lists | {"reads": reads, "reach": TRUTH}, "sources")


def _table(properties: dict[str, Schema], *needed: str) -> Schema:
    found = {"type": "object", "properties": properties, "additionalProperties": False}
    return found | {"required": [*needed]}


def _keys(keys: Iterable[str], *needed: str) -> Schema:
    """Return the schema of an entry with these keys, which may have indexes."""
    return _table({key: KEYS[key] for key in (*keys, FOR)}, *needed)


def _by_name(entry: Schema, named: Schema, has_indexes: bool = True) -> Schema:
    """Return the schema of a table of entries."""
    without = {"properties": {FOR: False, "start": {"not": {"type": "array"}}}}
    patterns = {WITH_INDEXES: entry, NAME: without} if has_indexes else {NAME: entry}
    found = {"type": "object", "propertyNames": named, "patternProperties": patterns}
    return found | {"additionalProperties": False, "maxProperties": reader.MOST_ENTRIES}


def _start(*values: Schema) -> Schema:
    """Return the schema of a start value, or of one for each index, or of lists by an index."""
    return {"anyOf": [*values, {"type": "array", "items": {"anyOf": [*values, {"type": "array"}]}}]}


def _entry(section: str) -> Schema:
    """Return the schema of an entry of a section of variables; its keys depend on its type."""
    keys, needed = reader.SECTIONS[section]
    needed = "" if section in CALCULATED else needed  # C may write it
    follows = [EXPRESSION] if section in ("states", "discrete") else []
    plain = [key for key in keys if key != "type"]
    given = {"start": _start(NUMBER, *follows)} if "start" in keys else {}
    kinds: list[tuple[Collection[str], str, Schema]] = [(plain, needed, given)]
    if section == "parameters":
        kinds.append((*reader.OWN_KEYS[FOLLOWS], {}))
        kinds += _counts(*reader.FOLLOWING_COUNTS, [], True)
    if section in reader.NOT_REAL:
        has_others = reader.NOT_REAL[section] != SWITCHES
        kinds += _counts(*reader.OWN_KEYS[reader.NOT_REAL[section]], follows, has_others)
    known = [*dict.fromkeys(key for keys, *_ in kinds for key in keys)]
    found = _keys(known) | {"anyOf": []}
    for keys, needed, own in kinds:
        others = dict.fromkeys([key for key in known if key not in keys], False)
        required = [key for key in (needed, "type" if "type" in own else "") if key]
        found["anyOf"].append({"properties": others | own, "required": required})
    return {"anyOf": [EXPRESSION, found]} if section == "where" else found


def _counts(
    keys: Collection[str], needed: str, follows: list[Schema], has_others: bool
) -> list[tuple[Collection[str], str, Schema]]:
    """Return the entries of a Boolean and, if there are others, an Integer and an enumeration.

    Each has its keys, the one that it needs, and the schemas of some; follows: of starts, too.
    """
    unordered = [key for key in keys if key not in ("min", "max")]

    def start(*values: Schema) -> Schema:
        return {"start": _start(*values)} if "start" in keys else {}

    found = [(unordered, needed, {"type": {"const": BOOLEAN}} | start(TRUTH, *follows))]
    if has_others:
        whole = {"min": WHOLE, "max": WHOLE} | start(WHOLE, *follows)
        found.append((keys, needed, {"type": {"const": INTEGER}} | whole))
        found.append((unordered, needed, {"type": ENUMERATION} | start({"type": "string"})))
    return found


def _data() -> Schema:
    """Return the schema of a table of [tables]: two columns of a file, two lists, or a grid."""
    found = _table({key: KEYS[key] for key in reader.TABLE})
    found["properties"]["unit"] = _table(dict.fromkeys("xyz", TEXT))
    lists, grid = {"x": ROWS, "y": ROWS, "file": False}, {"interpolation": {"const": "linear"}}
    found["anyOf"] = [
        {"properties": {"x": TEXT, "y": TEXT, "z": False}, "required": ["x", "y", "file"]},
        {"properties": lists | {"z": False}, "required": ["x", "y"]},
        {"properties": lists | grid, "required": ["x", "y", "z"]},
    ]
    return found


def _terminal() -> Schema:
    """Return the schema of a terminal, which may have others in it."""
    text = {"type": "string"}
    members = {"type": "object", "propertyNames": IDENTIFIER, "additionalProperties": text}
    head = {"rule": {"enum": ["plug", "bus", "none"]}, "description": text}
    kinds = dict.fromkeys(("signals", "inflows", "outflows"), members)
    found = _table(head | kinds | {"terminals": TERMINALS}, *head)
    some = [{"required": [key], "properties": {key: {"minProperties": 1}}} for key in kinds]
    return found | {"anyOf": [*some, {"required": ["terminals"]}]}


def _change(keys: tuple[str, ...]) -> Schema:
    """Return the schema of an event or sampler, which needs the first of its keys and an effect."""
    some = {"minProperties": 1}
    effects = [
        {"required": [key], "properties": {key: some}} for key in reader.EFFECTS if key in keys
    ]
    return _keys(keys, keys[0]) | {"anyOf": effects}
