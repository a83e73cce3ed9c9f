"""Elastic tensors of packs: lattices in closed form, bounds, units and numbering."""

import numpy as np
import pytest

from fdnet.errors import MechanicsError
from fdnet.mechanics.elastic import elastic_of
from fdnet.mechanics.springs import (
    Cement,
    Moduli,
    PackMaterial,
    anisotropy_of,
    direct_solver,
    iterative_solver,
    voigt_average,
    young_along,
)
from fdnet.spheres.snapshot import resting

R = 0.3e-3
ALL = (True, True, True)
SPRINGS = PackMaterial(normal=3e6, shear=1e6)


def lattice(basis, side, cells):
    corner = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), -1).reshape(-1, 3)
    place = (corner[:, None] + np.array(basis)[None]).reshape(-1, 3) * side
    return resting(place, np.full(len(place), R), np.array([[0, cells * side]] * 3))


def simple_cubic():
    return lattice([[0, 0, 0]], 2 * R, 4)


def face_centred():
    return lattice([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]], 8**0.5 * R, 3)


def random_pack(seed=5, count=150):
    """Centres pushed apart by hand until most of them touch; no law of fdnet is used."""
    rng = np.random.default_rng(seed)
    side = (count * 4 / 3 * np.pi / 0.66) ** (1 / 3)
    place = rng.random((count, 3)) * side
    for _ in range(300):
        apart = place[:, None] - place[None]
        apart -= side * np.round(apart / side)
        gap = np.linalg.norm(apart, axis=2) + 10 * np.eye(count)
        push = np.where(gap < 2, (2 - gap) / gap, 0.0)
        place += 0.3 * np.einsum("ij,ijk->ik", push, apart)
    return resting(place * R, np.full(count, R), np.array([[0, side * R]] * 3))


def test_a_simple_cubic_lattice_in_closed_form():
    """C11 = kn / a, C12 = 0, C44 = ks / 2a, with the side a = 2 R."""
    tensor = elastic_of(simple_cubic(), SPRINGS, periodic=ALL).tensor * 2 * R
    expected = np.diag([3e6] * 3 + [0.5e6] * 3)
    assert np.allclose(tensor, expected, rtol=0, atol=1e-6 * 3e6)


def test_a_face_centred_lattice_in_closed_form():
    """C11 = kn + ks, C12 = (kn - ks) / 2, C44 = (kn + ks) / 2, over sqrt(2) R."""
    tensor = elastic_of(face_centred(), SPRINGS, periodic=ALL).tensor * 2**0.5 * R
    assert tensor[0, 0] == pytest.approx(4e6, rel=1e-8)
    assert tensor[0, 1] == pytest.approx(1e6, rel=1e-8)
    assert tensor[3, 3] == pytest.approx(2e6, rel=1e-8)


def test_bonds_stiffen_a_simple_cubic_lattice_by_their_discs():
    cement = Cement(radius_ratio=0.5, normal=8e13, shear=2e13)
    material = PackMaterial(normal=3e6, shear=1e6, cement=cement)
    area = np.pi * (0.5 * R) ** 2
    tensor = elastic_of(simple_cubic(), material, periodic=ALL).tensor * 2 * R
    assert tensor[0, 0] == pytest.approx(3e6 + 8e13 * area, rel=1e-8)
    assert tensor[3, 3] == pytest.approx((1e6 + 2e13 * area) / 2, rel=1e-8)


def test_plates_carry_a_column_as_its_springs_in_series():
    """Six grains and two plates are seven springs in series; the sides hang free of it."""
    place = np.column_stack([(2 * np.arange(6) + 1) * R, np.full(6, R), np.full(6, R)])
    box = np.array([[0, 12 * R], [0, 2 * R], [0, 2 * R]])
    smooth = PackMaterial(normal=3e6, shear=1e-3)
    tensor = elastic_of(resting(place, R, box), smooth, periodic=(False,) * 3).tensor
    assert tensor[0, 0] == pytest.approx(3e6 / 7 * 12 * R / (4 * R**2), rel=1e-6)


def test_a_random_pack_is_softer_than_its_affine_bound():
    result = elastic_of(random_pack(), SPRINGS, periodic=ALL)
    assert np.linalg.eigvalsh(result.affine - result.tensor).min() > -1e-6 * result.affine[0, 0]
    assert 0.2 < result.averaged.shear / result.affine_averaged.shear < 0.9
    assert np.linalg.eigvalsh(result.tensor).min() > 0


def test_numbering_and_units_do_not_matter():
    pack = random_pack()
    first = elastic_of(pack, SPRINGS, periodic=ALL).tensor
    order = np.random.default_rng(0).permutation(len(pack))
    moved = (pack.position[order] + [3e-4, -2e-4, 1e-4]) % pack.box[:, 1]
    again = resting(moved, pack.radius[order], pack.box)
    other = resting(pack.position * 1e3, pack.radius * 1e3, pack.box * 1e3)
    largest = first.max()
    renumbered = elastic_of(again, SPRINGS, periodic=ALL).tensor
    assert np.allclose(renumbered, first, rtol=0, atol=1e-6 * largest)
    in_mm = elastic_of(other, PackMaterial(normal=3e3, shear=1e3), periodic=ALL).tensor * 1e6
    assert np.allclose(in_mm, first, rtol=0, atol=1e-6 * largest)


def test_the_two_solvers_agree():
    from fdnet.mechanics.elastic import carrying
    from fdnet.mechanics.springs import contact_springs, kinematics, stiffness_matrix

    pack = random_pack()
    joints, kept = carrying(pack, SPRINGS, ALL)
    maps = kinematics(joints, len(pack), length=R)
    springs = contact_springs(joints, SPRINGS)
    live = maps.of_grains[:, np.flatnonzero(np.repeat(kept, 6))]
    load = live.T @ (springs.ravel() * maps.of_strain[:, 0])
    matrix = stiffness_matrix(live, springs)
    one, other = direct_solver(matrix)(load), iterative_solver(matrix)(load)
    assert load @ one == pytest.approx(load @ other, rel=1e-8)


def test_a_grain_with_one_contact_is_a_rattler():
    pack = face_centred()
    place = np.vstack([pack.position, pack.position[0] + [0.1 * R, 0, 0]])
    radius = np.append(pack.radius, 0.05 * R)
    result = elastic_of(resting(place[:-1], radius[:-1], pack.box), SPRINGS, periodic=ALL)
    assert (result.rattlers, result.coordination) == (0, 12)
    loose = resting(place, radius, pack.box)
    assert elastic_of(loose, SPRINGS, periodic=ALL).rattlers == 1


def test_a_layer_that_touches_nothing_is_refused_by_its_axis():
    place = simple_cubic().position
    layer = place[place[:, 2] < R]
    pack = resting(layer, R, np.array([[0, 8 * R], [0, 8 * R], [0, 16 * R]]))
    with pytest.raises(MechanicsError, match="no load along z"):
        elastic_of(pack, SPRINGS, periodic=ALL)


def test_constants_of_a_cubic_tensor():
    """Hill (1952): K = (C11 + 2 C12) / 3, G_V = (C11 - C12 + 3 C44) / 5; E along an axis."""
    tensor = np.zeros((6, 6))
    tensor[:3, :3] = 5.0
    tensor[[0, 1, 2], [0, 1, 2]] = 11.0
    tensor[[3, 4, 5], [3, 4, 5]] = 4.0
    averaged = voigt_average(tensor)
    assert (averaged.bulk, averaged.shear) == (pytest.approx(7.0), pytest.approx(3.6))
    assert young_along(tensor)[0] == pytest.approx(6 * 21 / 16)
    reuss = 5 / (2 * 2 / 6 + 3 / 4)
    assert anisotropy_of(tensor) == pytest.approx(5 * 3.6 / reuss - 5)
    assert Moduli(7.0, 3.6).young == pytest.approx(9 * 7 * 3.6 / (21 + 3.6))
