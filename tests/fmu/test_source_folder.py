"""The program that writes an FMU's sources, on a small project."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support.generator import WHEEL, generate
from tests.support.paths import ROOT
from tests.support.programs import run

PROGRAM = ROOT / "fmu" / "source_code.py"
SINE = "double sin(double x)\n{\n\treturn __sin(x);\n}\n"
SINE = f'#include <features.h>\n#include <math.h>\n#include "sin_data.h"\n\n{SINE}'
FILES = {
    "toy/src/toy.c": '/* #include "nowhere.h" */\n#include "deep/toy.h"\n#include <stdio.h>\n'
    "/* cos(x) */ double cos, y = sin (1.0);\n",
    "toy/include/deep/toy.h": '#  include "../plain.h" // twice\n#include <plain.h>\n',
    "toy/include/plain.h": '#include "deep/toy.h"\nint caf\udce9;\n',
    "toy/include/unused.h": "",
    "math/sin.c": SINE,
    "math/__sin.c": "",
    "math/sin_data.c": "",
    "math/sin_data.h": "",
    "math/cos.c": "",
    "math/front.h": "",
}


class Toy:
    """A project of two libraries, and the program run on it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.output = folder / "out" / "sources"
        for name, text in FILES.items():
            self.write(name, text)
        self.libraries: list[dict[str, Any]] = [
            self.library("toy", ["toy/src/toy.c"], include=["toy/include"]),
            self.library(
                "elementary_functions",
                ["math/sin.c", "math/__sin.c", "math/sin_data.c", "math/cos.c"],
                prelude=str(folder / "math/front.h"),
            ),
        ]
        self.roots = {
            "project": str(ROOT),
            "toy": str(folder / "toy"),
            "math": str(folder / "math"),
        }

    def write(self, name: str, text: str) -> None:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text.encode("utf-8", "surrogateescape"))

    def library(
        self, name: str, sources: list[str], include: list[str] | None = None, prelude: str = ""
    ) -> dict[str, Any]:
        return {
            "name": name,
            "sources": [str(self.folder / source) for source in sources],
            "include": [str(self.folder / below) for below in include or []],
            "prelude": prelude,
        }

    def run(self, *options: object) -> subprocess.CompletedProcess[str]:
        manifest = self.folder / "manifest.json"
        if not manifest.exists():
            manifest.write_text(json.dumps({"libraries": self.libraries, "roots": self.roots}))
        return run(sys.executable, PROGRAM, manifest, "--output", self.output, *options)

    def contents(self) -> dict[str, str]:
        """Files of sources/ that are not the project's."""
        files = (path for path in self.output.rglob("*") if path.is_file())
        texts = {
            path.relative_to(self.output).as_posix(): path.read_bytes().decode(
                "utf-8", "surrogateescape"
            )
            for path in files
        }
        return {name: text for name, text in texts.items() if not name.startswith("project/")}


@pytest.fixture
def toy(tmp_path: Path) -> Toy:
    return Toy(tmp_path)


def test_only_includes_are_changed_and_what_is_not_called_is_left_out(toy: Toy) -> None:
    result = toy.run()
    assert result.returncode == 0, result.stderr
    front = '#include "project/fmu/source_code.h"\n#include "generated/elementary_functions.h"\n'
    math_front = front + '#include "math/front.h"\n'
    assert toy.contents() == {
        "toy_toy.c": front
        + '/* #include "nowhere.h" */\n#include "toy/include/deep/toy.h"\n#include <stdio.h>\n'
        "/* cos(x) */ double cos, y = sin (1.0);\n",
        "toy/include/deep/toy.h": '#include "../plain.h" // twice\n#include "../plain.h"\n',
        "toy/include/plain.h": '#include "deep/toy.h"\nint caf\udce9;\n',
        "math_sin.c": math_front
        + SINE.replace("#include <features.h>", "").replace('"sin_data', '"math/sin_data'),
        "math___sin.c": math_front,
        "math_sin_data.c": math_front,
        "math/sin_data.h": "",
        "math/front.h": "",
        "generated/elementary_functions.h": (
            "/* Functions of musl, by other names than the standard ones. */\n"
            "#define sin fmu_sin\ndouble sin(double x);\n"
        ),
    }


def test_of_sundials_comments_on_its_copyright_stay_only(toy: Toy) -> None:
    toy.write("sundials/step.c", (
        '/* Copyright (c) Them\n * See the LICENSE. */\n\n/* The step. */\n\n'
        '#include "step.h" // below\n#define HALF 0.5 /* of\n two */\n'
        "char slash = '\"', *text = \"/* \\\" kept */\"; /* gone */\nint a = HALF/* */*2; \n"
    ))  # fmt: skip
    toy.write("sundials/step.h", "int step(/* nothing */ void);\n/**/\n")
    toy.libraries.append(toy.library("sundials", ["sundials/step.c"]))
    toy.roots["sundials"] = str(toy.folder / "sundials")
    assert toy.run().returncode == 0
    found = toy.contents()
    assert found["sundials/step.h"] == "int step(  void);\n\n"
    _, _, own = found["sundials_step.c"].partition("/* C")
    assert own == (
        'opyright (c) Them\n * See the LICENSE. */\n\n#include "sundials/step.h"\n'
        '#define HALF 0.5\nchar slash = \'"\', *text = "/* \\" kept */";\nint a = HALF *2;\n'
    )


def test_headers_of_the_project_come_with_what_they_include(toy: Toy) -> None:
    toy.run()
    prelude = toy.output / "project" / "fmu" / "source_code.h"
    assert '#include "../src/model/platform.h"' in prelude.read_text()
    assert (toy.output / "project" / "src" / "model" / "platform.h").is_file()


def test_two_folders_give_the_same_bytes(tmp_path: Path) -> None:
    toys = [Toy(tmp_path / name) for name in ("a", "a folder with a longer name")]
    for toy in toys:
        assert toy.run().returncode == 0
    assert toys[0].contents() == toys[1].contents()


def test_files_that_are_gone_do_not_stay(toy: Toy) -> None:
    toy.run()
    stale = toy.output / "stale" / "stale.c"
    stale.parent.mkdir()
    stale.touch()
    assert toy.run().returncode == 0
    assert not stale.parent.exists()
    assert [path.name for path in toy.output.parent.iterdir()] == ["sources"]


def test_make_is_given_all_that_was_read(tmp_path: Path) -> None:
    toy = Toy(tmp_path / "a folder")
    rule = tmp_path / "sources.d"
    assert toy.run("--depfile", rule, "--target", "description.xml").returncode == 0
    target, _, files = rule.read_text().replace("\\\n", "").partition(":")
    assert target == "description.xml"
    read = set(files.replace("\\ ", "?").split())
    unused = {"toy/include/unused.h", "math/cos.c"}
    own = {str(tmp_path / "a?folder" / name) for name in FILES.keys() - unused}
    prelude = {str(ROOT / "fmu" / "source_code.h"), str(ROOT / "src" / "model" / "platform.h")}
    assert read == own | prelude


# ---- Mistakes -----------------------------------------------------------------------------------


# files, sources that join a library, what is said
MISTAKES: dict[str, tuple[dict[str, str], dict[int, str], str]] = {
    "source": ({}, {0: "toy/missing.c"}, "toy/missing.c: cannot be read: No such file"),
    "header": (
        {"toy/src/toy.c": '\n\n#include "missing.h"\n'}, {},
        "toy/src/toy.c:3: header missing.h was not found",
    ),
    "header of a header": (
        {"toy/include/plain.h": "#include <deep/missing.h>\n"}, {},
        "toy/include/plain.h:1: header deep/missing.h was not found",
    ),
    "header that the prelude lacks": (
        {"toy/src/toy.c": "#include <complex.h>\n"}, {},
        "toy/src/toy.c:1: header complex.h was not found",
    ),
    "same name": (
        {"toy/other/TOY.c": ""}, {0: "toy/other/TOY.c"},
        "toy/other/TOY.c: would be sources/toy_TOY.c, as {folder}/toy/src/toy.c",
    ),
    "file from elsewhere": (
        {"elsewhere.c": ""}, {0: "elsewhere.c"}, "elsewhere.c: is in no folder of the manifest",
    ),
    "function": (
        {"math/sin.c": "double cos(double x)\n{\n}\n"}, {}, "math/sin.c: does not define sin",
    ),
    "manifest": ({"manifest.json": '{"libraries": 5}'}, {}, "manifest.json: is not a manifest: "),
    "damaged manifest": (
        {"manifest.json": '{"libraries": '}, {}, "manifest.json: is not a manifest: ",
    ),
}  # fmt: skip


def test_the_manifest_needs_the_elementary_functions(toy: Toy) -> None:
    toy.libraries.pop()
    assert "the manifest has no library elementary_functions" in refused(toy)


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_refused_in_one_line(toy: Toy, name: str) -> None:
    files, sources, expected = MISTAKES[name]
    for file, text in files.items():
        toy.write(file, text)
    for library, source in sources.items():
        toy.libraries[library]["sources"].append(str(toy.folder / source))
    assert expected.format(folder=toy.folder) in refused(toy)


def refused(toy: Toy) -> str:
    """The one line that the program says."""
    result = toy.run()
    assert result.returncode == 2
    assert result.stderr.startswith("source_code.py: ") and result.stderr.count("\n") == 1
    assert not toy.output.exists()
    return result.stderr


def test_what_was_written_before_stays_after_a_mistake(toy: Toy) -> None:
    toy.run()
    before = toy.contents()
    toy.write("toy/src/toy.c", "#include <missing.h>\n")
    assert toy.run().returncode == 2
    assert toy.contents() == before


def test_a_description_of_no_files_is_refused(tmp_path: Path) -> None:
    result = generate(WHEEL, tmp_path / "out", "--sources", tmp_path)
    assert result.returncode == 2
    assert result.stderr == f"generate.py: {tmp_path}: has no C files\n"
    assert not (tmp_path / "out" / "modelDescription.xml").exists()
