"""Direct and multigrid give the same answer; what neither can solve is refused."""

import numpy as np
import pyamg
import pytest

from fdnet.errors import FlowError
from fdnet.network.flow import solver
from fdnet.network.flow.flow import solve_flow
from fdnet.network.flow.solver import DIRECT, MULTIGRID, Balances
from fdnet.network.laws.named import effective_law
from fdnet.network.network import build_network
from tests.network.packs import random_pack


def links(count=400, *, decades=4.0):
    """A ring with chords; one node in ten tied to pressure 0."""
    rng = np.random.default_rng(2)
    pair = np.concatenate(
        [
            np.stack([np.arange(count), (np.arange(count) + 1) % count], 1),
            rng.integers(count, size=(count, 2)),
        ]
    )
    tied = np.where(np.arange(count) % 10 == 0, 1.0, 0.0)
    return pair, 10.0 ** rng.uniform(-decades, 0, len(pair)), tied, rng.random(count)


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
@pytest.mark.parametrize("limit", [0, 10_000])
def test_both_methods_satisfy_every_balance(monkeypatch, limit, unit):
    """In any unit of conductance and flux."""
    monkeypatch.setattr(solver, "DIRECT_UP_TO", limit)
    pair, g, tied, source = links()
    balances = Balances(pair, g * unit, tied * unit)
    p = balances.solve(source * unit, imbalance=1e-9 * unit)
    flux = g * (p[pair[:, 0]] - p[pair[:, 1]])
    net = np.bincount(pair[:, 0], flux, len(tied)) - np.bincount(pair[:, 1], flux, len(tied))
    assert net + tied * p == pytest.approx(source, abs=1e-8)
    assert balances.method == (MULTIGRID if limit == 0 else DIRECT)


def test_a_cycle_is_pyamgs_own_and_symmetric(monkeypatch):
    """pyamg's, without the norms that it computes next to it."""
    made, build = [], pyamg.ruge_stuben_solver

    def kept(*given, **named):
        made.append(build(*given, **named))
        return made[0]

    monkeypatch.setattr(solver.pyamg, "ruge_stuben_solver", kept)
    pair, g, tied, source = links()
    cycle, other = solver.ruge_stuben(solver.laplacian(pair, g, tied)), np.roll(source, 7)
    assert len(made[0].levels) > 2
    assert np.array_equal(cycle(source), made[0].aspreconditioner() @ source)
    assert source @ cycle(other) == pytest.approx(other @ cycle(source), rel=1e-12)


@pytest.mark.parametrize("periodic", [(False, True, True), (True, True, True)])
@pytest.mark.parametrize("decades", [0, 12])
def test_multigrid_and_direct_agree_on_a_pack(monkeypatch, periodic, decades):
    network = build_network(random_pack(120), periodic=periodic, walls="slip")
    rng = np.random.default_rng(4)
    g = effective_law(network) * 10.0 ** rng.uniform(-decades, 0, len(network.throat_pores))
    flows = []
    for limit in (0, 10_000):
        monkeypatch.setattr(solver, "DIRECT_UP_TO", limit)
        flows.append(solve_flow(network, g))
    assert [flow.method for flow in flows] == [MULTIGRID, DIRECT]
    assert flows[0].inflow == pytest.approx(flows[1].inflow, rel=1e-8)
    assert flows[0].throat_flux == pytest.approx(flows[1].throat_flux, abs=1e-8 * flows[1].inflow)


@pytest.mark.parametrize("pairs", [0, 3000])
def test_multigrid_solves_pores_without_neighbours(pairs):
    """A thin slab has pores, or pairs of pores, that are tied to the planes alone.

    There is nothing to coarsen. It takes seconds, where a dense solve of the coarsest level would
    take minutes and gigabytes.
    """
    count, tied = 6000, np.linspace(1.0, 2.0, 6000)
    pair = np.arange(2 * pairs).reshape(-1, 2)
    balances = Balances(pair, np.ones(pairs), tied)
    pressure = balances.solve(tied)
    assert balances.method == MULTIGRID
    assert pressure == pytest.approx(np.ones(count))


def test_direct_takes_over_where_multigrid_does_not_converge(monkeypatch):
    monkeypatch.setattr(solver, "DIRECT_UP_TO", 0)
    monkeypatch.setattr(solver, "CG_STEPS", 1)
    pair, g, tied, source = links()
    balances = Balances(pair, g, tied)
    pressure = balances.solve(source, imbalance=1e-9)
    assert balances.method == DIRECT
    monkeypatch.setattr(solver, "DIRECT_UP_TO", 10_000)
    assert pressure == pytest.approx(Balances(pair, g, tied).solve(source))


def test_a_system_that_neither_converges_nor_fits_is_refused(monkeypatch):
    for name, value in (("DIRECT_UP_TO", 0), ("CG_STEPS", 1), ("MEMORY_CAP", 1e4)):
        monkeypatch.setattr(solver, name, value)
    pair, g, tied, source = links()
    with pytest.raises(FlowError, match=r"400 pores: multigrid did not converge .* GB of"):
        Balances(pair, g, tied).solve(source)


def test_nodes_without_a_way_out_are_refused():
    with pytest.raises(FlowError, match="no way out"):
        Balances(np.zeros((0, 2), int), np.zeros(0), np.zeros(3)).solve(np.ones(3))
