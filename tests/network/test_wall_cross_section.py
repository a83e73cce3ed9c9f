"""Side walls that hold the fluid: sections against finite differences, and effect on packs."""

import numpy as np
import pytest

from fdnet.case.tables import AnalysisChoices
from fdnet.errors import CaseError, NetworkError
from fdnet.network.flow.flow import solve_flow
from fdnet.network.laws import lubrication
from fdnet.network.laws.cross_section import wall_cuts
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.named import LAWS
from fdnet.network.laws.reaching_grains import cut_corners
from fdnet.network.laws.wedges import ratio_table
from fdnet.network.network import build_network
from fdnet.network.permeability import analyse
from fdnet.network.states import cut_out
from tests.network.one_section import edge_flux, uneven_flux, wall_flux
from tests.network.packs import random_pack, simple_cubic, snapshot, with_fines
from tests.network.walled_section import resolved_flux

NONE = (False,) * 3


@pytest.mark.parametrize(
    ("place", "disc"),
    [
        ((1.0, 1.0, 2.0), (1.0, 1.0)),
        ((1.0, 1.5, 2.1), (1.0, 1.0)),
        ((1.5, 1.5, 2.0), (1.0, 1.0)),
        ((1.0, 1.0, 2.0), (0.5, 0.5)),
        ((1.0, 2.2, 1.7), (1.0, 1.0)),
        ((0.6, 1.3, 2.2), (1.0, 0.7)),
        ((0.0, 1.0, 2.2), (1.0, 1.0)),
    ],
    ids=[
        "touching all",
        "one raised",
        "both raised",
        "small discs",
        "steep",
        "cut and unequal",
        "on the wall",
    ],
)
def test_half_section_against_finite_differences(place, disc):
    flux = wall_flux(np.array(place), *disc, ratio_table())
    assert flux == pytest.approx(resolved_flux(place, disc), rel=0.06)


@pytest.mark.parametrize("disc", [1.0, 0.8, 0.5, 0.2])
@pytest.mark.parametrize("far", [1.0, 1.5, 2.0])
def test_quarter_section_of_an_edge_against_finite_differences(far, disc):
    flux = edge_flux(np.array([1.0, far]), disc, ratio_table())
    exact = resolved_flux((1.0, 1.0, far), (disc, 0.0), edge=True)
    assert flux == pytest.approx(exact, rel=0.06)


def test_a_disc_over_the_edge_of_the_box_leaves_nothing():
    flux = edge_flux(np.array([1.0, 1.0]), np.array([1.5, 1.4]), ratio_table())
    assert flux[0] == 0.0
    assert flux[1] > 0.0


def test_two_thin_discs_far_apart_leave_a_channel_with_one_wall():
    """Between the wall and the free line of centres, L >> H: L H^3 / 3 except near the discs."""
    for along in (20.0, 30.0, 40.0):
        flux = wall_flux(np.array([1.0, 1.0, along]), 0.01, 0.01, ratio_table())
        assert flux == pytest.approx((along - 1.0) / 3.0, rel=0.05)


def test_centre_of_the_touching_circle_outside_still_leaves_a_flux():
    place, disc = (1.2, 2.8, 1.3), (1.0, 1.0)
    flux = wall_flux(np.array(place), *disc, ratio_table())
    assert 0.5 * resolved_flux(place, disc) < flux < resolved_flux(place, disc)


def test_swapping_the_discs_leaves_the_flux():
    one = wall_flux(np.array([1.0, 1.6, 2.1]), 0.9, 0.7, ratio_table())
    assert one == pytest.approx(
        wall_flux(np.array([1.6, 1.0, 2.1]), 0.7, 0.9, ratio_table()), rel=1e-3
    )


def test_overlapping_discs_leave_nothing():
    assert wall_flux(np.array([0.2, 0.2, 0.5]), 1.0, 1.0, ratio_table()) == 0.0


PACKS = {
    "next to walls": lambda: random_pack(100, 0.5, periodic=False),
    "cut by walls": lambda: random_pack(100),
    "radii 1:2": lambda: random_pack(100, spread=0.33),
    "simple cubic": lambda: simple_cubic(4),
}


def permeability(pack, walls, periodic=NONE, law="lubrication"):
    network = build_network(pack, periodic=periodic, walls=walls)
    return solve_flow(network, LAWS[law](network)).inflow * np.ptp(pack.box[0]) / network.area


@pytest.mark.parametrize("pack", PACKS)
def test_walls_that_hold_the_fluid_leave_less_of_it(pack):
    pack = PACKS[pack]()
    assert 0.2 < permeability(pack, "no-slip") / permeability(pack, "slip") < 0.8


@pytest.mark.parametrize("pack", PACKS)
def test_every_throat_cut_by_one_wall_is_a_grain_its_image_and_another(pack):
    network = build_network(PACKS[pack](), periodic=NONE, walls="no-slip")
    order, place, part = wall_cuts(network)
    ends = network.pore_group[network.throat_pores]
    free = ends[:, 0] != ends[:, 1]
    half = free & (network.throat_share == 0.5)
    assert np.all(order[half] >= 0)
    assert np.all(part[network.throat_share == 1] == 1)
    wall = network.box[1:].ravel()
    for t in np.flatnonzero(half)[:50]:
        side = network.throat_corner[t][:, 1:]
        heights = np.abs(np.repeat(side, 2, axis=1) - wall)
        assert np.any(np.all(np.isclose(heights[order[t]], place[t, :2, None], atol=1e-9), axis=0))


@pytest.mark.parametrize("pack", PACKS)
def test_every_throat_along_an_edge_is_a_grain_and_two_images(pack):
    network = build_network(PACKS[pack](), periodic=NONE, walls="no-slip")
    order, place, part = wall_cuts(network)
    ends = network.pore_group[network.throat_pores]
    edge = np.flatnonzero((ends[:, 0] != ends[:, 1]) & (network.throat_share == 0.25))
    assert len(edge) > 20
    assert np.all(order[edge, 0] >= 0)
    assert np.all(order[edge, 1] == -1)
    assert np.all(part[edge] == 2.0)
    wall = network.box[1:]
    for t in edge:
        grain = network.throat_corner[t][order[t, 0], 1:]
        heights = np.abs(grain[:, None] - wall).min(axis=1)
        assert heights == pytest.approx(place[t, :2], abs=1e-9 * network.grain_radius)


def test_a_throat_cut_by_a_wall_carries_less_than_half_of_one_that_slips():
    pack = random_pack(100, 0.5, periodic=False)
    network = build_network(pack, periodic=NONE, walls="no-slip")
    order, place, _ = wall_cuts(network)
    cut = np.flatnonzero((order[:, 0] >= 0) & (network.throat_share == 0.5))
    assert len(cut) > 100
    for t in cut:
        i, j = order[t]
        disc = network.throat_corner_radius[t]
        held = wall_flux(place[t], disc[i], disc[j], ratio_table())
        (h, g, apart), r, s = place[t], disc[i], disc[j]
        lower = np.array([[0.0, 0.0], [2 * h, 0.0], [h + g, apart]])
        upper = np.array([[0.0, 0.0], [2 * g, 0.0], [h + g, apart]])
        slips = uneven_flux(lower, np.array([r, r, s]), ratio_table())
        slips += uneven_flux(upper, np.array([s, s, r]), ratio_table())
        assert held < 0.5 * slips


def test_periodic_sides_and_other_laws_know_no_walls():
    pack = random_pack(100)
    assert permeability(pack, "no-slip", (False, True, True)) == permeability(
        pack, "slip", (False, True, True)
    )
    assert permeability(pack, "no-slip", law="effective") == permeability(
        pack, "slip", law="effective"
    )


def test_a_grain_centred_on_a_wall_has_one_triangle_for_the_whole_section():
    """A row of grains on the wall and others above: a small lift splits each triangle in two."""
    pack = random_pack(60, 0.45, periodic=False)
    measured = []
    for lift in (0.0, 1e-4):
        position = pack.position.copy()
        near = np.argsort(position[:, 1])[:4]
        position[near, 1] = lift
        moved = snapshot(position, 1.0, pack.box)
        measured.append(permeability(moved, "no-slip", (True, False, True)))
        cuts = wall_cuts(build_network(moved, periodic=(True, False, True), walls="no-slip"))
        assert np.any(cuts[2] == 2.0) == (lift == 0.0)
    assert measured[0] == pytest.approx(measured[1], rel=2e-2)


def test_half_resistances_are_those_of_the_law():
    network = build_network(random_pack(100, 0.5, periodic=False), periodic=NONE, walls="no-slip")
    assert LAWS["lubrication"](network) == pytest.approx(
        1.0 / half_resistances(network).sum(axis=1)
    )


def test_throats_that_walls_cut_are_narrowed_and_cut_by_pressure_planes_as_others(monkeypatch):
    """The same of them change as where walls slip."""
    pack = random_pack(100, 0.5, periodic=False)
    third = np.ptp(pack.box[0]) / 3.0
    slab = cut_out(pack, (pack.box[0, 0] + third, pack.box[0, 1] - third), NONE)
    narrowed, cut = [], []
    for walls in ("slip", "no-slip"):
        network = build_network(slab, periodic=NONE, walls=walls)
        ends = network.pore_group[network.throat_pores]
        some = (ends[:, 0] != ends[:, 1]) & (network.throat_share < 1.0)
        plain, fourth = (half_resistances(network, fourth=one)[some] for one in (False, True))
        narrowed.append(plain != fourth)
        with monkeypatch.context() as without:
            without.setattr(lubrication, "cut_corners", lambda *given: 0.0 * cut_corners(*given))
            cut.append(half_resistances(network)[some] != plain)
    for slips, holds in (narrowed, cut):
        assert np.count_nonzero(slips) > 20
        assert np.mean(slips != holds) < 0.02


def test_unknown_walls_are_refused():
    with pytest.raises(NetworkError, match=r"'sticky'.*slip"):
        build_network(random_pack(60), periodic=NONE, walls="sticky")
    with pytest.raises(CaseError, match=r"analysis.walls: 'sticky'.*slip"):
        analyse(
            random_pack(60), None, periodic=NONE, options=AnalysisChoices.of_pack(walls="sticky")
        )


def test_an_analysis_holds_the_fluid_at_the_walls_unless_told_otherwise():
    pack = random_pack(100, 0.5, periodic=False)
    measured = {
        options.walls: analyse(pack, None, periodic=NONE, options=options).k_initial
        for options in (AnalysisChoices.of_pack(), AnalysisChoices.of_pack(walls="slip"))
    }
    assert measured == pytest.approx(
        {walls: permeability(pack, walls) for walls in ("slip", "no-slip")}, rel=1e-9
    )


def test_fines_beside_walls_that_hold_the_fluid_leave_less_of_it():
    pack = with_fines(random_pack(60, 0.5, periodic=False), 150, 0.2)
    analysis = analyse(pack.grains(), pack, periodic=NONE, options=AnalysisChoices.of_pack())
    assert 0.0 < analysis.k_damaged < analysis.k_initial


def test_many_sections_at_once_are_those_asked_for_one_by_one():
    place, table = np.array([1.0, 1.6, 2.1]), ratio_table()
    discs = np.linspace(0.2, 1.0, 9), np.linspace(0.9, 0.1, 9)
    flux = wall_flux(place, *discs, table)
    single = [wall_flux(place, *pair, table) for pair in zip(*discs, strict=True)]
    assert flux == pytest.approx(single, rel=1e-13)
