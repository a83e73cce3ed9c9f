"""What fines take up of each throat and pore. They never change the network itself."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fdnet.errors import CaseError, NetworkError
from fdnet.network.fines.cylinder import OVERLAPS, Pairs
from fdnet.network.fines.deposit import deposit_in_pores
from fdnet.network.fines.fine_images import centred_inside, reaching_inside
from fdnet.network.fines.in_throats import FinesInThroats, fines_in_throats
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array, Snapshot, frozen


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Occupancy:
    """Fines in throats (T) and pores (P), and pairs (K) of a throat and a fine in it; SI units.

    A throat here is the cylinder of its inscribed radius between the positions of its two pores
    (Shi 2011, section 3.2.2).

    Attributes:
        throat_solid_volume: (T,) m3, fines in the cylinder.
        throat_porosity: (T,) 1 - solid / cylinder; negative where fines overlap, 1 where the
            radius of the throat is 0.
        throat_fine_radius: (T,) m, mean radius of the fines in it; 0 without fines.
        throat_fines: (T,) number of fines in it.
        blocked: (T,) whether one fine covers a whole cross-section.
        pore_solid_volume: (P,) m3, fines in the tetrahedron.
        pore_solid_surface: (P,) m2, surface of the fines in the tetrahedron.
        pore_porosity: (P,) (void - fines) / tetrahedron.
        pair_throat: (K,) index of the throat.
        pair_fine: (K,) index of the fine.
        pair_distance: (K,) distance of the centre of the fine from the axis over the radius of
            the throat.
        pair_radius: (K,) m, radius of the fine.
        pair_volume: (K,) m3 of the fine in the throat.
        fines: those whose spheres reach into the box.
        counts: how many fines lie outside the box, how many porosities are negative.
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
    pair_volume: Array
    fines: Snapshot
    counts: Mapping[str, int]

    def __repr__(self) -> str:
        return (
            f"Occupancy({int(np.sum(self.throat_fines > 0))} of {len(self.throat_fines)} throats "
            f"with fines, {int(np.sum(self.blocked))} blocked, "
            f"{float(np.sum(self.pore_solid_volume)):.4g} m3 of fines in "
            f"{int(np.sum(self.pore_solid_volume > 0))} of {len(self.pore_solid_volume)} pores)"
        )


def measure_occupancy(
    network: Network, fines: Snapshot, *, overlap: str | Callable[[Pairs], Array] = "exact"
) -> Occupancy:
    """What `fines` fill of the throats and pores of a network (Shi 2011, section 3.2).

    Throats and pores see every fine whose sphere reaches into the box, also one that is centred
    upstream of it. Pores hold what of it lies inside the box; a pore or
    throat that a mirrored face cuts stands for its mirrored part as well. Throats also see the
    mirror images of the fines centred inside. Fines centred outside are counted
    (`fines_outside_box`).

    Args:
        network: pores and throats of the grains.
        fines: the small spheres, m.
        overlap: volume of a fine in a throat: "exact", "two-plane" (the thesis), or a function of
            `Pairs` that returns the volumes (K,) m3.

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
    refuse_wide(network, fines)
    inside = centred_inside(network, fines.position)
    throats = fines_in_throats(network, fines, overlap)
    reaching = fines.where(reaching_inside(network, fines))
    fields = _throat_fields(network, throats) | _pore_fields(network, reaching)
    counts = {
        "fines_outside_box": int(np.sum(~inside)),
        "throat_porosity_negative": int(np.sum(fields["throat_porosity"] < 0)),
        "pore_porosity_negative": _overfilled(network, fields["pore_solid_volume"]),
    }
    values = {name: frozen(value) for name, value in fields.items()}
    return Occupancy(fines=reaching, counts=counts, **values)


def refuse_wide(network: Network, fines: Snapshot) -> None:
    """Raise NetworkError on fines that would meet their own image across a periodic side."""
    side = np.where(network.periodic, np.ptp(network.box, axis=1), np.inf)
    wide = np.flatnonzero(2.0 * fines.radius > side.min())
    if len(wide):
        raise NetworkError(
            f"occupancy: fine {fines.id[wide[0]]} of radius {fines.radius[wide[0]]:.3g} m meets "
            f"its own image across the periodic side {'xyz'[int(np.argmin(side))]} of "
            f"{side.min():.3g} m ({len(wide)} such fines); check units and box"
        )


def _throat_fields(network: Network, throats: FinesInThroats) -> dict[str, Array]:
    """The fields by throat and by pair."""
    count, pairs = len(network.throat_radius), throats.pairs
    solid = np.bincount(throats.throat, weights=throats.volume, minlength=count)
    number = np.bincount(throats.throat, minlength=count)
    radii = np.bincount(throats.throat, weights=pairs.sphere, minlength=count)
    tube = np.pi * network.throat_radius**2 * network.throat_length
    return {
        "throat_solid_volume": solid,
        "throat_porosity": 1.0 - ratio(solid, tube),
        "throat_fines": number,
        "throat_fine_radius": ratio(radii, number),
        "blocked": throats.blocked,
        "pair_throat": throats.throat,
        "pair_fine": throats.fine,
        "pair_radius": pairs.sphere,
        "pair_distance": pairs.offset / pairs.tube,
        "pair_volume": throats.volume,
    }


def _pore_fields(network: Network, reaching: Snapshot) -> dict[str, Array]:
    """The fields by pore, from the fines that reach into the box."""
    solid, surface = deposit_in_pores(network, reaching)
    return {
        "pore_solid_volume": solid,
        "pore_solid_surface": surface,
        "pore_porosity": ratio(network.pore_volume - solid, network.pore_tetra_volume),
    }


def _overfilled(network: Network, solid: Array) -> int:
    """Number of pores with more fines, `solid` (P,) m3, than void."""
    return int(np.sum((solid > 0) & (solid > network.pore_volume)))


def ratio(top: Array, bottom: Array) -> Array:
    """top / bottom, 0 where `bottom` is not positive."""
    return np.divide(top, bottom, out=np.zeros(np.shape(top)), where=np.asarray(bottom) > 0)
