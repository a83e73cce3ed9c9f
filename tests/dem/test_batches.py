"""Fines fed in batches: the suspension of one slab, each part present once it is due."""

import re

import numpy as np
import pytest
from builders import resting_spheres, tiny

from fdnet.dem.deck import specimen_box
from fdnet.dem.invade_deck import render_invade, write_batches
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.dem.packing import make_pack
from fdnet.dem.supply import AT_ONCE, CLEARANCE, LOOSEST_CAKE, batches_of, place_batches, slab_end
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Kind

BATCHED = ("fines.supply=batches", "fines.count=900", "run.checkpoint_ms=0.005")


def one_grain(case):
    return resting_spheres([[1.5e-3, 0.8e-3, 0.8e-3]], 2.5e-4, specimen_box(case), kind=Kind.GRAIN)


def in_the_slab(case, scales, grains):
    """The batches carried back to where they are in the suspension at the start."""
    travel = batches_of(case, scales).travel
    for number, fines in enumerate(place_batches(case, scales, grains), 1):
        yield fines, fines.position - [max(0, number - AT_ONCE) * travel, 0, 0]


@pytest.mark.parametrize("radius", ["0.05", "[0.02,0.06]"])
@pytest.mark.parametrize("sides", ["walls", "periodic"])
def test_batches_make_up_the_slab(radius, sides):
    case = tiny(
        *BATCHED, f"fines.radius_mm={radius}", f"box.sides={sides}", "fines.concentration=0.15"
    )
    scales, grains = scales_of(case), one_grain(case)
    placed = list(in_the_slab(case, scales, grains))
    end, batches = slab_end(case, grains), batches_of(case, scales)
    assert len(placed) == len(batches.counts) > 4
    ids = np.concatenate([fines.id for fines, _ in placed])
    assert np.array_equal(ids, np.arange(2, 902))
    for number, (fines, place) in enumerate(placed):
        assert len(fines) == batches.counts[number]
        assert np.all(place[:, 0] <= end - number * batches.length)
        assert np.all(
            place[:, 0]
            >= max(end - (number + 1) * batches.length, end - scales.slab_length) - 1e-18
        )
    place, radii = (
        np.concatenate([p for _, p in placed]),
        np.concatenate([f.radius for f, _ in placed]),
    )
    gap = place[:, None] - place
    for axis, size in enumerate(case.size_m):
        gap[..., axis] -= size * np.round(gap[..., axis] / size) if case.periodic[axis] else 0.0
    apart = np.linalg.norm(gap, axis=2) + np.eye(900)
    assert np.all(apart >= CLEARANCE * (radii[:, None] + radii) * (1 - 1e-12))


@pytest.mark.parametrize("concentration", [0.05, 0.1, 0.2])
def test_a_batch_enters_before_it_could_meet_the_cake(concentration):
    """A batch enters while its place is still clear of the loosest cake.

    The cake is h thick, phi h = c (u t + h): all fines that the suspension and the front's own
    advance have brought.
    """
    case = tiny(*BATCHED, f"fines.concentration={concentration}")
    scales, grains = scales_of(case), one_grain(case)
    end, batches = slab_end(case, grains), batches_of(case, scales)
    for number, (_, place) in enumerate(in_the_slab(case, scales, grains), 1):
        chunk = number - AT_ONCE
        nearest = end - place[:, 0].max() - max(0, chunk) * batches.travel
        arrived = batches.travel * max(0, chunk)
        cake = concentration * arrived / (LOOSEST_CAKE - concentration)
        assert LOOSEST_CAKE * cake == pytest.approx(concentration * (arrived + cake))
        assert nearest >= cake + (batches.length if chunk > 0 else 0) - 1e-15
    entered = [end - fines.position[:, 0].min() for fines in place_batches(case, scales, grains)]
    assert max(entered) <= batches.reach + 1e-15


def test_supplied_counts_the_batches_that_have_come():
    case = tiny(*BATCHED)
    batches = batches_of(case, scales_of(case))
    assert [batches.entered_at(chunk) for chunk in (1, 2, 5)] == [2, 3, 6]
    assert batches.supplied(batches.entered_at(10_000)) == 900


def test_batches_follow_the_mud_where_it_slows_down():
    """After the travel of n chunks of undisturbed mud the batches of chunk n + 1 are there."""
    batches = batches_of(tiny(*BATCHED), scales_of(tiny(*BATCHED)))
    moved = batches.travel * np.array([0.0, 0.99, 1.0, 1.5, 2.0, 1e6])
    assert [batches.entered_after(one) for one in moved] == [2, 2, 3, 3, 4, len(batches.counts)]
    for entered in (2, 3, len(batches.counts)):
        assert batches.entered_with(batches.supplied(entered)) == entered
        assert batches.entered_with(batches.supplied(entered) - 1) == entered
    assert batches.entered_with(0) == 2
    assert batches.entered_with(10_000) == len(batches.counts)


def test_thin_chunks_make_no_batch_thinner_than_a_fine():
    """Otherwise batches that are not neighbours could overlap: each is drawn clear of the last."""
    case = tiny("fines.supply=batches", "run.checkpoint_ms=0.0005")
    scales, grains = scales_of(case), one_grain(case)
    assert batches_of(case, scales).travel < 0.2 * 2 * 0.05e-3
    place = np.concatenate([place for _, place in in_the_slab(case, scales, grains)])
    apart = np.linalg.norm(place[:, None] - place, axis=2) + np.eye(len(place))
    assert apart.min() >= CLEARANCE * 0.1e-3 * (1 - 1e-12)


def test_so_few_fines_that_a_batch_would_be_empty_come_at_once():
    case = tiny(
        "fines={radius_mm=0.05, count=60, supply='batches', concentration=0.0003}",
        "run.checkpoint_ms=0.01",
    )
    assert batches_of(case, scales_of(case)).counts == (60,)


def test_a_short_slab_is_one_batch():
    case = tiny("fines.supply=batches", "fines.count=20")
    assert batches_of(case, scales_of(case)).counts == (20,)
    assert "batch_" not in render_invade(case, scales_of(case), one_grain(case)).text


@pytest.mark.parametrize(
    ("scheme", "sets"),
    [("viscous", set()), ("held", {"uf"}), ("implicit", {"uf", "Ksl"})],
)
def test_the_deck_takes_each_batch_in_once_and_gives_it_its_drag(tmp_path, scheme, sets):
    case = tiny(*BATCHED, f"drag.scheme={scheme}")
    scales, grains = scales_of(case), one_grain(case)
    write_batches(case, scales, grains, tmp_path)
    files = sorted((tmp_path / "supply").glob("*.in"))
    last = len(files) + 1
    assert {file.name for file in files} == {f"batch_{number}.in" for number in range(2, last + 1)}
    text = render_invade(case, scales, grains).text
    assert f'if "${{chunk}} < 2 || ${{chunk}} > {last}" then "jump SELF fed"' in text
    lines = files[0].read_text().splitlines()
    assert {
        line.split()[4] for line in lines if line.startswith("set group batch property/atom")
    } == sets
    assert any(line.startswith("velocity batch set") for line in lines)


@pytest.mark.parametrize(
    ("settings", "stored"),
    [
        (("drag.scheme=held",), "v_fx v_fy v_fz"),
        (("drag.refresh_steps=1",), None),
    ],
)
def test_what_is_stored_for_each_fine_is_stored_anew_after_a_batch(tmp_path, settings, stored):
    """LIGGGHTS stores nothing for atoms that come later: they would feel no drag."""
    case = tiny(*BATCHED, *settings)
    write_batches(case, scales_of(case), one_grain(case), tmp_path)
    text = (tmp_path / "supply/batch_2.in").read_text()
    again = re.findall(r"(?m)^unfix drag\nunfix st\nfix st fines store/state \d+ (.*)$", text)
    assert again == ([] if stored is None else [stored])
    assert len(re.findall("(?m)^fix drag fines addforce", text)) == len(again)


@pytest.mark.liggghts
@pytest.mark.parametrize(
    ("scheme", "forces"),
    [
        ("viscous", ()),
        ("held", ()),
        ("implicit", ()),
        ("held", ("drag.inertia=schiller-naumann", "drag.pressure_gradient=true")),
    ],
)
def test_a_batched_invasion_accounts_for_every_fine_and_resumes(binary, tmp_path, scheme, forces):
    settings = (f"drag.scheme={scheme}", "run.cap_ms=0.1", "fines.friction=0.2")
    case = tiny(*BATCHED, *settings, *forces)
    scales = scales_of(case)
    grains = make_pack(case, tmp_path / "pack", Launch(binary=binary)).grains
    whole = invade(case, scales, grains, tmp_path / "whole", Launch(binary=binary))
    last, batches = whole.history[-1], batches_of(case, scales)
    assert len(batches.counts) > 5
    assert (
        whole.supplied
        == batches.supplied(batches.entered_at(last.chunk))
        == last.upstream + last.invaded + last.passed
    )
    assert whole.max_overlap < (0.15 if forces else 0.1)

    def stop(line: str) -> None:
        if line.startswith("FDNET checkpoint 4 "):
            raise StopError

    with pytest.raises(StopError):
        invade(case, scales, grains, tmp_path / "cut", Launch(binary=binary, follow=stop))
    for lost in [*(tmp_path / "cut" / "supply").glob("batch_1?.*")]:
        lost.unlink()
    again = invade(case, scales, grains, tmp_path / "cut", Launch(binary=binary))
    assert again.history == whole.history
    assert np.array_equal(again.damaged.position, whole.damaged.position)


@pytest.mark.liggghts
def test_free_fines_are_where_the_fluid_has_carried_them(binary, tmp_path):
    """Without a grain, after some chunks every fine has moved u t from its place in the slab."""
    case = tiny(*BATCHED, "drag.scheme=viscous", "run.cap_ms=0.06")
    scales = scales_of(case)
    far = resting_spheres([[2.9e-3, 0.25e-3, 0.25e-3]], 1e-5, specimen_box(case), kind=Kind.GRAIN)
    result = invade(case, scales, far, tmp_path, Launch(binary=binary))
    last = result.history[-1]
    start = {
        int(number): x
        for fines, place in in_the_slab(case, scales, far)
        for number, x in zip(fines.id, place[:, 0], strict=True)
    }
    fines = result.damaged.fines()
    came = np.array([start[int(number)] for number in fines.id])
    moved = scales.upstream_velocity * last.step * scales.time_step
    assert last.invaded > 100
    assert np.allclose(fines.position[:, 0] - came, moved, rtol=0, atol=1e-9)


class StopError(Exception):
    """Raised by a test to cut a run."""
