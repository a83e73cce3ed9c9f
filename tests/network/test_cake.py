"""The external cake: its slices, its permeability by two ways, its share of the resistance."""

import numpy as np
import pytest
from packs import random_pack, simple_cubic

from fdnet.network.states import Sides
from fdnet.report.text import cake_words
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
    table = cake_summary(cake, pack, flow=0.25)
    assert (table["cake_resistance_share"], table["cake_by_depth"]["share_by"]) == (0.25, "flow")


def test_a_cake_of_a_tenth_of_a_millimetre_at_a_porosity_of_0_4_has_ten_thousand_millidarcy():
    """0.4^3 (1e-4 m)^2 / (180 x 0.6^2) = 9.877e-12 m2, over 9.869e-16: 10,007 mD."""
    bed = random_pack(160, 0.60, periodic=True, aspect=2.0, seed=3)
    scale = 1e-4 / (2.0 * float(bed.radius.mean()))
    equal = Snapshot.from_arrays(bed.position * scale, 0.5e-4, box=bed.box * scale)
    cake = measure_cake(as_cake(equal), SIDES)
    summary = cake_summary(cake, 1e8)
    k, porosity = summary["cake"]["k_carman_kozeny_m2"], summary["cake"]["porosity"]
    assert porosity == pytest.approx(0.4, abs=0.02)
    assert k == pytest.approx(9.877e-12, rel=0.25)
    assert k == pytest.approx(porosity**3 * 1e-8 / (180 * (1 - porosity) ** 2), rel=0.05)
    assert "mD by Carman and Kozeny at a porosity of 0.4" in cake_words(summary)
    table = summary["cake_by_depth"]
    assert (table["k_kozeny_m2"], table["porosity"]) == (k, porosity)


def column(layers):
    """Touching fines of diameter 1 in a column upstream of a grain, in a box 2 wide: loose."""
    x = 0.5 - np.arange(layers + 1)
    position = np.column_stack([x, np.ones(layers + 1), np.ones(layers + 1)])
    kind = np.full(layers + 1, Kind.FINE)
    kind[0] = Kind.GRAIN
    box = np.array([[0.0, 4.0], [0.0, 2.0], [0.0, 2.0]])
    return Snapshot.from_arrays(position, 0.5, box=box, kind=kind)


@pytest.mark.parametrize("layers", [1, 8])
def test_a_loose_column_of_fines_is_no_bed_and_has_no_permeability(layers):
    """Porosity 1 - (pi/6) / 4 = 0.869: the formula would say k = 0.213 d^2, 20 times a bed's."""
    cake = measure_cake(column(layers), SIDES)
    assert cake.porosity == pytest.approx(0.869, abs=5e-3)
    summary = cake_summary(cake, 1.0)
    assert summary["cake"] is summary["cake_by_depth"]["k_kozeny_m2"] is None
    assert all(row["k_kozeny_m2"] is None for row in cake_rows(cake))
    assert "loose all through" in cake_words(summary)
    assert "mD" not in cake_words(summary)


def test_a_few_fines_are_not_resolved_and_say_so():
    bed = simple_cubic(repeat=2)
    cake = measure_cake(as_cake(bed), SIDES)
    assert cake.k_network is None
    assert cake.unresolved == (  # 4 fines in two layers of 2 x 2
        "the cake has 8 fines, and a network needs 100 and is 2.0 diameters of a fine thick, and "
        "a network needs 3"
    )
    rows = cake_rows(cake)
    assert rows[0]["x_hi_m"] == 0.0
    assert all(row["k_network_m2"] is None and row["k_kozeny_m2"] > 0 for row in rows)
    alone = as_cake(bed).grains()
    assert measure_cake(alone, SIDES) is None
    assert cake_summary(None, 1.0) == {"cake_resistance_share": 0.0, "cake": None}
    wide = as_cake(simple_cubic(repeat=8))
    flat = measure_cake(wide.where(wide.position[:, 0] > -4.0), SIDES)  # 128 fines in two layers
    assert flat.unresolved == "the cake is 2.0 diameters of a fine thick, and a network needs 3"
