"""Dumps: their text, what OVITO reads back, whole files, rhythm, pictures."""

import gzip
import shutil
import subprocess
import sys
from itertools import product

import numpy as np
import pytest
from fakes import FakeHub
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from selection import parameters

from karamelo_py.output import files, snapshots, text
from karamelo_py.output.rhythm import ByTime, is_due, next_step
from karamelo_py.output.units import Units
from karamelo_py.points.kinematics import Axisymmetric
from karamelo_py.script.errors import Mark, ScriptError
from karamelo_py.styles.dumps import lammps
from karamelo_py.styles.dumps.lammps import GridDump, GridGz, Particle, ParticleGz
from karamelo_py.styles.dumps.pyplot import Movie, PyPlot


@pytest.fixture(params=[1, 2, 3])
def hub(request, tmp_path):
    return FakeHub(tmp_path, dimension=request.param)


@pytest.fixture
def plane(tmp_path):
    return FakeHub(tmp_path, dimension=2)


def steps_of(text):
    lines = text.splitlines()
    return [int(lines[i + 1]) for i, line in enumerate(lines) if line == "ITEM: TIMESTEP"]


def test_text_is_lammps_format(plane):
    """Compared with the format of LAMMPS, line by line: it reads the time before the step."""
    plane.update.step, plane.update.time = 7, 0.7
    Particle(plane, 1, "p.*.LAMMPS", "x", "y", "z", "vx").write()
    lines = (plane.folder / "p.7.LAMMPS").read_text().splitlines()
    assert lines[:10] == [
        "ITEM: TIME",
        "0.7",
        "ITEM: TIMESTEP",
        "7",
        "ITEM: NUMBER OF ATOMS",
        "40",
        "ITEM: BOX BOUNDS sm sm sm",
        "-0.5 0.5",
        "-0.5 0.5",
        "-0.125 0.125",
    ]
    assert lines[10] == "ITEM: ATOMS id type x y z vx"
    assert lines[11].split()[:2] == ["1", "1"]
    assert lines[-1].split()[:2] == ["40", "2"]
    table = np.loadtxt(lines[11:])
    for column, name in enumerate(("id", "type", "x", "y", "z", "vx")):
        np.testing.assert_allclose(table[:, column], plane.fields.particle(name), rtol=1e-8)


@pytest.mark.parametrize("style", [Particle, ParticleGz])
@pytest.mark.parametrize("name", ["p.*.dump", "all.dump"])
def test_ovito_reads_particles(hub, style, name):
    io = pytest.importorskip("ovito.io", exc_type=ImportError)  # or its graphics libraries
    name += ".gz" if style is ParticleGz else ""
    dump = style(hub, 5, name, "x", "y", "z", "vx", "s11", "mass")
    hub.dumps["d"] = dump
    hub.run(10)
    pipeline = io.import_file(str(hub.folder / name))
    assert pipeline.source.num_frames == 3
    for frame, step in enumerate((0, 5, 10)):
        data = pipeline.compute(frame)
        assert data.attributes["Timestep"] == step
        assert data.attributes["Time"] == pytest.approx(0.1 * step)
        points = data.particles
        xyz = np.column_stack([hub.fields.particle(n) for n in "xyz"])
        np.testing.assert_allclose(points.positions, xyz, rtol=1e-8)
        np.testing.assert_array_equal(points.particle_types, hub.fields.particle("type"))
        np.testing.assert_array_equal(points.identifiers, hub.fields.particle("id"))
        np.testing.assert_allclose(points["Velocity"][:, 0], hub.fields.particle("vx"), rtol=1e-8)
        np.testing.assert_allclose(points["s11"], hub.fields.particle("s11"), rtol=1e-8)
        np.testing.assert_allclose(points["Mass"], hub.fields.particle("mass"), rtol=1e-8)
        assert data.cell.volume > 0


@pytest.mark.parametrize(("style", "name"), [(Particle, "p.dump"), (ParticleGz, "p.gz")])
def test_ovito_shows_the_names_of_solids(plane, style, name):
    style(plane, 1, name, "vx", "element", "seq").write()
    (snapshot,) = snapshots.read(plane.folder / name)
    for column in ("id", "vx", "seq"):
        values = plane.fields.particle(column)
        np.testing.assert_allclose(snapshot.columns[column], values, rtol=1e-8)
    io = pytest.importorskip("ovito.io", exc_type=ImportError)
    points = io.import_file(str(plane.folder / name)).compute().particles
    found = [(kind.id, kind.name) for kind in points.particle_types.types]
    assert found == [(1, "left"), (2, "right")]
    np.testing.assert_array_equal(points.particle_types, plane.fields.particle("type"))


LAMMPS = """
import sys
from lammps import lammps
try:
    code = lammps(cmdargs=["-screen", "none", "-log", "none"])
except OSError as error:  # no MPI that fits
    sys.exit(f"skip: {error}")
code.commands_string('''
units si
dimension 2
boundary s s p
region b block -1 1 -1 1 -1 1
create_box 2 b
mass * 1
read_dump p.dump 7 x y vx box yes add yes
''')
print(code.get_natoms(), *code.numpy.extract_atom("x")[:, 0])
"""


def test_lammps_reads_particles(plane):
    """LAMMPS itself, from PyPI: `pip install lammps mpich`."""
    plane.update.step = 7
    Particle(plane, 1, "p.dump", "vx", "element").write()
    command = [sys.executable, "-c", LAMMPS]
    found = subprocess.run(command, cwd=plane.folder, capture_output=True, text=True)
    if "No module named 'lammps'" in found.stderr or found.stderr.startswith("skip: "):
        pytest.skip("no LAMMPS")
    assert found.returncode == 0, found.stderr
    count, *x = found.stdout.split()
    assert count == "40"
    np.testing.assert_allclose(np.sort(np.array(x, float)), np.sort(plane.fields.particle("x")))


@pytest.mark.parametrize("style", [GridDump, GridGz])
def test_ovito_reads_grid(hub, style):
    io = pytest.importorskip("ovito.io", exc_type=ImportError)
    ending = "gz" if style is GridGz else "dump"
    style(hub, 1, f"g.*.{ending}", "x", "y", "z", "mass").write()
    data = io.import_file(str(hub.folder / f"g.0.{ending}")).compute()
    assert data.particles.count == hub.fields.node_count
    assert list(data.particles.identifiers[:3]) == [0, 1, 2]
    np.testing.assert_allclose(data.particles["Mass"], hub.fields.node("mass"))


def test_grid_without_empty_nodes(plane):
    GridDump(plane, 1, "g.dump", "mass", occupied=True).write()
    table = np.loadtxt((plane.folder / "g.dump").read_text().splitlines()[11:])
    keep = plane.fields.node("mass") > 0
    np.testing.assert_array_equal(table[:, 0], np.flatnonzero(keep))
    np.testing.assert_allclose(table[:, 2], plane.fields.node("x")[keep])


def test_positions_are_always_written(plane):
    assert Particle(plane, 1, "p").columns == ("x", "y", "z")
    assert Particle(plane, 1, "p", "x", "y", "vx").columns == ("x", "y", "z", "vx")
    assert Particle(plane, 1, "p", "id", "vx", "z", "y", "x", "vx").columns == ("vx", "z", "y", "x")


def as_python(*columns):
    """The rows of a table as Python writes them."""
    line = " ".join("%d" if column.dtype.kind == "i" else "%.9g" for column in columns) + "\n"
    lists = [column.tolist() for column in columns]
    return "".join(line % row for row in zip(*lists, strict=True)).encode()


def test_rows_keep_integers_and_nine_digits():
    count = text.ROWS + 3
    integers = np.arange(count) * 10_000_000_000
    numbers = np.linspace(-1e-7, 1, count) / 3
    assert b"".join(text.rows([integers, numbers])) == as_python(integers, numbers)


@given(
    arrays(float, 7, elements=st.floats(allow_subnormal=True)),
    arrays(np.int64, 7, elements=st.integers(-(2**63), 2**63 - 1)),
    st.integers(-30, 30),
)
def test_rows_are_as_python_writes_them(numbers, integers, power):
    """Any double, any integer, what lies around a tie, and what has few digits."""
    few = np.round(integers / 2.0**50, 3) * 10.0**power
    halves = (integers // 2**25 + 0.5) * 10.0**power
    close = np.nextafter(halves, np.inf)
    columns = [integers, numbers, few, halves, close]
    assert b"".join(text.rows(columns)) == as_python(*columns)


def test_rows_of_all_kinds_of_doubles():
    """Half of them of random bits, the others with as many bits as make exact ties."""
    rng = np.random.default_rng(5)
    bits = rng.integers(-(2**63), 2**63, 100_000).view(float)
    ties = rng.integers(-(2**33), 2**33, 100_000) / 2.0 ** rng.integers(0, 40, 100_000)
    powers = 10.0 ** rng.integers(-320, 308, 100_000)
    columns = [bits, ties, powers, -np.nextafter(powers, 0)]
    assert b"".join(text.rows(columns)) == as_python(*columns)


def test_rows_of_nothing():
    assert b"".join(text.rows([np.zeros(0, int), np.zeros(0)])) == b""


def test_rhythm(plane):
    """First and last state of each run and multiples of the absolute step; none twice."""
    plane.dumps["d"] = Particle(plane, 4, "all.dump")
    plane.run(18)
    plane.run(3)
    assert steps_of((plane.folder / "all.dump").read_text()) == [0, 4, 8, 12, 16, 18, 20, 21]


def test_one_file_per_step(plane):
    plane.dumps["d"] = Particle(plane, 4, "p.*.LAMMPS")
    plane.run(6)
    names = sorted(p.name for p in plane.folder.iterdir() if p.name != "log.mpm")
    assert names == ["p.0.LAMMPS", "p.4.LAMMPS", "p.6.LAMMPS"]


def test_a_new_run_of_the_program_replaces_the_file(tmp_path):
    for _ in range(2):
        hub = FakeHub(tmp_path)
        hub.dumps["d"] = Particle(hub, 4, "all.dump")
        hub.run(4)
    assert steps_of((tmp_path / "all.dump").read_text()) == [0, 4]


def test_gz_is_the_same_text_and_the_same_bytes(tmp_path):
    hub = FakeHub(tmp_path)
    Particle(hub, 1, "p.txt", "seq").write()
    for name in ("a.gz", "b.gz"):
        ParticleGz(hub, 1, name, "seq").write()
    assert gzip.decompress((tmp_path / "a.gz").read_bytes()) == (tmp_path / "p.txt").read_bytes()
    assert (tmp_path / "a.gz").read_bytes() == (tmp_path / "b.gz").read_bytes()


@pytest.mark.parametrize(
    ("name", "meant"),
    [("s111", "'s11'"), ("sxx", "'s11'"), ("sigma_yx", "'s12'"), ("stress_12", "'s12'"),
     ("strain_yy", "'e22'")],
)  # fmt: skip
def test_unknown_column_names_the_nearest(plane, name, meant):
    with pytest.raises(ScriptError) as caught:
        Particle(plane, 1, "p", "x", name)
    assert name in str(caught.value)
    assert caught.value.argument == 3
    assert meant in caught.value.hint


@pytest.mark.parametrize("style", [Particle, ParticleGz])
@pytest.mark.parametrize("name", ["p.*.dump", "all.dump"])
def test_a_snapshot_that_breaks_off_leaves_nothing(plane, monkeypatch, style, name):
    """Ctrl-C in the middle of a snapshot: earlier ones stay readable."""
    dump = style(plane, 1, name)
    dump.write()
    plane.update.step = 1
    before = {p.name: p.read_bytes() for p in plane.folder.iterdir()}

    def interrupted(columns):
        yield b"1 1 0."
        raise KeyboardInterrupt

    monkeypatch.setattr(lammps, "rows", interrupted)
    with pytest.raises(KeyboardInterrupt):
        dump.write()
    assert {p.name: p.read_bytes() for p in plane.folder.iterdir()} == before


def test_a_folder_that_went_away_is_a_script_error(plane):
    with pytest.raises(ScriptError, match="cannot write"):
        Particle(plane, 1, "gone/p.*.dump").write()


def test_an_error_of_a_dump_in_a_run_is_its_own(plane):
    plane.dumps["d"] = Particle(plane, 2, "gone/p.*.dump")
    plane.dumps["d"].mark = Mark("in.test", 7, 1, 4, "dump(...)")
    with pytest.raises(ScriptError) as caught:
        plane.run(4)
    assert caught.value.render().startswith("in.test:7:1: error: cannot write ")
    assert "p.0.dump" in caught.value.message


DRAWN = [(1, "png", None), (2, "png", None), (3, "png", "seq"), (2, "pdf", "seq"), (3, "svg", None)]
OTHERS = product((1, 2, 3), [("png", None), ("png", "seq"), ("pdf", "seq"), ("svg", None)])
OTHERS = [(d, *of) for d, of in OTHERS if (d, *of) not in DRAWN]


@pytest.mark.parametrize(("hub", "ending", "field"), parameters(DRAWN, OTHERS), indirect=["hub"])
def test_pyplot_draws(hub, field, ending):
    hub.dumps["d"] = PyPlot(hub, 2, f"p.*.{ending}", 300, 2, field)
    hub.run(3)
    pictures = {int(p.name.split(".")[1]): p for p in hub.folder.glob(f"p.*.{ending}")}
    assert sorted(pictures) == [0, 2, 3]
    magic = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[ending]
    assert all(p.read_bytes().startswith(magic) for p in pictures.values())
    if ending == "png":
        image = pytest.importorskip("PIL.Image").open(pictures[3])
        assert image.size == (300, 200)
        colours = len(np.unique(np.asarray(image).reshape(-1, 3), axis=0))
        assert colours > (10 if hub.domain.dimension > 1 or field else 2)


def test_pyplot_shows_the_points_of_each_state(plane):
    """A reused figure gives the picture that a fresh one gives."""
    hub = plane
    reused = PyPlot(hub, 1, "reused.*.png", 3, 3)
    reused.write()
    hub.update.step = 1
    hub.fields.points["x"] *= 0.5
    reused.write()
    PyPlot(hub, 1, "fresh.*.png", 3, 3).write()
    first, second, fresh = (
        (hub.folder / name).read_bytes() for name in ("reused.0.png", "reused.1.png", "fresh.1.png")
    )
    assert first != second
    assert second == fresh


@pytest.mark.parametrize("ending", ["png", "pdf"])
@pytest.mark.filterwarnings("error")
def test_small_pictures_give_no_warning(hub, ending):
    PyPlot(hub, 1, f"p.{ending}", 0.2, 60, "seq").write()


def test_pictures_of_a_run_do_not_jump(hub):
    """The frame and the name of the field stay where they are, whatever the numbers."""
    dump = PyPlot(hub, 1, "p.png", 4, 3, "seq")
    dump.write()
    picture = dump._picture

    def places():
        boxes = [picture.axes.get_position(), picture.scale.label.get_window_extent()]
        return np.array([box.bounds for box in boxes])

    before = places()
    for factor in (-1e7, 3.3):
        hub.fields.points["seq"] *= factor
        dump.write()
        labels = [label.get_text() for label in picture.scale.get_ticklabels()]
        numbers = [float(label.replace("\N{MINUS SIGN}", "-")) for label in labels]
        assert numbers == pytest.approx(picture.scale.get_ticklocs())
        np.testing.assert_allclose(places(), before, atol=1e-9)


TITLE = "a ball that falls upon a plate of lead"
TITLED = [((300, 450), None), ((200, 500), TITLE), ((800, 250), TITLE)]
UNTITLED = [((300, 450), TITLE), ((200, 500), None), ((800, 250), None)]


@pytest.mark.parametrize(("size", "title"), parameters(TITLED, UNTITLED))
def test_a_title_lies_within_the_picture_and_colours_beside_the_axes(plane, size, title):
    dump = PyPlot(plane, 1, "p.png", *size, "seq", title=title)
    plane.update.time = 0.300056
    dump.write()
    picture = dump._picture
    frame, bar = picture.axes.get_window_extent(), picture.scale.axes.get_window_extent()
    assert bar.height <= frame.height + 1e-6 and abs(bar.y0 + bar.y1 - frame.y0 - frame.y1) < 1e-6
    written = picture.title.get_window_extent()
    assert written.x0 > 0 and written.x1 < size[0]
    assert written.y0 > bar.y1
    numbers = [label.get_window_extent() for label in picture.scale.get_ticklabels()]
    assert max(number.x1 for number in numbers) < picture.scale.label.get_window_extent().x0


@pytest.mark.parametrize("size", [(400, 700), (300, 450), (200, 500), (800, 250)])
def test_names_of_axes_lie_within_the_picture(plane, size):
    """In a domain much higher than wide, too, as that of a bar upon a wall."""
    plane.domain.hi[0] = plane.domain.lo[0] + 0.38 * (plane.domain.hi[1] - plane.domain.lo[1])
    dump = PyPlot(plane, 1, "p.png", *size, "seq")
    dump.write()
    axes = dump._picture.axes
    for label in (axes.xaxis.label, axes.yaxis.label):
        box = label.get_window_extent()
        assert min(box.x0, box.y0) >= 0
        assert box.x1 <= size[0] and box.y1 <= size[1]


def test_numbers_that_hardly_differ_are_told_apart(plane):
    plane.fields.points["seq"] = 1000 + np.linspace(0, 1, plane.fields.count)
    dump = PyPlot(plane, 1, "p.png", 4, 3, "seq")
    dump.write()
    labels = [label.get_text() for label in dump._picture.scale.get_ticklabels()]
    assert len(set(labels)) == len(labels) > 2


def test_colours_of_components_lie_about_zero(plane):
    dump = PyPlot(plane, 1, "p.png", 4, 3, "vx")
    for factor in (0, -1e-9, 1e9):
        plane.fields.points["vx"] = factor * plane.fields.points["s11"]
        dump.write()
        lo, hi = dump._picture.limits
        assert lo == -hi
    assert lo < plane.fields.points["vx"].min()
    seq = PyPlot(plane, 1, "q.png", 4, 3, "seq")
    assert (dump.look["cmap"], seq.look["cmap"]) == ("coolwarm", "viridis")


def test_limits_that_are_given_stay(plane):
    dump = PyPlot(plane, 1, "p.png", 4, 3, "vx", vmin=0.0, vmax=2e-3, cmap="magma")
    for factor in (1, 1000):
        plane.fields.points["vx"] *= factor
        dump.write()
        assert dump._picture.limits == (0, 2e-3)
    half = PyPlot(plane, 1, "p.png", 4, 3, "vx", vmin=-9.0)
    half.write()
    assert half._picture.limits[0] == -9 and half._picture.limits[1] > 1


def test_arrows_say_that_values_lie_beyond_the_colours(plane):
    """At the ends beyond which there are some, in this picture; none where the limits grow."""
    limited = PyPlot(plane, 1, "p.png", 4, 3, "vx", vmin=-1.0, vmax=2.0)
    free = PyPlot(plane, 1, "q.png", 4, 3, "vx")
    for low, high in ((-1, 2), (-3, 2), (-1, 3), (-2, 3), (0, 1), (-1, np.nan)):
        plane.fields.points["vx"] = np.linspace(low, np.nan_to_num(high), plane.fields.count)
        plane.fields.points["vx"][-1] = high
        limited.write()
        free.write()
        shown = [arrow.get_visible() for arrow in limited._picture.arrows]
        assert shown == [low < -1, high > 2], (low, high)
        assert not any(arrow.get_visible() for arrow in free._picture.arrows)
        bar = limited._picture.scale.axes.get_window_extent()
        with pytest.importorskip("PIL.Image").open(plane.folder / "p.png") as image:
            pixels = np.asarray(image)
        above = pixels[: 300 - int(bar.y1) - 2, int(bar.x0) : int(bar.x1)]
        below = pixels[300 - int(bar.y0) + 2 :, int(bar.x0) : int(bar.x1)]
        assert [bool((part < 250).any()) for part in (below, above)] == shown


def test_pyplot_refuses_limits_and_maps(plane):
    with pytest.raises(ScriptError, match="from 2 to 1") as caught:
        PyPlot(plane, 1, "p.png", 4, 3, "vx", vmin=2.0, vmax=1.0)
    assert caught.value.argument == "vmax"
    with pytest.raises(ScriptError, match="viridi") as caught:
        PyPlot(plane, 1, "p.png", 4, 3, "vx", cmap="viridi")
    assert caught.value.argument == "cmap"


def test_a_view_from_above_is_the_plane(tmp_path):
    """Elevation 90 and azimuth -90: x to the right, y upwards."""
    hub = FakeHub(tmp_path, dimension=3)
    dump = PyPlot(hub, 1, "p.png", 4, 4, azimuth=-90.0, elevation=90.0, axes=False, title="above")
    dump.write()
    drawn = np.asarray(dump._picture.artist.get_offsets())
    order = np.argsort(hub.fields.points["z"], kind="stable")
    for axis, name in enumerate("xy"):
        np.testing.assert_allclose(drawn[:, axis], hub.fields.points[name][order], atol=1e-12)
    assert dump._picture.title.get_text() == "above: step 0, time 0"


def test_a_ball_is_lit_where_it_faces_the_light(tmp_path):
    """Brighter at the top left than at the bottom right of the picture."""
    hub = FakeHub(tmp_path, dimension=3)
    axis = np.linspace(-0.4, 0.4, 21)
    x = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    x = x[np.linalg.norm(x, axis=1) < 0.4]
    hub.fields.points = dict(zip("xyz", x.T, strict=True))
    hub.fields.points |= {"type": np.ones(len(x), int), "volume": np.full(len(x), 0.04**3)}
    hub.fields.points["id"] = np.arange(1, len(x) + 1)
    dump = PyPlot(hub, 1, "p.png", 4, 4)
    dump.write()
    seen = np.asarray(dump._picture.artist.get_offsets())
    front = np.arange(len(seen)) > 0.9 * len(seen)  # the nearest are drawn last
    light = dump._picture.artist.get_facecolors()[:, 2]
    towards = seen @ [-0.35, 0.6]
    low, high = (light[front & s].mean() for s in (towards < -0.1, towards > 0.1))
    assert high > 1.3 * low


def test_points_have_the_size_of_what_they_stand_for(plane):
    """Rings of an axisymmetric scene, too, whose volume is that per radian."""
    dump = PyPlot(plane, 1, "p.png", 4, 3)
    assert dump.side(dump.snapshot()) == pytest.approx(np.sqrt(0.5 / 40))
    plane.domain.kin = Axisymmetric()
    x = np.linspace(1e-4, 1e-2, 40)
    plane.fields.points |= {"x": x, "volume": x * 0.05**2}
    assert dump.side(dump.snapshot()) == pytest.approx(0.05)


def test_legend_of_solids_and_units(plane):
    plane.output.units = Units("mm", "g", "ms")
    dump = PyPlot(plane, 1, "p.svg", 4, 3)
    dump.write()
    svg = (plane.folder / "p.svg").read_text()
    for word in ("left", "right", "x (mm)", "y (mm)", "t = 0 ms"):
        assert f"<!-- {word} -->" in svg
    PyPlot(plane, 1, "q.svg", 4, 3, "seq").write()
    assert "<!-- seq (MPa) -->" in (plane.folder / "q.svg").read_text()


def test_units_are_in_the_header_and_ovito_reads_on(plane):
    io = pytest.importorskip("ovito.io", exc_type=ImportError)
    plane.output.units = Units("mm", "g", "ms")
    Particle(plane, 1, "p.dump").write()
    assert (plane.folder / "p.dump").read_text().startswith("ITEM: UNITS\nmm g ms K\nITEM: TIME")
    assert io.import_file(str(plane.folder / "p.dump")).compute().particles.count == 40


def test_movie_has_a_frame_for_each_state(hub):
    image = pytest.importorskip("PIL.Image")
    hub.dumps["d"] = Movie(hub, 2, "m.gif", 3, 2)
    hub.run(4)
    assert image.open(hub.folder / "m.gif").n_frames == 3
    hub.fields.points["x"] *= 0.5
    hub.run(2)
    movie = image.open(hub.folder / "m.gif")
    assert movie.n_frames == 4 and movie.size == (300, 200)
    assert movie.info["duration"] == 40


def test_movie_of_a_run_that_breaks_off(plane):
    plane.dumps["d"] = Movie(plane, 2, "m.gif", 3, 2)
    plane.output.begin()
    plane.output.abort()
    assert (plane.folder / "m.gif").exists()


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg")
def test_movie_through_ffmpeg(plane):
    plane.dumps["d"] = Movie(plane, 2, "m.mp4", 3.01, 2)
    plane.run(4)
    assert (plane.folder / "m.mp4").read_bytes()[4:8] == b"ftyp"


def test_mp4_without_ffmpeg_is_refused(plane, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(ScriptError, match="ffmpeg") as caught:
        Movie(plane, 2, "m.mp4", 3, 2)
    assert caught.value.hint == "m.gif"
    with pytest.raises(ScriptError, match="not a name for a movie"):
        Movie(plane, 2, "m.*.gif", 3, 2)


def test_pyplot_survives_fields_without_range(plane):
    for values in (0.0, -3.0, np.nan, 1e300):
        plane.fields.points["seq"][:] = values
        PyPlot(plane, 1, "p.png", 2, 2, "seq").write()


def test_pyplot_refuses_other_formats_and_fields(plane):
    with pytest.raises(ScriptError, match=r"p\.jpg"):
        PyPlot(plane, 1, "p.jpg", 3, 3)
    with pytest.raises(ScriptError) as caught:
        PyPlot(plane, 1, "p.png", 3, 3, "sqe")
    assert "seq" in caught.value.hint


def test_limits_grow_and_stay():
    from karamelo_py.output.pictures import grown

    limits = grown(None, np.array([0.0, 0.9]))
    assert limits[0] <= 0 and limits[1] >= 0.9
    assert grown(limits, np.array([0.1, 0.5])) == limits
    wider = grown(limits, np.array([-3.0]))
    assert wider[0] <= -3 and wider[1] >= limits[1]


def test_whole_file_appears_at_once(tmp_path):
    target = tmp_path / "a"
    with files.whole(target) as file:
        file.write(b"1")
        assert not target.exists()
    assert target.read_bytes() == b"1"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_the_nodes_of_several_grids(run_interpreted):
    """One after the other, numbered through; the type says which grid, as the page of the style."""
    script = """
        method({})
        dimension(1, 0, 1, 0.1)
        region(a, block, 0.1, 0.3)
        region(b, block, 0.6, 0.9)
        material(m, linear, 1, 100, 0)
        solid(a, region, a, 2, m, 0.1, 0)
        solid(b, region, b, 2, m, 0.1, 0)
        dump(d, all, grid, 1, d.*.txt, x, mass)
        run(0)
    """
    own = run_interpreted(script.format("tlmpm, FLIP, linear, 1")).dump("d.0.txt")
    assert own["id"].tolist() == list(range(3 + 4))
    assert own["type"].tolist() == [1] * 3 + [2] * 4
    assert own.x == pytest.approx([0.1, 0.2, 0.3, 0.6, 0.7, 0.8, 0.9])
    each = run_interpreted(script.format("ulmpm/contacts, FLIP, linear, 1"), folder="c")
    both = each.dump("d.0.txt")
    assert both["type"].tolist() == [1] * 11 + [2] * 11
    assert (both.x[:11] == both.x[11:]).all()
    assert both.mass.reshape(2, 11).sum(axis=1) == pytest.approx([0.2, 0.3])


@pytest.mark.parametrize("fixed", [0.1, None])
def test_rhythm_of_time(plane, fixed):
    """The first step at or after each multiple of 0.25, with steps of 0.1: of 3, 5, 8, 10, 13."""
    plane.update.fixed_dt = fixed
    plane.dumps["d"] = Particle(plane, ByTime(0.25), "all.dump")
    plane.output.log.every = 1000
    plane.run(4)
    plane.run(10)
    steps = steps_of((plane.folder / "all.dump").read_text())
    assert steps == [0, 3, 4, 5, 8, 10, 13, 14]


def test_rhythm_of_time_with_growing_steps():
    """Whatever the steps become, none that is due is missed by more than the last of them."""
    every, time, dt, step = ByTime(1.0), 0.0, 1e-3, 0
    every.passed = 0
    written = []
    while time < 5:
        for _ in range(next_step(every, step, time, dt, fixed=False) - step):
            time, dt, step = time + dt, dt * 1.001, step + 1
        if is_due(every, step, time):
            every.passed = every.now(time)
            written.append((time, dt))
    assert [int(time) for time, _ in written] == [1, 2, 3, 4, 5]
    assert all(time - int(time) < dt for time, dt in written)
