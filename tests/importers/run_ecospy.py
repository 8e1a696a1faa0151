"""Ecos: inputs set before each step; get_real has all digits, its CSV files have six."""

from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure
from plan import Plan, Rows, main


def run(plan: Plan) -> Rows:
    EcosLib.set_log_level("warn")
    with EcosSimulationStructure() as structure:
        structure.add_model("arm", plan.fmu)
        values = {f"arm::{name}": value for name, value in plan.start_values().items()}
        structure.add_parameter_set("start", values)
        simulation = EcosSimulation(structure=structure, step_size=plan.step)
    with simulation:
        if not simulation.init(start_time=plan.start, parameter_set="start"):
            raise RuntimeError(EcosLib.get_last_error())

        def read() -> list[float]:
            return [simulation.get_real(f"arm::{name}") for name in plan.outputs]

        rows = [read()]
        for i in range(plan.steps):
            for name, value in plan.inputs_at(i).items():
                simulation.set_real(f"arm::{name}", value)
            simulation.step()
            rows.append(read())
        simulation.terminate()
    return rows


if __name__ == "__main__":
    main(run)
