"""Instances for model exchange, at a point: initialized and read, not integrated.

They exist so that what is asked of an FMU at one time can be asked of either kind.
"""

from fmpy import fmi2, fmi3

from rparm.errors import UserError
from rparm.fmi.fmi2_instance import Fmi2Instance
from rparm.fmi.fmi3_instance import Fmi3Instance
from rparm.fmi.fmi_instance import Instance

MOST_UPDATES = 100  # of the discrete states at one time


class _ModelExchange(Instance):
    """Ends initialization in continuous-time mode, after all events of the start."""

    next_event: float | None = None  # s, of the next time event

    def exit_initialization(self) -> None:
        super().exit_initialization()
        with self.explained("at the events of the start"):
            for _ in range(MOST_UPDATES):
                needed, terminates, _, _, has_next, time = self._update_discrete_states()
                if terminates:
                    raise UserError(f"{self.name}: the FMU ends the simulation at its start")
                if not needed:
                    break
            else:
                raise UserError(f"{self.name}: its discrete states do not settle at the start")
            self.fmi.enterContinuousTimeMode()
        self.next_event = time if has_next else None


class Fmi2ModelExchange(_ModelExchange, Fmi2Instance):
    LIBRARY = fmi2.FMU2Model

    def _update_discrete_states(self) -> tuple:
        return self.fmi.newDiscreteStates()


class Fmi3ModelExchange(_ModelExchange, Fmi3Instance):
    LIBRARY = fmi3.FMU3Model
    INSTANTIATE = "fmi3InstantiateModelExchange"

    def _instantiate(self) -> None:
        self.fmi.instantiate(logMessage=self._log)
        self._log_warnings()

    def _update_discrete_states(self) -> tuple:
        return self.fmi.updateDiscreteStates()
