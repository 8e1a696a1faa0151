"""The equations of an extended Kalman filter, as tables of a file with equations.

Between ticks dP = A P + P A' + Q, with Q = B diag(sigma^2 every) B' of inputs whose noise is held
over a period. At a tick each measurement y of variance r, one after the other, gives with slopes H
    s = H P H' + r,  K = P H' / s,  P+ = (1 - K H) P (1 - K H)' + K r K'.
What a plant's event or sampler gives new values, x+ = r(x, t), makes P+ = S P S' with
    S = r_x + (r_x f- + r_t - f+) t_x,  t_x = -g_x / (g_x f- + g_t),
where g is the distance that passes 0. An event before the plant's one sets P to r_x P r_x'; one
that follows it knows the rates f+, and adds what the shift in time does.
"""

import os
import re
from collections.abc import Iterable, Iterator
from copy import deepcopy
from itertools import combinations_with_replacement as pairs
from pathlib import Path
from typing import Any

from rparm.errors import UserError
from rparm.estimator import toml
from rparm.estimator.observability import unobservable
from rparm.estimator.request import PLANT, Request, load
from rparm.files import write_text
from rparm.fmu_tools.compiler.expressions.expression import RELATIONS, Node, in_order, names, written
from rparm.fmu_tools.compiler.graph.graph import Value, is_number
from rparm.fmu_tools.compiler.read.content import (
    FOLLOWS,
    Change,
    Event,
    Expression,
    Variable,
)
from rparm.fmu_tools.compiler.read.include import moved
from rparm.fmu_tools.compiler.units import BASE, shown

PERIOD = "filter_period"
SMALL = 1e-3  # of a nominal value: the deviation of a state of which nothing is known
Rows = dict[str, dict[str, str]]  # texts by state and column
LEFT_OUT = ("include", "terminals", "name", "description", "experiment")


def write(file: Path, to: Path) -> list[str]:
    """Write the equations of the estimator in a file; return warnings. UserError."""
    made = Equations(load(file))
    write_text(to, toml.written(made.of(to.parent)))
    return made.warnings


def product(*factors: str) -> str:
    """Return a product, without factors of 1; empty if one is empty, which stands for 0."""
    if not all(factors):
        return ""
    return " * ".join(factor for factor in factors if factor != "1") or "1"


def total(terms: Iterable[str]) -> str:
    """Return a sum of what is not 0."""
    return " + ".join(filter(None, terms)).replace("+ -", "- ")


class Equations:
    """Composes the filter; `warnings` has what is allowed, but may not be meant."""

    def __init__(self, request: Request) -> None:
        self.request, self.plant = request, request.plant
        self.tables = deepcopy(request.tables)
        self.warnings: list[str] = []
        self.states = [v.name for v in self.plant.of("states")]
        self.estimated = [*self.states, *request.unknown]
        self.taken = {*self.plant.variables, *self.plant.modes, *self.plant.functions}
        self.taken |= {*self.plant.happening, *self.plant.sizes, *self.plant.indexes}
        self.taken |= {name.partition("[")[0] for name in self.taken}
        self.hidden: dict[str, str] = {}  # names that the filter adds, by what they stand for
        leaves = {name: self.plant.variables[name].leaf for name in self.estimated}
        self.by_leaf = {leaf: name for name, leaf in leaves.items()}
        self.inputs = {self.plant.variables[name].leaf: name for name in request.noise}
        rates = {v.name: v.value for v in self.plant.of("states")}
        self.a = {name: self._slopes(rate, self.by_leaf) for name, rate in rates.items()}
        self.b = {name: self._slopes(rate, self.inputs) for name, rate in rates.items()}
        self.h = {name: self._moved_by([name]) for name in (*request.measure, *request.sigma)}
        self.jumps = [c for c in self.plant.changes if c.reinit or isinstance(c, Event) and c.set]
        self._check()
        self.known = self._closure()

    # ---- What follows from what ------------------------------------------------------------------
    def _slopes(self, value: Value, by: dict[Value, str]) -> list[str]:
        """Return names of leaves by which a value has a slope."""
        (found,) = self.plant.graph.gradients([value], by)
        return [by[leaf] for leaf in by if leaf in found and not is_number(found[leaf], 0.0)]

    def _moved_by(self, given: Iterable[str]) -> list[str]:
        """Return what is estimated and moves one of these names."""
        found = {name for name in given if name in self.by_leaf.values()}
        for name in given:
            state = name.removeprefix("der(").removesuffix(")")
            variable = self.plant.variables.get(name if state == name else state)
            if variable is not None and variable.is_real and name not in found:
                value = variable.value if state != name or variable.leaf is None else variable.leaf
                found.update(self._slopes(value, self.by_leaf))
        return [name for name in self.estimated if name in found]

    def _by_time(self, text: str, given: Iterable[str]) -> str:
        """Return the derivative of a text by the time, if one of its names follows from it."""
        found = [v for v in map(self.plant.variables.get, given) if v and v.leaf is None]
        follows = "time" in given or any(("time", "") in v.value.leaves for v in found)
        return f"partial({text}, time)" if follows else ""

    def _closure(self) -> set[tuple[str, str]]:
        """Return the elements of P that are not always 0, above and on the diagonal."""
        of = {name: i for i, name in enumerate(self.estimated)}
        spreads = self.request.start | self.request.unknown
        linked = {(x, x) for x in spreads}
        if self.jumps:
            linked |= {(x, y) for x in self.estimated for y in self.estimated}
        before = -1
        while before < len(linked):
            before = len(linked)
            for x, y in pairs(self.states, 2):
                if {*self.b[x]} & {*self.b[y]}:
                    linked |= {(x, y), (y, x)}
            for x in self.states:
                for k, y in [*linked]:
                    if k in self.a[x]:
                        linked |= {(x, y), (y, x)}
            for name in self.request.measure:
                moved_ = {x for x, k in linked if k in self.h[name]}
                linked |= {(x, y) for x in moved_ for y in moved_}
        return {(x, y) for x, y in linked if of[x] <= of[y]}

    # ---- Names and texts -------------------------------------------------------------------------
    def name(self, *parts: str) -> str:
        """Return a name for what is not seen outside of the file, which the plant does not have."""
        plain = "_".join(re.sub(r"\W+", "_", part).strip("_") for part in parts)
        if plain not in self.hidden:
            found = plain
            while found in self.taken or found in self.hidden.values():
                found += "_"
            self.hidden[plain] = found
        return self.hidden[plain]

    def own(self, form: str, name: str) -> str:
        """Return the name of an input, output or parameter that the filter adds; UserError."""
        head, bracket, indexes = name.partition("[")
        found = form.format(re.sub(r"\W+", "_", head + bracket + indexes).strip("_"))
        if found in self.taken:
            where = f"{self.request.path}: {PLANT}: {self.plant.path.name}"
            raise UserError(f"{where} has a variable {found}, as the filter: rename it")
        return found

    def p(self, x: str, y: str) -> str:
        """Return the name of an element of P, or nothing where it is 0."""
        for pair in ((x, y), (y, x)):
            if pair in self.known:
                return self.name("P", *pair)
        return ""

    def elements(self) -> Iterator[tuple[str, str]]:
        """Yield the elements of P."""
        for pair in pairs(self.estimated, 2):
            if pair in self.known:
                yield pair

    def rate(self, x: str) -> str:
        """Return the derivative of a state; nothing of a parameter."""
        return f"der({x})" if x in self.states else ""

    def unit(self, *of: str, seconds: int = 0) -> dict[str, str]:
        """Return the unit of a product, if the plant has units."""
        if not self.plant.has_units:
            return {}
        exponents = dict.fromkeys(BASE, 0) | {"s": seconds}
        for name in of:
            for base, exponent in self.plant.variables[name].exponents.items():
                if base in exponents:
                    exponents[base] += exponent
        return {"unit": shown(exponents)}

    def own_unit(self, name: str) -> dict[str, str]:
        """Return the unit of a variable by the name that the plant gives it."""
        unit = self.plant.variables[name].unit
        return {"unit": unit} if unit else self.unit(name)

    def deviation(self, name: str, entry: dict[str, Any]) -> None:
        """Add a standard deviation as a parameter."""
        self.tables.setdefault("parameters", {})[name] = entry

    # ---- Composition -----------------------------------------------------------------------------
    def of(self, folder: Path) -> dict[str, Any]:
        """Return the tables of the filter, with paths that begin at a folder."""
        request, plant = self.request, self.plant
        where = Path(os.path.relpath(plant.path.parent.resolve(), folder.resolve()))
        self.tables = moved(self.tables, where)
        for key in LEFT_OUT:
            self.tables.pop(key, None)
        self._free_parameters()
        self._add_parameters()
        states, hidden = self.tables["states"], self.tables.setdefault("where", {})
        for x in self.states:
            for y in self.a[x]:
                hidden[self.name("A", x, y)] = {"value": f"partial(der({x}), {y})", "shown": False}
            for u in self.b[x]:
                hidden[self.name("B", x, u)] = {"value": f"partial(der({x}), {u})", "shown": False}
        scales = {x: self._scale(x) for x in self.estimated}
        spread = request.start | request.unknown
        for x, y in self.elements():
            entry = {"derivative": self._covariance_rate(x, y) or "0", **self.unit(x, y)}
            if x == y and x in spread:
                entry["start"] = f"{self.own('spread_{}', x)}**2"
            entry |= {"nominal": scales[x] * scales[y], "causality": "local"}
            states[self.p(x, y)] = entry | {"description": f"Covariance of {x} and {y}"}
        self._add_jumps()
        for name in request.measure:
            self._add_update(name)
        self._add_deviations()
        experiment = plant.experiment | {"step": min(request.every, plant.experiment["stop"])}
        about = request.description or f"Extended Kalman filter of {plant.name}"
        head = {"name": request.name, "description": about, "experiment": experiment}
        if plant.calculate:
            head["calculate"] = plant.calculate
        return head | self.tables

    def _free_parameters(self) -> None:
        """Make states of unknown parameters, and entries of [where] of what follows from them."""
        parameters, places = self.tables.get("parameters", {}), {}
        if self.plant.calculate:
            places = {name: ".".join(map(str, at)) for at, name in self.plant.header.places.items()}
            for name in parameters:
                if "." in places.get(name, ""):
                    parameters[name]["field"] = places[name].removeprefix("parameters.")
        moving = self._moving()
        for name in moving:
            base = name.partition("[")[0]
            for key in [key for key in parameters if key.partition("[")[0] == base]:
                entry = parameters.pop(key)
                if name not in self.request.unknown:
                    kept = ("value", "unit", "description", "type", "for")
                    entry = {k: v for k, v in entry.items() if k in kept}
                    self.tables.setdefault("where", {})[key] = entry
                    continue
                about = {k: entry[k] for k in ("start", "unit", "description") if k in entry}
                about |= {"field": places[name]} if "." in places.get(name, "") else {}
                self.tables["states"][name] = about | {"derivative": "0"}
        texts = {message for message, e in self.plant.checks if names(e.tree) & moving}
        checks = self.tables.get("check", {})
        self.tables["check"] = {k: v for k, v in checks.items() if " ".join(k.split()) not in texts}

    def _moving(self) -> set[str]:
        """Return unknown parameters and those that follow from them."""
        found = {*self.request.unknown}
        while more := {
            v.name for v in self.plant.of(FOLLOWS) if names(v.expression.tree) & found
        } - found:
            found |= more
        fixed = [v.initial for v in self.plant.started]
        fixed += [period for sampler in self.plant.sampled for period in sampler.periods]
        for expression in fixed:
            if used := sorted(names(expression.tree) & found):
                place = ": ".join(expression.place)
                where = f"{self.request.path}: unknown: {self.plant.path.name}: {place}"
                raise UserError(f"{where} follows from {used[0]}, which is unknown")
        return found

    def _add_parameters(self) -> None:
        request = self.request
        period = {"start": request.every, **({"unit": "s"} if self.plant.has_units else {})}
        about = {"variability": "fixed", "description": "Time between measurements"}
        self.deviation(self.own(PERIOD, ""), period | about)
        inputs = self.tables.setdefault("inputs", {})
        for given, form, of in (
            (request.measure, "noise_{}", "Standard deviation of the measurement of {}"),
            (request.noise, "noise_{}", "Standard deviation of {}, held over a period"),
            (request.start | request.unknown, "spread_{}", "Standard deviation of {} at the start"),
        ):
            for name, sigma in given.items():
                entry = {"start": sigma, "min": 0.0, **self.own_unit(name)}
                self.deviation(self.own(form, name), entry | {"description": of.format(name)})
        for name in request.measure:
            entry = {**self.own_unit(name), "description": f"Measurement of {name}"}
            inputs[self.own("{}_measured", name)] = entry

    def _scale(self, x: str) -> float:
        """Return a small standard deviation of a state, for tolerances."""
        request, nominal = self.request, self.plant.variables[x].nominal or 1.0
        given = [d[x] for d in (request.start, request.unknown, request.measure) if x in d]
        return min(given, default=SMALL * nominal)

    def _covariance_rate(self, x: str, y: str) -> str:
        terms = []
        for i, j in ((x, y), (y, x)):
            terms += [product(self.name("A", i, k), self.p(k, j)) for k in self.a.get(i, ())]
        if x == y:
            terms = [product("2", term) for term in terms[: len(terms) // 2]]
        for u in self.b.get(x, ()):
            if u in self.b.get(y, ()):
                slopes = product(self.name("B", x, u), self.name("B", y, u))
                terms.append(product(slopes, f"{self.own('noise_{}', u)}**2", PERIOD))
        return total(terms)

    def _slope(self, name: str, x: str) -> str:
        return "1" if name == x else f"partial({name}, {x})"

    def _add_update(self, y: str) -> None:
        """Add the sampler that uses a measurement."""
        local, name = {}, self.name
        slopes = {x: self._slope(y, x) for x in self.h[y]}
        for x, slope in slopes.items():
            if slope != "1":
                local[name("slope", x)], slopes[x] = slope, name("slope", x)
        covariance = {}
        for x in self.estimated:
            text = total(product(self.p(x, k), slope) for k, slope in slopes.items())
            if text:
                local[name("covariance", x)], covariance[x] = text, name("covariance", x)
        local[name("expected")] = total(
            product(covariance.get(x, ""), s) for x, s in slopes.items()
        ) or self._zero_variance(y)
        value = self.plant.variables[y]
        noisy = self._slopes(value.leaf or value.value, self.inputs)
        own = [f"{self.own('noise_{}', y)}**2"]
        own += [f"(partial({y}, {u}) * {self.own('noise_{}', u)})**2" for u in noisy]
        local[name("variance")] = total(own)
        local[name("innovation_variance")] = f"{name('expected')} + {name('variance')}"
        local[name("innovation")] = f"{self.own('{}_measured', y)} - {y}"
        reinit = {}
        for x, text in covariance.items():
            local[name("gain", x)] = f"{text} / {name('innovation_variance')}"
            local[name("left", x)] = f"{text} - {name('gain', x)} * {name('expected')}"
            reinit[x] = f"{x} + {name('gain', x)} * {name('innovation')}"
        for i, j in self.elements():
            if i in covariance and j in covariance:
                gains = f"{name('gain', i)} * {covariance[j]} - {name('left', i)} * {name('gain', j)}"
                rest = f"{name('variance')} * {name('gain', i)} * {name('gain', j)}"
                reinit[self.p(i, j)] = f"{self.p(i, j)} - {gains} + {rest}"
        nis = self.own("nis_{}", y)
        self.tables.setdefault("discrete", {})[nis] = {
            "description": f"Squared innovation of {y} over its variance: 1 on average",
        }
        self.tables.setdefault("sampled", {})[name("update", y)] = {
            "every": PERIOD,
            "where": local,
            "reinit": reinit,
            "set": {nis: f"{name('innovation')}**2 / {name('innovation_variance')}"},
        }

    def _zero_variance(self, y: str) -> str:
        raise UserError(
            f"{self.request.path}: measure: {y}: nothing that moves it has a spread: "
            "give start, unknown or noise a standard deviation"
        )

    def _add_deviations(self) -> None:
        """Add sigma_NAME of states, unknown parameters and measured outputs."""
        outputs = self.tables.setdefault("outputs", {})
        further = [x for x in (*self.request.measure, *self.request.sigma) if x not in self.estimated]
        for x in dict.fromkeys((*self.estimated, *further)):
            moving = [x] if x in self.estimated else self.h[x]
            terms = []
            for i, j in pairs(moving, 2):
                once = product(self._slope(x, i), self._slope(x, j), self.p(i, j))
                terms.append(once if i == j else product("2", once))
            text = total(terms)
            # the root of an absolute value, without an event where rounding makes it less than 0
            value = f"sqrt(hypot({text}, 0))" if text else "0"
            entry = {"value": value, **self.own_unit(x)}
            outputs[self.own("sigma_{}", x)] = entry | {"description": f"Standard deviation of {x}"}

    # ---- Events and samplers of the plant --------------------------------------------------------
    def _add_jumps(self) -> None:
        before: dict[str, dict[str, Any]] = {"events": {}, "sampled": {}}
        after: dict[str, Any] = {}
        for change in self.jumps:
            if isinstance(change, Event):
                self._add_event(change, before["events"], after)
            else:
                local, rows, m = self._through(change)
                entry = {"every": _text(change, change.every), "offset": _text(change, change.offset)}
                entry |= _while(change) | {"where": local, "reinit": self._reset(change, rows, m)}
                before["sampled"][self.name("before", change.name)] = entry
        for section, entries in before.items():
            own = self.tables.get(section, {})
            entries |= own | (after if section == "events" else {})
            if entries:
                self.tables[section] = entries

    def _through(self, change: Change) -> tuple[dict[str, str], Rows, Rows]:
        """Return local entries, r_x and r_x P, which name them."""
        local: dict[str, str] = {}
        rows = {x: {x: "1"} for x in self.estimated}
        for x, new in change.reinit.items():
            rows[x] = {}
            for y in self._moved_by(names(new.tree)):
                local[self.name("jump", x, y)] = f"partial({_text(change, new)}, {y})"
                rows[x][y] = self.name("jump", x, y)
        found: dict[str, dict[str, str]] = {}
        for x in self.estimated:
            found[x] = {}
            for y in self.estimated:
                text = total(product(s, self.p(k, y)) for k, s in rows[x].items())
                if x in change.reinit and text:
                    local[self.name("part", x, y)] = text
                    text = self.name("part", x, y)
                found[x][y] = text
        return local, rows, found

    def _reset(self, change: Change, rows: Rows, m: Rows) -> dict[str, str]:
        """Return r_x P r_x', where new values change it."""
        return {
            self.p(x, y): total(product(m[x][k], s) for k, s in rows[y].items()) or "0"
            for x, y in self.elements()
            if {x, y} & change.reinit.keys()
        }

    def _add_event(self, event: Event, before: dict[str, Any], after: dict[str, Any]) -> None:
        """Add an event before the plant's one, and one that follows it."""
        local, rows, m = self._through(event)
        own = {"when": _text(event, event.when), **_while(event), "where": local}
        before[self.name("before", event.name)] = own
        own["reinit"] = self._reset(event, rows, m)
        sides = self._passed(event)
        moving = self._moved_by(frozenset().union(*map(names, sides))) if sides else []
        if not own["reinit"]:
            del own["reinit"]
        if not moving:
            if "reinit" not in own:
                del before[self.name("before", event.name)]
            return
        distance = f"({written(sides[0])}) - ({written(sides[1])})"
        turn = {k: self.name("turn", k) for k in moving}
        local |= {self.name("slope", k): f"partial({distance}, {k})" for k in moving}
        of_time = self._by_time(distance, frozenset().union(*map(names, sides)))
        speed = self.name("speed")
        terms = [product(self.name("slope", k), self.rate(k)) for k in moving]
        local[speed] = total([*terms, of_time])
        for k in moving:
            ratio = f"-{self.name('slope', k)} / {speed}"
            local[turn[k]] = f"{ratio} if {speed} < 0 or {speed} > 0 else 0"
        kept, keep = self.tables.setdefault("discrete", {}), {}

        def hold(name: str, text: str, unit: dict[str, str]) -> str:
            kept[name] = {**unit, "shown": False}
            keep[name] = text
            return name

        columns, shifts = {}, {}
        for x in self.estimated:
            if text := total(product(m[x][k], turn[k]) for k in moving):
                hidden = self.name("column", event.name, x)
                columns[x] = hold(hidden, text, self.unit(x, seconds=1))
            if x in self.states:
                text = total(product(s, self.rate(k)) for k, s in rows[x].items())
                if x in event.reinit:
                    new = event.reinit[x]
                    text = total([text, self._by_time(_text(event, new), names(new.tree))]) or "0"
                hidden = self.name("rate", event.name, x)
                shifts[x] = hold(hidden, text, self.unit(x, seconds=-1))
        square = total(product(turn[i], self.p(i, j), turn[j]) for i in moving for j in moving)
        variance = hold(self.name("square", event.name), square, self.unit(seconds=2))
        pending = self.name("after", event.name, "mode")
        modes = self.tables.get("modes", {})
        modes = dict.fromkeys(modes, False) if isinstance(modes, list) else modes
        self.tables["modes"] = modes | {pending: False}
        own["set"] = keep | {pending: "true"}
        shift = {x: self.name("shift", x) for x in shifts}
        reinit = {}
        for x, y in self.elements():
            terms = [self.p(x, y)]
            terms += [product(shift.get(i, ""), columns.get(j, "")) for i, j in ((x, y), (y, x))]
            terms.append(product(variance, shift.get(x, ""), shift.get(y, "")))
            reinit[self.p(x, y)] = total(terms)
        after[self.name("after", event.name)] = {
            "when": pending,
            "where": {shift[x]: f"{shifts[x]} - {self.rate(x)}" for x in shifts},
            "reinit": reinit,
            "set": {pending: "false"},
        }

    def _passed(self, event: Event) -> tuple[Node, ...]:
        """Return both sides of the relation that decides when, the first that states move."""
        for node in in_order([event.when.tree]):
            if node.op in RELATIONS and self._moved_by(names(node)):
                return node.arguments
        return ()

    # ---- What may not be meant -------------------------------------------------------------------
    def _check(self) -> None:
        request, plant = self.request, self.plant
        for name in request.measure:
            if not self.h[name]:
                raise UserError(f"{request.path}: measure: {name}: no state of the plant moves it")
        unseen = unobservable(request)
        measured, unknown = ", ".join(request.measure), [x for x in unseen if x in request.unknown]
        if unknown:
            what = f"{', '.join(unknown)} cannot be told from {measured}: other values fit as well"
            raise UserError(f"{request.path}: unknown: {what}")
        if unseen:
            what = f"{measured} does not show {', '.join(unseen)}: the deviation may grow"
            self.warnings.append(f"measure: {what}")
        if plant.modes:
            what = "is not measured: it follows the estimate"
            self.warnings.append(f"{plant.path.name}: mode {', '.join(plant.modes)} {what}")
        for event in plant.events:
            conditions = [n for e in event.conditions for n in in_order([e.tree])]
            moving = [n for n in conditions if n.op in RELATIONS and self._moved_by(names(n))]
            if len(moving) == 1 and event.reinit:
                self.warnings.append(
                    f"{plant.path.name}: [events.{event.name}]: an update may pass its limit from "
                    "the other side, and it happens again: write while with the direction, as v < 0"
                )
        for change in plant.changes:
            for name, new in change.set.items():
                variable: Variable | None = plant.variables.get(name)
                if variable and variable.is_real and self._moved_by(names(new.tree)):
                    what = "is held from states: the filter takes it as exact"
                    self.warnings.append(f"{plant.path.name}: [discrete]: {name} {what}")


def _text(change: Change, expression: Expression) -> str:
    """Return the text of an expression, with values of indexes and local names."""
    is_plain = "[" not in change.name and not change.where
    return expression.text if is_plain else written(expression.tree)


def _while(change: Change) -> dict[str, str]:
    return {"while": _text(change, change.during)} if change.during else {}
