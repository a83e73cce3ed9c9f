"""Comparisons with numbers from outside: statistics, set-ups, quick forms, committed rows."""

import math

import numpy as np
import pandas as pd
import pytest

from fdnet.errors import CaseError
from fdnet.mechanics.springs import PackMaterial
from fdnet.report.tables import write_rows
from fdnet.spheres.snapshot import resting
from validation import bridging, mechanics, outside
from validation.comparisons import findings, read_rows, table
from validation.outside import Clogging, clogging, fitted_line, geometric_chance

OPEN = {
    "ln P of a clog, friction 0.1",
    "the same with LAMMPS's contacts",
    "moduli, walls at the sides: Young's, 1.9 mm over 3 mm",
    "k of sand of quartz, 35 MPa over 0",
}
"""What disagrees, and is said to."""


def test_runs_that_clog_while_the_heap_grows_are_not_counted():
    """0.3 R^3 fines lie under the arch of a hole: 2.4 at R = 2."""
    one = clogging([(2, True), (3, True), (15, True), (95, False)], 2.0)
    assert one == Clogging(counts=(0, 12, 92), clogs=2, early=1)
    assert one.band[0] == pytest.approx(2 / 106)
    assert clogging([(9, True)], 3.0).counts == (0,)
    none = clogging([(1000, False)], 1.0)
    assert none.band == (0.0, 0.0, pytest.approx(1 - 0.025 ** (1 / 999)))


def test_geometric_samples_are_told_from_others():
    rng = np.random.default_rng(4)
    chances = [geometric_chance(tuple(rng.geometric(0.02, 40) - 1)) for _ in range(20)]
    assert 0.2 < np.mean(chances) < 0.8
    assert geometric_chance((50,) * 40) == 0.0
    assert geometric_chance((0,) * 30 + (500,) * 10) < 0.01


def test_the_fitted_line_is_found_again():
    holes = {}
    for ratio in (1.75, 2.0, 2.5, 3.0, 4.0):
        chance = math.exp(-0.4 - 0.7 * (ratio**2 - 1))
        clogs = 4 if ratio == 4.0 else 10_000
        holes[ratio] = Clogging((round(clogs * (1 - chance) / chance), 0), clogs, 0)
    line = fitted_line(holes)
    assert (line.slope, line.start) == pytest.approx((-0.7, -0.4), rel=1e-3)
    assert line.holes == (1.75, 2.0, 2.5, 3.0)
    assert (line.explained, line.chance) == (pytest.approx(1.0), pytest.approx(1.0, abs=0.01))
    bent = holes | {1.75: holes[1.75]._replace(counts=(2 * holes[1.75].counts[0], 0))}
    assert fitted_line(bent).chance < 1e-6
    few = holes | {1.75: holes[1.75]._replace(early=2), 2.0: holes[2.0]._replace(early=2)}
    assert fitted_line(few) is None


def test_slipping_begins_where_both_closed_forms_agree():
    slope = math.degrees(math.atan(3.5 * 0.3))
    below, above = (outside.rolling_gain(slope * (1 + e)) for e in (-1e-9, 1e-9))
    assert below == pytest.approx(above, rel=1e-7)
    assert outside.rolling_gain(30.0) == pytest.approx(5 / 14)
    assert outside.rolling_gain(90.0) == pytest.approx(1.0)
    assert outside.resisted_gain(11.0) == 0
    angle = math.radians(20.0)
    exact = 5 / 7 * math.cos(angle) * (math.tan(angle) - 0.2)
    assert outside.resisted_gain(20.0) == pytest.approx(exact)


@pytest.mark.parametrize("ratio", [1.5, 2.75, 4.0])
def test_the_wall_leaves_a_hole_of_that_diameter_and_no_other(ratio):
    wall, small, side = outside.wall_spheres(ratio)
    from_axis = np.hypot(wall[:, 1], wall[:, 2]) - small
    assert from_axis.min() == pytest.approx(ratio * outside.FINE)
    assert len(wall) == len(np.unique(np.round(wall / small, 6), axis=0))
    grid = np.linspace(-0.5 * side, 0.5 * side, 150)
    y, z = (axis.ravel() for axis in np.meshgrid(grid, grid))
    beside = np.hypot(y, z) > ratio * outside.FINE
    gap = np.stack([y[beside], z[beside]], axis=1)[:, None] - wall[None, :, 1:]
    gap -= side * np.round(gap / side)
    assert np.sqrt(np.sum(gap**2, axis=2)).min(axis=1).max() < small + 0.5 * outside.FINE


def test_the_fines_before_the_wall_touch_nothing():
    start = outside.heap_of(2.0, seed=1)
    fines, size = start.fines(), np.ptp(start.box, axis=1)
    gap = fines.position[:, None] - fines.position[None]
    gap -= size * np.round(gap / size)
    distance = np.sqrt(np.sum(gap**2, axis=2))[np.triu_indices(len(fines), 1)]
    assert distance.min() > 2 * outside.FINE
    assert fines.position[:, 0].max() < -2 * outside.FINE


def test_a_column_gives_way_under_the_flow_as_an_even_load_on_springs():
    """Five grains, six springs k, a force F on each: the middle one moves by 9 F / 2 k."""
    r = 2.5e-4
    place = np.column_stack([(2 * np.arange(5) + 1) * r, np.full(5, r), np.full(5, r)])
    column = resting(place, r, np.array([[0, 10 * r], [0, 2 * r], [0, 2 * r]]))
    smooth = PackMaterial(normal=3e6, shear=1e-3)
    moved = mechanics.displacement_under_flow(column, smooth, 1e9, periodic=(False,) * 3)
    assert moved[2, 0] == pytest.approx(4.5 * 1e9 * 8 * r**3 / 3e6, rel=1e-6)


def test_the_closed_throats_of_runs_add_up(tmp_path):
    """Also where the last class has no upper end."""
    for number, (throats, closed) in enumerate([(2, 1), (2, 2)]):
        (tmp_path / f"{number}").mkdir()
        rows = [
            bridging.class_row(0.1, 0.2, 0.3, [throats, 0, 0, closed, closed], 3.0),
            bridging.class_row(0.1, 1.5, math.inf, [1, 0, 0, 1, 1], 1.0),
        ]
        write_rows(tmp_path / f"{number}" / "bridging.csv", rows)
    runs = [str(tmp_path / "0"), str(tmp_path / "1")]
    command = [*runs, "--csv", str(tmp_path / "all.csv"), "--png", str(tmp_path / "all.png")]
    assert bridging.main(command) == 0
    narrow, wide = pd.read_csv(tmp_path / "all.csv").to_dict("records")
    assert (narrow["throats"], narrow["closed"], narrow["arrived_mean"]) == (4, 3, 1.5)
    assert narrow["share_low"] < 0.75 < narrow["share_high"]
    assert (wide["throats"], wide["closed"], wide["ratio_lo"]) == (2, 2, 1.5)
    with pytest.raises(CaseError, match="is missing"):
        bridging.main([str(tmp_path), "--csv", str(tmp_path / "none.csv")])


@pytest.mark.liggghts
@pytest.mark.parametrize("overlap", [0.0, 0.03, 0.05])
def test_fines_pass_the_throat_of_three_grains_up_to_half_a_percent(overlap, tmp_path):
    """The numbers 0.1547, 0.1201 and 0.0970."""
    exact = outside.passing_ratio(overlap)
    assert round(exact, 4) == {0.0: 0.1547, 0.03: 0.1201, 0.05: 0.0970}[overlap]
    assert outside.passes(0.995 * exact, overlap, tmp_path / "a", seed=1)
    assert not outside.passes(1.005 * exact, overlap, tmp_path / "b", seed=1)


@pytest.mark.liggghts
@pytest.mark.parametrize(
    ("chapter", "name"),
    [
        (outside, "fine on a slope"),
        (outside, "fine on a slope with rolling friction"),
        (outside, "free fine"),
        (outside, "constriction, friction 0.5"),
        (mechanics, "moduli, periodic sides"),
        pytest.param(outside, "single fines in a loose pack", marks=pytest.mark.nightly),
        pytest.param(outside, "constriction, friction 0.1", marks=pytest.mark.nightly),
        pytest.param(mechanics, "unbonded test, LIGGGHTS", marks=pytest.mark.nightly),
    ],
)
def test_a_quick_form_agrees_and_gives_the_committed_numbers(chapter, name, root, tmp_path):
    """Those that have the settings of the full form are the same to six digits."""
    own = chapter.__name__.removeprefix("validation.")
    command = ["--quick", "--only", name, "--out", str(tmp_path)]
    assert chapter.main(command) == 0
    rows = read_rows(tmp_path / f"{own}.csv")
    assert set(rows.status) == {"done"}
    assert all(one.verdict == "agrees" for one in findings(chapter.CHAPTER.comparisons, rows))
    keys = ["comparison", "value", "seed", "quantity"]
    known = read_rows(root / "docs" / "validation" / f"{own}.csv")
    texts = [one.assign(value=one.value.astype(str)) for one in (rows, known)]
    both = texts[0].merge(texts[1], on=keys, suffixes=("", "_known"))
    if "loose pack" not in name and "constriction" not in name:
        assert len(both) == len(rows)
        apart = (both.observed - both.observed_known).abs()
        assert (apart <= 1e-6 * both.observed_known.abs() + 1e-12).all()
    (picture,) = tmp_path.glob("*.png")
    assert picture.stat().st_size > 10_000


def test_a_command_goes_on_where_it_was_stopped(tmp_path, capsys):
    """What the CSV has is not measured again."""
    command = ["--quick", "--only", "Ergun's bed", "--out", str(tmp_path)]
    assert outside.main(command) == 0
    path = tmp_path / "outside.csv"
    first = path.read_text()
    path.write_text(first.replace("0.0145", "0.0146"))
    assert outside.main(command) == 0
    assert path.read_text() == first.replace("0.0145", "0.0146")
    assert "agrees" in capsys.readouterr().out


def test_the_page_has_the_table_of_the_committed_rows(root):
    page = (root / "docs" / "evidence" / "outside.md").read_text(encoding="utf-8")
    lines = []
    for chapter, own in ((outside, "outside"), (mechanics, "mechanics")):
        rows = read_rows(root / "docs" / "validation" / f"{own}.csv")
        lines += findings(chapter.CHAPTER.comparisons, rows)
    assert table([line for line in lines if line.source != mechanics.ITSELF]) in page
    assert {line.what for line in lines if line.verdict == "**disagrees**"} == OPEN
