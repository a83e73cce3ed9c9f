"""Trends and tables of the thesis on rows made up so that every difference is known.

Student's t at 97.5 % is 12.706 for 1 degree of freedom, 4.3027 for 2, 2.7764 for 4 and 2.3060 for
8 (any table).
"""

import csv
import math
from math import nan, sqrt

import pytest

from fdnet.statistics.bands import Band
from validation.engine.bands import Sample, band, difference
from validation.engine.markdown import as_told, figure, markdown_table, with_band
from validation.thesis.compare.tables import TABLES, table_of, thesis_tables
from validation.thesis.compare.trend_claims import (
    ABOVE,
    ALIKE,
    MORE,
    TRENDS,
    claims,
    share_at_the_face,
)
from validation.thesis.compare.trend_quantities import (
    QUANTITIES,
    beyond_the_others,
    first_share,
    multipliers_of,
    rank_correlation,
    sample_of,
    slope_per_decade,
)
from validation.thesis.compare.trend_table import (
    caveats,
    flows_table,
    trends_table,
    verdict_of,
)
from validation.thesis.compare.trends import (
    FAILS,
    FULL_SCALE,
    HOLDS,
    QUICK_FORMS,
    UNDECIDED,
    Comparison,
    compare_trends,
    verdict,
    write_trends,
)
from validation.thesis.numbers.examine import DEFAULT_PAIR, THESIS_PAIR
from validation.thesis.numbers.results import ResultRow

T2, T4, T8 = 4.3027, 2.7764, 2.3060
SCATTER = (-1.0, 0.0, 1.0)
"""Of variance 1."""
BASE = {
    "porosity_initial": 0.30,
    "porosity_damaged": 0.28,
    "porosity_loss_first_mm": 0.08,
    "invaded_count": 1000,
    "count_first_mm": 500,
    "invasion_depth_mm": 4.0,
    "invasion_depth_p95_mm": 3.0,
    "mean_depth_mm": 1.0,
    "fraction_first_0p25mm": 0.4,
    "fraction_first_mm": 0.9,
    "fraction_beyond_0p5mm": 0.2,
    "fraction_deep_near_wall": nan,
    "k_reduction": 0.10,
    "k_reductions": (0.3, 0.1, 0.06, 0.04, 0.0, 0.0, 0.0, 0.0),
    "k_reductions_inplace": (0.2,) * 8,
    "k_initial_m2": 1e-10,
    "k_damaged_m2": 9e-11,
    "throats": 100,
    "throats_blocked": 3,
    "supplied_count": 2000,
    "passed_count": 0,
    "cake_thickness_mm": 0.1,
    "stop_reason": "plugged",
    "time_ms": 1.0,
    "seconds": 1.0,
    "pack_seconds": 1.0,
    "max_overlap": 0.01,
    "thesis_damaged_porosity": nan,
    "thesis_depth_mm": nan,
    "thesis_invaded_count": nan,
    "thesis_k_reductions": (nan,) * 8,
    "thesis_fraction_first_bin": nan,
    "thesis_fraction_beyond_0p5mm": nan,
    "thesis_face_porosity_loss": nan,
    "thesis_count_first_mm": nan,
}


def row(run: str, seed: int = 1, laws: tuple[str, str] = THESIS_PAIR, **changed) -> ResultRow:
    return ResultRow(
        id=run, seed=seed, digest="", law=laws[0], damage_law=laws[1], **BASE | changed
    )


def rows_of(
    run: str, field: str, values, laws: tuple[str, str] = THESIS_PAIR, **changed
) -> list[ResultRow]:
    """One row a value, seeds from 1."""
    return [
        row(run, seed, laws, **{field: value}, **changed)
        for seed, value in enumerate(values, start=1)
    ]


def around(mean: float, scatter: float) -> list[float]:
    """Three values of that mean and standard deviation."""
    return [mean + scatter * one for one in SCATTER]


def comparison(
    comparisons: list[Comparison], *, quantity: str, one: str, other: str = "", laws: str = ""
) -> Comparison:
    match = [
        c
        for c in comparisons
        if (c.quantity, c.one, c.other) == (quantity, one, other) and laws in c.laws
    ]
    assert len(match) == 1
    return match[0]


def test_band_of_a_mean():
    assert band(Sample(values=(1.0, 2.0, 3.0))).half_width == pytest.approx(T2 / sqrt(3), rel=1e-4)
    assert math.isnan(band(Sample(values=(1.0, 2.0))).half_width)
    assert band(Sample(values=(0.1 + 0.2, 0.3, 0.3))).half_width == 0
    assert math.isnan(band(Sample(values=())).mean)


def test_welch_of_equal_spreads_is_students():
    """Variance 2.5 and five runs each give an error of 1 with 8 degrees of freedom."""
    one, other = Sample(values=(3.0, 4.0, 5.0, 6.0, 7.0)), Sample(values=(1.0, 2.0, 3.0, 4.0, 5.0))
    gap = difference(one, other)
    assert (gap.mean, gap.low, gap.high) == pytest.approx((2, 2 - T8, 2 + T8), rel=1e-4)


def test_welch_against_a_sample_without_scatter_keeps_the_others_freedom():
    gap = difference(Sample(values=(1.0, 2.0, 3.0, 4.0, 5.0)), Sample(values=(1.0,) * 9))
    assert gap.half_width == pytest.approx(T4 * sqrt(2.5 / 5), rel=1e-4)


def test_welch_of_unequal_spreads():
    """Variances of the means are 1/3 and 4/3.

    Degrees of freedom are (5/3)^2 / ((1/3)^2 / 2 + (4/3)^2 / 2) = 50/17, and t is 3.214.
    """
    gap = difference(Sample(values=tuple(around(5, 1))), Sample(values=tuple(around(0, 2))))
    assert gap.half_width == pytest.approx(3.214 * sqrt(5 / 3), rel=2e-3)


def test_a_single_run_borrows_the_spread_of_the_quick_form():
    quick = (1.0, 2.0, 3.0, 4.0, 5.0)
    single = Sample(values=(9.0,), lent=quick)
    assert (single.spread_of, single.mean) == ("quick form", 9)
    assert band(single).half_width == pytest.approx(T4 * sqrt(2.5), rel=1e-4)
    assert band(Sample(values=(9.0,), lent=quick, widened=2.0)).half_width == pytest.approx(
        2 * T4 * sqrt(2.5), rel=1e-4
    )
    assert Sample(values=tuple(around(1, 1)), lent=quick).spread_of == "seeds"
    assert Sample(values=(), lent=quick).spread_of == ""


def test_what_grows_with_the_specimen_keeps_at_least_its_relative_spread():
    rows = [
        *rows_of("quick-specimen3", "invaded_count", (90, 100, 110)),
        row("specimen3", invaded_count=800),
    ]
    assert sample_of(rows, "specimen3", QUANTITIES["invaded fines"]).widened == pytest.approx(8)
    fewer = [*rows[:3], row("specimen3", invaded_count=50)]
    assert sample_of(fewer, "specimen3", QUANTITIES["invaded fines"]).widened == 1
    assert sample_of(rows, "specimen3", QUANTITIES["porosity loss"]).widened == 1


@pytest.mark.parametrize(
    ("sense", "low", "high", "expected"),
    [
        (MORE, 0.1, 2.0, HOLDS),
        (MORE, -0.1, 2.0, UNDECIDED),
        (MORE, -2.0, 0.1, UNDECIDED),
        (MORE, -2.0, -0.1, FAILS),
        (ABOVE, 0.0, 0.0, UNDECIDED),
        (ABOVE, 1e-16, 1e-16, UNDECIDED),
        (ALIKE, -0.4, 0.4, HOLDS),
        (ALIKE, -0.4, 0.6, UNDECIDED),
        (ALIKE, 0.4, 0.6, UNDECIDED),
        (ALIKE, 0.6, 0.7, FAILS),
        (ALIKE, -0.7, -0.6, FAILS),
        (ALIKE, -0.9, 0.9, UNDECIDED),
        (MORE, nan, nan, UNDECIDED),
    ],
)
def test_verdicts(sense, low, high, expected):
    assert verdict(sense, Band(mean=(low + high) / 2, low=low, high=high), margin=0.5) == expected


def test_finer_fines_go_deeper_when_they_do():
    """Means 1, 2 and 1.1 mm, standard deviation 0.1 over three seeds.

    The difference 2 - 1 is 1 +- 0.23, and 3 - 1 is 0.1 +- 0.23.
    """
    rows = [
        *rows_of("specimen1", "mean_depth_mm", around(1, 0.1)),
        *rows_of("specimen2", "mean_depth_mm", around(2, 0.1)),
        *rows_of("specimen3", "mean_depth_mm", around(1.1, 0.1)),
    ]
    result = [one for one in compare_trends(rows) if one.scale == FULL_SCALE]
    deeper = comparison(result, quantity="mean depth", one="specimen2", other="specimen1")
    assert deeper.difference == pytest.approx(1)
    assert deeper.high - deeper.difference == pytest.approx(T4 * sqrt(2 * 0.01 / 3), rel=1e-4)
    assert (deeper.verdict, deeper.runs_one, deeper.runs_other, deeper.spread) == (
        HOLDS,
        3,
        3,
        "seeds",
    )
    assert (
        comparison(result, quantity="mean depth", one="specimen3", other="specimen2").verdict
        == FAILS
    )
    assert (
        comparison(result, quantity="mean depth", one="specimen3", other="specimen1").verdict
        == UNDECIDED
    )
    missing = comparison(result, quantity="mean depth", one="specimen5", other="specimen4")
    assert (missing.verdict, missing.runs_one) == (UNDECIDED, 0)
    assert missing.note == "no run of specimen5; no run of specimen4"


def test_a_full_scale_difference_of_single_runs_is_taken_as_it_is():
    rows = [row("specimen2", mean_depth_mm=2.0), row("specimen3", mean_depth_mm=5.0)]
    alone = comparison(
        compare_trends(rows), quantity="mean depth", one="specimen3", other="specimen2"
    )
    assert (alone.difference, alone.verdict, alone.spread) == (3, UNDECIDED, "")
    for name in ("quick-specimen2", "quick-specimen3"):
        rows += rows_of(name, "mean_depth_mm", around(4, 0.5))
    result = compare_trends(rows)
    borrowed = comparison(result, quantity="mean depth", one="specimen3", other="specimen2")
    # Specimen 3 is deeper than its quick form, so its spread is widened by 5 / 4.
    # The variances are those of single runs, not of means.
    error = sqrt(0.25 * (1 + (5 / 4) ** 2))
    freedom = (1 + (5 / 4) ** 2) ** 2 / ((1 + (5 / 4) ** 4) / 2)
    assert 3 < freedom < 4
    assert 2.776 * error < (borrowed.high - borrowed.low) / 2 < 3.182 * error
    assert (borrowed.difference, borrowed.spread) == (3, "quick form")
    quick = comparison(
        result, quantity="mean depth", one="quick-specimen3", other="quick-specimen2"
    )
    assert (quick.scale, quick.difference, quick.verdict) == (QUICK_FORMS, 0, UNDECIDED)


def test_fines_of_a_third_stop_at_the_face_as_in_the_thesis():
    """600 of its 704."""
    assert share_at_the_face() == pytest.approx(100 * 600 / 704)
    rows = rows_of("specimen1", "fraction_first_mm", around(0.95, 0.001))
    rows += rows_of("specimen4", "fraction_first_mm", around(0.50, 0.001))
    result = compare_trends(rows)
    bounds = [
        one for one in result if one.sense == ABOVE and one.trend == 1 and one.scale == FULL_SCALE
    ]
    assert [(one.one, one.verdict) for one in bounds] == [
        ("specimen1", HOLDS),
        ("specimen4", FAILS),
    ]
    assert bounds[0].difference == pytest.approx(95 - 100 * 600 / 704)
    assert bounds[0].high - bounds[0].difference == pytest.approx(T2 * 0.1 / sqrt(3), rel=1e-4)


def test_alike_is_within_a_fifth_of_the_larger():
    """Losses of 5.0, 4.5 and 3.5 points: a difference of 0.5 is within 1.0, one of 1.5 is not."""
    rows = []
    for run, loss in (("specimen2", 0.050), ("specimen3", 0.045), ("specimen7", 0.035)):
        rows += rows_of(run, "porosity_damaged", around(0.30 - loss, 1e-4))
    result = [one for one in compare_trends(rows) if one.scale == FULL_SCALE]
    alike = comparison(result, quantity="porosity loss", one="specimen2", other="specimen3")
    assert (alike.margin, alike.difference, alike.verdict) == (
        pytest.approx(1.0),
        pytest.approx(0.5),
        HOLDS,
    )
    apart = comparison(result, quantity="porosity loss", one="specimen2", other="specimen7")
    assert (apart.difference, apart.verdict) == (pytest.approx(1.5), FAILS)


def test_evenness_and_the_first_millimetre():
    """Reductions 0.3 and 0.1, 0.06, 0.04: 60 % of their sum; 20 points above the next."""
    assert first_share(row("a")) == pytest.approx(60)
    assert beyond_the_others(row("a")) == pytest.approx(20)
    quick = row("a", k_reductions=(0.3, 0.1, 0.06, 0.04, nan, nan, nan, nan))
    assert (first_share(quick), beyond_the_others(quick)) == pytest.approx((60, 20))
    late = row("a", k_reductions=(0.3, 0, 0, 0, 0, 0, 0, 0.5))
    assert (first_share(late), beyond_the_others(late)) == pytest.approx((100, -20))
    assert math.isnan(first_share(row("a", k_reductions=(0.0,) * 8)))
    assert math.isnan(beyond_the_others(row("a", k_reductions=(nan,) * 8)))
    assert QUANTITIES["k reduction from 1 to 4 mm"].value(quick) == pytest.approx(100 * 0.2 / 3)


def test_permeability_is_judged_under_each_pair_of_laws():
    def reductions(first):
        return [(first + one, *BASE["k_reductions"][1:]) for one in (-0.001, 0.0, 0.001)]

    rows = []
    for run, thesis, default in (("specimen1", 0.2, 0.4), ("specimen2", 0.3, 0.3)):
        rows += rows_of(run, "k_reductions", reductions(thesis))
        rows += rows_of(run, "k_reductions", reductions(default), DEFAULT_PAIR)
    result = compare_trends(rows)
    asked = {"quantity": "k reduction in the first mm", "one": "specimen2", "other": "specimen1"}
    by_thesis, by_default = (
        comparison(result, **asked, laws=laws[0]) for laws in (THESIS_PAIR, DEFAULT_PAIR)
    )
    assert (by_thesis.verdict, by_thesis.difference) == (HOLDS, pytest.approx(10))
    assert (by_default.verdict, by_default.difference) == (FAILS, pytest.approx(-10))
    lines = trends_table(result).splitlines()
    assert lines[4].split(" | ")[1:4] == [
        "holds in part (1 of 12; 11 not decided)",
        "no runs",
        "does not hold (1 of 12; 11 not decided)",
    ]


def test_slope_and_rank():
    assert slope_per_decade([1, 10, 100], [1.0, 1.5, 2.0]) == pytest.approx(0.5)
    assert math.isnan(slope_per_decade([1, 10], [1.0, 2.0]))
    assert rank_correlation([1, 3, 10, 30], [1.0, 2.0, 3.0, 9.0]) == pytest.approx(1)
    assert rank_correlation([1, 3, 10, 30], [1.0, 1.0, 1.0, 1.0]) == 0
    # ranks 2 1 4 3: 1 - 6 * 4 / (4 * 15)
    assert rank_correlation([1, 3, 10, 30], [2.0, 1.0, 4.0, 3.0]) == pytest.approx(0.6)


def scan(run: str, slope: float, seeds: int = 3) -> list[ResultRow]:
    """Mean depth growing by `slope` + 0.01 (seed - 2) a decade from a depth of the seed's own."""
    rows = []
    for seed in range(1, seeds + 1):
        for multiplier in (0.1, 1, 10, 100):
            name = run if multiplier == 1 else f"{run} drag.multiplier={multiplier:g}"
            depth = seed + (slope + 0.01 * (seed - 2)) * math.log10(multiplier)
            rows.append(row(name, seed, mean_depth_mm=depth))
    return rows


def test_drag_response_keeps_to_each_pack():
    """Depths of the seeds are 1, 2, 3 mm apart, slopes 0.49, 0.50, 0.51; only slopes count."""
    rows = [
        *scan("quick-specimen5", 0.5),
        *scan("quick-specimen7", -0.5),
        row("quick-specimen5", 4),
        row("specimen5"),
    ]
    rows.append(row("quick-specimen5 fines.friction=0.1"))
    assert [x for x, _ in multipliers_of(rows, "quick-specimen5")[1]] == [0.1, 1, 10, 100]
    result = [one for one in compare_trends(rows) if one.trend == 7]
    assert {(one.scale, one.one) for one in result} == {
        (QUICK_FORMS, "quick-specimen5"),
        (QUICK_FORMS, "quick-specimen7"),
    }
    slope = comparison(result, quantity="mean depth per decade of drag", one="quick-specimen5")
    assert (slope.difference, slope.runs_one, slope.verdict) == (pytest.approx(0.5), 3, HOLDS)
    assert slope.high - slope.difference == pytest.approx(T2 * 0.01 / sqrt(3), rel=1e-3)
    rank = "rank correlation of mean depth with drag"
    assert comparison(result, quantity=rank, one="quick-specimen5").difference == pytest.approx(1)
    assert comparison(result, quantity=rank, one="quick-specimen7").verdict == FAILS
    still = comparison(result, quantity="depth of 95 % per decade of drag", one="quick-specimen5")
    assert (still.difference, still.verdict) == (pytest.approx(0, abs=1e-12), UNDECIDED)


def test_notes_tell_what_weakens_a_comparison(tmp_path):
    rows = [
        row("specimen5"),
        row("specimen6", stop_reason="supply_exhausted", invaded_count=900, passed_count=100),
    ]
    result = compare_trends(rows)
    note = comparison(result, quantity="mean depth", one="specimen6", other="specimen5").note
    assert note == (
        "specimen6 ended by supply_exhausted; "
        "10% of the fines passed through specimen6, so they went deeper still"
    )
    assert comparison(
        result, quantity="porosity loss", one="specimen5", other="specimen6"
    ).note.startswith("specimen6 end")
    assert (
        "passed"
        not in comparison(
            result, quantity="porosity loss", one="specimen5", other="specimen6"
        ).note
    )
    remarks = caveats(result)
    assert "no run of specimen1" in remarks
    assert len(remarks) == len(set(remarks))
    assert not any("quick" in one for one in remarks)
    lines = list(csv.DictReader(write_trends(tmp_path / "trends.csv", result).open()))
    assert len(lines) == len(result)
    assert {one["trend"] for one in lines} == set("123456")
    assert lines[0]["margin"] == ""


def test_the_table_of_trends_has_a_line_each():
    table = trends_table(compare_trends([])).splitlines()
    assert len(table) == 2 + len(TRENDS)
    for number, line in enumerate(table[2:], start=1):
        assert line.startswith(f"| {number}. {TRENDS[number - 1]} | no runs | no runs |")
    assert {claim.trend for claim in claims()} == set(range(1, 8))


def test_the_table_of_trends_tells_the_numbers():
    rows = [row("specimen5", mean_depth_mm=1.0), row("specimen6", mean_depth_mm=3.0)]
    rows += rows_of("quick-specimen5", "mean_depth_mm", around(1, 0.1))
    rows += rows_of("quick-specimen6", "mean_depth_mm", around(3, 0.1))
    line = trends_table(compare_trends(rows)).splitlines()[2]
    # 2.7764 times the root of 0.02
    assert "mean depth, mm: 6 − 5: 2.0 ± 0.39*;" in line
    assert "4 − 85" not in line
    assert "holds in part" in line


def test_both_flows_are_judged_by_their_own_quick_forms():
    """The table of the flows knows the quick forms alone."""

    def deeper(by: float) -> list[ResultRow]:
        rows = rows_of("quick-specimen5", "mean_depth_mm", around(1, 0.1))
        return rows + rows_of("quick-specimen6", "mean_depth_mm", around(1 + by, 0.1))

    full = [row("specimen5", mean_depth_mm=1.0), row("specimen6", mean_depth_mm=0.1)]
    uniform, followed = (compare_trends([*full, *deeper(by)]) for by in (2.0, -0.5))
    line = flows_table(uniform, followed).splitlines()[2]
    trend, one, other, numbers = line.strip("| ").split(" | ")
    assert trend == f"1. {TRENDS[0]}"
    assert one.startswith("holds in part (1 of ")
    assert other.startswith("does not hold (1 of ")
    # 2.7764 times the root of 2 * 0.1^2 / 3
    assert "mean depth, mm: 6 − 5: −0.50 ± 0.23 (no)" in numbers


def test_verdict_of_several():
    result = compare_trends(rows_of("specimen1", "mean_depth_mm", around(1, 0.1)))
    one = comparison(result, quantity="mean depth", one="specimen2", other="specimen1")
    made = {
        name: {**_fields(one), "verdict": name, "runs_one": 3}
        for name in (HOLDS, FAILS, UNDECIDED)
    }
    holds, fails, open_ = (Comparison(**made[name]) for name in (HOLDS, FAILS, UNDECIDED))
    assert verdict_of([holds, holds]) == "holds (2 of 2)"
    assert verdict_of([holds, fails, open_]) == "holds in part (1 of 3; 1 not, 1 not decided)"
    assert verdict_of([fails, open_]) == "does not hold (1 of 2; 1 not decided)"
    assert verdict_of([open_]) == "not decided (1 of 1)"
    assert verdict_of([one]) == "no runs"


def table(number: str, rows: list[ResultRow]) -> list[list[str]]:
    text = table_of(next(one for one in TABLES if one.number == number), rows)
    return [
        line.strip("| ").split(" | ") for line in text.splitlines() if not line.startswith("| ---")
    ]


def test_table_4_side_by_side():
    rows = [
        *rows_of("specimen2", "porosity_damaged", around(0.28, 0.01)),
        row("specimen3", stop_reason="duration"),
    ]
    header, one, two, three, *_ = table("Table 4", rows)
    line = dict(zip(header, two, strict=True))
    assert (line["run"], line["fine diameter, mm"], line["damaged porosity, %, thesis"]) == (
        "specimen2",
        "0.1",
        "23",
    )
    # 1 point over the root of 3, times t; the last "ours" of the line is the depth
    assert "28.0 ± 2.5" in two
    assert "2.00 ± 2.5" in two
    assert (line["porosity loss, points, thesis"], line["runs"], line["ended by"]) == (
        "7",
        "3",
        "plugged",
    )
    assert line["porosity loss of the first mm, points"] == "8.00 ± 0"
    assert three[-2:] == ["1", "duration"]
    assert "28.0" in three
    assert one[3:] == ["–", "29 or 28", "–", "1 or 2", "–", "–", "4", "–", "–", "0", "–"]


def test_tables_of_one_specimen():
    rows = [
        row("specimen5"),
        row("specimen5", laws=DEFAULT_PAIR, k_reduction=0.25),
        row("specimen5-5to6"),
    ]
    lines = {line[0]: line[1:] for line in table("Table 9", rows)}
    assert lines["fine radius, mm"] == ["0.05–0.06", "0.05", "0.05–0.06"]
    assert lines["invaded fines in the first mm"] == ["above 2000", "500", "500"]
    assert lines["permeability reduction, %, thesis's laws"] == ["–", "10.0", "10.0"]
    assert lines["permeability reduction, %, fdnet's laws"] == ["–", "25.0", "–"]


def test_tables_by_section():
    rows = [
        row("specimen5"),
        row("specimen5", laws=DEFAULT_PAIR, k_reductions=(0.5,) + (0.0,) * 7),
    ]
    lines = {line[0]: line[1:] for line in table("Table 10", rows)}
    assert lines["0–1"] == ["32", "30.0", "20.0", "50.0", "20.0", "–"]
    assert lines["5–6"][0] == "0.3"
    assert lines["3–4"][:2] == ["5.7", "4.00"]
    figures = {line[0]: line[1:] for line in table("Figures 49, 58, 65, 69, 72", rows)}
    assert figures["specimen5"] == ["32", "30.0", "20.0", "10.0", "50.0", "20.0", "10.0", "1"]
    assert figures["specimen6"][0] == "about 40"
    assert figures["specimen2"][0] == "–"


def test_all_tables_are_there():
    text = thesis_tables([])
    for number in range(3, 12):
        assert f"**Table {number}: " in text
    assert "nan" not in text


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.012345, 3, "0.0123"),
        (-1.5, 3, "−1.50"),
        (2643.4, 3, "2643"),
        (1e-17, 3, "0"),
        (nan, 3, "–"),
        (0.98, 2, "0.98"),
        (85.2, 2, "85"),
    ],
)
def test_figures(value, digits, text):
    assert figure(value, digits=digits) == text


def test_numbers_as_told_and_with_their_band():
    assert as_told(100 * 0.29) == "29"
    assert with_band(Band(mean=2.0, low=1.75, high=2.25)) == "2.00 ± 0.25"
    assert with_band(Band(mean=2.0, low=nan, high=nan)) == "2.00"
    assert markdown_table(["a", "b"], [["1", "2"]]) == "| a | b |\n| --- | --- |\n| 1 | 2 |"


def _fields(one: Comparison) -> dict:
    return {name: getattr(one, name) for name in Comparison.__slots__}
