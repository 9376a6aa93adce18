"""A vector register as a number: `Lanes` of float64 or float32 that kernels add and multiply.

In loops over arrays the compiler must assume that arrays overlap, and processes one number at a time. A
kernel that loads, computes and stores whole lanes keeps every sum in a register and reads like the formula.
Without compilation lanes are short NumPy arrays.
"""

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, models, overload, register_model
from numpy.typing import DTypeLike, NDArray

REGISTER = 64
"""Bytes of a 512-bit register; narrower machines take two or four instructions for one.

The same on every processor, so that every sum is taken in the same order and has the same bits.
"""

DOUBLES = REGISTER // 8
"""Numbers of float64 in a register."""


def lanes(precision: DTypeLike) -> int:
    """How many numbers of a precision fit into one register."""
    return REGISTER // np.dtype(precision).itemsize


def load(array: NDArray[Any], i: int) -> Any:
    """The lanes array[i], array[i + 1] and so on."""
    return array[i : i + lanes(array.dtype)].copy()


def load_double(array: NDArray[Any], i: int) -> Any:
    """`DOUBLES` numbers from array[i] onwards, of any precision, as lanes of float64."""
    return array[i : i + DOUBLES].astype(np.float64)


def doubles(number: float) -> Any:
    """Lanes of float64 that all hold the same number."""
    return np.full(DOUBLES, number)


def store(array: NDArray[Any], i: int, value: Any) -> None:
    """array[i + t] = value[t] for each lane t."""
    array[i : i + lanes(array.dtype)] = value


def sqrt(value: Any) -> Any:
    """Square root of each lane."""
    return np.sqrt(value)


def muladd(a: Any, b: Any, c: Any) -> Any:
    """Returns a b + c of numbers, or of lanes, fused if the processor can."""
    return a * b + c


def dot(a: Any, x: Any, b: Any, y: Any, c: Any, z: Any) -> Any:
    """Lanes of a x + b y + c z."""
    return muladd(a, x, muladd(b, y, c * z))


def total(value: Any) -> float:
    """Sum of all lanes, float64."""
    return float(np.sum(value, dtype=np.float64))


def magnitude(value: Any) -> Any:
    """Absolute value of each lane."""
    return np.abs(value)


def larger(a: Any, b: Any) -> Any:
    """The larger of two numbers in each lane; if one is NaN, the other."""
    return np.fmax(a, b)


def largest(value: Any) -> float:
    """Largest of all lanes, ignoring NaN, float64."""
    return float(np.nanmax(value))


def where(bits: int, number: float, like: Any) -> Any:
    """A number in the lanes where the mask `bits` has a one, zero elsewhere."""
    held = (int(bits) >> np.arange(len(like))) & 1
    return (held * number).astype(like.dtype)


def positive(value: Any) -> Any:
    """Each lane, or zero if negative; NaN stays NaN."""
    return np.maximum(value, 0)


class _LanesType(types.Type):
    """Numba's type of one register of scalars."""

    def __init__(self, scalar) -> None:
        self.scalar = scalar
        self.count = REGISTER * 8 // scalar.bitwidth
        super().__init__(name=f"Lanes({scalar})")


@register_model(_LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, kind) -> None:
        vector = ir.VectorType(manager[kind.scalar].get_value_type(), kind.count)
        super().__init__(manager, kind, vector)


def _spread(context, builder, value, kind, lanes_kind):
    """A number broadcast to all lanes; lanes unchanged."""
    if isinstance(kind, _LanesType):
        return value
    vector = context.get_value_type(lanes_kind)
    number = context.cast(builder, value, kind, lanes_kind.scalar)
    index = ir.IntType(32)
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), number, index(0))
    everywhere = ir.Constant(ir.VectorType(index, lanes_kind.count), [0] * lanes_kind.count)
    return builder.shuffle_vector(one, one, everywhere)


def _pointer(context, builder, kind, array, index, count):
    data = context.make_array(kind)(context, builder, array).data
    vector = ir.VectorType(context.get_value_type(kind.dtype), count)
    return builder.bitcast(builder.gep(data, [index]), vector.as_pointer())


def _called(builder, name, kind, result, arguments):
    """One of LLVM's vector functions."""
    function = ir.FunctionType(result, [argument.type for argument in arguments])
    name = f"llvm.{name}.v{kind.count}f{kind.scalar.bitwidth}"
    return builder.call(cgutils.get_or_insert_function(builder.module, function, name), arguments)


@intrinsic
def _load(typing, array, i):
    kind = _LanesType(array.dtype)

    def generate(context, builder, signature, arguments):
        place = _pointer(context, builder, array, *arguments, kind.count)
        return builder.load(place, align=array.dtype.bitwidth // 8)

    return kind(array, i), generate


@intrinsic
def _load_double(typing, array, i):
    kind = _LanesType(types.float64)

    def generate(context, builder, signature, arguments):
        place = _pointer(context, builder, array, *arguments, kind.count)
        value = builder.load(place, align=array.dtype.bitwidth // 8)
        return value if array.dtype == types.float64 else builder.fpext(value, context.get_value_type(kind))

    return kind(array, i), generate


@intrinsic
def _doubles(typing, number):
    kind = _LanesType(types.float64)

    def generate(context, builder, signature, arguments):
        return _spread(context, builder, arguments[0], number, kind)

    return kind(number), generate


@intrinsic
def _store(typing, array, i, value):
    def generate(context, builder, signature, arguments):
        place = _pointer(context, builder, array, *arguments[:2], value.count)
        builder.store(arguments[2], place, align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.none(array, i, value), generate


@intrinsic
def _sqrt(typing, value):
    def generate(context, builder, signature, arguments):
        return _called(builder, "sqrt", value, arguments[0].type, arguments)

    return value(value), generate


@intrinsic
def _muladd(typing, a, b, c):
    kind = next(kind for kind in (a, b, c) if isinstance(kind, _LanesType))

    def generate(context, builder, signature, arguments):
        operands = zip(arguments, signature.args, strict=True)
        vectors = [_spread(context, builder, value, type_, kind) for value, type_ in operands]
        return _called(builder, "fmuladd", kind, vectors[0].type, vectors)

    return kind(a, b, c), generate


@intrinsic
def _magnitude(typing, value):
    def generate(context, builder, signature, arguments):
        return _called(builder, "fabs", value, arguments[0].type, arguments)

    return value(value), generate


@intrinsic
def _larger(typing, a, b):
    def generate(context, builder, signature, arguments):
        return _called(builder, "maxnum", a, arguments[0].type, arguments)

    return a(a, b), generate


@intrinsic
def _largest(typing, value):
    def generate(context, builder, signature, arguments):
        number = context.get_value_type(value.scalar)
        found = _called(builder, "vector.reduce.fmax", value, number, arguments)
        return context.cast(builder, found, value.scalar, types.float64)

    return types.float64(value), generate


@intrinsic
def _total(typing, value):
    def generate(context, builder, signature, arguments):
        number = context.get_value_type(value.scalar)
        summands = [ir.Constant(number, 0.0), *arguments]
        found = _called(builder, "vector.reduce.fadd", value, number, summands)
        return context.cast(builder, found, value.scalar, types.float64)

    return types.float64(value), generate


@intrinsic
def _where(typing, bits, number, like):
    def generate(context, builder, signature, arguments):
        mask_bits = ir.IntType(like.count)
        mask = arguments[0]
        if mask.type.width != like.count:
            mask = (builder.trunc if mask.type.width > like.count else builder.zext)(mask, mask_bits)
        mask = builder.bitcast(mask, ir.VectorType(ir.IntType(1), like.count))
        numbers = _spread(context, builder, arguments[1], number, like)
        return builder.select(mask, numbers, ir.Constant(numbers.type, [0.0] * like.count))

    return like(bits, number, like), generate


@intrinsic
def _positive(typing, value):
    def generate(context, builder, signature, arguments):
        zero = ir.Constant(arguments[0].type, [0.0] * value.count)
        return builder.select(builder.fcmp_ordered("<=", arguments[0], zero), zero, arguments[0])

    return value(value), generate


@overload(load)
def _compiled_load(array, i):
    return lambda array, i: _load(array, np.intp(i))


@overload(load_double)
def _compiled_load_double(array, i):
    return lambda array, i: _load_double(array, np.intp(i))


@overload(doubles)
def _compiled_doubles(number):
    return lambda number: _doubles(number)


@overload(store)
def _compiled_store(array, i, value):
    return lambda array, i, value: _store(array, np.intp(i), value)


@overload(sqrt)
def _compiled_sqrt(value):
    return lambda value: _sqrt(value)


@overload(muladd)
def _compiled_muladd(a, b, c):
    if any(isinstance(kind, _LanesType) for kind in (a, b, c)):
        return lambda a, b, c: _muladd(a, b, c)
    return lambda a, b, c: a * b + c


@overload(dot)
def _compiled_dot(a, x, b, y, c, z):
    return lambda a, x, b, y, c, z: _muladd(a, x, _muladd(b, y, c * z))


@overload(total)
def _compiled_total(value):
    return lambda value: _total(value)


@overload(positive)
def _compiled_positive(value):
    return lambda value: _positive(value)


@overload(magnitude)
def _compiled_magnitude(value):
    return lambda value: _magnitude(value)


@overload(larger)
def _compiled_larger(a, b):
    return lambda a, b: _larger(a, b)


@overload(largest)
def _compiled_largest(value):
    return lambda value: _largest(value)


@overload(where)
def _compiled_where(bits, number, like):
    return lambda bits, number, like: _where(bits, number, like)


def _give_arithmetic(operation: Callable[..., Any], instruction: str) -> None:
    """Let an operator combine lanes with lanes, and with numbers, which are broadcast."""

    @intrinsic
    def compute(typing, a, b):
        kind = a if isinstance(a, _LanesType) else b

        def generate(context, builder, signature, arguments):
            operands = zip(arguments, signature.args, strict=True)
            vectors = [_spread(context, builder, value, type_, kind) for value, type_ in operands]
            return getattr(builder, instruction)(*vectors)

        return kind(a, b), generate

    @overload(operation)
    def _compiled(a, b):
        if isinstance(a, _LanesType) or isinstance(b, _LanesType):
            return lambda a, b: compute(a, b)
        return None


_give_arithmetic(operator.add, "fadd")
_give_arithmetic(operator.sub, "fsub")
_give_arithmetic(operator.mul, "fmul")
_give_arithmetic(operator.truediv, "fdiv")
