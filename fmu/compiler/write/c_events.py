"""The events of a model in C (src/model/model.h).

Each relation has a mode: whether it holds. Its indicator is its distance with the sign of that
mode, and 1 while no value that is needed reads it. An event of the file fires when its relation
comes to hold in its modes. What all models do with that is in src/model/relations.c.
"""

import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from ..expressions.expression import in_order
from ..expressions.kinds import CONDITION, WHOLE, Kind
from ..graph.contacts import deciding
from ..graph.graph import CONDITIONS, Graph, Relation, Value, is_unknown
from ..names import Field, c_name
from ..plain_c.values import Conditions
from ..read.content import CALCULATED, COUNTS, OPTIONS, SWITCHES, Change, ModelFile, Sampler
from ..units import Exponents
from . import c_contacts, c_gradients, c_indicators, c_possible, c_undefined
from .c_code import Code, Leaves, located, told
from .c_text import declared, filled, indented, shortened, text
from .errors import NONE, Errors
from .statements import Block, Item, Operand, Place, Statement, field_of, store

Guards = dict[Value, Value | None]  # conditions; None: always

SECOND = {"s": 1}
INDEXES = re.compile(r"\[([0-9,]+)\]")
NEXT_TIME = [
    "static double next_time(const void *values) {",
    "    return relations_next_time(&relations, ROOM, values);",
    "}",
    "",
]


def leaves(file: ModelFile) -> Leaves:
    """Where functions of value structures have the leaves, and their derivatives along a curve."""
    rounding = ("*", "RELATIONS_TIME_ROUNDING", ("fabs", "time"))
    conditions = Conditions(file.graph)
    found: dict[tuple[str, str], Operand] = {("time", ""): "time", ("first", ""): "dt"}
    found["later", ""] = "relations_later", "time", rounding
    for v in file.of("parameters", "inputs", "states", "discrete"):
        field = file.fields.value(v.name)
        found[v.leaf.op, v.name] = field_of("values", field, v.name)
        found["first", v.name] = field_of("first", field, f"d_{v.name}")
        found["second", v.name] = field_of("second", field, f"dd_{v.name}")
    for name, kind in file.kinds.items():
        field = file.fields.count(name)
        if kind == CONDITION:
            found["mode", name] = field_of("values", field, name, "int")
        elif (numbers := file.variables[name].numbers) is not None:
            conditions.domains[file.graph.value("integer", name=name)] = frozenset(numbers)
            found["integer", name] = field_of("values", field, name, "int")
        else:
            found["integer", name] = field_of("(double)values", field, name)
    for i, name in enumerate(file.anchors):
        found["anchor", name] = Place("values->anchors[", i, "]")
    for i, name in enumerate(file.graph.segments):
        found["integer", name] = Place("values->segments[", i, "]")
    for i, name in enumerate(file.graph.relations):
        found["mode", name] = Place("values->relations[", i, "]")
    return Leaves(found, file.graph.names, file.graph.arrays, conditions)


def arrays(file: ModelFile) -> Leaves:
    """Return where functions of states and inputs have them."""
    return leaves(file).but(
        {
            (op, v.name): Place(f"{op}[", i, "]", v.name, is_opaque=True)
            for op, section in (("state", "states"), ("input", "inputs"))
            for i, v in enumerate(file.of(section))
        },
        is_near="true",
    )


@dataclass(frozen=True)
class Tick:
    """A number about a sampler: a local variable of the FMU, which `linearize` differentiates."""

    name: str
    field: Field
    value: Value
    exponents: Exponents  # of its unit
    description: str  # rparm/linearization/sampling.py knows it by that


def ticks(file: ModelFile) -> list[Tick]:
    """When samplers tick, and what each would set now; the largest double is no finite value.

    Those that set what the FMU does not show have none.
    """
    graph, found, taken = file.graph, [], {*file.variables, *file.modes}
    uncoupled = _uncoupled(file)
    one, zero, largest = map(graph.number, (1.0, 0.0, sys.float_info.max))
    hidden = {variable.name for variable in file.variables.values() if not variable.shown}
    for i, sampler in enumerate(file.sampled, 1):
        if hidden & sampler.given.keys():  # what it does shows in part
            continue
        every, offset = (period.value for period in sampler.periods)
        own = [("every", every, SECOND, "period"), ("offset", offset, SECOND, "offset")]
        for target, given in sampler.given.items():
            variable, new, unit = file.variables.get(target), given.value, {}
            old = variable.leaf if variable else graph.value("mode", name=target)
            if old.op == "mode":
                new, old = (graph.choice(value, one, zero) for value in (new, old))
            if sampler.during is not None:
                new = graph.choice(sampler.during.value, new, old)
            if old.op in ("state", "discrete"):
                meaning, unit = "new value", variable.exponents
            else:  # the change, which is 0 or not
                meaning = "count" if target in uncoupled else "change"
                new = graph.value("-", new, old)
            new = graph.value("if", graph.value("isfinite", new), new, largest)
            own.append((target, new, unit, f"{meaning} of {target}"))
        for key, value, unit, meaning in own:
            plain = f"sampled_{sampler.name}_{key}"
            indexes = ",".join(INDEXES.findall(plain))
            name, end = INDEXES.sub("", plain), indexes and f"[{indexes}]"
            while name + end in taken:
                name += "_"
            taken.add(name + end)
            description = f"Sampler {i}, {sampler.name}: {meaning}"
            found.append(Tick(name + end, Field(f"tick_{len(found)}"), value, unit, description))
    return found


def _uncoupled(file: ModelFile) -> set[str]:
    """Counters from which nothing follows but themselves."""
    graph, expressions = file.graph, [c for change in file.changes for c in change.conditions]
    read = [v.value for v in file.of("states", *CALCULATED)]
    read += [e.value for e in expressions] + [r.distance for r in graph.relations.values()]
    read += [segment.argument for segment in graph.segments.values()]
    used = {name for value in read for _, name in value.leaves}
    for change in file.changes:
        for target, new in change.given.items():
            used |= {name for _, name in new.value.leaves if name != target}
    return {v.name for v in file.of(COUNTS) if v.kind == WHOLE} - used


def has_events(file: ModelFile) -> bool:
    """Return whether a file has anything that only events, or the initialization, may write."""
    written = file.sampled or file.of("discrete", COUNTS, SWITCHES)
    ends = any(event.terminate for event in file.events)
    return bool(file.graph.relations or written or _has_starts(file) or ends)


def _has_starts(file: ModelFile) -> bool:
    return bool(file.started or any(file.modes.values()) or file.of(COUNTS))


def counted(file: ModelFile) -> dict[str, tuple[Kind, int]]:
    """Modes and discrete variables that are no real numbers: kinds, and values at the start."""
    found = {mode: (CONDITION, int(start)) for mode, start in file.modes.items()}
    return found | {v.name: (v.kind, int(v.start or 0)) for v in file.of(COUNTS)}


class Events:
    """All relations of a file with their indicators, and the functions of struct model_events."""

    def __init__(self, file: ModelFile) -> None:
        self.file, self.graph, self.leaves = file, file.graph, leaves(file)
        states = enumerate(file.of("states"))
        self.tolerances = {("state", x.name): Place("tolerance[", i, "]") for i, x in states}
        graph, self.relations = file.graph, list(file.graph.relations.values())
        read = [(v.value, None) for v in file.of("states", *CALCULATED) if v.shown]
        for event in file.events:
            during = event.during and event.during.value
            read += [(event.when.value, during), *([(during, None)] if during else [])]
        used = _guards(graph, [*read, *((value, None) for value in deciding(file.graph))])
        self.limits = c_contacts.limits(file)
        # condition under which each matters; None: always
        readers = {r.name: r.mode for r in self.relations}
        for segment in graph.segments.values():
            readers |= {segment.low.name: segment.leaf, segment.high.name: segment.leaf}
        self.used = {name: used.get(reader, graph.number(0.0)) for name, reader in readers.items()}
        if file.gradients:  # slopes matter where their relations do
            own = [*self.used][file.gradients.relations :]
            self.used |= {slope: self.used[file.gradients.watched[slope]] for slope in own}
        self.located = graph.located

    def __bool__(self) -> bool:
        return has_events(self.file)

    @property
    def discrete(self) -> list[Field]:
        """Fields of discrete states: times of samplers, and the discrete variables."""
        ticks = [Field(c_name("ticks", sampler.name)) for sampler in self.file.sampled]
        variables = [self.file.fields.value(v.name) for v in self.file.of("discrete")]
        return [*([Field("start"), *ticks] if ticks else []), *variables]

    def indicators(self) -> dict[Field, Value]:
        """Indicators by their fields: signed distances, or 1."""
        one, found = self.graph.number(1.0), {}
        for i, relation in enumerate(self.located):
            z, used = self.signed(relation), self.used[relation.name]
            z = z if used is None else self.graph.value("if", used, z, one)
            found[Field("z", i)] = z
        for i, limit in enumerate(self.limits, len(self.located)):
            found[Field("z", i)] = c_contacts.indicator(self.file, limit)
        return found

    @property
    def followed(self) -> list[Value]:
        """Distances of relations and limits, with the signs of modes."""
        relations = [self.signed(relation) for relation in self.located]
        return relations + [limit.distance(self.file.graph) for limit in self.limits]

    def signed(self, relation: Relation) -> Value:
        """The distance, with the sign of the mode."""
        opposite = self.graph.value("negative", relation.distance)
        return self.graph.value("if", relation.mode, relation.distance, opposite)

    def doubles(self) -> list[str]:
        """Fields of the value structure."""
        discrete = declared("double", self.discrete) if self else []
        return ["/* discrete states */", *discrete] if discrete else []

    def ints(self) -> list[str]:
        """Fields behind all doubles, without gaps."""
        if not self:
            return []
        return [
            *(["/* inputs */"] if self.file.of(SWITCHES) else []),
            *declared("int", [self.file.fields.count(v.name) for v in self.file.of(SWITCHES)]),
            "/* modes; C has no empty arrays */",
            "int is_begun;",
            *([f"int relations[{len(self.relations)}];"] if self.relations else []),
            f"int active[{len(self.file.events) + 1}];",
            *([f"int segments[{len(segments)}];"] if (segments := self.graph.segments) else []),
            *declared("int", map(self.file.fields.count, counted(self.file))),
        ]

    def functions(self, in_domain: str = "") -> list[str]:
        """Text of all functions and of the struct model_events; in_domain: behind their names."""
        if not self or self.file.hook:
            return []
        file, timed = self.file, [r for r in self.relations if r.time is not None]
        states = file.of("states")
        searched = Code(arrays(file).but({}, is_solved="is_solved"))
        places = {relation.name: i for i, relation in enumerate(self.relations)}
        indicators = {
            Place("indicator[", i, "]"): z for i, z in enumerate(self.indicators().values())
        }
        times = {Place("times[", places[r.name], "]"): r.time for r in timed}
        table = [
            # at its time a timed one is past
            f"{{{int(r.rises if r.time else r.includes_zero)}, {int(r.time is not None)}, "
            f"{int(r.rises)}, {int(self.graph.is_of_inputs(r.distance))}, {int(r.is_of_time)}, "
            f"{self.located.index(r) if r.time is None else 0}}},"
            for r in self.relations
        ]
        assigned = self._rows_of_assignments()
        return filled(
            "events.c.in",
            relations=len(self.relations),
            events=len(file.events),
            in_domain=in_domain,
            states=len(states),
            inputs=len(file.of("inputs")),
            state_offset=f"offsetof(struct equations_values, {file.fields.value(states[0].name)})"
            if states
            else "0",
            circles=self._circles(),
            **self._ends(),
            has_inputs=int(any(self.graph.is_of_inputs(r.distance) for r in self.relations)),
            modes=2
            + len(self.relations)
            + len(file.events)
            + len(file.graph.segments)
            + len(counted(file)),
            counts=len(counted(file)),
            count=self._counts() or ["{0},"],
            **self._segments(places),
            samplers=len(file.sampled),
            change_names=", ".join(
                [text(f"event {event.name}") for event in file.events]
                + [text(f"sampler {sampler.name}") for sampler in file.sampled]
                or ["NULL"]
            ),
            every_names=", ".join(map(text, map(_every_name, file.sampled))) or "NULL",
            assignment=assigned or ["{0},"],
            assignments=len(assigned),
            discrete=", ".join(
                [f"offsetof(struct equations_values, {self.discrete[0]})"]
                + [f"{len(self.discrete)} * sizeof(double)"]
            )
            if self.discrete
            else "0, 0",
            periods=self._periods(),
            write_start=self._starts() if _has_starts(file) else [],
            starts=[".start = start,"] if _has_starts(file) else [],
            switches=self._switches(),
            starts_follow=[".starts_follow = true,"] if file.started else [],
            located=len(self.located) + len(self.limits),
            **c_contacts.parts(
                file,
                self.leaves,
                [*counted(file)],
                self._compare_limits(),
                c_gradients.along(file, self.leaves),
            ),
            next_time=NEXT_TIME if timed or file.sampled else [],
            timed=[".next_time = next_time,"] if timed or file.sampled else [],
            table=table or ["{0},"],
            nominal=", ".join(str(float(v.nominal or 1.0)) for v in states) or "1.0",
            **c_gradients.parts(self, in_domain),
            **c_possible.parts(self),
            indicators=searched.assign(indicators).lines(),
            **self._is_known(),
            compare=self._compare(),
            times=Code(self.leaves).assign(times).lines(),
            due=self._due(),
            changes=[
                line
                for i, change in enumerate([*file.events, *file.sampled])
                for line in self._change(i, change)
            ],
            **c_undefined.parts(file, self.leaves, in_domain),
            descriptions=c_indicators.describe(self),
            names=", ".join(
                [text(file.relation_texts[places[r.name]][:100]) for r in self.located]
                + [text(f"{limit.contact}.{limit.key}") for limit in self.limits]
                or ["NULL"]
            ),
        ).splitlines()

    def _is_known(self) -> dict[str, list[str]]:
        """Whether indicators that are not finite miss a solution: others may miss a branch."""
        if not (self.graph.systems or self.graph.linear):
            return {"is_solved": [], "unless_solved": []}
        return {
            "is_solved": ["bool is_solved = true;"],
            "unless_solved": [
                f"if (!is_solved && !relations_are_finite(indicator, {len(self.indicators())})) {{",
                "    return STATUS_NOT_FINITE;",
                "}",
            ],
        }

    def _circles(self) -> list[str]:
        """Members of struct relations about relations that follow from themselves."""
        are_circular = [*map(self.graph.is_circular, self.relations)]
        if not any(are_circular):
            return []
        names = (text(name[:100]) for name in self.file.relation_texts)
        truths = (str(is_circular).lower() for is_circular in are_circular)
        return [
            f".is_circular = (const bool[]){{{', '.join(truths)}}},",
            f".names = (const char *const[]){{{', '.join(names)}}},",
        ]

    def _ends(self) -> dict[str, list[str]]:
        """Which events end the simulation, and whether one has."""
        ends = [bool(event.terminate) for event in self.file.events]
        if not any(ends):
            return dict.fromkeys(("ends", "has_ended", "end"), [])
        lines = ["static bool has_ended(const void *values_pointer, double time, char *text,"]
        lines += ["                      size_t size) {"]
        lines += ["    const struct equations_values *values = values_pointer;"]
        for i, event in enumerate(self.file.events, 1):
            if event.terminate:
                code = Code(self.leaves)
                said = told(self.file, code, f"event {event.name}: {event.terminate}")
                code.statements.append(Statement(("(void)snprintf(text, size, ", *said, ");")))
                inner = [*code.lines(), "return true;"]
                block = [f"if (values->active[EVENTS] == {i}) {{", *indented(inner), "}"]
                lines += indented(block)
        truths = ", ".join(str(of).lower() for of in ends)
        return {
            "ends": [f".ends = (const bool[]){{{truths}}},"],
            "has_ended": [*lines, "    return false;", "}", ""],
            "end": [".has_ended = has_ended,"],
        }

    def _comparing(self) -> tuple[Code, Errors, dict[Value, Value]]:
        """Return code that compares, errors of its values, and what moves with its rates."""
        graph, states, inputs = self.graph, self.file.of("states"), self.file.of("inputs")
        moving = {("first", v.name): Place("given->du[", i, "]") for i, v in enumerate(inputs)}
        code = Code(self.leaves.but(moving, is_free="given->is_free"))
        motion = {x.leaf: x.value for x in states} | {graph.value("time"): graph.number(1.0)}
        motion |= {u.leaf: graph.value("first", name=u.name) for u in inputs}
        given: dict[tuple[str, str], Operand] = {
            ("state", x.name): Place("given->state_errors[", i, "]") for i, x in enumerate(states)
        }
        given["time", ""] = "given->time"
        for i, u in enumerate(inputs):
            value, rate = code.leaves["input", u.name], moving["first", u.name]
            size = "fmax", ("fabs", value), Place("given->largest[", i, "]")
            of_value, of_time = ("*", "given->inputs", size), ("*", "given->time", ("fabs", rate))
            given["input", u.name] = "+", of_value, of_time
        return code, Errors(graph, code, given), motion

    def _compare(self) -> list[str]:
        """Return statements that compare relations, of which parameters may leave some out."""
        whole = Code(self.leaves)
        for condition, places in self.read_by().items():
            items = self._compared(places)
            if condition is not None:
                none = {"distance": 0.0, "slope": 0.0, "noise": 1.0, "used": "0"}
                unused = [store(Place("compared[", k, f"].{key}"), of)
                          for k in places for key, of in none.items()]  # fmt: skip
                items = [Block(whole.of(condition), (items, unused))]
            whole.statements += items
        return whole.lines()

    def read_by(self) -> dict[Value | None, list[int]]:
        """Return relations by conditions of parameters without which nothing reads them."""
        found: dict[Value | None, list[int]] = {}
        for k, relation in enumerate(self.relations):
            found.setdefault(self._of_parameters(self.used[relation.name]), []).append(k)
        return found

    def _of_parameters(self, guard: Value | None) -> Value | None:
        """Return what parameters that have few values say about a condition; None: nothing."""
        if guard is None:
            return None
        names = {variable.name for variable in self.file.of(OPTIONS)}
        if guard.leaves and {name for _, name in guard.leaves} <= names:
            return guard
        if guard.op not in ("and", "or"):
            return None
        parts = [*map(self._of_parameters, guard.arguments)]
        if None in parts:
            return None if guard.op == "or" else next((x for x in parts if x is not None), None)
        return parts[0] if parts[0] is parts[1] else self.graph.value(guard.op, *parts)

    def _compared(self, places: Iterable[int]) -> list[Item]:
        code, errors, motion = self._comparing()
        stores = []
        for k, relation in ((k, self.relations[k]) for k in places):
            distance, used = relation.distance, self.used[relation.name]
            error = errors.of(distance) if relation.time is None else NONE
            (slope,) = self.graph.derivatives([distance], motion)
            found = {"distance": code.of(distance), "slope": code.of(slope), "noise": error}
            found["used"] = "1" if used is None else code.of(used)
            stores += [store(Place("compared[", k, f"].{key}"), of) for key, of in found.items()]
        return [*code.statements, *stores]

    def _compare_limits(self) -> list[str]:
        code, errors, motion = self._comparing()
        distances = [limit.distance(self.file.graph) for limit in self.limits]
        slopes = self.graph.derivatives(distances, motion)
        code.statements += c_contacts.compare(self.file, code, errors, slopes)
        return code.lines()

    def _due(self) -> list[str]:
        """Return whether each event of the file is due."""
        code = Code(self.leaves)
        found = enumerate(self.dues(code))
        code.statements += [store(Place("due[", i, "]"), due) for i, due in found]
        return code.lines()

    def dues(self, code: Code) -> list[Operand]:
        """Return the operand of each event's condition."""
        found = []
        for event in self.file.events:
            due = code.of(event.when.value)
            if event.during is not None:
                due = "and", due, code.of(event.during.value)
            found.append(due)
        return found

    def _segments(self, places: Mapping[str, int]) -> dict[str, object]:
        segments, code = self.graph.segments.values(), Code(self.leaves)
        table = []
        for i, s in enumerate(segments):
            at = located(code, s.bounds, code.of(s.argument))
            code.statements.append(store(Place("number[", i, "]"), at))
            bounds = (s.first, s.first + s.count - 1, int(self.graph.is_of_inputs(s.low.distance)))
            row = (places[s.low.name], places[s.high.name], *bounds)
            table.append(f"{{{', '.join(map(str, row))}}},")
        return {"segments": len(segments), "segment": table or ["{0},"], "locate": code.lines()}

    def _rows_of_assignments(self) -> list[str]:
        """Rows of struct assignment."""
        counts = counted(self.file)
        found = [(-1, v.name, v.initial) for v in self.file.started if v.is_real]
        for i, change in enumerate([*self.file.events, *self.file.sampled]):
            found += [(i, n, e) for n, e in change.assigned.items() if n not in counts]
        return [
            f"{{{i}, offsetof(struct equations_values, {self.file.fields.value(name)}), "
            f"{shortened(f'{name} = ', expression, self.file.tables)}}},"
            for i, name, expression in found
        ]

    def _switches(self) -> list[str]:
        fields = [self.file.fields.count(v.name) for v in self.file.of(SWITCHES)]
        if not fields:
            return []
        begin = f"offsetof(struct equations_values, {fields[0]})"
        return [f".discrete_inputs = {{{begin}, {len(fields)} * sizeof(int)}},"]

    def _starts(self) -> list[str]:
        new = {v.name: v.initial.value for v in self.file.started}
        counts, code = counted(self.file).items(), Code(self.leaves)
        code.statements += [
            *(store(field_of("values", self.file.fields.count(n)), k) for n, (_, k) in counts),
            *self._assigned(code, new, is_single=len(new) == 1),
        ]
        return [
            "static void start(void *values_pointer) {",
            "    struct equations_values *values = values_pointer;",
            *indented(code.lines()),
            "}",
            "",
        ]

    def _periods(self) -> list[str]:
        code = Code(self.leaves)
        for i, sampler in enumerate(self.file.sampled):
            every, offset = Place("every[", i, "]"), Place("offset[", i, "]")
            code.assign({every: sampler.every.value, offset: sampler.offset.value})
        return code.lines()

    def _change(self, index: int, change: Change) -> list[str]:
        """What an event or a sampler of the file does."""
        moving = c_gradients.shifts(self.file)
        code = Code(self.leaves.but({("later", ""): "later", **moving}))
        is_single = len(change.assigned) + len(change.reinit) == 1
        new = {name: e.value for name, e in change.assigned.items()}
        stores = self._assigned(code, new, is_single)
        errors = Errors(self.graph, code, self.tolerances)
        jumped = {name: errors.of(e.value) for name, e in change.reinit.items()}
        for name, error in jumped.items():
            of = error if error == NONE else code.constant(error, is_kept=True)
            stores.append(store(self.tolerances["state", name], of))
        if isinstance(change, Sampler) and change.during is not None:
            stores = [Block(code.of(change.during.value), (stores,))]
        code.statements += stores
        return [f"if (event == {index}) {{", *indented(code.lines()), "}"]

    def _assigned(self, code: Code, new: Mapping[str, Value], is_single: bool) -> list[Statement]:
        """Statements that give variables and modes the new values, which the code calculates.

        is_single: no other statement changes what these values follow from.
        """
        counts, stores = counted(self.file), []
        for name, value in new.items():
            if name in counts:
                of, c_type = count(code, counts[name][0], value), "int"
                field = self.file.fields.count(name)
            else:
                of, c_type, field = code.of(value), "double", self.file.fields.value(name)
            found = code.constant(of, c_type, f"new_{name}", not is_single)
            stores.append(store(field_of("values", field, name), found))
        return stores

    def _counts(self) -> list[str]:
        """Rows of struct count: name, smallest and largest value."""
        rows = []
        for name, (kind, _) in counted(self.file).items():
            is_item = isinstance(kind, tuple)
            bounds = "-INT_MAX, INT_MAX"
            if is_item or kind == CONDITION:
                bounds = f"1, {len(kind)}" if is_item else "0, 1"
            rows.append(f"{{{text(name)}, {bounds}}},")
        return rows


def _every_name(sampler: Sampler) -> str:
    """Name of a period in messages, with the parameter that it is."""
    every = sampler.every
    of = f" = {every.tree.name}" if every.tree.op == "name" else ""
    return f"sampler {sampler.name}: every{of}"


def count(code: Code, kind: Kind, value: Value) -> Operand:
    """The int of a condition, whole number or item of an enumeration."""
    found = code.of(value)
    if isinstance(found, Place) and found.before.startswith("(double)"):
        return replace(found, before=found.before.removeprefix("(double)"), c_type="int")
    if kind != CONDITION:
        return "relations_whole", found
    return found if value.op in CONDITIONS and value.op != "mode" else ("!=", found, "0")


def _guards(graph: Graph, roots: Iterable[tuple[Value, Value | None]]) -> Guards:
    """Return for each mode the condition under which it is read; roots: values and conditions."""
    found: Guards = {}
    modes: dict[Value, list[Value]] = {}  # by the distance that they follow from
    for relation in graph.relations.values():
        modes.setdefault(relation.distance, []).append(relation.mode)
    for segment in graph.segments.values():
        modes.setdefault(segment.argument, []).append(segment.leaf)
    circular = [relation for relation in graph.relations.values() if graph.is_circular(relation)]
    for value, guard in [*roots, *((relation.distance, None) for relation in circular)]:
        _widen(graph, found, value, guard)
    for value in reversed(in_order([*modes, *found])):  # each before what it reads
        for mode in modes.get(value, []):
            if mode in found:
                _widen(graph, found, value, found[mode])
        if value not in found:
            continue
        conditions = [found[value]] * len(value.arguments)
        if value.op == "if" and not is_unknown(value):
            condition = value.arguments[0]
            for i, chosen in enumerate((condition, graph.value("not", condition)), 1):
                own = found[value]
                conditions[i] = _both(graph, own, chosen)
        if value.op in ("and", "or"):  # the second one decides where the first one does not
            first = value.arguments[0]
            open_ = first if value.op == "and" else graph.value("not", first)
            conditions[1] = _both(graph, found[value], open_)
        for argument, guard in zip(value.arguments, conditions, strict=True):
            _widen(graph, found, argument, guard)
    return {value: guard for value, guard in found.items() if value.op in ("mode", "integer")}


def _both(graph: Graph, guard: Value | None, condition: Value) -> Value:
    return condition if guard is None else graph.value("and", guard, condition)


def _widen(graph: Graph, found: Guards, value: Value, guard: Value | None) -> None:
    """Let a value matter under this condition, too."""
    if value not in found:
        found[value] = guard
    elif found[value] is not None and found[value] is not guard:
        found[value] = None if guard is None else graph.value("or", found[value], guard)
