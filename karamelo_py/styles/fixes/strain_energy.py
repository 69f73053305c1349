"""fix strain_energy: the compute of that name, as the 2020 language has it."""

from karamelo_py.scene.modify import Fix
from karamelo_py.styles.computes.strain_energy import StrainEnergy as Measure


class StrainEnergy(Measure, Fix):
    """Measure the stored (elastic) energy of a group of points; published as ID_s and ID.

    Example
    -------
    fix(Es, strain_energy, all)
    log_modify(custom, step, time, Es_s)

    See Also
    --------
    kinetic_energy, compute strain_energy
    """
