"""Intervals contain exact motions up to the first event; the checker notices what is wrong."""

import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import ModuleType

import flint
import numpy as np
import pytest
from flint import arb

from rparm.errors import UserError
from rparm.proof import checker
from rparm.proof import enclosure as enclosures
from rparm.proof.enclosure import Enclosure
from rparm.proof.prover import Step
from tests.prove.problems import EXAMPLES, PENDULUM, ROOT, SMALL, enclose, holds
from tests.support.tables import tables

SOURCES = {  # in the order in which they import each other
    "rparm.fmu_tools.compiler.graph.graph": ROOT / "fmu" / "compiler" / "graph" / "graph.py",
    **{f"rparm.proof.{name}": ROOT / "rparm" / "proof" / f"{name}.py"
       for name in ("problem", "prover", "enclosure")},
}  # fmt: skip


@pytest.fixture(autouse=True)
def precise() -> Iterator[None]:
    flint.ctx.prec, before = 400, flint.ctx.prec
    yield
    flint.ctx.prec = before


# ---- Closed forms --------------------------------------------------------------------------------


def widest(found: Enclosure, names: tuple[str, ...]) -> float:
    return float(found.of(names).radius.max())


def test_a_pendulum_follows_its_elliptic_function() -> None:
    """sin(phi / 2) = k cd(t sqrt(g / l)), which rests where it starts."""
    times = [0.0, 0.5, 1.3, 4.0]
    found = enclose(PENDULUM, times)
    k, root = (arb(2.5) / 2).sin(), (arb(9.81) / arb(0.7)).sqrt()
    for row, time in enumerate(times):
        sn, cn, dn = jacobi(arb(time) * root, k)
        half = (k * cn / dn).asin()
        rate = -2 * k * root * (1 - k * k) * sn / (dn * dn) / half.cos()
        assert holds(found, row, {"phi": 2 * half, "w": rate})
    assert widest(found, ("phi", "w")) < 1e-26


def jacobi(u: arb, k: arb) -> tuple[arb, arb, arb]:
    """sn, cn and dn by arithmetic-geometric means (Abramowitz, Stegun 16.4)."""
    a, b, c = [arb(1)], (1 - k * k).sqrt(), [k]
    while not c[-1].abs_upper() < arb(2) ** -300:
        a.append((a[-1] + b) / 2)
        c.append((a[-2] - b) / 2)
        b = (a[-2] * b).sqrt()
    phi = 2 ** (len(a) - 1) * a[-1] * u
    for n in range(len(a) - 1, 0, -1):
        phi = (phi + (c[n] / a[n] * phi.sin()).asin()) / 2
    # the mean is left out of c by less than this
    phi += arb(0, 1) * arb(2) ** -280
    sn = phi.sin()
    return sn, phi.cos(), (1 - k * k * sn * sn).sqrt()


def test_two_bodies_follow_kepler() -> None:
    """x = a (cos E - e), with E - e sin E = n t from the perigee."""
    times = [0.0, 60.0, 3000.0, 43200.0, 86400.0]
    found = enclose(EXAMPLES / "two_body_orbit.toml", times)
    mu, r, v = arb(3.986004418e14), arb(7e6), arb(9e3)
    a = 1 / (2 / r - v * v / mu)
    e, n = 1 - r / a, (mu / a**3).sqrt()
    for row, time in enumerate(times):
        anomaly = n * time
        angle = anomaly
        for _ in range(60):  # Newton's method, from 1 on
            step = (angle - e * angle.sin() - anomaly) / (1 - e * angle.cos())
            angle = (angle - step).mid()
        rest = (angle - e * angle.sin() - anomaly).abs_upper() / (1 - e)
        angle += arb(0, 1) * rest.abs_upper()
        b, share = (1 - e * e).sqrt(), n * a / (1 - e * angle.cos())
        exact = {"x": a * (angle.cos() - e), "y": a * b * angle.sin()}
        exact |= {"v_x": -share * angle.sin(), "v_y": share * b * angle.cos()}
        assert holds(found, row, exact)
    assert widest(found, ("x", "y")) < 1e-13


def test_a_motor_follows_its_exponentials() -> None:
    times = [0.0, 0.001, 0.1, 2.0]
    found = enclose(EXAMPLES / "dc_motor.toml", times)
    R, L, k, d, ratio = map(arb, (1.2, 2e-3, 0.05, 1e-5, 20.0))
    J = arb(2e-5) + arb(0.02) / ratio**2
    linear = flint.arb_mat([[-R / L, -k / L, 12 / L, 0], [k / J, -d / J, 0, 0],
                            [0, 0, 0, 0], [0, 1 / ratio, 0, 0]])  # fmt: skip
    for row, time in enumerate(times):
        i, speed, _, angle = [x[2] for x in (linear * arb(time)).exp().tolist()]
        assert holds(found, row, {"i": i, "speed": speed, "angle": angle})
    assert widest(found, ("i", "speed", "angle")) < 1e-26


def test_a_start_may_follow_from_an_input() -> None:
    text = 'name = "S"\n[inputs]\nu = {}\n[states]\nx = { start = "2 * u", derivative = "-x" }'
    found = enclose(text, [0.0, 1.0], inputs={"u": [0.3, 5.0]}, check=True)
    assert holds(found, 1, {"x": 2 * arb(0.3) * arb(-1).exp()})


def test_a_ball_falls_until_its_impact() -> None:
    found = enclose(EXAMPLES / "bouncing_ball.toml", [0.0, 0.2, 0.45, 0.5])
    for row, time in enumerate((0.0, 0.2, 0.45)):
        t, g = arb(time), arb(9.81)
        assert holds(found, row, {"h": 1 - g * t * t / 2, "v": -g * t})
    assert found.stopped is not None and found.stopped.reason == "event impact (h < 0)"
    impact = (2 / arb(9.81)).sqrt()
    assert impact - 1e-12 < arb(found.stopped.time) < impact
    assert len(found.times) == 3 and found.stopped.is_event


def test_many_states_that_swing_stay_narrow() -> None:
    """Orthogonal frames alone would let the set of 40 states grow 1e8 times in a second."""
    found = enclose(EXAMPLES / "masses.toml", [0.05 * k for k in range(21)])
    assert found.stopped is None and found.radius.max() < 1e-28


# ---- Where proofs end ----------------------------------------------------------------------------

ENDS = tables(str(Path(__file__).with_name("faults")))


@pytest.mark.parametrize(("rest", "reason", "time", "is_event"), ENDS["stop"])
def test_where_a_proof_ends(rest: str, reason: str, time: float, is_event: bool) -> None:
    stopped = enclose(f'name = "M"\n{rest}', [0.0, 0.3, 2.0]).stopped
    assert stopped is not None and stopped.reason == reason and stopped.is_event == is_event
    assert time - 1e-6 < stopped.time <= time


@pytest.mark.parametrize(("rest", "message"), ENDS["refused"])
def test_what_is_refused(rest: str, message: str) -> None:
    with pytest.raises(UserError, match=f"^model.toml: {re.escape(message)}$"):
        enclose(f'name = "M"\n{rest}', [0.0, 0.3, 2.0])


def test_a_set_that_is_too_broad_ends_the_proof(monkeypatch: pytest.MonkeyPatch) -> None:
    """No box holds the motions of so many states over the step."""
    monkeypatch.setattr(enclosures, "HALVINGS", 0)
    stopped = enclose(EXAMPLES / "lorenz.toml", [0.0, 1.0], {"x": 5.0, "y": 5.0, "z": 5.0}).stopped
    assert stopped is not None and not stopped.is_event and stopped.reason.endswith("too uncertain")


def test_corners_of_an_uncertain_start_are_inside() -> None:
    times, radius = [0.0, 0.4, 1.0], 1e-3
    broad = enclose(PENDULUM, times, {"phi": radius, "w": radius})
    for a, b in product((-0.999, 0.5, 0.999), repeat=2):
        one = enclose(PENDULUM, times, initial={"phi": 2.5 + a * radius, "w": b * radius})
        assert np.all(np.abs(one.high - broad.high) <= broad.radius)
    assert broad.radius.max() < 0.05


# ---- Claims and faults ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", SMALL)
def test_proofs_are_confirmed(name: str) -> None:
    found = enclose(**SMALL[name], check=True)
    assert found.checked > 1
    assert (found.stopped is not None) == (name in ("ball", "switch"))


def smaller(step: Step, part: str, row: int) -> Step:
    """A step with a tenth of the radius in the set at its end, or with something else there."""
    changed = getattr(step.after, part).entries()
    changed[row] = changed[row] / 10 if part in ("y", "s") else changed[row] + 2.0**-10
    matrix = getattr(step.after, part)
    return replace(step, after=replace(
        step.after, **{part: flint.arb_mat(matrix.nrows(), matrix.ncols(), changed)}
    ))  # fmt: skip


@pytest.mark.parametrize("part", ["centre", "frame", "y", "spread", "s"])
def test_a_claim_that_is_changed_is_refused(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    check = checker.Checker.step
    monkeypatch.setattr(
        checker.Checker, "step",
        lambda self, step, *rest: check(self, smaller(step, part, 0), *rest),
    )  # fmt: skip
    with pytest.raises(UserError, match="not confirmed"):
        enclose(**SMALL["uncertain"], check=True)


def test_polynomials_that_fail_the_equations_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are no claims, but a proof needs good ones."""
    check = checker.Checker.step
    for part in ("motion", "flow"):
        monkeypatch.setattr(
            checker.Checker, "step",
            lambda self, step, *rest, part=part: check(
                self, replace(step, **{part: getattr(step, part)[:2] if part == "flow"
                                       else [x[:-6] for x in step.motion]}), *rest),
        )  # fmt: skip
        with pytest.raises(UserError, match="not confirmed"):
            enclose(**SMALL["arm"], check=True)


def with_fault(monkeypatch: pytest.MonkeyPatch, file: str, before: str, after: str) -> ModuleType:
    """What encloses motions, after a text is replaced in a file, which has it once."""
    for name, source in SOURCES.items():
        text = source.read_text()
        if source.stem == file:
            assert text.count(before) == 1
            text = text.replace(before, after)
        module = ModuleType(name)
        module.__package__ = name.rpartition(".")[0]
        monkeypatch.setitem(sys.modules, name, module)
        exec(compile(text, name, "exec"), module.__dict__)
    return module


@pytest.mark.parametrize("fault", ENDS["fault"], ids=lambda fault: fault[0])
def test_planted_faults_are_noticed(fault: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """By the checker, which is another program."""
    faulty = with_fault(monkeypatch, *fault[1:])
    confirmed = []
    for name, case in SMALL.items():
        try:
            enclose(**case, check=True, by=faulty)
            confirmed.append(name)
        except UserError as error:
            assert "not confirmed" in str(error)
            return
    pytest.fail(f"confirmed: {confirmed}")


def test_without_a_fault_all_is_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is planted is what is noticed."""
    same = with_fault(monkeypatch, "", "", "")
    for case in SMALL.values():
        assert enclose(**case, check=True, by=same).checked > 1
