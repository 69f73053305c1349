"""Scenes on a GPU: the card that takes their steps, what it cannot do, and its memory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from karamelo_py.compiler.gpu import NoCard, card
from karamelo_py.kernels.hooks import CompiledHook
from karamelo_py.language import registry
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

WITHOUT = "no --gpu: processors run the same script"


def use_card(hub: Hub) -> None:
    """Let the GPU of this machine take the steps of a scene; it is an error that there is none."""
    hub.settings.engine = "gpu"
    try:
        hub.settings.card = card()
    except NoCard as error:
        raise ScriptError(str(error), hint=error.hint) from None


def refusals(hub: Hub, setup: Any = None) -> Iterator[ScriptError]:
    """Say what of a scene no GPU can do: each with its line, and what helps.

    Before there are arrays (`setup`), what depends on them is not looked at.
    """
    scheme = hub.update.scheme
    if getattr(scheme, "implicit", False):
        name = registry.name_of("scheme", type(scheme))
        yield ScriptError(
            f"a GPU takes no steps of scheme {name}, which solves equations",
            place=hub.update.scheme_place,
            hint=f"an explicit scheme (musl, usf, usl, usavg), or {WITHOUT}",
        )
        return
    for fix in hub.fixes.values():
        hooks = fix.hooks().items() if not fix.first_step_only else ()
        for name, hook in hooks:
            if not isinstance(hook, CompiledHook):
                yield ScriptError(
                    f"fix {fix.style} '{fix.id}' acts from Python in each step ({name}): a GPU "
                    "would wait for it",
                    place=fix.place,
                    hint=f"a fix whose hooks are compiled, or {WITHOUT}",
                )
                break
    if setup is not None and not hasattr(type(setup.basis), "line_nodes"):
        yield ScriptError(
            f"a GPU does not know basis {hub.update.method.basis_name} yet, whose points see nodes "
            "of several cells",
            place=hub.update.method.place,
            hint=f"linear, a spline or uGIMP, or {WITHOUT}",
        )


def refuse(hub: Hub, setup: Any = None) -> None:
    """Refuse a scene that no GPU can run."""
    first, *others = [*refusals(hub, setup)] or [None]
    if first is not None:
        first.others = others
        raise first
