"""Every combination of method, basis, transfer, scheme and kinematics, as a tiny scene."""

from pathlib import Path

import meshio
import numpy as np

TRANSFERS = {
    "PIC": "PIC, {basis}",
    "FLIP": "FLIP, {basis}, 0.98",
    "APIC": "APIC, {basis}",
    "AFLIP": "AFLIP, {basis}, 0.98",
    "ASFLIP": "ASFLIP, {basis}, 0.98",
    "MLS": "MLS, {basis}",
    "TPIC": "TPIC, {basis}",
    "TFLIP": "FLIP, {basis}, 0.98, gradient-enhanced",
    "XPIC": "XPIC, {basis}, 3",
}
SCHEMES = ("musl", "usl", "usf", "usavg")
KINEMATICS = ("line", "plane", "axisymmetric", "spherical", "space")
ROUND = ("axisymmetric", "cylindrical", "spherical")  # masses grow with the radius
PRODUCTS = ("linear", "quadratic-spline", "cubic-spline", "Bernstein-quadratic", "ugimp", "cpgimp")
DOMAINS = ("R4", "Q4", "T3", "R8", "H8", "Tet4")
# Method, basis and option: everything that says which nodes a point sees.
BASES = [
    *((kind, basis, "") for kind in ("ulmpm", "tlmpm", "ulmpm/contacts") for basis in PRODUCTS),
    *(("ulmpm", "cpgimp", variant) for variant in ("det", "diagonal", "stretch", "corners")),
    *((kind, "linear", shape) for kind in ("ulcpdi", "tlcpdi") for shape in DOMAINS),
]
MESHED = {"T3": "triangle", "Tet4": "tetra"}
SPEED = (1.0, 0.5, 0.25)
LO, SIDE = 0.2, 0.1


def fits(kinematics: str, option: str) -> bool:
    """Whether domains of this shape exist with this kinematics."""
    if option in DOMAINS:
        return {"R4": 2, "Q4": 2, "T3": 2}.get(option, 3) == dimension(kinematics)
    return True


def dimension(kinematics: str) -> int:
    """Number of directions."""
    return {"plane": 2, "axisymmetric": 2, "space": 3}.get(kinematics, 1)


def refused(kind: str, basis: str, option: str, transfer: str, scheme: str) -> str:
    """What the message says where the combination is refused; empty where it runs."""
    moves = kind in ("ulmpm", "ulmpm/contacts")
    # D vanishes at nodes, or with a domain that vanishes, and points move through the grid.
    unsteady = moves and (basis in ("linear", "Bernstein-quadratic") or option == "diagonal")
    if transfer in ("APIC", "AFLIP", "ASFLIP", "MLS") and unsteady and scheme != "musl":
        return "is unstable"
    if transfer == "ASFLIP" and kind == "ulcpdi" and option in ("Q4", "H8", "T3", "Tet4"):
        return "moves points faster than the grid"
    return ""


def scene(
    kinematics: str,
    kind: str,
    basis: str,
    option: str,
    transfer: str,
    scheme: str,
    *,
    mesh: Path | None = None,
    law: str = "neo-hookean",
    steps: int = 2,
) -> str:
    """One cell full of points in free flight, stretching: momentum is M times SPEED."""
    d = dimension(kinematics)
    end = ", " + option if option else ""
    # Two cells along x in 1D and 3D, so that points see different nodes; few points in all.
    hi = [LO + SIDE] * d
    centre = LO + SIDE / 2
    velocities = []
    for k, axis in enumerate("xyz"[:d]):
        if kinematics in ROUND:
            velocities.append(("0.5*x0", str(SPEED[1]))[k])
        else:
            velocities.append(f"{SPEED[k]} + 0.5*({axis}0 - {centre})")
    box = ", ".join(f"{LO}, {end_}" for end_ in hi)
    lines = [
        f"method({kind}, {TRANSFERS[transfer].format(basis=basis)}{end})",
        f"scheme({scheme})",
        f"dimension({d}, {', '.join(['0, 0.5'] * d)}, {SIDE})",
    ]
    if kinematics in ROUND:
        lines.append(f"{kinematics}(true)")
    lines.append(f"material(rubber, {law}, 2, 100, 0.3)")
    if mesh is not None:
        lines.append(f'solid(body, mesh, "{mesh}", rubber, {SIDE}, 0)')
    else:
        ppc = 3 if d == 1 else 2
        lines += [
            f"region(box, block, {box})",
            f"solid(body, region, box, {ppc}, rubber, {SIDE}, 0)",
        ]
    lines += [
        f"fix(v, initial_velocity_particles, all, {', '.join(velocities)})",
        "set_dt(0.001)",
        f"run({steps})",
    ]
    return "\n".join(lines) + "\n"


def write_mesh(path: Path, shape: str) -> Path:
    """The same cell as a mesh: two triangles, or the five tetrahedra of a cube."""
    a, b = LO, LO + SIDE
    if shape == "triangle":
        points = np.array([(a, a, 0), (b, a, 0), (b, b, 0), (a, b, 0)])
        cells = [(0, 1, 2), (0, 2, 3)]
    else:
        points = np.array([(x, y, z) for x in (a, b) for y in (a, b) for z in (a, b)])
        cells = [(0, 4, 6, 5), (0, 6, 2, 3), (0, 5, 3, 1), (6, 5, 3, 7), (0, 6, 3, 5)]
    meshio.write_points_cells(path, points, [(shape, np.array(cells))])
    return path
