"""Trial calls of plug-ins in plain Python."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import numpy as np

from karamelo_py.compiler.tuples import flat, record
from karamelo_py.kernels.arrays import Nodes, Number, Points, Setup, Tag
from karamelo_py.kernels.hook_loop import WholeNodes, WholePoints
from karamelo_py.kernels.hooks import CompiledHook, Member, results
from karamelo_py.kernels.laws import law_in, law_on
from karamelo_py.kernels.views import location_at, state_at
from karamelo_py.language import registry
from karamelo_py.language.faults import as_script_error, fault, place_of
from karamelo_py.points import laws
from karamelo_py.points.basis import entry, locate, support
from karamelo_py.points.basis.product import Along, along
from karamelo_py.points.kinematics import KINEMATICS, planar, tensor, vector
from karamelo_py.points.laws import parameter
from karamelo_py.points.laws.strengths import hardening, shear_response
from karamelo_py.points.transfers import updated_velocity
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.plugins import PartInUse, attributed, foreign_parts
from karamelo_py.script.errors import plural

TENSORS = (laws.cauchy_stress, laws.kirchhoff_stress, laws.elastic_strain)
STRAINS = (0, 1e-3, 0.05)  # the last one exceeds the yield strain of metals
TRIED = 8  # number of points that are tried
NUMBERS = (laws.jacobian, laws.wave_speed_squared, laws.energy_density)


def try_parts(hub: Hub, setup: Setup) -> None:
    for solid in hub.solids.values():
        law = law_on(solid.material.law, solid.h, solid.T0)
        try_law(hub, solid.material, setup.kin, law, _one(setup))
    if registry.is_foreign(type(setup.basis)):
        _try_basis(hub, setup)
    if registry.is_foreign(type(setup.transfer)):
        plugin = _part_of(hub, [type(setup.transfer)])
        v = vector(setup.kin, (_one(setup),) * setup.kin.dimension)
        with _trial(hub, plugin):
            result = updated_velocity(setup.transfer, v, v, v)
            _expect(plugin, updated_velocity, result, len(v))
            _numbers(plugin, "updated_velocity", result, v[0])
    for fix in hub.fixes.values():
        for moment, hook in fix.hooks().items():
            if isinstance(hook, CompiledHook) and hook.tag is not None and not hook.internal:
                _try_hook(setup, fix, moment, hook)


def _samples(setup: Setup, fix: Fix, hook: CompiledHook) -> Iterator[tuple]:
    tag, kin = hook.tag(0, ()), setup.kin
    if hook.on_nodes:
        yield WholeNodes(0, planar(kin), None, _one_node(setup), None, 0.0, tag, True), kin, kin, 0
        return
    for points, table, _ in setup.blocks:
        for p in np.flatnonzero(fix.group.has(points.id))[:1]:
            args = WholePoints(tag, points.id, kin, points, table, points.x[0], ())
            yield args, *state_at(kin, points, table, p), p


def _one_node(setup: Setup) -> Nodes:
    fields = tuple(type(one)(one.array[:1].copy()) for one in setup.nodes.fields)
    return type(setup.nodes)(*(np.ones_like(a[:1]) for a in setup.nodes[:3]), fields)


def _try_hook(setup: Setup, fix: Fix, moment: str, hook: CompiledHook) -> None:
    plugin = PartInUse(f"fix {fix.style}", type(fix), fix.mark)
    says = f"{moment}: {hook.function.__name__} has to return "
    values = (1.0,) * len(fix.formulas)
    for sample, law, state, p in _samples(setup, fix, hook):
        with (
            as_script_error(plugin.name, moment, hook.function, fix.mark),
            np.errstate(all="ignore"),
        ):
            try:
                result = results(sample.tag, sample, Member(p, law, state, values, 1.0))
            except ArithmeticError:  # sample numbers may be outside the range of the law
                continue
        expected = len(hook.writes) + hook.publishes
        if not isinstance(result, tuple) or len(result) != expected:
            got = len(result) if isinstance(result, tuple) else repr(result)
            raise fault(plugin.name, f"{says}{expected} results, not {got}", plugin.mark)
        for item, new in zip(hook.writes, result, strict=False):
            size = item.shape(setup.kin) if isinstance(item, type) else setup.kin.dimension
            if (got := len(flat((new,)))) != size:
                name = item.__name__ if isinstance(item, type) else item
                message = f"{says}{plural(size, 'number')} for {name}, not {got}"
                raise fault(plugin.name, message, plugin.mark)
        if hook.publishes and len(flat(result[-1:])) > len(fix.published):
            message = f"{says}as many totals as published has names, {len(fix.published)}"
            raise fault(plugin.name, message, plugin.mark)


def _part_of(hub: Hub, kinds: Iterable[type]) -> PartInUse | None:
    return next((plugin for plugin in foreign_parts(hub) if plugin.kind in kinds), None)


def _one(setup: Setup) -> Number:
    return setup.nodes.sums.dtype.type(1)


@contextmanager
def _trial(hub: Hub, plugin: PartInUse) -> Iterator[None]:
    """Report faults of a plug-in, but ignore invalid results that sample numbers cause."""
    with attributed(hub, plugin), np.errstate(all="ignore"):
        try:
            yield
        except ArithmeticError:
            return
        except ValueError as error:
            if str(error) != "math domain error":  # other ValueErrors, as of shapes, are faults
                raise


def _expect(
    plugin: PartInUse, function: Tag, value: object, count: int, kind: type = tuple
) -> None:
    if not (isinstance(value, kind) and len(value) == count):
        at = place_of(function.find((plugin.kind,))) if function.defined(plugin.kind) else ""
        expected = "tuple" if kind is tuple else "symmetric tensor"
        got = type(value).__name__ + (f" of {len(value)}" if isinstance(value, tuple) else "")
        message = f"{function.__name__} has to return a {expected} of {count}, not a {got}{at}"
        raise fault(plugin.name, message, plugin.mark)


def _numbers(plugin: PartInUse, name: str, values: Iterable, one: Number) -> None:
    for number in values:
        if not isinstance(number, (int, float, np.number)):
            raise fault(plugin.name, f"{name} is {number!r} for some point, no number", plugin.mark)
        if not np.isfinite(number):
            raise fault(plugin.name, f"{name} is {number} for some point", plugin.mark)
        if isinstance(number, np.float64) and type(one) is not np.float64:
            message = f"{name} is a double (float64) in a run of precision(single): its author "
            message += "converts numbers to the type of an argument, as in real(0.5, x)"
            raise fault(plugin.name, message, plugin.mark)


def try_law(
    hub: Hub, material: Material, kin: Tag = None, law: Tag = None, one: Number = 1.0
) -> None:
    """Try a plug-in's law: in its solid, or in a unit cell at 293 K."""
    kinds = laws.law_kind(material.law)
    if not any(map(registry.is_foreign, kinds)):
        return
    plugin = _part_of(hub, kinds) or PartInUse(
        f"material {material.style}", kinds[0], material.mark
    )
    law = law_in(law or law_on(material.law, 1.0, 293.0), type(one))
    kin = kin or KINEMATICS[hub.domain.dimension if hub.domain else 3]()
    for strain in STRAINS:
        dl = (type(one)(strain),) * kin.tensor_size
        with _trial(hub, plugin):
            state = laws.initial_state(law, kin, one)
            _try_flow_stress(plugin, law, state, one * strain)
            after = laws.advance(law, kin, state, tensor(kin, dl), one)
            if len(flat(after)) != len(flat(state)):
                message = f"the memory of a point has {len(flat(state))} numbers at first and "
                message += f"{len(flat(after))} after a step: their number must not change"
                raise fault(plugin.name, message, plugin.mark)
            _numbers(
                plugin, f"the memory of a point after a strain of {strain:g}", flat(after), one
            )
            for function in (*TENSORS, *NUMBERS):
                result = function(law, kin, after)
                if function in TENSORS:
                    _expect(plugin, function, result, len(kin.Symmetric.places), kin.Symmetric)
                name = f"{function.__name__} after a strain of {strain:g}"
                _numbers(plugin, name, flat((result,)), one)
            laws.specific_volume(law)
            for of in laws.columns_of(law).values():
                laws.shown(of, law, kin, after)


def _try_flow_stress(plugin: PartInUse, law: Tag, state: tuple, strain: Number) -> None:
    strength = parameter(law, "strength")
    kind = type(strength)
    if not (registry.is_foreign(kind) and hardening.flow_stress.defined(kind)):
        return
    memory, heat, dt = state.m.strength, state.m.heat, strain / strain if strain else 1
    before = hardening.before_flow(strength, memory, heat)
    result = hardening.flow_stress(strength, before, strain, dt)
    _expect(plugin, hardening.flow_stress, result, 2)
    _numbers(
        plugin, f"flow_stress, or its slope, at a plastic strain of {strain:g}", result, strain
    )
    if shear_response.find((kind,)) is hardening.radial_return:
        after = hardening.updated_memory(strength, memory, strain, dt)
        _expect(plugin, hardening.updated_memory, after, len(memory))
        if memory[1:] and not hardening.updated_memory.defined(kind):
            args = f"{', '.join(memory._fields[1:])} would never change: it has no updated_memory"
            raise fault(plugin.name, args, plugin.mark)


def _try_basis(hub: Hub, setup: Setup) -> None:
    basis, points = setup.basis, setup.blocks[0].points
    plugin = _part_of(hub, [type(basis)])
    for p in range(0, len(points.id), 1 + len(points.id) // TRIED):
        with _trial(hub, plugin):
            _try_functions(plugin, setup, points, p)


def _try_functions(plugin: PartInUse, setup: Setup, points: Points, p: int) -> None:
    basis, kin, one = setup.basis, setup.kin, _one(setup)
    grid = record(setup.grids, points.grid[p])
    at = location_at(basis, kin, points.x[0] if points.home is None else points.home, p)
    line = along(basis, kin, grid, at, 0) if along.defined(type(basis)) else None
    if line is not None:
        if not all(hasattr(line, name) for name in Along._fields):
            raise fault(plugin.name, "along has to return an Along", plugin.mark)
        for name in ("weights", "gradients", "affine"):
            got = len(getattr(line, name))
            if got != basis.line_nodes and (got or name != "affine"):
                message = (
                    f"along has to return {basis.line_nodes} {name}, not {got}: register says so"
                )
                raise fault(plugin.name, message, plugin.mark)
    stencil = locate(basis, kin, grid, at)
    weights, slopes = [], []
    for k in range(support(basis, kin)):
        _, weight, slope = entry(basis, kin, grid, stencil, k)
        weights.append(weight)
        slopes.append(tuple(slope)[: kin.dimension])
    _numbers(plugin, "a weight", weights, one)
    _numbers(plugin, "a gradient", flat(slopes), one)
    rounding = 1e3 * len(weights) * np.finfo(type(one)).eps
    for message, total, wanted in (
        ("weights", sum(weights), 1),
        *(("gradients, times h,", sum(of) / grid.inv_h, 0) for of in zip(*slopes, strict=True)),
    ):
        if abs(total - wanted) > rounding:
            x = ", ".join(f"{c:g}" for c in at[: kin.dimension])
            message = f"the {message} of a point at {x} add up to {total:.6g}, not to {wanted}"
            raise fault(plugin.name, message, plugin.mark)
