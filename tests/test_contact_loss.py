"""Energy that contact at nodes dissipates, against the kinetic energy of the bodies."""

import numpy as np
import pytest

# Bodies without stress: all change of energy is by contact.
HIT = """
method(ulmpm/contacts, FLIP, {basis}, 1)
scheme({scheme})
dimension(2, 0, 10, 0, 10, 1)
region(below, block, 3, 6, 2, 4)
region(above, block, 4, 6, 4.2, 6.2)
material(steel, rigid, 1)
material(soft, linear, 1, 1e-20, 0.3)
solid(a, region, below, 2, soft, 1)
solid(b, region, above, 2, {law}, 1)
group(a, particles, region, below, solid, a)
group(b, particles, region, above, solid, b)
fix(f, contact/friction, a, b, 0.4)
{motion}
compute(E, kinetic_energy, all)
compute(A, kinetic_energy, a)
compute(L, contact_loss, all)
compute(T, transfer_loss, all)
set_dt(0.3)
set_output(1)
log_modify(custom, step, E, A, L, T{more})
run(4)
"""


def test_a_loss_without_contact_is_told(run_interpreted):
    alone = HIT.replace("method(ulmpm/contacts", "method(ulmpm").replace("fix(f, contact", "#")
    script = alone.format(basis="linear", scheme="musl", law="soft", motion="", more="")
    assert (
        "contact_loss 'L': it stays 0, because the scene has no contact at nodes or surfaces"
        in run_interpreted(script).err
    )


def test_a_loss_of_one_solid_is_told(run_interpreted):
    script = HIT.format(basis="linear", scheme="musl", law="steel", motion="", more="")
    gone = "soft", "fix(f", "group(a", "compute(A", "L, T"
    text = "\n".join(x for x in script.splitlines() if not any(word in x for word in gone))
    text = text.replace("run(4)", "fix(v, velocity_particles, b, 0.1, 0)\nrun(1)")
    said = run_interpreted(text).err
    assert "contact_loss 'L': it stays 0" in said
    assert "transfer_loss 'T': it stays 0, because its points are gas, rigid or soil" in said


def test_a_loss_of_rigid_points_is_told(run_interpreted):
    script = HIT.format(basis="linear", scheme="musl", law="steel", motion=LED, more="")
    said = run_interpreted(script.replace("transfer_loss, all", "transfer_loss, b")).err
    assert "transfer_loss 'T': it stays 0" in said and "contact_loss" not in said


FREE = "fix(b, rigid_body, b, velocity=(0.2, -0.9), spin=0.1)"
THROWN = "fix(v, initial_velocity_particles, b, 0.2 - 0.1*(y0 - 5.2), -0.9 + 0.1*(x0 - 5))"
LED = "fix(v, velocity_particles, b, 0.2, -0.9)"


@pytest.mark.parametrize("scheme", ["musl", "usavg", "usf", "usl"])
@pytest.mark.parametrize("basis", ["linear", "quadratic-spline"])
@pytest.mark.parametrize(
    ("law", "motion", "more"),
    [("soft", THROWN, ""), ("steel", FREE, ", b_vx, b_vy, b_wz"), ("steel", LED, ", f_x, f_y")],
    ids=["pair", "free", "led"],
)
def test_contact_takes_what_the_bodies_lose(run_interpreted, law, motion, more, basis, scheme):
    """A block hits another one obliquely, with friction; FLIP 1 loses nothing in the transfer."""
    text = HIT.format(law=law, motion=motion, more=more, basis=basis, scheme=scheme)
    log = run_interpreted(text).log
    energy, work = log.E, 0
    if motion is FREE:  # 4 kg, and sides of two
        energy = log.A + 2 * (log.b_vx**2 + log.b_vy**2 + 2 / 3 * log.b_wz**2)
    if motion is LED:
        energy = log.A
        work = 0.3 * np.cumsum(0.2 * log.f_x - 0.9 * log.f_y)
    assert log.L[-1] > 0.05 * energy[0] + 0.01
    assert energy + log.L + log.T - work == pytest.approx(np.full(5, energy[0]), rel=1e-7, abs=1e-8)
