"""How the slab of fines is cut into batches, and when each of them enters.

With `fines.supply` = "batches" the slab is cut across the flow. A batch enters the simulation at
the start of a chunk, where the fluid would have carried it by then. The length of a batch is what
the suspension moves in a chunk of time t against a cake that grows towards it, to a thickness
h = c (u t + h) / phi with the concentration c, the velocity u and phi = `LOOSEST_CAKE`. So no cake
overtakes a batch as long as one more batch is present than needed.

Where the deposit slows the mud down (`Drag.slowed`), the distance that the mud has moved takes the
place of u t. A batch enters at the start of the chunk in which the mud will have moved far enough.
Its fines are drawn then, at the mud's velocity, where the mud would have carried them and clear of
all fines that are there: those move with the mud only in the mean.
"""

import math
from dataclasses import dataclass

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.size_classes import CLEARANCE
from fdnet.scales.scales import InvasionScales

LOOSEST_CAKE = 0.5
"""Volume fraction of the loosest cake that batches leave room for. Random loose packing has 0.55
(Onoda & Liniger 1990)."""
AT_ONCE = 2
"""Batches present from the start: the one that arrives in the first chunk, and the next."""
ROUNDING = 1e-9
"""Share of a chunk's travel that rounding may take from the distance of the mud."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Batches:
    """How a slab is cut.

    Attributes:
        counts: number of fines in each batch.
        length: m, of each batch along the flow.
        travel: m, that the suspension moves in a chunk.
    """

    counts: tuple[int, ...]
    length: float
    travel: float

    @property
    def reach(self) -> float:
        """Largest distance, m, of a fine to the slab's end when it enters undisturbed mud."""
        later = max(0, len(self.counts) - AT_ONCE)
        return min(AT_ONCE, len(self.counts)) * self.length + later * (self.length - self.travel)

    def entered_at(self, chunk: int) -> int:
        """Batches that are in the simulation in a chunk (numbered from 1) of undisturbed mud."""
        return min(len(self.counts), chunk + AT_ONCE - 1)

    def entered_after(self, distance: float) -> int:
        """Batches that are in the simulation once the mud has moved by a `distance`, m."""
        return self.entered_at(1 + math.floor(distance / self.travel + ROUNDING))

    def entered_with(self, fines: int) -> int:
        """The smallest number of batches that hold so many `fines`, and at least the first ones.

        They are all batches where not even these hold so many.
        """
        totals = np.cumsum(self.counts)
        needed = int(np.searchsorted(totals, fines)) + 1
        return min(len(totals), max(needed, self.entered_at(1)))

    def distance_of(self, number: int) -> float:
        """Distance m by which undisturbed mud has moved when batch `number` (from 0) enters."""
        return max(0, number + 1 - AT_ONCE) * self.travel

    def supplied(self, entered: int) -> int:
        """Fines in the first batches, `entered` of them."""
        return sum(self.counts[:entered])


def batches_of(case: InvasionCase, scales: InvasionScales) -> Batches:
    """The batches of a case: of equal length, with the slab's fines shared out evenly.

    A slab that is fed at once is one batch, and so is one of so few fines that some batch would be
    empty. No batch is thinner than a fine, so that each must clear only the one next to it.
    """
    travel = scales.upstream_velocity * scales.checkpoint_steps * scales.time_step
    apart = 1.01 * CLEARANCE * 2 * case.fines.radius_range_m[1]
    length = max(travel / (1 - case.fines.placed_fraction / LOOSEST_CAKE), apart)
    whole = Batches(counts=(scales.supplied_count,), length=scales.slab_length, travel=travel)
    if case.fines.supply == "slab" or scales.slab_length <= AT_ONCE * length:
        return whole
    number = math.ceil(scales.slab_length / length - 1e-9)
    share = np.minimum(np.arange(1, number + 1) * length / scales.slab_length, 1.0)
    counts = np.diff(np.round(share * scales.supplied_count).astype(int), prepend=0)
    if not counts.all():
        return whole
    return Batches(counts=tuple(int(count) for count in counts), length=length, travel=travel)
