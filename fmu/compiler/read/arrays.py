"""The elements of entries with indexes: "x[i]" = { for = "i = 1..n", ... }."""

from collections.abc import Iterator, Mapping
from itertools import groupby

from ..expressions.expression import ExpressionError, Node
from ..expressions.indexes import at_indexes
from ..expressions.parser import parse, parse_ranges
from .content import Element, ModelFile, ModelFileError, placed, shown

FOR = "for"
MOST_ELEMENTS = 20_000


def elements(file: ModelFile, key: str, entry: object) -> Iterator[Element]:
    """Yield the entry with each value of its indexes; without `for` the entry itself.

    A start value may be a list, of one number for each, or of such lists by the first index.
    """
    own = dict(entry) if isinstance(entry, dict) else entry
    over = own.pop(FOR, None) if isinstance(own, dict) else None
    if "[" not in key:
        if over is not None:
            raise ModelFileError(f"{key}: for: expected indexes in the name, such as {key}[i]")
        yield Element(key, key, own)
        return
    with placed(shown(key)):
        tree = _name_with_indexes(key)
        found = [(name_of(tree, file.sizes | at), at) for at in every(file, over)]
        starts = own.get("start") if isinstance(own, dict) else None
        if isinstance(starts, list):
            starts = _flat(starts, [at for _, at in found])
    for number, (name, at) in enumerate(found):
        given = own | {"start": starts[number]} if isinstance(starts, list) else own
        yield Element(name, key if not at else f"{key} at {_shown(at)}", given, at)


def _flat(
    starts: list[object], indexes: list[dict[str, int]], place: str = "start"
) -> list[object]:
    """Return one start value for each element; lists in the list are by the first index."""
    rows = [[*same] for _, same in groupby(indexes, lambda at: [*at.values()][:1])]
    is_nested = len(indexes[0]) > 1 and any(isinstance(start, list) for start in starts)
    if len(starts) != (len(rows) if is_nested else len(indexes)):
        same = len({*map(len, rows)}) == 1
        lists = f" of {_values(rows[0])}" if same else ", one for each first index"
        lists = f"{len(rows)} lists{lists}"
        what = f"{_values(indexes)} or {lists}" if len(indexes[0]) > 1 else _values(indexes)
        what = lists if is_nested else what
        raise ModelFileError(f"{place}: expected {what}, got {len(starts)}")
    if not is_nested:
        return starts
    found = []
    for number, (start, row) in enumerate(zip(starts, rows, strict=True), 1):
        if not isinstance(start, list):
            raise ModelFileError(f"{place}: expected {len(rows)} lists or only values, got both")
        inner = [dict([*at.items()][1:]) for at in row]
        found += _flat(start, inner, f"{place}: list {number}")
    return found


def _values(of: list[dict[str, int]]) -> str:
    return f"{len(of)} value{'s' * (len(of) != 1)}"


def name_of(tree: Node, indexes: Mapping[str, int]) -> str:
    """Return the name of an element, whose indexes are 0 or more."""
    found = at_indexes(tree, indexes)
    if "-" in found.name:
        raise ExpressionError(tree.column, f"{found.name}: expected indexes of 0 or more")
    return found.name


def target(text: str, element: Element, sizes: Mapping[str, int]) -> str:
    """Return the name that a key of `set` or `reinit` stands for."""
    return name_of(_name_with_indexes(text), sizes | element.indexes) if "[" in text else text


def _name_with_indexes(text: str) -> Node:
    tree = parse(text)
    if tree.op != "element" or "." in tree.name:
        raise ModelFileError("expected a name with its indexes, such as x[i]")
    return tree


def every(
    file: ModelFile, text: object, outer: Mapping[str, int] | None = None
) -> list[dict[str, int]]:
    """List all values of the indexes of a `for`, the last index fastest; once nothing for None.

    outer: other indexes, with their values.
    """
    known = file.sizes | (outer or {})
    found: list[dict[str, int]] = [{}]
    if text is None:
        return found
    with placed(FOR):
        if not isinstance(text, str):
            raise ModelFileError(f'expected a range such as "i = 1..n", got {shown(text)}')
        for over in parse_ranges(text):
            if over.index in (*file.reserved, *known):
                raise ModelFileError(f"{over.index!r} is a name already: expected an index")
            file.indexes.add(over.index)
            found = [at | {over.index: value} for at in found for value in over.values(known | at)]
            if len(found) > MOST_ELEMENTS:
                raise ModelFileError(f"more than {MOST_ELEMENTS} elements")
        if not found:
            raise ModelFileError(f"{text!r} has no values")
    return found


def _shown(indexes: Mapping[str, int]) -> str:
    return ", ".join(f"{index} = {value}" for index, value in indexes.items())
