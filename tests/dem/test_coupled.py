"""Invasions whose forces fdnet computes while LIGGGHTS waits."""

import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import TINY, followed, resting_spheres, tiny
from cut_and_continue import StopError, differences

from fdnet.case.file import case_from
from fdnet.dem.checkpoint import UPDATES, Checkpoints, read_updates
from fdnet.dem.deck import snapshot_of, specimen_box, write_data
from fdnet.dem.invade_deck import (
    FluidForces,
    Moment,
    fine_density,
    largest_share,
    read_state,
    render_decks,
    render_invade,
    write_forces,
    write_parts,
)
from fdnet.dem.invasion import invade, steps_between
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.dem.packing import make_pack
from fdnet.dem.supply import batches_of, densities
from fdnet.errors import CaseError, LiggghtsError
from fdnet.run.fluid import fluid_of
from fdnet.scales.scales import scales_of
from fdnet.spheres.dump import read_frame
from fdnet.spheres.snapshot import Kind, Snapshot

pytestmark = pytest.mark.liggghts


def small(scheme="implicit", *more):
    """15 grains, fines in batches, 5 checkpoints with five updates each."""
    return tiny(
        "drag.crowd=beetstra",
        f"drag.scheme={scheme}",
        "drag.update_travel=0.2",
        "fluid.darcy_length_mm=20.0",
        "run.time_step_factor=0.2",
        "box.sides=periodic",
        "box.size_mm=[1.6,1.0,1.0]",
        "grains.count=15",
        "fines.supply=batches",
        "fines.count=400",
        "run.cap_ms=0.25",
        "run.checkpoint_ms=0.05",
        *more,
    )


@pytest.fixture(scope="module")
def grains(binary, tmp_path_factory):
    case, folder = small(), tmp_path_factory.mktemp("pack")
    return make_pack(case, folder, Launch(binary=binary)).grains


@pytest.fixture(scope="module")
def done(binary, grains, tmp_path_factory):
    """The small invasion, finished: folder and result."""
    folder, case = tmp_path_factory.mktemp("done"), small()
    return folder, run(case, grains, folder, Launch(binary=binary))


def run(case, grains, folder, launch):
    scales = scales_of(case)
    return invade(case, scales, grains, folder, launch, fluid=fluid_of(case, scales, grains))


@pytest.mark.parametrize("scheme", ["implicit", "held"])
def test_a_continued_coupled_invasion_is_the_uncut_one(binary, grains, tmp_path, scheme):
    assert differences(small(scheme), grains, tmp_path, binary) == []


@pytest.mark.nightly
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("motion", ["fixed", "mobile"])
@pytest.mark.parametrize("scheme", ["implicit", "held"])
def test_it_is_so_everywhere(binary, grains, tmp_path, scheme, motion, ranks):
    case = small(scheme, f"grains.motion={motion}")
    assert differences(case, grains, tmp_path, binary, ranks=ranks) == []


def test_every_chunk_begins_with_an_update_and_holds_the_travel(done):
    folder, result = done
    case = small()
    scales = scales_of(case)
    steps = steps_between(case, scales, scales.interstitial_velocity)
    travel = steps * scales.time_step * scales.interstitial_velocity
    assert 0.9 * 0.2e-4 < travel <= 0.2e-4
    chunk = scales.checkpoint_steps
    expected = [
        start + at
        for start in range(0, len(result.history) * chunk, chunk)
        for at in range(0, chunk, steps)
    ]
    assert [row["step"] for row in result.updates] == expected
    assert read_updates(folder) == list(result.updates)


def test_a_lost_or_changed_record_of_updates_makes_the_checkpoint_unusable(done, tmp_path):
    folder, result = done
    shutil.copytree(folder, tmp_path / "cut")
    path = tmp_path / "cut" / UPDATES
    points = Checkpoints(folder=tmp_path / "cut", digest=small().digest("invade"))
    assert points.last() == result.history[-1]
    lines = path.read_text().splitlines()
    column = lines[0].split(",").index("factor_mean")
    row = lines[-2].split(",")
    row[column] = "1.0"
    lines[-2] = ",".join(row)
    path.write_text("\n".join(lines) + "\n")
    assert points.last() == result.history[-2]


def test_liggghts_that_is_killed_is_reported_and_the_run_goes_on_bit_for_bit(
    binary, grains, done, tmp_path
):
    _, whole = done

    def kill(line: str) -> None:
        if line.startswith("FDNET checkpoint 3 "):
            children = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
            for child in children:
                if b"liggghts" in Path(f"/proc/{child}/cmdline").read_bytes():
                    os.kill(int(child), signal.SIGKILL)

    launch = Launch(binary=binary)
    with pytest.raises(LiggghtsError, match=r"in\.invade: LIGGGHTS failed \(ended by signal 9"):
        run(small(), grains, tmp_path, replace(launch, follow=kill))
    again = run(small(), grains, tmp_path, launch)
    assert again.history == whole.history
    assert again.updates == whole.updates
    assert np.array_equal(again.damaged.position, whole.damaged.position)


ORPHAN = """
import sys
from pathlib import Path
from fdnet.dem.liggghts import find_binary
from fdnet.dem.liggghts import run_deck
from fdnet.dem.liggghts import Launch

def play(feed):
    print("started", feed.process.pid, flush=True)
    feed('shell sleep 0.1', 'print "alive"')
    sys.stdin.read()

run_deck(Path(sys.argv[1]), "in.none", Launch(binary=find_binary()), play)
"""


def test_liggghts_ends_when_fdnet_is_killed(tmp_path):
    command = [sys.executable, "-c", textwrap.dedent(ORPHAN), str(tmp_path)]
    parent = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    child = int(parent.stdout.readline().split()[1])
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 10
    while Path(f"/proc/{child}").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not Path(f"/proc/{child}").exists()


def test_an_error_of_liggghts_is_reported_with_its_line(binary, tmp_path):
    with pytest.raises(LiggghtsError, match="ERROR: Unknown command: nonsense"):
        run_deck(tmp_path, "in.none", Launch(binary=binary), lambda feed: feed("nonsense 1"))


def test_a_time_limit_ends_a_liggghts_that_hangs(binary, tmp_path):
    launch = Launch(binary=binary, timeout=1.0)
    with pytest.raises(LiggghtsError, match="did not end within its time limit"):
        run_deck(tmp_path, "in.none", launch, lambda feed: feed("shell sleep 30"))


def test_what_follow_raises_stops_liggghts(binary, grains, tmp_path):
    def stop(line: str) -> None:
        if line.startswith("FDNET checkpoint"):
            raise StopError

    with pytest.raises(StopError):
        run(small(), grains, tmp_path, Launch(binary=binary, follow=stop))
    assert len(list((tmp_path / "post").glob("invade_*.restart"))) == 1


def test_explicit_drag_that_would_overshoot_is_refused(binary, grains, tmp_path):
    case = small("held", "drag.multiplier=40.0", "run.stiffness_N_m=100.0")
    with pytest.raises(LiggghtsError, match=r"explicit drag would overshoot; take drag\.scheme"):
        run(case, grains, tmp_path, Launch(binary=binary))


def several(light: float):
    """Fines of two materials: one of the density `light` kg/m3, the other twice as dense."""
    sizes = {"D10_mm": 0.09, "D90_mm": 0.11}
    materials = [
        {"name": name, "share": density, "density_kg_m3": density, "sizes": sizes}
        for name, density in (("light", light), ("heavy", 2 * light))
    ]
    data = small("held").data()
    data["fines"] = {"count": 400, "supply": "batches", "materials": materials}
    return case_from(data)


def test_the_fluid_is_asked_with_the_density_of_each_fine(binary, grains, tmp_path):
    case, seen = several(1100.0), []
    scales = scales_of(case)
    fluid = fluid_of(case, scales, grains)

    class Asked:
        measured = fluid.measured

        def forces(self, spheres, moment):
            seen.append((spheres.fines(), moment.density))
            return fluid.forces(spheres, moment)

    invade(case, scales, grains, tmp_path, Launch(binary=binary), fluid=Asked())
    everyone = densities(case, batches_of(case, scales).counts)
    assert len(seen) > 5
    for fines, density in seen:
        assert np.array_equal(density, everyone[fines.id.astype(int) - 1 - int(grains.id.max())])
        assert set(density) == {1100.0, 2200.0}


def test_explicit_drag_is_judged_by_the_fine_that_follows_the_fluid_fastest():
    """C t / m of the lighter one of two equal fines: m = 4/3 pi r^3 rho."""
    two = resting_spheres(
        [[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0]], 5e-5, specimen_box(tiny()), kind=Kind.FINE
    )
    forces = FluidForces(
        coefficient=np.array([2e-6, 2e-6]),
        velocity=np.zeros((2, 3)),
        push=np.zeros((2, 3)),
        pace=1.0,
        measures={},
    )
    mass = 4 / 3 * np.pi * 5e-5**3 * 500.0
    share = largest_share(two, forces, np.array([2000.0, 500.0]), 1e-5)
    assert share == pytest.approx(2e-6 * 1e-5 / mass)


def test_what_cannot_carry_a_crowd_is_refused():
    with pytest.raises(CaseError, match=r"drag\.scheme: 'viscous' has one damping for all fines"):
        small("viscous")
    with pytest.raises(CaseError, match=r"drag\.update_travel: 0\.2 belongs to a drag"):
        tiny("drag.update_travel=0.2")
    case = small()
    with pytest.raises(CaseError, match="needs a fluid that fdnet computes"):
        invade(case, scales_of(case), None, Path("/nowhere"), None)


def test_render_shows_the_coupled_parts_with_what_it_is_fed(tmp_path):
    render_decks(small("held"), tmp_path)
    deck = (tmp_path / "invade" / "in.invade").read_text()
    assert "jump" not in deck
    for name in ("ask.in", "fluid.in", "checkpoint.in"):
        assert f"include {name}" in deck
        assert (tmp_path / "invade" / name).is_file()
        assert name in refusal_over(tmp_path / "theirs" / name, f"invade/{name}")
    assert "watched.in" not in deck
    assert "set group fines property/atom cd v_cd" in (tmp_path / "invade/fluid.in").read_text()
    assert "f_uf" not in (tmp_path / "invade/ask.in").read_text()
    render_decks(followed(), tmp_path / "followed")
    assert "f_uf[3]" in (tmp_path / "followed/invade/ask.in").read_text()
    render_decks(tiny(), tmp_path / "plain")
    plain = {path.name for path in (tmp_path / "plain" / "invade").iterdir()}
    assert plain == {"in.invade"}


def refusal_over(folder: Path, name: str) -> str:
    """What is said when decks would replace the file `name` of a folder; it stays as it is."""
    (folder / name).parent.mkdir(parents=True)
    (folder / name).write_text("mine")
    with pytest.raises(CaseError, match="is there already") as caught:
        render_decks(small("held"), folder)
    assert [path.read_text() for path in folder.rglob("*") if path.is_file()] == ["mine"]
    return str(caught.value)


def bed_of_fines(binary, folder) -> Snapshot:
    """A random dense bed of 1,028 spheres."""
    data = {key: value for key, value in TINY.items() if key != "fines"} | {
        "seed": 2,
        "box": {"size_mm": [9.0, 3.5, 3.5], "sides": "periodic"},
        "grains": {"radius_mm": 0.25, "porosity": 0.39},
    }
    case = case_from(data)
    return make_pack(case, folder, Launch(binary=binary)).grains


def share_within(bed: Snapshot, low: float, high: float) -> np.ndarray:
    """Share (N,) of each sphere's volume between two planes across x."""
    height = [
        np.clip((bed.position[:, 0] - plane) / bed.radius, -1.0, 1.0) for plane in (low, high)
    ]
    beyond = [0.5 + 0.75 * (h - h**3 / 3) for h in height]
    return beyond[0] - beyond[1]


def test_a_standing_bed_of_fines_takes_up_its_pressure_drop(binary, tmp_path):
    """Forces of the fluid in a dump of LIGGGHTS against Carman and Kozeny's gradient, 1 %.

    The bed stands in the box as fines; what LIGGGHTS applies is read from its own dump.
    """
    (tmp_path / "bed").mkdir()
    bed = bed_of_fines(binary, tmp_path / "bed")
    case = tiny(
        "drag.crowd=beetstra",
        "drag.refresh_steps=1",
        "box.size_mm=[9.0,3.5,3.5]",
        "box.sides=periodic",
        "fines.radius_mm=0.25",
        "grains.radius_mm=0.3",
        "grains.count=1",
        "fines.count=1",
        "fluid.velocity_m_s=0.1",
        "fluid.viscosity_cP=1.0",
    )
    fines = Snapshot(
        step=0,
        time_s=0.0,
        box=bed.box,
        id=bed.id + 1,
        kind=np.full(len(bed), Kind.FINE),
        position=bed.position,
        radius=bed.radius,
        velocity=np.zeros((len(bed), 3)),
    )
    total = applied_force(case, fines, tmp_path, binary)
    low, high = 1.5e-3, 7.5e-3
    share = share_within(fines, low, high)
    volume = float(share @ (4 / 3 * np.pi * fines.radius**3))
    area, length = 3.5e-3**2, high - low
    solid = volume / (area * length)
    gradient = 180 * 1e-3 * solid**2 * 0.1 / ((1 - solid) ** 3 * (2 * 2.5e-4) ** 2)
    assert float(share @ total) == pytest.approx(gradient * length * area, rel=0.01)


def test_liggghts_shows_the_densities_and_takes_in_only_the_last_forces(binary, tmp_path):
    """No number of the first forces is left after the second ones, where zeros have no rows."""
    case = tiny("drag.crowd=beetstra", "drag.scheme=implicit")
    box, place = specimen_box(case), [[2e-4, 5e-4, 5e-4], [6e-4, 5e-4, 5e-4]]
    fines = resting_spheres(place, 5e-5, box, kind=Kind.FINE, first=2)
    write_scene(case, fines, tmp_path, density=[2650.0, 2650.0, 1100.5])
    given = np.array([[[1.0, 2.0, -3.0], [4.0, 5.0, 6.0]], [[7.0, 0.0, 0.0], [0.0, -8.0, 0.0]]])

    def play(feed):
        feed("include in.invade", "include ask.in")
        assert np.array_equal(fine_density(read_state(tmp_path, case)), [2650.0, 1100.5])
        for number, velocity in enumerate(given):
            forces = FluidForces(
                coefficient=np.ones(2),
                velocity=velocity,
                push=np.zeros((2, 3)),
                pace=1.0,
                measures={},
            )
            write_forces(tmp_path, fines, forces)
            show = f"write_dump fines custom post/{number}.dump id f_uf[1] f_uf[2] f_uf[3]"
            feed("include fluid.in", f"{show} modify sort id")

    run_deck(tmp_path, "in.invade", Launch(binary=binary), play)
    for number, velocity in enumerate(given):
        frame = read_frame(tmp_path / "post" / f"{number}.dump")
        shown = np.column_stack([frame.column(f"f_uf[{axis}]") for axis in (1, 2, 3)])
        assert np.array_equal(shown, velocity)


def write_scene(case, fines, folder, *, density) -> Snapshot:
    """Write the deck of `fines` that a coupled invasion begins with; returns its one grain.

    `density` kg/m3 is that of the grain and of each fine.
    """
    scales = scales_of(case)
    grain = Snapshot.from_arrays([[-1e-3, 1e-3, 1e-3]], 3e-4, box=fines.box)
    beyond = np.array([[-2e-3, 1e-3], [0.0, 0.0], [0.0, 0.0]])
    write_data(
        folder / "invade.data",
        grain.joined(fines),
        bounds=fines.box + beyond,
        density=np.array(density),
        types=3,
    )
    (folder / "in.invade").write_text(render_invade(case, scales, grain).text)
    (folder / "post").mkdir()
    write_parts(case, scales, grain, folder)
    return grain


def applied_force(case, fines, folder, binary) -> np.ndarray:
    """Force (N,) N along x that LIGGGHTS puts on standing fines beside that of their contacts."""
    scales = scales_of(case)
    grain = write_scene(case, fines, folder, density=[2650.0] * (len(fines) + 1))

    def play(feed):
        show = 'write_dump fines custom post/{}.dump id fx modify sort id format "%d %.17g"'
        feed("include in.invade", "velocity fines set 0.0 0.0 0.0")
        feed("run 0", show.format("without"), "include ask.in")
        shown = snapshot_of(read_state(folder, case), case, time_s=0.0)
        assert np.array_equal(shown.id, fines.id)
        moment = Moment(step=0, time=0.0, before=None, first=None, fresh=True)
        write_forces(folder, shown, fluid_of(case, scales, grain).forces(shown, moment))
        feed("include fluid.in", "run 0", show.format("with"))

    run_deck(folder, "in.invade", Launch(binary=binary), play)
    first, second = (read_frame(folder / "post" / f"{name}.dump") for name in ("without", "with"))
    return second.column("fx") - first.column("fx")
