"""Flow through networks small enough to know the answer, by second methods, over many decades."""

import numpy as np
import pytest

from fdnet.errors import FlowError
from fdnet.network.flow import solver
from fdnet.network.flow.flow import solve_flow
from fdnet.network.flow.sections import inplace_permeability, plane_pressures, slab_permeability
from fdnet.network.flow.solver import DIRECT, MULTIGRID, Balances, balance_links, winding_groups
from fdnet.network.laws.named import LAWS, effective_law
from fdnet.network.network import build_network
from tests.network.exact import exact_balance, random_links
from tests.network.networks import chain
from tests.network.packs import random_pack, snapshot

ALL, SIDES = (True,) * 3, (False, True, True)


def test_chains_of_throats_in_closed_form():
    """n equal throats conduct g / n; one tube pi r^4 / 8 over a unit section (Poiseuille)."""
    for count in (1, 2, 7):
        flow = solve_flow(chain(count), np.full(count, 3.0))
        assert flow.inflow == pytest.approx(3.0 / count)
        assert flow.pore_pressure == pytest.approx(1 - np.arange(count + 1) / count)
        assert flow.throat_flux == pytest.approx(3.0 / count)
    network = chain(1, step=2.0)
    k = solve_flow(network, LAWS["thesis"](network)).inflow * 2.0 / network.area
    assert k == pytest.approx(np.pi * 0.1**4 / 8)
    # a slab splits throats at its planes
    flow = solve_flow(chain(4), np.full(4, 1.0), span=(0.25, 2.5))
    assert flow.inflow == pytest.approx(1 / 2.25)
    assert flow.mass_balance < 1e-12
    within = solve_flow(chain(2), np.full(2, 1.0), span=(0.2, 0.6))
    assert within.inflow == pytest.approx(1 / 0.4)


def test_cut_off_pores_are_counted_and_no_open_path_is_zero_with_its_reason():
    periodic = build_network(random_pack(50), periodic=ALL)
    inner = np.where(periodic.throat_shift[:, 0] != 0, 0.0, 1.0)  # nothing crosses the x face
    blocked = [(chain(3), np.array(g, float)) for g in ([0, 1, 1], [1, 0, 1], [0, 0, 0])]
    for network, g in [*blocked, (periodic, inner)]:
        flow = solve_flow(network, g)
        assert flow.inflow == 0.0
        assert "no open path" in flow.reason
        assert flow.mass_balance is None
    # slabs beside a closed throat still have a k
    network, g = chain(3), np.array([1.0, 0.0, 1.0])
    spans = ((0.0, 0.9), (0.9, 2.1), (1.2, 1.8), (2.1, 3.0))
    k = [slab_permeability(network, g, span)[0] for span in spans]
    assert k == pytest.approx([1.0, 0.0, 0.0, 1.0])
    in_place = inplace_permeability(network, solve_flow(network, g), np.array([0.0, 0.9, 3.0]))
    assert in_place.tolist() == [0.0, 0.0]


# ---- Periods.
@pytest.fixture(scope="module")
def periods():
    """A periodic network, and the one of three copies in a row between planes; its edge."""
    pack = random_pack(50)
    edge = pack.box[0, 1]
    place = np.vstack([pack.position + np.array([n * edge, 0, 0]) for n in range(3)])
    row = snapshot(place, 1.0, pack.box * [[3], [1], [1]])
    three = build_network(row, periodic=SIDES, walls="slip")
    return build_network(pack, periodic=ALL), three, edge


def test_a_period_is_the_middle_copy_of_three(periods):
    """Throats across the periodic x face belong to both ends of the box."""
    one, three, edge = periods
    for name, law in LAWS.items():
        for span in ((0.0, 1.0), (0.2, 0.7), (0.0, 0.3)):
            low, high = np.array(span) * edge
            inflow = solve_flow(one, law(one), span=(low, high)).inflow
            middle = solve_flow(three, law(three), span=(low + edge, high + edge)).inflow
            assert inflow == pytest.approx(middle, rel=1e-5), (name, span)
        # the endless pack is the limit of many periods between pressure planes
        flow = solve_flow(three, law(three))
        pressure = plane_pressures(three, flow, np.array([edge, 2 * edge]))
        middle = flow.inflow / (pressure[0] - pressure[1])
        assert solve_flow(one, law(one)).inflow == pytest.approx(middle, rel=0.03), name


# ---- Direct and multigrid.
def links(count=400):
    """A ring with chords, conductances over four decades; one node in ten tied to pressure 0."""
    rng = np.random.default_rng(2)
    ring = np.stack([np.arange(count), (np.arange(count) + 1) % count], 1)
    pair = np.concatenate([ring, rng.integers(count, size=(count, 2))])
    tied = np.where(np.arange(count) % 10 == 0, 1.0, 0.0)
    return pair, 10.0 ** rng.uniform(-4.0, 0, len(pair)), tied, rng.random(count)


def test_multigrid_and_direct_agree_on_packs_and_both_balance(monkeypatch):
    """Also over twelve decades with a fourth of the throats blocked."""
    for periodic in (SIDES, ALL):
        network = build_network(random_pack(120), periodic=periodic, walls="slip")
        count, rng = len(network.throat_pores), np.random.default_rng(4)
        for decades, blocked in ((0, 0.0), (12, 0.0), (12, 0.25)):
            spread = 10.0 ** rng.uniform(-decades, 0, count) * (rng.random(count) >= blocked)
            g, flows = effective_law(network) * spread, []
            for limit in (0, 10_000):
                monkeypatch.setattr(solver, "DIRECT_UP_TO", limit)
                flows.append(solve_flow(network, g))
            first, second = flows
            assert [first.method, second.method] == [MULTIGRID, DIRECT]
            assert first.inflow == pytest.approx(second.inflow, rel=1e-8)
            assert second.inflow > 0
            near = 1e-8 * second.inflow
            assert first.throat_flux == pytest.approx(second.throat_flux, abs=near)
            assert second.mass_balance < 1e-6
            one, two = network.throat_pores.T
            pores = len(network.pore_share)
            out, into = (np.bincount(end, second.throat_flux, pores) for end in (one, two))
            inner = (network.pore_share == 1) & np.isfinite(second.pore_pressure)
            assert np.abs((out - into)[inner]).max() < 1e-8 * second.inflow


def test_multigrid_solves_pores_without_neighbours():
    """Those of a thin slab are tied to the planes alone, in seconds, not minutes and gigabytes."""
    tied = np.linspace(1.0, 2.0, 6000)
    for pairs in (0, 3000):
        balances = Balances(np.arange(2 * pairs).reshape(-1, 2), np.ones(pairs), tied)
        assert balances.solve(tied) == pytest.approx(np.ones(6000))
        assert balances.method == MULTIGRID


def test_direct_takes_over_where_multigrid_fails_or_both_are_refused(monkeypatch):
    chain = np.array([[0, 1], [1, 2]])
    for pair, most in ((chain[:0], 3), (chain[:0], 0), (chain, 0)):
        monkeypatch.setattr(solver, "DIRECT_UP_TO", most)
        closed = Balances(pair, np.ones(len(pair)), np.zeros(3))
        with pytest.raises(FlowError, match=r"3 pores failed: .*no way out"):
            closed.solve(np.ones(3))
    monkeypatch.setattr(solver, "DIRECT_UP_TO", 10_000)
    pair, g, tied, source = links()
    expected = Balances(pair, g, tied).solve(source)
    monkeypatch.setattr(solver, "DIRECT_UP_TO", 0)
    monkeypatch.setattr(solver, "CG_STEPS", 1)
    balances = Balances(pair, g, tied)
    assert balances.solve(source, imbalance=1e-9) == pytest.approx(expected)
    assert balances.method == DIRECT
    monkeypatch.setattr(solver, "MOST_DIRECT", 399)
    with pytest.raises(FlowError, match=r"400 pores: multigrid did not converge .* at most 399"):
        Balances(pair, g, tied).solve(source)


# ---- Balances over many decades.
NODES = 16


@pytest.mark.parametrize("period", [False, True])
def test_fluxes_against_rational_arithmetic(period):
    """The error of the throughput, and of every flux over it."""
    for decades, within, each in [(6, 1e-9, 1e-9), (12, 1e-9, 1e-9), (20, 1e-9, 1e-4)]:
        solved = 0
        for seed in range(25):
            ends, g, jump = random_links(seed, decades=decades, period=period)
            if not winding_groups(ends, jump, NODES)[1].all():
                continue
            solved += 1
            throughput, exact = exact_balance(ends, g, jump, NODES)
            flux = balance_links(ends, g, jump, NODES).flux
            assert flux @ jump == pytest.approx(throughput, rel=within)
            assert flux == pytest.approx(exact, abs=each * throughput)
            net = np.bincount(ends[:, 0], flux, NODES) - np.bincount(ends[:, 1], flux, NODES)
            assert np.abs(net[1:]).max() <= 1e-6 * throughput
        assert solved > 15


def test_contrasts_that_cannot_be_held_are_refused(monkeypatch):
    """Without a limit on stiff links: no number is better than a wrong one."""
    g = np.array([1e10, 1e6, 1e2, 1e-12, 1e-16, 1e-12, 1e2, 1e6, 1e10])
    assert solve_flow(chain(9), g).inflow == pytest.approx(1 / np.sum(1 / g), rel=1e-9)
    monkeypatch.setattr(solver, "CONTRAST", 1e99)
    with pytest.raises(FlowError):
        solve_flow(chain(9), g)
