"""The step of thin and round bodies in the total frame: by the frequency of their light nodes."""

from math import sqrt

import pytest

# A plate with its lower face on a line of nodes and no Poisson's ratio. Its rows of points give
# the upper nodes T/2 of the mass and have slopes 1/h, so that w^2 = (c/h)^2 / (T/2 (1 - T/2)),
# above the 4 (c/h)^2 of waves along it: it is stable below 2/w.
PLATE = """
h = 0.1
method(tlmpm, TRANSFER)
scheme(SCHEME)
dimension(2, 0, 2, 0, 1, h)
region(b, block, 0.5, 1, 0.4, 0.4 + T*h)
material(m, linear, 1000, 1e7, 0)
solid(s, region, b, 2, m, h, points=cut)
region(end, block, -INF, 0.5, -INF, INF)
group(end, nodes, region, end, all)
fix(clamp, velocity_nodes, end, 0, 0)
fix(g, body_force, all, 0, -0.01)
compute(S, strain_energy, all)
log_modify(custom, step, dt, S)
set_output(10)
run(90)
"""


def _run(run_interpreted, transfer, scheme="musl", thickness=0.5):
    script = PLATE.replace("TRANSFER", transfer).replace("SCHEME", scheme)
    return run_interpreted(script.replace("T*h", f"{thickness}*h"))


@pytest.mark.parametrize(
    "transfer, thickness",
    [
        ("APIC, linear", 0.5),
        ("TPIC, linear", 0.25),
        pytest.param("MLS, linear", 0.5, marks=pytest.mark.full),
        ("AFLIP, linear, 1", 0.1),
    ],
)
def test_the_own_step_bears_a_thin_plate(run_interpreted, transfer, thickness):
    done = _run(run_interpreted, transfer, thickness=thickness)
    light = thickness / 2
    assert done.log["dt"][-1] == pytest.approx(
        0.9 * 2 * sqrt(light * (1 - light)) * 0.1 / 100, rel=0.001
    )
    assert "light_nodes" in done.out and "nowhere" not in done.err


def test_flip_needs_no_smaller_step(run_interpreted):
    """Its points average the motion of light nodes away."""
    done = _run(run_interpreted, "FLIP, linear, 1")
    assert (
        done.log["dt"][-1] == pytest.approx(0.9 * 0.1 / 100, rel=1e-3) and "nowhere" not in done.err
    )


def test_usl_bears_a_round_body(run_interpreted):
    """A limit of the strain at light nodes made what comes back through moments grow."""
    done = run_interpreted("""
method(tlmpm, APIC, linear)
scheme(usl)
dimension(2, -2, 2, -2, 2, 0.5)
region(disk, cylinder, 0.185, 0.305, 1)
material(rubber, neo-hookean, 1000, 1e6, 0.3)
solid(disk, region, disk, 2, rubber, 0.5)
fix(start, initial_velocity_particles, all, 0.75*(x0 - 0.185), 0.75*(y0 - 0.305))
compute(Ek, kinetic_energy, all)
compute(Es, strain_energy, all)
log_modify(custom, step, Ek, Es)
set_output(10)
run(60)
""")
    energy = done.log["Ek"] + done.log["Es"]
    assert energy.max() < 1.1 * energy[0] and "nowhere" not in done.err
