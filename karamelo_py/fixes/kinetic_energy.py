"""fix kinetic_energy: the compute of that name, as the 2020 language has it."""

from __future__ import annotations

from karamelo_py.computes.kinetic_energy import KineticEnergy as Measure
from karamelo_py.modify import Fix


class KineticEnergy(Measure, Fix):
    """Measure the kinetic energy sum m v^2 / 2 of a group of points; published as ID_s and ID.

    Parameters
    ----------
    group
        Group of points, or ``all``.

    Example
    -------
    fix(Ek, kinetic_energy, all)
    log_modify(custom, step, time, Ek_s)

    See Also
    --------
    strain_energy, compute kinetic_energy
    """
