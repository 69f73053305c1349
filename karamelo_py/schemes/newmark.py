"""Newmark: implicit steps in time; or the backward rule of Euler."""

from typing import Annotated, Any, Literal, NamedTuple

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.schemes.quasi_static import BEGIN, CLOSE, HOLD, PUBLISHED
from karamelo_py.script.errors import ScriptError


class Newmark(NamedTuple):
    """Steps in time that no wave limits: each ends in balance with inertia (Newmark 1959).

    The step is that of `set_dt`. Vibrations that it does not resolve stay, neither damped nor
    resolved, unless `gamma` is above 1/2 or the rule is that of Euler. Accelerations at the
    beginning of a step are those of the forces there.

    Parameters
    ----------
    beta, gamma
        Of displacement and velocity: u = dt v + dt^2 ((1/2 - beta) a + beta a'),
        v' = v + dt ((1 - gamma) a + gamma a'). 1/4 and 1/2 are the trapezoidal rule, which keeps
        the energy of linear bodies; gamma above 1/2 damps, the more the higher the frequency.
    rule
        ``newmark``, or ``euler``: the backward rule of Euler, which damps all vibrations.
    tolerance, iterations, solver, stabilisation
        As of quasi-static.

    Example
    -------
    scheme(newmark)
    scheme(newmark, 0.3025, 0.6)
    scheme(newmark, rule=euler)

    See Also
    --------
    quasi-static, set_dt
    """

    implicit = True
    limit = "error"
    inertia = True
    begin = BEGIN
    hold = HOLD
    close = CLOSE
    rows = (*BEGIN, *HOLD, *CLOSE)
    published = PUBLISHED

    beta: float
    gamma: float
    rule: str
    tolerance: float
    iterations: int
    solver: str
    stabilisation: float

    @classmethod
    def given(
        cls,
        beta: Annotated[float, Positive] = 0.25,
        gamma: Annotated[float, Positive] = 0.5,
        *,
        rule: Literal["newmark", "euler"] = "newmark",
        tolerance: Annotated[float, Positive] = 1e-10,
        iterations: Annotated[int, Positive] = 20,
        solver: Literal["auto", "direct", "amg"] = "auto",
        stabilisation: Annotated[float, NonNegative] = 0.0,
    ) -> Any:
        """The scheme from the words of a script."""
        if gamma < 0.5 or beta < gamma / 2:
            raise ScriptError(
                f"beta {beta:g} and gamma {gamma:g} are stable for small steps only",
                argument="beta",
                expected="gamma of at least 1/2, beta of at least gamma/2",
            )
        return cls(beta, gamma, rule, tolerance, iterations, solver, stabilisation)
