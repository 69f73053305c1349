"""compute average_stress."""

import numpy as np

from karamelo_py.output.fields import COMPONENTS
from karamelo_py.scene.modify import Compute


class AverageStress(Compute):
    """Measure the mean Cauchy stress, published as ID_11, ID_22, ID_33, ID_12, ID_13, ID_23.

    Example
    -------
    compute(s, average_stress, all)
    log_modify(custom, time, s_11, s_12)

    Notes
    -----
    The mean is over the present volume: sum V sigma / sum V, which for a body at rest follows from
    the forces on its surface alone. 0 for a group without points.

    See Also
    --------
    strain_energy, average_velocity
    """

    published = COMPONENTS

    def refresh(self) -> None:
        """Measure and publish."""
        fields = self.hub.fields
        chosen = np.isin(fields.particle("id") - 1, fields.members(self.group))
        volume = fields.particle("volume")[chosen]
        total = volume.sum()
        for component in COMPONENTS:
            stress = fields.particle("s" + component)[chosen]
            self.publish(component, float(volume @ stress) / total if total > 0 else 0.0)
