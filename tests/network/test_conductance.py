"""Conductance laws against closed forms, and k against resolved Stokes flow in lattices."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from fdnet.network import geometry
from fdnet.network.flow.flow import solve_flow
from fdnet.network.laws.named import LAWS
from fdnet.network.laws.pyramids import _foot_angles
from fdnet.network.network import build_network
from tests.network.packs import body_centred, face_centred, random_pack, simple_cubic

ALL = (True,) * 3


def permeability(pack, law, periodic=ALL):
    network = build_network(pack, periodic=periodic, walls="slip")
    flow = solve_flow(network, LAWS[law](network))
    return flow.inflow * (pack.box[0, 1] - pack.box[0, 0]) / network.area


def zick_homsy(solid, drag):
    """k of spheres of radius 1 from the drag coefficient K: k = 2 / (9 c K)."""
    return 2 / (9 * solid * drag)


@pytest.mark.parametrize(("law", "ratio"), [("series", 1.07), ("hydraulic", 0.97)])
def test_touching_simple_cubic_against_stokes(law, ratio):
    measured = permeability(simple_cubic(), law) / zick_homsy(np.pi / 6, 42.1)
    assert measured == pytest.approx(
        ratio, abs=0.015
    )  # ratios measured apart, by another code of these rules


@pytest.mark.parametrize(
    ("law", "ratio"),
    [("series", 1.00), ("hydraulic", 1.02), ("thesis", 0.27), ("effective", 1.04)],
)
def test_touching_body_centred_against_stokes(law, ratio):
    measured = permeability(body_centred(), law) / zick_homsy(np.pi * np.sqrt(3) / 8, 162.9)
    assert measured == pytest.approx(ratio, abs=0.015)


@pytest.mark.parametrize(("law", "ratio"), [("series", 1.38), ("hydraulic", 0.92)])
def test_touching_face_centred_against_stokes(law, ratio):
    measured = permeability(face_centred(), law) / zick_homsy(np.pi / np.sqrt(18), 435.0)
    assert measured == pytest.approx(ratio, abs=0.015)


@pytest.mark.parametrize(("solid", "drag", "ratio"), [(0.343, 15.4, 1.97), (0.45, 28.1, 1.36)])
def test_loose_simple_cubic_shows_the_known_excess_of_the_hydraulic_law(solid, drag, ratio):
    pack = simple_cubic(edge=(4 / 3 * np.pi / solid) ** (1 / 3))
    assert permeability(pack, "hydraulic") / zick_homsy(solid, drag) == pytest.approx(
        ratio, abs=0.02
    )


def test_body_centred_throat_by_the_formulas_on_paper():
    """Every facet of the BCC tetrahedra has sides 2, 2, 4/sqrt(3) in units of the radius."""
    network = build_network(body_centred(), periodic=ALL)
    long = 4 / np.sqrt(3)
    height = np.sqrt(4 - long**2 / 4)
    area = long * height / 2
    circle = 4 * long / (4 * area)
    assert network.throat_radius == pytest.approx(circle - 1, rel=1e-6)
    assert network.throat_area == pytest.approx(area - np.pi / 2, rel=1e-6)
    assert network.throat_length == pytest.approx(np.sqrt(2 / 3), rel=1e-5)
    assert LAWS["thesis"](network) == pytest.approx(
        np.pi * (circle - 1) ** 4 / (8 * np.sqrt(2 / 3)), rel=1e-4
    )
    effective = np.sqrt((area - np.pi / 2) / np.pi)
    assert LAWS["effective"](network) == pytest.approx(
        np.pi * effective**4 / (8 * np.sqrt(2 / 3)), rel=1e-4
    )

    def resistance(z):
        inscribed = circle - np.sqrt(1 - z**2)
        mean = 0.35 * inscribed + 0.65 * np.sqrt((area - np.pi * (1 - z**2) / 2) / np.pi)
        return 8 / (np.pi * mean**4)

    half = np.sqrt(2 / 3) / 2
    assert LAWS["series"](network) == pytest.approx(1 / quad(resistance, -half, half)[0], rel=1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_closed_throats_conduct_nothing_in_any_law(law):
    pack = random_pack(60)
    network = build_network(
        replace(pack, radius=pack.radius * 1.25),
        periodic=ALL,
    )
    closed = network.throat_radius == 0
    conductance = LAWS[law](network)
    assert closed.any()
    assert np.all(conductance[closed] == 0)
    assert np.all(np.isfinite(conductance) & (conductance >= 0))


@pytest.mark.parametrize("spread", [0.0, 0.33])
def test_pyramids_to_the_power_centres_take_up_every_grain_once(spread):
    """Their solid angles at a grain add up to 4 pi, so all facets have the same apexes."""
    pack = random_pack(80, spread=spread)
    network = build_network(pack, periodic=ALL)
    base = geometry.flat(network.throat_corner)
    middle = geometry.power_centre(base, network.throat_corner_radius)[0]
    angle = sum(_foot_angles(base, middle, network.throat_heights[:, side]) for side in (0, 1))
    whole = np.bincount(network.throat_grains.ravel(), weights=np.asarray(angle).ravel())
    assert whole == pytest.approx(np.full(len(pack), 4 * np.pi), rel=1e-6)
