"""Flow through a wedge: closed form against quadrature, series against a grid and the table."""

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

from fdnet.network.laws import wedges as wedge
from tests.network.wedge_table import exact_flux


def rays(angle: float, disc: float) -> float:
    point, weight = np.polynomial.legendre.leggauss(64)
    first = np.arccos(1.0 / disc) if disc > 1.0 else 0.0
    turn = first + 0.5 * (angle - first) * (1.0 + point)
    d = 1.0 / np.cos(turn)
    flux = (4.0 * d**4 * np.log(d / disc) - 3.0 * d**4 + 4.0 * d**2 * disc**2 - disc**4) / 16.0
    return float(0.5 * (angle - first) * np.sum(weight * flux))


@pytest.mark.parametrize(
    ("degrees", "disc"), [(5, 0.3), (30, 1.0), (60, 0.9), (70, 0.1), (50, 1.2), (80, 1.05)]
)
def test_closed_form_of_the_rays_is_their_integral(degrees: float, disc: float) -> None:
    angle = np.radians(degrees)
    assert wedge.ray_flux(angle, np.tan(angle), disc) == pytest.approx(rays(angle, disc), rel=1e-9)


def test_a_disc_that_fills_the_wedge_leaves_nothing() -> None:
    angle = np.radians(30.0)
    assert wedge.ray_flux(angle, np.tan(angle), 1.16) == 0.0


def grid_flux(angle: float, disc: float, cells: int) -> float:
    """Bilinear finite elements in polar coordinates; the far side is a grid line."""
    s, dt = (np.arange(cells + 1)) / cells, angle / cells
    rows, columns, values = [], [], []

    def length(t: float) -> float:
        return 1.0 / np.cos(t) - disc

    def slant(t: float, at: np.ndarray) -> np.ndarray:  # dr/dt at fixed s
        return at * np.sin(t) / np.cos(t) ** 2

    def add(row: int, column: int, value: float) -> None:
        rows.append(row), columns.append(column), values.append(value)

    count = cells + 1
    index = np.arange(count * count).reshape(count, count)
    load = np.zeros(count * count)
    gauss = np.array([-1.0, 1.0]) / np.sqrt(3.0)
    for i in range(cells):
        for j in range(cells):
            corner = [index[i, j], index[i + 1, j], index[i, j + 1], index[i + 1, j + 1]]
            block, part = np.zeros((4, 4)), np.zeros(4)
            for u in gauss:
                for v in gauss:
                    p, q = 0.5 * (1 + u), 0.5 * (1 + v)
                    t, place = (i + p) * dt, s[j] + q / cells
                    r = disc + length(t) * place
                    shape = np.array([(1 - p) * (1 - q), p * (1 - q), (1 - p) * q, p * q])
                    along_t = np.array([-(1 - q), 1 - q, -q, q]) / dt
                    along_s = np.array([-(1 - p), -p, 1 - p, p]) * cells
                    radial = along_s / length(t)
                    around = (along_t - radial * slant(t, place)) / r
                    area = r * length(t) * dt / cells / 4.0
                    block += area * (np.outer(radial, radial) + np.outer(around, around))
                    part += area * shape
            load[corner] += part
            for a in range(4):
                for b in range(4):
                    add(corner[a], corner[b], block[a, b])
    free = np.setdiff1d(index.ravel(), index[:, 0])
    matrix = sparse.csr_matrix((values, (rows, columns)))[free][:, free]
    return float(load[free] @ spsolve(matrix.tocsc(), load[free]))


@pytest.mark.parametrize(("degrees", "disc"), [(30, 0.9), (45, 0.5), (60, 0.8)])
def test_series_agrees_with_finite_elements(degrees: float, disc: float) -> None:
    angle = np.radians(degrees)
    coarse, fine = grid_flux(angle, disc, 12), grid_flux(angle, disc, 24)
    assert exact_flux(angle, disc) == pytest.approx(fine + (fine - coarse) / 3.0, rel=1e-3)


def test_rays_are_an_upper_bound() -> None:
    table = wedge.ratio_table()
    assert table.max() <= 1.0 + 1e-6
    assert np.all(table[0] == 1.0)


@pytest.mark.parametrize(("row", "column"), [(5, 4), (15, 20), (22, 10), (30, 18), (40, 1)])
def test_the_table_holds_what_the_series_gives(row: int, column: int) -> None:
    angle, disc = wedge.ANGLES[row], wedge.DISCS[column]
    expected = exact_flux(angle, disc) / wedge.ray_flux(angle, np.tan(angle), disc)
    assert wedge.ratio_table()[row, column] == pytest.approx(expected, abs=1e-6)


def test_between_its_points_the_table_is_good_to_a_thousandth() -> None:
    for degrees, disc in [(31, 0.52), (44.9, 0.77), (59.1, 0.93), (17.3, 0.4)]:
        angle = np.radians(degrees)
        exact = exact_flux(angle, disc) / wedge.ray_flux(angle, np.tan(angle), disc)
        assert wedge.shear_ratio(angle, disc, wedge.ratio_table()) == pytest.approx(
            exact, rel=1e-3
        )
