"""Statements as text: short functions with names of the source, long ones with loops.

Compilers need more than linear time for long functions. Statements repeat if they are the same but
for some indexes and constants, which change by the same steps from turn to turn. A constant that
another turn reads is kept in an array.
"""

from __future__ import annotations

import itertools
import re
from collections import Counter, defaultdict
from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from operator import attrgetter, sub

from ..graph.graph import DERIVATIVES
from .c_text import WIDTH, number, wrapped
from .statements import (
    Block,
    Constant,
    Item,
    Operand,
    Place,
    Statement,
    all_items,
    folded,
    places_in,
    write,
)

SHORTEST = 400  # statements of a function that gains by loops
FEWEST_TURNS = 4
MOST_LEFT = 0.7  # of the lines of a function with branches that gains by loops
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
SYSTEMS = re.compile(r"(solution|factors|pivot|linear|bound)_\d+")  # arrays of c_code.py


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
        while found in self.taken or SYSTEMS.fullmatch(found):
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
    most_left = 1.0
    if is_long is None:
        most_left = MOST_LEFT
        is_long = sum(1 for _ in all_items(chain(*sections))) >= SHORTEST
    parts = folded(sections, is_long)
    lines = _with_loops(parts, Names(taken), most_left) if is_long else None
    if lines is None:
        lines = _short(parts, Names(taken), has_named_places)
    room = WIDTH - INDENT
    return [
        [part for text in texts for line in text.split("\n") for part in wrapped(line, room)]
        for texts in lines
    ]


def pieces(item: Item, named: Mapping[Place, Constant]) -> list[Operand]:
    """Return an item as texts, numbers, indexes and constants; `named` stand for places.

    Of a block, that is its first line.
    """
    found: list[Operand] = []
    if isinstance(item, Constant):
        found += [item.declaration, item]
        if item.of is not None:
            found.append(" = ")
            write(item.of, found, named)
        found.append(";")
    elif isinstance(item, Statement):
        for part in item.parts:
            write(part, found, named)
    else:
        found.append(f"{item.keyword} (")
        write(item.condition, found, named)
        found.append(") {")
    return found


def _block(head: str, bodies: Iterable[Iterable[str]]) -> Iterator[str]:
    """Yield the lines of a block; those of its bodies are given."""
    yield head
    for i, body in enumerate(bodies):
        if i:
            yield "} else {"
        yield from ("    " + text.replace("\n", "\n    ") for text in body)
    yield "}"


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
        named, texts, left = known | new, [], dict(new)
        for item in section:
            if left:
                read = [place for place in places_in(item) if place in left]
                texts += [_shown(left.pop(place), {}, names) for place in dict.fromkeys(read)]
            texts.append(_shown(item, named, names))
        found.append(texts)
        known = known if i else new
    return found


def _shown(item: Item, named: Mapping[Place, Constant], names: Names) -> str:
    """Return the text of an item."""
    head = "".join(_piece(piece, names) for piece in pieces(item, named))
    if not isinstance(item, Block):
        return head
    return "\n".join(
        _block(head, [[_shown(inner, named, names) for inner in body] for body in item.bodies])
    )


def _piece(piece: Operand, names: Names) -> str:
    match piece:
        case Constant():
            return names.of(piece)
        case float():
            return number(piece)
    return str(piece)


class Line:
    """A statement, taken apart at its numbers and constants once; the first may be `defined`."""

    def __init__(
        self,
        texts: list[str],
        slots: list[Constant | None],
        numbers: list[int],
        defined: Constant | None = None,
    ) -> None:
        self.texts, self.slots, self.numbers = texts, slots, tuple(numbers)
        self.defined = defined
        bases = [slot.base if slot else "" for slot in slots]
        self.form = "\0".join(chain.from_iterable(zip(texts, [*bases, ""], strict=True)))

    @classmethod
    def of(cls, item: Item, found: list[Operand], places: Mapping[Constant, int]) -> Line:
        """Take the pieces of an item apart; `places` are the constants' numbers."""
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
        return cls(texts, slots, numbers, item if isinstance(item, Constant) else None)

    def lines(self) -> Iterator[Line]:
        """Yield this line."""
        yield self

    def with_arrays(self, kept: Mapping[Constant, tuple[str, int]]) -> Line | None:
        """Return the line, where elements of arrays replace constants."""
        if kept.keys().isdisjoint(self.slots):
            return self
        texts, slots, numbers = [*self.texts], [*self.slots], [*self.numbers]
        if self.defined in kept:
            if self.defined.of is None:
                return None
            texts[0] = ""
        for i, slot in enumerate(slots):
            if slot in kept:
                array, numbers[i] = kept[slot]
                texts[i] += f"{array}["
                texts[i + 1] = f"]{texts[i + 1]}"
                slots[i] = None
        return Line(texts, slots, numbers, self.defined)

    def text(self, terms: Sequence[str], depth: int, names: Names) -> Iterator[str]:
        """Yield the lines of C; terms: added to the numbers."""
        found = [self.texts[0]]
        each = zip(self.slots, self.numbers, terms, self.texts[1:], strict=True)
        for slot, value, term, text in each:
            shown = f"{value}{term}" if value or not term else term.removeprefix(" + ")
            found += [names.of(slot) if slot else shown, text]
        yield "".join(found)


@dataclass(frozen=True)
class Branches:
    """A line with a condition, and the bodies of its block."""

    head: Line
    bodies: tuple[list[Part], ...]
    form: tuple = field(init=False)
    numbers: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        shape = tuple(tuple(part.form for part in body) for body in self.bodies)
        object.__setattr__(self, "form", (self.head.form, shape))
        object.__setattr__(self, "numbers", (*chain(*map(NUMBERS, self.parts)),))

    @property
    def parts(self) -> tuple[Part, ...]:
        """The head and all of the bodies."""
        return self.head, *chain(*self.bodies)

    def lines(self) -> Iterator[Line]:
        """Yield all lines."""
        for part in self.parts:
            yield from part.lines()

    def with_arrays(self, kept: Mapping[Constant, tuple[str, int]]) -> Branches:
        """Return the block, where elements of arrays replace constants, with loops."""
        return Branches(
            self.head.with_arrays(kept), tuple([_rolled(body, kept) for body in self.bodies])
        )

    def text(self, terms: Sequence[str], depth: int, names: Names) -> Iterator[str]:
        """Yield the lines of C; terms: added to the numbers."""
        left = iter(terms)

        def of(part: Part) -> Iterator[str]:
            return part.text([*islice(left, len(part.numbers))], depth, names)

        (head,) = of(self.head)
        return _block(head, (chain.from_iterable(map(of, body)) for body in self.bodies))


@dataclass(frozen=True)
class Loop:
    """Turns of parts, with the numbers of the first turn."""

    parts: tuple[Part, ...]
    turns: int
    steps: tuple[int, ...]  # of the numbers, from turn to turn
    form: tuple = field(init=False)
    numbers: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        shape = (tuple(part.form for part in self.parts), self.turns, self.steps)
        object.__setattr__(self, "form", shape)
        object.__setattr__(self, "numbers", (*chain(*map(NUMBERS, self.parts)),))

    def lines(self) -> Iterator[Line]:
        """Yield the lines of a turn."""
        for part in self.parts:
            yield from part.lines()

    def text(self, terms: Sequence[str], depth: int, names: Names) -> Iterator[str]:
        """Yield the lines of C."""
        turn, used = f"r{depth}", 0
        yield f"for (size_t {turn} = 0; {turn} < {self.turns}; {turn}++) {{"
        own = [f"{term}{_moved(step, turn)}" for term, step in zip(terms, self.steps, strict=True)]
        for part in self.parts:
            count = len(part.numbers)
            for text in part.text(own[used : used + count], depth + 1, names):
                yield "    " + text.replace("\n", "\n    ")
            used += count
        yield "}"


Part = Line | Branches | Loop


def _moved(step: int, turn: str) -> str:
    """Return what a turn adds to a number; none falls below 0, so that they may be unsigned."""
    sign, by = "+-"[step < 0], abs(step)
    return f" {sign} {turn}" if by == 1 else f" {sign} {by} * {turn}" if by else ""


def _with_loops(
    sections: list[list[Item]], names: Names, most_left: float
) -> list[list[str]] | None:
    """Return the texts of sections with loops; None if branches gain little by them."""
    counts: Counter[str] = Counter()  # of constants by base
    numbers: dict[Constant, int] = {}
    for item in all_items(chain(*sections)):
        if isinstance(item, Constant):
            numbers[item] = counts[item.base]
            counts[item.base] += 1
    found = {item: pieces(item, {}) for item in all_items(chain(*sections))}
    table = _moved_to_table(found.values())

    def part(item: Item) -> Part:
        line = Line.of(item, found[item], numbers)
        if not isinstance(item, Block):
            return line
        return Branches(line, tuple([[*map(part, body)] for body in item.bodies]))

    lines = [[*map(part, section)] for section in sections]
    arrays: dict[tuple[str, str], str] = {}  # names by base and type
    kept: dict[Constant, tuple[str, int]] = {}  # elements of arrays
    sizes: Counter[tuple[str, str]] = Counter()
    while True:
        rolled = [_rolled(section, kept) for section in lines]
        new = _read_by_others(lines, kept, rolled)
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
    count = sum(1 for part in chain(*rolled) for _ in part.lines())
    if count > most_left * len(found) and any(isinstance(item, Block) for item in found):
        return None
    texts = [
        [text for item in items for text in item.text([""] * len(item.numbers), 0, names)]
        for items in rolled
    ]
    declared = [f"{key[1]} {arrays[key]}[{size}];" for key, size in sizes.items()]
    if table:
        declared.append(f"static const double {TABLE}[] = {{{', '.join(map(number, table))}}};")
    texts[0] = declared + texts[0]
    return texts


def _rolled(parts: Iterable[Part], kept: Mapping[Constant, tuple[str, int]]) -> list[Part]:
    """Return parts with arrays and loops."""
    found = [part.with_arrays(kept) for part in parts]
    return _loops([part for part in found if part is not None])


def _moved_to_table(items: Collection[list[Operand]]) -> list[float]:
    """Replace rare numbers by elements of a table: they are other ones in each turn."""
    counts = Counter(number(x) for item in items for x in item if isinstance(x, float))
    rare = {text for text, count in counts.items() if count <= RARE}
    table: list[float] = []
    for item in items if len(rare) >= FEWEST_LITERALS else ():
        parts = [*item]
        item.clear()
        for x in parts:
            if isinstance(x, float) and number(x) in rare:
                item += [f"{TABLE}[", len(table), "]"]
                table.append(x)
            else:
                item.append(x)
    return table


def _loops(items: list[Part]) -> list[Part]:
    """Return the statements with loops, the innermost ones found first."""
    while True:
        shorter = _once(items)
        if len(shorter) == len(items):
            return items
        items = shorter


def _once(items: list[Part]) -> list[Part]:
    known: dict[object, int] = {}
    forms = [known.setdefault(item.form, len(known)) for item in items]
    following, last = [len(items)] * len(items), {}
    for i in reversed(range(len(items))):
        following[i] = last.get(forms[i], len(items))
        last[forms[i]] = i
    found: list[Part] = []
    i = 0
    while i < len(items):
        loop, length = _loop_at(items, forms, following, i)
        found.append(loop or items[i])
        i += length
    return found


def _loop_at(
    items: list[Part], forms: list[int], following: list[int], begin: int
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


def _steps(items: list[Part], forms: list[int], a: int, length: int) -> tuple[int, ...] | None:
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


def _change(items: list[Part], a: int, count: int, distance: int) -> tuple[int, ...]:
    """Return by how much the numbers of `count` items change over a distance."""
    pairs = (map(NUMBERS, items[b : b + count]) for b in (a + distance, a))
    return tuple(map(sub, *map(chain.from_iterable, pairs)))


def _read_by_others(
    parts: list[list[Part]], kept: Container[Constant], found: list[list[Part]]
) -> set[Constant]:
    """Return the constants that are read where their names do not mean them."""
    where: dict[Constant, tuple[int, ...]] = {}  # turns in which a constant is defined
    others: set[Constant] = set()
    count = itertools.count()
    for section, items in zip(parts, found, strict=True):
        places = (place for item in items for place in _places(item, (), (), count))
        left = (
            line for part in section for line in part.lines()
            if not (line.defined in kept and line.defined.of is None)
        )  # fmt: skip
        for line, (turns, steps) in zip(left, places, strict=True):
            for i, constant in enumerate(line.slots):
                if i == 0 and line.defined:
                    where[constant] = turns
                elif constant and constant not in kept:
                    own = where[constant]
                    if own != turns[: len(own)] or any(step[i] for step in steps[len(own) :]):
                        others.add(constant)
    return others


def _places(
    item: Part,
    turns: tuple[int, ...],
    steps: tuple[tuple[int, ...], ...],
    count: Iterator[int],
) -> Iterator[tuple[tuple[int, ...], tuple[tuple[int, ...], ...]]]:
    """Yield for each statement the turns around it, and the steps of its numbers in each."""
    if isinstance(item, Line):
        yield turns, steps
        return
    is_loop = isinstance(item, Loop)
    if is_loop:
        steps = *steps, item.steps
    inside, used = [], 0
    for part in item.parts:
        end = used + len(part.numbers)
        inside.append((part, tuple(step[used:end] for step in steps)))
        used = end
    for turn in islice(count, item.turns if is_loop else 1):
        for part, own in inside:
            yield from _places(part, (*turns, turn) if is_loop else turns, own, count)
