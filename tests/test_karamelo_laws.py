"""Johnson and Cook without a rate, as scripts for Karamelo write it: epsdot0 = 0 where C = 0."""

import pytest
from scenes import block

SHEAR = [
    "fix(v, initial_velocity_particles, all, 10*(y0 - 0.4), 0)", "set_dt(1e-4)",
    "compute(e, max_plastic_strain, all)", "compute(W, dissipated_energy, all)",
    "log_modify(custom, step, e_Epmax, W)", "run(20)",
]  # fmt: skip


def scene(rate, C, d4="0", damage_rate="1"):
    parts = "\n".join([
        "eos(e, linear, 2, 100)",
        f"strength(s, johnson_cook, 40, 0.1, 1, 0.5, {rate}, {C}, 0, 0, 1)",
        f"damage(d, damage_johnson_cook, 5, 0, 0, {d4}, 0, {damage_rate}, 0, 1)",
        "material(rubber, eos-strength, e, s, d)",
    ])  # fmt: skip
    return block(2, *SHEAR).replace("material(rubber, linear, 2, 100, 0.3)", parts)


def test_a_rate_that_takes_no_part_may_be_zero(run_interpreted):
    """Bit for bit what any other rate gives."""
    logs = [
        run_interpreted(scene(rate, 0, 0, damage)).log for rate, damage in (("0", "0"), ("7", "3"))
    ]
    assert logs[0].e_Epmax[-1] > 0
    assert (logs[0].e_Epmax == logs[1].e_Epmax).all()
    assert (logs[0].W == logs[1].W).all()


@pytest.mark.parametrize(
    ("rates", "says"),
    [(("0", 0.1), "a number above 0, or C = 0"), (("1", 0, "0.2", "0"), "d4 = 0.2")],
)
def test_a_rate_that_takes_part_is_above_zero(run_interpreted, rates, says):
    assert says in run_interpreted(scene(*rates), status=1).err
