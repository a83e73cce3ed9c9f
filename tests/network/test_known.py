"""Sections with fines, where few throats carry the flow, by resolved flow."""

from dataclasses import replace
from math import ceil

import numpy as np
import pytest
from scipy.fft import next_fast_len

from fdnet.network.permeability import analyse, compare
from fdnet.network.resolved import coarse_flow, known, measured
from fdnet.network.resolved.combined import in_series
from fdnet.network.resolved.slab import cut_out
from fdnet.network.stokes.stokes import extrapolate, solve_slab
from fdnet.spheres.snapshot import Kind
from tests.network.packs import random_pack, with_fines

SIDES = "yz"
LAWS = ("auto", "all-spheres", "upscaled", "section-archie")
COUNT = "sections_resolved_with_fines"


@pytest.fixture(scope="module")
def pack():
    """Fines lie in the first half alone."""
    crowd = with_fines(random_pack(20, aspect=2.0), 16, 0.25)
    return crowd.where((crowd.kind == Kind.GRAIN) | (crowd.position[:, 0] < crowd.box[0, 1] / 2.0))


@pytest.fixture(scope="module")
def by_law(pack):
    pairs = [("lubrication", law) for law in LAWS]
    return dict(zip(LAWS, compare(pack, periodic=SIDES, sections=2, laws=pairs), strict=True))


@pytest.fixture
def by_the_network(monkeypatch):
    """Resolved flow with fines may have no cells."""
    monkeypatch.setattr(measured, "WITH_FINES", replace(measured.WITH_FINES, most_cells=0))


def test_the_permeability_is_that_of_finer_grids(pack, by_law):
    first = by_law["auto"].sections[0]
    span = first.x_lo, first.x_hi
    slab = cut_out(pack, span, (False, True, True))
    fine = extrapolate(*(solve_slab(slab, span, cells=cells) for cells in (54, 72)))
    assert first.k_damaged == pytest.approx(fine.k, rel=0.02)
    for law in LAWS[:3]:
        assert by_law[law].counts[COUNT] >= 1
        assert by_law[law].sections[0].k_damaged == first.k_damaged
        assert by_law[law].sections[0].k_damaged_resolved
    assert not by_law["section-archie"].sections[0].k_damaged_resolved
    assert COUNT not in by_law["section-archie"].counts
    assert not any("throats carry" in t and "section 1" in t for t in by_law["auto"].warnings)


def test_the_whole_is_that_of_its_sections_in_place(by_law, pack, by_the_network):
    result, plain = by_law["all-spheres"], analyse(pack, periodic=SIDES, sections=2)
    edges = np.array([result.sections[0].x_lo, *(one.x_hi for one in result.sections)])
    inplace = np.array([one.k_damaged_inplace for one in result.sections])
    assert in_series(inplace, edges) == pytest.approx(result.k_damaged)
    assert result.k_damaged_other == plain.k_damaged_other  # what section-archie gives


def test_sections_that_are_too_dear_are_named(pack, by_the_network):
    result = analyse(pack, periodic=SIDES, sections=2, damage_law="all-spheres")
    assert result.counts[COUNT] == 0
    (warning,) = [text for text in result.warnings if text.startswith("few throats carry")]
    assert " in section 1" in warning


def test_grids_that_disagree_are_named_once(pack, monkeypatch):
    """A section that resolved flow was tried on is not named as one with few throats again."""
    true = coarse_flow.estimate
    monkeypatch.setattr(
        coarse_flow,
        "estimate",
        lambda *grids, with_fines: replace(
            true(*grids, with_fines=with_fines), error=0.06 * with_fines
        ),
    )
    result = analyse(pack, periodic=SIDES, sections=2, damage_law="all-spheres")
    assert result.counts[COUNT] == 0
    assert any(t.startswith("section 1 with fines was left") for t in result.warnings)
    assert not any("throats carry" in t and "in section 1" in t for t in result.warnings)


def test_the_grid_is_as_fine_as_grains_or_fines_need(pack):
    longest = float(np.diff(pack.box, axis=1).max())
    grain, fine = (float(one.radius.mean()) for one in (pack.grains(), pack.fines()))
    slender = replace(pack, radius=np.where(pack.kind == Kind.FINE, 0.05 * fine, pack.radius))
    for spheres, wanted in ((pack, 15.0 / grain), (slender, 2.0 / (0.05 * fine))):
        coarse, finer = measured.WITH_FINES.cells(spheres)
        assert finer == next_fast_len(ceil(wanted * longest))
        assert coarse == next_fast_len(ceil(wanted * longest / 1.5))
    assert measured.WITHOUT_FINES.cells(pack.grains())[1] == next_fast_len(
        ceil(10.0 / grain * longest)
    )


def test_many_throats_keep_the_network(pack, monkeypatch):
    monkeypatch.setattr(known, "FEW_THROATS", 1)
    result = analyse(pack, periodic=SIDES, sections=2)
    assert result.counts[COUNT] == 0
    assert not any("few throats" in text for text in result.warnings)


def test_heavy_deposits_keep_the_network(pack, monkeypatch):
    monkeypatch.setattr(known, "LEAST_LEFT", 1.1)
    result = analyse(pack, periodic=SIDES, sections=2)
    assert result.counts[COUNT] == 0
    assert any(text.startswith("few throats carry") for text in result.warnings)


def test_fines_never_raise_the_permeability(pack, monkeypatch):
    """Resolved flow that gives more than without fines is cut to that, and counted."""
    true = measured.resolved_sections

    def doubled(*given, grids, **more):
        k, refused = true(*given, grids=grids, **more)
        return (9.0 * k if grids is measured.WITH_FINES else k), refused

    monkeypatch.setattr(measured, "resolved_sections", doubled)
    result = analyse(pack, periodic=SIDES, sections=2, damage_law="all-spheres")
    assert result.sections[0].k_damaged == result.sections[0].k_initial
    assert result.counts["sections_resolved_above_grains"] == result.counts[COUNT] >= 1


def test_moved_grains_keep_the_network(pack):
    closer = replace(pack, position=pack.position * [1.0 / 1.1, 1.0, 1.0])
    result = analyse(pack.grains(), closer, periodic=SIDES, damage_law="all-spheres")
    assert result.counts[COUNT] == 0
