"""What a damage law is: a factor on the clean conductance of whichever base law, never above 1."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from fdnet.network.fines.occupancy import Occupancy
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

CLEAN, DEPOSITION, CLOGGING, BLOCKED, KOZENY = (
    "clean",
    "deposition",
    "clogging",
    "blocked",
    "kozeny",
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Damage:
    """`conductance` (T,) m3 with fines, never above the clean one; `law_used` (T,) str: clean, deposition, clogging,
    blocked or kozeny; `counts` of what was capped or closed."""

    conductance: Array
    law_used: Array
    counts: Mapping[str, int]

    __repr__ = one_line


class DamageLaw(Protocol):
    """A damage law: clean conductance (T,) in, Damage out."""

    def __call__(self, network: Network, occupancy: Occupancy, clean: Array) -> Damage: ...
