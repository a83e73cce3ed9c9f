"""The deposit of a pack measured fine by fine, so that only fines that moved are measured anew.

The volume of each fine in each pore is kept as a piece. When fines come, leave or move, their
pieces are replaced. The order of the pieces does not depend on which were kept, and so neither do
sums over them, to the last digit.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.network.fines.ball import pieces
from fdnet.network.fines.deposit import size_classes
from fdnet.network.fines.fine_images import periodic_images
from fdnet.network.fines.inside import clip_to_box
from fdnet.network.fines.point_search import points_in_boxes
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, Snapshot, frozen, unmoved


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Holders:
    """The pores (P) of a network, which hold fines, as tetrahedra inside the box.

    Attributes:
        network: whose pores they are.
        piece: (K, 4, 3) m, the tetrahedra.
        low: (K, 3) m, their lower corners.
        high: (K, 3) m, their upper corners.
        pore: (K,) that each is a part of.
    """

    network: Network
    piece: Array
    low: Array
    high: Array
    pore: Array

    __repr__ = one_line


def holders_of(network: Network) -> Holders:
    """The pores of a network, cut at the faces of its box."""
    piece, pore = clip_to_box(network.pore_corner, network.box, network.periodic)
    return Holders(
        network=network,
        piece=frozen(np.ascontiguousarray(piece)),
        low=frozen(piece.min(axis=1)),
        high=frozen(piece.max(axis=1)),
        pore=frozen(pore),
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class KeptDeposit:
    """Fines (N) and their pieces (K) in the pores.

    Attributes:
        holders: of the network.
        fines: as they were measured.
        pore: (K,) that holds the piece.
        fine: (K,) index of the fine; pieces are sorted by the number of the fine, then by pore.
        volume: (K,) m3 of the fine in the pore, over the share of the pore inside the box.
        renewed: number of fines that the last change measured.
    """

    holders: Holders
    fines: Snapshot
    pore: Array
    fine: Array
    volume: Array
    renewed: int

    __repr__ = one_line

    @property
    def in_pores(self) -> Array:
        """Volume (P,) m3 of the fines in each pore."""
        return np.bincount(self.pore, self.volume, len(self.holders.network.pore_position))

    def changed_to(self, fines: Snapshot) -> "KeptDeposit":
        """The deposit of other `fines`; the pieces of those at the same place are kept."""
        new, old = unmoved((fines.id, fines.position), (self.fines.id, self.fines.position))
        moved = np.setdiff1d(np.arange(len(fines)), new, assume_unique=True)
        now = np.full(len(self.fines), -1)
        now[old] = new
        stays = now[self.fine] >= 0
        pore, fine, volume = _pieces_of(self.holders, fines.where(moved))
        pore = np.concatenate([self.pore[stays], pore])
        fine = np.concatenate([now[self.fine[stays]], moved[fine]])
        volume = np.concatenate([self.volume[stays], volume])
        return _sorted(self.holders, fines, (pore, fine, volume), renewed=len(moved))


def measured_deposit(holders: Holders, fines: Snapshot) -> KeptDeposit:
    """The deposit of `fines`, each reaching into the box, all measured."""
    return _sorted(holders, fines, _pieces_of(holders, fines), renewed=len(fines))


def _sorted(
    holders: Holders, fines: Snapshot, parts: tuple[Array, Array, Array], *, renewed: int
) -> KeptDeposit:
    """The deposit with its pieces (pore, fine, volume) sorted."""
    order = np.lexsort((parts[0], fines.id[parts[1]]))
    pore, fine, volume = (frozen(column[order]) for column in parts)
    return KeptDeposit(
        holders=holders, fines=fines, pore=pore, fine=fine, volume=volume, renewed=renewed
    )


def _pieces_of(holders: Holders, fines: Snapshot) -> tuple[Array, Array, Array]:
    """Pore, fine and volume m3 of each piece of `fines`."""
    parts = [(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))]
    low, high = holders.low, holders.high
    for some in size_classes(fines.radius) if len(fines) else []:
        radius = fines.radius[some]
        largest = float(radius.max())
        position, image = periodic_images(
            holders.network, fines.position[some], low.min(axis=0), high.max(axis=0), largest
        )
        pairs = points_in_boxes(position, low - largest, high + largest)
        volume = pieces(holders.piece, pairs, position, radius[image])[:, 0]
        real = volume > 0.0
        pore = holders.pore[pairs[0][real]]
        fine = some[image[pairs[1][real]]]
        parts.append((pore, fine, volume[real] / holders.network.pore_share[pore]))
    pore, fine, volume = (np.concatenate(column) for column in zip(*parts, strict=True))
    return pore, fine, volume
