"""Tracing compiler: from Python functions of points, numbers and arrays to kernels by LLVM.

The folders `trace`, `code` and `disk` are private.
"""

from karamelo_py.compiler.code.arguments import forget_array
from karamelo_py.compiler.trace.algebra import algebra, on_numbers
from karamelo_py.compiler.trace.choices import INTERPRETED, classes_in, tag_class
from karamelo_py.compiler.trace.functions import CannotCompile, Undefined, places_of
from karamelo_py.compiler.trace.held import at_hand, hold
from karamelo_py.compiler.trace.kernels import (
    address_of,
    address_of_python,
    caller_of,
    compilation,
    kernel,
    noinline,
)
from karamelo_py.compiler.trace.primitives import (
    all_lanes,
    any_lane,
    fma,
    implements,
    index,
    point_function,
    real,
    round_off,
    shared,
    where,
)
from karamelo_py.compiler.trace.session import importable
from karamelo_py.compiler.trace.values import intrinsic

__all__ = [
    "INTERPRETED", "CannotCompile", "Undefined", "address_of", "address_of_python", "algebra",
    "all_lanes", "any_lane", "at_hand", "caller_of", "classes_in", "compilation", "fma",
    "forget_array", "hold", "implements", "importable", "index", "intrinsic", "kernel", "noinline",
    "on_numbers", "places_of", "point_function", "real", "round_off", "shared", "tag_class",
    "where",
]  # fmt: skip
