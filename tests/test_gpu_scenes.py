"""Scenes with --gpu that have rows of their own, as in test_gpu_runs."""

import pytest
from selection import few
from test_gpu_runs import alike

OUTPUT = """
dt_factor(0.3)
compute(Ek, kinetic_energy, all)
compute(Es, strain_energy, all)
log_modify(custom, step, dt, time, Ek, Es{more})
set_output(2)
dump(points, all, particle, 5, d.*.LAMMPS, x, vx, s11{T})
dump(nodes, all, grid, 5, g.*.LAMMPS, mass, vx)
run(6)
"""
# A short bar is drawn out.
BAR = """
{method}
dimension(2, 0, 0.4, 0, 0.4, 0.1)
axisymmetric(true)
region(bar, block, 0, 0.1, 0.1, 0.3)
material(rubber, neo-hookean, 1000, 1000, 0.45)
solid(bar, region, bar, 2, rubber, 0.1, 0)
fix(v, initial_velocity_particles, all, 2*x, -4*y)
"""
# Two bodies meet.
PAIR = """
{method}
dimension({d}, 0, 0.5{domain}, 0.1)
region(left, block, 0.1, 0.2{side})
region(right, block, {begin}, {begin} + 0.1{side})
{materials}
solid(left, region, left, 2, left, 0.1, 400)
solid(right, region, right, 2, right, 0.1, 300)
group(left, particles, region, left, solid, left)
group(right, particles, region, right, solid, right)
fix(v1, initial_velocity_particles, left, 0.1{still})
"""
RUBBER = "material({}, neo-hookean, 1000, 1000, 0.3)"
RUBBERS = [RUBBER.format("left"), RUBBER.format("right")]
ON_RIGID = [RUBBER.format("left"), "material(right, rigid, 1000)"]
GASES = [
    "eos(dense, ideal-gas, 1, 1.4, p=1)", "eos(thin, ideal-gas, 0.125, 1.4, p=0.1)",
    "strength(none, fluid, 0)",
    "material(left, eos-strength, dense, none)", "material(right, eos-strength, thin, none)",
]  # fmt: skip
CONDUCTORS = [
    "material(left, linear, 1000, 1000, 0.3, 1, 1000)",
    "material(right, linear, 1000, 1000, 0.3, 2, 2000)",
]
CONTACTS = "method(ulmpm/contacts, FLIP, linear, 0.99)"
FORCES = ", ContactForce_right_x, ContactForce_right_y"


def bar(method):
    return BAR.format(method=method) + OUTPUT.format(more="", T="")


def pair(method, materials, *lines, d=2, begin=0.2, more="", T=""):
    domain, side, still = (", 0, 0.3", ", 0.1, 0.2", ", 0.05") if d == 2 else ("", "", "")
    found = PAIR.format(
        method=method, materials="\n".join(materials), d=d, begin=begin, domain=domain, side=side,
        still=still,
    )  # fmt: skip
    return "\n".join([found, *lines]) + OUTPUT.format(more=more, T=T)


def wet(method):
    return (
        bar(method)
        .replace("axisymmetric(true)", "")
        .replace("solid(", "pore_water(rubber, n=0.4, permeability=0.1, K=1000)\nsolid(", 1)
        .replace(
            "-4*y)",
            "-4*y)\nregion(top, block, -INF, INF, 0.29, INF)\ngroup(top, nodes, region, top, all)\n"
            "region(low, block, -INF, INF, -INF, 0.11)\ngroup(low, nodes, region, low, all)\n"
            "fix(g, body_force, all, 0, -9)\nfix(face, seepage_face, top, 0)\n"
            "fix(rain, flux, low, 0.1, ylo)",
        )
        .replace("Ek, Es", "Ek, Es, face_s, rain_s")
        .replace("vx, s11", "vx, s11, pore_pressure, wx")
    )


SCENES = {
    "water": wet("method(tlmpm, FLIP, linear, 1)"),
    "water and splines": wet("method(ulmpm, FLIP, quadratic-spline, 0.99)"),
    "axis": bar("method(ulmpm, FLIP, linear, 0.99)"),
    "centre": bar("method(ulmpm, FLIP, linear, 0.99)")
    .replace("dimension(2, 0, 0.4, 0, 0.4", "dimension(1, 0, 0.4")
    .replace("axisymmetric", "spherical")
    .replace("0, 0.1, 0.1, 0.3", "0, 0.2")
    .replace("2*x, -4*y", "2*x"),
    "twist": bar("method(ulmpm, AFLIP, quadratic-spline, 0.99)")
    .replace("axisymmetric(true", "axisymmetric(true, twist=true")
    .replace(
        "-4*y)",
        "-4*y, x*sin(9*y))\ngroup(some, nodes, region, bar, all)\n"
        "fix(turn, angular_velocity_nodes, some, time*y0)\n"
        "fix(push, body_force, all, 0, 0, 10*x0)\n"
        "fix(share, force_nodes, some, 0, 0, time)",
    ),
    "friction around an axis": pair(
        CONTACTS,
        RUBBERS,
        "fix(rub, contact/friction, left, right, 0.3)",
        more=", ContactForce_right_x, ContactTorque_right_y",
    )
    .replace("region(", "axisymmetric(true, twist=true)\nregion(", 1)
    .replace("0.1, 0.05)", "0.1, 0.05, x)"),
    "averaged volumes": bar("method(ulmpm, FLIP, linear, 0.99)\nanti_volumetric_locking(true)"),
    "averaged pressure of soil": bar(
        "method(ulmpm, FLIP, linear, 0.99)\nscheme(usavg)\nanti_volumetric_locking(true)"
    ).replace(
        "material(rubber, neo-hookean, 1000, 1000, 0.45)",
        "eos(bulk, linear, 1000, 800)\nstrength(sand, drucker-prager, 400, 0.1, 30)\n"
        "material(rubber, eos-strength, bulk, sand)",
    ),
    "series": bar("method(ulmpm, XPIC, linear, 3)"),
    "loss": pair("method(ulmpm, TPIC, quadratic-spline)", GASES, d=1),
    "heat": pair(
        "method(ulmpm, FLIP, linear, 1, thermo-mechanical)",
        CONDUCTORS,
        "region(face, block, 0.1, 0.12, INF, INF)",
        "group(face, nodes, region, face, all)",
        "fix(hot, temperature_nodes, face, 450 + 100*y)",
        "fix(flux, heat_flux_particles, right, 1000*time)",
        "fix(air, convection_particles, left, 100, 350)",
        T=", T",
        more=", hot_s, flux_s, air_s",
    ),
    "rigid": pair("method(ulmpm, FLIP, linear, 0.99)", ON_RIGID, more=FORCES),
    "contact": pair(
        CONTACTS, RUBBERS, "fix(rub, contact/friction, left, right, 0.3)", begin=0.21, more=FORCES
    ),
    "domains": pair("method(ulcpdi, FLIP, linear, 0.99, R4)", RUBBERS),
    "corners that move": pair("method(ulcpdi, MLS, linear, Q4)", RUBBERS),
    "contact of rigid": pair(CONTACTS, ON_RIGID, more=FORCES),
}


# Friction of bodies is shown around an axis, and of a rigid one.
@pytest.mark.parametrize("name", few(SCENES, *SCENES.keys() - {"contact", "rigid"}))
def test_same_as_processor(run_interpreted, name):
    here = run_interpreted(SCENES[name], folder="here")
    there = run_interpreted(SCENES[name], "--gpu", folder="there")
    alike(here, there, 1e-11)


@pytest.mark.full
@pytest.mark.parametrize("name", SCENES)
def test_same_as_processor_compiled(run_script, name):
    here = run_script(SCENES[name], folder="here")
    there = run_script(SCENES[name], "--gpu", folder="there")
    alike(here, there, 1e-11)
