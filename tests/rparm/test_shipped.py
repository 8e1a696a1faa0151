"""Files of an installed package: put together from pieces, whatever happens to the cache."""

import hashlib
import os
import resource
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from rparm import shipped
from rparm.errors import UserError
from tests.support.paths import ROOT

sys.path.insert(0, str(ROOT / "fmu"))
from built import packed
from package import pack
from pieces import write_pieces

CONTENT = os.urandom(50_000)


@pytest.fixture
def release(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two FMUs that share a file, and a system of both, in both versions; as they are shipped."""
    (tmp_path / "shared.bin").write_bytes(CONTENT)
    folder, share = tmp_path / "release", tmp_path / "share"
    share.mkdir()
    for below in (folder, folder / "fmi3"):
        for name in ("A", "B"):
            (tmp_path / name).write_text(f"{name} of {below.name}")
            files = {"sources/shared.bin": tmp_path / "shared.bin", "own": tmp_path / name}
            pack(below / f"{name}.fmu", files.items())
        fmus = {f"resources/{name}.fmu": below / f"{name}.fmu" for name in ("A", "B")}
        pack(below / "S.ssp", ({"SystemStructure.ssd": tmp_path / "A"} | fmus).items())
    write_pieces(folder, share)
    monkeypatch.setattr(shipped, "PIECES", share / "pieces")
    monkeypatch.setattr(shipped, "FILES", share / "files.json.xz")
    shipped._listed.cache_clear()
    yield folder
    shipped._listed.cache_clear()


def original(release: Path, name: str) -> bytes:
    return (release / name.replace("2.0/", "").replace("3.0/", "fmi3/")).read_bytes()


def test_every_file_has_its_bytes(release: Path, tmp_path: Path) -> None:
    assert sorted(shipped.names()) == [
        f"{v}/{n}" for v in ("2.0", "3.0") for n in ("A.fmu", "B.fmu", "S.ssp")
    ]
    for name in shipped.names():
        path = shipped.file(name, tmp_path / "cache")
        assert path.name == name.partition("/")[2]
        assert path.read_bytes() == original(release, name)
        assert zipfile.ZipFile(path).testzip() is None


def test_what_files_share_is_there_once(release: Path) -> None:
    assert shipped.PIECES.stat().st_size < 1.1 * len(CONTENT)
    assert shipped.PIECES.read_bytes().count(CONTENT[:100]) == 1


@pytest.mark.parametrize("damage", [b"", b"x", None])
def test_a_broken_cache_is_mended(release: Path, tmp_path: Path, damage: bytes | None) -> None:
    path = shipped.file("2.0/A.fmu", tmp_path)
    good = path.read_bytes()
    path.write_bytes(good[:-1] + b"?" if damage is None else damage)
    assert shipped.file("2.0/A.fmu", tmp_path).read_bytes() == good


def test_a_file_that_is_there_is_not_written_again(release: Path, tmp_path: Path) -> None:
    path = shipped.file("2.0/A.fmu", tmp_path)
    before = path.stat()
    again = shipped.file("2.0/A.fmu", tmp_path).stat()
    assert (again.st_ino, again.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)


def test_a_damaged_package_is_named(release: Path, tmp_path: Path) -> None:
    shipped.PIECES.write_bytes(shipped.PIECES.read_bytes()[:-1])
    with pytest.raises(UserError, match="damaged, install rparm again"):
        for name in shipped.names():
            shipped.file(name, tmp_path)
    shipped.PIECES.unlink()
    with pytest.raises(UserError, match="pieces: cannot be read: No such file"):
        shipped.file("2.0/A.fmu", tmp_path / "other")
    shipped.FILES.write_text("{")
    shipped._listed.cache_clear()
    with pytest.raises(UserError, match="files.json.xz: damaged"):
        shipped.names()


def test_a_full_disk_leaves_nothing_behind(release: Path, tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
    try:
        with pytest.raises(UserError, match="cannot be written: File too large"):
            shipped.file("2.0/A.fmu", tmp_path / "cache")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [path for path in (tmp_path / "cache").rglob("*") if path.is_file()] == []


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """Two files."""
    path = tmp_path / "archive.tar.xz"
    path.write_bytes(packed([("project/a.h", CONTENT), ("x/b.json", b"{}")]))
    shipped.unpacked.cache_clear()
    return path


@pytest.mark.parametrize("broken", [None, "", "x"])
def test_an_archive_is_unpacked_and_what_is_broken_mended(
    archive: Path, tmp_path: Path, broken: str | None
) -> None:
    folder = shipped.unpacked(archive, tmp_path / "cache")
    file, other = folder / "project" / "a.h", folder / "x" / "b.json"
    file.unlink() if broken is None else file.write_text(broken)
    before = other.stat()
    shipped.unpacked.cache_clear()
    assert shipped.unpacked(archive, tmp_path / "cache") == folder
    assert file.read_bytes() == CONTENT
    assert other.stat().st_mtime_ns == before.st_mtime_ns
    assert len([path for path in folder.rglob("*") if path.is_file()]) == 2


@pytest.mark.parametrize("length", [0, 100, -1])
def test_a_damaged_archive_is_named(archive: Path, tmp_path: Path, length: int) -> None:
    archive.write_bytes(archive.read_bytes()[:length])
    with pytest.raises(UserError, match="archive.tar.xz: damaged, install rparm again"):
        shipped.unpacked(archive, tmp_path / "cache")


def test_a_cache_that_cannot_be_written_is_named(
    release: Path, archive: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    for function, argument in ((shipped.file, "2.0/A.fmu"), (shipped.unpacked, archive)):
        with pytest.raises(UserError, match="written: Not a directory; RPARM_CACHE names"):
            function(argument, tmp_path / "file" / "cache")


AT_ONCE = """
import sys
from pathlib import Path
from rparm import shipped
shipped.PIECES, shipped.FILES = Path(sys.argv[1], "pieces"), Path(sys.argv[1], "files.json.xz")
input()
print(shipped.file("2.0/S.ssp", Path(sys.argv[2])))
"""


def test_processes_that_begin_at_once_do_not_disturb_each_other(
    release: Path, tmp_path: Path
) -> None:
    command = [sys.executable, "-c", AT_ONCE, shipped.PIECES.parent, tmp_path / "cache"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    processes = [subprocess.Popen(command, cwd=ROOT, **pipes) for _ in range(4)]
    for process in processes:
        process.stdin.write("\n")
        process.stdin.flush()
    paths = {process.communicate()[0].strip() for process in processes}
    (path,) = paths
    digest = hashlib.sha256(original(release, "2.0/S.ssp")).digest()
    assert hashlib.sha256(Path(path).read_bytes()).digest() == digest
    assert len(list(Path(path).parent.iterdir())) == 1
