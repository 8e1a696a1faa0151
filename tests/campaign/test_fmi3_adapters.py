"""The adapter of a derivative: called as FMI 2.0 does, it calls as FMI 3.0 wants it.

Those of values and steps: test_fmi3.py, where a derivative has as many unknowns as knowns.
"""

from ctypes import CFUNCTYPE, POINTER, c_double, c_int, c_size_t, c_uint32, c_void_p, cast
from typing import Any

from rparm.fmi.compiled_fmi3 import ADDRESSES
from rparm.fmi.compiled_loop import DERIVATIVE

INSTANCE = 0x1234
COUNT = 3
REALS = POINTER(c_double)
SIZED = (POINTER(c_uint32), c_size_t)
DERIVATIVE_2 = CFUNCTYPE(c_int, c_void_p, *SIZED, *SIZED, REALS, REALS)
DERIVATIVE_3 = CFUNCTYPE(c_int, c_void_p, *SIZED, *SIZED, REALS, c_size_t, REALS, c_size_t)


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
    given = (c_void_p * (1 + len(ADDRESSES)))(INSTANCE)  # in place of a component
    given[1 + DERIVATIVE] = cast(derive, c_void_p)
    assert adapter(given, unknowns, 2, knowns, COUNT, direction, result) == 0
    assert list(result) == [27.0, 45.0]
