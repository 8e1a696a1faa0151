"""The events of a model in C (src/model/events.h).

Each relation has a mode: whether it holds. Its indicator is its distance with the sign of that
mode, and 1 while no value that is needed reads it. An event of the file fires when its relation
comes to hold in its modes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from equations.c_code import calculated, text
from equations.c_events_text import BANDS, FIRE, UPDATE
from equations.graph import MOVING, Relation, Value
from equations.guards import guards
from equations.model_file import EventValues, ModelFile

MOST_FIRINGS = 1000  # at one instant
FIELD = "v_{}"
MODE = "m_{}"
INDICATOR = "z_{}"
CONST = "const struct equations_values *values = values_pointer;"


@dataclass(frozen=True)
class Switch:
    """A relation with its place in C."""

    name: str
    relation: Relation
    holds: Value  # its mode
    used: Value | None  # condition under which it matters; None: always

    @property
    def is_timed(self) -> bool:
        """Whether its time is known before."""
        return self.relation.time is not None

    @property
    def is_of_inputs(self) -> bool:
        """It follows from inputs and parameters only."""
        return not {op for op, _ in self.relation.distance.leaves} & {"state", "time", "mode"}

    @property
    def rises(self) -> bool:
        """Of a timed one: it holds after its time."""
        return self.relation.distance.arguments[0].op == "time"


class Events:
    """All relations of a file with their indicators, and the functions of struct model_events."""

    def __init__(self, file: ModelFile) -> None:
        self.file, self.graph = file, file.graph
        graph = file.graph
        calculated_values = [v.value for v in file.of("states", "where", "outputs")]
        distances = [relation.distance for relation in graph.relations.values()]
        conditions = [event.during for event in file.events if event.during is not None]
        used = guards(graph, [*calculated_values, *distances, *conditions])
        for event in file.events:
            guard = used.get(event.when, event.during)
            if guard is not event.during and guard is not None:
                guard = graph.value("or", guard, event.during) if event.during else None
            used[event.when] = guard
        self.switches = [
            Switch(name, relation, mode, used.get(mode, graph.number(0.0)))
            for name, relation in graph.relations.items()
            for mode in [graph.value("mode", name=name)]
        ]
        self.located = [switch for switch in self.switches if not switch.is_timed]
        self.timed = [switch for switch in self.switches if switch.is_timed]

    def __bool__(self) -> bool:
        return bool(self.switches)

    def indicators(self) -> dict[str, Value]:
        """Indicators by their fields."""
        return {INDICATOR.format(s.name): self._indicator(s) for s in self.located}

    def _indicator(self, switch: Switch) -> Value:
        """A signed distance, or 1."""
        graph = self.graph
        signed = self.signed(switch)
        if switch.used is None:
            return signed
        return graph.value("if", switch.used, signed, graph.number(1.0))

    def signed(self, switch: Switch) -> Value:
        """The distance, with the sign of the mode."""
        distance = switch.relation.distance
        opposite = self.graph.value("negative", distance)
        return self.graph.value("if", switch.holds, distance, opposite)

    def mode(self, name: str) -> str:
        """How C reads a mode."""
        names = list(self.graph.relations)
        place = f"relations[{names.index(name)}]" if name in names else MODE.format(name)
        return f"values->{place}"

    def fields(self) -> list[str]:
        """Fields of the value structure: ints without gaps."""
        if not self:
            return []
        active = [f"int active[{len(self.file.events)}];"] if self.file.events else []
        own = [f"int {MODE.format(mode)};" for mode in self.file.modes]
        return ["int is_begun;", f"int relations[{len(self.switches)}];", *active, *own]

    # ---- Functions -----------------------------------------------------------------------------

    def _leaf(self, value: Value) -> str:
        if value.op == "mode":
            return self.mode(value.name)
        return "t" if value.op == "time" else f"values->{FIELD.format(value.name)}"

    def decisions(self) -> list[str]:
        """Text of what outputs needs before the first event: begin."""
        switches = self.switches
        states = self.file.of("states")
        nominal = ", ".join(str(float(v.nominal or 1.0)) for v in states) or "1.0"
        # at its time a timed one is past
        zeros = _flags(s.rises if s.is_timed else s.relation.includes_zero for s in switches)
        indicators = {switch: i for i, switch in enumerate(self.located)}
        places = ", ".join(str(indicators.get(switch, 0)) for switch in switches)
        return [
            f"enum {{ RELATIONS = {len(switches)}, STATES = {len(self.file.of('states'))}, "
            f"MOST_FIRINGS = {MOST_FIRINGS} }};",
            f"static const int includes_zero[RELATIONS] = {{{zeros}}};",
            f"static const int is_timed[RELATIONS] = {{{_flags(s.is_timed for s in switches)}}};",
            f"static const int rises[RELATIONS] = "
            f"{{{_flags(s.is_timed and s.rises for s in switches)}}};",
            f"static const int of_inputs[RELATIONS] = "
            f"{{{_flags(s.is_of_inputs for s in switches)}}};",
            f"enum {{ HAS_INPUTS = {int(any(s.is_of_inputs for s in switches))} }};",
            f"static const size_t indicator_of[RELATIONS] = {{{places}}};",
            "",
            "/* Of a state's size: how far from its limit it may be where its event is located. */",
            "static const double location_error = 1e-11;",
            f"static const double nominal[STATES + 1] = {{{nominal}}};",
            "",
            "struct compared {",
            "    double distance[RELATIONS]; /* above 0 where it holds */",
            "    double slope[RELATIONS];    /* 1/s: of the distance, while inputs rest */",
            "    double noise[RELATIONS];    /* of the distance, from the error of the states */",
            "    int used[RELATIONS];        /* by a value that is needed */",
            "};",
            "",
            "static int holds_at(int k, double distance) {",
            "    return includes_zero[k] ? distance >= 0.0 : distance > 0.0;",
            "}",
            "",
            *self._compare(),
            "",
            *BANDS.splitlines(),
        ]

    def _compare(self) -> list[str]:
        graph, states = self.graph, self.file.of("states")
        one = graph.number(1.0)
        slopes = {
            (switch.name, i): graph.derivative(
                switch.relation.distance, {graph.value("state", name=state.name): one}
            )
            for switch in self.located
            for i, state in enumerate(states)
            if ("state", state.name) in switch.relation.distance.leaves
        }
        rates = {
            switch.name: graph.derivative(switch.relation.distance, {graph.value("time"): one})
            for switch in self.located
            if ("time", "") in switch.relation.distance.leaves
        }
        seeds = {graph.value("state", name=state.name): state.value for state in states}
        motion = {
            switch.name: graph.derivative(
                switch.relation.distance, seeds | {graph.value("time"): one}
            )
            for switch in self.switches
        }
        conditions = [switch.used for switch in self.switches if switch.used is not None]
        distances = [switch.relation.distance for switch in self.switches]
        roots = [*distances, *motion.values(), *slopes.values(), *rates.values(), *conditions]
        lines, at = calculated(roots, self._leaf)
        for k, switch in enumerate(self.switches):
            terms = [
                f"fabs({at[slope]}) * tolerance[{i}]"
                for (name, i), slope in slopes.items()
                if name == switch.name
            ]
            if switch.name in rates:
                terms.append(f"1e-12 * fabs({at[rates[switch.name]]}) * fmax(1.0, fabs(t))")
            used = "1" if switch.used is None else f"{at[switch.used]} != 0"
            lines += [
                f"compared->distance[{k}] = {at[switch.relation.distance]};",
                f"compared->slope[{k}] = {at[motion[switch.name]]};",
                f"compared->noise[{k}] = {' + '.join(terms) or '0.0'};",
                f"compared->used[{k}] = {used};",
            ]
        head = (
            "static void compare(const struct equations_values *values, double t, "
            "const double tolerance[], struct compared *compared) {"
        )
        return [head, *(f"    {line}" for line in lines), "}"]

    def functions(self) -> list[str]:
        """Text of the other functions, and of the struct model_events."""
        timed, located = bool(self.timed), bool(self.located)
        states = self.file.of("states")
        has_states = bool(states)
        first = "0.0"
        if has_states:
            place = f"offsetof(struct equations_values, {FIELD.format(states[0].name)})"
            first = f"((const double *)((const char *)values + {place}))[i]"
        names = ", ".join(text(f"indicator {s.name}") for s in self.located)
        ints = 1 + len(self.switches) + len(self.file.events) + len(self.file.modes)
        members = [
            f".indicator_count = {len(self.located)},",
            *([".indicator_names = indicator_names,"] if located else []),
            f".modes = {{offsetof(struct equations_values, is_begun), {ints} * sizeof(int)}},",
            *([".next_time = next_time,"] if timed else []),
            *([".are_possible = are_possible,"] if located else []),
            ".modes_are_possible = modes_are_possible,",
            *([".is_at_rest = is_at_rest,"] if has_states else []),
            *([".describe = describe,", ".indicators = indicators,"] if located else []),
            ".update = update,",
        ]
        rest = ["static bool is_at_rest(const void *values) {", "    return false;", "}", ""]
        possible = ["static bool are_possible(const void *values) {", "    return true;", "}", ""]
        return [
            *self._times(),
            "",
            *self._fire(),
            "",
            *UPDATE.replace("STATE_I", first).splitlines(),
            "",
            "static bool modes_are_possible(const void *values_pointer, bool is_held) {",
            f"    {CONST}",
            "    const size_t first = offsetof(struct equations_values, is_begun);",
            "    const int *mode = (const int *)((const char *)values + first);",
            "    bool are_fine = values->is_begun == 1;",
            f"    for (int i = 0; i < {ints}; i++) {{",
            "        are_fine = are_fine && (mode[i] == 0 || mode[i] == 1);",
            "    }",
            "    return are_fine;",
            "}",
            "",
            *(rest if has_states else []),
            *(possible if located else []),
            *([*self._describe(), ""] if located else []),
            *(
                [f"static const char *const indicator_names[] = {{{names}}};", ""]
                if located
                else []
            ),
            "static const struct model_events events = {",
            *(f"    {member}" for member in members),
            "};",
        ]

    def _times(self) -> list[str]:
        """Times of the timed relations; next_time: of the first that is not past."""
        lines, at = calculated([s.relation.time for s in self.timed], self._leaf)
        writes = [
            f"times[{k}] = {at[s.relation.time] if s.is_timed else 'INFINITY'};"
            for k, s in enumerate(self.switches)
        ]
        return [
            "static void write_times(const struct equations_values *values, double times[]) {",
            "    (void)values;",
            *(f"    {line}" for line in [*lines, *writes]),
            "}",
            "",
            "static double next_time(const void *values_pointer) {",
            f"    {CONST}",
            "    double next = INFINITY;",
            "    double times[RELATIONS];",
            "    write_times(values, times);",
            "    for (int k = 0; k < RELATIONS && values->is_begun; k++) {",
            "        const bool is_ahead = is_timed[k] && values->relations[k] != rises[k];",
            "        next = is_ahead ? fmin(next, times[k]) : next;",
            "    }",
            "    return next;",
            "}",
        ]

    def _fire(self) -> list[str]:
        """Whether an event of the file is due, and what it changes."""
        events = self.file.events
        if not events:
            arguments = "struct equations_values *values, double t, double tolerance[]"
            return [f"static bool fire({arguments}) {{", "    return false;", "}"]
        due = [
            condition
            for event in events
            for condition in (event.when, event.during)
            if condition is not None
        ]
        lines, at = calculated(due, self._leaf)
        for index, event in enumerate(events):
            during = "" if event.during is None else f" && {at[event.during]}"
            lines.append(f"due[{index}] = {at[event.when]}{during};")
        cases = [
            line
            for index, event in enumerate(events)
            for line in (f"if (event == {index}) {{", *self._change(event), "}")
        ]
        return [
            f"enum {{ EVENTS = {len(events)} }};",
            "",
            "static void find_due(const struct equations_values *values, double t, int due[]) {",
            *(f"    {line}" for line in lines),
            "}",
            "",
            "static void change(struct equations_values *values, double t, int event, "
            "double tolerance[]) {",
            *(f"    {line}" for line in cases),
            "}",
            "",
            *FIRE.splitlines(),
        ]

    def _change(self, event: EventValues) -> list[str]:
        """Statements of an event: right sides see the values before it."""
        states = [state.name for state in self.file.of("states")]
        lines, at = calculated([*event.reinit.values(), *event.set.values()], self._leaf)
        lines += [f"const double new_{name} = {at[value]};" for name, value in event.reinit.items()]
        lines += [f"const int new_{name} = {at[value]} != 0;" for name, value in event.set.items()]
        lines += [f"values->{FIELD.format(name)} = new_{name};" for name in event.reinit]
        # what has jumped is near no root
        lines += [f"tolerance[{states.index(name)}] = 0.0;" for name in event.reinit]
        lines += [f"values->{MODE.format(name)} = new_{name};" for name in event.set]
        return [f"    {line}" for line in lines]

    def _describe(self) -> list[str]:
        lines = []
        for index, switch in enumerate(self.located):
            lines += ["{", *(f"    {line}" for line in self._describe_one(index, switch)), "}"]
        return [
            "static void describe(const void *values_pointer, struct indicator indicators[]) {",
            f"    {CONST}",
            "    (void)values;",
            *(f"    {line}" for line in lines),
            "}",
        ]

    def _describe_one(self, index: int, switch: Switch) -> list[str]:
        """Says whether the indicator is used, and how it follows from the states."""
        graph, one, zero = self.graph, self.graph.number(1.0), self.graph.number(0.0)
        used = one if switch.used is None else switch.used
        distance, limit = switch.relation.distance, switch.relation.limit or zero
        moving = [graph.value(op, name=name) for op, name in distance.leaves if op in MOVING]
        state = moving[0] if len(moving) == 1 and moving[0].op == "state" else None
        factor = zero if state is None else graph.derivative(distance, {state: one})
        if state is None or factor.moves:
            lines, at = calculated([used, limit], self._leaf)
            kind = f".kind = INDICATOR_OF_MODEL, .offset = fabs({at[limit]})"
        else:
            rate = self.file.variables[state.name].value
            rate = zero if ("time", "") in rate.leaves else rate  # the time is unknown here
            lines, at = calculated([used, factor, rate], self._leaf)
            rest, at_zero = calculated([distance], lambda v: "0.0" if v is state else self._leaf(v))
            index_of_state = [v.name for v in self.file.of("states")].index(state.name)
            lines += [
                f"const double sign = {self.mode(switch.name)} ? 1.0 : -1.0;",
                "double offset = 0.0;",
                "{",
                *(f"    {line}" for line in rest),
                f"    offset = sign * ({at_zero[distance]});",
                "}",
            ]
            kind = (
                f".kind = INDICATOR_OF_STATE, .state = {index_of_state}, "
                f".factor = sign * {at[factor]}, .offset = offset, "
                f".rises = sign * {at[factor]} * {at[rate]} > 0.0"
            )
        return [
            *lines,
            f"indicators[{index}] = (struct indicator){{.kind = INDICATOR_UNUSED}};",
            f"if ({at[used]} != 0) {{",
            f"    indicators[{index}] = (struct indicator){{{kind}}};",
            "}",
        ]


def _flags(values: Iterable[bool]) -> str:
    return ", ".join(str(int(value)) for value in values)
