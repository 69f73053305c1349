"""Runs scripts without compiling anything: the same Python sources, interpreted.

Started by a fixture of conftest.py as a process of its own (``NUMBA_DISABLE_JIT=1`` must be set
before Numba is imported). Tells where its package lies, then reads one JSON request a line and
answers with one JSON line.
"""

import contextlib
import ctypes
import functools
import gc
import inspect
import io
import itertools
import json
import math
import os
import sys
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

MOST_PLACES = 1000  # whose stencils are kept
MOST_OBJECTS = 20
TRIALS = 5  # of sums over arrays of nodes

# Up to Python 3.11 a cached property is of one thread at a time: processes as threads meet in some.
functools.RLock = contextlib.nullcontext


def save_state(request: dict) -> int:
    """Run a script and save its final state or columns; a failure is told, not raised."""
    import numpy as np
    from comms import learn_at_random, together
    from states import final_columns, final_hub, final_state

    from karamelo_py.output import fields
    from karamelo_py.run import tiles
    from karamelo_py.run.checkpoint import arrays as storing
    from karamelo_py.run.mpi import partition, subdomain
    from karamelo_py.run.mpi.whole import Whole
    from karamelo_py.script.errors import ScriptError
    from karamelo_py.styles.dumps import hdf5

    script, columns = request["arguments"][0], request["columns"]
    usual = tiles.DIRECT_UP_TO, tiles.TILES, Whole.gather
    subdomain.LEARN_EVERY, partition.IMBALANCE, subdomain.Load.learn = 2, 1.0, learn_at_random
    if request["fails"]:  # no process may need the whole scene to say why
        Whole.gather = None
    if request["boxes"]:
        tiles.DIRECT_UP_TO, tiles.TILES = 0, {1: 4, 2: 2, 3: 2}
    # One process has all points in a piece, several a few; files of HDF5 are the same then, too.
    piece = 16 if request["ranks"] > 1 else 1 << 17
    fields.PIECE = storing.PIECE = piece
    hdf5.PIECE = 16
    try:
        folder = request["out"] and Path(request["out"])
        if request["fails"]:
            together(request["ranks"], lambda comm: final_hub(script, comm=comm, folder=folder))
            return 0
        if columns:
            arrays = final_columns(script, columns, folder)
        else:
            arrays = final_state(script, ranks=request["ranks"], folder=folder)
        np.savez(request["state"], **arrays)
    except Exception as error:
        if request["fails"] and isinstance(error, ScriptError):
            print(error.render(), file=sys.stderr)
            return 0
        traceback.print_exc()
        return 1
    finally:
        tiles.DIRECT_UP_TO, tiles.TILES, Whole.gather = usual
    return 0


def trouble_emulator() -> None:
    """Let threads of an emulated GPU come in any order, and its memory hold NaN at first."""
    import numpy as np

    from karamelo_py.compiler.gpu import Emulator

    allocate, chance = Emulator.allocate, np.random.default_rng(1)

    def with_rubbish(emulator: Emulator, size: int) -> int:
        at = allocate(emulator, size)
        ctypes.memset(at, 0xFF, size)  # whole numbers are -1
        return at

    def shuffled(emulator: Emulator, entry, arguments: tuple, count: int) -> None:
        for i in chance.permutation(count).tolist():
            entry(i, *arguments)

    Emulator.allocate, Emulator.launch = with_rubbish, shuffled


def remember_stencils(product: ModuleType) -> tuple[Callable, Callable]:
    """Keep the stencils of places, and their nodes: each visit of a step asks for the same.

    Returns ``kept(stencil, key, make)``, which keeps further things of a stencil, and
    ``arrays(kin, grid, stencil)``, numbers, weights and gradients of all nodes, or None.
    """
    import numpy as np

    locate, entry = product._locate_product, product._entry_product
    stencils: dict[tuple, tuple] = {}
    things: dict[int, dict] = {}

    def located(basis, kin, grid, place):
        number = place[0].__class__
        if number.__module__ != "numpy":  # it may carry slopes
            return locate(basis, kin, grid, place)
        key = number, id(basis), id(kin), grid, place
        found = stencils.get(key)
        if found is None:
            if len(stencils) > MOST_PLACES:
                stencils.clear()
                things.clear()
            stencil = locate(basis, kin, grid, place)
            # With these two and the stencil alive, nothing else has their identities.
            found = stencils[key] = stencil, basis, kin
            things[id(stencil)] = {"alive": stencil}
        return found[0]

    def kept(stencil, key, make):
        known = things.get(id(stencil))
        if known is None:
            return None
        if key not in known:
            known[key] = make()
        return known[key]

    def along(values):
        """Values along each axis, as arrays that NumPy combines to those of all nodes."""
        return np.ix_(*values) if len(values) > 1 else [np.array(*values)]

    def weights_of(kin, stencil):
        lines = stencil.lines
        if len({type(x) for line in lines for x in (*line.weights, *line.gradients)}) > 1:
            return None
        weights = along([line.weights for line in lines])
        weight = product.product(weights)
        slopes = product.with_each_replaced(weights, along([line.gradients for line in lines]))
        gradient = product.with_hoop(kin, weight, slopes, stencil.inv_r)
        return weight.ravel(), gradient._make([slope.ravel() for slope in gradient])

    def arrays(kin, grid, stencil):
        weights = kept(stencil, "weights", lambda: weights_of(kin, stencil))

        def made():  # of a grid, which may be a box of it
            first = product.node_number(grid, grid.first, [line.first for line in stencil.lines])
            steps = along([range(len(line.weights)) for line in stencil.lines])
            numbers = (first + product.node_number(grid, 0, steps)).ravel()
            return (numbers, *weights) if len({*numbers.tolist()}) == len(numbers) else None

        return weights and kept(stencil, (grid.first, grid.step_x, grid.step_y), made)

    def one_by_one(kin, grid, stencil):
        found = arrays(kin, grid, stencil)
        if found is None:
            return None
        numbers, weights, gradient = found
        gradients = map(gradient._make, zip(*gradient, strict=True))
        return [*zip(numbers.tolist(), weights, gradients, strict=True)]

    def found_entry(basis, kin, grid, stencil, k):
        key = grid.first, grid.step_x, grid.step_y, "one by one"
        found = kept(stencil, key, lambda: one_by_one(kin, grid, stencil))
        return entry(basis, kin, grid, stencil, k) if found is None else found[k]

    product._locate_product, product._entry_product = located, found_entry
    return kept, arrays


def quick_records() -> None:
    """Read and set fields of NumPy's records by C alone: a twentieth of what steps take."""
    import numpy as np

    void, read, put = np.void, np.record.__getattribute__, np.record.__setattr__

    def field(one: np.record, name: str):
        try:
            found = void.__getitem__(one, name)
        except ValueError:  # no field of that name
            return read(one, name)
        return read(one, name) if isinstance(found, void) else found

    def put_field(one: np.record, name: str, value) -> None:
        try:
            void.__setitem__(one, name, value)
        except ValueError:
            put(one, name, value)

    np.record.__getattribute__, np.record.__setattr__ = field, put_field


class Found(dict):
    """Implementations of a point function by the class of its first argument."""

    def __init__(self, function):
        self.function = function

    def __missing__(self, one: type) -> Callable:
        chosen = self.function.find((one,))
        if chosen is None:
            return self.function  # which says so
        self[one] = chosen
        return chosen


def direct(made) -> Callable:
    """A Python function that calls the implementation of a point function by one class.

    Python calls it in a quarter of the time of an object.
    """
    found = Found(made)
    names = [*inspect.signature(made.__wrapped__).parameters]
    passed = ", ".join(names)
    call = eval(f"lambda {passed}: found[{names[0]}.__class__]({passed})", {"found": found})

    def on(*classes: type) -> Callable:
        register = made.on(*classes)

        def registered(implementation: Callable) -> Callable:
            register(implementation)
            found.clear()
            return implementation

        return registered

    functools.update_wrapper(call, made.__wrapped__)
    call.tags, call.find, call.defined, call.on = 1, made.find, made.defined, on
    return call


def quick_point_functions(compiler: ModuleType, algebra: ModuleType) -> None:
    """Choose implementations by one class in a Python function."""
    declared = compiler.point_function

    def point_function(*, tags: int = 1, otherwise: bool = False) -> Callable:
        def declare(stub: Callable) -> Callable:
            made = declared(tags=tags, otherwise=otherwise)(stub)
            has_more = stub.__code__.co_flags & (inspect.CO_VARARGS | inspect.CO_VARKEYWORDS)
            plain = not (has_more or stub.__defaults__ or stub.__kwdefaults__)
            return direct(made) if tags == 1 and plain else made

        return declare

    class OfClasses(type):
        def __instancecheck__(cls, thing: object) -> bool:
            return hasattr(thing, "find") and hasattr(thing, "tags")

    compiler.point_function = point_function
    algebra.PointFunction = OfClasses("PointFunction", (), {})


def quick_totals(totals: ModuleType) -> None:
    """Let Python's integers do the exact sums of `totals`: the same digits, 5 % of the time."""
    by_limbs = totals.add_to, totals.add_many
    first = -1074 + 53  # the exponent of the smallest number, as of a mantissa's last bit

    def whole(x: float) -> int:
        mantissa, exponent = math.frexp(x)
        number, shift = int(mantissa * 2.0**53), exponent - first
        return number << shift if shift >= 0 else number >> -shift

    def put(totals_of_all, row: int, total: int) -> None:
        sign, total = (1, total) if total > 0 else (-1, -total)
        limb = ((total & -total).bit_length() - 1) >> 5
        total >>= 32 * limb
        while total:
            totals_of_all[row, limb] += sign * (total & totals.DIGIT)
            total >>= 32
            limb += 1

    def add_many(totals_of_all, row: int, terms, count: int) -> None:
        if totals.many_threads():
            by_limbs[1](totals_of_all, row, terms, count)
            return
        finite = [x for x in terms[:count].tolist() if math.isfinite(x)]
        totals_of_all[row, totals.LOST] += count - len(finite)
        total = sum(map(whole, filter(None, finite)))
        if total:
            put(totals_of_all, row, total)

    def add_to(totals_of_all, row: int, x: float) -> None:
        if totals.many_threads() or not math.isfinite(x):
            by_limbs[0](totals_of_all, row, x)
        elif x:
            put(totals_of_all, row, whole(x))

    def carry(total) -> None:
        digits, carried = total.tolist(), 0
        for k in range(totals.LOST - 1):
            digit = digits[k] + carried
            carried, digits[k] = digit >> 32, digit & totals.DIGIT
        digits[totals.LOST - 1] += carried
        total[:] = digits

    totals.add_to, totals.add_many, totals.carry = add_to, add_many, carry


def quick_slopes(slopes: ModuleType) -> None:
    """Combine the slopes of floats, of which 0 is a literal, by a loop of Python."""

    def combined(value, a, x, b, y):
        if not isinstance(y, slopes.Dual):
            return slopes.Dual(value, tuple([s and a * s for s in x.slopes]))
        if not isinstance(x, slopes.Dual):
            return slopes.Dual(value, tuple([t and b * t for t in y.slopes]))
        pairs = zip(x.slopes, y.slopes, strict=True)
        both = [(a * s + b * t if t else a * s) if s else t and b * t for s, t in pairs]
        return slopes.Dual(value, tuple(both))

    slopes.combined = combined


def remember(make: Callable) -> Callable:
    """Keep what `make` returns for the same objects, of a few scenes."""
    found: dict[tuple, tuple] = {}

    def made(*things):
        key = tuple(map(id, things))
        known = found.get(key)
        if known is None:
            if len(found) > MOST_OBJECTS:
                found.clear()
            known = found[key] = make(*things), things  # alive, they alone have these identities
        return known[0]

    return made


def quick_sums(sums: ModuleType, by_threads: Callable) -> None:
    """Add boxes of tiles by ranges of nodes, not node by node."""
    columns_of = remember(lambda quantities, kin: [*sums._columns(quantities, kin)])

    def sum_shares(quantities, kin, nodes, buffers, share):
        columns = columns_of(quantities, kin)
        for row in range(buffers.first[share], buffers.first[share + 1]):
            n, m, *counts, n_i, n_j, m_i, m_j, action = buffers.parts[row].tolist()
            clears, keeps = action == sums.arrays.CLEAR, action == sums.arrays.ADD
            for name, first, end, add in columns:
                array, box = sums.node_array(nodes, name), sums.node_array(buffers.nodes, name)
                if array is None or (add and clears):
                    continue
                for i, j in itertools.product(*map(range, counts[:2])):
                    to, of = n + i * n_i + j * n_j, m + i * m_i + j * m_j
                    into = array[to : to + counts[2], first:end]
                    out_of = box[of : of + counts[2], first:end]
                    if clears:
                        into[:] = 0
                    else:
                        into[:] = (into if add or keeps else 0) + out_of
                        out_of[:] = 0

    sums.sum_shares = by_threads(sum_shares)


def quick_scatter(eq: ModuleType) -> dict[type, Callable]:
    """Look once for the arrays to which a quantity adds.

    Returns ``given(load, node)`` by quantity: arrays, their first columns, and what is added.
    """
    register, all_given = eq._register, {}

    def register_both(kind):
        register(kind)
        by_array = itertools.groupby(kind.gives, lambda one: one.into.array)
        groups = [(array, [*of_array]) for array, of_array in by_array]

        @remember
        def present(nodes, kin):
            found = [(eq.node_array(nodes, array), of_array) for array, of_array in groups]
            return [
                (array, of_array[0].into.first(kin), [one.of for one in of_array])
                for array, of_array in found
                if array is not None
            ]

        def given(load, node):
            return [
                (array, first, eq.flat([of(load, node) for of in equations]))
                for array, first, equations in present(node.w.nodes, node.w.kin)
            ]

        @eq.scattered.on(kind)
        def scatter(quantity, load, node):
            for array, first, values in given(load, node):
                eq.accumulate(array, node.i, first, values)

        all_given[kind] = given

    eq._register = register_both
    return all_given


def rebuilt(template: tuple, numbers: Iterator) -> tuple:
    """Nest numbers as in a template."""
    parts = [rebuilt(one, numbers) if isinstance(one, tuple) else next(numbers) for one in template]
    return template._make(parts) if hasattr(template, "_make") else tuple(parts)


def visit_nodes_at_once(
    stencils: ModuleType, kept: Callable, arrays: Callable, given: dict[type, Callable]
) -> None:
    """Evaluate equations of nodes once for arrays of all nodes, where they do not branch.

    Sums over nodes are made from the first to the last, as one by one. The first points of each
    kind are tried both ways.
    """
    import numpy as np

    from karamelo_py.kernels import views

    scatter_each, gather_each, eq = stencils._scatter, stencils._gather, stencils.eq
    branch: set[tuple] = set()
    trials: Counter = Counter()

    def stacked(vectors):
        return vectors[0]._make([np.array(numbers) for numbers in zip(*vectors, strict=True)])

    class Nodes(views.NodeView):
        """All nodes of a stencil."""

        __slots__ = ()

        def _of_all(self, name):
            w, stencil = self.w, self.stencil

            def made():
                every = [views.node_of(w, stencil, k) for k in range(len(self.i))]
                return stacked([getattr(node, name) for node in every])

            found = kept(stencil, name, made)
            return made() if found is None else found  # cleared by another thread

        arm = property(lambda node: node._of_all("arm"))
        affine_N = property(lambda node: node._of_all("affine_N"))

    def all_of(w, stencil):
        parts = arrays(w.kin, w.grid, stencil)
        return parts and Nodes(w, stencil, np.arange(len(parts[0])), *parts)

    def kind_of(tag, w):
        parts = tag, w.frame, w.kin, w.basis, w.transfer, w.averaging, w.laws
        return tuple(type(part) for part in parts)

    def agrees(kind, made, each):
        """Whether both ways agree, for the first points with numbers other than 0."""
        trials[kind] += any(number != 0 for number in made)
        if [repr(number) for number in made] != [repr(number) for number in each]:
            branch.add(kind)
        return kind not in branch

    def values(quantity, load, nodes, kind):
        found = given[type(quantity)](load, nodes)
        if trials[kind] < TRIALS:
            every = [views.node_of(nodes.w, nodes.stencil, k) for k in nodes.k]
            each = [given[type(quantity)](load, node) for node in every]
            each = [number for one in each for _, _, numbers in one for number in numbers]
            made = [np.broadcast_to(x, len(every)) for _, _, numbers in found for x in numbers]
            if not agrees(kind, [*np.array(made).T.ravel()], each):
                return None
        return found

    def scatter(quantities, w, stencil, loads):
        nodes = all_of(w, stencil)
        for quantity, load in zip(quantities, loads, strict=True):
            kind, found = kind_of(quantity, w), None
            if nodes is not None and kind not in branch:
                try:
                    found = values(quantity, load, nodes, kind)
                except (TypeError, ValueError):
                    branch.add(kind)
            if found is None:
                scatter_each((quantity,), w, stencil, (load,))
            else:
                for array, first, numbers in found:
                    eq.accumulate(array, nodes.i, first, numbers)

    def total_of(task, nodes, total):
        try:
            made = eq.flat((eq.gathered(task, nodes, total),))
            sums = np.add.accumulate(np.array(made), axis=1)[:, -1]
        except (TypeError, ValueError):
            return None
        return rebuilt((total,), iter(sums))[0] if len(made) == len(eq.flat((total,))) else None

    def gather(tasks, w, stencil, totals):
        nodes, found = all_of(w, stencil), []
        for task, total in zip(tasks, totals, strict=True):
            kind, made = kind_of(task, w), None
            if nodes is not None and kind not in branch and not any(eq.flat((total,))):
                made = total_of(task, nodes, total)
                if made is None:
                    branch.add(kind)
            if made is None or trials[kind] < TRIALS:
                (each,) = gather_each((task,), w, stencil, (total,))
                if made is not None:
                    agrees(kind, eq.flat((made,)), eq.flat((each,)))
                made = each
            found.append(made)
        return tuple(found)

    stencils._scatter, stencils._gather = scatter, gather


def quick_states(views: ModuleType) -> None:
    """Make the template of states once for a table of laws."""
    from karamelo_py.compiler.tuples import nested_as

    @remember
    def template_of(laws, kin):
        template = views.initial_state(views.record(laws, 0), kin, 1.0)
        return template, range(views.count_in(template))

    def state_at(kin, points, laws, p):
        law, array = views.law_at(points, laws, p), points.state
        template, rows = template_of(laws, kin)
        return law, nested_as(template, tuple([array[k, p] for k in rows]))

    views.state_at = state_at


def quicken() -> None:
    """Import the program, and let it interpret scenes faster, with the same numbers."""
    from karamelo_py import compiler
    from karamelo_py.compiler import slopes
    from karamelo_py.compiler.threads import by_threads
    from karamelo_py.compiler.trace import algebra

    quick_point_functions(compiler, algebra)  # before others declare them
    from karamelo_py.kernels import totals
    from karamelo_py.points.basis import product

    quick_slopes(slopes)
    quick_totals(totals)  # before others import them
    kept, arrays = remember_stencils(product)  # before the bases are there, which register them
    from karamelo_py.kernels import views

    quick_states(views)
    from karamelo_py.kernels import equations

    given = quick_scatter(equations)
    from karamelo_py.kernels import sums

    quick_sums(sums, by_threads)
    from karamelo_py.kernels import stencils

    visit_nodes_at_once(stencils, kept, arrays, given)
    from karamelo_py.app import cli
    from karamelo_py.run import loop  # noqa: F401

    quick_records()
    cli._parser = functools.cache(cli._parser)  # a third of what a tiny scene takes
    gc.freeze()  # scenes make many objects, among which alone cycles have to be looked for
    gc.set_threshold(50_000, 20, 100)  # and few cycles


def answer() -> None:
    """Serve requests until the input ends."""
    requests, answers = sys.stdin, sys.stdout
    import karamelo_py
    from karamelo_py.app import cli
    from karamelo_py.run.element import Response

    Response.draw = lambda *_: None  # a third of what an element takes; test_element.py draws
    trouble_emulator()
    # Which package it is: the first line.
    print(karamelo_py.__file__, flush=True)
    # Interpreted arithmetic warns about what compiled kernels pass over in silence.
    warnings.simplefilter("ignore")
    for line in requests:
        request = json.loads(line)
        os.chdir(request["folder"])
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            arguments = request["arguments"]
            status = save_state(request) if "state" in request else cli.main(arguments)
        said = {"status": status, "out": out.getvalue(), "err": err.getvalue()}
        answers.write(json.dumps(said) + "\n")
        answers.flush()


if __name__ == "__main__":
    quicken()
    answer()
