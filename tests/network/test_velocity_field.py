"""The velocity field of a pack: exact flows, a second solver, balances, walls, ends."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from network.packs import random_pack

import fdnet
from fdnet.errors import CaseError, NetworkError
from fdnet.network.field.field import VelocityField, build_lattice, solved_field
from fdnet.network.stokes import solve_stokes
from fdnet.spheres.snapshot import Snapshot
from validation.engine.timing import least_time
from validation.network.interception import happel, intercepted
from validation.network.velocity_field import throat_fluxes


@cache
def pack() -> Snapshot:
    """Sixteen grains of radius 1 at porosity 0.42."""
    return random_pack(16, seed=4)


@cache
def field(periodic: str, cells: float = 6.0) -> VelocityField:
    return fdnet.velocity_field(pack(), periodic=periodic, cells=cells, tolerance=0.01)


def points(count: int = 2000) -> np.ndarray:
    size = np.ptp(pack().box, axis=1)
    return pack().box[:, 0] + np.random.default_rng(1).random((count, 3)) * size


def test_permeability_is_that_of_the_reference_solver_on_the_same_grid():
    current = field("xyz")
    reference = solve_stokes(pack(), cells=current.lattice.shape[0], tolerance=1e-6)
    assert current.lattice.shape == (current.lattice.shape[0],) * 3
    assert current.k == pytest.approx(reference.k, rel=2e-3)


def test_plane_walls_without_a_grain_give_the_parabola_of_poiseuille():
    """Mean 1 and pressure gradient 12 / H^2; this scheme's own error is 2 / n^2."""
    box = np.array([[0.0, 2.0], [0.0, 1.0], [0.0, 2.0]])
    lattice = build_lattice(box, (True, False, True), spacing=0.05, upstream=0.0, downstream=0.0)
    none = (np.zeros((0, 3)), np.zeros(0))
    flow = solved_field(lattice, none, none, 1e-5)
    y = np.linspace(0.002, 0.998, 100)
    u = flow.at(np.column_stack([np.full(100, 0.7), y, np.full(100, 1.1)]))
    assert u[:, 0] == pytest.approx(6.0 * y * (1.0 - y), abs=0.02)
    assert np.abs(u[:, 1:]).max() < 1e-5
    assert flow.resistance == pytest.approx(2.0 * 12.0 / (1.0 + 2.0 / 20**2), rel=1e-5)
    assert flow.wall_force[0] == pytest.approx(2.0 * flow.resistance, rel=1e-9)


@pytest.mark.parametrize("periodic", ["xyz", "yz", "", "xz"])
def test_the_flow_keeps_its_volume_and_passes_every_section(periodic):
    current = field(periodic)
    steps = current.lattice.spacing
    gain = np.zeros(current.lattice.shape)
    for axis, part in enumerate(current._flow):
        gain += (np.roll(part, -1, axis=axis) - part) / steps[axis]
    assert np.abs(gain).max() < 1e-4 / steps[0]
    assert current._flow[0].mean(axis=(1, 2)) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("periodic", ["xyz", "yz", ""])
def test_forces_add_up_to_the_pressure_drop_times_the_area(periodic):
    """The drop is read from the pressures before and beyond the specimen, not from the forces."""
    current = field(periodic)
    lattice, area = current.lattice, np.prod(np.ptp(pack().box, axis=1)[1:])
    total = current.grain_force.sum(axis=0) + current.wall_force
    assert total[0] == pytest.approx(current.resistance * area, rel=1e-9)
    if periodic != "xyz":
        gradient = current._gradient.parts[0].mean(axis=(1, 2)).astype(float)
        ends = lattice.low[0] + lattice.spacing[0] * np.arange(lattice.shape[0])
        clear = (ends < -1.3) | (ends > pack().box[0, 1] + 1.3)
        assert clear.any()
        assert np.abs(gradient[clear]).max() < 0.02 * np.abs(gradient).max()


def free_normals(gap: float) -> tuple[np.ndarray, np.ndarray]:
    """Centres and unit normals whose places on the sphere are `gap` away from all others."""
    size = np.ptp(pack().box, axis=1)
    out = np.random.default_rng(2).normal(size=(4000, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    centre = pack().position[np.arange(4000) % 16]
    apart = (centre + out)[:, None] - pack().position
    apart -= size * np.round(apart / size)
    second = np.sort(np.linalg.norm(apart, axis=2), axis=1)[:, 1]
    free = second > 1.0 + gap
    return centre[free], out[free]


def test_velocity_at_a_grain_is_linear_along_it_and_quadratic_across():
    centre, out = free_normals(0.5)
    assert len(out) > 100
    near = [field("xyz").at(centre + (1.0 + d) * out) for d in (2e-3, 2e-2)]
    across = [np.abs(np.sum(u * out, axis=1)).mean() for u in near]
    along = [np.linalg.norm(u, axis=1).mean() for u in near]
    assert along[1] == pytest.approx(10.0 * along[0], rel=0.1)
    assert across[1] == pytest.approx(100.0 * across[0], rel=0.1)
    assert across[1] < 0.05 * along[1]


def test_nothing_moves_in_grains_and_at_walls():
    current = field("")
    assert np.all(current.at(pack().position) == 0.0)
    size = np.ptp(pack().box, axis=1)
    side = points(200) * [1.0, 0.0, 1.0] + [0.0, 1e-6 * size[1], 0.0]
    assert np.abs(current.at(side)).max() < 1e-3


def test_far_upstream_the_mud_moves_evenly():
    current = field("yz")
    far = points(50) - [40.0, 0.0, 0.0]
    assert np.array_equal(current.at(far), np.tile([1.0, 0.0, 0.0], (50, 1)))
    entry = points(4000) * [0.0, 1.0, 1.0] + [current.lattice.low[0] + 0.1, 0.0, 0.0]
    assert current.at(entry).mean(axis=0)[0] == pytest.approx(1.0, abs=0.03)


def test_whole_periods_and_the_choice_of_the_cell_change_nothing():
    current, size = field("xyz"), np.ptp(pack().box, axis=1)
    u = current.at(points())
    assert current.at(points() + size * [3, -2, 1]) == pytest.approx(u, abs=1e-5)
    assert np.count_nonzero(np.any(u, axis=1)) == pytest.approx(0.42 * 2000, rel=0.1)


def test_turning_and_scaling_the_pack():
    """y and z change places, and a pack in metres is one in millimetres.

    The iteration stops at 1 % of its forces, so single points may differ by more than the mean.
    """
    current = field("yz")
    turn = [0, 2, 1]
    turned = replace(
        pack(),
        position=1e-3 * pack().position[:, turn],
        box=1e-3 * pack().box[turn],
        radius=1e-3 * pack().radius,
    )
    other = fdnet.velocity_field(turned, periodic="yz", cells=6.0, tolerance=0.01)
    difference = other.at(1e-3 * points()[:, turn])[:, turn] - current.at(points())
    assert np.sqrt((difference**2).mean()) < 0.005
    assert np.abs(difference).max() < 0.2
    assert other.k == pytest.approx(1e-6 * current.k, rel=2e-3)


def test_a_finer_grid_is_closer():
    fine = field("xyz", 20.0).at(points())
    speed = np.linalg.norm(fine, axis=1)[np.any(fine, axis=1)].mean()
    errors = [
        np.sqrt(np.mean(np.sum((field("xyz", n).at(points()) - fine) ** 2, axis=1)) / 0.42) / speed
        for n in (6.0, 10.0)
    ]
    assert errors[1] < 0.16
    assert errors[1] < 0.6 * errors[0] < 0.2


def test_fines_turn_the_flow_and_forces_add_up():
    place = points(600)
    place = place[np.any(field("xyz").at(place), axis=1)][:60]
    fines = Snapshot.from_arrays(place, 0.2, box=pack().box, kind="fine")
    new = fdnet.velocity_field(pack(), periodic="xyz", fines=fines, cells=6.0, tolerance=0.005)
    assert new.k < 0.9 * field("xyz").k
    assert np.all(new.at(place) == 0.0)
    total = new.grain_force.sum(axis=0) + new.fine_force.sum(axis=0)
    area = np.prod(np.ptp(pack().box, axis=1)[1:])
    assert total[0] == pytest.approx(new.resistance * area, rel=1e-9)


def test_fines_off_the_grid_are_left_out_and_counted():
    both = Snapshot.from_arrays(
        [[-30.0, 1.0, 1.0], [1.0, 1.0, 1.0]], 0.2, box=pack().box, kind="fine"
    )
    current = fdnet.velocity_field(pack(), periodic="yz", fines=both, cells=6.0, upstream=2.0)
    assert current.left_out == 1
    assert np.all(current.fine_force[0] == 0.0)
    cake = Snapshot.from_arrays([[-9.0, 1.0, 1.0]], 0.2, box=pack().box, kind="fine")
    wide = fdnet.velocity_field(pack(), periodic="yz", fines=cake, cells=6.0)
    assert wide.left_out == 0
    assert np.all(wide.at([[-9.0, 1.0, 1.0]]) == 0.0)


def test_refusals():
    with pytest.raises(CaseError, match=r"\(2,\).*expected \(N, 3\)"):
        field("xyz").at([1.0, 2.0])
    with pytest.raises(CaseError, match="not finite"):
        field("xyz").at([[1.0, 2.0, np.nan]])
    with pytest.raises(CaseError, match=r"0\.5 cells"):
        fdnet.velocity_field(pack(), cells=0.5)
    none = pack().where(np.zeros(16, bool))
    with pytest.raises(CaseError, match="no grain"):
        fdnet.velocity_field(none)
    far = replace(pack(), position=pack().position + np.array([100.0, 0.0, 0.0]))
    with pytest.raises(NetworkError, match="no wall"):
        fdnet.velocity_field(far, periodic="yz")


def test_fluxes_of_throats_are_those_of_a_fine_grid():
    network = fdnet.build_network(pack(), periodic="xyz")
    coarse, fine = (throat_fluxes(network, field("xyz", n)) for n in (10.0, 20.0))
    lost = np.sum((coarse - fine) ** 2) / np.sum((fine - fine.mean()) ** 2)
    assert lost < 0.01


@pytest.mark.parametrize("cells", [18.0])
def test_tracers_are_intercepted_as_in_happels_cell(cells):
    """Within a factor 1.5; a uniform velocity, which leads through the grains, gives about 1."""
    current = fdnet.velocity_field(pack(), periodic="xyz", cells=cells)
    expected = happel(0.42, 0.05)
    caught = intercepted(current.at, pack(), 0.05, tracers=800)
    assert caught.unfinished == 0
    assert 1.0 / 1.5 < caught.efficiency / expected < 1.5

    def even(place: np.ndarray) -> np.ndarray:
        return np.tile([1.0, 0.0, 0.0], (len(place), 1))

    assert intercepted(even, pack(), 0.05, tracers=800).efficiency > 4.0 * expected


def test_small_tracers_do_not_gather_at_the_walls_of_a_coarse_grid():
    """Happel's cell once more, at a touching distance of 0.08 spacings.

    A velocity across the wall that is not what the velocity along it asks for makes sinks there.
    """
    current = fdnet.velocity_field(pack(), periodic="xyz", cells=8.0)
    caught = intercepted(current.at, pack(), 0.02, tracers=4000)
    assert caught.unfinished == 0
    assert 1.0 / 1.4 < caught.efficiency / happel(0.42, 0.02) < 1.4


def test_happels_cell_at_the_porosity_of_the_issue():
    assert happel(0.40, 0.02) == pytest.approx(0.0228, abs=5e-5)
    assert happel(0.40, 0.01) == pytest.approx(0.0057, abs=5e-5)


def test_where_no_number_of_cells_is_given_the_grid_is_fine_as_far_as_a_million_cells_go():
    small = fdnet.velocity_field(pack(), periodic="xyz")
    assert small.lattice.spacing == pytest.approx(2.0 / 18.0, rel=0.1)
    assert small.lattice.spacing.max() <= 2.0 / 18.0


def test_two_hundred_thousand_points_take_a_third_of_a_second():
    place = points(200_000)
    field("xyz").at(place[:10])
    seconds = least_time(lambda: field("xyz").at(place))[1]
    assert seconds < 0.6
