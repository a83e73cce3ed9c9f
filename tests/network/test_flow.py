"""Flow through networks small enough to know the answer, and by a second method."""

import numpy as np
import pytest

from fdnet.errors import FlowError
from fdnet.network.flow.flow import solve_flow
from fdnet.network.flow.sections import inplace_permeability, plane_pressures, slab_permeability
from fdnet.network.laws.named import LAWS
from fdnet.network.network import build_network
from tests.network.networks import chain, network_of, random_network
from tests.network.packs import random_pack, snapshot


@pytest.mark.parametrize("count", [1, 2, 7])
def test_chain_of_equal_throats_conducts_g_over_n(count):
    flow = solve_flow(chain(count), np.full(count, 3.0))
    assert flow.inflow == pytest.approx(3.0 / count)
    assert flow.pore_pressure == pytest.approx(1 - np.arange(count + 1) / count)
    assert flow.throat_flux == pytest.approx(3.0 / count)


def test_one_tube_is_poiseuille():
    network = chain(1, step=2.0)
    k = solve_flow(network, LAWS["thesis"](network)).inflow * 2.0 / network.area
    assert k == pytest.approx(np.pi * 0.1**4 / 8)  # pi r^4 / 8 over a unit cross-section


def test_slab_splits_throats_at_its_planes():
    """A chain of unit steps cut from 0.25 to 2.5 conducts g / 2.25."""
    flow = solve_flow(chain(4), np.full(4, 1.0), span=(0.25, 2.5))
    assert flow.inflow == pytest.approx(1 / 2.25)
    assert flow.mass_balance < 1e-12


def test_slab_within_one_throat():
    assert solve_flow(chain(2), np.full(2, 1.0), span=(0.2, 0.6)).inflow == pytest.approx(1 / 0.4)


@pytest.mark.parametrize(
    ("resistances", "carrying"),
    [([1, 1, 1, 1], 4.0), ([1, 3], 16 / 10), ([1, 0, 0, 0], 1.0), ([1, 1, 0], 2.0)],
)
def test_throats_in_series_carry_the_flow_by_their_share_of_the_energy(resistances, carrying):
    g = 1.0 / np.maximum(np.array(resistances, float), 1e-9)
    flow = solve_flow(chain(len(g)), g)
    assert flow.carrying_throats == pytest.approx(carrying)


def test_no_throat_carries_where_nothing_flows():
    assert solve_flow(chain(2), np.array([1.0, 0.0])).carrying_throats == 0.0


def test_random_network_against_the_pseudo_inverse():
    network, g = random_network()
    flow = solve_flow(network, g)
    first, second = network.throat_pores.T
    laplacian = np.zeros((30, 30))
    np.add.at(laplacian, (first, second), -g)
    laplacian += laplacian.T
    np.fill_diagonal(laplacian, -laplacian.sum(axis=1))
    held = np.arange(8)
    inner = np.arange(8, 30)
    pressure = np.append(np.ones(4), np.zeros(4))
    solved = (
        np.linalg.pinv(laplacian[np.ix_(inner, inner)])
        @ -laplacian[np.ix_(inner, held)]
        @ pressure
    )
    inflow = (laplacian @ np.append(pressure, solved))[:4].sum()
    assert flow.inflow == pytest.approx(inflow, rel=1e-7)
    tied = np.isfinite(flow.pore_pressure[8:])
    assert flow.pore_pressure[8:][tied] == pytest.approx(solved[tied], abs=1e-7)
    assert flow.mass_balance < 1e-9


def test_cut_off_pores_are_counted_and_have_no_pressure():
    position = [[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, 2, 0], [0.5, 3, 0]]
    network = network_of(position, [(0, 1), (2, 3), (0, 4)], [[0, 1], [0, 3], [0, 1]])
    flow = solve_flow(network, np.ones(3))
    assert flow.inflow == pytest.approx(1.0)
    assert flow.isolated_pores == 3  # two on their own, one dead end that misses the outlet
    assert np.isnan(flow.pore_pressure[2:]).all()


@pytest.mark.parametrize("blocked", [[0], [1], [0, 1, 2]])
def test_no_open_path_is_zero_with_its_reason(blocked):
    g = np.ones(3)
    g[blocked] = 0.0
    flow = solve_flow(chain(3), g)
    assert flow.inflow == 0.0
    assert "no open path" in flow.reason
    assert flow.mass_balance is None


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.0])
def test_bad_conductance_is_refused_with_its_throat(bad):
    with pytest.raises(FlowError, match="throat 1"):
        solve_flow(chain(3), np.array([1.0, bad, 1.0]))


def test_twelve_decades_with_blocked_throats_still_balance():
    pack = random_pack(120)
    network = build_network(pack, periodic=(False, True, True), walls="slip")
    rng = np.random.default_rng(4)
    g = 10.0 ** rng.uniform(-12, 0, len(network.throat_pores)) * (
        rng.random(len(network.throat_pores)) > 0.25
    )
    flow = solve_flow(network, g)
    assert flow.mass_balance < 1e-6
    assert flow.inflow > 0
    for pore in np.flatnonzero((network.pore_share == 1) & np.isfinite(flow.pore_pressure))[:50]:
        out = flow.throat_flux[network.throat_pores[:, 0] == pore].sum()
        assert out == pytest.approx(
            flow.throat_flux[network.throat_pores[:, 1] == pore].sum(), abs=1e-9 * flow.inflow
        )


def three_in_a_row(pack):
    edge = pack.box[0, 1]
    place = np.vstack([pack.position + np.array([n * edge, 0, 0]) for n in range(3)])
    return snapshot(place, 1.0, pack.box * [[3], [1], [1]])


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("span", [(0.0, 1.0), (0.2, 0.7), (0.0, 0.3)])
def test_slab_of_a_period_is_the_slab_of_the_middle_copy(law, span):
    """Throats across the periodic x face belong to both ends of the box."""
    pack = random_pack(50)
    edge = pack.box[0, 1]
    one = build_network(pack, periodic=(True,) * 3)
    three = build_network(three_in_a_row(pack), periodic=(False, True, True), walls="slip")
    low, high = np.array(span) * edge
    inflow = solve_flow(one, LAWS[law](one), span=(low, high)).inflow
    assert inflow == pytest.approx(
        solve_flow(three, LAWS[law](three), span=(low + edge, high + edge)).inflow, rel=1e-5
    )


def test_period_of_a_pack_is_the_limit_of_many_periods_between_planes():
    """Of three copies in a row between pressure planes the middle one takes the period's flow."""
    pack = random_pack(50)
    edge = pack.box[0, 1]
    one = build_network(pack, periodic=(True,) * 3)
    three = build_network(three_in_a_row(pack), periodic=(False, True, True), walls="slip")
    for law in LAWS.values():
        flow = solve_flow(three, law(three))
        pressure = plane_pressures(three, flow, np.array([edge, 2 * edge]))
        middle = flow.inflow / (pressure[0] - pressure[1])
        assert solve_flow(one, law(one)).inflow == pytest.approx(middle, rel=0.03)


def test_period_without_a_way_round_is_zero():
    network = build_network(random_pack(50), periodic=(True,) * 3)
    g = np.where(network.throat_shift[:, 0] != 0, 0.0, 1.0)  # nothing crosses the x face
    flow = solve_flow(network, g)
    assert flow.inflow == 0.0
    assert "no open path" in flow.reason


@pytest.mark.parametrize(("turns", "inflow"), [((1, 1), 0.0), ((1, 0), 0.5)])
def test_period_across_and_back_is_no_way_round(turns, inflow):
    """Two throats of 1 in parallel that both cross the x face close no loop.

    If one of them does not cross it, they are in series.
    """
    shift = np.array([[turn, 0, 0] for turn in turns])
    network = network_of(
        [[0.2, 0, 0], [0.8, 0, 0]],
        [(0, 1), (0, 1)],
        [[0, 1]] * 3,
        periodic=(True, False, False),
        throat_shift=shift,
    )
    flow = solve_flow(network, np.ones(2))
    assert flow.inflow == pytest.approx(inflow)
    assert bool(flow.reason) == (inflow == 0)
    assert flow.isolated_pores == (2 if inflow == 0 else 0)


def test_slab_without_a_path_has_no_k_though_its_neighbours_do():
    """The middle throat of three is closed, so the whole and all slabs that hold it have k = 0."""
    network, g = chain(3), np.array([1.0, 0.0, 1.0])
    k = [
        slab_permeability(network, g, span)[0]
        for span in ((0.0, 0.9), (0.9, 2.1), (1.2, 1.8), (2.1, 3.0))
    ]
    assert k == pytest.approx([1.0, 0.0, 0.0, 1.0])
    assert inplace_permeability(
        network, solve_flow(network, g), np.array([0.0, 0.9, 3.0])
    ).tolist() == [0.0, 0.0]
