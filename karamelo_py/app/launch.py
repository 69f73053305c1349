"""One scene on several processes: how they are started, and what each may say."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from karamelo_py.run.crew import INSTALL, Crew, launched
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

# What Open MPI is told: more processes than cores are the user's choice, each has threads of its
# own, and a container's root may start it.
OPEN_MPI = {
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "PRTE_MCA_hwloc_default_binding_policy": "none",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}


def launch(ranks: int) -> int:
    """Run this command line on so many processes of this machine; returns the exit status.

    Raises
    ------
    ScriptError
        If there is no mpiexec, or no mpi4py.
    """
    beside = Path(sys.executable).parent / "mpiexec"
    mpiexec = str(beside) if beside.exists() else shutil.which("mpiexec")
    if mpiexec is None:
        raise ScriptError(f"--ranks {ranks}: there is no mpiexec here", hint=INSTALL)
    try:
        import mpi4py  # noqa: F401
    except ImportError:
        raise ScriptError(f"--ranks {ranks} needs mpi4py", hint=INSTALL) from None
    command = [mpiexec, "-n", str(ranks), sys.executable, "-m", "karamelo_py.app.cli"]
    environment = {**OPEN_MPI, **os.environ}
    return subprocess.run([*command, *sys.argv[1:]], env=environment, check=False).returncode


def join(asked: int | None) -> Crew:
    """Join the processes that mpiexec has started; all but the first keep silent.

    Raises
    ------
    ScriptError
        If there are not as many as asked for, or mpi4py is missing.
    """
    size, rank = launched()
    if rank > 0:
        sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    if asked is not None and asked != size:
        raise ScriptError(
            f"--ranks {asked}: mpiexec has started {size} processes",
            expected="one of the two: mpiexec -n N, or --ranks N",
        )
    return Crew()


def share(hub: Hub, crew: Crew) -> None:
    """Let a scene be stepped by all processes of the crew; the first writes."""
    settings = hub.settings
    settings.crew, settings.engine = crew, "ranks"
    if settings.threads is None:
        settings.threads = max(1, (os.cpu_count() or 1) // crew.size)
    if not crew.leads:
        hub.output.writes = False
        hub.output.log.rows = []
