"""C functions for compiled code: MuJoCo's functions and structures, and words shared by threads."""

from __future__ import annotations

import ctypes
from typing import Any

import mujoco
from llvmlite import ir
from numba import types
from numba.extending import intrinsic


@intrinsic
def call(_context: Any, function: Any, first: Any, second: Any) -> Any:
    """Call a C function of two pointers; `function` is its address, and all three are integers.

    An address is an argument, unlike a ctypes function. So the caller's machine code can be cached.
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


def _word(builder: Any, address: Any) -> Any:
    return builder.inttoptr(address, ir.IntType(64).as_pointer())


@intrinsic
def load(_context: Any, address: Any) -> Any:
    """The 64-bit integer at an address, as the last `store` of any thread wrote it."""
    signature = types.int64(types.intp)

    def generate(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        return builder.load_atomic(_word(builder, arguments[0]), "seq_cst", 8)

    return signature, generate


@intrinsic
def store(_context: Any, address: Any, value: Any) -> Any:
    """Write a 64-bit integer; a thread that reads it by `load` sees all earlier writes, too."""
    signature = types.void(types.intp, types.int64)

    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        builder.store_atomic(arguments[1], _word(builder, arguments[0]), "seq_cst", 8)
        return context.get_dummy_value()

    return signature, generate


def libc_address(name: str) -> int:
    """Address of a function of the C library."""
    return int(ctypes.cast(getattr(ctypes.CDLL(None), name), ctypes.c_void_p).value or 0)


def mj_step_address() -> int:
    """Address of the `mj_step` that the `mujoco` package itself calls."""
    # A symbol is looked up in a library and in the libraries that it is linked with.
    library = ctypes.CDLL(mujoco._functions.__file__)
    return int(ctypes.cast(library.mj_step, ctypes.c_void_p).value or 0)


def addresses(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[int, int]:
    """Addresses of the C structures of a model and its data; valid as long as both exist."""
    return int(model._address), int(data._address)
