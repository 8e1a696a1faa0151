"""Statements that repeat with other indexes as loops in C: compilers need more than linear time.

Lines repeat if they are the same but for some numbers, which change by the same steps from turn to
turn: the number of a constant (n12), the first one in a bracket, and that of a state. A constant
that another turn reads is kept in an array.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from operator import attrgetter, sub

SHORTEST = 400  # lines of a function that gains by loops
FEWEST_TURNS = 4
MOST_TRIED = 40  # lengths of a turn
STRING = r'"(?:\\.|[^"\\])*"'
STATE = r"(?<=state_indicator\()"
NUMBER = re.compile(rf"{STRING}|\b([nvzc])(\d+)\b|\[(\d+)|{STATE}(\d+)")  # strings have none
LITERAL = re.compile(r"\d(?<![\w.]\d)\d*(?:\.\d+(?:e[-+]?\d+)?|e[-+]?\d+)(?![\w.])")
RARE, FEWEST_LITERALS = 16, 20  # occurrences of a number, and such numbers, for a table of them
TABLE = "numbers"
NUMBERS = attrgetter("numbers")
DEFINITION = re.compile(r"const (double|int) ([nvzc])\d+ = ")


@dataclass(frozen=True)
class Line:
    """A statement: its text with # for numbers, and these."""

    form: str
    numbers: tuple[int, ...]

    def text(self, terms: Sequence[str], depth: int) -> Iterator[str]:
        """Yield the lines of C; terms: added to the numbers."""
        given = iter(zip(self.numbers, terms, strict=True))

        def number(found: re.Match[str]) -> str:
            if found[0].startswith('"'):
                return found[0]
            value, term = next(given)
            if found[0] in ("[#", "#"):
                shown = f"{value}{term}" if value or not term else term.removeprefix(" + ")
                return found[0].replace("#", shown)
            return f"{found[0][:-1]}{value}"

        yield re.sub(rf"{STRING}|(?:\b[nvzc]|\[|{STATE})#", number, self.form)


class Statement:
    """A statement, taken apart at its numbers once."""

    def __init__(self, text: str) -> None:
        found = [number for number in NUMBER.finditer(text) if number.lastindex]
        begins = [number.start(number.lastindex) for number in found]
        ends = [0, *(number.end() for number in found)]
        self.pieces = [text[end:begin] for end, begin in zip(ends, [*begins, None], strict=True)]
        self.names = [number[0] if number[1] else "" for number in found]  # of constants
        numbers = tuple([int(number[number.lastindex]) for number in found])
        self.line = Line("#".join(self.pieces), numbers)
        definition = DEFINITION.match(text)
        self.defined = self.names[0] if definition else ""
        self.array = f"{definition[2]}_{definition[1]}s" if definition else ""

    def with_arrays(self, kept: Mapping[str, tuple[str, int]]) -> Line:
        """Return its line, where elements of arrays replace constants."""
        if kept.keys().isdisjoint(self.names):
            return self.line
        pieces, numbers = [*self.pieces], [*self.line.numbers]
        for i, name in enumerate(self.names):
            if name in kept:
                array, numbers[i] = kept[name]
                pieces[i] = f"{pieces[i][:-1]}{array}["
                pieces[i + 1] = f"]{pieces[i + 1]}"
        if self.defined in kept:
            pieces[0] = pieces[0].removeprefix("const ").partition(" ")[2]
        return Line("#".join(pieces), tuple(numbers))


@dataclass(frozen=True)
class Loop:
    """Turns of lines, with the numbers of the first turn."""

    lines: tuple[Line | Loop, ...]
    turns: int
    steps: tuple[int, ...]  # of the numbers, from turn to turn
    form: tuple = field(init=False)
    numbers: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        shape = (tuple(line.form for line in self.lines), self.turns, self.steps)
        object.__setattr__(self, "form", shape)
        object.__setattr__(self, "numbers", (*chain(*map(NUMBERS, self.lines)),))

    def text(self, terms: Sequence[str], depth: int = 0) -> Iterator[str]:
        """Yield the lines of C."""
        turn, used = f"r{depth}", 0
        yield f"for (size_t {turn} = 0; {turn} < {self.turns}; {turn}++) {{"
        own = [f"{term}{_moved(step, turn)}" for term, step in zip(terms, self.steps, strict=True)]
        for line in self.lines:
            count = len(line.numbers)
            for text in line.text(own[used : used + count], depth + 1):
                yield f"    {text}"
            used += count
        yield "}"


def _moved(step: int, turn: str) -> str:
    """Return what a turn adds to a number; none falls below 0, so that they may be unsigned."""
    sign, by = "+-"[step < 0], abs(step)
    return f" {sign} {turn}" if by == 1 else f" {sign} {by} * {turn}" if by else ""


def rolled(*sections: list[str]) -> list[list[str]]:
    """Return the sections of one function with loops; the first one begins with declarations.

    A statement of several lines is one text.
    """
    if sum(map(len, sections)) < SHORTEST:
        return [_split(section) for section in sections]
    literals = Counter(t for section in sections for line in section for t in LITERAL.findall(line))
    rare = {text for text, count in literals.items() if count <= RARE}
    table: list[str] = []  # numbers that are other ones in each turn
    if len(rare) >= FEWEST_LITERALS:
        sections = tuple([_with_table(line, rare, table) for line in s] for s in sections)
    statements = [[Statement(line) for line in section] for section in sections]
    arrays = {s.defined: s.array for section in statements for s in section if s.defined}
    kept: dict[str, tuple[str, int]] = {}  # elements of arrays, by constant
    sizes: Counter[str] = Counter()
    while True:
        found = [_loops([s.with_arrays(kept) for s in section]) for section in statements]
        new = _read_by_others(statements, kept, found)
        if not new:
            break
        sizes.clear()
        for name in [name for name in arrays if name in new or name in kept]:
            kept[name] = arrays[name], sizes[arrays[name]]
            sizes[arrays[name]] += 1
    lines = [
        _split(text for item in items for text in item.text([""] * len(item.numbers), 0))
        for items in found
    ]
    declared = [f"{array.split('_')[1][:-1]} {array}[{n}];" for array, n in sizes.items() if kept]
    if table:
        declared.append(f"static const double {TABLE}[] = {{{', '.join(table)}}};")
    lines[0] = declared + lines[0]
    return lines


def _split(statements: Iterable[str]) -> list[str]:
    return [line for statement in statements for line in statement.split("\n")]


def _with_table(line: str, rare: set[str], table: list[str]) -> str:
    def moved(literal: re.Match[str]) -> str:
        if literal[0] not in rare:
            return literal[0]
        table.append(literal[0])
        return f"{TABLE}[{len(table) - 1}]"

    return LITERAL.sub(moved, line)


def _loops(items: list[Line | Loop]) -> list[Line | Loop]:
    """Return the statements with loops, the innermost ones found first."""
    while True:
        shorter = _once(items)
        if len(shorter) == len(items):
            return items
        items = shorter


def _once(items: list[Line | Loop]) -> list[Line | Loop]:
    known: dict[object, int] = {}
    forms = [known.setdefault(item.form, len(known)) for item in items]
    following, last = [len(items)] * len(items), {}
    for i in reversed(range(len(items))):
        following[i] = last.get(forms[i], len(items))
        last[forms[i]] = i
    found: list[Line | Loop] = []
    i = 0
    while i < len(items):
        loop, length = _loop_at(items, forms, following, i)
        found.append(loop or items[i])
        i += length
    return found


def _loop_at(
    items: list[Line | Loop], forms: list[int], following: list[int], begin: int
) -> tuple[Loop | None, int]:
    """Return the loop with the shortest turns that begins here, and how many items it replaces."""
    other = following[begin]
    for _ in range(MOST_TRIED):
        length = other - begin
        if begin + FEWEST_TURNS * length > len(items):
            break
        steps = _steps(items, forms, begin, length)
        if steps is not None:
            turns, turn = FEWEST_TURNS, forms[begin:other]
            for b in range(begin + turns * length, len(items), length):
                if (
                    forms[b : b + length] != turn
                    or _change(items, b - length, length, length) != steps
                ):
                    break
                turns += 1
            return Loop(tuple(items[begin:other]), turns, steps), turns * length
        other = following[other]
    return None, 1


def _steps(
    items: list[Line | Loop], forms: list[int], a: int, length: int
) -> tuple[int, ...] | None:
    """Return by how much numbers change from turn to turn; None if these are not enough turns."""
    if forms[a : a + FEWEST_TURNS * length : length].count(forms[a]) < FEWEST_TURNS:
        return None
    begins, steps = range(a, a + (FEWEST_TURNS - 1) * length, length), ()
    for count in (1, length):  # most differ in the first line
        if any(forms[b : b + count] != forms[b + length : b + length + count] for b in begins):
            return None
        steps, *others = [_change(items, b, count, length) for b in begins]
        if any(other != steps for other in others):
            return None
    return steps


def _change(items: list[Line | Loop], a: int, count: int, distance: int) -> tuple[int, ...]:
    """Return by how much the numbers of `count` items change over a distance."""
    pairs = (map(NUMBERS, items[b : b + count]) for b in (a + distance, a))
    return tuple(map(sub, *map(chain.from_iterable, pairs)))


def _read_by_others(
    statements: list[list[Statement]], kept: Container[str], found: list[list[Line | Loop]]
) -> set[str]:
    """Return the constants that are read where their names do not mean them."""
    where: dict[str, tuple[int, ...]] = {}  # turns in which a constant is defined
    others: set[str] = set()
    count = iter(range(sum(map(len, statements)) + 1))
    for section, items in zip(statements, found, strict=True):
        places = (place for item in items for place in _places(item, (), (), count))
        for statement, (turns, steps) in zip(section, places, strict=True):
            for i, name in enumerate(statement.names):
                if i == 0 and statement.defined:
                    where[name] = turns
                elif name and name not in kept:
                    own = where[name]
                    if own != turns[: len(own)] or any(step[i] for step in steps[len(own) :]):
                        others.add(name)
    return others


def _places(
    item: Line | Loop,
    turns: tuple[int, ...],
    steps: tuple[tuple[int, ...], ...],
    count: Iterator[int],
) -> Iterator[tuple[tuple[int, ...], tuple[tuple[int, ...], ...]]]:
    """Yield for each statement the turns around it, and the steps of its numbers in each."""
    if isinstance(item, Line):
        yield turns, steps
        return
    inside, used = [], 0
    for line in item.lines:
        end = used + len(line.numbers)
        inside.append((line, (*(step[used:end] for step in steps), item.steps[used:end])))
        used = end
    for turn in islice(count, item.turns):
        for line, own in inside:
            yield from _places(line, (*turns, turn), own, count)
