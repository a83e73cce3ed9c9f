"""Errors against a reference, levels with their bands, and the knee."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fdnet.errors import CaseError
from validation.engine.error_rows import against_reference, profile_distance
from validation.engine.knee import knee, knee_sentence
from validation.engine.levels import Level, levels, order
from validation.engine.study import DONE, Measured, Point

NAN = float("nan")


def level(value, cost, error, half=0.0) -> Level:
    return Level(value=value, runs=1, cost=cost, error=error, half_width=half)


def measured(value, seed, **observed) -> Measured:
    point = Point(series="s", knob="k", value=value, seed=seed)
    return Measured(
        point=point,
        status=DONE,
        observed=observed,
        wall_s=1.0,
        core_s=1.0,
        steps=NAN,
        peak_memory_bytes=NAN,
    )


def test_errors_against_a_reference_are_taken_seed_by_seed():
    # the seed adds 10 or 20, the setting 1: the scatter of seeds cancels
    runs = [measured("good", 1, q=10.0), measured("good", 2, q=20.0)]
    runs += [measured("poor", 1, q=11.0), measured("poor", 2, q=21.2), measured("poor", 3, q=16.0)]
    rows = against_reference(runs, "q", lambda run: run.point.value == "good")
    assert [row.error for row in rows] == pytest.approx(
        [-5 / 15, 5 / 15, 1 / 15, 1.2 / 15, 1 / 15]
    )
    assert rows[2].error_uncertainty == pytest.approx(0.1155 / 15, rel=1e-3)


def test_rounding_of_a_sum_is_no_error():
    runs = [
        measured("good", 0, q=0.3),
        measured("same", 0, q=0.1 + 0.2),
        measured("near", 0, q=0.3 * (1 + 1e-9)),
    ]
    rows = against_reference(runs, "q", lambda run: run.point.value == "good")
    assert rows[1].error == 0.0 != 0.1 + 0.2 - 0.3
    assert rows[2].error == pytest.approx(1e-9, rel=1e-6)


def test_a_level_has_the_confidence_band_of_its_seeds():
    runs = [
        measured("good", 0, q=1.0),
        *(measured("poor", seed, q=q) for seed, q in enumerate((1.1, 1.2, 1.3))),
    ]
    rows = against_reference(runs, "q", lambda run: run.point.value == "good")
    (band,) = [result for result in levels(rows, "s", "q") if result.value == "poor"]
    # mean 0.2, s = 0.1, t(0.975, 2) = 4.3027
    assert band.error == pytest.approx(0.2)
    assert band.half_width == pytest.approx(4.302653 * 0.1 / math.sqrt(3), rel=1e-6)


def test_the_knee_is_the_cheapest_within_twice_the_best_bound():
    noisy = [
        level(1, 1.0, 0.5, 0.1),
        level(2, 2.0, 0.028, 0.02),
        level(3, 4.0, 0.01, 0.02),
        level(4, 8.0, 0.012, 0.02),
    ]
    result = knee(noisy)
    assert result is not None
    assert result.value == 2
    assert knee([]) is None


def test_errors_that_go_on_falling_have_no_knee():
    exact = [level(1, 1.0, 0.5), level(2, 2.0, 0.25), level(3, 4.0, 0.125)]
    assert knee(exact) is None
    said = knee_sentence(exact, default=2)
    assert said.startswith("the error falls up to the costliest setting, 3 (error +12.5 %")
    assert "as the cost to the power of -1" in said


def test_neither_the_reference_nor_a_lucky_pair_of_seeds_is_a_knee():
    """Two seeds can cancel to an error of 0; the reference has none by construction."""
    result = [
        Level(value="lucky", runs=2, cost=1.0, error=0.0, half_width=0.5),
        Level(value="single", runs=1, cost=1.5, error=0.0, half_width=0.0),
        Level(value="fair", runs=5, cost=2.0, error=0.02, half_width=0.02),
        Level(value="good", runs=5, cost=4.0, error=0.01, half_width=0.02),
        Level(value="truth", runs=5, cost=9.0, error=0.0, half_width=0.01, reference=True),
    ]
    at = knee(result)
    assert at is not None
    assert at.value == "fair"
    assert "errors are relative to truth, which costs 9 s" in knee_sentence(result, default="good")
    assert knee_sentence(result[:1], default=None) == (
        "only one setting was run: lucky (error +0 ± 50 %, 1 s)"
    )


def test_no_knee_is_taken_from_levels_without_bands():
    pairs = [
        Level(value=n, runs=2, cost=float(n), error=1.0 / n, half_width=0.1) for n in (1, 2, 4)
    ]
    assert knee(pairs) is None
    assert knee_sentence(pairs, default=None).startswith(
        "too few seeds were run; the costliest setting is 4 (error +25 ± 10 %"
    )
    mixed = [
        *pairs,
        level(8, 8.0, 0.0),
        Level(value=3, runs=5, cost=3.0, error=0.3, half_width=0.1),
    ]
    assert "only the costliest setting is good enough, 3 (" in knee_sentence(mixed, default=None)


def test_unpaired_levels_carry_the_band_of_their_reference():
    """Both means are of one distribution: their difference's band holds 0, 95 of 100 times."""
    rng = np.random.default_rng(5)
    outside = 0
    for _ in range(200):
        runs = [measured("poor", seed, q=q) for seed, q in enumerate(rng.normal(1.0, 0.1, 10))]
        runs += [
            measured("good", 100 + seed, q=q) for seed, q in enumerate(rng.normal(1.0, 0.1, 5))
        ]
        rows = against_reference(runs, "q", lambda run: run.point.value == "good", paired=False)
        poor = next(result for result in levels(rows, "s", "q") if result.value == "poor")
        outside += poor.size > poor.half_width
    assert outside < 0.08 * 200


def test_a_setting_equal_to_the_reference_has_the_references_own_distance():
    rng = np.random.default_rng(3)
    profiles = rng.integers(1, 50, (4, 6)).astype(float)
    names = [f"bin_{n}" for n in range(6)]
    runs = [
        measured(value, seed, **dict(zip(names, profile, strict=True)))
        for value in ("same", "reference")
        for seed, profile in enumerate(profiles)
    ]
    rows = profile_distance(runs, names, lambda run: run.point.value == "reference")
    same, reference = levels(rows, "s", "profile")
    assert same.error == pytest.approx(reference.error)


def test_without_a_reference_the_refusal_says_why():
    lost = replace(measured("good", 1, q=1.0), status="failed: LIGGGHTS not found", observed={})
    with pytest.raises(
        CaseError, match=r"no reference run was done \(failed: LIGGGHTS not found\)"
    ):
        against_reference(
            [lost, measured("poor", 1, q=2.0)], "q", lambda run: run.point.value == "good"
        )


def test_costs_within_a_factor_of_two_have_no_order():
    near, far = (
        [level(n, cost, 0.1**n) for n, cost in enumerate(costs)]
        for costs in ((1, 1.3, 1.9), (1, 2, 4))
    )
    assert math.isnan(order(near))
    assert order(far) == pytest.approx(math.log(10) / math.log(2))
