"""Columns p and rho of points, for every law: in dumps, probes, conditions and pictures."""

import numpy as np
import pytest

# A square is drawn together evenly: rho = rho0/J, and p follows from the law.
SQUARE = """
    method(tlmpm, FLIP, linear, 1)
    dimension({d}, 0, 1, 0, 1{z}, 0.5)
    region(b, block, 0, 1, 0, 1{z})
    {law}
    solid(b, region, b, 2, m, 0.5, 0)
    region(every, block{every})
    group(every, nodes, region, every, all)
    fix(v, velocity_nodes, every, -x0, -y0{v})
    compute(p, probe, all, p, point=3)
    compute(rho, probe, all, rho, point=3)
    log_modify(custom, step, p, rho)
    dump(d, all, particle, 5, d.*.txt, p, rho, mass, volume, s11, s22, s33)
    dump(f, all, pyplot, 5, f.*.png, 200, 200, p/1e3, only=rho > 0)
    fix(e, erosion, all, rho > 1e6 || p < -1e12)
    set_output(5)
    set_dt(2e-3)
    run(5)
"""
PARTS = "material(m, eos-strength, e, s)"
LAWS = {
    "linear": ("material(m, linear, 1000, 1e6, 0.3)", None),
    "neo-hookean": ("material(m, neo-hookean, 1000, 1e6, 0.3)", None),
    "hencky": ("material(m, hencky, 1000, 1e6, 0.3)", None),
    "cam-clay": ("material(m, cam-clay, 1000, 4e6, 1.0, 0.1, 0.02, 1e5)", None),
    "soil": (
        f"eos(e, linear, 1000, 2e6)\n    strength(s, mohr-coulomb, 1e6, 1e9, 30)\n    {PARTS}",
        lambda rho: 2e6 * (1 - 1000 / rho),
    ),
    "water": (
        f"eos(e, fluid, 1000, 1e6, 7)\n    strength(s, fluid, 0)\n    {PARTS}",
        lambda rho: 1e6 * ((rho / 1000) ** 7 - 1),
    ),
    "gas": (
        f"eos(e, ideal-gas, 1000, 1.4, p=1e5)\n    strength(s, fluid, 0)\n    {PARTS}",
        lambda rho: 1e5 * (rho / 1000) ** 1.4,
    ),
}


def square(law, d=2):
    z, v = (", 0, 1", ", 0") if d == 3 else ("", "")
    return SQUARE.format(law=law, d=d, z=z, v=v, every=2 * d * ", INF")


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("law", LAWS)
def test_pressure_and_density_of_every_law(run_interpreted, law, d):
    if d == 3 and law not in ("soil", "linear"):
        pytest.skip("the same")
    text, pressure = LAWS[law]
    drawn = law == "soil"
    done = run_interpreted(square(text, d).replace("dump(f,", "dump(f," if drawn else "# dump(f,"))
    rows = (done.folder / "d.5.txt").read_text().partition("ITEM: ATOMS ")[2].splitlines()
    names = rows[0].split()
    table = dict(zip(names, np.loadtxt(rows[1:]).T, strict=True))
    assert table["rho"] == pytest.approx(1000 / 0.99**2, rel=3e-4)  # steps of 0.2 %
    assert table["rho"] == pytest.approx(table["mass"] / table["volume"], rel=1e-9)
    assert table["p"] == pytest.approx(-(table["s11"] + table["s22"] + table["s33"]) / 3, rel=1e-6)
    if pressure is not None:
        assert table["p"] == pytest.approx(pressure(table["rho"]), rel=0.02)
    log = done.log
    assert log.p[-1] == pytest.approx(table["p"][2]) and log.rho[-1] == pytest.approx(
        table["rho"][2]
    )
    assert (done.folder / "f.5.png").exists() == drawn and "column" not in done.err


def test_a_variable_with_the_name_of_a_column(run_interpreted):
    """The column is meant, and the user is told of it."""
    script = square(f"rho = 7\n    {LAWS['linear'][0]}")
    err = run_interpreted(script).err
    assert err.count("'rho' is the column here, not the variable of the script") == 2


def test_pressure_in_words(run_interpreted):
    script = square(LAWS["linear"][0]).replace("txt, p, rho", "txt, pressure")
    assert "hint: did you mean p?" in run_interpreted(script, status=1).err
