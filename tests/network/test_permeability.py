"""The whole analysis: invariances, sections, fines, moved grains, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.case.tables import AnalysisChoices
from fdnet.errors import CaseError, NetworkError
from fdnet.network.laws.named import LAWS
from fdnet.network.permeability import analyse
from fdnet.spheres.snapshot import Kind, Snapshot
from tests.network.packs import random_pack, simple_cubic, snapshot, with_fines

ALL, FLOW_X, WALLED = (True,) * 3, (False, True, True), (False,) * 3
THESIS, EFFECTIVE = ("thesis", "thesis"), ("effective", "thesis-code")
ARCHIE = ("lubrication", "section-archie")


def analysed(pack, periodic=FLOW_X, laws=EFFECTIVE, *, before=None, **more):
    options = AnalysisChoices.of_pack(law=laws[0], damage_law=laws[1], **more)
    before = pack.grains() if before is None else before
    return analyse(before, pack, periodic=periodic, options=options)


def both(pack, periodic, laws=EFFECTIVE):
    analysis = analysed(pack, periodic, laws)
    return np.array([analysis.k_initial, analysis.k_damaged])


@pytest.fixture(scope="module")
def pack():
    return with_fines(random_pack(80, aspect=2.0), 250, 0.15)


@pytest.fixture(scope="module")
def walled():
    return with_fines(random_pack(100, 0.52, periodic=False, aspect=2.0), 130, 0.15)


@pytest.mark.parametrize("periodic", [ALL, FLOW_X, WALLED])
def test_renumbering_quarter_turn_mirror_scale_and_shift_leave_k(pack, walled, periodic):
    spheres = walled if periodic == WALLED else pack
    place, box = spheres.position, spheres.box
    order = np.random.default_rng(8).permutation(len(spheres))
    turned = np.stack([place[:, 0], box[2, 1] - place[:, 2], place[:, 1]], axis=1)
    others = {"numbered": spheres.where(order), "turned": replace(spheres, position=turned)}
    for axis in range(3):
        mirrored = place.copy()
        mirrored[:, axis] = box[axis, 1] - mirrored[:, axis]
        others[f"mirrored in {axis}"] = replace(spheres, position=mirrored)
    if periodic == ALL:
        shifted = (place + np.array([3.3, 1.7, 5.1])) % box[:, 1]
        others["shifted"] = replace(spheres, position=shifted)
    scale = 2.5e-4
    small = replace(
        spheres, position=scale * place, radius=scale * spheres.radius, box=scale * box
    )
    for laws in (THESIS, EFFECTIVE, ARCHIE):
        k = both(spheres, periodic, laws)
        error = 3e-4 if laws == ARCHIE else 1e-5
        for name, other in others.items() if laws == EFFECTIVE else list(others.items())[:3]:
            assert both(other, periodic, laws) == pytest.approx(k, rel=error), (name, laws)
        assert both(small, periodic, laws) == pytest.approx(k * scale**2, rel=error), laws


def test_fines_never_raise_k_and_more_of_them_lower_it(pack):
    for law in LAWS:
        for damage_law in ("thesis", "thesis-code", "section-archie"):
            one = analysed(pack, laws=(law, damage_law))
            assert 0 < one.k_damaged < one.k_initial, (law, damage_law)
            assert np.all(one.conductance_damaged <= one.conductance_initial)
            assert one.k_reduction == pytest.approx(1 - one.k_damaged / one.k_initial)
            assert one.porosity_damaged < one.porosity_initial
    grains, fines = pack.grains(), pack.fines()
    number = np.arange(len(fines))
    k = [
        analysed(grains.joined(fines.where(number < count))).k_damaged
        for count in (0, 60, 120, 250)
    ]
    assert np.all(np.diff(k) < 0)
    assert k[0] == pytest.approx(analysed(None, before=grains).k_initial)


def test_sections_in_place_recombine_in_series(pack):
    length = pack.box[0, 1]
    for sections in (5, [0.0, 0.13 * length, 0.2 * length, 0.71 * length, length]):
        for periodic in (ALL, FLOW_X, WALLED):
            analysis = analysed(pack, periodic, sections=sections)
            for state in ("initial", "damaged"):
                resistance = [
                    (one.x_hi - one.x_lo) / getattr(one, f"k_{state}_inplace")
                    for one in analysis.sections
                ]
                k = getattr(analysis, f"k_{state}")
                assert length / sum(resistance) == pytest.approx(k, rel=1e-9), periodic
                assert min(resistance) > 0
    # shifted by half a period the two halves change places; all in-place values stay
    moved = pack.position.copy()
    moved[:, 0] = (moved[:, 0] + 0.5 * length) % length
    here, there = (
        analysed(one, ALL, sections=2).sections for one in (pack, replace(pack, position=moved))
    )
    assert abs(here[0].k_damaged_inplace / here[1].k_damaged_inplace - 1) > 0.01
    for name in ("k_initial_inplace", "k_damaged_inplace"):
        first, second = ([getattr(s, name) for s in one] for one in (here, there[::-1]))
        assert first == pytest.approx(second, rel=1e-5)


def test_damage_shows_in_the_section_that_holds_the_fines(pack):
    fines = pack.fines()
    near = fines.where(fines.position[:, 0] < 0.2 * pack.box[0, 1])
    analysis, x = (
        analysed(pack.grains().joined(near), laws=ARCHIE, sections=4),
        near.position[:, 0],
    )
    reduction = [one.k_reduction for one in analysis.sections]
    assert reduction[0] > 0.1
    assert reduction[2] == reduction[3] == 0.0
    assert [one.fines_fraction for one in analysis.sections] == [1.0, 0, 0, 0]
    assert analysis.profile.fines_fraction.sum() == pytest.approx(1.0)
    assert analysis.invasion_depth == x.max()
    assert analysis.invasion_depth_p95 == pytest.approx(np.quantile(x, 0.95))
    assert analysis.invaded_volume == pytest.approx(len(near) * 4 / 3 * np.pi * 0.15**3)


def test_a_face_sealed_by_fines_is_zero_with_a_warning():
    """One fine in each throat of the first layer of a lattice covers it (rule of the thesis)."""
    grains = simple_cubic(4)
    ends = analysed(None, laws=THESIS, before=grains).network.throat_ends
    middle, along = ends.mean(axis=1), np.abs(np.diff(ends[:, :, 0], axis=1)[:, 0])
    cork = middle[(along > 1e-6) & (middle[:, 0] < 3)]
    sealed = grains.joined(snapshot(cork, 0.9, grains.box, Kind.FINE))
    analysis = analysed(sealed, laws=THESIS, sections=2)
    assert (analysis.k_damaged, analysis.k_reduction) == (0.0, 1.0)
    assert any("no open path" in one for one in analysis.warnings)
    assert analysis.sections[0].k_damaged_inplace == analysis.sections[0].k_damaged == 0.0


def test_moved_grains_make_a_second_network_and_renumbered_ones_none(pack):
    grains, rng = pack.grains(), np.random.default_rng(1)
    push = 0.02 * rng.normal(size=pack.position.shape) * (pack.kind == Kind.GRAIN)[:, None]
    shifted = replace(pack, position=pack.position + push)
    analysis = analysed(shifted, ALL, before=grains)
    for spheres, k in ((shifted.grains(), analysis.k_moved), (grains, analysis.k_initial)):
        assert analysed(None, ALL, before=spheres).k_initial == pytest.approx(k, rel=1e-9)
    assert analysis.k_damaged < analysis.k_moved != analysis.k_initial
    throats = len(analysis.network.throat_radius)
    assert len(analysis.conductance_initial) == len(analysis.flow_initial.throat_flux) == throats
    order = rng.permutation(len(pack))
    across = pack.position + pack.box[:, 1] * (np.arange(len(pack)) % 2)[:, None]
    for same in (pack.where(order), replace(pack, position=across)):
        assert analysed(same, ALL, before=grains).k_moved is None
    with pytest.raises(NetworkError, match="differ"):
        analysed(pack.where(np.arange(len(pack)) > 0), ALL, before=grains)


def test_the_solver_reports_the_worst_of_all_solves_and_what_was_closed(pack):
    analysis = analysed(pack, WALLED, THESIS, sections=3)
    assert 0 < analysis.solver["mass_balance"] < 1e-6
    assert analysis.solver["mass_balance"] >= analysis.flow_initial.mass_balance
    assert set(analysis.seconds) == {"tessellate", "occupancy", "conductance", "solve", "porosity"}
    closed = int(np.sum(analysis.network.throat_radius == 0))
    assert analysis.counts["throats_not_conducting"] == closed


def test_wrong_choices_are_refused(pack):
    for wrong in (
        {"law": "magic"},
        {"damage_law": "magic"},
        {"sections": [0.0, 1.0]},
        {"sections": []},
        {"sections": 0},
        {"profile_bin_mm": 0.0},
    ):
        with pytest.raises(CaseError, match=next(iter(wrong))):
            analyse(pack.grains(), None, periodic=ALL, options=AnalysisChoices.of_pack(**wrong))


def test_doubtful_packs_are_told_of(pack):
    away = snapshot([[-1.0, 1.0, 1.0]], 0.1, pack.box, Kind.FINE)
    analysis = analysed(pack.grains().joined(away))
    assert analysis.k_damaged == analysis.k_initial
    text = "none of the 1 fines is centred in the box"
    assert any(text in warning for warning in analysis.warnings)
    # sections of 0.5 mm between rounded planes, and grains of 0.5 mm, are not thin
    lattice = (np.indices((8, 2, 2)).reshape(3, -1).T + 0.5) * 0.5e-3
    spheres = Snapshot.from_arrays(lattice, 0.25e-3, box=[(0, 4e-3), (0, 1e-3), (0, 1e-3)])
    fits, thin = (
        [one for one in analyse(spheres, sections=count).warnings if "thinner" in one]
        for count in (8, 9)
    )
    assert fits == []
    (text,) = thin
    assert "the mean grain diameter (0.5 mm)" in text
    assert text.endswith("take fewer sections: analysis.sections = 8 or less")
