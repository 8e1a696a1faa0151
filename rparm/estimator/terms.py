"""Terms of a filter's equations: which slopes and covariances are not always 0, and their texts.

A text is an expression of a file with equations. An empty one stands for 0.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import combinations_with_replacement as pairs

from rparm.errors import UserError
from rparm.estimator.request import PLANT, Request
from rparm.fmu_tools.compiler.expressions.expression import (
    RELATIONS,
    Node,
    in_order,
    names,
    with_names,
)
from rparm.fmu_tools.compiler.expressions.kinds import CONDITION
from rparm.fmu_tools.compiler.graph.graph import Value, is_number
from rparm.fmu_tools.compiler.read.content import CALCULATED, Event
from rparm.fmu_tools.compiler.units import BASE, shown


def product(*factors: str) -> str:
    """Return a product, without factors of 1; empty if one of them is."""
    if not all(factors):
        return ""
    return " * ".join(factor for factor in factors if factor != "1") or "1"


def total(terms: Iterable[str]) -> str:
    """Return the sum of what is not 0."""
    return " + ".join(filter(None, terms))


class Terms:
    """Names, slopes and covariances of a filter.

    Attributes
    ----------
    states, estimated : list of str
        States of the plant; with the unknown parameters, which become states.
    a, b, h : dict
        By which of `estimated` rates have slopes, by which noisy inputs; and measured outputs.
    jumps : list
        Events and samplers of the plant that change a covariance.
    known : set of pairs
        Elements of P that are not always 0, on the diagonal and above.
    """

    def __init__(self, request: Request) -> None:
        self.request, self.plant = request, request.plant
        self.states = [v.name for v in self.plant.of("states")]
        self.estimated = [*self.states, *request.unknown]
        taken = {*self.plant.variables, *self.plant.modes, *self.plant.functions}
        taken |= {*self.plant.happening, *self.plant.sizes, *self.plant.indexes}
        self.taken = taken | {name.partition("[")[0] for name in taken}
        self.hidden: dict[str, str] = {}  # names that the filter adds, by what they stand for
        self.leaves = {self.plant.variables[name].leaf: name for name in self.estimated}
        self.noisy = {self.plant.variables[name].leaf: name for name in request.noise}
        rates = {v.name: v.value for v in self.plant.of("states")}
        self.a = {name: self.slopes(rate, self.leaves) for name, rate in rates.items()}
        self.b = {name: self.slopes(rate, self.noisy) for name, rate in rates.items()}
        self.h = {name: self.moving([name]) for name in (*request.measure, *request.sigma)}
        changes = self.plant.changes
        self.jumps = [c for c in changes if c.reinit or (isinstance(c, Event) and c.set)]
        self.known = self._known()

    # ---- What follows from what ------------------------------------------------------------------
    def slopes(self, value: Value, by: Mapping[Value, str]) -> list[str]:
        """Return names of leaves by which a value has a slope."""
        (found,) = self.plant.graph.gradients([value], by)
        return [by[leaf] for leaf in by if leaf in found and not is_number(found[leaf], 0.0)]

    def values(self, names: Iterable[str]) -> Iterator[Value]:
        """Yield the values of real variables and of derivatives that an expression names."""
        for name in names:
            state = name.removeprefix("der(").removesuffix(")")
            variable = self.plant.variables.get(state)
            if variable is not None and variable.is_real:
                is_rate = state != name or variable.leaf is None
                yield variable.value if is_rate else variable.leaf

    def relations(self, *roots: Node) -> list[Node]:
        """Return relations that states move, also those of Boolean entries that roots name."""
        known = {
            v.name: v.expression.tree
            for v in self.plant.of(*CALCULATED)
            if v.kind == CONDITION and v.expression
        }
        found: list[Node] = []
        for root in roots:
            while names(root) & known.keys():
                root = with_names(root, known)
            found += [n for n in in_order([root]) if n.op in RELATIONS and self.moving(names(n))]
        return found

    def moving(self, names: Iterable[str]) -> list[str]:
        """Return what is estimated and moves one of these names."""
        found = {x for value in self.values(names) for x in self.slopes(value, self.leaves)}
        return [x for x in self.estimated if x in found]

    def _known(self) -> set[tuple[str, str]]:
        place = {x: i for i, x in enumerate(self.estimated)}
        linked = {(x, x) for x in self.request.start | self.request.unknown}
        for x, y in pairs(self.states, 2):
            if {*self.b[x]} & {*self.b[y]}:
                linked |= {(x, y), (y, x)}
        if self.jumps:
            linked = {(x, y) for x in self.estimated for y in self.estimated}
        before = -1
        while before < len(linked):
            before = len(linked)
            for x in self.states:
                columns = {y for k, y in linked if k in self.a[x]}
                linked |= {pair for y in columns for pair in ((x, y), (y, x))}
            for name in self.request.measure:
                rows = {x for x, k in linked if k in self.h[name]}
                linked |= {(x, y) for x in rows for y in rows}
        return {(x, y) for x, y in linked if place[x] <= place[y]}

    # ---- Names and texts -------------------------------------------------------------------------
    def name(self, *parts: str) -> str:
        """Return a name that only the equations use; the plant does not have it."""
        plain = "_".join(map(_plain, parts))
        if plain not in self.hidden:
            found = plain
            while found in self.taken or found in self.hidden.values():
                found += "_"
            self.hidden[plain] = found
        return self.hidden[plain]

    def own(self, form: str, name: str = "") -> str:
        """Return the name of an input, output or parameter of the filter; UserError if taken."""
        found = form.format(_plain(name))
        if found in self.taken:
            where = f"{self.request.path}: {PLANT}: {self.plant.path.name}"
            raise UserError(f"{where} has a variable {found}, as the filter: rename it")
        return found

    def p(self, x: str, y: str) -> str:
        """Return an element of P."""
        pair = next((pair for pair in ((x, y), (y, x)) if pair in self.known), None)
        return self.name("P", *pair) if pair else ""

    def elements(self) -> Iterator[tuple[str, str]]:
        """Yield the elements of P that are not always 0."""
        return (pair for pair in pairs(self.estimated, 2) if pair in self.known)

    def rate(self, x: str) -> str:
        """Return the derivative of what is estimated."""
        return f"der({x})" if x in self.states else ""

    def slope(self, y: str, x: str) -> str:
        """Return the slope of a variable."""
        return "1" if y == x else f"partial({y}, {x})"

    def by_time(self, text: str, names: Iterable[str]) -> str:
        """Return the derivative of a text of these names by the time."""
        names = [*names]
        follows = "time" in names or any(("time", "") in v.leaves for v in self.values(names))
        return f"partial({text}, time)" if follows else ""

    def unit(self, *of: str, seconds: int = 0) -> dict[str, str]:
        """Return the unit of a product, if the plant has units."""
        if not self.plant.has_units:
            return {}
        exponents = dict.fromkeys(BASE, 0) | {"s": seconds}
        for name in of:
            for base in exponents:
                exponents[base] += self.plant.variables[name].exponents.get(base, 0)
        return {"unit": shown(exponents)}

    def own_unit(self, name: str) -> dict[str, str]:
        """Return the unit of a variable, by the name that the plant gives it."""
        unit = self.plant.variables[name].unit
        return {"unit": unit} if unit else self.unit(name)


def _plain(name: str) -> str:
    return re.sub(r"\W+", "_", name).strip("_")
