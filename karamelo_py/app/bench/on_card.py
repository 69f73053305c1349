"""karamelo-py bench --gpu."""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from time import perf_counter
from typing import Any, NamedTuple

from karamelo_py.app.bench.apart import grown
from karamelo_py.app.bench.measure import (
    REPETITIONS,
    WORKLOADS,
    Solved,
    build,
    timed_steps,
    traffic,
)
from karamelo_py.kernels.gpu import OTHERS, STAGES

USUAL = ("disks-320", "disks-320-mls-single", "block-3d-mls-single", "block-3d-mls", "bar-3d-ul")
MOST = 200  # steps per repetition, few enough that no point leaves in five repetitions
SIZES = (1e6, 4e6, 16e6)  # numbers of points, unless variables are set


class OnCard(NamedTuple):
    points: int
    speeds: list[float]
    bytes_per_particle_step: float  # memory traffic without caches
    roofline: float  # fraction of the memory bandwidth at the best speed
    bytes_on_card: int
    stages: dict[str, float]
    made: float  # seconds to compile the step
    precision: str

    best, median, record = Solved.best, Solved.median, Solved.record


def sizes_of(name: str, presets: Mapping[str, str]) -> Iterator[dict[str, str]]:
    if {"N", "coarser"} & {*presets}:
        yield dict(presets)
        return
    count = build(WORKLOADS[name], 1, presets).count
    for size in SIZES:
        ((variable, value),) = grown(WORKLOADS[name].script, presets, size / count).items()
        yield {**presets, variable: f"{float(value):.6g}"}


def measured(
    name: str, presets: Mapping[str, str], card: Any, copied: float, seconds: float
) -> OnCard:
    simulation = build(WORKLOADS[name], 1, presets, card=card)
    begun = perf_counter()
    simulation.compile()
    made = perf_counter() - begun
    per_step = traffic(simulation)[0]
    timed_steps(simulation, WORKLOADS[name].lead + 5)
    count = min(max(5, int(seconds / REPETITIONS / (timed_steps(simulation, 20) / 20))), MOST)
    rates = [simulation.count * count / timed_steps(simulation, count) for _ in range(REPETITIONS)]
    steps = simulation.launches()
    stages: dict[str, float] = defaultdict(float)
    for launch, spent in steps.seconds_of_step():
        stages[STAGES.get(launch.name, OTHERS)] += spent
    result = OnCard(
        simulation.count, rates, per_step, max(rates) * per_step / copied, steps.images.size,
        dict(sorted(stages.items(), key=lambda item: -item[1])), made,
        simulation.hub.settings.precision,
    )  # fmt: skip
    steps.images.close()
    return result


def say(name: str, one: OnCard, presets: Mapping[str, str]) -> None:
    words = ", ".join(f"{variable} = {value}" for variable, value in presets.items())
    print(f"\n{name}: {WORKLOADS[name].title}; {words}; {one.points} points, {one.precision}")
    print(
        f"  {'particle-steps/s':<38} {one.best / 1e6:8.1f} million (median {one.median / 1e6:.1f})"
    )
    print(f"  {'bytes moved per particle-step':<38} {one.bytes_per_particle_step:8.0f}")
    print(f"  {'fraction of the memory bandwidth':<38} {100 * one.roofline:8.1f} %")
    print(f"  {'memory of the GPU':<38} {one.bytes_on_card / 1e9:8.2f} GB")
    print(f"  {'compilation':<38} {one.made:8.1f} s")
    for stage, spent in one.stages.items():
        print(f"    {stage:<38} {1e9 * spent / one.points:6.3f} ns")
    print(f"    {'a step':<38} {1e9 / one.best:6.3f} ns", flush=True)
