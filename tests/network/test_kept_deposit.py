"""The deposit followed fine by fine against the full measure."""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.network.fines.deposit import deposit_in_pores
from fdnet.network.fines.fine_images import reaching_inside
from fdnet.network.fines.kept_deposit import holders_of, measured_deposit
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
    grown = kept.changed_to(after, tolerance=0.0)
    assert 0 < grown.renewed < 60
    want = deposit_in_pores(network, after)[0]
    assert grown.in_pores == pytest.approx(want, rel=1e-9, abs=1e-12 * want.max())


def test_a_fine_within_the_tolerance_keeps_its_place():
    box = np.array([[0.0, 3e-3], [0.0, 2e-3], [0.0, 2e-3]])
    lattice = 1e-3 * (np.indices((3, 2, 2)).reshape(3, -1).T + 0.5)
    network = build_network(Snapshot.from_arrays(lattice, 0.45e-3, box=box), periodic="yz")
    before = some_fines(20, np.random.default_rng(1))
    before = before.where(reaching_inside(network, before))
    kept = measured_deposit(holders_of(network), before)
    way = np.where(np.arange(len(before)) < 5, 0.02, 0.005) * before.radius
    after = replace(before, position=before.position + way[:, None] * np.array([0.0, 1.0, 0.0]))
    moved = kept.changed_to(after, tolerance=0.01)
    assert moved.renewed == 5
    assert np.array_equal(moved.fines.position[5:], before.position[5:])
    assert kept.changed_to(before, tolerance=0.0).renewed == 0
