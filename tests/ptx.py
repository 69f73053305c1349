"""One point of a scene as a thread of a GPU would visit it, compiled to PTX and machine code.

Needs NVIDIA's linker, but neither a GPU nor a driver.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from cuda.bindings import nvjitlink
from numba import typeof

from karamelo_py.compiler import loops, machine
from karamelo_py.compiler.argument_buffer import plan_for
from karamelo_py.compiler.compile import index, shared
from karamelo_py.compiler.fields import load_vector
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import Nodes, Setup
from karamelo_py.kernels.g2p import empty_all, updated_all
from karamelo_py.kernels.heat import HeatContent, HeatFlow
from karamelo_py.kernels.lanes import OneByOne, zero_of
from karamelo_py.kernels.nodes import at_node
from karamelo_py.kernels.p2g import load_all, sum_share
from karamelo_py.kernels.stencils import gather_nodes, scatter_nodes
from karamelo_py.kernels.sweep import (
    Context,
    Visit,
    places_of,
    recompute_stencil,
    work_of,
)
from karamelo_py.kernels.table import Repeated, Sweep, fused, plain, staged
from karamelo_py.kernels.visit import place_at
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.points.basis import locate
from karamelo_py.run.lower.build import lower
from karamelo_py.scene.hub import Hub

CAPABILITY = (9, 0)  # of an H100 or H200


class Compiled(NamedTuple):
    """What a function has become."""

    ptx: str
    registers: int  # of a thread
    stack: int  # bytes of a thread's local memory, without spills
    spilled: int  # bytes that registers did not hold, stored and loaded


def visit_point(visit, s, block, p, report):
    """What `kernels.sweep.visit_tile` does for one point, in doubles or singles."""
    points, dt = block.points, s.dt
    p = index(p)
    grid = record(s.grids, index(points.grid[p]))
    places = places_of(s.frame, points, s.now, s.then)
    w = work_of(s, grid, s.nodes, block, places)
    width = OneByOne()
    stencil = locate(s.basis, s.kin, grid, place_at(s.basis, s.kin, places.where, p))
    totals = empty_all(visit.tasks, w, load_vector(s.kin, places.x, p))
    totals = gather_nodes(stencil, width, visit.tasks, w, totals)
    moved, rate = updated_all(visit.tasks, w, stencil, p, dt, totals, zero_of(width, dt))
    report[p, 0] = moved
    report[p, 1] = rate
    if not (moved <= s.stride and rate < 1e300):
        return
    stencil = recompute_stencil(visit.weights, w, stencil, p)
    loads = load_all(visit.quantities, w, p, dt)
    scatter_nodes(stencil, width, visit.quantities, w, loads)


def visit_node(task, kin, nodes, n, dt):
    """What `kernels.sweep.visit_nodes` does for one node."""
    at_node(task, kin, nodes, index(n), dt)


def setup_of(script: str) -> tuple[Setup, type]:
    """The arrays of a scene without its run, and its scheme."""
    hub = Hub(Console(quiet=True))
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_text(re.sub(r"^run\(.*", "", script, flags=re.MULTILINE))
    return lower(hub)[0], hub.update.scheme


def of_rows(rows: Iterable) -> Iterator[Visit]:
    """The visits of the points among the rows of a step."""
    for row in rows:
        if isinstance(row, Sweep):
            yield row.visit
        elif isinstance(row, Repeated):
            yield from of_rows(row.rows(0))


def visits_of(setup: Setup, scheme: Any, in_stages: bool = False) -> list[Visit]:
    """Every visit of the points in a step of a scene, each once; those in stages, if asked for."""
    rows = fused(scheme.rows) + (staged(scheme.rows) if in_stages else [])
    return list({typeof(visit): visit for visit in of_rows(plain(rows, setup))}.values())


def compiled(function: Any, *arguments: Any) -> Compiled:
    """A kernel for arguments of these types."""
    kinds = plan_for(arguments).types
    module, _ = loops.written(shared(function), kinds)
    main = module.globals[loops.NAME]
    main.linkage = "internal"
    main.attributes.discard("noinline")
    main.attributes.add("alwaysinline")
    module.globals[loops.NAME + loops.ENTRY].calling_convention = "ptx_kernel"
    text = str(module).replace(loops.NAME, "kernel").replace(loops.ENTRY, "_entry")
    ptx = machine.assembly(text, "nvptx64-nvidia-cuda", f"sm_{CAPABILITY[0]}{CAPABILITY[1]}")
    options = [f"-arch=sm_{CAPABILITY[0]}{CAPABILITY[1]}", "-verbose"]
    code = ptx.encode()
    linker = nvjitlink.create(len(options), options)
    try:
        nvjitlink.add_data(linker, nvjitlink.InputType.PTX, code, len(code), "visit.ptx")
        nvjitlink.complete(linker)
        log = bytearray(nvjitlink.get_info_log_size(linker))
        nvjitlink.get_info_log(linker, log)
    finally:
        nvjitlink.destroy(linker)
    found = re.search(
        r"(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads"
        r".*?Used (\d+) registers",
        log.decode(),
        re.DOTALL,
    )
    stack, stores, loads, registers = map(int, found.groups())
    return Compiled(ptx, registers, stack, stores + loads)


def calling(function: Callable, count: int) -> Callable:
    """A kernel that writes down what a function of numbers gives, another tuple of them."""
    shared(function)

    def write(out, *numbers):
        for k, value in enumerate(function(*numbers)):
            out[k] = value

    return write


def nodes_of(visit: Visit, setup: Setup) -> Nodes:
    """The nodes that a visit works with."""
    of_heat = any(isinstance(one, HeatContent | HeatFlow) for one in visit.quantities)
    return setup.heat.nodes if of_heat else setup.nodes


def compiled_sum(visit: Visit, setup: Setup) -> Compiled:
    """What sums at a share of the nodes what a visit gave to the tiles of points."""
    nodes = nodes_of(visit, setup)
    buffers = setup.buffers._replace(nodes=nodes)
    return compiled(sum_share, visit.quantities, setup.kin, nodes, buffers, 0)


def compiled_visit(visit: Visit, setup: Setup) -> Compiled:
    """A visit of a point of the scene's first law."""
    s, nodes = setup, nodes_of(visit, setup)
    real = s.nodes.sums.dtype.type
    context = Context(
        s.frame, s.kin, s.basis, s.transfer, s.averaging, s.grids, nodes, nodes, 0, real(0),
        real(1), (real(0),) * s.kin.dimension, 0, True, True, real(1),
        real(1),
    )  # fmt: skip
    report = np.zeros((1, 2), real)
    return compiled(visit_point, visit, context, s.blocks[0], 0, report)
