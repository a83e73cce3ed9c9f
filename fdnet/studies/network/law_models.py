"""What the laws make of a periodic pack: k, and with fines the share of it that is left."""

from typing import Any

from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.slabs import whole_permeability
from fdnet.network.laws.conductance import lubrication_law
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS
from fdnet.network.network import Network, build_network
from fdnet.spheres.snapshot import Array, Snapshot
from fdnet.studies.truth.truth import all_grains

PERIODIC = (True, True, True)
RESOLVED = "all spheres as grains"
RESOLVED_LIMIT = 2000
PAIRS = (
    ("thesis", "thesis"),
    ("thesis", "thesis-code"),
    ("lubrication", "kozeny"),
    ("lubrication", "side-kozeny"),
)


def network_of(pack: Snapshot) -> Network:
    return build_network(pack.grains(), periodic=PERIODIC)


def permeability(network: Network, conductance: Array) -> float:
    """k (m2) of a network with `conductance` (T,) m3."""
    return whole_permeability(network, conductance)[0]


def resolved(pack: Snapshot) -> float:
    """k (m2) with grains and fines tessellated alike, law `lubrication`; NaN above RESOLVED_LIMIT spheres."""
    if len(pack) > RESOLVED_LIMIT:
        return float("nan")
    network = network_of(all_grains(pack))
    return permeability(network, lubrication_law(network))


def loss(pack: Snapshot, network: Network) -> dict[str, Any]:
    """k/k0 and k (m2) of each of PAIRS by name, and k0 (m2) by law under the name k0."""
    occupancy = measure_occupancy(network, pack.fines())
    clean = {law: LAWS[law](network) for law in dict(PAIRS)}
    k0 = {law: permeability(network, conductance) for law, conductance in clean.items()}
    found: dict[str, Any] = {"k0": k0}
    for law, damage_law in PAIRS:
        k = permeability(
            network, DAMAGE_LAWS[damage_law](network, occupancy, clean[law]).conductance
        )
        found[f"{law} + {damage_law}"] = k / k0[law], k
    return found
