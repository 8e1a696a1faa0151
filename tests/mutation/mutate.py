"""Breaks the equations and the table of states in one place at a time: the tests must notice.

mutate.py BUILD applies every mutant of mutants.toml to a copy of the sources, builds it with the
settings of the folder BUILD and runs the C tests of that source. --few N takes N of them, which
--seed chooses.
"""

import argparse
import random
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.support.paths import ROOT
from tests.support.source_copy import copy_sources, run, settings_of

TIME_LIMIT = 120.0  # s, of a test that a mutant may have made endless


@dataclass(frozen=True)
class Mutant:
    """One replacement in a source, and the tests that must notice it."""

    path: str
    before: str
    after: str
    tests: tuple[str, ...]


def read_mutants() -> list[Mutant]:
    """All mutants of mutants.toml."""
    sources = tomllib.loads(Path(__file__).with_name("mutants.toml").read_text())["source"]
    return [
        Mutant(source["path"], mutant["from"], mutant["to"], tuple(source["tests"]))
        for source in sources
        for mutant in source["mutants"]
    ]


def mutated(mutant: Mutant, text: str) -> str:
    """The source with the mutant in it."""
    if text.count(mutant.before) != 1:
        raise ValueError(
            f"{mutant.path}: '{mutant.before}' is there {text.count(mutant.before)} times"
        )
    return text.replace(mutant.before, mutant.after)


class Workshop:
    """A copy of the sources and its build."""

    def __init__(self, folder: Path, settings_from: Path) -> None:
        self.sources = copy_sources(folder / "sources")
        self.build = folder / "build"
        options = ("-DCMAKE_BUILD_TYPE=Debug", "-DBUILD_TESTING=ON")
        run("cmake", "-S", self.sources, "-B", self.build, *options, *settings_of(settings_from))

    def make(self, tests: tuple[str, ...]) -> None:
        """Build the tests with what they load."""
        run("cmake", "--build", self.build, "--parallel", "2", "--target", *tests)

    def failing(self, tests: tuple[str, ...]) -> str | None:
        """The first test that does not pass."""
        for test in tests:
            program = self.build / "tests" / test
            try:
                result = subprocess.run(
                    program, capture_output=True, check=False, timeout=TIME_LIMIT
                )
            except subprocess.TimeoutExpired:
                return test
            if result.returncode != 0:
                return test
        return None

    def killer(self, mutant: Mutant) -> str | None:
        """The test that notices the mutant, which is gone afterwards."""
        source = self.sources / mutant.path
        text = source.read_text()
        source.write_text(mutated(mutant, text))
        try:
            self.make(mutant.tests)
            return self.failing(mutant.tests)
        finally:
            source.write_text(text)


def hunt(mutants: list[Mutant], settings_from: Path) -> int:
    """Apply the mutants in turn; the number of those that survive."""
    started = time.monotonic()
    survivors = 0
    with tempfile.TemporaryDirectory() as folder:
        workshop = Workshop(Path(folder), settings_from)
        tests = tuple(sorted({test for mutant in mutants for test in mutant.tests}))
        workshop.make(tests)
        broken = workshop.failing(tests)
        if broken is not None:
            raise RuntimeError(f"{broken} fails without any mutant")
        for mutant in mutants:
            killer = workshop.killer(mutant)
            survivors += killer is None
            fate = "SURVIVED" if killer is None else f"killed by {killer}"
            print(f"{mutant.path}: {mutant.before} -> {mutant.after}: {fate}", flush=True)
    seconds = time.monotonic() - started
    print(
        f"figures: mutants of the equations and the table of states; executions {len(mutants)}; "
        f"seconds {seconds:.0f}; findings {survivors}"
    )
    return survivors


def main() -> int:
    """1 where a mutant survives, 2 where one cannot be made."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", type=Path, metavar="BUILD")
    parser.add_argument("--few", type=int, metavar="N")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    mutants = read_mutants()
    try:
        for mutant in mutants:
            mutated(mutant, (ROOT / mutant.path).read_text())
        if arguments.few is not None:
            mutants = random.Random(arguments.seed).sample(mutants, arguments.few)
        return 1 if hunt(mutants, arguments.build) else 0
    except (RuntimeError, ValueError) as error:
        print(f"mutate.py: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
