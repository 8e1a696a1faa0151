"""Thousands of mutated files with equations; some of those that are accepted are compiled."""

import os
import random
from pathlib import Path

from tests.equations.compiled import Model, ModelFileError
from tests.equations.test_model_file import EXAMPLES, mutated, read_mutations

COUNT = int(os.environ.get("MUTATIONS", "10000"))


def test_many_mutated_files(tmp_path: Path) -> None:
    assert COUNT / 10 < read_mutations(tmp_path, COUNT, COUNT) < 0.9 * COUNT


def test_what_is_accepted_compiles(tmp_path: Path) -> None:
    chance, texts = random.Random(2), [path.read_text() for path in EXAMPLES]
    compiled = 0
    while compiled < 100:
        folder = tmp_path / str(compiled)
        folder.mkdir(exist_ok=True)
        try:
            Model(folder, mutated(chance, chance.choice(texts)))
        except ModelFileError:
            continue
        compiled += 1
