"""The wheel of ./release.sh does and builds what the checkout does, with the same bits."""

import hashlib
import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu

import rparm
from rparm import project
from rparm.command_line import COMMANDS
from rparm.errors import UserError
from tests.platforms.model import CHANGED, METHODS
from tests.platforms.platforms import PLATFORMS, Missing, Platform, Runner
from tests.platforms.transcript import first_difference
from tests.support.installed import RELEASE, Installed, wheel_of_release
from tests.support.missing import missing
from tests.support.paths import NAMES, ROOT, SYSTEMS
from tests.support.programs import RPARM, python, run

MODEL = (ROOT / "examples" / "models" / "cart_and_pole.toml").read_text(encoding="utf-8")
NAME = "CartAndPole"
FMUS = (f"{NAME}.fmu", f"fmi3/{NAME}.fmu")

each_platform = pytest.mark.parametrize("row", PLATFORMS, ids=lambda row: row.name)


@pytest.fixture(scope="module")
def wheel() -> Path:
    return wheel_of_release()


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    return Installed(wheel, tmp_path_factory.mktemp("installed"))


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "my models" / "cart.toml"
    path.parent.mkdir()
    path.write_text(MODEL, encoding="utf-8")
    return path


def built(installed: Installed, model: Path, output: Path, *options: str, path: str = "/") -> Path:
    """The FMU of FMI 2.0, by zig unless the path has another compiler."""
    pytest.importorskip("ziglang", reason="zig: ./setup.sh --release")
    # the C library that zig has for the release
    variables = {"PATH": path, "ZIG_GLOBAL_CACHE_DIR": str(ROOT / "build" / "zig")}
    ran = installed.run("build", model, "--output", output, *options, **variables)
    assert ran.returncode == 0, ran.stderr
    return output / f"{NAME}.fmu"


@pytest.fixture(scope="module")
def for_all(installed: Installed, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("all platforms")
    (folder / "cart.toml").write_text(MODEL, encoding="utf-8")
    return built(installed, folder / "cart.toml", folder / "out", "--platforms")


@pytest.mark.parametrize("path", ["/", "/usr/bin:/bin"], ids=["zig", "gcc"])
def test_fmus_are_valid_and_their_values_those_of_the_checkout(
    installed: Installed, model: Path, tmp_path: Path, path: str
) -> None:
    fmu = built(installed, model, tmp_path / "by the wheel", path=path)
    for name in FMUS:
        assert validate_fmu(str(fmu.parent / name)) == []
    assert model.with_name("cart.lock.toml").is_file()
    output = tmp_path / "by the checkout"
    command = [sys.executable, "-P", "-m", "rparm", "build", model, "--output", output]
    environment = project.child_environment()
    subprocess.run(command, cwd=ROOT, env=environment, check=True, stdout=subprocess.DEVNULL)
    # each in turn: the libraries have the same place
    first, second = (
        by_all_methods(Runner(None, NAME, each, tmp_path)) for each in (fmu, output / fmu.name)
    )
    assert first_difference(first, second) is None


def by_all_methods(runner: Runner) -> bytes:
    """Steps with rollback, a variant of the run for each method of integration."""
    with pytest.MonkeyPatch.context() as patch:
        changed = {"phi": 0.75, "v": 0.5, "solver_method": list(METHODS)}
        patch.setitem(CHANGED, NAME, changed)
        return b"".join(runner.run(*(f"steps:{variant}:0" for variant in METHODS)))


@each_platform
def test_every_platform_gives_the_same_bits(for_all: Path, row: Platform, tmp_path: Path) -> None:
    native = Runner(None, NAME, for_this_machine(for_all, tmp_path), tmp_path)
    try:
        other = Runner(row, NAME, for_all, tmp_path, archive=for_all)
    except Missing as error:
        missing(f"missing: {error}")
    expected, actual = by_all_methods(native), by_all_methods(other)
    assert len(expected) > 10_000
    assert first_difference(expected, actual) is None


def for_this_machine(fmu: Path, folder: Path) -> Path:
    """The FMU with the library for Linux alone."""
    path = folder / fmu.name
    with zipfile.ZipFile(fmu) as archive, zipfile.ZipFile(path, "w") as target:
        for name in ("modelDescription.xml", f"binaries/linux64/{NAME}.so"):
            target.writestr(name, archive.read(name))
    return path


def test_all_platforms_are_in_the_fmus(for_all: Path) -> None:
    """As in those of the release, whose binaries test_release.py reads."""
    for name in FMUS:
        with zipfile.ZipFile(for_all.parent / name) as archive:
            found = {
                n for n in archive.namelist() if n.startswith(("binaries/", "documentation/l"))
            }
            contents = b"".join(map(archive.read, archive.namelist()))
        with zipfile.ZipFile(RELEASE / name.replace(NAME, "RPPlant")) as archive:
            names = (n.replace("RPPlant", NAME) for n in archive.namelist())
            assert found == {n for n in names if n.startswith(("binaries/", "documentation/l"))}
        assert str(ROOT).encode() not in contents


def test_builds_at_once_give_the_same_bytes(
    installed: Installed, for_all: Path, model: Path, tmp_path: Path
) -> None:
    cache = {"ZIG_GLOBAL_CACHE_DIR": str(ROOT / "build" / "zig")}
    output = tmp_path / "out"
    arguments = ("build", model, "--platforms", "--output", output)
    started = [installed.start(*arguments, **cache) for _ in range(2)]
    for process in started:
        _, errors = process.communicate()
        assert process.returncode == 0, errors
    for name in FMUS:
        assert (output / name).read_bytes() == (for_all.parent / name).read_bytes()
    assert {path.name for path in model.parent.iterdir()} == {"cart.toml", "cart.lock.toml"}
    assert {path.name for path in output.rglob("*")} == {f"{NAME}.fmu", "fmi3"}


def test_an_fmu_for_the_web_is_that_of_the_checkout(
    installed: Installed, model: Path, tmp_path: Path
) -> None:
    made = built(installed, model, tmp_path / "installed", "--web")
    expected, _ = rparm.build(model, output=tmp_path / "checkout", web=True)
    assert made.read_bytes() == expected.read_bytes()


def test_what_cannot_be_written_is_one_line_and_leaves_nothing(
    installed: Installed, model: Path, tmp_path: Path
) -> None:
    output = tmp_path / "out"
    output.mkdir()
    (output / f"{NAME}.fmu").mkdir()
    ran = installed.run("build", model, "--output", output, PATH="/usr/bin")
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr == f"error: {output / NAME}.fmu: cannot be written: Is a directory\n"
    assert [path.name for path in output.iterdir()] == [f"{NAME}.fmu"]


def test_a_mistake_in_the_model_writes_nothing(installed: Installed, model: Path) -> None:
    model.write_text(MODEL.replace('derivative = "v"', 'derivative = "w"'), encoding="utf-8")
    ran = installed.run("build", model)
    assert ran.returncode == 2 and ran.stderr.count("\n") == 1
    assert [path.name for path in model.parent.iterdir()] == [model.name]


def test_what_is_not_installed_is_named(
    installed: Installed, model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hidden = installed.work / "ziglang"  # a package without a compiler, in front of the other
    hidden.mkdir()
    (hidden / "__init__.py").write_text("", encoding="utf-8")
    ran = installed.run("build", model, "--platforms", "--no-cache", PYTHONPATH=str(installed.work))
    assert ran.returncode == 2 and ran.stderr.count("\n") == 1
    (hidden / "__init__.py").unlink()
    hidden.rmdir()
    monkeypatch.setattr(project, "INSTALLED", True)
    monkeypatch.setattr(project, "find_spec", lambda name: None if name == "pycparser" else True)
    with pytest.raises(UserError, match=r'^pycparser: not installed, pip install "rparm\[build\]"'):
        rparm.build(model)


# ---- Proofs --------------------------------------------------------------------------------------


def test_the_wheel_proves(installed: Installed) -> None:
    arguments = ("prove", "free_fall", "--method", "taylor", "--json")
    ran = installed.run(*arguments)
    assert ran.returncode == 0, ran.stderr
    assert proven(ran.stdout) == proven(python(*RPARM, *arguments, check=True, timeout=None).stdout)


def proven(document: str) -> dict:
    """What a document says of the methods."""
    return json.loads(document)["methods"]


# ---- The whole wheel -----------------------------------------------------------------------------


LARGEST = 22_000_000  # bytes to download; what it needs, with pip, has 230 MB unpacked
OF_CHECKOUT = ("./run.sh", "./setup.sh", "build/venv", "build/report")


def checkout(*arguments: object) -> subprocess.CompletedProcess[str]:
    return python(*RPARM, *arguments, check=True, timeout=None)


def test_it_is_small_and_for_every_platform(wheel: Path) -> None:
    assert wheel.stat().st_size < LARGEST
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (metadata,) = [name for name in names if name.endswith(".dist-info/WHEEL")]
        assert "Root-Is-Purelib: true" in archive.read(metadata).decode()
    assert {name.partition("/")[0] for name in names} == {"rparm", Path(metadata).parent.name}
    assert "rparm/share/plotly/LICENSE.txt" in names
    assert [name for name in names if name.endswith((".pyc", ".c"))] == []
    equations = "rparm/share/models/"  # which `prove` reads
    assert [name for name in names if name.endswith(".h") and not name.startswith(equations)] == []


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
