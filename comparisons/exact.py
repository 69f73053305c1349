"""Exact solutions and reference curves, as plain functions.

Positions are arrays (..., d) of reference coordinates X; displacements and body forces (force per
mass) are arrays alike. Units are consistent. The constitutive law of the manufactured solutions is

    P = mu (F - F^-T) + lambda ln J F^-T

in plane strain (2D) or uniaxial strain (1D). tests/test_exact.py derives every body force again
by numerical differentiation, and holds the rest against independent numbers.
"""

from dataclasses import dataclass
from math import atan, cos, exp, log, pi, sin, sqrt, tan
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq

DATA = Path(__file__).parent / "data"

# --- Manufactured solutions ------------------------------------------------------------------


def lame(E: float, nu: float) -> tuple[float, float]:
    """(lambda, mu) of Young's modulus and Poisson's ratio."""
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def first_piola_kirchhoff(F: np.ndarray, lam: float, mu: float) -> np.ndarray:
    """P of the neo-Hookean law above for gradients F (..., d, d)."""
    inverse_transposed = np.swapaxes(np.linalg.inv(F), -1, -2)
    J = np.linalg.det(F)[..., None, None]
    return mu * (F - inverse_transposed) + lam * np.log(J) * inverse_transposed


@dataclass(frozen=True)
class AxisAligned:
    """u_i = G sin(pi X_i) sin(c pi t + phi_i) on the unit square, with c^2 = E / rho.

    Normal displacements vanish on the walls and shear tractions too, so rollers on all walls close
    the problem. The phases default to 0, pi, 0 as published: one direction shortens while the next
    lengthens. F is diagonal: no rotation, no shear.

    Source: Sadeghirad, Brannon & Burghardt 2011, IJNME 86, section 5 (method of manufactured
    solutions after Wallstedt & Guilkey 2008).
    """

    d: int = 2
    E: float = 1e4
    nu: float = 0.3
    rho: float = 1000
    G: float = 0.01
    phases: tuple[float, ...] = (0, pi, 0)

    def _phase(self, t):
        return sqrt(self.E / self.rho) * pi * t + np.array(self.phases[: self.d])

    def displacement(self, X, t):
        """u(X, t)."""
        return self.G * np.sin(pi * X) * np.sin(self._phase(t))

    def velocity(self, X, t):
        """du/dt (X, t)."""
        return self.G * np.sin(pi * X) * np.cos(self._phase(t)) * sqrt(self.E / self.rho) * pi

    def stretches(self, X, t):
        """The diagonal of F, (..., d)."""
        return 1 + pi * self.G * np.cos(pi * X) * np.sin(self._phase(t))

    def body_force(self, X, t):
        """b = a - div P / rho."""
        lam, mu = lame(self.E, self.nu)
        F = self.stretches(X, t)
        log_J = np.log(F).sum(-1, keepdims=True)
        factor = lam / F**2 * (1 - log_J) + mu * (1 + 1 / F**2) - self.E
        return pi**2 * self.displacement(X, t) / self.rho * factor


@dataclass(frozen=True)
class Vortex:
    """The generalised vortex: a ring 0.75 <= R <= 1.25 turned by alpha = G sin(pi t / T) h(R).

    h = 1 - 8 s^2 + 16 s^4 with s = (R - 1) / 0.5. h and its slope vanish at both edges of the ring,
    which are free of traction. Every point moves on a circle. F is a rotation times a simple shear,
    so J = 1.

    Source: Kamojjala, Brannon, Sadeghirad & Guilkey 2015, Engineering with Computers 31. The
    body force of two published codes has + in the last term of b_t; see tests/test_exact.py.
    """

    E: float = 1000
    nu: float = 0.3
    rho: float = 1000
    G: float = 1
    T: float = 1

    def profile(self, R):
        """h, h', h'' at R; all zero outside the ring."""
        s = (R - 1) / 0.5
        inside = np.abs(s.real) < 0.5
        h = 1 - 8 * s**2 + 16 * s**4
        slope = (-16 * s + 64 * s**3) / 0.5
        curvature = (-16 + 192 * s**2) / 0.5**2
        return (np.where(inside, each, 0) for each in (h, slope, curvature))

    def displacement(self, X, t):
        """u(X, t) = (Q(alpha) - I) X."""
        x, y = X[..., 0], X[..., 1]
        h, _, _ = self.profile(np.sqrt(x**2 + y**2))
        alpha = self.G * np.sin(pi * t / self.T) * h
        c, s = np.cos(alpha), np.sin(alpha)
        return np.stack([c * x - s * y - x, s * x + c * y - y], axis=-1)

    def _terms(self, X, t):
        """R, alpha, and the terms of b by their direction in the present polar frame."""
        m = lame(self.E, self.nu)[1] / self.rho
        R = np.linalg.norm(X, axis=-1)
        h, h1, h2 = self.profile(R)
        g = self.G * np.sin(pi * t / self.T)
        g1 = self.G * pi / self.T * np.cos(pi * t / self.T)
        g2 = -((pi / self.T) ** 2) * g
        tangential = m * (3 * g * h1 + R * g * h2) - R * g2 * h
        shear, centripetal = m * R * (g * h1) ** 2, R * (g1 * h) ** 2
        return R, g * h, tangential, shear, centripetal

    def body_force(self, X, t, last_sign: float = -1):
        """b at the reference position X; `last_sign` +1 gives the formula of the two codes."""
        R, alpha, tangential, shear, centripetal = self._terms(X, t)
        s, c = np.sin(alpha), np.cos(alpha)
        b_r = tangential * s + (shear - centripetal) * c
        b_t = -tangential * c + (shear + last_sign * centripetal) * s
        return self._vector(X, R, b_r, b_t)

    def spatial_body_force(self, x, t):
        """The same at the present position x, where it needs no angle: R is that of X.

        Turned into the polar frame of x, the sines and cosines of alpha drop out.
        """
        R, _, tangential, shear, centripetal = self._terms(x, t)
        return self._vector(x, R, shear - centripetal, -tangential)

    @staticmethod
    def _vector(X, R, b_r, b_t):
        e_r = X / R[..., None]
        e_t = np.stack([-e_r[..., 1], e_r[..., 0]], axis=-1)
        return b_r[..., None] * e_r + b_t[..., None] * e_t


def gradient(displacement, X: np.ndarray, t: float) -> np.ndarray:
    """F = I + du/dX by complex steps: exact to round-off, for any analytic displacement."""
    d = X.shape[-1]
    step = 1e-30
    columns = []
    for k in range(d):
        shifted = X.astype(complex)
        shifted[..., k] += 1j * step
        columns.append(displacement(shifted, t).imag / step)
    return np.eye(d) + np.stack(columns, axis=-1)


# Sixth-order central differences at -3..3.
FIRST = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60
SECOND = np.array([2, -27, 270, -490, 270, -27, 2]) / 180


def derived_body_force(displacement, X, t, E, nu, rho, space=4e-3, time=2e-3) -> np.ndarray:
    """b = a - div P / rho by numerical differentiation of a displacement alone."""
    lam, mu = lame(E, nu)
    acceleration = sum(
        w * displacement(X, t + k * time) for k, w in zip(range(-3, 4), SECOND, strict=True)
    )
    divergence = np.zeros_like(X)
    for j in range(X.shape[-1]):
        for k, w in zip(range(-3, 4), FIRST, strict=True):
            shifted = X.copy()
            shifted[..., j] += k * space
            P = first_piola_kirchhoff(gradient(displacement, shifted, t), lam, mu)
            divergence += w / space * P[..., :, j]
    return acceleration / time**2 - divergence / rho


# --- Closed forms ------------------------------------------------------------------------------


def column_stress(Y, rho: float, g: float, height: float):
    """sigma_yy of a column (nu 0) under its weight, by the reference height Y of a point.

    Equilibrium alone: the width does not change, so the section carries what lies above it.
    """
    return -rho * g * (height - np.asarray(Y))


def bar_frequency(L: float, E: float, rho: float) -> float:
    """omega of the first mode of a bar held at one end: pi / (2 L) sqrt(E / rho)."""
    return pi / (2 * L) * sqrt(E / rho)


def bar_mean_velocity(t, L: float, E: float, rho: float, v0: float):
    """Mean velocity of the bar that starts with v0 sin(pi x / (2 L))."""
    return 2 / pi * v0 * np.cos(bar_frequency(L, E, rho) * t)


def elastica(load: float, steps: int = 400) -> tuple[float, float]:
    """(v / L, u / L) of an inextensible cantilever under a dead end load P L^2 / (E I).

    theta'' = -load cos(theta), theta(0) = 0, theta'(1) = 0; v is the deflection along the load and
    u the shortening along the beam (Bisshopp & Drucker 1945). Solved by shooting for theta'(0).
    """

    def rate(state):
        theta, kappa, _, _ = state
        return np.array([kappa, -load * cos(theta), sin(theta), 1 - cos(theta)])

    def end(kappa0):
        state = np.array([0, kappa0, 0, 0], float)
        ds = 1 / steps
        for _ in range(steps):  # classical Runge-Kutta
            k1 = rate(state)
            k2 = rate(state + ds / 2 * k1)
            k3 = rate(state + ds / 2 * k2)
            k4 = rate(state + ds * k3)
            state = state + ds / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return state

    # The moment at the root lies between 0 and load (the arm is at most L).
    low, high = 0.0, load
    for _ in range(60):
        middle = (low + high) / 2
        if end(middle)[1] < 0:
            low = middle
        else:
            high = middle
    _, _, v, u = end((low + high) / 2)
    return v, u


def incline_acceleration(angle: float, friction: float, g: float, inertia: float = 0.5) -> float:
    """Acceleration along an incline of a round body with moment of inertia `inertia` m R^2.

    It rolls if tan(angle) <= mu (1 + 1 / inertia), for a disk 3 mu. It rolls with
    g sin / (1 + inertia), and slides with g (sin - mu cos).
    """
    if tan(angle) <= friction * (1 + 1 / inertia):
        return g * sin(angle) / (1 + inertia)
    return g * (sin(angle) - friction * cos(angle))


def incline_limit(friction: float, inertia: float = 0.5) -> float:
    """The steepest angle on which the body still rolls."""
    return atan(friction * (1 + 1 / inertia))


def disk_angular_momentum(mass: float, R: float, omega: float) -> float:
    """M R^2 omega / 2."""
    return mass * R**2 * omega / 2


def disk_energy(mass: float, R: float, omega: float) -> float:
    """Kinetic energy of a turning rigid disk, M R^2 omega^2 / 4."""
    return mass * R**2 * omega**2 / 4


def contact_time(distance: float, radii: float, speed: float) -> float:
    """When two disks touch whose centres are `distance` apart and close in with `speed`."""
    return (distance - radii) / speed


def prandtl_load(cohesion: float, phi: float = 0.0) -> float:
    """Limit pressure of a strip footing on weightless soil with an angle of friction in radians.

    (e^(pi tan(phi)) tan^2(pi/4 + phi/2) - 1) c / tan(phi), of clay (2 + pi) c (Prandtl 1920).
    """
    if phi == 0:
        return (2 + pi) * cohesion
    return (exp(pi * tan(phi)) * tan(pi / 4 + phi / 2) ** 2 - 1) * cohesion / tan(phi)


def hertz_stress(x: np.ndarray, depth: np.ndarray, force: float, half: float) -> np.ndarray:
    """Stress across a plane that a cylinder presses with `force` over 2 `half` (McEwen 1949).

    Johnson 1985, Contact Mechanics, eq. 4.46; at the surface it is Hertz's pressure.
    """
    z = np.maximum(depth, 1e-6 * half)
    a = half**2 - x**2 + z**2
    root = np.sqrt(a**2 + 4 * x**2 * z**2)
    m = np.sqrt((root + a) / 2)
    n = np.sqrt(np.maximum(root - a, 0) / 2)
    return -2 * force / (pi * half**2) * m * (1 - (z**2 + n**2) / (m**2 + n**2))


def hertz_load(approach: float, R: float, modulus: float) -> float:
    """Force per length that brings a plane nearer to the axis of a cylinder by `approach`.

    For a cylinder between two planes, approach = 2 P / (pi E*) (ln(4 R / a) - 1/2). Half the width
    of the contact is a = sqrt(4 P R / (pi E*)) (Johnson 1985, Contact Mechanics, section 5.6).
    """
    low, high = 0.0, modulus * R
    for _ in range(100):
        P = (low + high) / 2
        a = sqrt(4 * P * R / (pi * modulus))
        below = 2 * P / (pi * modulus) * (log(4 * R / a) - 0.5) < approach
        low, high = (P, high) if below else (low, P)
    return low


def spiral_slip(beta: float, phi: float) -> tuple[float, np.ndarray]:
    """Weight times height over cohesion at which a slope fails, and where it slips, (n, 2).

    The best upper bound by a body that turns on a logarithmic spiral through the toe of the slope
    (Chen 1975, Limit Analysis and Soil Plasticity, section 9.2). `beta` is the inclination, `phi`
    friction and dilatancy, in radians. Positions are relative to the toe, over the height. The
    slope lies at x < 0.
    """
    t = tan(phi)
    first, last = np.radians(np.arange(0, 90, 0.1)), np.radians(np.arange(45, 150, 0.1))[:, None]
    grown = np.exp((last - first) * t)
    H = np.sin(last) * grown - np.sin(first)
    L = np.sin(last - first) / np.sin(last) - np.sin(last + beta) / np.sin(last) / sin(beta) * H
    whole = (3 * t * np.cos(last) + np.sin(last)) * grown**3 - 3 * t * np.cos(first) - np.sin(first)
    whole = whole / 3 / (1 + 9 * t**2)
    above = L * (2 * np.cos(first) - L) * np.sin(first) / 6
    beside = np.cos(first) - L + np.cos(last) * grown
    beside *= grown * (np.sin(last - first) - L * np.sin(last)) / 6
    with np.errstate(divide="ignore", invalid="ignore"):
        N = H * (grown**2 - 1) / (2 * t * (whole - above - beside))
    N[~((N > 0) & (H > 0.1) & (L > 0))] = np.inf
    k = np.unravel_index(N.argmin(), N.shape)
    angle = np.linspace(first[k[1]], last[k[0], 0], 100)
    r = np.exp((angle - angle[0]) * t) / H[k]
    line = np.stack([-r * np.cos(angle), -r * np.sin(angle)], 1)
    return float(N[k]), line - line[-1]


def riemann(left, right, gamma: float):
    """Density, velocity and pressure over x/t after a wall between two gases at rest is removed.

    `left` has the larger pressure: a fan runs to the left, a shock to the right. `left` and `right`
    are density and pressure. Source: Toro 2009, chapter 4.
    """
    (dense, high), (thin, low) = left, right
    c, ahead = sqrt(gamma * high / dense), sqrt(gamma * low / thin)
    up, down, power = gamma + 1, gamma - 1, (gamma - 1) / (2 * gamma)

    def shock(p):  # velocity behind it
        return (p - low) * sqrt(2 / (up * thin) / (p + down / up * low))

    def fan(p):
        return 2 * c / down * (1 - (p / high) ** power)

    p = brentq(lambda p: shock(p) - fan(p), low, high, rtol=1e-14)
    u, inner = shock(p), c * (p / high) ** power
    front = ahead * sqrt(up / (2 * gamma) * p / low + power)
    behind = thin * (p / low + down / up) / (down / up * p / low + 1)

    def profiles(s: np.ndarray) -> tuple[np.ndarray, ...]:
        sound = np.maximum(2 / up * c - down / up * s, 0) / c
        parts = [s < -c, s < u - inner, s < u, s < front]
        density = dense * sound ** (2 / down), dense * (p / high) ** (1 / gamma), behind
        return (
            np.select(parts, [dense, *density], thin),
            np.select(parts, [0.0, 2 / up * (c + s), u, u], 0.0),
            np.select(parts, [high, high * sound ** (1 / power), p, p], low),
        )

    return profiles


TNT = 1630, 371.2e9, 3.231e9, 4.15, 0.95, 0.30, 7e9, 6930  # rho, A, B, R1, R2, omega, E0, D


def release_of_tnt() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x/t, pressure and velocity in the wave after a plane detonation (Taylor 1950)."""
    rho, A, B, R1, R2, W, E0, _ = TNT
    V = np.linspace(0.7, 0.8, 10001)
    cold = sum(a * (1 - W / (r * V)) * np.exp(-r * V) for a, r in ((A, R1), (B, R2)))
    p = (cold + W * E0 / V) / (1 - W * (1 - V) / (2 * V))
    k = (p / (1 - V)).argmin()  # where the Rayleigh line is tangent
    start, v = V[k], np.linspace(V[k], 1.2, 2001)
    left = p[k] - A * exp(-R1 * start) - B * exp(-R2 * start)
    terms = A * np.exp(-R1 * v), B * np.exp(-R2 * v), left * (v / start) ** -(1 + W)
    c = np.sqrt((R1 * terms[0] + R2 * terms[1] + (1 + W) * terms[2] / v) / rho)
    u = np.sqrt(p[k] * (1 - start) / rho) - cumulative_trapezoid(c, v, initial=0)
    return u + v * c, sum(terms), u


def granular_runout(aspect: float) -> float:
    """(l - l0) / l0 of a column of grains in a channel (Lube et al. 2005, eqs. 3 and 4).

    1.2 a below an aspect ratio a of 1.8, 1.9 a^(2/3) above 2.8; between them the line goes on until
    both meet. Lajeunesse, Monnier & Homsy 2005 find the same powers.
    """
    return min(1.2 * aspect, 1.9 * aspect ** (2 / 3)) if aspect < 2.8 else 1.9 * aspect ** (2 / 3)


# --- Curves ------------------------------------------------------------------------------------


def cantilever_curve() -> tuple[np.ndarray, np.ndarray]:
    """Time and tip deflection by finite elements (Sadeghirad et al. 2011), digitised."""
    rows = np.loadtxt(DATA / "cantilever_fem_sadeghirad.csv", delimiter=",")
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    return rows[:, 0], rows[:, 1]


def minimum(time: np.ndarray, value: np.ndarray) -> tuple[float, float]:
    """(time, value) of the first deep minimum, by a parabola through the lowest three samples."""
    k = int(np.argmin(value))
    if not 0 < k < len(value) - 1:
        return float(time[k]), float(value[k])
    a, b, c = np.polyfit(time[k - 1 : k + 2] - time[k], value[k - 1 : k + 2], 2)
    return float(time[k] - b / (2 * a)), float(c - b * b / (4 * a))
