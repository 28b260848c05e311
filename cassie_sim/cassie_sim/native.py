"""MuJoCo's own functions and structures, for compiled code that calls them."""

from __future__ import annotations

import ctypes
from typing import Any

import mujoco
from llvmlite import ir
from numba import types
from numba.extending import intrinsic


@intrinsic
def call(_context: Any, function: Any, first: Any, second: Any) -> Any:
    """Call the C function of two pointers at an address; all three are integers.

    With an address as an argument, unlike a ctypes function, the caller's machine code can be kept.
    """
    signature = types.void(types.intp, types.intp, types.intp)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), (pointer, pointer))
        target = builder.inttoptr(arguments[0], kind.as_pointer())
        operands = [builder.inttoptr(argument, pointer) for argument in arguments[1:]]
        builder.call(target, operands)
        return context.get_dummy_value()

    return signature, generate


def mj_step_address() -> int:
    """Address of the `mj_step` that the `mujoco` package itself calls."""
    # A symbol is looked up in a library and in those it is linked with.
    library = ctypes.CDLL(mujoco._functions.__file__)
    return int(ctypes.cast(library.mj_step, ctypes.c_void_p).value or 0)


def addresses(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[int, int]:
    """Addresses of a model's and its data's C structures; valid as long as these live."""
    return int(model._address), int(data._address)
