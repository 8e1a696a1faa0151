"""The process of one component: steps its FMU between the exchanges of the federation."""

from collections.abc import Callable

import numpy as np

from rparm.errors import UserError
from rparm.federation import watching
from rparm.federation.network import Federate
from rparm.federation.parts import Part
from rparm.federation.watching import Silence
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.systems.master import begin_instance, check_finite


def run(
    part: Part, fmu: Fmu, address: str, silence: float, is_gone: Callable[[], bool] = lambda: False
) -> None:
    """Step a component from the first to the last communication point.

    A call of the FMU, and silence of the broker at `address`, may last `silence` s. `is_gone` says
    whether the process that started this one has ended.

    UserError if the FMU fails, the federation steps something else or ends, or an output changes
    that must not.
    """
    name = part.component
    federate = Federate(name, address, sorted({s.component for s in part.sources}))
    still = Silence(federate, silence)

    def work() -> None:
        federate.join()
        part.check_same(federate.system())
        with fmu.instance(name) as instance:
            _Stepper(part, instance, federate).run()
        federate.leave()

    def look() -> None:
        if is_gone():
            raise UserError(f"{name}: the process that started it is gone")
        if not still.too_long():
            return
        if not federate.waits:
            raise UserError(f"{name}: its FMU has not returned for {silence:g} s")
        if not federate.has_broker():
            raise UserError(f"{name}: the broker at {address} has been silent for {silence:g} s")

    def end(error: BaseException) -> None:
        is_known = isinstance(error, UserError)
        federate.fail(str(error) if is_known else f"{name}: its process was ended")

    watching.run(work, look, end)


class _Stepper:
    def __init__(self, part: Part, instance: Instance, federate: Federate) -> None:
        self._part, self._instance, self._federate = part, instance, federate
        self._outputs = instance.reals(part.published)
        self._inputs = instance.reals(part.inputs)

    def run(self) -> None:
        self._initialize()
        constant = self._constants()
        times = self._part.times.tolist()
        for point, (start, end) in enumerate(zip(times[:-1], times[1:], strict=True), start=1):
            with self._instance.explained(f"in the step from t = {start!r} s"):
                self._take()
                self._instance.do_step(start, end - start)
            with self._instance.explained(f"at t = {end!r} s"):
                self._give(f"at t = {end!r} s")
            if constant and self._constants() != constant:
                names = ", ".join(self._part.constant)
                raise UserError(
                    f"{self._part.component}: {names} changed by t = {end!r} s; only Real values "
                    "are exchanged in the steps"
                )
            self._federate.go_to(point)

    def _initialize(self) -> None:
        part, instance = self._part, self._instance
        begin_instance(instance, part.times[0], part.times[-1], part.parameters)
        self._federate.enter_initialization()
        self._give_early()
        for _ in range(part.rounds):
            before = self._outputs.view.copy()
            self._federate.exchange()
            with instance.explained("in initialization"):
                self._take()
            self._give_early()
        if not np.array_equal(before, self._outputs.view):
            raise UserError(f"{part.component}: the connections form an algebraic loop")
        self._federate.begin()
        instance.exit_initialization()

    def _take(self) -> None:
        """Set the inputs to what their sources have published."""
        if self._part.inputs:
            values = self._federate.read()
            self._inputs.view[:] = [values[s.component][s.index] for s in self._part.sources]
            self._inputs.set()

    def _give_early(self) -> None:
        with self._instance.explained_early():
            self._give("in initialization")

    def _give(self, when: str) -> None:
        """Read the outputs and publish them."""
        self._outputs.get()
        check_finite(self._part.component, self._outputs, when)
        self._federate.publish(self._outputs.view)

    def _constants(self) -> list[object]:
        model = self._instance.fmu.model
        return [
            self._instance.boolean(name)
            if model.variables[name].type == "Boolean"
            else self._instance.integer(name)
            for name in self._part.constant
        ]
