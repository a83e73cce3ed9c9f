"""The external cake: its slices, its permeability by two ways, its share of the resistance."""

import numpy as np
import pytest
from packs import random_pack, simple_cubic

from fdnet.network.resolved.slab import Sides
from fdnet.run.cake import cake_rows, cake_summary, measure_cake, resistance_share
from fdnet.spheres.snapshot import Kind, Snapshot

SIDES = Sides(periodic=(False, True, True), walls="slip")


def as_cake(bed: Snapshot, *, lone: bool = False) -> Snapshot:
    """A bed as grains from x = 0 on, and once more as fines upstream of them.

    With `lone` a fine far upstream touches nothing.
    """
    size = np.ptp(bed.box, axis=1)
    places = bed.position - bed.box[:, 0]
    places[:, 0] += bed.radius.max() - places[:, 0].min()
    far = np.array([[-3.0 * size[0], 0.5 * size[1], 0.5 * size[2]]])[: int(lone)]
    position = np.concatenate([places, places - [size[0], 0.0, 0.0], far])
    kind = np.full(len(position), Kind.FINE)
    kind[: len(places)] = Kind.GRAIN
    radius = np.concatenate([bed.radius, bed.radius, np.full(len(far), bed.radius.max())])
    box = np.column_stack([np.zeros(3), size])
    return Snapshot.from_arrays(position, radius, box=box, kind=kind)


def test_a_cubic_bed_has_the_permeability_of_zick_and_homsy():
    """k = 0.00252 d^2 of a simple cubic lattice of touching spheres (1982); porosity 0.4764."""
    bed = simple_cubic(repeat=6)
    cake = measure_cake(as_cake(bed, lone=True), SIDES)
    assert cake.thickness == pytest.approx(12.0)
    assert len(cake.count) == 6
    assert cake.count.tolist() == [36] * 6
    assert cake.porosity == pytest.approx(0.476401, abs=2e-3)
    assert cake.diameter == pytest.approx(2.0)
    inner = cake.k_network[1:-1]
    assert inner == pytest.approx(0.00252 * 4.0, rel=0.05)
    kozeny = 0.476401**3 * 4.0 / (180 * (1 - 0.476401) ** 2)
    assert cake.k_kozeny == pytest.approx(kozeny, rel=0.02)


def test_a_dense_random_bed_is_between_both_ways():
    """Carman and Kozeny's 180 was found on such beds; both agree within a fifth."""
    bed = random_pack(160, 0.60, periodic=True, aspect=2.0, seed=3)
    equal = Snapshot.from_arrays(bed.position, float(bed.radius.mean()), box=bed.box)
    cake = measure_cake(as_cake(equal), SIDES)
    network, kozeny = cake.resistance(cake.k_network), cake.resistance(cake.k_kozeny)
    assert network == pytest.approx(kozeny, rel=0.2)


def test_the_share_is_that_of_beds_in_series():
    assert resistance_share(3.0, 1.0) == 0.75
    assert resistance_share(3.0, float("inf")) == 0.0
    cake = measure_cake(as_cake(simple_cubic(repeat=6)), SIDES)
    pack = 2.0 * cake.resistance(cake.k_kozeny)
    summary = cake_summary(cake, pack)
    assert summary["cake_by_depth"]["share_kozeny"] == pytest.approx(1 / 3, rel=1e-12)
    assert summary["cake_resistance_share"] == summary["cake_by_depth"]["share_network"]
    assert "cake_resistance_share" not in cake_summary(cake, pack, ("cake_resistance_share",))


def test_a_few_fines_are_not_resolved_and_say_so():
    bed = simple_cubic(repeat=2)
    cake = measure_cake(as_cake(bed), SIDES)
    assert cake.k_network is None
    assert "a network needs" in cake.unresolved
    rows = cake_rows(cake)
    assert rows[0]["x_hi_m"] == 0.0
    assert all(row["k_network_m2"] is None and row["k_kozeny_m2"] > 0 for row in rows)
    alone = as_cake(bed).grains()
    assert measure_cake(alone, SIDES) is None
    assert cake_summary(None, 1.0) == {"cake_resistance_share": 0.0}
