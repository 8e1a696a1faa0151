"""libcosim: inputs set before each step by a manipulator, outputs read by observers."""

from libcosimpy.CosimEnums import CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
from plan import Plan, Rows, main


def check(success: bool) -> None:
    if not success:
        raise RuntimeError("a call of libcosim failed")


def run(plan: Plan) -> Rows:
    if plan.start != 0.0:
        raise ValueError("libcosimpy starts at 0")
    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_step_size(round(plan.step * 1e9))
    slave = CosimLocalSlave(plan.fmu, "arm")
    arm = execution.add_local_slave(slave)
    references = {v.name.decode(): v.reference for v in execution.slave_variables(arm)}
    inputs = [references[name] for name in plan.inputs]
    outputs = [references[name] for name in plan.outputs]

    for name, value in plan.start_values().items():
        check(execution.real_initial_value(arm, references[name], value))
    manipulator = CosimManipulator.create_override()
    check(execution.add_manipulator(manipulator))
    last_value = CosimObserver.create_last_value()
    check(execution.add_observer(last_value))
    # only this observer sees the first values: initialization is part of the first step
    first_values = CosimObserver.create_time_series(plan.steps + 1)
    check(execution.add_observer(first_values))
    for reference in outputs:
        check(first_values.start_time_series(arm, reference, CosimVariableType.REAL))

    rows = []
    for i in range(plan.steps):
        check(manipulator.slave_real_values(arm, inputs, list(plan.inputs_at(i).values())))
        check(execution.step())
        rows.append(last_value.last_real_values(arm, outputs))
    # of the samples of a time series, libcosimpy 0.0.6 cuts off one too many where step 0 is asked
    # for: it takes it for an empty place
    first = [first_values.time_series_real_samples(arm, r, 0, 2)[2][0] for r in outputs]
    return [first, *rows]


if __name__ == "__main__":
    main(run)
