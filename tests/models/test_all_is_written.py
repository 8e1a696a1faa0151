"""Functions of models from equations write their results as a whole: the same bits whatever stood
there before. The other models: test_every_model.c; calls of FMI: fuzz/fuzz_hostile.c."""

import ctypes
from pathlib import Path

import numpy as np
import pytest

from tests.equations.compiled import LENGTH, WORDS_OF_EVENTS, Model, Origin
from tests.equations.examples import FOLDER

NAMES = sorted(path.stem for path in FOLDER.glob("*.toml") if not path.stem.endswith(".lock"))
OF_EVENTS = [*WORDS_OF_EVENTS, "are_possible", "modes_are_possible", "moves_on", "is_at_rest"]
OF_EVENTS += ["describe", "indicators", "errors"]
INDICATOR = np.dtype([("kind", "i4"), ("gap", "i4"), ("state", "u8"), ("factor", "f8"),
                      ("offset", "f8"), ("rises", "u1"), ("end", "u1", 7)])  # fmt: skip
USED = ((), ("state", "factor", "offset", "rises"), ("offset",))  # by kind


class Events(ctypes.Structure):
    """struct model_events up to `errors`: words of 64 bits."""

    _fields_ = [(name, ctypes.c_size_t) for name in OF_EVENTS]


def call(address: int, *arguments: np.ndarray | float | int) -> None:
    """Call a function that returns a status or nothing."""
    converted = [
        ctypes.c_void_p(a.ctypes.data) if isinstance(a, np.ndarray)
        else ctypes.c_double(a) if isinstance(a, float) else ctypes.c_size_t(a)
        for a in arguments
    ]  # fmt: skip
    ctypes.CFUNCTYPE(None, *map(type, converted))(address)(*converted)


def part(words: ctypes.Structure, name: str) -> slice:
    """A range of the value structure in words of 64 bits."""
    first, size = getattr(words, f"{name}_offset"), getattr(words, f"{name}_size")
    return slice(first // 8, -(-(first + size) // 8))


def results(model: Model, holds: int, fill: float) -> dict[str, np.ndarray]:
    """What the functions write at a random point, over this value."""
    words, t, source = model.words, 3.0, np.random.default_rng(holds)
    events = Events.from_address(words.events) if words.events else None
    known, values = np.zeros(-(-words.size // 8), dtype=bool), np.zeros(-(-words.size // 8))
    for name in "pux":
        known[part(words, name)] = True
    if events:
        for name in ("discrete_states", "discrete_inputs", "modes"):
            known[part(events, name)] = True
    values[known] = source.uniform(0.5, 2.0, np.count_nonzero(known))
    if events:
        values[part(events, "modes")].view("i4")[:] = holds
    x, u = values[part(words, "x")].copy(), values[part(words, "u")].copy()
    values[~known] = fill
    count = len(x)
    found = {"dx": np.full(count, fill), "J": np.full(count * count, fill)}
    call(words.right_hand_side, values, t, x, u, found["dx"])
    if count:
        call(words.jacobian, values, t, x, u, found["J"])
    found["outputs"] = values.copy()
    call(words.outputs, found["outputs"], t)
    for name in ("first", "second"):
        found[name] = np.where(known, 0.25, fill)
    call(words.derivatives, found["outputs"], t, 1.0, found["first"], found["second"])

    row_count, _, extend = (ctypes.c_size_t * 3).from_address(words.series)
    rows, inputs = np.full((row_count, LENGTH), fill), source.normal(size=(len(u) + 1, 4))
    rows[:count, 0] = x
    origin = Origin(values.ctypes.data, t, 0.25, inputs.ctypes.data, False)
    call(extend, ctypes.addressof(origin), 0, LENGTH - 1, rows)
    found["state rows"] = rows[:count]
    if events and events.indicator_count:
        described = np.full(events.indicator_count * INDICATOR.itemsize, 255 if fill else 0, "u1")
        found["z"] = np.full(events.indicator_count, fill)
        found["errors"] = np.full(events.indicator_count, fill)
        call(events.describe, values, described)
        call(events.indicators, values, t, x, u, found["z"])
        call(events.errors, values, t, 1e-9 * x, np.abs(u) + 1.0, 1e-15, found["errors"])
        for i, row in enumerate(described.view(INDICATOR)):
            for key in ("kind", *USED[row["kind"]]):
                found[f"{key} of indicator {i}"] = np.array(row[key])
    return found


@pytest.mark.parametrize("name", NAMES)
def test_results_do_not_depend_on_what_stood_there(name: str, tmp_path: Path) -> None:
    model = Model(tmp_path, (FOLDER / f"{name}.toml").read_text(encoding="utf-8"), "-w")
    for holds in (0, 1):
        one, other = (results(model, holds, fill) for fill in (np.nan, 0.0))
        for key, value in one.items():
            np.testing.assert_array_equal(value, other[key], f"{key}, modes {holds}", strict=True)
