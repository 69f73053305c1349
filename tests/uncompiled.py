"""Runs scripts without compiling anything: the same Python sources, interpreted.

Started by a fixture of conftest.py as a process of its own (``NUMBA_DISABLE_JIT=1`` must be set
before Numba is imported). Tells where its package lies, then reads one JSON request a line and
answers with one JSON line.
"""

import contextlib
import ctypes
import functools
import gc
import io
import json
import os
import sys
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

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
            arrays = final_columns(script, columns)
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


def remembered(entry: Callable) -> Callable:
    """Keep what is found of the nodes of the last stencil: each task and quantity asks for it.

    Numbers of nodes are those of a grid, or of a box of it. Ranks are threads that take turns.
    """
    last: tuple = None, None, {}

    def found(basis, kin, grid, stencil, k):
        nonlocal last
        mine = last
        if mine[0] is not stencil or mine[1] is not grid:
            mine = last = stencil, grid, {}
        known = mine[2]
        if k not in known:
            known[k] = entry(basis, kin, grid, stencil, k)
        return known[k]

    return found


def main() -> None:
    """Serve requests until the input ends."""
    requests, answers = sys.stdin, sys.stdout
    import karamelo_py
    from karamelo_py.points.basis import product

    # Before the bases are there, which register it: a tenth of what steps take.
    product._entry_product = remembered(product._entry_product)
    from karamelo_py.app import cli
    from karamelo_py.run import loop  # noqa: F401

    cli._parser = functools.cache(cli._parser)  # a third of what a tiny scene takes
    gc.freeze()  # scenes make many objects, among which alone cycles have to be looked for
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
        answer = {"status": status, "out": out.getvalue(), "err": err.getvalue()}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
