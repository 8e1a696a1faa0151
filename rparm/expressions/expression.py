"""Expressions that users write: their tree, its parser, kinds and values.

Nothing of the text is ever executed as Python. The parser climbs precedences.
"""

import math
import operator
import re
from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any, TypeVar

# functions, with the number of their arguments; None: two or more
FUNCTIONS: dict[str, int | None] = dict.fromkeys(
    ["sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"]
    + ["exp", "log", "sqrt", "abs"],
    1,
) | {"atan2": 2, "min": None, "max": None}
RELATIONS = ("<", "<=", ">", ">=")
CONSTANTS = ("pi",)
LITERALS = {"true": 1.0, "false": 0.0}
# not to be used as names: operators, and words that other languages execute or give a value
WORDS = ("and", "or", "not", "if", "else")
NO_NAMES = (*WORDS, *LITERALS, "True", "False", "None", "lambda")
Item = TypeVar("Item", bound=Any)  # hashable, with `arguments` of its own kind
NUMBER, CONDITION = "a number", "a condition"
LOGIC = ("and", "or", "not")
DEEPEST = 100  # levels of brackets and other nesting
UNIT_ONE = "1"  # name of an operation whose value has this unit
MOST_OPERATIONS = 10_000  # that functions make of an expression: they multiply
DERIVATIVE = "der"  # of a state, in front of a bracket
SPACE = re.compile(r"\s*")
TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)(?![\w.])"
    r"|(?P<name>[^\W\d]\w*(?:\.[^\W\d]\w*)*)"
    r"|(?P<operator>\*\*|<=|>=|[-+*/<>(),])"
)
SHOWN = 30  # characters of the text in a message
# how tightly operators bind
CONDITIONAL, OR, AND, NOT, RELATION, SUM, PRODUCT, SIGN, POWER = range(1, 10)
BINDING = {"if": CONDITIONAL, "or": OR, "and": AND, "+": SUM, "-": SUM, "*": PRODUCT, "/": PRODUCT}
BINDING |= {"**": POWER} | dict.fromkeys(RELATIONS, RELATION)
LONGEST = 1000  # characters
OPERATIONS: dict[str, Callable[..., float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": math.pow,
    "negative": operator.neg,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "and": lambda a, b: a and b,
    "or": lambda a, b: a or b,
    "not": operator.not_,
}
BUILT_IN = {"abs": abs, "min": min, "max": max}
OPERATIONS |= {name: BUILT_IN.get(name) or getattr(math, name) for name in FUNCTIONS}


# ---- The tree ------------------------------------------------------------------------------------
class ExpressionError(ValueError):
    """A mistake in an expression, in one line that begins with the column (from 1)."""

    def __init__(self, column: int, text: str) -> None:
        super().__init__(f"column {column}: {text}")


@dataclass(frozen=True, eq=False, slots=True)
class Node:
    """An operation, a number or a name.

    op is "number" (then `value` counts), "literal" (a condition: whether `value` is 1), "name"
    (then `name`), "table" (a look-up in the table `name`), an operator of `RELATIONS`, + - * / **,
    "negative", "and", "or", "not", "if" (arguments: condition, value if true, otherwise), or a name
    of `FUNCTIONS`. min and max have two arguments here.
    """

    op: str
    column: int
    arguments: tuple["Node", ...] = ()
    value: float = 0.0
    name: str = ""


def in_order(roots: Iterable[Item], known: Container[Item] = ()) -> list[Item]:
    """List all below and with `roots` that are not `known`, each once, arguments first."""
    done: dict[Item, None] = {}
    todo = [root for root in roots if root not in known][::-1]
    while todo:
        left = [a for a in todo[-1].arguments if a not in done and a not in known]
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
            case "negative" | "not":
                text = f"{'-' if node.op == 'negative' else 'not '}{inner[0]}"
            case "if":
                text = f"{inner[1]} if {inner[0]} else {texts[2]}"
            case op if op in BINDING:
                text = f" {op} ".join(inner)
            case op:
                text = f"{node.name if op == 'table' else op}({', '.join(texts)})"
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
def check_kinds(root: Node, expected: str = NUMBER, conditions: Collection[str] = ()) -> None:
    """Raise ExpressionError where a part is of the wrong kind; `conditions` are Booleans' names."""
    for node in in_order([root]):
        for number, argument in enumerate(node.arguments):
            is_condition = node.op in LOGIC or (node.op == "if" and number == 0)
            _check(argument, CONDITION if is_condition else NUMBER, conditions)
    _check(root, expected, conditions)


def _check(node: Node, expected: str, conditions: Collection[str]) -> None:
    is_condition = node.op == "name" and node.name in conditions
    found = CONDITION if is_condition or node.op in ("literal", *LOGIC, *RELATIONS) else NUMBER
    if found != expected:
        constants = {"number": "the number", "literal": "true" if node.value else "false"}
        what = node.name or constants.get(node.op, repr(node.op))
        raise ExpressionError(node.column, f"expected {expected}, {what} gives {found}")


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

    def of(self, given: Sequence[Node], column: int) -> Node:
        """Return its expression for these arguments; mistakes in it are at this column."""
        known = dict(zip(self.arguments, given, strict=True))
        found: dict[Node, Node] = {}
        for node in in_order([self.body]):
            if node.op == "name" and node.name in known:
                found[node] = known[node.name]
            else:
                arguments = tuple(found[argument] for argument in node.arguments)
                found[node] = replace(node, column=column, arguments=arguments)
        return replace(found[self.body], name=UNIT_ONE) if self.has_unit_one else found[self.body]


@dataclass(frozen=True)
class Lookup:
    """A table, which is called as a function."""

    name: str
    arguments: tuple[str, ...]

    def of(self, given: Sequence[Node], column: int) -> Node:
        """Return the look-up at these arguments."""
        return Node("table", column, tuple(given), name=self.name)


def parse(text: str, functions: Mapping[str, Function | Lookup] | None = None) -> Node:
    """Parse an expression; ExpressionError says what is wrong with it.

    functions: further ones, by name.
    """
    parser = _Parser(_tokens(text), {**FURTHER, **(functions or {})})
    root = parser.expression(CONDITIONAL)
    if parser.token.kind != "end":
        raise parser.unexpected("an operator")
    return root


def _tokens(text: str) -> list[Token]:
    tokens = []
    at = SPACE.match(text).end()
    while at < len(text):
        found = TOKEN.match(text, at)
        if found is None:
            piece = text[at : at + SHOWN].split()[0]
            hint = ": powers are written **" if piece.startswith("^") else ""
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
        if binding == RELATION and self.token.text in RELATIONS:
            raise self.unexpected("no second relation: write a < b and b < c")
        return Node(operator.text, operator.column, (left, right))

    def operand(self, floor: int) -> Node:
        token = self.token
        if token.kind == "number":
            return self.number()
        if token.text in LITERALS:
            self.take()
            return Node("literal", token.column, value=LITERALS[token.text])
        if token.kind == "name" and token.text not in NO_NAMES:
            self.take()
            if self.token.text == "(":
                return self.call(token)
            return Node("name", token.column, name=token.text)
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

    def number(self) -> Node:
        token = self.take()
        value = float(token.text)
        if not math.isfinite(value):
            raise ExpressionError(token.column, f"{token.shown} is too large")
        return Node("number", token.column, value=value)

    def call(self, function: Token) -> Node:
        """Parse the arguments of a function."""
        if function.text == DERIVATIVE:
            return self.derivative(function)
        further = self._functions.get(function.text)
        if function.text not in FUNCTIONS and further is None:
            known = ", ".join([*FUNCTIONS, *self._functions, DERIVATIVE])
            raise ExpressionError(function.column, f"no function {function.shown} (known: {known})")
        arguments = []
        separator = "("
        while self.token.text == separator:
            self.take()
            arguments.append(self.expression(CONDITIONAL))
            separator = ","
        self.expect(")")
        count = len(further.arguments) if further else FUNCTIONS[function.text]
        if len(arguments) != (count or max(2, len(arguments))):
            wanted = f"{count or '2 or more'} argument{'s' * (count != 1)}"
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
            text = f"functions make more than {MOST_OPERATIONS} operations of this expression"
            raise ExpressionError(column, text)
        return function.of(arguments, column)

    def derivative(self, function: Token) -> Node:
        """Parse the state whose derivative is meant."""
        self.expect("(")
        state = self.take()
        if state.kind != "name":
            raise ExpressionError(state.column, f"expected a state, got {state.shown}")
        self.expect(")")
        return Node("name", function.column, name=derivative_of(state.text))


def derivative_of(state: str) -> str:
    """Return the name that expressions have for the derivative of a state."""
    return f"{DERIVATIVE}({state})"


# functions that are no operations of their own; their names are free for variables
FURTHER: dict[str, Function] = {}
for _name, _arguments, _body in (
    ("sign", "x", "1 if x > 0 else -1 if x < 0 else 0"),
    ("hypot", "x y", "sqrt(x**2 + y**2)"),
    ("log10", "x", f"log(x) / {math.log(10)!r}"),
    ("cbrt", "x", f"x**{1 / 3!r} if x >= 0 else -(-x)**{1 / 3!r}"),
):
    FURTHER[_name] = Function(tuple(_arguments.split()), parse(_body), _name == "sign")


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
    tree = parse(text)
    check_kinds(tree)
    return Expression(text, tree)


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
