"""The wheel of ./release.sh: installed, it does what the checkout does, with the same bytes."""

import hashlib
import json
import subprocess
import zipfile
from pathlib import Path

import pytest

from rparm.command_line import COMMANDS
from tests.support.installed import RELEASE, Installed, wheel_of_release
from tests.support.paths import NAMES, SYSTEMS
from tests.support.programs import RPARM, python, run

UNPACKED = 22_000_000  # bytes; what it needs, with pip, has 230 MB more
OF_CHECKOUT = ("./run.sh", "./setup.sh", "build/venv", "build/report")


@pytest.fixture(scope="module")
def wheel() -> Path:
    return wheel_of_release()


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    return Installed(wheel, tmp_path_factory.mktemp("installed"))


def checkout(*arguments: object) -> subprocess.CompletedProcess[str]:
    return python(*RPARM, *arguments, check=True, timeout=None)


def test_it_is_small_and_for_every_platform(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        assert sum(member.file_size for member in archive.infolist()) < UNPACKED
        names = archive.namelist()
        (metadata,) = [name for name in names if name.endswith(".dist-info/WHEEL")]
        assert "Root-Is-Purelib: true" in archive.read(metadata).decode()
    assert {name.partition("/")[0] for name in names} == {"rparm", Path(metadata).parent.name}
    assert "rparm/share/plotly/LICENSE.txt" in names
    assert [name for name in names if name.endswith((".pyc", ".c", ".h"))] == []


def test_all_files_of_the_release_are_in_it(installed: Installed) -> None:
    """Put together by the package, against the checksums of the release."""
    script = (
        "from pathlib import Path; from rparm import shipped; import json\n"
        "print(json.dumps({n: str(shipped.file(n, Path('files'))) for n in shipped.names()}))"
    )
    command = (installed.folder / "bin" / "python", "-P", "-c", script)
    made = run(*command, cwd=installed.work, check=True)
    lines = (line.split("  ") for line in (RELEASE / "SHA256SUMS").read_text().splitlines())
    of_fmus = (".fmu", ".ssp")
    expected = {name: checksum for checksum, name in lines if name.endswith(of_fmus)}
    found = {
        name.replace("2.0/", "").replace("3.0/", "fmi3/"): hashlib.sha256(
            (installed.work / path).read_bytes()
        ).hexdigest()
        for name, path in json.loads(made.stdout).items()
    }
    assert found == expected
    assert len(found) == 2 * (len(NAMES) + len(SYSTEMS))


@pytest.mark.parametrize(
    "arguments",
    [("run", "sine_efforts", "stick_slip", "controller_pd_gravity"), ("system", "nominal")],
)
def test_results_have_the_bytes_of_the_checkout(
    installed: Installed, arguments: tuple[str, ...], tmp_path: Path
) -> None:
    ran = installed.run(*arguments)  # systems by Ecos: there is no unzip on this PATH
    assert ran.returncode == 0, ran.stderr
    checkout(*arguments, "--report", tmp_path)
    for name in arguments[1:]:
        (made,) = (installed.work / "rparm-output").rglob(f"{name}.csv")
        (expected,) = tmp_path.rglob(f"{name}.csv")
        assert made.read_bytes() == expected.read_bytes()


def test_a_file_of_ones_own_runs_from_anywhere(installed: Installed) -> None:
    assert installed.run("new", "mine").returncode == 0
    ran = installed.run("mine.toml")
    assert ran.returncode == 0 and ran.stdout.splitlines()[-1].startswith(
        "completed: 1 scenario, errors estimated; "
    )


def test_campaigns_and_fmus_have_names(installed: Installed) -> None:
    ran = installed.run("campaign", "tolerance", "--replay", "0", "--json")
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)["exit_code"] == 0
    assert (installed.work / "rparm-output/campaigns/tolerance/replays").is_dir()
    assert "'RPPlnt', did you mean 'RPPlant'?" in installed.run("fmu", "RPPlnt").stderr


@pytest.mark.parametrize("command", COMMANDS)
def test_no_help_names_what_only_a_checkout_has(installed: Installed, command: str) -> None:
    ran = installed.run("help", command)
    assert ran.returncode == 0 and f"usage: rparm {command}" in ran.stdout
    assert [text for text in OF_CHECKOUT if text in ran.stdout] == []


def test_no_page_names_what_only_a_checkout_has(installed: Installed) -> None:
    assert installed.run("run", "free_fall", "--report", "pages").returncode == 0
    pages = list((installed.work / "pages").rglob("*.html"))
    assert pages
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert [word for word in OF_CHECKOUT if word in text] == [], page.name


@pytest.mark.parametrize("arguments", [("run", "free_fall"), ("system", "nominal")])
def test_a_cache_that_cannot_be_written_is_one_line(
    installed: Installed, arguments: tuple[str, ...]
) -> None:
    ran = installed.run(*arguments, RPARM_CACHE="/dev/null/cache")
    assert (ran.returncode, ran.stdout) == (2, "")
    (line,) = ran.stderr.splitlines()
    assert line.startswith("error: /dev/null/cache/files/") and "RPARM_CACHE" in line
