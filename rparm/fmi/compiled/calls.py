"""Functions of a loaded FMU of FMI 2.0, called from compiled code by their addresses.

Addresses are arguments, not constants: one compiled loop serves every FMU, and numba keeps it on
disk. All pointers are integers. Each call returns the FMU's status. FMUs of FMI 3.0 are called in
the same way, through `rparm.fmi.compiled.fmi3_adapters`.
"""

from ctypes import c_void_p, cast

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from rparm.fmi.fmi_instance import Instance

FUNCTIONS = {
    "2.0": (
        "fmi2SetReal",
        "fmi2GetReal",
        "fmi2SetBoolean",
        "fmi2GetBoolean",
        "fmi2DoStep",
        "fmi2GetDirectionalDerivative",
        "fmi2GetInteger",
    ),
    "3.0": (
        "fmi3SetFloat64",
        "fmi3GetFloat64",
        "fmi3SetBoolean",
        "fmi3GetBoolean",
        "fmi3DoStep",
        "fmi3GetDirectionalDerivative",
        "fmi3GetInt32",
    ),
}
SET_REAL, GET_REAL, SET_BOOLEAN, GET_BOOLEAN, DO_STEP, DERIVATIVE, GET_INTEGER = range(7)
DISCARD = 2  # the first status of FMI that stops a run
TERMINATED = 100  # no status of FMI: the FMU asks to end the simulation

_POINTER = ir.IntType(8).as_pointer()
_SIZE = ir.IntType(64)
_STATUS = ir.IntType(32)
_REAL = ir.DoubleType()


def functions(instance: Instance) -> tuple[str, ...]:
    """Names of the functions that an instance is called by."""
    return FUNCTIONS[instance.fmu.model.fmi_version]


def addresses(instance: Instance) -> list[int]:
    """Addresses of its functions in the loaded library; 0 where it lacks one."""
    library = instance.fmi.dll
    return [
        cast(getattr(library, name), c_void_p).value or 0 if hasattr(library, name) else 0
        for name in functions(instance)
    ]


def _call(builder: ir.IRBuilder, kinds: list[ir.Type], arguments: list[ir.Value]) -> ir.Value:
    """Call the function at the address `arguments`[0]; integers become pointers where asked."""
    function = builder.inttoptr(arguments[0], ir.FunctionType(_STATUS, kinds).as_pointer())
    given = [
        builder.inttoptr(value, kind) if isinstance(kind, ir.PointerType) else value
        for kind, value in zip(kinds, arguments[1:], strict=True)
    ]
    return builder.call(function, given)


@intrinsic
def move_values(_context, function, component, references, count, values):
    """fmi2SetReal, fmi2GetReal, fmi2SetBoolean, fmi2GetBoolean or fmi2GetInteger."""
    signature = types.int32(types.int64, types.int64, types.int64, types.int64, types.int64)

    def generate(_context, builder, _signature, arguments):
        return _call(builder, [_POINTER, _POINTER, _SIZE, _POINTER], arguments)

    return signature, generate


@intrinsic
def do_step(_context, function, component, time, length):
    """fmi2DoStep, whose step is never undone."""
    signature = types.int32(types.int64, types.int64, types.float64, types.float64)

    def generate(_context, builder, _signature, arguments):
        final = ir.Constant(_STATUS, 1)
        return _call(builder, [_POINTER, _REAL, _REAL, _STATUS], [*arguments, final])

    return signature, generate


@intrinsic
def directional_derivative(
    _context, function, component, unknowns, knowns, count, direction, result
):
    """fmi2GetDirectionalDerivative, with as many knowns as unknowns."""
    signature = types.int32(*[types.int64] * 7)

    def generate(_context, builder, _signature, arguments):
        function, component, unknowns, knowns, count, direction, result = arguments
        kinds = [_POINTER, _POINTER, _SIZE, _POINTER, _SIZE, _POINTER, _POINTER]
        given = [function, component, unknowns, count, knowns, count, direction, result]
        return _call(builder, kinds, given)

    return signature, generate
