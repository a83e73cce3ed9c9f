"""What fines take up of each throat and pore. They never change the network itself (Shi 2011, section 3.2.1)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fdnet.errors import CaseError
from fdnet.network.cylinder import OVERLAPS, Pairs, covers_section
from fdnet.network.deposit import deposit_in_pores, neighbours
from fdnet.network.images import make_images
from fdnet.network.tessellation import Network
from fdnet.snapshot import Array, Snapshot, frozen


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Occupancy:
    """Fines in throats (T), pores (P) and fine-throat pairs (K); SI units.

    A throat here is the cylinder of its inscribed radius between its two pore positions (Shi 2011, section 3.2.2).
    `throat_solid_volume` m3; `throat_porosity` = 1 - solid / cylinder (negative where fines overlap, 1 where the
    radius is 0); `throat_fine_radius` mean radius m of the fines in it (0 without); `throat_fines` how many;
    `blocked` one fine covers a whole cross-section. `pore_solid_volume` m3, `pore_solid_surface` m2 in the
    tetrahedron; `pore_porosity` = (void - fines) / tetrahedron. `pair_throat`, `pair_fine` (K,) indices,
    `pair_distance` (K,) distance of the fine's centre from the axis over the throat radius, `pair_radius` (K,) m.
    """

    throat_solid_volume: Array
    throat_porosity: Array
    throat_fine_radius: Array
    throat_fines: Array
    blocked: Array
    pore_solid_volume: Array
    pore_solid_surface: Array
    pore_porosity: Array
    pair_throat: Array
    pair_fine: Array
    pair_distance: Array
    pair_radius: Array
    counts: Mapping[str, int]


def measure_occupancy(network: Network, fines: Snapshot, *, overlap: str = "exact") -> Occupancy:
    """Occupancy of `network` by `fines`; `overlap` "exact" or "two-plane" (the thesis) for fines in throats.

    Throats see the fines whose sphere reaches into the box, pores those centred in it. Raises CaseError on an
    unknown `overlap`.
    """
    if overlap not in OVERLAPS:
        raise CaseError(f"analysis.overlap: {overlap!r} is not known; choose one of {sorted(OVERLAPS)}")
    throat, fine, pairs = _pairs(network, fines)
    inside = OVERLAPS[overlap](pairs)
    blocked = np.zeros(len(network.throat_radius), bool)
    blocked[throat[covers_section(pairs)]] = True
    use = inside > 0
    throat, fine, pairs, inside = throat[use], fine[use], pairs.where(use), inside[use]
    solid, surface = deposit_in_pores(network, fines)
    throats = _throat_sums(network, throat, pairs, inside)
    pore_porosity = _ratio(network.pore_volume - solid, network.pore_tetra_volume)
    counts = {
        "throat_porosity_negative": int(np.sum(throats["throat_porosity"] < 0)),
        "pore_porosity_negative": int(np.sum((solid > 0) & (solid > network.pore_volume))),
    }
    found = {
        **throats,
        "blocked": blocked,
        "pore_solid_volume": solid,
        "pore_solid_surface": surface,
        "pore_porosity": pore_porosity,
        "pair_throat": throat,
        "pair_fine": fine,
        "pair_radius": pairs.sphere,
        "pair_distance": pairs.offset / pairs.tube,
    }
    return Occupancy(counts=counts, **{name: frozen(value) for name, value in found.items()})


def _throat_sums(network: Network, throat: Array, pairs: Pairs, inside: Array) -> dict[str, Array]:
    count = len(network.throat_radius)
    solid = np.bincount(throat, weights=inside, minlength=count)
    number = np.bincount(throat, minlength=count)
    tube = np.pi * network.throat_radius**2 * network.throat_length
    return {
        "throat_solid_volume": solid,
        "throat_porosity": 1.0 - _ratio(solid, tube),
        "throat_fines": number,
        "throat_fine_radius": _ratio(np.bincount(throat, weights=pairs.sphere, minlength=count), number),
    }


def _ratio(top: Array, bottom: Array) -> Array:
    return np.divide(top, bottom, out=np.zeros(len(top)), where=bottom > 0)


def _pairs(network: Network, fines: Snapshot) -> tuple[Array, Array, Pairs]:
    """Throat and fine (K,) of the pairs that may overlap, with their relative places."""
    low, high = network.box[0]
    index = np.arange(len(fines))
    if not network.periodic[0]:
        x = fines.position[:, 0]
        index = np.flatnonzero((x + fines.radius > low) & (x - fines.radius < high))
    open_throat = np.flatnonzero(network.throat_radius > 0)
    if not len(index) or not len(open_throat):
        empty = np.zeros(0)
        return (
            empty.astype(int),
            empty.astype(int),
            Pairs(sphere=empty, offset=empty, depth=empty, tube=empty, length=empty),
        )
    ends = network.throat_ends[open_throat]
    position, owner = _images(network, fines.where(index), ends)
    half = 0.5 * network.throat_length[open_throat]
    reach = np.hypot(half, network.throat_radius[open_throat]) + float(fines.radius[index].max())
    row, image = neighbours(cKDTree(position), ends.mean(axis=1), reach)
    throat, fine = open_throat[row], index[owner[image]]
    return _touching(throat, fine, _relative(network, throat, position[image], fines.radius[fine]))


def _images(network: Network, fines: Snapshot, ends: Array) -> tuple[Array, Array]:
    beyond = np.maximum(network.box[:, 0] - ends.min(axis=(0, 1)), ends.max(axis=(0, 1)) - network.box[:, 1])
    margin = np.maximum(beyond, 0.0) + float(network.throat_radius.max()) + float(fines.radius.max())
    if not network.periodic[0]:
        margin[0] = np.nan  # beyond the x faces the fines themselves are seen
    images = make_images(fines.position, network.box, periodic=network.periodic, margin=margin, hair=0.0)
    return images.position, images.owner


def _relative(network: Network, throat: Array, position: Array, radius: Array) -> Pairs:
    start, end = network.throat_ends[throat, 0], network.throat_ends[throat, 1]
    along = end - start
    span = np.linalg.norm(along, axis=1)
    # a throat between two pores at one place keeps its shortest length and any direction
    axis = np.where(span[:, None] > 0, along / np.where(span > 0, span, 1.0)[:, None], np.array([1.0, 0.0, 0.0]))
    from_start = position - start
    depth = np.sum(from_start * axis, axis=1)
    offset = np.linalg.norm(from_start - depth[:, None] * axis, axis=1)
    return Pairs(
        sphere=radius,
        offset=offset,
        depth=depth,
        tube=network.throat_radius[throat],
        length=network.throat_length[throat],
    )


def _touching(throat: Array, fine: Array, pairs: Pairs) -> tuple[Array, Array, Pairs]:
    use = (pairs.offset < pairs.sphere + pairs.tube) & (pairs.depth > -pairs.sphere)
    use &= pairs.depth < pairs.length + pairs.sphere
    return throat[use], fine[use], pairs.where(use)
