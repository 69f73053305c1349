"""A builder that writes frequent instructions as text at once.

Objects of llvmlite, one per instruction and printed later, take three times as long.
"""

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir


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


def _typed(*values: Any) -> str:
    return ", ".join([f"{value.type} {value.get_reference()}" for value in values])


_NOTHING = ir.VoidType()


class Builder(ir.IRBuilder):
    def _write(self, kind: ir.Type, text: str) -> Instruction:
        counts = self._block.scope._basenamemap  # llvmlite numbers its own instructions by it, too
        counts[""] = number = counts[""] + 1
        reference = f'%".{number}"'
        text = text if kind is _NOTHING else f"{reference} = {text}"
        made = Instruction(kind, reference, text)
        self._block.instructions.insert(self._anchor, made)
        self._anchor += 1
        return made

    def load(self, pointer: Any, align: int = 0) -> Instruction:
        kind = pointer.type.pointee
        return self._write(kind, f"load {kind}, {_typed(pointer)}{_aligned(align)}")

    def store(self, value: Any, pointer: Any, align: int = 0) -> Instruction:
        return self._write(_NOTHING, f"store {_typed(value, pointer)}{_aligned(align)}")

    def gep(self, pointer: Any, indices: Sequence, inbounds: bool = False) -> Instruction:
        kind, source = pointer.type, pointer.type.pointee
        if len(indices) > 1:
            kind = source
            for i in indices[1:]:
                kind = kind.gep(i)
            kind = kind.as_pointer()
        name = "getelementptr inbounds" if inbounds else "getelementptr"
        return self._write(kind, f"{name} {source}, {_typed(pointer, *indices)}")

    def extract_value(self, aggregate: Any, place: int | tuple[int, ...]) -> Instruction:
        """Write an instruction, or find the same one earlier in the block."""
        made = vars(self._block).setdefault("extracted", {})
        reference = aggregate.get_reference()
        key = reference, place, reference[0] != "%" and aggregate.type
        if key not in made:
            places = (place,) if isinstance(place, int) else place
            kind = aggregate.type
            for k in places:
                kind = kind.elements[k]
            numbers = ", ".join(map(str, places))
            made[key] = self._write(kind, f"extractvalue {aggregate.type} {reference}, {numbers}")
        return made[key]

    def insert_value(self, aggregate: Any, value: Any, place: int) -> Instruction:
        return self._write(aggregate.type, f"insertvalue {_typed(aggregate, value)}, {place}")

    def call(self, function: Any, values: Sequence, name: str = "") -> Instruction:
        kind = function.function_type.return_type
        kind = _NOTHING if kind == _NOTHING else kind
        return self._write(kind, f"call {kind} {function.get_reference()}({_typed(*values)})")


def _aligned(align: int) -> str:
    return f", align {align}" if align else ""


def _binary(operation: str) -> Callable:
    def write(
        self: Builder, a: Any, b: Any, name: str = "", flags: Sequence[str] = ()
    ) -> Instruction:
        word = " ".join([operation, *flags])
        return self._write(a.type, f"{word} {a.type} {a.get_reference()}, {b.get_reference()}")

    return write


def _comparison(name: str, sign_word: str) -> Callable:
    def write(self: Builder, sign: str, a: Any, b: Any) -> Instruction:
        truth = ir.IntType(1)
        if isinstance(a.type, ir.VectorType):
            truth = ir.VectorType(truth, a.type.count)
        order = _ORDER.get(sign, sign)  # "ord" and "uno" are not renamed
        if order is not sign and not (name == "icmp" and order in ("eq", "ne")):
            order = sign_word + order
        operands = f"{a.get_reference()}, {b.get_reference()}"
        return self._write(truth, f"{name} {order} {a.type} {operands}")

    return write


def _cast(name: str) -> Callable:
    def write(self: Builder, value: Any, kind: ir.Type) -> Any:
        same = value.type == kind
        return value if same else self._write(kind, f"{name} {_typed(value)} to {kind}")

    return write


def _of_operands(name: str, kind_of: Callable) -> Callable:
    def write(self: Builder, *values: Any) -> Instruction:
        return self._write(kind_of(*values), f"{name} {_typed(*values)}")

    return write


_ORDER = {">": "gt", "<": "lt", "==": "eq", "!=": "ne", ">=": "ge", "<=": "le"}
_BINARY = "add sub mul sdiv udiv srem urem shl ashr lshr xor fadd fsub fmul fdiv frem"
_CASTS = "trunc zext sext fptrunc fpext bitcast fptoui uitofp fptosi sitofp ptrtoint inttoptr"
_WRITTEN = {
    **{name: _binary(name) for name in _BINARY.split()},
    **{name: _cast(name) for name in _CASTS.split()},
    "and_": _binary("and"),
    "or_": _binary("or"),
    "icmp_signed": _comparison("icmp", "s"),
    "icmp_unsigned": _comparison("icmp", "u"),
    "fcmp_ordered": _comparison("fcmp", "o"),
    "fcmp_unordered": _comparison("fcmp", "u"),
    "select": _of_operands("select ", lambda condition, a, b: a.type),
    "extract_element": _of_operands("extractelement", lambda vector, k: vector.type.element),
    "insert_element": _of_operands("insertelement", lambda vector, value, k: vector.type),
    "shuffle_vector": _of_operands(
        "shufflevector", lambda a, b, order: ir.VectorType(a.type.element, order.type.count)
    ),
}
for _name, _method in _WRITTEN.items():
    setattr(Builder, _name, _method)
