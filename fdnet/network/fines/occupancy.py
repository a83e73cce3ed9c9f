"""What fines take up of each throat and pore. They never change the network itself (Shi 2011, section 3.2.1)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fdnet.errors import CaseError, NetworkError
from fdnet.network.fines.cells import points_in_boxes
from fdnet.network.fines.cylinder import OVERLAPS, Pairs, covers_section, place_by_axis
from fdnet.network.fines.deposit import (
    centred_inside,
    deposit_in_pores,
    deposit_on_sides,
    mirrored_images,
)
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array, Snapshot, frozen


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Occupancy:
    """Fines in throats (T), pores (P) and fine-throat pairs (K); SI units.

    A throat here is the cylinder of its inscribed radius between its two pore positions (Shi 2011, section 3.2.2).
    `throat_solid_volume` m3; `throat_porosity` = 1 - solid / cylinder (negative where fines overlap, 1 where the
    radius is 0); `throat_fine_radius` mean radius m of the fines in it (0 without); `throat_fines` how many;
    `blocked` one fine covers a whole cross-section. `pore_solid_volume` m3, `pore_solid_surface` m2 in the
    tetrahedron; `pore_porosity` = (void - fines) / tetrahedron; of the fines in it, by volume, the mean
    `pore_fine_volume` m3 of a whole fine, and `pore_layer` m, the thickness of the layer they make on the grains.
    `side_solid_volume` m3 and `side_solid_surface` m2 (T, 2) in the pyramids from the facet to the power centres of
    the first and second pore. `pair_throat`, `pair_fine` (K,) indices,
    `pair_distance` (K,) distance of the fine's centre from the axis over the throat radius, `pair_radius` (K,) m,
    `pair_volume` (K,) m3 of the fine in the throat.
    """

    throat_solid_volume: Array
    throat_porosity: Array
    throat_fine_radius: Array
    throat_fines: Array
    blocked: Array
    pore_solid_volume: Array
    pore_solid_surface: Array
    pore_porosity: Array
    pore_fine_volume: Array
    pore_layer: Array
    side_solid_volume: Array
    side_solid_surface: Array
    pair_throat: Array
    pair_fine: Array
    pair_distance: Array
    pair_radius: Array
    pair_volume: Array
    counts: Mapping[str, int]


def measure_occupancy(
    network: Network, fines: Snapshot, *, overlap: str | Callable[[Pairs], Array] = "exact"
) -> Occupancy:
    """What `fines` fill of each pore and throat of `network`.

    Throats hold the fines whose sphere reaches into the box, pores those centred in it. Both also
    hold the mirror images of the latter across faces that are not periodic, where pores and throats
    cut by the face are whole. Fines centred outside are counted (`fines_outside_box`).

    Args:
        network: the pores and throats of the grains.
        fines: the small spheres alone, m.
        overlap: volume of a fine in a throat, "exact" or "two-plane" (the thesis), or a function
            that gives the volumes (K,) m3 of fine-throat pairs.

    Raises:
        CaseError: `overlap` is unknown.
        NetworkError: a fine is wider than a periodic side.

    Examples:
        >>> import fdnet, numpy as np
        >>> lattice = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
        >>> grains = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
        >>> network = fdnet.build_network(grains, periodic="yz")
        >>> fine = fdnet.Snapshot.from_arrays([[1e-3] * 3], 5e-5, box=grains.box, kind="fine")
        >>> occupancy = fdnet.measure_occupancy(network, fine)
        >>> print(f"{1e18 * occupancy.pore_solid_volume.sum():.0f} um3 of fines in the pores")
        523599 um3 of fines in the pores
    """
    if isinstance(overlap, str) and overlap not in OVERLAPS:
        raise CaseError(
            f"analysis.throat_overlap: {overlap!r} is not known; choose one of {sorted(OVERLAPS)}"
        )
    _refuse_wide(network, fines)
    throat, fine, pairs = _pairs(network, fines)
    inside = OVERLAPS[overlap](pairs) if isinstance(overlap, str) else overlap(pairs)
    blocked = np.zeros(len(network.throat_radius), bool)
    blocked[throat[covers_section(pairs)]] = True
    use = inside > 0
    throat, fine, pairs, inside = throat[use], fine[use], pairs.where(use), inside[use]
    solid, surface, fine_volume, layer = deposit_in_pores(network, fines)
    side_solid, side_surface = deposit_on_sides(network, fines)
    throats = _throat_sums(network, throat, pairs, inside)
    pore_porosity = ratio(network.pore_volume - solid, network.pore_tetra_volume)
    counts = {
        "fines_outside_box": int(np.sum(~centred_inside(network, fines.position))),
        "throat_porosity_negative": int(np.sum(throats["throat_porosity"] < 0)),
        "pore_porosity_negative": int(np.sum((solid > 0) & (solid > network.pore_volume))),
    }
    found = {
        **throats,
        "blocked": blocked,
        "pore_solid_volume": solid,
        "pore_solid_surface": surface,
        "pore_porosity": pore_porosity,
        "pore_fine_volume": fine_volume,
        "pore_layer": layer,
        "side_solid_volume": side_solid,
        "side_solid_surface": side_surface,
        "pair_throat": throat,
        "pair_fine": fine,
        "pair_radius": pairs.sphere,
        "pair_distance": pairs.offset / pairs.tube,
        "pair_volume": inside,
    }
    return Occupancy(counts=counts, **{name: frozen(value) for name, value in found.items()})


def _refuse_wide(network: Network, fines: Snapshot) -> None:
    side = np.where(network.periodic, np.ptp(network.box, axis=1), np.inf)
    wide = np.flatnonzero(2.0 * fines.radius > side.min())
    if len(wide):
        raise NetworkError(
            f"occupancy: fine {fines.id[wide[0]]} of radius {fines.radius[wide[0]]:.3g} m meets its own image across "
            f"the periodic side {'xyz'[int(np.argmin(side))]} of {side.min():.3g} m ({len(wide)} such fines); check "
            "units and box"
        )


def _throat_sums(network: Network, throat: Array, pairs: Pairs, inside: Array) -> dict[str, Array]:
    count = len(network.throat_radius)
    solid = np.bincount(throat, weights=inside, minlength=count)
    number = np.bincount(throat, minlength=count)
    tube = np.pi * network.throat_radius**2 * network.throat_length
    return {
        "throat_solid_volume": solid,
        "throat_porosity": 1.0 - ratio(solid, tube),
        "throat_fines": number,
        "throat_fine_radius": ratio(
            np.bincount(throat, weights=pairs.sphere, minlength=count), number
        ),
    }


def ratio(top: Array, bottom: Array) -> Array:
    """top / bottom, 0 where `bottom` is not positive."""
    return np.divide(top, bottom, out=np.zeros(np.shape(top)), where=np.asarray(bottom) > 0)


def _pairs(network: Network, fines: Snapshot) -> tuple[Array, Array, Pairs]:
    """Throat and fine (K,) of the pairs that touch, with their relative places."""
    index = np.flatnonzero(_reaching_in(network, fines))
    throat = np.flatnonzero(network.throat_radius > 0)
    ends = network.throat_ends[throat]
    if not len(index) or not len(throat):
        return (
            throat[:0],
            index[:0],
            Pairs(**dict.fromkeys(("sphere", "offset", "depth", "tube", "length"), np.zeros(0))),
        )
    low, high = ends.min(axis=1), ends.max(axis=1)
    largest = float(fines.radius[index].max())
    # a throat shorter than the shortest allowed reaches beyond its ends
    beyond = network.throat_length[throat] - np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    reach = (network.throat_radius[throat] + np.maximum(beyond, 0.0) + largest)[:, None]
    low, high = low - reach, high + reach
    position, owner = mirrored_images(
        network, fines.position[index], low.min(axis=0), high.max(axis=0), 0.0
    )
    row, image = points_in_boxes(position, low, high)
    offset, depth = place_by_axis(ends[:, 0], ends[:, 1], row, position, image)
    throat, fine = throat[row], index[owner[image]]
    return _touching(network, throat, fine, (fines.radius[fine], offset, depth))


def _reaching_in(network: Network, fines: Snapshot) -> Array:
    """True (N,) for fines whose sphere reaches into the box along the axes that are not periodic."""
    low, high = network.box.T
    reach = fines.radius[:, None]
    return np.all(
        ((fines.position + reach > low) & (fines.position - reach < high))
        | np.array(network.periodic),
        axis=1,
    )


def _touching(
    network: Network, throat: Array, fine: Array, place: tuple[Array, Array, Array]
) -> tuple[Array, Array, Pairs]:
    sphere, offset, depth = place
    tube, length = network.throat_radius[throat], network.throat_length[throat]
    use = (offset < sphere + tube) & (depth > -sphere) & (depth < length + sphere)
    pairs = Pairs(sphere=sphere, offset=offset, depth=depth, tube=tube, length=length).where(use)
    return throat[use], fine[use], pairs
