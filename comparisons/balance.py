"""python -m comparisons.balance [SCENE ...] [--full]: energy and momentum of all scenes of inputs/.

Writes docs/balance.md. Without --full the first run of each, 3000 steps of it at most (fewer of
many points, 10 of implicit schemes). Scenes that are not named keep what the page said about them
before.
"""

import argparse
import re
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from karamelo_py import Simulation
from karamelo_py.advice import energy
from karamelo_py.points.kinematics import Axisymmetric
from karamelo_py.points.laws import is_rigid
from karamelo_py.run.energy import unknown_work
from karamelo_py.styles.fixes.rigid_body import contacts_of

ROOT = Path(__file__).parent.parent
INPUTS, PAGE = ROOT / "inputs", ROOT / "docs" / "balance.md"
STEPS, FEWEST, LOAD_STEPS = 3000, 60, 10
WORK = 2_000_000  # points times steps
CLOSES = 1.0  # per cent
RUN = re.compile(r"^ *run(_time)?\((.*?)(?:, *on_trouble.*)?\) *$", re.M)
HEAD = """# Balances of energy and momentum

This table shows how well each scene of `inputs/` conserves energy and momentum.
`python -m comparisons.balance` writes it. It takes the first run of each scene, with at most 3000
steps, and fewer for more than 700 points. With `--full` it takes the whole run.

| column | meaning |
|---|---|
| energy | change of kinetic, stored and dissipated energy less the work of the loads |
| momentum | change of the momentum of points that are not rigid, less the impulses on them |
| why | the cause of an energy that changes by more than 1 %, as the program names it |

Energy is relative to the largest energy ([monitor](energy.md#energy-monitor)). Momentum is relative
to the largest impulse or to sqrt(2 m E), with the largest kinetic energy E. In axisymmetric scenes
it is the momentum along the axis. Implicit steps have no value for the momentum, because their
forces are only known at the end of a step. Impulses are from fixes and rigid solids.

| scene | steps | energy | momentum | why |
|---|---|---|---|---|
"""


class Balance(NamedTuple):
    """What is left of the balances of a scene, in per cent of the largest; NaN where unknown."""

    steps: int
    energy: float
    momentum: float
    why: str


def outer_forces(hub: Any) -> dict[str, float]:
    """Names of the forces on the points that are not rigid, and by what they count."""
    solids = list(hub.solids.values())
    rigid = [s for s in solids if is_rigid(s.material.law)]
    masses = {s.id: float(np.sum(np.broadcast_to(s.mass, s.count))) for s in solids}
    # Weight is published with that of rigid bodies where they have nodes of their own.
    own = rigid if hub.update.method.fields_per_solid else []
    soft = 1 - sum(masses[s.id] for s in own) / sum(masses.values())
    names = {
        fix.id: soft if fix.accelerates else 1.0
        for fix in hub.fixes.values()
        if {"x", "y", "z"} <= set(fix.published) and not fix.solids and fix.hooks()
        if not (fix.leads_points and any(map(fix.group.touches, rigid)))
    }
    for solid in rigid:
        if f"ContactForce_{solid.id}_x" in hub.values:
            names[f"ContactForce_{solid.id}"] = -1.0
        else:
            names |= {touch.id: 1.0 for touch in contacts_of(hub) if touch.touches is solid}
    return names


def run(sim: Simulation, script: Path, full: bool) -> None:
    """Take the first run of a script, or as much of it as there is time for."""
    if full:
        sim.run()
        return
    found = RUN.search(script.read_text("utf-8"))
    end = float(sim.evaluate(found[2])) if found else 1e300
    count = sum(solid.count for solid in sim.hub.solids.values())
    implicit = getattr(sim.hub.update.scheme, "implicit", False)
    most = LOAD_STEPS if implicit else max(min(STEPS, WORK // count), FEWEST)
    if found and not found[1]:
        sim.run(min(int(end), most))
        return
    sim.command(f"run_while(timestep < {most} && time < {end * (1 - 1e-9)!r})")


def measure(script: Path, *, full: bool = False) -> Balance:
    """Run a scene; what is left of its balances."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sim = Simulation(script)
        hub = sim.hub
        d, forces = hub.domain.dimension, outer_forces(hub)
        soft = [s.id for s in hub.solids.values() if not is_rigid(s.material.law)]
        sim.command(f"""
            region(of_balance, block, {", ".join(["INF"] * 2 * d)})
            group(of_balance, particles, region, of_balance, solid, {", ".join(soft)})
            compute(p_balance, linear_momentum, of_balance)
            compute(E_balance, kinetic_energy, of_balance)
            set_output(1)
        """)
        names = [f"{one}_{a}" for one in forces for a in "xyz"]
        columns = ["time", *(f"p_balance_{a}" for a in "xyz"), "E_balance", *names]
        sim.log_modify("custom", *columns)
        run(sim, script, full)
    simulation, log = hub.simulation, sim.log
    dt = np.diff(log["Time"])
    kick = 0.5 * (np.concatenate([dt[:1], dt[:-1]]) + dt)[:, None]
    p = np.stack([log[f"p_balance_{a}"] for a in "xyz"], axis=1)
    push = sum(
        (
            share * np.stack([log[f"{one}_{a}"] for a in "xyz"], axis=1)
            for one, share in forces.items()
        ),
        np.zeros_like(p),
    )
    impulse = np.cumsum(kick * push[1:], axis=0)
    axes = [1] if isinstance(simulation.kin, Axisymmetric) else list(range(d))
    left = np.abs(p[-1] - p[0] - impulse[-1])[axes].max()
    mass = sum(
        block.points.mass.sum() for block in simulation.setup.blocks if not is_rigid(block.laws)
    )
    size = max(np.sqrt(2 * mass * log["E_balance"].max()), np.abs(impulse).max())
    watched = simulation.control.energy[0].watch_energy
    lost = simulation.energy_watch.lost_fraction() if watched else np.nan
    # Forces of implicit steps are those of their ends.
    momentum = np.nan if simulation.implicit else 100 * left / size if size else 0.0
    return Balance(len(dt), -100 * lost, momentum, why(hub, simulation, lost))


def why(hub: Any, simulation: Any, lost: float) -> str:
    """The program's own words on energy that is not kept, or not known."""
    if not simulation.moves:
        return "load steps have no inertia"
    if unknown := unknown_work(hub):
        return f"energy {energy.not_watched(unknown)}"
    if abs(100 * lost) <= CLOSES:
        return ""
    if lost < 0:
        return energy.cause_of_gain(hub, simulation)[0]
    return " and ".join(energy.taken_by(hub)) or energy.cause_of_loss(hub)[0]


def main() -> None:
    """Run the scenes, write the page."""
    parser = argparse.ArgumentParser(prog="python -m comparisons.balance", description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="all, if none is named")
    parser.add_argument("--full", action="store_true", help="whole runs")
    options = parser.parse_args()
    there = sorted(path.name.removeprefix("in.") for path in INPUTS.glob("in.*"))
    text = PAGE.read_text("utf-8") if PAGE.exists() else ""
    rows = {line.split("`")[1]: line for line in text.splitlines() if line.startswith("| `in.")}
    for name in options.scenes or [name for name in there if name != "element"]:
        one = measure(INPUTS / f"in.{name}", full=options.full)
        of_energy = f"{one.energy:+.2f} %" if one.energy == one.energy else ""
        of_momentum = f"{one.momentum:.2g} %" if one.momentum == one.momentum else ""
        row = f"| `in.{name}` | {one.steps} | {of_energy} | {of_momentum} | {one.why} |"
        print(row, flush=True)
        rows[f"in.{name}"] = row
        PAGE.write_text(HEAD + "\n".join(rows[key] for key in sorted(rows)) + "\n", "utf-8")


if __name__ == "__main__":
    main()
