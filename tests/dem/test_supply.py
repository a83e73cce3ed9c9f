"""Supply of fines: places clear of everything, and batches that are the suspension of one slab."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from builders import followed, resting_spheres, tiny

from fdnet.dem.deck import specimen_box
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.dem.supply import (
    AT_ONCE,
    CLEARANCE,
    LOOSEST_CAKE,
    SURE_CROWDING,
    batches_of,
    crowding,
    later_batch,
    place_batches,
    refuse_crowded_supply,
    slab_end,
)
from fdnet.errors import CaseError
from fdnet.scales.scales import scales_of
from fdnet.spheres.geometry import touching_pairs
from fdnet.spheres.snapshot import Kind

CROWDED = "fines.concentration=0.3"
BATCHED = ("fines.supply=batches", "fines.count=900", "run.checkpoint_ms=0.005")


def clearances(place, radius, case):
    """Distances (N, N) over the sum of the radii, across the periodic sides too."""
    gap = place[:, None] - place
    gap -= np.where(case.periodic, case.size_m, 0) * np.round(gap / case.size_m)
    return np.linalg.norm(gap, axis=2) / (radius[:, None] + radius)


def one_grain(case):
    return resting_spheres([[1.5e-3, 0.8e-3, 0.8e-3]], 2.5e-4, specimen_box(case), kind=Kind.GRAIN)


def in_the_slab(case, scales, grains):
    """The batches carried back to where they are in the suspension at the start."""
    travel = batches_of(case, scales).travel
    for number, fines in enumerate(place_batches(case, scales, grains), 1):
        yield fines, fines.position - [max(0, number - AT_ONCE) * travel, 0, 0]


def test_fines_start_clear_of_everything(grains_of):
    """In the last slab rounds of draws alone leave some 70 of them without a place."""
    crowded_slab = ("box.sides=periodic", CROWDED, "fines.count=2000", "seed=1")
    for keys in ([], ["fines.radius_mm=[0.02,0.06]"], crowded_slab):
        case = tiny(*keys)
        scales, grains = scales_of(case), grains_of(case)
        [fines] = place_batches(case, scales, grains)
        assert len(fines) == scales.supplied_count
        both = grains.joined(fines)
        pairs, _ = touching_pairs(both, case.periodic, gap=0.5 * (CLEARANCE - 1))
        assert not np.any(both.kind[pairs] == Kind.FINE), keys
        low, high = np.min(fines.position[:, 0]), np.max(fines.position[:, 0])
        assert np.min(grains.position[:, 0] - grains.radius) > high
        assert high - low <= scales.slab_length
        assert np.all(fines.velocity[:, 0] == scales.upstream_velocity)


def crowded(case, concentration):
    """A case with another concentration than its file may have."""
    fines = case.fines.model_copy(update={"concentration": concentration})
    return case.model_copy(update={"fines": fines})


@pytest.mark.parametrize("sides", ["walls", "periodic"])
def test_every_fine_finds_a_place_up_to_the_sure_crowding(sides):
    """Slabs of 1 and 20 diameters, just above the limit, where it is tried out, and below."""
    for radius, length in itertools.product(("0.05", "[0.015,0.05]", "0.2"), (1, 20)):
        slab = 2 * float(radius.strip("[]").rsplit(",", 1)[-1]) * length
        case = tiny(f"box.sides={sides}", f"fines={{radius_mm={radius}, slab_mm={slab}}}")
        sure = SURE_CROWDING / crowding(crowded(case, 1.0))
        for seed in range(3):
            full = crowded(case, 1.001 * sure).model_copy(update={"seed": seed})
            assert crowding(full) > SURE_CROWDING
            refuse_crowded_supply(full, scales_of(full))
        refuse_crowded_supply(crowded(case, 0.999 * sure), scales_of(case))
    full = crowded(case, 0.6)
    with pytest.raises(CaseError, match=r"fines\.concentration: 0\.6 leaves"):
        refuse_crowded_supply(full, scales_of(full))


@pytest.mark.parametrize(("radius", "sides"), [("0.05", "walls"), ("[0.02,0.06]", "periodic")])
def test_batches_make_up_the_slab(radius, sides):
    keys = (f"fines.radius_mm={radius}", f"box.sides={sides}", "fines.concentration=0.15")
    case = tiny(*BATCHED, *keys)
    scales, grains = scales_of(case), one_grain(case)
    placed = list(in_the_slab(case, scales, grains))
    end, batches = slab_end(case, grains), batches_of(case, scales)
    assert len(placed) == len(batches.counts) > 4
    ids = np.concatenate([fines.id for fines, _ in placed])
    assert np.array_equal(ids, np.arange(2, 902))
    for number, (fines, place) in enumerate(placed):
        assert len(fines) == batches.counts[number]
        assert np.all(place[:, 0] <= end - number * batches.length)
        least = max(end - (number + 1) * batches.length, end - scales.slab_length)
        assert np.all(place[:, 0] >= least - 1e-18)
    place = np.concatenate([place for _, place in placed])
    radius = np.concatenate([fines.radius for fines, _ in placed])
    assert np.all(clearances(place, radius, case) + 9 * np.eye(900) >= CLEARANCE * (1 - 1e-12))


@pytest.mark.parametrize("concentration", [0.05, 0.1, 0.2])
def test_a_batch_enters_before_it_could_meet_the_cake(concentration):
    """Its place is clear of the loosest cake, which is h thick: phi h = c (u t + h)."""
    case = tiny(*BATCHED, f"fines.concentration={concentration}")
    scales, grains = scales_of(case), one_grain(case)
    end, batches = slab_end(case, grains), batches_of(case, scales)
    for number, (_, place) in enumerate(in_the_slab(case, scales, grains), 1):
        chunk = number - AT_ONCE
        nearest = end - place[:, 0].max() - max(0, chunk) * batches.travel
        arrived = batches.travel * max(0, chunk)
        cake = concentration * arrived / (LOOSEST_CAKE - concentration)
        assert nearest >= cake + (batches.length if chunk > 0 else 0) - 1e-15
    entered = [end - fines.position[:, 0].min() for fines in place_batches(case, scales, grains)]
    assert max(entered) <= batches.reach + 1e-15


# ---- Batches that come as the mud carries them, clear of fines that lag behind.
def followed_batches(*more):
    keys = ("fines.supply=batches", "fines.count=600", "run.checkpoint_ms=0.02")
    case = followed(*keys, *more)
    return case, scales_of(case), batches_of(case, scales_of(case))


@pytest.mark.parametrize("sizes", [(), ("fines.radius_mm=[0.02,0.07]",)])
def test_a_batch_is_clear_of_what_is_there(grains_of, sizes):
    """Fines that lag behind the mud lie where the batch comes; others ahead of it."""
    case, scales, batches = followed_batches(*sizes)
    grains = grains_of(case)
    there = list(itertools.islice(place_batches(case, scales, grains), 2))
    lagging = there[1].position - np.array([0.5 * batches.length, 1e-3, 0])
    spheres = grains.joined(there[0]).joined(replace(there[1], position=lagging))
    batch = later_batch(case, scales, spheres, 2, batches.travel)
    assert len(batch) == batches.counts[2]
    assert batch.id.min() == spheres.id.max() + 1
    high = slab_end(case, grains) + batches.travel - 2 * batches.length
    assert np.all((batch.position[:, 0] < high) & (batch.position[:, 0] > high - batches.length))
    every = spheres.fines().joined(batch)
    apart = clearances(every.position, every.radius, case)
    new = every.id >= batch.id.min()
    assert np.sum(apart[new] < CLEARANCE) == new.sum()  # each with itself alone


def test_the_last_batch_is_as_crowded_as_the_others_and_one_without_room_is_refused(grains_of):
    case, scales, batches = followed_batches()
    grains = grains_of(case)
    end, number = slab_end(case, grains), len(batches.counts) - 1
    rest = scales.slab_length - number * batches.length
    assert rest < 0.9 * batches.length
    place = later_batch(case, scales, grains, number, 0.0).position[:, 0]
    assert end - scales.slab_length < place.min() < end - scales.slab_length + 0.2 * rest
    dense = 1e-4 * np.indices((20, 10, 10)).reshape(3, -1).T  # as dense as they can stand
    dense = dense + np.array([end - 3 * batches.length, 0.0, 0.0])
    there = resting_spheres(dense, 5e-5, grains.box, kind=Kind.FINE, first=10_000)
    with pytest.raises(CaseError, match="of batch 3 find no room"):
        later_batch(case, scales, grains.joined(there), 2, batches.length)


@pytest.mark.liggghts
def test_free_fines_are_where_the_fluid_has_carried_them(binary, tmp_path):
    """Without a grain, after some chunks every fine has moved u t from its place in the slab."""
    case = tiny(*BATCHED, "drag.scheme=viscous", "run.cap_ms=0.06")
    scales = scales_of(case)
    far = resting_spheres([[2.9e-3, 0.25e-3, 0.25e-3]], 1e-5, specimen_box(case), kind=Kind.GRAIN)
    result = invade(case, scales, far, tmp_path, Launch(binary=binary))
    last, fines = result.history[-1], result.state.fines()
    start = np.concatenate([place[:, 0] for _, place in in_the_slab(case, scales, far)])
    came = start[fines.id.astype(int) - 2]
    moved = scales.upstream_velocity * last.step * scales.time_step
    assert last.invaded > 100
    assert np.allclose(fines.position[:, 0] - came, moved, rtol=0, atol=1e-9)
