"""Curves of sizes: moments and conversions against closed forms; the densest random packing."""

import math

import numpy as np
import pytest
from builders import tiny
from scipy.special import gamma, gammaincinv, ndtr

from fdnet import sizes
from fdnet.errors import CaseError
from fdnet.scales import pack
from fdnet.sizes import NUMBER, LogNormal, RosinRammler, SizeCurve, Uniform, best_fit, cut_curve

Z10 = 1.2815515655446004
"""Normal quantile of 90 %."""


def test_a_log_normal_curve_converts_as_hatch_and_choate_say():
    """ln D50 by weight w is ln D50 by number + w s^2; <d^k> = exp(k ln D50 + k^2 s^2 / 2)."""
    weights = (NUMBER, sizes.SURFACE, sizes.VOLUME)
    for spread, by in ((spread, by) for spread in (0.1, 0.54, 1.0) for by in weights):
        law, reach = LogNormal(40e-6, spread), math.exp(13 * spread)
        whole = SizeCurve(law=law, by=by, low=40e-6 / reach, high=40e-6 * reach)
        cut = cut_curve(law, by=by, cut=(0.2, 0.8))
        assert cut.size_at(0.5) == pytest.approx(whole.size_at(0.5))
        number = math.log(40e-6) - by * spread**2
        for weight in weights:
            median = math.exp(number + weight * spread**2)
            coarse = median * math.exp(Z10 * spread)
            assert whole.size_at(0.5, weight) == pytest.approx(median, rel=1e-6), (spread, by)
            assert whole.size_at(0.9, weight) == pytest.approx(coarse, rel=1e-6), (spread, by)
        for power in (2, 3, 4):
            exact = math.exp(power * number + 0.5 * (power * spread) ** 2)
            assert whole.mean(power) == pytest.approx(exact, rel=1e-6), (spread, by)


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
    # finest solids left out are counted by their volume
    curve = cut_curve(LogNormal(40e-6, spread), cut=(0.01, 0.99), finest=20e-6)
    assert curve.low == 20e-6
    assert curve.below == pytest.approx(float(ndtr(math.log(0.5) / spread)), rel=1e-9)
    assert curve.kept == pytest.approx(1 - curve.below - 0.01)


def test_moments_of_rosin_and_rammler_are_gamma_functions():
    """The integral of d^p dF over all sizes is scale^p Gamma(1 + p / n), where p > -n."""
    for exponent in (0.8, 1.5, 3.2, 6.0):
        whole = cut_curve(RosinRammler(4e-4, exponent), cut=(1e-12, 1 - 1e-15))
        for power in (1, 2, 3):
            exact = 4e-4**power * gamma(1 + power / exponent)
            assert whole.total(power) == pytest.approx(exact, rel=1e-9), exponent
        if exponent > 3:
            sauter = 4e-4 / gamma(1 - 1 / exponent)
            assert whole.mean(3) / whole.mean(2) == pytest.approx(sauter, rel=1e-8)
    # by number to volume: F = P(1 + 3/n, u), the regularised incomplete gamma function
    curve = cut_curve(RosinRammler(4e-4, 2.0), by=NUMBER, cut=(0.05, 0.9))
    ends = [4e-4 * gammaincinv(2.5, share) ** 0.5 for share in (0.05, 0.9)]
    assert (curve.low, curve.high) == pytest.approx(ends, rel=1e-5)


def test_measured_points_and_uniform_ranges_have_elementary_moments():
    """Between two sieves dF / d ln d is constant; <r^3> = (a + b)(a^2 + b^2) / 4 by number."""
    size, finer = (1e-4, 2e-4, 5e-4), (0.1, 0.6, 1.0)
    curve = cut_curve(sizes.Points(size, finer))
    assert curve.below == pytest.approx(0.1)
    for power in (-3, -1, 2):
        exact = sum(
            (q - p) / math.log(b / a) * (b**power - a**power) / power
            for a, b, p, q in zip(size, size[1:], finer, finer[1:], strict=False)
        )
        assert curve.total(power) == pytest.approx(exact, rel=1e-12)
    assert curve.total(0) == pytest.approx(0.9, rel=1e-12)
    middle = np.array([math.sqrt(1e-4 * 2e-4)])
    assert float(curve.share_finer(middle)[0]) == pytest.approx(0.25 / 0.9, rel=1e-6)
    low, high = 0.3, 0.6
    curve = SizeCurve(law=Uniform(low, high), by=NUMBER, low=low, high=high)
    assert curve.mean(1) == pytest.approx(0.45)
    assert curve.mean(2) == pytest.approx((low**2 + low * high + high**2) / 3)
    assert curve.mean(3) == pytest.approx((low + high) * (low**2 + high**2) / 4)
    assert curve.mean(-1) == pytest.approx(math.log(high / low) / (high - low))


def test_strata_and_batches_have_the_curve_of_the_whole():
    curve = cut_curve(LogNormal(40e-6, 0.54), cut=(0.01, 0.99))
    for count in (1, 7, 300, 20_000):
        placed = curve.strata(count)
        assert np.sum(placed**3) == pytest.approx(count * curve.mean(3), rel=1e-12)
        assert np.all(np.diff(placed) >= -1e-9 * placed[1:])
        assert curve.low <= placed.min() <= placed.max() <= curve.high
    shares = (0.1, 0.5, 0.9)
    wanted = [curve.size_at(share) for share in shares]
    assert list(sizes.volume_quantiles(placed, shares)) == pytest.approx(wanted, rel=1e-3)
    # each batch of n takes one fine of each n-th part: a count is within 1.5 of its share
    counts = [50] * 19 + [31]
    batches = sizes.dealt(counts, np.random.default_rng(1))
    assert sorted(np.concatenate(batches)) == list(range(sum(counts)))
    for count, batch in zip(counts, batches, strict=True):
        assert len(batch) == count
        finer = [np.sum(batch < share * sum(counts)) for share in shares]
        assert np.abs(np.array(finer) - count * np.array(shares)).max() <= 1.5


def test_three_points_of_a_law_are_met_and_others_by_the_line_of_least_squares():
    """The log-normal quantiles are symmetric, so the line passes through the mean of ln d."""
    for law in (LogNormal(0.4e-3, 0.34), RosinRammler(0.46e-3, 3.5)):
        points = {share: law.quantile(share) for share in (0.1, 0.5, 0.9)}
        fit = best_fit(points)
        assert type(fit.law) is type(law)
        assert fit.worst < 1e-12
        assert best_fit(points, fit.name).name == fit.name
    points = {0.1: 0.25e-3, 0.5: 0.40e-3, 0.9: 0.60e-3}
    fit, other = best_fit(points, "log-normal"), best_fit(points, "rosin-rammler")
    assert fit.law.median == pytest.approx((0.25 * 0.40 * 0.60) ** (1 / 3) * 1e-3)
    assert fit.law.spread == pytest.approx(math.log(0.60 / 0.25) / (2 * Z10))
    assert fit.misfit[0.5] == pytest.approx((0.25 * 0.60 / 0.40**2) ** (1 / 3) - 1)
    assert (best_fit(points).name, other.name) == ("log-normal", "rosin-rammler")
    assert other.worst > fit.worst


# ---- Random close packing of a range of sizes, and porosities that it rules out.
def test_spheres_fill_what_farr_and_groot_calibrated_on_and_farrs_formula_says():
    """R. S. Farr, Powder Technol. 245 (2013) 28, by number, within 0.0003 as he states."""
    one = SizeCurve(law=Uniform(1.0, 1.0), by=NUMBER, low=1.0, high=1.0)
    assert pack.close_packing(one) == pytest.approx(pack.EQUAL_SPHERES, abs=3e-4)
    assert pack.densest_porosity(tiny().grains) == pytest.approx(1 - pack.EQUAL_SPHERES, abs=3e-4)
    for spread in (0.1, 0.34, 0.6, 1.0):
        ends = {"low": math.exp(-8 * spread), "high": math.exp(8 * spread)}
        whole = SizeCurve(law=LogNormal(1.0, spread), by=NUMBER, **ends)
        ripple = math.cos(2 * math.pi * (1 - math.exp(-0.75 * spread**0.7 - 0.025 * spread**4)))
        formula = 1 - 0.57 * math.exp(-spread) + 0.2135 * math.exp(-0.57 * spread / 0.2135)
        formula += 0.0019 * (ripple - 1)
        assert pack.close_packing(whole) == pytest.approx(formula, abs=5e-4), spread


def test_a_porosity_out_of_reach_is_refused_with_what_can_be():
    """Spheres grown by 4 % with overlaps of 8 % allow 2 % growth at a limit of 4 %."""
    keys = "grains={{radius_mm=0.25, porosity={}, max_overlap={}}}"
    least = 1 - pack.EQUAL_SPHERES / 0.95**3
    with pytest.raises(CaseError, match=rf"below {least:.3f} .* ask for 0\.35\d or more"):
        pack.refuse_unreachable(tiny(keys.format(0.20, 0.05)))
    pack.refuse_unreachable(tiny(keys.format(0.26, 0.05)))
    pack.refuse_unreachable(tiny(keys.format(0.40, 0.001)))
    made = 1 - (1 - 0.36) * 1.04**3
    assert pack.within_limit(0.36, made, 0.08, 0.04) == pytest.approx(1 - (1 - 0.36) * 1.02**3)
    assert pack.within_limit(0.36, made, 0.08, 0.0) == pytest.approx(0.36)
