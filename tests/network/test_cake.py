"""The external cake, and what fines do to throats: beds, columns, classes by width and ratio."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from fdnet.network.network import build_network
from fdnet.network.states import Sides
from fdnet.report.text import cake_words
from fdnet.run.bridging import OpenThroats, classes_of, open_throats, width_rows, wilsons_band
from fdnet.run.cake import cake_rows, cake_summary, measure_cake, resistance_share
from fdnet.spheres.snapshot import Kind, Snapshot
from tests.network.packs import random_pack, simple_cubic

SIDES = Sides(periodic=(False, True, True), walls="slip")


def as_cake(bed: Snapshot, *, lone: bool = False) -> Snapshot:
    """A bed as grains from x = 0 on, and once more as fines upstream of them.

    With `lone` a fine far upstream touches nothing.
    """
    size, places = np.ptp(bed.box, axis=1), bed.position - bed.box[:, 0]
    places[:, 0] += bed.radius.max() - places[:, 0].min()
    far = np.array([[-3.0 * size[0], 0.5 * size[1], 0.5 * size[2]]])[: int(lone)]
    position = np.concatenate([places, places - [size[0], 0.0, 0.0], far])
    kind = np.where(np.arange(len(position)) < len(places), Kind.GRAIN, Kind.FINE)
    radius = np.concatenate([bed.radius, bed.radius, np.full(len(far), bed.radius.max())])
    return Snapshot.from_arrays(
        position, radius, box=np.column_stack([np.zeros(3), size]), kind=kind
    )


def test_a_cubic_bed_has_the_permeability_of_zick_and_homsy():
    """k = 0.00252 d^2 of a simple cubic lattice of touching spheres (1982); porosity 0.4764."""
    cake = measure_cake(as_cake(simple_cubic(repeat=6), lone=True), SIDES)
    assert cake.thickness == pytest.approx(12.0)
    assert cake.count.tolist() == [36] * 6
    assert cake.porosity == pytest.approx(0.476401, abs=2e-3)
    assert cake.diameter == pytest.approx(2.0)
    assert cake.k_network[1:-1] == pytest.approx(0.00252 * 4.0, rel=0.05)
    kozeny = 0.476401**3 * 4.0 / (180 * (1 - 0.476401) ** 2)
    assert cake.k_kozeny == pytest.approx(kozeny, rel=0.02)


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
    """0.4^3 (1e-4 m)^2 / (180 x 0.6^2) = 9.877e-12 m2, over 9.869e-16: 10,007 mD.

    Carman and Kozeny's 180 was found on such beds; the network agrees within a fifth.
    """
    bed = random_pack(160, 0.60, periodic=True, aspect=2.0, seed=3)
    scale = 1e-4 / (2.0 * float(bed.radius.mean()))
    bed = Snapshot.from_arrays(bed.position * scale, 0.5e-4, box=bed.box * scale)
    cake = measure_cake(as_cake(bed), SIDES)
    summary = cake_summary(cake, 1e8)
    kozeny = cake.resistance(cake.k_kozeny)
    assert cake.resistance(cake.k_network) == pytest.approx(kozeny, rel=0.2)
    k, porosity = summary["cake"]["k_carman_kozeny_m2"], summary["cake"]["porosity"]
    assert porosity == pytest.approx(0.4, abs=0.02)
    assert k == pytest.approx(9.877e-12, rel=0.25)
    assert k == pytest.approx(porosity**3 * 1e-8 / (180 * (1 - porosity) ** 2), rel=0.05)
    assert "mD by Carman and Kozeny at a porosity of 0.4" in cake_words(summary)
    table = summary["cake_by_depth"]
    assert (table["k_kozeny_m2"], table["porosity"]) == (k, porosity)


def test_a_loose_column_of_fines_is_no_bed_and_has_no_permeability():
    """Porosity 1 - (pi/6) / 4 = 0.869: the formula would say k = 0.213 d^2, 20 times a bed's."""
    for layers in (1, 8):  # of diameter 1 upstream of a grain, in a box 2 wide
        place = np.ones((layers + 1, 3))
        place[:, 0] = 0.5 - np.arange(layers + 1)
        kind = [Kind.GRAIN] + [Kind.FINE] * layers
        box = np.array([[0.0, 4.0], [0.0, 2.0], [0.0, 2.0]])
        cake = measure_cake(Snapshot.from_arrays(place, 0.5, box=box, kind=kind), SIDES)
        assert cake.porosity == pytest.approx(0.869, abs=5e-3)
        summary = cake_summary(cake, 1.0)
        assert summary["cake"] is summary["cake_by_depth"]["k_kozeny_m2"] is None
        assert all(row["k_kozeny_m2"] is None for row in cake_rows(cake))
        assert "loose all through" in cake_words(summary)
        assert "mD" not in cake_words(summary)


def test_a_few_fines_are_not_resolved_and_say_so():
    bed = as_cake(simple_cubic(repeat=2))
    cake = measure_cake(bed, SIDES)
    assert cake.k_network is None
    assert cake.unresolved == (  # 4 fines in two layers of 2 x 2
        "the cake has 8 fines, and a network needs 100 and is 2.0 diameters of a fine thick, and "
        "a network needs 3"
    )
    rows = cake_rows(cake)
    assert rows[0]["x_hi_m"] == 0.0
    assert all(row["k_network_m2"] is None and row["k_kozeny_m2"] > 0 for row in rows)
    assert measure_cake(bed.grains(), SIDES) is None
    assert cake_summary(None, 1.0) == {"cake_resistance_share": 0.0, "cake": None}
    wide = as_cake(simple_cubic(repeat=8))
    flat = measure_cake(wide.where(wide.position[:, 0] > -4.0), SIDES)  # 128 fines in two layers
    assert flat.unresolved == "the cake is 2.0 diameters of a fine thick, and a network needs 3"


# ------------------------------------------------------------------------------------------------
# Throats that fines bridge.


def test_wilsons_band():
    """Values of Brown, Cai and DasGupta (2001), and Newcombe (1998) for 81 of 263."""
    for hits, trials, band in [
        (0, 10, (0.0, 0.2775)),
        (5, 10, (0.2366, 0.7634)),
        (10, 10, (0.7225, 1.0)),
        (81, 263, (0.2553, 0.3662)),
    ]:
        assert wilsons_band(hits, trials) == pytest.approx(band, abs=5e-5), (hits, trials)


def test_throats_fall_into_their_classes():
    """Throats of width 1 that hold a fine of the ratio each."""
    ratio, none = np.array([0.15, 0.2, 0.29, 2.0]), np.zeros(4, bool)
    own = OpenThroats(
        width=np.ones(4),
        fine=ratio,
        held=~none,
        blocked=none,
        left=np.array([1.0, 0.0, 1.0, 0.0]),
        between=~none,
    )
    rows = classes_of(ratio, own, np.ones(4), 0.1)
    classes = [(row["ratio_lo"], row["ratio_hi"]) for row in rows]
    assert classes == [(0.1, 0.2), (0.2, 0.3), (1.5, None)]
    assert [row["throats"] for row in rows] == [1, 2, 1]
    assert [row["closed"] for row in rows] == [0, 1, 1]


def specimen(network, *, fine=0.0, held=None, blocked=None, left=1.0):
    """An analysis of a network whose throats hold these fines."""
    count = len(network.throat_radius)
    none = np.zeros(count, bool)
    return SimpleNamespace(
        network=network,
        occupancy=SimpleNamespace(
            throat_fine_radius=np.broadcast_to(fine, count),
            throat_fines=none if held is None else held,
            blocked=none if blocked is None else blocked,
        ),
        conductance_initial=np.ones(count),
        conductance_damaged=np.broadcast_to(left, count),
    )


def test_bridged_throats_are_counted_by_width_with_the_fines_in_them():
    """Four widths between grains, one that they close, and one out to a mirror image."""
    network = SimpleNamespace(
        throat_radius=np.array([1.0, 2.0, 3.0, 4.0, 0.0, 9.0]),
        throat_images=np.array([*[[0, 1, 2]] * 5, [0, 1, 3]]),
        image_position=np.array([*[[0.5, 0.5, 0.5]] * 3, [0.5, -0.5, 0.5]]),
        box=np.array([[0.0, 1.0]] * 3),
        periodic=(False, False, True),
    )
    analysis = specimen(
        network,
        fine=np.array([0.5, 0.0, 2.0, 0.0, 9.0, 1.0]),
        held=np.array([1, 0, 2, 0, 3, 1]),
        blocked=np.array([True, False, False, False, False, True]),
        left=np.array([0.0, 1.0, 0.5, 0.6, 1.0, 0.05]),
    )
    *rows, beside = width_rows(open_throats(analysis))
    assert [row["throats"] for row in rows] == [1, 1, 1, 1]
    assert [row["bridged"] for row in rows] == [1, 0, 1, 0]
    assert [row["blocked"] for row in (*rows, beside)] == [1, 0, 0, 0, 1]
    assert [row["fine_over_throat"] for row in rows] == [0.5, None, pytest.approx(2 / 3), None]
    assert rows[-1]["throat_to_m"] == 8.0
    assert beside["throat_from_m"] is beside["fine_over_throat"] is None
    assert (beside["throats"], beside["bridged"], beside["fines_median_m"]) == (1, 1, 2.0)
    network.periodic = (False, True, True)  # then it is a grain beyond the period
    assert sum(row["throats"] for row in width_rows(open_throats(analysis))) == 5


def test_the_gap_to_a_wall_is_no_throat_of_the_sand():
    """Touching grains of a cubic lattice, 0.4 diameters d away from all walls.

    No circle through three corners of a cube is wider than the sphere around it, sqrt 3 d, so
    (sqrt 3 - 1) d = 0.73 d is left. Across the gap to the mirror images circles are wider.
    """
    bed = simple_cubic(repeat=3)
    d = 2.0 * float(bed.radius[0])
    box = np.column_stack([np.zeros(3), np.ptp(bed.box, axis=1) + 0.8 * d])
    place = bed.position - bed.box[:, 0] + 0.4 * d
    loose = Snapshot.from_arrays(place, bed.radius, box=box)
    network = build_network(loose, periodic=(False, False, False))
    *rows, beside = width_rows(open_throats(specimen(network)))
    assert beside["throat_to_m"] is None
    assert 2.0 * network.throat_radius.max() > 0.8 * d
    assert 0 < rows[-1]["throat_to_m"] <= (math.sqrt(3) - 1) * d * (1 + 1e-9)
