"""Small scenes for tests of the engine, as scripts."""

TRANSFERS = {
    "PIC": "PIC, linear",
    "FLIP": "FLIP, linear, 1",
    "FLIP 0.9": "FLIP, linear, 0.9",
    "APIC": "APIC, quadratic-spline",
    "AFLIP": "AFLIP, quadratic-spline, 1",
    "ASFLIP": "ASFLIP, quadratic-spline, 1",
    "MLS": "MLS, quadratic-spline",
    "TPIC": "TPIC, quadratic-spline",
    "XPIC": "XPIC, quadratic-spline, 3",
    "TFLIP": "FLIP, quadratic-spline, 1, gradient-enhanced",
    "FLIP quadratic": "FLIP, quadratic-spline, 1",
    "FLIP cubic": "FLIP, cubic-spline, 1",
}
SCHEMES = ["musl", "usl", "usf", "usavg"]
LAWS = {
    "linear": "linear, 2, 100, 0.3",
    "rate=none": "linear, 2, 100, 0.3, rate=none",
    "neo-hookean": "neo-hookean, 2, 100, 0.3",
    "soft": "linear, 2, 1, 0.3",
}
H = 0.1


def block(
    d: int,
    *lines: str,
    transfer: str = "FLIP",
    scheme: str = "musl",
    law: str = "linear",
    ppc: int = 2,
    size: tuple[float, ...] = (0.3, 0.2, 0.1),
) -> str:
    """A block of `size` with its lower corner at 0.3 in a domain of side 1.2, and more `lines`.

    E = 100, nu = 0.3, rho = 2; cells of 0.1 with `ppc` points per direction. In 3D the domain ends
    0.4 from the block: interpreted steps go through every node near it.
    """
    domain = ", ".join(f"0, {0.7 + size[k]:g}" if d == 3 else "0, 1.2" for k in range(d))
    extent = ", ".join(f"0.3, {0.3 + size[k]}" for k in range(d))
    head = [
        f"method(ulmpm, {TRANSFERS[transfer]})",
        f"scheme({scheme})",
        f"dimension({d}, {domain}, {H})",
        f"region(box, block, {extent})",
        f"material(rubber, {LAWS[law]})",
        f"solid(body, region, box, {ppc}, rubber, {H}, 0)",
    ]
    return "\n".join([*head, *lines]) + "\n"
