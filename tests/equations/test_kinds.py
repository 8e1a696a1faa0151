"""Outputs and entries of [where] that are no real numbers."""

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from tests.equations.compiled import declared, read
from tests.equations.examples import METHODS, MODELS, loaded, made, simulated
from tests.support.instances import Instance

GEAR = MODELS["kinds"]["GEAR"]


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("version", ["", "fmi3"])
@pytest.mark.parametrize("fmi_type", ["CoSimulation", "ModelExchange"])
def test_they_follow_the_motion(version: str, method: int, fmi_type: str) -> None:
    fmu = made(GEAR)
    run = simulated(
        fmu.parent / version / fmu.name, 10.0, 0.01, {"solver_method": method, "large": 0.5},
        fmi_type=fmi_type, relative_tolerance=1e-10, also=["hot", "warm", "level"],
    )  # fmt: skip
    # by the exact motion, except within a tolerance of the switches
    w = np.sqrt(0.1)
    x, v = 1.5 / w * np.sin(w * run["time"]), 1.5 * np.cos(w * run["time"])
    sure = np.min(np.abs([x - 3, x - 1.5, v]), axis=0) > 1e-5
    hot, warm = x > 3, (x > 1.5) & (x <= 3)
    level = np.where(hot, 3, np.where(warm, 2, 1))
    expected = {
        "hot": hot, "warm": warm, "is_warm": warm, "level": level, "state": np.minimum(level, 2),
        "gear": np.where(hot, np.where(v > 0, 1, -1), 2),
    }  # fmt: skip
    assert np.sum(sure) > 900
    for name, values in expected.items():
        assert np.array_equal(run[name][sure], values[sure]), name
    assert {*run["count"]} == {5 * 10**8} and {*run["more"]} == {10**9}


def test_what_they_follow_from_is_declared() -> None:
    fmu = made(GEAR)
    variables = declared(read(fmu.with_suffix(".toml")))["variables"]
    kinds = {name: (v.get("type"), v["causality"]) for name, v in variables.items()}
    assert kinds["gear"] == ("int32", "output") and kinds["hot"] == ("boolean", "local")
    assert kinds["level"] == ("enumeration", "local") and kinds["height"] == (None, "output")
    assert variables["gear"]["dependencies"] == ["x", "v"]
    assert variables["gear"]["parameters"] == ["limit"]
    assert variables["more"]["parameters"] == ["large"] and not variables["more"]["dependencies"]
    assert [*variables["state"]["items"]] == ["low", "high"]
    own = {v.name: v for v in fmpy.read_model_description(fmu).modelVariables}
    assert (own["gear"].min, own["gear"].max, own["gear"].variability) == ("-1", "2", "discrete")
    assert own["warm"].description == "Between half and all of the limit"


def test_a_whole_number_of_more_than_32_bits_is_named() -> None:
    with Instance(loaded(made(GEAR)), logging_on=True) as unit:
        unit.initialize()
        more = [unit.loaded.references["more"]]
        with pytest.raises(FMICallException, match="discard"):
            unit.fmi.getInteger(more)
        said = (
            "more: count + floor(1e9 * large) [floor: up to 2^30] is no number of 32 bits at t = 0"
        )
        assert unit.messages[-1].text == f"{said} with count = 1500000000, large = 1.5"
        unit.set(large=1.0)
        assert unit.fmi.getInteger(more) == [2 * 10**9]
