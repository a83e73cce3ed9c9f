"""The external cake, and what fines do to throats: beds, columns, classes by width and ratio."""

from types import SimpleNamespace

import numpy as np
import pytest

from fdnet.network.states import Sides
from fdnet.run.bridging import open_throats, width_rows, wilsons_band
from fdnet.run.cake import cake_rows, cake_summary, measure_cake, resistance_share
from fdnet.spheres.snapshot import Kind, Snapshot
from tests.network.packs import simple_cubic

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


def test_bridged_throats_are_counted_by_width_with_the_fines_in_them():
    """Four widths between grains, one that they close, and one out to a mirror image."""
    network = SimpleNamespace(
        throat_radius=np.array([1.0, 2.0, 3.0, 4.0, 0.0, 9.0]),
        throat_images=np.array([*[[0, 1, 2]] * 5, [0, 1, 3]]),
        image_position=np.array([*[[0.5, 0.5, 0.5]] * 3, [0.5, -0.5, 0.5]]),
        box=np.array([[0.0, 1.0]] * 3),
        periodic=(False, False, True),
    )
    occupancy = SimpleNamespace(
        throat_fine_radius=np.array([0.5, 0.0, 2.0, 0.0, 9.0, 1.0]),
        throat_fines=np.array([1, 0, 2, 0, 3, 1]),
        blocked=np.array([True, False, False, False, False, True]),
    )
    analysis = SimpleNamespace(
        network=network,
        occupancy=occupancy,
        conductance_initial=np.ones(6),
        conductance_damaged=np.array([0.0, 1.0, 0.5, 0.6, 1.0, 0.05]),
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
