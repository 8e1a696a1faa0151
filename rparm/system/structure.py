"""A system of connected FMUs: components, connections, and the variants of its parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rparm.fmi.model import Value

ALONE = "default"  # the variant of a system that has no parameter sets


@dataclass(frozen=True)
class Connector:
    """A variable of a component that the system sees."""

    name: str
    kind: str  # input, output, parameter or calculatedParameter
    type: str | None  # Real, Integer, Boolean, String or Enumeration; None: the variable's
    unit: str | None  # None: the variable's


@dataclass(frozen=True)
class Component:
    """One FMU in the system."""

    name: str
    source: str  # path of the FMU inside the SSP
    connectors: dict[str, Connector]  # by name, in the order of the file


@dataclass(frozen=True)
class Connection:
    """An output that feeds an input."""

    start_component: str
    start_connector: str
    end_component: str
    end_connector: str

    def __str__(self) -> str:
        return (
            f"{self.start_component}.{self.start_connector} -> "
            f"{self.end_component}.{self.end_connector}"
        )


@dataclass(frozen=True)
class Parameter:
    """A value that a parameter set gives to a variable."""

    type: str  # Real, Integer, Boolean or String
    value: Value
    unit: str | None


@dataclass(frozen=True)
class System:
    """Structure of a system, and the variants of its parameters."""

    name: str
    components: tuple[Component, ...]  # in the order of the file
    connections: tuple[Connection, ...]
    start: float  # s
    stop: float  # s
    step: float  # s, communication step
    # variant -> component -> variable; a component without a binding has no values, and without
    # parameter sets ALONE is the only variant
    parameters: dict[str, dict[str, dict[str, Parameter]]]
    descriptions: Mapping[str, str] = field(default_factory=dict)  # of variants that have one
    notes: tuple[str, ...] = ()  # what was chosen where the SSP says nothing

    @property
    def parameter_sets(self) -> dict[str, dict[str, dict[str, Value]]]:
        """Only the values: variant -> component -> variable -> value, variants in file order."""
        return {
            variant: {
                component: {name: parameter.value for name, parameter in values.items()}
                for component, values in components.items()
            }
            for variant, components in self.parameters.items()
        }

    @property
    def steps(self) -> int:
        return round((self.stop - self.start) / self.step)

    @property
    def times(self) -> np.ndarray:
        """Communication points, (steps + 1,) s."""
        return self.start + self.step * np.arange(self.steps + 1)

    @property
    def has_sets(self) -> bool:
        """Whether its variants are parameter sets."""
        return any(self.parameters.values())

    def component(self, name: str) -> Component:
        return next(component for component in self.components if component.name == name)
