"""The scenes that karamelo-py bench times, as workloads.toml lists them."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

MOST_STEPS = 2500  # in these scenes nothing leaves the domain before


class Workload(NamedTuple):
    """A scene to be timed."""

    title: str
    script: str
    # Steps before the measuring begins.
    lead: int = 3
    # Published million particle-steps a second of Karamelo (C++) on one core of a small AMD EPYC.
    karamelo: float | None = None


def _read() -> dict[str, Workload]:
    path = Path(__file__).with_suffix(".toml")
    found = tomllib.loads(path.read_text(encoding="utf-8"))
    texts = found["scenes"]

    def workload(
        title: str, scenes: Sequence[str], variables: Mapping[str, str | int],
        method: str = "ulmpm, FLIP, linear, 1", scheme: str = "musl", precision: str = "double",
        **rest,
    ) -> Workload:  # fmt: skip
        lines = [f"precision({precision})", f"method({method})", f"scheme({scheme})"]
        for name, value in variables.items():
            lines.append(f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {value}")
        return Workload(title, "\n".join([*lines, *(texts[name] for name in scenes)]), **rest)

    return {name: workload(**each) for name, each in found["workloads"].items()}


WORKLOADS = _read()
