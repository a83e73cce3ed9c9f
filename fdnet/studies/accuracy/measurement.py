"""What the laws make of a periodic pack: the one place that measures laws against Stokes truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fdnet.case.names import COMBINED, SECTION_ARCHIE, UPSCALED
from fdnet.network.fines.occupancy import Occupancy, measure_occupancy
from fdnet.network.flow.slabs import whole_permeability
from fdnet.network.laws.named import DAMAGE_LAWS, DEFAULT_DAMAGE_LAW, DEFAULT_LAW, LAWS
from fdnet.network.network import Network, build_network
from fdnet.network.resolved.all_spheres import all_conductances
from fdnet.network.resolved.combined import combined
from fdnet.network.upscaling.upscaled import upscaled_damage
from fdnet.spheres.snapshot import Array, Snapshot

PERIODIC = (True, True, True)
SIDE_KOZENY = f"{DEFAULT_LAW} + {DEFAULT_DAMAGE_LAW}"
PAIRS = (
    "thesis + thesis",
    "thesis + thesis-code",
    "lubrication + kozeny",
    "lubrication + side-kozeny",
    "lubrication + section-archie",
)
"""The pairs of a conductance law and a damage law that are compared."""
RESOLVED = "all spheres as grains"
"""The network of grains and fines alike, at the scale of the fines; it has no damage law."""
ARCHIE, MEAN = f"{DEFAULT_LAW} + {SECTION_ARCHIE}", f"{DEFAULT_LAW} + {COMBINED}"
"""The pair of laws whose mean with `RESOLVED` is `combined`, and that mean."""
LOCAL = f"{DEFAULT_LAW} + {UPSCALED}"
"""The damage law of throats between grains that solves parts of that network."""
RESOLVED_LIMIT = 20_000
"""Spheres above which that network is left out."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Loss:
    """Permeabilities of one pack before and after its fines.

    Attributes:
        intact: m2, without the fines, by conductance law.
        damaged: m2, with the fines, by pair of laws or `RESOLVED`.
    """

    intact: Mapping[str, float]
    damaged: Mapping[str, float]

    def ratio(self, name: str) -> float:
        """k/k0 of a pair of laws or of `RESOLVED`."""
        return self.damaged[name] / self.intact[law_of(name)]


def network_of(pack: Snapshot) -> Network:
    """The network of the grains of a periodic pack."""
    return build_network(pack.grains(), periodic=PERIODIC, walls="slip")


def permeability(network: Network, conductance: Array) -> float:
    """k (m2) along x of a network with `conductance` (T,) m3."""
    return whole_permeability(network, conductance)[0]


def law_of(name: str) -> str:
    """The conductance law of a pair of laws; of `RESOLVED` the default one."""
    return DEFAULT_LAW if name == RESOLVED else name.split(" + ", maxsplit=1)[0]


def by_law(network: Network, law: str) -> float:
    """k (m2) of the grains by a conductance law."""
    return permeability(network, LAWS[law](network))


def by_pair(network: Network, occupancy: Occupancy, pair: str) -> float:
    """k (m2) with fines by a pair of laws."""
    law, damage_law = pair.split(" + ")
    damaged = DAMAGE_LAWS[damage_law](network, occupancy, LAWS[law](network))
    return permeability(network, damaged.conductance)


def resolved(pack: Snapshot) -> float:
    """k (m2) by the network of all spheres that runs take; nan above `RESOLVED_LIMIT` spheres."""
    if len(pack) > RESOLVED_LIMIT:
        return float("nan")
    network = build_network(pack, periodic=PERIODIC, walls="slip")
    return permeability(network, all_conductances(network))


def local(pack: Snapshot, network: Network) -> float:
    """k (m2) by `LOCAL`; nan above `RESOLVED_LIMIT` spheres."""
    if len(pack) > RESOLVED_LIMIT:
        return float("nan")
    damage = upscaled_damage(network, pack, LAWS[DEFAULT_LAW](network))
    return permeability(network, damage.conductance)


def mean_of(intact: float, whole: float, archie: float) -> float:
    """k with fines by `MEAN`, from k without fines, by `RESOLVED` and by `ARCHIE`, in one unit."""
    parts = (np.array([min(k, intact)]) for k in (whole, archie))
    return float(combined(np.array([intact]), *parts)[0])


def measure_loss(
    pack: Snapshot, network: Network, *, pairs: Sequence[str] = PAIRS, whole: bool = True
) -> Loss:
    """Permeabilities of a pack by `pairs` of laws, and by `LOCAL` and `RESOLVED` if `whole`."""
    occupancy = measure_occupancy(network, pack.fines())
    damaged = {pair: by_pair(network, occupancy, pair) for pair in pairs}
    if whole:
        damaged |= {LOCAL: local(pack, network), RESOLVED: resolved(pack)}
    return Loss(
        intact={law: by_law(network, law) for law in dict.fromkeys(map(law_of, pairs))},
        damaged=damaged,
    )
