"""Wrong scripts: each ends with one message that marks the place and says what to do."""

import re

import pytest
from scenes import block

from karamelo_py.language import registry
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.scene.hub import Hub
from karamelo_py.script import errors
from karamelo_py.script.errors import Mark, ScriptError, nearest, render_message

SCENE = """\
method(ulmpm, FLIP, linear, 1)
dimension(2, 0, 1, 0, 1, 0.1)
region(b, block, 0, 1, 0, 1)
material(m, linear, 1000, 1000, 0.3)
solid(s, region, b, 2, m, 0.1, 0)
group(n, nodes, region, b, all)
group(p, particles, region, b, all)
"""

# What is wrong, the column of the mark, and parts of the message.
SYNTAX = [
    ("a =", 1, "nothing is assigned to 'a'"),
    ("a = 1.2.3", 5, "'1.2.3' is not a number"),
    ("a = 1e3.5", 5, "'1e3.5' is not a number\n"),
    ("run(1e3.5)", 5, "a whole number after e"),
    ("run(&\n10)", 5, "may run over several lines inside its parentheses"),
    ("a = 1 + & # more\n 2", 9, "leave it out"),
    ("label loop", 7, "a script has no loops, blocks or imports"),
    ("run(1) // a step", 8, "comments begin with #"),
    ("// it's \"half", 9, "comments begin with #"),
    ("print('a, b')", 7, 'write "a, b"'),
    ("// a step", 1, "comments begin with #"),
    ("/* a step */", 1, "comments begin with #"),
    ("method('ulmpm', FLIP, linear, 1)", 8, 'write "ulmpm", or the word without quotes'),
    ("a = 2 3", 7, "operator is missing between '2' and '3'"),
    ("a = 2x", 5, "2*x"),
    ("a = 1e", 5, "exponent"),
    ("a = 1d5", 5, "1e5"),
    ("a = 3)", 6, "closes nothing"),
    ("run(10", 1, "call of run is not closed"),
    ("a = (1 + 2", 5, "not closed"),
    ("a = max(1, (2)", 5, "not closed"),
    ("run(10))", 8, "closes nothing"),
    ("f(a,,b)", 5, "argument 2 is missing"),
    ("f(,b)", 3, "argument 1 is missing"),
    ("f(a,)", 4, "argument 2 is missing"),
    ('a = "text', 5, "quote is not closed"),
    ('f(a, "text)', 6, "quote is not closed"),
    ("a = “text”", 5, "typographic quote"),
    ("a = 3 $ 4", 7, "without $"),
    ("a = 3;", 6, "one statement per line"),
    ("a = 'b'", 5, "double quotes"),
    ("a = 1 & 2", 7, "write &&"),
    ("a = 2 − 1", 7, "type -"),
    ("a += 2", 3, "a = a + 2"),
    ("f(x) = 3", 1, "f = 3"),
    ("a = b = 4", 7, "unexpected '='"),
    ("= 3", 1, "no name on its left"),
    ("3 = x", 3, "unexpected '='"),
    ("run 100", 5, "run(100)"),
    ("a = 1,5", 6, "1.5"),
    ("a = 1,5e5", 6, "a point: 1.5e5"),
    ("a = 3 *", 7, "ends after '*'"),
    ("a = * 3", 5, "nothing on its left"),
    ("a = 3 + * 4", 9, "'*' follows operator '+'"),
    ("a = ()", 5, "these parentheses are empty"),
    ("a = max(1,)", 11, "missing after ','"),
    ("run(1) run(2)", 8, "write two statements on two lines"),
    ("if (3 > 2) run(1)", 12, "a script has no loops, blocks or imports"),
    ("E = 2.1e11 Pa", 12, "write numbers without units"),
    ('print "a b"', 7, "arguments go in parentheses"),
    ("a = 2(3)", 6, "operator is missing"),
    ("a = 30%", 7, "30 % is 0.3"),
    ("a = 2x10^6", 5, "a power of 10 is written 2e6"),
    ("a = 1e400", 5, "too large"),
    ("a = \x01", 5, "control character"),
]

NAMES = [
    ("x = 3", 1, "'x' is a coordinate"),
    ("time = 3", 1, "'time' is the time"),
    ("PI = 3", 1, "cannot be assigned"),
    ("run = 3", 1, "'run' is a command"),
    ("log = 2", 1, "cannot be assigned"),
    ("sin = 2", 1, "'sin' is a function"),
    ("a = b", 5, "unknown name 'b'"),
    ("length = 2\na = 2*lenght", 7, "did you mean 'length'?"),
    ("b = a + 1\na = 3", 5, "'a' is used before it is set"),
    ("c = Ek_s\nfix(Ek, kinetic_energy, all)", 5, "used before its fix is defined"),
    ("a = a + 1", 5, "used before it is set"),
    ("b = a\na = 3*c\nc = 2*b", 5, "'b' and 'a' need each other"),
    ("b = a\na = 3*c\nc = 2", 5, "move line 3 up"),
    ("a = sn(1)", 5, "did you mean 'sin'?"),
    ("a = sin", 5, "sin(a)"),
    ("a = run", 5, "needs parentheses"),
    ("run", 1, "needs parentheses"),
    ("a = run(10)", 5, "gives no value"),
    ("metod(ulmpm, FLIP, linear, 1)", 1, "did you mean 'method'?"),
    ("Run(10)", 1, "did you mean 'run'?"),
    ("label(loop)", 1, "a script has no loops, blocks or imports"),
    ("a = 3\na(4)", 1, "a variable"),
    ("a = 3\nb = a(4)", 5, "a*(...)"),
    ("a = INF", 5, "INF is not a number"),
    ("a = NULL + 1", 5, "NULL is not a number"),
    ("a = cubic-spline", 5, 'quotes: "cubic-spline"'),
    ("h = L/20", 5, "hint: set it first: L = ..."),
]

VALUES = [
    ("a = 1/0", 7, "division by zero"),
    ("a = 0\nb = 3/a", 7, "division by zero: a is 0"),
    ("a = 5 % 0", 9, "division by zero"),
    ("a = 0^-1", 5, "division by zero"),
    ("a = 2*time + 1/0", 16, "division by zero"),
    ("a = sqrt(-1)", 10, "sqrt(-1) is not a real number"),
    ("a = log(0)", 9, "above 0"),
    ("a = acos(2)", 10, "between -1 and 1"),
    ("a = (-8)^(1/3)", 5, "whole exponent"),
    ("a = 10^400", 5, "too large"),
    ("a = exp(1000)", 5, "too large"),
    ("a = sin(1, 2)", 5, "sin takes 1 operand, not 2"),
    ("a = atan2(1)", 5, "atan2(y, x)"),
    ("a = max(1)", 5, "at least 2"),
    ("a = if(1, 2)", 5, "if(condition, a, b)"),
    ('a = "text" * 2', 5, "'text' is text"),
    ('a = -"text"', 6, "is text"),
    ('a = sin("text")', 9, "is text"),
    ("a = value(x)", 11, "differs from point to point"),
]

COMMANDS = [
    ("fix(v, velocity_node, n, 1, 0)", 8, "did you mean 'velocity_nodes'?"),
    ("fix(v, velocity_nodes, nn, 1, 0)", 24, "did you mean 'n'?"),
    ("fix(v, velocity_nodes, p, 1, 0)", 24, "a group of particles"),
    ("fix(v, velocity_nodes)", 1, "group is missing"),
    ("fix(v)", 1, "style is missing"),
    ("fix(v, velocity_node, n, 1, 0)", 8, "one of velocity_nodes, "),
    ("fix(v, velocity_node, n, 1, 0)", 8, "karamelo-py styles fix lists all "),
    ("fix(f, body_force, all, 0, -1, 0, 7)", 35, "4 components, but there are at most 3"),
    ("scheme(musl, strat=half)", 14, "did you mean 'start'?"),
    ("scheme(musl, strat=half)", 14, "expected: start=full or start=half"),
    ("dump(d, all, pyplot, 1, d.*.png, 300, 300, 2*vxx)", 46, " in all), or a number"),
    ("dump(d, all, particle, 1, d.*, vxx)", 32, " in all: see docs/reference/columns.md)"),
    ("fix(f, body_force, all, 0, -9.81*)", 33, "ends after '*'"),
    ("fix(f, body_force, all, 0, 1/0)", 30, "division by zero"),
    ("fix(f, body_force, all, 0, dt=3)", 28, "arguments of fix body_force are given by position"),
    ("fix(f, body_force, all, 0, dt=3)", 28, "fix(ID, body_force, group, bx[, by[, bz]])"),
    ("region(r, block, xlo=0, 1, 0, 1)", 18, "expected: region(ID, block, xlo, xhi"),
    ("region(ID=r, block, 0, 1)", 8, "ID of region: given by position, without a name"),
    ("material(m2, neo-hookean, 1000, 0.3, rho=7850)", 38, "rho is given twice: by position and"),
    ("material(m2, linear, E=1000, 1, 0.3)", 30, "arguments by position come first"),
    ("strength(s, plastic, G=1e9, Y=1e7)", 29, "expected: G=..., yield_stress=..., H=..."),
    ("material(m2, linear, 1000, 1000)", 1, "nu is missing"),
    ("material(m2, linear, 1000, 1000, 0.3, 4)", 39, "kappa is needed"),
    ("material(m2, linear, 1000, 1000, 0.3, 4, 1, 0, 5)", 48, "one argument too many"),
    ("material(m2, linear, 0, 1000, 0.3)", 22, "above 0"),
    ("material(m2, linear, NULL, 1000, 0.3)", 22, "not NULL"),
    ("material(m2, linear, time, 1000, 0.3)", 22, "value(time)"),
    ('material(m2, linear, "abc", 1000, 0.3)', 22, "not the text 'abc'"),
    ("material(m, linear, 1000, 1000, 0.3)", 10, "already used (line 4)"),
    ("material(3, linear, 1000, 1000, 0.3)", 10, "a word, not the number 3"),
    ("compute(E-k, kinetic_energy, all)", 9, "could not name the values of compute 'E-k'"),
    ("compute(E-k, kinetic_energy, all)", 9, "hint: such as E_k"),
    ("fix(1a, body_force, all, 0, -1)", 5, "could not name the values of fix '1a'"),
    ("fix(1a, body_force, all, 0, -1)", 5, "hint: such as f1a"),
    ("compute(not, kinetic_energy, all)", 9, "hint: such as cnot"),
    ("restart(-1)", 9, "whole number of steps, time(T), or 0 for never, not -1"),
    ("solid(s2, region, b, 2.5, m, 0.1, 0)", 22, "whole number"),
    ("solid(s2, region, c, 2, m, 0.1, 0)", 19, "unknown region 'c'"),
    ("dump(d, all, particle, 10, nodir/d.*.gz, x)", 28, "folder nodir does not exist"),
    ("axisymmetric(yes)", 14, "true or false"),
    ("run(1.5)", 5, "whole number"),
    ("run(-1)", 5, "at least 0"),
    ("nsteps = 3\nrun(timesteps)", 5, "that is one (nsteps)\nhint: did you mean 'nsteps'?"),
    ("set_dt(0)", 8, "above 0"),
    ("group(g, node, region, b, all)", 10, "did you mean 'nodes'?"),
    ("group(g, nodes region, b, all)", 10, "is a comma missing"),
    ("group(g,\n  nodes,\n  region, bb, all)", 11, "unknown region 'bb'"),
    ("log_modify(custom, step, Ekk)", 26, "unknown"),
    ("log_modify(custom, stp)", 20, "did you mean 'step'?"),
    ("log_modify(custom, steps)", 20, "did you mean 'step'?"),
    ("log_modify(custom, step, ke)", 26, "expected: one of step, dt, time, timestep\n"),
    ("compute(Ek, kinetic_energy, all)\nlog_modify(custom, kinetic_energy)", 20, "mean 'Ek'?"),
    ("compute(Ek, kinetic_energy, all)\na = kinetic + 1", 5, "mean 'Ek'?"),
    ("compute(v, average_velocity, all)\na = w_x", 5, "a compute (v_x, v_y, v_z)"),
    ("dump(d, all, particle, 1, d.*, x, sigma)", 35, "mean s11, s22, s33, s12, s13, s23, seq, p?"),
    ("compute(v, average_velocity, all)\nlog_modify(custom, c_v)", 20, "write v_x or v_y or v_z"),
    ("compute(e, probe, all, strain)", 24, "mean e11, e22, e33, e12, e13, e23?"),
    ("dump(d, all, particle, 1, d.*, vel)", 32, "did you mean vx, vy, vz?"),
    ("dump(d, all, grid, 1, d.*, v_E)", 28, "log_modify(custom, step, time, E) writes"),
    ("E = 3*time\nlog_modify(custom, v_E)", 20, "hint: write E"),
    ("compute(Ek, kinetic_energy, all)\nlog_modify(custom, c_Ek)", 20, "hint: write Ek"),
    ("compute(Ek, kinetic_energy, all)\na = 2*c_Ek", 7, "hint: write Ek"),
    ("log_modify(custom, step, c_Ek)", 26, "hint: compute(Ek, kinetic_energy, all) gives Ek"),
    ("group(p, particles, region, b)", 1, "all|solid is missing"),
    ("group(p)", 1, "group: particles|nodes, region|mesh, regionID, all|solid are missing"),
    ("group(p, particles, region)", 1, "group: regionID, all|solid are missing"),
    ("group(p, region, b)", 10, "group: particles|nodes, all|solid are missing"),
    ("group(p, region, b)", 10, "hint: group(p, particles, region, b, all)"),
    ("group(p, region, b, all)", 10, "hint: group(p, particles, region, b, all)"),
    ("group(w, nodes, wall)", 17, "group: region|mesh, all|solid are missing"),
    ("group(w, nodes, wall)", 17, "hint: group(w, nodes, region, wall, all)"),
    ("a = false", 5, 'hint: write "false", in quotes'),
    ("a = 2*(1 - True)", 12, "hint: write 1"),
    ("a = 0\naxisymmetric(a)", 14, "must be true or false, not 'a', which is 0"),
    ("a = 0\naxisymmetric(a)", 14, 'hint: write a = "false"'),
    ("axisymmetric(1)", 14, "hint: write true"),
    ("group wall region wall", 7, "hint: arguments go in parentheses: group(wall, particles, reg"),
    ("method(auto, accuracy=0,01)", 25, "hint: with a decimal point: accuracy=0.01; in parenth"),
    ("include(nofile.in)", 9, "no file"),
    ("print()", 1, "first is missing"),
    ('run_while("abc")', 11, "not the text 'abc'"),
    ("scheme(mus)", 8, "did you mean 'musl'?"),
    ("compute(v, average_velocity, all)\nlog_modify(custom, v)", 20, "v_x, v_y, v_z, not v"),
    ("compute(Es, strain_energy, all)\nE = Es_y", 5, "publishes Es, Es_s, not Es_y"),
    ("fix(k, initial_velocity_nodes, all, 1, 0)\nE = k_x", 5, "publishes nothing, not k_x"),
    ("fix(E, kinetic_energy, all)\ncompute(E, strain_energy, all)", 9, "'E' is a fix already"),
    ("fix(f, body_force, all, 0, -9,81)", 31, "with a decimal point: -9.81"),
    ("method(ulmpm, PIC, linear)", 1, "move it above line 5"),
    ("fix(body_force, all, 0, -9.81)", 5, "fix(ID, body_force, all, ...)"),
    ("compute(C, kinetic_energy, al)", 28, "one of all, n, p"),
    ("a == 3", 1, "a = 3"),
    ("fix(f, body_force, all, 0, null)", 28, "write NULL"),
    ("run_until(0.01)", 11, "run_until(time >= 0.01)"),
    ("run_while(1)", 11, "run_while(time < 1)"),
    ("fix(f, all, body_force, 0, 1)", 13, "fix(f, body_force, all, ...)"),
    ("compute(k, p, kinetic_energy)", 15, "compute(k, kinetic_energy, p, ...)"),
    ("fix(1, all, body_force, 0, 1)", 5, "such as n1"),
    ("method(ulmpm, MLS, quadratic-spline, 0.9)", 38, "MLS takes no number"),
    ("a = 1\nmethod(ulmpm, PIC, linear, a, mechanical)", 28, "method(ulmpm, PIC, linear, mech"),
    ("a = 1\nmethod(ulmpm, APIC, linear, a)", 29, "hint: -var a mechanical removes it"),
    ("method(ulmpm, FLIP, cubic, 1)", 21, "did you mean 'cubic-spline'?"),
    ("method(ulmpm, FLIP, quadratic spline, 1)", 21, "did you mean 'quadratic-spline'?"),
    ("region(r, circle, 0, 0, 1)", 11, "the style cylinder"),
    ("fix(v, initial_velocity_particles, s, 1, 0)", 36, "'s' is a solid"),
    ("solid(s2, region, n, 1, m, 0.1)", 19, "'n' is a group"),
    ("fix(v, velocity_nodes, b, 1, 0)", 24, "hint: group(b, nodes, region, b, all) makes"),
    ("method(FLIP, linear, 0.99)", 22, "hint: FLIP is a transfer; a method comes first: "),
    ("method(mlsmpm, quadratic)", 8, "did you mean 'ulmpm' or 'tlmpm'?"),
    ("method(mpm, FLIP, linear, 1)", 8, "hint: ulmpm, or tlmpm"),
    ("material(m2, linear, 1000; 1000, 0.3)", 22, "hint: is a comma missing in '1000; 1000'?"),
    ("material(m2, linear, 1000, 1,000,000, 0.3)", 34, "hint: commas separate arguments: a mill"),
    ("dump(d, all, movie, 5, d.gif, seq)", 1, "hint: the size comes after the file: dump(ID"),
    ("E = 1e5\nlog_modify(custom, step, Ek)", 26, "hint: compute(Ek, kinetic_energy, all)"),
    ("gravity(0, -9.81)", 1, "hint: fix(ID, body_force, all, 0, -9.81)"),
    ("neo_hookean(m2, 1000, 1e6, 0.3)", 1, "hint: material(ID, neo-hookean, rho, E, nu"),
    ("viscosity(m, prony, g=(0.1), tau=(1))", 11, "hint: viscosity(prony, m, ...)"),
    ("run(0.6)", 5, "hint: run_time(T) runs for a time T"),
    ("set_dt(time(0.1))", 8, "hint: the number without time()"),
    ("set_output(0.05)", 12, "hint: time(0.05) is a time"),
    ("compute(p, probe, all, p, x=0,5, y=0,5)", 31, "hint: with a decimal point: x=0.5"),
    ("compute(p, probe, all, pore_pressure)", 24, "hint: only points of a material with pore"),
    ("log_modify(custom, step, lost_by_transfer)", 26, "hint: compute(L, transfer_loss, all)"),
    ("compute(p, probe, all, ux)", 24, "hint: fix(u, displacement, all), before it, gives"),
    ("compute(p, probe, all, displacement_x)", 24, "hint: fix(u, displacement, all), before"),
    ("material(m2, linear, 1000, 1e6, 0,3)", 35, "hint: with a decimal point: 0.3"),
    ("pore_water(m, k=1e-4)", 15, "hint: write permeability=..."),
    ("material(c, johnson-cook, 1, 2)", 13, "'johnson_cook' is a style of strength: material("),
    ("a = rand()", 5, "pseudo-random numbers"),
    ("fix(t, max_position, all)", 8, "is a style of compute"),
    ("delete_fix(g)", 12, "expected: no fix is defined yet"),
    ("set_dt = 0.1", 1, "set_dt(...) calls it"),
    ("log_modify(custom, step, s11)", 26, "s11 differs from point to point"),
    ("method(ulmpm, XPIC, linear, 2, 0.9)", 32, "XPIC takes order and no further number"),
    ("method(ulmpm, APIC, linear, mechanicl)", 29, "did you mean 'mechanical'?"),
]

# As LAMMPS says it.
LAMMPS = [
    ("timestep 0.001", 10, "set_dt(0.001)"),
    ("timestep(0.001)", 1, "set_dt(dt)"),
    ("timestep = 0.001", 1, "set_dt(dt)"),
    ("dt = 0.001", 1, "set_dt(dt)"),
    ("unfix f", 7, "delete_fix(f)"),
    ("undump(d)", 1, "delete_dump(ID)"),
    ("thermo 100", 8, "set_output(100)"),
    ("thermo_style custom step pe", 14, "log_modify(custom, "),
    ("velocity(all, set, 1, 0)", 1, "initial_velocity_particles"),
    ("variable a equal 3", 10, "name = expression"),
    ("units si", 7, "units(m, kg, s)"),
    ("lattice", 1, "solid(ID, region, "),
    ("fix(wall, wall_reflect, all, ylo)", 11, "hint: boundary(reflect)"),
    ("fix(f, all, nve)", 13, "points move without a fix"),
    ("fix(f, nve, all)", 8, "points move without a fix"),
    ("compute(k, all, ke)", 17, "kinetic_energy"),
    ("dump(d, all, custom, 10, d.*.gz, x)", 14, "particle"),
]


def run(text, tmp_path):
    hub = Hub()
    hub.folder = tmp_path
    Interpreter(hub).run_text(text, "in.wrong")
    return hub


def check(script, lines_before, column, part, tmp_path):
    with pytest.raises(ScriptError) as caught:
        run(script, tmp_path)
    error = caught.value
    message = error.render()
    assert part in message
    assert message.startswith(f"in.wrong:{error.mark.line}:{error.mark.column}: error: ")
    assert error.mark.line > lines_before
    assert error.mark.column == column
    lines = message.splitlines()
    assert lines[1].endswith(script.splitlines()[error.mark.line - 1].rstrip().replace("\x01", "�"))
    assert lines[2].strip().startswith("|")
    assert set(lines[2].replace("|", "").strip()) == {"^"}
    # No word of the machinery.
    for word in ("Token", "LPAR", "RPAR", "NAME", "Traceback", "None"):
        assert word not in message


@pytest.mark.parametrize(("text", "column", "part"), SYNTAX)
def test_syntax(text, column, part, tmp_path):
    check("good = 1\n" + text, 1, column, part, tmp_path)


@pytest.mark.parametrize("before", ["", "** Job name: bar\n**\n"])
def test_an_input_file_of_abaqus_is_told_in_one_message(before, tmp_path):
    with pytest.raises(ScriptError) as caught:
        run(before + "*Heading\n A bar\n*Node\n1, 0., 0.\n*End Step", tmp_path)
    said = caught.value.render()
    assert "error: this is an input file of Abaqus" in said and "| *Heading\n" in said
    assert said.count("error: ") == 1 and "hint: docs/howto/from-abaqus.md" in said


@pytest.mark.parametrize("before", ["", "$ LS-DYNA keyword deck\n$\n"])
def test_an_input_file_of_ls_dyna_is_told_in_one_message(before, tmp_path):
    with pytest.raises(ScriptError) as caught:
        run(before + "*KEYWORD\n*TITLE\nTaylor bar\n*NODE\n1,0,0,0\n*END", tmp_path)
    said = caught.value.render()
    assert "error: this is an input file of LS-DYNA" in said and "| *KEYWORD\n" in said
    assert said.count("error: ") == 1


@pytest.mark.parametrize("named", ["al, al", "al"])
def test_one_id_for_damage_and_temperature_is_told(named, tmp_path):
    with pytest.raises(ScriptError) as caught:
        run(
            "eos(al, linear, 2700, 70e9)\nstrength(al, linear, 26e9)\n"
            "damage(al, damage_johnson_cook, 1, 1, 1, 0, 0, 1, 0, 1)\n"
            "temperature(al, plastic_work, 0.9, 900, 0, 0, 300, 900)\n"
            f"material(al, eos-strength, al, al, {named})\n",
            tmp_path,
        )
    said = caught.value.render()
    assert "'al' is the ID of a damage and of a temperature" in said
    assert "hint: damage(al_damage, ...) and temperature(al_temperature, ...)" in said


@pytest.mark.parametrize(("text", "column", "part"), [*NAMES, *VALUES])
def test_names_and_values(text, column, part, tmp_path):
    check("# nothing\n" + text, 1, column, part, tmp_path)


@pytest.mark.parametrize(("text", "column", "part"), COMMANDS)
def test_commands(text, column, part, tmp_path):
    check(SCENE + text, 7, column, part, tmp_path)


def test_an_id_of_a_solid_is_refused_before_its_points_are_made(tmp_path, capsys):
    with pytest.raises(ScriptError, match="'s' is already used"):
        run(SCENE + "solid(s, region, b, 2, m, 0.1, 0)\n", tmp_path)
    assert "mass there is doubled" not in capsys.readouterr().err


@pytest.mark.parametrize(("text", "column", "part"), LAMMPS)
def test_words_of_lammps(text, column, part, tmp_path):
    check(f"{SCENE}{text}\n", 7, column, part, tmp_path)


def test_hints_for_words_of_lammps_are_words_of_ours():
    for family, words in errors.table()["instead"].items():
        for word, hint in words.items():
            assert not registry.knows(family, word)
            for command in re.findall(r"(\w+)\(", hint):
                assert registry.knows("command", command), hint
            style = re.match("the style ([^,]*)", hint)
            assert not style or registry.knows(family, style[1]), hint


@pytest.mark.parametrize("text", ["a = 1/0", "run(10"])
def test_nothing_runs_when_something_later_cannot_be_read(text, tmp_path):
    if text == "run(10":
        with pytest.raises(ScriptError):
            run("nosuchcommand(1)\n" + text, tmp_path)
    else:
        with pytest.raises(ScriptError, match="unknown command"):
            run("nosuchcommand(1)\n" + text, tmp_path)


def test_mistakes_after_a_run_are_found_before_its_first_step(tmp_path):
    hub = Hub()
    hub.folder = tmp_path
    script = SCENE + "run(3)\na = 1\nfix(f, body_force, nowhere, 0, 0)\n"
    with pytest.raises(ScriptError, match="unknown group 'nowhere'") as caught:
        Interpreter(hub).run_text(script)
    assert caught.value.mark.line == 10
    assert hub.update.step == 0


def test_results_that_a_rehearsal_does_not_have_raise_nothing(tmp_path):
    script = SCENE + (
        "fix(Ek, kinetic_energy, all)\nrun(2)\nE0 = value(Ek_s)\nratio = 1/E0 + sqrt(E0 - 1)\n"
        "quit\nnosuchcommand(1)\n"
    )
    hub = Hub()
    hub.folder = tmp_path
    with pytest.raises(ScriptError, match="division by zero"):
        # Nothing moves: E0 is 0, and only the real value can say so.
        Interpreter(hub).run_text(script)
    assert hub.update.step == 2


def test_multi_line_text_marks_the_line_of_the_word(tmp_path):
    with pytest.raises(ScriptError) as caught:
        run(SCENE + "fix(v, velocity_nodes,\n    nowhere, # where\n    0, 0)", tmp_path)
    place = caught.value.mark
    assert (place.line, place.column, place.length) == (9, 5, 7)
    assert place.text == "    nowhere, # where"


def test_tabs_keep_the_marks_in_line():
    text = render_message("error", "m", Mark("f", 1, 3, 1, "a\tb"))
    assert text.splitlines()[2].endswith("|  \t^")


def test_long_lines_are_cut_around_the_mark():
    line = "a = " + "1 + " * 200 + "b"
    text = render_message("error", "m", Mark("f", 1, len(line), 1, line)).splitlines()
    assert len(text[1]) < 200
    assert text[1].index("b") == text[2].index("^")


@pytest.mark.parametrize(
    ("name", "names", "expected"),
    [
        ("Run", ["run", "runs"], "run"),
        ("metod", ["method", "mesh"], "method"),
        ("zzz", ["a", "b"], None),
        ("cubic", ["linear", "cubic-spline"], "cubic-spline"),
        ("Hertz", ["contact/friction", "contact/hertz"], "contact/hertz"),
        ("a", [], None),
    ],
)
def test_nearest(name, names, expected):
    assert nearest(name, names) == expected


# ---- files --------------------------------------------------------------------------------------


def run_file(path):
    hub = Hub()
    hub.folder = path.parent
    interpreter = Interpreter(hub)
    interpreter.run_file(path)
    return interpreter.variables


def test_include_is_relative_to_its_script(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "in.main").write_text("a = 1\ninclude(sub/one.in)\nd = b + c\n")
    (tmp_path / "sub" / "one.in").write_text("b = a + 1\ninclude(two.in)\n")
    (tmp_path / "sub" / "two.in").write_text("c = 10")
    assert run_file(tmp_path / "in.main")["d"] == 12


def test_mistakes_in_an_included_script_are_marked_there(tmp_path):
    (tmp_path / "in.main").write_text("include(one.in)\n")
    (tmp_path / "one.in").write_text("\na = nothing\n")
    with pytest.raises(ScriptError) as caught:
        run_file(tmp_path / "in.main")
    assert caught.value.mark.file.endswith("one.in")
    assert caught.value.mark.line == 2


def test_include_of_itself_is_refused(tmp_path):
    (tmp_path / "in.main").write_text("include(one.in)\n")
    (tmp_path / "one.in").write_text("include(in.main)\n")
    with pytest.raises(ScriptError, match="includes itself"):
        run_file(tmp_path / "in.main")


def test_quit_ends_everything_quietly(tmp_path):
    (tmp_path / "in.main").write_text("include(one.in)\na = 2\n")
    (tmp_path / "one.in").write_text("a = 1\nquit # enough\na = 3")
    assert run_file(tmp_path / "in.main") == {"a": 1.0}


def test_a_missing_file_a_folder_and_a_binary_file(tmp_path):
    (tmp_path / "in.main").write_text("")
    with pytest.raises(ScriptError) as caught:
        run_file(tmp_path / "in.mian")
    assert "in.main" in caught.value.hint
    with pytest.raises(ScriptError, match="is a folder"):
        run_file(tmp_path)
    (tmp_path / "binary").write_bytes(b"a\0b")
    with pytest.raises(ScriptError, match="not a text file"):
        run_file(tmp_path / "binary")


def test_other_encodings_are_read(tmp_path):
    (tmp_path / "latin").write_bytes("a = 1 # größer\r\nb = 2".encode("latin-1"))
    assert run_file(tmp_path / "latin") == {"a": 1.0, "b": 2.0}
    (tmp_path / "utf16").write_bytes("a = 3".encode("utf-16"))
    assert run_file(tmp_path / "utf16") == {"a": 3.0}


def test_print_shows_values(tmp_path, capsys):
    hub = run('a = 2\nf = a*time\nw = "linear"\nprint(a, f, w, "done")\nprint(x0)', tmp_path)
    assert hub.mark.line == 5
    out = capsys.readouterr().out
    assert 'a = 2, f = 2*time = 0, w = "linear", done' in out
    assert "x0 = x0" in out


def test_the_name_of_a_style_wins_over_a_variable(run_interpreted):
    words = [
        f'{word} = "nothing"'
        for word in ("ulmpm", "FLIP", "linear", "block", "kinetic_energy", "all")
    ]
    text = block(1, "compute(E, kinetic_energy, all)", "log_modify(custom, step, E)", "run(1)")
    assert run_interpreted("\n".join([*words, text])).log.Step[-1] == 1


def test_a_compute_does_not_hide_the_time(run_interpreted):
    said = run_interpreted(block(1, "compute(time, kinetic_energy, all)", "run(1)"), status=1).err
    assert "would publish its value as 'time', which is the time of the run" in said


def test_swapped_pressure_and_exponent_of_a_liquid_are_told(tmp_path):
    script = SCENE + "eos(water, fluid, 1000, 7, 3e8)\n"
    check(script, 7, 28, "hint: eos(ID, fluid, 1000, 3e+08, 7)", tmp_path)


def test_swapped_modulus_and_speed_of_a_shock_are_told(tmp_path):
    """Copper: K = 137 GPa, c0 = 3940 m/s, rho = 8930 kg/m^3 (Meyers 1994)."""
    line = "eos(cu, shock, 8930, {}, {}, 1.49, 1.96, 385, 294, 1.5, 0.06)"
    run(line.format("137e9", 3940), tmp_path)
    with pytest.raises(ScriptError, match=r"K = 3940 and c0 = 1.37e\+11 are swapped") as caught:
        run(line.format(3940, "137e9"), tmp_path)
    assert "eos(ID, shock, 8930, 1.37e+11, 3940, ...)" in caught.value.render()
