"""Values that follow from parameters: calculated parameters and start values."""

from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from rparm import api
from tests.equations.examples import METHODS, MODELS, initializing, made, simulated
from tests.support.rparm_project import Console


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(tmp_path_factory.mktemp("following"), MODELS["following_values"]["SPRING"])


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_a_state_starts_where_its_parameters_say(fmu: Path, method: int, kind: str) -> None:
    if kind == "ModelExchange" and method > 1:
        pytest.skip("the importer integrates")
    start = {"solver_method": method, "l0": 2.0, "phi0": 1.1}
    run = simulated(
        fmu, 3.0, 0.05, start, also=["k", "weight"], fmi_type=kind, relative_tolerance=1e-10
    )
    w, x0 = np.sqrt(9.81 / 2.0), 2.0 * np.cos(1.1)
    bound = 1e-8 if kind == "CoSimulation" else 1e-4
    assert np.max(np.abs(run["x"] - x0 * np.cos(w * run["time"]))) < bound
    assert set(run["k"]) == {2.0 * 9.81 / 2.0} and set(run["weight"]) == {2.0 * 9.81}
    assert run["energy"][0] == pytest.approx(9.81 / 2 * x0**2, rel=1e-14)
    assert set(run["largest"]) == {4.0}


def test_values_follow_while_parameters_are_set(fmu: Path) -> None:
    """In initialization mode all values and their derivatives follow at once, later k does."""
    begun = initializing(fmu)
    instance, at = begun.fmi, begun.loaded.references
    for l0, phi0 in ((1.0, 0.5), (3.0, -0.2)):
        instance.setReal([at["l0"], at["phi0"]], [l0, phi0])
        x, largest, k = instance.getReal([at["x"], at["largest"], at["k"]])
        assert (x, largest, k) == pytest.approx(
            (l0 * np.cos(phi0), 2 * l0, 2 * 9.81 / l0), rel=1e-15
        )
        by_l0 = instance.getDirectionalDerivative(
            [at[n] for n in ("x", "k", "energy")], [at["l0"]], [1.0]
        )
        expected = np.cos(phi0), -2 * 9.81 / l0**2, 9.81 * np.cos(phi0) ** 2
        assert by_l0 == pytest.approx(expected, rel=1e-13)
    instance.exitInitializationMode()
    instance.setReal([at["l0"]], [1.0])
    assert instance.getReal([at["k"], at["x"]]) == pytest.approx([2 * 9.81, 3.0 * np.cos(-0.2)])
    instance.reset()
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    assert instance.getReal([at["x"]])[0] == pytest.approx(1.5 * np.cos(0.3))


def test_an_importer_cannot_set_a_start_that_follows(fmu: Path) -> None:
    begun = initializing(fmu)
    instance, at = begun.fmi, begun.loaded.references
    with pytest.raises(FMICallException):
        instance.setReal([at["x"]], [1.0])


def test_a_start_that_follows_survives_serialization(fmu: Path) -> None:
    begun = initializing(fmu), initializing(fmu)
    first, second = (instance.fmi for instance in begun)
    at = begun[0].loaded.references
    first.setReal([at["l0"]], [2.5])
    first.exitInitializationMode()
    for i in range(7):
        first.doStep(i * 0.1, 0.1)
    content = first.serializeFMUstate(first.getFMUstate())
    second.exitInitializationMode()
    second.setFMUstate(second.deSerializeFMUstate(content))
    for instance in (first, second):
        instance.doStep(0.7, 0.1)
    names = [at[name] for name in ("x", "v", "largest")]
    assert first.getReal(names) == second.getReal(names)


@pytest.mark.parametrize(
    ("section", "name", "message"),
    [
        ("parameters", "k", "'k' follows from m, l0, g: set these"),
        ("initial", "x", "'x' follows from l0, phi0: set these"),
    ],
)
def test_a_scenario_does_not_set_it(
    fmu: Path, tmp_path: Path, console: Console, section: str, name: str, message: str
) -> None:
    path = tmp_path / "spring.toml"
    path.write_text(
        f'fmu = "{fmu}"\ntitle = "t"\ndescription = "d"\ntolerance = 1e-8\n'
        f"[time]\nstart = 0.0\nstop = 1.0\nstep = 0.1\n[{section}]\n{name} = 1.0\n"
    )
    code, _, err = console(str(path))
    assert code == 2 and message in err and err.count("\n") == 1


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_linear_model_is_made_at_states_that_are_given(fmu: Path, version: str) -> None:
    path = fmu if version == "2.0" else fmu.parent / "fmi3" / fmu.name
    found = api.linearize(path, at={"x": 0.7, "v": 0.1, "l0": 2.0})
    assert found.at["x"] == 0.7 and found.at["v"] == 0.1
    assert found.between.A[:2, :2].tolist() == [[0.0, 1.0], [-9.81 / 2.0, 0.0]]
    energy = found.C[found.outputs.index("energy")]
    assert energy == pytest.approx([2 * 9.81 / 2.0 * 0.7, 2.0 * 0.1, 0.0], rel=1e-14)
