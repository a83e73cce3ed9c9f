"""The benchmark: its spheres, a run that ends and one that does not, and a whole run's cost."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from validation.benchmark import ROOT, grains_of, measured, network_rows, seated


def test_spheres_are_tiles_with_fines_on_the_grains():
    rng = np.random.default_rng(1)
    grains = grains_of(1000, rng)
    fines = seated(grains, 500, rng)
    size, radius = grains.box[:, 1], grains.radius[0]
    assert (len(grains), len(fines)) == (1080, 500)
    assert np.all((grains.position >= 0) & (grains.position <= size))
    nearest = cKDTree(grains.position % size, boxsize=size).query(fines.position % size)[0]
    assert nearest == pytest.approx(np.full(500, 1.1 * radius), rel=2e-4)


def test_how_a_process_ended_is_a_row(tmp_path):
    [failed] = measured(["fdnet", str(tmp_path / "none.npz"), ""], ROOT, 60)
    assert failed["status"].startswith("exit 1: FileNotFoundError")
    [late] = measured(["fdnet", str(tmp_path / "none.npz"), ""], ROOT, 0.01)
    assert late["status"] == "stopped after 0.01 s"


@pytest.mark.nightly
def test_every_step_of_a_size_is_a_row():
    rows = list(network_rows([40], 2.0, [ROOT], 600))
    assert {row["status"] for row in rows} == {"ok"}
    steps = [row["step"] for row in rows]
    assert steps[:3] == ["tessellate", "conductance", "solve"]
    assert "whole, all-spheres" in steps
    assert all(20 < row["peak_MB"] < 4000 and row["grains"] == 40 for row in rows)
