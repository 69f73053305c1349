"""Checks of parameters that several laws have."""

from karamelo_py.script.errors import ScriptError


def check_temperatures(Tr: float, Tm: float, name: str = "Tr") -> None:
    """Refuse a melting temperature that is not above the reference temperature."""
    if not Tm > Tr:
        raise ScriptError(
            f"the melting temperature Tm = {Tm:g} is not above {name} = {Tr:g}",
            argument="Tm",
            expected=f"a number above {Tr:g}",
        )


def reference_rate(epsdot0: float, factor: float, name: str) -> float:
    """The reference rate of a factor 1 + `factor` ln(rate/epsdot0), any where that is 1.

    Raises
    ------
    ScriptError
        For a rate of 0 that takes part.
    """
    if epsdot0 > 0:
        return epsdot0
    if factor:
        raise ScriptError(
            f"there is no rate to compare with, and {name} = {factor:g} is not 0",
            argument="epsdot0",
            expected=f"a number above 0, or {name} = 0",
        )
    return 1.0
