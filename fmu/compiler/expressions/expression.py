"""Expressions that users write: their tree, its parser, kinds and values.

Nothing of the text is ever executed as Python. The parser climbs precedences.
"""

import math
import operator
import re
from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import attrgetter
from typing import Any, TypeVar

from .hints import SIGNS, meant

# functions, with the number of their arguments; None: two or more
FUNCTIONS: dict[str, int | None] = dict.fromkeys(
    ["sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"]
    + ["exp", "log", "sqrt", "abs"],
    1,
) | {"atan2": 2, "min": None, "max": None}
RELATIONS = ("<", "<=", ">", ">=")
EQUALITIES = ("==", "!=")  # of what is counted or named
CONSTANTS = ("pi",)
LITERALS = {"true": 1.0, "false": 0.0}
# not to be used as names: operators, and words that other languages execute or give a value
WORDS = ("and", "or", "not", "if", "else")
NO_NAMES = (*WORDS, *LITERALS, "True", "False", "None", "lambda")
Item = TypeVar("Item", bound=Any)  # hashable, with `arguments` of its own kind
LOGIC = ("and", "or", "not")
DEEPEST = 100  # levels of brackets and other nesting
UNIT_ONE = "1"  # name of an operation whose value has this unit
MOST_OPERATIONS = 100_000  # that functions and sums make of an expression: they multiply
TOO_LARGE = f"functions and sums make more than {MOST_OPERATIONS} operations of this expression"
DERIVATIVE = "der"  # of a state, in front of a bracket
SPACE = re.compile(r"\s*")
TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)(?!\w|\.(?!\.))"
    r"|(?P<name>[^\W\d]\w*(?:\.[^\W\d]\w*)*)"
    r"|(?P<text>\"[^\"]*\"|'[^']*')"
    r"|(?P<operator>\*\*|[<>=!]=|\.\.|[-+*/<>(),\[\]=])"
)
SHOWN = 30  # characters of the text in a message
# how tightly operators bind
CONDITIONAL, OR, AND, NOT, RELATION, SUM, PRODUCT, SIGN, POWER = range(1, 10)
BINDING = {"if": CONDITIONAL, "or": OR, "and": AND, "+": SUM, "-": SUM, "*": PRODUCT, "/": PRODUCT}
BINDING |= {"**": POWER} | dict.fromkeys((*RELATIONS, *EQUALITIES), RELATION)
LONGEST = 1000  # characters
OPERATIONS: dict[str, Callable[..., float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": math.pow,
    "negative": operator.neg,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "and": lambda a, b: a and b,
    "or": lambda a, b: a or b,
    "not": operator.not_,
    "unit": lambda a: a,
}


def hypot(x: float, y: float) -> float:
    """Return the root of x**2 + y**2 with the bits of slopes_hypot (src/model/slopes.h)."""
    largest = max(abs(x), abs(y))
    scale = 2.0**600 if largest > 2.0**500 else 2.0**-600 if largest < 2.0**-500 else 1.0
    a, b = x / scale, y / scale
    return math.sqrt(a * a + b * b) * scale


BUILT_IN = {"abs": abs, "min": min, "max": max, "floor": math.floor, "hypot": hypot}
OPERATIONS |= {
    name: BUILT_IN.get(name) or getattr(math, name) for name in (*FUNCTIONS, "floor", "hypot")
}


# ---- The tree ------------------------------------------------------------------------------------
class ExpressionError(ValueError):
    """A mistake in an expression, in one line that begins with the column (from 1)."""

    def __init__(self, column: int, text: str) -> None:
        super().__init__(f"column {column}: {text}")


@dataclass(frozen=True, eq=False, slots=True)
class Node:
    """An operation, a number or a name.

    op is "number" (then `value` counts), "literal" (a condition: whether `value` is 1), "name"
    (then `name`), "text" (`name`, an item of an enumeration), "table" (a look-up in the table
    `name`), "call" (of the function `name`), "unit" (its argument, in the unit `name`), an operator
    of `RELATIONS` or `EQUALITIES`, + - * / **, "negative", "and", "or", "not", "if" (arguments:
    condition, value if true, otherwise), "floor", "hypot", or a name of `FUNCTIONS`. min and max
    have two arguments here.
    "element" of an array by indexes that follow from variables (arguments: the indexes; `name` has
    {} where they come; behind them, once `with_elements` has added them, the elements in `of`).
    Until `at_indexes` has replaced them: other elements, and "sum" of the `body` over the index
    `name` (arguments: first and last).
    `function`: of `FURTHER`, of whose expression it is.
    """

    op: str
    column: int
    arguments: tuple["Node", ...] = ()
    value: float = 0.0
    name: str = ""
    body: "Node | None" = None
    function: str = ""
    of: tuple[tuple[int, ...], ...] = ()


def in_order(
    roots: Iterable[Item],
    known: Container[Item] = (),
    read: Callable[[Item], Iterable[Item]] = attrgetter("arguments"),
) -> list[Item]:
    """List all below and with `roots` that are not `known`, each once after what it reads."""
    done: dict[Item, None] = {}
    todo = [root for root in roots if root not in known][::-1]
    while todo:
        left = [a for a in read(todo[-1]) if a not in done and a not in known]
        if left:
            todo += left[::-1]
        else:
            done.setdefault(todo.pop())
    return list(done)


def names(root: Node) -> frozenset[str]:
    """Return the names of variables in an expression."""
    found = {node.name for node in in_order([root]) if node.op == "name"}
    return frozenset(found.difference(CONSTANTS))


def written(root: Node) -> str:
    """Return the text of an expression, with the brackets that it needs."""
    found: dict[Node, tuple[str, int]] = {}  # with how tightly it binds
    for node in in_order([root]):
        own = {"negative": SIGN, "not": NOT, "if": CONDITIONAL, **BINDING}.get(node.op, POWER + 1)
        given = [found[argument] for argument in node.arguments]
        texts = [text for text, _ in given]
        inner = [  # from the left, operators of one kind need no brackets
            text if part > own or (part == own and i == 0 and own != POWER) else f"({text})"
            for i, (text, part) in enumerate(given)
        ]
        match node.op:
            case "number":
                text = f"{node.value:.12g}"
            case "literal":
                text = "true" if node.value else "false"
            case "name":
                text = node.name
            case "unit":
                text, own = given[0]
            case "negative" | "not":
                text = f"{'-' if node.op == 'negative' else 'not '}{inner[0]}"
            case "if":
                text = f"{inner[1]} if {inner[0]} else {texts[2]}"
            case "element":
                text = node.name.format(*texts)
            case op if op in BINDING:
                text = f" {op} ".join(inner)
            case op:
                text = f"{node.name if op in ('table', 'call') else op}({', '.join(texts)})"
        found[node] = text, own
    return found[root][0]


def finite_number(given: Any) -> float:
    """Return `given` as a float; ValueError says what was expected if it is not a finite number."""
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise ValueError("expected a number")
    try:
        number = float(given)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("expected a finite number")
    return number


# ---- Kinds of its parts --------------------------------------------------------------------------
NUMBER, WHOLE, CONDITION, TEXT = "a number", "a whole number", "a condition", "a text"
KEEP_WHOLE = ("+", "-", "*", "negative", "abs", "min", "max", "if")  # of whole numbers
Kind = str | tuple[str, ...]  # the items of an enumeration
KIND_HINTS = {  # by what is expected and what is given
    (WHOLE, NUMBER): ": write floor(...), which rounds down",
    (NUMBER, CONDITION): ": write 1 if ... else 0",
}


def with_kinds(
    root: Node, expected: Kind = NUMBER, kinds: Mapping[str, Kind] | None = None
) -> Node:
    """Return the tree with numbers (from 1) in place of items of enumerations.

    ExpressionError where a part is of the wrong kind. `kinds` has the names that are no numbers.
    """
    nodes, found = in_order([root]), {}
    for node in nodes:
        found[node] = _kind(node, [found[argument] for argument in node.arguments], kinds or {})
    items: dict[Node, Node] = {}
    needed, pairs = {root: expected}, [(root, expected)]
    for node in reversed(nodes):
        of_arguments = [*zip(node.arguments, _needed(node, needed[node], found), strict=True)]
        pairs += of_arguments[::-1]
        needed |= of_arguments
        if node.op == "text" and node.name in needed[node]:
            items[node] = _constant(node, needed[node].index(node.name) + 1)
    for node, kind in reversed(pairs):
        _check(node, found[node], kind)
    if items:
        for node in nodes:
            given = tuple(items.get(argument, argument) for argument in node.arguments)
            if given != node.arguments:
                items[node] = replace(node, arguments=given)
    return items.get(root, root)


def kind_of(root: Node, kinds: Mapping[str, Kind]) -> Kind:
    """Return the kind of an expression, of which `kinds` has the names that are no numbers."""
    found: dict[Node, Kind] = {}
    for node in in_order([root]):
        found[node] = _kind(node, [found[argument] for argument in node.arguments], kinds)
    return found[root]


def _kind(node: Node, given: list[Kind], kinds: Mapping[str, Kind]) -> Kind:
    if node.op == "name":
        return kinds.get(node.name, NUMBER)
    if node.op == "text":
        return TEXT
    if node.op in ("literal", *LOGIC, *RELATIONS, *EQUALITIES):
        return CONDITION
    if node.op == "if" and not {*given[1:]} <= {NUMBER, WHOLE, CONDITION}:
        return max(given[1:], key=lambda kind: isinstance(kind, tuple))
    if node.op == "element":
        elements = {*given[node.name.count("{}") :]}
        return elements.pop() if len(elements) == 1 else NUMBER
    is_whole = node.op == "number" and node.value.is_integer()
    if node.op == "**" and {*given} == {WHOLE}:
        exponent = node.arguments[1]
        is_whole = exponent.op == "number" and exponent.value >= 0
    is_whole |= node.op in KEEP_WHOLE and {*given[node.op == "if" :]} == {WHOLE}
    return WHOLE if is_whole or node.op == "floor" else NUMBER


def _needed(node: Node, own: Kind, found: Mapping[Node, Kind]) -> list[Kind]:
    """Return the kinds that the arguments must have."""
    given = [found[argument] for argument in node.arguments]
    if node.op in LOGIC:
        return [CONDITION] * len(given)
    if node.op == "if":
        is_item = not {*given[1:]} <= {NUMBER, WHOLE, CONDITION}
        return [CONDITION, *[own if is_item else NUMBER] * 2]
    if node.op in RANDOM:
        return [WHOLE] * len(given)
    if node.op == "element":
        count = node.name.count("{}")
        return [WHOLE] * count + [found[node]] * (len(given) - count)
    if node.op in EQUALITIES:
        enumerations = [kind for kind in given if isinstance(kind, tuple)]
        if not enumerations and {*given} not in ({WHOLE}, {CONDITION}):
            what = "compares whole numbers, conditions and enumerations"
            raise ExpressionError(node.column, f"{node.op!r} {what}, not {given[0]} and {given[1]}")
        return [enumerations[0] if enumerations else given[0]] * 2
    return [NUMBER] * len(given)


def _check(node: Node, found: Kind, needed: Kind) -> None:
    if found == needed or (found, needed) == (WHOLE, NUMBER):
        return
    if found == TEXT and (node.op == "if" or node.name in needed) and isinstance(needed, tuple):
        return
    constants = {"number": "the number", "literal": "true" if node.value else "false"}
    what = shown_text(node.name) if node.op == "text" else node.name
    what = what or constants.get(node.op, repr(node.function or node.op))
    wanted, given = (
        kind if isinstance(kind, str) else f"one of {', '.join(map(shown_text, kind))}"
        for kind in (needed, found)
    )
    hint = KIND_HINTS.get((wanted, given), "")
    raise ExpressionError(node.column, f"expected {wanted}, {what} gives {given}{hint}")


def shown_text(text: str) -> str:
    """Return a text as expressions have it."""
    return f'"{text:.{SHOWN}}"'


# ---- Its parser ----------------------------------------------------------------------------------
@dataclass(frozen=True, slots=True)
class Token:
    """A number, name or operator; at the end of the text one of kind "end"."""

    kind: str
    text: str
    column: int

    @property
    def shown(self) -> str:
        """As a message names it."""
        return repr(self.text[:SHOWN]) if self.text else "the end"


@dataclass(frozen=True)
class Function:
    """A function that stands for an expression of its arguments."""

    arguments: tuple[str, ...]
    body: Node
    has_unit_one: bool = False  # its value takes no other unit, although it is made of numbers
    name: str = ""  # by which `table_unit` has units of its arguments and its value
    function: str = ""  # of `FURTHER`

    def of(self, given: Sequence[Node], column: int) -> Node:
        """Return its expression for these arguments; mistakes in it are at this column."""
        if self.name:
            units = (table_unit(self.name, i) for i in range(len(given)))
            given = [
                Node("unit", a.column, (a,), 0.0, u) for a, u in zip(given, units, strict=True)
            ]
            body = replace(self, name="").of(given, column)
            return Node("unit", column, (body,), name=table_unit(self.name))
        known = dict(zip(self.arguments, given, strict=True))
        found = with_names(self.body, known, column, self.function)
        return replace(found, name=UNIT_ONE) if self.has_unit_one else found


def with_names(root: Node, known: Mapping[str, Node], column: int = 0, function: str = "") -> Node:
    """Return an expression with others in the place of names; a column counts for all of it."""
    found: dict[Node, Node] = {}
    for node in in_order([root]):
        if node.op == "name" and node.name in known:
            found[node] = known[node.name]
        else:
            found[node] = replace(
                node,
                column=column or node.column,
                arguments=tuple(found[argument] for argument in node.arguments),
                function=function or node.function,
            )
    return found[root]


def table_unit(name: str, argument: int | str = "") -> str:
    """Return the key that units have for an argument of a table or function, or for its value."""
    return f"{name}({argument})"


@dataclass(frozen=True)
class Range:
    """An index with its first and last value."""

    index: str
    first: Node
    last: Node

    def values(self, indexes: Mapping[str, int]) -> range:
        """Return its values; `indexes`: sizes and other indexes."""
        first, last = (_index(at_indexes(node, indexes)) for node in (self.first, self.last))
        if last - first >= MOST_OPERATIONS:
            raise ExpressionError(self.last.column, f"more than {MOST_OPERATIONS} values")
        return range(first, last + 1)


@dataclass(frozen=True)
class Lookup:
    """A table, a function of a C file or of `RANDOM`, floor or hypot: an operation of its own.

    optional: how many of the arguments need not be given; they are 0 then.
    """

    name: str
    arguments: tuple[str, ...]
    op: str = "table"
    optional: int = 0

    def of(self, given: Sequence[Node], column: int) -> Node:
        """Return the operation on these arguments."""
        function = self.name if self.op == self.name else ""
        zeros = [Node("number", column)] * (len(self.arguments) - len(given))
        return Node(self.op, column, (*given, *zeros), name=self.name, function=function)


def parse(text: str, functions: Mapping[str, Function | Lookup] | None = None) -> Node:
    """Parse an expression; ExpressionError says what is wrong with it.

    functions: further ones, by name.
    """
    parser = _Parser(_tokens(text), FURTHER if functions is None else {**FURTHER, **functions})
    root = parser.expression(CONDITIONAL)
    if parser.token.kind != "end":
        raise parser.unexpected("an operator")
    return root


def parse_ranges(text: str) -> list[Range]:
    """Parse "i = 1..n, j = 1..i"; ExpressionError says what is wrong with it."""
    parser = _Parser(_tokens(text), FURTHER)
    found = [parser.range()]
    while parser.token.text == ",":
        parser.take()
        found.append(parser.range())
    if parser.token.kind != "end":
        raise parser.unexpected("','")
    return found


def _tokens(text: str) -> list[Token]:
    tokens = []
    at = SPACE.match(text).end()
    while at < len(text):
        found = TOKEN.match(text, at)
        if found is None:
            piece = text[at : at + SHOWN].split()[0]
            hint = f": {SIGNS[piece[0]]}" if piece[0] in SIGNS else ""
            raise ExpressionError(at + 1, f"{piece!r} is no number, name or operator{hint}")
        kind = "operator" if found[0] in WORDS else str(found.lastgroup)
        tokens.append(Token(kind, found[0], at + 1))
        at = SPACE.match(text, found.end()).end()
    return [*tokens, Token("end", "", len(text) + 1)]


class _Parser:
    def __init__(self, tokens: list[Token], functions: Mapping[str, Function | Lookup]) -> None:
        self._tokens, self._functions = iter(tokens), functions
        self.token = next(self._tokens)
        self._depth = 0
        self._operations = 0  # that functions stand for

    def take(self) -> Token:
        """Return the current token, and go to the next one."""
        token = self.token
        self.token = next(self._tokens, token)
        return token

    def unexpected(self, expected: str) -> ExpressionError:
        return ExpressionError(self.token.column, f"expected {expected}, got {self.token.shown}")

    def expect(self, text: str) -> None:
        if self.token.text != text or self.token.kind != "operator":
            raise self.unexpected(repr(text))
        self.take()

    def expression(self, floor: int) -> Node:
        """Parse up to an operator that binds less than `floor`."""
        self._depth += 1
        if self._depth > DEEPEST + 1:
            raise ExpressionError(self.token.column, f"more than {DEEPEST} levels of brackets")
        left = self.operand(floor)
        while self.token.kind == "operator" and BINDING.get(self.token.text, 0) >= floor:
            left = self.operation(left)
        self._depth -= 1
        return left

    def operation(self, left: Node) -> Node:
        """Parse the operation whose operator stands here."""
        operator = self.take()
        binding = BINDING[operator.text]
        if binding == CONDITIONAL:
            condition = self.expression(OR)
            self.expect("else")
            otherwise = self.expression(CONDITIONAL)
            return Node("if", operator.column, (condition, left, otherwise))
        right = self.expression(SIGN if binding == POWER else binding + 1)
        if binding == RELATION and self.token.text in (*RELATIONS, *EQUALITIES):
            raise self.unexpected("no second relation: write a < b and b < c")
        return Node(operator.text, operator.column, (left, right))

    def operand(self, floor: int) -> Node:
        token = self.token
        if token.kind == "number":
            return self.number()
        if token.kind == "text":
            self.take()
            return Node("text", token.column, name=token.text[1:-1])
        if token.text in LITERALS:
            self.take()
            return Node("literal", token.column, value=LITERALS[token.text])
        if token.kind == "name" and token.text not in NO_NAMES:
            self.take()
            return self.call(token) if self.token.text == "(" else self.variable(token)
        if token.text == "(":
            self.take()
            inner = self.expression(CONDITIONAL)
            self.expect(")")
            return inner
        if token.text in ("-", "+"):
            self.take()
            value = self.expression(SIGN)
            return value if token.text == "+" else Node("negative", token.column, (value,))
        if token.text == "not" and floor <= NOT:
            self.take()
            return Node("not", token.column, (self.expression(NOT),))
        raise self.unexpected("a number, a name or '('")

    def variable(self, token: Token, form: str = "{}") -> Node:
        """Parse the indexes of a variable, if it has any; form: of its name."""
        if self.token.text != "[":
            return Node("name", token.column, name=form.format(token.text))
        indexes = []
        while self.token.text == ("," if indexes else "["):
            self.take()
            indexes.append(self.expression(CONDITIONAL))
        self.expect("]")
        name = form.format(f"{token.text}[{','.join(['{}'] * len(indexes))}]")
        return Node("element", token.column, tuple(indexes), name=name)

    def range(self) -> Range:
        """Parse "i = 1..n"."""
        token = self.take()
        if token.kind != "name" or token.text in NO_NAMES or "." in token.text:
            raise ExpressionError(token.column, f"expected an index such as i, got {token.shown}")
        self.expect("=")
        first = self.expression(CONDITIONAL)
        self.expect("..")
        return Range(token.text, first, self.expression(CONDITIONAL))

    def sum(self, column: int) -> Node:
        """Parse the range and the terms of a sum."""
        self.take()
        over = self.range()
        self.expect(",")
        body = self.expression(CONDITIONAL)
        if self.token.text in ("=", ","):
            raise self.unexpected("')', as in sum(i = 1..n, sum(j = 1..m, ...))")
        self.expect(")")
        return Node("sum", column, (over.first, over.last), name=over.index, body=body)

    def number(self) -> Node:
        token = self.take()
        value = float(token.text)
        if not math.isfinite(value):
            raise ExpressionError(token.column, f"{token.shown} is too large")
        return Node("number", token.column, value=value)

    def call(self, function: Token) -> Node:
        """Parse the arguments of a function."""
        if function.text == DERIVATIVE:
            return self.derivative()
        if function.text == "sum":
            return self.sum(function.column)
        further = self._functions.get(function.text)
        if function.text not in FUNCTIONS and further is None:
            known = [*FUNCTIONS, *self._functions, DERIVATIVE, "sum"]
            text = f"no function {function.shown}{meant(function.text, known)}"
            raise ExpressionError(function.column, f"{text} (known: {', '.join(known)})")
        arguments = []
        separator = "("
        while self.token.text == separator:
            self.take()
            if self.token.text == ")" and further and not further.arguments:
                break
            arguments.append(self.expression(CONDITIONAL))
            separator = ","
        self.expect(")")
        count = len(further.arguments) if further else FUNCTIONS[function.text]
        fewest = 2 if count is None else count - getattr(further, "optional", 0)
        if not fewest <= len(arguments) <= (count or len(arguments)):
            numbers = (
                "2 or more" if count is None else " or ".join(map(str, sorted({fewest, count})))
            )
            wanted = f"{numbers} argument{'s' * (count != 1)}"
            text = f"{function.text}: expected {wanted}, got {len(arguments)}"
            raise ExpressionError(function.column, text)
        if further:
            return self.expanded(further, arguments, function.column)
        if count:
            return Node(function.text, function.column, tuple(arguments))
        return reduce(lambda a, b: Node(function.text, function.column, (a, b)), arguments)

    def expanded(self, function: Function | Lookup, arguments: list[Node], column: int) -> Node:
        """Return the expression that a call stands for; those that multiply are refused."""
        if isinstance(function, Function):
            self._operations += len(in_order([function.body]))
        if self._operations > MOST_OPERATIONS:
            raise ExpressionError(column, TOO_LARGE)
        return function.of(arguments, column)

    def derivative(self) -> Node:
        """Parse the state whose derivative is meant."""
        self.expect("(")
        state = self.take()
        if state.kind != "name":
            raise ExpressionError(state.column, f"expected a state, got {state.shown}")
        found = self.variable(state, derivative_of("{}"))
        self.expect(")")
        return found


def derivative_of(state: str) -> str:
    """Return the name that expressions have for the derivative of a state."""
    return f"{DERIVATIVE}({state})"


# functions whose names are free for variables
FURTHER: dict[str, Function | Lookup] = {}
_WHOLE = {"whole": Lookup("floor", ("x",), "floor")}
for _name, _arguments, _body in (
    ("sign", "x", "1 if x > 0 else -1 if x < 0 else 0"),
    ("log10", "x", f"log(x) / {math.log(10)!r}"),
    ("cbrt", "x", f"x**{1 / 3!r} if x >= 0 else -(-x)**{1 / 3!r}"),
    ("ceil", "x", "-whole(-x)"),
    ("round", "x", "whole(x + 0.5)"),
    ("mod", "x y", "x - y * whole(x / y)"),
):
    _parts = (tuple(_arguments.split()), parse(_body, _WHOLE), _name == "sign")
    FURTHER[_name] = Function(*_parts, function=_name)
FURTHER |= {"floor": _WHOLE["whole"], "hypot": Lookup("hypot", ("x", "y"), "hypot")}
# of files with equations; a function of the same name that the file has is meant instead
RANDOM = {name: Lookup(name, ("seed", "k", "stream"), name, 1) for name in ("noise", "uniform")}


# ---- Indexes -------------------------------------------------------------------------------------
def at_indexes(root: Node, indexes: Mapping[str, int], are_known: bool = True) -> Node:
    """Replace indexes by their values, elements by their names, and sums by their terms.

    Conditions on indexes alone are decided. ExpressionError where an index is none; unless they
    `are_known`, elements stay whose indexes follow from variables.
    """
    return _AtIndexes(dict(indexes), are_known).of(root)


def with_elements(root: Node, elements: Mapping[str, Collection[tuple[int, ...]]]) -> Node:
    """Add their elements to the look-ups by indexes that follow from variables.

    elements: indexes of all elements, by the names of arrays. ExpressionError where there are none.
    """
    found: dict[Node, Node] = {}
    for node in in_order([root]):
        arguments = tuple(found[argument] for argument in node.arguments)
        new = node if arguments == node.arguments else replace(node, arguments=arguments)
        if node.op == "element":
            base, numbers = node.name.partition("[")[0], [*map(_number_of, arguments)]
            of = [
                at
                for at in elements.get(base, ())
                if len(at) == len(numbers)
                and all(n in (None, i) for n, i in zip(numbers, at, strict=True))
            ]
            if not of:
                raise ExpressionError(node.column, f"there is no {base} with such indexes")
            names = (f"{base}[{','.join(map(str, at))}]" for at in of)
            own = tuple(Node("name", node.column, name=name) for name in names)
            new = replace(node, arguments=arguments + own, of=tuple(of))
        found[node] = new
    return found[root]


def _number_of(index: Node) -> int | None:
    """Return the value of an index; None if it follows from variables."""
    return None if names(index) else _index(index)


class _AtIndexes:
    def __init__(self, indexes: dict[str, int], are_known: bool) -> None:
        self.indexes, self.are_known = indexes, are_known
        self.count = 0  # of operations

    def of(self, root: Node) -> Node:
        found: dict[Node, Node] = {}
        decided: set[Node] = set()  # by indexes and numbers
        fixed: set[Node] = set()  # by numbers
        nodes = in_order([root])
        self.count += len(nodes)
        if self.count > MOST_OPERATIONS:
            raise ExpressionError(root.column, TOO_LARGE)
        for node in nodes:
            given = tuple(found[argument] for argument in node.arguments)
            new = node if given == node.arguments else replace(node, arguments=given)
            if node.op == "name" and node.name in self.indexes:
                new = _constant(node, self.indexes[node.name])
                decided.add(new)
            elif node.op in ("number", "literal"):
                fixed.add(new)
            elif node.op == "element" and not self.are_known and any(map(names, given)):
                pass  # of variables
            elif node.op == "element":
                name = node.name.format(*map(_index, given))
                new = Node("name", node.column, name=name)
            elif node.op == "sum":
                new = self.summed(node, given)
            elif node.op in ("if", "and", "or") and decided.intersection(given):
                new = _decided(new, decided)
            elif node.op in OPERATIONS and {*given} <= fixed:
                fixed.add(new)
            elif node.op in OPERATIONS and {*given} <= fixed | decided:
                with suppress(ArithmeticError, ValueError):
                    new = _constant(node, evaluated(new, {}))
                    decided.add(new)
            found[node] = new
        return found[root]

    def summed(self, node: Node, given: tuple[Node, ...]) -> Node:
        """Return the terms of a sum, added from the first on."""
        if node.name in self.indexes:
            raise ExpressionError(node.column, f"index {node.name!r} has a meaning already")
        terms = []
        for value in Range(node.name, *given).values({}):
            self.indexes[node.name] = value
            terms.append(self.of(node.body))
        self.indexes.pop(node.name, None)
        if not terms:
            return _constant(node, 0)
        return reduce(lambda a, b: Node("+", node.column, (a, b)), terms)


def _constant(node: Node, value: float | bool) -> Node:
    return Node("literal" if type(value) is bool else "number", node.column, value=float(value))


def _decided(node: Node, decided: Collection[Node]) -> Node:
    """Return the part of an operation that counts, where a condition is decided."""
    first, second, *_ = node.arguments
    if node.op == "if":
        chosen = node.arguments[1 if first.value else 2]
        return chosen if first in decided else node
    rest, known = (second, first) if first in decided else (first, second)
    return rest if known.value == (node.op == "and") else known


def _index(node: Node) -> int:
    """Return the value of an index; ExpressionError if it is not known or not whole."""
    unknown = names(node)
    if unknown:
        text = f"{min(unknown)!r} is no size and no index of for or sum"
        raise ExpressionError(node.column, text)
    try:
        value = evaluated(node, {})
    except (KeyError, ArithmeticError, ValueError):
        value = math.nan
    if not math.isfinite(value) or value != int(value):
        raise ExpressionError(node.column, "expected a whole number as index")
    return int(value)


# ---- Values --------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Expression:
    """A number that follows from others. A name may have dots: ``component.variable``."""

    text: str
    tree: Node

    @cached_property
    def names(self) -> frozenset[str]:
        """Names whose values it needs."""
        return names(self.tree)

    def value(self, values: Mapping[str, float]) -> float:
        """Return the value; ArithmeticError, ValueError if it is not defined or too large."""
        result = evaluated(self.tree, values)
        if not math.isfinite(result):
            raise ValueError("is not a finite number")
        return result


def parsed(text: str) -> Expression:
    """Parse and check an expression; ValueError says what is wrong with it."""
    if len(text) > LONGEST:
        raise ValueError(f"has more than {LONGEST} characters")
    return Expression(text, with_kinds(at_indexes(parse(text), {})))


def evaluated(root: Node, values: Mapping[str, float]) -> float:
    """Evaluate a tree of right kinds, not its branches that are not taken; errors as in `value`."""
    known: dict[Node, float] = {}
    todo = [root]
    while todo:
        node = todo[-1]
        needed = node.arguments
        if node.op == "if" and needed[0] in known:
            needed = (needed[0], needed[1] if known[needed[0]] else needed[2])
        elif node.op == "if":
            needed = needed[:1]
        left = [argument for argument in needed if argument not in known]
        if left:
            todo += left
            continue
        if node.op == "if":
            known[node] = known[needed[1]]
        else:
            known[node] = _operation(node, [known[argument] for argument in needed], values)
        todo.pop()
    return known[root]


def _operation(node: Node, arguments: list[float], values: Mapping[str, float]) -> float:
    if node.op == "number":
        return node.value
    if node.op == "literal":
        return node.value > 0.0
    if node.op == "name":
        return math.pi if node.name == "pi" else values[node.name]
    return OPERATIONS[node.op](*arguments)
