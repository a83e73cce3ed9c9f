"""What is out of the ordinary is counted by stated rules."""

import numpy as np
import pytest

from fdnet.network.network import build_network
from fdnet.spheres.geometry import measure_porosity
from tests.network.packs import body_centred, face_centred, random_pack, simple_cubic
from validation.truth import read_pack

ALL = (True,) * 3


@pytest.mark.parametrize(
    ("pack", "groups"),
    [(simple_cubic(), 27), (face_centred(), 27 * 4), (body_centred(), 0)],
    ids=["SC", "FCC", "BCC"],
)
def test_cospherical_groups_are_the_cells_of_the_lattice(pack, groups):
    """One cube per grain of SC, one octahedron per grain of FCC; BCC has none."""
    assert build_network(pack, periodic=ALL).counts["cospherical_groups"] == groups


def test_random_packs_have_no_slivers_unless_walls_cut_them():
    pack = random_pack(100)
    assert build_network(pack, periodic=ALL).counts["slivers"] == 0
    assert build_network(pack, periodic=(True, False, True), walls="slip").counts["slivers"] > 0


@pytest.mark.parametrize("name", ["packE_80_eps30", "packG_100_radii12_eps38"])
def test_void_of_truth_packs_is_their_porosity(name):
    pack = read_pack(name)
    network = build_network(pack, periodic=ALL)
    porosity = measure_porosity(pack, periodic=ALL, lines=20_000)
    void = network.pore_volume.sum() / np.prod(pack.box[:, 1])
    assert void == pytest.approx(porosity.mean, abs=5 * porosity.standard_error + 1e-5)


def test_overlapping_grains_are_counted_by_throat():
    counts = build_network(read_pack("packE_80_eps30"), periodic=ALL).counts
    assert counts["throats_overlapping"] > 100
    touching = build_network(simple_cubic(), periodic=ALL).counts
    assert touching["throats_overlapping"] == 0
