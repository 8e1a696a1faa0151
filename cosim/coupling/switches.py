"""Connections between Booleans: an input follows its source at communication points."""

from collections.abc import Iterable, Mapping

from cosim.errors import UserError
from cosim.fmi_instance import Instance
from cosim.fmu_file import Fmu
from cosim.system.structure import Connection


class Switches:
    """The connections of a system that lead from a Boolean output to a Boolean input.

    Parameters
    ----------
    instances : mapping of str to Instance
        By name of the component.
    connections : iterable of Connection
        Those of `are_switches`.
    """

    def __init__(
        self, instances: Mapping[str, Instance], connections: Iterable[Connection]
    ) -> None:
        self._ends = [
            (instances[c.start_component], c.start_connector, instances[c.end_component])
            + (c.end_connector,)
            for c in connections
        ]

    def transfer(self) -> bool:
        """Set the inputs whose sources have another value; whether there are any."""
        changed = False
        for source, output, target, name in self._ends:
            value = source.boolean(output)
            if value != target.boolean(name):
                target.set(name, value)
                changed = True
        return changed


def is_switch(fmus: Mapping[str, Fmu], connection: Connection) -> bool:
    """Whether a connection begins at a Boolean output.

    Raises
    ------
    UserError
        If it does, and does not end at a Boolean input.
    """
    if not _is(fmus, connection.start_component, connection.start_connector, "output"):
        return False
    if not _is(fmus, connection.end_component, connection.end_connector, "input"):
        raise UserError(f"{connection}: a Boolean feeds a Boolean input only")
    return True


def _is(fmus: Mapping[str, Fmu], component: str, name: str, causality: str) -> bool:
    variable = fmus[component].model.variables.get(name) if component in fmus else None
    return variable is not None and (variable.type, variable.causality) == ("Boolean", causality)
