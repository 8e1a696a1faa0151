"""C that is derived from functions in plain C: Jacobians, and derivatives along a curve."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pycparser import c_ast

from ..expressions.expression import in_order
from ..graph.curve import Curve
from ..graph.graph import Graph, Value
from ..plain_c.interpreter import Interpreter
from ..plain_c.memory import Array, Pointer, Structure, is_real, is_whole
from ..plain_c.text import CTextError, Program, refused
from . import statements
from .c_code import Code, Leaves
from .c_text import WIDTH, indented
from .loops import printed
from .statements import Operand

Place = tuple[str | int, ...]  # a part of an argument, from its name
KINDS = ("jacobian", "rates", "derivatives")
FORM = "NAME = jacobian|rates|derivatives of FUNCTION [OUTPUT ...] by ARGUMENT ..."


class WithEnumerators(Code):
    """Statements where whole numbers have their names."""

    def __init__(self, leaves: Leaves, names: Mapping[str, Mapping[int, str]]) -> None:
        super().__init__(leaves)
        self.enumerators = names

    def whole(self, leaf: Value, number: int) -> str:
        """Return the name of a number that a leaf is compared with."""
        return self.enumerators.get(leaf.name, {}).get(number, str(number))


@dataclass(frozen=True)
class Wanted:
    """A "jacobian", "rates" (first derivatives along a curve) or "derivatives" (both) to derive.

    `of`: the arguments that the function writes, if not of all. `by`: the arguments that move.
    """

    name: str
    kind: str
    function: str
    of: tuple[str, ...]
    by: tuple[str, ...]

    @staticmethod
    def read(text: str) -> Wanted:
        """Parse a text of the form `FORM`."""
        match text.split():
            case [name, "=", kind, "of", function, *rest] if kind in KINDS and "by" in rest:
                at = rest.index("by")
                return Wanted(name, kind, function, tuple(rest[:at]), tuple(rest[at + 1 :]))
        raise CTextError(f"{text!r}: is not {FORM}")


@dataclass
class Derived:
    """Derives from the functions of a program. modes: names of possible values of integer parts."""

    program: Program
    modes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def text(self, wanted: Iterable[Wanted], header: str) -> str:
        """Write the C file; header: its include, with the prototypes."""
        parts = [Function(self, each).text() for each in wanted]
        own = [path.name for path in self.program.files]
        lines = [
            "/* Derived from equations in plain C by the build: change those, not this file.",
            " * Operations keep their order, and values their names: d_x is the first derivative",
            " * of x along a curve, dd_x the second, x_by_y the derivative of x by y.",
            " *",
            *wrapped_list(" * Read: ", own),
            " */",
            f'#include "{header}"',
            "",
            "#include <math.h>",
            "#include <stddef.h>",
        ]
        return "\n".join([*lines, "", "\n\n".join(parts), ""])


class Function:
    """One derived function."""

    def __init__(self, derived: Derived, wanted: Wanted) -> None:
        self.wanted, self.program = wanted, derived.program
        self.graph = Graph(has_switches=False, is_guarded=False)
        self.interpreter = Interpreter(
            self.program, self.graph, doubles_move="real" not in self.program.typedefs,
            is_exact=False, warn=derived.warnings.append,
        )  # fmt: skip
        function = self.program.functions.get(wanted.function)
        if function is None:
            name = self.program.files[0].name
            raise CTextError(f"{name}: has no function {wanted.function}")
        self.function = function
        self.parameters = self.interpreter.parameters(function)
        self.kinds = {parameter.name: kind for parameter, kind in self.parameters}
        for name in wanted.by:
            if name not in self.kinds:
                raise refused(function.decl, f"{wanted.function} has no argument {name}")
        self.modes, self.enumerators = self._modes(derived.modes)
        self.places: dict[Value, Place] = {}
        self.names: dict[Value, str] = {}
        _, self.written = self.interpreter.run(wanted.function, self._leaf)
        self.outs = {str(place[0]) for place in self.written}

    def _modes(
        self, modes: Mapping[str, tuple[str, ...]]
    ) -> tuple[dict[str, tuple[int, ...]], dict[str, dict[int, str]]]:
        """Return possible values of integer parts, and their names."""
        values: dict[str, tuple[int, ...]] = {}
        names: dict[str, dict[int, str]] = {}
        for place, words in modes.items():
            found = {}
            for word in words:
                is_number = word.lstrip("-").isdigit()
                found[int(word) if is_number else self.interpreter.enumerator(word)] = word
            values[place], names[place] = tuple(sorted(found)), found
        return values, names

    def _leaf(self, place: Place, kind: Any) -> Any:
        text = shown(place, self.kinds[place[0]])
        if is_whole(kind):
            key = general(place)
            known = [mode for mode in self.modes if f".{key}".endswith(f".{mode}")]
            domain = self.modes[known[0]] if known else None
            self.enumerators[text] = self.enumerators[known[0]] if known else {}
            return self.interpreter.conditions.leaf(text, domain)
        moves = place[0] in self.wanted.by
        last = max(i for i, part in enumerate(place) if isinstance(part, str))
        leaf = self.graph.value("state" if moves else "parameter", name=text)
        name = self.names[leaf] = "_".join(map(str, place[last:]))
        if moves:
            self.places[leaf] = place
            for prefix, order in (("d", "first"), ("dd", "second")):
                derivative = self.graph.value(order, name=self._derivative(place, order))
                self.names[derivative] = f"{prefix}_{name}"
        return leaf

    # ---- Text ------------------------------------------------------------------------------------

    def text(self) -> str:
        outputs = self._outputs()
        if self.wanted.kind == "jacobian":
            return self._jacobian(outputs)
        return self._along_curve(outputs)

    def _outputs(self) -> dict[Place, Value]:
        """Return what the function writes, in the order of its declaration."""
        written = {
            place: value
            for place, value in self.written.items()
            if not self.wanted.of or place[0] in self.wanted.of
        }
        if not written:
            reason = "writes no such argument: write what it returns to one, as in real *y"
            raise refused(self.function.decl, f"{self.wanted.function} {reason}")
        for place, value in written.items():
            if not isinstance(value, Value):
                name = shown(place, self.kinds[place[0]])
                raise refused(self.function.decl, f"{name} is a whole number: nothing to derive")
        order = {name: i for i, name in enumerate(self.kinds)}
        places = sorted(written, key=lambda place: (order[place[0]], self._rank(place)))
        return {place: written[place] for place in places}

    def _rank(self, place: Place) -> tuple[int, ...]:
        """Return the position of a part among all of its argument."""
        kind, found = pointed(self.kinds[place[0]]), []
        for part in place[1:]:
            if isinstance(kind, Structure):
                fields = self.interpreter.types.fields(kind, self.function)
                found.append(list(fields).index(str(part)))
                kind = fields[str(part)]
            else:
                found.append(int(part))
                kind = kind.of if isinstance(kind, Array) else kind
        return tuple(found)

    def _jacobian(self, outputs: dict[Place, Value]) -> str:
        """Write J[i + n j]: derivative of output i by variable j."""
        variables = self._variables()
        one, zero, n = self.graph.number(1.0), self.graph.number(0.0), len(outputs)
        targets: dict[str, Value] = {}
        names = self.interpreter.names | self.names
        for j, place in enumerate(variables):
            leaf = self._leaf(place, None)
            label = "_".join(map(str, place[1:] if len(self.wanted.by) == 1 else place))
            label = f"{place[0]}{label}" if label[:1].isdigit() else label
            curve = Curve(self.graph, lambda y, at=leaf: (one, zero) if y is at else None)
            for i, first in enumerate(curve.first(outputs.values())):
                targets[f"J[{i + n * j}]"] = first
            for value, name in self.interpreter.names.items():
                first = curve.firsts.get(value)
                if first is not None and first.arguments:
                    names.setdefault(first, f"{name}_by_{label}")
        parameters = [*self._read(self.outs), "double J[]"]
        return self._definition(self.wanted.name, parameters, self._lines(targets, names))

    def _variables(self) -> list[Place]:
        """Return parts of the arguments that move, in their order."""
        moving = self.wanted.by
        return [place for name in moving for place in self._parts((name,), self.kinds[name])]

    def _parts(self, place: Place, kind: Any) -> list[Place]:
        kind = pointed(kind)
        if isinstance(kind, Array):
            if kind.length is None:
                raise refused(self.function.decl, f"the array {place[0]} has no size")
            return [p for i in range(kind.length) for p in self._parts((*place, i), kind.of)]
        if isinstance(kind, Structure):
            fields = self.interpreter.types.fields(kind, self.function)
            return [p for name, of in fields.items() for p in self._parts((*place, name), of)]
        return [place] if is_real(kind) else []

    def _along_curve(self, outputs: dict[Place, Value]) -> str:
        """Write first and, if they are wanted, second derivatives."""
        orders = ("first", "second") if self.wanted.kind == "derivatives" else ("first",)
        curve = Curve(self.graph, self._rates)
        found = {"first": curve.first(outputs.values())}
        if "second" in orders:
            found["second"] = curve.second(outputs.values())
        names = self.interpreter.names | self.names
        for prefix, derivatives in (("d", curve.firsts), ("dd", curve.seconds)):
            for value, name in self.interpreter.names.items():
                derivative = derivatives.get(value)
                if derivative is not None and derivative.arguments:
                    names.setdefault(derivative, f"{prefix}_{name}")
        targets = {
            order: {
                self._derivative(place, order): value
                for place, value in zip(outputs, found[order], strict=True)
            }
            for order in orders
        }
        outs = {str(place[0]) for place in outputs}
        read = self._read(self.outs - {*self.wanted.by})
        moving = [
            (self._parameter(d, self._of_order(d.name, order), d.name not in outs), order)
            for order in orders
            for d in self._declared()
            if d.name in outs | {*self.wanted.by}
        ]
        name, given = self.wanted.name, [*read, *(text for text, _ in moving)]
        firsts = self._lines(targets["first"], names)
        if len(orders) == 1:
            return self._definition(name, given, firsts)
        both = self._lines(targets["first"] | targets["second"], names)
        half = [*read, *(text for text, order in moving if order == "first")]
        calls = [
            f"if ({self._of_order(next(iter(outs)), 'second')} == NULL) {{",
            f"    {name}_first({', '.join(map(parameter_name, half))});",
            "} else {",
            f"    {name}_second({', '.join(map(parameter_name, given))});",
            "}",
        ]
        parts = ((f"{name}_first", half, firsts), (f"{name}_second", given, both))
        texts = [self._definition(*part, storage="static ") for part in parts]
        return "\n\n".join([*texts, self._definition(name, given, calls)])

    def _rates(self, leaf: Value) -> tuple[Value, Value] | None:
        place = self.places.get(leaf)
        if place is None:
            return None
        first, second = (
            self.graph.value(order, name=self._derivative(place, order))
            for order in ("first", "second")
        )
        return first, second

    def _derivative(self, place: Place, order: str) -> str:
        """Return the place of a part's derivative."""
        return shown((self._of_order(str(place[0]), order), *place[1:]), self.kinds[place[0]])

    def _of_order(self, name: str, order: str) -> str:
        return order if len(self.wanted.by) == 1 and name in self.wanted.by else f"{name}_{order}"

    def _declared(self) -> list[c_ast.Decl]:
        return [parameter for parameter, _ in self.parameters]

    def _parameter(self, declared: c_ast.Decl, name: str, is_const: bool) -> str:
        """Declare a parameter by another name."""
        kind = self.kinds[declared.name]
        if is_real(kind) or is_whole(kind):
            return f"{'double' if is_real(kind) else kind} {name}"
        const = "const " if is_const else ""
        if isinstance(kind, Array):
            sizes = ""
            while isinstance(kind, Array):
                sizes += f"[{'' if kind.length is None else kind.length}]"
                kind = kind.of
            return f"{const}{c_name(kind)} {name}{sizes}"
        return f"{const}{c_name(kind.to)} *{name}"

    def _read(self, names: Collection[str]) -> list[str]:
        """Return the parameters that are passed on, but those with these names."""
        return [self._parameter(d, d.name, True) for d in self._declared() if d.name not in names]

    def _lines(self, targets: Mapping[str, Value], names: Mapping[Value, str]) -> list[str]:
        taken = {*self.kinds, "first", "second", "J"}
        taken |= {f"{name}_{order}" for name in self.kinds for order in ("first", "second")}
        places: dict[tuple[str, str], Operand] = {}
        for leaf in in_order(targets.values()):
            is_int = leaf.op == "integer"
            name, c_type = ("", "int") if is_int else (names.get(leaf, ""), "double")
            places[leaf.op, leaf.name] = statements.Place(leaf.name, name=name, c_type=c_type)
        leaves = Leaves(places, names, set(), self.interpreter.conditions)
        written = WithEnumerators(leaves, self.enumerators)
        written.assign(
            {statements.Place(target, name=target): value for target, value in targets.items()}
        )
        return printed(written.statements, taken=taken, is_long=False)[0]

    def _definition(
        self, name: str, parameters: list[str], lines: list[str], storage: str = ""
    ) -> str:
        """Write the definition of a function."""
        head, own = f"{storage}void {name}(", []
        indent = len(head)
        for i, parameter in enumerate(parameters):
            more = parameter + (") {" if i + 1 == len(parameters) else ", ")
            if len(head) + len(more.rstrip()) > WIDTH:
                own.append(head.rstrip())
                head = " " * indent
            head += more
        return "\n".join([*own, head, *indented(lines), "}"])


def pointed(kind: Any) -> Any:
    """Return the type that an argument points to."""
    return kind.to if isinstance(kind, Pointer) else kind


def shown(place: Place, kind: Any) -> str:
    """Write a part of an argument in C."""
    text, rest = str(place[0]), list(place[1:])
    if isinstance(kind, Pointer) and not isinstance(kind.to, Array | Structure):
        return f"*{text}"
    for i, part in enumerate(rest):
        is_first = i == 0 and isinstance(kind, Pointer)
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += f"->{part}" if is_first else f".{part}"
    return text


def general(place: Place) -> str:
    """Write a part of an argument, of any index."""
    return ".".join(str(part) for part in place if isinstance(part, str))


def c_name(kind: Any) -> str:
    """Write a type in C."""
    if isinstance(kind, Structure):
        return f"struct {kind.name}"
    return "double" if is_real(kind) else str(kind)


def parameter_name(text: str) -> str:
    """Return the name of a parameter in its declaration."""
    return text.replace("*", " ").split()[-1].partition("[")[0]


def wrapped_list(head: str, words: list[str]) -> list[str]:
    """Write words behind each other in lines of a comment."""
    lines, line = [], head
    for i, word in enumerate(words):
        more = word + ("," if i + 1 < len(words) else "")
        if len(line) + len(more) > 98:
            lines.append(line.rstrip())
            line = " *   "
        line += f"{more} "
    return [*lines, line.rstrip()]
