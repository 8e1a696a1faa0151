"""CasADi uses the FMUs as models: Jacobians, integration and optimal control, in both versions."""

import json
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy import fmi2

from tests.importers.by_fmpy import co_simulation
from tests.importers.test_importers import OPTIMIZER, SCRIPTS, VERSIONS, folder_of, start
from tests.support.instances import Instance, LoadedFmu

X = [0.3, 0.2, -0.4, 0.1]  # states of arm and plant
U = [1.0, 2.0, 0.1, 0.2, 0.3]  # inputs of the plant; the first two are those of the arm


@pytest.fixture(params=VERSIONS)
def version(request: pytest.FixtureRequest) -> str:
    return request.param


def path_of(fmu: Path, version: str, name: str = "RPManipulator") -> Path:
    return (fmu.parent if version == "fmi2" else fmu.parent / version) / f"{name}.fmu"


def ask(task: str, fmu: Path, folder: Path, **plan: Any) -> dict[str, Any]:
    """What run_casadi.py answers in CasADi's environment."""
    files = folder / "plan.json", folder / "result.json"
    files[0].write_text(json.dumps(plan), encoding="utf-8")
    python = folder_of(OPTIMIZER) / "bin" / "python"
    process = start([python, SCRIPTS / "run_casadi.py", task, fmu, *files], folder)
    assert process.returncode == 0, process.stdout
    assert "Status" not in process.stdout  # what the FMU logs
    return json.loads(files[1].read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ["RPManipulator", "RPPlant"])
def test_its_jacobians_are_directional_derivatives(
    fmu: Path, version: str, name: str, tmp_path: Path
) -> None:
    """The plant's stop_impulse1 is among the outputs, which CasADi asks for all at once."""
    u = U if name == "RPPlant" else U[:2]
    found = ask("jacobians", path_of(fmu, version, name), tmp_path, x=X, u=u)
    loaded = LoadedFmu(path_of(fmu, "fmi2", name), tmp_path / "unpacked")
    references = loaded.references
    rates = [d.variable.valueReference for d in loaded.description.derivatives]
    unknowns = {"ode": rates, "y": [references[y] for y in found["y"]]}
    assert {"ddq1", "ee_vx"} | ({"stop_impulse1"} if name == "RPPlant" else set()) <= {*found["y"]}
    with Instance(loaded, fmi2.FMU2Model) as model:
        values = zip([*found["x"], *found["u"]], [*X, *u], strict=True)
        model.initialize(**dict(values))
        for of, names in unknowns.items():
            for by in "xu":
                columns = [
                    model.fmi.getDirectionalDerivative(names, [references[known]], [1.0])
                    for known in found[by]
                ]
                expected = np.transpose(columns)
                np.testing.assert_allclose(found[f"{of}_{by}"], expected, rtol=1e-14, atol=1e-14)


def test_its_cvodes_gives_the_motion_of_fmpy(fmu: Path, version: str, tmp_path: Path) -> None:
    """The same equations by two loops of CVODE."""
    path, tolerance = path_of(fmu, version), 1e-11
    times = [0.0, 0.25, 0.5, 0.75, 1.0]
    options = {"times": times, "tolerance": tolerance}
    found = np.array(ask("motion", path, tmp_path, x=X, u=U[:2], **options)["x"])
    names = ["q1", "q2", "dq1", "dq2"]
    result = fmpy.simulate_fmu(
        path,
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=tolerance,
        stop_time=times[-1],
        output_interval=0.25,
        start_values=dict(zip([*names, "tau1", "f2"], [*X, *U[:2]], strict=True)),
        output=names,
    )
    np.testing.assert_array_equal(result["time"], times)
    expected = np.transpose([result[name] for name in names])
    difference = np.abs(found - expected).max() / np.abs(expected).max()
    print(f"casadi {version}: cvodes differs from fmpy by {difference:.1e}")
    assert difference <= 1e-8


def test_its_optimal_control_swings_the_arm_up(fmu: Path, version: str, tmp_path: Path) -> None:
    """From q1 = -1.5 rad to 0 in 1 s, at rest; Co-Simulation with these inputs goes there, too."""
    path, intervals = path_of(fmu, version), 20
    begin, end = [-1.5, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]
    plan = {"start": begin, "end": end, "duration": 1.0, "intervals": intervals}
    found = ask("control", path, tmp_path, **plan)
    assert found["status"] == "Solve_Succeeded"
    names = ("q1", "q2", "dq1", "dq2")
    efforts = zip(("tau1", "f2"), np.transpose(found["u"]), strict=True)
    run = {
        "start": 0.0,
        "step": 1 / intervals,
        "steps": intervals,
        "parameters": {"relative_tolerance": 1e-10},
        "initial": dict(zip(names, begin, strict=True)),
        "inputs": {name: [*values, values[-1]] for name, values in efforts},
        "outputs": names,
    }
    rows = co_simulation(LoadedFmu(path, tmp_path / "unpacked"), run)
    np.testing.assert_allclose(rows[1:], found["x"][1:], rtol=0, atol=1e-5)
    error = np.abs(rows[-1] - end).max()
    print(f"casadi {version}: optimal control ends {error:.1e} beside its end")
    assert error <= 1e-5
