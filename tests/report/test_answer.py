"""What a run answers: skin, damaged zone, rules of thumb and millidarcy."""

import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from fdnet.case.tables import Run
from fdnet.report.tables import MILLIDARCY, in_millidarcy, percent
from fdnet.report.text import answer_sentence, end_words, facts, in_place_words
from fdnet.run import answer
from fdnet.run.answer import Step, face_loss, flow_lost, hawkins, layered_skin, steps_of, zone_of
from fdnet.run.summary import above_intact


def test_hawkins_skin_of_a_thin_zone_is_small():
    """(1/0.141 - 1) ln(109/108) = 6.0922 x 0.0092167."""
    skin = hawkins(0.141, well=0.108, damaged=0.109)
    assert skin == pytest.approx(0.0561, abs=5e-5)
    assert hawkins(1.0, well=0.1, damaged=0.2) == 0.0
    assert math.isinf(hawkins(0.0, well=0.1, damaged=0.2))
    assert flow_lost(math.log(100 / 0.1), well=0.1, drainage=100.0) == pytest.approx(0.5)
    assert flow_lost(math.inf, well=0.1, drainage=100.0) == 1.0


def test_rings_in_series_are_the_integral_of_the_pressure():
    """p' = q / (k r), integrated numerically, over q / k; k of the formation is in series."""
    edges, ratios = np.array([0.0, 1e-3, 3e-3, 10e-3]), (0.05, 0.4, 0.9)
    for before, formation in [
        ((2e-12, 2e-12, 2e-12), 2e-12),
        ((8e-12, 4e-12, 2e-12), 10e-3 / (1 / 8 + 2 / 4 + 7 / 2) * 1e-9),
    ]:
        steps, extra = [], 0.0
        for near, far, k, ratio in zip(edges, edges[1:], before, ratios, strict=False):
            steps.append(Step(near, far, k, k * ratio))
            radius = np.linspace(0.1 + near, 0.1 + far, 20001)
            middle = 0.5 * (radius[1:] + radius[:-1])
            lost = 1 / (k * ratio) - 1 / k
            extra += formation * float(np.sum(np.diff(radius) * lost / middle))
        assert layered_skin(steps, 0.1) == pytest.approx(extra, rel=1e-6), before


def test_millidarcy_is_that_of_the_recommended_practice():
    assert pytest.approx(9.869233e-13, rel=1e-12) == 1000.0 * MILLIDARCY
    assert in_millidarcy(9.869233e-13) == "1,000"
    assert in_millidarcy(9.869233e-16 * 194553.0) == "194,600"
    assert in_millidarcy(9.869233e-16 * 0.25) == "0.25"
    assert (percent(-0.0004), percent(None), percent(0.3464)) == ("0.0", "–", "34.6")
    assert in_millidarcy(None) == in_millidarcy(float("nan")) == "–"


def analysis_of(sections, layers=None, law="all-spheres"):
    names = ("x_lo", "x_hi", "k_initial_inplace", "k_damaged_inplace")
    made = [SimpleNamespace(**dict(zip(names, row, strict=True))) for row in sections]
    if layers is not None:
        rows = np.array(layers)
        layers = SimpleNamespace(
            edges=np.append(rows[:, 0], rows[-1, 1]), k_initial=rows[:, 2], k_damaged=rows[:, 3]
        )
    return SimpleNamespace(sections=made, layers=layers, damage_law_used=law)


def test_layers_and_what_is_left_of_a_section_are_the_section_in_series():
    """Two layers of 0.5 mm and a rest of 1 mm make a section of 2 mm, by either permeability."""
    thin = [(0.0, 5e-4, 4.0, 0.5), (5e-4, 1e-3, 2.0, 1.0)]
    whole = [
        answer.layers_in_series([(5e-4, k[0]), (5e-4, k[1]), (1e-3, 3.0)])
        for k in ((4.0, 2.0), (0.5, 1.0))
    ]
    steps = steps_of(analysis_of([(0.0, 2e-3, *whole), (2e-3, 4e-3, 5.0, 5.0)], thin))
    assert [step.near for step in steps] == [0.0, 5e-4, 1e-3, 2e-3]
    assert [step.far for step in steps] == [5e-4, 1e-3, 2e-3, 4e-3]
    assert (steps[2].before, steps[2].after) == pytest.approx((3.0, 3.0))
    zone = zone_of(steps)
    assert zone.depth == 1e-3
    assert zone.ratio == pytest.approx((1 / 4 + 1 / 2) / (1 / 0.5 + 1 / 1.0))
    assert not zone.open_end
    assert len(steps_of(analysis_of([(0.0, 2e-3, *whole)], thin, law="section-archie"))) == 1


def test_a_layer_that_seems_to_gain_is_made_up_for_and_nothing_is_cut_off():
    """In place the fines turn the flow aside: layer and rest make the section in series."""
    thin = [(0.0, 1e-3, 2.0, 1.0)]
    section = [
        answer.layers_in_series([(1e-3, 2.0), (1e-3, 3.0)]),
        answer.layers_in_series([(1e-3, 1.0), (1e-3, 3.6)]),
    ]
    first, rest = steps_of(analysis_of([(0.0, 2e-3, *section)], thin))
    assert (rest.before, rest.after) == (pytest.approx(3.0), pytest.approx(3.6))
    assert zone_of([first, rest]).depth == 1e-3
    much = [(0.0, 1e-3, 2.0, 0.4)]  # resists more than its whole section
    assert steps_of(analysis_of([(0.0, 2e-3, 2.0, 1.0)], much)) == [Step(0.0, 2e-3, 2.0, 1.0)]


def test_a_layer_that_two_sections_share_counts_in_each_with_its_part():
    """Half of the last layer, 0.2 mm of k 1, and 0.8 mm of k 2 beyond make a section of 1 mm."""
    thin = [(0.0, 4e-4, 4.0, 4.0), (4e-4, 8e-4, 1.0, 1.0)]
    series = 1e-3 / (2e-4 / 1.0 + 8e-4 / 2.0)
    sections = [(0.0, 6e-4, 2.0, 2.0), (6e-4, 1.6e-3, series, series)]
    *_, rest = steps_of(analysis_of(sections, thin))
    assert rest == pytest.approx(Step(8e-4, 1.6e-3, 2.0, 2.0))


def test_values_in_place_above_the_intact_ones_are_counted():
    sections = [(0.0, 1e-3, 2.0, 2.0 * (1 + 1e-4)), (1e-3, 2e-3, 2.0, 2.4)]
    layers = [(0.0, 5e-4, 2.0, 2.4), (5e-4, 1e-3, 2.0, 1.0), (1e-3, 2e-3, 2.0, 2.1)]
    counted = above_intact(analysis_of(sections, layers))
    assert counted == {"sections_inplace_above_intact": 1, "layers_above_intact": 2}
    assert in_place_words(above_intact(analysis_of(sections[:1]))) == ""


def test_a_zone_without_damage_without_end_and_without_flow():
    for after, depth, ratio, open_end in [
        ((1.0, 1.0), 0.0, 1.0, False),
        ((0.5, 0.5), 2.0, 0.5, True),
        ((0.0, 1.0), 1.0, 0.0, False),
    ]:
        zone = zone_of([Step(0, 1, 1.0, after[0]), Step(1, 2, 1.0, after[1])])
        assert (zone.depth, zone.open_end) == (depth, open_end), after
        assert zone.ratio == pytest.approx(ratio), after


def sizes(**changed):
    fines = {"D50": 40e-6, "D85": 60e-6, "D90": 100e-6} | changed.pop("fines", {})
    given = {"throat_median": 100e-6, "throat_largest": 90e-6, "grain_d15": 270e-6}
    return {"fines": fines, **given, "concentration": 0.05, **changed}


def test_each_rule_turns_at_its_published_limit():
    for changed, says in [
        ({}, ["bridges", "bridges", "bridges", "bridges"]),
        ({"concentration": 0.049}, ["passes", "bridges", "bridges", "bridges"]),
        ({"throat_median": 121e-6}, ["passes", "bridges", "bridges", "bridges"]),
        ({"throat_largest": 101e-6}, ["bridges", "passes", "passes", "bridges"]),
        ({"fines": {"D50": 18e-6}}, ["passes", "bridges", "passes", "bridges"]),
        ({"grain_d15": 301e-6}, ["bridges", "bridges", "bridges", "between"]),
        ({"grain_d15": 541e-6}, ["bridges", "bridges", "bridges", "passes"]),
    ]:
        rules = answer.rules_of("bridges", **sizes(**changed))
        assert [rule["says"] for rule in rules] == says, changed
        expected = {"bridges": True, "passes": False, "between": None}
        assert [rule["agrees"] for rule in rules] == [expected[word] for word in says]
        undecided = answer.rules_of("undecided", **sizes(**changed))
        assert {rule["agrees"] for rule in undecided} == {None}
    # 0.309 is (5/9)^2: the share finer grows with the square root of the size up to D90
    values = [rule["value"] for rule in answer.rules_of("bridges", **sizes())]
    assert values == pytest.approx([0.4, 100 / 90, 40 / 90 * (9 / 5) ** 2, 270 / 60])


def test_the_run_bridges_passes_or_does_not_decide():
    base = {"invaded_count": 900, "passed_count": 20, "stop_reason": "plugged"}
    base |= {"invasion_depth_p95_m": 1e-3, "sections": [{"x_hi_m": 4e-3}]}
    for changed, shown in (
        ({}, "bridges"),
        ({"passed_count": 901}, "passes"),
        ({"invasion_depth_p95_m": 3.8e-3}, "passes"),
        ({"stop_reason": "cap"}, "undecided"),
    ):
        assert answer.run_shows(base | changed) == shown, changed


def test_the_scatter_of_a_seed_is_that_of_the_published_repeats(root):
    table = pd.read_csv(root / "docs/thesis/results.csv")
    table = table[table["law"] == "lubrication"].drop_duplicates(["id", "seed"])
    for one in (answer.QUICK, answer.FULL):
        seeds = table[table["id"].isin(one.cases)].groupby("id")
        depth, loss = seeds["invasion_depth_p95_mm"], seeds["k_reduction_1"]
        assert seeds.size().sum() == one.runs
        assert one.depth == pytest.approx(((depth.std() / depth.mean()) ** 2).mean() ** 0.5, 0.02)
        assert one.loss == pytest.approx((loss.std() ** 2).mean() ** 0.5, 0.03)
    seeds = pd.read_csv(root / "docs/validation/seeds.csv").groupby("case")
    assert dict(seeds.size()) == dict.fromkeys(answer.FOLLOWED.cases, answer.FOLLOWED.runs)
    depth, loss = seeds["invasion_depth_p95_m"], seeds["face_lost"]
    spread = ((depth.std() / depth.mean()) ** 2).mean() ** 0.5
    assert answer.FOLLOWED.depth == pytest.approx(spread, 0.02)
    assert answer.FOLLOWED.loss == pytest.approx((loss.var()).mean() ** 0.5, 0.03)


def test_the_loss_at_the_face_is_that_of_the_layers_in_series():
    """1.5 of 2 layers, and a depth beyond the end."""
    steps = [Step(0.0, 1e-3, 2.0, 0.5), Step(1e-3, 3e-3, 4.0, 2.0)]
    before, after = 1.0 / (1 / 2 + 0.5 / 4), 1.0 / (1 / 0.5 + 0.5 / 2)
    assert face_loss(steps, 1.5e-3) == (pytest.approx(1 - after / before), 1.5e-3)
    assert face_loss(steps[:1], 1.5e-3) == (pytest.approx(0.75), 1e-3)


def test_a_plugged_face_says_what_may_still_move():
    end = {"stop_reason": "plugged", "rate_over_initial": 0.3}
    for share, said in ((0.0, "1.0"), (0.2, "20.0")):
        text = end_words(end, Run(plug_rate=share))
        assert f"no more than {said} % of the fluid's first velocity" in text
    assert end_words(end | {"method": "network"}, Run()).endswith("crossed it for the set time")


DAMAGE = {"zone_depth_m": 2e-3, "zone_k_over_k0": 0.34, "reaches_the_end": False}
DAMAGE |= {"lost_from": 0.05, "face_depth_m": 1e-3, "face_lost": 0.784}
SUMMARY = {
    **{"case": "a", "seed": 3, "stop_reason": "plugged", "final": True, "invaded_count": 900},
    **{"invasion_depth_p95_m": 1.388e-3, "k_initial_m2": 2e-12, "porosity_initial": 0.38},
    "words": {"end": "the face plugged: no fine crossed it for the set time"},
    "damage": DAMAGE,
    "sections": [{"x_hi_m": 4e-3}],
    "scatter": {"depth_p95_relative": 0.36, "first_mm_loss": 0.067, "runs": 30, "source": "x.csv"},
}
WELL = {"skin": 0.056, "skin_flow_lost": 0.0081, "skin_well_radius_m": 0.108}
SHORT = WELL | {"sections": [{"x_hi_m": 2.3e-3}]}
UNFINISHED = {"final": False, "stop_reason": "unfinished", "share_done": 0.34}
FLOW = {"drag_last_update": {"k_over_k0": 0.278}, "damage_law_used": "thesis"}


def test_each_number_of_two_laws_names_its_own():
    """The thesis's law says 0.733 of k0, the network of the flow 0.278."""
    counts = dict.fromkeys(("supplied_count", "passed_count", "upstream_count"), 900)
    more = {"k_damaged_m2": 1.466e-12, "k_reduction": 0.267, "porosity_damaged": 0.3}
    more |= {"invasion_depth_m": 2e-3, "cake_thickness_m": 0.0, "law": "thesis", **counts}
    said = {one.name: one.text for one in facts(SUMMARY | more | FLOW)}
    assert said["permeability"].endswith("26.7 % lost by the law thesis")
    last = "72.2 % lost as the simulated flow met it last: by section-archie with"
    assert said["k of the flow"].startswith(last)
    assert "k of the flow" not in [one.name for one in facts(SUMMARY | more)]


def test_the_answer_is_a_sentence_to_act_on():
    first = ["first millimetre lost 78 %", "± 6.7 points", "within 1.39 mm (± 36 %)"]
    cut_off = {"final": False, "stop_reason": "mud_cut_off"}
    for changed, said, not_said in [
        ({}, [*first, "than 2.4 mm"], "skin"),
        (SHORT, ["too short", "lengthen the box", "the skin is 0.056 or more"], "deeper"),
        (SHORT | UNFINISHED, ["Provisional, at 34.0 %", "too short", "or more"], "Continue"),
        (UNFINISHED, ["so far 95 %", "Continue the run"], "too short"),
        (WELL, ["small skin of 0.056", "0.81 % of the flow", "108 mm"], "infinite"),
        (WELL | {"skin": None, "skin_flow_lost": 1.0}, ["skin is infinite"], "small"),
        (WELL | {"skin": -1e-4, "skin_flow_lost": -1e-5}, ["this is no skin"], "-"),
        ({"final": False, "stop_reason": "cap"}, ["not final", "run.cap_ms"], "deeper"),
        (cut_off, ["mud was cut off", "fines.slab_mm"], "cap"),
        (FLOW, ["lost 78 % of the permeability by the law thesis"], "all-spheres"),
        ({"invaded_count": 0}, ["No fine entered"], "95 %"),
    ]:
        text = answer_sentence(SUMMARY | changed)
        assert all(part in text for part in said), text
        assert not_said not in text, text
