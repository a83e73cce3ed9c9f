"""Damage by fines: the laws of single throats, by sections, and the network of all spheres."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fdnet.errors import CaseError, NetworkError
from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.sections import whole_permeability
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS, damage_law
from fdnet.network.laws.section_archie import measured_sections
from fdnet.network.network import build_network
from fdnet.network.permeability import analyse
from fdnet.spheres.snapshot import Kind, Snapshot
from tests.network.networks import chain
from tests.network.packs import random_pack, with_fines

# ---- The laws of the thesis, on single throats.
R, L = 0.1, 1.0
CLEAN = np.pi * R**4 / (8 * L)


def occupancy(porosity, *, fine=0.02, distance=0.9, blocked=None):
    porosity = np.asarray(porosity, float)
    count = len(porosity)
    return SimpleNamespace(
        throat_porosity=porosity,
        throat_fines=(porosity < 1).astype(int),
        throat_fine_radius=np.full(count, fine),
        blocked=np.zeros(count, bool) if blocked is None else np.asarray(blocked),
        pair_throat=np.arange(count),
        pair_distance=np.full(count, distance),
    )


def damaged(law, state, **options):
    count = len(state.throat_porosity)
    return damage_law(law, **options)(chain(count), state, np.full(count, CLEAN))


def carman_kozeny(porosity, fine):
    k = porosity**3 * (2 * fine) ** 2 / (72 * 2.5 * (1 - porosity) ** 2)
    return k * np.pi * R**2 / L


def test_the_law_of_the_thesis_by_throat_porosity():
    damage = damaged("thesis", occupancy([1.0, 0.8, 0.4, 0.39, 0.2, -0.1]))
    clogged = [carman_kozeny(0.39, 0.02), carman_kozeny(0.2, 0.02), 0.0]
    expected = [CLEAN, CLEAN * 0.64, CLEAN * 0.16, *clogged]
    assert damage.conductance == pytest.approx(expected, rel=1e-12, abs=1e-18)
    assert damage.law_used.tolist() == ["clean", *["deposition"] * 2, *["clogging"] * 3]
    assert damage.counts["throats_filled"] == 1
    damage = damaged("thesis", occupancy([0.9, 0.9], blocked=[True, False]))
    assert damage.conductance == pytest.approx([0.0, CLEAN * 0.81])
    assert damage.law_used[0] == "blocked"
    damage = damaged("thesis", occupancy([0.39], fine=1.0))
    assert carman_kozeny(0.39, 1.0) > CLEAN == damage.conductance[0]
    assert damage.counts["capped"] == 1


def test_thresholds_of_text_and_code_and_by_choice():
    for law, options, used in [
        ("thesis", {}, "clogging"),
        ("thesis-code", {}, "deposition"),
        ("thesis-code", {"clogging_threshold": 0.5}, "clogging"),
    ]:
        assert damaged(law, occupancy([0.38]), **options).law_used[0] == used, (law, options)
    for distance, clogged in ((0.9, 1), (0.3, 3)):  # the middle band is decided by the place
        state = occupancy([0.35, 0.37, 0.79, 0.81], distance=distance)
        used = damaged("thesis", state, middle_band="position").law_used.tolist()
        assert used == ["clogging"] * clogged + ["deposition"] * (4 - clogged)


# ---- The law by sections.
@pytest.fixture(scope="module")
def dense():
    return with_fines(random_pack(40), 150, 0.2)


@pytest.fixture(scope="module")
def network(dense):
    return build_network(dense.grains(), periodic="yz")


def k_of(pack):
    return analyse(pack, periodic="yz", damage_law="section-archie").k_damaged


def conductances(network, fines):
    clean = LAWS["lubrication"](network)
    law = DAMAGE_LAWS["section-archie"]
    return clean, law(network, measure_occupancy(network, fines), clean)


def test_a_pack_between_planes_is_half_its_mirrored_double(dense):
    """Pressure planes are planes of symmetry: the fines have mirror images there."""
    other, box = dense.position.copy(), dense.box.copy()
    other[:, 0] = 2.0 * dense.box[0, 1] - other[:, 0]
    box[0, 1] += np.ptp(dense.box[0])
    double = replace(dense, box=box).joined(replace(dense, position=other, box=box))
    network = build_network(double.grains(), periodic="xyz")
    damage = conductances(network, double.fines())[1]
    whole = whole_permeability(network, damage.conductance)[0]
    assert k_of(dense) == pytest.approx(whole, rel=0.02)


@pytest.mark.parametrize(("periodic", "spread"), [("yz", 1.0), ("", 1.0), ("", 10.0)])
def test_fines_that_come_leave_and_move_renew_the_throats_they_reach(dense, periodic, spread):
    """Bit for bit what all throats give when they are summed anew.

    Radii differ by up to the factor `spread`.
    """
    network = build_network(dense.grains(), periodic=periodic)
    rng, fines = np.random.default_rng(8), dense.fines()
    fines = replace(fines, radius=fines.radius * spread ** -rng.uniform(size=len(fines)))
    place, number = np.array(fines.position), np.arange(len(fines))
    place[::15] += rng.normal(0.0, 0.1, place[::15].shape)
    after = replace(fines, position=place).where(number < len(fines) - 3)
    grown = measured_sections(network, fines.where(number > 3)).changed_to(after)
    full = measured_sections(network, after)
    assert 0 < grown.renewed < 0.6 * full.renewed
    assert np.array_equal(grown.raised, full.raised)
    assert np.array_equal(grown.without, full.without)
    with np.errstate(invalid="raise", divide="raise"):
        assert np.all((full.factor >= 0.0) & (full.factor <= 1.0))
    clean, damage = conductances(network, after)
    raised = np.sum(full.without / np.maximum(full.factor, 1e-12), axis=1)
    lost = damage.conductance[clean > 0] / clean[clean > 0]
    assert (full.without.sum(axis=1) / raised)[clean > 0] == pytest.approx(lost, abs=0.01)


# ---- The network of grains and fines together.
@pytest.fixture(scope="module")
def pack():
    return with_fines(random_pack(40, aspect=2.0), 60, 0.2)


@pytest.fixture(scope="module")
def analysis(pack):
    return analyse(pack, periodic="yz", sections=2, damage_law="all-spheres")


def all_spheres(pack, sections=2):
    return analyse(pack, periodic="yz", sections=sections, damage_law="all-spheres")


def test_a_section_is_the_specimen_of_its_own_spheres(pack, analysis):
    section, box = analysis.sections[1], pack.box.copy()
    box[0] = section.x_lo, section.x_hi
    alone = all_spheres(replace(pack, box=box), 1)
    assert section.k_initial == pytest.approx(alone.k_initial)
    assert section.k_damaged == pytest.approx(alone.k_damaged)


def test_fines_upstream_count_as_far_as_they_reach_in(pack):
    low, radius = pack.box[0, 0], float(pack.fines().radius.mean())

    def upstream(beyond):
        side = np.random.default_rng(3).uniform(0, pack.box[1, 1], (2, 250))
        place = np.column_stack([np.full(250, low - beyond), *side])
        cake = Snapshot.from_arrays(place, radius, box=pack.box, kind=Kind.FINE)
        both = pack.joined(replace(cake, id=cake.id + 10_000))
        return all_spheres(both, 4).sections[0].k_damaged

    apart = upstream(1.01 * radius)
    assert apart == pytest.approx(upstream(3.0 * radius))
    assert upstream(0.3 * radius) < 0.98 * apart


def test_what_all_spheres_cannot_do_is_refused_or_left_to_the_other_law(pack, monkeypatch):
    with pytest.raises(CaseError, match=r"analysis\.damage_law: 'all-spheres'.*'thesis'"):
        analyse(pack, periodic="yz", law="thesis", damage_law="all-spheres")

    def refuse(*_: object, **__: object) -> None:
        raise NetworkError("no throat")

    monkeypatch.setattr("fdnet.network.states.build_network", refuse)
    with pytest.raises(NetworkError, match=r"all-spheres.*no throat.*section-archie"):
        all_spheres(pack)
    default = analyse(pack, periodic="yz")
    assert default.damage_law_used == "section-archie"
    assert any("no throat" in text for text in default.warnings)
