"""Spheres above the cut in LIGGGHTS, what is finer as classes in the same flow."""

import numpy as np
import pytest
from builders import followed, resting_spheres
from cut_and_continue import differences

from fdnet.case.file import case_from
from fdnet.classes.beside_spheres import Passed, Stands
from fdnet.classes.deposit import kept_shares
from fdnet.dem import checkpoint
from fdnet.dem.checkpoint import Checkpoints
from fdnet.dem.invade_deck import Moment
from fdnet.errors import CaseError
from fdnet.run.fluid import fluid_of
from fdnet.run.pipeline import run_case
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Kind

pytestmark = pytest.mark.liggghts
ENDS = "run.plug_rate=0.05"
WIDE = {"D10_mm": 0.02, "D50_mm": 0.06, "D90_mm": 0.12}


def mud(method, *more, cut=80.0, sizes=WIDE):
    """15 grains, 100 spheres of a mud that is half finer than they are."""
    tables = followed(*more, "fines.supply=batches").data()
    fines = {"sizes": sizes, "count": 100, "concentration": 0.2, "supply": "batches"}
    fines |= {} if cut is None else {"cut_um": cut}
    return case_from(tables | {"fines": fines, "invasion": {"method": method}})


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A finished run of all stages."""
    return run_case(mud("both"), tmp_path_factory.mktemp("both") / "run")


def test_a_continued_run_of_both_is_the_uncut_one(go, tmp_path):
    assert differences(go, mud("both"), tmp_path) == []
    kept, last = (sorted(tmp_path.glob(f"{one}/post/*.npz")) for one in ("whole", "at every *"))
    assert len(kept) == 2
    assert kept[-1].read_bytes() == last[-1].read_bytes()


def test_a_changed_state_of_the_classes_makes_the_checkpoint_unusable(go, tmp_path):
    case = mud("both")
    done = go(case, tmp_path)
    points = Checkpoints(folder=tmp_path, digest=case.digest("invade"))
    last = done.history[-1].step
    with points.path(last, "npz").open("r+b") as file:
        file.seek(500)
        file.write(b"noise")
    assert points.last().step == done.history[-2].step
    assert go(case, tmp_path).updates == done.updates


def test_without_solids_below_the_cut_it_is_the_run_of_spheres_byte_for_byte(go, tmp_path):
    sizes = {"D10_mm": 0.09, "D50_mm": 0.1, "D90_mm": 0.11}
    for method in ("liggghts", "both"):
        go(mud(method, cut=None, sizes=sizes), tmp_path / method)
    spheres, both = tmp_path / "liggghts", tmp_path / "both"
    kept = (".csv", ".dump", ".restart")
    files = [path for path in spheres.rglob("*") if path.suffix in kept]
    assert len(files) == 9
    for path in files:
        assert path.read_bytes() == (both / path.relative_to(spheres)).read_bytes(), path


def test_the_ledger_of_every_class_closes_and_the_classes_cost_permeability(whole):
    rows, summary = whole.history, whole.summary
    assert rows["classes_missing"].max() < 1e-12
    classes = summary["classes"]
    for one in classes:
        found = one["inside_m3"] + one["passed_m3"] + one["cake_m3"]
        assert found == pytest.approx(one["supplied_m3"], rel=1e-12)
        assert min(one["inside_m3"], one["passed_m3"], one["cake_m3"]) >= 0.0
        of_filtrate = summary["filtrate_m3"] * one["concentration"]
        assert one["supplied_m3"] == pytest.approx(of_filtrate, rel=1e-9)
    assert classes[-1]["to_m"] == pytest.approx(80e-6)
    assert sum(one["concentration"] for one in classes) < 0.2


def test_its_tables_hold_spheres_and_classes(whole):
    summary = whole.summary
    assert summary["method"] == "both"
    counts = [summary[f"{name}_count"] for name in ("invaded", "passed", "upstream")]
    assert sum(counts) == pytest.approx(summary["supplied_count"], abs=2)
    fines = whole.spheres().fines()
    assert len(fines) == counts[0] + counts[2]
    sections = whole.sections
    assert sections["fines_count"].sum() == summary["invaded_count"]
    assert np.all(sections["k_damaged_m2"] <= sections["k_initial_m2"])
    filled = whole.profile.porosity_initial - whole.profile.porosity_damaged
    width = whole.profile.x_hi_m - whole.profile.x_lo_m
    area = whole.case.size_m[1] * whole.case.size_m[2]
    inside = summary["invaded_volume_m3"]
    assert float(filled @ width) * area == pytest.approx(inside, rel=0.1)
    assert sum(one["inside_m3"] for one in summary["classes"]) < inside


@pytest.fixture
def fluid(grains_of):
    return fluid_of(mud("both"), scales_of(mud("both")), grains_of(mud("both")))


def test_spheres_bear_a_pore_by_their_share_of_its_solids(fluid):
    """With as much of finer solids beside them half of it, and the grains the other half."""
    pack, network = fluid.pack, fluid.pack.network
    spheres = 1e-3 * np.maximum(network.pore_volume, 0.0)
    kept = np.full(pack.halves.shape, 0.3)
    own = np.bincount(network.pore_group, spheres * network.pore_share)
    alone, beside = (pack.carried(kept, spheres, finer).pressed for finer in (None, own))
    assert beside.groups == pytest.approx(0.5 * alone.groups, rel=1e-12)
    sums = [one.grains + one.groups.sum(axis=0) for one in (alone, beside)]
    assert sums[0] == pytest.approx(sums[1], rel=1e-9, abs=1e-9 * network.area)


def test_spheres_hold_classes_that_would_pass_without_them(fluid):
    """A narrowed passage holds what is wider; what rests narrows the sides by the fast model."""
    finer = fluid.finer
    none = np.zeros(len(fluid.pack.network.pore_group))
    pores, held = float(finer.sieve.void.sum()), []
    for factor in (1.0, 1e-6):
        finer.forget()
        sides = np.full(finer.kept.shape, factor)
        left = finer.among(Passed(0.0, 0.5 * pores, 1e-3), Stands(sides, none, 0.0))
        held.append(left.volume.sum())
        own = kept_shares(finer.sieve, finer.solids, finer.own)
        assert left.kept == pytest.approx(factor * own, rel=1e-9)
    assert held[1] > 1.5 * held[0]


def test_spheres_and_classes_share_the_room_of_a_pore(fluid):
    """It is full at 0.60 (1 - 0.29 d / l) of both together; what is there or arrives stays."""
    finer, network = fluid.finer, fluid.pack.network
    size, void = finer.classes.diameter[[0, -1]], finer.sieve.void
    packed = 0.6 * (1.0 - 0.29 * 2.0 / np.sum(1.0 / size) / finer.sieve.room) * void
    first = np.unique(network.pore_group, return_index=True)[1]
    sides, big = np.ones(finer.kept.shape), void > 0.3 * void.mean()
    for spheres, classes, full in ((0.49, 0.49, False), (0.51, 0.51, True), (2.0, 0.0, False)):
        finer.forget()
        finer.solids.in_pores[:, 0] = classes * packed
        held = np.zeros(len(network.pore_group))
        held[first] = spheres * packed / network.pore_share[first]
        finer.among(Passed(0.0, 0.0, 1e-3), Stands(sides, held, 0.0))
        assert np.all(finer.full[big] == full)
    finer.solids.in_pores[:, 0] = 1.1 * packed
    place = np.array([(-0.75, 3.0, 3.0), (-0.25, 3.0, 3.0), (2.0, 3.0, 3.0)]) * size[1]
    some = resting_spheres(place, 0.5 * size[1], fluid.grains.box, kind=Kind.FINE, first=10_000)
    now = Moment(step=0, time=0.0, before=None, fresh=True)
    acts = fluid.forces(fluid.grains.joined(some), now)
    assert np.array_equal(acts.velocity[:, 0] > 0.0, [True, False, False])
    assert np.all(acts.coefficient[1:] > 100.0 * acts.coefficient[0])


def test_the_common_flow_ends_it_where_the_spheres_would_go_on(tmp_path, monkeypatch):
    """At `run.plug_rate` of the first rate; a case of spheres alone asks for `run.stop_rate`."""
    rows = [{"step": 5, "rate_over_initial": 0.04, "filtrate_m3": 0.0}]
    monkeypatch.setattr(checkpoint, "read_updates", lambda folder: rows)
    less, spheres = mud("both", "run.plug_rate=0.03"), mud("liggghts", ENDS, cut=None)
    for case, said in ((mud("both", ENDS), "plugged"), (less, None), (spheres, None)):
        assert checkpoint.flow_says(tmp_path, case, scales_of(case), 9) == said


def test_what_does_not_go_with_both_is_refused():
    tables = mud("both").data()
    with pytest.raises(CaseError, match="share one flow"):
        case_from(tables | {"drag": {"field": "uniform"}})
    with pytest.raises(CaseError, match="nothing turns the flow back"):
        case_from(tables | {"clean_up": {"drawdown_MPa": 1.0}})
