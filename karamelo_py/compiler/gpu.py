"""GPU code: functions of one thread, device memory, and launches.

``f(i, ...)`` defines the work of thread `i`. The function is traced like a kernel and compiled to
PTX.
"""

import ctypes
import hashlib
import os
import weakref
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types

from karamelo_py.compiler import llvm
from karamelo_py.compiler.code import machine
from karamelo_py.compiler.code.arguments import ArgumentBuffer, plan_for
from karamelo_py.compiler.code.builder import Builder
from karamelo_py.compiler.disk import cache
from karamelo_py.compiler.llvm import I32, I64
from karamelo_py.compiler.trace.choices import INTERPRETED, modules_noted, modules_of, note
from karamelo_py.compiler.trace.held import text_with_types
from karamelo_py.compiler.trace.kernels import ENTRY, NAME, compilation, items_at, written
from karamelo_py.compiler.trace.primitives import implements
from karamelo_py.compiler.trace.session import session
from karamelo_py.compiler.trace.values import in_one, intrinsic

THREADS = 128  # threads per block
USUAL = Path("/usr/local/cuda/nvvm/libdevice/libdevice.10.bc")  # default path of NVIDIA's library
TRIPLE = "nvptx64-nvidia-cuda"


class NoCard(Exception):
    """No GPU can be used; text and hint of the error are for the user."""

    def __init__(self, reason: str, hint: str):
        super().__init__(reason)
        self.hint = hint


def counted(array: np.ndarray, i: int, step: int) -> int:
    """Add to an integer of an array atomically; return the old value."""
    array[i] += step
    return array[i] - step


@implements(counted)
@intrinsic
def _counted(array, i, step):
    def codegen(builder, table, i, step):
        at = llvm.item_pointer(builder, array, table, (i,))
        return builder.atomic_rmw("add", at, step, "monotonic")

    return array.dtype(array, types.int64, array.dtype), codegen


@intrinsic
def _largest(array, i, value):
    def codegen(builder, table, i, number):
        at = llvm.item_pointer(builder, array, table, (i,))
        # Non-negative floats have the same order as their bits, read as integers.
        bits = builder.bitcast(number, I64)
        builder.atomic_rmw("umax", builder.bitcast(at, I64.as_pointer()), bits, "monotonic")

    return types.none(array, types.int64, types.float64), codegen


def raise_to(array: np.ndarray, i: int, value: float) -> None:
    """Set a non-negative double to `value` if this is larger, atomically."""
    array[i] = max(array[i], value)


@implements(raise_to)
def _raise_to(array, i, value):
    if value > array[i]:
        _largest(array, i, value)


@intrinsic
def aligned_record(array, i, count):
    """Read `count` numbers of record `i`, aligned to 16 bytes, or to its size if less."""
    if not isinstance(count, types.IntegerLiteral):
        return None
    result = types.UniTuple(array.dtype, count.literal_value)
    size = array.dtype.bitwidth // 8
    together = max(1, min(16 // size, count.literal_value))

    def codegen(builder, table, i, _):
        kind = ir.VectorType(llvm.register_type(array.dtype), together)
        pointer = llvm.item_pointer(builder, array, table, (i, I64(0)))
        pointer = builder.bitcast(pointer, kind.as_pointer())
        numbers = []
        for k in range(count.literal_value // together):
            vector = builder.load(builder.gep(pointer, [I64(k)]), align=size * together)
            numbers += [builder.extract_element(vector, I32(lane)) for lane in range(together)]
        return llvm.make_tuple(builder, result, numbers)

    return result(array, types.int64, count), codegen


def _entry(module: ir.Module) -> tuple[ir.Function, ir.IRBuilder]:
    entry = ir.Function(module, ir.FunctionType(ir.VoidType(), [I64] * 2), NAME + ENTRY)
    return entry, Builder(entry.append_basic_block("entry"))


def _as_loop(module: ir.Module, main: ir.Function, kinds: tuple, result: Any) -> None:
    entry, builder = _entry(module)
    items = items_at(builder, kinds[1:], entry.args[0])
    with llvm.counted(builder, entry.args[1]) as i:
        builder.call(main, [i, *items])
    builder.ret_void()


def _as_threads(module: ir.Module, main: ir.Function, kinds: tuple, result: Any) -> None:
    entry, builder = _entry(module)
    entry.calling_convention = "ptx_kernel"

    def special(name: str) -> Any:
        register = llvm.external(builder, f"llvm.nvvm.read.ptx.sreg.{name}", I32, [])
        return builder.zext(builder.call(register, []), I64)

    i = builder.add(builder.mul(special("ctaid.x"), special("ntid.x")), special("tid.x"))
    with builder.if_then(builder.icmp_signed("<", i, entry.args[1])):
        builder.call(main, [i, *items_at(builder, kinds[1:], entry.args[0])])
    builder.ret_void()
    main.linkage = "internal"
    main.attributes.discard("noinline")
    main.attributes.add("alwaysinline")


# Functions of the C library that NVIDIA's library also has.
_MATHEMATICS = {
    "exp", "exp2", "log", "log2", "log10", "log1p", "expm1", "pow", "sin", "cos", "tan", "asin",
    "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "erf", "erfc",
    "lgamma", "cbrt", "hypot", "fmod", "ldexp", "frexp",
}  # fmt: skip


def _of_nvidia(name: str) -> str | None:
    if name == "karamelo_gamma":
        return "__nv_tgamma"
    plain = name.removeprefix("llvm.").removesuffix(".f64")
    single = plain.removesuffix(".f32") if name.startswith("llvm.") else plain.removesuffix("f")
    if plain in _MATHEMATICS:
        return f"__nv_{plain}"
    return f"__nv_{single}f" if single in _MATHEMATICS else None


def library() -> bytes:
    from cuda import pathfinder

    try:
        return Path(pathfinder.find_bitcode_lib("device")).read_bytes()
    except pathfinder.BitcodeLibNotFoundError:
        if USUAL.exists():
            return USUAL.read_bytes()
        raise NoCard(
            "NVIDIA's library of mathematics (libdevice) was not found",
            "pip install 'karamelo-py[gpu]'",
        ) from None


def text_of(
    function: Callable, kinds: tuple, on_card: bool, called: dict | None = None
) -> tuple[str, str]:
    """Return name and module text of a thread function; for `called`, see `values.in_one`."""
    with in_one(called or {}):
        entry = _as_threads if on_card else _as_loop
        module, _ = written(function, (types.int64, *kinds), types.none, entry)
    if module.needs or module.raises:
        raise TypeError(f"{function.__qualname__} calls a function that threads cannot call")
    text = text_with_types(module)
    if on_card:
        outside = [f.name for f in module.functions if not f.blocks]
        for other, replacement in [(f, _of_nvidia(f)) for f in outside]:
            text = text.replace(f'@"{other}"', f'@"{replacement}"') if replacement else text
    name = f"{function.__name__}_{hashlib.sha256(text.encode()).hexdigest()[:32]}"
    return name, text.replace(NAME + ENTRY, f"{name}_entry").replace(NAME, name)


def numbers_of(function: Callable, arguments: tuple, i: int) -> int:
    if INTERPRETED:
        return len(function(*arguments, i))
    kinds = plan_for(arguments).types
    with in_one({}):
        return len(written(function, (*kinds, types.int64), entry=lambda *_: None)[1])


def assembled(text: str, processor: str) -> str:
    return machine.assembly(text, TRIPLE, processor, library() if '@"__nv_' in text else None)


def bandwidth(card: Any, size: int = 1 << 30) -> float:
    """Measure the copy bandwidth: bytes read plus written per second."""
    source, target = card.allocate(size), card.allocate(size)
    fastest = min(card.seconds_of([lambda: card.copy(target, source, size)] * 5))
    card.free(source)
    card.free(target)
    return 2 * size / fastest


class Code(NamedTuple):
    name: str
    code: bytes  # empty if the code is to be read from the file
    file: str
    needs: tuple
    modules: frozenset[str]


class _Coded:
    on_card: bool
    processor: str
    made: Callable[[str], bytes]  # compiles module text
    loaded: Callable[[Code], Any]

    def __init__(self) -> None:
        self._entries: dict[str, Any] = {}
        self._known: dict[tuple, Any] = {}

    def compiled(self, function: Callable, kinds: tuple, called: dict | None = None) -> Any:
        called = called or {}
        key = function, kinds, session.changes, *called.values()
        if key not in self._known:
            code = self._found(function, kinds, called)
            self._load(code)
            if "<locals>" in function.__qualname__:  # local functions are created for each scene
                return self._entries[code.name]
            self._known[key] = self._entries[code.name]
        return self._known[key]

    def _found(self, function: Callable, kinds: tuple, called: dict) -> Code:
        files = cache.KernelFiles(function, self._load, self.processor, *called.values())
        return files.kernel(kinds, None, lambda: self._compiled(function, kinds, called))

    def _load(self, code: Code) -> None:
        if code.name not in self._entries:
            content = code.code or cache.code_of(code.file)
            self._entries[code.name] = self.loaded(code._replace(code=content))

    def _compiled(self, function: Callable, kinds: tuple, called: dict) -> Code:
        with compilation(function.__name__), modules_noted() as modules:
            note(modules_of(function, *called.values()))
            name, text = text_of(function, kinds, self.on_card, called)
            file = f"{name}.{cache.short_hash(text, self.processor, machine.describe())}"
            code = cache.machine_code(file, lambda: self.made(text))
        return Code(f"{name}_entry", code, file, (), frozenset(modules))


class Emulator(_Coded):
    name, processor, on_card = "emulated", "processor", False
    made = staticmethod(machine.compile_text)
    copies = 1  # copies of the totals, to which threads add

    def __init__(self) -> None:
        super().__init__()
        self._rooms: dict[int, Any] = {}

    def allocate(self, size: int) -> int:
        room = ctypes.create_string_buffer(size + 64)
        at = -(-ctypes.addressof(room) // 64) * 64
        self._rooms[at] = room
        return at

    def memory(self) -> tuple[int, int]:
        return 1 << 60, 1 << 60

    def free(self, address: int) -> None:
        del self._rooms[address]

    def copy_to(self, target: int, source: int, size: int) -> None:
        ctypes.memmove(target, source, size)

    copy = copy_from = copy_to

    def loaded(self, code: Code) -> Callable:
        (address,) = machine.load(code.code, code.name)
        return ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64)(address)

    def launch(self, entry: Callable, arguments: int, count: int) -> None:
        """Run `count` threads of an entry; if interpreted, it is a Python function."""
        if not INTERPRETED:
            entry(arguments, count)
            return
        for i in range(count):
            entry(i, *arguments)

    def together(self, launches: Sequence[Callable]) -> Callable:
        def do() -> None:
            for launch in launches:
                launch()

        return do

    def wait(self) -> None:
        pass

    def seconds_of(self, launches: Iterable[Callable]) -> list[float]:
        seconds = []
        for launch in launches:
            begun = perf_counter()
            launch()
            seconds.append(perf_counter() - begun)
        return seconds


class Counted(Emulator):
    """An emulator that counts allocated bytes (never freed) and runs nothing."""

    name, taken, copies = "counted", 0, 64

    def allocate(self, size: int) -> int:
        self.taken += size
        return 1 << 40

    def free(self, address: int) -> None:
        pass

    def copy_to(self, address: int, source: int, size: int) -> None:
        pass

    copy = copy_from = copy_to

    def compiled(self, function: Callable, kinds: tuple, called: dict | None = None) -> None:
        pass


class Card(_Coded):
    on_card = True
    copies = 64  # copies of the totals: neighbouring threads rarely add to the same copy

    def __init__(self) -> None:
        try:
            from cuda.bindings import driver
        except ImportError:
            raise NoCard(
                "--gpu needs the packages for NVIDIA GPUs",
                "pip install '.[gpu]' in the folder of karamelo-py, or leave out --gpu",
            ) from None
        super().__init__()
        self._driver = driver
        try:
            self._do("cuInit", 0)
            device = self._do("cuDeviceGet", 0)
        except Exception as error:
            raise NoCard(
                "there is no NVIDIA GPU with a driver on this machine",
                "leave out --gpu: processors run the same script; nvidia-smi lists the GPUs",
            ) from error
        self._context = self._do("cuDevicePrimaryCtxRetain", device)
        self._do("cuCtxSetCurrent", self._context)
        self._stream = self._do("cuStreamCreate", 0)  # copies wait for this stream
        about = driver.CUdevice_attribute
        major, minor = (
            self._do("cuDeviceGetAttribute", getattr(about, f"CU_DEVICE_ATTRIBUTE_{key}"), device)
            for key in ("COMPUTE_CAPABILITY_MAJOR", "COMPUTE_CAPABILITY_MINOR")
        )
        self.processor = f"sm_{major}{minor}"
        self.name = self._do("cuDeviceGetName", 100, device).split(b"\0")[0].decode()

    def _do(self, function: str, *arguments: Any) -> Any:
        error, *results = getattr(self._driver, function)(*arguments)
        if int(error) != 0:
            name = self._driver.cuGetErrorName(error)[1]
            raise RuntimeError(f"{function}: {name.decode() if name else int(error)}")
        return results[0] if results else None

    def memory(self) -> tuple[int, int]:
        _, free, whole = self._driver.cuMemGetInfo()
        return int(free), int(whole)

    def allocate(self, size: int) -> int:
        try:
            return int(self._do("cuMemAlloc", max(size, 1)))
        except RuntimeError:
            free, whole = self.memory()
            raise MemoryError(
                f"the GPU has {free:.3g} of {whole:.3g} bytes free, {size:.3g} are asked for"
            ) from None

    def free(self, address: int) -> None:
        self._do("cuMemFree", address)

    def copy_to(self, target: int, source: int, size: int) -> None:
        self._do("cuMemcpyHtoD", target, source, size)

    def copy(self, target: int, source: int, size: int) -> None:
        self._do("cuMemcpyDtoD", target, source, size)

    def copy_from(self, target: int, source: int, size: int) -> None:
        self._do("cuMemcpyDtoH", target, source, size)

    def made(self, text: str) -> bytes:
        return assembled(text, self.processor).encode() + b"\0"

    def loaded(self, code: Code) -> Any:
        room = ctypes.create_string_buffer(code.code)
        module = self._do("cuModuleLoadData", ctypes.addressof(room))
        return self._do("cuModuleGetFunction", module, code.name.encode())

    def launch(self, entry: Any, arguments: int, count: int) -> None:
        values = (arguments, count), (ctypes.c_int64, ctypes.c_int64)
        blocks = -(-count // THREADS)
        self._do("cuLaunchKernel", entry, blocks, 1, 1, THREADS, 1, 1, 0, self._stream, values, 0)

    def together(self, launches: Sequence[Callable]) -> Callable:
        mode = self._driver.CUstreamCaptureMode.CU_STREAM_CAPTURE_MODE_RELAXED
        self._do("cuStreamBeginCapture", self._stream, mode)
        for launch in launches:
            launch()
        graph = self._do("cuStreamEndCapture", self._stream)
        made = self._do("cuGraphInstantiate", graph, 0)
        self._do("cuGraphDestroy", graph)

        def do() -> None:
            self._do("cuGraphLaunch", made, self._stream)

        weakref.finalize(do, self._driver.cuGraphExecDestroy, made).atexit = False
        return do

    def wait(self) -> None:
        self._do("cuCtxSynchronize")

    def seconds_of(self, launches: Iterable[Callable]) -> list[float]:
        launches = list(launches)
        events = [self._do("cuEventCreate", 0) for _ in range(len(launches) + 1)]
        self._do("cuEventRecord", events[0], self._stream)
        for launch, event in zip(launches, events[1:], strict=True):
            launch()
            self._do("cuEventRecord", event, self._stream)
        self.wait()
        seconds = [self._do("cuEventElapsedTime", *pair) / 1e3 for pair in pairwise(events)]
        for event in events:
            self._do("cuEventDestroy", event)
        return seconds


def card() -> Card | Emulator:
    """Return the GPU, or with KARAMELO_PY_GPU=emulated the emulator."""
    return Emulator() if os.environ.get("KARAMELO_PY_GPU") == "emulated" else Card()


class _There(NamedTuple):
    address: int
    size: int
    array: np.ndarray  # array in the memory of the program
    image: np.ndarray  # same shape and strides, at a device address


def _extent(array: np.ndarray) -> int:
    if not array.size:
        return 0
    steps = zip(array.shape, array.strides, strict=True)
    return sum((n - 1) * step for n, step in steps) + array.itemsize


def _free_all(card: Any, rooms: dict[int, int]) -> None:
    for address in rooms:
        card.free(address)
    rooms.clear()


class Images:
    """Arrays of the program with copies in device memory.

    An image is a NumPy array at a device address, which only kernels access.
    """

    def __init__(self, card: Any):
        self.card = card
        self._known: dict[int, _There] = {}
        self._rooms: dict[int, int] = {}  # sizes by address
        weakref.finalize(self, _free_all, card, self._rooms).atexit = False

    def of(self, thing: Any) -> Any:
        if isinstance(thing, np.ndarray):
            return self._image(thing)
        if isinstance(thing, tuple):
            items = [self.of(item) for item in thing]
            return type(thing)(*items) if hasattr(thing, "_fields") else tuple(items)
        return thing

    def _image(self, array: np.ndarray) -> np.ndarray:
        image_of = self._known.get(id(array))
        if image_of is None:
            size, at = _extent(array), array.ctypes.data
            if not size or any(room <= at < room + n for room, n in self._rooms.items()):
                return array  # the array is empty or on the device already
            address = self._room(size)
            memory = (ctypes.c_char * size).from_address(address)
            made = np.ndarray(array.shape, array.dtype, memory, 0, array.strides)
            image = made.view(type(array))
            image.flags.writeable = array.flags.writeable
            image_of = self._known[id(array)] = _There(address, size, array, image)
        return image_of.image

    def _room(self, size: int) -> int:
        address = self.card.allocate(size)
        self._rooms[address] = size
        return address

    @property
    def size(self) -> int:
        return sum(self._rooms.values())

    def new(self, shape: tuple[int, ...], dtype: Any) -> np.ndarray:
        size = max(int(np.prod(shape)) * np.dtype(dtype).itemsize, 1)
        return np.ndarray(shape, dtype, (ctypes.c_char * size).from_address(self._room(size)))

    def send(self, arrays: Iterable[np.ndarray]) -> None:
        for one in self._of(arrays):
            self.card.copy_to(one.address, one.array.ctypes.data, one.size)

    def fetch(self, arrays: Iterable[np.ndarray]) -> None:
        for one in self._of(arrays):
            self.card.copy_from(one.array.ctypes.data, one.address, one.size)

    def _of(self, arrays: Iterable[np.ndarray]) -> list[_There]:
        return [self._known[id(array)] for array in arrays if id(array) in self._known]

    def put_at(self, at: int, content: bytes | bytearray) -> None:
        room = (ctypes.c_char * len(content)).from_buffer_copy(content)
        self.card.copy_to(at, ctypes.addressof(room), len(content))

    def close(self) -> None:
        _free_all(self.card, self._rooms)
        self._known.clear()


class KernelLaunch:
    """A thread function with its arguments, run by `count` threads."""

    def __init__(
        self, images: Images, function: Callable, count: int, *arguments: Any,
        called: dict | None = None,
    ):  # fmt: skip
        self.card, self.count, self.name = images.card, count, function.__name__
        images_of_arguments = images.of(arguments)
        if INTERPRETED:
            self.entry, self.at = function, images_of_arguments
            return
        plan = plan_for(images_of_arguments)
        self.entry = self.card.compiled(function, plan.types, called)
        self._arguments = images._room(max(plan.text.size, 1))
        memory, self.at = ArgumentBuffer(images_of_arguments).in_memory(plan, self._arguments)
        images.put_at(self._arguments, memory)

    def __call__(self) -> None:
        if self.count:
            self.card.launch(self.entry, self.at, self.count)
