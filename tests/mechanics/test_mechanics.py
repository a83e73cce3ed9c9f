"""Bonds, elastic tensors and triaxial tests: beams, lattices in closed form, bounds, units."""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.errors import MechanicsError
from fdnet.mechanics import triaxial as loading
from fdnet.mechanics.elastic import elastic_of, voigt_average
from fdnet.mechanics.springs import (
    Cement,
    PackMaterial,
    bond_springs,
    bond_stress,
    disc_radius,
    find_joints,
    kinematics,
    solver_of,
    stiffness_matrix,
)
from fdnet.mechanics.triaxial import Triaxial, triaxial
from fdnet.spheres.snapshot import resting
from tests.network import packs

R = 0.3e-3
ALL, NONE = (True, True, True), (False, False, False)
SPRINGS = PackMaterial(normal=3e6, shear=1e6)
SAND = PackMaterial(normal=5e7, shear=2e7, friction=0.5)


def random_pack(count=150):
    """Centres pushed apart by hand until most of them touch; no law of fdnet is used."""
    side = (count * 4 / 3 * np.pi / 0.66) ** (1 / 3)
    place = np.random.default_rng(5).random((count, 3)) * side
    for _ in range(300):
        apart = place[:, None] - place[None]
        apart -= side * np.round(apart / side)
        gap = np.linalg.norm(apart, axis=2) + 10 * np.eye(count)
        push = np.where(gap < 2, (2 - gap) / gap, 0.0)
        place += 0.3 * np.einsum("ij,ijk->ik", push, apart)
    return resting(place * R, np.full(count, R), np.array([[0, side * R]] * 3))


# ---- One bond, by the theory of beams.
def test_a_bond_under_tension_shear_bending_and_torsion():
    """The first grain is held, loads act on the second, with the lever R2 about the bond."""
    r1, r2, force, moment = 0.3e-3, 0.2e-3, 0.7, 2e-5
    cement = Cement(radius_ratio=0.5, normal=9e13, shear=4e13)
    material, rim = PackMaterial(normal=1.0, shear=1.0, cement=cement), 0.5 * r2
    area, bending, twist = np.pi * rim**2, np.pi * rim**4 / 4, np.pi * rim**4 / 2

    def loaded(axis, push, turn):
        """Displacement and rotation of the second grain, tension and shear in the bond."""
        place = 1e-3 + np.array([np.zeros(3), (r1 + r2) * axis])
        pair = resting(place, np.array([r1, r2]), np.array([[0, 2e-3]] * 3))
        joints = find_joints(pair, ALL, gap=0.01)
        springs, free = bond_springs(joints, material), kinematics(joints, 2, length=r1)
        free = free.of_grains[:, 6:]
        motion = solver_of(stiffness_matrix(free, springs))(np.concatenate([push, turn / r1]))
        inner = (springs.ravel() * (free @ motion)).reshape(-1, 6)
        tension, shear = bond_stress(inner, disc_radius(joints, material))
        return motion[:3], motion[3:] / r1, tension[0], shear[0]

    x, y, none, skew = *np.eye(3)[:2], np.zeros(3), np.array([2.0, 3.0, 6.0]) / 7
    moved, turned, tension, shear = loaded(skew, force * skew, none)
    assert moved == pytest.approx(force / (cement.normal * area) * skew, rel=1e-7)
    assert np.abs(turned).max() < 1e-9
    assert tension == pytest.approx(force / area, rel=1e-7)
    assert shear == pytest.approx(0.0, abs=1e-6 * tension)
    assert loaded(x, -force * x, none)[2] == pytest.approx(-force / area, rel=1e-7)
    moved, turned, tension, shear = loaded(x, force * y, none)
    angle = force * r2 / (cement.normal * bending)
    assert moved[1] == pytest.approx(force / (cement.shear * area) + angle * r2, rel=1e-7)
    assert turned[2] == pytest.approx(angle, rel=1e-7)
    assert tension == pytest.approx(force * r2 * rim / bending, rel=1e-7)
    assert shear == pytest.approx(force / area, rel=1e-7)
    moved, turned, tension, shear = loaded(x, none, moment * y)
    assert turned[1] == pytest.approx(moment / (cement.normal * bending), rel=1e-7)
    assert moved[2] == pytest.approx(-turned[1] * r2, rel=1e-7)
    assert tension == pytest.approx(moment * rim / bending, rel=1e-7)
    assert shear == pytest.approx(0.0, abs=1e-6 * tension)
    _, turned, tension, shear = loaded(skew, none, moment * skew)
    assert turned == pytest.approx(moment / (cement.shear * twist) * skew, rel=1e-7)
    assert shear == pytest.approx(moment * rim / twist, rel=1e-7)
    assert tension == pytest.approx(0.0, abs=1e-6 * shear)


# ---- Elastic tensors.
def test_lattices_in_closed_form():
    """Simple cubic: C11 = kn / a, C12 = 0, C44 = ks / 2a, a = 2 R, and bonds add their discs.

    Face-centred: C11 = kn + ks, C12 = (kn - ks) / 2, C44 = (kn + ks) / 2, over sqrt(2) R.
    """
    tensor = elastic_of(packs.simple_cubic(4, R), SPRINGS, periodic=ALL).tensor * 2 * R
    assert np.allclose(tensor, np.diag([3e6] * 3 + [0.5e6] * 3), rtol=0, atol=1e-6 * 3e6)
    tensor = elastic_of(packs.face_centred(3, R), SPRINGS, periodic=ALL).tensor * 2**0.5 * R
    assert tensor[[0, 0, 3], [0, 1, 3]] == pytest.approx([4e6, 1e6, 2e6], rel=1e-8)
    cement, area = Cement(radius_ratio=0.5, normal=8e13, shear=2e13), np.pi * (0.5 * R) ** 2
    glued = replace(SPRINGS, cement=cement)
    tensor = elastic_of(packs.simple_cubic(4, R), glued, periodic=ALL).tensor * 2 * R
    assert tensor[0, 0] == pytest.approx(3e6 + 8e13 * area, rel=1e-8)
    assert tensor[3, 3] == pytest.approx((1e6 + 2e13 * area) / 2, rel=1e-8)


def test_plates_carry_a_column_as_its_springs_in_series():
    """Six grains and two plates are seven springs in series; the sides hang free of it."""
    place = np.array([[2 * n + 1, 1, 1] for n in range(6)]) * R
    box = np.array([[0, 12 * R], [0, 2 * R], [0, 2 * R]])
    smooth = PackMaterial(normal=3e6, shear=1e-3)
    tensor = elastic_of(resting(place, R, box), smooth, periodic=NONE).tensor
    assert tensor[0, 0] == pytest.approx(3e6 / 7 * 12 * R / (4 * R**2), rel=1e-6)


def test_a_random_pack_is_softer_than_its_affine_bound_in_any_numbering_and_unit():
    pack = random_pack()
    result = elastic_of(pack, SPRINGS, periodic=ALL)
    first, largest = result.tensor, result.tensor.max()
    assert np.linalg.eigvalsh(result.affine - first).min() > -1e-6 * result.affine[0, 0]
    assert 0.2 < result.averaged.shear / voigt_average(result.affine).shear < 0.9
    assert np.linalg.eigvalsh(first).min() > 0
    order = np.random.default_rng(0).permutation(len(pack))
    moved = (pack.position[order] + [3e-4, -2e-4, 1e-4]) % pack.box[:, 1]
    again = resting(moved, pack.radius[order], pack.box)
    renumbered = elastic_of(again, SPRINGS, periodic=ALL).tensor
    assert np.allclose(renumbered, first, rtol=0, atol=1e-6 * largest)
    other = resting(pack.position * 1e3, pack.radius * 1e3, pack.box * 1e3)
    in_mm = elastic_of(other, PackMaterial(normal=3e3, shear=1e3), periodic=ALL).tensor * 1e6
    assert np.allclose(in_mm, first, rtol=0, atol=1e-6 * largest)


def test_rattlers_are_counted_and_a_layer_that_touches_nothing_is_refused_by_its_axis():
    pack = packs.face_centred(3, R)
    result = elastic_of(pack, SPRINGS, periodic=ALL)
    assert (result.rattlers, result.coordination) == (0, 12)
    place = np.vstack([pack.position, pack.position[0] + [0.1 * R, 0, 0]])
    loose = resting(place, np.append(pack.radius, 0.05 * R), pack.box)
    assert elastic_of(loose, SPRINGS, periodic=ALL).rattlers == 1
    place = packs.simple_cubic(4, R).position
    box = np.array([[0, 8 * R], [0, 8 * R], [0, 16 * R]])
    with pytest.raises(MechanicsError, match="no load along z"):
        elastic_of(resting(place[place[:, 2] < R], R, box), SPRINGS, periodic=ALL)


# ---- Triaxial tests.
def test_bonds_break_in_tension_and_shear_at_their_strength():
    """A straight pull of a ring of grains: stress = kn * (strain times length)."""
    strength = {"tensile_strength": 1e7, "shear_strength": 1e9}
    cement = Cement(radius_ratio=0.5, normal=1e14, shear=1e14, **strength)
    material = replace(SAND, cement=cement)
    place = np.array([[2 * n + 1, 2, 2] for n in range(4)]) * R
    box = np.array([[0, 8 * R], [0, 4 * R], [0, 4 * R]])
    pack = loading.at_rest(resting(place, R, box), material, ALL, relieved=True)
    for share in (0.99, 1.01):
        strain = np.array([share * 1e7 / (1e14 * 2 * R), 0, 0])
        loaded = loading.loaded_pack(pack, replace(material, glued=False), ALL)
        load = loading.Load(strain=strain, stress=np.zeros(3), drag=1e-3, within=1e-12)
        _, forces = loading.carried_out(loaded, *loading.balance(loaded, load)[:2])
        ratio, how = loading.overloaded(loaded, forces)
        assert ratio.max() == pytest.approx(share, rel=1e-3)
        assert how[np.argmax(ratio)] == loading.TENSION
    assert np.all(pack.memory.broken == loading.SOUND)
    twist = np.zeros((len(loaded.joints), 6))
    twist[:, 3] = 1e-6
    tension, shear = bond_stress(twist, disc_radius(loaded.joints, material))
    assert shear[0] == pytest.approx(2 * 1e-6 / (np.pi * (R / 2) ** 3), rel=1e-12)
    assert tension[0] == 0


def test_a_simple_cubic_lattice_bears_the_load_as_its_springs():
    """Axial stress kn / a times the strain; the sides keep the confining stress."""
    test = Triaxial(confining=1e6, strain=1e-4, steps=2, tolerance=1e-4)
    result = triaxial(packs.simple_cubic(4, R), SAND, test, periodic=ALL)
    last = result.rows[-1]
    assert last.axial - 1e6 == pytest.approx(5e7 / (2 * R) * 1e-4, rel=1e-3)
    assert last.side == pytest.approx(1e6, rel=1e-3)
    assert result.restless == 0


def test_a_bonded_pack_starts_with_the_young_modulus_of_the_sparse_solve():
    """Bonds without friction or opening are linear: two methods, one answer."""
    cement = Cement(radius_ratio=0.7, normal=5e13, shear=2e13)
    material, pack = replace(SAND, friction=1e3, cement=cement), random_pack(60)
    test = Triaxial(confining=5e6, strain=1e-5, steps=1, tolerance=1e-5)
    along = elastic_of(pack, material, periodic=ALL).young_along
    young = triaxial(pack, material, test, periodic=ALL).young
    assert young == pytest.approx(along[0], rel=0.05)


def test_dense_sand_yields_at_the_ratio_of_its_friction():
    """Axial over side stress of frictional spheres at yield: 1.5 to 4; more friction, more."""
    test, pack = Triaxial(confining=5e6, strain=1.5e-3, steps=3, tolerance=0.03), random_pack(40)
    materials = (replace(SAND, friction=mu) for mu in (0.1, 0.5))
    peaks = [triaxial(pack, one, test, periodic=ALL).peak for one in materials]
    low, high = (peak.axial / peak.side for peak in peaks)
    assert 1.2 < low < 0.9 * high < 4.0


def test_a_pack_that_falls_apart_under_its_stress_is_refused_with_advice():
    """Walls along x only, no bonds, and overlaps as compressed springs: nothing holds it."""
    rng = np.random.default_rng(4)
    box = np.array([[0, 6.6], [0, 4.2], [0, 4.8]]) * R
    pack = resting(rng.random((26, 3)) * box[:, 1], R, box)
    test = Triaxial(confining=1.7e6, strain=1e-4, steps=2, relieved=False)
    with pytest.raises(MechanicsError, match=r"falls apart under 1\.7e\+06 Pa.*a denser pack"):
        triaxial(pack, replace(SAND, friction=0.1), test, periodic=(False, True, True))
