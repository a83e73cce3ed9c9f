"""The velocity field of a pack: exact flows, a second solver, balances, ends."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import fdnet
from fdnet.errors import CaseError, NetworkError
from fdnet.network.field.field import build_lattice, solved_field
from fdnet.network.stokes import solve_stokes
from fdnet.spheres.snapshot import Snapshot
from tests.network.packs import random_pack


@cache
def pack():
    """Sixteen grains of radius 1 at porosity 0.42."""
    return random_pack(16, seed=4)


@cache
def field(periodic, cells=6.0):
    return fdnet.velocity_field(pack(), periodic=periodic, cells=cells, tolerance=0.01)


def points(count=2000):
    size = np.ptp(pack().box, axis=1)
    return pack().box[:, 0] + np.random.default_rng(1).random((count, 3)) * size


def test_the_permeability_is_that_of_the_reference_solver_on_the_same_grid():
    current = field("xyz")
    cells = current.lattice.shape[0]
    assert current.lattice.shape == (cells,) * 3
    k = solve_stokes(pack(), cells=cells, tolerance=1e-6).k
    assert current.k == pytest.approx(k, rel=2e-3)


def test_plane_walls_without_a_grain_give_the_parabola_of_poiseuille():
    """Mean 1 and pressure gradient 12 / H^2; this scheme's own error is 2 / n^2."""
    box = np.array([[0.0, 2.0], [0.0, 1.0], [0.0, 2.0]])
    lattice = build_lattice(box, (True, False, True), spacing=0.05, upstream=0.0, downstream=0.0)
    none = pack().where(np.zeros(16, bool))
    flow, y = solved_field(lattice, none, none, 1e-5), np.linspace(0.002, 0.998, 100)
    u = flow.at(np.column_stack([np.full(100, 0.7), y, np.full(100, 1.1)]))
    assert u[:, 0] == pytest.approx(6.0 * y * (1.0 - y), abs=0.02)
    assert np.abs(u[:, 1:]).max() < 1e-5
    assert flow.resistance == pytest.approx(2.0 * 12.0 / (1.0 + 2.0 / 20**2), rel=1e-5)
    assert flow.forces[1][0] == pytest.approx(2.0 * flow.resistance, rel=1e-9)


def test_the_flow_keeps_its_volume_passes_every_section_and_stands_still_in_grains():
    for periodic in ("xyz", "yz", "", "xz"):
        current = field(periodic)
        parts = current.lattice.response.velocity(list(current.solved.force))
        flow = [part + drift for part, drift in zip(parts, current.solved.drift, strict=True)]
        steps = current.lattice.spacing
        gain = sum((np.roll(u, -1, axis) - u) / steps[axis] for axis, u in enumerate(flow))
        assert np.abs(gain).max() < 1e-4 / steps[0], periodic
        assert flow[0].mean(axis=(1, 2)) == pytest.approx(1.0, abs=1e-4), periodic
        assert np.all(current.at(pack().position) == 0.0)
    side = points(200) * [1.0, 0.0, 1.0] + [0.0, 1e-6 * np.ptp(pack().box[1]), 0.0]
    assert np.abs(field("").at(side)).max() < 1e-3


def test_forces_add_up_to_the_pressure_drop_times_the_area():
    """The drop lies between the ends: before and beyond the specimen the pressure is even."""
    size, (y, z) = np.ptp(pack().box, axis=1), np.indices((30, 30)).reshape(2, -1) + 0.5
    for periodic in ("xyz", "yz", ""):
        current = field(periodic)
        total = sum(np.sum(np.atleast_2d(part), axis=0) for part in current.forces)
        area = size[1] * size[2]
        assert total[0] == pytest.approx(current.resistance * area, rel=1e-9), periodic
        if periodic != "xyz":
            gradient = {}
            for x in (-2.0, -1.4, *np.linspace(0.1, 0.9, 9) * size[0], size[0] + 1.4):
                place = np.column_stack([np.full(900, x), y * size[1] / 30, z * size[2] / 30])
                gradient[x] = abs(current.pressure_gradient_at(place)[:, 0].mean())
            clear = [one for x, one in gradient.items() if x < -1.3 or x > size[0] + 1.3]
            assert max(clear) < 0.02 * max(gradient.values()), periodic


def test_periods_turns_and_units_change_nothing():
    """The iteration stops at 1 % of its forces, so single points may differ more than the mean."""
    current, u = field("xyz"), field("xyz").at(points())
    size = np.ptp(pack().box, axis=1)
    assert current.at(points() + size * [3, -2, 1]) == pytest.approx(u, abs=1e-5)
    assert np.count_nonzero(np.any(u, axis=1)) == pytest.approx(0.42 * 2000, rel=0.1)
    turn = [0, 2, 1]  # y and z change places, and a pack in metres is one in millimetres
    turned = replace(pack(), position=1e-3 * pack().position[:, turn])
    turned = replace(turned, box=1e-3 * pack().box[turn], radius=1e-3 * pack().radius)
    other = fdnet.velocity_field(turned, periodic="yz", cells=6.0, tolerance=0.01)
    difference = other.at(1e-3 * points()[:, turn])[:, turn] - field("yz").at(points())
    assert np.sqrt((difference**2).mean()) < 0.005
    assert np.abs(difference).max() < 0.2
    assert other.k == pytest.approx(1e-6 * field("yz").k, rel=2e-3)


def test_a_finer_grid_is_closer():
    fine, coarse = field("xyz", 20.0).at(points()), [field("xyz", n).at(points()) for n in (6, 10)]
    speed = np.linalg.norm(fine, axis=1)[np.any(fine, axis=1)].mean()
    squares = [np.mean(np.sum((one - fine) ** 2, axis=1)) / 0.42 for one in coarse]
    errors = np.sqrt(squares) / speed
    assert errors[1] < 0.16
    assert errors[1] < 0.6 * errors[0] < 0.2


def test_fines_turn_the_flow_and_those_off_the_grid_are_left_out():
    place = points(600)
    place = place[np.any(field("xyz").at(place), axis=1)][:60]
    fines = Snapshot.from_arrays(place, 0.2, box=pack().box, kind="fine")
    new = fdnet.velocity_field(pack(), periodic="xyz", fines=fines, cells=6.0, tolerance=0.005)
    assert new.k < 0.9 * field("xyz").k
    assert np.all(new.at(place) == 0.0)
    total = new.forces[0].sum(axis=0)
    area = np.prod(np.ptp(pack().box, axis=1)[1:])
    assert total[0] == pytest.approx(new.resistance * area, rel=1e-9)
    far = [[30.0, 1.0, 1.0], [1.0, 1.0, 1.0]]
    both = Snapshot.from_arrays(far, 0.2, box=pack().box, kind="fine")
    current = fdnet.velocity_field(pack(), periodic="yz", fines=both, cells=6.0)
    assert current.position[current.grains :].tolist() == far[1:]


def test_bad_points_packs_and_cells_are_refused():
    for place, said in (
        ([1.0, 2], r"\(2,\).*expected \(N, 3\)"),
        ([[1, 2, np.nan]], "not finite"),
    ):
        with pytest.raises(CaseError, match=said):
            field("xyz").at(place)
    none = pack().where(np.zeros(16, bool))
    for spheres, cells, said in ((pack(), 0.5, r"0\.5 cells"), (none, 6.0, "no grain")):
        with pytest.raises(CaseError, match=said):
            fdnet.velocity_field(spheres, cells=cells)
    far = replace(pack(), position=pack().position + np.array([100.0, 0.0, 0.0]))
    with pytest.raises(NetworkError, match="no wall"):
        fdnet.velocity_field(far, periodic="yz")
