"""Places for the last fines of a crowded slab, which rounds of draws leave over by chance."""

import numpy as np
import pytest
from builders import tiny
from scipy.spatial import cKDTree

from fdnet.dem import supply
from fdnet.dem import supply as size_classes
from fdnet.dem.supply import CLEARANCE, few, last_places, places_by_size, refuse_crowded_supply
from fdnet.scales.scales import scales_of

RADIUS, SIZE = 0.05, np.array([1.0, 1.0, 1.0])


def drawn(seed, **more):
    """Places of spheres that fill 27 % of a periodic box, and how many got none."""
    radius = np.full(round(0.27 / (4 / 3 * np.pi * RADIUS**3)), RADIUS)
    low, high = np.zeros((len(radius), 3)), np.tile(SIZE, (len(radius), 1))
    rng = np.random.default_rng(seed)
    return places_by_size(radius, low, high, SIZE, rng=rng, **more)


def closest(place, size):
    """Least distance of two places, m."""
    return cKDTree(place, boxsize=size).query(place, 2)[0][:, 1].min()


def slab(seed, concentration):
    return tiny(
        "box.sides=periodic",
        "fines.count=2000",
        f"fines.concentration={concentration}",
        f"seed={seed}",
    )


@pytest.mark.parametrize(("concentration", "seed"), [(0.25, 0), (0.3, 1)])
def test_a_slab_of_2000_fines_holds_all_that_a_case_may_ask_for(concentration, seed):
    """Rounds alone leave 1 and some 70 of them without a place."""
    case = slab(seed, concentration)
    refuse_crowded_supply(case, scales_of(case))
    ((place, radius),) = supply._draw(case, scales_of(case), end=0.0)
    size = np.array([0.0, 1.6e-3, 1.6e-3])
    assert len(place) == 2000
    assert closest(np.column_stack([place[:, 0] - place[:, 0].min(), place[:, 1:]]), size) >= (
        2 * CLEARANCE * radius.min() * (1 - 1e-9)
    )


def test_what_finds_its_places_in_the_rounds_keeps_them(monkeypatch):
    """Nothing more is drawn then."""
    monkeypatch.setattr(supply, "last_places", None)
    monkeypatch.setattr(size_classes, "last_places", None)
    list(supply._draw(slab(2, 0.2), scales_of(slab(2, 0.2)), end=0.0))
    monkeypatch.setattr(supply, "ROUNDS", 30)
    with pytest.raises(TypeError):
        list(supply._draw(slab(2, 0.2), scales_of(slab(2, 0.2)), end=0.0))


def test_the_last_ones_of_a_class_are_drawn_more_often():
    seed = next(one for one in range(20) if drawn(one, patient=False)[1])
    lost, (place, none) = drawn(seed, patient=False)[1], drawn(seed)
    assert 0 < lost < 30
    assert none == 0
    assert closest(place, SIZE) >= 2 * CLEARANCE * RADIUS * (1 - 1e-12)


def test_where_there_is_no_room_no_place_is_made_up(monkeypatch):
    """A cubic lattice has holes of 0.73 radii: one sphere goes into each, no larger one does."""
    monkeypatch.setattr(size_classes, "LAST_TRIES", 20_000)
    edge = np.arange(5) * 0.2
    lattice = np.stack(np.meshgrid(edge, edge, edge), axis=-1).reshape(-1, 3)
    others = lattice, np.full(len(lattice), 0.1)
    span = np.zeros((3, 3)), np.tile(SIZE, (3, 1))
    fits, tight = np.array([0.06, 0.05, 0.08]), np.array([0.08, 0.05, 0.05])
    rng = np.random.default_rng(1)
    assert len(last_places(fits, span, SIZE, rng=rng, others=others)) == 2
    assert len(last_places(tight, span, SIZE, rng=rng, others=others)) == 0


def test_the_last_ones_are_few():
    assert few(1, 1)
    assert few(100, 2000)
    assert not few(101, 2000)
    assert not few(0, 2000)
