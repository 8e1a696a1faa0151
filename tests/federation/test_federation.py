"""The closed loop as a federation: each FMU in its own process, coupled by HELICS."""

import json
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rparm import project
from rparm.errors import UserError
from rparm.federation import federation, network
from rparm.federation.component import parts, real_connections
from rparm.fmi.fmu_file import Fmu
from rparm.systems import ssp
from rparm.systems.master import Master
from rparm.systems.opened import opened
from rparm.systems.structure import OpenedSystem
from tests.federation.processes import Start, ended
from tests.support.programs import RPARM, python
from tests.support.rparm_project import BUILD, MISTAKES, Console
from tests.support.ssp_files import SSP, edited, replace

STRUCTURE = "SystemStructure.ssd"
SHORT = replace('stopTime="6"', 'stopTime="1"')
ARM = "resources/arm_nominal.ssv"
TOLERANCE = (
    '<ssv:Parameter name="relative_tolerance"><ssv:Real value="1e-11" unit="1"/></ssv:Parameter>'
)


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OpenedSystem]:
    """The closed loop, of 1 s."""
    path = edited(SSP, tmp_path_factory.mktemp("ssp") / "Short.ssp", {STRUCTURE: SHORT})
    with ssp.unpacked(path) as system:
        yield system


def by_the_master(system: OpenedSystem, variant: str) -> tuple[tuple[str, ...], np.ndarray]:
    """Names and values at all communication points of the Jacobi master, in this process."""
    fmus = {c.name: Fmu(system.fmu(c.name)) for c in system.system.components}
    try:
        times = next(iter(parts(system, variant).values())).times
        with Master(fmus, real_connections(system)) as master:
            master.initialize(times[0], times[-1], system.system.parameter_sets[variant])
            return master.names, master.run(times)
    finally:
        for fmu in fmus.values():
            fmu.close()


def test_values_are_those_of_the_master(short: OpenedSystem) -> None:
    variant = "heavy_payload_integral"
    record = federation.run(short, variant, network.free_address())
    names, rows = by_the_master(short, variant)
    assert set(record.names) == set(names)
    expected = rows[:, [names.index(name) for name in record.names]]
    scale = np.maximum(np.abs(expected).max(axis=0), 1e-300)
    assert record.values.shape == (1001, len(names))
    assert np.abs((record.values - expected) / scale).max() <= 1e-12
    assert np.abs(rows[-1] - rows[0]).max() > 1e-3, "nothing has moved"


def test_a_loop_file_with_python_and_a_signal_is_as_by_the_master(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(
        "def step(t, h, inputs):\n    return {'u': inputs['r'] - 2 * inputs['x']}\n"
    )
    file = tmp_path / "loop.toml"
    file.write_text(
        f'name = "Loop"\nstep = 0.05\nstop = 1\n[components]\nlaw = "law.py"\n'
        f'plant = "{(BUILD / "tests" / "oscillator" / "Oscillator.fmu").as_posix()}"\n'
        '[connections]\n"plant.u" = "law.u"\n"law.x" = "plant.x"\n'
        '[inputs]\n"law.r" = { table = [[0, 0], [0.5, 3]] }\n'
    )
    with opened(file) as system, system.unpacked_fmus() as fmus:
        record = federation.run(system, "default", network.free_address())
        with Master(fmus, system.system.connections, signals=system.system.inputs) as master:
            master.initialize(0.0, 1.0)
            expected = master.run(record.times)
    columns = [master.names.index(name) for name in record.names]
    assert np.array_equal(record.values, expected[:, columns])
    assert np.abs(np.diff(record.values[:, record.names.index("law.u")])).max() > 0.1


def test_components_are_of_the_version_that_is_asked_for(
    tmp_path: Path, console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(project.BUILD_FOLDERS, "3.0", str(tmp_path))
    file = tmp_path / "loop.toml"
    file.write_text('name = "Loop"\n[components]\nplant = "RPPlant"\n')
    error = console.refused("federation", file, "--fmi", "3")
    assert f"[components] plant: {tmp_path}: has no FMU of rp_plant" in error


def test_a_component_may_be_stepped_elsewhere(short: OpenedSystem, start: Start) -> None:
    """By a command that is started first, as on another machine."""
    address = network.free_address()
    arguments = federation.arguments(short.path, "nominal", "arm", address)
    other = start(*arguments)
    time.sleep(8.0)  # longer than HELICS itself would wait, 4 s
    record = federation.run(short, "nominal", address, elsewhere=["arm"])
    assert ended(other) == f"waiting for a federation at {address}\n"
    together = federation.run(short, "nominal", network.free_address())
    assert np.array_equal(record.values, together.values)


# Each value may be 0, all of them together may not: only the FMU knows.
def test_what_an_fmu_refuses_is_the_message(tmp_path: Path) -> None:
    none = TOLERANCE.replace("relative_tolerance", "I1z").replace("1e-11", "0")
    none += TOLERANCE.replace("relative_tolerance", "I2z").replace("1e-11", "0")
    none += TOLERANCE.replace("relative_tolerance", "m1").replace("1e-11", "0")
    none = none.replace('unit="1"', 'unit="kg.m2"', 2).replace('unit="1"', 'unit="kg"')
    changes = {STRUCTURE: SHORT, ARM: replace(TOLERANCE, none)}
    path = edited(SSP, tmp_path / "NoInertia.ssp", changes)
    with ssp.unpacked(path) as system, pytest.raises(UserError, match="arm: .* I1z"):
        federation.run(system, "nominal", network.free_address())


def test_it_is_a_document(short: OpenedSystem) -> None:
    """Whatever the processes of the components print."""
    done = python(*RPARM, "federation", "nominal", "--json", "--ssp", short.path, check=True)
    (variant,) = json.loads(done.stdout)["variants"]
    assert variant["passed"] and set(variant["microseconds_per_step"]) == {
        "helics", "ecos", "master",
    }  # fmt: skip
    assert max(map(len, done.stderr.splitlines())) <= 80
    assert "passed: 1 variant; " in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(("arguments", "words"), MISTAKES["federation"]["rows"])
def test_wrong_use(arguments: list[str], words: str, console: Console) -> None:
    assert words in console.refused("federation", "--ssp", SSP, *arguments)


def test_a_port_that_is_in_use_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with pytest.raises(UserError, match=f"port {port} is in use"):
            network.check_address_is_free(f"tcp://127.0.0.1:{port}")


def test_one_that_listens_is_waited_for() -> None:
    address = network.free_address()
    said = []
    with pytest.raises(UserError, match=f"nothing has listened at {address} for 1 s"):
        network.wait_for_listener(address, 1.0, lambda: said.append("wait"))
    assert said == ["wait"]
    with socket.create_server(network.check_address(address)):
        network.wait_for_listener(address, 1.0, lambda: pytest.fail("nothing to wait for"))


def test_an_unknown_host_is_not_waited_for() -> None:
    address = "tcp://no-such-host.invalid:23404"
    with pytest.raises(UserError, match=address):
        network.wait_for_listener(address, 60.0, lambda: pytest.fail("it is waited for"))
