"""libcosim runs an SSP: steps of the SSP's own fixed-step algorithm, the first parameter set.

    run_osp_system.py SSP NAMES STEPS RESULT

NAMES (component.variable) and RESULT are JSON files; row i of the result is read after step i + 1.
"""

import json
import sys
from pathlib import Path

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver


def run(ssp: str, names: list[str], steps: int) -> list[list[float]]:
    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(ssp)
    indices = {info.name.decode(): info.index for info in execution.slave_infos()}
    references = {
        component: {v.name.decode(): v.reference for v in execution.slave_variables(index)}
        for component, index in indices.items()
    }
    variables: dict[str, list[str]] = {}
    for name in names:
        component, _, variable = name.partition(".")
        variables.setdefault(component, []).append(variable)
    observer = CosimObserver.create_last_value()
    if not execution.add_observer(observer):
        raise RuntimeError("a call of libcosim failed")
    rows = []
    for _ in range(steps):
        if not execution.step():
            raise RuntimeError("a step of libcosim failed")
        row: dict[str, float] = {}
        for component, of_component in variables.items():
            wanted = [references[component][variable] for variable in of_component]
            values = observer.last_real_values(indices[component], wanted)
            row |= {f"{component}.{v}": x for v, x in zip(of_component, values, strict=True)}
        rows.append([row[name] for name in names])
    return rows


if __name__ == "__main__":
    ssp_file, names_file, step_count, result_file = sys.argv[1:]
    wanted_names = json.loads(Path(names_file).read_text(encoding="utf-8"))
    result = run(ssp_file, wanted_names, int(step_count))
    Path(result_file).write_text(json.dumps(result), encoding="utf-8")
