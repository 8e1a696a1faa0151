"""GEMSEO: a discipline that is executed step by step, with its inputs as arrays."""

from gemseo_fmu.disciplines.do_step_fmu_discipline import DoStepFMUDiscipline
from numpy import array
from plan import Plan, Rows, main


def run(plan: Plan) -> Rows:
    if plan.initial:
        raise ValueError("GEMSEO sets inputs and parameters, no other start values")
    arm = DoStepFMUDiscipline(
        plan.fmu,
        input_names=[*plan.parameters, *plan.inputs],
        output_names=plan.outputs,
        initial_time=plan.start,
        final_time=plan.stop,
        time_step=plan.step,
        add_time_to_output_grammar=False,
    )

    def execute(i: int) -> list[float]:
        values = plan.parameters | plan.inputs_at(i)
        result = arm.execute({name: array([value]) for name, value in values.items()})
        return [float(result[name][0]) for name in plan.outputs]

    arm.set_default_execution(initialize_only=True)
    rows = [execute(0)]
    arm.set_default_execution()  # the first execution resets the FMU and initializes it again
    rows += [execute(i) for i in range(plan.steps)]
    return rows


if __name__ == "__main__":
    main(run)
