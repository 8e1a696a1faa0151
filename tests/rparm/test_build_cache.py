"""The cache of builds: the same bytes with it and without it, and nothing wrong is taken."""

import json
import os
import shutil
import stat
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest

from rparm import build_cache, building, project
from rparm.build_cache import BuildCache
from tests.support.paths import ROOT
from tests.support.programs import RPARM, python
from tests.support.rparm_project import BUILD

FILES = {"b": b"first\n", "a/c": b"", "d": bytes(range(256))}
KEY, OTHER = "0" * 64, "1" * 64
MODEL = """name = "Tiny"
[states]
h = { start = 1e-12, derivative = "k(time) - h" }
[tables.k]
x = "x"
y = "y"
file = "k.csv"
"""


def test_an_entry_is_taken_whole_or_not_at_all(tmp_path: Path) -> None:
    """One flipped byte, a missing end, another's entry under the name, a folder, no content."""
    cache = BuildCache(tmp_path / "below" / "it")
    assert cache.get(KEY) is None
    cache.put(KEY, FILES)
    assert list(cache.get(KEY).items()) == list(FILES.items()) and cache.get(OTHER) is None
    path = cache.folder / KEY
    content = path.read_bytes()
    for place in (0, 63, 64, 70, len(content) - 1):
        path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        assert cache.get(KEY) is None
    for wrong in (content[:-1], content + b"x", b"", b"\n", content[:64]):
        path.write_bytes(wrong)
        assert cache.get(KEY) is None
    cache.put(OTHER, FILES)
    shutil.copy(cache.folder / OTHER, path)
    assert cache.get(KEY) is None
    cache.put(KEY, FILES)
    assert cache.get(KEY) == FILES


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="only root gives away")
def test_an_entry_of_another_user_is_not_taken(tmp_path: Path) -> None:
    cache = BuildCache(tmp_path)
    cache.put(KEY, FILES)
    os.chown(tmp_path / KEY, 65534, -1)
    assert cache.get(KEY) is None


def test_the_entries_used_least_recently_go(tmp_path: Path) -> None:
    cache = BuildCache(tmp_path, largest=3500)
    names = [str(i) for i in range(4)]
    for i, name in enumerate(names):
        if i == 3:
            assert cache.get("0") is not None  # so it is the newest
        cache.put(name, {"x": bytes(1000)})
        os.utime(tmp_path / name, (i, i))
    cache.put("4", {"x": bytes(1000)})
    assert {path.name for path in tmp_path.iterdir()} == {"0", "3", "4"}


def test_no_folder_is_no_reason_to_fail(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for folder in (None, tmp_path / "file", Path("/proc/none")):
        BuildCache(folder).put(KEY, FILES)
        assert BuildCache(folder).get(KEY) is None


def put_and_get(folder: Path) -> bool:
    cache = BuildCache(folder)
    for _ in range(50):
        cache.put(KEY, FILES)
        if cache.get(KEY) != FILES:
            return False
    return True


def test_processes_at_once_see_whole_entries(tmp_path: Path) -> None:
    with ProcessPoolExecutor(3) as pool:
        assert all(pool.map(put_and_get, [tmp_path] * 3))
    assert [path.name for path in tmp_path.iterdir()] == [KEY]


# ---- Models --------------------------------------------------------------------------------------
@pytest.fixture
def model(tmp_path: Path) -> Path:
    folder = tmp_path / "a model"
    folder.mkdir()
    (folder / "tiny.toml").write_text(MODEL)
    (folder / "k.csv").write_text("x,y\n0,1\n1,2\n")
    return folder / "tiny.toml"


@pytest.fixture
def built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., bool]:
    """Builds a model by a cache of its own, and returns whether the program was run for it."""
    monkeypatch.setenv("RPARM_CACHE", str(tmp_path / "cache"))
    runtime = json.loads((BUILD / "runtime" / "runtime.json").read_text())
    path = tmp_path / "runtime.json"
    monkeypatch.setattr(project, "runtimes", lambda *_: [path])
    asked = []

    def made(*arguments: object) -> tuple[list[str], str]:
        """What the program would make: the lock file and FMUs are all that matters here."""
        asked.append(arguments)
        *_, work = arguments
        (work / "fmi3").mkdir()
        names = ["tiny.lock.toml", "Tiny.fmu", "fmi3/Tiny.fmu"]
        for name in names:
            (work / name).write_bytes(name.encode())
        return names, "warning: a warning\n"

    monkeypatch.setattr(building, "_made", made)

    def build(model: Path, **changed: object) -> bool:
        path.write_text(json.dumps(runtime | changed))
        asked.clear()
        fmus = building.build(model, output=tmp_path / "out")
        assert [fmu.read_bytes() for fmu in fmus] == [b"Tiny.fmu", b"fmi3/Tiny.fmu"]
        return bool(asked)

    return build


def test_what_an_fmu_is_made_from_makes_its_key(
    model: Path, tmp_path: Path, built: Callable[..., bool], capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    assert built(model) and not built(model)  # the lock file was not there at first
    assert capsys.readouterr().err == f"warning: {model}: a warning\n" * 2
    other = tmp_path / "another folder"
    shutil.copytree(model.parent, other)
    assert not built(other / model.name)
    renamed = shutil.copy(model, model.with_name("renamed.toml"))
    assert not built(renamed)
    assert sorted(path.name for path in model.parent.glob("*.lock.toml")) == [
        "renamed.lock.toml", "tiny.lock.toml",
    ]  # fmt: skip
    options = json.loads((BUILD / "runtime" / "runtime.json").read_text())["options"]
    assert built(model, options=[*options, "-O1"]) and not built(model)
    for path in (model, model.with_name("k.csv")):
        path.write_text(path.read_text() + "\n")
        assert built(model) and not built(model)
    lock = model.with_suffix(".lock.toml")
    lock.write_bytes(b"another")
    assert built(model)
    assert not built(model) and lock.read_bytes() == b"tiny.lock.toml"
    monkeypatch.setenv("CPATH", "/elsewhere")
    assert built(model)
    monkeypatch.delenv("CPATH")
    own = tmp_path / "own" / "fmu"
    shutil.copytree(ROOT / "fmu", own, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(build_cache.fmu_tools, "__path__", [str(own)])
    assert built(model) and not built(model)
    (own / "compiler" / "graph" / "graph.py").write_text("changed")
    assert built(model)


def test_a_file_that_changes_meanwhile_is_not_kept(
    model: Path, built: Callable[..., bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = building._made

    def changed(*arguments: object) -> tuple[list[str], str]:
        model.write_text(model.read_text() + "\n")
        return made(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(building, "_made", changed)
        assert built(model)
    text = model.read_text()
    for given in (text, text[:-1]):
        model.write_text(given)
        assert built(model)


def test_a_folder_that_cannot_be_written_is_done_without(
    model: Path, tmp_path: Path, built: Callable[..., bool]
) -> None:
    assert built(model)
    for path in (tmp_path / "cache", tmp_path / "cache" / "builds"):
        path.chmod(stat.S_IRUSR | stat.S_IXUSR)
    assert not built(model)
    shutil.rmtree(tmp_path / "cache")
    (tmp_path / "cache").touch()
    assert built(model) and built(model)


def test_fmus_have_the_same_bytes_with_it_and_without(model: Path, tmp_path: Path) -> None:
    """And a build imports little: the packages that drive FMUs are for other commands."""
    script = "import sys; from rparm.__main__ import main; code = main(); import json\n"
    script += "print(json.dumps([code, *sys.modules]))"
    given = {"RPARM_CACHE": str(tmp_path / "cache")}
    results = []
    for options in (["--no-cache"], [], []):
        output = tmp_path / f"out{len(results)}"
        arguments = ("build", model, "--output", output, "--quiet", *options)
        ran = python("-P", "-c", script, *arguments, environment=given)
        code, *modules = json.loads(ran.stdout.splitlines()[-1])
        assert code == 0 and not {"numpy", "fmpy", "pydantic", "lxml", "email"} & {*modules}
        assert ran.stderr.startswith(f"warning: {model}: [states]: h: starts at 1e-12, but")
        kept = [*(tmp_path / "cache").glob("builds/*")]
        names = ("Tiny.fmu", "fmi3/Tiny.fmu")
        results.append([(output / name).read_bytes() for name in names])
        assert results[-1] == results[0]
        assert len(kept) == (0 if options else 1)


def test_only_commands_that_build_take_the_option() -> None:
    ran = python(*RPARM, "list", "--no-cache")
    assert ran.returncode == 2 and "unrecognized arguments: --no-cache" in ran.stderr
    assert "--no-cache" in python(*RPARM, "help", "identify").stdout
