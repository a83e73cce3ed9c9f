"""The packs of the Stokes truth: made again from their seeds, porosity, table from grids."""

import numpy as np
import pytest

from fdnet.spheres.geometry import measure_porosity
from validation.truth import packs
from validation.truth.grids import make, tabulated
from validation.truth.made_packs import touching_three
from validation.truth.packs import DATA, read_pack

STATED = {
    "packE_80_eps30": 0.30,
    "packF_80_eps45": 0.45,
    "packG_100_radii12_eps38": 0.38,
    "packH_40_eps40": 0.40,
    "packH_r5_d13": 0.27,
    "packH_r5_d17": 0.23,
    "packH_r5_d20": 0.20,
}


@pytest.mark.parametrize("name", STATED)
def test_porosity_as_stated(name):
    pack, edge = read_pack(DATA / f"{name}.csv")
    assert measure_porosity(pack, periodic=(True,) * 3).mean == pytest.approx(
        STATED[name], abs=0.001
    )
    assert np.all((pack.position >= 0.0) & (pack.position <= edge * 1e-3))
    assert len(pack.fines()) == 0 or np.all(pack.fines().radius == pytest.approx(1e-4))


def test_a_pack_is_made_again_from_its_seed(tmp_path):
    make(["packF_80_eps45"], tmp_path)
    made, stored = (read_pack(folder / "packF_80_eps45.csv")[0] for folder in (tmp_path, DATA))
    np.testing.assert_allclose(made.position, stored.position, atol=1e-8)


def test_seats_touch_three():
    corner = np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.3, 0.9, 0.2]])
    reach = np.array([0.7, 0.8, 0.6])
    place = touching_three(corner, reach, np.random.default_rng(2))
    np.testing.assert_allclose(np.linalg.norm(corner - place, axis=1), reach, rtol=1e-12)
    assert touching_three(corner, 0.3 * reach, np.random.default_rng(2)) is None


def test_the_table_takes_the_two_finest_grids():
    def row(case: str, cells: int, k: float) -> dict[str, str]:
        values = {
            "case": case,
            "file": f"{case}.csv",
            "edge_mm": "1",
            "axis": "x",
            "cells": str(cells),
            "k_mm2": str(k),
        }
        return values | {"iterations": "1", "slip": "0.01", "unknowns": "9", "seconds": "1"}

    exact = {"packH_40_eps40": 2.0, "packH_r5_d13": 0.5}
    rows = [row(case, n, k + 7.0 / n**2) for case, k in exact.items() for n in (96, 144)]
    rows.append(row("packH_40_eps40", 12, 99.0))
    table = {entry["case"]: entry for entry in tabulated(rows)}
    assert float(table["packH_40_eps40"]["k_mm2"]) == pytest.approx(2.0, rel=1e-5)
    assert float(table["packH_r5_d13"]["k_over_k0"]) == pytest.approx(0.25, rel=1e-3)
    assert table["packH_r5_d13"]["source"].endswith("N=96+144")


def test_packs_that_are_not_there_are_missed_by_name(monkeypatch, tmp_path):
    monkeypatch.setattr(packs, "DATA", tmp_path / "data")
    with pytest.raises(packs.CaseError, match=r"data is not there.*install fdnet again"):
        packs.truth_folder()
