"""Units of a scene, for labels."""

import re
from collections.abc import Mapping
from math import isclose, log10
from typing import Any, NamedTuple

# Value in SI units.
LENGTHS = {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "in": 0.0254}
MASSES = {"kg": 1.0, "t": 1e3, "g": 1e-3, "mg": 1e-6, "ug": 1e-9, "lb": 0.45359237}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}

PREFIXES = {-12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}


class Powers(NamedTuple):
    length: int = 0
    mass: int = 0
    time: int = 0
    temperature: int = 0


NUMBER, LENGTH, TEMPERATURE = Powers(), Powers(1), Powers(0, 0, 0, 1)
DENSITY, VELOCITY, STRESS = Powers(-3, 1), Powers(1, 0, -1), Powers(-1, 1, -2)
FORCE, ENERGY = Powers(1, 1, -2), Powers(2, 1, -2)
NAMED = {FORCE: "N", STRESS: "Pa", ENERGY: "J", Powers(2, 1, -3): "W"}

# Dimension of each column of dumps and word of the log.
COLUMNS = {
    r"[xyz]0?": LENGTH,
    r"v[xyz](_update)?": VELOCITY,
    r"[st][123]{2}|seq|p|pore_pressure": STRESS,
    r"[fb][xyz]": FORCE,
    r"volume": Powers(3),
    r"rho": DENSITY,
    r"mass": Powers(0, 1),
    r"ienergy": ENERGY,
    r"epdot": Powers(0, 0, -1),
    r"T": TEMPERATURE,
    r"time|dt": Powers(0, 0, 1),
}


class Units(NamedTuple):
    length: str
    mass: str
    time: str
    temperature: str = "K"

    def __str__(self) -> str:
        return " ".join(self)

    def si(self, powers: Powers) -> float:
        si = LENGTHS[self.length] ** powers.length * MASSES[self.mass] ** powers.mass
        return si * TIMES[self.time] ** powers.time

    def name(self, powers: Powers) -> str:
        if powers in NAMED:
            order = log10(self.si(powers))
            if isclose(order, round(order), abs_tol=1e-9) and round(order) in PREFIXES:
                return PREFIXES[round(order)] + NAMED[powers]
        parts = [
            (unit if abs(power) == 1 else f"{unit}^{abs(power)}", power)
            for unit, power in zip(self, powers, strict=True)
            if power
        ]
        above = " ".join(factor for factor, power in parts if power > 0)
        below = " ".join(factor for factor, power in parts if power < 0)
        if not below:
            return above
        return f"{above or 1}/{f'({below})' if ' ' in below else below}"

    def of_column(self, name: str) -> str:
        powers = (powers for names, powers in COLUMNS.items() if re.fullmatch(names, name))
        return self.name(next(powers, Powers()))

    def of_value(self, name: str, parts: Mapping[str, Any]) -> str:
        for ID, publisher in parts.items():
            if name in (ID, *(f"{ID}_{end}" for end in publisher.published)):
                return self.name(publisher.unit)
        return self.of_column(name) if name in ("time", "dt") else ""


def time_text(time: float, unit: str) -> str:
    factor, unit = suited(unit, time, TIMES)
    return f"{time * factor:.6g} {unit}".rstrip()


def suited(unit: str, size: float, units: Mapping[str, float]) -> tuple[float, str]:
    """Return the factor and name of a metric unit that suits a `size` given in `unit`.

    The unit is the largest metric unit in which `size` is at least 0.1, or else the smallest unit.
    If `size` is 0 or from 0.1 to 10^4, or if `unit` is not metric, `unit` is returned with the
    factor 1.
    """
    metric = {name: si for name, si in units.items() if isclose(log10(si) % 3, 0, abs_tol=1e-9)}
    if unit not in metric or not size or 0.1 <= size < 1e4:
        return 1.0, unit
    si = abs(size) * metric[unit]
    names = sorted(metric, key=lambda name: -metric[name])
    best = next((name for name in names if si >= 0.1 * metric[name]), names[-1])
    return metric[unit] / metric[best], best.replace("u", "µ")


def labelled(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit else name
