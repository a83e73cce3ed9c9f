"""The external cake, and what fines do to throats: beds, columns, classes by width and ratio."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fdnet.report.text import cake_words
from fdnet.run.bridging import wilsons_band
from fdnet.run.cake import cake_rows, cake_summary, measure_cake
from fdnet.spheres.snapshot import Kind, Snapshot
from tests.network.packs import simple_cubic
from validation.truth import names as read_names
from validation.truth import read_pack
from validation.truth_solved import CAKES

SIDES = (False, True, True)
ROOT = Path(__file__).parents[2]


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
    box = np.column_stack([np.zeros(3), size])
    return Snapshot.from_arrays(position, radius, box=box, kind=kind)


def test_a_cubic_bed_has_the_permeability_of_zick_and_homsy():
    """k = 0.00252 d^2 of a simple cubic lattice of touching spheres (1982); porosity 0.4764."""
    cake = measure_cake(as_cake(simple_cubic(repeat=8), lone=True), SIDES)
    assert cake.thickness == pytest.approx(16.0)
    assert cake.count.tolist() == [64] * 8
    assert cake.porosity == pytest.approx(0.476401, abs=2e-3)
    assert cake.diameter == pytest.approx(2.0)
    k = [row["k_m2"] for row in cake_rows(cake)]
    assert k[1:-2] == pytest.approx([0.00252 * 4.0] * 5, rel=0.2), "not next to the face"
    assert cake.permeability == pytest.approx(0.00252 * 4.0, rel=0.2)
    own = cake.thickness / cake.permeability
    summary = cake_summary(cake, 2.0 * own)
    assert summary["cake_resistance_share"] == pytest.approx(1 / 3, rel=1e-12)
    assert summary["cake"]["resistance_1_m"] == pytest.approx(own, rel=1e-12)
    assert cake_summary(cake, float("inf"))["cake_resistance_share"] == 0.0


def test_what_is_thin_or_hangs_by_one_contact_is_no_cake_yet():
    thin = cake_summary(measure_cake(as_cake(simple_cubic(repeat=2)), SIDES), 1.0)
    assert thin["cake"]["k_m2"] is None
    said = "no cake yet: packed for 2.0 diameters of a fine, 3 are needed"
    assert thin["cake"]["no_cake_yet"] == said
    assert "no cake yet" in cake_words(thin)
    place = np.ones((9, 3))
    place[:, 0] = 0.5 - np.arange(9)  # eight in a row before a grain
    kind, box = [Kind.GRAIN] + [Kind.FINE] * 8, np.array([[0.0, 4.0], [0.0, 2.0], [0.0, 2.0]])
    assert measure_cake(Snapshot.from_arrays(place, 0.5, box=box, kind=kind), SIDES) is None
    assert cake_words(cake_summary(None, 1.0)) == "no cake yet: no fine stands before the face"


@pytest.mark.parametrize("name", read_names(CAKES))
def test_cakes_that_liggghts_made_resist_as_resolved_flow_does(name):
    """Within 20 %; many fines are in flight before two of them, and none is of the cake."""
    row = pd.read_csv(ROOT / "docs/validation/cakes.csv").set_index("cake").loc[name]
    spheres = read_pack(name, CAKES)
    cake = measure_cake(spheres, SIDES)
    assert cake.count.sum() == row["fines"]
    assert cake.thickness == pytest.approx(1e-3 * row["thickness_mm"], rel=1e-3)
    assert cake.resistance.sum() == pytest.approx(row["law_1_m"], rel=1e-3)
    assert cake.resistance.sum() == pytest.approx(row["resolved_1_m"], rel=0.2)
    assert row["error"] < 0.06
    assert 0.40 < cake.packed_porosity < 0.50


def test_wilsons_band():
    """Values of Brown, Cai and DasGupta (2001), and Newcombe (1998) for 81 of 263."""
    for hits, trials, band in [
        (0, 10, (0.0, 0.2775)),
        (5, 10, (0.2366, 0.7634)),
        (10, 10, (0.7225, 1.0)),
        (81, 263, (0.2553, 0.3662)),
    ]:
        assert wilsons_band(hits, trials) == pytest.approx(band, abs=5e-5), (hits, trials)
    assert all((wilsons_band(0, n)[0], wilsons_band(n, n)[1]) == (0.0, 1.0) for n in range(1, 99))
