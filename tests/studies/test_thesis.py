"""The specimens of the thesis, on a simple cubic lattice with fines placed by hand.

Cells of edge A with grains of radius R = A/2 are pores of radius (sqrt(3)/2 - 1/2) A; their faces
are two throats each, of length A and radius (1/sqrt(2) - 1/2) A. Layers of whole cells are centred
at 0.6, 1.1 and 1.6 mm; the faces of the specimen cut the layers at the ends.
"""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pandas as pd
import pytest
from builders import resting_spheres, tiny

from fdnet.errors import CaseError
from fdnet.spheres.snapshot import Kind
from validation.thesis import command
from validation.thesis import quantities as q
from validation.thesis.compare import half_width, mean_of, rows_of
from validation.thesis.figures import Sources, draw_all
from validation.thesis.runs import Planned, State, find_state, planned, read_state, write_state

MM, A, R = 1e-3, 0.5, 0.25
TUBE, WIDE, THIN, APART = (1 / sqrt(2) - 0.5) * A, 0.1, 0.02, 2e-4
# x, y, z, radius in mm, midway between two cells; the wide ones apart, so that none is left out
FINES = [
    [0.6, 0.0, 0.25, 0.05],
    [0.6, 0.5 + 0.5, 0.25 + 0.08, THIN],
    [0.6 + 0.11, 0.5, 0.75, THIN],
    *([0.6, 0.5 + y, 1.25 + z, WIDE] for y, z in ((-APART, 0.0), (APART, 0.0), (0.0, APART))),
    [1.6, 1.0, 1.25, 0.05],
    [-0.3, 0.5, 0.5, 0.05],
]
ITEM, BALL = Planned(group="specimen", name="specimen5"), 4 / 3 * pi


@pytest.fixture(scope="module")
def state():
    case = tiny("box.size_mm=[2.2,2.0,2.0]", "box.sides=periodic", "analysis.sections=2")
    box = MM * np.array([[0.0, 2.2], [0.0, 2.0], [0.0, 2.0]])
    x, side = 0.35 + A * np.arange(4), A * np.arange(4)
    place = MM * np.stack(np.meshgrid(x, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    grains = resting_spheres(place, R * MM, box, kind=Kind.GRAIN)
    fines = MM * np.array(FINES)
    small = resting_spheres(fines[:, :3], 1.0, box, kind=Kind.FINE, first=1000)
    ending = dict.fromkeys(("passed", "stop_reason", "seconds", "pack_seconds", "max_overlap"), 0)
    ending |= {"supplied": 8, "steps": 1000, "dt_s": 2e-6}
    damaged = grains.joined(replace(small, radius=fines[:, 3]))
    return State(case=case, grains=grains, damaged=damaged, ending=ending)


@pytest.fixture(scope="module")
def run(state):
    return q.examine(ITEM, state)


@pytest.fixture(scope="module")
def results(root):
    return pd.read_csv(root / "docs/thesis/results.csv")


def test_the_plan_names_every_run_once_and_the_rows_are_of_it(results):
    plan = {(one.id, one.seed) for one in planned()}
    made = {*zip(results.id, results.seed, strict=True)}
    assert len(plan) == len(planned()) == len(made) + 2
    soft = ("specimen1 run.stiffness_N_m=100.0", 2)
    assert (plan - made, made - plan) == ({soft, ("quick-specimen5 fines.count=3840", 2)}, set())
    assert all(one.load().seed == one.seed for one in planned(quick=True))


def test_a_state_is_kept_to_a_nanometre_and_a_wrong_one_refused(state, tmp_path):
    write_state(tmp_path / "a.npz", state)
    kept = read_state(tmp_path / "a.npz")
    assert (kept.case, kept.ending) == (state.case, state.ending)
    for one, other in ((kept.grains, state.grains), (kept.damaged, state.damaged)):
        assert np.array_equal([one.id, one.kind], [other.id, other.kind])
        assert np.abs(one.position - other.position).max() < 1e-9
    (tmp_path / ITEM.file).write_bytes((tmp_path / "a.npz").read_bytes())
    with pytest.raises(CaseError, match="is the state of another case"):
        find_state(tmp_path, ITEM)
    with pytest.raises(CaseError, match="holds no state and no results"):
        command.main(["--redraw", "--out", str(tmp_path / "none")])


def test_fines_are_counted_by_depth(run):
    row, _ = q.result_rows(run)
    assert (row["supplied_count"], row["invaded_count"], row["count_first_mm"]) == (8, 7, 6)
    assert row["mean_depth_mm"] == pytest.approx((6 * 0.6 + 0.11 + 1.6) / 7)
    assert (row["fraction_first_0p25mm"], row["fraction_beyond_0p5mm"]) == (0, 1)
    # three almost at one place count once
    filled = BALL * (0.05**3 + 2 * THIN**3 + WIDE**3)
    assert row["porosity_loss_first_mm"] == pytest.approx(filled / 4.4, rel=0.02)


def test_sizes_of_the_lattice_and_parts_cut_by_the_face(run):
    section = q.first_section(run, q.WHOLE)
    # 16 cells; their faces across y and z, and those towards the second layer, at 0.85 mm
    assert section.weight["throat"].sum() == 2 * (32 + 16)
    pore = (sqrt(3) / 2 - 0.5) * A
    for name, size in (("pore radius", pore), ("throat radius", TUBE), ("throat length", A)):
        assert q.measure(section, name, (0.999 * size, 1.001 * size)) == (1.0, "share")
        assert q.measure(section, name, (0.0, 0.999 * size)) == (0.0, "share")
    cut = q.first_section(run, q.CUT)
    filled = np.sum(cut.weight["pore"] * cut.network.pore_tetra_volume)
    assert filled == pytest.approx((0.35 + A) * 4.0 * MM**3)  # 0.35 mm of the layer at the face


def test_fines_in_throats_and_bodies(run):
    section, occupancy = q.first_section(run, q.WHOLE), run.thesis.occupancy
    bodies = BALL * 0.05**3 + 2 * BALL * THIN**3 + 3 * BALL * WIDE**3
    # what lies of the third fine in its throats: the only one not wholly inside
    third = 1e9 * occupancy.pair_volume[np.isclose(occupancy.pair_distance, 0.11 / TUBE)]
    throats = 2 * (BALL * 0.05**3 + BALL * THIN**3 + 3 * BALL * WIDE**3) + third.sum()
    expected = {
        "throats with fines": 8 / 96,
        "throats without fines": 88 / 96,
        "throats blocked": 0,
        "throats of radius 0": 0,
        "volume of fines in throats": throats,
        "volume of fines in pore bodies": bodies,
        "share of throats in the volume of fines": throats / (throats + bodies),
        "overall throat porosity": 1 - throats / (96 * pi * TUBE**2 * A),
        "overall pore-body porosity": 1 - bodies / (16 * (A**3 - BALL * R**3)),
        "mean porosity of throats with fines": 1 - throats / (8 * pi * TUBE**2 * A),
    }
    measured = {name: q.measure(section, name, None)[0] for name in q.SINGLES}
    assert measured == pytest.approx(expected)


def test_intervals_of_the_textbooks():
    """Student's t is 4.3027 for 2 degrees of freedom, 2.7764 for 4."""
    one, other = mean_of([1.0, 2.0, 3.0]), mean_of([4.0, 5.0, 6.0])
    assert half_width(one) == pytest.approx(4.3027 / sqrt(3), rel=1e-4)
    assert half_width(one, other) == pytest.approx(2.7764 * sqrt(2 / 3), rel=1e-4)
    assert mean_of([10.0], [1.0, 2.0, 3.0], grows=True).variance == pytest.approx(25.0)  # widened


@pytest.mark.nightly
def test_every_figure_is_drawn_small(run, results, tmp_path):
    names = [f"specimen{number}" for number in range(1, 9)]
    runs = {name: [replace(run, item=replace(ITEM, name=name))] * 2 for name in names}
    figures = {one["figure"] for one in draw_all(Sources(runs, results), tmp_path)}
    assert {*map(str, [*range(14, 23), 42, *range(44, 73)])} <= figures
    drawn = {path.stem.removeprefix("figure_") for path in tmp_path.glob("*.png")}
    assert figures - drawn == {"57"}  # no fine lies in a throat of that class here
    assert all(path.stat().st_size < 100_000 for path in tmp_path.glob("*.png"))


def test_every_kept_state_is_that_of_its_run():
    """`find_state` refuses one of another case."""
    kept = sorted(path.name for path in command.STATES.glob("*-seed*.npz"))
    plan = {item.file: item for item in planned(quick=False)}
    assert len(kept) > 20
    assert all(find_state(command.STATES, plan[name]) is not None for name in kept)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["specimen1", "specimen5"])
def test_a_kept_state_gives_its_rows_again(results, name):
    """Whatever the processor: sorts and roots that differ between instruction sets are avoided."""
    item = replace(ITEM, name=name)
    for row in q.result_rows(q.examine(item, find_state(command.STATES, item))):
        known = rows_of(results, name, f"{row['law']}, {row['damage_law']}").iloc[0]
        for column in (one for one, value in row.items() if isinstance(value, float)):
            wanted = pytest.approx(known[column], rel=1e-6, abs=1e-9, nan_ok=True)
            assert row[column] == wanted, column


@pytest.mark.liggghts
@pytest.mark.nightly
def test_quick_forms_run_to_their_end_and_are_drawn_again(binary, tmp_path, monkeypatch):
    plan = [one for one in planned(quick=True) if one.name in ("quick-specimen7", "quick-table3")]
    monkeypatch.setattr(command, "planned", lambda quick: plan)
    words = ["--out", str(tmp_path / "out")]
    assert command.main([*words, "--quick"]) == 0
    table = tmp_path / "out" / "results.csv"
    assert [*pd.read_csv(table).id[::2]] == [one.id for one in plan]
    before = table.read_bytes()
    (tmp_path / "out" / "states" / plan[0].file).unlink()
    assert command.main([*words, "--redraw"]) == 0
    assert table.read_bytes() == before
