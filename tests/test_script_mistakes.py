"""Several mistakes of a script in one go, and mistakes in scripts that others include."""

import re

import pytest
from scenes import block


def places(err: str) -> list[tuple[int, str]]:
    """Line and first words of each error."""
    return [(int(line), text) for line, text in re.findall(r":(\d+):\d+: error: (.*)", err)]


HEAD = 6  # lines that block() writes before those of the test


def test_all_mistakes_that_do_not_follow_from_each_other(run_interpreted):
    lines = [
        "a = sqroot(2)",  # 1: wrong
        "b = 2*a",  # follows from the first
        "fix(g, body_forc, all, 0, -9)",  # 3: wrong
        "fix(h, body_force, all, 0)",  # 4: wrong
        "c = g_x + 1",  # follows from the third
        "log_modify(custom, step, c)",  # and this from that
        "log_modify(custom, step, tim)",  # 7: wrong
        "e = wrong_name",  # 8: wrong
        "f = wrong_name*2",  # the same again
        "run(10)",
    ]
    err = run_interpreted(block(2, *lines), status=1).err
    assert [line - HEAD for line, _ in places(err)] == [1, 3, 4, 7, 8]


@pytest.mark.parametrize(
    ("wrong", "others"),
    [
        ("region(b, blok, 0, 1, 0, 1)", ["unknown solid 'nobody'"]),
        ("dimension(2, 0, 1, 0)", []),  # nothing goes without a domain
    ],
)
def test_what_follows_from_a_missing_part_is_not_told(run_interpreted, wrong, others):
    script = f"""\
        method(ulmpm, FLIP, linear, 1)
        {"dimension(2, 0, 1, 0, 1, 0.1)" if "region" in wrong else ""}
        {wrong}
        material(m, linear, 1, 100, 0.3)
        solid(s, region, b, 2, m, 0.1)
        group(g, particles, region, b, solid, s)
        fix(v, initial_velocity_particles, g, 1, 0)
        delete_fix(v)
        delete_particles(nobody, region, b)
        region(other, block, 0, 1, 0, 1)
        delete_particles(nobody, region, other)
        run(10)
        """
    found = places(run_interpreted(script, status=1).err)
    assert [text.split(": ")[-1] for _, text in found[1:]] == others


def test_what_follows_from_refused_pore_water_or_solids_is_not_told(run_interpreted):
    script = """\
        method(tlmpm, FLIP, linear, 0.99)
        dimension(2, 0, 1, 0, 1, 0.1)
        region(b, block, 0.2, 0.5, 0, 0.5)
        material(m, linear, 1000, 1e6, 0.3)
        pore_water(m, n=40, permeability=1e-3)
        solid(b, region, b, 2, m, 0.1)
        group(top, nodes, region, b, solid, b)
        fix(s, seepage_face, top, 0)
        fix(q, initial_pore_pressure, all, 0)
        dump(d, all, particle, 1, d.*, pore_pressure, wx)
        fix(w, water_flux, top, 1, yhi)
        run(10)
        """
    for wrong in (script, script.replace("n=40", "n=0.4").replace("m, 0.1)", "m, -0.1)")):
        first, second = places(run_interpreted(wrong, status=1).err)
        assert "porosity" in first[1] or "'h'" in first[1]
        assert "unknown fix style" in second[1]


def test_what_follows_from_a_refused_setting_or_deletion_is_not_told(run_interpreted):
    lines = [
        "plane_stres(true)",  # 1: wrong
        "compute(Ek, kinetic_energy, all)",
        "delete_compute(Ek, 1)",  # 3: wrong
        "compute(Ek, kinetic_energy, all)",
        "dump(d, all, particle, 10, d.*, thickness, x)",
        "dump(d2, all, particle, 10, e.*, x, dmg)",  # 6: wrong
    ]
    err = run_interpreted(block(2, *lines), status=1).err
    assert [line - HEAD for line, _ in places(err)] == [1, 3, 6]


def test_what_follows_in_an_included_script_is_not_told(run_interpreted, tmp_path):
    inner = tmp_path / "walls.mpm"
    follows = "fix(walls, velocity_nodes, all, speed, 0)"
    inner.write_text(f"{follows}\nfix(base, velocity_node, all, 0)\n")
    lines = [
        "speed = 1/0",  # 1: wrong, and a line of the included script follows
        f'include("{inner}")',
        "fix(top, velocity_nodes, al, 0, 0)",  # 3: wrong
    ]
    found = places(run_interpreted(block(2, *lines), status=1).err)
    assert [line for line, _ in found] == [HEAD + 1, HEAD + 3, 2]


@pytest.mark.parametrize(
    ("unknown", "wrong"),
    [
        ("pair_style(hybrid)", [4, 8]),  # material(...) stands for it: one may be missing
        ("invented(copper, 1)", [4, 8]),  # copper may be what it makes
        ("invented(1)", [4, 5, 8]),
        ("thermo(100)", [4, 5, 8]),  # makes nothing
    ],
)
def test_what_an_unknown_command_may_have_made(run_interpreted, unknown, wrong):
    script = f"""\
        method(ulmpm, FLIP, linear, 1)
        dimension(2, 0, 1, 0, 1, 0.1)
        region(b, block, 0.3, 0.6, 0.3, 0.6)
        {unknown}
        solid(s, region, b, 2, copper, 0.1)
        group(g, particles, region, b, solid, s)
        run(10)
        delete_fix(nobody)
        """
    assert [line for line, _ in places(run_interpreted(script, status=1).err)] == wrong


def test_mistakes_behind_the_first_run_are_found_before_it(run_interpreted):
    lines = ["run(1)", "a = 1 + nothing", "run(abc)", "dump(d, all, partikle, 1, d.*)"]
    result = run_interpreted(block(2, *lines), status=1)
    assert [line - HEAD for line, _ in places(result.err)] == [2, 3, 4]
    assert not (result.folder / "log.mpm").exists()


def test_a_mistake_in_an_included_script_says_who_includes_it(run_interpreted, tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "outer.in").write_text("b = 1\ninclude(inner.in)\n")
    (folder / "inner.in").write_text("c = 2\nd = nothing\n")
    (folder / "broken.in").write_text("c = (2\n")
    script = "a = 1\ninclude(outer.in)\ne = nobody\ninclude(broken.in)\n"
    err = run_interpreted(script, status=1).err
    inner = err.index("inner.in:2:5: error: unknown name 'nothing'")
    outer = err.index("outer.in:2: the script above is included here")
    main = err.index("in.script:2: the script above is included here")
    then = err.index("in.script:3:5: error: unknown name 'nobody'")
    broken = err.index("broken.in:1:")
    last = err.index("in.script:4: the script above is included here")
    assert inner < outer < main < then < broken < last


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("fix 1 all nve", "leave it out: points move without a fix"),
        ("fix 1 all body_force 0 -9.81", "fix(n1, body_force, all, 0, -9.81)"),
        ("compute Ek all ke", "compute(Ek, kinetic_energy, all)"),
        ("units lj", "units(m, kg, s)"),
        ("write_data end.dat", "write_restart(end.dat)"),
        ("region(b, block, 0 1, 0, 1)", "is a comma missing in '0 1'?"),
        ("fix(g, body_force, all, 0 -9.81)", "is a comma missing in '0 -9.81'?"),
        ("eos(e, shock, 7, K, 6, 0, 5, 4)", "eos(e, shock, 7, K, 6, 5, 4, 0, 0, 0, 0)"),
        ("eos(e, shock, 7, 6)", "eos(e, shock, rho0, K, c0, S, 0, 0, 0, 0, 0)"),
        ("strength(s, johnson_cook, 1, 2, 3, n, 4, C)",
         "(s, johnson_cook, 1, 2, 3, n, 4, C, 0, 0, 1)"),
        ("damage(d, damage_johnson_cook, 1, 1, 1, 0, 1)",
         "damage(d, damage_johnson_cook, 1, 1, 1, 0, 0, 1, 0, 1)"),
        ("fix(f, indent/pinball, all)", "indent/minimize_penetration"),
        ("fix(f, indent/pinball, all, sphere, K, R, x1, 0, 0, u, 0, 0)",
         "fix(f, indent/minimize_penetration, all, sphere, R, x1, 0, 0, u, 0, 0, 0)"),
        ("fix(f, indent, all, 0, 1, 0, R, 1e3)", "fix(f, indent, all, sphere, 1e3, R, 0, 1, 0)"),
        ("fix(f, body_force_current_config, all, 0, -9.81)", "fix(f, body_force, all, 0, -9.81)"),
        ("material(tool, rigid)", "material(tool, rigid, 1000)"),
        ("temperature(t, plastic_work, 0.9, 8960, 385)",
         "temperature(t, plastic_work, 0.9, 385, 0, 0, T0, Tm)"),
        ("my speed = 3", "a name has no blanks: my_speed = ..."),
        ("x AND y", "write and"),
        ("w = sin(t)", "did you mean 'time'?"),
        ("units(lj)", "units(m, kg, s)"),
        ("units(kg, m, s)", "swap kg and m: length m, mass kg"),
        ("a = Es", "compute(Es, strain_energy, all)"),
        ("run(steps)", "set it first: steps = ..."),
        ("run_time(2*tim)", "set it first: tim = ..."),
        ("run_time(2*Pi)", "did you mean 'PI'?"),
        ('run("100")', "write numbers without quotes: 100"),
        ("region(b, sphere, 0.5, 0.6, 0.5, 0.2)", "for 3D; here region(b, sphere, 0.5, 0.6, 0.2)"),
        ("region(b, sphere, 0,5, 0,6, 0,2)", "with a decimal point: 0.5, 0.6, 0.2"),
        ("fix(v, body_force, all, 0,5, -2,5)", "with a decimal point: 0.5, -2.5"),
        ("run_time(0,1)", "with a decimal point: 0.1"),
        ("fix(v, velocity_node, n, 1,0)", "did you mean 'velocity_nodes'?"),
        ("contact/surface(all, walls)", "fix(ID, contact/surface, group, region"),
        ("neo-hookean(rubber, 1, 1e5, 0.4)", "material(ID, neo-hookean, rho, E, nu"),
        ("modify(rubber, E=2e5)", "the kind comes first: modify(material, ID, name=value)"),
        ("method(Auto)", "did you mean 'auto'?"),
        ("E = 100kPa", "numbers have no units: 100e3"),
        ("m = 3kg", "numbers have no units: 3\n"),
        ("k = 1e-3m/s", "numbers have no units: 1e-3\n"),
        ("E = 1e2kPa", "numbers have no units: 1e2*1e3\n"),
        ("run(1_000)", "digits are not grouped: 1000"),
        ("if(1 > 0, run(20))", "if(...) chooses one of two values"),
        ("region(b, terrain, hill.xyz)", "the style heights"),
    ],
)  # fmt: skip
def test_lines_of_other_programs_say_what_to_write(run_interpreted, line, hint):
    """In one step: of LAMMPS, and of Karamelo's older forms."""
    err = run_interpreted(f"dimension(2, 0, 1, 0, 1, 0.1)\n{line}\n", status=1).err
    (told,) = places(err)
    assert told[0] == 2
    assert hint in err.partition("hint: ")[2]


def test_the_size_of_cells_is_found_where_solids_name_it(run_interpreted):
    """As in Karamelo's vortex of 2019."""
    script = "dimension(2, 0, 1, 0, 1)\ncell = 1/8\nregion(box, block, 0, 1, 0, 1)\n"
    script += "solid(s, box, 2, mat, cell)\n"
    err = run_interpreted(script, status=1).err
    assert "hint: dimension(2, 0, 1, 0, 1, cell), after line 2, which sets cell\n" in err
    assert err.count("error") == 1


OF_2020 = """
method(tlmpm, FLIP, linear, 0.99)
dimension(2, 0, 1, 0, 1, 0.5)
region(box, {shape}, 0, 0.5, 0, 0.5)
eos(bulk, {eos}, 7850, 1e9)
strength(shear, linear, 1e9)
material(mat, bulk, shear)
solid(a, box, 1, mat, 0.5)
solid(b, block, box, 1, mat, 0.5)
run(1)
"""


@pytest.mark.parametrize(
    ("given", "lines"),
    [({"shape": "blok"}, [4]), ({"eos": "liner"}, [5]), ({"shape": "blok", "eos": "x"}, [4, 5])],
)
def test_what_only_follows_from_a_refused_region_or_eos_is_not_told(run_interpreted, given, lines):
    """Forms of 2020 are right: material(ID, eos, strength) and solid(ID, box, region)."""
    run_interpreted(OF_2020.format(shape="block", eos="linear"))
    err = run_interpreted(
        OF_2020.format(**{"shape": "block", "eos": "linear"} | given), status=1
    ).err
    assert [line for line, *_ in places(err)] == lines


@pytest.mark.parametrize(
    ("steps", "taken"), [("0.3/0.1", 3), ("0.201999999999999/0.001 + 1e-12", 202), ("3.001", None)]
)
def test_numbers_of_steps_may_be_rounded(run_interpreted, steps, taken):
    """A quotient of decimal numbers is off by round-off, in every place of a whole number."""
    script = OF_2020.format(shape="block", eos="linear").replace("run(1)", "")
    script += (
        f"set_output(0.6/0.2)\nset_dt(1e-7)\ndump(d, all, particle, 0.3/0.1, d.*, x)\nrun({steps})"
    )
    result = run_interpreted(script, status=int(taken is None))
    if taken is None:
        assert "must be a whole number of at least 0, not 3.001" in result.err
    else:
        assert f"\n  steps             {taken}\n" in result.out


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("plot(e, 2, time, Ekk)", "did you mean 'Ek', defined further down, in line 9?"),
        ("plot(e, 2, t, time)", "did you mean 'time'?"),
        ("plot(e, 2, stp, time)", "did you mean 'step'?"),
        ("plot(e, 2, time, time, rigth)", "axis=right"),
        ("plot(e, 2, time, time, log)", "scale=log"),
        ("plot(e, 2, time, time, step)", "a line for each curve"),
        ("fix(g, body_force, all, 0, 0, -9.81)", "the last direction here is y"),
    ],
)
def test_slips_in_a_plot(run_interpreted, line, hint):
    lines = [line, "compute(Ek, kinetic_energy, all)", "run(1)"]
    assert f"hint: {hint}" in run_interpreted(block(2, "# a plot", *lines), status=1).err


@pytest.mark.parametrize(
    ("lines", "wrong"),
    [
        ("method(ulmpm, FLIP, lin, 1)\ndimension(2, 0, 1, 0, 1, 0.1)\nregion(b, blok, 0, 1)\n"
         "fix(v, bodyforce, all, 0)\nfix(w, body_force, nobody, 0)\nset_outptu(20)", [1, 3, 4, 6]),
        ("dimension(2, 0, 1, 0)\nregion(b, cilinder, 0, 0, 1)\nrun_tim(0.4)", [1, 2, 3]),
        ("R = 0.2 +\nmethod(ulmpm, FLIP, linear, 1)\nfoo(3)\nb = 2*\nc = R", [1, 3, 4]),
        ("method(ULMPM, flip, Linear, 7)\nfoo(3)", [1, 1, 1, 2]),
        ("method(ulmpm, FLIP)\nfoo(3)\nquit\nrun_tim(0.4)", [1, 2]),
        ("method(ulmpm, FLIP)\nstyle = 3\ncompute(e, style, all)\nstyle(3)", [1]),
    ],
)  # fmt: skip
def test_names_of_commands_and_styles_depend_on_nothing(run_interpreted, lines, wrong):
    assert [line for line, _ in places(run_interpreted(lines, status=1).err)] == wrong


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("solid(s, region, rubber, 2, box, 0.1)", "swap rubber and box: region box, mat"),
        ("solid(s, region, box, rubber, 2, 0.1)", "swap rubber and 2: ppc 2, mat"),
        ("solid(s, region, box, 2, 0.1, rubber)", "swap 0.1 and rubber: material rubber, h 0.1"),
        ("group(g, region, particles, box, all)", "swap region and particles: kind particles"),
        ("dump(d, particle, all, 1, d.*, x)", "swap particle and all: group all, style particle"),
        ("solid(region, s, box, 2, rubber, 0.1)", "'region' is a style, and the ID comes first"),
        ("material(linear, steel, 1, 1, 0.3)", "'linear' is a style, and the ID comes first"),
        ("material(steel, 1, 1, 0.3)", "must be one of arruda-boyce, cam-clay, eos-strength,"),
        ("run(1)\nprecision(single)", "the precision cannot change after the first run"),
        ("run(1)\nset_output(1, csv)", "the format of the log cannot change after the first run"),
    ],
)
def test_words_in_each_others_places(run_interpreted, line, told):
    """What does not fit where it stands, but there where another does not; all before a step."""
    result = run_interpreted(block(2, *line.split("\n")), status=1)
    assert told in result.err
    assert not (result.folder / "log.mpm").exists()


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("fix(all, body_force, g, 0, -9)", "hint: fix(g, body_force, all, 0, -9)"),
        ("group(g)\nfix(v, g, body_force, 0)", "expected: fix(v, body_force, g, ...)"),
        ("group(g, particles, region, box)", "hint: group(g, particles, region, box, all)"),
        ("group(g, nodes, solid, body)", "hint: group(g, nodes, region, box, solid, body)"),
        ("group(g, solid, body)", "hint: group(g, particles, region, box, solid, body)"),
        ("method(auto, 0.01)", "hint: accuracy=0.01"),
        (
            "fix(v, velocity_particles, body, 1)",
            "(body, particles, region, box, solid, body) makes",
        ),
        ("fix(c, contact/hertz, body, 0.3)", "expected: one of body"),
        (
            "fix(c, contact/hertz, body, body, 0.3)",
            "contact/minimize_penetration takes a coefficient",
        ),
        ('fix(g, body_force, all, 0, "-9*time")', "hint: write formulas without quotes: -9*time"),
        ('strength(t, tabulated, 1, "0.1;2.5")', "without quotes: 0.1, 2.5"),
        ("compute(e, energy_balance, all)\nlog_modify(step, e)", "log_modify(custom, step, time"),
        ("restart(r.*.h5, 10)", "hint: swap r.*.h5 and 10: every 10, file r.*.h5"),
        ("dump(d, all, grid, 1, d.*, s11)", "hint: dump particle writes s11, a column of points"),
        ("dump(d, all, pyplot, 1, d.*.png, 9, 9, x, 0)", "hint: the range of colours is vmin=..."),
        ("scheme(implicit)", "hint: quasi-static, for load steps without inertia"),
        ("read_restart(none.h5)", "there is no file none.h5"),
        ("load_path(p, 1, e11=1)", "hint: write exx=..."),
        ("modify(material, rubber, young=1)", "hint: write E=..."),
        ("fix(t, edge_traction, all, box, left, 1, 0)", "hint: write xlo"),
        ("group(g, particles, region, box, solids, body)", "hint: did you mean 'solid'?"),
        ("a = ln(5)", "hint: log(x) is the natural logarithm"),
    ],
)
def test_slips_say_what_to_write(run_interpreted, line, told):
    error = run_interpreted(block(2, *line.split("\n"), "run(1)"), status=1).err
    assert told in error
    assert error.count("error: ") == 1 + line.startswith("group(g)")


@pytest.mark.parametrize("words", ["ulmpm, linear, FLIP, 1", "FLIP, ulmpm, linear, 1"])
def test_words_of_a_method_in_each_others_places(run_interpreted, words):
    error = run_interpreted(f"method({words})", status=1).err
    assert error.count("error: ") == 1 and "hint: method(ulmpm, FLIP, linear, 1)" in error


@pytest.mark.parametrize(
    ("method", "lines", "told"),
    [
        ("tlmpm, PolyPIC/quadratic, linear", "", "tlmpm and the basis linear"),
        ("ulmpm/contacts, FLIP, linear, 1, mass=corrected", "",
         "mass=corrected does not support method ulmpm/contacts and transfer FLIP and the basis"),
        ("ulmpm, FLIP, linear, 1", "scheme(quasi-static)\nprecision(single)\n"
         "material(soil, linear, 1, 1, 0.3)\npore_water(soil, n=0.4, permeability=1)\n"
         "region(b, block, 0, 0.2, 0, 0.2)\nsolid(w, region, b, 2, soil, 0.1)",
         "pore_water and scheme quasi-static do not support precision(single)"),
    ],
)  # fmt: skip
def test_one_wrong_choice_gives_one_message(run_interpreted, method, lines, told):
    script = block(2, *lines.split("\n"), "run(1)").replace("ulmpm, FLIP, linear, 1", method)
    error = run_interpreted(script, status=1).err
    assert told in error and error.count("error: ") == 1


def test_what_may_stand_after_a_run(run_interpreted):
    """The form that the log has already; a precision behind an element, which is no run."""
    lines = ["set_output(1, csv)", "run(1)", "set_output(2, csv)", "run(1)"]
    element = "load_path(p, 1, exx=1e-3)\nelement(e, rubber, p)\nprecision(single)"
    run_interpreted(block(2, element, *lines))
