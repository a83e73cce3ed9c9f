"""Size classes on a pore network: exact solutions, balances, and what must not matter."""

from dataclasses import replace

import numpy as np
import pytest

from fdnet.case.spheres import Fines
from fdnet.classes import invasion
from fdnet.classes.capture import (
    Bed,
    SizeClasses,
    bridging_chance,
    collector_efficiency,
    mud_classes,
    wider_share,
)
from fdnet.classes.deposit import (
    Release,
    Sieve,
    advanced,
    fluid_void,
    holding,
    kept_shares,
    loads_of,
    no_solids,
    released,
    sieve_of,
)
from fdnet.classes.invasion import Course, flows_through, invade_classes
from fdnet.classes.transport import streams_of
from fdnet.network.flow.flow import solve_flow
from fdnet.network.laws.deposit_resistances import grain_resistances
from fdnet.network.network import build_network
from tests.network.packs import random_pack

BED = Bed(diameter=0.5e-3, porosity=0.4, velocity=1.4e-4, viscosity=1e-3, density=998.0)


def sizes(*diameters, concentration=0.02):
    d = np.array(diameters, float)
    return SizeClasses(
        low=d,
        high=d,
        diameter=d,
        concentration=np.full(len(d), concentration / len(d)),
        density=np.full(len(d), 2650.0),
    )


def chain(count, *, step=1.0, void=1e-3, surface=1.0, passage=1.0):
    """Pores in a row; the first lies on the face and the last on the outlet."""
    place = np.column_stack([step * np.arange(count), np.zeros(count), np.zeros(count)])
    ends = np.column_stack([np.arange(count - 1), np.arange(1, count)])
    number = np.arange(count)
    return Sieve(
        ends=ends,
        passage=np.full(count - 1, passage),
        opening=np.full(count - 1, 0.5 * passage),
        halves=np.ones((count - 1, 2)),
        reach=np.full(count - 1, step),
        winding=1.0,
        void=np.full(count, void),
        room=np.full(count, np.cbrt(void)),
        surface=np.full(count, surface),
        place=place,
        throat_place=0.5 * (place[1:] + place[:-1]),
        inlet=number == 0,
        outlet=number == count - 1,
        area=1.0,
        length=step * (count - 1),
    )


def through(sieve):
    count = len(sieve.void)
    faces = {"inlet": sieve.inlet, "outlet": sieve.outlet}
    return streams_of(sieve.ends, np.ones(count - 1), np.linspace(1, 0, count), **faces)


def step(sieve, solids, classes, streams, filtering, filtrate):
    what = holding(sieve, solids, classes, streams, filtering)
    after = advanced(sieve, solids, classes, streams, what, filtrate)
    return after.carried / fluid_void(sieve, solids)[:, None], after


def test_one_rate_in_a_chain_falls_exponentially():
    """c = c0 exp(-lambda x) (Iwasaki 1937) once the fluid of the chain is renewed."""
    sieve, classes = chain(40, void=1e-12), sizes(1e-6)
    solids, streams = no_solids(sieve, classes), through(sieve)
    carried, _ = step(sieve, solids, classes, streams, np.array([0.11]), 1.0)
    expected = classes.concentration * np.exp(-0.11 * sieve.place[:-1, 0])
    assert carried[:-1, 0] == pytest.approx(expected, rel=1e-9)


def test_a_surface_that_fills_up_gives_the_solution_of_bohart_and_adams():
    """c/c0 = e^T / (e^X + e^T - 1): Langmuir's blocking, X = lambda x, T = lambda c0 V / s."""
    count, rate = 400, 4.0
    sieve = chain(count, step=1.0 / count, void=1e-5)
    classes = sizes(1e-6, concentration=1e-4)
    solids, streams = no_solids(sieve, classes), through(sieve)
    most = 0.546 * 1.0 / (1.5 / 1e-6) * count  # solids that cover the surface of a unit of length
    for turn in range(1, 401):
        volume = 0.01 * most / (rate * classes.concentration[0])
        carried, solids = step(sieve, solids, classes, streams, np.array([rate]), volume)
        if turn % 100 == 0:
            x, t = rate * sieve.place[:-1, 0], 0.01 * turn
            expected = np.exp(t) / (np.exp(x) + np.exp(t) - 1.0)
            got = carried[:-1, 0] / classes.concentration
            assert got == pytest.approx(expected, abs=0.01)


def test_a_flow_lifts_a_deposit_above_the_critical_wall_stress_alone():
    """Of one throat: r dp / (2 l); below it nothing moves, above it falls as exp(-t / time)."""
    sieve, classes = chain(4, passage=0.1), sizes(1e-6)
    solids = no_solids(sieve, classes)
    solids.in_throats[1], solids.attached[1] = 3e-9, 5e-9
    streams, drop = through(sieve), 600.0
    stress = 0.05 * (drop / 3) / (2 * 1.0)
    kept = kept_shares(sieve, solids, classes)
    assert kept.min() < 1.0
    below = released(sieve, solids, streams, drop, 7.0, Release(1.001 * stress, 2.0))
    assert np.array_equal(kept_shares(sieve, below, classes), kept)
    assert np.array_equal(below.carried, solids.carried)
    law = Release(0.999 * stress, 2.0)
    above = solids
    for seconds in (0.5, 2.5, 4.0):
        above = released(sieve, above, streams, drop, seconds, law)
    left = np.exp(-7.0 / 2.0)
    assert above.in_throats[1, 0] == pytest.approx(3e-9 * left, rel=1e-12)
    assert above.attached[1, 0] == pytest.approx(5e-9 * left, rel=1e-12)
    assert above.carried[1, 0] == pytest.approx(8e-9 * (1 - left), rel=1e-12)
    assert above.inside_by_class == pytest.approx(solids.inside_by_class, rel=1e-14)
    assert kept_shares(sieve, above, classes)[1, 0] > kept[1, 0]


def test_one_sweep_solves_the_balance_of_every_pore():
    """The same system with the laws of the page, assembled and solved by elimination."""
    rng, count = np.random.default_rng(3), 30
    pressure = rng.random(count)
    ends = np.array([(a, b) for a in range(count) for b in range(a) if rng.random() < 0.3])
    flux = pressure[ends[:, 0]] - pressure[ends[:, 1]]
    inlet, outlet = pressure > 0.8, pressure < 0.15
    streams = streams_of(ends, flux, pressure, inlet=inlet, outlet=outlet)
    links = {
        "ends": ends,
        "passage": rng.uniform(0.1, 0.5, len(ends)),
        "reach": rng.random(len(ends)),
    }
    sieve = replace(chain(count), void=rng.random(count), inlet=inlet, outlet=outlet, **links)
    classes = replace(sizes(0.2, 0.3, concentration=0.2), high=np.array([0.25, 0.4]))
    solids = no_solids(sieve, classes)
    solids.carried[~outlet] = 0.05 * rng.random((int(np.sum(~outlet)), 2))
    solids.in_pores[:] = (
        np.where(rng.random(count) < 0.5, 0.6 * sieve.void * rng.random(count), 0)[:, None] / 2
    )
    filtering = np.array([0.3, 0.0])
    what = holding(sieve, solids, classes, streams, filtering)
    got = advanced(sieve, solids, classes, streams, what, 0.7)
    loads, void, d = loads_of(sieve, solids, classes), sieve.void, classes.diameter
    full = np.clip((loads.filled - 0.95) / 0.05, 0, 1)
    assert full.max() == 1.0
    assert full.min() == 0.0
    for i in range(2):
        matrix, source = np.diag(fluid_void(sieve, solids)), solids.carried[:, i].copy()
        source[streams.fed > 0] += 0.7 * streams.fed[streams.fed > 0] * what.feed[:, i]
        for k in range(len(streams.link)):
            a, b, w = streams.source[k], streams.target[k], 0.7 * streams.share[k]
            passage = sieve.passage[streams.link[k : k + 1]]
            near = (solids.in_pores[a] + solids.in_pores[b]).sum() / (void[a] + void[b])
            gaps = [0.1547 * one if one > 0 else np.inf for one in loads.diameter[[a, b]]]
            loose = 1 - wider_share(classes, passage)[0, i]
            loose *= 1 - bridging_chance.py_func(d[i] / passage[0])
            chance = min(0.06 + 1.6 * near, 0.33) if near > 1e-3 else 1.6 * near
            loose *= 1 - chance * wider_share(classes, np.array([min(gaps)]))[0, i]
            loose *= 1 - full[b] * wider_share(classes, np.array([gaps[1]]))[0, i]
            loose *= np.exp(-filtering[i] * sieve.reach[streams.link[k]])
            matrix[a, a] += w
            matrix[b, a] -= w * loose
        there = np.linalg.solve(matrix, source) * fluid_void(sieve, solids)
        assert got.carried[~outlet, i] == pytest.approx(there[~outlet], rel=1e-12)
        before, after = (one.inside_by_class + one.passed + one.cake for one in (solids, got))
        assert after - got.supplied == pytest.approx(before, rel=1e-13)


def test_contact_efficiency_of_a_colloid():
    """1 um in sand of 0.5 mm: Tufenkji and Elimelech 2004, by hand."""
    eta = collector_efficiency(np.array([1e-6]), np.array([1050.0]), BED)
    assert eta == pytest.approx([3.05e-3], rel=0.005)


def test_a_class_is_strained_by_the_share_that_is_too_wide():
    classes = replace(sizes(1.0), low=np.array([1.0]), high=np.array([4.0]))
    wider = wider_share(classes, np.array([0.5, 1.0, 2.0, 4.0, 9.0]))[:, 0]
    assert wider == pytest.approx([1.0, 1.0, 0.5, 0.0, 0.0], abs=1e-12)


def test_classes_hold_all_solids_of_the_mud():
    """Also what the cut of the case leaves out, and the tails of its curve."""
    curve = {"D10_mm": 0.005, "D50_mm": 0.025, "D90_mm": 0.07}
    classes = mud_classes(Fines.model_validate({"sizes": curve, "cut_um": 40.0}), 8)
    assert classes.concentration.sum() == pytest.approx(0.10, rel=1e-12)
    assert len(classes.low) == 8
    assert classes.low[0] < 5e-6
    assert np.all((classes.low <= classes.diameter) & (classes.diameter <= classes.high))
    one = mud_classes(Fines.model_validate({"radius_mm": 0.05}), 8)
    assert one.diameter == pytest.approx([1e-4])


# ---- On the network of a random pack.
def pack(order=None):
    grains = random_pack(60, aspect=1.5)
    if order is not None:
        grains = grains.where(order)
    network = build_network(grains, periodic="yz")
    halves = grain_resistances(network)
    clean = 1.0 / halves.sum(axis=1)
    intact = solve_flow(network, clean)
    sieve = sieve_of(network, halves, intact.throat_flux)
    return sieve, flows_through(network, sieve, clean, intact)


def course(sieve, **keys):
    given = {
        **{"velocity": 1e-3, "resistance": 1e3, "rest": 0.0, "at_rate": False},
        **{"plug_rate": 0.05, "plug_time": 200.0, "cap_time": 1e6, "sticking": 0.0, "bed": BED},
        **dict.fromkeys(("cake_permeability", "duration", "release")),
        "supply": 0.5 * float(sieve.void.sum()),
    }
    return Course(**given | keys)


def test_a_release_loses_no_mass():
    sieve, flow = pack()
    classes, solids = sizes(0.05, 0.2, 0.5), no_solids(sieve, sizes(0.05, 0.2, 0.5))
    volume, filtering = 0.05 * float(sieve.void.sum()), np.full(3, 0.2)
    for _ in range(6):
        streams = flow(kept_shares(sieve, solids, classes), None).streams
        loose = released(sieve, solids, streams, 1.0, 1.0, Release(1e-3, 2.0))
        solids = step(sieve, loose, classes, streams, filtering, volume)[1]
    assert loose.attached.sum() < solids.attached.sum()
    assert np.abs(solids.missing).max() < 1e-12
    assert min(solids.attached.min(), solids.in_throats.min(), solids.carried.min()) >= 0.0


def test_mass_of_every_class_is_found_again_and_none_falls_below_zero():
    sieve, flow = pack()
    end = invade_classes(sieve, sizes(0.05, 0.2, 0.5), course(sieve), flow)
    assert np.abs(end.solids.missing).max() < 1e-12
    assert end.solids.supplied.min() > 0
    names = ("carried", "in_pores", "attached", "in_throats", "cake", "passed")
    for one in (getattr(end.solids, name) for name in names):
        assert one.min() >= 0.0


def test_the_numbers_of_the_grains_do_not_matter():
    sieve, flow = pack()
    other, flow_there = pack(np.random.default_rng(5).permutation(60))
    first, second = (
        invade_classes(one, sizes(0.2, 0.5), course(one, supply=20.0), way)
        for one, way in ((sieve, flow), (other, flow_there))
    )
    for name in ("cake", "passed", "supplied"):
        there = pytest.approx(getattr(second.solids, name), rel=1e-6, abs=1e-9)
        assert getattr(first.solids, name) == there, name
    assert first.rows[-1]["k_over_k0"] == pytest.approx(second.rows[-1]["k_over_k0"], rel=1e-6)


def test_what_strains_and_sticks_nowhere_leaves_the_permeability():
    sieve, flow = pack()
    end = invade_classes(sieve, sizes(1e-4), course(sieve), flow)
    assert end.rows[-1]["k_over_k0"] == pytest.approx(1.0, abs=1e-9)
    assert end.stop_reason == "supply_exhausted"
    assert end.solids.passed[0] > 0.3 * end.solids.supplied[0]


def test_a_class_wider_than_every_throat_stays_at_the_face():
    """It fills the pores of the face and then makes a cake, which plugs it."""
    sieve, flow = pack()
    widest = sizes(1.001 * float(sieve.passage.max()))
    end = invade_classes(sieve, widest, course(sieve, supply=1e3), flow)
    assert end.stop_reason == "plugged"
    assert end.solids.cake[0] > 0
    assert not np.any(end.solids.in_pores[~sieve.inlet])
    # a tight one slows the flow by the law of its own growth, in which 1 / q rises evenly with V
    tight = course(sieve, supply=np.inf, cake_permeability=1e-7, duration=1e6)
    rows = invade_classes(sieve, widest, tight, flow).rows
    rate, volume = (np.array([row[key] for row in rows]) for key in ("rate_m3_s", "filtrate_m3"))
    slower = np.diff(volume) @ (1.0 / rate[1:] + 1.0 / rate[:-1]) / 2.0
    assert rate[-1] < 2e-3 * rate[0]
    assert rows[-1]["time_s"] == pytest.approx(slower, rel=0.08)


def test_a_tenth_of_the_step_hardly_changes_the_permeability(monkeypatch):
    """What the deposit holds back is that of the middle of a step, and not of its beginning."""
    sieve, flow = pack()
    classes, whole = sizes(0.4, 0.6, concentration=0.2), course(sieve, supply=10.0, plug_time=4e3)
    long = invade_classes(sieve, classes, whole, flow)
    monkeypatch.setattr(invasion, "CHANGE", 0.1 * invasion.CHANGE)
    monkeypatch.setattr(invasion, "FIRST_STEP", 0.1 * invasion.FIRST_STEP)
    short = invade_classes(sieve, classes, whole, flow)
    assert len(short.rows) > 8 * len(long.rows)
    assert long.rows[-1]["k_over_k0"] == pytest.approx(short.rows[-1]["k_over_k0"], rel=0.04)
