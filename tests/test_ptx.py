"""That everything compiles for a GPU (tests/ptx_cases.py), in a process of its own."""

import subprocess
import sys

import pytest
from conftest import TESTS


def passes(marks: str) -> None:
    words = ["-q", "-n", "0", "-m", marks, str(TESTS / "ptx_cases.py")]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *words], capture_output=True, text=True, cwd=TESTS.parent
    )
    if "skipped" in done.stdout and "passed" not in done.stdout:
        pytest.skip(done.stdout.strip().splitlines()[-1])
    assert done.returncode == 0, done.stdout[-4000:]


def test_one_of_each_family():
    passes("not full")


@pytest.mark.full
def test_all():
    passes("full")
