"""fix kinetic_energy and strain_energy: computes, which the language of 2020 has as fixes."""

from karamelo_py.scene.modify import Fix
from karamelo_py.styles.computes import kinetic_energy, strain_energy


class KineticEnergy(kinetic_energy.KineticEnergy, Fix):
    """Measure the kinetic energy sum m v^2 / 2 of a group of points; published as ID_s and ID.

    Example
    -------
    fix(Ek, kinetic_energy, all)
    log_modify(custom, step, time, Ek_s)

    See Also
    --------
    strain_energy, compute kinetic_energy
    """


class StrainEnergy(strain_energy.StrainEnergy, Fix):
    """Measure the stored (elastic) energy of a group of points; published as ID_s and ID.

    Example
    -------
    fix(Es, strain_energy, all)
    log_modify(custom, step, time, Es_s)

    See Also
    --------
    kinetic_energy, compute strain_energy
    """
