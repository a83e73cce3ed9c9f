"""The deposit of a pack measured fine by fine, so that only fines that moved are measured anew.

What `measure_deposit` sums over all fines is kept here as pieces: one row for each fine in each
pore and each side of a throat. When fines come, leave or move, their rows are replaced. The sums
are those of a full measure but for rounding, and for fines that moved less than the tolerance.
"""

from dataclasses import dataclass, replace

import numpy as np

from fdnet.network.fines.ball import pieces
from fdnet.network.fines.deposit import (
    means_in_pores,
    side_corners,
    size_classes,
    wall_distance,
)
from fdnet.network.fines.fine_images import periodic_images
from fdnet.network.fines.inside import clip_to_box
from fdnet.network.fines.occupancy import Occupancy, occupancy_of_deposit
from fdnet.network.fines.point_search import points_in_boxes
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, Snapshot, frozen


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Holders:
    """What holds fines: the pores (P) of a network, then the first and the second sides (T).

    Attributes:
        network: whose pores and sides they are.
        piece: (K, 4, 3) m, tetrahedra inside the box.
        low: (K, 3) m, their lower corners.
        high: (K, 3) m, their upper corners.
        owner: (K,) index of the holder that each is a part of.
        share: (P + 2 T,) by which what the parts hold is divided: the part of the holder inside
            the box, with the sign of the side.
    """

    network: Network
    piece: Array
    low: Array
    high: Array
    owner: Array
    share: Array

    __repr__ = one_line


def holders_of(network: Network) -> Holders:
    """The holders of a network, cut at the faces of its box."""
    corners, owners, shares = [network.pore_corner], [np.arange(len(network.pore_position))], []
    shares.append(network.pore_share)
    first = len(network.pore_position)
    for side in (0, 1):
        real, corner = side_corners(network, side)
        corners.append(corner)
        height = network.throat_heights[:, side]
        owners.append(first + side * len(network.throat_pores) + real)
        shares.append(np.copysign(network.throat_share, height))
    piece, which = clip_to_box(np.concatenate(corners), network.box, network.periodic)
    return Holders(
        network=network,
        piece=frozen(np.ascontiguousarray(piece)),
        low=frozen(piece.min(axis=1)),
        high=frozen(piece.max(axis=1)),
        owner=frozen(np.concatenate(owners)[which]),
        share=frozen(np.concatenate(shares)),
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class KeptDeposit:
    """Fines (N) and their pieces (K) in the holders.

    Attributes:
        holders: of the network.
        fines: as they were measured, each at the place where that was done.
        distance: (N,) m from the nearest grain.
        holder: (K,) index of the holder.
        fine: (K,) index of the fine.
        measure: (K, 2) volume m3 and surface m2 of the fine in the holder, with its sign.
        renewed: number of fines that the last change measured.
    """

    holders: Holders
    fines: Snapshot
    distance: Array
    holder: Array
    fine: Array
    measure: Array
    renewed: int

    __repr__ = one_line

    @property
    def occupancy(self) -> Occupancy:
        """The occupancy of these fines, as `measure_deposit` gives it."""
        network, radius = self.holders.network, self.fines.radius
        pores, throats = len(network.pore_position), len(network.throat_pores)
        count, volume = pores + 2 * throats, self.measure[:, 0]
        whole = (4.0 / 3.0 * np.pi * radius**3)[self.fine]
        away = self.distance[self.fine]
        square = 5.0 * away**2 + radius[self.fine] ** 2
        rows = (volume, self.measure[:, 1], volume * whole, volume * away, volume * square)
        sums = np.array([np.bincount(self.holder, row, count) for row in rows])
        solid, surface = sums[:2, pores:].reshape(2, 2, throats)
        means = means_in_pores(network, sums[:, :pores])
        return occupancy_of_deposit(network, self.fines, means, (solid.T, surface.T))

    @property
    def by_pore(self) -> tuple[Array, Array, Array]:
        """Pore, fine and volume m3 of each piece in a pore."""
        here = self.holder < len(self.holders.network.pore_position)
        return self.holder[here], self.fine[here], self.measure[here, 0]

    def changed_to(self, fines: Snapshot, *, tolerance: float) -> "KeptDeposit":
        """The deposit of other `fines`; those within `tolerance` radii of their place are kept."""
        _, new, old = np.intersect1d(
            fines.id, self.fines.id, assume_unique=True, return_indices=True
        )
        way = np.linalg.norm(fines.position[new] - self.fines.position[old], axis=1)
        same = way <= tolerance * fines.radius[new]
        new, old = new[same], old[same]
        moved = np.setdiff1d(np.arange(len(fines)), new, assume_unique=True)
        place, distance = np.array(fines.position), np.empty(len(fines))
        place[new], distance[new] = self.fines.position[old], self.distance[old]
        now = np.full(len(self.fines), -1)
        now[old] = new
        stays = now[self.fine] >= 0
        holder, fine, measure = _pieces_of(self.holders, fines.where(moved))
        distance[moved] = wall_distance(self.holders.network, fines.position[moved])
        return KeptDeposit(
            holders=self.holders,
            fines=replace(fines, position=frozen(place)),
            distance=frozen(distance),
            holder=frozen(np.concatenate([self.holder[stays], holder])),
            fine=frozen(np.concatenate([now[self.fine[stays]], moved[fine]])),
            measure=frozen(np.concatenate([self.measure[stays], measure])),
            renewed=len(moved),
        )


def measured_deposit(holders: Holders, fines: Snapshot) -> KeptDeposit:
    """The deposit of `fines`, each reaching into the box, all measured."""
    holder, fine, measure = _pieces_of(holders, fines)
    return KeptDeposit(
        holders=holders,
        fines=fines,
        distance=frozen(wall_distance(holders.network, fines.position)),
        holder=frozen(holder),
        fine=frozen(fine),
        measure=frozen(measure),
        renewed=len(fines),
    )


def _pieces_of(holders: Holders, fines: Snapshot) -> tuple[Array, Array, Array]:
    """Holder, fine and (volume, surface) of each piece of `fines`."""
    parts = [(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros((0, 2)))]
    low, high = holders.low, holders.high
    for some in size_classes(fines.radius) if len(fines) else []:
        radius = fines.radius[some]
        largest = float(radius.max())
        position, image = periodic_images(
            holders.network, fines.position[some], low.min(axis=0), high.max(axis=0), largest
        )
        pairs = points_in_boxes(position, low - largest, high + largest)
        measure = pieces(holders.piece, pairs, position, radius[image])
        real = measure[:, 0] > 0.0
        holder = holders.owner[pairs[0][real]]
        fine = some[image[pairs[1][real]]]
        parts.append((holder, fine, measure[real] / holders.share[holder, None]))
    holder, fine, measure = (np.concatenate(column) for column in zip(*parts, strict=True))
    return holder, fine, measure
