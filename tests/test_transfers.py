"""Transfers of velocity: definitions, and what they conserve when a point meets the grid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tensors import KINEMATICS, numbers, tensors
from test_basis import LO, fractions, made, place, stencil_of

from karamelo_py.points.basis import affine_weight, reach, support
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.transfers import (
    add_moment,
    add_momentum,
    updated_velocity,
    zero_moment,
)
from karamelo_py.points.transfers.apic import APIC
from karamelo_py.points.transfers.flip import FLIP
from karamelo_py.points.transfers.pic import PIC

every_kinematics = pytest.mark.parametrize("kin", KINEMATICS, ids=lambda kin: type(kin).__name__)
every_transfer = pytest.mark.parametrize(
    "transfer", [PIC(), FLIP(1.0), FLIP(0.4), APIC()], ids=lambda transfer: str(transfer)
)


def test_definitions():
    """v_p = (1 - alpha) v_pic + alpha (v_p + dv); alpha = 0 is PIC (Brackbill & Ruppel 1986)."""
    v, v_pic, dv = (1.0, 2.0), (3.0, 4.0), (0.1, 0.2)
    assert updated_velocity(PIC(), v, v_pic, dv) == v_pic
    assert updated_velocity(APIC(), v, v_pic, dv) == v_pic
    assert updated_velocity(FLIP(1.0), v, v_pic, dv) == pytest.approx((1.1, 2.2))
    assert updated_velocity(FLIP(0.0), v, v_pic, dv) == pytest.approx(v_pic)
    mixed = (0.4 * 1.1 + 0.6 * 3, 0.4 * 2.2 + 0.6 * 4)
    assert updated_velocity(FLIP(0.4), v, v_pic, dv) == pytest.approx(mixed)


def scattered(transfer, kin, x, mass, v, moment):
    """Positions (n, d) and momentum (n, d) of the nodes of a point, and its stencil."""
    domain, basis = made(Linear, kin)
    stencil, nodes, weights, _ = stencil_of(basis, kin, x)
    momentum = [
        add_momentum(
            transfer, kin, basis, stencil, k, weights[k] * mass, mass, v, moment, (0.0,) * len(v)
        )
        for k in range(support(basis, kin))
    ]
    return domain.node_positions()[nodes][:, : kin.dimension], np.array(momentum), basis, stencil


@every_transfer
@every_kinematics
@given(data=st.data())
def test_linear_momentum_is_given_whole(transfer, kin, data):
    """sum_I p_I = m v, whatever the moment of velocity."""
    x = place(kin, data.draw(st.tuples(fractions, fractions, fractions)))
    v = data.draw(numbers(kin.dimension))
    moment = data.draw(tensors(kin)) if transfer.keeps_moment else ()
    _, momentum, _, _ = scattered(transfer, kin, x, 2.5, v, moment)
    assert momentum.sum(axis=0) == pytest.approx(2.5 * np.array(v), abs=1e-12)


@every_kinematics
@given(data=st.data())
def test_apic_gives_its_angular_momentum_whole(kin, data):
    """sum_I (X_I - x) p_I^T = m B^T: the moment arrives at the nodes (Jiang et al. 2017)."""
    x = place(kin, data.draw(st.tuples(fractions, fractions, fractions)))
    d = kin.dimension
    v, moment = data.draw(numbers(d)), data.draw(tensors(kin))
    positions, momentum, _, _ = scattered(APIC(), kin, x, 2.5, v, moment)
    arms = positions - np.array(x)
    assert momentum.T @ arms == pytest.approx(2.5 * np.reshape(moment, (d, d)), abs=1e-12)


@every_kinematics
@given(data=st.data())
def test_apic_takes_an_affine_field_as_it_is(kin, data):
    """From the nodal field v + C (X - x) a point gathers v and B = C D, and gives it back."""
    d = kin.dimension
    inner = st.floats(0.01, 0.99)
    x = place(kin, data.draw(st.tuples(inner, inner, inner)))
    v, c = np.array(data.draw(numbers(d))), np.reshape(data.draw(tensors(kin)), (d, d))
    _, basis = made(Linear, kin)
    stencil, _, weights, _ = stencil_of(basis, kin, x)
    arms = np.array([reach(basis, kin, stencil, k) for k in range(len(weights))])
    field = v + arms @ c.T
    moment = zero_moment(APIC(), kin, 1.0)
    for k, weight in enumerate(weights):
        moment = add_moment(APIC(), kin, basis, stencil, k, weight, tuple(field[k]), moment)
    spread = (weights[:, None] * arms).T @ arms  # D
    assert np.reshape(moment, (d, d)) == pytest.approx(c @ spread, abs=1e-12)
    _, momentum, _, _ = scattered(APIC(), kin, x, 1.0, tuple(v), moment)
    assert momentum == pytest.approx(weights[:, None] * field, abs=1e-12)
    affine = np.array([affine_weight(basis, kin, stencil, k) for k in range(len(weights))])
    assert np.isfinite(affine).all()


@every_kinematics
def test_apic_on_a_node_stays_finite(kin):
    """There D of the hat functions vanishes, but N D^-1 (X - x) does not need its inverse."""
    x = tuple(LO[: kin.dimension])
    moment = tuple(0.1 for _ in range(kin.tensor_size))
    _, momentum, _, _ = scattered(APIC(), kin, x, 1.0, (1.0,) * kin.dimension, moment)
    assert np.isfinite(momentum).all()
