"""Runs of instances that are reset: those of simulations and of the master, to the last bit."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from rparm.campaign import bases
from rparm.campaign.instances import Alone
from rparm.campaign.job import LYAPUNOV
from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import simulate
from rparm.systems import ssp
from rparm.systems.master import Master
from rparm.systems.opened import opened
from tests.campaign.files import ARM, FILES, HEAD, campaign
from tests.campaign.runners import rows, runner
from tests.support.paths import ROOT
from tests.support.rparm_project import BUILD, FMUS, fmi3_fmu, load
from tests.support.ssp_files import EXPERIMENT, FROM_TRAJECTORY, SETS, TYPES, without

OSCILLATOR = BUILD / "tests" / "oscillator" / "Oscillator.fmu"
OUTPUTS = ("q1", "q2", "dq1", "dq2", "total_energy", "ee_x")


def assert_bits_of_simulation(record: np.ndarray, names: Sequence[str], run: Scenario) -> None:
    with Fmu(FMUS[run.model]) as fmu:
        result = simulate(fmu, run)
    for i, name in enumerate(names):
        assert np.array_equal(record[:, i], result.values[:, result.names.index(name)])


@pytest.mark.parametrize(
    "name", ["hanging_swing", "sine_efforts", "irregular_steps", "grasp_at_rest"]
)
def test_a_run_has_the_bits_of_a_simulation(name: str, tmp_path: Path) -> None:
    """With inputs of all kinds, Boolean ones too."""
    scenario = load(name)
    changes = [("hanging_swing", name), ("time = { stop = 1.0 }\n", "")]
    if scenario.model == "rp_plant":
        changes.append(('integral = ["actuator_power"]\n', ""))
        assert any(values.dtype == bool for values in scenario.inputs.values())
    with runner(campaign(tmp_path, changes=changes), tmp_path, OUTPUTS) as (runs, job, points):
        record = rows(runs, job, points, [17]).trajectories[17]
        m2, q1 = points.of(range(17, 18))[0]
    changed = dataclasses.replace(
        scenario,
        parameters=scenario.parameters | {"m2": m2},
        initial=scenario.initial | {"q1": q1},
        reference_every=1,
    )
    assert_bits_of_simulation(record, job.watched, changed)


def test_what_cannot_be_reset_is_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with runner(campaign(tmp_path), tmp_path) as (runs, job, points):
        expected = rows(runs, job, points, [0, 1, 2])

    def refused(_: Alone) -> None:
        raise UserError("no reset")

    monkeypatch.setattr(Alone, "reset", refused)
    with runner(campaign(tmp_path), tmp_path) as (runs, job, points):
        found = rows(runs, job, points, [0, 1, 2])
    assert found.failures == [""] * 3
    assert found.measures.tobytes() == expected.measures.tobytes()


SYSTEM = HEAD + (
    'system = "closed_loop"\nvariant = "heavy_payload"\nsampling = "random"\nruns = 3\n'
    "time = { stop = 1.0 }\n[set]\n'arm.relative_tolerance' = 1e-9\n"
    "[parameters.'arm.m2']\nuniform = [0.9, 1.4]\n[keep]\nfinal = ['arm.q1', 'controller.tau1']\n"
    "trajectories = [1]\n[keep.tracking.tip]\n"
    "of = [['arm.ee_x', 'trajectory.ee_x_ref'], ['arm.ee_y', 'trajectory.ee_y_ref']]\n"
)


def test_a_run_of_a_system_has_the_bits_of_the_master(tmp_path: Path) -> None:
    with runner(campaign(tmp_path, SYSTEM), tmp_path) as (runs, job, points):
        found = rows(runs, job, points, [0, 1])
        m2 = points.of(range(1, 2))[0, 0]
    with ssp.unpacked(BUILD / "ClosedLoop.ssp") as opened:
        parameters = opened.system.parameter_sets["heavy_payload"]
        parameters["arm"] |= {"relative_tolerance": 1e-9, "m2": m2}
        names = [component.name for component in opened.system.components]
        fmus = {name: Fmu(opened.fmu(name)) for name in names}
        real = [c for c in opened.system.connections if c.start_connector != "payload_attached"]
        with Master(fmus, real) as master:
            master.initialize(0.0, 1.0, parameters)
            expected = master.run(job.times)
        for fmu in fmus.values():
            fmu.close()
    columns = [master.names.index(name) for name in job.watched]
    assert np.array_equal(found.trajectories[1], expected[:, columns])
    tip = expected[:, [master.names.index(f"arm.ee_{x}") for x in "xy"]]
    tip -= expected[:, [master.names.index(f"trajectory.ee_{x}_ref") for x in "xy"]]
    largest = np.max(np.hypot(*tip.T))
    assert found.measures[1, 2] == pytest.approx(largest, rel=1e-12)


def test_booleans_go_through_a_system(tmp_path: Path) -> None:
    # the gripper's signal makes controller and plant carry the payload
    text = HEAD + (
        'system = "machine"\nvariant = "pick_and_place"\nsampling = "random"\nruns = 1\n'
        "[parameters.'plant.payload_mass']\nvalues = [1.0]\n[keep]\n"
        "final = ['plant.q1', 'plant.q2', 'plant.dq1', 'plant.dq2']\ntrajectories = [0]\n"
    )
    with runner(campaign(tmp_path, text), tmp_path) as (runs, job, points):
        record = rows(runs, job, points, [0]).trajectories[0]
    path = ROOT / "models" / "machine" / "references" / "pick_and_place" / "ecos.csv"
    names = path.read_text(encoding="utf-8").splitlines()[0].replace('"', "").split(",")
    reference = np.loadtxt(path, delimiter=",", skiprows=1)
    steps = np.rint(reference[:, 0] / 1e-3).astype(int)
    assert steps[-1] == job.steps == 4000
    for i, name in enumerate(job.watched):
        expected = reference[:, names.index(name)]
        assert np.max(np.abs(record[steps, i] - expected)) < 1e-7 * np.max(np.abs(expected))


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_events_and_counters_are_those_of_a_simulation(version: str, tmp_path: Path) -> None:
    name = "thrown_against_stop"
    path = FMUS["rp_plant"] if version == "2.0" else fmi3_fmu(FMUS["rp_plant"])
    text = HEAD + (
        f'scenario = "{name}"\nsampling = "grid"\n[parameters.dq2]\nvalues = [0.0, 2.5, 3.2]\n'
        "[keep]\nfinal = ['solver_steps', 'last_event_time', 'event_count']\n"
        "maximum = ['last_event_time']\n"
    )
    with runner(campaign(tmp_path, text), tmp_path, fmu=path) as (runs, job, points):
        assert [m.column for m in job.measures] == [
            *("final(solver_steps)", "final(last_event_time)", "final(event_count)"),
            "maximum(last_event_time)",
        ]
        found = rows(runs, job, points, range(3))
    scenario = load(name)
    counts = set()
    for dq2, (steps, last, count, largest) in zip((0.0, 2.5, 3.2), found.measures, strict=True):
        changed = dataclasses.replace(
            scenario,
            initial=scenario.initial | {"dq2": dq2},
            panels=(("event_count",),),
            reference_every=1,
        )
        with Fmu(path) as fmu:
            result = simulate(fmu, changed)
        counted = result.integers["event_count"]
        assert (steps, count) == (result.solver_steps, counted[-1])
        row = int(np.flatnonzero(np.diff(counted))[-1])  # of the step with the last event
        assert result.times[row] < last <= result.times[row + 1]
        assert largest == last
        counts.add(count)
    assert len(counts) == 3


def test_a_run_that_fails_says_why_and_harms_no_other(tmp_path: Path) -> None:
    # the mass of link 2 becomes negative in some runs, which the FMU refuses
    changes = [("normal = [-2.0, 0.2]", "uniform = [-3.0, 3.0]"), ("[keep]", "[derived]\nI1z = "
               "\"q1\"\n[keep]")]  # fmt: skip
    given = campaign(tmp_path, changes=changes)
    with runner(given, tmp_path) as (runs, job, points):
        numbers = list(range(given.count))
        found = rows(runs, job, points, numbers)
        values = points.of(range(given.count))
        failed = values[:, points.names.index("I1z")] < 0
        good = [n for n in numbers if not failed[n]]
        alone = rows(runs, job, points, good)
    assert 5 < np.count_nonzero(failed) < 35
    assert [bool(text) for text in found.failures] == failed.tolist()
    assert all("I1z" in text for text in found.failures if text)
    assert np.isnan(found.measures[failed]).all()
    assert np.array_equal(found.measures[~failed], alone.measures)
    assert not any(alone.failures)


def test_a_value_that_is_not_defined_is_a_failed_run(tmp_path: Path) -> None:
    given = campaign(tmp_path, changes=[("[keep]", '[derived]\ndq1 = "sqrt(q1 + 2)"\n[keep]')])
    with runner(given, tmp_path) as (runs, job, points):
        found = rows(runs, job, points, range(8))
        undefined = points.of(range(8))[:, 1] < -2
    assert 0 < np.count_nonzero(undefined) < 8
    expected = ["dq1: its value is not defined" if x else "" for x in undefined]
    assert found.failures == expected


def test_an_input_can_be_a_parameter(tmp_path: Path) -> None:
    changes = [("[parameters.m2]\nuniform = [1.0, 3.0]", "[parameters.f2]\nvalues = [-21.5]"),
               ("normal = [-2.0, 0.2]", "values = [-2.22]")]  # fmt: skip
    with runner(campaign(tmp_path, changes=changes), tmp_path) as (runs, job, points):
        record = rows(runs, job, points, [3]).trajectories[3]
    scenario = load("hanging_swing")
    held = {"f2": np.full(len(scenario.times), -21.5)}
    changed = dataclasses.replace(
        scenario, inputs=held, initial={"q1": -2.22, "q2": 0.25}, reference_every=1
    )
    with Fmu(FMUS["rp_manipulator"]) as fmu:
        result = simulate(fmu, changed)
    q1 = result.values[: len(record), result.names.index("q1")]
    assert np.allclose(record[:, 0], q1, rtol=0, atol=1e-9)


def growth_of_a_deviation(
    folder: Path,
    text: str,
    changes: Sequence[tuple[str, str]],
    start: Mapping[str, float],
    size: float,
) -> float:
    """By how much two runs part that begin half of `size` before and behind a start in each state.

    `text` varies q1 and keeps q1, q2, dq1, dq2 first.
    """
    ends = []
    for sign in (-1, 1):
        moved = {name: value + sign * size / 2 for name, value in start.items()}
        lines = "".join(f"{n} = {v!r}\n" for n, v in moved.items() if n != "q1")
        shifted = text.replace("[set]\n", f"[set]\n{lines}")
        shifted = shifted.replace(f"values = [{start['q1']}]", f"values = [{moved['q1']!r}]")
        with runner(campaign(folder, shifted, changes), folder) as (runs, job, points):
            ends.append(rows(runs, job, points, [0]).measures[0, :4])
    return float(np.linalg.norm(ends[1] - ends[0]) / (2 * size))  # of a deviation of length 2 size


def test_the_exponent_is_the_growth_of_a_small_deviation(tmp_path: Path) -> None:
    text = ARM[: ARM.index("[parameters.m2]")] + (
        "[set]\nrelative_tolerance = 5e-12\n[parameters.q1]\nvalues = [-1.0]\n"
        "[keep]\nlyapunov = true\nfinal = ['q1', 'q2', 'dq1', 'dq2']\n"
    )
    changes = [("stop = 1.0", "stop = 2.0, step = 0.001"), ("runs = 40", "runs = 1"),
               ('"sobol"', '"random"')]  # fmt: skip
    given = campaign(tmp_path, text, changes)
    size = 1e-6
    with runner(given, tmp_path) as (runs, job, points):
        found = rows(runs, job, points, [0])
        assert job.measures[-1].column == LYAPUNOV
    start = {"q1": -1.0, "q2": 0.25, "dq1": 0.0, "dq2": 0.0}
    growth = growth_of_a_deviation(tmp_path, text, changes, start, size)
    assert found.measures[0, -1] == pytest.approx(np.log(growth) / 2.0, abs=1e-5)


PLANT = HEAD + FILES["PLANT"]


def test_the_exponent_passes_springs_and_has_no_value_where_a_deviation_jumps(
    tmp_path: Path,
) -> None:
    """At a spring derivatives are continuous; at an impact and under dry friction they are not."""
    size = 1e-7
    start = {"q1": 0.4, "q2": 0.0, "dq1": 0.0, "dq2": 0.4}
    text = PLANT.replace("[set]\n", "[set]\nq2 = 0.0\ndq2 = 0.4\n")
    with runner(campaign(tmp_path, text), tmp_path) as (runs, job, points):
        (found,) = rows(runs, job, points, [0]).measures
        columns = [measure.column for measure in job.measures]
    assert found[columns.index("final(event_count)")] > 2
    states = [columns.index(f"final({name})") for name in ("q1", "q2", "dq1", "dq2")]
    growth = growth_of_a_deviation(tmp_path, PLANT, (), start, size)
    exponent = found[columns.index(LYAPUNOV)]
    assert exponent == pytest.approx(np.log(growth) / 0.5, abs=2e-3)
    for change in (
        ("upper2 = 0.01", 'upper2 = 0.01\nstops2 = "rigid"'),
        (
            "coulomb_friction2 = 0.0\nbreakaway_friction2 = 0.0",
            "coulomb_friction2 = 0.5\nbreakaway_friction2 = 0.5",
        ),
    ):
        with runner(campaign(tmp_path, text, [change]), tmp_path) as (runs, job, points):
            (other,) = rows(runs, job, points, [0]).measures
        assert np.isnan(other[columns.index(LYAPUNOV)]) and np.isfinite(other[states]).all()


def test_a_system_without_parameter_sets_varies_inputs_that_nothing_feeds(tmp_path: Path) -> None:
    """Computed torque brings the joint to its reference: poles at -20."""
    bare = without(tmp_path / "bare.ssp", SETS, EXPERIMENT, TYPES, FROM_TRAJECTORY)
    text = (
        f'{HEAD}system = "{bare.name}"\nsampling = "grid"\ntime = {{ stop = 1.0 }}\n'
        '[parameters."controller.q1_ref"]\nvalues = [0.1, 0.2]\n[keep]\nfinal = ["arm.q1"]\n'
    )
    given = campaign(tmp_path, text)
    with bases.opened(given, None, tmp_path / "test.toml") as base:
        *times, alone = base.questions
    assert "bare.ssp: communication step 0.001 s" in times[-1] and "controller.q1_ref" in alone
    with runner(given, tmp_path, fmu=bare) as (runs, job, points):
        found = rows(runs, job, points, [0, 1]).measures[:, 0]
    assert found == pytest.approx([0.1, 0.2], rel=1e-6)
    wrong = campaign(tmp_path, text.replace("stop = 1.0", "stop = 1.0, step = 0.3"))
    said = r"test: \[time\]: step: expected a whole number of steps in 1 s, got 0\.3 s$"
    with pytest.raises(UserError, match=said), bases.opened(wrong, bare, Path("test")):
        pass


LAW = """
class Law:
    inputs = ["x", "reference", "off"]
    outputs = ["u"]
    types = {"off": bool}
    kp = 1.0
    integral = 0.0

    def step(self, t, h, inputs):
        if self.kp < 0:
            raise ValueError("kp")
        self.integral += h * (inputs["reference"] - inputs["x"])
        return {"u": 0.0 if inputs["off"] else self.kp * self.integral}


class Guard:
    inputs = ["x"]
    outputs = ["off"]
    types = {"off": bool}

    def step(self, t, h, inputs):
        return {"off": inputs["x"] > 0.05}
"""


def test_a_loop_file_with_python_has_the_bits_of_the_master(tmp_path: Path) -> None:
    """And a run whose code raises says where, and harms no other."""
    (tmp_path / "law.py").write_text(LAW)
    (tmp_path / "loop.toml").write_text(
        f'name = "Loop"\nstep = 0.05\nstop = 1\n[components]\nplant = "{OSCILLATOR.as_posix()}"\n'
        'law = "law.py:Law"\nguard = "law.py:Guard"\n[connections]\n"plant.u" = "law.u"\n'
        '"law.x" = "plant.x"\n"guard.x" = "plant.x"\n"law.off" = "guard.off"\n'
        '[inputs]\n"law.reference" = { sines = [{ amplitude = 2, frequency = "1 Hz" }] }\n'
        '[parameters]\n"plant.omega" = 3\n[variants.stiff]\n"plant.omega" = 9\n'
    )
    text = (
        f'{HEAD}system = "loop.toml"\nsampling = "grid"\n[parameters."law.kp"]\n'
        'values = [2.0, -1.0, 0.5]\n[parameters."plant.x"]\nvalues = ["10 cm", 1.0]\n'
        '[keep]\nfinal = ["plant.x", "law.u"]\ntrajectories = [0, 5]\n'
    )
    given = campaign(tmp_path, text)
    with bases.opened(given, None, tmp_path / "test.toml") as base:
        given = bases.in_si(given, base, "test")
    with runner(given, tmp_path, fmu=tmp_path / "loop.toml") as (runs, job, points):
        found = rows(runs, job, points, range(6))
    assert [bool(text) for text in found.failures] == [False, False, True, True, False, False]
    assert f"law: {tmp_path / 'law.py'}, line 11: ValueError: kp (" in found.failures[2]
    with opened(tmp_path / "loop.toml") as system, system.unpacked_fmus() as fmus:
        signals = system.system.inputs
        for run, kp, x in ((0, 2.0, 0.1), (5, 0.5, 1.0)):
            with Master(fmus, system.system.connections, signals=signals) as master:
                values = {"plant": {"omega": 3.0, "x": x}, "law": {"kp": kp}}
                master.initialize(0.0, 1.0, values)
                expected = master.run(job.times)
            columns = [master.names.index(name) for name in job.watched]
            assert np.array_equal(found.trajectories[run], expected[:, columns])
    assert np.abs(expected).max() > 0.1
