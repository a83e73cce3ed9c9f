"""Figures: drawn for every kind of specimen; the cut circles checked against the closed form."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.image import imread
from report_demo import demo_analysis, demo_damaged, demo_grains, snapshot_of

from fdnet.report import figures
from fdnet.report.figures import PlacedSizes, cut_circles, fill_size_curves
from fdnet.sizes import LogNormal, cut_curve
from fdnet.spheres.snapshot import Kind

HISTORY = [
    {
        "physical_time_s": 1e-4 * i,
        "invaded_count": i,
        "passed_count": 0,
        "upstream_count": 50 - i,
    }
    for i in range(50)
]
DAMAGE = {"porosity_reduction", "invaded_fraction", "permeability_ratio"}


def coloured_share(path):
    picture = imread(path)[..., :3]
    return float((picture.min(axis=2) < 0.95).mean())


def test_all_figures_of_a_damaged_specimen(tmp_path):
    paths = figures.draw_all(tmp_path / "figures", demo_analysis(), demo_damaged(), HISTORY)
    assert {path.stem for path in paths} == set(figures.CAPTIONS) - {"spheres_3d", "size_curves"}
    assert sorted(paths) == sorted((tmp_path / "figures").iterdir())
    assert all(imread(path).shape[1] >= 900 and coloured_share(path) > 0.02 for path in paths)


def test_an_intact_pack_gets_no_figures_of_damage(tmp_path):
    none = {"occupancy": None, "invaded_count": 0, "layers": None}
    intact = SimpleNamespace(**(vars(demo_analysis()) | none))
    stems = {path.stem for path in figures.draw_all(tmp_path, intact, demo_grains())}
    assert stems == {"side_view", "depth", "network", "size_distributions"}


def test_sections_without_flow_fines_of_one_size_and_no_invasion_can_be_drawn(tmp_path):
    dead = [copy.copy(s) for s in demo_analysis().sections]
    dead[0].k_initial = dead[0].k_initial_inplace = 0.0
    fines = snapshot_of([[-1e-4, 1e-3, 1e-3]], 5e-5, Kind.FINE, first_id=900)
    values = {"sections": tuple(dead), "k_initial": 0.0, "invaded_count": 0}
    analysis = SimpleNamespace(**(vars(demo_analysis()) | values))
    stems = {
        path.stem for path in figures.draw_all(tmp_path, analysis, demo_grains().joined(fines))
    }
    assert stems >= DAMAGE


def test_a_ratio_to_nothing_is_no_number():
    assert figures._ratios([1.0, 2.0], [2.0, 0.0]) == pytest.approx([0.5, np.nan], nan_ok=True)


def test_cut_circles_are_pythagoras():
    position = np.array([[1.0, 0.0, 2.0], [3.0, 3.0, 4.0], [5.0, 5.0, 6.0], [7.0, -5.1, 8.0]])
    index, centre, radius = cut_circles(snapshot_of(position, 5.0, Kind.GRAIN), 0.0)
    assert index.tolist() == [0, 1]  # touching (d = r) is no cut
    assert centre.tolist() == [[1, 2], [3, 4]]
    assert radius == pytest.approx([5.0, 4.0])  # the 3-4-5 triangle


def test_the_curves_of_sizes_are_drawn_over_the_diameter_in_microns(tmp_path):
    """The steps of the placed spheres end at the shares that the cuts leave."""
    from matplotlib.figure import Figure

    curve = cut_curve(LogNormal(40e-6, 0.5), cut=(0.02, 0.95))
    sizes = PlacedSizes(
        name="fines",
        law="log-normal",
        asked={0.5: 40e-6},
        curve=curve,
        placed=curve.strata(500),
        invaded=curve.strata(20),
    )
    figure = Figure()
    fill_size_curves(figure, sizes=[sizes])
    asked, given, placed, invaded = figure.axes[0].get_lines()
    assert given.get_xydata()[0] == pytest.approx([40.0, 50.0])
    assert asked.get_ydata()[[0, -1]] == pytest.approx([2.0, 95.0])
    assert placed.get_ydata()[-1] == pytest.approx(95.0)
    assert np.interp(40.0, placed.get_xdata(), placed.get_ydata()) == pytest.approx(50.0, abs=0.5)
    assert len(invaded.get_xdata()) == 20
    demo = figures.draw_all(tmp_path, demo_analysis(), sizes=[sizes])
    assert "size_curves" in {path.stem for path in demo}
