"""Breaks the C sources in places drawn by chance: the C tests must notice.

random_mutants.py BUILD takes a sample of all mutants of src, fmu and models, builds each with the
settings of the folder BUILD in a copy of the sources and runs the C tests; those that live run with
sanitizers too. Mutants that do not compile, or of which the compiler makes the same code, are
replaced by the next ones of the seed: so the sources need not be parsed.
"""

import argparse
import contextlib
import hashlib
import json
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.support.paths import ROOT
from tests.support.programs import run_checked
from tests.support.source_copy import copy_sources, settings_of

FOLDERS = ("src", "fmu", "models")
NO_CODE = re.compile(r'/\*.*?\*/|//[^\n]*|^#(?:\\\n|[^\n])*|"(?:\\.|[^"\\])*"', re.DOTALL | re.M)
# clang-format sets spaces around operators of two values, and none behind those of one
PLACES = {
    "operator": r"(?<= )(?:[-+*/%&|^]|<<|>>|[-+*/|&]=|[<>=!]=|[<>]|&&|\|\|)(?= )",
    "count": r"(?:\+\+|--)(?!\)\s\{)",  # a loop that counts the wrong way proves nothing
    "negation": r"!(?=[\w(])",
    "condition": r"(?:if|while) \([^;{}]*\)(?= \{\n)",
    "sign": r"(?<![-\w])-(?=[\w(.])",
    "constant": r"(?<![\w.])(?:\d+\.\d*(?:e-?\d+)?|\d+)(?![\w.])|\b(?:true|false|INFINITY)\b",
    "removal": r"^ +(?!return|break|continue|goto|case|default|\(void\))\w[^;{}]*;(?=[ #]*$)",
}
TYPE = r"[\w\s]*\b(?:double|real|bool|char|int|size_t|uint\w+|(?:struct|enum) \w+) \**"
DECLARED = re.compile(rf"{TYPE}[^=]*$")  # in front of a number: it is a length of an array
DECLARATION = re.compile(rf"{TYPE}\w")
OPERATORS = {
    "+": "-", "-": "+", "*": "/", "/": "*", "%": "*", "&": "|", "|": "&", "^": "|",
    "<<": ">>", ">>": "<<", "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "|=": "=", "&=": "=",
    "<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"),
    "==": "!=", "!=": "==", "&&": "||", "||": "&&",
}  # fmt: skip
NAMES = {"true": "false", "false": "true", "INFINITY": "(-INFINITY)"}
OPTIONS = ["-DCMAKE_BUILD_TYPE=Mutants", "-DCMAKE_C_FLAGS=-O1 -w", "-DBUILD_TESTING=ON"]
if shutil.which("ld.gold"):  # half the time of a link, and a mutant needs up to 130
    OPTIONS += [f"-DCMAKE_{kind}_LINKER_FLAGS=-fuse-ld=gold" for kind in ("EXE", "SHARED")]
MOST_KILLING = 8  # programs that run first, with those of the mutant's folder
LIMITS = {"plain": "ulimit -c 0 -f 400000 -v 8000000; ", "sanitized": "ulimit -c 0 -f 400000; "}
TEST_LIMIT = 100  # s, after which a test hangs; the slowest takes a tenth
UNCOMPILABLE, SAME_CODE, LIVES = "do not compile", "same code", "lives"


@dataclass(frozen=True)
class Mutant:
    """Text of a source that another takes the place of."""

    file: str
    start: int
    before: str
    after: str

    def of(self, text: str) -> str:
        """The source with the mutant in it."""
        return text[: self.start] + self.after + text[self.start + len(self.before) :]

    def description(self, text: str) -> str:
        """One line for a reader."""
        line = text.count("\n", 0, self.start) + 1
        code = text.splitlines()[line - 1].strip()
        return f"{self.file}:{line}: {code}: {self.before.strip()} -> {self.after or '(removed)'}"


def replacements(kind: str, before: str) -> tuple[str, ...]:
    """What can take the place of a text."""
    if kind == "operator":
        after = OPERATORS[before]
        return after if isinstance(after, tuple) else (after,)
    if kind == "count":
        return ("--" if before == "++" else "++",)
    if kind == "condition":
        head, _, condition = before.partition(" ")
        return (f"{head} (!{condition})",)
    if kind != "constant":
        return ("",) if kind != "removal" else (";",)
    if before in NAMES:
        return (NAMES[before],)
    if "." in before:
        return ("1.0",) if float(before) == 0.0 else (f"(2.0 * {before})", f"(-{before})")
    return (f"({before} + 1)",)


def is_idle(kind: str, code: str, start: int) -> bool:
    """Whether a mutant changes nothing, or never compiles, because something is declared there."""
    if kind == "constant":
        return bool(DECLARED.match(code[code.rindex("\n", 0, start) + 1 : start]))
    return kind == "removal" and bool(DECLARATION.match(code, start))


def mutants_of(file: str, text: str) -> list[tuple[Mutant, ...]]:
    """All mutants of a source, by their places."""
    code = NO_CODE.sub(lambda found: re.sub(r"[^\n]", "#", found[0]), text)
    places = []
    for kind, pattern in PLACES.items():
        for found in re.finditer(pattern, code, re.MULTILINE):
            if not is_idle(kind, code, found.start()):
                before = text[slice(*found.span())]
                alternatives = replacements(kind, before)
                places.append(
                    tuple(Mutant(file, found.start(), before, after) for after in alternatives)
                )
    return places


def sources(root: Path) -> dict[str, str]:
    """Text of every C file that mutants are made of, by its path from the root."""
    return {
        path.relative_to(root).as_posix(): path.read_text(encoding="utf-8")
        for folder in FOLDERS
        for path in sorted((root / folder).rglob("*.[ch]"))
    }


def order(texts: dict[str, str], seed: int) -> list[Mutant]:
    """One mutant of every place in an order that follows from the seed."""
    chance = random.Random(seed)
    places = [place for file, text in texts.items() for place in mutants_of(file, text)]
    chance.shuffle(places)
    return [chance.choice(place) for place in places]


@dataclass
class Build:
    """C tests of a copy of the sources."""

    folder: Path
    kind: str  # plain or sanitized
    tests: dict[str, tuple[str, str]] = field(default_factory=dict)  # program and folder of each
    kills: Counter[str] = field(default_factory=Counter)  # by program

    def prepare(self, copy: Path, settings: list[str]) -> None:
        """Build everything without a mutant; all tests pass."""
        generator = ["-G", "Ninja"] if shutil.which("ninja") else []
        sanitize = f"-DSANITIZE={'ON' if self.kind == 'sanitized' else 'OFF'}"
        options = [*generator, *OPTIONS, sanitize, *settings]
        run_checked("cmake", "-S", copy, "-B", self.folder, *options)
        run_checked("cmake", "--build", self.folder, "--parallel", "2", "--target", "c_tests")
        listed = run_checked("ctest", "--show-only=json-v1", "-L", "^c$", folder=self.folder)
        for test in json.loads(listed)["tests"]:
            properties = {each["name"]: each["value"] for each in test["properties"]}
            program = Path(test["command"][0]).name
            self.tests[test["name"]] = program, properties["LABELS"][-1]
        if failed := self.failed(self.programs()):
            raise RuntimeError(f"{failed} fails without any mutant ({self.kind})")

    def programs(self) -> set[str]:
        """Targets of all tests."""
        return {program for program, _ in self.tests.values()}

    def rounds(self, mutant: Mutant) -> Iterator[set[str]]:
        """The programs that probably kill a mutant, then all."""
        folder = Path(mutant.file).parent.name
        near = {program for program, its in self.tests.values() if its == folder}
        yield near | {program for program, _ in self.kills.most_common(MOST_KILLING)}
        yield self.programs()

    def make(self, programs: set[str]) -> bool:
        """Build these; whether that succeeds."""
        command = ["cmake", "--build", self.folder, "--parallel", "2", "--target", *programs]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0

    def code(self) -> dict[str, bytes]:
        """Hashes of all objects."""
        objects = sorted(self.folder.rglob("*.o"))
        return {str(path): hashlib.sha256(path.read_bytes()).digest() for path in objects}

    def failed(self, programs: set[str]) -> str:
        """The first test of these programs that does not pass, or nothing."""
        names = "|".join(name for name, (program, _) in self.tests.items() if program in programs)
        tests = ["ctest", "-R", f"^({names})$", "--stop-on-failure", "-j", "2"]
        tests += ["--timeout", str(TEST_LIMIT)]
        command = ["sh", "-c", LIMITS[self.kind] + 'exec "$@"', "sh", *tests]
        done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True, check=False)
        failed = re.search(r"Test +#\d+: (\S+) .*\*\*\*", done.stdout)
        return failed[1] if failed else "ctest" if done.returncode else ""


class Workshop:
    """A copy of the sources with a build without sanitizers and, once it is needed, one with."""

    def __init__(self, folder: Path, settings: list[str]) -> None:
        self.folder = folder
        self.settings = settings
        self.copy = copy_sources(folder / "sources")
        self.builds: dict[str, Build] = {}
        self.code = self.build("plain").code()

    def build(self, kind: str) -> Build:
        """A build, made when it is asked for the first time."""
        if kind not in self.builds:
            build = Build(self.folder / kind, kind)
            build.prepare(self.copy, self.settings)
            self.builds[kind] = build
        return self.builds[kind]

    def judge(self, mutant: Mutant) -> str:
        """Verdict on a mutant: by the tests without sanitizers, then by those with."""
        for kind in LIMITS:
            build = self.build(kind)
            with self.broken(mutant):
                for programs in filter(None, build.rounds(mutant)):
                    if not build.make(programs):
                        return UNCOMPILABLE
                    is_last = programs == build.programs()
                    if is_last and kind == "plain" and build.code() == self.code:
                        return SAME_CODE
                    if failed := build.failed(programs):
                        build.kills[build.tests.get(failed, (failed,))[0]] += 1
                        return f"dies by {failed} ({kind})"
        return LIVES

    @contextlib.contextmanager
    def broken(self, mutant: Mutant) -> Iterator[None]:
        """The sources with the mutant in them, which is gone afterwards."""
        source = self.copy / mutant.file
        text = source.read_text(encoding="utf-8")
        source.write_text(mutant.of(text), encoding="utf-8")
        try:
            yield
        finally:
            source.write_text(text, encoding="utf-8")


def judged(workshop: Workshop, mutants: list[Mutant], texts: dict[str, str], count: int) -> Counter:
    """How many of so many mutants live or die, and how many they replaced; printed one by one."""
    verdicts: Counter[str] = Counter()
    for mutant in mutants:
        if verdicts[LIVES] + verdicts["dies"] == count:
            break
        verdict = workshop.judge(mutant)
        verdicts["dies" if verdict.startswith("dies") else verdict] += 1
        print(f"{mutant.description(texts[mutant.file])}: {verdict}", flush=True)
    return verdicts


def main() -> int:
    """1 where too few mutants die, 2 where they cannot be made."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", type=Path, metavar="BUILD")
    parser.add_argument("--seed", type=int, help="of the sample; a new one if it is not given")
    parser.add_argument("--count", type=int, default=20, metavar="N", help="mutants of the sample")
    parser.add_argument(
        "--at-least", type=float, default=0.0, metavar="PERCENT", help="of them must die"
    )
    arguments = parser.parse_args()
    seed = arguments.seed or random.SystemRandom().randrange(1, 1_000_000)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(2))
    started = time.monotonic()
    texts = sources(ROOT)
    mutants = order(texts, seed)
    print(f"seed {seed}: {len(mutants)} places", flush=True)
    try:
        with tempfile.TemporaryDirectory() as folder:
            workshop = Workshop(Path(folder), settings_of(arguments.build))
            verdicts = judged(workshop, mutants, texts, arguments.count)
    except RuntimeError as error:
        print(f"random_mutants.py: {error}", file=sys.stderr)
        return 2
    died = verdicts["dies"]
    print(
        f"figures: random mutants of all C; executions {died + verdicts[LIVES]}; "
        f"seconds {time.monotonic() - started:.0f}; findings {verdicts[LIVES]}; "
        f"{verdicts[UNCOMPILABLE]} {UNCOMPILABLE}; {verdicts[SAME_CODE]} {SAME_CODE}"
    )
    return 1 if 100.0 * died < arguments.at_least * (died + verdicts[LIVES]) else 0


if __name__ == "__main__":
    sys.exit(main())
