"""One material point under prescribed strains and stresses (commands load_path, element).

The point functions of the law are called in plain Python, without compilation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import on_numbers
from karamelo_py.compiler.slopes import Dual, slopes_of
from karamelo_py.kernels.laws import law_on
from karamelo_py.language.arguments import Named
from karamelo_py.output.files import savefig, whole
from karamelo_py.output.plots import blank_figure, tidy
from karamelo_py.points import laws
from karamelo_py.points.kinematics import tensor
from karamelo_py.script.errors import ScriptError

COMPONENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
NORMAL = COMPONENTS[:3]


@dataclass
class LoadPath(Named):
    """Strains and stresses at the end of a load path; components not named do not change."""

    increments: int
    duration: float
    strain: Mapping[str, float]  # strains by component
    stress: Mapping[str, float]
    shear: Sequence[str] = ()  # components with simple instead of pure shear
    volumetric: float | None = None  # sum of normal strains; unnamed ones are equal
    turn: float = 0.0  # angle of rotation about z

    catalogue = "load_paths"

    def __post_init__(self) -> None:
        for name in self.stress:
            if name in self.strain:
                raise ScriptError(
                    f"strain and stress of the component {name} are both prescribed",
                    argument=f"s{name}",
                    expected=f"s{name}, or the strain of that component",
                )
        if self.volumetric is None:
            return
        normal = [name for name in NORMAL if name in self.stress]
        if normal:
            raise ScriptError(
                f"the volume and s{normal[0]} are both prescribed",
                argument="volumetric",
                expected="normal strains with volumetric, no normal stresses",
            )
        if set(NORMAL) <= set(self.strain):
            raise ScriptError(
                "all normal strains are prescribed: the volume follows from them",
                argument="volumetric",
                expected="two normal strains at most with volumetric",
            )

    def strain_at_end(self, strain: np.ndarray, free: Sequence[str]) -> np.ndarray:
        end = strain.copy()
        for name, value in self.strain.items():
            end[COMPONENTS.index(name)] = value
        if self.volumetric is not None:
            rest = [k for k, name in enumerate(NORMAL) if name in free and name not in self.strain]
            end[rest] += (self.volumetric - end[:3].sum()) / len(rest)
        return end


SHEARS = {3: (0, 1), 4: (0, 2), 5: (1, 2)}

ITERATIONS = 40
SEARCH_HALVINGS = 8
CONTRACTS = 0.1  # residual / previous residual, below which slopes are reused
DIVISIONS = 8  # halvings of an increment that does not converge
TOLERANCE = 1e-10  # residual / stress, or / the stress change in elastic increments
UNRESOLVED = 1e-13  # stress / modulus below which a stress is round-off


class Unreachable(Exception):
    """No strain gives the prescribed stress."""


class Loading(NamedTuple):
    strain: np.ndarray  # (6,) change of strain; 0 where the stress is prescribed
    turn: float
    shear: tuple[int, ...]
    prescribed: np.ndarray  # components with a prescribed stress
    begin: np.ndarray  # (k,) stress of these components at the beginning
    end: np.ndarray


def stress_after(law, kin, state, dl, dt):
    return laws.cauchy_stress(law, kin, laws.advance(law, kin, state, dl, dt))


class Point:
    def __init__(self, law: NamedTuple, kin: NamedTuple, T: float | None = None):
        self.law, self.kin = law_on(law, None, T), kin
        self.state = laws.initial_state(self.law, kin, 1.0)
        if T is not None:
            self.state = laws.with_temperature(self.law, kin, self.state, T)
        self.stress = self._stress(self.state)
        self.slopes: np.ndarray | None = None  # d(stress) / d(strain) found last along this path
        self.strain = np.zeros(6)  # sum of symmetric parts of dt grad v
        self.time = 0.0
        self.work = 0.0  # work per reference volume
        self.last: tuple = (self.state, np.zeros((3, 3)), 1.0)  # state before, increment, dt

    @property
    def free(self) -> tuple[str, ...]:
        places = self.kin.Tensor.places
        return tuple(c for c in COMPONENTS if ("xyz".index(c[0]), "xyz".index(c[1])) in places)

    def _stress(self, state: tuple) -> np.ndarray:
        return np.array([*laws.cauchy_stress(self.law, self.kin, state), *5 * [0.0]][:6])

    def follow(self, path: LoadPath, observe: Callable[[], None]) -> None:
        prescribed = np.array([k for k, name in enumerate(COMPONENTS) if name in path.stress], int)
        load = Loading(
            strain=path.strain_at_end(self.strain, self.free) - self.strain,
            turn=path.turn,
            shear=tuple(COMPONENTS.index(name) for name in path.shear),
            prescribed=prescribed,
            begin=self.stress[prescribed],
            end=np.array([path.stress[COMPONENTS[k]] for k in prescribed]),
        )
        begun, self.slopes = self.time, None
        rate = np.zeros(len(prescribed))  # change of the unknown strains along the path
        marks = np.arange(path.increments + 1) / path.increments
        for number, (a, b) in enumerate(pairwise(marks), 1):
            try:
                rate = self._go(load, path.duration, a, b, rate, DIVISIONS)
            except Unreachable as error:
                raise Unreachable(f"increment {number} of {path.increments}: {error}") from None
            # Computed from the path, not summed over increments, so that tables have round numbers.
            self.time = begun + b * path.duration
            observe()

    def _go(
        self, load: Loading, duration: float, a: float, b: float, rate: np.ndarray, divisions: int
    ) -> np.ndarray:
        try:
            solution = self._solve(load, (b - a) * duration, a, b, rate)
        except Unreachable:
            middle = (a + b) / 2
            if divisions == 0 or not len(load.prescribed):
                raise
            rate = self._go(load, duration, a, middle, rate, divisions - 1)
            return self._go(load, duration, middle, b, rate, divisions - 1)
        return solution / (b - a)

    def _solve(self, load: Loading, dt: float, a: float, b: float, rate: np.ndarray) -> np.ndarray:
        prescribed, target = load.prescribed, load.begin + b * (load.end - load.begin)
        increment = (b - a) * load.strain
        rigid = self._turned((b - a) * load.turn, dt)
        latest: tuple = (None, None)

        def after(unknown: np.ndarray) -> tuple[tuple, np.ndarray] | None:
            nonlocal latest
            increment[prescribed] = unknown
            if latest[0] is not unknown:
                latest = unknown, computed()
            return latest[1]

        def computed() -> tuple[tuple, np.ndarray] | None:
            dl = self._strained(increment, load.shear) + rigid
            try:
                state = laws.advance(self.law, self.kin, self.state, self._flat(dl), dt)
                stored = laws.energy_density(self.law, self.kin, state)
                if laws.jacobian(self.law, self.kin, state) > 0 and np.isfinite(stored):
                    return state, self._stress(state)
            except (ArithmeticError, ValueError):
                pass  # the logarithm of a negative stretch, or an overflow
            return None

        def misfit(unknown: np.ndarray) -> np.ndarray:
            state = after(unknown)
            return state[1][prescribed] - target if state else np.full(len(prescribed), np.inf)

        def slopes(unknown: np.ndarray) -> np.ndarray:
            increment[prescribed] = unknown
            dl = self._strained(increment, load.shear) + rigid
            ways = [self._strained(e, load.shear) for e in np.eye(6)[prescribed]]
            return self._slopes(self.state, dl, dt, ways)[prescribed]

        unknown = self._newton(misfit, slopes, rate * (b - a), increment, target)
        after_increment = after(unknown)
        self.last = (self.state, self._strained(increment, load.shear) + rigid, dt)
        if after_increment is None or not np.isfinite(after_increment[1]).all():
            raise Unreachable(
                "the point is turned inside out (det F <= 0), or its energy has no value there: "
                "gent ends at I1*J^(-2/3) - 3 = Jm"
            )
        self._accept(*after_increment, increment)
        return unknown

    def tangent(self) -> np.ndarray:
        """Return the tangent (n, m) of the last increment, d(Cauchy stress) / d(free strains).

        Shear strains are engineering strains, twice the tensor components.
        """
        numbers = [COMPONENTS.index(name) for name in self.free]
        ways = [self._strained((0.5 if k > 2 else 1) * np.eye(6)[k], ()) for k in numbers]
        return self._slopes(*self.last, ways)[: len(self.kin.symmetric_names)]

    def _slopes(
        self, state: tuple, dl: np.ndarray, dt: float, ways: Sequence[np.ndarray]
    ) -> np.ndarray:
        places = self.kin.Tensor.places
        numbers = [Dual(float(dl[at]), tuple([float(way[at]) for way in ways])) for at in places]
        stress = on_numbers(stress_after)(self.law, self.kin, state, tensor(self.kin, numbers), dt)
        rows = [slopes_of(x, len(ways)) for x in stress]
        return np.array([*rows, *[[0.0] * len(ways)] * (6 - len(rows))], float)

    def _newton(
        self, misfit: Callable, slopes: Callable, guess: np.ndarray, increment: np.ndarray,
        target: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        if not len(guess):
            return guess
        volume = laws.specific_volume(self.law) * laws.jacobian(self.law, self.kin, self.state)
        modulus = laws.wave_speed_squared(self.law, self.kin, self.state) / volume
        unknown = guess if np.isfinite(misfit(guess)).all() else np.zeros(len(guess))
        residual = misfit(unknown)
        for _ in range(ITERATIONS):
            size = np.linalg.norm(residual)
            stresses = [modulus * np.abs(increment).max(), *np.abs(target), *np.abs(self.stress)]
            if size <= TOLERANCE * max(stresses) + UNRESOLVED * modulus:
                return unknown
            if not np.isfinite(size):
                break
            if new := self.slopes is None:
                self.slopes = slopes(unknown)
            if not np.isfinite(self.slopes).all():
                break
            # Least squares leave components without stiffness unchanged.
            step = np.linalg.lstsq(self.slopes, -residual, rcond=1e-12)[0]
            for halving in range(SEARCH_HALVINGS if new else 1):
                trial = unknown + step / 2**halving
                trial_residual = misfit(trial)
                fraction = np.linalg.norm(trial_residual) / size
                if fraction < (1 if new else CONTRACTS):
                    unknown, residual = trial, trial_residual
                    self.slopes = self.slopes if fraction < CONTRACTS else None
                    break
            else:
                if new:
                    break
                self.slopes, residual = None, misfit(unknown)  # misfit() restores the increment
        self.slopes = None
        raise Unreachable("the law does not reach the prescribed stress")

    def _strained(self, increment: np.ndarray, shear: Sequence[int]) -> np.ndarray:
        full = np.diag(increment[:3])
        for k, (i, j) in SHEARS.items():
            simple = k in shear
            full[i, j] = (2 if simple else 1) * increment[k]
            full[j, i] = 0 if simple else increment[k]
        return full

    def _turned(self, angle: float, dt: float) -> np.ndarray:
        """Return the dt grad v (3, 3) that a law regards as a rigid rotation about z.

        To first order it is skew. The second-order part depends on how the law computes strain and
        volume: strain from the symmetric part and volume from det F, or both from F.
        """
        if angle == 0:
            return np.zeros((3, 3))
        skew = np.zeros((3, 3))
        skew[1, 0], skew[0, 1] = angle, -angle
        # In the first case, the volume is constant if (1 + a) ((1 + a)^2 + angle^2) = 1.
        roots = np.roots([1, 0, angle**2, -1])
        same_volume = float(roots[np.argmin(np.abs(roots - 1))].real) - 1
        exact = np.sin(angle) / angle * skew + (np.cos(angle) - 1) * np.diag([1, 1, 0])
        forms = [skew, skew + same_volume * np.eye(3), exact]
        before = laws.energy_density(self.law, self.kin, self.state)

        def stored(form: np.ndarray) -> float:
            state = laws.advance(self.law, self.kin, self.state, self._flat(form), dt)
            return abs(laws.energy_density(self.law, self.kin, state) - before)

        return min(forms, key=stored)

    def _flat(self, gradient: np.ndarray) -> tuple:
        return tensor(self.kin, [float(gradient[index]) for index in self.kin.Tensor.places])

    def _accept(self, state: tuple, stress: np.ndarray, increment: np.ndarray) -> None:
        weights = np.where(np.arange(6) < 3, 1, 2)
        before = laws.jacobian(self.law, self.kin, self.state) * self.stress
        self.state, self.stress = state, stress
        after = laws.jacobian(self.law, self.kin, self.state) * self.stress
        self.work += float(weights * (before + after) / 2 @ increment)
        self.strain = self.strain + increment
        across = laws.stretch_across(self.law, self.state)
        if across != 1:
            self.strain[self.kin.dimension : 3] = np.log(across)


WIDTH = 17  # for ten digits, sign, exponent and a blank


def shown(point: Point) -> dict[str, float]:
    """Return output columns by name; q is the von Mises stress sqrt(3/2 s:s)."""
    law, kin, state, stress = point.law, point.kin, point.state, point.stress
    names = COMPONENTS[: len(kin.symmetric_names)]
    xx, yy, zz, *shear = stress
    normal = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
    return {
        "time": point.time,
        **{f"e{name}": point.strain[k] for k, name in enumerate(names)},
        **{f"s{name}": stress[k] for k, name in enumerate(names)},
        "p": -float(stress[:3].sum()) / 3,
        "q": float(np.sqrt(normal / 2 + 3 * np.sum(np.square(shear)))),
        "J": laws.jacobian(law, kin, state),
        "stored": laws.energy_density(law, kin, state),
        "work": point.work,
        **{name: laws.shown(of, law, kin, state) for name, of in laws.columns_of(law).items()},
    }


class Response:
    def __init__(self, point: Point):
        self.point = point
        self.names = list(shown(point))
        self.rows: list[list[float]] = []
        self.observe()

    def observe(self) -> None:
        self.rows.append([float(value) + 0.0 for value in shown(self.point).values()])

    def last(self) -> dict[str, float]:
        return dict(zip(self.names, self.rows[-1], strict=True))

    def write(self, path: Path) -> None:
        formats = [f"%-{WIDTH}.10g"] * (len(self.names) - 1) + ["%.10g"]
        header = "".join(name.ljust(WIDTH) for name in self.names).rstrip()
        with whole(path) as file:
            np.savetxt(file, self.rows, fmt=formats, delimiter="", header=header, comments="")

    def draw(self, path: Path, title: str) -> None:
        table = dict(zip(self.names, np.transpose(self.rows), strict=True))
        strains = [name for name in self.names if name.startswith("e") and name[1:] in COMPONENTS]
        driven = max(strains, key=lambda name: np.ptp(table[name]))
        stresses = [f"s{name[1:]}" for name in strains]
        largest = max(float(np.abs(table[name]).max()) for name in stresses)
        figure = blank_figure(9.6, 4.0)
        left, right = figure.subplots(1, 2)
        for name, dashes in zip(stresses, ("-", "--", ":") * 2, strict=False):
            if np.abs(table[name]).max() > 1e-6 * largest:
                left.plot(table[driven], table[name], dashes, label=name, linewidth=1.4)
        left.set_xlabel(driven)
        left.set_ylabel("Cauchy stress")
        right.plot(table["p"], table["q"], linewidth=1.4)
        right.plot(table["p"][:1], table["q"][:1], "o", color="0.3", label="start")
        right.set_xlabel("pressure p")
        right.set_ylabel("von Mises stress q")
        for axes in (left, right):
            tidy(axes)
            # Labels such as 0.0025 fit; longer ones get a power of ten.
            axes.locator_params(axis="x", nbins=6)
            axes.ticklabel_format(scilimits=(-3, 4))
            if axes.get_legend_handles_labels()[0]:
                axes.legend(frameon=False)
        figure.suptitle(title)
        savefig(figure, path)
