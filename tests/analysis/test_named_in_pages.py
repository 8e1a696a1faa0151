"""Every file, folder, module and name in code that a page of the project names is there.

A function that a page names with a file ("`file.c`: `function` does it", "`function` of `file.c`")
is in that file. What is written later, as in build/, only has to be named by the code that does it.
"""

import os
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path, PurePosixPath

import pytest

from tests.support.paths import ROOT

TOPS = "cmake|rparm|fmu|models|playground|requirements|src|tests"
SOURCE = {".c", ".cmake", ".h", ".js", ".md", ".py", ".sh", ".toml", ".txt"}
CODE = SOURCE - {".md"} | {".css", ".html", ".in", ".ini", ".xml"}
WRITTEN = {"value_references.h", "benchmark.md"}  # by the generator and the benchmark
# what the reader makes
PLACEHOLDERS = {"my_scenario", "my_model", "MyModel", "Name", "name"}
# names in programs of others
ELSEWHERE = {"LD_PRELOAD", "step_until", "SystemGeometry"}
ELSEWHERE |= {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES"}
ELSEWHERE |= {"OMSimulator", "system_sc", "system_wc", "importFMU", "load_fmu", "final_time"}
HISTORY = ROOT / "CHANGELOG.md"  # names what is gone, too

SPAN = re.compile(r"`([^`\n]+)`")
PATH = re.compile(r"[\w.*-]+(/[\w.*-]+)*/?")
IN_TEXT = re.compile(rf"(?<![\w/.-])(?:{TOPS})/[\w./*-]*[\w*]")
NAME = re.compile(r"(?:(?:struct|enum) )?([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)(?:\(.*\))?")
FMI_NAME = re.compile(r"\bfmi[23][A-Z]\w+")
# names within code: of more than one word, or called
PART = re.compile(r"(?<![\w./*-])([A-Za-z]\w*_\w+\b(?!\*)|[A-Za-z_]\w+(?=\())")
BLOCK = re.compile(r"^```(?:c|cmake|js|python|toml)\n(.*?)^```", re.MULTILINE | re.DOTALL)
MODULE = re.compile(rf"-m ((?:{TOPS})[\w.]*)")
LINK = re.compile(r"\]\((?!\w+:)([^)#\s]*)(?:#([^)\s]+))?\)")
ITEM = re.compile(r"^(?:\d+\.|-) `([\w./-]+\.\w+)`: (.*)", re.MULTILINE)
OF_FILE = re.compile(
    r"`([A-Za-z_][\w.]*)`(?: of| in|,? from)? \(?\[?`([\w./-]+\.[ch]|[\w./-]+\.py)`"
)
COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)


@cache
def files() -> frozenset[str]:
    """Paths of all files, and of the folders with "/" at the end."""
    found = set()
    for folder, folders, names in os.walk(ROOT):
        below = Path(folder).relative_to(ROOT).as_posix()
        folders[:] = [x for x in folders if x not in ("build", "__pycache__") and x[0] != "."]
        found |= {f"{below}/{name}".removeprefix("./") for name in names}
        found |= {f"{below}/{name}/".removeprefix("./") for name in folders}
    return frozenset(found)


def pages() -> list[str]:
    return sorted(name for name in files() if name.endswith(".md"))


@cache
def text_of(name: str) -> str:
    text = (ROOT / name).read_text(encoding="utf-8")
    return COMMENT.sub(" ", text) if name.endswith((".c", ".h")) else text


@cache
def code() -> str:
    """Text of everything that runs, but for this file."""
    names = (name for name in sorted(files()) if PurePosixPath(name).suffix in CODE)
    return "\n".join(text_of(x) for x in names if not x.endswith(Path(__file__).name))


@cache
def words() -> frozenset[str]:
    """Of the code, and what files are called."""
    stems = (PurePosixPath(name).stem for name in files())
    return frozenset(re.findall(r"\w+", code())) | frozenset(stems)


@cache
def prefixes() -> frozenset[str]:
    """What names that the code puts together begin with."""
    made = re.findall(r"\b([A-Za-z]\w*_)\$?\{", code())
    return frozenset([*made, "python_"])  # of a test in Python: tests/CMakeLists.txt


def matching(path: str, folder: str) -> list[str]:
    """Files and folders that a page in a folder means; NAME and * stand for any name."""
    path = os.path.normpath(path)
    pattern = re.compile(
        rf"(?:.*/)?{re.escape(path).replace(re.escape('*'), '[^/]*').replace('NAME', '[^/]*')}/?"
    )
    beside = os.path.normpath(f"{folder}/{path}")
    return [x for x in files() if pattern.fullmatch(x) or x.rstrip("/") == beside]


def is_known_path(path: str, folder: str) -> bool:
    if matching(path, folder) or PLACEHOLDERS & set(re.split(r"[/.]", path)):
        return True
    last = PurePosixPath(path).name
    must_exist = re.match(rf"({TOPS})/", path) or PurePosixPath(path).suffix in SOURCE
    return last in WRITTEN or not must_exist and last in code()


def is_known_name(name: str) -> bool:
    """Whether it is in the code, maybe put together; `_x` is an ending of another name."""
    if name in words() | ELSEWHERE | PLACEHOLDERS or "NAME" in name:
        return True
    if name.startswith("_"):
        return any(word.endswith(name) for word in words() | {f"_{x}" for x in words()})
    rests = (name.removeprefix(prefix) for prefix in prefixes() if name.startswith(prefix))
    return any(rest in words() or f"test_{rest}" in words() for rest in rests)


def unknown_paths(text: str, folder: str) -> Iterator[str]:
    named = {span for span in SPAN.findall(text) if PATH.fullmatch(span)}
    named = {x for x in named if "/" in x.strip("/") or PurePosixPath(x).suffix in SOURCE}
    yield from (x for x in sorted(named) if not is_known_path(x, folder))
    for path in set(IN_TEXT.findall(text)) - named:
        if not is_known_path(path, folder):
            yield path
    for module in MODULE.findall(text):
        path = module.removeprefix("rparm." * module.startswith("rparm.models.")).replace(".", "/")
        if not {f"{path}.py", f"{path}/__main__.py"} & files():
            yield module


def anchors(text: str) -> set[str]:
    """Of the headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", x).strip().lower().replace(" ", "-") for x in headings}


def broken_links(text: str, folder: str) -> Iterator[str]:
    for path, anchor in LINK.findall(text):
        target = os.path.normpath(f"{folder}/{path}") if path else None
        if target and not {target, f"{target}/"} & files() and target != ".":
            yield path
        elif anchor and anchor not in anchors(text_of(target) if target else text):
            yield f"{path}#{anchor}"


def unknown_names(text: str) -> Iterator[str]:
    named = set(FMI_NAME.findall(text))
    for span in [*SPAN.findall(unfenced(text)), *BLOCK.findall(text)]:
        whole = NAME.fullmatch(span)
        named.update(whole[1].split(".") if whole else PART.findall(span))
    yield from sorted(name for name in named if not is_known_name(name))


def misplaced_names(text: str, folder: str) -> Iterator[str]:
    """Names that are not in the file with which the page names them."""
    pairs = [(name, file) for name, file in OF_FILE.findall(text) if NAME.fullmatch(name)]
    for file, rest in ITEM.findall(text):
        for span in SPAN.finditer(rest):
            if PurePosixPath(span[1]).suffix in SOURCE:
                file = span[1] if rest[span.end() :].startswith(":") else ""
            elif file and NAME.fullmatch(span[1]):
                pairs.append((span[1], file))
    for name, file in pairs:
        if PurePosixPath(name).suffix in SOURCE:
            continue
        found = [text_of(x) for x in matching(file, folder)]
        for part in NAME.fullmatch(name)[1].split("."):
            if not any(re.search(rf"\b{part}\b", x) for x in found):
                yield f"{name} of {file}"


def unfenced(text: str) -> str:
    """Without blocks of code, and with list items on one line each."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"\n +(?=\S)", " ", text)


def wrong(text: str, folder: str) -> list[str]:
    """What a page in a folder names that is not there."""
    plain = unfenced(text)
    found = [*unknown_paths(text, folder), *broken_links(text, folder), *unknown_names(text)]
    return sorted({*found, *misplaced_names(plain, folder)})


@pytest.mark.parametrize("page", pages())
def test_what_pages_name_exists(page: str) -> None:
    text = text_of(page)
    folder = str(PurePosixPath(page).parent)
    if ROOT / page == HISTORY:
        assert list(broken_links(text, folder)) == []
    else:
        assert wrong(text, folder) == []


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (
            "2. `src/instance/stepping.c`: `do_step` checks, `integrate_to` integrates",
            "integrate_to",
        ),
        (
            "- `clock.c`: it, and\n  `stepping.c`: `clock_two_sum` adds",
            "clock_two_sum of stepping.c",
        ),
        ("see `arm_forward_dynamics` of `rp_plant.h`", "arm_forward_dynamics of rp_plant.h"),
        ("by tests/fuzz/replays.c", "tests/fuzz/replays.c"),
        ("`steppings.c` does", "steppings.c"),
        ("```sh\npython -m rparm.report.recordings\n```", "rparm.report.recordings"),
        ("[x](CONTRIBUTING.md#nowhere)", "CONTRIBUTING.md#nowhere"),
        ("calls fmi2SetReals", "fmi2SetReals"),
        ("```c\nstatus = instance_do_steps(y);\n```", "instance_do_steps"),
        ("`Model.find_it` finds", "find_it"),
    ],
)
def test_what_does_not_exist_is_noticed(text: str, found: str) -> None:
    assert found in wrong(text, ".")
