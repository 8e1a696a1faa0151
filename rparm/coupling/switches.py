"""Connections between Booleans: an input follows its source at communication points."""

from collections.abc import Iterable, Mapping

from rparm.errors import UserError
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.system.structure import Connection


class Switches:
    """The connections of a system that lead from Boolean outputs to Boolean inputs."""

    def __init__(
        self, instances: Mapping[str, Instance], connections: Iterable[Connection]
    ) -> None:
        self._instances = instances
        self._connections = list(connections)

    def transfer(self) -> list[str]:
        """Set the inputs whose sources have another value; which these are."""
        changed = []
        for c in self._connections:
            source, target = self._instances[c.start_component], self._instances[c.end_component]
            value = source.boolean(c.start_connector)
            if value != target.boolean(c.end_connector):
                target.set(c.end_connector, value)
                changed.append(f"{c.end_component}.{c.end_connector}")
        return changed


def split(
    fmus: Mapping[str, Fmu], connections: Iterable[Connection]
) -> tuple[list[Connection], list[Connection]]:
    """Connections that begin at a Boolean output, and the others.

    UserError if one of the first does not end at a Boolean input, or two end at the same one.
    """
    switches: list[Connection] = []
    others: list[Connection] = []
    for connection in connections:
        is_switch = _is(fmus, connection.start_component, connection.start_connector, "output")
        (switches if is_switch else others).append(connection)
    seen = set()
    for connection in switches:
        end = connection.end_component, connection.end_connector
        if not _is(fmus, *end, "input"):
            raise UserError(f"{connection}: a Boolean feeds a Boolean input only")
        if end in seen:
            raise UserError(f"{'.'.join(end)}: is connected more than once")
        seen.add(end)
    return switches, others


def _is(fmus: Mapping[str, Fmu], component: str, name: str, causality: str) -> bool:
    variable = fmus[component].model.variables.get(name) if component in fmus else None
    return variable is not None and (variable.type, variable.causality) == ("Boolean", causality)
