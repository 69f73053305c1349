"""Words of other programs, above all of LAMMPS, and what says the same here."""

_FILL = "solid(ID, region, regionID, ppc, material, h, 0) fills a region with points"
_LAW = "material(ID, linear, rho, E, nu) makes a material, and solid(...) uses it"
_COLUMNS = "log_modify(custom, step, time, ...) names the columns of the log"
_DOMAIN = "dimension(2, xlo, xhi, ylo, yhi, h) makes the domain and its grid"
_VELOCITY = "fix(ID, initial_velocity_particles, group, vx, vy, vz) sets velocities"
_NEEDLESS = "leave it out"
_FILLED = "region(box, {}, ...) and solid(ID, region, box, ppc, material, h, 0): a region is filled"

# Commands of Karamelo, whose names its scripts cannot use for variables. Others are free.
KARAMELO_COMMANDS = frozenset((
    "anti_volumetric_locking", "axisymmetric", "compute", "create_domain", "damage",
    "delete_compute", "delete_dump", "delete_fix", "delete_particles", "dimension", "dt_factor",
    "dump", "eos", "evaluate", "external_force", "fix", "group", "include", "internal_force", "log",
    "log_modify", "material", "method", "partition_domain", "plot",
    "populate_cylindrical_coordinates", "print", "quit", "read_restart", "region", "restart", "run",
    "run_time", "run_until", "run_while", "save_plot", "scheme", "set_dt", "set_output", "solid",
    "strength", "temperature", "translate_particles", "value", "write_restart", "xcm",
))  # fmt: skip

# By family and name.
INSTEAD = {
    "command": {
        "method_modify": "method(tlmpm, FLIP, linear, 0.99), before the first solid: behind the "
        "first word stand those of method_modify",
        "partition_domain": "method(ulmpm, FLIP, linear, 1): with linear weights no point acts "
        "across a line of nodes",
        "delete_atoms": "delete_particles(solid, region, regionID)",
        "displace_atoms": "translate_particles(solid, region, regionID, dx, dy)",
        "timestep": "set_dt(dt) sets the time step",
        "dt": "set_dt(dt) sets the time step",
        "unfix": "delete_fix(ID) ends a fix",
        "uncompute": "delete_compute(ID) ends a compute",
        "undump": "delete_dump(ID) ends a dump",
        "dump_modify": "dump(ID, all, style, every, file, ...) says all of it",
        "thermo": "set_output(N) logs every N steps",
        "thermo_style": _COLUMNS,
        "thermo_modify": _COLUMNS,
        "variable": "a variable is set by name = expression",
        "velocity": _VELOCITY,
        "run_style": "scheme(musl), scheme(usl), scheme(usf) or scheme(usavg)",
        "create_box": _DOMAIN,
        "lattice": _FILL,
        "create_atoms": _FILL,
        "read_data": f"{_FILL}; solid(ID, mesh, file, material, h) reads a mesh",
        "mass": "the density stands in material(...)",
        "pair_style": _LAW,
        "pair_coeff": _LAW,
        "atom_style": _NEEDLESS,
        "atom_modify": _NEEDLESS,
        "comm_modify": _NEEDLESS,
        "neighbor": f"{_NEEDLESS}: points interact by the grid",
        "neigh_modify": f"{_NEEDLESS}: points interact by the grid",
        "newton": _NEEDLESS,
        "processors": "karamelo-py SCRIPT --threads N",
        "write_data": "write_restart(file), or dump(ID, all, particle, every, file, ...)",
        "write_dump": "dump(ID, all, particle, every, file, ...) writes the last state, too",
        "minimize": "fix(ID, local_damping, all, 0.8) and run_while(Ek > ...)",
        "reset_timestep": f"{_NEEDLESS}: steps are counted through all runs",
    },
    "fix": {
        "body_force_current_config": "the style body_force",
        "indent/pinball": "fix(ID, indent/minimize_penetration, group, sphere, R, x, y, z, vx, vy, "
        "vz, mu)",
        "nve": f"{_NEEDLESS}: points move without a fix",
        "enforce2d": f"{_NEEDLESS}: dimension(2, ...) is a plane",
        "gravity": "fix(ID, body_force, all, 0, -9.81)",
        "addforce": "fix(ID, body_force, group, ax, ay) or fix(ID, force_particles, group, fx, fy)",
        "viscous": "fix(ID, local_damping, all, 0.8) brings a scene to rest",
        "setforce": "fix(ID, velocity_nodes, group, 0, 0) holds nodes",
        "freeze": "fix(ID, velocity_nodes, group, 0, 0) holds nodes",
        "move": "fix(ID, velocity_particles, group, vx, vy) moves points",
        "velocity": _VELOCITY,
        "wall/reflect": "boundary(reflect)",
        "wall_reflect": "boundary(reflect)",
    },
    "compute": {
        "ke": "the style kinetic_energy",
        "pe": "the style strain_energy",
        "temp": "the style average_temperature",
        "angmom": "the style angular_momentum",
        "com": "the style center_of_mass",
        "xcm": "the style center_of_mass, or xcm(group, x) in an expression",
        "centre_of_mass": "the style center_of_mass",
        "reduce": "compute(ID, average_stress, group) and the like; help compute lists them",
        "stress/atom": "dump(ID, all, particle, every, file, s11, s22, ...) writes stresses",
    },
    "solid": {
        name: _FILLED.format(style)
        for name, style in (
            ("block", "block"),
            ("box", "block"),
            ("rectangle", "block"),
            ("cylinder", "cylinder"),
            ("sphere", "sphere"),
        )
    }
    | {"file": "solid(ID, mesh, file, material, h) reads a mesh"},
    "region": {
        "box": "the style block",
        "rectangle": "the style block",
        "circle": "the style cylinder",
        "disk": "the style cylinder",
        "ball": "the style sphere",
    },
    "material": {
        "elastic": "the style linear",
        "plastic": "the style eos-strength, of an eos and a strength",
        "fluid": "the style eos-strength, of an eos and a strength",
    },
    "strength": {"JC": "the style johnson_cook, with G, A, B, n, epsdot0, C, m, Tr, Tm"},
    "dump": {
        "atom": "the style particle",
        "custom": "the style particle",
        "atom/gz": "the style particle/gz",
        "custom/gz": "the style particle/gz",
        "image": "the style pyplot",
    },
}


# Usual names of energies, and what gives them.
ENERGIES = {
    name: f"compute({ID}, {style}, all) gives {ID}"
    for names, ID, style in (
        ("Ek Ekin ke KE", "Ek", "kinetic_energy"),
        ("Es Epot Ep pe PE", "Es", "strain_energy"),
        ("E Etot etotal", "E", "energy_balance"),
    )
    for name in names.split()
}

# Commands that there are here, too, with other arguments.
OTHERWISE = {"units": "units(m, kg, s) names the units of all numbers; or leave it out"}

# What is done in another way than by more arguments.
SURPLUS = {"plot": "a line for each curve: plot(another ID, every, x, y)"}

# Earlier forms of Karamelo's laws, by the number of arguments behind the style (None: any other):
# what the line does without, and its arguments here, of which {0} is the first of the script.
_NO_HEAT = "without heat and viscosity: "
_NO_TEMPERATURE = "without a temperature: "
_NO_SOFTENING = "without softening by heat: "
SHORTER: dict[str, dict[int | None, tuple[str, tuple[str, ...]]]] = {
    "eos shock": {
        None: (_NO_HEAT, ("rho0", "K", "c0", "S", "0", "0", "0", "0", "0")),
        6: (_NO_HEAT, ("{0}", "{1}", "{2}", "{4}", "{5}", "0", "0", "0", "0")),
        7: ("without viscosity: ", (*(f"{{{k}}}" for k in range(7)), "0", "0")),
    },
    "strength johnson_cook": {
        None: (_NO_SOFTENING, ("G", "A", "B", "n", "epsdot0", "C", "0", "0", "1")),
        6: (_NO_SOFTENING, (*(f"{{{k}}}" for k in range(6)), "0", "0", "1")),
    },
    "damage damage_johnson_cook": {
        None: (_NO_TEMPERATURE, ("d1", "d2", "d3", "d4", "0", "epsdot0", "0", "1")),
        5: (_NO_TEMPERATURE, ("{0}", "{1}", "{2}", "{3}", "0", "{4}", "0", "1")),
        6: (_NO_TEMPERATURE, (*(f"{{{k}}}" for k in range(6)), "0", "1")),
        7: ("without d5: ", ("{0}", "{1}", "{2}", "{3}", "0", "{4}", "{5}", "{6}")),
    },
}


def instead(family: str, name: str) -> str | None:
    """What to write here for a command or style of another program; None for other words."""
    return INSTEAD.get(family, {}).get(name)
