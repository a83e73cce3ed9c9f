"""Balances over many decades against rational arithmetic."""

import numpy as np
import pytest

from fdnet.errors import FlowError
from fdnet.network.flow import solver as stiff
from fdnet.network.flow.flow import solve_flow
from fdnet.network.flow.solver import (
    balance_links,
    cancelling_pressures,
    stiffness,
    winding_groups,
)
from tests.network.exact import exact_balance, random_links
from tests.network.networks import chain, network_of

NODES = 16


@pytest.mark.parametrize("period", [False, True])
@pytest.mark.parametrize(("decades", "within"), [(6, 1e-9), (12, 1e-8), (16, 1e-8), (20, 1e-6)])
def test_fluxes_against_rational_arithmetic(decades, within, period):
    """The error of every flux, over the throughput: 1e-6 over 12 decades, 1e-3 over 16."""
    solved = 0
    for seed in range(25):
        ends, g, jump = random_links(seed, decades=decades, period=period)
        if not winding_groups(ends, jump, NODES)[1].all():
            continue
        solved += 1
        throughput, flux = exact_balance(ends, g, jump, NODES)
        balance = balance_links(ends, g, jump, NODES)
        assert balance.flux @ jump == pytest.approx(throughput, rel=within)
        assert balance.flux == pytest.approx(flux, abs=within * throughput)
        net = np.bincount(ends[:, 0], balance.flux, NODES) - np.bincount(
            ends[:, 1], balance.flux, NODES
        )
        assert np.abs(net[1:]).max() <= 1e-6 * throughput
    assert solved > 15


def test_chain_with_links_sixteen_decades_apart():
    """Resistances add: 1 / g = 1e16 + 1 + 1e8 + 1 + 1e16; every link takes the same flux."""
    g = np.array([1e-16, 1.0, 1e-8, 1.0, 1e-16])
    flow = solve_flow(chain(5), g)
    assert flow.inflow == pytest.approx(1.0 / np.sum(1.0 / g), rel=1e-12)
    assert flow.throat_flux == pytest.approx(flow.inflow, rel=1e-9)


def test_conductances_falling_by_decades_along_a_chain():
    g = 10.0 ** -np.array([0, 4, 8, 12, 16, 12, 8, 4, 0])
    flow = solve_flow(chain(9), g)
    assert flow.inflow == pytest.approx(1.0 / np.sum(1.0 / g), rel=1e-12)
    assert flow.throat_flux == pytest.approx(flow.inflow, rel=1e-9)


def test_flux_divides_within_a_contracted_group():
    """Two parallel paths in a group 1e12 times stiffer than its ends share as 1 to 3.

    That is the ratio of their conductances.
    """
    position = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]
    network = network_of(position, [(0, 1), (1, 2), (1, 2), (2, 3)], [[0, 3], [0, 1], [0, 1]])
    flow = solve_flow(network, np.array([1.0, 1e12, 3e12, 1.0]))
    assert flow.throat_flux / flow.inflow == pytest.approx([1.0, 0.25, 0.75, 1.0], rel=1e-9)


def test_a_pore_group_hanging_on_threads_takes_a_pressure_within_bounds():
    """Two pores joined by 1 and tied to the flow by 1e-18 have the pressure of their neighbour."""
    position = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0], [1, 2, 0]]
    network = network_of(position, [(0, 1), (1, 2), (1, 3), (3, 4)], [[0, 2], [0, 3], [0, 1]])
    flow = solve_flow(network, np.array([1.0, 1.0, 1e-18, 1.0]))
    assert flow.pore_pressure[1:] == pytest.approx([0.5, 0.0, 0.5, 0.5], abs=1e-9)


def test_stiffness_counts_contrasts_above_the_weakest_link_of_the_best_way():
    ends = np.array([(0, 1), (1, 2), (2, 0), (1, 2)])
    jump = np.array([1.0, 0.0, 0.0, 0.0])
    g = np.array([1.0, 1e12, 1e-3, 1e-9])
    assert stiffness(ends, g, jump, 3).tolist() == [0, 1, 0, 0]


def test_heights_take_up_the_jumps_of_a_forest():
    ends = np.array([(0, 1), (2, 1), (2, 3), (4, 5)])
    jump = np.array([1.0, 0.0, -2.0, 3.0])
    height = cancelling_pressures(ends, jump, 6)
    assert (jump + height[ends[:, 0]] - height[ends[:, 1]]).tolist() == [0, 0, 0, 0]


@pytest.mark.parametrize(
    ("jumps", "winds"),
    [([0, 0, 0, 1, -1], False), ([1, 0, -1, 0, 0], False), ([1, 1, 1, 0, 0], True)],
)
def test_only_a_closed_way_with_a_jump_winds(jumps, winds):
    """A triangle 0-1-2 and two pores joined to it.

    A jump there and back closes no loop; three turns do.
    """
    ends = np.array([(0, 1), (1, 2), (2, 0), (2, 3), (3, 4)])
    group, winding = winding_groups(ends, np.array(jumps, float), 5)
    assert winding.all() == winding.any() == winds
    assert len(set(group)) == 1


def test_parallel_links_with_unlike_jumps_wind():
    assert winding_groups(np.array([(0, 1), (0, 1)]), np.array([0.0, 1.0]), 2)[1].all()


def test_links_in_parallel_on_both_sides_of_the_contrast_settle(monkeypatch):
    """A group contracted by 1.5e8 includes the link of 0.9e8 in parallel.

    Otherwise each sweep gains a factor of only 0.6.
    """
    monkeypatch.setattr(stiff, "CONTRASTS", (1e8,))
    ends, jump = np.array([(0, 1), (1, 2), (1, 2), (2, 0)]), np.array([1.0, 0.0, 0.0, 0.0])
    balance = balance_links(ends, np.array([1.0, 1.5e8, 0.9e8, 1.0]), jump, 3)
    assert balance.defect < 1e-8
    assert balance.flux == pytest.approx([0.5, 0.5 * 1.5 / 2.4, 0.5 * 0.9 / 2.4, 0.5], abs=1e-7)


def test_what_does_not_settle_is_refused(monkeypatch):
    """Without contraction sixteen decades cannot be held: no number is better than a wrong one."""
    monkeypatch.setattr(stiff, "CONTRASTS", (1e99,))
    g = 10.0 ** -np.array([0, 4, 8, 12, 16, 12, 8, 4, 0])[::-1]
    with pytest.raises(FlowError):
        solve_flow(chain(9), np.where(g > 1e-10, g * 1e10, g))
