"""karamelo-py check: what a scene needs before it runs."""

from collections.abc import Callable
from math import inf, isfinite
from typing import Any

from karamelo_py.advice.energy import not_watched
from karamelo_py.advice.step_size import (
    own_step_instead_of,
    stable_step,
    step_after_motion,
    words_of_fraction,
    words_of_limit,
    words_of_own_step,
    words_of_solution,
)
from karamelo_py.advice.suggestions import seconds_of_step, suggestions
from karamelo_py.compiler.gpu import NoCard, card
from karamelo_py.kernels.step import Staged, rows_of
from karamelo_py.kernels.table import one_by_one, says
from karamelo_py.points.basis import support
from karamelo_py.points.laws import law_kind
from karamelo_py.points.laws.further import without_rate
from karamelo_py.run.energy import unknown_work
from karamelo_py.run.lower.card import memory_there, refusals
from karamelo_py.run.lower.memory import common, memory_of, node_fields, nodes_in_use, point_fields
from karamelo_py.run.mpi.plan import report_lines
from karamelo_py.run.no_number import endless_speed
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene import machine_memory
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material
from karamelo_py.scene.solid import words_of_volumes
from karamelo_py.script.errors import plural

LOADED = 24 << 20  # bytes of compiled loops and imported modules


def report(hub: Hub, end_time: float = inf) -> None:
    program = machine_memory.taken() - common(hub)
    simulation = hub.simulation
    simulation.begin(end_time)
    if not isfinite(simulation.fastest()):
        raise endless_speed(simulation)
    simulation.sort_if_due()
    say = hub.console.say
    s = simulation.setup
    thin = {1: "uniaxial stress", 2: "plane stress"}
    word = thin[s.kin.dimension] if hub.domain.thin else s.kin.word
    say(f"dimension      {s.kin.dimension} ({word})")
    say(f"method         {hub.update.words}")
    facts = {"points": simulation.count, "dt": simulation.dt}
    if chosen := hub.update.chosen:
        facts["chosen"] = chosen.facts
        for name, words in chosen.words.items():
            say(f"{name:<15}{words}")
    say(f"precision      {hub.settings.precision}")
    say(f"points         {simulation.count} in {len(hub.solids)} solid(s)")
    if volumes := words_of_volumes(hub):
        say(f"volumes        {volumes}")
    hub.record.begin(facts)
    lattices = hub.lattices
    shapes = ", ".join(" x ".join(map(str, lattice.shape)) for lattice in lattices[:8])
    more = ", ..." if len(lattices) > 8 else ""
    say(f"nodes          {hub.fields.node_count} ({shapes}{more})")
    tiles = simulation.tiles
    nodes = nodes_in_use(s)
    say(f"tiles          {tiles.occupied} of {tiles.count} hold points, {nodes} nodes are in use")
    if simulation.implicit:
        _say_of_equations(say, simulation, nodes)
    else:
        stable = stable_step(simulation, simulation.steps.limit)
        say(f"first dt       {simulation.dt:.6g} (stable limit {stable:.6g})")
        say(f"               {words_of_fraction(simulation)}")
        if (step := own_step_instead_of(simulation)) is not None:
            say(f"own dt         {words_of_own_step(simulation, step)}")
        say(f"limited by     {words_of_limit(simulation)}")
        if (n := (end_time - simulation.time) / simulation.steps.later_dt) < inf:
            one = seconds_of_step(hub, simulation.count)
            after = step_after_motion(simulation)
            most = f" ({n / after:.0f} if points move from the start)" if after < 1 else ""
            say(f"steps          about {n:.0f}{most}, {n * one:.1g} s or more")
            for solid in hub.solids.values():
                if solid.material.fluid is not None:
                    words = solid.material.fluid.time_scale(solid, end_time - simulation.time)
                    say(f"water          {words}")
            if words := words_of_solution(simulation, end_time - simulation.time):
                say(f"               {words}")
            slowest = max(hub.fixes.values(), key=lambda fix: fix.seconds(), default=None)
            if slowest is not None and 2 * slowest.seconds() > one:
                say(f"               most of it for fix {slowest.style} '{slowest.id}'")
    if simulation.moves:
        why = unknown_work(hub)
        say(f"energy         is {not_watched(why) if why else 'monitored'}")
    say(f"threads        {simulation.threads}")
    say("")
    say(f"{'':<34}numbers     bytes")
    for block in s.blocks:
        say(f"fields of a point of {', '.join(m.words for m in materials(hub, block))}")
        point_bytes = 0
        for name, shape, size in point_fields(block):
            say(f"  {name:<30}  {shape:<10} {size:>6}")
            point_bytes += size
        say(f"  {'together':<30}  {'':<10} {point_bytes:>6}")
    say("fields of a node")
    for name, array in node_fields(s):
        say(f"  {name:<30}  {array.shape[1]!s:<10} {array.itemsize * array.shape[1]:>6}")
    say(f"boxes of tiles {_size(tiles.box_bytes(s))}")
    memory = memory_of(simulation, s, tiles.box_bytes(s))
    say(f"memory         {_size(sum(memory))} in a run")
    say(f"               {_size(memory.copied)} of them are a copy of the last good state")
    say(f"               {_size(sum(memory) + program + LOADED)} with the program itself")
    if (machine := machine_memory.machine_memory()) is not None:
        free = _size(machine.free)
        say(f"               {free} are free on this machine, without the memory of this check")
    if hub.settings.card:
        _say_of_gpu(say, simulation)
    if hub.settings.ranks > 1:
        say("")
        for line in report_lines(simulation, hub.settings.ranks):
            say(line)
    say("")
    staged = simulation.implicit or isinstance(simulation.visits, Staged)
    say(f"stages of a step, {'one by one' if staged else 'fused'}")
    for stage in stages(hub, simulation):
        say(f"  {stage}")
    advice = suggestions(hub, simulation)
    if advice:
        say("")
        say("could be left out")
    for suggestion in advice:
        say(f"  {suggestion.reason}")
        say(f"    instead: {suggestion.cure}")
    if hub.warned:
        say("")
        say(f"{plural(len(hub.warned), 'warning')}, printed above this report")


def _say_of_gpu(say: Callable, simulation: Simulation) -> None:
    try:
        here = card()
        free, whole = map(_size, here.memory())
        about = f"{here.name}, {free} of {whole} free"
    except NoCard as error:
        about = f"none here: {error}"
    say(f"gpu            {about}")
    if next(refusals(simulation.hub, simulation.setup), None) is None:
        say(f"               {_size(memory_there(simulation))} in a run")


def _size(count: float) -> str:
    mib = count / 2**20
    return f"{mib:.0f} MiB" if mib > 100 else f"{mib:.3g} MiB"


def materials(hub: Hub, block: Any) -> list[Material]:
    used = dict.fromkeys(solid.material for solid in hub.solids.values())
    kind = without_rate(law_kind(block.laws))
    return [material for material in used if law_kind(material.law) == kind]


def _say_of_equations(say: Callable, simulation: Simulation, nodes: int) -> None:
    """Print unknowns and memory of the equations, which couple the nodes of each point."""
    s = simulation.setup
    d, reach = s.kin.dimension, round(support(s.basis, s.kin) ** (1 / s.kin.dimension)) - 1
    size = nodes * (2 * reach + 1) ** d * d * d * 8
    say(f"dt             {simulation.dt:.6g}")
    say(f"unknowns       {nodes * d} at most, and {size / 2**20:.3g} MiB of stiffness")


def stages(hub: Hub, simulation: Simulation) -> list[str]:
    acting: dict[str, list[str]] = {}
    for fix in hub.fixes.values():
        for name in fix.hooks():
            once = " (first step only)" if fix.first_step_only else ""
            acting.setdefault(name, []).append(fix.id + once)
    lines = [f"{name}: {', '.join(ids)}" for name, ids in acting.items()]
    scheme = simulation.scheme
    if simulation.implicit:
        parts = one_by_one(scheme.begin), one_by_one(scheme.close)
        words = [[t for row in rows if (t := says(row, simulation.setup))] for rows in parts]
        newton = "Newton's method: stress, tangent and linear equations, until forces balance"
        return [*words[0], newton, *words[1], *(lines or ["no fix acts between them"])]
    rows = rows_of(type(scheme), type(simulation.visits))
    first = [text for row in rows if (text := says(row, simulation.setup)) is not None]
    return [*first, *(lines or ["no fix acts between them"])]
