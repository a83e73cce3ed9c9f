"""Triaxial tests: single contacts and lattices in closed form, bonds that break, bad input."""

from dataclasses import replace

import numpy as np
import pytest
from test_elastic import R, random_pack, simple_cubic

from fdnet.errors import CaseError, MechanicsError
from fdnet.mechanics.elastic import elastic_of
from fdnet.mechanics.springs import Cement, PackMaterial, young_along
from fdnet.mechanics.triaxial import (
    SHEAR,
    SOUND,
    TENSION,
    Load,
    Triaxial,
    at_rest,
    balance,
    carried_out,
    loaded_pack,
    overloaded,
    triaxial,
)
from fdnet.spheres.snapshot import resting

ALL = (True, True, True)
SAND = PackMaterial(normal=5e7, shear=2e7, friction=0.5)
SIDE = 2 * R


def column():
    """Four grains along x in a periodic box: a ring of contacts, free sideways."""
    place = np.column_stack([(2 * np.arange(4) + 1) * R, np.full(4, 2 * R), np.full(4, 2 * R)])
    return resting(place, R, np.array([[0, 8 * R], [0, 4 * R], [0, 4 * R]]))


def strained(pack, material, strain, stress=0.0):
    loaded = loaded_pack(pack, replace(material, glued=False), ALL)
    load = Load(strain=np.array(strain), stress=np.full(3, stress), drag=1e-3, within=1e-12)
    motion, given, _ = balance(loaded, load)
    return loaded, *carried_out(loaded, motion, given)


def test_a_contact_opens_and_pulls_nothing():
    pack = at_rest(column(), SAND, ALL, relieved=True)
    _, pushed, forces = strained(pack, SAND, [-1e-4, 0, 0])
    assert forces.normal.max() == pytest.approx(5e7 * 1e-4 * SIDE, rel=1e-6)
    _, _, forces = strained(pushed, SAND, [3e-4, 0, 0])
    assert forces.normal.max() == 0


def test_bonds_break_in_tension_at_their_strength():
    """A straight pull: stress = kn * (strain times length), whatever the area of the disc."""
    cement = Cement(
        radius_ratio=0.5, normal=1e14, shear=1e14, tensile_strength=1e7, shear_strength=1e9
    )
    material = replace(SAND, cement=cement)
    pack = at_rest(column(), material, ALL, relieved=True)
    at_strength = 1e7 / (1e14 * SIDE)
    for share in (0.99, 1.01):
        loaded, _, forces = strained(pack, material, [share * at_strength, 0, 0])
        ratio, how = overloaded(loaded, forces)
        assert ratio.max() == pytest.approx(share, rel=1e-3)
        assert how[np.argmax(ratio)] == TENSION
    assert np.all(pack.memory.broken == SOUND)


def test_a_bond_twisted_beyond_its_shear_strength_breaks_in_shear():
    from fdnet.mechanics.springs import bond_stress, disc_radius

    cement = Cement(radius_ratio=0.5, normal=1e14, shear=1e14)
    loaded = loaded_pack(
        at_rest(column(), replace(SAND, cement=cement), ALL, relieved=True),
        replace(SAND, cement=cement),
        ALL,
    )
    disc = disc_radius(loaded.joints, replace(SAND, cement=cement))
    force = np.zeros((len(loaded.joints), 6))
    force[:, 3] = 1e-6
    tension, shear = bond_stress(force, disc)
    assert shear[0] == pytest.approx(2 * 1e-6 / (np.pi * (R / 2) ** 3), rel=1e-12)
    assert tension[0] == 0
    assert SHEAR != TENSION


def test_a_simple_cubic_lattice_bears_an_oedometer_as_its_springs():
    """Axial stress kn / a times the strain; the sides keep the confining stress."""
    test = Triaxial(confining=1e6, strain=1e-4, steps=2, sides=False, tolerance=1e-4)
    result = triaxial(simple_cubic(), SAND, test, periodic=ALL)
    last = result.rows[-1]
    assert last.axial - 1e6 == pytest.approx(5e7 / SIDE * 1e-4, rel=1e-3)
    assert last.side == pytest.approx(1e6, rel=1e-3)
    assert result.restless == 0


def test_a_bonded_pack_starts_with_the_young_modulus_of_the_sparse_solve():
    """Bonds without friction or opening are linear: two methods, one answer."""
    cement = Cement(radius_ratio=0.7, normal=5e13, shear=2e13)
    material = PackMaterial(normal=5e7, shear=2e7, friction=1e3, cement=cement)
    pack = random_pack(count=60)
    test = Triaxial(confining=5e6, strain=1e-5, steps=1, tolerance=1e-5)
    result = triaxial(pack, material, test, periodic=ALL)
    along = young_along(elastic_of(pack, material, periodic=ALL).tensor)
    assert result.young == pytest.approx(along[0], rel=0.05)


def test_dense_sand_yields_at_the_ratio_of_its_friction():
    """Axial over side stress of frictional spheres at yield: 1.5 to 4; more friction, more."""
    test = Triaxial(confining=5e6, strain=1.5e-3, steps=3, tolerance=0.03)
    peaks = [
        triaxial(random_pack(count=40), replace(SAND, friction=mu), test, periodic=ALL).peak
        for mu in (0.1, 0.5)
    ]
    low, high = (peak.axial / peak.side for peak in peaks)
    assert 1.2 < low < 0.9 * high < 4.0


def test_a_stress_beyond_the_springs_is_refused():
    with pytest.raises(CaseError, match="expected at most 5 %"):
        triaxial(random_pack(count=60), SAND, Triaxial(confining=5e10), periodic=ALL)


def test_a_pack_without_contacts_is_refused():
    far = resting(column().position, 0.8 * R, column().box)
    with pytest.raises(MechanicsError, match="has no contacts"):
        triaxial(far, SAND, Triaxial(confining=1e6), periodic=ALL)


def test_a_pack_that_falls_apart_under_its_stress_is_refused_with_advice():
    """Walls along x only, no bonds, and overlaps as compressed springs: nothing holds it."""
    rng = np.random.default_rng(4)
    box = np.array([[0, 6.6], [0, 4.2], [0, 4.8]]) * R
    pack = resting(rng.random((26, 3)) * box[:, 1], R, box)
    test = Triaxial(confining=1.7e6, strain=1e-4, steps=2, rests=20, relieved=False)
    with pytest.raises(MechanicsError, match=r"falls apart under 1\.7e\+06 Pa.*take a denser pack"):
        triaxial(pack, replace(SAND, friction=0.1), test, periodic=(False, True, True))
