"""The study of the velocity field, in its quick form."""

import numpy as np
import pytest

from validation.command import run_study
from validation.engine.table import read_rows
from validation.network.velocity_field import FLUXES, STUDY, VELOCITY, pore_points
from validation.truth import simple_cubic


def test_errors_fall_with_the_cells(tmp_path):
    run_study(STUDY, tmp_path / "out", quick=True)
    rows = read_rows(tmp_path / "out" / "velocity-field.csv")
    for quantity in (VELOCITY, FLUXES):
        errors = {row.value: row.error for row in rows if row.quantity == quantity}
        assert 0.0 < errors[7] < 0.7 * errors[5]


def test_points_of_the_pores_are_a_share_of_the_porosity():
    """Simple cubic lattice of volume fraction 0.216: by 4,000 points to 0.02 (3 sigma)."""
    pack = simple_cubic(0.216)
    place = pore_points(pack, 4000, 1)
    assert len(place) / 4000 == pytest.approx(1.0 - 0.216, abs=0.02)
    apart = place[:, None] - pack.position
    apart -= np.ptp(pack.box, axis=1) * np.round(apart / np.ptp(pack.box, axis=1))
    assert np.linalg.norm(apart, axis=2).min() > pack.radius[0]
