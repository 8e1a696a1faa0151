"""What events and samplers of the plant do to the covariance.

New values x+ = r(x, t) at an event, which happens where a distance g(x, t) passes 0, make
    P+ = S P S',  S = r_x + (r_x f- + r_t - f+) t_x,  t_x = -g_x / (g_x f- + g_t).
An event before the plant's one, by the same condition, sets P to r_x P r_x' and keeps r_x f- + r_t
(`rate`), r_x P t_x' (`column`) and t_x P t_x' (`square`). One that follows knows f+, the rates that
there are then, and adds the rest. Times of samplers do not depend on states: they have no t_x.
"""

from typing import Any

from rparm.estimator.terms import Terms, product, total
from rparm.fmu_tools.compiler.expressions.expression import Node, names, written
from rparm.fmu_tools.compiler.read.content import Change, Event, Expression, Sampler

Rows = dict[str, dict[str, str]]  # texts by state and column


def add(terms: Terms, tables: dict[str, Any]) -> None:
    """Add events and samplers to the tables of a filter."""
    before: dict[str, dict[str, Any]] = {"events": {}, "sampled": {}}
    after: dict[str, Any] = {}
    for change in terms.jumps:
        name = terms.name("before", change.name)
        if isinstance(change, Sampler):
            before["sampled"][name] = _Jump(terms, change).first()
        elif isinstance(change, Event):
            jump = _Jump(terms, change)
            if jump.moving:
                before["events"][name] = jump.first(tables)
                after[terms.name("after", change.name)] = jump.second()
            elif change.reinit:
                before["events"][name] = jump.first()
    for section, entries in before.items():
        own = entries | tables.get(section, {}) | (after if section == "events" else {})
        if own:
            tables[section] = own


def passed(terms: Terms, event: Event) -> tuple[Node, ...]:
    """Return both sides of the relation that decides when: the first one that states move."""
    return next((node.arguments for node in terms.relations(event.when.tree)), ())


class _Jump:
    def __init__(self, terms: Terms, change: Change) -> None:
        self.terms, self.change = terms, change
        sides = passed(terms, change) if isinstance(change, Event) else ()
        self.sides = sides
        self.moving = terms.moving(frozenset().union(*map(names, sides)))  # has a part in g_x
        self.local: dict[str, str] = {}
        self.rows: Rows = {x: {x: "1"} for x in terms.estimated}  # r_x
        for x, new in change.reinit.items():
            self.rows[x] = {
                y: self._named(f"partial({self._text(new)}, {y})", "jump", x, y)
                for y in terms.moving(names(new.tree))
            }
        self.parts = {x: self._part(x) for x in terms.estimated}  # r_x P

    def _named(self, text: str, *parts: str) -> str:
        """Give a text a local name."""
        name = self.terms.name(*parts)
        self.local[name] = text
        return name

    def _part(self, x: str) -> dict[str, str]:
        p, found = self.terms.p, {}
        for y in self.terms.estimated:
            text = total(product(slope, p(k, y)) for k, slope in self.rows[x].items())
            is_new = x in self.change.reinit and text
            found[y] = self._named(text, "part", x, y) if is_new else text
        return found

    def _text(self, expression: Expression) -> str:
        """Return the text of an expression, with values of indexes and local names."""
        is_plain = "[" not in self.change.name and not self.change.where
        return expression.text if is_plain else written(expression.tree)

    def first(self, tables: dict[str, Any] | None = None) -> dict[str, Any]:
        """Return what happens before: P by r_x; with tables, it keeps what the second one needs."""
        change, keys = (
            self.change,
            ("when",) if isinstance(self.change, Event) else ("every", "offset"),
        )
        entry: dict[str, Any] = {key: self._text(getattr(change, key)) for key in keys}
        if change.during:
            entry["while"] = self._text(change.during)
        new = {
            self.terms.p(x, y): total(product(self.parts[x][k], s) for k, s in self.rows[y].items())
            for x, y in self.terms.elements()
            if {x, y} & change.reinit.keys()
        }
        entry["where"] = self.local
        if new:
            entry["reinit"] = {name: text or "0" for name, text in new.items()}
        if tables is not None:
            entry["set"] = self._keep(tables)
        return entry

    def _turn(self) -> dict[str, str]:
        """Name t_x; 0 where the distance does not change."""
        terms, (left, right) = self.terms, self.sides
        distance = f"({written(left)}) - ({written(right)})"
        slopes = {k: self._named(f"partial({distance}, {k})", "slope", k) for k in self.moving}
        speeds = [product(slope, terms.rate(k)) for k, slope in slopes.items()]
        speeds.append(terms.by_time(distance, names(left) | names(right)))
        speed = self._named(total(speeds) or "0", "speed")
        rest = f"/ {speed} if {speed} < 0 or {speed} > 0 else 0"
        return {k: self._named(f"-{slope} {rest}", "turn", k) for k, slope in slopes.items()}

    def _keep(self, tables: dict[str, Any]) -> dict[str, str]:
        """Declare what the second event needs; return its values."""
        terms, event, turn, kept = self.terms, self.change.name, self._turn(), {}
        discrete = tables.setdefault("discrete", {})

        def keep(text: str, unit: dict[str, str], *parts: str) -> str:
            name = terms.name(*parts)
            discrete[name], kept[name] = unit | {"shown": False}, text
            return name

        self.columns, self.rates = {}, {}
        for x, part in self.parts.items():
            if text := total(product(part[k], turn[k]) for k in turn):
                self.columns[x] = keep(text, terms.unit(x, seconds=1), "column", event, x)
            if x in terms.states:
                rates = [product(slope, terms.rate(k)) for k, slope in self.rows[x].items()]
                if new := self.change.reinit.get(x):
                    rates.append(terms.by_time(self._text(new), names(new.tree)))
                self.rates[x] = keep(
                    total(rates) or "0", terms.unit(x, seconds=-1), "rate", event, x
                )
        square = total(product(turn[i], terms.p(i, j), turn[j]) for i in turn for j in turn)
        self.square = keep(square or "0", terms.unit(seconds=2), "square", event)
        modes = tables.get("modes", {})
        modes = dict.fromkeys(modes, False) if isinstance(modes, list) else modes
        self.pending = terms.name("after", event, "mode")
        tables["modes"] = modes | {self.pending: False}
        return kept | {self.pending: "true"}

    def second(self) -> dict[str, Any]:
        """Return the event that follows."""
        terms, reinit = self.terms, {}
        shift = {x: terms.name("shift", x) for x in self.rates}
        for x, y in terms.elements():
            sides = ((x, y), (y, x))
            added = [terms.p(x, y)]
            added += [product(shift.get(i, ""), self.columns.get(j, "")) for i, j in sides]
            added.append(product(self.square, shift.get(x, ""), shift.get(y, "")))
            reinit[terms.p(x, y)] = total(added)
        return {
            "when": self.pending,
            "where": {shift[x]: f"{rate} - {terms.rate(x)}" for x, rate in self.rates.items()},
            "reinit": reinit,
            "set": {self.pending: "false"},
        }
