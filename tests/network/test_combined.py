"""The mean of all spheres and section-archie, on grains that resolved flow knows."""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.network.flow.depth import Layers, scaled_layers
from fdnet.network.permeability import analyse, compare
from fdnet.network.resolved import coarse_flow, measured
from fdnet.network.resolved.coarse_flow import WITHOUT_FINES, resolved_sections
from fdnet.network.resolved.combined import carried_over, combined, in_series
from fdnet.network.resolved.slab import Sides, cut_out
from fdnet.network.stokes.staggered import OPEN
from fdnet.network.stokes.stokes import StokesFlow, extrapolate, solve_slab
from fdnet.spheres.snapshot import Kind, Snapshot
from tests.network.packs import random_pack, with_fines

SIDES = "yz"


def one(*values):
    return [np.array([float(value)]) for value in values]


@pytest.fixture(scope="module")
def pack():
    """Fines lie in the first third alone."""
    crowd = with_fines(random_pack(40, aspect=2.0), 60, 0.2)
    return crowd.where((crowd.kind == Kind.GRAIN) | (crowd.position[:, 0] < crowd.box[0, 1] / 3.0))


@pytest.fixture(scope="module", autouse=True)
def fines_by_the_network():
    """No section is small enough for resolved flow with fines (`test_known.py`)."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measured, "WITH_FINES", replace(measured.WITH_FINES, most_cells=0))
        yield


@pytest.fixture(scope="module")
def by_law(pack, fines_by_the_network):
    laws = ["auto", "combined", "all-spheres", "section-archie"]
    pairs = [("lubrication", law) for law in laws]
    return dict(zip(laws, compare(pack, periodic=SIDES, sections=2, laws=pairs), strict=True))


def test_two_equal_values_have_themselves_as_mean():
    assert combined(*one(1, 0.3, 0.3)) == pytest.approx(0.3)


def test_the_weights_are_those_of_the_errors():
    """Both err by 4 % where ln k/k0 is -0.04 / 0.13; there the mean is halfway."""
    whole = float(np.exp(-0.04 / 0.13))
    assert combined(*one(1, whole, 0.6)) == pytest.approx(np.sqrt(0.6 * whole))
    light, heavy = combined(*one(1, 0.99, 0.9)), combined(*one(1, 0.05, 0.1))
    assert light == pytest.approx(0.9, rel=1e-3)
    assert heavy == pytest.approx(0.05, rel=0.01)


def test_a_closed_section_is_what_all_spheres_says_it_is():
    assert combined(*one(1, 0.0, 0.2)) == 0.0
    assert combined(*one(1, 0.2, 0.0)) == pytest.approx(0.2)
    assert combined(*one(0, 0.0, 0.0)) == 0.0


def test_the_grains_carry_over_as_far_as_the_fines_leave_them():
    assert carried_over(*one(1.0, 0.9, 1.0)) == pytest.approx(0.9)
    assert carried_over(*one(1.0, 0.9, 0.5)) == pytest.approx(0.5 * 0.9**0.5)
    assert carried_over(*one(1.0, 0.9, 0.0)) == 0.0


def test_auto_takes_it_and_it_lies_between_its_parts(by_law):
    auto, parts = by_law["auto"], (by_law["all-spheres"], by_law["section-archie"])
    assert (auto.damage_law_used, auto.damage_law_other) == ("combined", "section-archie")
    assert auto.k_damaged == by_law["combined"].k_damaged
    assert auto.k_damaged_other == parts[1].k_damaged
    kept = [law.sections[0].k_damaged / law.sections[0].k_initial for law in (auto, *parts)]
    assert min(kept[1:]) * 0.97 < kept[0] < max(kept[1:]) * 1.03
    assert auto.sections[1].k_reduction == 0.0


def test_sections_without_fines_are_by_resolved_flow(pack, by_law):
    auto, first = by_law["auto"], by_law["auto"].sections[0]
    assert auto.counts["sections_resolved"] == 1  # two take more cells than are allowed
    span = first.x_lo, first.x_hi
    slab = cut_out(pack.grains(), span, (False, True, True))
    fine = extrapolate(*(solve_slab(slab, span, cells=cells) for cells in (56, 72)))
    assert first.k_initial == pytest.approx(fine.k, rel=0.02)
    for name in ("all-spheres", "section-archie"):
        k = [one.k_initial for one in by_law[name].sections]
        assert (k[0] == first.k_initial) == (name == "all-spheres")
        assert k[1] == auto.sections[1].k_initial
    edges = np.array([first.x_lo, first.x_hi, auto.sections[1].x_hi])
    for name, whole in (("k_initial", auto.k_initial), ("k_damaged", auto.k_damaged)):
        inplace = np.array([getattr(one, f"{name}_inplace") for one in auto.sections])
        assert in_series(inplace, edges) == pytest.approx(whole)


def test_layers_agree_with_the_sections(by_law):
    auto, plain = by_law["auto"], by_law["all-spheres"]
    inside = auto.layers.edges[1:] <= auto.sections[0].x_hi
    for name in ("k_initial", "k_damaged"):
        factor = getattr(auto.layers, name)[inside] / getattr(plain.layers, name)[inside]
        one, other = (getattr(law.sections[0], f"{name}_inplace") for law in (auto, plain))
        assert factor == pytest.approx(one / other)


def test_drops_of_scaled_layers_add_up_to_the_whole():
    """Two sections of one layer each, of k 1 and 3; the first falls to a half."""
    start = np.ones(2), 1.0
    layers = Layers(
        edges=np.array([0.0, 1.0, 2.0]),
        k_initial=np.array([1.0, 3.0]),
        k_damaged=np.array([1.0, 3.0]),
        drop_initial=np.array([0.75, 0.25]),
        drop_damaged=np.array([0.75, 0.25]),
        fines_count=np.zeros(2, int),
    )
    whole = (2.0 / (2.0 + 1.0 / 3.0)) / (2.0 / (1.0 + 1.0 / 3.0))
    scaled = scaled_layers(layers, layers.edges, start, (np.array([0.5, 1.0]), whole))
    assert scaled.k_damaged == pytest.approx([0.5, 3.0])
    assert scaled.drop_damaged == pytest.approx([6.0 / 7.0, 1.0 / 7.0])
    assert scaled.drop_initial == pytest.approx(layers.drop_initial)


def test_the_sections_at_the_face_are_solved_first(pack):
    edges, sides = np.linspace(*pack.box[0], 3), Sides(periodic=(False, True, True), walls="slip")
    slab = cut_out(pack.grains(), (edges[0], edges[1]), sides.periodic)
    size = coarse_flow._size(slab, WITHOUT_FINES.cells(slab)[1], OPEN)
    grids = replace(WITHOUT_FINES, most_cells=int(1.5 * size))
    k, refused = resolved_sections(
        pack.grains(), edges, sides, wanted=np.ones(2, bool), grids=grids
    )
    assert np.isfinite(k).tolist() == [True, False]
    assert not refused


@pytest.mark.parametrize("periodic", [(True, True, True), (False, False, True)])
def test_no_section_is_solved_where_x_repeats_or_walls_slip(pack, periodic):
    sides, every = Sides(periodic=periodic, walls="slip"), np.ones(1, bool)
    k, _ = resolved_sections(pack.grains(), pack.box[0], sides, wanted=every, grids=WITHOUT_FINES)
    assert np.all(np.isnan(k))


def test_grids_that_disagree_leave_the_network(pack, monkeypatch):
    monkeypatch.setattr(coarse_flow, "LARGEST_ERROR", 1e-4)
    result = analyse(pack, periodic=SIDES, sections=2)
    assert result.counts["sections_resolved"] == 0
    assert any("section 1 without fines was left to the network" in t for t in result.warnings)
    plain = analyse(pack, periodic=SIDES, sections=2, damage_law="section-archie")
    assert result.k_initial == plain.k_initial


def test_moved_grains_keep_the_network_and_weigh_the_fines_alone(pack):
    """All spheres come 1.2 times closer along x, and fines are weighed by the closer grains."""
    closer = pack.position * [1.0 / 1.2, 1.0, 1.0]
    result, whole, two_scale = compare(
        pack.grains(),
        replace(pack, position=closer),
        periodic=SIDES,
        laws=[("lubrication", name) for name in ("combined", "all-spheres", "section-archie")],
    )
    assert result.damage_law_used == "combined"
    assert result.counts["sections_resolved"] == 0
    k = (result.k_moved, whole.k_damaged, two_scale.k_damaged)
    assert result.k_damaged == pytest.approx(float(combined(*one(*k))[0]))
    assert result.k_moved < 0.9 * result.k_initial


def test_a_coarse_grid_far_above_the_fine_one_leaves_the_network(pack, monkeypatch):
    """The extrapolation would be negative."""
    flows = iter([3.0, 1.0, 3.0, 1.0])
    monkeypatch.setattr(
        coarse_flow,
        "solve_slab",
        lambda *_, cells, **__: StokesFlow(
            k=next(flows), iterations=1, residual=0.0, seconds=0.0, cells=cells, unknowns=1
        ),
    )
    sides = Sides(periodic=(False, True, True), walls="no-slip")
    edges, every = np.linspace(*pack.box[0], 3), np.ones(2, bool)
    k, refused = resolved_sections(pack.grains(), edges, sides, wanted=every, grids=WITHOUT_FINES)
    assert np.all(np.isnan(k))
    (text,) = refused.values()  # the other section takes more cells than are left
    assert "two grids give 3 and 1 m2, too far apart" in text


def test_many_spheres_have_section_archie_alone(pack, monkeypatch):
    monkeypatch.setattr(measured, "MOST_SPHERES", len(pack) - 1)
    large = analyse(pack, periodic=SIDES)
    assert (large.damage_law_used, large.damage_law_other) == ("section-archie", "side-kozeny")
    assert large.k_damaged == analyse(pack, periodic=SIDES, damage_law="section-archie").k_damaged
    whole = analyse(pack, periodic=SIDES, damage_law="side-kozeny")
    assert large.k_damaged_other == pytest.approx(whole.k_damaged)
    intact_grains = analyse(pack.grains(), periodic=SIDES)
    assert intact_grains.damage_law_used is None
    assert intact_grains.k_damaged == intact_grains.k_initial


def test_fines_in_the_open_that_the_finer_network_counts_as_gain_still_cost():
    """In the voids of a lattice all spheres are above the grains; section-archie has 2 %."""
    grains, fines = (np.indices(n).reshape(3, -1).T for n in ((3, 4, 4), (2, 4, 4)))
    lattice = Snapshot.from_arrays(
        1e-3 * np.vstack([grains + 0.5, fines + 1.0]),
        1e-3 * np.repeat([0.5, 0.1], [len(grains), len(fines)]),
        kind=np.repeat([Kind.GRAIN, Kind.FINE], [len(grains), len(fines)]),
        box=1e-3 * np.array([[0, 3], [0, 4], [0, 4]]),
    )
    lattice = replace(
        lattice, **{n: 0.3 * getattr(lattice, n) for n in ("position", "radius", "box")}
    )
    result = analyse(lattice, periodic=SIDES)
    assert result.counts["all_spheres_above_grains"] == 1
    assert result.layers.drop_damaged.sum() == pytest.approx(1.0)  # 0.9 mm are the specimen
    assert result.k_damaged == pytest.approx(result.k_damaged_other)
    assert result.k_damaged < 0.99 * result.k_initial
