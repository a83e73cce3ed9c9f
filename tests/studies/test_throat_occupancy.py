"""Volume of a sphere in a cylinder: quadrature converges, two planes have their known bias."""

import numpy as np
import pytest

from fdnet.network.fines.occupancy import GAUSS_POINTS, Pairs
from fdnet.studies.command import run_study
from fdnet.studies.engine.table import read_rows
from fdnet.studies.network.throat_occupancy import STUDY, TWO_PLANE, reference_volume
from fdnet.studies.truth import packs


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    out = tmp_path_factory.mktemp("study")
    run_study(STUDY, out / "out", quick=True)
    return read_rows(out / "out" / "throat-occupancy.csv")


def errors(rows, series, quantity):
    return {
        row.value: row.error for row in rows if row.series == series and row.quantity == quantity
    }


@pytest.mark.parametrize("where", ["inside", "ends"])
@pytest.mark.parametrize("ratio", ["0.2", "1"])
def test_gauss_error_falls_a_hundredfold_per_doubling(rows, ratio, where):
    result = errors(rows, f"a/r = {ratio}", f"largest, {where}")
    assert result[4] > 100 * result[8] > 1e4 * result[16] > 0
    assert result[GAUSS_POINTS] < 5e-7


@pytest.mark.parametrize(("ratio", "bias"), [(0.2, -0.008), (1.0, -0.20)])
def test_two_planes_have_their_published_bias(rows, ratio, bias):
    """Centres uniform around a long tube; measured apart by quadrature of the same reading."""
    assert errors(rows, TWO_PLANE, "bias of the sum, inside")[ratio] == pytest.approx(
        bias, rel=0.03
    )
    assert errors(rows, TWO_PLANE, "largest, inside")[1.0] == pytest.approx(0.25, abs=0.01)


def test_in_a_deposit_the_default_is_converged_and_two_planes_lose_less_than_the_law(rows):
    result = errors(rows, "fines 1/5, 5 points", "k/k0, thesis")
    assert abs(result[GAUSS_POINTS]) < 1e-7
    assert 0.02 < result[TWO_PLANE] < 0.06
    assert set(errors(rows, "fines 1/5, 5 points", "blocked").values()) == {0.0}
    assert errors(rows, "fines 1/5, 5 points", "throat porosity")[TWO_PLANE] > 0


def test_the_reference_has_the_closed_forms():
    """Whole sphere; napkin ring; half of it at an end; a sphere that holds the tube."""
    rows = [
        [0.3, 0.5, 5, 1, 10],
        [2.0, 0.0, 5, 1, 10],
        [2.0, 0.0, 0, 1, 10],
        [30.0, 2.0, 0.5, 1, 1],
        [0.4, 1.5, 5, 1, 9],
    ]
    pairs = Pairs(
        **dict(zip(("sphere", "offset", "depth", "tube", "length"), np.array(rows).T, strict=True))
    )
    ring = 4 / 3 * np.pi * (8 - 3**1.5)
    assert reference_volume(pairs) == pytest.approx(
        [4 / 3 * np.pi * 0.027, ring, ring / 2, np.pi, 0.0], rel=1e-12
    )


def test_packs_that_are_not_there_are_missed_by_name(monkeypatch, tmp_path):
    monkeypatch.setattr(packs, "DATA", tmp_path / "data")
    with pytest.raises(packs.CaseError, match=r"data is not there.*install fdnet again"):
        packs.truth_folder()
