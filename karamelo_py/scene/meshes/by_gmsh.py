"""Read or generate meshes with Gmsh."""

import contextlib
import re
import shutil
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np

from karamelo_py.scene.meshes.data import CellBlock, Mesh
from karamelo_py.script.errors import ScriptError

READS = (".msh", ".msh2", ".msh4", ".med", ".unv", ".cgns")
_LIBRARIES = "libglu1-mesa libxrender1 libxcursor1 libxft2 libxinerama1"
# Families whose name is not Gmsh's name in lower case.
_FAMILIES = {"Quadrilateral": "quad", "Point": "vertex", "Tetrahedron": "tetra", "Prism": "wedge"}


class NoGmsh(Exception):
    pass


@contextlib.contextmanager
def _model(path: Path) -> Iterator[ModuleType]:
    """Open a new Gmsh model; other models of the process stay open."""
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise NoGmsh(str(error)) from None
    mine = not gmsh.isInitialized()
    if mine:
        begin(gmsh)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(path))
        yield gmsh
        if not mine:
            gmsh.model.remove()
    finally:
        if mine:
            gmsh.finalize()


def begin(gmsh: ModuleType) -> None:
    """Initialize Gmsh, but undo its reset of SIGPIPE.

    With the reset, closing a pipe, or the live page, would end the program.
    """
    before = signal.getsignal(signal.SIGPIPE) if hasattr(signal, "SIGPIPE") else None
    gmsh.initialize([], readConfigFiles=False, run=False, interruptible=False)
    if before is not None:
        with contextlib.suppress(ValueError):  # signals cannot be set outside the main thread
            signal.signal(signal.SIGPIPE, before)


@contextlib.contextmanager
def alone(path: Path, ending: str = "") -> Iterator[Path]:
    """Link a file in an empty folder, since Gmsh also reads FILE.opt, which may run commands."""
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / (path.name + ending)
        try:
            link.symlink_to(path)
        except OSError:
            shutil.copyfile(path, link)
        yield link


def _reason(error: BaseException, path: Path) -> str:
    return " ".join(str(error).split()).replace(str(path), path.name)


def mesh_geometry(path: Path, dimension: int, size: float | None = None) -> Mesh:
    try:
        with _model(path) as gmsh:
            if size:
                gmsh.option.setNumber("Mesh.MeshSizeMax", size)
            gmsh.model.mesh.generate(dimension)
            if not len(gmsh.model.mesh.getNodes()[0]):
                raise ScriptError(f"{path.name} has nothing to mesh", argument="file")
            groups = {d for d, _ in gmsh.model.getPhysicalGroups()}
            if groups and min(groups) > dimension:
                raise ScriptError(
                    f"{path.name} does not fit {dimension}D: its physical groups have "
                    f"{min(groups)} dimensions",
                    argument="file",
                    expected=f"a physical group of {dimension} dimensions, or none",
                )
            return _taken(gmsh, only_groups=bool(groups))
    except ScriptError:
        raise
    except NoGmsh as error:
        raise ScriptError(
            f"Gmsh, which meshes {path.name}, cannot be loaded: {error}",
            argument="file",
            expected="its libraries installed: on Debian and Ubuntu, apt install " + _LIBRARIES,
            hint=f"or mesh it elsewhere: gmsh -{dimension} {path.name} -o {path.stem}.msh",
        ) from None
    except Exception as error:  # Gmsh raises plain Exceptions
        raise ScriptError(
            f"Gmsh cannot mesh {path.name}: {_reason(error, path)}",
            argument="file",
            hint=f"gmsh -{dimension} {path.name} prints more",
        ) from None


def read_by_gmsh(path: Path) -> Mesh:
    """Read a mesh; raises ValueError for errors of Gmsh."""
    with alone(path, "" if path.suffix.lower() in READS else ".msh") as link:
        try:
            with _model(link) as gmsh:
                return _taken(gmsh, of_file=_Header(path))
        except NoGmsh:
            raise
        except Exception as error:
            raise ValueError(_reason(error, link)) from None


class _Header:
    """File content that Gmsh's library drops: names of empty groups, and groups by element.

    For format versions 1 and 2, Gmsh puts all elements of an entity into all its groups.
    """

    def __init__(self, path: Path):
        with path.open("rb") as file:
            head = file.read(1_000_000)
        names = re.search(rb"\$PhysicalNames(.*?)\$EndPhysicalNames", head, re.S)
        groups = re.findall(r'(\d) +(\d+) +"([^"]*)"', names[1].decode("latin-1")) if names else []
        self.names = {(int(dim), int(number)): name for dim, number, name in groups}
        self.groups: dict[int, int] | None = None
        version = re.match(rb"\$MeshFormat\s+([12])\S* +0", head)
        if not version and b"$NOD" not in head:
            return
        pattern = rb"\$ELM\s+\d+(.*?)\$END|\$Elements\s+\d+(.*?)\$End"
        section = re.search(pattern, path.read_bytes(), re.S)
        if section and (section[1] or version):
            at = 2 if section[1] else 3  # number, type, [tag count,] group
            rows = (line.split(None, at + 1) for line in (section[1] or section[2]).splitlines())
            self.groups = {int(row[0]): int(row[at]) for row in rows if len(row) > at}


def _taken(gmsh: ModuleType, only_groups: bool = False, of_file: _Header | None = None) -> Mesh:
    tags, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    ascending = tags[order]
    if (ascending[1:] == ascending[:-1]).any():
        raise ValueError("two nodes have one number, or one has the number 0")
    names = dict(of_file.names) if of_file else {}
    for dim, number in gmsh.model.getPhysicalGroups():
        names.setdefault((dim, number), gmsh.model.getPhysicalName(dim, number).strip())
    entities = {} if names else dict.fromkeys(gmsh.model.getEntities(), "")
    names |= entities  # names of entities, such as the properties of Nastran
    # By element type: nodes, and groups (-1: none).
    left_out: dict[str, int] = {}
    by_kind: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for dim, tag in gmsh.model.getEntities():
        numbers = [tag] if entities else gmsh.model.getPhysicalGroupsForEntity(dim, tag)
        if only_groups and not len(numbers):
            continue
        for kind, elements, nodes in zip(*gmsh.model.mesh.getElements(dim, tag), strict=True):
            name, _, _, count, *_ = gmsh.model.mesh.getElementProperties(kind)
            if not count:  # Such lines are pieces of elements cut by a level set.
                left_out[name] = left_out.get(name, 0) + len(elements)
                continue
            if not entities and of_file and of_file.groups is not None:
                groups = np.array([[of_file.groups.get(int(n), -1)] for n in elements])
            else:
                groups = np.tile(np.append(numbers, -1).astype(int), (len(elements), 1))
            at = np.searchsorted(ascending, nodes).reshape(-1, count)
            by_kind.setdefault(int(kind), []).append((at, groups))
    cells = []
    sets: dict[str, list[np.ndarray]] = {}
    for keys in sorted(names, key=lambda keys: keys[::-1]):
        sets.update({key: [] for key in (names[keys], str(keys[1])) if key})
    for kind, parts in by_kind.items():
        name, dim, _, count, reference, primary = gmsh.model.mesh.getElementProperties(kind)
        family = _FAMILIES.get(name.split()[0], name.split()[0].lower())
        natural = np.reshape(reference, (count, -1))[:, :dim] if dim else None
        nodes = np.concatenate([nodes for nodes, _ in parts])
        cells.append(CellBlock(family if count == primary else f"{family}{count}", nodes, natural))
        for key, masks in sets.items():
            of = [n for (d, n), name in names.items() if d == dim and key in (name, str(n))]
            masks.append(np.concatenate([np.isin(groups, of).any(axis=1) for _, groups in parts]))
    return Mesh(np.reshape(points, (-1, 3))[order], cells, sets, {}, left_out)
