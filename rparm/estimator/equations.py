"""The equations of an extended Kalman filter, as a file with equations.

Between ticks dP = A P + P A' + Q, with Q = B diag(sigma^2 every) B' of inputs whose noise is held
over a period. At a tick each measurement y of variance r, one after the other, gives with slopes H
    s = H P H' + r,  K = P H' / s,  P+ = (1 - K H) P (1 - K H)' + K r K'.
"""

import os
from copy import deepcopy
from itertools import combinations_with_replacement as pairs
from pathlib import Path
from typing import Any

from rparm.errors import UserError
from rparm.estimator import checks, jumps, toml
from rparm.estimator.request import load
from rparm.estimator.terms import Terms, product, total
from rparm.files import write_text
from rparm.fmu_tools.compiler.expressions.expression import names
from rparm.fmu_tools.compiler.read.content import FOLLOWS
from rparm.fmu_tools.compiler.read.include import moved

PERIOD = "filter_period"
SMALL = 1e-3  # of a nominal value: the deviation of a state of which nothing is known
LEFT_OUT = ("include", "terminals", "name", "description", "experiment")
OF_WHERE = ("value", "unit", "description", "type", "for")


def write(file: Path, to: Path) -> list[str]:
    """Write the equations of an estimator into a file; return warnings. UserError."""
    request = load(file)
    read = (file, *request.plant.files)
    if to.exists() and any(to.samefile(path) for path in read):
        raise UserError(f"{to}: {file} is made from this file, expected another one to write")
    terms = Terms(request)
    warnings = checks.check(terms)
    write_text(to, toml.written(_Equations(terms).tables(to.parent)))
    return warnings


class _Equations:
    def __init__(self, terms: Terms) -> None:
        self.terms, self.request, self.plant = terms, terms.request, terms.plant
        self.found: dict[str, Any] = {}

    def section(self, name: str) -> dict[str, Any]:
        return self.found.setdefault(name, {})

    def tables(self, folder: Path) -> dict[str, Any]:
        """Return the tables of the filter, with paths that begin at a folder."""
        request, plant = self.request, self.plant
        place = Path(os.path.relpath(plant.path.parent.resolve(), folder.resolve()))
        self.found = moved(deepcopy(request.tables), place)
        for key in LEFT_OUT:
            self.found.pop(key, None)
        self._free_parameters()
        self._add_given()
        self._add_covariance()
        jumps.add(self.terms, self.found)
        for name in request.measure:
            self._add_update(name)
        self._add_deviations()
        experiment = plant.experiment | {"step": min(request.every, plant.experiment["stop"])}
        about = request.description or f"Extended Kalman filter of {plant.name}"
        head = {"name": request.name, "description": about, "experiment": experiment}
        return head | ({"calculate": plant.calculate} if plant.calculate else {}) | self.found

    # ---- Parameters ------------------------------------------------------------------------------
    def _free_parameters(self) -> None:
        """Make states of unknown parameters, and entries of [where] of what follows from them."""
        parameters, places = self.section("parameters"), {}
        if self.plant.calculate:  # its C has them in structs of their own
            at = self.plant.header.places.items()
            places = {name: ".".join(map(str, place)) for place, name in at if len(place) > 2}
            for name in parameters.keys() & places.keys():
                parameters[name]["field"] = places[name].removeprefix("parameters.")
        freed = self._freed()
        for key in [key for key in parameters if key.partition("[")[0] in freed]:
            entry = parameters.pop(key)
            if key not in self.request.unknown:
                self.section("where")[key] = {k: entry[k] for k in OF_WHERE if k in entry}
                continue
            kept = {k: entry[k] for k in ("start", "unit", "description") if k in entry}
            kept |= {"field": places[key]} if key in places else {}
            self.section("states")[key] = kept | {"derivative": "0"}
        texts = {message for message, e in self.plant.checks if names(e.tree) & freed}
        checked = self.section("check")
        self.found["check"] = {k: v for k, v in checked.items() if " ".join(k.split()) not in texts}

    def _freed(self) -> set[str]:
        """Return unknown parameters and those that follow from them, without indexes too."""
        found, before = {*self.request.unknown}, 0
        while before < len(found):
            before = len(found)
            found |= {v.name for v in self.plant.of(FOLLOWS) if names(v.expression.tree) & found}
        fixed = [v.initial for v in self.plant.started]
        fixed += [period for sampler in self.plant.sampled for period in sampler.periods]
        for expression in fixed:
            if used := sorted(names(expression.tree) & found):
                place = ": ".join((self.plant.path.name, *expression.place))
                what = f"follows from {used[0]}, which is unknown"
                raise UserError(f"{self.request.path}: unknown: {place} {what}")
        return found | {name.partition("[")[0] for name in found}

    def _add_given(self) -> None:
        """Add the period, standard deviations and the inputs of measurements."""
        terms, request, parameters = self.terms, self.request, self.section("parameters")
        parameters[terms.own(PERIOD)] = {
            "start": request.every, **({"unit": "s"} if self.plant.has_units else {}),
            "variability": "fixed", "description": "Time between measurements",
        }  # fmt: skip
        for given, form, of in (
            (request.measure, "noise_{}", "Standard deviation of the measurement of {}"),
            (request.noise, "noise_{}", "Standard deviation of {}, held over a period"),
            (request.start | request.unknown, "spread_{}", "Standard deviation of {} at the start"),
        ):
            for name, sigma in given.items():
                entry = {"start": sigma, "min": 0.0, **terms.own_unit(name)}
                parameters[terms.own(form, name)] = entry | {"description": of.format(name)}
        for name in request.measure:
            entry = {**terms.own_unit(name), "description": f"Measurement of {name}"}
            self.section("inputs")[terms.own("{}_measured", name)] = entry

    # ---- Covariance ------------------------------------------------------------------------------
    def _add_covariance(self) -> None:
        terms, where = self.terms, self.section("where")
        for letter, slopes in (("A", terms.a), ("B", terms.b)):
            for x, by in slopes.items():
                for y in by:
                    entry = {"value": f"partial(der({x}), {y})", "shown": False}
                    where[terms.name(letter, x, y)] = entry
        spread = self.request.start | self.request.unknown
        scales = {x: self._scale(x) for x in terms.estimated}
        for x, y in terms.elements():
            entry = {"derivative": self._rate(x, y) or "0", **terms.unit(x, y)}
            if x == y and x in spread:
                entry["start"] = f"{terms.own('spread_{}', x)}**2"
            entry |= {"nominal": scales[x] * scales[y], "causality": "local"}
            entry["description"] = f"Covariance of {x} and {y}"
            self.section("states")[terms.p(x, y)] = entry

    def _scale(self, x: str) -> float:
        """Return a small standard deviation, for tolerances."""
        request, nominal = self.request, self.plant.variables[x].nominal or 1.0
        given = [d[x] for d in (request.start, request.unknown, request.measure) if x in d]
        return min(given, default=SMALL * nominal)

    def _rate(self, x: str, y: str) -> str:
        """Return the derivative of an element of P."""
        terms = self.terms
        name, p = terms.name, terms.p
        found = [product(name("A", x, k), p(k, y)) for k in terms.a.get(x, ())]
        if x == y:
            found = [product("2", term) for term in found]
        else:
            found += [product(name("A", y, k), p(k, x)) for k in terms.a.get(y, ())]
        for u in terms.b.get(x, ()):
            if u in terms.b.get(y, ()):
                variance = f"{terms.own('noise_{}', u)}**2"
                found.append(product(name("B", x, u), name("B", y, u), variance, PERIOD))
        return total(found)

    def _add_update(self, y: str) -> None:
        """Add the sampler that uses a measurement."""
        terms, local, reinit = self.terms, {}, {}
        name, p = terms.name, terms.p

        def named(text: str, *parts: str) -> str:
            local[name(*parts)] = text
            return name(*parts)

        slopes = {x: terms.slope(y, x) for x in terms.h[y]}
        slopes = {x: named(s, "slope", x) if s != "1" else s for x, s in slopes.items()}
        columns = {
            x: total(product(p(x, k), s) for k, s in slopes.items()) for x in terms.estimated
        }
        columns = {x: named(s, "covariance", x) for x, s in columns.items() if s}
        expected = total(product(columns.get(x, ""), s) for x, s in slopes.items())
        expected, variance = named(expected, "expected"), named(self._variance(y), "variance")
        whole = named(f"{expected} + {variance}", "innovation_variance")
        innovation = named(f"{terms.own('{}_measured', y)} - {y}", "innovation")
        for x, column in columns.items():
            gain = named(f"{column} / {whole}", "gain", x)
            named(f"{column} - {gain} * {expected}", "left", x)
            reinit[x] = f"{x} + {gain} * {innovation}"
        for i, j in terms.elements():
            if i in columns and j in columns:
                gains, left = [name("gain", x) for x in (i, j)], name("left", i)
                less = f"{gains[0]} * {columns[j]} - {left} * {gains[1]}"
                reinit[p(i, j)] = f"{p(i, j)} - {less} + {variance} * {gains[0]} * {gains[1]}"
        nis = terms.own("nis_{}", y)
        about = f"Squared innovation of {y} over its variance: 1 on average"
        self.section("discrete")[nis] = {"description": about}
        entry: dict[str, Any] = {"every": PERIOD, "where": local, "reinit": reinit}
        if self.request.offset:
            entry["offset"] = repr(self.request.offset)
        entry["set"] = {nis: f"{innovation}**2 / {whole}"}
        self.section("sampled")[name("update", y)] = entry

    def _variance(self, y: str) -> str:
        """Return the variance of a measurement, with that of inputs that it follows at once."""
        terms, variable = self.terms, self.plant.variables[y]
        found = [f"{terms.own('noise_{}', y)}**2"]
        for u in terms.slopes(variable.leaf or variable.value, terms.noisy):
            found.append(f"(partial({y}, {u}) * {terms.own('noise_{}', u)})**2")
        return total(found)

    def _add_deviations(self) -> None:
        """Add sigma_NAME of states, unknown parameters and outputs."""
        terms = self.terms
        for x in dict.fromkeys((*terms.estimated, *self.request.measure, *self.request.sigma)):
            found = []
            for i, j in pairs([x] if x in terms.estimated else terms.h[x], 2):
                once = product(terms.slope(x, i), terms.slope(x, j), terms.p(i, j))
                found.append(once if i == j else product("2", once))
            text = total(found)
            # hypot: an absolute value without an event where rounding leaves less than 0
            entry = {"value": f"sqrt(hypot({text}, 0))" if text else "0", **terms.own_unit(x)}
            entry["description"] = f"Standard deviation of {x}"
            self.section("outputs")[terms.own("sigma_{}", x)] = entry
