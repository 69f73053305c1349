"""VTKHDF files, which refer to arrays of HDF5 dumps (ParaView; VTK File Formats, VTKHDF 2.0)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from karamelo_py.output.files import whole
from karamelo_py.output.hdf5_file import reading
from karamelo_py.output.vtu import arrays_of

VERSION = "v110"  # oldest HDF5 version that can read the files
POSITIONS = ("x", "y", "z")
CELLS = ("Vertices", "Lines", "Polygons", "Strips")


def describe(path: Path, columns: Sequence[str], dimension: int) -> None:
    """Write a .vtkhdf file next to the dump at `path`, for the points in the dump.

    The file has no data, only views of positions, columns and vectors in the dump. VTK does not
    draw deleted points, as their positions are NaN.
    """
    import h5py

    with reading(path) as dump:
        times, count = dump["time"][:], len(dump["id"])
    steps = len(times)
    with h5py.File("new", "w", driver="core", backing_store=False, libver=VERSION) as root:
        top = root.create_group("VTKHDF")
        top.attrs["Version"] = 2, 0
        top.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", 8))

        def virtual(group: h5py.Group, name: str, parts: Sequence[str]) -> None:
            layout = h5py.VirtualLayout((steps * count, *[len(parts)] * (len(parts) > 1)), float)
            layout.dcpl.set_obj_track_times(False)  # makes files of equal runs equal
            for k, component in enumerate(parts):
                if component in columns:
                    source = h5py.VirtualSource(path.name, component, (steps, count), float)
                    layout[(slice(None), k) if len(parts) > 1 else slice(None)] = source
            group.create_virtual_dataset(name, layout, fillvalue=0)

        def numbers(group: h5py.Group, name: str, of: str, shift: int = 0) -> None:
            layout = h5py.VirtualLayout((shift + count,), np.int64)
            layout.dcpl.set_obj_track_times(False)
            layout[shift:] = h5py.VirtualSource(path.name, of, (count,), np.int64)
            group.create_virtual_dataset(name, layout, fillvalue=0)

        top["NumberOfPoints"] = [count]
        virtual(top, "Points", POSITIONS)
        data, at = top.create_group("PointData"), top.create_group("Steps/PointDataOffsets")
        for name in ("id", "type"):
            numbers(data, name, name)
            at[name] = np.zeros(steps, np.int64)
        arrays = {name: [name] for name in columns if name not in POSITIONS}
        for name, parts in (arrays | arrays_of(columns, dimension)).items():
            virtual(data, name, parts)
            at[name] = np.arange(steps) * count
        for kind in CELLS:
            cells = top.create_group(kind)
            n = count if kind == CELLS[0] else 0
            cells["NumberOfCells"] = cells["NumberOfConnectivityIds"] = [n]
            if n:  # 0, 1, ... n; ids of points begin with 1
                numbers(cells, "Offsets", "id", 1)
                numbers(cells, "Connectivity", "id", 1)
            else:
                cells["Offsets"], cells["Connectivity"] = np.zeros(1, np.int64), np.empty(0, int)
        of = top["Steps"]
        of.attrs["NSteps"] = steps
        of["Values"], of["PointOffsets"] = times, np.arange(steps) * count
        of["PartOffsets"], of["NumberOfParts"] = np.zeros(steps, np.int64), np.ones(steps, int)
        of["CellOffsets"] = of["ConnectivityIdOffsets"] = np.zeros((steps, 4), np.int64)
        root.flush()
        image = root.id.get_file_image()
    with whole(path.with_suffix(".vtkhdf")) as file:
        file.write(image)
