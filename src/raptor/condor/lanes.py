"""Moves of LANES consecutive numbers at once.

Written as loops, the compiler must assume that the arrays overlap and moves one number at a time,
which halves the speed of the whole simulator; so each move is stated as one vector instruction.
Without compilation the plain Python body runs.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

LANES = 8
"""Numbers of a move: one 512-bit register of float64; narrower machines split it."""


def copy_lanes(target: NDArray[Any], i: int, source: NDArray[Any], j: int) -> None:
    """target[i + t] = source[j + t] for each lane t."""
    target[i : i + LANES] = source[j : j + LANES]


def add_lanes(target: NDArray[Any], i: int, source: NDArray[Any], j: int) -> None:
    """target[i + t] += source[j + t] for each lane t."""
    target[i : i + LANES] += source[j : j + LANES]


def subtract_lanes(target: NDArray[Any], i: int, source: NDArray[Any], j: int) -> None:
    """target[i + t] -= source[j + t] for each lane t."""
    target[i : i + LANES] -= source[j : j + LANES]


def _as_instruction(move: Callable[..., None], operation: str | None) -> None:
    """Give a move its compiled form: load, at most one arithmetic operation, store."""

    @intrinsic
    def instruction(context, target, i, source, j):
        def generate(context, builder, signature, arguments):
            def pointer(array, kind, index):
                data = context.make_array(kind)(context, builder, array).data
                element = context.get_data_type(kind.dtype)
                place = builder.gep(data, [index])
                size = np.dtype(str(kind.dtype)).itemsize
                return builder.bitcast(place, ir.VectorType(element, LANES).as_pointer()), size

            to_, size = pointer(arguments[0], signature.args[0], arguments[1])
            from_, _ = pointer(arguments[2], signature.args[2], arguments[3])
            value = builder.load(from_, align=size)
            if operation is not None:
                value = getattr(builder, operation)(builder.load(to_, align=size), value)
            builder.store(value, to_, align=size)
            return context.get_dummy_value()

        return types.none(target, i, source, j), generate

    @overload(move)
    def _compiled(target, i, source, j):
        def move_lanes(target, i, source, j):
            instruction(target, np.intp(i), source, np.intp(j))  # type: ignore[call-arg]  # Numba passes the context

        return move_lanes


_as_instruction(copy_lanes, None)
_as_instruction(add_lanes, "fadd")
_as_instruction(subtract_lanes, "fsub")
