"""Sections of throats against finite elements: where the division by midway lines holds."""

import numpy as np
import pytest

from fdnet.network.laws.wedges import ratio_table
from tests.network.one_section import even_flux, touching_flux, uneven_flux
from tests.network.section_flux import resolved_flux
from tests.network.wedge_table import exact_flux

RIGHT_ISOSCELES = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]])
ACUTE = np.array([[0.0, 0.0], [2.0, 0.0], [1.1175, 1.7808]])


def test_finite_elements_give_the_exact_wedges() -> None:
    """Half a square is four wedges of 45 degrees, by symmetry and without a law."""
    exact = 4.0 * exact_flux(np.pi / 4.0, 0.95)
    assert resolved_flux(RIGHT_ISOSCELES, np.full(3, 0.95)) == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("disc", [0.3, 0.7, 0.93])
def test_equal_discs(disc: float) -> None:
    flux = even_flux(ACUTE, disc, ratio_table())
    assert flux == pytest.approx(resolved_flux(ACUTE, np.full(3, disc)), rel=0.01)


@pytest.mark.parametrize("disc", [0.6, 0.9, 0.98])
@pytest.mark.parametrize("edge", [2.85, 2.9, 3.0, 3.1])
def test_equal_discs_in_an_obtuse_triangle(edge: float, disc: float) -> None:
    """Its circumcentre lies beyond the long edge: signed shares alone give -97 to 97 %."""
    base = np.array([[0.0, 0.0], [edge, 0.0], [edge / 2, np.sqrt(4.0 - edge**2 / 4)]])
    discs, table = np.full(3, disc), ratio_table()
    exact = resolved_flux(base, discs)
    assert uneven_flux(base, discs, table) / exact == pytest.approx(1.0, abs=0.13)


def test_a_flux_does_not_jump_where_a_triangle_becomes_obtuse() -> None:
    fluxes = []
    for angle in np.radians(np.arange(87.0, 97.0, 0.25)):
        base = np.array([[0.0, 0.0], [2.0, 0.0], [2.0 * np.cos(angle), 2.0 * np.sin(angle)]])
        fluxes.append(uneven_flux(base, np.full(3, 0.6), ratio_table()))
    assert np.all(np.abs(np.diff(np.log(fluxes))) < 0.02)


@pytest.mark.parametrize(
    ("apex", "disc", "ratio"),
    [
        ((0.5, 0.4), (0.5, 0.5, 0.1), 0.98),
        ((0.6, 0.5), (0.5, 0.5, 0.1), 0.99),
        ((0.8, 0.5), (0.5, 0.5, 0.1), 1.03),
        ((0.6, 0.2), (0.5, 0.5, 0.1), 0.94),
        ((0.35, 0.7), (0.1, 0.1, 0.5), 1.12),
    ],
    ids=["touching", "apart", "askew", "obtuse", "two small and one large"],
)
def test_unequal_discs(
    apex: tuple[float, float], disc: tuple[float, float, float], ratio: float
) -> None:
    """The law over finite elements; rays give the last (docs/physics_network.md)."""
    edge = {0.5: 1.0, 0.35: 0.7}.get(apex[0], 1.2)
    base, discs = np.array([[0.0, 0.0], [edge, 0.0], apex]), np.array(disc)
    flux = uneven_flux(base, discs, ratio_table())
    assert flux / resolved_flux(base, discs) == pytest.approx(ratio, abs=0.01)


@pytest.mark.parametrize(
    ("apex", "disc", "signed", "ratio"),
    [
        ((1.098, 0.706), (0.560, 0.374, 0.184), 0.01, 0.96),
        ((1.000, 0.513), (0.601, 0.309, 0.058), 0.07, 0.98),
        ((1.172, 0.252), (0.463, 0.077, 0.079), 0.13, 0.93),
        ((1.142, 0.305), (0.754, 0.182, 0.144), 0.16, 0.94),
        ((1.144, 0.308), (0.420, 0.141, 0.118), 0.18, 0.93),
    ],
)
def test_sections_whose_signed_shares_cancel_are_summed_over_rays(
    apex: tuple[float, float], disc: tuple[float, float, float], signed: float, ratio: float
) -> None:
    """Signed shares and the law over finite elements."""
    base, discs, table = np.array([[0.0, 0.0], [1.0, 0.0], apex]), np.array(disc), ratio_table()
    exact = resolved_flux(base, discs, 400)
    assert touching_flux(base, discs, table) / exact == pytest.approx(signed, abs=0.04)
    assert uneven_flux(base, discs, table) / exact == pytest.approx(ratio, abs=0.02)
