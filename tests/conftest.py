"""What the Python tests share."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.support.missing import missing
from tests.support.paths import ROOT

if TYPE_CHECKING:
    from rparm.fmi.fmu_file import Fmu
    from tests.support.browser import Browser
    from tests.support.hosts import Network
    from tests.support.instances import LoadedFmu
    from tests.support.rparm_project import Console


# One cache of built models for all tests, which a new clone and another compiler begin empty.
os.environ["RPARM_CACHE"] = str(ROOT / "build" / "cache")
os.environ.pop("RPARM_NO_CACHE", None)
# A shell that starts the tests in the background lets them, and all that they start, ignore Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def fmu() -> Path:
    """The built FMU: $RP_FMU, or the one in build/."""
    path = Path(os.environ.get("RP_FMU", ROOT / "build" / "RPManipulator.fmu")).absolute()
    if not path.is_file():
        pytest.fail(f"{path}: no such file, ./run.sh builds it")
    return path


@pytest.fixture(scope="module")
def path(request: pytest.FixtureRequest, fmu: Path) -> Path:
    """The FMU of a test file: the one it names by UNIT, or RPManipulator."""
    return fmu.with_name(f"{getattr(request.module, 'UNIT', fmu.stem)}.fmu")


@pytest.fixture(scope="module")
def opened(path: Path) -> Iterator["Fmu"]:
    """The same FMU, opened by rparm."""
    from rparm.fmi.fmu_file import Fmu

    with Fmu(path) as opened:
        yield opened


@pytest.fixture(scope="module")
def loaded(path: Path, tmp_path_factory: pytest.TempPathFactory) -> "LoadedFmu":
    """The same FMU, unpacked for fmpy."""
    from tests.support.instances import LoadedFmu

    return LoadedFmu(path, tmp_path_factory.mktemp("unit"))


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the project with two scenarios, for the command line to work in."""
    from tests.support.rparm_project import copy_project

    copy_project(tmp_path)
    monkeypatch.setattr("rparm.project.ROOT", tmp_path)
    return tmp_path


@pytest.fixture
def console(capsys: pytest.CaptureFixture[str]) -> "Console":
    """The command line."""
    from tests.support.rparm_project import Console

    return Console(capsys)


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Writes a scenario of a small model and returns its path."""
    from tests.support.toy_model import make_model

    return make_model(tmp_path)


@pytest.fixture(scope="session")
def browser() -> Iterator["Browser"]:
    """Chromium, one for all tests; where it is not installed they are skipped, in CI they fail."""
    from tests.support.browser import opened

    with opened() as browser:
        yield browser


@pytest.fixture(scope="session")
def firefox() -> Iterator["Browser"]:
    """The same with Firefox."""
    from tests.support.browser import opened_firefox

    with opened_firefox() as browser:
        yield browser


@pytest.fixture(params=["browser", "firefox"], ids=["chromium", "firefox"])
def each_browser(request: pytest.FixtureRequest) -> "Browser":
    """Chromium, then Firefox."""
    return request.getfixturevalue(request.param)


@pytest.fixture(params=["same user", "another user"])
def user(request: pytest.FixtureRequest) -> int | None:
    """Id of another user, nobody's, or None: only root can become one."""
    if request.param == "same user":
        return None
    if not hasattr(os, "getuid") or os.getuid() != 0:
        if os.environ.get("CI"):
            pytest.fail("needs root, to become another user")
        pytest.skip("needs root, to become another user")
    return 65534


@pytest.fixture
def apart() -> Iterator["Network"]:
    """Two hosts; skipped where the kernel permits none."""
    from tests.support.hosts import NotPermittedError, network

    with ExitStack() as stack:
        try:
            made = stack.enter_context(network())
        except FileNotFoundError as error:
            missing(str(error))
        except NotPermittedError as error:
            pytest.skip(f"no network namespaces: {error}")
        yield made
