"""What else users do with friction and stops: components, linear models, campaigns, fits."""

import json
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

import rparm
from tests.contacts.test_closed_forms import STUCK, UPPER, fmus
from tests.equations.examples import METHODS, made, quick, simulated
from tests.support.rparm_project import call

PAIR = """name = "Pair"
[components]
left = "slider.toml"
right = { file = "slider.toml", parameters = { c = "1.5 N" } }
[connections]
left.u = "6"
right.u = "6"
[outputs]
rest = { type = "Boolean", value = 'left.stops.end.mode == "upper"' }
"""


@pytest.mark.parametrize("method", METHODS)
def test_components_have_friction_and_stops_of_their_own(tmp_path: Path, method: str) -> None:
    (tmp_path / "slider.toml").write_text(
        Path(__file__).with_name("slider.toml").read_text(encoding="utf-8"), encoding="utf-8"
    )
    path = tmp_path / "pair.toml"
    path.write_text(PAIR, encoding="utf-8")
    both = simulated(
        quick(path, tmp_path), 3, 0.1, {"solver_method": METHODS[method]}, relative_tolerance=1e-10
    )
    for name, c in (("left", 0.8), ("right", 1.5)):
        start = {"solver_method": METHODS[method], "u": 6, "c": c}
        alone = simulated(fmus()["Slider"], 3, 0.1, start, relative_tolerance=1e-10)
        for output in ("x", "friction.guide.force", "stops.end.loss", "stops.end.mode"):
            assert both[f"{name}.{output}"] == pytest.approx(alone[output], abs=1e-8)
    rests = (both["left.stops.end.mode"] == UPPER) & (both["left.friction.guide.mode"] == STUCK)
    assert both["rest"].tolist() == rests.tolist() and rests[-1] and not rests[0]


def test_linear_models_leave_out_what_is_held() -> None:
    held = rparm.linearize(fmus()["Slider"], at={"u": 0.5})
    assert [*held.held] == ["x", "v"]
    moves = rparm.linearize(fmus()["Slider"], at={"v": 0.5})
    assert pytest.approx(np.array([[0, 1], [-30 / 1.2, -0.5 / 1.2]])) == moves.A
    assert pytest.approx(np.array([[0], [1 / 1.2]])) == moves.B


def test_a_campaign_finds_where_it_rests(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """From a throw: m v^2 / 2 - c x - k x^2 / 2 = 0, if it rests before the stop."""
    run = tmp_path / "run.toml"
    run.write_text(
        f'title = "Throw"\ndescription = "Throw"\nfmu = {json.dumps(str(fmus()["Slider"]))}\n'
        "tolerance = 1e-10\n[time]\nstart = 0.0\nstop = 2.0\nstep = 0.1\n[initial]\nv = 0.3\n"
        "[parameters]\nd = 0.0\nk = 4.0\n",
        encoding="utf-8",
    )
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(
        f'title = "Throws"\ndescription = "Throws"\nscenario = "{run.name}"\nsampling = "grid"\n'
        '[parameters.c]\nvalues = [0.6, 0.9, 1.3]\n[keep]\nfinal = ["x"]\n',
        encoding="utf-8",
    )
    code, _, _ = call(
        capsys, "campaign", campaign, "--output", tmp_path, "--no-dashboard", "--quiet"
    )
    assert code == 0
    table = parquet.read_table(tmp_path / "blocks").to_pydict()
    for c, x in zip(table["c"], table["final(x)"], strict=True):
        assert 2 * x**2 + c * x == pytest.approx(1.2 * 0.3**2 / 2, abs=1e-8)


BLOCK = """name = "Block"
[parameters]
c = { start = 1.0, min = 0 }
e = { start = 0.5, min = 0, max = 1 }
[inputs]
u = {}
[states]
x = { derivative = "v" }
v = { derivative = "u - F + P" }
[friction.slide]
force = "F"
velocity = "v"
coulomb = "c"
[stops.slide]
force = "P"
position = "x"
velocity = "v"
lower = "-0.5"
upper = "0.5"
restitution = "e"
"""


def moved(x: float, v: float, u: float, h: float, c: float, e: float) -> tuple[float, float]:
    """A block between stops at +-0.5 under a constant force, from one parabola to the next."""
    while h > 0 and (v != 0 or abs(u) > c) and not (v == 0 and u * x >= 0.5 * abs(u)):
        sign = np.sign(v or u)
        a = u - sign * c
        halts = -v / a if a * v < 0 else np.inf
        roots = [r.real for r in np.roots([a / 2, v, x - sign / 2]) if abs(r.imag) < 1e-12]
        hits = min((r for r in roots if r > 1e-12), default=np.inf)
        t = min(h, halts, hits)
        x, v, h = x + v * t + a * t**2 / 2, v + a * t, h - t
        if t == halts:
            v = 0.0
        elif t == hits:
            x, v = sign / 2, -e * v if e * abs(v) > 1e-9 else 0.0
    return x, v


def test_a_fit_finds_friction_and_restitution(tmp_path: Path) -> None:
    """Of a log by parabolas, with noise."""
    random, true = np.random.default_rng(5), {"c": 1.3, "e": 0.6}
    times, x, v = 0.02 * np.arange(500), 0.0, 0.0
    forces = 3 * np.sin(1.7 * times) + np.sin(5.1 * times)
    rows = ["time,u,x"]
    for t, u in zip(times, forces, strict=True):
        rows.append(f"{t},{u!r},{x + 2e-4 * random.standard_normal()!r}")
        x, v = moved(x, v, u, 0.02, **true)
    log = tmp_path / "log.csv"
    log.write_text("\n".join(rows).replace("np.float64(", "").replace(")", ""))
    found = rparm.identify(
        made(BLOCK), log, parameters=["c", "e"], inputs=["u"], measured=["x"], segment=2.0
    )
    assert found.chi2 < 1.5
    for name, value in true.items():
        estimate = found.estimates[name]
        assert estimate.low < value < estimate.high < estimate.low * 1.05
