"""Functions with the prototypes of FMI 2.0 that call an FMU of FMI 3.0: the loop knows only these.

In place of the component, each adapter takes a row of pointers: to the FMU's instance, then to its
functions, in the order of `compiled_loop.FUNCTIONS`. Importing this module compiles them.
"""

import numpy as np
from llvmlite import ir
from numba import carray, cfunc, njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from rparm.fmi.compiled_call import BOOLEAN_3, POINTER, REAL, SIZE, STATUS, call
from rparm.fmi.fmi_instance import DISCARD, TERMINATED

INSTANCE, SET_FLOAT64, GET_FLOAT64, SET_BOOLEAN, GET_BOOLEAN, DO_STEP, DERIVATIVE = range(7)
GET_INT32 = 7
ROW = types.CPointer(POINTER)
BOOLEAN_2 = types.int32
_move = cfunc(STATUS(ROW, POINTER, SIZE, POINTER), cache=True)


@intrinsic
def _place(_context):
    """Return eight bytes of the calling function's stack, all 0."""

    def generate(_context, builder, _signature, _arguments):
        place = cgutils.alloca_once(builder, ir.IntType(64), zfill=True)
        return builder.bitcast(place, cgutils.voidptr_t)

    return POINTER(), generate


# ---- Values --------------------------------------------------------------------------------------
@njit(cache=True, nogil=True)
def _move_booleans(row, function, references, count, values):
    """Move Booleans, which are ints in FMI 2.0 and bytes in FMI 3.0."""
    ints = carray(values, count, np.int32)
    truths = np.empty(count, np.bool_)
    for i in range(count):
        truths[i] = ints[i] != 0
    status = call(row[function], (row[INSTANCE], references, count, truths.ctypes, count))
    for i in range(count):
        ints[i] = truths[i]
    return status


@_move
def _set_real(row, references, count, values):
    return call(row[SET_FLOAT64], (row[INSTANCE], references, count, values, count))


@_move
def _get_real(row, references, count, values):
    return call(row[GET_FLOAT64], (row[INSTANCE], references, count, values, count))


@_move
def _get_integer(row, references, count, values):
    return call(row[GET_INT32], (row[INSTANCE], references, count, values, count))


@_move
def _set_boolean(row, references, count, values):
    return _move_booleans(row, SET_BOOLEAN, references, count, values)


@_move
def _get_boolean(row, references, count, values):
    return _move_booleans(row, GET_BOOLEAN, references, count, values)


# ---- Steps ---------------------------------------------------------------------------------------
@cfunc(STATUS(ROW, REAL, REAL, BOOLEAN_2), cache=True)
def _do_step(row, time, length, final):
    """Step an instance without event mode and early return."""
    event, terminates, early, reached = _place(), _place(), _place(), _place()
    results = event, terminates, early, reached
    status = call(row[DO_STEP], (row[INSTANCE], time, length, BOOLEAN_3(final), *results))
    if status < DISCARD and carray(terminates, 1, np.bool_)[0]:
        return TERMINATED
    return status


@cfunc(STATUS(ROW, POINTER, SIZE, POINTER, SIZE, POINTER, POINTER), cache=True)
def _derivative(row, unknowns, unknown_count, knowns, known_count, direction, result):
    given = unknowns, unknown_count, knowns, known_count
    further = direction, known_count, result, unknown_count
    return call(row[DERIVATIVE], (row[INSTANCE], *given, *further))


ADAPTERS = (
    _set_real, _get_real, _set_boolean, _get_boolean, _do_step, _derivative, _get_integer,
)  # fmt: skip
ADDRESSES = tuple(adapter.address for adapter in ADAPTERS)
