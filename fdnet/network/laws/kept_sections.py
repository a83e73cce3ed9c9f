"""The damage law `section-archie` where fines come, leave and move between the solves of a flow.

The resistances of a throat depend on the fines that reach into it and on nothing else. Only
throats that a changed fine reaches, at its former place or at its new one, are summed anew.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fdnet.network.fines.occupancy import ratio
from fdnet.network.laws.beside_throats import FineImages
from fdnet.network.laws.section_archie import STEP, Part, fine_resistances, parts_of
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, Snapshot, frozen, unmoved


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class KeptSections:
    """Resistances of the sides of throats (T) among fines.

    Attributes:
        network: pores and throats.
        parts: what does not depend on the fines, of its throats.
        step: greatest between two sections, in radii of the smallest fine in the throat.
        fines: at the places for which the resistances hold.
        without: (T, 2) 1/m3, without the fines; see `fine_resistances`.
        raised: (T, 2) 1/m3, with them.
        renewed: number of throats that the last change summed anew.
    """

    network: Network
    parts: Sequence[Part]
    step: float
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
        new, old = unmoved((fines.id, fines.position), (self.fines.id, self.fines.position))
        gone, come = np.ones(len(self.fines), bool), np.ones(len(fines), bool)
        gone[old] = come[new] = False
        reached = self._throats_beside(
            np.concatenate([self.fines.position[gone], fines.position[come]]),
            np.concatenate([self.fines.radius[gone], fines.radius[come]]),
        )
        both = fine_resistances(
            self.network, fines, among=reached, parts=self.parts, step=self.step
        )[:2]
        without, raised = (
            np.where(reached[:, None], now, before)
            for now, before in zip(both, (self.without, self.raised), strict=True)
        )
        return replace(
            self,
            fines=fines,
            without=frozen(without),
            raised=frozen(raised),
            renewed=int(reached.sum()),
        )

    def _throats_beside(self, position: Array, radius: Array) -> Array:
        """Whether spheres at `position` (N, 3) m of `radius` (N,) m reach into each throat."""
        images = FineImages(self.network, position, radius)
        return np.concatenate([images.reached(part.prisms) for part in self.parts])


def measured_sections(
    network: Network,
    fines: Snapshot,
    *,
    parts: Sequence[Part] | None = None,
    step: float = STEP,
) -> KeptSections:
    """The resistances among `fines`, those of all throats summed; `parts` of the network."""
    parts = tuple(parts_of(network)) if parts is None else parts
    without, raised, _ = fine_resistances(network, fines, parts=parts, step=step)
    return KeptSections(
        network=network,
        parts=parts,
        step=step,
        fines=fines,
        without=frozen(without),
        raised=frozen(raised),
        renewed=len(without),
    )
