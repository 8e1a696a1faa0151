"""Instances whose inputs and outputs the compiled loop moves; what fails is the user's error."""

from collections.abc import Sequence

import numpy as np
from fmpy.fmi1 import FMICallException

from rparm.errors import UserError
from rparm.fmi.compiled import loop
from rparm.fmi.compiled.calls import DISCARD, TERMINATED, functions
from rparm.fmi.compiled.loop import Part, Tangent, Wires
from rparm.fmi.fmi_instance import Instance


class Stepper:
    """Steps components whose Reals and Booleans are wired to each other and to held inputs."""

    def __init__(
        self, reals: Sequence[Part], switches: Sequence[Part], held_reals: int, held_switches: int
    ) -> None:
        self.reals = Wires.of(reals, held_reals, np.float64)
        self.switches = Wires.of(switches, held_switches, np.int32)
        self._instances: Sequence[Instance] = ()
        self.calls = np.zeros((0, 2 * loop.COLUMNS), np.int64)

    def connect(self, instances: Sequence[Instance]) -> None:
        """Take the instances of all components, which stay open as long as they are used."""
        self._instances, self.calls = instances, loop.component_calls(instances)

    def set_inputs(self, when: str) -> None:
        """Set all inputs from the values; UserError, which says `when`, if that fails."""
        self._check(loop.set_inputs(*self._state(), True), when)

    def read_outputs(self, when: str) -> None:
        """Read all outputs into the values; UserError, which says `when`, if that fails."""
        self._check(loop.read_outputs(*self._state()), when)

    def advance(
        self,
        times: np.ndarray,
        held: np.ndarray,
        held_switches: np.ndarray,
        points: np.ndarray,
        watched: np.ndarray,
        record: np.ndarray,
        tangent: Tangent | None = None,
        growth: np.ndarray | None = None,
    ) -> tuple[int, UserError | None]:
        """Make steps, as `loop.advance` explains; how many were made, and why not all of them."""
        tangent = Tangent.none() if tangent is None else tangent
        calls, reals, switches = self._state()
        *failed, step = loop.advance(
            calls,
            times,
            held,
            held_switches,
            reals,
            switches,
            points,
            watched,
            record,
            tangent.fields,
            np.empty(0) if growth is None else growth,
        )
        try:
            self._check(failed, f"in the step from t = {float(times[step])!r} s")
        except UserError as error:
            return step, error
        return len(times) - 1, None

    def _state(self) -> tuple:
        return self.calls, tuple(self.reals), tuple(self.switches)

    def _check(self, failed: Sequence[int], when: str) -> None:
        """Raise the user's error if the loop says that a function failed."""
        status, function, component = failed
        if status < DISCARD:
            return
        instance = self._instances[component]
        if status == TERMINATED:
            raise UserError(f"{instance.name}: the FMU ends the simulation {when}")
        raise instance.failure(FMICallException(functions(instance)[function], status), when)
