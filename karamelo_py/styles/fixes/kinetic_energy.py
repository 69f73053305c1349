"""fix kinetic_energy: the compute of that name, as the 2020 language has it."""

from karamelo_py.scene.modify import Fix
from karamelo_py.styles.computes.kinetic_energy import KineticEnergy as Measure


class KineticEnergy(Measure, Fix):
    """Measure the kinetic energy sum m v^2 / 2 of a group of points; published as ID_s and ID.

    Example
    -------
    fix(Ek, kinetic_energy, all)
    log_modify(custom, step, time, Ek_s)

    See Also
    --------
    strain_energy, compute kinetic_energy
    """
