"""The study of contact stiffness in its quick form, on the real binary."""

import math

import pytest

from fdnet.scales.contacts import sphere_mass
from fdnet.scales.scales import scales_of
from validation.command import run_study
from validation.dem.closed import deepest_overlap_of, restitution_of
from validation.dem.collisions import SPEED
from validation.dem.runs import slab_case
from validation.dem.stiffness import COLLISION, LONG, NOMINAL, STUDY
from validation.engine.levels import levels
from validation.engine.table import read_rows

pytestmark = pytest.mark.liggghts


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    out = tmp_path_factory.mktemp("stiffness")
    run_study(STUDY, out, quick=True)
    return read_rows(out / "stiffness.csv")


def test_overlap_falls_as_the_root_of_the_stiffness_up_to_the_nominal_value(rows):
    """v sqrt(m_eff / k) exp(...) of a damped spring; 2 % for a step of 0.1 sqrt(m/k)."""
    result = {
        level.value: level.error for level in levels(rows, COLLISION, "overlap_over_diameter")
    }
    case = slab_case(1)
    mass = sphere_mass(case.fines.mean_radius_m, case.fines.density_kg_m3)
    for value in (1e2, 1e4, NOMINAL):
        pair = (
            scales_of(slab_case(1, f"run.stiffness_N_m={value!r}"))
            .contacts["fine-fine"]
            .normal_stiffness
        )
        exact = deepest_overlap_of(case.fines.damping_ratio, SPEED, pair, mass / 2)
        assert result[value] * 2 * case.fines.mean_radius_m == pytest.approx(exact, rel=0.025)


def test_restitution_does_not_depend_on_the_stiffness(rows):
    result = [level.error for level in levels(rows, COLLISION, "restitution_error")]
    assert result == pytest.approx([result[0]] * 3, abs=1e-6)
    assert abs(result[0]) < 0.01


def test_invasions_overlap_less_when_stiffer_and_every_quantity_is_there(rows):
    result = levels(rows, LONG, "max_overlap")
    assert [level.value for level in result] == [1e2, 1e3, 1e4]
    assert result[0].error > 3 * result[1].error > 3 * result[2].error > 0
    assert {row.quantity for row in rows if row.series == LONG} == {
        "invaded", "mean_depth", "porosity_loss", "porosity_loss_first", "k_ratio",
        "k_ratio_first", "max_overlap",
        "profile",
    }  # fmt: skip


def test_closed_forms_of_a_damped_contact():
    """Undamped: e = 1 and v / w. At zeta 0.2: the equation of motion integrated by scipy."""
    from scipy.integrate import solve_ivp

    assert restitution_of(0.0) == pytest.approx(1.0)
    assert deepest_overlap_of(0.0, 2.0, 4.0, 1.0) == pytest.approx(1.0)
    zeta = 0.2

    def moving(_, y):
        return [y[1], -2 * zeta * y[1] - y[0]]

    def released(_, y):
        return 2 * zeta * y[1] + y[0] if y[0] > 1e-9 or y[1] < 0 else 1.0

    released.terminal = True
    result = solve_ivp(
        moving, (0, 10), [1e-12, 1.0], events=released, rtol=1e-10, atol=1e-12, max_step=0.01
    )
    assert -result.y[1, -1] == pytest.approx(restitution_of(zeta), rel=1e-5)
    assert max(result.y[0]) == pytest.approx(deepest_overlap_of(zeta, 1.0, 1.0, 1.0), rel=1e-4)
    assert math.isclose(result.y[0].max(), max(result.y[0]))
