"""Values of a graph as statements in C that people read, with `if` blocks.

What only one branch of a choice needs is calculated in this branch. A value that several branches
use, and nothing else, is calculated under what these have in common: friction where a joint slides,
though efforts, energies and loads read it under conditions of their own. A value that is used once
stands where it is used; others are constants with the names that the source gave them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ..expressions.expression import in_order
from ..graph.graph import CONDITIONS, DERIVATIVES, LEAVES, Value
from ..plain_c.values import RELATION, Conditions, Known
from .c_code import indented, number

COSTS = {"+": 1, "-": 1, "*": 1, "negative": 0, "/": 5, "value_of": 0, "moving_as": 0, "if": 0}
OF_FUNCTION = 20
WORTH_A_BRANCH = 8  # cost of what is not calculated then
MOST_LEVELS = 20  # of guards within each other
Path = tuple[tuple[Value, bool], ...]  # conditions that hold, or do not, from outside to inside
WIDTH = 100
MOST_CHOSEN = 2  # cost of both branches of ?:
MOST_INLINE = 72  # characters of an expression within another
# how tightly an operation binds
PRIMARY, UNARY, TERNARY = 10, 9, 2
BINDING = {"*": 8, "/": 8, "+": 7, "-": 7, "<": 6, "<=": 6, ">": 6, ">=": 6, "==": 5}
BINDING |= {"and": 4, "or": 3}
SYMBOLS = {"and": "&&", "or": "||"}
NUMBER = re.compile(r"\(?-?[\d.e+-]+\)?")
KEYWORDS = {"auto", "break", "case", "char", "const", "continue", "default", "do", "double"}
KEYWORDS |= {"else", "enum", "extern", "float", "for", "goto", "if", "inline", "int", "long"}
KEYWORDS |= {"register", "restrict", "return", "short", "signed", "sizeof", "static", "struct"}
KEYWORDS |= {"switch", "typedef", "union", "unsigned", "void", "volatile", "while", "bool"}
KEYWORDS |= {"true", "false", "NULL", "y0", "y1", "yn", "j0", "j1", "jn", "gamma", "real"}
RESERVED = {*KEYWORDS, *DERIVATIVES}
Text = tuple[str, int]  # of an expression, and how tightly it binds


@dataclass(frozen=True)
class Need:
    """A value is needed where integer leaves have one of these values and the literals hold."""

    sets: tuple[tuple[Value, frozenset[int]], ...] = ()
    literals: Path = ()


def cost(value: Value) -> int:
    """Estimate how long an operation takes, in additions."""
    if not value.arguments or value.op in CONDITIONS:
        return 0
    return COSTS.get(value.op, OF_FUNCTION)


def plain(value: Value) -> Value:
    """Return the value without operations that differ in derivatives only."""
    while value.op in ("value_of", "moving_as"):
        value = value.arguments[0]
    return value


def stripped(targets: Mapping[str, Value], conditions: Conditions) -> tuple[
    dict[str, Value], dict[Value, Value]
]:  # fmt: skip
    """Remove operations that differ in derivatives only; map each value to its successor."""
    found: dict[Value, Value] = {}
    for value in in_order(targets.values()):
        if value.op in ("value_of", "moving_as"):
            found[value] = found[value.arguments[0]]
        else:
            found[value] = _with(value, [found[a] for a in value.arguments], conditions)
    return {target: found[value] for target, value in targets.items()}, found


def _with(value: Value, arguments: list[Value], conditions: Conditions) -> Value:
    """Return the operation with other arguments."""
    if all(a is b for a, b in zip(value.arguments, arguments, strict=True)):
        return value
    graph = conditions.graph
    new = graph.value(value.op, *arguments, name=value.name, number=value.number)
    if value in conditions.members:
        conditions.members[new] = conditions.members[value]
    return new


def paths(targets: Mapping[str, Value]) -> dict[Value, Path]:
    """Find the innermost branch that contains all uses of a value."""
    found: dict[Value, Path] = {value: () for value in targets.values()}

    def use(value: Value, path: Path) -> None:
        found[value] = common(found[value], path) if value in found else path

    for value in in_order(targets.values())[::-1]:
        path = found[value]
        for argument, literal in _uses(value):
            use(argument, (*path, literal) if literal else path)
    return found


def _uses(value: Value) -> list[tuple[Value, tuple[Value, bool] | None]]:
    """Yield arguments, with the condition under which they are used."""
    if value.op != "if":
        return [(argument, None) for argument in value.arguments]
    condition, first, second = value.arguments
    return [(condition, None), (first, (condition, True)), (second, (condition, False))]


def common(first: Path, second: Path) -> Path:
    """Return the common begin of two paths."""
    length = 0
    for a, b in zip(first, second, strict=False):
        if a[0] is not b[0] or a[1] is not b[1]:
            break
        length += 1
    return first[:length]


def known_on(path: Path, conditions: Conditions) -> Known:
    """Return the knowledge in a branch."""
    known = Known()
    for condition, holds in path:
        known = conditions.assume(condition, holds, known) or known
    return known


def costs_inside(
    values: Iterable[Value], places: Mapping[Value, Path]
) -> Counter[tuple[Path, Value]]:
    """Return the cost of both branches of each condition, by its place."""
    found: Counter[tuple[Path, Value]] = Counter()
    for value in values:
        path = places[value]
        for i in range(len(path)):
            found[path[:i], path[i][0]] += cost(value)
    return found


def guarded(
    targets: Mapping[str, Value], conditions: Conditions
) -> tuple[dict[str, Value], dict[Value, Value]]:
    """Put values that only some cases need behind choices; map each to its successor."""
    became = {value: value for value in in_order(targets.values())}
    for _ in range(MOST_LEVELS):
        guards = Guards(targets, conditions)
        if not guards.found:
            break
        targets, found = guards.rewritten()
        became = {value: found[now] for value, now in became.items() if now in found}
    targets, found = settled(targets, conditions)
    return targets, {value: found[now] for value, now in became.items() if now in found}


def settled(
    targets: Mapping[str, Value], conditions: Conditions
) -> tuple[dict[str, Value], dict[Value, Value]]:
    """Remove choices that the blocks around them have made; map each value to its successor."""
    places = paths(targets)
    found: dict[Value, Value] = {}
    for value in in_order(targets.values()):
        now = _with(value, [found[a] for a in value.arguments], conditions)
        if value.op == "if" and places[value]:
            known = known_on(places[value], conditions)
            choice = conditions.resolve(value.arguments[0], known)
            if choice.op == "number":
                now = now.arguments[1 if choice.number else 2]
        found[value] = now
    return {target: found[value] for target, value in targets.items()}, found


class Guards:
    """The guards of values that are needed in some cases only: conditions that stand outermost."""

    def __init__(self, targets: Mapping[str, Value], conditions: Conditions) -> None:
        self.targets, self.conditions = targets, conditions
        self.order = in_order(targets.values())
        self.paths = paths(targets)
        self.needs: dict[Value, Need] = {value: Need() for value in targets.values()}
        for value in self.order[::-1]:
            need = self.needs[value]
            for argument, literal in _uses(value):
                new = self._and(need, *literal) if literal else need
                known = self.needs.get(argument)
                self.needs[argument] = new if known is None else self._either(known, new)
        self.found = self._guards()

    def rewritten(self) -> tuple[dict[str, Value], dict[Value, Value]]:
        """Return the targets' values with guards; map each value to its successor."""
        zero = self.conditions.graph.number(0.0)
        guards = self.found
        found: dict[Value, Value] = {}
        for value in self.order:
            arguments = []
            for argument, literal in _uses(value):
                new, guard = found[argument], guards.get(argument)
                if guard is not None and not self._is_inside(value, argument, literal, guards):
                    new = self.conditions.select(guard, new, zero)
                arguments.append(new)
            found[value] = _with(value, arguments, self.conditions)
        return {target: found[value] for target, value in self.targets.items()}, found

    def _is_inside(
        self,
        user: Value,
        value: Value,
        literal: tuple[Value, bool] | None,
        guards: Mapping[Value, Value],
    ) -> bool:
        """Return whether a use of a value is behind the same guard."""
        guard, path = guards[value], self.paths[value]
        if guards.get(user) is guard and self.paths[user] == path:
            return literal is None
        of_use = (*self.paths[user], literal) if literal else self.paths[user]
        if len(of_use) <= len(path):
            return False
        condition, holds = of_use[len(path)]
        return guard is (condition if holds else self.conditions.no(condition))

    def _guards(self) -> dict[Value, Value]:
        """Return conditions that are stronger than the uses' and worth a branch."""
        found: dict[Value, Value] = {}
        costs: Counter[tuple[Path, Value]] = Counter()
        inside = costs_inside(self.order, self.paths)
        for value in self.order:
            if cost(value) == 0 and value.op != "if":
                continue
            guard = self._condition(self.needs[value], known_on(self.paths[value], self.conditions))
            has_it = value.op == "if" and value.arguments[0] in (guard, self.conditions.no(guard))
            if guard.op != "number" and not has_it:
                found[value] = guard
                path = self.paths[value]
                own = inside[path, value.arguments[0]] if value.op == "if" else cost(value)
                costs[path, guard] += own
        worth = [v for v, guard in found.items() if costs[self.paths[v], guard] >= WORTH_A_BRANCH]
        depth = min((len(self.paths[value]) for value in worth), default=0)
        return {value: found[value] for value in worth if len(self.paths[value]) == depth}

    def _condition(self, need: Need, known: Known) -> Value:
        """Turn a need into a condition, where some is known already."""
        result = self.conditions.true
        for leaf, values in need.sets:
            member = self.conditions.member(leaf, values, known)
            result = self.conditions.both(result, self.conditions.resolve(member, known))
        for condition, holds in need.literals:
            literal = condition if holds else self.conditions.no(condition)
            result = self.conditions.both(result, self.conditions.resolve(literal, known))
        return result

    def _and(self, need: Need, condition: Value, holds: bool) -> Need:
        """Add a condition to a need."""
        if condition.op == "not":
            return self._and(need, condition.arguments[0], not holds)
        if condition in self.conditions.members:
            leaf, inside = self.conditions.members[condition]
            domain = self.conditions.domains[leaf]
            sets = dict(need.sets)
            sets[leaf] = sets.get(leaf, domain) & (inside if holds else domain - inside)
            return Need(tuple(sets.items()), need.literals)
        if condition.op in ("and", "or") and holds is (condition.op == "and"):
            for part in condition.arguments:
                need = self._and(need, part, holds)
            return need
        new = (condition, holds)
        return need if new in need.literals else Need(need.sets, (*need.literals, new))

    def _either(self, first: Need, second: Need) -> Need:
        """Return the common part of two needs."""
        other = dict(second.sets)
        sets = []
        for leaf, values in first.sets:
            union = values | other.get(leaf, self.conditions.domains[leaf])
            if union != self.conditions.domains[leaf]:
                sets.append((leaf, union))
        literals = tuple(literal for literal in first.literals if literal in second.literals)
        return Need(tuple(sets), literals)


class Scope:
    """Texts of known values in a block and around it; the block is for values `wanted`."""

    def __init__(self, path: Path, wanted: set[Value], outer: Scope | None = None) -> None:
        self.path, self.wanted, self.outer = path, wanted, outer
        self.known: dict[Value, Text] = {}
        self.shared: set[Value] = set()  # which a later block with this condition reads, too
        self.lines: list[str] = []

    def find(self, value: Value) -> Text | None:
        scope: Scope | None = self
        while scope is not None:
            if value in scope.known:
                return scope.known[value]
            scope = scope.outer
        return None


class Blocks:
    """Statements that give lvalues of C (`targets`) values; `enumerators` name whole numbers."""

    def __init__(
        self,
        targets: Mapping[str, Value],
        names: Mapping[Value, str],
        conditions: Conditions,
        enumerators: Mapping[str, Mapping[int, str]],
        taken: Iterable[str] = (),
    ) -> None:
        self.enumerators = enumerators
        targets, plain = stripped(targets, conditions)
        targets, became = guarded(targets, conditions)
        self.names: dict[Value, str] = {}
        for value, name in names.items():
            if plain.get(value) in became:
                self.names.setdefault(became[plain[value]], name)
        self.taken = {*taken, *RESERVED}
        self.targets = targets
        self.order = in_order(targets.values())
        self.uses = Counter(a for v in self.order for a in v.arguments)
        self.uses.update(targets.values())
        self.paths = paths(targets)
        self.blocks = self._block_values()
        bits = {value: 1 << i for i, value in enumerate(self.blocks)}
        self.depends: dict[Value, int] = {}  # on values of blocks, as bits
        for value in self.order:
            mask = 0
            for argument in value.arguments:
                mask |= self.depends[argument] | bits.get(argument, 0)
            self.depends[value] = mask
        self.bits, self.in_progress = bits, 0

    def lines(self) -> list[str]:
        """Return the statements."""
        scope = Scope((), set(self.order))
        for target, value in self.targets.items():
            scope.lines.append(f"{target} = {self._result(value, scope)};")
        return scope.lines

    def _result(self, value: Value, scope: Scope) -> str:
        """Write a value that is stored: it needs no name if nothing else uses it."""
        is_only_here = self.uses[value] == 1 and value.arguments and value not in self.blocks
        if is_only_here and scope.find(value) is None and len(self.paths[value]) >= len(scope.path):
            return self._expression(value, scope)[0]
        return self.text(value, scope)[0]

    def _is_constant(self, value: Value) -> bool:
        """Return whether it may get a name, as an operation, or as it is read twice."""
        is_read = value.op in LEAVES and value.op != "integer" and self.uses[value] > 1
        return is_read or bool(value.arguments)

    # ---- Where values are calculated -------------------------------------------------------------

    def _block_values(self) -> dict[Value, None]:
        """Return choices with calculations in a branch; the others are `?:`."""
        inside = costs_inside(self.order, self.paths)
        return {
            value: None for value in self.order
            if value.op == "if" and inside[self.paths[value], value.arguments[0]] > MOST_CHOSEN
        }  # fmt: skip

    # ---- Statements ------------------------------------------------------------------------------

    def text(self, value: Value, scope: Scope) -> Text:
        """Write the expression of a value in a block, after statements that it needs."""
        found = scope.find(value)
        if found is not None:
            return found
        if not self._is_constant(value):
            return self._leaf(value)
        while len(scope.path) > len(self.paths[value]) and scope.outer is not None:
            scope = scope.outer  # it was forgotten before the block began
        if value in self.blocks:
            self._block(value, scope)
            return self.text(value, scope)
        text = self._expression(value, scope)
        if value.op in CONDITIONS or self._is_inline(value, text, scope):
            return text
        name = self._new_name(value)
        if value in scope.shared and scope.outer is not None:
            self._share(value, name, scope.outer)
            scope.lines.append(f"{name} = {text[0]};")
        else:
            scope.lines.append(f"const double {name} = {text[0]};")
            scope.known[value] = (name, PRIMARY)
        return (name, PRIMARY)

    def _share(self, value: Value, name: str, scope: Scope) -> None:
        """Declare a value in front of the block that calculates it."""
        scope.lines.append(f"double {name} = 0.0;")
        scope.known[value] = (name, PRIMARY)

    def _is_inline(self, value: Value, text: Text, scope: Scope) -> bool:
        if value in scope.shared:
            return False
        if value.op == "negative" and text[0][1:].isidentifier():
            return True
        return self.uses[value] == 1 and value not in self.names and len(text[0]) <= MOST_INLINE

    def _leaf(self, value: Value) -> Text:
        if value.op == "number":
            return number(value.number), PRIMARY
        return value.name, PRIMARY

    def _expression(self, value: Value, scope: Scope) -> Text:
        if not value.arguments:
            return self._leaf(value)
        given = [self.text(argument, scope) for argument in value.arguments]
        if value.arguments[0].op == "integer" and value.op in RELATION:
            return self._of_integer(value)
        given = [
            (f"(double){text}", UNARY) if argument.op == "integer" else (text, binding)
            for argument, (text, binding) in zip(value.arguments, given, strict=True)
        ]
        match value.op:
            case "negative":
                text, binding = given[0]
                return "-" + (text if binding >= UNARY and text[0] != "-" else f"({text})"), UNARY
            case "not":
                return self._not(value.arguments[0], given[0])
            case "if":
                parts = [self._within(text, TERNARY + 1) for text in given]
                return f"{parts[0]} ? {parts[1]} : {parts[2]}", TERNARY
            case op if op in BINDING:
                binding = BINDING[op]
                left, right = given
                is_mixed = op == "or"  # && within || needs none, but compilers ask for them
                low = UNARY if is_mixed and left[1] == BINDING["and"] else binding
                texts = self._within(left, low), self._within(right, binding + 1)
                if is_mixed and right[1] == BINDING["and"]:
                    texts = texts[0], self._within(right, UNARY)
                return f"{texts[0]} {SYMBOLS.get(op, op)} {texts[1]}", binding
        return f"{value.op}({', '.join(text for text, _ in given)})", PRIMARY

    def _of_integer(self, value: Value) -> Text:
        """Write a comparison of an integer leaf with a whole number."""
        leaf, other = value.arguments
        named = self.enumerators.get(leaf.name, {})
        constant = int(other.number)
        return f"{leaf.name} {value.op} {named.get(constant, constant)}", BINDING[value.op]

    def _not(self, condition: Value, text: Text) -> Text:
        if condition.op == "==" and " == " in text[0]:
            return text[0].replace(" == ", " != "), BINDING["=="]
        return f"!{self._within(text, UNARY)}", UNARY

    def _within(self, text: Text, least: int) -> str:
        return text[0] if text[1] >= least else f"({text[0]})"

    def _block(self, value: Value, scope: Scope) -> None:
        """Write the `if` that calculates a choice and all others that go with it."""
        condition, path = value.arguments[0], self.paths[value]
        group = [value]
        busy, below = self.in_progress | self.bits[value], self.depends[value]
        same = [
            other for other in self.blocks
            if other.arguments[0] is condition and self.paths[other] == path
            and other in scope.wanted and scope.find(other) is None
        ]  # fmt: skip
        for other in same:
            if (
                other is not value
                and not self.depends[other] & busy
                and not (self.in_progress | below) & self.bits[other]
            ):
                group.append(other)
                busy |= self.bits[other]
                below |= self.depends[other]
        before, self.in_progress = self.in_progress, busy
        for needed in self._needed(group, path):
            self.text(needed, scope)
        head = self.text(condition, scope)

        names = [self._new_name(member) for member in group]
        bodies = []
        for holds in (True, False):
            results = [member.arguments[1 if holds else 2] for member in group]
            inner = Scope((*path, (condition, holds)), set(), scope)
            inner.wanted = self._inside(results, len(inner.path))
            later = [other for other in same if scope.find(other) is None and other not in group]
            inner.shared = self._shared(later, inner, 1 if holds else 2)
            given = [self._result(result, inner) for result in results]
            bodies.append((inner.lines, given))
        if not bodies[0][0] and all(NUMBER.fullmatch(value) for value in bodies[0][1]):
            head, bodies = self._not(condition, head), bodies[::-1]
        self.in_progress = before
        has_values = not bodies[1][0] and all(NUMBER.fullmatch(value) for value in bodies[1][1])
        for name, member, value in zip(names, group, bodies[1][1], strict=True):
            if member in scope.shared and scope.outer is not None:
                self._share(member, name, scope.outer)
                scope.lines += [f"{name} = {value};"] if has_values else []
            else:
                scope.lines.append(f"double {name} = {value};" if has_values else f"double {name};")
                scope.known[member] = (name, PRIMARY)
        scope.lines += self._if(head[0], names, *bodies[: 1 if has_values else 2])

    def _if(self, head: str, names: list[str], *bodies: tuple[list[str], list[str]]) -> list[str]:
        """Write a block: statements and results of one branch or of both."""
        found = [f"if ({head}) {{"]
        for i, (lines, given) in enumerate(bodies):
            results = [f"{name} = {value};" for name, value in zip(names, given, strict=True)]
            found += ["} else {"] * i + indented([*lines, *results])
        return [*found, "}"]

    def _inside(self, roots: list[Value], depth: int) -> set[Value]:
        """Return the values in a block that the roots follow from."""
        found: set[Value] = set()
        todo = list(roots)
        while todo:
            value = todo.pop()
            if value not in found and len(self.paths[value]) >= depth:
                found.add(value)
                todo += value.arguments
        return found

    def _shared(self, later: list[Value], scope: Scope, branch: int) -> set[Value]:
        """Return the values of a block that other choices of the same condition start from."""
        if not later:
            return set()
        depth = len(scope.path)
        results = [other.arguments[branch] for other in later]
        users = self._inside(results, depth) - scope.wanted
        read = {*results, *(argument for user in users for argument in user.arguments)}
        return {v for v in read & scope.wanted if self.paths[v] == scope.path and v.arguments}

    def _needed(self, group: list[Value], path: Path) -> list[Value]:
        """Return values that branches need and that are calculated before them, in this block."""
        members, seen, found = set(group), set(group), []
        todo = [a for value in group[::-1] for a in value.arguments[::-1]]
        while todo:
            value = todo.pop()
            if value in seen:
                continue
            seen.add(value)
            if len(self.paths[value]) > len(path):
                todo += value.arguments[::-1]
            elif self.paths[value] == path and value not in members and self._is_constant(value):
                if value.op in CONDITIONS:
                    todo += value.arguments[::-1]
                else:
                    found.append(value)
        return found

    def _new_name(self, value: Value) -> str:
        """Return a name that is free."""
        base = self.names.get(value, "")
        if value.op == "if" and not base:
            base = self.names.get(value.arguments[1]) or self.names.get(value.arguments[2], "")
        base = base or "t"
        name, count = base, 1
        while name in self.taken or (base == "t" and count == 1):
            count += 1
            name = f"{base}{count - 1}" if base == "t" else f"{base}_{count}"
        self.taken.add(name)
        return name


def wrapped(line: str) -> list[str]:
    """Break a statement into lines that are not too long."""
    lines: list[str] = []
    own = len(line) - len(line.lstrip()) + 4
    while len(line) > WIDTH:
        at = line.rfind(" ", own + 8, WIDTH)
        if at < 0:
            break
        lines.append(line[:at])
        line = " " * own + line[at + 1 :]
    return [*lines, line]
