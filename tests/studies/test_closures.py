"""The resistance that a deposit adds to the throats of its pore, against what it must be."""

import numpy as np
import pytest

import fdnet
from fdnet.network.fines.occupancy import measure_occupancy
from validation.closures import added_resistance, arrival_table


def test_added_resistance_of_a_fine_in_one_tetrahedron_by_hand():
    """Four touching spheres: the void of their tetrahedron is 0.220364 of it."""
    corner = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]) / np.sqrt(2.0) * 1e-3
    grains = fdnet.Snapshot.from_arrays(corner + 1e-3, 0.5e-3, box=[(0.0, 3e-3)] * 3)
    network = fdnet.build_network(grains, walls="slip")
    centre = grains.position.mean(axis=0)
    fine = fdnet.Snapshot.from_arrays([centre], 5e-5, box=grains.box, kind="fine")
    found = added_resistance(network, measure_occupancy(network, fine))
    void = 0.220364 * 1e-9 / (6.0 * np.sqrt(2.0))
    share = 4.0 / 3.0 * np.pi * 5e-5**3 / void
    expected = 1210.0 * share**2 / (1e-4 * void ** (1.0 / 3.0)) ** 1.5
    assert np.max(found) == pytest.approx(expected, rel=1e-4)


def test_arrivals_are_counted_by_class_and_a_fresh_throat_is_a_class_of_its_own():
    one = {"diameter_um": 100, "concentration": 0.1, "ratio": 0.7}
    loads = [(0.0, False), (0.0, False), (0.0, True), (0.01, True), (0.01, False)]
    rows = [one | {"load": load, "stopped": stopped} for load, stopped in loads]
    table = arrival_table(rows)
    assert table["arrivals"].tolist() == [3, 2]
    assert table["stopped"].tolist() == [1, 1]
    assert table["share_low"][0] < 1 / 3 < table["share_high"][0]
    assert (table["ratio_lo"] == 0.65).all()
