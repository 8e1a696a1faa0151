"""FMUs and SSPs that are hostile or damaged: refused in one line, nothing is written elsewhere."""

import io
import stat
import struct
import tempfile
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile, ZipInfo

import pytest

from rparm import __main__ as cli
from rparm.errors import UserError
from rparm.fmi import fmu_file
from rparm.fmi.fmu_file import Fmu
from rparm.systems import ssp
from tests.support.paths import ROOT
from tests.support.rparm_project import assert_one_line, repacked
from tests.support.ssp_files import SSP, Edit, edited, edited_fmu, replace

STRUCTURE = "SystemStructure.ssd"
DESCRIPTION = "modelDescription.xml"
FMUS = {"2.0": ROOT / "build" / "RPManipulator.fmu", "3.0": ROOT / "build/fmi3/RPManipulator.fmu"}
OUTSIDE, CONTROL = "outside of its folder", "a control character"

Content = str | bytes
Change = Callable[[bytearray, int], None]  # of an archive, whose last entry's row begins there


@pytest.fixture(params=["fmu", "ssp"])
def refuse(
    request: pytest.FixtureRequest,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> Callable[..., None]:
    """Checks how the command refuses an archive with this content, and what it leaves behind."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    path = tmp_path / f"x.{request.param}"
    command = {"fmu": ["run", "--fmu"], "ssp": ["system", "--list", "--ssp"]}[request.param]

    def refuse(content: bytes, *words: str) -> None:
        path.write_bytes(content)
        assert cli.main([*command, str(path)]) == 2
        error = capsys.readouterr().err
        assert_one_line(error)
        assert error.startswith(f"error: {path}: ")
        assert "object" not in error and str(tmp_path / "temporary") not in error
        for word in words:
            assert word in error
        assert {x.relative_to(tmp_path) for x in tmp_path.rglob("*")} == {
            Path("temporary"),
            Path(path.name),
        }

    return refuse


def archive(*files: tuple[str | ZipInfo, Content], whole: bool = True) -> bytes:
    """An archive with these files after what both kinds of archives must have."""
    buffer = io.BytesIO()
    with warnings.catch_warnings(), ZipFile(buffer, "w") as target:
        warnings.simplefilter("ignore")  # two files of one name
        if whole:
            with ZipFile(FMUS["2.0"]) as fmu, ZipFile(SSP) as system:
                target.writestr(DESCRIPTION, fmu.read(DESCRIPTION))
                for name in fmu.namelist():
                    if name.startswith("binaries/"):
                        target.writestr(name, b"")
                target.writestr(STRUCTURE, system.read(STRUCTURE))
        for name, content in files:
            target.writestr(name, content)
    return buffer.getvalue()


def entry(name: str, method: int = zipfile.ZIP_STORED, mode: int = 0o100644) -> ZipInfo:
    """Entry of any name: ZipInfo itself cuts it at a null character."""
    info = ZipInfo("x")
    info.filename, info.compress_type, info.external_attr = name, method, mode << 16
    return info


def changed(change: Change, method: int = zipfile.ZIP_STORED) -> bytes:
    """An archive whose last entry, `data/x`, is changed."""
    content = bytearray(archive((entry("data/x", method), b"content" * 10)))
    change(content, content.rindex(b"PK\1\2"))
    return bytes(content)


def put(offset: int, form: str, value: int) -> Change:
    """Change of a number in the entry's row of the directory."""
    return lambda content, row: struct.pack_into(form, content, row + offset, value)


# ---- names -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "message"),
    [
        *((name, OUTSIDE) for name in ("../../x", "/x", "a/../../x", "..", "a/..", "//h/s/x")),
        *((name, OUTSIDE) for name in ("..\\..\\x", "a\\..\\x", "\\x", "\\\\host\\share\\x")),
        *((name, OUTSIDE) for name in ("C:/x", "C:x", "c:\\x", "x:stream", ".. /x", ".../x")),
        *((f"a{c}b", CONTROL) for c in ("\0", "\n", "\r", "\t", "\x1b", "\x7f", "\x85", "\u2028")),
        ("a\\x", "a backslash"),
        ("", "is no name of a file"),
        ("./", "is no name of a file"),
        ("a/" * 1000 + "x", "has a name of 2001 characters"),
        ("x" * 300, "xxx... cannot be unpacked: File name too long"),
    ],
)
def test_names_that_are_no_paths_in_the_archive(
    refuse: Callable[..., None], name: str, message: str
) -> None:
    refuse(archive((entry(name), b"x")), message)


@pytest.mark.parametrize(
    "names",
    [
        *(("a", "A"), ("a/b", "A/b"), ("a", "a."), ("a ", "a"), ("a. /x", "a/x"), ("a", "a/")),
        *(("a/b", "a//b"), ("a", "./a"), ("\xe9", "e\u0301"), (DESCRIPTION, DESCRIPTION.upper())),
        *((name, name) for name in ("a", DESCRIPTION, STRUCTURE)),
    ],
    ids=ascii,
)
def test_two_files_in_one_place(refuse: Callable[..., None], names: tuple[str, str]) -> None:
    """On some system: which of them counts would depend on who reads the archive."""
    message = "is there twice" if names[0] == names[1] else "are one file on some systems"
    refuse(archive(*((entry(name), "<x/>") for name in names), whole=False), message)


@pytest.mark.parametrize("names", [("a", "a/b"), ("a/b/c", "A"), (f"{DESCRIPTION}/x",)])
def test_a_file_that_is_a_folder_too(refuse: Callable[..., None], names: tuple[str, ...]) -> None:
    refuse(archive(*((entry(name), b"x") for name in names)), "is a file, and a folder of")


def test_folders_and_names_of_other_languages_are_welcome(tmp_path: Path, fmu: Path) -> None:
    names = ["a/", "a/b/", "a/", "a/b", "a/.b", "a/b..c", "\u0645\u06cc\u200c\u062e", "\u3000\xa0"]
    path = repacked(fmu, tmp_path / "x.fmu", lambda xml: xml)
    with warnings.catch_warnings(), ZipFile(path, "a") as target:
        warnings.simplefilter("ignore")
        for name in (name for name in names if name != "a/b"):
            target.writestr(entry(name), b"")
    with Fmu(path) as opened:
        assert {x.name for x in (opened.folder / "a").iterdir()} == {"b", ".b", "b..c"}


# ---- entries -----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR, stat.S_IFSOCK])
def test_links_and_devices(refuse: Callable[..., None], kind: int) -> None:
    refuse(archive((entry("x", mode=kind | 0o644), "/etc/hostname")), "'x' is a link or a device")


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_methods_that_the_standards_do_not_have(refuse: Callable[..., None], method: int) -> None:
    """zipfile unpacks them without a limit of memory."""
    refuse(archive((entry("x", method), b"x")), f"by method {method}, expected stored or deflate")


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put(8, "<H", 0x1), "'data/x' is encrypted"),
        (put(8, "<H", 0x41), "'data/x' is encrypted"),
        (put(10, "<H", 99), "'data/x' is compressed by method 99"),
        (put(16, "<L", 1), "'data/x' is damaged: Bad CRC-32"),
        (put(24, "<L", 5), "'data/x' is damaged"),  # the length of the content
        (put(24, "<L", 5000), "'data/x' is damaged"),
        (put(24, "<L", 2**31), "MB inside"),
        (put(20, "<L", 2), "'data/x' is damaged"),  # its length compressed
        (put(42, "<L", 2**32 - 2), "damaged"),  # where it begins
        (put(42, "<L", 0), "'data/x' is damaged"),  # at another file
        (put(6, "<H", 99), "zip file version 9.9"),
        (lambda content, row: content.__delitem__(slice(row - 1, row)), "damaged"),
        (lambda content, row: content.__delitem__(slice(row, None)), "damaged"),
        (lambda content, row: content.__delitem__(slice(2)), "damaged"),
    ],
)
def test_damaged_entries(
    refuse: Callable[..., None], change: Change, message: str, method: int
) -> None:
    refuse(changed(change, method), message)


@pytest.mark.parametrize("field", range(3))
def test_numbers_of_64_bits(refuse: Callable[..., None], field: int) -> None:
    """Sizes and place of an entry from its extra field."""
    for value in (2**40, 2**63, 2**64 - 1):
        info = entry("data/x")
        numbers = [1, 1, 0]
        numbers[field] = value
        info.extra = struct.pack("<HH3Q", 0xFFFF, 24, *numbers)  # not yet by its own number
        content = bytearray(archive((info, b"x")))
        row = content.rindex(b"PK\1\2")
        struct.pack_into("<LL", content, row + 20, 2**32 - 1, 2**32 - 1)
        struct.pack_into("<L", content, row + 42, 2**32 - 1)
        struct.pack_into("<H", content, content.index(b"\xff\xff\x18\0", row), 1)
        refuse(bytes(content))


@pytest.mark.parametrize("content", [b"", b"PK", b"no archive", archive(whole=False)])
def test_no_archives(refuse: Callable[..., None], content: bytes) -> None:
    refuse(content)


def test_without_what_it_must_have(refuse: Callable[..., None]) -> None:
    refuse(archive((f"{DESCRIPTION}/", ""), (f"{STRUCTURE}/", ""), whole=False))


@pytest.mark.parametrize("action", [Fmu, lambda path: ssp.unpacked(path).__enter__()])
def test_a_folder_is_no_archive(tmp_path: Path, action: Callable[[Path], object]) -> None:
    with pytest.raises(UserError, match="is a folder, expected an "):
        action(tmp_path)


# ---- size --------------------------------------------------------------------------------------


def test_archives_that_grow(refuse: Callable[..., None], monkeypatch: pytest.MonkeyPatch) -> None:
    files = [(entry(f"data/{i}", zipfile.ZIP_DEFLATED), bytes(20_000_000)) for i in range(4)]
    content = archive(*files)
    assert len(content) < 1_000_000
    monkeypatch.setattr(fmu_file, "LARGEST_CONTENT", 70_000_000)
    refuse(content, "has 80 MB inside, expected at most 70 MB")
    refuse(archive(*((str(i), b"") for i in range(10_001))), "has 10004 files inside")


def test_a_system_whose_fmus_grow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each within its limit: some commands unpack all of them."""
    monkeypatch.setattr("rparm.systems.structure.LARGEST_SYSTEM", SSP.stat().st_size // 2)
    with pytest.raises(UserError, match="the FMUs up to component '.*' have more than"):
        ssp_opened(SSP)


def test_a_description_that_grows(tmp_path: Path, fmu: Path) -> None:
    def change(content: bytes) -> bytes:
        return content + b" " * 65_000_000

    path = edited(SSP, tmp_path / "x.ssp", {STRUCTURE: change})
    with pytest.raises(UserError, match=r"SystemStructure.ssd: has 65 MB"), ssp.unpacked(path):
        pass
    with pytest.raises(UserError, match=r"modelDescription.xml: has 65 MB, expected at most 64 MB"):
        Fmu(edited(fmu, tmp_path / "x.fmu", {DESCRIPTION: change}))


# ---- the XML inside ----------------------------------------------------------------------------

LEVELS = "".join(f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 50}">' for i in range(8))
XML = {
    "two": lambda _: b"<x/>",
    "no version": lambda text: text.replace(b" fmiVersion", b" other").replace(b"ssd:", b"x:"),
    "empty": lambda _: b"",
    "cut": lambda text: text[:400],
    "not UTF-8": lambda text: text.replace(b'description="', b'description="\xff', 1),
    "doctype": replace("?>", "?><!DOCTYPE a []>"),
    "external": replace("?>", '?><!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/hostname">]>'),
    "growing": lambda text: text.replace(
        b"?>", f'?><!DOCTYPE a [<!ENTITY a "aaaaaaaaaaaaaaaaaaaa">{LEVELS}]>'.encode(), 1
    ).replace(b' name="', b' name="&i;', 1),
    "deep": lambda _: b"<a>" * 100_000,
}


@pytest.mark.parametrize("case", XML)
@pytest.mark.parametrize("version", FMUS)
def test_wrong_xml(tmp_path: Path, case: str, version: str) -> None:
    """Of an FMU, of the same FMU within an SSP, and of the SSP."""
    edit: Edit = XML[case]
    fmu = edited(FMUS[version], tmp_path / "x.fmu", {DESCRIPTION: edit})
    nested = {"resources/RPManipulator.fmu": lambda _: fmu.read_bytes()}
    system = edited(SSP, tmp_path / "x.ssp", {STRUCTURE: edit})
    for path, action, name in (
        (fmu, Fmu, DESCRIPTION),
        (edited(SSP, tmp_path / "nested.ssp", nested), ssp_opened, DESCRIPTION),
        (system, ssp_opened, STRUCTURE),
    ):
        with pytest.raises(UserError) as caught:
            action(path)
        text = str(caught.value)
        assert text.startswith(f"{path}: ") and name in text and "\n" not in text
        assert "object" not in text and len(text) < 500
        assert "DOCTYPE" in text or case not in ("doctype", "external")


def ssp_opened(path: Path) -> None:
    with ssp.unpacked(path):
        pass


@pytest.mark.parametrize(
    ("xml", "message"),
    [
        ("<SimpleType", "<!-- x --><SimpleType><!-- y --></SimpleType><SimpleType"),
        ('index="', 'index="9'),
        ("<ModelVariables>", "<ModelVariables><ScalarVariable name='x' valueReference='999'/>"),
    ],
)
def test_what_surprises_fmpy(tmp_path: Path, fmu: Path, xml: str, message: str) -> None:
    path = edited(fmu, tmp_path / "x.fmu", {DESCRIPTION: replace(xml, message)})
    with pytest.raises(UserError, match=r"x\.fmu: wrong modelDescription\.xml: ") as caught:
        Fmu(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("source", ["/etc/hostname", "../../x.ssv", "..\\x.ssv", "C:/x.ssv"])
def test_what_an_ssp_refers_to_lies_inside(tmp_path: Path, source: str) -> None:
    for old in ("resources/arm_nominal.ssv", "resources/RPManipulator.fmu"):
        path = edited(SSP, tmp_path / "x.ssp", {STRUCTURE: replace(f'"{old}"', f'"{source}"', -1)})
        with pytest.raises(UserError, match=r"component 'arm': .* is no path in the SSP: would"):
            ssp_opened(path)


def test_a_variant_is_no_path(tmp_path: Path) -> None:
    """Files that are written and removed get its name."""
    rename = replace('name="nominal"', 'name="../../x"')
    edits = {
        f"resources/{component}_nominal.ssv": rename
        for component in ("arm", "controller", "trajectory")
    }
    path = edited(SSP, tmp_path / "a.ssp", edits)
    with pytest.raises(UserError, match=r"name '../../x' of the set is no plain name"):
        ssp_opened(path)


def test_a_source_of_an_impossible_name(tmp_path: Path) -> None:
    edit = replace("resources/RPManipulator.fmu", f"resources/{'9' * 350}.fmu")
    path = edited(SSP, tmp_path / "a.ssp", {STRUCTURE: edit})
    with pytest.raises(UserError, match="is missing in the SSP"):
        ssp_opened(path)


# ---- an FMU within an SSP ----------------------------------------------------------------------


def test_an_fmu_within_an_ssp_is_named_by_both(tmp_path: Path) -> None:
    """When it is read, and when it is loaded."""
    edits = {DESCRIPTION: replace('modelIdentifier="RPManipulator"', 'modelIdentifier="Other"', -1)}
    arm = "resources/RPManipulator.fmu"
    path = edited(SSP, tmp_path / "x.ssp", {arm: edited_fmu(edits)})
    with ssp.unpacked(path) as opened, pytest.raises(UserError) as caught:
        opened.unpacked_fmu("arm")
    assert str(caught.value).startswith(f"{path}/{arm}: Other")
    hostile = archive((entry("../x"), b"x"))
    path = edited(SSP, tmp_path / "y.ssp", {arm: lambda _: hostile})
    with pytest.raises(UserError) as caught:
        ssp_opened(path)
    assert str(caught.value).startswith(f"{path}: component 'arm': {arm}: '../x' would lie")


def test_a_library_with_a_table_beyond_all_files(tmp_path: Path, fmu: Path) -> None:
    with ZipFile(fmu) as old, ZipFile(tmp_path / "x.fmu", "w") as new:
        for name in old.namelist():
            content = bytearray(old.read(name))
            if content[:4] == b"\x7fELF":
                struct.pack_into("<Q", content, 32, 2**64 - 1)
            new.writestr(name, bytes(content))
    with pytest.raises(UserError, match=r"x\.fmu: RPManipulator.*: is cut off"):
        Fmu(tmp_path / "x.fmu")
