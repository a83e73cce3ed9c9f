"""Statistics of clogs: bands, the geometric law and the fitted line, against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from validation.outside.clogs import (
    Clogging,
    after_first,
    clogging,
    fitted_line,
    geometric_chance,
    under_arch,
)


def test_runs_that_clog_while_the_heap_grows_are_not_counted():
    """0.3 R^3 fines lie under the arch of a hole: 2.4 at R = 2."""
    assert [under_arch(ratio) for ratio in (1.0, 2.0, 3.0)] == [1, 3, 9]
    runs = [(2, True), (3, True), (15, True), (95, False)]
    assert after_first(runs, 2.0) == ([(0, True), (12, True), (92, False)], 1)
    one_hole = clogging(runs, 2.0)
    assert (one_hole.clogs, one_hole.escapes, one_hole.early) == (2, 104, 1)
    assert one_hole.probability == pytest.approx(2 / 106)
    assert math.isnan(clogging([(2, True)], 2.0).probability)


def test_the_band_without_a_clog_by_hand():
    """None of n: below 1 - 0.025^(1/n)."""
    one_hole = clogging([(1000, False)], 1.0)
    assert (one_hole.probability, one_hole.low) == (0.0, 0.0)
    assert one_hole.high == pytest.approx(1 - 0.025 ** (1 / 999))


def test_the_band_holds_the_probability_of_most_samples():
    rng, hits, chance = np.random.default_rng(2), 0, 0.05
    for _ in range(200):
        runs = [(int(n), True) for n in rng.geometric(chance, 20)]
        one_hole = clogging(runs, 1.0)
        hits += one_hole.low <= chance <= one_hole.high
    assert hits >= 184


def test_geometric_samples_are_told_from_others():
    rng = np.random.default_rng(4)
    chances = [geometric_chance(rng.geometric(0.02, 40) - 1, seed=k) for k in range(20)]
    assert 0.2 < np.mean(chances) < 0.8
    assert geometric_chance([50] * 40, seed=1) == 0.0
    assert geometric_chance([0] * 30 + [500] * 10, seed=1) < 0.01


def test_the_fitted_line_is_found_again():
    ratios = [1.75, 2.0, 2.5, 3.0, 4.0]
    cloggings = []
    for ratio in ratios:
        chance = math.exp(-0.4 - 0.7 * (ratio**2 - 1))
        clogs = 4 if ratio == 4.0 else 10_000
        escapes = round(clogs * (1 - chance) / chance)
        cloggings.append(
            Clogging(clogs=clogs, escapes=escapes, early=0, counted=clogs, low=0.0, high=1.0)
        )
    line = fitted_line(ratios, cloggings)
    assert (line.slope, line.start) == pytest.approx((-0.7, -0.4), rel=1e-3)
    assert (line.holes, line.least, line.most) == (4, 1.75, 3.0)
    assert (line.explained, line.chance) == (pytest.approx(1.0), pytest.approx(1.0, abs=0.01))
    lived = replace(cloggings[0], early=cloggings[0].counted)
    assert fitted_line(ratios, [lived, *cloggings[1:]]).holes == 3
    bent = [replace(cloggings[0], escapes=2 * cloggings[0].escapes), *cloggings[1:]]
    assert fitted_line(ratios, bent).chance < 1e-6
    with pytest.raises(ValueError, match="2 holes"):
        fitted_line(ratios[:2], cloggings[:2])
