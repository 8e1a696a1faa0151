"""Statements as text: short functions with names of the source, long ones with loops.

Compilers need more than linear time for long functions. Statements repeat if they are the same but
for some indexes and constants, which change by the same steps from turn to turn. A constant that
another turn reads is kept in an array.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from operator import attrgetter, sub

from ..graph.graph import DERIVATIVES
from .c_text import WIDTH, number, wrapped
from .statements import Constant, Item, Operand, Place, Statement, folded, places_in, write

SHORTEST = 400  # statements of a function that gains by loops
FEWEST_TURNS = 4
MOST_TRIED = 40  # lengths of a turn
RARE, FEWEST_LITERALS = 16, 20  # occurrences of a number, and such numbers, for a table of them
TABLE = "numbers"
INDENT = 8  # of statements, or less
NUMBERS = attrgetter("numbers")
# names that no constant may have: of C, and of the files and functions of models
KEYWORDS = """
auto break case char const continue default do double else enum extern float for goto if inline int
long register restrict return short signed sizeof static struct switch typedef union unsigned void
volatile while bool true false NULL y0 y1 yn j0 j1 jn gamma real isnan isfinite fabs fmax fmin floor
ceil round trunc numbers
"""
RESERVED = {*KEYWORDS.split(), *DERIVATIVES, *(f"r{depth}" for depth in range(10))}
WORDS = """
time dt first second to state input rate slope values given compared times every offset segment
number due later event tolerance indicator unused distance text size copy relation relations count
nominal change_names assignment zeros events errors series inner band order places expressions
domains row_of_indicator indicator_names
"""
OF_MODELS = frozenset(WORDS.split())


class Names:
    """Gives constants names in C, when they are printed."""

    def __init__(self, taken: Iterable[str]) -> None:
        self.taken = {*taken, *RESERVED}
        self.known: dict[Constant, str] = {}
        self.counts = defaultdict(lambda: 1)  # of names that are the same

    def of(self, constant: Constant) -> str:
        """Return the name of a constant."""
        if constant not in self.known:
            name = constant.name or self._of_function(constant.of)
            self.known[constant] = self.free(name, constant.base)
        return self.known[constant]

    def _of_function(self, of: Operand) -> str:
        """Return sin_x of sin(x), and nothing for other operations."""
        if isinstance(of, tuple) and of[0] in DERIVATIVES and len(of) == 2:
            of_x = of[1]
            if isinstance(of_x, Constant) and of_x in self.known:
                return f"{of[0]}_{self.known[of_x]}"
            if isinstance(of_x, Place) and of_x.name:
                return f"{of[0]}_{of_x.name}"
        return ""

    def free(self, name: str, base: str) -> str:
        """Return a free name like this one; without it a short one."""
        plain = "_".join(re.findall(r"\w+", name))
        if base.isupper() and sum(map(str.isalpha, base)) > 2:  # maybe a macro
            plain += "_"
        found = plain or f"{base}1"
        while found in self.taken:
            self.counts[plain] += 1
            found = f"{plain}_{self.counts[plain]}" if plain else f"{base}{self.counts[plain]}"
        self.taken.add(found)
        return found


def printed(
    *sections: list[Item],
    taken: Iterable[str] = OF_MODELS,
    is_long: bool | None = None,
    has_named_places: bool = True,
) -> list[list[str]]:
    """Return the sections of one function as lines; the first one begins with declarations.

    has_named_places: of a short function, those that are read more than once.
    """
    if is_long is None:
        is_long = sum(map(len, sections)) >= SHORTEST
    names, parts = Names(taken), folded(sections, is_long)
    lines = _with_loops(parts, names) if is_long else _short(parts, names, has_named_places)
    room = WIDTH - INDENT
    return [
        [part for text in texts for line in text.split("\n") for part in wrapped(line, room)]
        for texts in lines
    ]


def pieces(item: Item, named: Mapping[Place, Constant]) -> list[Operand]:
    """Return an item as texts, numbers, indexes and constants; `named` stand for places."""
    found: list[Operand] = []
    if isinstance(item, Constant):
        found += [f"const {item.c_type} ", item, " = "]
        write(item.of, found, named)
        found.append(";")
    elif isinstance(item, Statement):
        for part in item.parts:
            write(part, found, named)
    else:
        for i, body in enumerate(item.bodies):
            found.append("} else {" if i else "if (")
            if i == 0:
                write(item.condition, found, named)
                found.append(") {")
            for inner in body:
                found.append("\n    ")
                found += [
                    piece.replace("\n", "\n    ") if isinstance(piece, str) else piece
                    for piece in pieces(inner, named)
                ]
            found.append("\n")
        found.append("}")
    return found


def _short(sections: list[list[Item]], names: Names, has_named_places: bool) -> list[list[str]]:
    """Return the texts of sections; the first one's constants for places are known in all."""
    found: list[list[str]] = []
    known: dict[Place, Constant] = {}
    for i, section in enumerate(sections):
        reads = Counter(place for item in section for place in places_in(item))
        new = {
            place: Constant(place, place.c_type, place.name)
            for place, count in reads.items()
            if place.name and place not in known and (count > 1 or place.is_opaque)
            if has_named_places
        }
        named, items, left = known | new, [], dict(new)
        for item in section:
            if left:
                read = [place for place in places_in(item) if place in left]
                items += [pieces(left.pop(place), {}) for place in dict.fromkeys(read)]
            items.append(pieces(item, named))
        found.append(["".join(_shown(piece, names) for piece in item) for item in items])
        known = known if i else new
    return found


def _shown(piece: Operand, names: Names) -> str:
    match piece:
        case Constant():
            return names.of(piece)
        case float():
            return number(piece)
    return str(piece)


class Line:
    """A statement, taken apart at its numbers and constants once."""

    def __init__(self, texts: list[str], slots: list[Constant | None], numbers: list[int]) -> None:
        self.texts, self.slots, self.numbers = texts, slots, tuple(numbers)
        bases = [slot.base if slot else "" for slot in slots]
        self.form = "\0".join(chain.from_iterable(zip(texts, [*bases, ""], strict=True)))

    @classmethod
    def of(cls, found: list[Operand], places: Mapping[Constant, int]) -> Line:
        """Take pieces apart; `places` are the constants' numbers."""
        texts, slots, numbers = [""], [], []
        for piece in found:
            if isinstance(piece, str):
                texts[-1] += piece
            elif isinstance(piece, float):
                texts[-1] += number(piece)
            else:
                is_constant = isinstance(piece, Constant)
                slots.append(piece if is_constant else None)
                numbers.append(places[piece] if is_constant else piece)
                texts.append("")
        return cls(texts, slots, numbers)

    def with_arrays(self, kept: Mapping[Constant, tuple[str, int]], defined: bool) -> Line:
        """Return the line, where elements of arrays replace constants."""
        if kept.keys().isdisjoint(self.slots):
            return self
        texts, slots, numbers = [*self.texts], [*self.slots], [*self.numbers]
        if defined and slots[0] in kept:
            texts[0] = ""
        for i, slot in enumerate(slots):
            if slot in kept:
                array, numbers[i] = kept[slot]
                texts[i] += f"{array}["
                texts[i + 1] = f"]{texts[i + 1]}"
                slots[i] = None
        return Line(texts, slots, numbers)

    def text(self, terms: Sequence[str], depth: int, names: Names) -> Iterator[str]:
        """Yield the lines of C; terms: added to the numbers."""
        found = [self.texts[0]]
        each = zip(self.slots, self.numbers, terms, self.texts[1:], strict=True)
        for slot, value, term, text in each:
            shown = f"{value}{term}" if value or not term else term.removeprefix(" + ")
            found += [names.of(slot) if slot else shown, text]
        yield "".join(found)


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

    def text(self, terms: Sequence[str], depth: int, names: Names) -> Iterator[str]:
        """Yield the lines of C."""
        turn, used = f"r{depth}", 0
        yield f"for (size_t {turn} = 0; {turn} < {self.turns}; {turn}++) {{"
        own = [f"{term}{_moved(step, turn)}" for term, step in zip(terms, self.steps, strict=True)]
        for line in self.lines:
            count = len(line.numbers)
            for text in line.text(own[used : used + count], depth + 1, names):
                yield "    " + text.replace("\n", "\n    ")
            used += count
        yield "}"


def _moved(step: int, turn: str) -> str:
    """Return what a turn adds to a number; none falls below 0, so that they may be unsigned."""
    sign, by = "+-"[step < 0], abs(step)
    return f" {sign} {turn}" if by == 1 else f" {sign} {by} * {turn}" if by else ""


def _with_loops(sections: list[list[Item]], names: Names) -> list[list[str]]:
    """Return the texts of sections with loops."""
    defined = [[isinstance(item, Constant) for item in section] for section in sections]
    counts: Counter[str] = Counter()  # of constants by base
    numbers: dict[Constant, int] = {}
    for item in chain(*sections):
        if isinstance(item, Constant):
            numbers[item] = counts[item.base]
            counts[item.base] += 1
    found = [[pieces(item, {}) for item in section] for section in sections]
    table = _moved_to_table(found)
    lines = [[Line.of(item, numbers) for item in section] for section in found]
    arrays: dict[tuple[str, str], str] = {}  # names by base and type
    kept: dict[Constant, tuple[str, int]] = {}  # elements of arrays
    sizes: Counter[tuple[str, str]] = Counter()
    while True:
        rolled = [
            _loops([line.with_arrays(kept, d) for line, d in zip(*pair, strict=True)])
            for pair in zip(lines, defined, strict=True)
        ]
        new = _read_by_others(lines, defined, kept, rolled)
        if not new:
            break
        sizes.clear()
        for constant in numbers:
            if constant in new or constant in kept:
                key = (constant.base, constant.c_type)
                if key not in arrays:
                    arrays[key] = names.free(constant.base, "")
                kept[constant] = arrays[key], sizes[key]
                sizes[key] += 1
    texts = [
        [text for item in items for text in item.text([""] * len(item.numbers), 0, names)]
        for items in rolled
    ]
    declared = [f"{key[1]} {arrays[key]}[{size}];" for key, size in sizes.items()]
    if table:
        declared.append(f"static const double {TABLE}[] = {{{', '.join(map(number, table))}}};")
    texts[0] = declared + texts[0]
    return texts


def _moved_to_table(sections: list[list[list[Operand]]]) -> list[float]:
    """Replace rare numbers by elements of a table: they are other ones in each turn."""
    counts = Counter(
        number(x) for section in sections for item in section for x in item if isinstance(x, float)
    )
    rare = {text for text, count in counts.items() if count <= RARE}
    table: list[float] = []
    for item in chain(*sections) if len(rare) >= FEWEST_LITERALS else ():
        parts = [*item]
        item.clear()
        for x in parts:
            if isinstance(x, float) and number(x) in rare:
                item += [f"{TABLE}[", len(table), "]"]
                table.append(x)
            else:
                item.append(x)
    return table


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
    lines: list[list[Line]],
    defined: list[list[bool]],
    kept: Container[Constant],
    found: list[list[Line | Loop]],
) -> set[Constant]:
    """Return the constants that are read where their names do not mean them."""
    where: dict[Constant, tuple[int, ...]] = {}  # turns in which a constant is defined
    others: set[Constant] = set()
    count = iter(range(sum(map(len, lines)) + 1))
    for section, flags, items in zip(lines, defined, found, strict=True):
        places = (place for item in items for place in _places(item, (), (), count))
        for line, is_definition, (turns, steps) in zip(section, flags, places, strict=True):
            for i, constant in enumerate(line.slots):
                if i == 0 and is_definition:
                    where[constant] = turns
                elif constant and constant not in kept:
                    own = where[constant]
                    if own != turns[: len(own)] or any(step[i] for step in steps[len(own) :]):
                        others.add(constant)
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
