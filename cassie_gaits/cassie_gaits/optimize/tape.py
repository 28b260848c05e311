"""A symbolic function as a list of instructions that are executed at many instants at once.

CasADi's own virtual machine spends most of its time on instruction dispatch. Here each instruction
is dispatched once for `LANES` instants, and the processor's vector units execute it.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import numpy.typing as npt

from cassie_gaits.compiled import compiled
from cassie_gaits.errors import GaitLibraryError
from cassie_gaits.records import FloatArray

LANES = 8
"""Number of instants in parallel: one or two registers of a processor with AVX."""

_OPERATIONS = (
    *("MUL", "ADD", "SUB", "DIV", "TWICE", "OUTPUT", "CONST", "NEG", "INPUT", "SQ", "SIN", "COS"),
    *("SQRT", "ACOS", "ATAN2", "INV", "ASIN", "FABS", "SIGN", "ASSIGN"),
)
"""Operations that `_run` knows, in the order of their codes."""


class Tape:
    """A function of one vector whose output is a vector.

    Args:
        name: Name for messages.
        inputs: Symbols. Shape (n, 1).
        outputs: Expressions. Shape (m, 1), dense.

    Raises:
        GaitLibraryError: if an operation is not known here.
    """

    def __init__(self, name: str, inputs: ca.SX, outputs: ca.SX) -> None:
        function = ca.Function(name, [inputs], [ca.densify(outputs)])
        numbers = {getattr(ca, f"OP_{op}"): i for i, op in enumerate(_OPERATIONS)}
        count = function.n_instructions()
        self._code = np.zeros((count, 4), np.int32)
        self._constants = np.zeros(count)
        for k in range(count):
            operation = function.instruction_id(k)
            if operation not in numbers:
                raise GaitLibraryError(f"{name} has operation {operation}, unknown to the tape")
            kind = _OPERATIONS[numbers[operation]]
            self._code[k, 0] = numbers[operation]
            to, of = function.instruction_output(k), function.instruction_input(k)
            self._code[k, 1] = to[1] if kind == "OUTPUT" else to[0]
            if kind == "CONST":
                self._constants[k] = function.instruction_constant(k)
            elif kind == "INPUT":
                self._code[k, 2] = of[1]
            else:
                self._code[k, 2 : 2 + len(of)] = of
        self._work = np.zeros((function.sz_w(), LANES))
        self.inputs, self.outputs = inputs.size1(), outputs.size1()

    def run(self, inputs: FloatArray) -> FloatArray:
        """Outputs at several instants. Shape (m, instants), from (n, instants)."""
        count = inputs.shape[1]
        padded = np.repeat(inputs[:, -1:], -(-count // LANES) * LANES, axis=1)
        padded[:, :count] = inputs
        result = np.zeros((self.outputs, padded.shape[1]))
        _run(self._code, self._constants, self._work, padded, result)
        return result[:, :count]


@compiled
def _run(
    code: npt.NDArray[np.int32],
    constants: FloatArray,
    work: FloatArray,
    inputs: FloatArray,
    outputs: FloatArray,
) -> None:
    """Execute the instructions, for `LANES` instants at a time."""
    for first in range(0, inputs.shape[1], LANES):
        for k in range(code.shape[0]):
            kind, to, a, b = code[k, 0], code[k, 1], code[k, 2], code[k, 3]
            if kind == 0:
                for i in range(LANES):
                    work[to, i] = work[a, i] * work[b, i]
            elif kind == 1:
                for i in range(LANES):
                    work[to, i] = work[a, i] + work[b, i]
            elif kind == 2:
                for i in range(LANES):
                    work[to, i] = work[a, i] - work[b, i]
            elif kind == 3:
                for i in range(LANES):
                    work[to, i] = np.divide(work[a, i], work[b, i])
            elif kind == 4:
                for i in range(LANES):
                    work[to, i] = 2.0 * work[a, i]
            elif kind == 5:
                for i in range(LANES):
                    outputs[to, first + i] = work[a, i]
            elif kind == 6:
                for i in range(LANES):
                    work[to, i] = constants[k]
            elif kind == 7:
                for i in range(LANES):
                    work[to, i] = -work[a, i]
            elif kind == 8:
                for i in range(LANES):
                    work[to, i] = inputs[a, first + i]
            elif kind == 9:
                for i in range(LANES):
                    work[to, i] = work[a, i] * work[a, i]
            elif kind == 10:
                for i in range(LANES):
                    work[to, i] = math.sin(work[a, i])
            elif kind == 11:
                for i in range(LANES):
                    work[to, i] = math.cos(work[a, i])
            elif kind == 12:
                for i in range(LANES):
                    work[to, i] = np.sqrt(work[a, i])
            elif kind == 13:
                for i in range(LANES):
                    work[to, i] = np.arccos(work[a, i])
            elif kind == 14:
                for i in range(LANES):
                    work[to, i] = math.atan2(work[a, i], work[b, i])
            elif kind == 15:
                for i in range(LANES):
                    work[to, i] = np.divide(1.0, work[a, i])
            elif kind == 16:
                for i in range(LANES):
                    work[to, i] = np.arcsin(work[a, i])
            elif kind == 17:
                for i in range(LANES):
                    work[to, i] = abs(work[a, i])
            elif kind == 18:
                for i in range(LANES):
                    work[to, i] = np.sign(work[a, i])
            else:
                for i in range(LANES):
                    work[to, i] = work[a, i]
