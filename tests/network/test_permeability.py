"""The whole analysis: invariances, sections, fines, moved grains."""

import numpy as np
import pytest

from fdnet.case.tables import AnalysisChoices
from fdnet.errors import CaseError, NetworkError
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS
from fdnet.network.permeability import analyse
from fdnet.spheres.snapshot import Kind, Snapshot
from tests.network.packs import random_pack, simple_cubic, snapshot, with_fines

ALL, FLOW_X, WALLED = (True,) * 3, (False, True, True), (False,) * 3
PAIRS = [("thesis", "thesis"), ("effective", "thesis-code")]
ARCHIE = ("lubrication", "section-archie")


def options(pair=PAIRS[1], **more):
    return AnalysisChoices.of_pack(law=pair[0], damage_law=pair[1], **more)


def rebuilt(pack, position=None, *, scale=1.0, order=None, box=None):
    position = (pack.position if position is None else position) * scale
    order = np.arange(len(pack)) if order is None else order
    return Snapshot(
        step=0,
        time_s=0,
        box=(pack.box if box is None else box) * scale,
        id=pack.id[order],
        kind=pack.kind[order],
        position=position[order],
        radius=pack.radius[order] * scale,
        velocity=pack.velocity,
    )


@pytest.fixture(scope="module")
def pack():
    return with_fines(random_pack(120, aspect=2.0), 400, 0.15)


@pytest.fixture(scope="module")
def walled():
    return with_fines(random_pack(150, 0.52, periodic=False, aspect=2.0), 200, 0.15)


def both(pack, periodic, pair):
    analysis = analyse(pack.grains(), pack, periodic=periodic, options=options(pair))
    return np.array([analysis.k_initial, analysis.k_damaged])


@pytest.mark.parametrize("periodic", [ALL, FLOW_X, WALLED])
@pytest.mark.parametrize("pair", PAIRS)
def test_renumbering_quarter_turn_mirror_and_scale_leave_k(pack, walled, periodic, pair):
    spheres = walled if periodic == WALLED else pack
    k = both(spheres, periodic, pair)
    rng = np.random.default_rng(8)
    assert both(
        rebuilt(spheres, order=rng.permutation(len(spheres))), periodic, pair
    ) == pytest.approx(k, rel=1e-5)
    high = spheres.box[:, 1]
    turned = np.stack(
        [spheres.position[:, 0], high[2] - spheres.position[:, 2], spheres.position[:, 1]], axis=1
    )
    assert both(rebuilt(spheres, turned), periodic, pair) == pytest.approx(k, rel=1e-5)
    for axis in range(3):
        mirrored = spheres.position.copy()
        mirrored[:, axis] = high[axis] - mirrored[:, axis]
        assert both(rebuilt(spheres, mirrored), periodic, pair) == pytest.approx(k, rel=1e-5)
    assert both(rebuilt(spheres, scale=2.5e-4), periodic, pair) == pytest.approx(
        k * 6.25e-8, rel=1e-5
    )


@pytest.mark.parametrize("periodic", [ALL, FLOW_X, WALLED])
def test_box_may_start_anywhere(walled, periodic):
    offset = np.array([5.0, -3.0, 2.0])
    moved = rebuilt(walled, walled.position + offset, box=walled.box + offset[:, None])
    here, there = (
        analyse(one.grains(), one, periodic=periodic, options=options(sections=3))
        for one in (walled, moved)
    )
    assert there.k_damaged == pytest.approx(here.k_damaged, rel=1e-5)
    assert there.porosity_damaged == pytest.approx(here.porosity_damaged, abs=1e-9)
    assert there.invasion_depth == pytest.approx(here.invasion_depth)
    assert [one.k_damaged_inplace for one in there.sections] == pytest.approx(
        [one.k_damaged_inplace for one in here.sections], rel=1e-5
    )


def test_shifting_a_periodic_pack_leaves_k(pack):
    k = both(pack, ALL, PAIRS[1])
    moved = (pack.position + np.array([3.3, 1.7, 5.1])) % pack.box[:, 1]
    assert both(rebuilt(pack, moved), ALL, PAIRS[1]) == pytest.approx(k, rel=1e-5)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("damage_law", ["thesis", "thesis-code", "section-archie"])
def test_fines_never_raise_k(pack, law, damage_law):
    analysis = analyse(pack.grains(), pack, periodic=FLOW_X, options=options((law, damage_law)))
    assert 0 < analysis.k_damaged < analysis.k_initial
    assert np.all(analysis.conductance_damaged <= analysis.conductance_initial)
    assert analysis.k_reduction == pytest.approx(1 - analysis.k_damaged / analysis.k_initial)
    assert analysis.porosity_damaged < analysis.porosity_initial


def test_more_fines_lower_k_with_the_default_law(pack):
    grains, fines = pack.grains(), pack.fines()
    k = [
        analyse(
            grains,
            grains.joined(fines.where(np.arange(len(fines)) < count)),
            periodic=FLOW_X,
            options=options(),
        ).k_damaged
        for count in (0, 100, 200, 400)
    ]
    assert np.all(np.diff(k) < 0)
    assert k[0] == pytest.approx(
        analyse(grains, None, periodic=FLOW_X, options=options()).k_initial
    )


@pytest.mark.parametrize("periodic", [ALL, FLOW_X, WALLED])
@pytest.mark.parametrize("sections", [5, "uneven"])
def test_inplace_sections_recombine_in_series(pack, periodic, sections):
    length = pack.box[0, 1]
    wanted = (
        sections if sections == 5 else [0.0, 0.13 * length, 0.2 * length, 0.71 * length, length]
    )
    analysis = analyse(pack.grains(), pack, periodic=periodic, options=options(sections=wanted))
    for k, name in (
        (analysis.k_initial, "k_initial_inplace"),
        (analysis.k_damaged, "k_damaged_inplace"),
    ):
        resistance = [(one.x_hi - one.x_lo) / getattr(one, name) for one in analysis.sections]
        assert length / sum(resistance) == pytest.approx(k, rel=1e-9)
        assert min(resistance) > 0


def test_inplace_sections_of_a_period_move_with_the_pack(pack):
    """Shifted by half a period the two halves change places; all in-place values stay."""
    moved = pack.position.copy()
    moved[:, 0] = (moved[:, 0] + 0.5 * pack.box[0, 1]) % pack.box[0, 1]
    here, there = (
        analyse(one.grains(), one, periodic=ALL, options=options(sections=2)).sections
        for one in (pack, rebuilt(pack, moved))
    )
    assert abs(here[0].k_damaged_inplace / here[1].k_damaged_inplace - 1) > 0.01
    for name in ("k_initial_inplace", "k_damaged_inplace"):
        first, second = (
            [getattr(one, name) for one in sections] for sections in (here, there[::-1])
        )
        assert first == pytest.approx(second, rel=1e-5)


def test_one_section_is_the_whole_specimen(pack):
    analysis = analyse(pack.grains(), pack, periodic=FLOW_X, options=options())
    (section,) = analysis.sections
    assert section.k_initial == pytest.approx(analysis.k_initial)
    assert section.k_damaged_inplace == pytest.approx(analysis.k_damaged)
    assert section.porosity_initial == pytest.approx(analysis.porosity_initial)
    assert section.fines_count == analysis.invaded_count == 400


def test_damage_shows_in_the_section_that_holds_the_fines(pack):
    grains, fines, length = pack.grains(), pack.fines(), pack.box[0, 1]
    near = fines.where(fines.position[:, 0] < 0.2 * length)
    analysis = analyse(
        grains, grains.joined(near), periodic=FLOW_X, options=options(ARCHIE, sections=4)
    )
    reduction = [one.k_reduction for one in analysis.sections]
    assert reduction[0] > 0.1
    assert reduction[2] == reduction[3] == 0.0
    assert [one.fines_fraction for one in analysis.sections] == [1.0, 0, 0, 0]
    assert analysis.profile.fines_fraction.sum() == pytest.approx(1.0)
    assert analysis.invasion_depth == near.position[:, 0].max()
    assert analysis.invasion_depth_p95 == pytest.approx(np.quantile(near.position[:, 0], 0.95))
    assert analysis.invaded_volume == pytest.approx(len(near) * 4 / 3 * np.pi * 0.15**3)


def test_face_sealed_by_fines_is_zero_with_a_warning():
    """One fine in each throat of the first layer of a lattice covers it (rule of the thesis)."""
    grains = simple_cubic(4)
    network = analyse(grains, None, periodic=FLOW_X, options=options(("thesis", "thesis"))).network
    first = network.throat_ends.mean(axis=1)
    cork = first[
        (np.abs(np.diff(network.throat_ends[:, :, 0], axis=1)[:, 0]) > 1e-6) & (first[:, 0] < 3)
    ]
    spheres = grains.joined(snapshot(cork, 0.9, grains.box, Kind.FINE))
    spheres = rebuilt(spheres)
    analysis = analyse(
        grains, spheres, periodic=FLOW_X, options=options(("thesis", "thesis"), sections=2)
    )
    assert analysis.k_damaged == 0.0
    assert analysis.k_reduction == 1.0
    assert any("no open path" in one for one in analysis.warnings)
    assert analysis.sections[0].k_damaged_inplace == 0.0
    assert analysis.sections[0].k_damaged == 0.0


def test_moved_grains_make_a_second_network(pack):
    grains = pack.grains()
    rng = np.random.default_rng(1)
    shifted = rebuilt(
        pack,
        pack.position
        + 0.02 * rng.normal(size=pack.position.shape) * (pack.kind == Kind.GRAIN)[:, None],
    )
    analysis = analyse(grains, shifted, periodic=ALL, options=options())
    assert analysis.k_moved == pytest.approx(
        analyse(shifted.grains(), None, periodic=ALL, options=options()).k_initial, rel=1e-9
    )
    assert analysis.k_initial == pytest.approx(
        analyse(grains, None, periodic=ALL, options=options()).k_initial, rel=1e-9
    )
    assert analysis.k_damaged < analysis.k_moved != analysis.k_initial
    assert (
        len(analysis.conductance_initial)
        == len(analysis.network.throat_radius)
        == len(analysis.flow_initial.throat_flux)
    )


def test_grains_in_another_order_or_wrapped_have_not_moved(pack):
    grains = pack.grains()
    order = np.random.default_rng(2).permutation(len(pack))
    assert (
        analyse(grains, rebuilt(pack, order=order), periodic=ALL, options=options()).k_moved
        is None
    )
    across = pack.position + pack.box[:, 1] * (np.arange(len(pack)) % 2)[:, None]
    assert analyse(grains, rebuilt(pack, across), periodic=ALL, options=options()).k_moved is None


def test_solver_reports_the_worst_of_all_solves(pack):
    analysis = analyse(pack.grains(), pack, periodic=WALLED, options=options(sections=3))
    assert 0 < analysis.solver["mass_balance"] < 1e-6
    assert analysis.solver["mass_balance"] >= analysis.flow_initial.mass_balance
    assert set(analysis.seconds) == {"tessellate", "occupancy", "conductance", "solve", "porosity"}


@pytest.mark.parametrize(
    "wrong",
    [
        {"law": "magic"},
        {"damage_law": "magic"},
        {"sections": [0.0, 1.0]},
        {"sections": []},
        {"sections": 0},
        {"profile_bin_mm": 0.0},
    ],
)
def test_wrong_choices_are_refused(pack, wrong):
    with pytest.raises(CaseError, match=next(iter(wrong))):
        analyse(pack.grains(), None, periodic=ALL, options=AnalysisChoices.of_pack(**wrong))


def test_another_pack_after_the_invasion_is_refused(pack):
    fewer = pack.where(np.arange(len(pack)) > 0)
    with pytest.raises(NetworkError, match="differ"):
        analyse(pack.grains(), fewer, periodic=ALL, options=options())


def test_laws_named_by_the_contract_exist():
    assert set(LAWS) == {"thesis", "effective", "lubrication"}
    assert set(DAMAGE_LAWS) == {"thesis", "thesis-code", "section-archie"}


def test_fines_all_outside_the_box_are_told_of(pack):
    away = snapshot([[-1.0, 1.0, 1.0]], 0.1, pack.box, Kind.FINE)
    analysis = analyse(
        pack.grains(), pack.grains().joined(away), periodic=(False, True, True), options=options()
    )
    assert analysis.k_damaged == analysis.k_initial
    assert any(
        "none of the 1 fines is centred in the box" in warning for warning in analysis.warnings
    )


def test_throats_that_do_not_conduct_are_counted(pack):
    analysis = analyse(pack.grains(), None, periodic=ALL, options=options(("thesis", "thesis")))
    assert analysis.counts["throats_not_conducting"] == int(
        np.sum(analysis.network.throat_radius == 0)
    )


def test_sections_of_one_grain_diameter_are_not_thin():
    """Sections of 0.5 mm between rounded planes, and grains of 0.5 mm."""
    lattice = (np.indices((8, 2, 2)).reshape(3, -1).T + 0.5) * 0.5e-3
    spheres = Snapshot.from_arrays(lattice, 0.25e-3, box=[(0, 4e-3), (0, 1e-3), (0, 1e-3)])
    texts = [
        [one for one in analyse(spheres, sections=count).warnings if "thinner" in one]
        for count in (8, 9)
    ]
    assert texts[0] == []
    assert len(texts[1]) == 1
    assert "the mean grain diameter (0.5 mm)" in texts[1][0]
    assert texts[1][0].endswith("take fewer sections: analysis.sections = 8 or less")
