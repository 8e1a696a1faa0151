"""All functions of a struct model (src/model/model.h), whatever stands where they write."""

import ctypes
from collections.abc import Iterable

import numpy as np

from tests.equations.compiled import LENGTH, WORDS_OF_EVENTS, Origin, Words

OF_EVENTS = [*WORDS_OF_EVENTS, "are_possible", "modes_are_possible", "moves_on", "is_at_rest"]
OF_EVENTS += ["describe", "indicators", "errors", "reach"]
INDICATOR = np.dtype([("kind", "i4"), ("gap", "i4"), ("state", "u8"), ("factor", "f8"),
                      ("offset", "f8"), ("rises", "u1"), ("end", "u1", 7),
                      ("is_far_above", "f8")])  # fmt: skip
UNUSED, OF_STATE, OF_MODEL = range(3)
USED = ((), ("state", "factor", "offset", "rises"), ("offset",))  # by kind
T, SCALE = 3.0, 1 / 64  # s: the time, and that of series


class Events(ctypes.Structure):
    """struct model_events up to `reach`: words of 64 bits."""

    _fields_ = [(name, ctypes.c_size_t) for name in OF_EVENTS]


def events_of(words: Words) -> Events | None:
    """Return struct model_events, if the model has it."""
    return Events.from_address(words.events) if words.events else None


def call(address: int, *arguments: np.ndarray | float | int | None, fails: bool = False) -> None:
    """Call a function that returns a status; `fails`: or nothing."""
    converted = [
        ctypes.c_void_p(None if a is None else a.ctypes.data)
        if a is None or isinstance(a, np.ndarray)
        else ctypes.c_double(a) if isinstance(a, float) else ctypes.c_size_t(a)
        for a in arguments
    ]  # fmt: skip
    status = ctypes.CFUNCTYPE(ctypes.c_int, *map(type, converted))(address)(*converted)
    assert fails or status == 0


def part(words: ctypes.Structure, name: str) -> slice:
    """A range of the value structure in words of 64 bits."""
    first, size = getattr(words, f"{name}_offset"), getattr(words, f"{name}_size")
    return slice(first // 8, -(-(first + size) // 8))


def known_words(words: Words) -> np.ndarray:
    """True where the value structure has what is given: not calculated."""
    known, events = np.zeros(-(-words.size // 8), dtype=bool), events_of(words)
    for name in (*"pux", "anchors"):
        known[part(words, name)] = True
    for name in ("discrete_states", "discrete_inputs", "modes") if events else ():
        known[part(events, name)] = True
    return known


def series(
    words: Words, values: np.ndarray, inputs: np.ndarray, fill: float, ends: Iterable[int],
    scale: float = SCALE,
) -> np.ndarray:  # fmt: skip
    """Return all rows up to the last of these orders, each of which ends a call."""
    row_count, _, extend = (ctypes.c_size_t * 3).from_address(words.series)
    rows, states = np.full((row_count, LENGTH), fill), values[part(words, "x")]
    rows[: len(states), 0] = states
    origin = Origin(values.ctypes.data, T, scale, inputs.ctypes.data, False)
    first = 0
    for last in ends:
        call(extend, ctypes.addressof(origin), first, last, rows)
        first = last + 1
    return rows


def results(
    words: Words, point: np.ndarray, curve: tuple[np.ndarray, np.ndarray], inputs: np.ndarray,
    fill: float, known: np.ndarray,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Return what the functions write at a point, with `fill` for all that is not known.

    curve: first and second derivatives of all that is known. inputs: their series, (inputs, 4).
    """
    events, values = events_of(words), np.where(known, point, fill)
    x, u = values[part(words, "x")].copy(), values[part(words, "u")].copy()
    given = values.copy()  # of functions to which states and inputs are arguments
    given[part(words, "x")] = given[part(words, "u")] = fill
    count = len(x)
    found = {"dx": np.full(count, fill), "J": np.full(count * count, fill)}
    call(words.right_hand_side, given, T, x, u, found["dx"])
    if count:
        call(words.jacobian, given, T, x, u, found["J"])
    found["outputs"] = values.copy()
    call(words.outputs, found["outputs"], T)
    for name, slope in zip(("first", "second"), curve, strict=True):
        found[name] = np.where(known, slope, fill)
    found["first alone"] = found["first"].copy()
    call(words.derivatives, found["outputs"], T, 1.0, found["first"], found["second"])
    call(words.derivatives, found["outputs"], T, 1.0, found["first alone"], None)
    np.testing.assert_array_equal(found["first"], found["first alone"])
    found["state rows"] = series(words, values, inputs, fill, [LENGTH - 1])[:count]
    if events and events.indicator_count:
        described = np.full(events.indicator_count * INDICATOR.itemsize, 255 if fill else 0, "u1")
        found["z"] = np.full(events.indicator_count, fill)
        call(events.describe, values, described, fails=True)
        call(events.indicators, given, T, x, u, found["z"])
        for i, row in enumerate(described.view(INDICATOR)):
            for key in ("kind", *USED[row["kind"]]):
                found[f"{key} of indicator {i}"] = np.array(row[key])
    if events and events.errors:
        errors = found["errors"] = np.full(events.indicator_count, fill)
        call(events.errors, values, T, 1e-9 * x, np.abs(u) + 1.0, 1e-15, errors, fails=True)
    if events and events.reach:
        found["reach"] = np.full(count, fill)
        call(events.reach, given, x, found["reach"], fails=True)
    return found
