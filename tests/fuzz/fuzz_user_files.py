"""Mutates the files that users write: each is read, or refused by a UserError of one line.

python tests/fuzz/fuzz_user_files.py SECONDS [SEED]; 1 where something else was raised, or took
too long. tests/equations/test_model_file.py does it with files of equations.
"""

import io
import json
import random
import re
import shutil
import sys
import time
import tomllib
import traceback
import warnings
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "fmu")]

from compiler.read import by_hand  # noqa: E402
from compiler.read.content import ModelFileError  # noqa: E402
from compiler.write import lock  # noqa: E402
from compiler.write.c_tables import value_references, variable_table  # noqa: E402
from compiler.write.declaration import declared, keys  # noqa: E402
from fmi2.model_description import model_description  # noqa: E402
from fmi3.model_description import model_description as fmi3_model_description  # noqa: E402
from fmi3.model_description import terminals_and_icons  # noqa: E402
from program import Provenance  # noqa: E402
from rparm.models.closed_loop.study import EXPERIMENT  # noqa: E402

from rparm.errors import UserError  # noqa: E402
from rparm.fmi.fmu_file import read_model  # noqa: E402
from rparm.fmi.model import Model  # noqa: E402
from rparm.runs import scenario as scenarios  # noqa: E402
from rparm.runs.comparison import load_reference  # noqa: E402
from rparm.systems import comparison, ssp  # noqa: E402

SLOWEST = 5.0  # s of processor time, for one file
MODEL = "rp_manipulator"
SCENARIO = "constant_effort_single_step"
CLOSED_LOOP = ROOT / "models" / "closed_loop"
LOGGED = """title = "A"
description = "B"
tolerance = 1e-8
[time]
start = 0.0
stop = "5 s"
step = "100 ms"
[initial]
q1 = "-90 deg"
[inputs.f2]
file = "log.csv"
column = "effort"
scale = "1 kN"
hold = true
[measured.q2]
file = "log.csv"
time = "time"
column = "#"
scale = 0.001
"""
# literals of TOML, to put in the place of any value
VALUES = (
    *("nan", "inf", "-inf", "1e308", "-1e308", "5e-324", "0", "-1", "-0.0", "1e999", "1e-300"),
    *("true", '""', '"x"', "[]", "{}", "[[]]", "[{}]", "[1, 2]", "[[0, 1], [1, nan]]"),
    *("1979-05-27T07:32:00Z", "07:32:00", '"\\u0000"', '"\\U0010ffff"', '"../../x"', "9" * 30),
    *("9" * 5000, "0x" + "f" * 5000, "[0.001, 1e-12]", "[1e300]", '"' + "a" * 100_000 + '"'),
    *('"90 deg"', '"300mm"', '"1e400 m"', '"5 1/s"', '"-1e-400 N.m"', '"' + "9" * 90 + ' rad"'),
    *("{ constant = 0x" + "f" * 5000 + " }", "[[0.0, 1e308], [1.0, -1e308]]", '["x"]'),
)
# strings to put somewhere in a text
TEXTS = (
    *("\0", "\n", "\r", '"', "'", "<", ">", "&", "=", ",", "/", "..", "nan", "1e999", "-"),
    *("9" * 400, "\ufeff", "\u202e", "<!--", "&#0;", "]]>", "{", "[", "[[", ".x" * 100, "é"),
    "[time]\n",
)
Check = Callable[[], object]


class Literal(str):
    """Text that stands in a TOML file as it is."""


def toml(value: object) -> str:
    """Text of a value in TOML, on one line."""
    if isinstance(value, Literal):
        return str(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value) if isinstance(value, str | bool) else repr(value)


def places(value: object) -> Iterator[tuple[dict | list, str | int]]:
    """All places in tables and lists, by container and key."""
    pairs = value.items() if isinstance(value, dict) else ()
    pairs = enumerate(value) if isinstance(value, list) else pairs
    for key, inner in list(pairs):
        yield value, key
        yield from places(inner)


def mutated_toml(text: str, chance: random.Random) -> str:
    """Another value, a missing key or a misspelt one in a TOML file."""
    content = tomllib.loads(text)
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        container, key = chance.choice(list(places(content)))
        what = chance.random()
        if what < 0.8:
            container[key] = Literal(chance.choice(VALUES))
        elif what < 0.9:
            del container[key]
        elif isinstance(container, dict):
            container[chance.choice(("", "x", f"{key}x", "constant", "include"))] = container.pop(
                key
            )
        if not content:
            break
    return "\n".join(f"{json.dumps(key)} = {toml(value)}" for key, value in content.items())


def mutated_text(text: str, chance: random.Random) -> str:
    """A text that is cut, or with something left out, doubled, exchanged or put in."""
    for _ in range(chance.choice((1, 1, 2, 8))):
        i, j = sorted(chance.randrange(len(text) + 1) for _ in range(2))
        j = min(j, i + chance.choice((1, 8, 100)))
        put_in = chance.choice(TEXTS)
        text = chance.choice(
            (
                text[:i],
                text[:i] + text[j:],
                text[:j] + text[i:],
                text[:i] + put_in + text[i:],
                text[:i] + put_in + text[j:],
                text.replace(text[i:j] or "\0", put_in, 3),
            )
        )
        text = text or "\n"
    return text


def mutated_bytes(content: bytes, chance: random.Random) -> bytes:
    """Bytes that are cut, changed or left out."""
    result = bytearray(content)
    for _ in range(chance.choice((1, 1, 4, 30))):
        # names, sizes and methods of an archive's files are at its end
        i = max(0, len(result) - 1 - int(chance.expovariate(1 / chance.choice((2000, 200_000)))))
        what = chance.random()
        if what < 0.1:
            del result[i:]
        elif what < 0.2:
            del result[i : i + chance.randrange(1, 40)]
        elif i < len(result):
            result[i] = chance.choice((0, 1, 255, chance.randrange(256)))
    return bytes(result)


def raised_by(check: Check) -> Exception | None:
    """What a check raises."""
    try:
        check()
    except Exception as error:  # noqa: BLE001 (any is what is looked for)
        return error
    return None


class Fuzz:
    """One kind of file after the other, each in a folder that has what belongs to it."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.chance = random.Random(seed)
        self.seed = seed
        self.folder = folder
        self.executions = self.refused = 0
        self.findings: dict[str, str] = {}
        self.model = folder / "models" / MODEL
        shutil.copytree(ROOT / "models" / MODEL, self.model, ignore=shutil.ignore_patterns("*.png"))
        for name in ("wheel.toml", "wheel.lock.toml"):
            shutil.copy(ROOT / "tests" / "wheel" / name, folder)
        self.scenario = self.model / "scenarios" / f"{SCENARIO}.toml"
        self.log = self.scenario.with_name("log.csv")
        rows = "".join(f"{i},{i / 10},{i % 7}\n" for i in range(100))
        self.log.write_text(f'"#",time,effort\n{rows}')
        self.reference = self.model / "references" / SCENARIO / "RPManipulator_ref.csv"
        self.scenario_texts = [x.read_text() for x in self.scenario.parent.glob("*.toml")]
        self.scenario_texts.append(LOGGED)
        self.declared = read_model(ROOT / "build" / "RPManipulator.fmu")
        with zipfile.ZipFile(ROOT / "build" / "RPManipulator.fmu") as archive:
            self.fmu = {name: archive.read(name) for name in archive.namelist()}
        with zipfile.ZipFile(ROOT / "build" / "ClosedLoop.ssp") as archive:
            self.system = {name: archive.read(name) for name in archive.namelist()}

    def run(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        kinds = (
            *(self.a_scenario, self.a_log, self.a_declaration, self.a_reference, self.an_fmu),
            self.a_system,
        )
        while time.monotonic() < end:
            kinds[self.executions % len(kinds)]()

    def either_way(self, text: str) -> bytes:
        """A mutation of a TOML file, by its values or by its characters."""
        if self.chance.random() < 0.7:
            return mutated_toml(text, self.chance).encode(errors="surrogatepass")
        return mutated_text(text, self.chance).encode(errors="surrogatepass")

    def a_scenario(self) -> None:
        self.with_file(
            self.scenario,
            self.either_way(self.chance.choice(self.scenario_texts)),
            lambda: scenarios.load(self.scenario, self.declared),
        )

    def a_log(self) -> None:
        kept = self.scenario.read_bytes()
        self.scenario.write_text(LOGGED)
        content = mutated_text(self.log.read_text(), self.chance).encode(errors="surrogatepass")
        self.with_file(self.log, content, lambda: scenarios.load(self.scenario, self.declared))
        self.scenario.write_bytes(kept)

    def a_declaration(self) -> None:
        file = self.chance.choice(sorted(self.folder.glob("wheel*.toml")))
        content = self.either_way(file.read_text(encoding="utf-8"))
        self.with_file(file, content, self.generate)

    def generate(self) -> None:
        file = by_hand.read(self.folder / "wheel.toml")
        references = lock.references(self.folder / "wheel.lock.toml", keys(file))
        declaration = declared(file, references)
        model_description(declaration, Provenance("1"))
        fmi3_model_description(declaration, Provenance("1"))
        terminals_and_icons(declaration)
        value_references(declaration)
        variable_table(declaration)

    def a_reference(self) -> None:
        text = mutated_text(self.reference.read_text(encoding="utf-8"), self.chance)
        self.with_file(
            self.reference,
            text.encode(errors="surrogatepass"),
            lambda: self.read_scenario(self.declared),
        )

    def read_scenario(self, declared: Model) -> None:
        load_reference(scenarios.load(self.scenario, declared), declared)

    def an_fmu(self) -> None:
        path = self.folder / "model.fmu"
        self.archive(path, self.fmu, "modelDescription.xml")
        self.check(lambda: self.read_scenario(read_model(path)), path.read_bytes())

    def a_system(self) -> None:
        path = self.folder / "system.ssp"
        names = [name for name in self.system if name.endswith((".ssd", ".ssv"))]
        name = self.chance.choice((names[0], "SystemStructure.ssd", self.chance.choice(names)))
        self.archive(path, self.system, name)
        self.check(lambda: self.read_system(path), path.read_bytes())

    def archive(self, path: Path, files: dict[str, bytes], name: str) -> None:
        """Write an archive with a mutation of one of its files, sometimes of its bytes."""
        changed = mutated_text(files[name].decode(), self.chance).encode(errors="surrogatepass")
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            for entry, content in files.items():
                archive.writestr(entry, changed if entry == name else content)
            if self.chance.random() < 0.2:
                info = zipfile.ZipInfo()
                info.filename = mutated_text(self.chance.choice(list(files)), self.chance)
                with suppress(UnicodeEncodeError), warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # two files of one name
                    archive.writestr(info, changed)
        content = buffer.getvalue()
        if self.chance.random() < 0.4:
            content = mutated_bytes(content, self.chance)
        path.write_bytes(content)

    def read_system(self, path: Path) -> None:
        with ssp.unpacked(path) as unpacked:
            for name in unpacked.system.parameters:
                comparison.load_reference(unpacked, name, CLOSED_LOOP, EXPERIMENT)

    def with_file(self, file: Path, content: bytes, check: Check) -> None:
        kept = file.read_bytes()
        file.write_bytes(content)
        try:
            self.check(check, content)
        finally:
            file.write_bytes(kept)

    def check(self, check: Check, content: bytes) -> None:
        self.executions += 1
        begin = time.process_time()
        error = raised_by(check)
        taken = time.process_time() - begin
        found = None
        if isinstance(error, UserError | ModelFileError):
            self.refused += 1
            text = str(error)
            if not text or "\n" in text or re.search(r"\w' object|^'|: '\w+'$", text):
                found = f"no message of one line for a user: {text[:200]!r}"
        elif error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            found = f"{type(error).__name__} in {place.filename}:{place.lineno}: {str(error)[:200]}"
        if taken > SLOWEST:
            found = f"{taken:.0f} s for one file"
        if found and found not in self.findings:
            kept = Path.cwd() / f"finding_{self.seed}_{self.executions}.bin"
            kept.write_bytes(content)
            self.findings[found] = kept.name


def main() -> int:
    """Fuzz for a time; the figures are the last line."""
    seconds = float(sys.argv[1])
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    with TemporaryDirectory(prefix="fuzz-") as name:
        fuzz = Fuzz(Path(name), seed)
        fuzz.run(seconds)
    for text, file in fuzz.findings.items():
        print(f"finding, input in {file}: {text}")
    print(
        f"figures: files of users; executions {fuzz.executions}; refused {fuzz.refused}; "
        f"seconds {seconds:.0f}; findings {len(fuzz.findings)}"
    )
    return 1 if fuzz.findings else 0


if __name__ == "__main__":
    sys.exit(main())
