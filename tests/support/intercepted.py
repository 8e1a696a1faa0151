"""Functions of an FMU that the loop calls, replaced in a component by Python's."""

from collections.abc import Callable
from ctypes import (
    CFUNCTYPE,
    POINTER,
    c_bool,
    c_double,
    c_int,
    c_size_t,
    c_uint,
    c_void_p,
    cast,
)  # fmt: skip
from typing import Any

from rparm.fmi.loop import Component, function_names

PROTOTYPES = {
    "fmi2GetReal": (c_void_p, POINTER(c_uint), c_size_t, POINTER(c_double)),
    "fmi3GetFloat64": (c_void_p, POINTER(c_uint), c_size_t, POINTER(c_double), c_size_t),
    "fmi2SetBoolean": (c_void_p, POINTER(c_uint), c_size_t, POINTER(c_int)),
    "fmi3DoStep": (c_void_p, c_double, c_double, c_bool, *[POINTER(c_bool)] * 3, POINTER(c_double)),
}


def intercept(component: Component, name: str, function: Callable[..., int]) -> Any:
    """Let a component call function(original, *arguments); keep what is returned."""
    prototype = CFUNCTYPE(c_int, *PROTOTYPES[name])
    number = function_names(component.instance).index(name)
    functions = component.state.fmu.functions
    original = prototype(functions[number])
    made = prototype(lambda *arguments: function(original, *arguments))
    functions[number] = cast(made, c_void_p).value
    return made
