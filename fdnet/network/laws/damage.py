"""What a damage law is: a factor, never above 1, on the conductance of clean throats."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from fdnet.network.fines.occupancy import Occupancy
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

CLEAN, DEPOSITION, CLOGGING, BLOCKED, SECTIONS = (
    "clean",
    "deposition",
    "clogging",
    "blocked",
    "sections",
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Damage:
    """Conductance of throats (T) with fines.

    Attributes:
        conductance: (T,) m3, at most that of the clean throat.
        law_used: (T,) which rule applied: clean, deposition, clogging, blocked or sections.
        counts: how many throats, pores or sides were capped or closed.
    """

    conductance: Array
    law_used: Array
    counts: Mapping[str, int]

    __repr__ = one_line


class DamageLaw(Protocol):
    """A damage law: from a network, its fines and the clean conductance (T,) m3 to a `Damage`.

    What else a law needs is given when it is made (`laws.named.damage_law`).
    """

    def __call__(self, network: Network, occupancy: Occupancy, clean: Array) -> Damage: ...
