"""Bands, differences and numbers of seeds against closed forms and published values."""

import math

import pytest
from builders import tiny
from campaign.samples import compared, finished_run

import fdnet
from fdnet.report.figures import DEPTH_LABEL
from fdnet.statistics.bands import seeds_for_width
from fdnet.statistics.differences import holm

IN_PLACE = ("k_initial_inplace_m2", "k_damaged_inplace_m2")
DRUG_1 = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0]
DRUG_2 = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4]
"""Hours of sleep gained by ten patients with each of two drugs (Student 1908)."""


def ends(row) -> tuple[float, float, float]:
    return row["mean"], row["low"], row["high"]


def test_the_band_of_a_mean_is_students(tmp_path):
    """t(4) = 2.776445 of any table, s^2 = 2.5; one run has no band."""
    summary = compared(tmp_path, {"a": [1.0, 2.0, 3.0, 4.0, 5.0]}, "skin").summary
    half = 2.776445 * math.sqrt(2.5 / 5)
    assert ends(summary["skin"]) == pytest.approx((3, 3 - half, 3 + half), rel=1e-6)
    assert summary["skin"]["seeds"] == 5
    single = compared(tmp_path / "one", {"a": [0.4]})
    assert ends(single.summary["k_reduction"]) == (0.4, None, None)
    assert single.ranking == ("a: permeability lost 40.0 % (no band: one run), 1 seed.",)
    two = compared(tmp_path / "two", {"a": [0.4], "b": [0.5]})
    said = "a and b: difference −10.0 % (no band: one run); not distinguished."
    assert two.differences == (said,)


def test_differences_of_students_sleep_data_are_those_of_textbooks(tmp_path):
    """Paired t = -4.0621 (Student 1908); as two samples Welch's p = 0.07939."""
    for paired, p_value, low, high in (
        (True, 0.002833, -2.4598858, -0.7001142),
        (False, 0.07939, -3.3654832, 0.2054832),
    ):
        values = {"a": DRUG_1, "b": DRUG_2}
        (pair,) = compared(tmp_path / f"{paired}", values, "skin", shared=paired).summary["pairs"]
        assert (pair["paired"], pair["apart"]) == (paired, paired)
        assert pair["p_value"] == pytest.approx(p_value, rel=1e-3)
        assert ends(pair["difference"]) == pytest.approx((-1.58, low, high), rel=1e-6)


def test_the_seeds_needed_are_cohens(tmp_path):
    """For half a spread, at 80 % power and 5 %: 34 pairs, or 64 of each (Cohen 1988)."""
    half, needed = math.sqrt(0.5), []
    for name, one, other, shared in (
        ("paired", [0.5 - half, 0.5 + half], [0.0, 0.0], True),
        ("separate", [0.5 - half, 0.5 + half], [-half, half], False),
        ("equal", [0.5, 0.5], [0.5, 0.5], True),
        ("same mean", [-half, half], [0.0, 0.0], True),
        ("tiny", [1e-6 - half, 1e-6 + half], [0.0, 0.0], True),
    ):
        made = compared(tmp_path / name, {"a": one, "b": other}, "skin", shared=shared)
        needed.append(made.summary["pairs"][0]["seeds_needed"])
    assert needed == [34, 64, None, None, None]


def test_the_seeds_for_a_width_are_the_first_that_reach_it():
    """s^2 = 2.5, half-width 1: t(11) s / sqrt(12) = 1.0046 and t(12) s / sqrt(13) = 0.9555."""
    assert seeds_for_width([1, 2, 3, 4, 5], 1.0, 100) == 13
    assert seeds_for_width([1, 2, 3, 4, 5], 1.0, 10) == 10


def test_several_pairs_are_judged_together():
    """Holm: 0.005 < 0.05/4 and 0.01 < 0.05/3, but 0.03 is not below 0.05/2."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == [True, False, False, True]
    assert holm([math.nan, 0.001]) == [False, True]


def test_shared_packs_show_a_difference_that_separate_ones_hide(tmp_path):
    """A gap of 0.01 under a scatter of packs of 0.1; a difference of shares ends at 1."""
    base, noise = [0.3, 0.4, 0.5, 0.6], [0.0101, 0.0099, 0.0102, 0.0098]
    values = {"a": base, "b": [x + y for x, y in zip(base, noise, strict=True)]}
    (paired,) = compared(tmp_path / "p", values).summary["pairs"]
    (separate,) = compared(tmp_path / "s", values, shared=False).summary["pairs"]
    assert (paired["paired"], paired["apart"]) == (True, True)
    assert (separate["paired"], separate["apart"]) == (False, False)
    wide = compared(tmp_path / "w", {"a": [0.1, 0.9], "b": [0.2, 0.9]}, shared=False)
    assert ends(wide.summary["pairs"][0]["difference"])[1:] == (-1.0, 1.0)


def test_the_mean_of_a_sweep_takes_each_seed_once(tmp_path):
    """Means over the variants by seed: 2, 3 and 4, of which Student's half is t(2)/sqrt(3)."""
    row = compared(tmp_path, {"a": [1, 2, 3, 9], "b": [3, 4, 5]}, "skin").summary["skin"]
    half = 4.302653 / math.sqrt(3)
    assert row["seeds"] == 3
    assert ends(row) == pytest.approx((3, max(0, 3 - half), 3 + half), rel=1e-6)


def test_a_band_ends_where_its_quantity_does(tmp_path):
    """t(1) = 12.7062 and t(2) = 4.302653: the whole band of 0.5 and 0.6 is -0.085 to 1.185."""
    t = 4.302653
    table = [
        ("k_reduction", [0.5, 0.6], (0.0, 1.0), [0, 1]),
        ("k_reduction", [0.02, 0.10, 0.18], (0.0, 0.298731), [0]),
        ("porosity_damaged", [0.82, 0.90, 0.98], (0.701269, 1.0), [1]),
        ("invaded_count", [1, 5, 9], (0.0, 5 + t * 4 / 3**0.5), [0]),
        ("k_damaged_m2", [1e-12, 5e-12, 9e-12], (0.0, 5e-12 + t * 4e-12 / 3**0.5), [0]),
        ("pores", [1, 5, 9], (0.0, 5 + t * 4 / 3**0.5), [0]),
        ("skin", [1.0, 5.0, 9.0], (5 - t * 4 / 3**0.5, 5 + t * 4 / 3**0.5), []),
        ("k_reduction", [-0.1, 0.0, 0.1], (-0.248414, 0.248414), []),
        ("k_reduction", [0.3, 0.4, 0.5], (0.4 - 0.248414, 0.4 + 0.248414), []),
    ]
    for number, (quantity, values, expected, cut) in enumerate(table):
        made = compared(tmp_path / str(number), {"a": values}, quantity)
        row = made.summary["variants"][0][quantity]
        assert ends(row)[1:] == pytest.approx(expected, rel=1e-5), (quantity, values)
        assert row.get("cut_at", []) == cut
        assert ("cut at" in made.ranking[0]) == bool(cut)
        assert row["mean"] == pytest.approx(sum(values) / len(values))
    said = compared(tmp_path / "words", {"a": [0.5, 0.6]}).ranking[0]
    assert "95 % band 0.0 to 100.0 %, cut at 0.0 % and 100.0 %" in said


def test_one_variant_is_not_ranked(tmp_path):
    made = compared(tmp_path, {"mud": [0.3, 0.4, 0.5]})
    assert made.summary["ranking"] == []
    said = "mud: permeability lost 40.0 % (95 % band 15.2 to 64.8 %), 3 seeds"
    assert str(made).startswith(said)
    page = (made.path / "compare.html").read_text()
    assert "Rank" not in page
    assert "best first" not in page


def test_runs_open_as_one_object_with_bands_by_quantity_and_by_depth(tmp_path):
    """t(2) = 4.302653 of any table; the spread of 1, 2, 3 is 1."""
    half = 4.302653 / math.sqrt(3)
    names = ("section", "x_lo_m", "x_hi_m", "porosity_initial", "porosity_damaged", "k_initial_m2")
    names += ("k_damaged_m2", "k_reduction", "fines_count", *IN_PLACE)
    edges = ((1, 0.0, 1e-3), (2, 1e-3, 2e-3))
    for seed in (1, 2, 3):
        k = (1e-11, seed * 1e-11, 0.5, 4, 1e-11, seed * 1e-11)
        rows = [dict(zip(names, (*own, 0.4, 0.3, *k), strict=True)) for own in edges]
        finished_run(tmp_path / f"r{seed}", tiny(f"seed={seed}"), skin=float(seed), sections=rows)
    runs = fdnet.open_runs(tmp_path)
    assert runs.mean["skin"] == 2.0
    row = runs.band.loc["skin"]
    assert [*row] == pytest.approx([2, 2 - half, 2 + half, 3], rel=1e-6)
    depth = runs.by_depth()
    assert "section_low" not in depth
    assert depth[["section", "x_lo_m", "x_hi_m"]].to_numpy().tolist() == [*map(list, edges)]
    assert depth["k_damaged_m2"].tolist() == pytest.approx([2e-11] * 2, rel=1e-12)
    high = depth["k_damaged_m2_high"].tolist()
    assert high == pytest.approx([(2 + half) * 1e-11] * 2, rel=1e-6)
    assert depth["k_damaged_m2_low"].tolist() == [0, 0]  # cut: no permeability is negative
    axes = runs.plot()
    assert (axes.get_xlabel(), axes.get_ylabel()) == (DEPTH_LABEL, "permeability in place (mD)")
    assert not (tmp_path / "table.csv").exists()
    assert runs.table["skin"].tolist() == [1, 2, 3]
    written = fdnet.compare_runs(sorted(tmp_path.iterdir()), out=tmp_path / "compared")
    assert (written.summary["skin"], str(written)) == (runs.summary["skin"], str(runs))
    page = (written.path / "compare.html").read_text()
    # 2e-11 and 2.484e-11 m2 over 9.86923e-16
    assert "20,260 mD<br>\n<small>0 to 45,440 mD, cut at 0 mD</small>" in page
    assert page.count("data:image/svg+xml") == 1


def test_the_tables_are_read_with_their_types(tmp_path):
    """Counts stay whole, yes and no stay, and a value that a run lacks is empty."""
    made = compared(tmp_path, {"a": [3, None, 5]}, "layers_above_intact")
    assert (made.path / "table.csv").read_text().splitlines()[1].split(",")[0] == "a-1"
    values = made.table["layers_above_intact"]
    assert values.isna().tolist() == [False, True, False]
    assert made.table["seed"].tolist() == [1, 2, 3]


def test_the_answer_names_the_variants_that_are_as_good(tmp_path):
    """The gap of a and b changes from seed to seed, that of a and c does not."""
    values = {"a": [0.30, 0.31, 0.32], "b": [0.36, 0.29, 0.34], "c": [0.60, 0.61, 0.63]}
    made = compared(tmp_path, values)
    page = " ".join((made.path / "compare.html").read_text().split())
    assert "the smallest mean, but these seeds do not tell it apart from b.</p>" in page
    runs = fdnet.open_runs(tmp_path / "made")
    assert runs.mean["a", "k_reduction"] == pytest.approx(0.31)
    assert runs.band.loc[("b", "k_reduction"), "seeds"] == 3
    with pytest.raises(fdnet.CaseError, match="does not exist"):
        fdnet.open_runs(tmp_path / "no")
    apart = compared(tmp_path / "two", {"a": values["a"], "c": values["c"]})
    page = (apart.path / "compare.html").read_text()
    assert "It is the smallest, and differs from every other variant." in page
