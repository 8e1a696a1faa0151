"""What each process of a federation does: its component, and where its inputs come from."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rparm.errors import UserError, hint
from rparm.fmi.model import Value
from rparm.systems.ssp import Connection, Ssp


@dataclass(frozen=True)
class Source:
    """Where an input comes from: value `index` of what the component `component` publishes."""

    component: str
    index: int


@dataclass(frozen=True)
class Part:
    """A component of a system, as one process steps it."""

    component: str
    parameters: dict[str, Value]
    published: tuple[str, ...]  # Real outputs, in the order of the FMU
    inputs: tuple[str, ...]  # connected Real inputs
    sources: tuple[Source, ...]  # of each of `inputs`
    constant: tuple[str, ...]  # outputs that feed an input which is no Real: they must not change
    rounds: int  # exchanges in initialization after which no output changes any more
    times: np.ndarray  # s, communication points
    system: str  # variant and SHA-256 of the SSP: those of all processes must be the same

    def check_same(self, other: str) -> None:
        """UserError if the federation steps another variant, or that of another SSP."""
        if other == self.system:
            return
        (here, own), (there, foreign) = self.system.rsplit(" ", 1), other.rsplit(" ", 1)
        if here != there:
            raise UserError(
                f"{self.component}: its variant is {here!r}, that of the federation is {there!r}"
            )
        raise UserError(
            f"{self.component}: its SSP is not that of the federation (SHA-256 {own[:12]}..., "
            f"expected {foreign[:12]}...): copy the file"
        )


def parts(ssp: Ssp, variant: str) -> dict[str, Part]:
    """The parts of a variant, by component; UserError if it is unknown."""
    system = ssp.system
    if variant not in system.parameters:
        known = hint(variant, system.parameters, "there are")
        raise UserError(f"{ssp.path}: has no variant {variant!r}{known}")
    published = {name: model.real_outputs for name, model in ssp.models.items()}
    whole = f"{variant} {hashlib.sha256(ssp.path.read_bytes()).hexdigest()}"
    made = {}
    for component in system.components:
        name = component.name
        incoming = [c for c in real_connections(ssp) if c.end_component == name]
        others = [c for c in system.connections if c not in real_connections(ssp)]
        made[name] = Part(
            component=name,
            parameters=system.parameter_sets[variant].get(name, {}),
            published=tuple(published[name]),
            inputs=tuple(c.end_connector for c in incoming),
            sources=tuple(
                Source(c.start_component, published[c.start_component].index(c.start_connector))
                for c in incoming
            ),
            constant=tuple(
                dict.fromkeys(c.start_connector for c in others if c.start_component == name)
            ),
            rounds=len(system.components) + 1,
            times=system.times,
            system=whole,
        )
    return made


def real_connections(ssp: Ssp) -> Sequence[Connection]:
    return [
        c
        for c in ssp.system.connections
        if ssp.variable(f"{c.start_component}.{c.start_connector}").type == "Real"
    ]
