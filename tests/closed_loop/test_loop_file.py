"""Loop files: mistakes in them, and what loops of them do, against own simulations."""

import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from scipy.integrate import solve_ivp

import rparm
from rparm import building
from rparm.errors import UserError
from rparm.federation import federation, network
from rparm.report import block_diagram
from rparm.systems import comparison, ecos, ssp_writer
from rparm.systems.master import Master, run_in_master
from rparm.systems.opened import opened
from rparm.systems.structure import OpenedSystem
from tests.campaign.files import HEAD, campaign
from tests.campaign.runners import rows, runner
from tests.support.programs import python
from tests.support.rparm_project import BUILD, Console, repacked
from tests.support.tables import tables

TABLES = tables(__file__)
NAMES = ["plant.phi", "plant.omega", "law.torque"]
FINE = {"rtol": 1e-12, "atol": 1e-13}
MASSES = {"default": 1.0, "heavy": 2.0}
WAVE = "{ sines = [{ amplitude = 0.5, frequency = 0.7 }], offset = 0.2 }"


# ---- Mistakes ------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with files that no loop can use."""
    found = tmp_path_factory.mktemp("beside")
    (found / "law.py").write_text("def law(t, h, inputs): ...", encoding="utf-8")
    (found / "TEXT.fmu").write_text("no archive", encoding="utf-8")
    repacked(BUILD / "RPManipulator.fmu", found / "TOY.fmu", str, drop="binaries")
    (found / "other.ssp").touch()
    return found


@pytest.mark.parametrize("mistake", TABLES["mistakes"], ids=lambda row: row[2][:40])
def test_a_mistake_is_refused_in_a_line(
    mistake: list[str], beside: Path, tmp_path: Path, console: Console
) -> None:
    old, new, message = mistake
    assert TABLES["good"].count(old) == 1
    path = beside / "self.toml"
    path.write_text(TABLES["good"].replace(old, new), encoding="utf-8")
    error = console.refused("system", path, "--output", tmp_path / "report")
    assert error.startswith(f"error: {path}: ") and message in error
    assert error.count(f"{path}: ") == 1


@pytest.mark.parametrize("command", TABLES["kinds"])
def test_a_file_of_another_kind_is_refused_by_name(
    command: str, tmp_path: Path, console: Console
) -> None:
    expected, path = TABLES["kinds"][command][0], tmp_path / "file.toml"
    for other, (kind, text) in TABLES["kinds"].items():
        path.write_text(f"name = 'X'\n{text}\n", encoding="utf-8")
        if other != command and (command, other) != ("build", "system"):  # that builds one FMU
            way_out = TABLES["writers"].get(command) if other == "build" else None
            way_out = (way_out or f"{other} FILE takes it").replace("FILE", str(path))
            wrong = f"{path}: is {kind}, expected {expected}: ./run.sh {way_out}"
            assert console.refused(command, path) == f"error: {wrong}\n"


# ---- A loop --------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of a loop, and one whose input moves, of FMUs that are built here once."""
    found = tmp_path_factory.mktemp("loop")
    for name, text in TABLES["loop"].items():
        (found / name).write_text(text, encoding="utf-8")
    with opened(found / "loop.toml") as system:
        for component, name in (("plant", "pendulum.fmu"), ("law", "law.fmu")):
            shutil.copy(system.fmu(component), found / name)
    text = TABLES["loop"]["loop.toml"].replace('pendulum.toml"', 'pendulum.fmu"')
    text = text.replace('law.toml"', 'law.fmu"')
    (found / "loop.toml").write_text(text, encoding="utf-8")
    (found / "wave.toml").write_text(text.replace("{ constant = 1.0 }", WAVE), encoding="utf-8")
    return found


@pytest.fixture
def loop(folder: Path) -> Iterator[OpenedSystem]:
    with opened(folder / "loop.toml") as system:
        yield system


def with_step(system: OpenedSystem, step: float) -> OpenedSystem:
    return replace(system, system=replace(system.system, step=step))


def wanted(file: str, time: float) -> float:
    return 1.0 if file == "loop.toml" else 0.2 + 0.5 * np.sin(2 * np.pi * 0.7 * time)


def held(file: str, mass: float, step: float, steps: int) -> np.ndarray:
    """The loop in Jacobi order, by hand: rows of `NAMES`.

    Over a step all inputs are those of its beginning. A torque follows the speed at once, so the
    plant gets it a step later than its part by the error, which is a state.
    """
    phi, omega, error, torque = 0.5, 0.0, 0.0, 0.0
    rows = [(phi, omega, torque)]
    for i in range(steps):
        plant = solve_ivp(
            lambda _, x, u=torque: [x[1], u / mass - 9 * np.sin(x[0])],
            (0, step), [phi, omega], **FINE,
        )  # fmt: skip
        limit = wanted(file, i * step) - phi
        error = limit + (error - limit) * np.exp(-step / 0.2)
        torque = 30 * error - 2 * omega
        phi, omega = plant.y[:, -1]
        rows.append((phi, omega, 30 * error - 2 * omega))
    return np.array(rows)


@pytest.mark.parametrize("file", ["loop.toml", "wave.toml"])
@pytest.mark.parametrize("variant", MASSES)
def test_inputs_are_held_over_each_step(folder: Path, file: str, variant: str) -> None:
    with opened(folder / file) as system:
        step = system.system.step
        run = run_in_master(system, variant, NAMES)
        expected = held(file, MASSES[variant], step, system.system.steps)
        np.testing.assert_allclose(run.values, expected, atol=1e-8)
        if file == "loop.toml":
            # Ecos adds up steps to times, which rounds
            other = ecos.run(system, variant, NAMES).values
            np.testing.assert_allclose(other, run.values, rtol=0, atol=1e-11)
        else:
            assert ecos.unsuited(system) == "law.wanted moves"


def continuous(mass: float, stop: float) -> np.ndarray:
    """Plant and law in one simulation: phi, omega and torque at each millisecond."""

    def slopes(_: float, x: np.ndarray) -> list[float]:
        phi, omega, error = x
        torque = 30 * error - 2 * omega
        return [omega, torque / mass - 9 * np.sin(phi), (1.0 - phi - error) / 0.2]

    times = np.linspace(0, stop, round(1000 * stop) + 1)
    phi, omega, error = solve_ivp(slopes, (0, stop), [0.5, 0, 0], t_eval=times, **FINE).y
    return np.column_stack([phi, omega, 30 * error - 2 * omega])


def test_the_coupling_error_is_of_first_order_and_as_estimated(loop: OpenedSystem) -> None:
    exact = continuous(1.0, 2.0)
    errors = {}
    for milliseconds in (4, 2, 1):
        finer = with_step(loop, milliseconds / 1000)
        outcome = comparison.run_alone(finer, "default", NAMES, run_in_master)
        apart = np.abs(outcome.run.values - exact[::milliseconds]).max(axis=0)
        errors[milliseconds] = apart
        # one scale, since no variable has a unit
        estimated = np.array([outcome.errors[name] for name in NAMES]) * np.abs(exact).max()
        np.testing.assert_allclose(estimated, apart, rtol=0.05)
    np.testing.assert_allclose(errors[4] / errors[2], 2.0, rtol=0.05)
    np.testing.assert_allclose(errors[2] / errors[1], 2.0, rtol=0.03)


def test_integers_go_from_component_to_component(tmp_path: Path) -> None:
    """Each counter adds one to what the other has counted before the step."""
    for name, text in TABLES["counters"].items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    build = ("-m", "pythonfmu", "build", "-f", tmp_path / "counter.py", "-d", tmp_path)
    python(*build, check=True)
    with opened(tmp_path / "loop.toml") as system:
        assert ecos.unsuited(system) == "there are connections of type Integer"
        run = run_in_master(system, "default", comparison.kept(system))
    assert run.values.tolist() == [[i, i] for i in range(11)]


# ---- The start ----------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an FMU of FMI 2.0 with a sampler, and one of FMI 3.0 in its folder fmi3."""
    found = tmp_path_factory.mktemp("start")
    (found / "part.toml").write_text(TABLES["start"]["part.toml"], encoding="utf-8")
    building.build(found / "part.toml", output=found, lock=False)
    return found


def joined(folder: Path, connections: str, more: str = "") -> Path:
    """A loop file of three parts."""
    (folder / "loop.toml").write_text(f"{TABLES['start']['head']}{connections}\n{more}")
    return folder / "loop.toml"


@pytest.mark.parametrize(("connections", "u", "why_not"), TABLES["start"]["ways"])
@pytest.mark.parametrize("version", ["", "fmi3"])
def test_the_first_step_has_what_samplers_set_at_the_start(
    parts: Path, version: str, connections: str, u: float, why_not: str
) -> None:
    """x' = u - x from 0, whose input is constant from the start on, in all masters."""
    with opened(joined(parts / version, connections)) as system:
        times, names = system.system.times, ["p.x"]
        exact = u * (1 - np.exp(-times))
        assert ecos.unsuited(system) == why_not
        found = [run_in_master(system, "default", names).values[:, 0]]
        with system.unpacked_fmus() as fmus:
            ways = [("jacobi", "held"), ("gauss_seidel", "held"), ("gauss_seidel", "extrapolated")]
            for way in ways:
                with Master(fmus, system.system.connections, *way) as master:
                    master.initialize(0.0, 1.0)
                    found.append(master.run(times)[:, master.names.index("p.x")])
        if not why_not:  # else Ecos is a step late
            found.append(ecos.run(system, "default", names).values[:, 0])
        text = (
            f'{HEAD}system = "loop.toml"\nsampling = "grid"\n[parameters."p.more"]\n'
            'values = [1.0]\n[keep]\nfinal = ["p.x"]\ntrajectories = [0]\n'
        )
        with runner(campaign(parts, text), parts, fmu=system.path) as (runs, job, points):
            record = rows(runs, job, points, [0]).trajectories[0]
            found.append(record[:, job.watched.index("p.x")])
    for values in found:
        np.testing.assert_allclose(values, exact, rtol=0, atol=1e-8)


def test_a_federation_has_what_samplers_set_at_the_start(parts: Path) -> None:
    connections, u, _ = TABLES["start"]["ways"][3]
    with opened(joined(parts, connections)) as system:
        record = federation.run(system, "default", network.free_address())
        values = record.values[:, record.names.index("p.x")]
        np.testing.assert_allclose(values, u * (1 - np.exp(-record.times)), rtol=0, atol=1e-8)
    with (
        opened(joined(parts, TABLES["start"]["ways"][2][0])) as system,
        pytest.raises(UserError, match=r"^s: hot changed by t = 0\.0 s; only Real values"),
    ):
        federation.run(system, "default", network.free_address())


def test_a_loop_that_fmus_do_not_declare_has_no_solution(parts: Path) -> None:
    """x = x + 2, through both."""
    repacked(
        parts / "Part.fmu", parts / "Open.fmu",
        lambda text: re.sub(r' dependencies(Kind)?="[^"]*"', "", text),
    )  # fmt: skip
    file = joined(parts, '"a.u" = "s.more_by_1"\n"s.u" = "a.more_by_1"')
    file.write_text(file.read_text().replace("Part.fmu", "Open.fmu"))
    with opened(file) as system:
        assert ecos.unsuited(system).startswith("its FMUs do not exclude an algebraic loop")
        wrong = r"^no solution of the algebraic loop of 2 connections .* is off by 1 "
        with pytest.raises(UserError, match=wrong):
            run_in_master(system, "default", ["p.x"])


def thermostat() -> np.ndarray:
    """The thermostat's loop by hand: temperature, heating, switches and windows at the points."""
    rows = [(290.0, 1, 0, 0)]
    on = True
    for _ in range(200):
        temperature, heating, switches, windows = rows[-1]
        limit = 280.0 + 20.0 * heating
        warmed = limit + (temperature - limit) * np.exp(-20.0 / 900.0)
        now = temperature < 293.15 + (0.5 if on else -0.5) and windows == 0
        count, on = switches + (now != on), now
        rows.append((warmed, int(now), count, 2 if switches == 2 else 0))
    return np.array(rows)


def test_python_has_booleans_integers_and_units(tmp_path: Path) -> None:
    """With the user's types in `step`, by the loop and, packed, by engines."""
    for name, text in TABLES["thermostat"].items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    columns = ["room.T", "law.heating", "law.switches", "person.windows"]
    expected = thermostat()
    assert expected[-1, 2] > 4 and expected[:, 3].any()
    table = rparm.System(tmp_path / "loop.toml").run()
    np.testing.assert_allclose(np.array([table[x] for x in columns]).T, expected, rtol=1e-13)
    assert table.units["room.T"] == "K"
    with opened(tmp_path / "loop.toml") as system:
        ssp_writer.write(tmp_path / "Loop.ssp", system)
    packed = rparm.System(tmp_path / "Loop.ssp").run()
    assert all(packed[x].tobytes() == table[x].tobytes() for x in columns)
    with opened(tmp_path / "Loop.ssp") as system:
        assert system.variable("law.target").unit == "K"
    text = TABLES["thermostat"]["loop.toml"]
    for old, new, said in (
        ('"law.heating"', '"law.switches"', "types differ, Integer and Boolean"),
        ('"20 degC"', '"20 m"', "law.target: unknown unit 'm'"),
    ):
        (tmp_path / "wrong.toml").write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(UserError, match=said):
            rparm.System(tmp_path / "wrong.toml")


# ---- The command ---------------------------------------------------------------------------------
def test_the_command_runs_variants_and_writes_their_pages(
    folder: Path, tmp_path: Path, console: Console
) -> None:
    given, output = ("system", folder / "loop.toml"), ("--output", tmp_path)
    code, out, _ = console(*given, *output, "--json", "--step", "5ms")
    document = json.loads(out)
    assert code == 0 and [x["name"] for x in document["variants"]] == ["default", "heavy"]
    for x in document["variants"]:
        assert x["steps"] == 400 and x["coupling_worst"] == "law.torque"
        assert 0.01 < x["coupling_error"] < 0.5 and "passed" not in x
        page = (tmp_path / f"system/Swing_{x['name']}.html").read_text(encoding="utf-8")
        assert "by half the step" in page and 'src="Swing.svg"' in page and "Ecos" in page
        head = (tmp_path / f"system/Swing_{x['name']}.csv").read_text(encoding="utf-8")
        assert head.startswith('"time","plant.phi","plant.omega","law.torque"\n')
    assert "no variant 'heavi', did you mean 'heavy'?" in console.refused(*given, "heavi", *output)
    code, out, _ = console("system", folder / "wave.toml", "heavy", *output)
    assert code == 0 and "law.wanted moves: the master of rparm steps Swing" in out
    assert out.count(" completed\n") == 1 and "completed: 1 variant" in out


def test_each_signal_is_drawn_from_block_to_block(loop: OpenedSystem) -> None:
    root = etree.fromstring(block_diagram.draw(loop).encode())
    space = {"s": root.nsmap[None]}
    blocks = root.findall("s:rect", space)
    sides = [(float(b.get("x")), float(b.get("x")) + float(b.get("width"))) for b in blocks]
    texts = [text.text for text in root.findall("s:text", space)]
    assert len(blocks) == 2 and {"plant", "law", "Pendulum", "phi, omega", "torque"} <= {*texts}
    ends = set()
    for line in root.findall("s:path", space):
        numbers = re.fullmatch(r"M(\d+) .* H(\d+)", line.get("d"))
        assert numbers is not None
        start, end = map(float, numbers.groups())
        ends.add(([x[1] for x in sides].index(start), [x[0] for x in sides].index(end)))
    assert ends == {(0, 1), (1, 0)}
