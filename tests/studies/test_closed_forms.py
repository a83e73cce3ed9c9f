"""Points of the studies that have an exact answer: orders, bounds, 80 digits, known packs."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fdnet.errors import CaseError
from fdnet.scales.contacts import sphere_mass
from fdnet.scales.scales import scales_of
from tests.network.exact import exact_balance, random_links
from validation import study
from validation.linear_solver import Circuit, exact_fluxes
from validation.small_systems import SPEED, deepest_overlap_of, measure, restitution_of, slab_case


def measured(work: Path, values, **settings) -> dict:
    """What `measure` finds at each value."""
    points = [study.Point("s", "k", value, 1, settings | {"k": value}) for value in values]
    return {point.value: measure(point, work) for point in points}


@pytest.mark.nightly
@pytest.mark.liggghts
def test_overlap_falls_as_the_root_of_the_stiffness_up_to_the_nominal_value(tmp_path):
    """v sqrt(m_eff / k) exp(...) of a damped spring; restitution does not depend on it."""
    result = measured(tmp_path, (1e2, 1e4, 94.3e9), system="collision")
    fines = slab_case(1).fines
    mass, radius = sphere_mass(fines.mean_radius_m, fines.density_kg_m3), fines.mean_radius_m
    for value, one in result.items():
        pair = scales_of(slab_case(1, f"run.stiffness_N_m={value!r}")).contacts["fine-fine"]
        exact = deepest_overlap_of(fines.damping_ratio, SPEED, pair.normal_stiffness, mass / 2)
        assert one["overlap_over_diameter"] * 2 * radius == pytest.approx(exact, rel=0.025)
        assert one["restitution_error"] == pytest.approx(-0.0085, abs=5e-4)


@pytest.mark.nightly
@pytest.mark.liggghts
def test_schemes_of_drag_have_the_errors_of_their_closed_forms(tmp_path):
    """After n = tau/h intervals h: ((2-h)/(2+h))^n implicit, (1-h)^n else, against exp(-1)."""
    for scheme in ("every step", "held", "viscous", "implicit"):
        result = measured(
            tmp_path / scheme.replace(" ", "_"), (0.2, 0.1, 0.05),
            system="falling fine", scheme=scheme, looks=1,
        )  # fmt: skip
        implicit = scheme == "implicit"
        errors = [abs(one["relaxation_error"]) for one in result.values()]
        order = np.polyfit(np.log([*result]), np.log(errors), 1)[0]
        assert order == pytest.approx(2.0 if implicit else 1.0, abs=0.1), scheme
        for h, one in result.items():
            left = ((2 - h) / (2 + h) if implicit else 1 - h) ** round(1 / h)
            exact = pytest.approx(math.exp(-1) - left, rel=0.05 if implicit else 0.12)
            assert one["relaxation_error"] == exact, scheme
    far = {"system": "falling fine", "looks": 1}
    bounded = measured(tmp_path / "far", (10.0,), scheme="implicit", **far)
    assert bounded[10.0]["relaxation_error"] == pytest.approx(8 / 12, rel=0.01)
    with pytest.raises(CaseError, match=r"run\.time_step_s"):
        measured(tmp_path / "far", (2.0,), scheme="every step", **far)


def test_closed_forms_of_a_damped_contact():
    """Undamped: e = 1 and v / w. At zeta 0.2: the equation of motion integrated by scipy."""
    assert restitution_of(0.0) == pytest.approx(1.0)
    assert deepest_overlap_of(0.0, 2.0, 4.0, 1.0) == pytest.approx(1.0)
    zeta = 0.2

    def released(_, y):
        return 2 * zeta * y[1] + y[0] if y[0] > 1e-9 or y[1] < 0 else 1.0

    released.terminal = True
    result = solve_ivp(
        lambda _, y: [y[1], -2 * zeta * y[1] - y[0]], (0, 10), [1e-12, 1.0],
        events=released, rtol=1e-10, atol=1e-12, max_step=0.01,
    )  # fmt: skip
    assert -result.y[1, -1] == pytest.approx(restitution_of(zeta), rel=1e-5)
    assert max(result.y[0]) == pytest.approx(deepest_overlap_of(zeta, 1.0, 1.0, 1.0), rel=1e-4)


def test_eighty_digits_are_the_rational_answer():
    for seed, decades in ((0, 0), (1, 8), (2, 20)):
        ends, conductance, jump = random_links(seed, decades=decades, period=False)
        pores = int(ends.max())
        node = np.where(ends == 0, np.where(jump != 0, pores, pores + 1)[:, None], ends - 1)
        exact = exact_balance(ends, conductance, jump, pores + 1)[1]
        fluxes = exact_fluxes(Circuit(ends=node, conductance=conductance, count=pores))
        assert fluxes == pytest.approx(exact, rel=1e-14, abs=1e-30 * np.abs(exact).max())
