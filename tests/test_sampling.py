"""Random variables of studies: distributions, results, probabilities, sensitivity."""

import json
import re

import numpy as np
import pandas
import pytest
from conftest import INPUTS
from scipy import stats

from karamelo_py.app.cli import main
from karamelo_py.app.studies import sampling, sensitivity, surrogate, uncertainty
from karamelo_py.script.errors import ScriptError

SCRIPT = """
a = 1
b = 2
method(ulmpm, FLIP, linear, 1)
dimension(1, 0, 10, 1)
region(line, block, 1, 2)
material(rubber, linear, 2, 100, 0)
solid(body, region, line, 2, rubber, 1, 0)
fix(v, initial_velocity_particles, all, a + 2*b)
set_dt(0.01)
compute(v, average_velocity, all)
log_modify(custom, step, time, v_x)
run(1)
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    (tmp_path / "in.lin").write_text(SCRIPT, encoding="utf-8")
    return tmp_path


def laws(*words):
    return [one.law for one in sampling.random_variables(words)[0]]


@pytest.mark.parametrize(
    ("text", "mean", "deviation"),
    [
        ("uniform(2, 8)", 5, 6 / np.sqrt(12)),
        ("normal(3, 0.5)", 3, 0.5),
        ("lognormal(1e7, 3e6)", 1e7, 3e6),
        ("loguniform(1, 100)", 99 / np.log(100), None),
        ("triangular(1, 2, 6)", 3, np.sqrt((1 + 4 + 36 - 2 - 6 - 12) / 18)),
    ],
)
def test_distributions_have_the_moments_that_they_name(text, mean, deviation):
    (law,) = laws(f"x={text}")
    assert law.mean() == pytest.approx(mean)
    if deviation:
        assert law.std() == pytest.approx(deviation)


def test_longer_sequences_begin_with_shorter_ones():
    two = laws("a=normal(0, 1)", "b=uniform(0, 1)")
    for sequence in ("halton", "sobol"):
        few, many = (sampling.samples(two, n, sequence, 3) for n in (16, 32))
        assert np.array_equal(few, many[:16])
    strata = np.sort(sampling.samples(two, 50, "latin", 1)[:, 1] * 50).astype(int)
    assert np.array_equal(strata, np.arange(50))  # one in each of 50 parts


def test_correlated_normals(tmp_path):
    """Correlation and means of 4096 points of Sobol' within a part of 1/sqrt(n)."""
    (tmp_path / "r.csv").write_text("b,a\n0.7,1\n1,0.7\n".replace("b,a", "a,b"), "utf-8")
    with pytest.raises(ScriptError, match="not a matrix of correlations"):
        sampling.correlation(tmp_path / "r.csv", ["a", "b"])
    (tmp_path / "r.csv").write_text("a,b\n1,0.7\n0.7,1\n", "utf-8")
    factor = sampling.correlation(tmp_path / "r.csv", ["a", "b"])
    two = laws("a=normal(5, 2)", "b=normal(-1, 0.1)")
    drawn = sampling.samples(two, 4096, "sobol", 1, factor)
    assert np.corrcoef(drawn.T)[0, 1] == pytest.approx(0.7, abs=0.005)
    assert drawn.mean(axis=0) == pytest.approx([5, -1], abs=0.005)
    (tmp_path / "r.csv").write_text("a,b\n1,1.2\n1.2,1\n", "utf-8")
    with pytest.raises(ScriptError, match="contradict each other"):
        sampling.correlation(tmp_path / "r.csv", ["a", "b"])


def test_intervals_of_means_and_of_probabilities():
    """Normal theory for 4000 numbers; Wilson (1927) in closed form."""
    values = stats.norm.ppf((np.arange(4000) + 0.5) / 4000)
    mean, deviation, low, median, high = uncertainty.statistics_of(values)
    assert mean.high - mean.low == pytest.approx(2 * 1.96 / np.sqrt(4000), rel=0.1)
    assert deviation.high - deviation.low == pytest.approx(2 * 1.96 / np.sqrt(8000), rel=0.1)
    assert (low.value, median.value, high.value) == pytest.approx((-1.645, 0, 1.645), abs=2e-3)
    n, k, z = 32, 11, 1.959964
    middle, half = (
        (k + z * z / 2) / (n + z * z),
        z / (n + z * z) * np.sqrt(k * (n - k) / n + z * z / 4),
    )
    found = uncertainty.probability(k, n)
    assert (found.low, found.high) == pytest.approx((middle - half, middle + half), rel=1e-5)


def ishigami(x):
    return (np.sin(x[0]) + 7 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]))[None]


def test_indices_of_ishigami():
    """Ishigami & Homma 1990: first 0.3139, 0.4424, 0; total 0.5576, 0.4424, 0.2437."""
    three = laws(*[f"{name}=uniform({-np.pi}, {np.pi})" for name in "abc"])
    (rows,) = sensitivity.sobol(three, ishigami, 4096, 1)
    few = [sensitivity.sobol(three, ishigami, 64, 1) for _ in range(2)]
    assert few[0] == few[1]  # intervals, too
    first, total = zip(*rows, strict=True)
    assert [one.value for one in first] == pytest.approx([0.3139, 0.4424, 0], abs=0.01)
    assert [one.value for one in total] == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.01)
    for one, exact in zip(
        (*first, *total), (0.3139, 0.4424, 0, 0.5576, 0.4424, 0.2437), strict=True
    ):
        assert one.low - 5e-3 < exact < one.high + 5e-3 and one.high - one.low < 0.15


ISHIGAMI = [f"-var={name}=uniform({-np.pi}, {np.pi})" for name in "abc"]


@pytest.mark.usefixtures("starts_are_cheap")
@pytest.mark.parametrize("n", [2, pytest.param(256, marks=pytest.mark.full)])
def test_indices_of_a_script_that_only_computes(tmp_path, monkeypatch, capsys, n):
    monkeypatch.chdir(tmp_path)
    words = [str(INPUTS / "in.ishigami"), *ISHIGAMI, "-record", "f", "-n", str(n)]
    assert main(["sensitivity", *words]) == 0
    table = pandas.read_csv("sensitivity.csv")
    assert len(table) == 5 * n
    assert table.f.to_numpy() == pytest.approx(ishigami(table[[*"abc"]].to_numpy().T)[0])
    if n > 2:
        found = re.findall(r"(\S+) \((\S+) to (\S+)\)", capsys.readouterr().out)
        exact = (0.3139, 0.5576, 0.4424, 0.4424, 0, 0.2437)
        for (_, low, high), value in zip(found, exact, strict=True):
            assert float(low) <= value <= float(high)


def test_indices_of_a_fit():
    """Ishigami & Homma 1990 by 200 runs; a quadratic of normals, known in closed form, by 30.

    x + y^2 + x z of standard normals has the variances 1 of x, 2 of y^2 and 1 of x z.
    """
    three = laws(*[f"{name}=uniform({-np.pi}, {np.pi})" for name in "abc"])
    (rows,), ((name, wrong),) = surrogate.indices(three, ishigami, 200, 1)
    assert name == "a Gaussian process" and wrong < 0.2
    exact = (0.3139, 0.5576), (0.4424, 0.4424), (0, 0.2437)
    for pair, known in zip(rows, exact, strict=True):
        assert [one.value for one in pair] == pytest.approx(known, abs=0.03)
    normals = laws(*[f"{name}=normal(0, 1)" for name in "abc"])
    (rows,), ((name, wrong),) = surrogate.indices(
        normals, lambda x: (x[0] + x[1] ** 2 + x[0] * x[2])[None], 30, 1
    )
    assert name == "a quadratic polynomial" and wrong < 1e-9
    exact = (0.25, 0.5), (0.5, 0.5), (0, 0.25)
    for pair, known in zip(rows, exact, strict=True):
        assert [one.value for one in pair] == pytest.approx(known, abs=0.07)


def test_failed_runs_bound_a_probability(capsys):
    """All, or none, of the runs without a result may be events."""
    rows = [{"status": "done", "v": float(k)} for k in range(15)] + [{"status": "failed"}] * 5
    uncertainty.tell(rows, [], "v > 11.5")
    out = capsys.readouterr().out
    assert (
        "; 3 of 15 runs\n  with the 5 runs without a result: between 3 and 8 of 20, 0.15 to" in out
    )
    assert "5 runs without results are left out" in out


@pytest.mark.usefixtures("starts_are_cheap")
def test_a_sample_of_a_linear_function(folder, capsys):
    """v = a + 2 b of normals: mean 1 + 4, deviation sqrt(0.1^2 + 4 0.05^2), P(v > 5) = 1/2."""
    words = ["-var", "a=normal(1, 0.1)", "-var", "b=normal(2, 0.05)", "-sequence", "halton"]
    command = ["sweep", "in.lin", "-record", "v_x", *words, "-fails", "v_x > 5", "-o", "s.csv"]
    assert main([*command, "-sample", "12"]) == 0
    capsys.readouterr()
    assert main([*command, "-sample", "24"]) == 0
    out = capsys.readouterr().out
    assert "24 of 24 runs are done; 12 were known" in out
    table = pandas.read_csv("s.csv")
    assert table.v_x.to_numpy() == pytest.approx((table.a + 2 * table.b).to_numpy(), rel=1e-9)
    assert table.v_x.mean() == pytest.approx(5, abs=0.03)
    assert table.v_x.std() == pytest.approx(np.sqrt(0.02), rel=0.2)
    (line,) = [line for line in out.splitlines() if line.startswith("v_x ")]
    assert float(line.split()[1]) == pytest.approx(table.v_x.mean(), rel=1e-3)
    seen = int((table.v_x > 5).sum())
    assert f"probability of v_x > 5: {seen / 24:.4g}" in out and f"; {seen} of 24 runs" in out
    made = json.loads((folder / "s.json").read_text())
    assert made["random"] == {"a": "normal(1, 0.1)", "b": "normal(2, 0.05)"} and made["seed"] == 1
    assert main(["chart", "s.csv", "-distribution", "v_x", "-o", "d.png"]) == 0
    assert (folder / "d.png").stat().st_size > 5000
    assert "drawn: d.png" in capsys.readouterr().out


@pytest.mark.usefixtures("starts_are_cheap")
def test_the_settlement_of_a_column(folder):
    """u = rho g H^2/(2 E), of points a quarter of a cell below the top."""
    words = ["-var", "E=lognormal(1e7, 2e6)", "-var", "rho=lognormal(2000, 100)"]
    assert (
        main(["sweep", str(INPUTS / "in.settlement"), "-sample", "6", *words, "-record", "u"]) == 0
    )
    table = pandas.read_csv("sweep.csv")
    exact = table.rho * 9.81 * 10**2 / (2 * table.E)
    assert table.u.to_numpy() == pytest.approx(exact.to_numpy(), rel=0.03)


@pytest.mark.parametrize(
    ("c", "t"), [(9e3, 0.36), (11.4e3, 0.34), pytest.param(13e3, 0.31, marks=pytest.mark.full)]
)
def test_slopes_slide_where_their_factor_of_safety_is_below_one(run_script, c, t):
    """F = c/(rho g H sin(b)) + tan(phi)/tan(b), limit equilibrium of an infinite slope.

    The factors are 0.989, 1.004 and 0.978.
    """
    log = run_script(INPUTS / "in.infinite_slope", "-var", "c", str(c), "-var", "t", str(t)).log
    b = np.radians(25)
    exact = c / (2000 * 9.81 * 5 * np.sin(b)) + t / np.tan(b)
    assert log["F"][-1] == pytest.approx(exact, rel=1e-6)
    assert (log["v_x"][-1] > 0.001) == (exact < 1)


@pytest.mark.usefixtures("starts_are_cheap")
def test_each_value_of_another_variable_is_a_sample(folder, capsys):
    """v = a + 2 b: means differ by 2 between b = 0 and 1; nothing is pooled."""
    words = ["-var", "a=normal(1, 0.1)", "-var", "b=0,1", "-sample", "6", "-fails", "v_x > 2"]
    assert main(["sweep", "in.lin", *words, "-record", "v_x"]) == 0
    out = capsys.readouterr().out
    first, second = out.split("\nb = 0\n")[1].split("\nb = 1\n")
    means = [float(re.search(r"^v_x +(\S+)", part, re.M)[1]) for part in (first, second)]
    assert means[1] - means[0] == pytest.approx(2, rel=1e-3)
    assert "0 of 6 runs" in first and "6 of 6 runs" in second
    assert main(["chart", "sweep.csv", "-distribution", "v_x", "-o", "d.png"]) == 1
    assert "-where 'b == 0'" in capsys.readouterr().err
    assert (
        main(["chart", "sweep.csv", "-distribution", "v_x", "-o", "d.png", "-where", "b == 0"]) == 0
    )


@pytest.mark.usefixtures("starts_are_cheap")
def test_sensitivity_of_a_linear_function(folder, capsys):
    """Morris: mu* is slope times range, without deviation; no run is made twice."""
    words = ["-var", "a=uniform(0, 1)", "-var", "b=uniform(0, 1)", "-record", "v_x"]
    assert main(["sensitivity", "in.lin", *words, "-method", "morris", "-n", "2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for name, slope in (("a", 1), ("b", 2)):
        (cells,) = [line.split() for line in lines if line.startswith(f"{name} ")]
        assert float(cells[1]) == pytest.approx(slope * 0.98, rel=1e-3)
        assert float(cells[-1]) == pytest.approx(0, abs=1e-8)
    assert main(["sensitivity", "in.lin", *words, "-n", "2", "-o", "sobol.csv"]) == 0
    out = capsys.readouterr().out
    assert "first" in out and "-n 4 makes them narrower" in out
    assert len(pandas.read_csv("sobol.csv")) == 8
    assert main(["sensitivity", "in.lin", *words, "-method", "fit", "-n", "6", "-o", "f.csv"]) == 0
    out = capsys.readouterr().out
    assert "v_x: a linear function has a leave-one-out error of" in out
    assert re.search(r"^b +0\.[78]", out, re.M) and "6 runs" in out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["-sample", "8", "-var", "a=nromal(1, 2)"], "did you mean 'normal'"),
        (["-sample", "8", "-var", "a=normal(1, 0)"], "deviation) with numbers, deviation > 0"),
        (["-sample", "8", "-var", "a=uniform(2, 1)"], "with numbers, low < high"),
        (["-sample", "8", "-var", "a=normal(1)"], "normal(mean, deviation) with numbers"),
        (["-sample", "8", "-var", "a=lognormal(0, 1)"], "mean > 0 && deviation > 0"),
        (["-sample", "8", "-var", "a=1,2"], "no variable is random"),
        (["-sample", "9", "-var", "a=normal(1, inf)"], "normal(mean, deviation) with numbers"),
        (["-sample", "9", "-sequence", "sobol", "-var", "a=normal(1, 1)"], "a power of 2"),
        (["-var", "a=normal(1, 1)"], "-sample N, such as 200"),
        (["-var", "a=1,2", "-fails", "a > 1"], "-sample N with them"),
        (["-sample", "8", "-var", "q=normal(1, 1)"], "has no such variable"),
    ],
)
def test_samples_that_are_refused(folder, capsys, words, says):
    assert main(["sweep", "in.lin", *words]) == 1
    assert says in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["-var", "a=normal(1, 1)"], "sensitivity compares random variables"),
        (["-var", "a=normal(1, 1)", "-var", "b=1,2", "-var", "b=normal(0, 1)"], "several values"),
        (["-var", "a=normal(1, 1)", "-var", "b=normal(1, 1)", "-n", "5"], "a power of 2"),
        (
            ["-var", "a=normal(1, 1)", "-var", "b=normal(1, 1)", "-method", "fit", "-n", "5"],
            "-n 6 or more for 2 variables",
        ),
    ],
)
def test_sensitivities_that_are_refused(folder, capsys, words, says):
    assert main(["sensitivity", "in.lin", "-record", "v_x", *words]) == 1
    assert says in capsys.readouterr().err
