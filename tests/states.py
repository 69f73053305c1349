"""The exact state at the end of a script: every bit of what the points carry."""

import io
from collections.abc import Iterable
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from comms import together

from karamelo_py.app.launch import share
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.mpi.comm import MpiComm
from karamelo_py.scene.hub import Hub


def final_hub(
    script: Path,
    threads: int | None = None,
    comm: MpiComm | None = None,
    folder: Path | None = None,
) -> Hub:
    """The hub after a script has run, where a comm is given as one of its ranks."""
    # Of several processes the first alone says something.
    silent = None if comm is None or comm.leads else io.StringIO()
    hub = Hub(Console(quiet=True, err=silent))
    hub.settings.threads = threads
    if comm is not None:
        share(hub, comm)
    # Others write logs at the same time.
    hub.folder = folder or Path(mkdtemp(dir=Path(script).parent))
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_file(str(script))
    return hub


def final_columns(
    script: Path, names: Iterable[str], folder: Path | None = None
) -> dict[str, np.ndarray]:
    """Columns of all points by id, in full precision; `work` and `balance` are the watch's."""
    hub = final_hub(script, folder=folder)
    energy = hub.simulation.control.energy[0]
    watched = {"work": energy.work, "balance": energy.balance}
    return {n: watched[n] if n in watched else hub.fields.particle(n) for n in names}


def final_state(
    script: Path, threads: int | None = None, ranks: int = 1, folder: Path | None = None
) -> dict[str, np.ndarray]:
    """The state of the hub after a script has run; files are kept in `folder`, if any."""
    if ranks == 1:
        return state_of(final_hub(script, threads, folder=folder))
    return together(ranks, lambda comm: state_of(final_hub(script, threads, comm, folder)))[0]


def state_of(hub: Hub) -> dict[str, np.ndarray]:
    """Arrays of all points by id, and the clock."""
    state = hub.simulation.state()
    arrays = {
        "x": state.places.T,
        "v": state.v.T,
        "time": np.array([hub.update.time, hub.update.step]),
    }
    arrays["mass"] = hub.fields.mass
    nodes = hub.fields.node("mass")
    arrays["nodal mass"] = nodes.sum()
    arrays |= {"-".join(k.__name__ for k in kind): a.T for kind, a in state.laws.items()}
    arrays |= {getattr(kind, "__name__", kind): a.T for kind, a in state.fields.items()}
    return arrays


def same_bits(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> bool:
    """Whether two states agree in every bit; an assertion names the field that does not."""
    assert a.keys() == b.keys()
    for name in a:
        assert np.isfinite(a[name]).all(), name
        assert a[name].dtype == b[name].dtype
        difference = np.abs(a[name] - b[name]).max(initial=0)
        assert a[name].tobytes() == b[name].tobytes(), f"{name} differs by up to {difference}"
    return True
