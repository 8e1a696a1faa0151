"""SysSimX: one component, stepped as its own masters step it; inputs set before each step."""

from plan import Plan, Rows, main
from syssimx import FMUComponent


def run(plan: Plan) -> Rows:
    arm = FMUComponent("arm", plan.fmu)
    arm.set_parameters(**plan.parameters)  # it cannot set start values of states
    arm.initialize(plan.start)
    arm.set_inputs(plan.inputs_at(0))

    def row() -> list[float]:
        outputs = arm.get_outputs()
        return [float(outputs[name].magnitude) for name in plan.outputs]

    rows = [row()]
    for i in range(plan.steps):
        arm.set_inputs(plan.inputs_at(i))
        arm.do_step(plan.time(i), plan.step)
        rows.append(row())
    return rows


if __name__ == "__main__":
    main(run)
