"""Free rigid bodies, and scenes in which they are not supported."""

from collections.abc import Sequence

import numpy as np

from karamelo_py.compiler import address_of, address_of_python
from karamelo_py.compiler.programs import BLOCK, EVALUATE, ROWS, STACK
from karamelo_py.kernels import free_bodies as kernel
from karamelo_py.kernels import rigid_motion as motion
from karamelo_py.kernels.arrays import PROGRAM, Block
from karamelo_py.kernels.contact import ListedPairs
from karamelo_py.kernels.touching import CALL
from karamelo_py.points.laws import can, constrained_velocity, is_rigid
from karamelo_py.run.lower.hooks import Programs
from karamelo_py.run.lower.links import lower_links, refusal
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import Lattice
from karamelo_py.scene.modify import moved
from karamelo_py.script.formula import evaluate_in_table
from karamelo_py.styles.fixes.rigid_body import (
    ContactRigidBody,
    RigidBody,
    bodies_of,
    contacts_of,
    surfaces_of,
)
from karamelo_py.styles.fixes.rigid_links import contacts, joints
from karamelo_py.styles.methods.base import LOADS, slots_of_loads

APART = 1e-3  # tolerated distance of a point from its position in a rigid body, in cells


def lower_bodies(hub: Hub, lattices: Sequence[Lattice]) -> kernel.FreeBodies:
    moving = bodies_of(hub)
    _refuse(hub, moving)
    nodes = sum(lattice.node_count for lattice in lattices)
    fixed = np.zeros((nodes, hub.domain.dimension), np.int32)
    for fix in hub.fixes.values():
        for k, formula in enumerate(fix.formulas) if fix.prescribes_velocity else ():
            if formula is not None:
                slot = 1 + hub.values.slot(f"{fix.id}_x")
                fixed[slice(None) if fix.group.all else fix.nodes, k] = slot
    kind = kernel.FreeBodies if hub.update.method.fields_per_solid else kernel.BodiesAtPoints
    bodies = tuple(_body(hub, fix, len(fixed)) for fix in moving)
    return kind(bodies, fixed, hub.values.torques, lower_links(hub, moving))


def _body(hub: Hub, fix: RigidBody, nodes: int) -> motion.FreeBody:
    count, d = sum(solid.count for solid in hub.solids.values()), hub.domain.dimension
    separate = hub.update.method.fields_per_solid
    pairs = nodes if separate else 1
    capacity = (nodes if separate else count * max(1, len(surfaces_of(fix)))) + 1
    soft = np.ones(count, np.bool_)
    for solid in hub.solids.values():
        if solid.rigid:
            soft[solid.first_id : solid.first_id + solid.count] = False
    surfaces = tuple(
        kernel.TouchingSurface(
            touch.region.outline(),
            touch.group.has(np.arange(count)) & soft,
            motion.records(kernel.SEEN, count),
            touch.grip_of(count),
            float(touch.mu),
            float(touch.limit),
            hub.values.slot(f"{touch.id}_x"),
            int(hub.values.torques[hub.values.slot(f"{touch.id}_x")]),
            hub.values.slot(f"{touch.id}_area"),
            address_of_python(touch.refuse, CALL),
        )
        for touch in surfaces_of(fix)
    )
    slots = fix.slots()
    if f"{LOADS[0]}_{fix.body.id}_x" in hub.values and not separate:
        first = zip(
            slots_of_loads(hub, fix.body), (motion.index_of("force"), motion.NUMBERS), strict=True
        )
        slots = np.concatenate([slots, *([(a + k, b + k) for k in range(3)] for a, b in first)])
    ends = fix.body.first_id, fix.body.first_id + fix.body.count
    listed = motion.records(motion.CONTACT, capacity)
    return motion.FreeBody(
        field=hub.update.method.lattice_of(hub, fix.body), ids=np.array(ends), dofs=fix.dofs,
        constants=fix.constants, state=fix.state, numbers=fix.numbers, slots=slots,
        formulas=_formulas(hub, fix), solution=motion.new_solution(),
        contacts=listed, words=listed.view(np.int64).reshape(capacity, -1),
        count=np.zeros(1, np.int64),
        pairs=ListedPairs(np.empty((pairs, 2), np.int64), np.empty((pairs, d)), np.empty(pairs)),
        surfaces=surfaces,
    )  # fmt: skip


def _formulas(hub: Hub, fix: RigidBody) -> motion.Formulas:
    programs, formulas = motion.records(PROGRAM, motion.FORMULAS), Programs(hub)
    programs[:] = [formulas.add(formula) for formula in fix.formulas_of_body]
    scratch = np.zeros((STACK + ROWS + 1, BLOCK))
    evaluate = address_of(evaluate_in_table, EVALUATE)
    return motion.Formulas(evaluate, programs, *formulas.tables(), scratch)


def check_bodies(hub: Hub, blocks: Sequence[Block], now: int) -> None:
    """Raise ScriptError if points of a body are not where its fix has put them.

    Warn of rigid solids that rotate without a fix, because their points move along straight lines.
    """
    count, d = sum(solid.count for solid in hub.solids.values()), hub.domain.dimension
    x, v = np.full((2, count, d), np.nan)
    for block in blocks:
        if is_rigid(block.laws):
            x[block.points.id] = block.points.x[now, :d].T
            v[block.points.id] = block.points.v[:d].T
    moving = bodies_of(hub)
    for fix in moving:
        body = fix.body
        present = x[body.first_id : body.first_id + body.count]
        away = np.abs(present - fix.rigid_positions()).max()
        if not away <= APART * hub.domain.h:  # also if NaN, as for deleted points
            message = f"points of '{body.id}' are not at the position stored by its fix"
            if np.isnan(away):
                message = f"points of '{body.id}' are missing"
            raise refusal(fix, message, "the fix that moved it, with the same ID, from the start")
    fixes = [fix for fix in hub.fixes.values() if fix.leads_points]
    for solid in hub.solids.values():
        led = solid in moved(hub) or any(fix.group.touches(solid) for fix in fixes)
        speeds = v[solid.first_id : solid.first_id + solid.count]
        speeds = speeds[np.isfinite(speeds[:, 0])]
        if not led and len(speeds) and np.ptp(speeds, axis=0).max() > APART * np.abs(speeds).max():
            hub.warn(
                f"rigid solid '{solid.id}' rotates or deforms: no fix moves it, and its points "
                "move along straight lines",
                mark=solid.mark,
                hint=f"fix(ID, rigid_body, {solid.id}, ...), or fix velocity_particles",
            )


def _refuse(hub: Hub, moving: list[RigidBody]) -> None:
    bodies = {fix.body for fix in moving}
    for touch in contacts_of(hub):
        _refuse_contact(hub, touch, bodies)
    method, solids = hub.update.method, hub.solids.values()
    rigid = [solid for solid in solids if can(solid.material.law, constrained_velocity)]
    driven = _driven(hub, moving)
    for fix in moving:
        body, apart = fix.body, method.own_grids or method.fields_per_solid
        if body.places is not fix.weighed:
            message = f"points of '{body.id}' were moved or deleted after its mass was computed"
            raise refusal(fix, message, "fix rigid_body after the commands that change the points")
        other = next((solid for solid in rigid if solid not in bodies and not apart), None)
        if other is not None:
            message = f"'{body.id}' moves freely, and rigid solid '{other.id}' on its grid does not"
            raise refusal(fix, message, "method(ulmpm/contacts, ...) or method(tlmpm, ...)")
        if any(body in (s, s.glued_to) for s in solids if s.glued_to is not None):
            raise refusal(fix, f"'{body.id}' is glued to another solid", "no GlueToSolid")
        if body not in driven and not (method.fields_per_solid and len(solids) > len(rigid)):
            hint = "velocity=(...), gravity=(...), force=(...), or fix contact/rigid_body"
            raise refusal(fix, f"no load acts on the body '{body.id}': it stays at rest", hint)
    for fix in hub.fixes.values() if moving else ():
        leads = fix.leads_points or fix.style == "initial_velocity_particles"
        led = [s for s in bodies if leads and not fix.group.all and fix.group.touches(s)]
        if led:
            message = f"fix {fix.style} also moves '{led[0].id}', which fix rigid_body moves"
            hint = "velocity=, spin=, motion= or turning= of fix rigid_body, or another group"
            raise refusal(fix, message, hint)


def _driven(hub: Hub, moving: list[RigidBody]) -> set:
    """Return the bodies that loads move, directly or through contacts and joints."""
    driven = set()
    for fix in moving:
        if fix.has_load or np.any(fix.state.v) or np.any(fix.state.spin) or surfaces_of(fix):
            driven.add(fix.body)
    links = [fix.linked for fix in (*contacts(hub), *joints(hub))]
    for joint in joints(hub):
        if joint.spring and joint.spring[2] is not None:  # initial extension of a spring
            driven.update(joint.linked)
    driven -= {None}  # None is the ground
    while more := {s for some in links if driven & set(some) for s in some} - driven - {None}:
        driven |= more
    return driven


def _refuse_contact(hub: Hub, fix: ContactRigidBody, bodies: set) -> None:
    if fix.touches not in bodies:
        hint = f"fix(ID, rigid_body, {fix.touches.id}, ...); or fix contact/surface, which moves "
        hint += "by formulas"
        raise refusal(fix, f"solid '{fix.touches.id}' has no fix rigid_body", hint)
    if hub.update.method.fields_per_solid:
        hint = "fix contact/friction for friction, or method ulmpm"
        raise refusal(fix, "ulmpm/contacts has this contact on its grid already", hint)
    other = next((body for body in bodies if not fix.group.all and fix.group.touches(body)), None)
    if other is not None:
        message = f"the group has points of '{other.id}': rigid bodies pass through each other"
        raise refusal(fix, message, "a group of points that deform")
