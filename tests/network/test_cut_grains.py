"""Sections at a pressure plane show the discs of the grains that the plane cuts."""

import numpy as np
import pytest

from fdnet import Snapshot, build_network
from fdnet.network.flow.sections import whole_permeability
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.reaching_grains import cut_corners, ray_room, share_of_cut
from fdnet.network.laws.wedges import ratio_table
from fdnet.network.states import cut_out
from tests.network.one_section import from_python, uneven_flux
from tests.network.section_flux import resolved_flux
from validation.truth import read_pack, slabs

ROOM = np.empty((2, 3, 3)), ray_room(0), ratio_table()
BASE = np.array([[0.0, 0.0], [1.0, 0.0], [0.45, 0.85]])
share = from_python(share_of_cut)


@pytest.mark.parametrize(
    ("away", "radius", "stand_in"),
    [((-0.1, -0.05), 0.45, 0.4), ((-0.15, -0.1), 0.5, 0.4), ((0.0, -0.3), 0.5, 0.3)],
)
def test_the_flux_is_that_of_finite_elements(away, radius, stand_in):
    """The disc on the corner is 3 to 38 % off, that of the grain itself at most 3 %."""
    corner, own = np.array([stand_in, 0.4, 0.35]), np.array([radius, 0.4, 0.35])
    cut = np.zeros((3, 4))
    cut[0] = *away, 0.0, radius
    centre = BASE + np.array([away, (0, 0), (0, 0)])
    exact = resolved_flux(BASE, own, centre=centre)
    flux = uneven_flux(BASE, corner, ratio_table())
    left = share(BASE, corner, 0.0, cut, *ROOM)
    assert abs(flux / exact - 1.0) > 0.025
    assert flux * left == pytest.approx(exact, rel=0.03)


def test_the_disc_follows_the_height_above_the_facet():
    """Centre 0.2 above the facet, radius 0.5: at the height 0.5 the disc has the radius 0.4."""
    corner, cut = np.array([0.3, 0.4, 0.35]), np.zeros((3, 4))
    cut[0] = 0.0, 0.0, 0.2, 0.5
    flat = cut.copy()
    flat[0] = 0.0, 0.0, 0.0, 0.4
    there = share(BASE, corner, 0.5, cut, *ROOM)
    assert there == pytest.approx(share(BASE, corner, 0.0, flat, *ROOM), rel=1e-12)
    assert share(BASE, corner, 0.1, cut, *ROOM) < there < 1.0


def test_corners_know_the_grains_that_a_face_cuts():
    """A grain of radius 5 centred 3 beyond the face x = 0, another 1 beyond x = 10."""
    grains = [[-3.0, 5.0, 5.0], [4, 2, 2], [4, 8, 2], [4, 5, 8], [11, 5, 5]]
    spheres = Snapshot.from_arrays(grains, [5.0, 2, 2, 2, 3], box=[0, 10, 0, 10, 0, 10])
    network = build_network(spheres)
    part = slice(0, len(network.throat_pores))
    facet = network.image_position[network.throat_images]
    cut = cut_corners(network, part, facet)
    grain = network.throat_grains
    for which, away, radius in ((0, 3.0, 5.0), (4, 1.0, 3.0)):
        assert np.any(grain == which)
        ways = cut[grain == which]
        assert np.linalg.norm(ways[:, :3], axis=1) == pytest.approx(away, rel=1e-9)
        assert ways[:, 3] == pytest.approx(radius, rel=1e-3)
    assert not cut[(grain != 0) & (grain != 4)].any()


@pytest.mark.parametrize(
    "name", ["slabM_r5_ranges_cake", "slabL_r10", "slabE_r3", "slabQ_r5_mu0_light"]
)
def test_thin_slabs_of_grains_against_stokes(name):
    """Planes that cut caps off grains."""
    slab = next(slabs([name]))
    grains = read_pack(slab.specimen).grains()
    sides = (False, True, True)
    network = build_network(cut_out(grains, slab.planes, sides), periodic=sides)
    k = whole_permeability(network, 1.0 / half_resistances(network).sum(axis=1))[0]
    tolerance = {"slabL_r10": 0.09, "slabM_r5_ranges_cake": 0.07, "slabQ_r5_mu0_light": 0.03}
    assert k == pytest.approx(slab.k0, rel=tolerance.get(name, 0.05))
