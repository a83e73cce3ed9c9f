"""Damage by fines: the laws of single throats, by sections, and the network of all spheres."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fdnet.case.tables import AnalysisChoices
from fdnet.errors import CaseError, NetworkError
from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.sections import layer_edges, plane_pressures, whole_permeability
from fdnet.network.laws import section_archie
from fdnet.network.laws.deposit_resistances import deposit_resistances
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS, damage_law
from fdnet.network.laws.section_archie import FineImages, measured_sections, parts_of
from fdnet.network.network import build_network
from fdnet.network.nodes import nodes_of
from fdnet.network.permeability import analyse
from fdnet.spheres.snapshot import Kind, Snapshot
from tests.network.networks import chain
from tests.network.packs import random_pack, simple_cubic, snapshot, with_fines

# ------------------------------------------------------------------------------------------------
# The laws of the thesis, on single throats.

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
        ("thesis", {"clogging_threshold": 0.3}, "deposition"),
        ("thesis-code", {"clogging_threshold": 0.5}, "clogging"),
    ]:
        assert damaged(law, occupancy([0.38]), **options).law_used[0] == used, (law, options)
    for distance, clogged in ((0.9, 1), (0.3, 3)):  # the middle band is decided by the place
        state = occupancy([0.35, 0.37, 0.79, 0.81], distance=distance)
        used = damaged("thesis", state, middle_band="position").law_used.tolist()
        assert used == ["clogging"] * clogged + ["deposition"] * (4 - clogged)
    for options in ({"clogging_threshold": 1.2}, {"middle_band": "guess"}):
        with pytest.raises(CaseError, match=next(iter(options))):
            damaged("thesis", occupancy([0.5]), **options)


def test_laws_have_their_names_and_others_are_refused_with_the_one_to_take():
    assert set(LAWS) == {"thesis", "effective", "lubrication"}
    assert set(DAMAGE_LAWS) == {"thesis", "thesis-code", "section-archie"}
    archie = damage_law("section-archie", clogging_threshold=0.3)
    assert archie is DAMAGE_LAWS["section-archie"], "it has no options"
    with pytest.raises(CaseError, match=r"damage_law: 'guess'.*section-archie.*thesis-code"):
        damage_law("guess")
    for key, gone, instead in [
        ("law", "hydraulic", "lubrication"),
        ("law", "series", "lubrication"),
        ("damage_law", "combined", "auto"),
        ("damage_law", "upscaled", "all-spheres"),
        ("damage_law", "kozeny", "section-archie"),
        ("damage_law", "side-kozeny", "section-archie"),
    ]:
        with pytest.raises(CaseError, match=f"analysis.{key}: .*'{gone}'.*take '{instead}'"):
            AnalysisChoices.of_pack(**{key: gone})


# ------------------------------------------------------------------------------------------------
# The law by sections.


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


def test_a_throat_meets_the_fines_whose_bodies_reach_into_its_prism(network, dense):
    """Places in the prisms are tried one by one, against all images of all fines."""
    fines, size, rng = dense.fines(), np.ptp(network.box, axis=1), np.random.default_rng(3)
    beside = FineImages(network, fines.position, fines.radius).beside(next(parts_of(network)))
    sides = [np.array([0.0, y, z]) * size for y in (-1, 0, 1) for z in (-1, 0, 1)]
    mirrored = [fines.position * (-1.0, 1.0, 1.0) + (2.0 * x, 0, 0) for x in network.box[0]]
    image = np.concatenate([one + side for one in (fines.position, *mirrored) for side in sides])
    met = 0
    for t in range(25):
        corner = network.image_position[network.throat_images[t]]
        normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
        normal /= np.linalg.norm(normal)
        height = rng.uniform(*np.sort(nodes_of(network).heights[t] * (-1.0, 1.0)), 1500)
        near = image[np.linalg.norm(image - corner.mean(axis=0), axis=1) < 4.0]
        own = beside.place[beside.first[t] : beside.first[t + 1], 2]
        both = []
        for sense in (1.0, -1.0):  # the normal may point either way
            place = rng.dirichlet(np.ones(3), 1500) @ corner + sense * height[:, None] * normal
            apart = np.linalg.norm(place[:, None] - near, axis=2)
            inside = near[np.any(apart < 0.2, axis=0)]
            up = sense * (inside - corner[0]) @ normal
            both.append(np.all(np.any(np.abs(up[:, None] - own) < 1e-9, axis=1)))
            met += len(inside)
        assert any(both)
    assert met > 50


def test_throats_without_fines_keep_their_conductance(network, dense):
    clean, damage = conductances(network, dense.fines().where(np.array([0])))
    changed = damage.conductance != clean
    assert 0 < changed.sum() < 0.2 * len(clean)
    assert set(damage.law_used[~changed & (clean > 0)]) == {"clean"}
    assert set(damage.law_used[changed]) <= {"sections", "blocked"}


def test_fines_from_vanishing_to_as_wide_as_the_throat(network, dense):
    """In the gap of four grains of a simple cubic lattice the corners of the gap stay open."""
    grains, fines = dense.grains(), dense.fines().where(np.arange(20))
    k0 = k_of(grains)
    lost = [
        1.0 - k_of(grains.joined(replace(fines, radius=np.full(20, radius)))) / k0
        for radius in (0.2, 0.05, 0.0125)
    ]
    assert lost[0] > lost[1] > lost[2] >= 0.0
    assert lost[2] < 1e-3
    # a radius of 1e-300 would ask for more sections than a number counts
    radius = np.where(np.arange(len(dense.fines())) == 3, 1e-300, dense.fines().radius)
    for size, coarse in ((radius, True), (dense.fines().radius, False)):
        _, damage = conductances(network, replace(dense.fines(), radius=size))
        assert (damage.counts["throats_coarse"] > 0) == coarse
    grains = simple_cubic(3)
    cubic, edge = build_network(grains, periodic="xyz"), np.ptp(grains.box[0]) / 3.0
    gap = grains.position[:1] + np.array([[0.0, 0.5, 0.5]]) * edge
    fine = snapshot(gap, 0.5 * edge * np.sqrt(2.0) - 1.0 + 0.02, grains.box, Kind.FINE)
    clean, damage = conductances(cubic, fine)
    kept = damage.conductance[clean > 0] / clean[clean > 0]
    assert 0.0 < kept.min() < 0.05
    assert np.median(kept) == 1.0


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


def test_more_sections_change_little_and_the_power_of_the_share_is_the_one_constant(
    network, dense, monkeypatch
):
    """At the power 0 nothing is lost, and the clean resistance is that of `lubrication`."""
    own = k_of(dense)
    with monkeypatch.context() as finer:
        finer.setattr(section_archie, "STEP", 0.5 * section_archie.STEP)
        finer.setattr(section_archie, "LEAST_STEPS", 2 * section_archie.LEAST_STEPS)
        assert k_of(dense) == pytest.approx(own, rel=0.03)
    without = section_archie.fine_resistances(network, dense.fines())[0]
    halves = half_resistances(network)
    some = np.flatnonzero(np.any(without != 1.0, axis=1) & np.isfinite(halves.sum(axis=1)))
    assert len(some) > 100
    off = np.abs(without[some].sum(axis=1) / halves[some].sum(axis=1) - 1.0)
    assert np.percentile(off, 95) < 5e-3
    monkeypatch.setattr(section_archie, "EXPONENT", 0.0)
    assert set(conductances(network, dense.fines())[1].law_used) == {"clean"}


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


# ------------------------------------------------------------------------------------------------
# The network of grains and fines together.


@pytest.fixture(scope="module")
def pack():
    return with_fines(random_pack(40, aspect=2.0), 60, 0.2)


@pytest.fixture(scope="module")
def analysis(pack):
    return analyse(pack, periodic="yz", sections=2, damage_law="all-spheres")


def all_spheres(pack, sections=2):
    return analyse(pack, periodic="yz", sections=sections, damage_law="all-spheres")


def test_k_is_that_of_the_network_of_all_spheres(pack, analysis):
    network = build_network(pack, periodic="yz")
    conductance = 1.0 / deposit_resistances(network).sum(axis=1)
    assert analysis.k_damaged == pytest.approx(whole_permeability(network, conductance)[0])
    assert analysis.damage_law_used == "all-spheres"
    two_scale = analyse(pack, periodic="yz", damage_law="section-archie")
    assert analysis.damage_law_other == two_scale.damage_law_used == "section-archie"
    assert analysis.k_damaged_other == pytest.approx(two_scale.k_damaged)
    assert len(analysis.conductance_damaged) == len(analysis.network.throat_radius)


def test_a_section_is_the_specimen_of_its_own_spheres(pack, analysis):
    section, box = analysis.sections[1], pack.box.copy()
    box[0] = section.x_lo, section.x_hi
    alone = all_spheres(replace(pack, box=box), 1)
    assert section.k_initial == pytest.approx(alone.k_initial)
    assert section.k_damaged == pytest.approx(alone.k_damaged)
    # in a periodic pack they see the images beyond its faces
    grains = random_pack(40, aspect=2.0)
    half = np.array([0.5 * np.ptp(grains.box[0]), 0, 0])
    both = (grains, replace(grains, position=grains.position + half))
    first, second = (
        [one.k_initial for one in analyse(spheres, periodic="xyz", sections=2).sections]
        for spheres in both
    )
    assert second == pytest.approx(first[::-1], rel=1e-4)


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


def test_values_in_place_and_layers_add_up_to_the_whole(pack, analysis):
    thickness = [one.x_hi - one.x_lo for one in analysis.sections]
    for state in ("initial", "damaged"):
        k = [getattr(one, f"k_{state}_inplace") for one in analysis.sections]
        series = sum(thickness) / np.sum(np.divide(thickness, k))
        assert series == pytest.approx(getattr(analysis, f"k_{state}")), state
    network = build_network(pack.grains(), periodic="yz")
    halves = half_resistances(network)
    flow = whole_permeability(network, 1.0 / halves.sum(axis=1))[1]
    pressure = plane_pressures(network, flow, np.linspace(*pack.box[0], 30), halves)
    assert pressure[[0, -1]] == pytest.approx([1.0, 0.0])
    assert np.all(np.diff(pressure) < 0)
    # layers are as thick as a fine and fill the first millimetre
    box = np.array([[0.0, 8e-3], [0, 1e-3], [0, 1e-3]])
    assert layer_edges(box, 3e-4) == pytest.approx([0, 3e-4, 6e-4, 9e-4, 1e-3])
    assert len(layer_edges(box, 1e-7)) == 201
    box[0, 1] = 2e-4
    assert layer_edges(box, 1e-4) == pytest.approx([0, 1e-4, 2e-4])


def test_fines_never_raise_k(pack):
    """One small fine makes the network finer, and its k may come out above that of the grains."""
    fines = pack.fines()
    for count in (1, 5, len(fines)):
        few = pack.grains().joined(fines.where(np.arange(count)))
        few = replace(few, radius=np.where(few.kind == Kind.FINE, 0.3, 1.0) * few.radius)
        for law in ("auto", "all-spheres"):
            result = analyse(few, periodic="yz", sections=2, damage_law=law)
            assert result.k_damaged <= result.k_initial
            assert all(one.k_damaged <= one.k_initial for one in result.sections)
    near = fines.where(fines.position[:, 0] < 0.2 * pack.box[0, 1])
    first, second = all_spheres(pack.grains().joined(near)).sections
    assert first.k_reduction > 0.01
    assert second.k_reduction == 0.0


def test_sections_through_which_few_throats_carry_the_flow_are_named(pack):
    result = analyse(pack, periodic="yz", sections=2)
    (said,) = [text for text in result.warnings if text.startswith("few throats carry")]
    assert all(part in said for part in ("in section 1", "in section 2", "fdnet stokes"))


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


def test_fines_that_are_there_twice_count_once(pack):
    double = pack.joined(replace(pack.fines(), id=pack.fines().id + 10_000))
    result, plain = analyse(double, periodic="yz"), analyse(pack, periodic="yz")
    assert result.k_damaged == plain.k_damaged
    assert result.counts["spheres_dropped"] == len(pack.fines())
