"""Steps against the reference step of the documentation, which is written from the equations."""

import numpy as np
import pytest
from reference_step import Body, linear, quadratic, step, stress, vibrating_bar
from scenes import H, block
from states import final_columns

from comparisons.vibrating_bar import frequency

BASES = {"linear": linear, "quadratic-spline": quadratic}
COMPONENTS = ("s11", "s22", "s33", "s12", "s13", "s23")
PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
VELOCITY = ("1.5 + sin(9*x0)", "0.5*cos(7*x0 + 8*y0)", "0.4*sin(6*z0 - 9*x0)")
DT, SHARE, STEPS = 0.006, 0.98, 8
COLUMNS = [*"xyz", "vx", "vy", "vz", *COMPONENTS, "x0", "y0", "z0"]


def script(d: int, basis: str) -> str:
    """A stretching block that flies, two cells and more from all walls."""
    text = block(
        d,
        f"fix(v, initial_velocity_particles, all, {', '.join(VELOCITY[:d])})",
        f"set_dt({DT})",
        f"run({STEPS})",
        law="neo-hookean",
        size=(0.3, 0.2, 0.1) if d < 3 else (0.2, 0.1, 0.1),
    )
    return text.replace("FLIP, linear, 1", f"FLIP, {basis}, {SHARE}")


def expected(d: int, basis: str, places: np.ndarray) -> Body:
    """The same block by the reference step."""
    # Nodes around the block, as many as it can reach.
    axes = [H * np.arange(1, 10)] * d
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, d)
    x, y, z = np.pad(places, ((0, 0), (0, 3 - d))).T
    formulas = {"sin": np.sin, "cos": np.cos, "x0": x, "y0": y, "z0": z}
    v = np.column_stack([eval(text, formulas) for text in VELOCITY[:d]])
    n, volume = len(places), (H / 2) ** d
    young, nu = 100.0, 0.3
    body = Body(
        x=places.copy(),
        v=v,
        F=np.tile(np.eye(d), (n, 1, 1)),
        m=np.full(n, 2 * volume),
        V=np.full(n, volume),
        lam=young * nu / ((1 + nu) * (1 - 2 * nu)),
        G=young / (2 * (1 + nu)),
    )
    for _ in range(STEPS):
        body = step(body, nodes, H, DT, BASES[basis], SHARE)
    return body


def check(found: dict[str, np.ndarray], d: int, basis: str) -> None:
    """To round-off: some 1e-16 of E in the stress and of 1 in the others, each step."""

    def vectors(*names):
        return np.column_stack([found[name] for name in names[:d]])

    start = vectors("x0", "y0", "z0")
    body = expected(d, basis, start)
    crossed = np.floor(body.x / H) != np.floor(start / H)
    assert crossed.any()
    assert np.abs(body.x - vectors("x", "y", "z")).max() < 1e-14
    assert np.abs(body.v - vectors("vx", "vy", "vz")).max() < 1e-13
    sigma, _ = stress(body)
    assert np.abs(sigma).max() > 1
    for name, (i, j) in zip(COMPONENTS, PLACES, strict=True):
        if max(i, j) < d:
            assert np.abs(sigma[:, i, j] - found[name]).max() < 1e-11, name


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("basis", BASES)
def test_interpreted(state_interpreted, d, basis):
    """All dimensions with both bases."""
    check(state_interpreted(script(d, basis), *COLUMNS), d, basis)


@pytest.mark.parametrize(
    "d, basis",
    [
        (2, "linear"),
        *(
            pytest.param(d, basis, marks=pytest.mark.full)
            for d in (1, 2, 3)
            for basis in BASES
            if (d, basis) != (2, "linear")
        ),
    ],
)
@pytest.mark.xdist_group("neo-hookean")
def test_compiled(tmp_path, d, basis):
    """Contracted products and sums change the last bits only."""
    path = tmp_path / "in.script"
    path.write_text(script(d, basis), encoding="utf-8")
    check(final_columns(path, COLUMNS), d, basis)


def test_frequency_of_the_reference_step():
    """Of a free bar, pi c / L, as the page says; lumped hats are slow by (k h)^2 / 24 = 1e-3."""
    times, shares = vibrating_bar(periods=3)
    assert frequency(times, shares) == pytest.approx(10 * np.pi, rel=0.005)
