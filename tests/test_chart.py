"""Charts of sweeps: orders, Pareto front, and pictures in which nothing hides anything."""

import itertools
import json
import re
import shlex
import subprocess
import sys
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from karamelo_py.app.cli import main
from karamelo_py.app.studies import look, pictures
from karamelo_py.app.studies.chart import in_html
from karamelo_py.app.studies.curves import Family, Table, order
from karamelo_py.output.plots import blank_figure, tick_texts, tidy

ORDERS = {"linear": 1, "quadratic-spline": 2, "cubic-spline": 4}


def rows():
    """Errors N^-order and times 1e-3 N^2 of three bases; the finest linear run has failed."""
    found = []
    for basis, p in ORDERS.items():
        for n in (10, 20, 40, 80):
            failed = basis == "linear" and n == 80
            found.append(
                {
                    "N": str(n),
                    "basis": basis,
                    "err": "" if failed else f"{n**-p:.12g}",
                    "seconds": "" if failed else f"{1e-3 * n**2 * (1 + p / 10):.12g}",
                    "status": "failed" if failed else "done",
                    "reason": "point 3 <leaves>" if failed else "",
                    "folder": f"sweep/N={n},basis={basis}",
                }
            )
    return found


@pytest.fixture
def table(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lines = [",".join(rows()[0])] + [
        ",".join(f'"{cell}"' for cell in row.values()) for row in rows()
    ]
    (tmp_path / "sweep.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    made = {"script": "in.x", "variables": {"N": [], "basis": []}, "timed": True, "threads": 1}
    (tmp_path / "sweep.json").write_text(json.dumps(made), encoding="utf-8")
    return tmp_path


RESULTS = """a,mu,runout,seconds,status,reason,folder
2,0.1,2.5,1,done,,f
0.5,0.1,0.6,1,done,,f
1,0.1,-1.18,1,done,,f
1,0.3,1.0,1,done,,f
2,0.3,,1,failed,x,f
"""


@pytest.fixture
def results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "r.csv").write_text(RESULTS, encoding="utf-8")
    made = {"script": "in.x", "variables": {"a": [], "mu": []}}
    (tmp_path / "r.json").write_text(json.dumps(made), encoding="utf-8")
    (tmp_path / "seen.csv").write_text("runout,other,a\n0.58,7,0.5\n1.75,7,1.5\n", encoding="utf-8")
    return tmp_path


def test_a_result_over_a_variable(results, monkeypatch, capsys):
    """Of any sign, in order of the variable, with a law and measured points; what failed is out."""
    drawn = []
    monkeypatch.setattr(pictures, "savefig", lambda figure, path: drawn.append(figure))
    words = ["-y", "runout", "-x", "a", "-law", "1.2*a", "-data", "seen.csv", "-o", "r.png"]
    assert main(["chart", "r.csv", *words]) == 0
    (figure,) = drawn
    axes = figure.axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("linear", "linear")
    found = [line.get_xydata().tolist() for line in axes.lines if line.get_marker() == "o"]
    assert found == [[[0.5, 0.6], [1, -1.18], [2, 2.5]], [[1, 1.0]]]
    (law,) = (line for line in axes.lines if line.get_linewidth() == 4)
    assert np.allclose(law.get_ydata(), 1.2 * law.get_xdata()) and law.get_xdata()[-1] == 2
    (seen,) = (line for line in axes.lines if line.get_marker() == "+")
    assert seen.get_xydata().tolist() == [[0.5, 0.58], [1.5, 1.75]]
    assert {"mu = 0.1", "mu = 0.3", "1.2*a", "seen.csv"} <= {t.get_text() for t in axes.texts}
    out = capsys.readouterr().out
    assert re.search(r"^  2 +2.5 +2.4 +\+4.2$", out, re.M)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("-y nope -x a", "the table has no 'nope'"),
        ("-y runout", "-y without -x"),
        ("-y runout -x nope", "the table has no 'nope'"),
        ("-y runout -x a -law 1.2*b", "unknown name 'b'"),
        ("-y runout -x a -law (", "is not closed"),
        ("-y runout -x a -data nofile.csv", "nofile.csv cannot be read"),
        ("-y reason -x a", "no run has numbers"),
        ("-accuracy runout -law 2*a", "-law and -data are drawn with -y"),
    ],
)
def test_results_that_cannot_be_drawn(results, capsys, words, said):
    assert main(["chart", "r.csv", *words.split()]) == 1
    err = capsys.readouterr().err
    assert said in err and err.count("error") == 1


def test_what_a_page_shows_and_offers_is_no_code():
    """A browser takes <!--<script> for its own, a shell what is in $( )."""
    from karamelo_py.app.studies.case import command_of

    command = command_of("in x", {"tag": '"a $(touch HACKED)"', "E": "4000*(1+1)"})
    assert shlex.split(command) == [
        "karamelo-py", "in x", "-var", "tag", '"a $(touch HACKED)"', "-var", "E", "4000*(1+1)",
    ]  # fmt: skip
    done = subprocess.run(["sh", "-c", f"printf '%s|' {command}"], capture_output=True, text=True)
    assert done.stdout.split("|")[:-1] == shlex.split(command)


def test_the_order_of_a_power_law():
    found = order([10, 20, 40], [3 * n**-2.0 for n in (10, 20, 40)])
    assert (found.exponent, found.lowest, found.highest) == pytest.approx((-2, -2, -2))
    # 1 between the first two, 2 between the last two; what has no logarithm does not count.
    found = order([1, 2, 4, 8], [8, 4, 1, np.inf])
    assert (found.lowest, found.highest) == pytest.approx((-2, -1))
    assert found.exponent == pytest.approx(-1.5)
    assert str(order([1], [1])) == "–"


def test_the_table_tells_orders_and_front(table, capsys):
    assert main(["chart", "sweep.csv", "-accuracy", "err", "-by", "basis"]) == 0
    out = capsys.readouterr().out
    # Errors fall with N^-p, and with the cost, N^2, to half that power.
    for basis, p in ORDERS.items():
        assert re.search(rf"{basis} +{p / 2:.2f} +{p:.2f} +2.00", out)
    assert re.search(r"cubic-spline +80 +8.96 .* front", out)
    assert not re.search(r"quadratic-spline +40 .*front", out)
    assert "failed: point 3 <leaves>" in out
    # Over a variable, costs say nothing unless they are asked for.
    words = ["chart", "sweep.csv", "-accuracy", "err", "-by", "basis", "-x", "N"]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "err by N" in out and "seconds" not in out and "front" not in out
    assert main([*words, "-cost", "seconds"]) == 0
    assert "seconds by N" in capsys.readouterr().out


@given(st.lists(st.tuples(st.floats(1e-3, 1e3), st.floats(1e-9, 1)), min_size=1, max_size=30))
def test_nothing_beats_the_front_and_the_front_beats_the_rest(runs):
    table = [{"c": str(c), "e": str(e), "k": str(k)} for k, (c, e) in enumerate(runs)]
    front = Family(Table(table, ["k"]), "e", "c").front()
    chosen = [(float(row["c"]), float(row["e"])) for row in front]
    for cost, error in runs:
        beaten = any(c <= cost and e <= error for c, e in chosen)
        assert beaten  # by itself, if it is on the front
    for a, b in combinations(chosen, 2):
        assert a[0] <= b[0] and a[1] > b[1]


@given(st.lists(st.floats(0, 1), min_size=1, max_size=20))
def test_labels_are_moved_apart(wanted):
    places = look.apart(wanted, 0.05, 0.0, 1.0)
    ranked = np.sort(places)
    assert (np.diff(ranked) > 0.05 - 1e-9).all()
    assert ranked[0] > -1e-9 and ranked[-1] < 1 + 1e-9
    inverse = np.argsort(wanted, kind="stable")
    assert (np.diff(places[inverse]) > 0).all()  # no leader line crosses another


def overlap(a, b):
    return min(a.x1, b.x1) - max(a.x0, b.x0) > 1 and min(a.y1, b.y1) - max(a.y0, b.y0) > 1


@pytest.mark.parametrize(
    "words", [[], ["-x", "N"], ["-heat", "N,basis"]], ids=["cost", "convergence", "heat"]
)
def test_no_text_hides_another(table, monkeypatch, words):
    from matplotlib.text import Text

    drawn = []
    monkeypatch.setattr(pictures, "savefig", lambda figure, path: drawn.append(figure))
    assert main(["chart", "sweep.csv", "-accuracy", "err", *words, "-o", "chart.png"]) == 0
    figure = drawn[0]
    figure.canvas.draw()
    texts = [t for t in figure.findobj(Text) if t.get_visible() and t.get_text().strip()]
    boxes = {t: t.get_window_extent() for t in texts}
    inside = [t for t in texts if figure.bbox.overlaps(boxes[t])]
    for a, b in combinations(inside, 2):
        assert not overlap(boxes[a], boxes[b]), (a.get_text(), b.get_text())
    said = {t.get_text() for t in inside}
    if not words:
        assert {*ORDERS, "time of the stepping loop (s)", "err"} <= said
    if words == ["-x", "N"]:
        assert {"10", "20", "40", "80", "× at the top: no value (failed)"} <= said
    if words[:1] == ["-heat"]:
        assert {"0.1", "2.4e-08", "×\nfailed", *ORDERS} <= said


def test_words_side_by_side(table, monkeypatch, capsys):
    drawn = []
    monkeypatch.setattr(pictures, "savefig", lambda figure, path: drawn.append(figure))
    assert main(["chart", "sweep.csv", "-accuracy", "err", "-x", "basis", "-o", "chart.png"]) == 0
    (axes,) = drawn[0].axes
    assert [tick.get_text() for tick in axes.get_xticklabels()] == [*ORDERS]
    assert sum(list(line.get_xdata()) == [0, 1, 2] for line in axes.lines) == 3  # N = 10, 20, 40
    out = capsys.readouterr().out
    assert re.search(r"20 +quadratic-spline +0.0025", out) and "by basis" not in out


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_pictures_are_written(table, suffix):
    name = f"chart.{suffix}"
    assert main(["chart", "sweep.csv", "-accuracy", "err", "-o", name]) == 0
    magic = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix]
    assert (table / name).read_bytes().startswith(magic)


def test_a_closed_pipe_leaves_the_picture(table, starts_are_cheap):
    """Who reads the first lines of the table alone (head -1) wants the picture all the same."""
    words = ["chart", "sweep.csv", "-accuracy", "err", "-o", "chart.png"]
    command = [sys.executable, "-m", "karamelo_py.app.cli", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert b"Traceback" not in process.stderr.read()
    assert (table / "chart.png").exists()


@pytest.mark.parametrize(("first", "scale"), [(0, "linear"), (5, "log")])
def test_a_variable_that_is_zero_has_a_place(table, monkeypatch, first, scale):
    drawn = []
    monkeypatch.setattr(pictures, "savefig", lambda figure, path: drawn.append(figure))
    text = (table / "sweep.csv").read_text(encoding="utf-8").replace('"10"', f'"{first}"')
    (table / "sweep.csv").write_text(text, encoding="utf-8")
    assert main(["chart", "sweep.csv", "-accuracy", "err", "-x", "N", "-o", "chart.png"]) == 0
    (axes,) = drawn[0].axes
    assert axes.get_xscale() == scale and axes.get_yscale() == "log"
    whole = [line for line in axes.lines if len(line.get_xdata()) == 4]
    assert len(whole) == 2 and all(line.get_xdata()[0] == first for line in whole)


def test_words_along_the_axes(table, capsys):
    draw = ["chart", "sweep.csv", "-accuracy", "err", "-o", "chart.svg", "-axes"]
    assert main([*draw, ",relative error (1)"]) == 0
    text = (table / "chart.svg").read_text(encoding="utf-8")
    assert "relative error (1)" in text and "time of the stepping loop (s)" in text
    assert main([*draw, ' "cells, in all" ,basis of N', "-heat", "N,basis"]) == 0
    text = (table / "chart.svg").read_text(encoding="utf-8")
    assert "cells, in all" in text and "basis of N" in text
    assert main([*draw, "N,err", "-x", "N"]) == 0
    two = ["-versus", "basis", "-where", "basis != linear"]
    assert main([*draw, "relative error (1),", *two]) == 0
    text = (table / "chart.svg").read_text(encoding="utf-8")
    assert "relative error (1)" in text and "cubic-spline / quadratic-spline" in text
    assert main(["chart", "sweep.csv", "-accuracy", "err", "-axes", "N,err"]) == 1
    assert capsys.readouterr().err.count("expected: -curve, or -accuracy or -y with -o") == 1
    assert main([*draw, "N"]) == 1
    assert "two, such as -axes" in capsys.readouterr().err


def test_a_method_has_its_colour_in_every_chart():
    (alone,) = look.styles([{"basis": "cubic-spline"}])
    among = look.styles([{"basis": basis, "N": N} for basis in ORDERS for N in "34"])
    assert among[-1][:2] == among[-2][:2] == alone[:2] and among[-1] != among[-2]
    methods = {name: look.number(name) for name in look.FAMILIES[0]}
    assert len(set(methods.values())) == len(methods)


def test_curves_have_the_colours_of_their_methods_and_names_where_they_leave_the_axis(monkeypatch):
    """An energy that falls by 20 decades leaves an axis of 16 where it is 1e-16."""
    drawn = []
    monkeypatch.setattr(pictures, "savefig", lambda figure, path: drawn.append(figure))
    time = np.linspace(0, 1, 101)
    fallen = pictures.History(time, 10 ** (-20 * time), "PIC")
    kept = pictures.History(time, np.ones(101), "FLIP")
    pictures.draw_histories([kept, fallen], pictures.Sheet(None, "time (s)", "energy (1)"))
    axes = drawn[0].axes[0]
    curves = [line for line in axes.lines if len(line.get_xdata()) == 101]
    assert [line.get_color() for line in curves] == [
        look.PALETTE[look.number(name)] for name in ("FLIP", "PIC")
    ]
    lead = next(line for line in axes.lines if line.get_color() == curves[1].get_color()
                and len(line.get_xdata()) == 3)  # fmt: skip
    x, y = (axes.transAxes + axes.transData.inverted()).transform(
        [lead.get_xdata()[0], lead.get_ydata()[0]]
    )
    assert x == pytest.approx(0.8) and y == pytest.approx(1e-16)


def test_no_two_lines_look_alike():
    """Of cpgimp and stretch the numbers add up to those of linear and mechanical."""
    cantilevers = [
        {"kind": "ulmpm", "basis": "linear", "domains": "mechanical"},
        {"kind": "ulmpm", "basis": "cpgimp", "domains": "stretch"},
        {"kind": "ulcpdi", "basis": "linear", "domains": "R4"},
    ]
    assert len(set(look.styles(cantilevers))) == 3
    everything = [{"basis": b, "transfer": t} for b in look.FAMILIES[0] for t in look.FAMILIES[1]]
    few = [choice for choice in everything if look.number(choice["transfer"]) < len(look.DASHES)]
    assert len(set(look.styles(few))) == len(few)


@pytest.mark.parametrize("span", [1.1, 1.5, 2.1, 4, 9.3, 30, 400, 1e8, 1e30])
@pytest.mark.parametrize("low", [1, 0.0021, 1.3e-4, 5.7e7])
def test_numbers_along_a_short_logarithmic_axis_do_not_touch(low, span):
    """As drawn: no box of a number reaches into that of the next."""
    figure = blank_figure(8.4, 5.2)
    axes = figure.subplots()
    look.log_axis(axes.xaxis, low, low * span)
    axes.set_ylim(0, 1)
    look.direct_labels(axes, [(low, 1, "quadratic-spline", "k")])
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in axes.get_xticklabels() if text.get_text()]
    assert len(boxes) >= 2
    assert all(a.x1 < b.x0 for a, b in itertools.pairwise(boxes))


def test_orders_have_their_sign_by_the_work_of_runs_not_by_noise_of_their_times():
    """Errors N^-1 of runs on a busy machine, of which the finest took the shortest time."""
    found = [
        {"N": f"{n}", "err": f"{1 / n}", "seconds": f"{1 / n}", "particle_steps": f"{n**3}"}
        for n in (10, 20, 40)
    ]
    (line,) = Family(Table(found, ["N"], made={}), "err", "seconds", along="N").lines
    assert line.rises
    for row in found:  # a table of another program has its costs alone
        del row["particle_steps"]
    (line,) = Family(Table(found, ["N"], made={}), "err", "seconds", along="N").lines
    assert not line.rises


def test_times_of_several_machines_are_not_compared(table, capsys):
    table = table / "sweep.csv"
    lines = table.read_text("utf-8").splitlines()
    named = [f"{line},node-{k % 2}" for k, line in enumerate(lines[1:])]
    table.write_text("\n".join([f"{lines[0]},machine", *named]) + "\n", "utf-8")
    assert main(["chart", str(table), "-accuracy", "err"]) == 1
    said = capsys.readouterr().err
    assert "on 2 machines: node-0, node-1" in said and "-cost node_visits" in said
    where = ["-where", re.search("-where '(.*)'", said)[1]]
    assert main(["chart", str(table), "-accuracy", "err", *where]) == 0
    assert main(["chart", str(table), "-accuracy", "err", "-x", "N"]) == 0


def test_lines_that_end_together_share_a_name():
    """Four of one colour have one; another colour, and another place, have their own."""
    axes = blank_figure(8.4, 5.2).subplots()
    axes.plot([0, 5], [0, 1])  # as autoscaled, of which nobody has asked before
    look.direct_labels(axes, [(5, 1, "linear", "k")])
    at = axes.lines[-1].get_xdata()
    assert at[0] == pytest.approx(1.05 / 1.1) and [*at[1:]] == [1.0, 1.03]
    axes.texts[0].remove()
    axes.set(xlim=(0, 1), ylim=(0, 1))
    ends = [(1, 0.5 + 0.001 * k, f"linear, {word}", "k") for k, word in enumerate(look.FAMILIES[3])]
    ends += [(1, 0.5, "cpgimp, musl", "g"), (1, 0.8, "linear, musl, alpha = 1", "k")]
    look.direct_labels(axes, ends)
    names = [text.get_text() for text in axes.texts]
    assert names == ["linear, musl / usl / usf / usavg", "cpgimp, musl", "linear, musl, alpha = 1"]


def test_round_ticks():
    assert look.log_ticks(0.9, 55) == [1, 2, 5, 10, 20, 50]
    assert look.log_ticks(1e-7, 1) == pytest.approx([10.0**k for k in range(-7, 1)])
    assert look.log_ticks(2.1e-3, 4.6e-3) == pytest.approx([2.5e-3, 3e-3, 3.5e-3, 4e-3, 4.5e-3])
    assert len(look.log_ticks(9.77e-7, 1.2e-6)) >= 3  # 9.8 and 10 would touch: 1.05, 1.1, ...
    # Linear axes, too, say what is there.
    few = r"$5\cdot10^{-6}$", r"$5\cdot10^{4}$"
    for top, said in ((2e-5, few[0]), (2.5e5, few[1]), (4e8, "$10^{8}$"), (2, "0.5")):
        figure = blank_figure(7.0, 4.0)
        axes = figure.subplots()
        axes.set_xlim(0, top)
        tidy(axes)
        figure.canvas.draw()
        labels = [label.get_text() for label in axes.get_xticklabels()]
        assert said in labels
        assert all(("10^" in label) == ("10^" in said) for label in labels if label != "0")
        assert not axes.xaxis.get_offset_text().get_text()


@pytest.mark.parametrize(
    ("ticks", "said"),
    [
        ([5e-4, 1e-3, 0.02, 0], ["0.0005", "0.001", "0.02", "0"]),
        ([2e-7, 1e-3, 0.1], [r"$2\cdot10^{-7}$", "$10^{-3}$", "$10^{-1}$"]),
        ([0, 5e4, 1e5], ["0", r"$5\cdot10^{4}$", "$10^{5}$"]),
    ],
)
def test_numbers_of_an_axis_have_one_style(ticks, said):
    assert tick_texts(ticks) == said
    axes = blank_figure(7.0, 4.0).subplots()
    positive = [tick for tick in ticks if tick]
    look.log_axis(axes.xaxis, positive[0], positive[-1], positive)
    assert axes.xaxis.get_major_formatter().format_ticks(positive) == tick_texts(positive)


def test_numbers_of_an_axis_on_a_page():
    said = ["2·10<sup>-7</sup>", "10<sup>-3</sup>", "0", "-1.5·10<sup>5</sup>"]
    assert tick_texts([2e-7, 1e-3, 0, -1.5e5], in_html) == said
    assert tick_texts([5e-4, 20.0], in_html) == ["0.0005", "20"]


def lucky_rows():
    """Order 1 of two choices; the errors of one change their sign at N = 40 and grow again."""
    return [
        {
            "N": str(n), "kind": kind, "err": str(abs(value)), "err_signed": str(value),
            "seconds": str(1e-3 * n**2), "seconds_spread": str(1e-4 * n**2), "points": str(n),
        }
        for kind, values in (("a", (-8, -4, -0.2, 3)), ("b", (-16, -8, -4, -2)))
        for n, value in zip((10, 20, 40, 80), values, strict=True)
    ]  # fmt: skip


def test_small_errors_by_chance_are_hollow_and_off_the_front(monkeypatch):
    drawn = []
    monkeypatch.setattr(pictures, "savefig", lambda figure, path: drawn.append(figure))
    family = Family(Table(lucky_rows(), ["N", "kind"]), "err", "seconds")
    assert [[*line.lucky] for line in family.lines] == [[False, False, True, True], [False] * 4]
    assert [row["N"] + row["kind"] for row in family.front()] == ["10a", "20a", "80b"]
    pictures.lines(family, pictures.Sheet(None))
    (axes,) = drawn[0].axes
    (hollow,) = [
        line for line in axes.lines
        if line.get_markerfacecolor() == "white" and len(line.get_xdata())
    ]  # fmt: skip
    assert list(hollow.get_ydata()) == [0.2, 3]
    assert "hollow: may be small by chance" in drawn[0].get_supxlabel()
    bars = [each for each in axes.collections if len(each.get_segments())]
    ends = bars[0].get_segments()[0][:, 0]
    assert ends == pytest.approx([0.095, 0.105])  # the spread of 10 % about 0.1 s
    longest = max(float(each.get_segments()[-1][:, 0].max()) for each in bars)
    assert longest == pytest.approx(1.05 * 6.4) and axes.get_xlim()[1] > longest
    # A variable that changes no number of points refines nothing.
    rows = [{**row, "points": "5"} for row in lucky_rows()]
    assert not any(
        line.lucky.any() for line in Family(Table(rows, ["N", "kind"]), "err", "seconds").lines
    )


@pytest.mark.parametrize(("p", "falls"), [(1, True), (2.2, True), (4, True), (2, False)])
def test_a_triangle_shows_the_order_below_all_lines(monkeypatch, p, falls):
    """Of errors N^-p or h^p, in halves."""
    drawn = []
    monkeypatch.setattr(pictures, "savefig", lambda figure, path: drawn.append(figure))
    rows = [
        {
            "x": str(x),
            "err": str(x ** (-p if falls else p)),
            "seconds": str(x**2 if falls else x**-2),
        }
        for x in (1, 2, 4, 8, 16)
    ]
    pictures.lines(Family(Table(rows, ["x"]), "err", "seconds", along="x"), pictures.Sheet(None))
    (axes,) = drawn[0].axes
    (shape,) = axes.patches
    x, y = np.log(shape.get_xy()[:3]).T
    assert (y[0] - y[1]) / abs(x[2] - x[1]) == pytest.approx(round(2 * p) / 2)
    assert all(
        y[0] < np.log(min(float(r["err"]) for r in rows if 4 <= float(r["x"]) <= 8)) for _ in "1"
    )
    assert {f"{round(2 * p) / 2:g}", "1"} <= {text.get_text() for text in axes.texts}
    assert axes.get_ylim()[0] < np.exp(y.min())
    (line,) = Family(Table(rows, ["x"]), "err", "seconds").lines
    assert line.rises == falls


def test_names_of_lines_can_be_read():
    """A contrast of 4.5 to 1 on white at least; black letters have 21."""
    greens = [colour for colour, *_ in look.styles([{"N": n} for n in "12345"])]
    for colour in (*look.PALETTE, *greens):
        rgb = [int(look.readable(colour)[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        assert look.contrast(rgb) >= 4.45
    assert look.contrast([0, 0, 0]) == pytest.approx(21)
    assert look.contrast([0.5, 0.5, 0.5]) == pytest.approx(3.98, abs=0.01)  # #808080 by WCAG
    assert look.readable("#000000") == "#000000"


def test_four_panels_make_a_square(table, monkeypatch):
    drawn = []
    monkeypatch.setattr(pictures, "savefig", lambda figure, path: drawn.append(figure))
    rows = [
        {"a": a, "b": b, "c": c, "err": "0.1", "seconds": "1"}
        for a in "12"
        for b in "12"
        for c in "1234"
    ]
    pictures.heat(
        Family(Table(rows, ["a", "b", "c"]), "err", "seconds"), "a", "b", pictures.Sheet(None)
    )
    places = [axes.get_subplotspec().get_gridspec().get_geometry() for axes in drawn[0].axes[:4]]
    assert places == [(2, 2)] * 4


def test_titles_have_the_units_of_the_script(tmp_path):
    script = tmp_path / "in.units"
    computes = ("Ek, kinetic_energy", "v, average_velocity")
    lines = ["# A bar,", "# 2.5 mm long, swings. More.", 'units("mm", "g", "ms")']
    lines += [f"compute({words}, all)" for words in computes]
    script.write_text("\n".join(lines) + "\n", encoding="utf-8")
    table = Table([], [], made={"script": str(script)})
    assert table.title == "A bar, 2.5 mm long, swings"
    assert [table.label(name) for name in ("Time", "Ek", "v_x", "max:Ek", "err", "seconds")] == [
        "Time (ms)", "Ek (mJ)", "v_x (mm/ms)", "max:Ek (mJ)", "err",
        "time of the stepping loop (s)",
    ]  # fmt: skip
    assert Table([], []).label("wall_s") == "time of the process (s)"


def test_a_page_needs_nothing_else(table):
    pytest.importorskip("plotly")
    from PIL import Image

    folder = table / "sweep" / "N=10,basis=linear"
    folder.mkdir(parents=True)
    Image.new("RGB", (900, 300), "red").save(folder / "plot.png")
    assert main(["chart", "sweep.csv", "-accuracy", "err", "-o", "chart.html"]) == 0
    page = (table / "chart.html").read_text(encoding="utf-8")
    assert not re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=\"?http", page)
    runs = json.loads(re.search(r"const runs = (\[.*?\]), aside", page, re.S)[1])
    assert len(runs) == 12 and runs[0]["command"] == "karamelo-py in.x -var N 10 -var basis linear"
    assert runs[0]["picture"].startswith("data:image/png;base64,") and not runs[1]["picture"]
    assert "point 3 &lt;leaves&gt;" in page and "<leaves>" not in page.split("const runs")[0]


def test_a_page_without_plotly_is_refused_before_the_table(table, monkeypatch, capsys):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["chart", "sweep.csv", "-accuracy", "err", "-o", "chart.html"]) == 1
    said = capsys.readouterr()
    assert not said.out and "a page needs the package plotly" in said.err
    assert "pip install '.[studies]'" in said.err


def test_a_page_comes_to_life_in_a_browser(table, browser):
    """A chart of all runs with a value, and the facts of one; those of another after a click."""
    assert main(["chart", "sweep.csv", "-accuracy", "err", "-by", "basis", "-o", "page.html"]) == 0
    front = Family(Table(rows(), ["N", "basis"]), "err", "seconds").front()
    page = browser.new_page()
    page.goto((table / "page.html").as_uri())
    page.get_by_role("heading", name="N = 80, basis = cubic-spline").wait_for()
    # 11 runs have a value; those of them that none beats are in the band as well.
    assert page.locator("path.point").count() == 11 + len(front)
    page.get_by_role("link", name="N = 80, basis = linear").click()
    page.get_by_role("heading", name="N = 80, basis = linear").wait_for()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-accuracy", "error"], "did you mean 'err'?"),
        (["-accuracy", "err", "-cost", "second"], "did you mean 'seconds'?"),
        (["-accuracy", "err", "-by", "base"], "did you mean 'basis'?"),
        (["-accuracy", "err", "-heat", "N"], "two variables"),
        (["-accuracy", "err", "-heat", "N,M"], "no 'M'"),
        (["-accuracy", "err", "-where", "N > 100"], "no row fulfils"),
        (["-accuracy", "err", "-o", "chart.gif"], "unknown kind of file"),
        (["-accuracy", "status"], "no run has a value"),
        ([], "-accuracy"),
    ],
)
def test_mistakes(table, capsys, words, said):
    assert main(["chart", "sweep.csv", *words]) == 1
    assert said in capsys.readouterr().err


def test_tables_that_are_none(tmp_path, capsys):
    assert main(["chart", str(tmp_path / "none.csv"), "-accuracy", "err"]) == 1
    assert "cannot read" in capsys.readouterr().err
    (tmp_path / "odd.csv").write_text("a,b\n1\n", encoding="utf-8")
    assert main(["chart", str(tmp_path / "odd.csv"), "-accuracy", "err"]) == 1
    assert "is not a table of runs" in capsys.readouterr().err
