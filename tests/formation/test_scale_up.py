"""What a specimen hands up, and what the commands make of it."""

import json
import shutil
from contextlib import suppress
from dataclasses import fields, replace

import numpy as np
import pytest
from builders import tiny

from fdnet.cli import main
from fdnet.errors import CaseError
from fdnet.formation import scale_up
from fdnet.formation.model import Column, Flood, march
from fdnet.formation.scale_up import core_flood, fit_damage, fit_depths, hand_up, well_invasion
from fdnet.run.by_classes import Rested
from fdnet.run.finished import FinishedRun
from fdnet.run.pipeline import run_case
from fdnet.scales.flow import API_AREA

MUD = (
    "fines={sizes={D10_mm=0.04,D50_mm=0.07,D90_mm=0.12},count=300,concentration=0.2}",
    "box.sides=periodic",
    "fines.supply=batches",
)
FAST = (*MUD, "fines.count=4000", "invasion={method='network',classes=4}", "drag={}", "run={}")
BOTH = (
    *(*MUD, "fines.cut_um=80.0", "invasion={method='both',classes=3}", "drag={field='network'}"),
    *("fluid.velocity_m_s=5.0", "run.cap_ms=0.35", "run.time_step_factor=0.2"),
)


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    monkeypatch.setattr(scale_up, "DRAWS", 8)


RATE, G, LENGTH = 900.0, 1.5, 0.004


def depths(count, seed, g=G):
    """Depths m of fines, drawn by the law of the module, and how many passed `LENGTH`."""
    deeper = np.random.default_rng(seed).uniform(size=count)
    start = -np.expm1(-g)
    x = -np.log(-np.expm1(-g * deeper) / start) / RATE
    return x[x < LENGTH], int(np.sum(x >= LENGTH))


def fit(x, passed, random=None):
    """Rate and g of equal fines."""
    volume = np.full(len(x), 2e-15)
    return fit_depths(Rested("all", 0.1, x, volume, 2e-15 * passed, len(x)), LENGTH, random)[:2]


def test_the_filtration_of_drawn_fines_comes_back_within_the_scatter_of_samples():
    """The scatter of other fines is that of samples of the same ones, and the mean is true."""
    found = np.array([fit(*depths(150, seed)) for seed in range(40)])
    random = np.random.default_rng(0)
    samples = np.array([fit(*depths(150, seed % 4), random) for seed in range(80)])
    scatter = [np.std(samples[one::4], axis=0) for one in range(4)]
    assert np.mean(scatter, axis=0) == pytest.approx(found.std(axis=0), rel=0.3)
    error = (found.mean(axis=0) - [RATE, G]) / found.std(axis=0) * np.sqrt(40)
    assert np.abs(error).max() < 3


def test_a_constant_filtration_is_the_censored_mean():
    """rate = fines inside / (sum of depths + passed length): exact where growth is 0."""
    x, passed = depths(4000, 3, g=1e-9)
    rate, g = fit(x, passed)
    assert passed > 50
    assert abs(g) < 0.2
    assert rate == pytest.approx(len(x) / (x.sum() + passed * LENGTH), rel=0.1)
    exact = 25 / (x[:25].sum() + 40 * LENGTH)
    assert fit(x[:25], 40) == pytest.approx((exact, 1e-6), rel=1e-12)


def test_the_damage_of_made_sections_comes_back():
    deposit = 0.2 * np.exp(-np.linspace(0, 5, 40))
    share = np.repeat(np.eye(4), 10, axis=1) / 10
    kept = 1 / (share @ (1 + 14.0 * deposit) ** 2)
    value, error = fit_damage(kept, deposit, share)
    assert np.exp(value) == pytest.approx(14.0, rel=1e-4)
    assert error < 1e-4
    assert fit_damage(kept * [1.1, 0.9, 1.1, 0.9], deposit, share)[1] > 0.01


def test_the_model_gives_a_specimen_its_own_profile_and_permeability_back(finished):
    """Clean fluid follows through a cake, so that all comes to rest."""
    many, length = hand_up(finished), finished.case.size_m[0]
    area = float(np.prod(finished.case.size_m[1:]))
    edges = np.append(finished.sections["x_lo_m"], length)
    column = Column(edges=np.linspace(0.0, length, 301), area=area)
    fines, kept = [], []
    for one in many:
        caked = replace(one.medium, cake_permeability=1e-11)
        made = march(column, caked, [Flood(100.0, rate=area * 1e-3)], taps=edges)
        whole = np.append(0.0, np.cumsum(made.end.deposit.sum(axis=0) * column.volume))
        fines.append(np.diff(np.interp(edges, column.edges, whole)))
        kept.append(made.k_over_k0[-1])
    number = np.array(fines) / (4 / 3 * np.pi * float(finished.spheres().fines().radius[0]) ** 3)
    measured = np.cumsum(finished.sections["fines_count"])
    shares = measured.to_numpy() / measured.iloc[-1]
    assert np.cumsum(number[0]) / measured.iloc[-1] == pytest.approx(shares, abs=0.1)
    assert number[0].sum() == pytest.approx(measured.iloc[-1], rel=0.01)
    assert number[1:].sum(axis=1).std() / measured.iloc[-1] == pytest.approx(298**-0.5, rel=0.6)
    # each section within the scatter that a form with one number leaves
    assert np.log(kept[0]) == pytest.approx(np.log(scale_up.kept_by(finished)), abs=0.25)
    assert kept[0][0] == pytest.approx(scale_up.kept_by(finished)[0], abs=0.05)


def changed(run, spheres=lambda one: one, **summary):
    """The run with other spheres and other numbers in its summary."""

    class Changed(FinishedRun):
        def spheres(self, state="damaged"):
            return spheres(run.spheres(state))

    made = Changed(**{one.name: getattr(run, one.name) for one in fields(FinishedRun)})
    made.__dict__["summary"] = {**run.summary, **summary}
    return made


def shifted(metres):
    """Moves the fines along x."""

    def moved(one):
        way = np.outer(one.kind != one.kind.min(), [metres, 0, 0])
        return replace(one, position=one.position + way)

    return {"spheres": moved}


def test_a_specimen_that_cannot_tell_says_why(finished):
    sound, table = changed(finished), finished.sections
    before = table["k_initial_inplace_m2"]
    sound.__dict__["sections"] = table.assign(k_damaged_inplace_m2=before)
    passed = changed(finished, **shifted(1.0), passed_count=298)
    for run, said in (
        (passed, r"all 298 fines passed 3 mm, none was filtered: .* below 3"),
        (changed(finished, **shifted(-1.0)), "0 fines inside, 30 are needed"),
        (changed(finished, supplied_count=0), "no fines were supplied"),
        (sound, "no open section lost 2%"),
    ):
        with pytest.raises(CaseError, match=said):
            hand_up(run)
    assert any("not by a closed face" in note for note in hand_up(finished)[0].notes)


def test_a_face_that_plugs_at_once_hands_up_a_cake_alone(finished):
    cake = {"packed_thickness_m": 4e-4, "resistance_1_m": 1e7, "porosity": 0.5, "k_m2": 4e-11}
    plugged = changed(finished, **shifted(-1.0), stop_reason="plugged", cake=cake)
    (handed,) = hand_up(plugged)
    assert "all is cake" in handed.notes[-1]
    core = core_flood(plugged, length=0.05, rate=1e-8)
    assert core["k_over_k0"] == 1.0
    assert core["closed_at_s"] == 0.0
    assert core["cake_thickness_m"] > 0


@pytest.mark.parametrize("keys", [FAST, BOTH])
def test_classes_of_the_network_are_handed_up_each_by_its_own_profile(keys, tmp_path):
    """Their sum is the mud, their deposit that of the run, and a core has its k/k0 by section."""
    run = run_case(tiny(*keys), tmp_path / "run", stages=("pack", "invade", "analyse"))
    one, classes = hand_up(run)[0], run.summary["classes"]
    solids, rates = one.medium.solids, one.medium.rate
    assert len(solids) == len(classes) + (keys is BOTH)
    shares = [each["concentration"] for each in classes]
    assert solids[-len(classes) :] == pytest.approx(shares)
    assert solids.sum() == pytest.approx(run.case.fines.volume_fraction, rel=1e-9)
    assert keys is BOTH or rates[-1] > 2 * rates[0]
    area, length = float(np.prod(run.case.size_m[1:])), run.case.size_m[0]
    rest = sum(each.volume.sum() for each in scale_up._rested(run, run.case))
    assert one.fitted.mean() * length * area == pytest.approx(rest, rel=0.03)
    assert rest < run.summary["invaded_volume_m3"]  # the fluid carries the others
    assert core_flood(run, length=0.05, rate=1e-8)["sections"][0]["k_over_k0"] < 0.999


def test_a_run_whose_only_sphere_passed_has_no_table_of_its_throats(tmp_path):
    run = run_case(tiny(*BOTH, "fines.count=1"), tmp_path, stages=("pack", "invade", "analyse"))
    assert not (run.path / "bridging.csv").exists()


def test_both_without_finer_solids_hands_up_its_spheres(finished):
    assert len(scale_up._rested(finished, tiny(*BOTH))) == 1


def closed(run):
    """The run as if its face had closed, with a cake of 1 mm."""
    cake = {"packed_thickness_m": 1e-3, "resistance_1_m": 2e7, "porosity": 0.5, "k_m2": 5e-11}
    return changed(run, stop_reason="plugged", cake=cake)


def test_a_cake_whose_api_filtrate_is_given_gives_it_back(finished):
    """8 mL in half an hour at 100 psi, where no fine enters before."""
    press = {"length": 1e-5, "diameter": np.sqrt(4 * API_AREA / np.pi), "pressure": 6.895e5}
    plugged = closed(changed(finished, **shifted(-1.0)))
    found = core_flood(plugged, **press, minutes=30.0, api_filtrate=8e-6)
    assert found["filtrate_m3"] == pytest.approx(8e-6, rel=0.01)


def test_a_well_has_the_skin_of_its_run(finished):
    found = well_invasion(closed(finished), hours=1.0, pressure=2e6, api_filtrate=8e-6)
    assert found["skin"] == pytest.approx(found["skin_hawkins"], rel=0.05)
    assert found["skin_low"] < found["skin"] < found["skin_high"]
    assert found["perforated"]["skin"] > found["skin"]
    assert found["time_s"] == 3600.0
    one, inside = hand_up(finished)[0], np.cumsum(hand_up(finished)[0].fitted)
    depth = np.interp(0.95 * inside[-1], inside, one.x)
    assert found["depth_p95_m"] == pytest.approx(depth, rel=0.05)
    kept = [row["k_over_k0"] for row in found["k_over_k0"]]
    assert kept == sorted(kept)
    radius = np.sqrt(0.108**2 + found["filtrate_m3"] / np.pi / finished.porosity_initial)
    assert found["invasion_radius_m"] == pytest.approx(radius, rel=1e-3)
    wide = well_invasion(closed(finished), hours=1.0, pressure=2e6, radius=50.0, api_filtrate=8e-6)
    assert wide["skin"] < found["skin"] / 100
    for api, said in ((None, "of that time; give --api-filtrate"), (8e-6, "of that time")):
        full = well_invasion(closed(finished), hours=1e7, pressure=2e6, api_filtrate=api)
        assert full["warnings"][-1].endswith(f"alone fills the hole: the numbers are those {said}")


def test_the_commands_hand_up_once_and_keep_all(finished, tmp_path, capsys, monkeypatch):
    run, seen, of_run = tmp_path / "run", [], scale_up._of_run
    monkeypatch.setattr(scale_up, "_of_run", lambda *one: seen.append(one) or of_run(*one))
    shutil.copytree(finished.path, run)
    words = ["core", str(run), "--length", "76mm", "--rate", "1ml/min"]
    assert main([*words, "--json"]) == 0
    assert len(seen) == 1
    found = json.loads(capsys.readouterr().out)
    assert len(found["sections"]) == 4
    assert found["sections"][0]["k_over_k0"] < found["sections"][1]["k_over_k0"]
    assert "deposit of the run's end" in found["warnings"][-1]
    assert found["rate_m3_s"] == pytest.approx(1e-6 / 60, rel=1e-9)
    assert json.loads((run / "formation" / "core.json").read_text())["given"]["length"] == 0.076
    assert main(["well", str(run), "--hours", "2", "--pressure", "300psi", "--quiet"]) == 0
    text = capsys.readouterr().out
    assert {"skin", "depth_m"} <= set(text.split())
    page = (run / "report.html").read_text()
    assert "From the face to a core and a well" in page
    assert (run / "formation" / "handed_up.svg").is_file()
    for bad, said in (
        (["--length", "76"], "has no unit"),
        (["--length", "76mm"], "one of --rate and --pressure"),
        (["--length", "76mm", "--rate", "1ml"], "unit of volume"),
        (["--length", "0mm", "--rate", "1ml/min"], "length: 0, expected a number above 0"),
    ):
        with suppress(SystemExit):  # argparse ends by itself
            assert main(["core", str(run), *bad]) == 2
        assert said in capsys.readouterr().err
    assert main(["well", str(run), "--pressure", "2MPa", "--radius", "99.8m"]) == 2
    assert "99.8 m, expected below 99.7 m, the drainage radius" in capsys.readouterr().err
    with pytest.raises(CaseError, match="an empty list"):
        well_invasion([])
    with pytest.raises(CaseError, match="api_filtrate: 8e-06, expected None as it was handed up"):
        well_invasion(hand_up(finished), api_filtrate=8e-6)


def test_of_several_seeds_the_band_is_students():
    rows = [
        {"a": 1.0, "b": {"c": 2.0}, "d": [{"e": 1.0}], "f": None},
        {"a": 3.0, "b": {"c": 2.0}, "d": [{"e": 5.0}], "f": 4.0},
        {"a": 2.0, "b": {"c": 2.0}, "d": [{"e": 3.0}], "f": 6.0},
    ]
    found = scale_up._merged(rows, seeds=3)
    assert scale_up.with_band(found, "a") == "2 (-0.484 to 4.48)"
    assert scale_up.with_band(found, "f") == "5 (-7.71 to 17.7), 2 of 3 seeds"
    assert (found["b"], found["d"][0]["e"]) == ({"c": 2.0}, 3.0)
    found = scale_up._merged(rows, seeds=1)
    assert scale_up.with_band(found, "f") == "unknown (2 of 3 fits have it)"
