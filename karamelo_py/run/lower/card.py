"""Scenes on a GPU."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from karamelo_py.compiler.gpu import Counted, NoCard, card
from karamelo_py.kernels import table
from karamelo_py.kernels.arrays import Setup
from karamelo_py.kernels.hooks import CompiledHook
from karamelo_py.kernels.step import untaken
from karamelo_py.language import registry
from karamelo_py.run.lower.build import PRECISIONS
from karamelo_py.run.lower.memory import largest, least_bytes
from karamelo_py.run.state import SceneState
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.machine_memory import in_words
from karamelo_py.script.errors import ScriptError, plural

WITHOUT = "leave out --gpu: processors run the same script"


def use_card(hub: Hub) -> None:
    settings = hub.settings
    if settings.ranks > 1:
        raise ScriptError(
            f"--gpu: one GPU computes the whole scene, and {settings.ranks} processes would "
            "divide it",
            hint="--gpu by one process, or leave it out",
        )
    settings.engine, settings.card = "gpu", Counted()


def take_card(hub: Hub) -> None:
    if isinstance(hub.settings.card, Counted) and not hub.checking:
        with missing_told():
            hub.settings.card = card()


@contextmanager
def missing_told(hub: Hub | None = None) -> Iterator[None]:
    try:
        yield
    except NoCard as error:
        raise ScriptError(str(error), hint=error.hint, complete=True) from None
    except TypeError as error:
        if hub is None:
            raise
        raise ScriptError(f"a GPU cannot run this scene: {error}", hint=WITHOUT) from error
    except MemoryError:
        if hub is None:
            raise
        raise _too_large(hub, 0.0) from None


def check_room_there(hub: Hub) -> None:
    need = least_bytes(hub, PRECISIONS[hub.settings.precision], copied=False)
    if need > hub.settings.card.memory()[0]:
        raise _too_large(hub, need)


def _too_large(hub: Hub, least: float) -> ScriptError:
    count = sum(solid.count for solid in hub.solids.values())
    free, whole = map(in_words, hub.settings.card.memory())
    need = f", which take at least {in_words(least)} of its memory" if least else ""
    has = f"{hub.settings.card.name} has {free} of {whole} free"
    single = "" if hub.settings.precision == "single" else "; precision(single)"
    return ScriptError(
        f"the scene does not fit into the memory of the GPU: {plural(count, 'point')}{need}; {has}",
        mark=largest(hub).mark,
        hint=f"larger cells, or fewer points per cell{single}; {WITHOUT}",
        command="solid",
    )


def memory_there(simulation: SceneState) -> int:
    simulation.launches()
    return simulation.hub.settings.card.taken


def refusals(hub: Hub, setup: Setup | None = None) -> Iterator[ScriptError]:
    """Yield an error for everything in a scene that is not supported on GPUs.

    Without `setup`, checks that need arrays are skipped.
    """
    scheme = hub.update.scheme
    from karamelo_py.run.gpu import Card  # registers rows of steps

    rows = scheme.rows if setup is None else table.plain(scheme.rows, setup)
    for kind in untaken(rows, Card):
        name = registry.name_of("scheme", type(scheme))
        yield ScriptError(
            f"a GPU does not support the row {kind} of scheme {name}",
            mark=hub.update.scheme_mark,
            hint=f"another scheme, take.on({kind}, Card) in its plug-in, or {WITHOUT}",
        )
    for fix in hub.fixes.values():
        hooks = fix.hooks().items() if not fix.first_step_only else ()
        for name, hook in hooks:
            from_python = not isinstance(hook, CompiledHook)
            if from_python or hook.internal:
                why = "calls Python in each step" if from_python else "is for processors"
                yield ScriptError(
                    f"fix {fix.style} '{fix.id}' {why} ({name}), which a GPU does not support",
                    mark=fix.mark,
                    hint=f"a fix whose hooks are compiled, or {WITHOUT}",
                )
                break
    if setup is not None and not hasattr(type(setup.basis), "line_nodes"):
        yield ScriptError(
            f"a GPU does not support basis {hub.update.method.basis_name}, whose points reach "
            "nodes of several cells",
            mark=hub.update.method.mark,
            hint=f"linear, a spline or uGIMP, or {WITHOUT}",
        )


def refuse(hub: Hub, setup: Setup | None = None) -> None:
    if errors := [*refusals(hub, setup)]:
        errors[0].others = errors[1:]
        raise errors[0]
