"""Rotation around an axis in implicit steps: nodes have an angle as third unknown.

In axes that rotate with a point, an increment moves the point to the radius r', and its components
31 and 32 are r' dphi/dr and r' dphi/dz. In H these components are dphi/dr and dphi/dz; the
conjugate stress has the torques r' P_31 and r' P_32.
"""

from karamelo_py.compiler.fields import field
from karamelo_py.kernels import implicit
from karamelo_py.kernels.equations.twist import RadiusAfterMove
from karamelo_py.points.kinematics.twist import Twisted, gradient_around


@implicit.radius_of.on(Twisted)
def _radius_twisted(kin, points, p):
    return field(points.fields, RadiusAfterMove)[0, p]


@implicit.gradient_of.on(Twisted)
def _gradient_twisted(kin, u, slopes):
    return gradient_around(kin.Vector._make(u[:2]), u[2], slopes)


@implicit.increment_of.on(Twisted)
def _increment_twisted(kin, H, r):
    after = r * (1 + H[4])
    return H._make([*H[:5], after * H[5], after * H[6], 0, 0])


@implicit.conjugate.on(Twisted)
def _conjugate_twisted(kin, P, H, r):
    after = r * (1 + H[4])
    return P._make([*P[:5], after * P[5], after * P[6], *P[7:]])


@implicit.add_force.on(Twisted)
def _add_force_twisted(kin, start, stress, slopes):
    force = stress.dot(slopes)
    torque = stress[5] * slopes[0] + stress[6] * slopes[1]
    return start._make([start[0] + force[0], start[1] + force[1], start[2] + torque])
