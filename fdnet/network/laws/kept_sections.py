"""The damage law `section-archie` where fines come, leave and move between the solves of a flow.

The resistances of a throat depend on the fines that reach into it and on nothing else. Only
throats that a changed fine reaches, at its former place or at its new one, are summed anew.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.network import geometry
from fdnet.network.fines.occupancy import ratio
from fdnet.network.laws.beside_throats import FineImages
from fdnet.network.laws.lubrication import THROATS
from fdnet.network.laws.section_archie import fine_resistances
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, Snapshot, frozen


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class KeptSections:
    """Resistances of the sides of throats (T) among fines.

    Attributes:
        network: pores and throats.
        fines: at the places for which the resistances hold.
        without: (T, 2) 1/m3, without the fines; see `fine_resistances`.
        raised: (T, 2) 1/m3, with them.
        renewed: number of throats that the last change summed anew.
    """

    network: Network
    fines: Snapshot
    without: Array
    raised: Array
    renewed: int

    __repr__ = one_line

    @property
    def factor(self) -> Array:
        """Share (T, 2) of its clean conductance that each side keeps, at most 1."""
        finite = np.where(np.isfinite(self.raised), self.raised, 0.0)
        left = ratio(self.without, finite)  # 0 where the fines close a side
        return np.where(self.raised > self.without, left, 1.0)

    def changed_to(self, fines: Snapshot) -> "KeptSections":
        """The resistances among other `fines`; those at the same place are taken as unchanged."""
        _, new, old = np.intersect1d(
            fines.id, self.fines.id, assume_unique=True, return_indices=True
        )
        same = np.all(fines.position[new] == self.fines.position[old], axis=1)
        gone, come = np.ones(len(self.fines), bool), np.ones(len(fines), bool)
        gone[old[same]] = come[new[same]] = False
        reached = throats_beside(self.network, self.fines.where(gone))
        reached |= throats_beside(self.network, fines.where(come))
        both = fine_resistances(self.network, fines, among=reached)[:2]
        without, raised = (
            np.where(reached[:, None], now, before)
            for now, before in zip(both, (self.without, self.raised), strict=True)
        )
        return KeptSections(
            network=self.network,
            fines=fines,
            without=frozen(without),
            raised=frozen(raised),
            renewed=int(reached.sum()),
        )


def measured_sections(network: Network, fines: Snapshot) -> KeptSections:
    """The resistances among `fines`, those of all throats summed."""
    without, raised, _ = fine_resistances(network, fines)
    return KeptSections(
        network=network,
        fines=fines,
        without=frozen(without),
        raised=frozen(raised),
        renewed=len(without),
    )


def throats_beside(network: Network, fines: Snapshot) -> Array:
    """Whether any of the fines reaches into each throat (T,)."""
    images = FineImages(network, fines)
    parts = geometry.slices(len(network.throat_pores), THROATS)
    return np.concatenate([np.diff(images.beside(part).first) > 0 for part in parts])
