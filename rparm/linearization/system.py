"""A system of connected FMUs to linearize."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace

from rparm.errors import UserError, hint
from rparm.files import UnreadableError
from rparm.fmi.fmu_file import MODEL_EXCHANGE, Fmu
from rparm.fmi.model import Value, Variable
from rparm.linearization.connections import connected
from rparm.linearization.derivatives import (
    SAMPLED,
    known_variable,
    linear_model,
    next_event,
    require_derivatives,
)
from rparm.linearization.linear import Linear
from rparm.linearization.modes import held_states, is_sampled
from rparm.systems.master import INPUT_MODES, ORDERS, Master
from rparm.systems.ssp import Connection, Ssp


class SystemSubject(ExitStack):
    """A variant of a system to linearize; a context manager, which keeps its FMUs unpacked.

    Names are "component.variable".

    Parameters
    ----------
    ssp : Ssp
        Unpacked as long as this.
    variant : str
        Of its parameter sets.
    time : float, optional
        s; default: the start of the system.
    without : sequence of str
        Components that are left out: what they feed is fed by outputs of the same names, of what
        feeds them. So sensors become ideal.
    cut : str
        An input whose connection is left out.
    """

    def __init__(
        self,
        ssp: Ssp,
        variant: str,
        time: float | None = None,
        without: Sequence[str] = (),
        cut: str = "",
    ) -> None:
        super().__init__()
        system = ssp.system
        if variant not in system.parameters:
            raise UserError(f"{ssp.path}: no variant {variant!r}{hint(variant, system.parameters)}")
        names = [component.name for component in system.components]
        for name in without:
            if name not in names:
                raise UserError(f"{ssp.path}: no component {name!r}{hint(name, names)}")
        self.ssp, self.without = ssp, without
        self.time = system.start if time is None else time
        self.names = [name for name in names if name not in without]
        self.connections = list(system.connections)
        for name in without:
            self.connections = bypassed(ssp, self.connections, name)
        self.cut = self._found(cut) if cut else None
        self._parameters = system.parameter_sets[variant]
        with ExitStack() as stack:  # closes what is open if one of them is refused
            self.fmus = {name: stack.enter_context(ssp.unpacked_fmu(name)) for name in self.names}
            for fmu in self.fmus.values():
                require_derivatives(fmu)
            self.push(stack.pop_all())

    def _found(self, name: str) -> Connection:
        """The connection to an input."""
        ends = {f"{c.end_component}.{c.end_connector}": c for c in self.connections}
        if name not in ends:
            raise UserError(f"--break: {name}: no connection ends there{hint(name, ends)}")
        return ends[name]

    def variable(self, name: str) -> Variable:
        """What is declared of ``component.variable``; UserError if there is none of that name."""
        component, dot, variable = name.partition(".")
        if not dot or component not in self.names:
            where = f"{self.ssp.path}: {name}: expected COMPONENT.VARIABLE"
            raise UserError(f"{where}{hint(component, self.names, 'components')}")
        where = f"{self.ssp.path}: component {component!r}"
        return known_variable(self.ssp.models[component], variable, where)

    def parts(self, values: Mapping[str, Value]) -> dict[str, Linear]:
        """The linear model of each component, without held states, by its name.

        UserError if one is sampled, or if the connections form an algebraic loop.
        """
        parameters = self.merged(values)
        found = {}
        with Master(self.fmus, self.connections) as master:
            master.initialize(self.time, None, parameters)
            for name, component in master.components.items():
                part = linear_model(component.instance)
                self._refuse_sampled(name, part, parameters.get(name, {}))
                found[name] = part
        return found

    def at(self, values: Mapping[str, Value]) -> Linear:
        """The linear model where parameters and states have these values, held states included.

        All loops are closed, also the one that is to be broken: the point is that of the system.
        """
        return connected(self.parts(values), self.connections)

    @property
    def kept(self) -> list[Connection]:
        """The connections but the one that is cut."""
        return [c for c in self.connections if c != self.cut]

    @property
    def ways(self) -> list[tuple[str, str]]:
        """Orders and inputs in which a master can step the system."""
        models = {name: fmu.model for name, fmu in self.fmus.items()}
        can = all(
            models[c.start_component].gives_output_derivatives
            and models[c.end_component].interpolates_inputs
            for c in self.connections
            if self._is_real(c.start_component, c.start_connector)
        )
        return [
            (order, inputs)
            for inputs in (INPUT_MODES if can else INPUT_MODES[:1])
            for order in ORDERS
        ]

    def held(self, parts: Mapping[str, Linear]) -> dict[str, list[str]]:
        """Held states by component."""
        return {name: held_states(part, self.ssp.models[name]) for name, part in parts.items()}

    def merged(self, values: Mapping[str, Value]) -> dict[str, dict[str, Value]]:
        """All that is set, by component."""
        merged = {name: dict(self._parameters.get(name, {})) for name in self.names}
        for name, value in values.items():
            component, _, variable = name.partition(".")
            fed = {f"{c.end_component}.{c.end_connector}" for c in self.connections}
            if name in fed and self.variable(name).type == "Real":
                raise UserError(f"{name}: is fed by a connection, which says its value")
            merged[component][variable] = value
        return merged

    def _refuse_sampled(self, name: str, part: Linear, values: Mapping[str, Value]) -> None:
        feeding = [c.start_connector for c in self.connections if c.start_component == name]
        outputs = [output for output in feeding if self._is_real(name, output)]

        def announced() -> float | None:
            return _next_event(self.ssp, name, values, self.time)

        if is_sampled(part, self.ssp.models[name], outputs, announced):
            raise UserError(f"{self.ssp.path}: component {name!r} {SAMPLED}{self._way_out(name)}")

    def _way_out(self, name: str) -> str:
        try:
            bypassed(self.ssp, self.connections, name)
        except UserError:
            return ""
        return f", or take it as ideal by --without {name}"

    def _is_real(self, component: str, output: str) -> bool:
        return self.ssp.models[component].variables[output].type == "Real"


def bypassed(ssp: Ssp, connections: Sequence[Connection], name: str) -> list[Connection]:
    """Connections without a component: what it fed is fed by what fed it, by the same names."""
    sources = dict.fromkeys(c.start_component for c in connections if c.end_component == name)
    result = []
    for c in connections:
        if c.start_component == name:
            found = [s for s in sources if c.end_connector in ssp.models[s].real_outputs]
            if len(found) != 1:
                what = f"{c.end_component}.{c.end_connector}"
                raise UserError(
                    f"--without {name}: {what} has nothing to be fed by: expected one component "
                    f"that feeds {name} and has a Real output {c.end_connector!r}"
                )
            result.append(replace(c, start_component=found[0], start_connector=c.end_connector))
        elif c.end_component != name:
            result.append(c)
    return result


def _next_event(ssp: Ssp, name: str, values: Mapping[str, Value], time: float) -> float | None:
    """Time of the first time event of a component, if its FMU is for model exchange, too."""
    try:
        fmu = Fmu(ssp.fmu(name), kind=MODEL_EXCHANGE)
    except (UserError, UnreadableError):
        return None
    with fmu, fmu.instance(name) as instance:
        instance.set_up(time, None)
        for variable, value in values.items():
            instance.set(variable, value)
        instance.enter_initialization()
        instance.exit_initialization()
        return next_event(instance)
