"""The deposit followed fine by fine against the full measure."""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.network.fines.deposit import (
    deposit_in_pores,
    holders_of,
    measured_deposit,
    reaching_inside,
)
from fdnet.network.network import build_network
from fdnet.spheres.snapshot import Kind, Snapshot


def some_fines(count: int, rng: np.random.Generator) -> Snapshot:
    box = np.array([[0.0, 3e-3], [0.0, 2e-3], [0.0, 2e-3]])
    place = rng.uniform([-5e-5, 0.0, 0.0], [3e-3, 2e-3, 2e-3], (count, 3))
    radius = rng.uniform(2e-5, 9e-5, count)
    made = Snapshot.from_arrays(place, radius, box=box, kind="fine")
    return replace(made, id=np.arange(1, count + 1), kind=np.full(count, Kind.FINE))


@pytest.mark.parametrize("periodic", ["yz", ""])
def test_fines_that_come_leave_and_move_give_the_full_measure(periodic):
    rng = np.random.default_rng(3)
    lattice = 1e-3 * (np.indices((3, 2, 2)).reshape(3, -1).T + 0.5)
    box = np.array([[0.0, 3e-3], [0.0, 2e-3], [0.0, 2e-3]])
    grains = Snapshot.from_arrays(
        lattice + rng.uniform(-2e-5, 2e-5, lattice.shape), 0.45e-3, box=box
    )
    network = build_network(grains, periodic=periodic)
    before = some_fines(120, rng)
    place = np.array(before.position)
    place[::4] += rng.normal(0.0, 1e-4, place[::4].shape)
    after = replace(before, position=place).where(rng.permutation(120)[:100])
    before, after = (one.where(reaching_inside(network, one)) for one in (before, after))
    kept = measured_deposit(holders_of(network), before)
    grown = kept.changed_to(after)
    assert 0 < grown.renewed < 60
    full = measured_deposit(kept.holders, after)
    for name in ("pore", "fine", "volume"):
        assert np.array_equal(getattr(grown, name), getattr(full, name))
    assert np.array_equal(grown.in_pores, full.in_pores)
    assert kept.changed_to(before).renewed == 0
    want = deposit_in_pores(network, after)[0]
    assert grown.in_pores == pytest.approx(want, rel=1e-9, abs=1e-12 * want.max())
