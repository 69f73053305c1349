"""karamelo-py styles and karamelo-py help, as a user calls them."""

import pytest

import karamelo_py
from karamelo_py.app import catalogue
from karamelo_py.app.cli import COMMANDS, main
from karamelo_py.language import registry
from karamelo_py.script.errors import table


def call(capsys, *arguments):
    status = main(list(arguments))
    output = capsys.readouterr()
    return status, output.out, output.err


def test_styles_lists_every_command_and_style_with_its_package(capsys):
    status, out, _ = call(capsys, "styles")
    assert status == 0
    version = karamelo_py.__version__
    rows = [line.split() for line in out.splitlines() if line.startswith("  ")]
    listed = [row[0] for row in rows if f"karamelo-py {version}" == " ".join(row[1:3])]
    known = [name for family in catalogue.families() for name in registry.names(family)]
    assert sorted(listed) == sorted(known)
    assert all(len(row) > 4 for row in rows), "each has a summary"


@pytest.mark.parametrize("word", ["fix", "fixes", "Fix"])
def test_styles_of_a_family(capsys, word):
    status, out, _ = call(capsys, "styles", word)
    assert status == 0
    assert "body_force" in out
    assert "set_dt" not in out


def test_help_alone_says_how_to_use_it(capsys):
    status, out, _ = call(capsys, "help")
    assert status == 0
    assert "karamelo-py help FAMILY STYLE" in out


def test_help_of_a_style(capsys):
    status, out, _ = call(capsys, "help", "fix", "velocity_nodes")
    assert status == 0
    for part in (
        "fix(ID, velocity_nodes, group, vx[, vy[, vz]][, mu=mu])",
        "Prescribe the velocity of nodes",
        "a group of nodes, or all",
        "a number or a formula or NULL, any number of them",
        "fix(base, velocity_nodes, bottom, 0, 0)",
        "the force that holds the nodes",
        "velocity_particles",
    ):
        assert part in out


def test_help_finds_a_style_in_whatever_family(capsys):
    assert call(capsys, "help", "body_force")[1] == call(capsys, "help", "fix", "body_force")[1]


def test_help_of_a_command_comes_before_styles_of_that_name_and_lists_its_styles(capsys):
    status, out, _ = call(capsys, "help", "material")
    assert status == 0
    assert "material(ID, style[, arguments, ...])" in out
    assert "one of arruda-boyce, cam-clay, eos-strength, gent, hashin, hencky, hill," in out
    assert "karamelo-py help material NAME" in out


def test_help_of_method_names_all_that_there_is(capsys):
    words = call(capsys, "help", "method")[1].replace(",", " ").split()
    for family in ("method", "transfer", "basis"):
        assert set(registry.names(family)) <= set(words)


def test_help_of_a_part_of_the_method(capsys):
    assert "method(kind, FLIP, basis, alpha[, " in call(capsys, "help", "transfer", "FLIP")[1]
    assert "scheme(usl)" in call(capsys, "help", "usl")[1]


def test_defaults_and_words_are_told(capsys):
    _, out, _ = call(capsys, "help", "material", "linear")
    assert "rate=jaumann|none" in out
    assert "jaumann when left out" in out
    _, out, _ = call(capsys, "help", "angular_momentum")
    assert "a number, 0 when left out" in out


@pytest.mark.parametrize("word", ["on_trouble", "halve"])
def test_help_finds_an_argument_and_what_it_may_be(capsys, word):
    status, out, _ = call(capsys, "help", word)
    assert status == 0
    assert "argument of run, run_time, run_until, run_while" in out
    assert "returns to its last good state and halves" in " ".join(out.split())


@pytest.mark.parametrize(
    ("word", "listed"),
    [
        ("contact", ["fix contact/friction", "fix contact/surface", "method ulmpm/contacts"]),
        ("Gravity", ["fix body_force"]),
        ("sand", ["strength drucker-prager"]),
        ("Landslide", ["strength drucker-prager"]),
        ("hold a wall", ["fix velocity_nodes"]),
        ("heat", ["fix heat_flux_particles", "command temperature"]),
    ],
)
def test_help_finds_styles_by_a_word(capsys, word, listed):
    """A part of the name, a word of the summary, a word of the text; below an argument, too."""
    status, out, _ = call(capsys, "help", word)
    assert status == 0
    rows = out.partition("about" if "about" in out else "See also")[2].splitlines()[1:]
    families = {" ".join(row.split()[:2]) for row in rows}
    assert set(listed) <= families
    assert all("contact" in row for row in families) or word != "contact"


@pytest.mark.parametrize(
    ("words", "listed"),
    [
        (["rigid", "body"], "material rigid"),
        (["reaction", "force"], "compute reaction"),
        (["moving", "wall"], "fix contact/surface"),
        (["dam", "break"], "eos fluid"),
        (["time", "step"], "command set_dt"),
        (["what", "time", "step"], "command set_dt"),
        (["stress", "at", "a", "probe"], "compute probe"),
        (["write", "a", "fix"], "fix python"),
        (["retaining", "wall", "force"], "fix velocity_nodes"),
        (["strength", "reduction"], "command modify"),
        (["random", "variables"], "karamelo-py sensitivity"),
        (["parameter", "study"], "karamelo-py sweep"),
        (["prescribed", "displacement"], "fix velocity_nodes"),
        (["save", "restart"], "command restart"),
        (["poisson"], "material linear"),
        (["gravity"], "fix body_force"),
        (["factor", "of", "safety"], "karamelo-py find"),
    ],
)
def test_several_words_need_no_quotes(capsys, words, listed):
    """The first is no family, or has no such style: all are looked for."""
    status, out, _ = call(capsys, "help", *words)
    assert status == 0
    assert listed in [" ".join(row.split()[:2]) for row in out.splitlines()]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["help", "bodyforce"], "did you mean 'body_force'?"),
        (["help", "fix", "body_forc"], "did you mean 'body_force'?"),
        (["help", "fixx", "body_force"], "did you mean 'fix'?"),
        (["help", "qqq", "qqqq", "qqqqq"], "karamelo-py styles lists them all"),
        (["help", "fix", "qqqqq"], "karamelo-py styles fix lists all"),
        (["help", "qqqqq"], "karamelo-py styles lists them all"),
        (["styles", "comput"], "did you mean 'compute'?"),
        (["styles", "fix", "compute"], "too many arguments"),
        (["help", "kinetic_energy"], "karamelo-py help fix kinetic_energy"),
        (["hepl"], "did you mean 'karamelo-py help'?"),
    ],
)
def test_what_is_unknown_or_means_several_things(capsys, arguments, message):
    status, out, err = call(capsys, *arguments)
    assert status == 1
    assert out == ""
    assert message in err


def test_a_broken_plug_in_is_listed_as_such(capsys, tmp_path, monkeypatch):
    package = tmp_path / "broken-1.2.dist-info"
    package.mkdir()
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.2\n")
    (package / "entry_points.txt").write_text(
        "[karamelo_py.fix]\nbroken_fix = broken_package_that_is_not_there:Fix\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    registry.forget()
    try:
        status, out, _ = call(capsys, "styles", "fix")
        assert status == 0
        (line,) = [line for line in out.splitlines() if "broken_fix" in line]
        assert "broken 1.2" in line and "cannot be loaded" in line
        assert "body_force" in out
        status, _, err = call(capsys, "help", "fix", "broken_fix")
        assert status == 1 and "of broken 1.2" in err and "Traceback" not in err
    finally:
        monkeypatch.undo()
        registry.forget()


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("umat", "class in Python"),
        ("mass scaling", "raise the density"),
        ("hourglass", "two points per cell"),
        ("loop", "karamelo-py sweep"),
    ],
)
def test_help_says_what_is_missing(capsys, asked, said):
    assert main(["help", asked]) == 0
    assert said in capsys.readouterr().out


def test_answers_of_help_name_what_there_is():
    """A target of the table is a command, a style or a subcommand."""
    targets = [target.split() for key in table()["first"] for target in key.split(", ")]
    known = {(family, name) for family in registry.families() for name in registry.names(family)}
    known |= {("karamelo-py", name) for name in COMMANDS}
    assert not [target for target in targets if tuple(target) not in known]
    asked = [
        word for key in ("first", "answers") for words in table()[key].values() for word in words
    ]
    assert len(asked) == len(set(asked))


def test_help_takes_commands_of_other_programs(capsys):
    assert main(["help", "unfix"]) == 1
    assert "delete_fix(ID)" in capsys.readouterr().err


def test_help_groups_parameters_with_one_description_and_omits_one_that_repeats_the_type(capsys):
    out = call(capsys, "help", "material", "hyperelastic")[1]
    _, *kinds, text = out.partition("cp=, kappa=, alpha=")[2].splitlines()[:5]
    assert [kind.split(":")[0].strip() for kind in kinds] == ["cp", "kappa", "alpha"]
    assert out.count("Heat capacity") == 1 and text.strip().startswith("Heat capacity")
    assert "x, y or z" not in call(capsys, "help", "internal_force")[1]
    assert "File name" not in call(capsys, "help", "write_restart")[1]
    assert "one of K, C; K when left out" in call(capsys, "help", "units")[1]
