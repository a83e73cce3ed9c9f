"""A run by the fast model: the same folder as with LIGGGHTS, from the same pack."""

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from builders import tiny

from fdnet import build_network, solve_flow
from fdnet.classes import invasion
from fdnet.classes.invasion import cake_permeability, invade_classes
from fdnet.cli import main
from fdnet.errors import CaseError, FlowError
from fdnet.report.picture import PNG_START
from fdnet.run import by_classes, movie
from fdnet.run.by_classes import STATE, class_model, read_classes, write_class_invasion
from fdnet.run.finished import open_run
from fdnet.run.movie import fluxes_of, states_of
from fdnet.run.pipeline import run_case
from fdnet.scales.scales import invasion_scales
from fdnet.spheres.readers import read_spheres

FAST = ("invasion.method=network", "box.sides=periodic", "drag={}", "run={}")
FAST += ("fines.supply=batches", "cake.api_filtrate_mL=5.0")


@pytest.fixture(scope="module")
def fast(tmp_path_factory):
    return run_case(tiny(*FAST), tmp_path_factory.mktemp("fast") / "run")


def test_the_folder_is_that_of_any_run(fast):
    """Every number of the output contract that does not ask how the fines were moved."""
    summary, fines = fast.summary, fast.spheres().fines()
    assert summary["method"] == "network"
    inside = (fines.position[:, 0] >= 0) & (fines.position[:, 0] < fast.case.size_m[0])
    assert int(inside.sum()) == summary["invaded_count"] == fast.sections.fines_count.sum() > 0
    parts = ("invaded_count", "passed_count", "upstream_count")
    assert summary["supplied_count"] == sum(summary[name] for name in parts)
    last = fast.history.iloc[-1]
    assert [last[name] for name in parts] == [summary[name] for name in parts]
    assert 0 < summary["k_damaged_m2"] < summary["k_initial_m2"]
    assert (fast.throats.conductance_damaged_m3 <= fast.throats.conductance_initial_m3).all()
    assert summary["mass_missing"] < 1e-12
    assert summary["dem_dt_s"] is None, "nothing moved in time steps"
    filled = fast.profile.porosity_initial - fast.profile.porosity_damaged
    width = fast.profile.x_hi_m - fast.profile.x_lo_m
    area = fast.case.size_m[1] * fast.case.size_m[2]
    assert float(filled @ width) * area == pytest.approx(summary["invaded_volume_m3"], rel=1e-6)
    assert (fast.path / "report.html").stat().st_size > 0
    text = " ".join(summary["certainty"])
    assert "8 seeds of cases/quick.toml, with spheres in LIGGGHTS alone" in text
    assert "by the fast model of size classes" in text


def test_the_number_of_the_api_is_that_of_the_cake(fast):
    """A filtrate given comes out again; without a cake's permeability it is unknown."""
    assert fast.summary["api_filtrate_mL"] == pytest.approx(5.0, rel=1e-12)
    by_hand = 2 * cake_permeability(fast.case) * 690e3 * 1800 * (1 - 0.4 - 0.1) / (0.05 * 0.1)
    assert 1e6 * 45.8e-4 * np.sqrt(by_hand) == pytest.approx(5.0, rel=1e-9)


def test_what_the_case_says_of_the_flow_ends_a_fast_run_too(fast):
    """The rate below which the face is plugged, and the volumes of the pores that pass."""
    scales, grains = invasion_scales(fast.case), fast.spheres("initial")
    pores = scales.porosity * np.prod(fast.case.size_m)
    for key, said in (("stop_rate=0.9", "plugged"), ("stop_pore_volumes=0.01", "duration")):
        model = class_model(tiny(*FAST, f"run.{key}"), scales, grains)
        end = invade_classes(model.sieve, model.classes, model.course, model.flow)
        assert end.stop_reason == said
        before, last = (row["rate_over_initial"] for row in end.rows[-2:])
        assert last < 0.9 <= before if said == "plugged" else last > 0.9
    assert end.rows[-1]["filtrate_m3"] == pytest.approx(0.01 * pores, rel=1e-9)


def test_a_fast_run_of_too_many_steps_or_too_few_fines_is_refused(fast, tmp_path, monkeypatch):
    few = "fines={sizes={D10_mm=0.04,D50_mm=0.07,D90_mm=0.1},count=2,concentration=0.1}"
    for case, steps, error, said in (
        (tiny(*FAST, few), 5000, CaseError, r"2.1 fines came, .* raise fines.count"),
        (fast.case, 3, FlowError, r"3 steps reached .* of at most .* ms; raise run.plug"),
    ):
        monkeypatch.setattr(invasion, "MOST_STEPS", steps)
        model = class_model(case, invasion_scales(case), fast.spheres("initial"))
        with pytest.raises(error, match=said):
            write_class_invasion(model, tmp_path / "invade")


def test_a_killed_run_goes_on_from_the_pack_to_the_same_bits(fast, tmp_path):
    """Without LIGGGHTS."""
    again = tmp_path / "again"
    shutil.copytree(fast.path, again)
    for name in ("manifest.json", "invade/stage.json", "summary.json"):
        (again / name).unlink()
    run_case(tiny(*FAST), again, resume=True, liggghts="/nowhere")
    for name in ("invade/classes.npz", "sections.csv", "history.csv", "spheres_damaged.csv"):
        assert (again / name).read_bytes() == (fast.path / name).read_bytes(), name
    assert open_run(again).summary["k_damaged_m2"] == fast.summary["k_damaged_m2"]


def test_a_movie_shows_the_solids_that_the_history_counts(fast, tmp_path, monkeypatch):
    """In every state, and none moves; the last is the end of the run."""
    clean, *states = states_of(fast)
    assert clean.spheres is None
    assert len(states) == min(len(fast.history) - 1, by_classes.MOST_STATES)
    seen = {}
    for one in states:
        fines = read_spheres(one.spheres, box=[(0.0, side) for side in fast.case.size_m])
        x = fines.position[:, 0]
        inside = (x >= 0) & (x < fast.case.size_m[0])
        assert int(inside.sum()) == one.row["invaded_count"]
        assert int((x < 0).sum()) == one.row["upstream_count"]
        for number, place in zip(fines.id.tolist(), fines.position.tolist(), strict=True):
            assert seen.setdefault(number, place) == place
    end = fast.spheres().fines()
    assert np.array_equal(fines.position, end.position)
    assert np.array_equal(fines.radius, end.radius)
    drawn = []
    monkeypatch.setattr(movie, "write_movie", lambda path, frames, *_, **__: drawn.extend(frames))
    movie.movie_of(fast.path, tmp_path / "m.gif", flux=True)
    assert [one.spheres for one in drawn[1:]] == [one.spheres for one in states]
    last = fast.history.iloc[-1]
    words = f"k/k0 {last.k_over_k0:.2f},   {int(last.invaded_count)} fines in the sand"
    assert drawn[-1].words.endswith(words)


def test_the_flux_of_a_movie_is_that_of_the_run(fast, tmp_path):
    table, states = fast.throats, list(states_of(fast))
    network = build_network(fast.spheres("initial"), periodic=fast.case.periodic)
    first, *_, last = (one for one, _ in fluxes_of(fast, network, states))
    rate = fast.history.rate_over_initial.iloc[-1]
    for values, name, share in ((first, "initial", 1.0), (last, "damaged", rate)):
        flow = solve_flow(network, table[f"conductance_{name}_m3"].to_numpy())
        expected = 100.0 * share * np.abs(flow.throat_flux) / flow.inflow
        assert values == pytest.approx(expected, rel=1e-4, abs=1e-5)
    target = tmp_path / "before_and_after.png"
    assert main(["movie", str(fast.path), "--show", "flux", "--out", str(target)]) == 0
    assert target.read_bytes().startswith(PNG_START)


def test_a_fast_run_of_an_earlier_version_has_its_end_to_show_and_no_flow(fast, tmp_path):
    old = Path(shutil.copytree(fast.path, tmp_path / "old"))
    with np.load(old / "invade" / STATE) as data:
        kept = {name: data[name] for name in data.files if not name.startswith("state_")}
    np.savez_compressed(old / "invade" / STATE, **kept)
    done, *_ = by_classes.finished_classes(
        fast.case, invasion_scales(fast.case), fast.spheres("initial"), old / "invade"
    )
    ((row, fines),) = done.states
    assert row.step == len(fast.history) - 1
    assert len(fines) == len(fast.spheres().fines())
    with pytest.raises(CaseError, match="kept no flow; run the case anew for --show flux"):
        next(fluxes_of(open_run(old), fast.network(), []))


def test_states_on_the_way_are_even_and_what_was_washed_out_is_drawn(fast):
    model = class_model(fast.case, invasion_scales(fast.case), fast.spheres("initial"))
    kept, seen = read_classes(fast.path / "invade" / STATE), {}
    flow = SimpleNamespace(throat_flux=np.array([-1.0, 3.0]), inflow=2.0)
    for step in range(150):
        by_classes.watch(seen, step, kept.solids, flow)
    assert list(seen) == [*range(0, 150, 8), 149]
    assert seen[149]["flux"].tolist() == [0.5, 1.5]
    by_class = np.repeat(kept.by_class[-1:], 150, axis=0)
    by_class[8, 0, 0] += 5 * model.classes.volume[0]
    kept = replace(kept, by_class=by_class, rows=kept.rows[-1:] * 150)
    end, held = fast.spheres().fines(), {step: one["held"] for step, one in seen.items()}
    states = [one for _, one in by_classes.states_on_the_way(fast.case, model, kept, held)]
    assert [len(one) - len(end) for one in states] == [0, 5, *[0] * (len(seen) - 2)]
    x = states[1].position[len(end) :, 0]
    assert ((x >= 0) & (x < fast.case.size_m[0])).all()


def test_a_given_time_ends_with_its_mud_or_when_it_is_over(fast):
    """Mud without an end comes for all the time; before, the run stopped in a division by 0."""
    for mud, reason in (("", "duration"), (", count=60", "supply_exhausted")):
        fines = f"fines={{radius_mm=0.05, concentration=0.1{mud}}}"
        case = tiny(*FAST[:4], fines, "run.duration_ms=40.0")
        model = class_model(case, invasion_scales(case), fast.spheres("initial"))
        end = invade_classes(model.sieve, model.classes, model.course, model.flow)
        assert end.stop_reason == reason
        assert mud or end.rows[-1]["time_s"] == pytest.approx(0.04)


def test_a_class_above_every_throat_is_said_to_be_cake(fast):
    case = tiny(*FAST, "fines.radius_mm=0.24", "fines.count=20")
    scales, grains = invasion_scales(case), fast.spheres("initial")
    (said,) = by_classes.all_is_cake(class_model(case, scales, grains))
    assert said.startswith("fines of 480 to 480 µm are wider than every throat (")
    assert not list(by_classes.all_is_cake(class_model(fast.case, scales, grains)))


def test_a_pack_without_a_path_and_a_mud_above_packing_are_refused(fast, monkeypatch):
    with pytest.raises(CaseError, match=r"fines.concentration: .* at most 30 %"):
        tiny(*FAST, "fines.concentration=0.65")
    shut = lambda network: np.full((len(network.throat_radius), 2), np.inf)  # noqa: E731
    monkeypatch.setattr(by_classes, "grain_resistances", shut)
    with pytest.raises(FlowError, match="no open path from the face"):
        class_model(fast.case, invasion_scales(fast.case), fast.spheres("initial"))


def test_the_pack_is_that_of_a_run_with_spheres():
    sides = "box.sides=periodic"
    cases = tiny(sides), tiny(*FAST), tiny(sides, "invasion.method=liggghts")
    assert len({case.digest("pack") for case in cases}) == 1


def test_what_does_not_go_together_is_refused():
    network = "invasion.method=network"
    cake = ("cake.api_filtrate_mL=5", "cake.permeability_m2=1e-18")
    for keys, said in (
        ((network, *cake), "each gives the cake"),
        (cake[1:], "the table belongs to invasion.method"),
        ((network, "clean_up.drawdown_MPa=1"), "nothing turns the flow back"),
        ((network, "grains.motion=mobile"), "grains that stay"),
        (("invasion={method='network',release_stress_Pa=1.0}",), "release_time_s: is missing"),
    ):
        with pytest.raises(CaseError, match=said):
            tiny(*keys)
