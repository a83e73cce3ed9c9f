"""Random close packing of a range of sizes, and porosities that it rules out."""

import math

import pytest
from builders import tiny

from fdnet.errors import CaseError
from fdnet.scales.pack import (
    EQUAL_SPHERES,
    close_packing,
    densest_porosity,
    refuse_unreachable,
    within_limit,
)
from fdnet.scales.scales import scales_of
from fdnet.sizes import NUMBER, LogNormal, SizeCurve, Uniform


def test_equal_spheres_fill_what_farr_and_groot_calibrated_on():
    one = SizeCurve(law=Uniform(1.0, 1.0), by=NUMBER, low=1.0, high=1.0)
    assert close_packing(one) == pytest.approx(EQUAL_SPHERES, abs=3e-4)
    assert densest_porosity(tiny().grains) == pytest.approx(1 - EQUAL_SPHERES, abs=3e-4)


@pytest.mark.parametrize("spread", [0.1, 0.34, 0.6, 1.0])
def test_log_normal_spheres_fill_what_the_formula_of_farr_says(spread):
    """R. S. Farr, Powder Technol. 245 (2013) 28, by number, within 0.0003 as he states."""
    law = LogNormal(1.0, spread)
    whole = SizeCurve(law=law, by=NUMBER, low=math.exp(-8 * spread), high=math.exp(8 * spread))
    ripple = math.cos(2 * math.pi * (1 - math.exp(-0.75 * spread**0.7 - 0.025 * spread**4)))
    formula = (
        1
        - 0.57 * math.exp(-spread)
        + 0.2135 * math.exp(-0.57 * spread / 0.2135)
        + 0.0019 * (ripple - 1)
    )
    assert close_packing(whole) == pytest.approx(formula, abs=5e-4)


def test_a_porosity_out_of_reach_is_refused_with_what_can_be():
    case = tiny("grains={radius_mm=0.25, porosity=0.20, max_overlap=0.05}")
    least = 1 - EQUAL_SPHERES / 0.95**3
    with pytest.raises(CaseError, match=rf"below {least:.3f} .* ask for 0\.35\d or more"):
        refuse_unreachable(case)
    refuse_unreachable(tiny("grains={radius_mm=0.25, porosity=0.26, max_overlap=0.05}"))
    refuse_unreachable(tiny("grains={radius_mm=0.25, porosity=0.40, max_overlap=0.001}"))


def test_the_limit_lies_where_the_growth_beyond_close_packing_allows_it():
    """Spheres grown by 4 % with overlaps of 8 % allow 2 % growth at a limit of 4 %."""
    rigid = 0.36
    made = 1 - (1 - rigid) * 1.04**3
    assert within_limit(rigid, made, 0.08, 0.04) == pytest.approx(1 - (1 - rigid) * 1.02**3)
    assert within_limit(rigid, made, 0.08, 0.0) == pytest.approx(rigid)


def test_a_dense_sand_is_warned_of_by_its_own_sizes():
    """Log-normal sand with a spread of 0.34 by volume gets to about 0.32."""
    curve = 'sizes={D10="0.25 mm", D50="0.40 mm", D90="0.60 mm"}'
    box, fines = "box.size_mm=[3.0, 2.4, 2.4]", "fines.radius_mm=0.02"
    dense = scales_of(tiny(box, fines, f"grains={{{curve}, porosity=0.30}}")).warnings
    assert any("0.30 grains overlap".replace("0.30", "0.3") in one for one in dense)
    loose = scales_of(tiny(box, fines, f"grains={{{curve}, porosity=0.38}}")).warnings
    assert not any("at random" in one for one in loose)
