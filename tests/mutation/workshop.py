"""Copies of the sources with their builds, where mutants are built and tested."""

import contextlib
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from sites import FOLDERS, Mutant, mutated

from tests.support.programs import run_checked
from tests.support.source_copy import copy_sources, settings_of

COMMON_OPTIONS = ("CMAKE_BUILD_TYPE=Mutants", "CMAKE_C_FLAGS=-O1 -w", "BUILD_TESTING=ON")
OPTIONS: dict[str, tuple[str, ...]] = {"plain": (), "sanitized": ("SANITIZE=ON",)}
BUILT_ALONE = 6  # tests that are built when they run: most mutants need no more
BUILD_LIMIT = 300.0  # s
PATIENCE = 20.0  # s, for a test whose time is not known yet
LIMITS = {"plain": "ulimit -c 0 -f 400000 -v 8000000; ", "sanitized": "ulimit -c 0 -f 400000; "}
OBJECT = re.compile(r"-o (\S*CMakeFiles/([^/\s]+)\.dir/\S+)")


@dataclass(frozen=True)
class Test:
    """A C test as ctest knows it."""

    name: str
    command: tuple[str, ...]
    folder: str

    @property
    def target(self) -> str:
        """What has to be built for it."""
        return Path(self.command[0]).name


@dataclass
class Record:
    """What the tests have done so far, shared by all workshops: which to run first and how long."""

    seconds: dict[tuple[str, str], float] = field(default_factory=dict)
    kills: defaultdict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    lock: threading.Lock = field(default_factory=threading.Lock)

    def order(self, file: str, kind: str, tests: list[Test]) -> list[Test]:
        """First the test named like the source, then those that killed most, then the quick."""
        name = f"test_{Path(file).stem}"
        with self.lock:
            kills = self.kills[file].copy()
        return sorted(
            tests,
            key=lambda test: (
                test.name != name,
                -kills[test.name],
                self.seconds.get((kind, test.name), 0.0),
                test.name,
            ),
        )

    def limit(self, kind: str, test: Test) -> float:
        """Time in s after which a test hangs."""
        return 10.0 + 8.0 * self.seconds.get((kind, test.name), 0.0)

    def killed(self, file: str, test: str) -> None:
        """Note a kill."""
        with self.lock:
            self.kills[file][test] += 1


def c_tests(build: Path) -> list[Test]:
    """The tests of a build with the label c."""
    listed = subprocess.run(
        ["ctest", "--show-only=json-v1", "-L", "^c$"],
        cwd=build, check=True, capture_output=True, text=True,
    )  # fmt: skip
    tests = []
    for test in json.loads(listed.stdout)["tests"]:
        properties = {each["name"]: each["value"] for each in test["properties"]}
        folder = properties.get("WORKING_DIRECTORY", str(build))
        tests.append(Test(test["name"], tuple(test["command"]), folder))
    return tests


class Processes:
    """Runs programs that end with this one, whatever they do."""

    def __init__(self) -> None:
        self.stopped = threading.Event()
        self.running: set[subprocess.Popen[bytes]] = set()

    def run(self, command: list[str], folder: Path | str, limit: float) -> str:
        """How a program ended: passed, failed or timeout."""
        process = subprocess.Popen(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self.running.add(process)
        try:
            end = "passed" if process.wait(limit) == 0 else "failed"
        except subprocess.TimeoutExpired:
            end = "timeout"
        finally:
            self.kill(process)
            self.running.discard(process)
        if self.stopped.is_set():
            raise InterruptedError
        return end

    @staticmethod
    def kill(process: subprocess.Popen[bytes]) -> None:
        """End a program and what it has started."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def stop(self) -> None:
        """End all programs."""
        self.stopped.set()
        for process in list(self.running):
            self.kill(process)


class Workshop:
    """A copy of the sources and its builds: one without sanitizers and, once needed, one with."""

    def __init__(
        self, folder: Path, settings_from: Path, processes: Processes, record: Record
    ) -> None:
        self.processes = processes
        self.record = record
        self.settings = settings_of(settings_from)
        self.sources = copy_sources(folder / "sources")
        self.builds = {kind: folder / kind for kind in OPTIONS}
        self.tests: dict[str, list[Test]] = {}
        self.programs: dict[str, dict[str, str]] = {}
        self.prepare("plain")
        commands = self.builds["plain"] / "compile_commands.json"
        self.compiled = json.loads(commands.read_text(encoding="utf-8"))
        self.objects = {file: self.digests(file) for file in self.product_files()}

    def prepare(self, kind: str) -> None:
        """Build everything without a mutant."""
        build = self.builds[kind]
        generator = ["-G", "Ninja"] if shutil.which("ninja") else []
        options = [f"-D{option}" for option in (*COMMON_OPTIONS, *OPTIONS[kind])]
        run_checked("cmake", "-S", self.sources, "-B", build, *generator, *options, *self.settings)
        run_checked("cmake", "--build", build, "--parallel", "1")
        self.tests[kind] = c_tests(build)
        self.programs[kind] = {test.name: self.digest(build, test) for test in self.tests[kind]}

    @staticmethod
    def digest(build: Path, test: Test) -> str:
        """Hash of a test's program, of the files in its command, and of the FMUs that it names."""
        files = [Path(part) for part in test.command if part.startswith("/")]
        parts = [file.read_bytes() for file in files if file.is_file()]
        folders = (build / "fmu", *build.glob("tests/*/fmu"))
        libraries = sorted(file for folder in folders for file in folder.rglob("*.so"))
        parts += [each.read_bytes() for each in libraries if str(each).encode() in parts[0]]
        return hashlib.sha256(b"".join(parts)).hexdigest()

    def make(self, kind: str, targets: list[str]) -> bool:
        """Build the targets; whether that succeeds."""
        build = str(self.builds[kind])
        command = ["cmake", "--build", build, "--parallel", "1", "--target", *targets]
        return self.processes.run(command, self.builds[kind], BUILD_LIMIT) == "passed"

    def product_files(self) -> list[str]:
        """Sources that are compiled, by their paths in the copy."""
        files = {Path(entry["file"]) for entry in self.compiled}
        inside = [file for file in files if file.is_relative_to(self.sources)]
        relative = [file.relative_to(self.sources).as_posix() for file in inside]
        return sorted(file for file in relative if file.startswith(FOLDERS))

    def objects_of(self, files: list[str]) -> list[tuple[Path, str]]:
        """Objects of the sources and the targets that they belong to."""
        wanted = {str(self.sources / file) for file in files}
        found = []
        for entry in self.compiled:
            match = OBJECT.search(entry["command"])
            if entry["file"] in wanted and match:
                found.append((Path(entry["directory"]) / match[1], match[2]))
        return found

    def digests(self, file: str) -> dict[Path, str]:
        """Hashes of the objects of a source."""
        return {
            path: hashlib.sha256(path.read_bytes()).hexdigest()
            for path, _ in self.objects_of([file])
            if path.exists()
        }

    def compile(self, file: str) -> str:
        """Compile what a source is part of: fails, gives the same code or other code."""
        files = [file] if file in self.objects else list(self.objects)  # a header: all
        targets = {target for path, target in self.objects_of(files) if path.exists()}
        if not self.make("plain", sorted(targets)):
            return "uncompilable"
        same = all(self.digests(each) == self.objects[each] for each in files)
        return "same code" if same else "other code"

    def passes(self, kind: str, test: Test) -> str:
        """How a test ends; one whose program is as without a mutant need not run."""
        if self.digest(self.builds[kind], test) == self.programs[kind][test.name]:
            return "passed"
        return self.run(kind, test)

    def run(self, kind: str, test: Test) -> str:
        """Run a test: passed, failed or timeout."""
        shell = ["sh", "-c", LIMITS[kind] + 'exec "$@"', "sh", *test.command]
        return self.processes.run(shell, test.folder, self.record.limit(kind, test))

    def measure(self, kind: str, tests: list[Test]) -> None:
        """Run tests without a mutant, to know that they pass and how long they take."""
        for test in tests:
            started = time.monotonic()
            self.record.seconds[kind, test.name] = PATIENCE
            if self.run(kind, test) != "passed":
                raise RuntimeError(f"{test.name} fails without any mutant ({kind})")
            self.record.seconds[kind, test.name] = time.monotonic() - started

    def killer(self, file: str, kind: str) -> tuple[str, str] | None:
        """The first test that does not pass, and how it ends."""
        tests = self.record.order(file, kind, self.tests[kind])
        built = True
        for index, test in enumerate(tests):
            if index <= BUILT_ALONE:
                following = tests[index:] if index == BUILT_ALONE else [test]
                built = self.make(kind, sorted({each.target for each in following}))
            end = self.passes(kind, test) if built else "failed"  # a check of the compiler
            if end != "passed":
                self.record.killed(file, test.name)
                return test.name, end
        return None

    @contextlib.contextmanager
    def broken(self, mutant: Mutant) -> Iterator[None]:
        """The sources with the mutant in them, which is gone afterwards."""
        source = self.sources / mutant.file
        text = source.read_text(encoding="utf-8")
        source.write_text(mutated(mutant, text), encoding="utf-8")
        try:
            yield
        finally:
            source.write_text(text, encoding="utf-8")

    def judge(self, mutant: Mutant, kind: str) -> tuple[str, str]:
        """Verdict on a mutant by the tests of one build, and the test that gave it."""
        with self.broken(mutant):
            code = self.compile(mutant.file) if kind == "plain" else "other code"
            if code != "other code":
                return code, ""
            killer = self.killer(mutant.file, kind)
        if killer is None:
            return "survived", ""
        if kind == "sanitized":
            return "sanitizer", killer[0]
        return "timeout" if killer[1] == "timeout" else "killed", killer[0]
