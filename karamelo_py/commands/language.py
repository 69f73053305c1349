"""Commands print, value (or evaluate), include, quit."""

import math

from karamelo_py.language import registry
from karamelo_py.language.signature import Argument
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Quit
from karamelo_py.script.expressions import POINT_SEEDS, SEEDS, Expression, shown


def print_(hub: Hub, first: Argument, *more: Argument) -> None:
    """Print the values of variables and expressions.

    Parameters
    ----------
    first, more
        Expressions, or texts in quotes. A formula is printed with its present value.

    Example
    -------
    print(E)
    print("energy", Ek + Es)

    See Also
    --------
    value
    """
    arguments = (first, *more)
    values = [argument.value(hub) for argument in arguments]
    if hub.rehearsing or hub.interpreter.replay is not None:
        return
    parts = []
    for argument, value in zip(arguments, values, strict=True):
        if isinstance(value, str) and argument.text.startswith('"'):
            parts.append(value)
            continue
        words = [argument.text, shown(value)]
        if isinstance(value, Expression) and not value.names.intersection(POINT_SEEDS):
            _refresh(hub, value)
            words = [argument.text] if value.text == argument.text else words
            words.append(f"{value.evaluate(hub.values):.10g}")
        parts.append(" = ".join(words))
    hub.answered = True
    hub.console.say(", ".join(parts))


registry.may_differ(print_)


def value(hub: Hub, expression: Expression) -> float:
    """Return the present value of a formula, as a constant number.

    ``value`` and ``evaluate`` are names of the same command.

    Parameters
    ----------
    expression
        A formula of time and of values of fixes and computes.

    Example
    -------
    E0 = value(Ek + Es)

    See Also
    --------
    print
    """
    if expression.is_constant:
        return expression.constant
    if not expression.names.intersection(POINT_SEEDS):
        if hub.rehearsing:
            return math.nan  # unknown here: the value depends on earlier runs
        if hub.interpreter.replay is not None:
            number = hub.interpreter.replay.value()
        else:
            _refresh(hub, expression)
            number = expression.evaluate(hub.values)
        hub.interpreter.record.note(number)
        return number
    return expression.evaluate(hub.values)


def include(hub: Hub, file: str) -> None:
    """Execute another script here; its variables and definitions remain.

    Parameters
    ----------
    file
        Name of the script, relative to the one that includes it.

    Example
    -------
    include(materials.in)
    """
    hub.interpreter.include(file)


def quit_(hub: Hub) -> None:
    """End the script here. The bare word quit also ends the script.

    Example
    -------
    quit
    """
    raise Quit


def _refresh(hub: Hub, formula: Expression) -> None:
    if formula.names - SEEDS and not hub.rehearsing:
        hub.refresh_values()
