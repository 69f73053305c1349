"""Meshes from files: read by meshio, and made by Gmsh where the file is a geometry."""

import contextlib
import io
import tempfile
import warnings
from functools import lru_cache
from pathlib import Path

import meshio
import numpy as np

from karamelo_py.language.kinds import InputFile
from karamelo_py.scene.meshes.geometry import refuse_commands
from karamelo_py.script.errors import FAILURES, ScriptError, unknown

GEOMETRIES = (".geo", ".geo_unrolled")

_LIBRARIES = "libglu1-mesa libxrender1 libxcursor1 libxft2 libxinerama1"


class MeshFile(InputFile):
    """For signatures: a file that `read` can read, by its ending."""

    endings = {*meshio.extension_to_filetypes, *GEOMETRIES} - {".svg"}  # only written


def read(path: Path, dimension: int, trusted: bool = False) -> meshio.Mesh:
    """The mesh in a file; a geometry of Gmsh is meshed up to `dimension`.

    A `trusted` geometry may run commands of the system and write files.
    """
    status = path.stat()
    if not status.st_size:
        raise ScriptError(
            f"the file {path.name} is empty", argument="file", expected="a mesh or a geometry"
        )
    if path.suffix.lower() in GEOMETRIES:
        refuse_commands(path, trusted=trusted)
    # Regions and solids often come from the same file.
    return _read(path.resolve(), dimension, (status.st_mtime_ns, status.st_size))


@lru_cache(maxsize=2)
def _read(path: Path, dimension: int, _state: tuple[int, int]) -> meshio.Mesh:
    if path.suffix.lower() not in GEOMETRIES:
        return _by_meshio(path)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "made.msh"
        _mesh_geometry(path, dimension, made)
        return _by_meshio(made, path.name)


def _by_meshio(path: Path, name: str | None = None) -> meshio.Mesh:
    said = io.StringIO()
    try:
        # It prints what it has to say, and ends the process where no format fits.
        with (
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("ignore")
            mesh = meshio.read(path)
    except FAILURES as error:
        unknown = "Could not deduce" in str(error)
        reason = "its ending tells no format" if unknown else _reason(error)
        raise ScriptError(
            f"the file {name or path.name} cannot be read as a mesh: {reason}",
            argument="file",
            expected="a mesh in a format that meshio reads (.msh, .vtu, .inp, .med, .stl, ...), "
            "or a .geo file, which Gmsh meshes",
            hint="mesh a CAD file beforehand: gmsh -3 part.step -o part.msh"
            if path.suffix.lower() in (".step", ".stp", ".iges", ".igs", ".brep")
            else None,
        ) from None
    points = np.asarray(mesh.points, float)
    if not len(points) or not sum(len(block.data) for block in mesh.cells):
        raise ScriptError(
            f"the mesh {name or path.name} is empty",
            argument="file",
            expected="a mesh with elements",
        )
    if not np.isfinite(points).all():
        raise ScriptError(
            f"the mesh {name or path.name} has a node whose position is not a number",
            argument="file",
        )
    return mesh


def _reason(error: BaseException) -> str:
    """Word an exception in one line; where no format fits, meshio says so only in passing."""
    if isinstance(error, SystemExit) or not str(error).strip():
        return "its content does not fit its ending"
    return f"{' '.join(str(error).split())} ({type(error).__name__})"


def _mesh_geometry(path: Path, dimension: int, target: Path) -> None:
    """Let Gmsh mesh the geometry in `path`; the mesh is written to `target`."""
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise ScriptError(
            f"Gmsh, which meshes {path.name}, cannot be loaded: {error}",
            argument="file",
            expected="its libraries installed: on Debian and Ubuntu, apt install " + _LIBRARIES,
            hint=f"or mesh it elsewhere: gmsh -{dimension} {path.name} -o {path.stem}.msh",
        ) from None
    # Whoever uses Gmsh in the same process keeps it, with the models that are open.
    mine = not gmsh.isInitialized()
    if mine:
        gmsh.initialize([], readConfigFiles=False, run=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(path))
        gmsh.model.mesh.generate(dimension)
        if not len(gmsh.model.mesh.getNodes()[0]):
            raise ScriptError(f"{path.name} has nothing to mesh", argument="file")
        # Where there are physical groups, Gmsh writes what is in them and no more.
        groups = {d for d, _ in gmsh.model.getPhysicalGroups()}
        if groups and min(groups) > dimension:
            raise ScriptError(
                f"{path.name} does not fit {dimension}D: its physical groups have "
                f"{min(groups)} dimensions",
                argument="file",
                expected=f"a physical group of {dimension} dimensions, or none",
            )
        gmsh.write(str(target))
        if not mine:
            gmsh.model.remove()
    except ScriptError:
        raise
    except Exception as error:  # Gmsh has one class for all that it complains about.
        reason = " ".join(str(error).split()).replace(str(path), path.name)
        raise ScriptError(
            f"Gmsh cannot mesh {path.name}: {reason}",
            argument="file",
            hint=f"gmsh -{dimension} {path.name} says more",
        ) from None
    finally:
        if mine:
            gmsh.finalize()


def chosen_cells(mesh: meshio.Mesh, group: str | int | None) -> list[tuple[str, int, np.ndarray]]:
    """The cells of a physical group (or set of cells), or all: types, dimensions, nodes (n, c)."""
    if group is None:
        masks = [np.ones(len(block.data), bool) for block in mesh.cells]
    else:
        masks = _members(mesh, group)
    return [
        (block.type, block.dim, np.asarray(block.data)[mask])
        for block, mask in zip(mesh.cells, masks, strict=True)
        if mask.any()
    ]


def _members(mesh: meshio.Mesh, group: str | int) -> list[np.ndarray]:
    tags = mesh.cell_data.get("gmsh:physical", [])
    if group in mesh.cell_sets:
        sets = zip(mesh.cells, mesh.cell_sets[group], strict=True)
        return [np.isin(np.arange(len(b.data)), () if of is None else of) for b, of in sets]
    number, dimension = group, None
    if isinstance(group, str):
        number, dimension = mesh.field_data.get(group, (None, None))
    masks = [
        np.asarray(tag) == number if dimension in (None, block.dim) else np.zeros(len(tag), bool)
        for block, tag in zip(mesh.cells, tags, strict=bool(len(tags)))
    ]
    if number is not None and any(mask.any() for mask in masks):
        return masks
    names = [name for name in (*mesh.cell_sets, *mesh.field_data) if not name.startswith("gmsh:")]
    known = list(dict.fromkeys(names)) or sorted({str(n) for tag in tags for n in np.unique(tag)})
    message = f"the mesh has no physical group '{group}' with elements"
    raise unknown(message, str(group), known, argument="group")
