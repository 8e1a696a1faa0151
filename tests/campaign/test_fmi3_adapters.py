"""Adapters between C functions: called as those of FMI 2.0, they call as FMI 3.0 wants it."""

from ctypes import (
    CFUNCTYPE,
    POINTER,
    Array,
    c_bool,
    c_double,
    c_int,
    c_size_t,
    c_uint32,
    c_void_p,
    cast,
)
from typing import Any

from rparm.fmi.compiled.calls import DERIVATIVE, GET_BOOLEAN, SET_BOOLEAN
from rparm.fmi.compiled.fmi3_adapters import ADDRESSES

INSTANCE = 0x1234
COUNT = 3
REFERENCES, BOOLEANS, REALS = POINTER(c_uint32), POINTER(c_bool), POINTER(c_double)
SIZED = (REFERENCES, c_size_t)
MOVE_2 = CFUNCTYPE(c_int, c_void_p, *SIZED, POINTER(c_int))
MOVE_3 = CFUNCTYPE(c_int, c_void_p, *SIZED, BOOLEANS, c_size_t)
DERIVATIVE_2 = CFUNCTYPE(c_int, c_void_p, *SIZED, *SIZED, REALS, REALS)
DERIVATIVE_3 = CFUNCTYPE(c_int, c_void_p, *SIZED, *SIZED, REALS, c_size_t, REALS, c_size_t)


def row(function: int, callback: Any) -> Array:
    """What an adapter gets in place of a component."""
    made = (c_void_p * (1 + len(ADDRESSES)))(INSTANCE)
    made[1 + function] = cast(callback, c_void_p)
    return made


def test_booleans_are_set() -> None:
    seen = []

    @MOVE_3
    def take(instance: int, references: Any, count: int, values: Any, values_count: int) -> int:
        seen.append((instance, references[:count], values[:count], values_count))
        return 1

    values = (c_int * COUNT)(1, 0, 1)
    adapter = MOVE_2(ADDRESSES[SET_BOOLEAN])
    given = row(SET_BOOLEAN, take)
    assert adapter(given, (c_uint32 * COUNT)(7, 9, 8), COUNT, values) == 1
    assert seen == [(INSTANCE, [7, 9, 8], [True, False, True], COUNT)]
    assert list(values) == [1, 0, 1]


def test_booleans_are_read() -> None:
    @MOVE_3
    def give(_instance: int, references: Any, count: int, values: Any, _values_count: int) -> int:
        for i in range(count):
            values[i] = references[i] != 9
        return 0

    values = (c_int * (COUNT + 1))(0, 1, 0, -5)
    adapter = MOVE_2(ADDRESSES[GET_BOOLEAN])
    given = row(GET_BOOLEAN, give)
    assert adapter(given, (c_uint32 * COUNT)(7, 9, 8), COUNT, values) == 0
    assert list(values) == [1, 0, 1, -5]  # nothing behind them


def test_sizes_of_a_derivative() -> None:
    @DERIVATIVE_3
    def derive(instance: int, unknowns: Any, n: int, knowns: Any, m: int, *rest: Any) -> int:
        seed, seeds, sensitivity, sensitivities = rest
        if (instance, n, m, seeds, sensitivities) != (INSTANCE, 2, COUNT, COUNT, 2):
            return 3
        total = sum(a * x for a, x in zip(knowns[:m], seed[:m], strict=True))
        for i in range(n):
            sensitivity[i] = unknowns[i] * total
        return 0

    result = (c_double * 2)()
    adapter = DERIVATIVE_2(ADDRESSES[DERIVATIVE])
    knowns, unknowns = (c_uint32 * COUNT)(1, 2, 4), (c_uint32 * 2)(3, 5)
    direction = (c_double * COUNT)(0.5, 0.25, 2.0)
    given = row(DERIVATIVE, derive)
    assert adapter(given, unknowns, 2, knowns, COUNT, direction, result) == 0
    assert list(result) == [27.0, 45.0]
