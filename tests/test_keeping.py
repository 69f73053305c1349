"""The energy table: words for logs, and the one command that makes it, reduced."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.special import j0, j1

from karamelo_py.app.cli import main
from karamelo_py.app.studies import atlas
from karamelo_py.app.studies.keeping import judge, look_at

ROOT = Path(__file__).parent.parent


@pytest.mark.parametrize(
    ("rate", "word"), [(0.0, "keeps"), (-0.3, "damps"), (0.3, "gains"), (0.1, "keeps")]
)
def test_words_are_those_of_means(rate, word):
    """Of exp(rate t) the mean over the last fifth is exp(0.8 rate) times that over the first."""
    t = np.linspace(0, 1, 101)
    found, ratio = judge(t, np.exp(rate * t))
    assert found == word and ratio == pytest.approx(np.exp(0.8 * rate), rel=1e-12)


def test_what_is_not_a_number_is_not_kept():
    assert judge(np.arange(10.0), np.full(10, np.nan))[0] == "gains"


def log_of(folder, values, notes=()):
    lines = [f"{k} {value}" for k, value in enumerate(values)]
    (folder / "log.mpm").write_text("\n".join(["Time E", *lines]) + "\n", encoding="utf-8")
    record = {"runs": [], "messages": list(notes)}
    (folder / "run.json").write_text(json.dumps(record), encoding="utf-8")


GROWN = {"kind": "warning", "text": "step 9: spurious energy gain", "cause": "a cause"}
LOST = {"kind": "error", "text": "point 1"}


@pytest.mark.parametrize(
    ("values", "status", "notes", "word", "silent"),
    [
        ([1, 1, 1, 1, 1, 2], "done", [GROWN], "gains", False),
        ([1, 1, 1, 1, 1, 2], "done", [], "gains", True),
        ([1, 1, 1], "failed", [GROWN, LOST], "breaks", False),
        ([1, 1, 1], "failed", [LOST], "breaks", True),
        ([1, 1, 1], "too long", [], "unknown", False),
    ],
)
def test_what_goes_wrong_in_silence_is_named(tmp_path, values, status, notes, word, silent):
    log_of(tmp_path, values, notes)
    kept = look_at({"folder": ".", "status": status}, tmp_path, "Time", "E", within=0.1)
    assert (kept.word, kept.silent) == (word, silent)
    if GROWN in notes:
        assert kept.said[0] == "a cause"


ORDERS = "musl", "leapfrog"  # there is no such scheme as the second


def test_the_energy_table_reduced(tmp_path, monkeypatch, capsys, starts_are_cheap):
    """The command of measured energies on a coarse disk, one period, and a scheme that is none.

    PIC takes what nodes have averaged away in every step: it damps by its definition.
    """
    monkeypatch.chdir(tmp_path)
    entries, _ = atlas.read(ROOT / "docs" / "atlas.toml")
    assert {e.name for e in entries} >= {"energy/FLIP", "energy/transfers"}
    entry = next(e for e in entries if e.name == "energy/transfers")
    entry.small.update(periods="1", transfers="PIC,TPIC", schemes=",".join(ORDERS))
    for line in entry.lines(str(ROOT / "inputs"), small=True):
        refused = line.startswith("sweep")
        assert main([*line.split(), *["-var", "ppc=1"] * refused]) == refused
    text = (tmp_path / "energy.md").read_text(encoding="utf-8")
    lines = [line[2:-2].split(" | ") for line in text.splitlines() if line.startswith("| ")]
    cells = {(row[0], order): row[-2 + k] for row in lines for k, order in enumerate(ORDERS)}
    assert cells["PIC", "musl"].startswith("damps")
    assert cells["PIC", "leapfrog"].startswith("refused")
    # The cause that the program names beforehand for TPIC with linear functions stands below.
    assert "[" in cells["TPIC", "musl"]
    assert "affine noise: TPIC with the basis linear" in text
    assert "refused: 2 of 4" in capsys.readouterr().out


def test_a_part_of_the_energy_gains_nothing(tmp_path, monkeypatch, capsys, starts_are_cheap):
    """A block falls from rest: Ek = m g^2 t^2/2, while Ek + m g y stays."""
    monkeypatch.chdir(tmp_path)
    script = """speed = 1
method(ulmpm, FLIP, linear, 1)
dimension(1, 0, 10, 1)
region(line, block, 6, 7)
material(rubber, linear, 1, 100, 0)
solid(body, region, line, 1, rubber, 1, 0)
fix(v, initial_velocity_particles, all, speed)
fix(g, body_force, all, -10)
compute(Ek, kinetic_energy, all)
compute(c, center_of_mass, all)
E = Ek + 10*c_x
set_dt(0.01)
set_output(1)
log_modify(custom, step, time, Ek, E)
run(20)
"""
    (tmp_path / "in.fall").write_text(script, encoding="utf-8")
    assert main(["sweep", "in.fall", "-var", "speed=0", "-o", "runs.csv"]) == 0
    assert main(["chart", "runs.csv", "-keeps", "Ek"]) == 0
    out = capsys.readouterr().out
    assert "| grows " in out and "gains" not in out and "silent" not in out
    assert main(["chart", "runs.csv", "-keeps", "E"]) == 0
    assert "| keeps " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-keeps", "F"], "the log has no 'F'"),
        (["-keeps", "E", "-by", "bass"], "did you mean 'basis'?"),
    ],
)
def test_mistakes(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    log_of(tmp_path, [1, 1])
    head = "basis,seconds,status,reason,folder\n"
    (tmp_path / "runs.csv").write_text(head + "linear,1,done,,.\n", encoding="utf-8")
    assert main(["chart", "runs.csv", *words]) == 1
    assert said in capsys.readouterr().err


def gaining() -> list[tuple[str, ...]]:
    """(transfer, basis, scheme, strain) of measured energies that go wrong and are told."""
    page = ROOT / "docs" / "energy-measurements.md"
    text = page.read_text(encoding="utf-8").partition("## Other")[2].partition("## Finer")[0]
    rows = [line[2:-2].split(" | ") for line in text.splitlines() if line.startswith("| ")]
    heads = [head.split() for head in rows[0][2:]]
    return [
        (row[0], row[1], scheme, strain)
        for row in rows[2:]
        for (scheme, strain, _), cell in zip(heads, row[2:], strict=True)
        if ("gains" in cell or "breaks" in cell) and "silent" not in cell
    ]


def test_what_gains_is_told_beforehand(tmp_path, monkeypatch, capsys, starts_are_cheap):
    """Of every transfer and scheme a cell that gains or breaks, on a coarser disk, as fast."""
    monkeypatch.chdir(tmp_path)
    cells = gaining()
    assert len(cells) == 72
    for transfer, basis, scheme, strain in {(c[0], c[2]): c for c in cells}.values():
        alpha = {"XPIC": "2"}.get(transfer, "1" if "FLIP" in transfer else "mechanical")
        values = {"transfer": transfer, "basis": basis, "order": scheme, "alpha": alpha, "n": "2"}
        values |= {"strain": str(float(strain) / 100)}
        words = [word for pair in values.items() for word in ("-var", *pair)]
        assert main(["check", str(ROOT / "inputs" / "in.energy_disk"), *words]) == 0
        captured = capsys.readouterr()
        told = re.search(
            "affine noise|points that cross|large vibrations", captured.out + captured.err
        )
        assert told, (transfer, basis, scheme, strain)


def drifting() -> list[tuple[str, str, str]]:
    """Variables of measured disks on finer grids, their energy, and when that is told."""
    text = (ROOT / "docs" / "energy-measurements.md").read_text(encoding="utf-8")
    lines = text.partition("| variables |")[2].partition("## Bodies")[0].splitlines()
    rows = [[cell.strip() for cell in line.split("|")] for line in lines if "| n =" in line]
    return [(row[1], row[3], row[4]) for row in rows if "moving" not in row[1]]


@pytest.mark.parametrize(("variables", "energy", "told"), drifting())
def test_what_drifts_is_told_as_the_table_says(run_interpreted, variables, energy, told):
    values = {"n": variables[4], "basis": "linear"}
    for word in variables.split(", ")[1:]:
        name, _, value = word.rpartition(" ")
        if word == "one point per cell":
            values["ppc"] = "1"
        elif name == "strain":
            values["strain"] = value
        elif not name:
            values["basis"] = word
    words = [word for pair in values.items() for word in ("-var", *pair)]
    said = run_interpreted(ROOT / "inputs" / "in.energy_disk", *words, command="check").err
    assert ("noise of a drift" in said) == ("before" in told)
    assert float(energy) <= 1.1 or told


def test_the_mode_of_the_disk():
    """k R J0(k R) / J1(k R) = 2 mu / (lambda + 2 mu), in plane strain, for nu = 0.3."""
    text = (ROOT / "inputs" / "in.energy_disk").read_text("utf-8")
    kR = float(re.search(r"^kR += (\S+)", text, re.M)[1])
    assert kR * j0(kR) / j1(kR) == pytest.approx(0.4 / 0.7, abs=1e-4)
