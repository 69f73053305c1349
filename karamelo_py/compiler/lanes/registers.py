"""Numbers that lie side by side in a vector register: their type, and how they get there."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types

from karamelo_py.compiler import code

I32, I64 = ir.IntType(32), ir.IntType(64)


class Lanes(types.Type):
    """`width` numbers of a scalar type in a register."""

    def __init__(self, scalar: types.Type, width: int):
        self.scalar, self.width = scalar, width
        super().__init__(name=f"Lanes({scalar}, {width})")

    def register_type(self) -> ir.VectorType:
        """LLVM's type of them."""
        return vector_of(self)


def element(scalar: types.Type) -> ir.Type:
    """How a number lies in a register."""
    if isinstance(scalar, types.Boolean):
        return ir.IntType(1)
    if isinstance(scalar, types.Integer):
        return ir.IntType(scalar.bitwidth)
    return {64: ir.DoubleType(), 32: ir.FloatType()}[scalar.bitwidth]


def vector_of(lanes: Lanes) -> ir.VectorType:
    return ir.VectorType(element(lanes.scalar), lanes.width)


def constant(values: list[int], bits: ir.Type = I32) -> ir.Constant:
    return ir.Constant(ir.VectorType(bits, len(values)), values)


def splat(builder: Any, value: Any, lanes: Lanes) -> Any:
    """The same number in all lanes."""
    vector = vector_of(lanes)
    if isinstance(lanes.scalar, types.Boolean) and value.type != ir.IntType(1):
        value = builder.trunc(value, ir.IntType(1))
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(I32, 0))
    return builder.shuffle_vector(
        one, ir.Constant(vector, ir.Undefined), constant([0] * lanes.width)
    )


def lane(builder: Any, value: Any, k: int) -> Any:
    return builder.extract_element(value, ir.Constant(I32, k))


def pack(builder: Any, values: list, lanes: Lanes) -> Any:
    out = ir.Constant(vector_of(lanes), ir.Undefined)
    for k, value in enumerate(values):
        out = builder.insert_element(out, value, ir.Constant(I32, k))
    return out


def shape(lanes: Lanes) -> str:
    """What LLVM's intrinsics call a vector: v4f64."""
    kind = "f" if isinstance(lanes.scalar, types.Float) else "i"
    return f"v{lanes.width}{kind}{lanes.scalar.bitwidth}"


def shuffle(builder: Any, a: Any, b: Any, order: list[int]) -> Any:
    return builder.shuffle_vector(a, b, constant(order))


def call_vector(name: str, lanes: Lanes) -> Callable:
    """Code that calls an LLVM intrinsic of vectors, such as sqrt."""

    def codegen(builder, sig, arguments):
        vector = vector_of(lanes)
        values = [
            value if isinstance(kind, Lanes) else splat(builder, value, lanes)
            for kind, value in zip(sig.args, arguments, strict=True)
        ]
        function = code.external(
            builder, f"llvm.{name}.{shape(lanes)}", vector, [vector] * len(values)
        )
        return builder.call(function, values)

    return codegen
