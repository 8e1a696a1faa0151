"""Reads the tables and functions of a file with equations, which its expressions call."""

from ..expressions.dimensions import dimension_of, of_exponents
from ..expressions.expression import CONSTANTS, ExpressionError, in_order
from ..expressions.kinds import with_kinds
from ..expressions.parser import Function, Lookup, table_unit
from ..graph.tables import read as table_of
from . import keys
from .content import Element, ModelFile, ModelFileError, placed, shown


def read_table(file: ModelFile, name: str, entry: object) -> None:
    """Read a table of [tables]."""
    with placed(f"[tables.{keys.named(name)}]"):
        check_name(name, file)
        given = dict(entry) if isinstance(entry, dict) else {}
        units = given.pop("unit", {})
        given = keys.entries(given or entry, (*keys.TABLE, "unit"), "x")
        arguments = ("x", "y") if "z" in given else ("x",)
        columns = (*arguments, "z" if "z" in given else "y")
        if not isinstance(units, dict) or not all(type(unit) is str for unit in units.values()):
            wanted = "unit: expected a table such as { x = 'm' }"
            raise ModelFileError(f"{wanted}, got {shown(units)}")
        measures = {}
        for key in units:
            if key not in columns:
                wanted = f"expected {', '.join(columns)}"
                raise ModelFileError(f"unit: unknown key {shown(key)}, {wanted}")
            measures[key] = file.unit(units[key])
            axis = "" if key == columns[-1] else columns.index(key)
            file.table_units[table_unit(name, axis)] = measures[key].exponents
        file.tables[name] = table_of(name, given, file.path.parent, measures)
        file.functions[name] = Lookup(name, arguments)


def check_name(name: str, file: ModelFile) -> None:
    """Check the name of a function or table."""
    if not keys.NAME.fullmatch(name):
        raise ModelFileError("expected a name: a letter, then letters, digits, _")
    if name in keys.RESERVED - keys.FUNCTIONS.keys():
        why = keys.reason(name, False)
        raise ModelFileError(f"this name is reserved ({why}), choose another one")
    if name in (*keys.TAKEN, *file.functions):
        raise ModelFileError("expected a name that is no function already")


def read(file: ModelFile, entries: dict[str, object]) -> None:
    """Read units of functions of the C file, then functions, which may call those before them."""
    in_c = file.code.functions if file.code else {}
    of_c = {name: entry for name, entry in entries.items() if name in in_c}
    for name, entry in (of_c | entries).items():
        with placed("[functions]", keys.named(name)):
            needed = "" if name in in_c else "value"
            given = keys.entries(entry, ("arguments", "value", "unit"), needed)
            arguments, units = given.get("arguments", {}), {}
            order = (*arguments,) if "value" in given else in_c[name].arguments
            if {*order} != {*arguments}:
                raise ModelFileError(f"arguments: expected all of the C file: {', '.join(order)}")
            if "unit" in given or any(arguments.values()):
                if "" in arguments.values():
                    raise ModelFileError("unit: expected units of arguments, too: { x = 'm' }")
                units = {table_unit(name, order.index(a)): u for a, u in arguments.items()}
                units |= {table_unit(name): given.get("unit", "1")}
                file.table_units |= {k: file.unit(u).exponents for k, u in units.items()}
            if "value" in given:
                own = _function(file, name, arguments, given["value"], bool(units))
                file.functions[name] = own


def _function(
    file: ModelFile, name: str, arguments: dict[str, str], text: object, has_units: bool
) -> Function:
    """Return a function, whose arguments and value have units in the file, or take any."""
    check_name(name, file)
    taken = (*keys.RESERVED, *file.sizes)
    if not arguments:
        wanted = "expected one name at least: what has no arguments is an entry of [where]"
        raise ModelFileError(f"arguments: {wanted}, or of [parameters] with a value")
    if not all(keys.NAME.fullmatch(a) and a not in taken for a in arguments):
        raise ModelFileError("arguments: expected names, each once and none reserved")
    value = file.expression(Element(name, name, text), ("value",), text)
    for node in in_order([value.tree]):
        if node.op == "name" and node.name not in (*arguments, *CONSTANTS):
            raise ExpressionError(node.column, f"{shown(node.name)} is no argument")
    body = with_kinds(value.tree)
    if has_units:
        units = {key: of_exponents(found) for key, found in file.table_units.items()}
        units |= {a: units[table_unit(name, i)] for i, a in enumerate(arguments)}
        with placed("value"):
            dimension_of(body, units, units[table_unit(name)])
    return Function((*arguments,), body, name=name if has_units else "")
