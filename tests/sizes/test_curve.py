"""Curves of sizes: moments and conversions against closed forms."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gamma, gammaincinv, ndtr

from fdnet.sizes import (
    NUMBER,
    SURFACE,
    VOLUME,
    LogNormal,
    Points,
    RosinRammler,
    SizeCurve,
    Uniform,
    best_fit,
    blended,
    cut_curve,
    dealt,
    volume_quantiles,
)

Z10 = 1.2815515655446004
"""Normal quantile of 90 %."""


@pytest.mark.parametrize("by", [NUMBER, SURFACE, VOLUME])
@pytest.mark.parametrize("spread", [0.1, 0.54, 1.0])
def test_a_log_normal_curve_converts_as_hatch_and_choate_say(by, spread):
    """ln D50 by weight w is ln D50 by number + w s^2; <d^k> = exp(k ln D50 + k^2 s^2 / 2)."""
    law, reach = LogNormal(40e-6, spread), math.exp(13 * spread)
    whole = SizeCurve(law=law, by=by, low=40e-6 / reach, high=40e-6 * reach)
    assert cut_curve(law, by=by, cut=(0.2, 0.8)).size_at(0.5) == pytest.approx(whole.size_at(0.5))
    number = math.log(40e-6) - by * spread**2
    for weight in (NUMBER, SURFACE, VOLUME):
        median = math.exp(number + weight * spread**2)
        assert whole.size_at(0.5, weight) == pytest.approx(median, rel=1e-6)
        assert whole.size_at(0.9, weight) == pytest.approx(
            median * math.exp(Z10 * spread), rel=1e-6
        )
    for power in (2, 3, 4):
        exact = math.exp(power * number + 0.5 * (power * spread) ** 2)
        assert whole.mean(power) == pytest.approx(exact, rel=1e-6)


def test_moments_between_cuts_are_those_of_the_truncated_log_normal():
    """<d^k> of a log-normal between a and b, by number, is a ratio of normal distributions."""
    spread, curve = 0.54, cut_curve(LogNormal(40e-6, 0.54), cut=(0.01, 0.95))
    mean = math.log(40e-6) - 3 * spread**2

    def integral(power: float) -> float:
        ends = [(math.log(d) - mean) / spread - power * spread for d in (curve.low, curve.high)]
        factor = math.exp(power * mean + 0.5 * (power * spread) ** 2)
        return factor * float(ndtr(ends[1]) - ndtr(ends[0]))

    for power in (1, 2, 3, 6):
        assert curve.mean(power) == pytest.approx(integral(power) / integral(0), rel=1e-11)
    assert (curve.below, curve.above) == pytest.approx((0.01, 0.05))


@pytest.mark.parametrize("exponent", [0.8, 1.5, 3.2, 6.0])
def test_moments_of_rosin_and_rammler_are_gamma_functions(exponent):
    """The integral of d^p dF over all sizes is scale^p Gamma(1 + p / n), where p > -n."""
    whole = cut_curve(RosinRammler(4e-4, exponent), cut=(1e-12, 1 - 1e-15))
    for power in (1, 2, 3):
        exact = 4e-4**power * gamma(1 + power / exponent)
        assert whole.total(power) == pytest.approx(exact, rel=1e-9)
    if exponent > 3:
        sauter = whole.mean(3) / whole.mean(2)
        assert sauter == pytest.approx(4e-4 / gamma(1 - 1 / exponent), rel=1e-8)


@pytest.mark.parametrize("power", [-3, -2, 0.5, 2])
def test_rosin_and_rammler_between_cuts_agrees_with_adaptive_quadrature(power):
    """Also where the gamma functions of the whole do not exist (p <= -n)."""
    curve = cut_curve(RosinRammler(4e-4, 1.5), cut=(0.01, 0.99))

    def density(d: float) -> float:
        u = (d / 4e-4) ** 1.5
        return d**power * 1.5 / d * u * math.exp(-u)

    exact = quad(density, curve.low, curve.high, epsrel=1e-12, limit=500)[0]
    assert curve.total(power) == pytest.approx(exact, rel=1e-10)


def test_rosin_and_rammler_by_number_converts_to_volume_by_incomplete_gamma():
    """By volume F = P(1 + 3/n, u), the regularised incomplete gamma function."""
    curve = cut_curve(RosinRammler(4e-4, 2.0), by=NUMBER, cut=(0.05, 0.9))
    ends = [4e-4 * gammaincinv(2.5, share) ** 0.5 for share in (0.05, 0.9)]
    assert (curve.low, curve.high) == pytest.approx(ends, rel=1e-5)


def test_measured_points_are_straight_over_the_logarithm():
    """Between two sieves dF / d ln d is constant, so all moments are elementary."""
    size, finer = (1e-4, 2e-4, 5e-4), (0.1, 0.6, 1.0)
    curve = cut_curve(Points(size, finer))
    assert curve.below == pytest.approx(0.1)
    for power in (-3, -1, 2):
        exact = sum(
            (q - p) / math.log(b / a) * (b**power - a**power) / power
            for a, b, p, q in zip(size, size[1:], finer, finer[1:], strict=False)
        )
        assert curve.total(power) == pytest.approx(exact, rel=1e-12)
    assert curve.total(0) == pytest.approx(0.9, rel=1e-12)
    middle = math.sqrt(1e-4 * 2e-4)
    assert float(curve.share_finer(np.array([middle]))[0]) == pytest.approx(0.25 / 0.9, rel=1e-6)


def test_a_uniform_range_of_radii_has_the_moments_of_today():
    """<r^3> = (a + b)(a^2 + b^2) / 4, <r^2> = (a^2 + ab + b^2) / 3, by number."""
    low, high = 0.3, 0.6
    curve = SizeCurve(law=Uniform(low, high), by=NUMBER, low=low, high=high)
    assert curve.mean(1) == pytest.approx(0.45)
    assert curve.mean(2) == pytest.approx((low**2 + low * high + high**2) / 3)
    assert curve.mean(3) == pytest.approx((low + high) * (low**2 + high**2) / 4)
    assert curve.mean(-1) == pytest.approx(math.log(high / low) / (high - low))


def test_finest_solids_left_out_are_counted_by_their_volume():
    spread, cut = 0.54, 20e-6
    curve = cut_curve(LogNormal(40e-6, spread), cut=(0.01, 0.99), finest=cut)
    assert curve.low == cut
    assert curve.below == pytest.approx(float(ndtr(math.log(cut / 40e-6) / spread)), rel=1e-9)
    assert curve.kept == pytest.approx(1 - curve.below - 0.01)


def test_strata_have_the_volume_and_the_quantiles_of_the_curve():
    curve = cut_curve(LogNormal(40e-6, 0.54), cut=(0.01, 0.99))
    for count in (1, 7, 300, 20_000):
        placed = curve.strata(count)
        assert np.sum(placed**3) == pytest.approx(count * curve.mean(3), rel=1e-12)
        assert np.all(np.diff(placed) >= -1e-9 * placed[1:])
        assert curve.low <= placed.min() <= placed.max() <= curve.high
    for share, size in zip(
        (0.1, 0.5, 0.9), volume_quantiles(placed, (0.1, 0.5, 0.9)), strict=True
    ):
        assert size == pytest.approx(curve.size_at(share), rel=1e-3)


def test_a_blend_sums_its_parts_by_volume():
    """Mean volume by number: 1 / sum(w / <v>), and shares finer add up by their volumes."""
    first = cut_curve(LogNormal(40e-6, 0.3), cut=(0.01, 0.99))
    second = cut_curve(LogNormal(80e-6, 0.5), cut=(0.02, 0.95))
    both = blended((0.7, 0.3), (first, second))
    kept = np.array([0.7 * first.kept, 0.3 * second.kept])
    weight = kept / kept.sum()
    assert both.mean(3) == pytest.approx(
        1 / (weight[0] / first.mean(3) + weight[1] / second.mean(3)), rel=1e-9
    )
    size = np.array([60e-6])
    exact = weight @ np.array([first.share_finer(size)[0], second.share_finer(size)[0]])
    assert float(both.share_finer(size)[0]) == pytest.approx(exact, rel=1e-5)
    assert both.below == pytest.approx(0.7 * 0.01 + 0.3 * 0.02)
    assert both.kept == pytest.approx(kept.sum())


def test_three_points_of_a_law_are_met_and_the_law_is_recognised():
    for law in (LogNormal(0.4e-3, 0.34), RosinRammler(0.46e-3, 3.5)):
        points = {share: law.quantile(share) for share in (0.1, 0.5, 0.9)}
        fit = best_fit(points)
        assert type(fit.law) is type(law)
        assert fit.worst < 1e-12
        assert best_fit(points, fit.name).name == fit.name


def test_the_misfit_of_three_points_is_that_of_the_line_of_least_squares():
    """The log-normal quantiles are symmetric, so the line passes through the mean of ln d."""
    points = {0.1: 0.25e-3, 0.5: 0.40e-3, 0.9: 0.60e-3}
    fit = best_fit(points, "log-normal")
    assert fit.law.median == pytest.approx((0.25 * 0.40 * 0.60) ** (1 / 3) * 1e-3)
    assert fit.law.spread == pytest.approx(math.log(0.60 / 0.25) / (2 * Z10))
    assert fit.misfit[0.5] == pytest.approx((0.25 * 0.60 / 0.40**2) ** (1 / 3) - 1)
    assert best_fit(points).name == "log-normal"
    assert best_fit(points, "rosin-rammler").worst > fit.worst
    assert best_fit(points, "rosin-rammler").name == "rosin-rammler"


def test_every_batch_has_the_curve_of_the_whole():
    """Each batch of n takes one fine of each n-th part: a count is within 1.5 of its share."""
    counts = [50] * 19 + [31]
    batches = dealt(counts, np.random.default_rng(1))
    assert sorted(np.concatenate(batches)) == list(range(sum(counts)))
    for count, batch in zip(counts, batches, strict=True):
        assert len(batch) == count
        for share in (0.1, 0.5, 0.9):
            finer = np.sum(batch < share * sum(counts))
            assert abs(finer - share * count) <= 1.5
