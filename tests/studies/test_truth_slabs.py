"""The slabs of the Stokes truth: their files, their cases, and the table from grids."""

import numpy as np
import pytest

from fdnet.errors import CaseError
from fdnet.network.stokes import StokesFlow, solve_slab
from fdnet.spheres.snapshot import Kind, resting
from validation.engine.csv_rows import read_named
from validation.truth.made_slabs import SLABS
from validation.truth.slab_grids import (
    DEPOSIT,
    GRAINS,
    TOLERANCE,
    limit,
    slab_table,
    tabulated,
)
from validation.truth.slabs import (
    SLAB_FOLDER,
    SLAB_GRIDS,
    SLAB_TRUTH,
    YES,
    read_specimen,
    write_specimen,
)
from validation.truth.specimens import SPECIMENS


def flow(cells: int, k: float) -> StokesFlow:
    return StokesFlow(k=k, iterations=1, residual=0.01, seconds=1.0, cells=cells, unknowns=9)


def test_limit_of_three_grids():
    """k = 3 + 50 h^2: it is found, also from the finest three of four grids."""
    grids = [flow(n, 3.0 + 50.0 / n**2) for n in (96, 72, 120)]
    end = limit([flow(48, 9.0), *grids])
    assert end.k_mm2 == pytest.approx(3.0, rel=1e-12)
    assert end.order == pytest.approx(2.0, rel=1e-6)
    assert end.relative_error == 2.0 * TOLERANCE


@pytest.mark.parametrize("order", [1.7, 2.6])
def test_limit_shows_another_order(order):
    end = limit([flow(n, 3.0 + 50.0 * n**-order) for n in (72, 96, 120)])
    assert end.order == pytest.approx(order, rel=1e-6)


def test_the_error_covers_what_the_grids_scatter():
    """Each of three grids is off by up to 0.5 %, in 200 draws: the error is too small in few."""
    rng = np.random.default_rng(3)
    missed = 0
    for _ in range(200):
        grids = [
            flow(n, (3.0 + 3e3 / n**2) * (1.0 + 0.005 * rng.uniform(-1, 1))) for n in (72, 96, 120)
        ]
        end = limit(grids)
        missed += abs(end.k_mm2 - 3.0) / 3.0 > end.relative_error
    assert missed < 60


def test_limit_without_an_order():
    """Two grids show no order, nor do three of which the middle one stands out."""
    two = limit([flow(60, 3.0 + 50.0 / 60**2), flow(120, 3.0 + 50.0 / 120**2)])
    assert (two.order, two.k_mm2) == (None, pytest.approx(3.0))
    assert limit([flow(60, 3.0), flow(72, 3.2), flow(96, 3.1)]).order is None


def test_the_table_of_a_slab():
    def row(solid: str, cells: int, k: float) -> dict[str, str]:
        return {
            "slab": "slabG_r3_range_cake",
            "solid": solid,
            "cells": str(cells),
            "k_mm2": str(k + 7.0 / cells**2),
            "iterations": "1",
            "slip": "0.01",
            "unknowns": "9",
            "seconds": "1",
        }

    rows = [row(GRAINS, n, 2.0) for n in (60, 72, 96)]
    assert tabulated(rows) == []
    rows += [row(DEPOSIT, n, 0.5) for n in (96, 60, 72)]
    [entry] = tabulated(rows)
    assert float(entry["k_over_k0"]) == pytest.approx(0.25, rel=1e-3)
    assert entry["order"] == "2.00"
    assert (entry["file"], entry["known_before"]) == ("slabG_r3_range_cake.csv", YES)
    assert entry["grids"] == "60+72+96"


def test_a_specimen_is_read_as_it_was_written(tmp_path):
    place = np.array([[-1e-4, 2e-4, 3e-4], [1.234567e-3, 1e-4, 0.0]])
    box = np.array([[0.0, 2.5e-3], [0.0, 1.2e-3], [0.0, 1.1e-3]])
    spheres = resting(place, np.array([5e-5, 2.5e-4]), box, np.array([Kind.FINE, Kind.GRAIN]))
    write_specimen(tmp_path / "one.csv", spheres, "seed 7")
    again = read_specimen(tmp_path / "one.csv")
    np.testing.assert_allclose(again.position, place, rtol=1e-12)
    np.testing.assert_allclose(again.radius, spheres.radius, rtol=1e-12)
    np.testing.assert_allclose(again.box, box, rtol=1e-12)
    assert np.array_equal(again.kind, spheres.kind)
    (tmp_path / "bare.csv").write_text("x,y,z,radius\n0,0,0,1\n")
    with pytest.raises(CaseError, match="expected '# box"):
        read_specimen(tmp_path / "bare.csv")


@pytest.mark.parametrize("name", SPECIMENS)
def test_stored_specimens_are_those_of_their_cases(name):
    specimen, spheres = SPECIMENS[name], read_specimen(SLAB_FOLDER / f"{name}.csv")
    case = specimen.case(name)
    np.testing.assert_allclose(spheres.box[:, 1], case.size_m)
    small, large = spheres.fines().radius, spheres.grains().radius
    for radius, given in ((small, specimen.fine_mm), (large, specimen.grain_mm)):
        assert 1e3 * radius.min() >= np.min(given) * (1 - 1e-6)
        assert 1e3 * radius.max() <= np.max(given) * (1 + 1e-6)
    assert len(small) <= specimen.supplied
    if isinstance(specimen.pack, int):
        assert len(large) == specimen.pack


def test_every_slab_has_its_truth():
    rows = {row["slab"]: row for row in read_named(SLAB_FOLDER / SLAB_TRUTH)}
    grids = read_named(SLAB_FOLDER / SLAB_GRIDS)
    solved = {(row["slab"], row["solid"], int(row["cells"])) for row in grids}
    assert set(rows) == set(SLABS)
    assert solved >= {
        (slab.name, solid, count)
        for slab in SLABS.values()
        for solid in (GRAINS, DEPOSIT)
        for count in slab.cells
    }
    for name, slab in SLABS.items():
        assert rows[name]["known_before"] == slab.known_before
        assert len(rows[name]["grids"].split("+")) >= 3
        assert 0.0 < float(rows[name]["k_over_k0"]) < 1.0


def test_stored_truth_of_a_slab_lies_below_a_coarse_grid():
    row = next(r for r in read_named(SLAB_FOLDER / SLAB_TRUTH) if r["slab"] == "slabO_r5_light")
    spheres = read_specimen(SLAB_FOLDER / row["file"])
    for pack, k in ((spheres.grains(), row["k0_mm2"]), (spheres, row["k_mm2"])):
        end = limit(
            [
                flow(n, 1e6 * solve_slab(pack, (0.0, 5e-4), cells=n, tolerance=1e-3).k)
                for n in (36, 48)
            ]
        )
        assert end.k_mm2 == pytest.approx(float(k), rel=0.02)


def test_the_list_of_slabs_has_a_row_for_each():
    assert [row.split(" | ")[0] for row in slab_table(SLAB_FOLDER).splitlines()[2:]] == [
        f"| {name}" for name in SLABS
    ]
