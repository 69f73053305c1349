"""Entry point for mesh files: chooses the reader.

Abaqus, LS-DYNA, Nastran, Exodus, MFEM and OBJ have readers in this package. Gmsh reads its own
formats, MED, UNV and CGNS, and meshes geometries; meshio reads all other formats.
"""

import contextlib
import io
import re
import warnings
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from karamelo_py.language.kinds import InputFile
from karamelo_py.scene.meshes.abaqus import read_deck
from karamelo_py.scene.meshes.by_gmsh import READS as BY_GMSH
from karamelo_py.scene.meshes.by_gmsh import NoGmsh, alone, mesh_geometry, read_by_gmsh
from karamelo_py.scene.meshes.data import CellBlock, Mesh
from karamelo_py.scene.meshes.exodus import ENDINGS as EXODUS
from karamelo_py.scene.meshes.exodus import read_exodus
from karamelo_py.scene.meshes.geometry import refuse_commands
from karamelo_py.scene.meshes.lsdyna import ENDINGS as LSDYNA
from karamelo_py.scene.meshes.lsdyna import read_lsdyna
from karamelo_py.scene.meshes.mfem import read_mfem
from karamelo_py.scene.meshes.nastran import ENDINGS as NASTRAN
from karamelo_py.scene.meshes.nastran import read_nastran
from karamelo_py.scene.meshes.obj import read_obj
from karamelo_py.script.errors import FAILURES, ScriptError

if TYPE_CHECKING:
    import meshio  # imported with the first mesh only: it takes 8 % of a small scene's time

GEOMETRIES = (".geo", ".geo_unrolled")
CAD = (".step", ".stp", ".iges", ".igs", ".brep")
# Gmsh reads files that do not begin with one of these as geometries.
_OF_GMSH = (b"$MeshFormat", b"$NOD", b"$Comments", b"$PhysicalNames")
_BY_ENDING = (".unv", ".cgns")
_HDF5 = b"\x89HDF"
# First bytes of other kinds of files that may have the ending of a mesh, with advice.
_FOREIGN = (
    (re.compile(rb"version https://git-lfs"), "a pointer of Git LFS", "git lfs pull fetches it"),
    (re.compile(rb"\s*(#[^\n]*\n\s*)*MESH\s", re.I), "a mesh of GiD", "export it as .inp or .msh"),
    (re.compile(rb"\s*Begin\s+(ModelPart|Properties|Nodes)"), "a model of Kratos",
     "export it as .vtu or .msh"),
    (re.compile(rb"(?s).*\bNZONE *= *([2-9]|\d\d)"), "a file of several zones (NZONE)",
     "write each zone to a file"),
)  # fmt: skip


_BULK = re.compile(rb"^(SOL|CEND|BEGIN +BULK|GRID)\b", re.M | re.I)


class _Endings:
    def __contains__(self, ending: object) -> bool:
        import meshio

        of_meshio = meshio.extension_to_filetypes.keys() - {".svg"}
        return ending in {*of_meshio, *GEOMETRIES, *CAD, *BY_GMSH, *EXODUS, *LSDYNA}


class MeshFile(InputFile):
    endings = _Endings()


def read(path: Path, dimension: int, trusted: bool = False, size: float | None = None) -> Mesh:
    """Read a mesh.

    Geometries are meshed up to `dimension`, CAD files with edges of `size`.

    If `trusted`, a geometry may run system commands and write files.
    """
    status = path.stat()
    if not status.st_size:
        raise ScriptError(
            f"the file {path.name} is empty", argument="file", expected="a mesh or a geometry"
        )
    if path.suffix.lower() in GEOMETRIES:
        refuse_commands(path, trusted=trusted)
    cad = path.suffix.lower() in CAD
    state = status.st_mtime_ns, status.st_size
    mesh = _read(path.resolve(), dimension, size if cad else None, state)
    if path.stat().st_size != status.st_size:
        raise ScriptError(
            f"the file {path.name} changed while it was read",
            argument="file",
            hint="start again after it is complete",
        )
    return mesh


@lru_cache(maxsize=2)
def _read(path: Path, dimension: int, size: float | None, _state: tuple[int, int]) -> Mesh:
    if path.suffix.lower() in GEOMETRIES:
        mesh = mesh_geometry(path, dimension, size)
    elif path.suffix.lower() in CAD:
        _refuse_what_is_no_cad(path)
        with alone(path) as link:
            mesh = mesh_geometry(link, dimension, size)
    else:
        try:
            with np.errstate(all="ignore"):
                mesh = _by_content(path)
        except ScriptError:
            raise
        except FAILURES as error:
            raise _unreadable(path, _reason(error)) from None
    if not len(mesh.points) or not sum(len(cells.nodes) for cells in mesh.cells):
        counts = ", ".join(f"{n} {kind}" for kind, n in mesh.left_out.items())
        raise ScriptError(
            f"the mesh {path.name} is empty" + (f" but for {counts}" if counts else ""),
            argument="file",
            expected="a mesh with elements that have a volume",
        )
    if not np.isfinite(mesh.points).all():
        raise ScriptError(
            f"the mesh {path.name} has a node whose position is not a number", argument="file"
        )
    for cells in mesh.cells:
        if not len(cells.nodes) or cells.dimension < 0:
            continue
        if not 0 <= cells.nodes.min() <= cells.nodes.max() < len(mesh.points):
            raise ScriptError(
                f"the mesh {path.name} has an element with a node that does not exist",
                argument="file",
            )
    return mesh


def _refuse_what_is_no_cad(path: Path) -> None:
    with path.open("rb") as file:
        begin = file.read(1024)
    right = {
        "st": begin.lstrip().startswith(b"ISO-10303-21"),
        "ig": begin[72:73] == b"S",
        "br": b"CASCADE" in begin or begin.lstrip().startswith(b"DBRep"),
    }
    if not right.get(path.suffix[1:3].lower(), True):
        raise _unreadable(path, "its content does not fit its ending")


def _by_content(path: Path) -> Mesh:
    with path.open("rb") as file:
        begin = file.read(4096)
    ending = path.suffix.lower()
    for pattern, program, remedy in _FOREIGN:
        if pattern.match(begin):
            raise _unreadable(path, f"it is {program}", hint=remedy)
    if ending in LSDYNA or re.match(rb"\s*(\$[^\n]*\n)*\*KEYWORD", begin, re.I):
        return read_lsdyna(path)
    if ending in (".inp", ".msh") and re.search(rb"^ *\*[A-Za-z]", begin, re.M):
        return read_deck(path)
    if ending == ".inp" and re.match(rb"\s*(#[^\n]*\n\s*)*\d+ +\d+ +\d+ +\d+ +\d+\s", begin):
        return _by_meshio(path, "avsucd")
    if ending == ".obj" and b"\0" not in begin:
        return read_obj(path)
    if ending in EXODUS:
        return read_exodus(path)
    if ending in NASTRAN or (ending == ".dat" and _BULK.search(begin)):
        return read_nastran(path)
    if begin.lstrip().startswith(b"MFEM"):
        return read_mfem(path)
    why = None
    by_content = begin.startswith(_OF_GMSH) or (ending == ".med" and begin.startswith(_HDF5))
    if by_content or ending in _BY_ENDING:
        try:
            if begin.startswith(_HDF5):
                _read_all(path)
            return read_by_gmsh(path)
        except NoGmsh as error:
            why = f"Gmsh cannot be loaded ({error}), and meshio: "
    return _by_meshio(path, why=why)


def _read_all(path: Path) -> None:
    """Read all of an HDF5 file. Raises ValueError if it is damaged, since Gmsh would crash."""
    import h5py

    def visit(_: str, item: h5py.Group | h5py.Dataset) -> None:
        dict(item.attrs)
        if isinstance(item, h5py.Dataset):
            item[()]

    try:
        with h5py.File(path) as file:
            file.visititems(visit)
    except FAILURES as error:
        raise ValueError(f"the file is damaged: {_reason(error)}") from None


def _unreadable(path: Path, reason: str, hint: str | None = None) -> ScriptError:
    return ScriptError(
        f"the file {path.name} cannot be read as a mesh: {reason}",
        argument="file",
        expected="a mesh of Gmsh (.msh, .med, .unv), of Abaqus (.inp) or in a format that meshio "
        "reads (.vtu, .stl, ...), or a geometry, which Gmsh meshes (.geo, .step, .brep)",
        hint=hint,
    )


def _skip_close(file: Any, depth: int) -> None:
    """Skip to the closing bracket, or raise ValueError: without it, meshio would never end."""
    while depth > 0:
        letter = file.read(1)
        if not letter:
            raise ValueError("it ends within brackets")
        depth += (letter == b"(") - (letter == b")")


def _by_meshio(path: Path, file_format: str | None = None, why: str | None = None) -> Mesh:
    import meshio

    # meshio supports pixels, voxels and hexagonal prisms of VTK only in part.
    partly = (8, "pixel", 4, 2), (11, "voxel", 8, 3), (16, "hexa_prism", 12, 3)
    for number, name, count, dimension in partly:
        meshio._common.num_nodes_per_cell.setdefault(name, count)
        meshio._mesh.topological_dimension.setdefault(name, dimension)
        meshio._vtk_common.vtk_to_meshio_type.setdefault(number, name)
    meshio.ansys._ansys._skip_close = _skip_close
    try:
        # meshio prints messages, and ends the process if no format fits.
        with (
            contextlib.redirect_stdout(io.StringIO()),
            contextlib.redirect_stderr(io.StringIO()),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("ignore")
            mesh = meshio.read(path, file_format)
    except FAILURES as error:
        unknown = "Could not deduce" in str(error)
        reason = "its ending identifies no format" if unknown else _reason(error)
        raise _unreadable(path, (why or "") + reason) from None
    if np.ndim(mesh.points) != 2:
        raise _unreadable(path, "its content does not fit its ending")
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    cells = [CellBlock(block.type, np.asarray(block.data)) for block in mesh.cells]
    sets = dict(_sets_of(mesh))
    if path.suffix.lower() == ".su2":
        sets |= _markers(path, sets)
    return Mesh(points, cells, sets, {}, {})


def points_of(path: Path) -> np.ndarray:
    """Read the points (n, 3) of a cloud or mesh; raises ScriptError if meshio cannot read them."""
    return _by_meshio(path).points


def _markers(path: Path, sets: dict[str, list[np.ndarray]]) -> dict[str, list[np.ndarray]]:
    """Return the sets of an SU2 mesh by marker name; meshio replaces names by numbers."""
    number, named = 0, {}
    for name in re.findall(r"^MARKER_TAG *= *(\S+)", path.read_text("latin-1"), re.M):
        number = int(name) if name.isdigit() else number + 1
        named[name] = sets.get(str(number), [])
    return named


def _sets_of(mesh: "meshio.Mesh") -> Iterator[tuple[str, list[np.ndarray]]]:
    for name, elements in mesh.cell_sets.items():
        if not name.startswith("gmsh:"):
            yield (
                name,
                [
                    np.isin(np.arange(len(block.data)), () if of is None else of)
                    for block, of in zip(mesh.cells, elements, strict=True)
                ],
            )
    tags = {
        name: [np.asarray(array).reshape(-1) for array in arrays]
        for name, arrays in mesh.cell_data.items()
        if all(np.size(a) == len(a) and np.asarray(a).dtype.kind in "iu" for a in arrays)
        and name != "gmsh:geometrical"
    }
    for name, arrays in tags.items():
        for number in np.unique(np.concatenate(arrays)):
            masks = [array == number for array in arrays]
            yield f"{name}:{number}", masks
            if len(tags) == 1 or name == "gmsh:physical":
                yield str(number), masks
            for group in vars(mesh).get("cell_tags", {}).get(int(number), ()):  # for MED files
                yield group, masks
    for name, (number, dimension) in mesh.field_data.items():
        arrays = tags.get("gmsh:physical", [])
        if arrays:
            yield (
                name,
                [
                    (array == number) & (block.dim == dimension)
                    for block, array in zip(mesh.cells, arrays, strict=True)
                ],
            )


def _reason(error: BaseException) -> str:
    """Return a reader's error as one line, or a clearer line if no format fits."""
    said = str(error).strip()
    foreign = isinstance(error, UnicodeDecodeError) or said.startswith("could not convert")
    if isinstance(error, SystemExit) or foreign or not said:
        return "its content does not fit its ending"
    kind = "" if type(error) is ValueError else f" ({type(error).__name__})"
    return f"{' '.join(said.split())}{kind}"
