"""The structures and functions of the loop in C, as loop.h, fmu_calls.h and tangent.h explain them.

A structure keeps the arrays that it points to.
"""

import functools
from ctypes import (
    CDLL,
    CFUNCTYPE,
    Structure,
    addressof,
    c_double,
    c_int,
    c_int32,
    c_int64,
    c_uint32,
    c_void_p,
    sizeof,
)
from typing import Any

import fmpy
import numpy as np

from rparm import project
from rparm.errors import UserError, one_line

# by version of FMI, in the order of enum fmu_function
FUNCTIONS = {
    "2.0": (
        "fmi2SetReal", "fmi2GetReal", "fmi2SetBoolean", "fmi2GetBoolean",
        "fmi2SetInteger", "fmi2GetInteger", "fmi2SetInteger", "fmi2GetInteger",
        "fmi2SetRealInputDerivatives", "fmi2GetRealOutputDerivatives",
        "fmi2GetDirectionalDerivative", "fmi2DoStep",
    ),
    "3.0": (
        "fmi3SetFloat64", "fmi3GetFloat64", "fmi3SetBoolean", "fmi3GetBoolean",
        "fmi3SetInt32", "fmi3GetInt32", "fmi3SetInt64", "fmi3GetInt64",
        "", "fmi3GetOutputDerivatives", "fmi3GetDirectionalDerivative", "fmi3DoStep",
    ),
}  # fmt: skip
TYPES = ("Boolean", "Integer", "Enumeration")  # enum fmu_type
ENDED, RAISED = 1_000_000, 1_000_001
STEP, READ, ROW, SLOPES, GET_DISCRETE, SET_DISCRETE, NOT_FINITE, HOST = range(8)  # loop_phase
Solve, Follow, Host = CFUNCTYPE(c_int, c_int64), CFUNCTYPE(c_int), CFUNCTYPE(c_int, c_double)


class _Pointing(Structure):
    """A structure whose pointers are set to arrays."""

    def point(self, **arrays: Any) -> None:
        """Let members point to arrays, of numpy or of structures; they live as long as this."""
        kept = self.__dict__.setdefault("arrays", {})
        for name, array in arrays.items():
            kept[name] = array
            is_numpy = isinstance(array, np.ndarray)
            setattr(self, name, array.ctypes.data if is_numpy else addressof(array))


class Polynomials(_Pointing):
    _fields_ = [
        ("instance", c_void_p),
        ("set", c_void_p),
        ("count", c_int64),
        ("references", c_void_p),
        ("order", c_int64),
        ("coefficients", c_void_p),
        ("values", c_void_p),
        ("host", Host),
        ("start", c_double),
        ("status", c_int32),
    ]


class FmuCalls(_Pointing):
    _fields_ = [
        ("instance", c_void_p),
        ("functions", c_void_p * len(FUNCTIONS["2.0"])),
        ("polynomials", c_void_p),
        ("reached", c_double),
        ("memory", c_void_p),
        ("memory_count", c_int64),
        ("version", c_int32),
        ("called", c_int32),
    ]


class FmuVariable(Structure):
    _fields_ = [("reference", c_uint32), ("type", c_int32)]


class TangentState(_Pointing):
    _fields_ = [
        ("count", c_int64),
        *((name, c_void_p) for name in ("derivatives", "states", "deviation", "rate", "predicted")),
        ("real_count", c_int64),
        ("reals", c_void_p),
        ("real_values", c_void_p),
        ("integer_count", c_int64),
        ("integers", c_void_p),
        ("integer_values", c_void_p),
        ("has_begun", c_int64),
    ]


class ComponentState(_Pointing):
    _fields_ = [
        ("fmu", FmuCalls),
        ("number", c_int64),
        ("input_count", c_int64),
        *(
            (name, c_void_p)
            for name in (
                "inputs", "sources", "ahead", "on_loop", "orders", "input_values", "kept", "lines",
            )
        ),
        *((name, c_int32) for name in ("has_ahead", "solves", "is_sampled", "is_due")),
        ("output_count", c_int64),
        ("outputs", c_void_p),
        ("first", c_int64),
        ("before", c_void_p),
        ("slope_count", c_int64),
        *(
            (name, c_void_p)
            for name in ("slope_outputs", "slope_orders", "slope_indices", "slope_values")
        ),
        ("difference_count", c_int64),
        ("differences", c_void_p),
        ("read_count", c_int64),
        *((name, c_void_p) for name in ("read", "read_columns", "read_values")),
        ("discrete_count", c_int64),
        ("discretes", c_void_p),
        ("discrete_columns", c_void_p),
        *((name, c_double) for name in ("every", "time", "began", "ticks")),
    ]  # fmt: skip


class Switch(Structure):
    _fields_ = [
        ("source", c_int32),
        ("target", c_int32),
        ("from_", FmuVariable),
        ("to", FmuVariable),
        ("column", c_int64),
        ("value", c_int64),
        ("is_new", c_int64),
    ]


class Failure(Structure):
    _fields_ = [
        ("status", c_int32),
        ("phase", c_int32),
        ("component", c_int64),
        ("item", c_int64),
        ("time", c_double),
    ]


class LoopState(_Pointing):
    _fields_ = [
        ("component_count", c_int64),
        ("components", c_void_p),
        ("group_count", c_int64),
        ("grouped", c_void_p),
        ("group_first", c_void_p),
        ("values", c_void_p),
        ("slopes", c_void_p),
        ("owners", c_void_p),
        ("first_driven", c_int64),
        ("driven_count", c_int64),
        ("switch_count", c_int64),
        ("switches", c_void_p),
        ("scheduled_count", c_int64),
        ("row_width", c_int64),
        ("column_count", c_int64),
        ("columns", c_void_p),
        ("solve", Solve),
        ("follow", Follow),
        ("tangent", c_void_p),
        *(
            (name, c_int32)
            for name in (
                "extrapolates", "has_rates", "is_final", "checks_finite", "sets_for_rows",
                "reads_for_rows", "inputs_first",
            )
        ),
        ("start", c_double),
        ("time", c_double),
        ("end", c_double),
        ("step_count", c_int64),
        ("stop", c_int32),
        ("failure", Failure),
    ]  # fmt: skip


class Run(_Pointing):
    _fields_ = [
        ("count", c_int64),
        *(
            (name, c_void_p)
            for name in ("ends", "driven", "scheduled", "has_row", "rows", "growth")
        ),
    ]


STRUCTURES = (
    Polynomials,
    FmuCalls,
    FmuVariable,
    TangentState,
    ComponentState,
    Switch,
    Failure,
    LoopState,
    Run,
)


@functools.cache
def library() -> CDLL:
    """Load the loop; UserError if it is not there, or of another version than this file."""
    path = project.loop_folder() / f"loop{fmpy.sharedLibraryExtension}"
    way_out = "install rparm again" if project.INSTALLED else "cmake --build build makes it"
    if not path.is_file():
        raise UserError(f"{path}: not there, {way_out}")
    try:
        found = CDLL(str(path))
        found.loop_size.restype = c_int64
    except (OSError, AttributeError) as error:
        raise UserError(f"{path}: cannot be loaded, {way_out}: {one_line(error)}") from error
    if [found.loop_size(i) for i in range(len(STRUCTURES))] != [*map(sizeof, STRUCTURES)]:
        raise UserError(f"{path}: not of this version of rparm, {way_out}")
    found.loop_advance.restype = found.loop_transfer.restype = c_int64
    found.loop_advance.argtypes = c_void_p, c_void_p
    found.loop_transfer.argtypes = found.loop_read_row.argtypes = c_void_p, c_void_p
    found.loop_follow_slopes.argtypes = (c_void_p,)
    return found
