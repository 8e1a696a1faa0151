"""CoFMPy: inputs from tables in its configuration, previous value, set before each step."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

from cofmupy import Coordinator
from plan import Plan, Rows, main


def configuration(plan: Plan) -> dict:
    def table(values: list[float]) -> dict[str, float]:
        # half a step early: CoFMPy adds up its time, which may fall short of the point
        return {repr(plan.time(i) - plan.step / 2): value for i, value in enumerate(values)}

    return {
        "fmus": [{"id": "arm", "path": plan.fmu, "initialization": plan.start_values()}],
        "connections": [
            {
                "source": {"type": "literal", "values": table(values)},
                "target": {"id": "arm", "variable": name},
            }
            for name, values in plan.inputs.items()
        ],
        "cosim_method": "jacobi",
        "iterative": False,
    }


def run(plan: Plan) -> Rows:
    if plan.start != 0.0:
        raise ValueError("CoFMPy starts at 0")
    coordinator = Coordinator()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "configuration.json"
        path.write_text(json.dumps(configuration(plan)), encoding="utf-8")
        coordinator.start(str(path))

    def read() -> list[float]:
        return [coordinator.get_variable(("arm", name))[0] for name in plan.outputs]

    rows = [read()]
    for _ in range(plan.steps):
        coordinator.do_step(plan.step)
        rows.append(read())
    return rows


if __name__ == "__main__":
    main(run)
