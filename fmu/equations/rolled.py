"""Statements that repeat with rising indexes as loops in C: compilers need more than linear time.

Lines repeat if they are the same but for some numbers, which rise by the same steps from turn to
turn: the number of a constant (n12), the first one in a bracket, and that of a state. A constant
that another turn reads is kept in an array.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

SHORTEST = 400  # lines of a function that gains by loops
FEWEST_TURNS = 4
MOST_TRIED = 40  # lengths of a turn
STRING = r'"(?:\\.|[^"\\])*"'
STATE = r"(?<=state_indicator\()"
NUMBER = re.compile(rf"{STRING}|\b([nvzc])(\d+)\b|\[(\d+)|{STATE}(\d+)")  # strings have none
LITERAL = re.compile(r"(?<![\w.])(?:\d+\.\d+(?:e[-+]?\d+)?|\d+e[-+]?\d+)(?![\w.])")
RARE, FEWEST_LITERALS = 16, 20  # occurrences of a number, and such numbers, for a table of them
TABLE = "numbers"
DEFINITION = re.compile(r"const (double|int) ([nvzc])(\d+) = ")


@dataclass(frozen=True)
class Line:
    """A statement: its text with # for numbers, and these."""

    form: str
    numbers: tuple[int, ...]

    @classmethod
    def of(cls, text: str) -> Line:
        """Take a statement apart."""
        numbers: list[int] = []

        def hole(number: re.Match[str]) -> str:
            if not number.lastindex:
                return number[0]
            numbers.append(int(number[number.lastindex]))
            return f"{number[1] or '[' * bool(number[3])}#"

        return cls(NUMBER.sub(hole, text), tuple(numbers))

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
        numbers = tuple(number for line in self.lines for number in line.numbers)
        object.__setattr__(self, "numbers", numbers)

    def text(self, terms: Sequence[str], depth: int = 0) -> Iterator[str]:
        """Yield the lines of C."""
        turn, used = f"r{depth}", 0
        yield f"for (size_t {turn} = 0; {turn} < {self.turns}; {turn}++) {{"
        own = [
            term + ("" if not step else f" + {turn}" if step == 1 else f" + {step} * {turn}")
            for term, step in zip(terms, self.steps, strict=True)
        ]
        for line in self.lines:
            count = len(line.numbers)
            for text in line.text(own[used : used + count], depth + 1):
                yield f"    {text}"
            used += count
        yield "}"


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
    constants = [DEFINITION.match(line) for section in sections for line in section]
    arrays = {f"{c[2]}{c[3]}": f"{c[2]}_{c[1]}s" for c in constants if c}  # in their order
    kept: dict[str, str] = {}  # elements of arrays, by constant
    sizes: Counter[str] = Counter()
    while True:
        texts = [[_with_arrays(line, kept) for line in section] for section in sections]
        found = [_loops([Line.of(text) for text in section]) for section in texts]
        new = _read_by_others(texts, found)
        if not new:
            break
        sizes.clear()
        names = [name for name in arrays if name in new or name in kept]
        for name in names:
            kept[name] = f"{arrays[name]}[{sizes[arrays[name]]}]"
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


def _with_arrays(line: str, kept: dict[str, str]) -> str:
    definition = DEFINITION.match(line)
    if definition and f"{definition[2]}{definition[3]}" in kept:
        line = line.removeprefix(f"const {definition[1]} ")
    return NUMBER.sub(lambda number: kept.get(number[0], number[0]), line) if kept else line


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
        if other + length > len(items):
            break
        turns, steps = 1, _steps(items, forms, begin, other, length)
        while steps is not None and (
            _steps(items, forms, begin + (turns - 1) * length, begin + turns * length, length)
            == steps
        ):
            turns += 1
        if turns >= FEWEST_TURNS:
            return Loop(tuple(items[begin:other]), turns, steps), turns * length
        other = following[other]
    return None, 1


def _steps(
    items: list[Line | Loop], forms: list[int], a: int, b: int, length: int
) -> tuple[int, ...] | None:
    """Return by how much numbers rise from turn a to turn b; None if these are no turns."""
    if forms[a : a + length] != forms[b : b + length]:
        return None
    found: list[int] = []
    for i in range(length):
        pairs = zip(items[b + i].numbers, items[a + i].numbers, strict=True)
        found += [later - earlier for later, earlier in pairs]
    return tuple(found) if min(found, default=0) >= 0 else None


def _read_by_others(texts: list[list[str]], found: list[list[Line | Loop]]) -> set[str]:
    """Return the constants that are read where their names do not mean them."""
    where: dict[str, tuple[int, ...]] = {}  # turns in which a constant is defined
    others: set[str] = set()
    count = iter(range(sum(map(len, texts)) + 1))
    for section, items in zip(texts, found, strict=True):
        places = [place for item in items for place in _places(item, (), (), count)]
        for text, (turns, steps) in zip(section, places, strict=True):
            is_definition = DEFINITION.match(text) is not None
            numbers = (number for number in NUMBER.finditer(text) if number.lastindex)
            for i, number in enumerate(numbers):
                if is_definition and i == 0:
                    where[number[0]] = turns
                elif number[1]:
                    own = where[number[0]]
                    if own != turns[: len(own)] or any(step[i] for step in steps[len(own) :]):
                        others.add(number[0])
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
    for _ in range(item.turns):
        turn, used = next(count), 0
        for line in item.lines:
            end = used + len(line.numbers)
            own = (*(step[used:end] for step in steps), item.steps[used:end])
            yield from _places(line, (*turns, turn), own, count)
            used = end
