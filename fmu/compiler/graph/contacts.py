"""Dry friction and stops as values of a graph: forces that hold what is at rest.

Accelerations are affine in the forces of all contacts: a = a0 + B f. A direction is a velocity that
friction and stops act on; while it is held, the force of its contact makes its acceleration 0.
src/model/contacts.c decides what is held.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial, reduce
from typing import TYPE_CHECKING

from . import algebraic, stribeck
from .algebraic import replaced
from .held import Held, is_opposite
from .samples import are_equal, exact

if TYPE_CHECKING:
    from .graph import Graph, Value

BACKWARD, STUCK, FORWARD = 1, 2, 3  # modes of friction
FREE, LOWER, UPPER = 1, 2, 3  # modes of stops
MOST_COUPLED = 8  # src/model/contacts.h
STILL = ("parameter", "integer", "mode", "discrete")  # leaves of factors
OF_OFFSETS = (*STILL, "time")


@dataclass(eq=False)
class Contact:
    """Friction or stops; `given` has values of the file by their keys."""

    name: str
    is_friction: bool
    force: Value  # leaf
    mode: Value
    given: dict[str, Value]
    active: Value | None = None  # None: always
    law: Value | None = None  # size of friction that slides, by its velocity alone
    ratio: Value | None = None  # of its velocity to that of its direction
    place: tuple[Value, Value] | None = None  # of stops: state that a limit sets, its factor
    tolerances: dict[Value, Value] = field(default_factory=dict)  # factors of states in it

    @property
    def breakaway(self) -> Value:
        """The largest friction at rest."""
        return self.given.get("breakaway", self.given["coulomb"])


@dataclass(eq=False)
class Direction:
    """A velocity on which friction and stops act."""

    velocity: Value
    row: dict[Value, Value]  # factors by state
    offset: Value  # what is added to its terms
    contacts: list[Contact]
    own: Value | None = None  # state that follows from the others while it is held
    rest: Value | None = None  # what that is then
    is_exact: bool = True  # it does not follow from others that follow from it
    held: Value | None = None
    hold: Value | None = None  # force, in the direction of the velocity

    @property
    def friction(self) -> Contact | None:
        """The friction, which comes first."""
        return self.contacts[0] if self.contacts[0].is_friction else None

    @property
    def stops(self) -> list[Contact]:
        """The stops."""
        return [contact for contact in self.contacts if not contact.is_friction]


@dataclass(frozen=True)
class Limit:
    """A distance that is above 0 while modes are valid, with another one for some modes."""

    contact: str
    key: str
    number: int  # of its contact
    used: Value | None
    cases: tuple[Value | None, Value, Value]  # condition, distance if it holds, else
    most: Value | None = None  # of friction: the largest force that holds, in the first case

    def distance(self, graph: Graph) -> Value:
        """Return the distance in the modes that are."""
        condition, first, second = self.cases
        return second if condition is None else graph.value("if", condition, first, second)


@dataclass(eq=False)
class Contacts:
    """All contacts of a model, and what decides them."""

    contacts: list[Contact]
    directions: list[Direction]
    limits: list[Limit]
    accelerations: list[Value]  # of the directions, without forces
    response: list[list[Value]]  # of accelerations to the forces, B
    moved: dict[Value, list[Value]]  # states that impulses move, with the response of their rates
    blocks: list[list[int]]  # directions that are decided together


class ContactError(ValueError):
    """What is wrong with a contact: its name, the key and the reason."""

    def __init__(self, contact: Contact, key: str, text: str) -> None:
        super().__init__(text)
        self.contact, self.key = contact, key


class Builder:
    """Finds directions and forces of contacts. rates: of the states by their leaves."""

    def __init__(self, graph: Graph, contacts: list[Contact], rates: Mapping[Value, Value]) -> None:
        self.graph, self.contacts, self.rates = graph, contacts, dict(rates)
        self.zero, self.one = graph.number(0.0), graph.number(1.0)
        self.forces = {(c.force.op, c.force.name): c for c in contacts}
        self.directions: list[Direction] = []
        self.moved: dict[Value, list[Value]] = {}  # states, with the response of their rates
        self.own_rates: dict[Value, Value] = {}  # of states, where they are found with forces

    # ---- Directions ------------------------------------------------------------------------------

    def find(self) -> None:
        """Check the contacts, and find their directions."""
        for contact in self.contacts:
            for key in contact.given:
                self._check_reads(contact, key)
            contact.active = self._active(contact)
            if contact.is_friction:
                contact.law = self._where_active(contact, self._law(contact, False))
        for contact in sorted(self.contacts, key=lambda c: not c.is_friction):
            self._add(contact, self._row(contact, "velocity", contact.given["velocity"]))
        self._check_independence()
        for direction, own in self._owners().items():
            direction.own = own
            direction.rest = self._solved_for(own, direction.row, direction.offset)
            direction.held = self._held(direction)
        for direction in self.directions:
            direction.is_exact = self._is_exact(direction, ())
            for contact in direction.stops:
                self._find_place(contact, direction)

    def _check_reads(self, contact: Contact, key: str) -> None:
        read = contact.given[key].leaves & {(c.mode.op, c.mode.name) for c in self.contacts}
        if read:
            name = min(name for _, name in read)
            raise ContactError(contact, key, f"reads {name}, which is decided together with it")
        read = contact.given[key].leaves & self.forces.keys()
        if read:
            name = min(name for _, name in read)
            text = f"reads the unknown force {name}: then no motion, or several, may be possible"
            raise ContactError(contact, key, text)

    def _active(self, contact: Contact) -> Value | None:
        """Return when a contact can hold: friction also not where a fixed limit is 0."""
        found = contact.given.get("while")
        if found is not None and found.moves:
            raise ContactError(contact, "while", "moves: expected parameters and modes")
        if not contact.is_friction or contact.breakaway.moves:
            return found
        limit = contact.breakaway
        if limit.op == "number" and limit.number > 0:
            return found
        exists = self.graph.value("not", self.graph.value("==", limit, self.zero))
        return exists if found is None else self.graph.value("and", found, exists)

    def _row(self, contact: Contact, key: str, value: Value) -> tuple[dict[Value, Value], Value]:
        """Return factors of the states in a value, and the rest."""
        (row,) = self.graph.gradients([value], self.rates)
        row = {x: factor for x, factor in row.items() if not _is_zero(factor)}
        if not row:
            raise ContactError(contact, key, "follows from no state")
        for x, factor in row.items():
            if {op for op, _ in factor.leaves} - {*STILL}:
                text = f"must be linear in the states: the factor of {x.name} is not fixed"
                raise ContactError(contact, key, text)
        (rest,) = replaced(self.graph, [value], dict.fromkeys(row, self.zero))
        wrong = sorted(name for op, name in rest.leaves if op not in OF_OFFSETS)
        if wrong:
            text = f"reads {wrong[0]}: expected states, parameters and the time"
            raise ContactError(contact, key, text)
        return row, rest

    def _add(self, contact: Contact, found: tuple[dict[Value, Value], Value]) -> None:
        """Add a contact to the direction of its velocity."""
        row, rest = found
        for direction in self.directions:
            ratio = self._ratio(row, direction)
            if ratio is not None:
                velocity, first = contact.given["velocity"], direction.contacts[0].name
                if not are_equal(velocity, self._times(ratio, direction.velocity)):
                    text = f"differs from that of {first} by what the time or parameters move"
                    raise ContactError(contact, "velocity", text)
                if contact.is_friction:
                    text = f"is that of {first}: add the two limits in one"
                    raise ContactError(contact, "velocity", text)
                contact.ratio = ratio
                direction.contacts.append(contact)
                break
        else:
            contact.ratio = self.one
            self.directions.append(Direction(contact.given["velocity"], row, rest, [contact]))

    def _check_independence(self) -> None:
        """Check that no velocity follows from others, by elimination with any parameters."""
        done: list[tuple[Value, dict[Value, Fraction], set[int]]] = []  # with pivot and members
        for k, direction in enumerate(self.directions):
            row, of = {x: exact(factor) for x, factor in direction.row.items()}, {k}
            for pivot, other, members in done:
                if factor := row.get(pivot):
                    scale = factor / other[pivot]
                    for x, value in other.items():
                        row[x] = row.get(x, Fraction(0)) - scale * value
                    of |= members
            row = {x: value for x, value in row.items() if value}
            if not row:
                names = [self.directions[i].contacts[0].name for i in sorted(of - {k})]
                text = f"follows from those of {' and '.join(names)}: forces would not be unique"
                raise ContactError(direction.contacts[0], "velocity", text)
            done.append((next(iter(row)), row, of))

    def _owners(self) -> dict[Direction, Value]:
        """Match each direction to a state of its velocity, those with few states first."""
        by_state: dict[Value, Direction] = {}

        def match(direction: Direction, tried: set[Value]) -> bool:
            simple = [*direction.row]
            simple.sort(key=lambda x: direction.row[x].op not in ("number", "negative"))
            for x in simple:
                if x not in tried:
                    tried.add(x)
                    if x not in by_state or match(by_state[x], tried):
                        by_state[x] = direction
                        return True
            return False

        for direction in sorted(self.directions, key=lambda d: len(d.row)):
            match(direction, set())
        found = {direction: x for x, direction in by_state.items()}
        return {direction: found[direction] for direction in self.directions}

    def _ratio(self, row: dict[Value, Value], other: Direction) -> Value | None:
        """Return factors of states over those of a direction, if they have one ratio."""
        if row == other.row:
            return self.one
        if row.keys() != other.row.keys():
            return None
        if all(is_opposite(row[x], other.row[x]) for x in row):
            return self.graph.number(-1.0)
        first, *others = row
        ratio = self.graph.simple("/", row[first], other.row[first])
        scaled = [(row[x], self._times(ratio, other.row[x])) for x in others]
        return ratio if all(are_equal(*pair) for pair in scaled) else None

    def _solved_for(self, own: Value, row: Mapping[Value, Value], rest: Value) -> Value:
        """Return the value of a state at which a linear value is 0."""
        total = rest
        for x, factor in row.items():
            if x is not own:
                total = self._plus(total, self._times(factor, x))
        return self.over(self.graph.negative(total), row[own])

    def _is_exact(self, direction: Direction, above: tuple[Direction, ...]) -> bool:
        """Return whether no other direction's own state follows from that of this one, in turn."""
        owners = {other.own: other for other in self.directions}
        others = [owners[x] for x in direction.row if x is not direction.own and x in owners]
        below = (*above, direction)
        return not any(other in below or not self._is_exact(other, below) for other in others)

    def _find_place(self, contact: Contact, direction: Direction) -> None:
        """Find the state that is set where a stop is reached."""
        graph, position = self.graph, contact.given["position"]
        places, offset = self._row(contact, "position", position)
        (rate,) = graph.derivatives([position], self.rates | {graph.value("time"): self.one})
        if rate.leaves & self.forces.keys():
            raise ContactError(contact, "position", "has no velocity: a force acts on its rate")
        if not are_equal(rate, contact.given["velocity"]):
            raise ContactError(contact, "velocity", "is not the rate of position")
        own = min(places, key=lambda x: self.rates[x] is not direction.own)
        contact.place = own, self._solved_for(own, places, offset)
        contact.tolerances = places

    # ---- Forces ----------------------------------------------------------------------------------

    def _is(self, contact: Contact, mode: int) -> Value:
        return is_mode(self.graph, contact, mode)

    def stuck(self, direction: Direction) -> Value | None:
        """Return whether friction holds a direction; None: it has none."""
        return self._is(direction.friction, STUCK) if direction.friction else None

    def closed(self, contact: Contact) -> Value:
        """Return whether stops are closed."""
        return self.graph.value("not", self._is(contact, FREE))

    def alone(self, direction: Direction, contact: Contact) -> Value:
        """Return whether stops hold a direction without friction."""
        closed, stuck = self.closed(contact), self.stuck(direction)
        return closed if stuck is None else self.graph.value(
            "and", closed, self.graph.value("not", stuck)
        )  # fmt: skip

    def _held(self, direction: Direction) -> Value:
        stuck = self.stuck(direction)
        found = [] if stuck is None else [stuck]
        found += [self.closed(contact) for contact in direction.stops]
        return reduce(partial(self.graph.value, "or"), found)

    def sliding(self, contact: Contact) -> Value:
        """Return friction of what slides, against its velocity: with its sign."""
        law, backward = self._law(contact, True), self._is(contact, BACKWARD)
        found = self.choice(backward, self.graph.negative(law), law)
        return self._where_active(contact, found)

    def _law(self, contact: Contact, is_in_mode: bool) -> Value:
        """Return the size of sliding friction: in the sense of its mode, or of its velocity."""
        found = contact.given["coulomb"]
        if "breakaway" in contact.given:
            mode = self._is(contact, BACKWARD) if is_in_mode else None
            found = stribeck.size(self.graph, contact.given, mode)
        return found

    def _where_active(self, contact: Contact, size: Value) -> Value:
        return size if contact.active is None else self.choice(contact.active, size, self.zero)

    def build(self) -> tuple[Contacts, dict[Value, Value], dict[Value, Value]]:
        """Return the contacts, forces as they are shown, and rates of the states.

        Who carries a closed stop's direction where friction holds it, too, is shown only: friction
        does as far as it can. In rates it does so alone.
        """
        self.find()
        graph, forces = self.graph, [c.force for c in self.contacts]
        rates = [*self.rates.values()]
        slopes = graph.gradients(rates, forces)
        moved = {
            x: [row.get(f, self.zero) for f in forces]
            for x, row in zip(self.rates, slopes, strict=True)
            if any(not _is_zero(s) for s in row.values())
        }
        for x, row in moved.items():
            for contact, slope in zip(self.contacts, row, strict=True):
                if slope.leaves & self.forces.keys():
                    text = f"the derivative of {x.name} is not linear in {contact.force.name}"
                    raise ContactError(contact, "force", text)
        free = dict(
            zip(rates, replaced(graph, rates, dict.fromkeys(forces, self.zero)), strict=True)
        )
        response, accelerations, plain = [], [], []
        for direction in self.directions:
            total = whole = self._rate_of_offset(direction)
            for x, factor in direction.row.items():
                whole = self._plus(whole, self._times(factor, self.rates[x]))
                total = self._plus(total, self._times(factor, free[self.rates[x]]))
            accelerations.append(total)
            plain.append(whole)
            response.append([
                self._sum(self._times(factor, moved[x][e]) for x, factor in direction.row.items()
                          if x in moved)
                for e in range(len(forces))
            ])  # fmt: skip
            for contact in direction.contacts:
                if _is_zero(response[-1][self.contacts.index(contact)]):
                    text = f"{contact.force.name} does not act on the velocity"
                    raise ContactError(contact, "force", text)
        blocks = self._blocks(response)
        self.moved = moved
        found = Contacts(self.contacts, self.directions, [], accelerations, response, moved, blocks)
        self._solve(found, plain)
        in_rates, shown = self._forces(found)
        found.limits += sorted(self._limits(in_rates), key=lambda limit: limit.number)
        return found, shown, self._rates(in_rates)

    def _blocks(self, response: list[list[Value]]) -> list[list[int]]:
        """Return groups of directions whose forces act on each other."""
        count, of = len(self.directions), {}
        for k, direction in enumerate(self.directions):
            of |= {self.contacts.index(contact): k for contact in direction.contacts}
        group = [*range(count)]
        for k in range(count):
            for e, slope in enumerate(response[k]):
                a, b = group[k], group[of[e]]
                if not _is_zero(slope) and a != b:
                    group = [a if g == b else g for g in group]
        blocks = [[k for k in range(count) if group[k] == g] for g in dict.fromkeys(group)]
        for block in blocks:
            if len(block) > MOST_COUPLED:
                names = ", ".join(self.directions[k].contacts[0].name for k in block)
                text = f"more than {MOST_COUPLED} velocities are held together: {names}"
                raise ContactError(self.directions[block[0]].contacts[0], "force", text)
        return blocks

    def _rate_of_offset(self, direction: Direction) -> Value:
        return self.graph.derivatives([direction.offset], {self.graph.value("time"): self.one})[0]

    def _column(self, direction: Direction, row: list[Value]) -> Value:
        """Return the response of an acceleration to the force that holds a direction."""
        value = self.zero
        for contact in direction.contacts[::-1]:
            own = row[self.contacts.index(contact)]
            if contact.is_friction:
                own = self.graph.negative(own)
                own = own if not direction.stops else self.choice(self.stuck(direction), own, value)
            else:
                own = self.over(own, contact.ratio)
                is_last = contact is direction.contacts[-1]
                own = own if is_last else self.choice(self.closed(contact), own, value)
            value = own
        return value

    def _solve(self, found: Contacts, accelerations: list[Value]) -> None:
        """Find the forces that hold directions, by which their accelerations are 0."""
        graph = self.graph
        sliding = {}
        for contact in self.contacts:
            own = self.zero
            if contact.is_friction:
                slides = self.sliding(contact)
                own = self.choice(self._is(contact, STUCK), self.zero, slides)
            sliding[contact.force] = own
        pushed = replaced(graph, accelerations, sliding)
        for block in found.blocks:
            if Held.fits([self.directions[k] for k in block]):
                held = Held(self, block, found.response)
                for k in block:
                    self.directions[k].hold = held.hold(k)
                    self.own_rates[self.directions[k].own] = held.rate(k)
                continue
            right = [
                self.choice(self.directions[k].held, graph.negative(pushed[k]), self.zero)
                for k in block
            ]
            if len(block) == 1:
                (k,) = block
                column = self._column(self.directions[k], found.response[k])
                hold = self.over(graph.negative(pushed[k]), column)
                self.directions[k].hold = self.choice(self.directions[k].held, hold, self.zero)
                continue
            elements = {}
            for i, k in enumerate(block):
                for j, other in enumerate(block):
                    column = self._column(self.directions[other], found.response[k])
                    if i == j or not _is_zero(column):
                        diagonal = self.one if i == j else self.zero
                        elements[i, j] = self.choice(self.directions[k].held, column, diagonal)
            vector = graph.value("linear", algebraic.matrix(graph, elements), *right)
            names = [c.force.name for k in block for c in self.directions[k].contacts]
            texts = [f"0 = der({self.directions[k].contacts[0].name}.velocity)" for k in block]
            graph.linear.append(algebraic.Linear(names, texts, vector))
            for i, k in enumerate(block):
                self.directions[k].hold = algebraic.component(graph, vector, i)

    def _forces(self, found: Contacts) -> tuple[dict[Value, Value], dict[Value, Value]]:
        """Return the force of each contact, in rates and as it is shown."""
        graph, in_rates, shown = self.graph, {}, {}
        for direction in found.directions:
            friction, stuck, hold = direction.friction, self.stuck(direction), direction.hold
            if friction is not None:
                slides = self.sliding(friction)
                in_rates[friction.force] = self.choice(stuck, graph.negative(hold), slides)
                held = graph.value("-", self.zero, hold)  # 0, not -0
                shown[friction.force] = self.choice(stuck, held, slides)
            for contact in direction.stops:
                force, alone = self.over(hold, contact.ratio), self.alone(direction, contact)
                in_rates[contact.force] = self.choice(alone, force, self.zero)
                shown[contact.force] = in_rates[contact.force]
                if friction is None:
                    continue
                excess = self._excess(friction, contact, hold)
                both = graph.value("and", stuck, self.closed(contact))
                shown[contact.force] = self.choice(
                    both, self.over(excess, contact.ratio), in_rates[contact.force]
                )
                rest = graph.value("-", excess, hold)
                shown[friction.force] = self.choice(both, rest, shown[friction.force])
        return in_rates, shown

    def is_positive(self, contact: Contact) -> Value:
        """Return whether closed stops push in the direction's sense."""
        lower = self._is(contact, LOWER)
        positive = self.graph.value(">", contact.ratio, self.zero)
        if contact.ratio.op == "number":
            return lower if contact.ratio.number > 0 else self.graph.value("not", lower)
        return self.graph.choice(positive, lower, self.graph.value("not", lower))

    def _excess(self, friction: Contact, contact: Contact, hold: Value) -> Value:
        """Return what a stop carries of the force that holds its direction."""
        graph, limit = self.graph, friction.breakaway
        lower = graph.value("negative", limit)
        above = graph.value(
            "if", graph.value(">", hold, limit), graph.value("-", hold, limit), self.zero
        )
        below = graph.value(
            "if", graph.value("<", hold, lower), graph.value("-", hold, lower), self.zero
        )
        return self.choice(self.is_positive(contact), above, below)

    def _rates(self, forces: Mapping[Value, Value]) -> dict[Value, Value]:
        """Return the rates of the states: of what is held, one follows from the others."""
        rates = [*self.rates.values()]
        by = {**forces, **{self.rates[x]: rate for x, rate in self.own_rates.items()}}
        found = dict(zip(self.rates, replaced(self.graph, rates, by), strict=True))
        done = {*self.own_rates}
        owners = {direction.own: direction for direction in self.directions}

        def finish(x: Value, above: tuple[Value, ...]) -> Value | None:
            """Return the rate of a state; None in a circle."""
            if x in above:
                return None
            if x not in owners or x in done:
                return found[x]
            direction = owners[x]
            total = self._rate_of_offset(direction)
            for other, factor in direction.row.items():
                if other is not x:
                    rate = finish(other, (*above, x))
                    if rate is None:
                        return None
                    total = self._plus(total, self._times(factor, rate))
            at_rest = self.over(self.graph.negative(total), direction.row[x])
            found[x] = self.choice(direction.held, at_rest, found[x])
            done.add(x)
            return found[x]

        for x in owners:
            finish(x, ())
        return found

    # ---- Limits ----------------------------------------------------------------------------------

    def _limits(self, forces: Mapping[Value, Value]) -> list[Limit]:
        """Return two limits of each contact: forward and backward, or lower and upper."""
        graph, found = self.graph, []
        for direction in self.directions:
            stuck = self.stuck(direction)
            for contact in direction.contacts:
                number = self.contacts.index(contact)
                if contact.is_friction:
                    found += self._limits_of_friction(direction, contact, number)
                    continue
                for key, mode, sign in (("lower", LOWER, 1), ("upper", UPPER, -1)):
                    force, distance = forces[contact.force], self.one
                    is_closed, used = self._is(contact, mode), self._is(contact, FREE)
                    if key in contact.given:
                        ends = contact.given["position"], contact.given[key]
                        distance = graph.value("-", *ends[::sign])
                        used = graph.value("or", used, is_closed)
                    else:
                        used = is_closed
                    if stuck is not None:
                        used = graph.value("and", graph.value("not", stuck), used)
                    if contact.active is not None:
                        used = graph.value("and", contact.active, used)
                    pushes = force if sign > 0 else graph.negative(force)
                    cases = (is_closed, pushes, distance)
                    found.append(Limit(contact.name, key, number, used, cases))
        return found

    def _limits_of_friction(
        self, direction: Direction, contact: Contact, number: int
    ) -> list[Limit]:
        graph, limit, stuck = self.graph, contact.breakaway, self._is(contact, STUCK)
        velocity = contact.given["velocity"]
        moves = self.choice(self._is(contact, BACKWARD), graph.negative(velocity), velocity)
        opens = []
        for stop in direction.stops:
            positive, is_open = self.is_positive(stop), self._is(stop, FREE)
            opens.append(
                [
                    graph.value("or", is_open, side)
                    for side in (positive, graph.value("not", positive))
                ]
            )
        sides = []
        for i in range(2):
            conditions = [sides_of[i] for sides_of in opens]
            sides.append(reduce(partial(graph.value, "and"), conditions) if conditions else None)
        forward, backward = sides
        first = contact.active
        if forward is not None:
            own = graph.value("or", graph.value("not", stuck), forward)
            first = own if first is None else graph.value("and", first, own)
        second = stuck if backward is None else graph.value("and", stuck, backward)
        left = graph.value("+", limit, direction.hold)
        right = graph.value("-", limit, direction.hold)
        return [
            Limit(contact.name, "forward", number, first, (stuck, left, moves), limit),
            Limit(contact.name, "backward", number, second, (None, right, right), limit),
        ]

    # ---- Operations ------------------------------------------------------------------------------

    def choice(self, condition: Value, first: Value, second: Value) -> Value:
        return first if first is second else self.graph.value("if", condition, first, second)

    def _plus(self, a: Value, b: Value) -> Value:
        return self.graph.simple("+", a, b)

    def _sum(self, values) -> Value:
        return reduce(self._plus, values, self.zero)

    def _times(self, a: Value, b: Value) -> Value:
        if a.op == "number" and a.number == -1.0:
            return self.graph.negative(b)
        return self.graph.simple("*", a, b)

    def over(self, a: Value, b: Value) -> Value:
        if b.op == "number" and b.number == -1.0:
            return self.graph.negative(a)
        return self.graph.simple("/", a, b)


def deciding(graph: Graph) -> list[Value]:
    """Return all that decides contacts."""
    found = graph.contacts
    if found is None:
        return []
    values = [*found.accelerations, *(v for row in found.response for v in row)]
    values += [v for row in found.moved.values() for v in row]
    values += [v for contact in found.contacts for v in contact.given.values()]
    for limit in found.limits:
        values += [limit.distance(graph), *([] if limit.used is None else [limit.used])]
    return values


def is_mode(graph: Graph, contact: Contact, mode: int) -> Value:
    """Return whether a contact is in a mode."""
    return graph.value("==", contact.mode, graph.number(float(mode)))


def _is_zero(value: Value) -> bool:
    return value.op == "number" and value.number == 0.0
