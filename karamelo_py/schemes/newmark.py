"""Newmark's implicit time steps with inertia, and the backward Euler rule."""

from typing import Annotated, Any, Literal, NamedTuple

from karamelo_py.compiler.fields import Field, vector
from karamelo_py.language.signature import In, NonNegative, Positive
from karamelo_py.schemes.quasi_static import BEGIN, CLOSE, HOLD, Tolerance
from karamelo_py.schemes.traits import IMPLICIT, SchemeTraits
from karamelo_py.script.errors import ScriptError


class Surplus(Field):
    """Generalized-alpha acceleration minus force/mass, at the end of a step."""

    shape = vector


def _damping(scheme: "Newmark") -> str:
    if scheme.rule == "euler":
        return "rule=euler"
    if scheme.rho < 1:
        return f"rho {scheme.rho:g}"
    return f"gamma {scheme.gamma:g}" if scheme.gamma > 0.5 else ""


class Newmark(NamedTuple):
    """Implicit steps with inertia, longer than explicit ones (Newmark 1959).

    The step must be set by `set_dt`. Vibrations faster than the step are damped only if `gamma` is
    above 1/2, `rho` below 1, or the rule euler. The acceleration at the beginning of a step is
    computed from the forces; with `rho`, points store a part of it.

    Parameters
    ----------
    beta, gamma
        Coefficients of displacement and velocity: u = dt v + dt^2 ((1/2 - beta) a + beta a'), v' =
        v + dt ((1 - gamma) a + gamma a'), with primes at the end of the step. The defaults, 1/4 and
        1/2, are the trapezoidal rule, which conserves the energy of linear bodies. Values of gamma
        above 1/2 damp vibrations, fast ones most.
    rule
        ``newmark``, or ``euler``: backward Euler, which damps all vibrations.
    rho
        High-frequency spectral radius of generalized-alpha (Chung & Hulbert 1993): the fraction of
        the amplitude of vibrations much faster than the step that remains after a step, from 1 (no
        damping) to 0. Slow vibrations are hardly damped.
    tolerance, iterations, solver, stabilisation
        As in quasi-static.

    Example
    -------
    scheme(newmark)
    scheme(newmark, 0.3025, 0.6)
    scheme(newmark, rho=0.8)
    scheme(newmark, rule=euler)

    See Also
    --------
    quasi-static, set_dt
    """

    limit = "error"
    traits = SchemeTraits(implicit=True, restrictions=IMPLICIT, damping=_damping)
    begin = BEGIN
    hold = HOLD
    close = CLOSE
    rows = (*BEGIN, *HOLD, *CLOSE)

    beta: float
    gamma: float
    rule: str
    tolerance: float
    iterations: int
    solver: str
    stabilisation: float
    rho: float

    @property
    def alphas(self) -> tuple[float, float]:
        """Return the weights of accelerations and forces at the beginning of a step."""
        # For rho = 1 both weights would be 1/2; balance at the start then gives balance at the end.
        return _alphas(self.rho) if self.rho < 1 else (0.0, 0.0)

    @property
    def point_fields(self) -> tuple[type, ...]:
        return (Surplus,) if self.rho < 1 else ()

    @classmethod
    def given(
        cls,
        beta: Annotated[float, Positive] | None = None,
        gamma: Annotated[float, Positive] | None = None,
        *,
        rule: Literal["newmark", "euler"] = "newmark",
        rho: Annotated[float, In(0, 1)] | None = None,
        tolerance: Annotated[float, Tolerance] = 1e-10,
        iterations: Annotated[int, Positive] = 20,
        solver: Literal["auto", "direct", "amg"] = "auto",
        stabilisation: Annotated[float, NonNegative] = 0.0,
    ) -> Any:
        if rho is not None:
            if beta is not None or gamma is not None or rule != "newmark":
                raise ScriptError(
                    f"rho {rho:g} already determines beta, gamma and the rule",
                    argument="rho",
                    expected="rho alone, or none",
                )
            m, f = _alphas(rho)
            beta, gamma = (1 - m + f) ** 2 / 4, 0.5 - m + f
            return cls(beta, gamma, rule, tolerance, iterations, solver, stabilisation, rho)
        beta, gamma = 0.25 if beta is None else beta, 0.5 if gamma is None else gamma
        if gamma < 0.5 or beta < gamma / 2:
            raise ScriptError(
                f"beta {beta:g} and gamma {gamma:g} are stable for small steps only",
                argument="beta",
                expected="gamma of at least 1/2, beta of at least gamma/2",
            )
        return cls(beta, gamma, rule, tolerance, iterations, solver, stabilisation, 1.0)


def _alphas(rho: float) -> tuple[float, float]:
    return (2 * rho - 1) / (rho + 1), rho / (rho + 1)
