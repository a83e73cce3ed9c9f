"""The velocity at the formation face: a plug, a well, Darcy's law and Ergun's."""

import math

import pytest
from builders import tiny
from scipy.integrate import quad

from fdnet.case.case import Case
from fdnet.case.file import case_from, read_case, set_keys
from fdnet.errors import CaseError
from fdnet.scales.flow import Losses, radial, straight
from fdnet.scales.scales import scales_of
from fdnet.scales.table import scale_rows

WELL = "well={radius_mm=108.0, drainage_radius_m=100.0}"
GRADIENT = 3.5e6 / (0.108 * math.log(100 / 0.108))
"""Of 3.5 MPa at the face, radial Darcy flow: 4.7 MPa/m."""


def at_a_well(name: str, root, *assignments: str) -> Case:
    """A specimen of the thesis at the face of a well instead of in a plug of 8 mm."""
    data = read_case(root / f"cases/{name}.toml").data()
    del data["fluid"]["darcy_length_mm"]
    return case_from(set_keys(data, [WELL, *assignments]))


@pytest.mark.parametrize(("name", "speed"), [("specimen1", 0.024), ("specimen5", 0.059)])
def test_a_well_of_the_field_moves_the_fluid_at_centimetres_per_second(root, name, speed):
    plug, well = (
        scales_of(read_case(root / f"cases/{name}.toml")),
        scales_of(at_a_well(name, root)),
    )
    assert pytest.approx(4.744e6, rel=1e-3) == GRADIENT
    assert well.pressure_gradient == pytest.approx(GRADIENT, rel=1e-12)
    assert plug.pressure_gradient == pytest.approx(3.5e6 / 8e-3, rel=1e-12)
    assert plug.pressure_gradient / well.pressure_gradient == pytest.approx(92.2, abs=0.1)
    assert well.interstitial_velocity == pytest.approx(speed, abs=5e-4)
    assert well.interstitial_velocity == pytest.approx(
        well.permeability * GRADIENT / 0.05 / well.porosity, rel=1e-12
    )
    assert not any("Darcy" in one or "overbalance" in one for one in well.warnings)


def test_a_formation_tighter_than_the_pack_slows_the_fluid(root):
    own, tight = (
        scales_of(at_a_well("specimen5", root, *more))
        for more in ((), ("well.formation_permeability_mD=1000.0",))
    )
    assert tight.darcy_velocity == pytest.approx(9.869233e-13 / 0.05 * GRADIENT, rel=1e-12)
    # the gradient is that which drives this flow through the pack itself
    lower = tight.darcy_velocity / own.darcy_velocity
    assert tight.pressure_gradient == pytest.approx(lower * GRADIENT, rel=1e-12)


@pytest.mark.parametrize(
    ("more", "named"),
    [
        (("fluid.velocity_m_s=1.0",), "velocity_m_s = 1:"),
        (("fluid.darcy_length_mm=8.0",), "darcy_length_mm = 8:"),
    ],
)
def test_a_well_and_another_velocity_are_one_error(more, named):
    with pytest.raises(CaseError, match="1 problem: well: the table") as caught:
        tiny(WELL, *more)
    assert named in str(caught.value)
    assert "keep one of them" in str(caught.value)


def test_a_well_must_be_smaller_than_its_drainage():
    with pytest.raises(CaseError, match=r"well\.drainage_radius_m: 0\.1 m is not above"):
        tiny("well={radius_mm=108.0, drainage_radius_m=0.1}")
    with pytest.raises(CaseError, match=r"unknown key .*did you mean well\.radius_mm"):
        tiny("well={radius_m=0.108, drainage_radius_m=100.0}")


def test_a_case_that_names_no_way_is_told_what_a_well_would_give():
    """66 grains in 3 x 1.6 x 1.6 mm; 3.5 MPa over 3 mm instead of over 0.738 m."""
    warning = next(one for one in scales_of(tiny()).warnings if "overbalance" in one)
    scales = scales_of(tiny())
    slower = scales.interstitial_velocity * 3e-3 / (0.108 * math.log(100 / 0.108))
    assert f"{scales.interstitial_velocity:.3g} m/s" in warning
    assert f"would be {slower:.2g} m/s: add the table [well]" in warning
    for way in (WELL, "fluid.darcy_length_mm=3.0", "fluid.velocity_m_s=0.1"):
        assert not any("overbalance" in one for one in scales_of(tiny(way)).warnings)


@pytest.mark.parametrize(("name", "percent"), [("specimen1", 10), ("specimen5", 26)])
def test_inertia_takes_a_tenth_to_a_quarter_at_the_gradients_of_the_thesis(root, name, percent):
    """Ergun's ratio of the losses, (1.75 / 150) rho q d / (mu (1 - phi)), with the pack's k."""
    path = root / f"cases/{name}.toml"
    darcy, ergun = (
        scales_of(read_case(path)),
        scales_of(read_case(path, assignments=["fluid.darcy_law=ergun"])),
    )
    q, phi = ergun.darcy_velocity, ergun.porosity
    excess = 1.75 / 150 * 1095 * q * 0.5e-3 / (0.05 * (1 - phi))
    assert 0.05 * q / ergun.permeability * (1 + excess) == pytest.approx(3.5e6 / 8e-3, rel=1e-12)
    assert ergun.pressure_gradient == pytest.approx(3.5e6 / 8e-3, rel=1e-12)
    lost = 1 - q / darcy.darcy_velocity
    assert lost == pytest.approx(percent / 100, abs=0.005)
    assert darcy.inertial_loss == ergun.inertial_loss == pytest.approx(lost, rel=1e-12)
    assert any(f"lower it by {percent} % (Ergun)" in one for one in darcy.warnings)
    assert not any("Ergun" in one for one in ergun.warnings)


def test_the_root_of_the_radial_law_loses_the_pressure_on_the_way():
    """The second method: the gradient at each distance, summed up numerically."""
    losses, well, outer = Losses(viscous=2e8, inertial=4e10), 0.1, 30.0
    face = losses.velocity(5e6, radial(well, outer))

    def gradient(log_r: float) -> float:
        r = math.exp(log_r)
        return losses.gradient(face * well / r) * r

    lost, _ = quad(gradient, math.log(well), math.log(outer))
    assert lost == pytest.approx(5e6, rel=1e-9)
    assert losses.velocity(5e6, straight(0.2)) == pytest.approx(
        (-2e8 + math.sqrt(4e16 + 4 * 4e10 * 5e6 / 0.2)) / 8e10, rel=1e-9
    )
    assert Losses(viscous=2e8).velocity(5e6, straight(0.2)) == pytest.approx(0.125, rel=1e-15)


def test_the_table_of_scales_says_by_which_law(root):
    formulas = {
        row.name: row.formula
        for case in (at_a_well("specimen5", root, "fluid.darcy_law=ergun"),)
        for row in scale_rows(case, scales_of(case))
    }
    assert formulas["Darcy velocity"] == (
        "mu q r_w ln(r_e/r_w) / k + b q^2 r_w^2 (1/r_w - 1/r_e) = dP"
    )
    assert formulas["pressure gradient in the pack"] == "mu q / k + b q^2"
