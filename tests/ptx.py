"""Threads of scenes as a card of NVIDIA has them: their PTX, and what its linker makes of it.

Needs NVIDIA's linker, but neither a GPU nor a driver.
"""

import re
from collections.abc import Callable
from typing import Any, NamedTuple

from cuda.bindings import nvjitlink

from karamelo_py.compiler import gpu, index, shared
from karamelo_py.compiler.code.arguments import plan_for
from karamelo_py.kernels.equations.node_updates import at_node
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.on_card import SimulationOnCard
from karamelo_py.scene.hub import Hub


class Compiled(NamedTuple):
    """What a function of a thread has become."""

    name: str
    ptx: str
    registers: int  # of a thread, and of what it calls
    stack: int  # bytes of a thread's local memory, without spills
    spilled: int  # bytes that registers did not hold, stored and loaded


class Linked(gpu.Counted):
    """A card that links what it is to run, and notes what came out."""

    on_card, processor = True, "sm_90"  # of an H100 or H200

    def __init__(self, all_of_them: bool = True) -> None:
        super().__init__()
        self.all, self.found = all_of_them, []

    def compiled(self, function: Callable, kinds: tuple, called: dict | None = None) -> Any:
        """Link a function; unless all are, one that is not the same in every scene."""
        if self.all or "<locals>" in function.__qualname__:
            return super(gpu.Counted, self).compiled(function, kinds, called)
        return None

    def made(self, text: str) -> bytes:
        """Make PTX."""
        return gpu.assembled(text, self.processor).encode()

    def loaded(self, code: gpu.Code) -> None:
        """Link it."""
        options = [f"-arch={self.processor}", "-verbose"]
        linker = nvjitlink.create(len(options), options)
        try:
            kind, size = nvjitlink.InputType.PTX, len(code.content)
            nvjitlink.add_data(linker, kind, code.content, size, "threads.ptx")
            nvjitlink.complete(linker)
            log = bytearray(nvjitlink.get_info_log_size(linker))
            nvjitlink.get_info_log(linker, log)
        finally:
            nvjitlink.destroy(linker)
        said = re.findall(
            r"(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads"
            r".*?Used (\d+) registers",
            log.decode(),
            re.DOTALL,
        )
        stack, stores, loads, registers = (sum(map(int, of)) for of in zip(*said, strict=True))
        made = Compiled(code.name, code.content.decode(), registers, stack, stores + loads)
        self.found.append(made)


def scene_on_card(script: str, all_of_them: bool = False) -> SimulationOnCard:
    """The simulation of a scene without its run, on a card that links."""
    hub = Hub(Console(quiet=True))
    hub.settings.engine, hub.settings.card = "gpu", Linked(all_of_them)
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_text(re.sub(r"^run\(.*", "", script, flags=re.MULTILINE))
    hub.simulation.begin(1.0)
    return hub.simulation


def threads_of(script: str, all_of_them: bool = False) -> list[Compiled]:
    """What the threads of a scene have become: those of its physics, or all."""
    simulation = scene_on_card(script, all_of_them)
    simulation.launches()
    return simulation.hub.settings.card.found


def compiled(function: Callable, *arguments: Any) -> Compiled:
    """A function of a thread for arguments of these types."""
    card = Linked()
    card.compiled(function, plan_for(arguments).types)
    return card.found[0]


def visit_node(i, task, kin, nodes, dt):
    """What a task does at one node."""
    at_node(task, kin, nodes, index(i), dt)


def calling(function: Callable) -> Callable:
    """A thread that writes down what a function of numbers gives, another tuple of them."""
    shared(function)

    def write(i, out, *numbers):
        for k, value in enumerate(function(*numbers)):
            out[k] = value

    return write
