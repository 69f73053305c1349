"""method ulmpm/contacts."""

from collections.abc import Iterator, Sequence
from math import prod
from typing import NamedTuple

import numpy as np

from karamelo_py.kernels.contact import MEMORY, SeparateFields
from karamelo_py.points.basis.surface import surface_table
from karamelo_py.points.laws import (
    can,
    conductivity,
    constrained_velocity,
    heat_capacity,
    law_kind,
    law_traits,
    specific_volume,
)
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import Lattice, numbered
from karamelo_py.scene.modify import Fix, moved
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.methods.base import Method, publish_loads, slots_of_loads


def fields(hub: Hub) -> list[int]:
    numbers: dict[str, int] = {}
    for solid in hub.solids.values():
        other = solid.glued_to
        numbers[solid.id] = (
            max(numbers.values(), default=-1) + 1 if other is None else numbers[other.id]
        )
    return list(numbers.values())


def flows(law: NamedTuple) -> bool:
    traits = [law_traits(kind) for kind in law_kind(law)]
    return any(of.flows or of.any_speed for of in traits)


def heat_fractions(laws: Sequence[NamedTuple], *, conducting: bool) -> np.ndarray:
    """Return the fraction (F, F) of frictional heat that goes into the first of two solids.

    With conduction, the fraction follows from the effusivities sqrt(kappa rho cp), as between
    half-spaces (Carslaw & Jaeger 1959, section 2.15). Otherwise the fraction is 1/2, or 0 without a
    temperature.
    """
    takes = np.array([float(heat_capacity(law, 1.0)) > 0 for law in laws], float)
    root = [conductivity(law, 1.0) * heat_capacity(law, 1.0) / specific_volume(law) for law in laws]
    if conducting and max(root) > 0:
        takes = np.sqrt(root)
    total = takes[:, None] + takes[None, :]
    return np.where(total > 0, takes[:, None] / np.where(total > 0, total, 1), 0.5)


class ULMPMContacts(Method):
    """Updated Lagrangian MPM with contact: a velocity field on the grid for each solid.

    Solids push each other along their common normal once the gap is closed, and separate freely.
    Contact is frictionless without fix contact/friction. Contact does not move rigid solids, unless
    they have a fix rigid_body.

    Example
    -------
    method(ulmpm/contacts, FLIP, linear, 0.99)

    Notes
    -----
    Publishes the contact force on every solid ID (the sum of m dv/dt over its nodes) as
    ContactForce_ID_x, ContactForce_ID_y, ContactForce_ID_z, and its torque about the origin as
    ContactTorque_ID_x and so on. Glued solids have one field and one force.

    The gap at a node is computed from the mean position of the points around it, assuming that the
    outermost points are half their size below the surface (Nairn 2013, "Modeling imperfect
    interfaces in the material point method using multimaterial methods"). The gap is exact for
    plane surfaces along the grid. Solids with curved or inclined faces have cut points (points=cut)
    by default, since whole squares make it stair-stepped, and a block on a slope of 20 degrees
    sticks. With bernstein-quadratic, contact begins as soon as two solids have mass at one node.

    Contact is inelastic at the nodes of a surface: colliding bars of 4, 8 and 16 cells lose 15, 11
    and 4 % of the kinetic energy. The summary of a run names this energy (``lost by contact``), as
    does compute contact_loss.

    For a fixed base, use a rigid solid, or a solid with fix velocity_nodes for all components at
    all corners of its cells. With splines the base should be three cells thick: the surface of a
    thinner one appears higher by up to a quarter of a cell.

    Walls one cell thick contain liquids and granular materials, even if they have corners, are
    inclined or move: points of sand penetrated fixed walls by at most 10 % of a cell in 1e5 steps,
    gel by 15 %, and water in 2e4 steps by 5 % (FLIP 0.99), 16 % (APIC), 20 to 27 % (moving walls)
    and 30 to 46 % (FLIP 1, which retains noise). For 100 steps after contact at
    a node, sand there does not approach the wall, and liquids close 1 % of a gap per step.

    The two solids at a node have a common normal, so momentum is conserved. The normal is computed
    from the sums of m grad N of both solids, averaged over neighbouring nodes with the weights 1/4,
    1/2, 1/4 along each axis. The solid whose sums vary less has more weight, so a face outweighs a
    corner. If the velocity of a solid is prescribed, only the normal of this solid is used, except
    at the end of its face. Solids with a gap between them along a grid axis are not in contact.

    At a node of more than two solids, the impulses of all approaching pairs are computed from the
    same velocities, with reduced impulses for solids in several pairs; up to 16 such passes remove
    the remaining approach. The order of the solids has no effect. Contact does not move nodes held
    by fix velocity_nodes, whose reaction includes the impulse.

    Bardenhagen, Guilkey, Roessig, Brackbill, Witzel & Foster 2001, "An improved contact algorithm
    for the material point method and application to stress propagation in granular material".

    See Also
    --------
    fix contact/friction, ulmpm
    """

    fields_per_solid = True
    _prescribed: np.ndarray | None = None

    def lattices(self, hub: Hub) -> list[Lattice]:
        domain = hub.domain
        box = domain.dimension, domain.lo, domain.hi, domain.h
        return numbered([self._lattice(*box) for _ in range(max(fields(hub), default=0) + 1)])

    def rigid_fields(self, hub: Hub) -> np.ndarray:
        pairs = zip(hub.solids.values(), fields(hub), strict=True)
        rigid = {field for solid, field in pairs if solid.rigid}
        count = max(fields(hub), default=-1) + 1
        return np.isin(np.arange(count if rigid else 0), list(rigid))

    def lattice_of(self, hub: Hub, solid: Solid) -> int:
        return fields(hub)[solid.index]

    def welcome(self, hub: Hub, solid: Solid) -> None:
        publish_loads(hub, solid)

    def held_with(self, hub: Hub, nodes: np.ndarray) -> np.ndarray:
        """Return `nodes`, and the nodes that points reach from cells with all corners in `nodes`.

        Splines and domains reach more nodes; if these were free, the contact normal would rotate.
        """
        if self.basis.traits.cells == 1 and not self.basis.traits.shape:
            return nodes
        of = np.array(fields(hub))
        solids = list(hub.solids.values())
        united = nodes
        for k, lattice in enumerate(hub.lattices[: max(of, default=-1) + 1]):
            places = np.concatenate([solids[i].x0 for i in np.flatnonzero(of == k)])
            cells = np.unique(lattice.cells_of(places), axis=0)
            if np.isin(lattice.around(cells, range(2)), nodes).all():
                united = np.union1d(united, lattice.around(cells, range(-1, 3)))
        return united

    def contact_between(self, hub: Hub, lattices: Sequence[Lattice]) -> NamedTuple:
        count, d = len(lattices), hub.domain.dimension
        unknown = len(hub.domain.kin.Unknown._fields)
        shape = lattices[0].shape[:d]
        nodes = sum(lattice.node_count for lattice in lattices)
        h = hub.domain.h
        first: dict[int, Solid] = {}
        copies: list[tuple[int, int]] = []
        for solid, field in zip(hub.solids.values(), fields(hub), strict=True):
            if first.setdefault(field, solid) is not solid:
                both = (slots_of_loads(hub, one) for one in (first[field], solid))
                copies += zip(*both, strict=True)
        laws = [first[k].material.law for k in range(count)]
        slots = np.array([slots_of_loads(hub, first[k]) for k in range(count)])
        return SeparateFields(
            stride=lattices[0].node_count,
            beside=np.array([(prod(shape[k + 1 :]), shape[k]) for k in range(d)]),
            per_mass=np.array([specific_volume(law) for law in laws]) / h ** (d - 1),
            friction=np.zeros((count, count)),
            warmth=heat_fractions(laws, conducting=hub.update.thermal),
            pair=np.full((count, count), -1, np.int64),
            slot=slots[:, 0].copy(),
            copies=np.array(copies, np.int64).reshape(-1, 2),
            # Memory pages cost nothing until they are written.
            touched=np.zeros((nodes, count), np.int32),
            prescribed=np.zeros((nodes, unknown), np.int32),
            reactions=np.zeros(1 + len(hub.values.array), np.int64),
            forces=np.zeros(1 + len(hub.values.array), np.int64),
            places=np.zeros(nodes, np.int64),
            number=np.zeros((lattices[0].node_count, 1), np.int64),
            meeting=np.zeros(count, np.int64),
            partners=np.zeros(count, np.int64),
            change=np.zeros((count, unknown)),
            rigid=np.array([can(law, constrained_velocity) for law in laws]),
            free=np.array([first[k] in moved(hub) for k in range(count)]),
            torque=slots[:, 1].copy(),
            torques=hub.values.torques,
            memory=np.array([MEMORY if flows(law) else 1 for law in laws]),
            fluid=np.array([any(law_traits(k).fluid for k in law_kind(law)) for law in laws]),
            surface=np.array(
                [surface_table(self.basis, first[k].half_size.mean() / h) for k in range(count)]
            ),
        )

    def begin(self, hub: Hub, contact: NamedTuple) -> None:
        contact.friction[:] = 0
        contact.pair[:] = -1
        for (a, b), fix in self._rubbing(hub):
            contact.friction[a, b] = contact.friction[b, a] = fix.friction
            contact.pair[a, b] = hub.values.slot(f"{fix.id}_x")
        published = [*contact.slot, *contact.torque, *contact.pair[contact.pair >= 0]]
        turning = hub.values.torques[published]
        published += list(turning[turning > 0])
        contact.forces[: 1 + len(published)] = [len(published), *published]
        fixes = [fix for fix in hub.fixes.values() if fix.prescribes_velocity]
        slots = [hub.values.slot(f"{fix.id}_x") for fix in fixes]
        rotating = [fix for fix in hub.fixes.values() if fix.prescribes_rotation]
        torques = [hub.values.slot(f"{fix.id}_s") for fix in rotating]
        published = [*slots, *(-slot for slot in torques)]
        contact.reactions[: 1 + len(published)] = [len(published), *published]
        prescribed: np.ndarray = contact.prescribed
        if self._prescribed is prescribed:
            prescribed[:] = 0
        self._prescribed = prescribed if published else None
        for fix, slot in zip(rotating, torques, strict=True):
            prescribed[fix.nodes, -1] = 1 + slot
        for fix, slot in zip(fixes, slots, strict=True):
            nodes = slice(None) if fix.group.all else fix.nodes
            for k, formula in enumerate(fix.formulas):
                if formula is not None:
                    prescribed[nodes, k] = 1 + slot

    def remembered(self, contact: NamedTuple, spans: np.ndarray) -> list[np.ndarray]:
        """Return views of `touched`, which usf and usavg read at the start of a step."""
        return [contact.touched[begin:end] for begin, end in spans]

    def resume(self, contact: NamedTuple, before: NamedTuple) -> None:
        """Continue from the contact state `before`; fields of new solids come last."""
        if contact.stride == before.stride:
            fields = before.touched.shape[1]
            touched = np.flatnonzero(before.touched.any(axis=1))
            contact.touched[touched, :fields] = before.touched[touched]

    def check(self, hub: Hub) -> None:
        super().check(hub)
        by_pair: dict[frozenset, Fix] = {}
        for pair, fix in self._rubbing(hub):
            other = by_pair.setdefault(frozenset(pair), fix)
            if other is not fix:
                first, second = (solid.id for solid in fix.solids)
                line = f" (line {other.mark.line})" if other.mark else ""
                raise ScriptError(
                    f"the friction of solids '{first}' and '{second}' is already set by fix "
                    f"'{other.id}'{line}",
                    mark=fix.mark,
                    expected="one fix contact/friction for each pair of solids (solids "
                    "glued together count as one)",
                    hint=f"fix({other.id}, contact/friction, {first}, {second}, ...) replaces it",
                    command=f"fix {fix.style}",
                )

    @staticmethod
    def _rubbing(hub: Hub) -> Iterator[tuple[tuple[int, int], Fix]]:
        of = fields(hub)
        for fix in hub.fixes.values():
            if fix.friction is not None:
                first, second = fix.solids
                yield (of[first.index], of[second.index]), fix
