"""Throats between grains by the flow through the fines around them: local upscaling."""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.errors import CaseError, NetworkError
from fdnet.network.flow.flow import solve_flow
from fdnet.network.laws.damage import BLOCKED, CLEAN, UPSCALED
from fdnet.network.laws.named import LAWS
from fdnet.network.network import build_network
from fdnet.network.permeability import analyse, compare
from fdnet.network.resolved.all_spheres import all_conductances
from fdnet.network.upscaling import regions, upscaled
from fdnet.network.upscaling.overlay import overlay_of
from fdnet.network.upscaling.pore_graph import pore_graph
from fdnet.network.upscaling.shifts import keys_of, looked_up
from fdnet.network.upscaling.upscaled import upscaled_damage
from fdnet.spheres.snapshot import Kind, Snapshot
from fdnet.studies.truth.packs import read_pack, truth_folder
from tests.network.packs import body_centred, random_pack, with_fines

pytestmark = pytest.mark.usefixtures("by_the_network_alone")
LAW = "upscaled"
SIDES = "yz"


@pytest.fixture(scope="module")
def pack():
    return with_fines(random_pack(40, aspect=2.0), 150, 0.2)


def both_networks(pack, periodic):
    grains, whole = (build_network(one, periodic=periodic) for one in (pack.grains(), pack))
    return grains, LAWS["lubrication"](grains), whole


def damaged_sections(pack, sections, law):
    """k_damaged of the sections by a damage law."""
    result = analyse(pack, periodic=SIDES, sections=sections, damage_law=law)
    return [one.k_damaged for one in result.sections]


@pytest.mark.parametrize("periodic", ["", "yz"])
def test_all_flux_between_pores_crosses_the_facets_that_lie_between(pack, periodic):
    """With the pressures of the whole specimen no cell gains or loses fluid."""
    grains, clean, whole = both_networks(pack, periodic)
    flow = solve_flow(whole, all_conductances(whole))
    overlay = overlay_of(grains, pore_graph(grains, clean), whole)
    count, cells = len(overlay.whole.node), overlay.facets.cells
    pressure = np.append(np.zeros(count), [1.0, 0.0])
    pressure[whole.pore_group] = np.nan_to_num(flow.pore_pressure)
    ends, crossings = overlay.whole.ends, overlay.crossings
    flux = overlay.whole.conductance * (pressure[ends[:, 0]] - pressure[ends[:, 1]])
    across = crossings.share * flux[crossings.link]
    gain = np.zeros(cells + 2)
    np.add.at(gain, overlay.facets.ends[crossings.facet, 1], across)
    np.add.at(gain, overlay.facets.ends[crossings.facet, 0], -across)
    assert crossings.lost == 0
    assert np.abs(gain[:cells]).max() < 1e-9 * flow.inflow
    assert [-gain[cells], gain[cells + 1]] == pytest.approx([flow.inflow, flow.inflow])


@pytest.mark.parametrize(("periodic", "off"), [("", 0.02), ("yz", 0.03), ("xyz", 0.02)])
def test_k_is_near_that_of_all_spheres(pack, periodic, off):
    grains, clean, whole = both_networks(pack, periodic)
    throats = upscaled_damage(grains, pack, clean).conductance
    k = solve_flow(grains, throats).inflow / solve_flow(whole, all_conductances(whole)).inflow
    assert k == pytest.approx(1.0, abs=off)


def test_larger_regions_come_nearer_to_all_spheres(monkeypatch):
    """One ring of neighbours is too few; the third still gains."""
    spheres = read_pack(truth_folder() / "packH_r5_d13.csv")[0]
    grains, clean, whole = both_networks(spheres, "xyz")
    true = solve_flow(whole, all_conductances(whole)).inflow
    off = []
    for rings in (1, 2, 3):
        monkeypatch.setattr(regions, "RINGS", rings)
        throats = upscaled_damage(grains, spheres, clean).conductance
        off.append(abs(solve_flow(grains, throats).inflow / true - 1.0))
    assert off[0] > 0.03 > 0.01 > off[1] > off[2]


@pytest.mark.parametrize(
    ("name", "ratio"),
    [("packH_r5_d1", 0.8866), ("packC_r5_d8", 0.1606), ("packH_r5_d20", 0.0175)],
)
def test_fines_lower_k_as_resolved_flow_does(name, ratio):
    spheres = read_pack(truth_folder() / f"{name}.csv")[0]
    result = analyse(spheres, periodic="xyz", walls="slip", damage_law=LAW)
    assert result.k_damaged / result.k_initial == pytest.approx(ratio, rel=0.04)


def test_throats_far_from_fines_keep_their_conductance(pack):
    few = pack.where(pack.position[:, 0] < 0.3 * pack.box[0, 1]).fines()
    spheres = pack.grains().joined(few)
    result = analyse(spheres, periodic=SIDES, damage_law=LAW)
    clean = result.law_used == CLEAN
    before, after = result.conductance_initial, result.conductance_damaged
    assert np.array_equal(before[clean], after[clean])
    assert set(result.law_used[~clean]) <= {UPSCALED, BLOCKED}
    x = result.network.throat_corner[:, :, 0].min(axis=1)
    assert clean[x > 0.6 * pack.box[0, 1]].all()
    assert not clean[x < 0.1 * pack.box[0, 1]].any()


def test_the_tables_and_k_are_by_the_law_that_was_asked_for(pack):
    result = analyse(pack, periodic=SIDES, damage_law=LAW)
    assert (result.damage_law_used, result.damage_law_other) == (LAW, None)
    assert result.k_damaged_other is None
    area, length = result.network.area, np.ptp(pack.box[0])
    assert result.flow_damaged.inflow * length / area == pytest.approx(result.k_damaged)
    assert result.counts["links_without_facet"] == 0
    assert not result.warnings


def test_a_section_is_the_specimen_of_its_own_spheres(pack):
    section = analyse(pack, periodic=SIDES, sections=2, damage_law=LAW).sections[1]
    box = pack.box.copy()
    box[0] = section.x_lo, section.x_hi
    alone = analyse(replace(pack, box=box), periodic=SIDES, damage_law=LAW)
    assert section.k_damaged == pytest.approx(alone.k_damaged)


@pytest.mark.parametrize("sections", [8, 12, 20])
def test_thin_sections_are_near_to_all_spheres(pack, sections):
    """From half a grain to a quarter of it thick: fluid goes straight from plane to plane."""
    own, whole = (damaged_sections(pack, sections, law) for law in (LAW, "all-spheres"))
    assert own == pytest.approx(whole, rel=0.05)


def test_fluid_may_go_from_plane_to_plane_where_no_throat_between_grains_does():
    pack = with_fines(random_pack(20, aspect=2.0, seed=5), 40, 0.3, seed=5)
    edges = [0, 0.3, 1.6, float(pack.box[0, 1])]
    own, whole = (damaged_sections(pack, edges, law) for law in (LAW, "all-spheres"))
    assert own == pytest.approx(whole, rel=0.05)


@pytest.mark.parametrize("periodic", ["xyz", "yz", ""])
def test_pores_on_the_faces_of_a_lattice_are_placed(periodic):
    pack = with_fines(body_centred(2), 20, 0.1)
    own, whole = compare(
        pack, periodic=periodic, laws=[("lubrication", name) for name in (LAW, "all-spheres")]
    )
    assert own.k_damaged == pytest.approx(whole.k_damaged, rel=0.03)


@pytest.mark.parametrize("periodic", ["xyz", "yz", ""])
def test_grains_that_close_every_path_are_no_error(pack, periodic):
    closed = np.where(pack.kind == Kind.GRAIN, 1.6, 1.0) * pack.radius
    result = analyse(replace(pack, radius=closed), periodic=periodic, damage_law=LAW)
    assert result.k_damaged == 0.0


def test_sections_in_place_add_up_to_the_whole(pack):
    result = analyse(pack, periodic=SIDES, sections=3, damage_law=LAW)
    series = sum((s.x_hi - s.x_lo) / s.k_damaged_inplace for s in result.sections)
    assert np.ptp(pack.box[0]) / series == pytest.approx(result.k_damaged)


def test_renumbering_mirror_shift_and_scale_leave_k(pack):
    k = analyse(pack, periodic=SIDES, damage_law=LAW).k_damaged
    mirrored, shifted = pack.position.copy(), pack.position.copy()
    mirrored[:, 1] = pack.box[1].sum() - mirrored[:, 1]
    shifted[:, 1:] += 0.37 * np.ptp(pack.box[1:], axis=1)
    for changed, times in (
        (pack.where(np.random.default_rng(5).permutation(len(pack))), 1.0),
        (replace(pack, position=mirrored), 1.0),
        (replace(pack, position=shifted), 1.0),
        (
            replace(
                pack, position=1e-4 * pack.position, radius=1e-4 * pack.radius, box=1e-4 * pack.box
            ),
            1e-8,
        ),
    ):
        result = analyse(changed, periodic=SIDES, damage_law=LAW)
        assert result.k_damaged == pytest.approx(times * k, rel=2e-3)


def test_regions_are_the_same_in_any_number_of_parts(pack, monkeypatch):
    grains, clean, _ = both_networks(pack, SIDES)
    at_once = upscaled_damage(grains, pack, clean).conductance
    monkeypatch.setattr(upscaled, "MOST_PORES", 500)
    assert upscaled_damage(grains, pack, clean).conductance == pytest.approx(at_once, rel=1e-7)


@pytest.mark.parametrize("axes", [[], [0], [0, 2]])
def test_blocks_hold_some_cells_each_however_flat_their_group_is(axes):
    place = np.zeros((400, 3))
    place[:, axes] = np.random.default_rng(2).random((400, len(axes)))
    block = regions.blocks_of(place)
    assert len(block) == 400
    assert block.max() + 1 >= (1 if not axes else 20)


def test_moved_grains_are_those_that_count(pack):
    moved = replace(pack, position=pack.position + 0.02 * np.sin(pack.position[:, ::-1]))
    result = analyse(pack.grains(), moved, periodic=SIDES, damage_law=LAW)
    assert result.k_moved is not None
    grains, clean, _ = both_networks(moved, SIDES)
    throats = upscaled_damage(grains, moved, clean).conductance
    assert result.conductance_damaged == pytest.approx(throats)
    assert result.k_damaged <= result.k_moved


def test_without_fines_nothing_is_damaged(pack):
    result = analyse(pack.grains(), periodic=SIDES, damage_law=LAW)
    assert result.damage_law_used is None
    assert result.k_damaged == result.k_initial


def test_all_laws_are_compared_with_it(pack):
    pairs = [("lubrication", name) for name in (LAW, "all-spheres")]
    own, whole = compare(pack, periodic=SIDES, laws=pairs)
    assert own.damage_law_used == LAW
    assert own.k_damaged == pytest.approx(whole.k_damaged, rel=0.03)


def test_it_needs_the_law_of_the_network_of_all_spheres(pack):
    with pytest.raises(CaseError, match=r"analysis.damage_law: 'upscaled' needs .*lubrication"):
        analyse(pack, periodic=SIDES, law="thesis", damage_law=LAW)


def test_spheres_at_one_place_are_refused_with_what_to_do(pack):
    first = pack.grains().position[:1]
    double = Snapshot.from_arrays(first, pack.grains().radius[:1], box=pack.box, kind=Kind.FINE)
    with pytest.raises(NetworkError, match=r"upscaled: grains and fines.*section-archie"):
        analyse(
            pack.joined(replace(double, id=double.id + 10_000)), periodic=SIDES, damage_law=LAW
        )


def test_keys_tell_all_apart_and_refuse_what_they_cannot():
    shift = np.stack(np.meshgrid(*[np.arange(-7, 8)] * 3), axis=-1).reshape(-1, 3)
    keys = np.concatenate(
        [keys_of(np.full(len(shift), part), shift=shift, size=3) for part in (0, 2)]
    )
    assert len(np.unique(keys)) == len(keys)
    place, there = looked_up(np.sort(keys), keys[:5])
    assert there.all()
    assert np.array_equal(np.sort(keys)[place], keys[:5])
    with pytest.raises(NetworkError, match=r"8 periods apart.*all-spheres"):
        keys_of(np.zeros(1, int), shift=np.array([[0, 8, 0]]), size=3)
