"""What is written and run only where the user says so: files of others, programs of geometries."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest
from scenes import block

from karamelo_py import Simulation, SimulationError
from karamelo_py.scene.meshes.geometry import refuse_commands
from karamelo_py.script.errors import ScriptError

RUN = block(2, "fix(v, initial_velocity_particles, all, 0.1, 0)", "set_dt(0.001)", "run(2)")


# --- files that no run has written --------------------------------------------------------------


@pytest.mark.parametrize("text", ["My notes\non many things\n", "a,b\nc,d\n", "\xff\xfe\x00"])
def test_a_log_of_somebody_else(run_interpreted, tmp_path, text):
    """A file that is no log stays, unless -log names it."""
    (tmp_path / "run").mkdir()
    path = tmp_path / "run" / "log.mpm"
    path.write_bytes(text.encode("latin-1"))
    result = run_interpreted(RUN, status=1)
    assert "exists and is not the log of a run" in result.err
    assert path.read_bytes() == text.encode("latin-1")
    run_interpreted(RUN, "-log", "log.mpm")
    assert path.read_text().startswith("Step")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "Step dt Time\n",
        "Step dt Time\n0 0.1 0\n# Step E\n1 2\n",
        "Step limit\n0 waves\n1 set_dt\n",
    ],
)
def test_a_log_of_an_earlier_run(run_interpreted, tmp_path, text):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "log.mpm").write_text(text)
    assert run_interpreted(RUN).log.Step.tolist() == [0, 1, 2]


def test_the_list_of_a_series(run_interpreted, tmp_path):
    """A .pvd is written beside what the script names: it must be one of a run."""
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "p.pvd").write_text("notes")
    script = RUN.replace("run(2)", "dump(d, all, vtk, 1, p.*.vtu, x)\nrun(2)")
    result = run_interpreted(script, status=1)
    assert "p.pvd, which would list the snapshots, exists" in result.err
    (tmp_path / "run" / "p.pvd").unlink()
    run_interpreted(script)
    run_interpreted(script)  # over its own


def test_nothing_is_written_elsewhere(run_interpreted, tmp_path):
    """Only the folder of the run has new files."""
    before = set(tmp_path.rglob("*"))
    run_interpreted(RUN.replace("run(2)", "restart(1, r.h5)\nrun(2)"), "-out", "results")
    new = {path.relative_to(tmp_path) for path in set(tmp_path.rglob("*")) - before}
    assert {str(path) for path in new} == {
        "run", "run/in.script", "run/results", "run/results/log.mpm", "run/results/r.h5",
        "run/results/run.json",
    }  # fmt: skip


# --- geometries that do more than describe ------------------------------------------------------

SQUARE = 'SetFactory("OpenCASCADE");\nRectangle(1) = {0.3, 0.3, 0, 0.3, 0.2};\n'
ACTS = [
    'SystemCall "touch hacked";',
    'System "touch hacked";',
    'NonBlockingSystemCall "touch hacked";',
    'OnelabRun("touch", "touch hacked");',
    'Printf("x") > "hacked";',
    'Printf("x") >> "hacked";',
    'Print "hacked.png";',
    'Save "hacked.msh";',
    'CreateDir "hacked";',
    'Include "other.geo";',
    'Merge "other.geo";',
    'name = "other.geo";\nInclude Str(name);',
    'Parse["SystemCall hacked"];',
    # Texts that hide what follows: Gmsh has two kinds of quotes, over lines too, up to a length.
    "Printf('\"'); SystemCall 'touch hacked'; Printf('\"');",
    'Printf("x\n"); SystemCall "touch hacked"; Printf("");',
    f'Printf("{"x" * 2000}; SystemCall touch hacked; ");',
    # What Gmsh does not know it reads as its own language.
    'Include "other.txt";',
    'Merge "other.pos";',
    'Merge "other.msh";',
    'Printf("Include "); Printf("x"); name = "other.geo"; Include Str(name);',
    'General.OptionsFileName = "hacked"; General.SaveOptions = 1;',
    "Exit;",
    # Fields, merged files and names made of texts act, too, and so do names that a file gives.
    'Field[1] = ExternalProcess;\nField[1].CommandLine = "touch hacked";\nBackground Field = 1;',
    "ExternalProcess = 1;\nField[1] = ExternalProcess;",
    'Field[1] = Structured;\nField[1].FileName = "/etc/passwd";',
    'MergeWithBoundingBox "other.pos";',
    'Include "other.stl";',
    'Merge "other.Stl";',
    'Merge "other.py";',
    'Merge "data.stl";',
    'System = 1; System "touch hacked";',
    'S2N["System"] "touch hacked";',
    'StringToName["SystemCall"] "touch hacked";',
    'future = 1; future "touch hacked";',
    'Future "touch hacked";',
    "x() = ListFromFile['/etc/passwd'];",
    'x = GetValue("waits for an answer", 1);',
    "Sleep 100000;",
    'General[0].LogFileName = "hacked";',
    # Passing over a condition Gmsh loses the letter after E, F, I, M and R, and ends at a NUL.
    "E = 1; If(0) E\" EndIf SystemCall 'touch hacked'; \"; EndIf",
    'E = 1; If(0) E"x"; // " EndIf SystemCall \'touch hacked\';\nEndIf',
    'x1E = 1; If(0) x1E// EndIf SystemCall "touch hacked";\n ; EndIf',
    '// \0 SystemCall "touch hacked";',
]


@pytest.mark.parametrize("line", ACTS)
def test_a_geometry_that_acts(run_interpreted, tmp_path, line):
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "data.stl").write_text("solid\nendsolid\n")
    for name in ("geo", "txt", "pos", "msh", "stl", "Stl", "py"):
        (folder / f"other.{name}").write_text('\n\nSystemCall "touch hacked";\n')
    (folder / "data.stl.opt").write_text('\n\nSystemCall "touch hacked";\n')
    (folder / "box.geo").write_text(SQUARE + line + "\n")
    script = block(2).replace("region, box, 2,", "mesh, box.geo,")
    result = run_interpreted(script, status=1)
    says = "would end this program" if line == "Exit;" else "run a program, or read or write a file"
    assert says in result.err
    assert "--trust-geometries" in result.err
    read = re.fullmatch(r'(?:Include|Merge\w*) "((?:other\.(?!S|py)\w+|data.stl))";', line)
    where = read and read[1].replace("data.stl", "data.stl.opt")
    assert (f"{where}, line 3" if read else "box.geo, line") in result.err
    assert not list(folder.glob("hacked*"))


def test_options_beside_a_geometry(tmp_path):
    """Gmsh reads box.geo.opt with box.geo."""
    path = tmp_path / "box.geo"
    path.write_text(SQUARE)
    refuse_commands(path)
    (tmp_path / "box.geo.opt").write_text('SystemCall "touch hacked";\n')
    with pytest.raises(ScriptError, match=r"box\.geo\.opt, line 1: SystemCall"):
        refuse_commands(path)


@pytest.mark.parametrize(
    "text",
    ["// SystemCall\n", "/* EndIf Save\n Print */\n", 'Printf("SystemCall");\n',
     "SystemCalls = 1;\n",
     "n = 3; DefineConstant[ m = {2, Min 1, Name 'm'}, k ]; x() = {1e-3, n*m + k};\n",
     "For i In {1:3}\n list~{i}[] += newp; EndFor // Return\n",
     "Macro Hole p = newp; Return Call Hole;\n",
     "Field[1] = Box; Field[1].VIn = 0.1; Background Field = 1;\n",
     "Transfinite Curve{1} = 4 Using Progression 1.1; Recombine Surface{1};\n",
     "Color Red{ Surface{1}; } General.RotationX = 30; Mesh.Algorithm = 6;\n",
     "General.Terminal = 1; // it's \"\n"],
)  # fmt: skip
def test_a_geometry_that_only_speaks(tmp_path, text):
    path = tmp_path / "a.geo"
    path.write_text(SQUARE + text)
    refuse_commands(path)


def test_a_trusted_geometry(tmp_path, monkeypatch):
    """The option lets it; in Python an argument does."""
    pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "box.geo"
    path.write_text(SQUARE + 'Printf("made") > "made.txt";\nMesh.MeshSizeMax = 0.1;\n')
    text = block(2).replace("region, box, 2,", "mesh, box.geo,")
    with pytest.raises(SimulationError, match="--trust-geometries"):
        Simulation(text)
    assert not (tmp_path / "made.txt").exists()
    Simulation(text, trust_geometries=True)
    assert (tmp_path / "made.txt").exists()


def test_all_shipped_geometries_only_describe():
    from conftest import INPUTS

    found = list(INPUTS.glob("*.geo"))
    assert found
    for path in found:
        refuse_commands(path)


def test_names_that_the_system_cannot_write(tmp_path):
    """Where names of files are ASCII (UTF-8 is switched off) the name is told, not the author."""
    (tmp_path / "in.a").write_text(
        RUN.replace("run(2)", 'dump(d, all, hdf5, 1, "ß.h5", x)\nrun(2)')
    )
    done = subprocess.run(
        [sys.executable, "-m", "karamelo_py.app.cli", "in.a"],
        cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0",
             "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    if done.returncode:  # a system without such names
        assert "cannot be the name of a file here" in done.stderr
        assert "tell the author" not in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limits of files")
@pytest.mark.parametrize("style", ["hdf5", "grid/hdf5"])
@pytest.mark.parametrize("room", [8, 300])
def test_no_room_for_a_dump_in_hdf5(tmp_path, starts_are_cheap, style, room):
    """Told once; a file holds the states that were complete, and is closed.

    HDF5 writes when it thinks fit, reports little of it, and ends in a segmentation fault.
    """
    import h5py
    import numpy as np

    columns = "vx, vy, mass" if "grid" in style else "x, y, vx, vy, s11, s22, s12"

    (tmp_path / "in.a").write_text(
        RUN.replace("run(2)", f"dump(d, all, {style}, 1, d.h5, {columns})\nrun(400)")
    )
    limited = (
        # Python does not see that there is no room for what it compiles.
        "import resource, sys; sys.dont_write_bytecode = True; "
        "from karamelo_py.app.cli import main; "
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({room} * 1024,) * 2); sys.exit(main(['in.a']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", limited], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("error:") == 1 and "Traceback" not in done.stderr
    assert "cannot write" in done.stderr and "File too large" in done.stderr
    if room > 10:  # what was written before stays
        with h5py.File(tmp_path / "d.h5") as file:
            assert len(file["step"]) > 2
            assert np.array_equal(file["step"], range(len(file["step"])))
            assert not np.isnan(file["vx"]).any()


# --- the first moment ---------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to one process")
@pytest.mark.parametrize("after", [0.15, 0.3, 0.6])
def test_ctrl_c_while_the_program_starts(tmp_path, after):
    """One word and exit status 130, also in the midst of an import."""
    (tmp_path / "in.a").write_text(RUN.replace("run(2)", "run(100000000)"))
    process = subprocess.Popen(
        [sys.executable, "-c", "import sys; from karamelo_py.app import start; "
         "sys.argv[1:] = ['in.a']; print('begun', flush=True); sys.exit(start.main())"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert process.stdout.readline() == "begun\n"
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert "interrupted" in err


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGTERM to one process")
def test_a_signal_between_two_runs(tmp_path, starts_are_cheap):
    """One that comes while the first run writes its last outputs: the second does not begin."""
    (tmp_path / "in.a").write_text(
        RUN.replace("run(2)", "plot(e, 1, time, dt)\nsave_plot(e.png)\nrun(2)\nrun(40)")
    )
    sent = (
        "import os, signal, sys; from karamelo_py.app.cli import main; "
        "from karamelo_py.output.schedule import Output; end = Output.end; "
        "Output.end = lambda s: (end(s), os.kill(os.getpid(), signal.SIGTERM)); "
        "sys.exit(main(['in.a']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", sent], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert done.returncode == 128 + signal.SIGTERM, done.stderr
    assert "the log and the dumps are complete up to here" in done.stderr
    assert done.stdout.count("Run interrupted") == 1
    assert (tmp_path / "log.mpm").read_text().splitlines()[-1].split()[0] == "2"


def test_the_word_of_the_error():
    """ScriptError and SimulationError are one family, so that either can be caught."""
    assert issubclass(SimulationError, ScriptError)


@pytest.mark.parametrize(("law", "told"), [("linear", True), ("neo-hookean", False)])
def test_a_law_that_resists_is_named_where_there_is_another(run_interpreted, law, told):
    """A bar of 1 whose nodes are brought together by 1.5 (det F < 0): whatever the law."""
    said = run_interpreted(
        f"""
        method(tlmpm, FLIP, linear, 1)
        dimension(1, 0, 1, 1)
        region(b, block, 0, 1)
        material(m, {law}, 1e-6, 1, 0.3)
        solid(b, region, b, 2, m, 1)
        region(ends, block, -INF, INF)
        group(ends, nodes, region, ends, all)
        fix(press, velocity_nodes, ends, -1.5*x0)
        fix(start, initial_velocity_particles, all, -1.5*x0)
        set_dt(0.05)
        run(20)
        """,
        status=1,
    ).err
    assert "is turned inside out (det F <= 0)" in said
    assert ("neo-hookean" in said) == told
