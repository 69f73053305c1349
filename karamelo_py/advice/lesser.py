"""Suggestions of `check`: fewer dimensions, or half of the body, would suffice."""

from collections.abc import Callable, Iterator
from math import prod
from typing import NamedTuple

import numpy as np

from karamelo_py.advice.basics import is_zero
from karamelo_py.advice.loads import (
    AXES,
    Roller,
    Words,
    acting,
    acts_alike,
    alike,
    cells,
    cost,
    depends,
    extent,
    given,
    rollers,
    to_change,
)
from karamelo_py.advice.round import round_bodies
from karamelo_py.kernels.laws import law_on
from karamelo_py.points.kinematics import KINEMATICS, Space, free_from
from karamelo_py.points.kinematics.twist import Twisted
from karamelo_py.points.laws import (
    can,
    initial_state,
    is_round,
    law_parts,
    law_traits,
    wave_speed_squared,
)
from karamelo_py.points.laws.leaning import leans
from karamelo_py.points.laws.placed import names_in, place_of
from karamelo_py.points.laws.thin import Thin
from karamelo_py.scene.domain import THIN as THIN_BODY
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid

NO_LAYERS = 0, (0.0, 0.0)
SAMPLES = 1000  # positions tested to find whether a solid is a prism
THIN = 0.2  # thickness / smallest width of a plate in plane stress


def lesser_models(hub: Hub, _: object = None) -> Words:
    held = rollers(hub)
    for rule in (_flat, _bar, _thin):
        if suggestions := list(rule(hub, held)):
            yield from suggestions
            break
    yield from round_bodies(hub, held)
    yield from _mirrored(hub)


def _flat(hub: Hub, held: dict[int, Roller]) -> Words:
    domain = hub.domain
    d = domain.dimension
    if d == 1 or len(hub.lattices) > 1 or isinstance(domain.kin, Twisted) or domain.across:
        return
    round_ = domain.kin.hoops > 0
    whole = "thickness" if d == 3 else "length" if round_ else "cross-section"
    counts: dict[int, int] = {}  # number of layers by direction
    for k in range(free_from(domain.kin), d):
        rest = [axis for axis in range(d) if axis != k]
        layers, faces = _layers(hub, k, rest) if _moves_nothing(hub, [k]) else NO_LAYERS
        # A radial scene would cost as much as one or two layers of points.
        if layers > (2 if round_ else 0) and _faces_held(hub, k, *faces):
            several = [axis for axis in rest if axis not in counts]
            if several and acts_alike(hub, several):
                counts[k] = layers
    while counts and _leans(hub, rest := [axis for axis in range(d) if axis not in counts]):
        del counts[min(counts)]
    if not counts:
        return
    many = prod(counts.values())
    named = " and ".join(AXES[k] for k in counts)
    whole = whole if len(counts) == 1 else "cross-section"
    kind = "plane strain" if len(rest) == 2 else "a line"
    yield (
        f"all solids are uniform along {named}, and nothing moves in this direction: "
        f"{many} times the points of {kind}{cost(hub, many, len(rest))}, which has the forces and "
        f"energies of a {whole} of 1",
        _domain_of(hub, rest) + (", and cylindrical(true)" if round_ else ""),
    )


def _domain_of(hub: Hub, rest: list[int], more: str = "") -> str:
    """Return the line of a domain that has only the directions `rest`."""
    domain = hub.domain
    ends = [f"{domain.lo[axis]:g}, {domain.hi[axis]:g}" for axis in rest]
    line = f"dimension({len(rest)}, {', '.join(ends)}, {domain.h:g}){more}"
    if rest == list(range(len(rest))):
        return line
    axes = " and ".join(AXES[axis] for axis in rest)
    return f"{line}, with {axes} called {' and '.join(AXES[: len(rest)])}"


def _bar(hub: Hub, held: dict[int, Roller]) -> Words:
    """Suggest 1D for prisms along an axis whose sides are free or symmetry planes."""
    if hub.domain.dimension < 3 or _flows(hub):
        return
    solids = [solid for solid in hub.solids.values() if solid.count]
    x0 = np.concatenate([solid.x0 for solid in solids])
    lo, hi = extent(solids)
    size = hi - lo
    for k in range(3):
        rest = [axis for axis in range(3) if axis != k]
        # With a symmetry plane, the whole bar is twice as wide.
        widths = [size[axis] * (1 + (axis in held)) for axis in rest]
        if max(widths) > THIN * size[k] or not _moves_nothing(hub, rest):
            continue
        columns = {len(np.unique(cells(s.x0, s.h)[:, rest], axis=0)) for s in solids}
        prisms = all(_is_prism(solid, k, rest) for solid in solids)
        if len(columns) > 1 or not prisms or _is_led(hub, rest, held) or not acts_alike(hub, [k]):
            continue
        if _leans(hub, [k]) or not all(is_round(solid.material.whole) for solid in solids):
            continue
        volume = sum(float(solid.volume0.sum()) for solid in solids)
        length = sum(float(solid.hi[k] - solid.lo[k]) for solid in solids)
        many = len(x0) / (length / solids[0].h * solids[0].ppc)
        axes = " and ".join(AXES[axis] for axis in rest)
        area = f", and uniaxial_stress(true, area={volume / length:.6g})"
        yield (
            f"a bar with free sides, and nothing acts along {axes}: {many:.3g} times the points "
            f"of a line{cost(hub, many, 1, _longer(hub, 1))}, with the same energies to some "
            "per cent (waves shorter than a few widths are slower in the bar), and cells need not "
            "fit into the width",
            _domain_of(hub, [k], area) + to_change(hub, THIN_BODY),
        )
        return


def _thin(hub: Hub, held: dict[int, Roller]) -> Words:
    domain = hub.domain
    if domain.dimension < 3 or _flows(hub):
        return
    x0 = np.concatenate([solid.x0 for solid in hub.solids.values() if solid.count])
    for k in range(3):
        rest = [axis for axis in range(3) if axis != k]
        layers, (low, high) = _layers(hub, k, rest) if _moves_nothing(hub, [k]) else NO_LAYERS
        thickness = (high - low) * domain.h
        wide = np.ptp(x0[:, rest], axis=0).min() + thickness / max(layers, 1)
        whole = thickness * (1 + (k in held))
        if not layers or whole > THIN * wide or _is_led(hub, [k], held):
            continue
        if _leans(hub, rest) or not acts_alike(hub, rest):
            continue
        plate = "a plate with free faces, and"
        if k in held:
            plate = f"half of a plate, held in its middle plane {AXES[k]} = {held[k].at:g}, and"
        yield (
            f"{plate} nothing acts along {AXES[k]}: {layers} times the points "
            f"of plane stress{cost(hub, layers, 2, _longer(hub, 2))}, with energies equal within "
            "a few per cent, and cells need not fit into the thickness",
            _domain_of(hub, rest, f" and plane_stress(true, thickness={thickness:g})")
            + to_change(hub, THIN_BODY),
        )
        return


class Fewer(NamedTuple):
    """The scene with fewer dimensions, as seen by the rules for inclined material directions."""

    hub: Hub
    d: int


def _leans(hub: Hub, rest: list[int]) -> bool:
    """Return True if a law has directions that do not fit a scene with only the axes `rest`."""
    d = len(rest)
    for solid in hub.solids.values():
        law = solid.material.whole
        place = place_of(law)
        lost = {axis + "0" for axis in AXES[d:]} & (names_in(place.formulas) if place else set())
        # If other axes became x and y, the numbers that give directions would change.
        if can(law, is_round) and (lost or rest != [*range(d)] or leans(law, Fewer(hub, d))):
            return True
    return False


def _flows(hub: Hub) -> bool:
    laws = [law for solid in hub.solids.values() for law in law_parts(solid.material.whole)]
    return any(law_traits(law).flows for law in laws)


def _longer(hub: Hub, d: int) -> float:
    """Return the stable step of a thin body in `d` dimensions / its step in 3D."""
    ratios, space, thin = [], Space(), KINEMATICS[d]()
    for solid in hub.solids.values():
        law = law_on(solid.material.whole, solid.h, solid.T0)
        fast = wave_speed_squared(law, space, initial_state(law, space, 1.0))
        slow = wave_speed_squared(Thin(law), thin, initial_state(Thin(law), thin, 1.0))
        ratios.append(float(fast / slow) ** 0.5)
    return 1.0 if hub.update.scheme.traits.implicit else min(ratios)


def _is_led(hub: Hub, across: list[int], held: dict[int, Roller]) -> bool:
    """Return True if a fix other than a symmetry plane prescribes velocities across a thin body."""
    planes = [roller.fix for roller in held.values()]
    led = [f for f in hub.fixes.values() if f.prescribes_velocity and f not in planes]
    formulas = [fix.formulas for fix in led]
    return any(len(one) <= k or one[k] is not None for one in formulas for k in across)


def _moves_nothing(hub: Hub, across: list[int]) -> bool:
    """Return True if no fix acts in the directions `across`, or depends on positions in them."""
    named = "".join(AXES[k] for k in across)
    for fix in acting(hub):
        formulas = given(fix)
        if len(formulas) < hub.domain.dimension or not all(is_zero(formulas[k]) for k in across):
            return False
        rest = [formula for k, formula in enumerate(formulas) if k not in across]
        if any(depends(act, named) for act in (*rest, fix.wall_friction)):
            return False
    return True


def _is_prism(solid: Solid, k: int, rest: list[int]) -> bool:
    """Return True if a solid has the same section everywhere along axis `k`."""
    if solid.region is None:
        places = cells(solid.x0, solid.h)
        across, counts = np.unique(places[:, k], return_counts=True)
        columns = len(np.unique(places[:, rest], axis=0))
        return len(set(counts)) == 1 and columns * len(across) == len(places)
    d, rng = solid.domain.dimension, np.random.default_rng(1)
    lo, size = solid.lo[:d], (solid.hi - solid.lo)[:d]
    x, y = lo + size * rng.random((2, SAMPLES, d))
    y[:, rest] = x[:, rest]
    return bool((solid.region.inside(x) == solid.region.inside(y)).all())


def _layers(hub: Hub, k: int, rest: list[int]) -> tuple[int, tuple[float, float]]:
    """Return the number of equal layers along `k` and their ends in cells, or `NO_LAYERS`."""
    most, ends = 0, set()
    for solid in hub.solids.values():
        if not solid.count:
            continue
        if not _is_prism(solid, k, rest):
            return NO_LAYERS
        low, high = solid.lo[k] / solid.h, solid.hi[k] / solid.h
        most = max(most, round((high - low) * (solid.ppc or 1)))
        ends.add((round(low, 6), round(high, 6)))
    return (most, ends.pop()) if len(ends) == 1 else NO_LAYERS


def _faces_held(hub: Hub, k: int, low: float, high: float) -> bool:
    lattice = hub.lattices[0]
    fixed = np.zeros(lattice.shape, np.bool_)
    for fix in hub.fixes.values():
        if fix.prescribes_velocity and len(fix.formulas) > k and fix.formulas[k] is not None:
            fixed.ravel()[fix.nodes - lattice.first] = is_zero(fix.formulas[k])
    if fixed.all():
        return True
    planes = [(end * lattice.h - lattice.lo[k]) / lattice.spacing for end in (low, high)]
    if any(abs(plane - round(plane)) > 1e-4 for plane in planes):
        return False
    numbers = [round(plane) for plane in planes]
    inside = all(0 <= number < lattice.shape[k] for number in numbers)
    return inside and bool(fixed.take(numbers, axis=k).all())


def _mirrored(hub: Hub) -> Words:
    domain, solids = hub.domain, [solid for solid in hub.solids.values() if solid.count]
    if len(hub.lattices) > 1 or not acting(hub):
        return
    if not all(solid.region for solid in solids):
        return  # these solids may have initial velocities
    if any(can(solid.material.whole, is_round) for solid in solids):
        return  # directions of a law may change in the mirror
    for k in range(free_from(domain.kin), domain.dimension):
        ends = [(solid.x0[:, k].min(), solid.x0[:, k].max()) for solid in solids]
        middle = (min(low for low, _ in ends) + max(high for _, high in ends)) / 2
        middle = round(middle / domain.h, 9) * domain.h + 0.0
        number = (middle - domain.lo[k]) / domain.h
        rest = [axis for axis in range(domain.dimension) if axis != k]
        if abs(number - round(number)) > 1e-6 or not all(_given_alike(hub, k, rest)):
            continue

        def sides(x: np.ndarray, k: int = k, middle: float = middle) -> np.ndarray:
            folded = x.copy()
            folded[:, k] = np.abs(x[:, k] - middle)
            return folded

        if all(_both_sides(solid, sides) for solid in solids) and all(
            alike(hub, fix, sides) for fix in acting(hub)
        ):
            yield (
                f"the scene is symmetric about {AXES[k]} = {middle:g}: twice the points (unless "
                "it may buckle or break unevenly); energies are halved, and bases "
                "wider than linear change results by a few per cent on coarse grids",
                f"half of it, and the nodes at {AXES[k]} = {middle:g} held in {AXES[k]}",
            )
            return


def _given_alike(hub: Hub, k: int, rest: list[int]) -> Iterator[bool]:
    for fix in acting(hub):
        formulas = given(fix)
        rest_formulas = [formulas[j] for j in rest if j < len(formulas)]
        yield (len(formulas) <= k or is_zero(formulas[k])) and not any(
            depends(act, AXES[k]) for act in (*rest_formulas, fix.wall_friction)
        )


def _both_sides(solid: Solid, sides: Callable[[np.ndarray], np.ndarray]) -> bool:
    places = cells(sides(solid.x0), solid.h)
    return bool((np.unique(places, axis=0, return_counts=True)[1] == 2).all())
