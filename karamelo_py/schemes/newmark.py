"""Newmark: implicit steps in time, with generalized alpha or the rule of Euler."""

from typing import Annotated, Any, Literal, NamedTuple

from karamelo_py.compiler.fields import Field, vector
from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.schemes.quasi_static import BEGIN, CLOSE, HOLD, PUBLISHED
from karamelo_py.script.errors import ScriptError


class Acceleration(Field):
    """Acceleration of a point at the end of a step."""

    shape = vector


class Newmark(NamedTuple):
    """Steps in time that no wave limits: each ends in balance with inertia (Newmark 1959).

    The step is that of `set_dt`. Vibrations that it does not resolve stay, neither damped nor
    resolved, unless `radius` is below 1.

    Parameters
    ----------
    beta, gamma
        Of displacement and velocity: u = dt v + dt^2 ((1/2 - beta) a + beta a'),
        v' = v + dt ((1 - gamma) a + gamma a'). 1/4 and 1/2 are the trapezoidal rule, which keeps
        the energy of linear bodies.
    radius
        Share of the amplitude that vibrations far above 1/dt keep in a step, from 0 to 1
        (generalized alpha; Chung & Hulbert 1993). Below 1 it chooses beta and gamma.
    rule
        ``newmark``, or ``euler``: the backward rule of Euler, which damps all vibrations.
    tolerance, iterations, solver, stabilisation
        As of quasi-static.

    Example
    -------
    scheme(newmark)
    scheme(newmark, radius=0.8)
    scheme(newmark, rule=euler)

    See Also
    --------
    quasi-static, set_dt
    """

    implicit = True
    begin = BEGIN
    hold = HOLD
    close = CLOSE
    rows = (*BEGIN, *HOLD, *CLOSE)
    published = PUBLISHED
    point_fields = (Acceleration,)

    beta: float
    gamma: float
    alpha_m: float  # share of the old inertia, and of the old forces, in the balance
    alpha_f: float
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
        radius: Annotated[float, NonNegative] = 1.0,
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
        if radius > 1:
            raise ScriptError(f"radius is {radius:g}", argument="radius", expected="0 to 1")
        alpha_m = alpha_f = 0.0
        if radius < 1:
            alpha_m, alpha_f = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
            gamma, beta = 0.5 - alpha_m + alpha_f, (1 - alpha_m + alpha_f) ** 2 / 4
        rules = beta, gamma, alpha_m, alpha_f, rule
        return cls(*rules, tolerance, iterations, solver, stabilisation)  # type: ignore[arg-type]
