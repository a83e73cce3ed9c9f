"""Bands, differences and numbers of seeds against closed forms and published values."""

import math

import pytest
from campaign.samples import comparison

from fdnet.campaign.result.pairs import (
    Pair,
    compare_pair,
    holm,
    paired_seeds,
    seeds_for_width,
    separate_seeds,
    student_band,
)
from fdnet.campaign.result.table import band_row
from fdnet.campaign.result.words import band_text, value_text
from fdnet.campaign.until import is_reached, next_seed_count, parse_until
from fdnet.errors import CaseError
from fdnet.report.tables import percent
from fdnet.statistics.bands import Band

DRUG_1 = dict(enumerate([0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0]))
DRUG_2 = dict(enumerate([1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4]))
"""Hours of sleep gained by ten patients with each of two drugs (Student 1908)."""


def test_the_band_of_a_mean_is_students():
    """t(4) = 2.776445 of any table, s^2 = 2.5."""
    band = student_band([1, 2, 3, 4, 5])
    half = 2.776445 * math.sqrt(2.5 / 5)
    assert (band.mean, band.low, band.high) == pytest.approx((3, 3 - half, 3 + half), rel=1e-6)
    assert math.isnan(student_band([1.0]).low)


def test_a_paired_difference_is_that_of_students_sleep_data():
    """t = -4.0621, p = 0.002833, 95 % from -2.4599 to -0.7001, as textbooks give it."""
    pair = compare_pair(("1", "2"), DRUG_1, DRUG_2, paired=True)
    assert pair.p_value == pytest.approx(0.002833, rel=1e-3)
    ends = (pair.difference.mean, pair.difference.low, pair.difference.high)
    assert ends == pytest.approx((-1.58, -2.4598858, -0.7001142), rel=1e-6)
    assert pair.apart


def test_an_unpaired_difference_is_welchs():
    """The same data as two samples: p = 0.07939, 95 % from -3.3655 to 0.2055."""
    pair = compare_pair(("1", "2"), DRUG_1, DRUG_2, paired=False)
    assert pair.p_value == pytest.approx(0.07939, rel=1e-3)
    ends = (pair.difference.low, pair.difference.high)
    assert ends == pytest.approx((-3.3654832, 0.2054832), rel=1e-6)
    assert not pair.apart


def test_the_seeds_needed_are_cohens():
    """80 % power at 5 % for half a spread: 34 pairs, or 64 of each (Cohen 1988)."""
    assert paired_seeds(0.5, 1.0) == 34
    assert separate_seeds(0.5, 1.0, 1.0) == 64
    assert paired_seeds(0.0, 1.0) is None
    assert paired_seeds(1e-6, 1.0) is None


def test_the_seeds_for_a_width_are_the_first_that_reach_it():
    """s^2 = 2.5, half-width 1: t(11) s / sqrt(12) = 1.0046 and t(12) s / sqrt(13) = 0.9555."""
    assert seeds_for_width([1, 2, 3, 4, 5], 1.0, 100) == 13
    assert seeds_for_width([1, 2, 3, 4, 5], 1.0, 10) == 10


def test_several_pairs_are_judged_together():
    """Holm: 0.005 < 0.05/4 and 0.01 < 0.05/3, but 0.03 is not below 0.05/2."""
    band = Band(mean=0, low=0, high=0)
    pairs = [
        Pair(
            one="a",
            other=str(p),
            difference=band,
            paired=True,
            p_value=p,
            apart=True,
            seeds_needed=None,
        )
        for p in (0.01, 0.04, 0.03, 0.005)
    ]
    assert [pair.apart for pair in holm(pairs)] == [True, False, False, True]


def test_shared_packs_show_a_difference_that_separate_ones_hide(tmp_path):
    """A constant gap of 0.01 with little noise, under a scatter of packs of 0.1."""
    base, noise = [0.3, 0.4, 0.5, 0.6], [0.0101, 0.0099, 0.0102, 0.0098]
    values = {"a": base, "b": [x + y for x, y in zip(base, noise, strict=True)]}
    (paired,) = comparison(tmp_path, values).pairs()
    (separate,) = comparison(tmp_path, values, shared=False).pairs()
    assert paired.paired
    assert paired.apart
    assert not separate.paired
    assert not separate.apart


def test_the_mean_of_a_sweep_takes_each_seed_once(tmp_path):
    """Means over the variants by seed: 2, 3 and 4, of which Student's half is t(2)/sqrt(3)."""
    made = comparison(tmp_path, {"a": [1, 2, 3, 9], "b": [3, 4, 5]})
    band, seeds = made.overall("k_reduction")
    assert seeds == 3
    assert (band.mean, band.half_width) == pytest.approx((3, 4.302653 / math.sqrt(3)), rel=1e-6)


@pytest.mark.parametrize(
    ("text", "half", "relative"),
    [
        ("k_reduction ± 5 %", 0.05, False),
        ("k_reduction+-0.02", 0.02, False),
        ("k_damaged_m2 +- 10%", 0.1, True),
    ],
)
def test_a_goal_is_read(text, half, relative):
    goal = parse_until(text)
    assert (goal.half_width, goal.relative) == (pytest.approx(half), relative)


@pytest.mark.parametrize("text", ["k_reduction", "± 5 %", "k_reduction ± 0 %", "k ± x", ""])
def test_a_goal_that_says_nothing_is_refused(text):
    with pytest.raises(CaseError, match="--until"):
        parse_until(text)


def test_seeds_are_added_until_the_band_is_narrow(tmp_path):
    """Three seeds 0.3, 0.4 and 0.5: half a band is 0.248; for 0.1 the spread asks for 7 seeds."""
    made = comparison(tmp_path, {"a": [0.3, 0.4, 0.5]})
    assert is_reached(parse_until("k_reduction ± 25 %"), made)
    goal = parse_until("k_reduction ± 10 %")
    assert not is_reached(goal, made)
    assert next_seed_count(goal, made, 32) == 6  # at most twice as many at a time
    assert next_seed_count(goal, made, 4) == 4


@pytest.mark.parametrize(
    ("quantity", "values", "ends", "said"),
    [
        # t(1) = 12.7062: the whole band of 0.5 and 0.6 is -0.085 to 1.185
        ("k_reduction", [0.5, 0.6], (0.0, 1.0), "cut at 0 % and 100 %"),
        # t(2) 0.08 / sqrt(3) = 4.302653 x 0.0461880 = 0.198731
        ("k_reduction", [0.02, 0.10, 0.18], (0.0, 0.298731), "cut at 0 %"),
        ("porosity_damaged", [0.82, 0.90, 0.98], (0.701269, 1.0), "cut at 100 %"),
        ("invaded_count", [1, 5, 9], (0.0, 5 + 4.302653 * 4 / 3**0.5), "cut at 0"),
        ("k_damaged_m2", [1e-12, 5e-12, 9e-12], (0.0, 5e-12 + 4.302653 * 4e-12 / 3**0.5), "cut"),
        ("pores", [1, 5, 9], (0.0, 5 + 4.302653 * 4 / 3**0.5), "cut at 0"),
        # neither bounded, nor within the bounds
        ("skin", [1.0, 5.0, 9.0], (5 - 4.302653 * 4 / 3**0.5, 5 + 4.302653 * 4 / 3**0.5), ""),
        ("k_reduction", [-0.1, 0.0, 0.1], (-0.248414, 0.248414), ""),
        ("k_reduction", [0.3, 0.4, 0.5], (0.4 - 0.248414, 0.4 + 0.248414), ""),
    ],
)
def test_a_band_ends_where_its_quantity_does(tmp_path, quantity, values, ends, said):
    made = comparison(tmp_path, {"a": values}, more={quantity: values})
    band = made.band("a", quantity)
    assert (band.low, band.high) == pytest.approx(ends, rel=1e-5)
    assert band.mean == pytest.approx(sum(values) / len(values))
    assert said in band_text(quantity, band)
    assert ("cut" in band_text(quantity, band)) == bool(said)
    assert made.overall(quantity)[0] == band
    assert band_row(band).get("cut_at", []) == list(band.cut)


def test_a_difference_of_shares_ends_at_all_of_them(tmp_path):
    """Welch with one degree of freedom each side: far more than 100 points."""
    (pair,) = comparison(tmp_path, {"a": [0.1, 0.9], "b": [0.2, 0.9]}, shared=False).pairs()
    assert (pair.difference.low, pair.difference.high) == (-1.0, 1.0)


def test_the_seeds_are_added_by_the_whole_band(tmp_path):
    """Of 0.02, 0.1 and 0.18 half a band is 0.199; what is left of it is half as wide."""
    made = comparison(tmp_path, {"a": [0.02, 0.10, 0.18]})
    assert not is_reached(parse_until("k_reduction ± 19 %"), made)
    assert is_reached(parse_until("k_reduction ± 20 %"), made)


def test_no_zero_has_a_sign():
    assert value_text("k_reduction", -0.0) == "0 %"
    assert percent(-1e-6) == "0.0"
