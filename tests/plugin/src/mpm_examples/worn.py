"""A damage, a part of eos-strength."""

from typing import Annotated, NamedTuple

from karamelo_py.language.signature import Positive
from karamelo_py.points.laws import column, damage
from karamelo_py.points.laws.damages import damage_after, initial_damage, initiation, integrity


class Worn(NamedTuple):
    """Strength that is lost in proportion to plastic strain.

    Parameters
    ----------
    limit
        Plastic strain at which nothing is left.

    Example
    -------
    damage(worn, worn, 0.2)
    """

    limit: Annotated[float, Positive]


column(Worn, "damage", damage)


@initial_damage.on(Worn)
def _initial_damage_worn(damage, template):
    return (0.0,)


@damage_after.on(Worn)
def _damage_after_worn(damage, memory, step):
    return (min(memory[0] + step.strain / damage.limit, 1),)


@integrity.on(Worn)
def _integrity_worn(damage, memory):
    return 1 - memory[0]


@initiation.on(Worn)
def _initiation_worn(damage, memory):
    return memory[0]
