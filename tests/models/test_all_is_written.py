"""Functions of models from equations write their results as a whole: the same bits whatever stood
there before. The plant: test_plant_model.py; calls of FMI: fuzz/fuzz_hostile.c."""

from pathlib import Path
from shutil import copy

import numpy as np
import pytest

from tests.equations.compiled import Model, Words
from tests.equations.examples import FOLDER
from tests.support.model_calls import events_of, known_words, part, results

NAMES = sorted(path.stem for path in FOLDER.glob("*.toml") if not path.stem.endswith(".lock"))


def written(words: Words, holds: int, fill: float) -> dict[str, np.ndarray]:
    """What the functions write at a random point with these modes, over this value."""
    source, known, events = np.random.default_rng(holds), known_words(words), events_of(words)
    values = source.uniform(0.5, 2.0, len(known))
    if events:
        values[part(events, "modes")].view("i4")[:] = holds
    slope, inputs = np.full(len(known), 0.25), source.normal(size=(words.u_size // 8 + 1, 4))
    return results(words, values, (slope, slope), inputs, fill, known)


@pytest.mark.parametrize("name", NAMES)
def test_results_do_not_depend_on_what_stood_there(name: str, tmp_path: Path) -> None:
    for component in FOLDER.glob("*.toml"):
        copy(component, tmp_path)
    model = Model(tmp_path, (FOLDER / f"{name}.toml").read_text(encoding="utf-8"), "-w")
    for holds in (0, 1):
        one, other = (written(model.words, holds, fill) for fill in (np.nan, 0.0))
        for key, value in one.items():
            np.testing.assert_array_equal(value, other[key], f"{key}, modes {holds}", strict=True)
