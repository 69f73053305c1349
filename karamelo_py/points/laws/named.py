"""Parts of a law as a script names them: arguments of material eos-strength."""

from typing import Any, ClassVar

from karamelo_py.language.arguments import Argument, look_up
from karamelo_py.language.scene import Scene
from karamelo_py.script.errors import ScriptError, nearest


class Eos:
    """For signatures: an equation of state that the script has named."""

    script_kind: ClassVar[str] = "the ID of an equation of state"
    kind: ClassVar[str] = "eos"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        """The part that `argument` names."""
        return look_up(hub.parts[cls.kind], argument)


class Strength(Eos):
    """For signatures: a strength."""

    script_kind = "the ID of a strength"
    kind = "strength"


class Option:
    """For signatures: a part that may be left out."""

    script_kind: ClassVar[str] = "the ID of a damage or of a temperature"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        """The part that `argument` names."""
        word = argument.word()
        optional = {kind: named for kind, named in hub.parts.items() if kind not in NEEDED}
        known = {ID: part for named in optional.values() for ID, part in named.items()}
        if word in known:
            return known[word]
        close = nearest(word, known) if word else None
        raise ScriptError(
            f"unknown {' or '.join(optional)} '{argument.text}'",
            place=argument.place,
            expected=f"one of {', '.join(known)}" if known else "none is defined yet",
            hint=f"did you mean '{close}'?" if close else None,
        )


NEEDED = ("eos", "strength")
