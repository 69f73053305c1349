"""Scenes that go on from their files: all parts that a run changes, and how to go on from them."""

import re
import shutil
from pathlib import Path
from textwrap import dedent

import h5py
import numpy as np
from scenes import H, block
from test_boundary import thrown
from test_columns_karamelo import sheared
from test_contact_grid import bars
from test_contact_points import bodies
from test_heat import HOT, slab
from test_laws_rigid import scene as pushed
from test_laws_scripts import ALL, pulled
from test_walls import scene as rubbed

EVERY = "restart(2, r.*.h5)\n"
SIZE = (0.3, 0.1)


def arrays(path: Path) -> dict[str, np.ndarray]:
    """All that a file in HDF5 holds, by name."""
    found = {}

    def keep(name, item):
        if isinstance(item, h5py.Dataset):
            found[name] = item[()]

    with h5py.File(path, swmr=True) as root:
        root.visititems(keep)
    return found


def same_files(one: Path, other: Path) -> None:
    """Two folders hold the same files, byte by byte."""
    names = {path.name for path in one.iterdir()} - {"out", "run.json"}
    assert names == {path.name for path in other.iterdir()} - {"out", "run.json"}
    for name in names:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name


def with_files(script: str, line: str = EVERY) -> str:
    """A script that writes files to go on from, from its first run on."""
    text, count = re.subn("^run", f"{line}run", dedent(script), count=1, flags=re.M)
    assert count
    return text


def goes_on(run, script: str, *, files: int = 1) -> Path:
    """Run a script, and once more from some of the files that it wrote; all is the same."""
    whole = run(script, folder="whole").folder
    written = sorted(whole.glob("r.*.h5"), key=lambda path: int(path.name.split(".")[1]))
    assert len(written) > 1
    for file in written[: -1 : max(1, (len(written) - 1) // files)][:files]:
        again = whole.with_name("again")
        shutil.rmtree(again, ignore_errors=True)
        shutil.copytree(whole, again)
        said = run(script, "-restart", file.name, folder="again")
        assert "continued from step" in said.out
        same_files(whole, again)
    return whole


RUBBING = bars(
    0.0, "fix(rub, contact/friction, a, b, 0.3)", "compute(lost, contact_loss, all)",
    "log_modify(custom, step, rub_x, va_x, lost)",
    "fix(slide, initial_velocity_particles, b, -0.1, 0.3)", "run(4)", d=2, scheme="usavg", v=2,
)  # fmt: skip
TOOLS = (
    "fix(F, indent/minimize_penetration, all, sphere, 0.1, 0.45, 0.55, 0, 3, 0, 0, 0.2)",
    "fix(W, contact/minimize_penetration/plane, body, 0.32, 0, 0, 1, 0, 0, 0.3)",
    "fix(I, indent, all, sphere, 500, 0.13, 0.45, 0.55, 0)",
    "fix(C, cuttingtool, all, 0.1, 0.35 + time, 0.36, 0, -1, 0, 0, 0.4, 0.5, 0.6, 0.36)",
    "region(low, block, 0, 1, 0, 0.32)",
    "fix(S, contact/surface, all, low, 0.3, 9*time^2, 0)",
    "log_modify(custom, step, F_x, W_x, I_y, C_x, S_x)", "set_dt(0.001)", "run(4)",
)  # fmt: skip
GROUPS = """\
region(low, block, 0.3, 0.3, 0.3, 0.5)
group(low, nodes, region, low, all)
group(half, particles, region, box, solid, body)
fix(hold, velocity_nodes, low, 0.1*time, 0)
fix(g, body_force, all, 0, -1)
fix(push, force_nodes, low, 1, 0)
fix(check, check_solution, all, 0.1*time*x0, 0)
fix(v, initial_velocity_particles, all, sin(9*x0), 0)
compute(R, reaction, low)
compute(L, angular_momentum, all)
compute(P, linear_momentum, all)
compute(E, energy_balance, all)
compute(G, transfer_loss, all)
compute(err, error, all, ux, 0.1*time*x0, L2)
compute(p, probe, all, x, point=3)
pull = internal_force(half, x) + external_force(low, x)
log_modify(custom, step, R_x, L_drift, P_drift, E_drift, err_history, err_max, p, check_z, pull, G)
set_output(time(0.004))
plot(e, 2, time, E)
save_plot(e.svg)
"""
LOADS = (
    "fix(F, force_particles, all, 2*time, -1)", "fix(T, edge_traction, all, box, xhi, 0.2, y*time)",
    "fix(P, edge_pressure, all, box, 5*time)", "fix(calm, local_damping, all, 0.8)",
    "fix(Ek, kinetic_energy, all)", "fix(Es, strain_energy, all)",
    "compute(E, energy_balance, all)", "set_output(1)",
    "log_modify(custom, step, dt, limit, F_y, T_x, P_x, E_drift, Ek, Es)", "run(4)",
)  # fmt: skip
PYTHON = """\
fix(v, initial_velocity_nodes, all, 0.2*sin(9*x0), 0)
fix(push, python, all, pumps.push)
region(everywhere, block, INF, INF, INF, INF)
group(nodes, nodes, region, everywhere, all)
fix(brake, python, nodes, pumps.brake)
log_modify(custom, step, push_x, push_y, brake)
"""
# Tools of Karamelo, of which one needs space, and computes of points: all in a few points.
BENCH = """\
region(face, block, 0.46, INF, INF, INF, INF, INF)
group(face, particles, region, face, all)
fix(s, initial_stress, all, 3*x0, 1, 0, 0, 0, -2*y0)
fix(v, initial_velocity_particles, all, sin(9*x0), 0, y0)
fix(M, meldtool, all, 0.1, y, 0.03, 0.4, 0.35, 10*time, 0.31, 2, 0.12)
fix(W, impenetrablesurface, all, 0.5, 0.42, 0.36, 0.35, 3, 4, time)
fix(T, neumann_bc_mech, face, -7*time, 1, NULL)
compute(s, average_stress, face)
compute(c, center_of_mass, face)
compute(q, position_quantile, all, 0.8)
compute(m, max_position, all)
compute(FO, force_on, W)
compute(m0, min_position, all)
compute(r, reference, all, ../curve.csv, vx)
compute(now, reference, c_x, ../curve.csv, vx, max, relative)
log_modify(custom, step, M_x, W_x, T_x, FO_x, FO_px, s_11, c_z, q_x, m_z, r, now)
set_dt(0.001)
run(4)
"""
CURVE = "x, vx\n0, 0\n0.4, 0.5\n2, 1\n"
FACE = """
    group(face, particles, region, end, all)
    region(other, block, 0.9, 1)
    group(other, particles, region, other, all)
    fix(hold, temperature_particles, face, 301 + time)
    fix(lamp, heat_flux_particles, other, 7*time)
    fix(air, convection_particles, other, 0.01, 200)
    fix(sun, edge_heat_flux, all, slab, 3*time)
    fix(wind, edge_convection, all, slab, 0.02, 200)
"""
FLUIDS = """
method(ulmpm, TFLIP, quadratic-spline, 0.98)
scheme(usl/unlimited)
dimension(1, 0, 1, 0.1)
region(left, block, 0.2, 0.4)
region(right, block, 0.6, 0.8)
eos(water, fluid, 2, 100, 7)
strength(thin, fluid, 0.1)
material(water, eos-strength, water, thin)
eos(air, ideal-gas, 1.2, 1.4, p=10)
material(air, eos-strength, air, thin)
solid(water, region, left, 2, water, 0.1)
solid(air, region, right, 2, air, 0.1)
region(last, block, 0.8, 0.9)
eos(tnt, jwl, 2, 500, 5, 4, 1, 0.3, 5, 30, Q1=1.5)
material(tnt, eos-strength, tnt, thin)
solid(tnt, region, last, 2, tnt, 0.1)
region(first, block, 0, 0.2)
eos(stone, linear, 2, 100)
eos(rock, p-alpha, stone, 1.2, 0.1, 5)
damage(spall, tuler-butcher, 0.1, 1, 0.01)
material(rock, eos-strength, rock, thin, spall)
solid(rock, region, first, 2, rock, 0.1)
region(between, block, 0.4, 0.6)
eos(gas, formula, 1.2, 0.4*E/J, E=25)
material(gas, eos-strength, gas, thin)
solid(gas, region, between, 2, gas, 0.1)
region(middle, block, 0.4, 0.5)
eos(gel, stiffened-gas, 2, 4, 20, p=1)
damage(gel, formula, max(s1 - p, 0)/9)
material(gel, eos-strength, gel, thin, gel)
solid(gel, region, middle, 2, gel, 0.1)
region(other, block, 0.5, 0.6)
eos(iron, mie-grueneisen, 2, 7, 1.5, 2, Q1=1.5)
damage(iron, cochran-banner, 0.1, 0.01)
strength(iron, plastic, 50, 0.2)
material(iron, eos-strength, iron, iron, iron)
solid(iron, region, other, 2, iron, 0.1)
fix(light, detonation, all, (x0 - 0.8)/30)
fix(v, initial_velocity_particles, all, sin(9*x0))
run(4)
"""
FLOWS = {
    "a": "zerilli-armstrong, 80, 0.4, 0.2, 0, 0.0028, 0.000115, 0.3, 0.5",
    "b": "tabulated, 80, 0, 0.4, 1, 0.9",
    "c": "tabulated, 80, 0, 0.4, 0.5, 0.65, 1, 0.9",
    "d": "formula, 80, 0.4 + 0.5*ep + 0.01*epdot",
    "e": "mu-i, 80, 0.382, 0.643, 0.279, 1, 2",
    "f": "drucker-prager, 80, 0.1, 30, 5, fit=plane-strain",
    "g": "mohr-coulomb, 80, 0.1, 30, 5",
    "h": "swift, 80, 0.4, 0.5, 0.01, 0.5",
    "i": "linear, 80",
    "j": "johnson-holmquist-2, 80, 0.9, 0.6, 0.3, 0.6, 0, 1, 0.2, 2.8, 1.5, 0.005, 1",
    "k": "steinberg-guinan, 80, 0.2, 36, 0.45, 0.7, 0.03, 0.0004",
    "l": "mts, 46, 0.04, 0.0008, 1.6, 1e7, 0.67, 1, 2.4, 0.9, 0.35, 1e8, 0.1",
    "m": "norton, 80, 10, 4",
    "n": "perzyna, 80, 0.3, 0.5, 0.03, 5",
    "o": "hjc, 80, 0.8, 1.6, 0.6, 0, 1, 0.5, 0.1, 7, 0.04, 1, 0.01",
    "p": "crushable-foam, 80, 0.4, 0.1",
    "q": "gurson, 80, 0.4, 0.01, 0.1, 0.01",
}


ELASTIC = {
    "a": "hyperelastic, 2, 20*(I1*J^(-2/3) - 3) + 50*(J - 1)^2",
    "b": "mooney-rivlin, 2, 15, 5, 100",
    "c": "ogden, 2, 100, 60, 1.3, -10, -2",
    "d": "yeoh, 2, 100, 20, -1",
    "e": "gent, 2, 40, 20, 100",
    "f": "saint-venant-kirchhoff, 2, 50, 40",
    "g": "orthotropic, 2, 100, 50, 50, 0.2, 0.2, 0.3, 40, 40, 20, 30",
    "h": "transverse, 2, 100, 0.3, 50, 0.1, 30, 30, 90",
    "i": "yeoh, 2, 100, 20)\nviscosity(prony, i, g=(0.3, 0.2), tau=(0.01, 0.1)",
    "j": "arruda-boyce, 2, 40, 5, 100",
    "k": "holzapfel, 2, 40, 20, 1, 100, fibre=(0.6, 0.8, 0)",
    "l": "mullins, d, 2, 5",
    "m": "hyperelastic, 2, 0.06*T*(I1*J^(-2/3) - 3) + 50*(J - 1)^2, cp=1, kappa=0",
    "n": "neo-hookean, 2, 60, 0.3, 1, 0)\n"
    "viscosity(prony, n, g=0.3, tau=0.01, wlf=(17, 52, 293))\nviscosity(newtonian, n, 0.1",
    "o": "jointed, 2, 100, 0.3, 0.1, 30, 30, 90, psi=5, matrix_cohesion=0.2, matrix_phi=20",
    "p": "linear, 2, 100, 0.3",
    "q": "hill, p, flow, 30, R=(1.8, 1.3, 2.1)",
    "r": "tsai-hill, g, 0.6, 0.3, 0.3, 30",
    "s": "holzapfel, 2, 40, 20, 1, 100, fibre=(y0, 1 - x0, 0), fibre2=(1, 0, 0)",
    "u": "orthotropic, 2, 100, 50, 50, 0.2, 0.2, 0.3, 40, 40, 20, axes=(90*x0 + 30)",
    "t": "hashin, g, 0.6, 0.5, 0.3, 0.4, 0.3, 0.2, 30",
}


def of_laws(method: str, laws: dict[str, str], thin: str = "false") -> str:
    """One point for each law, strengths or materials, pulled and sheared."""
    lines = [f"method({method})", f"dimension(2, 0, {len(laws) / 10 + 0.1}, 0, 0.3, {H})",
             f"plane_stress({thin})", "eos(bulk, linear, 8, 160)",
             "strength(flow, johnson_cook, 40, 0.1, 0.2, 0.4, 1, 0.01, 0, 293, 900)"]  # fmt: skip
    for k, (name, law) in enumerate(laws.items()):
        lines += [
            f"region({name}, block, {k / 10}, {(k + 1) / 10}, 0.1, 0.2)",
            *(
                [f"strength({name}, {law})", f"material({name}, eos-strength, bulk, {name})"]
                if laws is FLOWS
                else [f"material({name}, {law})"]
            ),
            f"solid({name}, region, {name}, 1, {name}, {H})",
        ]
    lines += [
        "region(everywhere, block, INF, INF, INF, INF)",
        "group(nodes, nodes, region, everywhere, all)",
        "fix(pull, velocity_nodes, nodes, x0 + y0, -x0)",
        f"dump(d, all, particle, 1, d.*.txt, s11, s12{', ep, epdot' * (laws is FLOWS)})",
        "set_dt(0.003)",
        "run(4)",
    ]
    return "\n".join(lines)


IMPLICIT = (
    "region(floor, block, -INF, INF, -INF, 0.301)", "group(floor, nodes, region, floor, all)",
    "fix(hold, velocity_nodes, floor, 0, 0)", "fix(g, body_force, all, time, -time)",
    "set_dt(0.5)", "set_output(1)", "log_modify(custom, step, iterations, residual, hold_y)",
    "run(4)",
)  # fmt: skip
SWAYS = (
    "fix(v, initial_velocity_particles, all, 3*sin(9*x0), 1)", "set_output(1)",
    "log_modify(custom, step, dt, time)", "run(6)",
)  # fmt: skip
EDGES = (
    "region(low, block, -INF, INF, -INF, 0.301)", "group(low, nodes, region, low, all)",
    "fix(out, absorbing, low, rubber, ylo)", "fix(start, geostatic_stress, all, k0=0)",
    "fix(sponge, mass_damping, all, 9*(0.6 - y0))",
    "fix(v, initial_velocity_particles, all, sin(9*x0), -y0)", "set_output(1)",
    "log_modify(custom, step, time, out_x, out_y, sponge_x)", "run(4)",
)  # fmt: skip
WET = """
pore_water(rubber, n=0.4, permeability=0.1, K=1000, rho=1, kozeny=true)
solid("""
WATER = (
    "region(top, block, -INF, INF, 0.39, INF)", "group(top, nodes, region, top, all)",
    "fix(table, initial_pore_pressure, all, 9*(0.4 - y0))",
    "fix(drain, pore_pressure, top, 3*time)", "region(low, block, -INF, INF, -INF, 0.31)",
    "group(low, nodes, region, low, all)", "fix(rain, flux, low, 0.1, ylo)",
    "region(side, block, -INF, 0.31, -INF, INF)", "group(side, nodes, region, side, all)",
    "fix(face, seepage_face, side, 0)", "fix(g, body_force, all, 0, -9)",
    "compute(p, probe, all, pore_pressure)",
    "fix(v, initial_velocity_particles, all, sin(9*x0), -y0)", "set_output(1)",
    "dump(d, all, particle, 2, d.*.txt, wx, wy, pore_pressure, porosity)",
    "log_modify(custom, step, time, p, drain_s, rain_s, face_s)", "run(4)",
)  # fmt: skip
FREE = (
    "region(above, block, 0.4, 0.6, 0.41, 0.61)", "material(steel, rigid, 6)",
    f"solid(b, region, above, 1, steel, {H})",
    "fix(b, rigid_body, b, velocity=(0.2, -0.9), spin=0.1, gravity=(0, -9*time))",
    "fix(touch, contact/rigid_body, all, b, 0.4)", "set_output(1)", "set_dt(0.003)",
    "log_modify(custom, step, b_x, b_vy, b_rz, b_wz, touch_x, touch_y)", "run(4)",
)  # fmt: skip
LINKED = (
    "region(above, block, 0.4, 0.6, 0.45, 0.65)", "material(steel, rigid, 6)",
    f"solid(b, region, above, 1, steel, {H})", "region(wall, block, 0.61, 0.8, 0.3, 0.8)",
    "fix(b, rigid_body, b, velocity=(3, 0), spin=0.1)",
    "fix(meet, contact/bodies, b, wall, mu=0.2)",
    "fix(pull, joint, spring, b, at=(0.5, 0.5), end=(0.3, 0.8), stiffness=20)", "set_output(1)",
    "set_dt(0.003)", "log_modify(custom, step, b_x, b_vx, b_rz, meet_x, pull_x)", "run(4)",
)  # fmt: skip
SERIAL = {  # scenes that one process takes
    "load steps": block(2, "scheme(quasi-static)", *IMPLICIT, size=SIZE),
    "large steps": block(2, "scheme(newmark)", *IMPLICIT, size=SIZE),
    "logarithmic strains": block(2, *SWAYS, size=SIZE).replace(
        "rubber, linear,", "rubber, hencky,"
    ),
    "clay": block(2, *SWAYS, size=SIZE).replace(
        "rubber, linear, 2, 100, 0.3", "rubber, cam-clay, 2, 40, 1, 0.1, 0.02, 1"
    ),
    "pressure solved for": block(2, *WATER, scheme="semi-implicit", size=SIZE)
    .replace("\nsolid(", WET, 1)
    .replace("ulmpm", "tlmpm"),
    "rigid body that moves freely": block(2, *FREE, size=SIZE),
    "rigid bodies that meet": block(2, *LINKED, size=SIZE),
    "points that go": block(2, "fix(e, erosion, all, x > 0.55, every=2)", *SWAYS, size=SIZE),
}
SCENES = {
    "water in pores": block(2, *WATER, transfer="FLIP quadratic", size=SIZE).replace(
        "\nsolid(", WET, 1
    ),
    "loads": block(2, *LOADS, size=SIZE),
    "loads in the total frame": block(2, *LOADS, size=SIZE).replace("ulmpm", "tlmpm"),
    "wall that rubs": rubbed().replace("run_time(0.2)", "run(4)"),
    "rigid": pushed().replace("run_time(3)", "set_dt(0.05)\nrun(16)"),
    "rigid by a formula": pushed("ulmpm/contacts").replace("initial_velocity_particles, tool, 0.5",
        "velocity_particles, tool, 0.2*time").replace("run_time(3)", "run(4)"),
    "flow": of_laws("ulmpm, FLIP, linear, 1", FLOWS),
    "flow in the total frame": of_laws("tlmpm, APIC, linear", FLOWS),
    "flow with averaged volumes": of_laws("ulmpm, FLIP, linear, 1", FLOWS).replace(
        "dimension(", "scheme(usf)\nanti_volumetric_locking(true)\ndimension("
    ),
    "elastic laws": of_laws("tlmpm, PolyPIC, linear", ELASTIC, "true"),
    "heat flux in shocks": block(
        1, "fix(v, initial_velocity_particles, all, -x0)", "run(4)", size=(0.3,)
    )
    .replace("FLIP, linear, 1", "PolyPIC/quadratic, cubic-spline, thermo-mechanical")
    .replace("material(rubber, linear, 2, 100, 0.3)",
        "eos(gas, ideal-gas, 2, 5/3, p=1, Q1=1, Qh=3)\nstrength(none, fluid, 0)\n"
        "material(rubber, eos-strength, gas, none)"),
    "rate of plastic strain": sheared(", epdot"),
    "step that varies": block(
        2, "fix(v, initial_velocity_particles, all, 5*sin(9*x0), 3)", "set_output(1)",
        "fix(g, body_force, all, 100*time, 0)", "log_modify(custom, step, dt, time, limit)",
        "run(3)", "run_time(0.02)", scheme="usf, start=half",
    ).replace("FLIP, linear, 1", "FLIP/per-time, linear, 0.9"),
    "friction": RUBBING,
    "points that touch": bodies(
        -0.01, "contact/minimize_penetration, a, b, 0.2", "log_modify(custom, step, c_x)", "run(4)",
        d=2, n=2,
    ),
    "faces that touch": bodies(
        -0.01, "contact/solids, a, b, 0.2", "log_modify(custom, step, c_x)", "run(4)", d=2, n=2
    ),
    "Hertz": bodies(
        -0.01, "contact/hertz, a, b", "log_modify(custom, step, c_x)", "run(4)", d=2, n=2
    ),
    "heat": slab(HOT.format("301 + time"), ", hot_s", "run(4)"),
    "heat in the total frame": slab(HOT.format(301), ", hot_s", "run(4)").replace(
        'kind = "ulmpm"', 'kind = "tlmpm"'
    ),
    "metal": pulled(ALL).replace("run(50)", "run(6)"),
    "anti locking": block(
        2, "anti_volumetric_locking(true)", "fix(v, initial_velocity_particles, all, sin(9*x0), 0)",
        "run(4)", size=SIZE,
    ),
    "single": "precision(single)\n" + block(
        2, "fix(v, initial_velocity_particles, all, sin(9*x0), 0)", "run(4)", size=SIZE
    ),
    "deleted": thrown(2, "delete", "run(8)", "run(12)"),
    "reflected": thrown(2, "reflect", "run(8)", "run(12)"),
    "tools": block(2, *TOOLS),
    "groups": block(2, GROUPS, "run(7)", size=SIZE),
    "functions in Python": block(2, PYTHON, "run(5)", size=SIZE),
    "bench": block(3, BENCH, size=(0.2, 0.1, 0.1)),
    "sphere": block(
        1, "fix(v, initial_velocity_particles, all, 3*sin(9*x0))",
        "fix(p, edge_pressure, all, box, 9)",
        "dump(d, all, particle, 2, d.*.txt, x, s11, s22, s33, volume)", "set_output(1)",
        "log_modify(custom, step, dt, time, p_x)", "run(4)",
    ).replace("region(box", "spherical(true)\nregion(box"),
    "twist": block(
        2, "region(low, block, -INF, INF, -INF, 0.301)", "group(low, nodes, region, low, all)",
        "fix(v, initial_velocity_particles, all, 0.2*sin(9*x0), y0, x0)",
        "fix(grip, angular_velocity_nodes, low, 3*time)",
        "dump(d, all, particle, 2, d.*.txt, x, vtheta, twist, s12, s13, s23)", "set_output(1)",
        "log_modify(custom, step, dt, time, grip_s)", "run(4)", size=SIZE,
    ).replace("region(box", "axisymmetric(true, twist=true)\nregion(box"),
    "faces with heat": slab(FACE, ", lamp_s, air_s", "run(4)"),
    "fluids": FLUIDS,
    "ground": block(2, *EDGES, size=SIZE),
    "shaken ground": block(
        2, "region(low, block, -INF, INF, -INF, 0.301)", "group(low, nodes, region, low, all)",
        "fix(edge, absorbing, low, rubber, ylo)", "fix(s, initial_stress, all, 1, 2, 0, 1, 0, 0)",
        "fix(quake, ground_motion, low, 9*sin(90*time), NULL, through=edge)",
        "fix(shock, ground_motion, low, NULL, 3)",
        "set_output(1)", "log_modify(custom, step, quake_x, quake_vx, shock_y, shock_vy)", "run(4)",
        size=SIZE,
    ),
    "stages": block(
        2, "region(more, block, 0.3, 0.5, 0.5, 0.6)",
        "solid(fill, region, more, 2, rubber, 0.1)",
        "group(fill, particles, region, more, all)", "deactivate(fill)",
        "fix(u, displacement, all)", "dump(d, all, particle, 2, d.*.txt, x, y, ux, uy)",
        *SWAYS[:-1],
        "run(4)", "activate(fill)", "run(4)", size=SIZE,
    ),
    "inflow": block(
        2, "region(nozzle, block, 0.1, 0.2, 0.3, 0.5)",
        "solid(jet, region, nozzle, 2, rubber, 0.1)",
        "fix(feed, inflow, jet, 2, 0, until=0.1)", "region(end, block, 0.55, INF, INF, INF)",
        "fix(out, outflow, all, end, every=3)", "dump(d, all, particle, 2, d.*.txt, id, x, y, vx)",
        "set_output(1)", "log_modify(custom, step, time, feed_points, feed_mass, feed_x, out_mass)",
        "run(30)", size=SIZE,
    ).replace("linear, 2, 100", "linear, 2, 500"),
    "corrected accelerations": block(
        2, "region(low, block, -INF, INF, -INF, 0.301)", "group(low, nodes, region, low, all)",
        "fix(hold, velocity_nodes, low, NULL, 0)", *SWAYS, transfer="APIC", size=SIZE,
    ).replace("spline)", "spline, mass=corrected)"),
}  # fmt: skip
OUTPUTS = """\
dump(d1, all, particle, 2, all.txt, x, y, s11)
dump(d2, all, particle/gz, 2, all.gz, x, y, s11)
dump(d3, all, particle/bin, 3, all.bin, x, y)
dump(d4, all, hdf5, time(0.01), points.h5, x, y, s11)
dump(d5, all, grid/hdf5, 3, nodes.h5, vx, mass, occupied=true)
dump(raster, all, heights, 2, all.*.asc, 0.2)
dump(d6, all, vtk, 4, p.*.vtu, vx)
dump(d7, all, movie, 3, m.gif, 60, 60, vx)
dump(d8, all, grid, 3, g.*.txt, vx, fx, mass)
dump(d9, all, grid/gz, 3, g.*.gz, vx, mass)
dump(e1, all, grid/bin, 3, g.*.bin, vx, mass)
dump(e2, all, grid/vtk, 4, g.*.vtu, vx)
dump(e3, all, pyplot, 8, p.*.png, 1, 1, vx)
"""
FLY = block(2, "fix(v, initial_velocity_particles, all, sin(9*x0), 0)", "set_dt(0.001)", "run(4)",
            size=(0.2, 0.1))  # fmt: skip
