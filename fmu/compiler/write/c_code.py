"""Values of a graph as statements: a constant for each operation, in the order of the text."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence

from ..expressions.expression import in_order
from ..graph import algebraic
from ..graph.graph import CONDITIONS, LEAVES, Value
from ..plain_c.values import RELATION, Conditions
from ..read.content import PLACEHOLDER, ModelFile
from .blocks import Blocks, Writer
from .c_text import indented, text
from .loops import printed
from .statements import Block, Constant, Item, Operand, Place, Statement, store

WITHOUT_DERIVATIVES = ("value_of", "moving_as")  # elsewhere they are their first argument
FUNCTIONS = {"hypot": "slopes_hypot", "noise": "random_normal", "uniform": "random_uniform"}


class Leaves(dict[tuple[str, str], Operand]):
    """Where C has leaves, by operation and name.

    names: of values. arrays: of tables in use. conditions: what integer leaves may be.
    """

    def __init__(
        self,
        places: Mapping[tuple[str, str], Operand],
        names: Mapping[Value, str],
        arrays: set[str],
        conditions: Conditions,
    ) -> None:
        super().__init__(places)
        self.names, self.arrays, self.conditions = names, arrays, conditions
        self.is_near = "false"  # or true, in C: solutions are searched near their anchors only
        self.is_free = "false"  # or true, in C: modes follow where solutions are searched
        self.is_solved = ""  # variable of C that is false where a system is not solved
        self.count = itertools.count(1)  # of the arrays of systems in a function

    def but(
        self,
        own: Mapping[tuple[str, str], Operand],
        is_near: str = "",
        is_free: str = "",
        is_solved: str = "",
    ) -> Leaves:
        """Return these leaves, of which some are elsewhere."""
        found = Leaves({**self, **own}, self.names, self.arrays, self.conditions)
        found.is_near = is_near or self.is_near
        found.is_free, found.is_solved = is_free or self.is_free, is_solved or self.is_solved
        found.count = self.count
        return found


class Code(Writer):
    """Statements, each value once; values that do not move are calculated in an `outer` code.

    names: of more values than the source has names for.
    """

    def __init__(
        self,
        leaves: Leaves,
        outer: Code | None = None,
        names: Mapping[Value, str] | None = None,
    ) -> None:
        self.leaves, self.outer = leaves, outer
        self.names = leaves.names if names is None else {**names, **leaves.names}
        self.statements: list[Item] = []
        self.known: dict[Value, Operand] = {}

    def of(self, root: Value) -> Operand:
        """Return the operand of a value."""
        if self.outer and not root.moves:
            return self.outer.of(root)
        for value in () if root in self.known else in_order([root], self.known):
            self.known[value] = self.operand(value, [self.known[x] for x in value.arguments])
        return self.known[root]

    def operand(self, value: Value, given: Sequence[Operand], name: str = "") -> Operand:
        """Return the operand of an operation on others, after its statement."""
        if value.op == "number":
            return value.number
        if value.op in LEAVES:
            place = self.leaves[value.op, value.name]
            return ("double", place) if self._is_int(value) else place
        if self.outer and not value.moves:
            return self.outer.of(value)
        name = self.names.get(value, name)
        match value.op:
            case op if op in WITHOUT_DERIVATIVES:
                return given[0]
            case op if op in RELATION and self._is_int(value.arguments[0]):
                return self._comparison(value, given)
            case "entry":
                self.leaves.arrays.add(value.name)
                return self.constant(("entry", value.name, *given), name=name)
            case "element":
                place, *row = given
                return self.constant(element(row, place), name=name)
            case "component":
                return self.constant(Place(f"{given[0]}[", int(value.name), "]"), name=name)
            case "factors":
                return self._factors(value, given)
            case "slopes":
                return self._slopes(value, given)
            case "linear":
                return self.linear(given)
            case "solution":
                return self._solution(value, given)
            case "locate":
                return self.constant(located(self, value.name, given[0]), "int", name)
        c_type = "int" if value.op in CONDITIONS else "double"
        return self.constant(called(value.op, *given), c_type, name)

    def _factors(self, value: Value, given: Sequence[Operand]) -> str:
        """Return the name of an array with a factorized matrix."""
        number, places = next(self.leaves.count), algebraic.places(value)
        count = 1 + max(i for i, _ in places)
        factors = f"factors_{number}"
        self.statements += [
            Statement((f"double {factors}[{count * (count + 1)}] = {{0.0}};",)),
            Statement((f"int pivot_{number}[{count}];",)),
        ]
        for (i, j), of in zip(places, given, strict=True):
            self.statements.append(store(Place(f"{factors}[", i * count + j, "]"), of))
        self.statements.append(
            Statement((f"algebraic_factorize({count}, {factors}, pivot_{number});",))
        )
        return factors

    def _slopes(self, value: Value, given: Sequence[Operand]) -> str:
        """Return the name of an array with the factorized slopes of a system."""
        number, count = next(self.leaves.count), self._size(value)
        factors = f"factors_{number}"
        self.statements += [
            Statement((f"double {factors}[{count * (count + 1)}] = {{0.0}};",)),
            Statement((f"int pivot_{number}[{count}];",)),
            Statement(
                (
                    f"factorize_{value.name}(",
                    *in_row(given[count:]),
                    ", ",
                    *in_row(given[:count]),
                    f", {factors}, pivot_{number});",
                )
            ),
        ]
        return factors

    def _size(self, value: Value) -> int:
        """Return how many unknowns a system has."""
        return len(self.leaves.conditions.graph.systems[value.name].unknowns)

    def linear(self, given: Sequence[Operand]) -> str:
        """Return the name of an array with the solution of linear equations."""
        factors, *right = given
        name, pivot = f"linear_{next(self.leaves.count)}", factors.replace("factors", "pivot")
        self.statements += [
            Statement((f"double {name}[{len(right)}];",)),
            Statement(
                (
                    f"algebraic_substitute({len(right)}, {factors}, {pivot}, ",
                    *in_row(right),
                    f", {name});",
                )
            ),
        ]
        if noted := self.leaves.is_solved:
            self.statements.append(Statement((f"{noted} &= isfinite({name}[0]) != 0;",)))
        return name

    def bounds(self, factors: str, errors: Sequence[Operand]) -> str:
        """Return the name of an array with errors of the solution, from those of right sides."""
        count, name = len(errors), f"bound_{next(self.leaves.count)}"
        pivot = factors.replace("factors", "pivot")
        parts = (
            f"algebraic_bounds({count}, {factors}, {pivot}, ",
            *in_row(errors),
            f", (double[{2 * count}]){{0.0}}, {name});",
        )
        self.statements += [Statement((f"double {name}[{count}];",)), Statement(parts)]
        return name

    def spread(self, vector: Value, errors: Sequence[Operand]) -> str:
        """Return the name of an array with errors of a solution, from those of its equations."""
        name, count = f"bound_{next(self.leaves.count)}", self._size(vector)
        read = [self.of(value) for value in vector.arguments[:-count]]
        parts = (f"spread_{vector.name}(", *in_row(read), f", {self.of(vector)}, {name});")
        self.statements += [
            Statement((f"double {name}[] = ", *in_row(errors, ""), ";")),
            Statement(parts),
        ]
        return name

    def _solution(self, value: Value, given: Sequence[Operand]) -> str:
        """Return the name of an array with the unknowns of a system."""
        name = f"solution_{next(self.leaves.count)}"
        count = self._size(value)
        read, guesses = given[:-count], given[-count:]
        has_anchors = any(a.op == "anchor" for a in value.arguments)
        is_near = self.leaves.is_near if has_anchors else "false"
        noted = f"{self.leaves.is_solved} &= " if self.leaves.is_solved else "(void)"
        self.statements += [
            Statement((f"double {name}[] = ", *in_row(guesses, ""), ";")),
            Statement(
                (
                    f"{noted}solve_{value.name}(",
                    *in_row(read),
                    f", {is_near}, {self.leaves.is_free}, {name});",
                )
            ),
        ]
        return name

    def _is_int(self, value: Value) -> bool:
        """Return whether C has an integer leaf as an int."""
        place = self.leaves.get((value.op, value.name))
        return value.op == "integer" and isinstance(place, Place) and place.c_type == "int"

    def _comparison(self, value: Value, given: Sequence[Operand]) -> Operand:
        """Compare an integer leaf, as an int with a whole number."""
        leaf, other = value.arguments
        if other.op != "number" or other.number != int(other.number):
            return self.constant((value.op, *given), "int")
        return value.op, self.leaves[leaf.op, leaf.name], self.whole(leaf, int(other.number))

    def whole(self, _leaf: Value, number: int) -> str:
        """Return a number that a leaf is compared with."""
        return str(number)

    def constant(
        self, of: Operand, c_type: str = "double", name: str = "", is_kept: bool = False
    ) -> Constant:
        """Return a new constant."""
        self.statements.append(Constant(of, c_type, name, is_kept))
        return self.statements[-1]

    def assign(self, values: Mapping[Place, Value]) -> Code:
        """Give places their values, after all of them have been calculated."""
        before = self.statements
        blocks = Blocks.of_graph(self, [*values.values()], self.leaves.conditions)
        given, statements = blocks.written()
        self.statements = [*before, *statements, *map(store, values, given)]
        return self

    @property
    def has_blocks(self) -> bool:
        """Whether later statements may not read all that is calculated."""
        return any(isinstance(item, Block) for item in self.statements)

    def lines(self) -> list[str]:
        """Return the text of the statements."""
        return printed(self.statements)[0]


def of_both(
    code: Code,
    first: Mapping[Place, Value],
    second: Mapping[Place, Value],
    array: str,
    end: str,
) -> list[list[str]]:
    """Return statements for the first places, and those behind them, unless an array is NULL."""
    firsts = code.assign(first).statements
    if code.has_blocks:
        alone = [f"if ({array} == NULL) {{", *indented([*code.lines(), end]), "}"]
        both = Code(code.leaves, names=code.names).assign({**first, **second})
        return [alone, both.lines()]
    code.statements = []
    lines = printed(firsts, code.assign(second).statements)
    return [[*lines[0], f"if ({array} == NULL) {{", f"    {end}", "}"], lines[1]]


def in_row(given: Sequence[Operand], of: str = "(const double[])") -> list[Operand]:
    """The parts of an array of C; it has one element at least."""
    parts: list[Operand] = [f"{of}{{"]
    for i, operand in enumerate(given or [0.0]):
        parts += [", "] * (i > 0) + [operand]
    return [*parts, "}"]


def called(op: str, *given: Operand) -> Operand:
    """An operation of the graph."""
    return FUNCTIONS.get(op, op), *given


def element(row: list[Operand], place: Operand) -> Operand:
    """The element of a row at a place; a part of an array of C is read where it is."""
    first, array = row[0], ("row", *row)
    function = "relations_element"
    if isinstance(first, Place) and first.index is not None:
        before, after = first.before, first.after
        following = enumerate(row, first.index)
        if all(isinstance(x, Place) and (x.before, x.index, x.after) == (before, i, after)
               for i, x in following):  # fmt: skip
            array = before.removeprefix("(double)").removesuffix("[")
            array += f" + {first.index}" if first.index else ""
            function = "relations_count" if before.startswith("(double)") else function
    return function, array, len(row), place


def located(code: Code, bounds: str, x: Operand) -> Operand:
    """The segment of x; without bounds the largest whole number up to it."""
    if not bounds:
        return "relations_floor", x
    code.leaves.arrays.add(bounds)
    return "relations_locate", bounds, f"sizeof {bounds} / sizeof *{bounds}", x


def told(
    file: ModelFile, code: Code, given: str, known: Collection[str] | None = None
) -> tuple[Operand, ...]:
    """Format and arguments of a message, in which values stand in the place of {NAME}.

    known: operations of the leaves that such a value may have; any if it is missing.
    """
    parts = PLACEHOLDER.split(given)
    form, arguments = parts[0].replace("%", "%%"), []
    for name, rest in zip(parts[1::2], parts[2::2], strict=True):
        variable, shown = file.variables.get(name), f"{{{name}}}"
        value = variable and (variable.leaf or variable.value)
        if value and (known is None or {op for op, _ in value.leaves} <= {*known}):
            shown, found = ("%g" if variable.is_real else "%d"), code.of(value)
            arguments += [", ", ("+", found, 0.0) if variable.is_real else ("(int)", found)]
        form += shown + rest.replace("%", "%%")
    return text(form), *arguments
