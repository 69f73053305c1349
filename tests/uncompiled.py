"""Runs scripts without compiling anything: the same Python sources, interpreted.

Started by the fixture `interpreted` as a process of its own (``NUMBA_DISABLE_JIT=1`` must be set
before Numba is imported). Reads one JSON request a line, answers with one JSON line.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
import traceback
import warnings


def save_state(request: dict) -> int:
    """Run a script and save its final state; a failure is told, not raised."""
    import numpy as np
    from states import final_state

    try:
        np.savez(request["state"], **final_state(request["arguments"][0]))
    except Exception:
        traceback.print_exc()
        return 1
    return 0


def main() -> None:
    """Serve requests until the input ends."""
    requests, answers = sys.stdin, sys.stdout
    from karamelo_py.app.cli import main as command

    # Interpreted arithmetic warns about what compiled kernels pass over in silence.
    warnings.simplefilter("ignore")
    for line in requests:
        request = json.loads(line)
        os.chdir(request["folder"])
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            arguments = request["arguments"]
            status = save_state(request) if "state" in request else command(arguments)
        answer = {"status": status, "out": out.getvalue(), "err": err.getvalue()}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
