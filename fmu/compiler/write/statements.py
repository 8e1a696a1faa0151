"""Statements of C as data: what is calculated from what, until it is printed.

An operand is a number (float), an index (int), a text of C that binds as a name does, a place, a
constant, or an operation: a tuple of its name and its operands.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..expressions.expression import RELATIONS
from ..names import Field

Operand = Any
MOST_INLINE = 72  # characters of an operation within another
MOST_TERMS = 8  # of a sum in a long function that is one expression
# how tightly an operation binds; others are calls
UNARY, TERNARY = 9, 2
BINDING = {"*": 8, "/": 8, "+": 7, "-": 7, **dict.fromkeys(RELATIONS, 6), "==": 5, "!=": 5}
BINDING |= {"and": 4, "or": 3}
SYMBOLS = {"and": "&&", "or": "||"}
PREFIXES = {"negative": "-", "not": "!", "double": "(double)"}
COMPARED = (*RELATIONS, "==", "!=", "not")


@dataclass(eq=False, slots=True)
class Place:
    """A variable or an element of an array; what the source calls it."""

    before: str
    index: int | None = None
    after: str = ""
    name: str = ""
    c_type: str = "double"
    is_opaque: bool = False  # without its name nobody sees what it is


@dataclass(eq=False, slots=True)
class Constant:
    """What an operation calculates; one that is not kept may stand where it is used.

    A variable begins with that, or without a value if it is None, and gets others.
    """

    of: Operand
    c_type: str = "double"
    name: str = ""  # in the source
    is_kept: bool = False
    is_variable: bool = False

    @property
    def declaration(self) -> str:
        """What stands in front of its name."""
        return f"{self.c_type} " if self.is_variable else f"const {self.c_type} "

    @property
    def base(self) -> str:
        """What all elements of an array are called."""
        return self.name.partition("[")[0] or ("t" if self.c_type == "double" else "is")


@dataclass(eq=False, slots=True)
class Statement:
    """Operands and texts between them; a result may be a large operation."""

    parts: tuple[Operand, ...]


@dataclass(eq=False, slots=True)
class Block:
    """Statements that run if the condition holds, and others that run if it does not; or a loop."""

    condition: Operand
    bodies: tuple[list[Item], ...]
    keyword: str = "if"


Item = Constant | Statement | Block
Named = Mapping[Place, Constant]  # constants that stand for places


def field_of(structure: str, field: Field, name: str = "", c_type: str = "double") -> Place:
    """A field of a value structure."""
    if field.index is None:
        return Place(f"{structure}->{field}", name=name, c_type=c_type)
    return Place(f"{structure}->{field.base}[", field.index, "]", name, c_type)


def operands(item: Item) -> Sequence[Operand]:
    """What an item reads itself."""
    if isinstance(item, Statement):
        return item.parts
    return (item.of if isinstance(item, Constant) else item.condition,)


def store(target: Operand, of: Operand, sign: str = "=") -> Statement:
    """Give a place a value."""
    return Statement((target, f" {sign} ", of, ";"))


# ---- Operations ----------------------------------------------------------------------------------


def constants_in(term: Operand) -> Iterator[Constant]:
    """Yield the constants of an operand, each as often as it is read."""
    if isinstance(term, Constant):
        yield term
    elif isinstance(term, tuple):
        for operand in term[1:]:
            yield from constants_in(operand)


def all_items(items: Iterable[Item]) -> Iterator[Item]:
    """Yield items, and those of their blocks behind each."""
    for item in items:
        yield item
        for body in item.bodies if isinstance(item, Block) else ():
            yield from all_items(body)


def places_in(item: Item) -> Iterator[Place]:
    """Yield the places that an item reads or writes, each as often."""
    for own in all_items([item]):
        todo: list[Operand] = [*operands(own)]
        while todo:
            term = todo.pop()
            if isinstance(term, Place):
                yield term
            elif isinstance(term, tuple):
                todo += term[:0:-1]


def length(term: Operand) -> int:
    """About how many characters an operand has, the same for elements of an array."""
    match term:
        case str():
            return len(term)
        case float() | int():
            return 3
        case Place():
            return len(term.before) + len(term.after)
        case Constant():
            return len(term.base)
    is_call = term[0] not in BINDING and term[0] not in (*PREFIXES, "if")
    return sum(map(length, term[1:])) + 3 * (len(term) - 2) + (len(term[0]) if is_call else 0)


def with_constants(term: Operand, found: Mapping[Constant, Operand]) -> Operand:
    """The operand, in which operations replace constants."""
    if isinstance(term, Constant):
        return found.get(term, term)
    if isinstance(term, tuple):
        return (term[0], *[with_constants(operand, found) for operand in term[1:]])
    return term


def write(term: Operand, to: list[Operand], named: Named, least: int = 0) -> None:
    """Append texts, numbers, indexes and constants; in brackets if it binds less tightly."""
    if isinstance(term, Place) and term in named:
        to.append(named[term])
    elif isinstance(term, Place):
        to.append(term.before)
        if term.index is not None:
            to.append(term.index)
        to.append(term.after)
    elif not isinstance(term, tuple):
        to.append(term)
    else:
        op, *given = term
        if op in PREFIXES or op == "if" or op in BINDING:
            own = {"if": TERNARY}.get(op, BINDING.get(op, UNARY))
            if op == "not" and _is(given[0], "=="):
                (_, *given), op, own = given[0], "!=", BINDING["!="]
            to += ["("] * (own < least)
            _write_operator(op, own, given, to, named)
            to += [")"] * (own < least)
        elif op == "entry":
            to.append(given[0])
            for index in given[1:]:
                to.append("[")
                write(index, to, named)
                to.append("]")
        else:
            begin, end = ("(const double[]){", "}") if op == "row" else (f"{op}(", ")")
            to.append(begin)
            for i, operand in enumerate(given):
                to += [", "] * (i > 0)
                write(operand, to, named)
            to.append(end)


def _write_operator(
    op: str, own: int, given: list[Operand], to: list[Operand], named: Named
) -> None:
    if op == "if":
        for operand, sign in zip(given, (" ? ", " : ", ""), strict=True):
            write(operand, to, named, TERNARY + 1)
            to.append(sign)
    elif op in PREFIXES:
        to.append(PREFIXES[op])
        write(given[0], to, named, UNARY + _is(given[0], "negative"))
    else:
        left, right = given
        # compilers ask for brackets that C does not need
        asked = {"or": ("and",)}.get(op, COMPARED if op in COMPARED else ())
        write(left, to, named, UNARY if _is(left, *asked) else own)
        to.append(f" {SYMBOLS.get(op, op)} ")
        write(right, to, named, UNARY if _is(right, *asked) else own + 1)


def _is(term: Operand, *ops: str) -> bool:
    return isinstance(term, tuple) and term[0] in ops


# ---- Where constants stand -----------------------------------------------------------------------


def folded(sections: Sequence[list[Item]], is_long: bool) -> list[list[Item]]:
    """Return sections without constants that nobody reads or that stand where they are used.

    is_long: nor has a result a constant for its name.
    """
    uses: dict[Constant, int] = {}
    own: list[dict[Constant, int]] = []
    for section in reversed(sections):
        own.append({})
        _count(section, uses, own[-1])
    return [
        Folding({c: n for c, n in inside.items() if n == uses[c]}, uses, is_long).of(section)
        for section, inside in zip(sections, reversed(own), strict=True)
    ]


def _count(items: list[Item], uses: dict[Constant, int], own: dict[Constant, int]) -> None:
    """Count how often constants are read by what is read itself: in all, and in this section."""
    for item in reversed(items):
        if isinstance(item, Block):
            for body in reversed(item.bodies):
                _count(body, uses, own)
        if isinstance(item, Constant) and item not in uses:
            continue
        for term in operands(item):
            for constant in constants_in(term):
                uses[constant] = uses.get(constant, 0) + 1
                own[constant] = own.get(constant, 0) + 1


class Folding:
    """Puts constants where they are used, if that is one place in their section, or for a minus.

    own: how often constants are read that only this section reads.
    """

    def __init__(
        self, own: Mapping[Constant, int], uses: Mapping[Constant, int], is_long: bool
    ) -> None:
        self.own, self.uses, self.is_long = own, uses, is_long
        self.passed: set[Constant] = set()  # in this section
        self.small: dict[Constant, Operand] = {}
        self.gone: set[Constant] = set()
        self.long_sums: set[Constant] = set()

    def of(self, items: list[Item]) -> list[Item]:
        """Return what is left of the items."""
        if self.is_long:
            self.long_sums = _long_sums(items)
        for item in items:
            if isinstance(item, Constant):
                self.passed.add(item)
                item.of = with_constants(item.of, self.small)
                if self._is_small(item):
                    self.small[item] = item.of
                    self.gone.add(item)
            elif isinstance(item, Block):
                item.condition = with_constants(item.condition, self.small)
                item.bodies = tuple([self.of(body) for body in item.bodies])
            else:
                item.parts = self._result(item.parts)
        return [item for item in items if item not in self.gone and self._is_read(item)]

    def _is_read(self, item: Item) -> bool:
        return not isinstance(item, Constant) or item in self.uses

    def _is_small(self, item: Constant) -> bool:
        if item not in self.own or item.name or item.is_kept or item in self.long_sums:
            return False
        if _is(item.of, "negative") and not isinstance(item.of[1], tuple):
            return True
        return self.own[item] == 1 and length(item.of) <= MOST_INLINE

    def _result(self, parts: tuple[Operand, ...]) -> tuple[Operand, ...]:
        """Put a large operation into a statement that gives a place its value."""
        to, found = parts[0], []
        has_name = self.is_long or isinstance(to, Constant) or isinstance(to, Place) and to.name
        for part in parts:
            is_own = isinstance(part, Constant) and part in self.passed and not part.is_kept
            if is_own and self.own.get(part) == 1 and (has_name or not part.name):
                self.gone.add(part)
                found.append(part.of)
            else:
                found.append(with_constants(part, self.small))
        return tuple(found)


def _long_sums(items: list[Item]) -> set[Constant]:
    """Return sums of many terms and the sums that they begin with: loops add a term in a turn."""
    found = [item for item in items if isinstance(item, Constant) and _is(item.of, "+", "-")]
    terms: dict[Operand, int] = {}
    for item in found:
        terms[item] = terms.get(item.of[1], 1) + 1
    for item in reversed(found):
        left = item.of[1]
        if left in terms:
            terms[left] = max(terms[left], terms[item])
    return {item for item in found if terms[item] > MOST_TERMS}
