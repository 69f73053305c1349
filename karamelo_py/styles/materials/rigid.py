"""material rigid: a body that moves as it is told."""

from __future__ import annotations

from typing import Annotated

from karamelo_py.language.signature import Positive
from karamelo_py.points.laws.rigid import Rigid as RigidLaw
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material


class Rigid(Material):
    """A body that moves as it is told, whatever it meets.

    Parameters
    ----------
    rho
        Density.

    Example
    -------
    material(tool, rigid, 1e6)

    Notes
    -----
    Each point keeps the velocity that fix initial_velocity_particles or fix velocity_particles
    gives it. Forces, contact and velocities of nodes do not change it. There is no stress, and no
    limit of the time step but that a point stays within a cell.

    On the grid the body counts with its mass: what shares nodes with it gets the mean velocity by
    mass. Only with a density a hundred times that of what it meets, and more, does that give way
    as if before a rigid body.

    Domains of points that deform with the grid (CPDI, cpgimp) would not stay rigid, and are
    refused.

    See Also
    --------
    material, fix velocity_particles, fix initial_velocity_particles
    """

    def __init__(self, hub: Hub, rho: Annotated[float, Positive]):
        self.law = RigidLaw(1 / rho)
