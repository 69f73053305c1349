"""A builder that writes frequent instructions as text at once.

An object of llvmlite for each instruction, printed later, takes three times as long.
"""

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir

_ORDER = {">": "gt", "<": "lt", "==": "eq", "!=": "ne", ">=": "ge", "<=": "le"}


class Instruction:
    """An instruction as text; as an operand, its type and reference."""

    __slots__ = ("reference", "text", "type")

    def __init__(self, kind: ir.Type, reference: str, text: str):
        self.type, self.reference, self.text = kind, reference, text

    def get_reference(self) -> str:
        return self.reference

    def __str__(self) -> str:
        return self.text

    @property
    def function_type(self) -> ir.FunctionType:
        return self.type.pointee


def _typed(value: Any) -> str:
    return f"{value.type} {value.get_reference()}"


def _all_typed(values: Sequence) -> str:
    return ", ".join([f"{value.type} {value.get_reference()}" for value in values])


def _check(kind: ir.Type, other: ir.Type) -> None:
    if kind is not other and kind != other:
        raise TypeError(f"{kind} and {other} are different types")


class Builder(ir.IRBuilder):
    def _write(self, kind: ir.Type, text: str, gives: bool = True) -> Instruction:
        counts = self._block.scope._basenamemap  # llvmlite numbers its own instructions by it, too
        counts[""] = number = counts[""] + 1
        reference = f'%".{number}"'
        made = Instruction(kind, reference, f"{reference} = {text}" if gives else text)
        self._block.instructions.insert(self._anchor, made)
        self._anchor += 1
        return made

    def _compare(self, name: str, a: Any, b: Any) -> Instruction:
        kind = a.type
        _check(kind, b.type)
        truth = ir.IntType(1)
        if isinstance(kind, ir.VectorType):
            truth = ir.VectorType(truth, kind.count)
        return self._write(truth, f"{name} {kind} {a.get_reference()}, {b.get_reference()}")

    def icmp_signed(self, sign: str, a: Any, b: Any) -> Instruction:
        return self._compare(f"icmp {'' if sign in ('==', '!=') else 's'}{_ORDER[sign]}", a, b)

    def icmp_unsigned(self, sign: str, a: Any, b: Any) -> Instruction:
        return self._compare(f"icmp {'' if sign in ('==', '!=') else 'u'}{_ORDER[sign]}", a, b)

    def fcmp_ordered(self, sign: str, a: Any, b: Any) -> Instruction:
        return self._compare(f"fcmp o{_ORDER[sign]}" if sign in _ORDER else f"fcmp {sign}", a, b)

    def fcmp_unordered(self, sign: str, a: Any, b: Any) -> Instruction:
        return self._compare(f"fcmp u{_ORDER[sign]}" if sign in _ORDER else f"fcmp {sign}", a, b)

    def select(self, condition: Any, a: Any, b: Any) -> Instruction:
        _check(a.type, b.type)
        return self._write(a.type, f"select  {_all_typed((condition, a, b))}")

    def load(self, pointer: Any, align: int | None = None) -> Instruction:
        kind = pointer.type.pointee
        end = "" if align is None else f", align {align}"
        return self._write(kind, f"load {kind}, {_typed(pointer)}{end}")

    def store(self, value: Any, pointer: Any, align: int | None = None) -> Instruction:
        _check(pointer.type.pointee, value.type)
        end = "" if align is None else f", align {align}"
        text = f"store {_all_typed((value, pointer))}{end}"
        return self._write(ir.VoidType(), text, False)

    def gep(self, pointer: Any, indices: Sequence, inbounds: bool = False) -> Instruction:
        kind = pointer.type
        source = kind.pointee
        if len(indices) > 1:
            kind = source
            for i in indices[1:]:
                kind = kind.gep(i)
            kind = kind.as_pointer()
        operands = _all_typed((pointer, *indices))
        name = "getelementptr inbounds" if inbounds else "getelementptr"
        return self._write(kind, f"{name} {source}, {operands}")

    def extract_value(self, aggregate: Any, place: int | Sequence[int]) -> Instruction:
        places = (place,) if isinstance(place, int) else place
        kind = aggregate.type
        for k in places:
            kind = kind.elements[k]
        return self._write(kind, f"extractvalue {_typed(aggregate)}, {', '.join(map(str, places))}")

    def insert_value(self, aggregate: Any, value: Any, place: int) -> Instruction:
        _check(aggregate.type.elements[place], value.type)
        return self._write(
            aggregate.type, f"insertvalue {_all_typed((aggregate, value))}, {place}"
        )

    def extract_element(self, vector: Any, place: Any) -> Instruction:
        return self._write(vector.type.element, f"extractelement {_all_typed((vector, place))}")

    def insert_element(self, vector: Any, value: Any, place: Any) -> Instruction:
        _check(vector.type.element, value.type)
        return self._write(vector.type, f"insertelement {_all_typed((vector, value, place))}")

    def shuffle_vector(self, a: Any, b: Any, order: Any) -> Instruction:
        _check(a.type, b.type)
        kind = ir.VectorType(a.type.element, order.type.count)
        return self._write(kind, f"shufflevector {_all_typed((a, b, order))}")

    def call(self, function: Any, values: Sequence, name: str = "") -> Instruction:
        kind = function.function_type
        for wanted, value in zip(kind.args, values, strict=True):
            _check(wanted, value.type)
        gives = kind.return_type
        text = f"call {gives} {function.get_reference()}({_all_typed(values)})"
        return self._write(gives, text, not isinstance(gives, ir.VoidType))


def _binary(operation: str) -> Callable:
    def write(
        self: Builder, a: Any, b: Any, name: str = "", flags: Sequence[str] = ()
    ) -> Instruction:
        kind = a.type
        _check(kind, b.type)
        word = " ".join([operation, *flags])
        return self._write(kind, f"{word} {kind} {a.get_reference()}, {b.get_reference()}")

    return write


def _cast(name: str) -> Callable:
    def write(self: Builder, value: Any, kind: ir.Type) -> Any:
        if value.type == kind:
            return value
        return self._write(kind, f"{name} {_typed(value)} to {kind}")

    return write


for _name in (
    "add", "sub", "mul", "sdiv", "udiv", "srem", "urem", "shl", "ashr", "lshr", "and", "or", "xor",
    "fadd", "fsub", "fmul", "fdiv", "frem",
):  # fmt: skip
    setattr(Builder, _name if hasattr(ir.IRBuilder, _name) else f"{_name}_", _binary(_name))
for _name in (
    "trunc", "zext", "sext", "fptrunc", "fpext", "bitcast", "fptoui", "uitofp", "fptosi", "sitofp",
    "ptrtoint", "inttoptr",
):  # fmt: skip
    setattr(Builder, _name, _cast(_name))
