"""PathSim: a scheduled event makes the FMU's step, with the inputs of the end of that step.

With a time step as long as the FMU's, PathSim first evaluates its sources at the end of the time
step, then handles the event that was due at its beginning.
"""

from collections.abc import Callable

from pathsim import Connection, Simulation
from pathsim.blocks import Source
from pathsim_fmi import CoSimulationFMU
from plan import Plan, Rows, main


def run(plan: Plan) -> Rows:
    if plan.start != 0.0:
        raise ValueError("PathSim's FMU block starts at 0")

    def signal(values: list[float]) -> Callable[[float], float]:
        return lambda t: values[round(t / plan.step)]

    arm = CoSimulationFMU(plan.fmu, "arm", start_values=plan.start_values(), dt=plan.step)
    sources = {name: Source(signal(values)) for name, values in plan.inputs.items()}
    connections = [Connection(source, arm[name]) for name, source in sources.items()]
    simulation = Simulation([arm, *sources.values()], connections, dt=plan.step, log=False)
    places = list(arm.fmu_wrapper.output_refs)

    def read() -> list[float]:
        return [float(arm.outputs[places.index(name)]) for name in plan.outputs]

    rows = [read()]
    for _ in range(plan.steps):
        simulation.timestep()
        rows.append(read())
    return rows


if __name__ == "__main__":
    main(run)
