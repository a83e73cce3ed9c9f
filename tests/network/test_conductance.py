"""Conductance laws against closed forms, and k against resolved Stokes flow in lattices."""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.network.flow.flow import solve_flow
from fdnet.network.laws.named import LAWS
from fdnet.network.network import build_network
from tests.network.packs import body_centred, random_pack

ALL = (True,) * 3


def permeability(pack, law, periodic=ALL):
    network = build_network(pack, periodic=periodic, walls="slip")
    flow = solve_flow(network, LAWS[law](network))
    return flow.inflow * (pack.box[0, 1] - pack.box[0, 0]) / network.area


def zick_homsy(solid, drag):
    """k of spheres of radius 1 from the drag coefficient K: k = 2 / (9 c K)."""
    return 2 / (9 * solid * drag)


@pytest.mark.parametrize(
    ("law", "ratio"),
    [("thesis", 0.27), ("effective", 1.04)],
)
def test_touching_body_centred_against_stokes(law, ratio):
    measured = permeability(body_centred(), law) / zick_homsy(np.pi * np.sqrt(3) / 8, 162.9)
    assert measured == pytest.approx(ratio, abs=0.015)


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
