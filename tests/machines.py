"""A process that takes cases of a study from a Dask scheduler."""

import asyncio
import os

from distributed import Worker

from karamelo_py.app.studies import case, warm


def work(address, place, python):
    """Be a Dask worker, with folders and a cache of its own; `python` starts runs."""
    os.chdir(place)
    os.environ |= {"KARAMELO_PY_CACHE": f"{place}/cache", "NUMBA_DISABLE_JIT": "1"}
    case.PROGRAM[0], warm.TRIES = python, 0

    async def working():
        async with Worker(address, nthreads=1, local_directory=place) as worker:
            await worker.finished()

    asyncio.run(working())
