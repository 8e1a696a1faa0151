"""Calls of functions by their addresses, for the code that numba compiles."""

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

POINTER, SIZE, REAL, STATUS = types.voidptr, types.uintp, types.float64, types.int32
BOOLEAN_3 = types.uint8  # of FMI 3.0


@intrinsic
def call(_context, function, arguments):
    """Call a function by its address; its status. The types of the arguments are its prototype."""
    kinds = [POINTER if isinstance(kind, types.ArrayCTypes) else kind for kind in arguments]
    assert {*kinds} <= {POINTER, SIZE, types.int64, REAL, STATUS, BOOLEAN_3}

    def generate(_context, builder, _signature, given):
        function, packed = given
        values = cgutils.unpack_tuple(builder, packed)
        kinds = [value.type for value in values]
        prototype = ir.FunctionType(ir.IntType(32), kinds).as_pointer()
        is_pointer = isinstance(function.type, ir.PointerType)
        convert = builder.bitcast if is_pointer else builder.inttoptr
        # as C extends a bool
        extended = {i: ("zeroext",) for i, kind in enumerate(kinds) if kind == ir.IntType(8)}
        return builder.call(convert(function, prototype), values, arg_attrs=extended)

    return STATUS(function, types.BaseTuple.from_types(kinds)), generate
