"""Networks of pores between two planes for the study of solvers, and their exact answer.

Nodes 0 to count - 1 are pores, node `count` is the inlet plane (pressure 1) and node `count` + 1
is the outlet plane (pressure 0).
"""

import decimal
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from fdnet.network.flow.solver import groups
from fdnet.network.laws.named import LAWS
from fdnet.network.network import build_network
from fdnet.spheres.snapshot import Array
from validation.truth import read_pack, tiled

TILE, SHAKE, LAW = "packH_40_eps40", 0.02, "lubrication"
PORES_PER_GRAIN = 6.5
DIGITS = 80


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Circuit:
    """Links between pores and the two planes.

    Attributes:
        ends: (K, 2) nodes that a link joins.
        conductance: (K,) of the links, in any one unit.
        count: number of pores.
    """

    ends: Array
    conductance: Array
    count: int

    def inflow(self, flux: Array) -> float:
        """Flux (from first to second end) out of the inlet plane."""
        return self._out_of(flux, self.count)

    def outflow(self, flux: Array) -> float:
        """Flux into the outlet plane."""
        return -self._out_of(flux, self.count + 1)

    def _out_of(self, flux: Array, node: int) -> float:
        return float(np.sum(flux[self.ends[:, 0] == node]) - np.sum(flux[self.ends[:, 1] == node]))

    def imbalance(self, flux: Array) -> float:
        """Sum over the pores of what flows in without flowing out."""
        net = [
            np.bincount(self.ends[:, side], weights=flux, minlength=self.count + 2)
            for side in (0, 1)
        ]
        return float(np.abs(net[0] - net[1])[: self.count].sum())

    def fluxes(self, pressure: Array) -> Array:
        """Fluxes (K,) for pore pressures (count,)."""
        p = np.concatenate([pressure, [1.0, 0.0]])
        return self.conductance * (p[self.ends[:, 0]] - p[self.ends[:, 1]])


def circuit_of(pores: int, decades: float, seed: int, work: Path) -> Circuit:
    """A circuit of about `pores` pores, periodic across the flow, by the law `lubrication`.

    A pack of the Stokes truth is tiled and each grain moved by up to 2 % of its radius. Each
    conductance is divided by a factor that is log-uniform over `decades`, drawn with `seed`.
    Networks are kept in `work`.
    """
    stored = work / f"network_{pores}.npz"
    if not stored.exists():
        _store(stored, intact_circuit(pores))
    with np.load(stored) as file:
        circuit = Circuit(
            ends=file["ends"], conductance=file["conductance"], count=int(file["count"])
        )
    factor = 10.0 ** np.random.default_rng(seed).uniform(-decades, 0.0, len(circuit.ends))
    return replace(circuit, conductance=circuit.conductance * factor)


def _store(path: Path, circuit: Circuit) -> None:
    part = path.with_suffix(".part.npz")
    np.savez(part, ends=circuit.ends, conductance=circuit.conductance, count=circuit.count)
    part.replace(path)


def intact_circuit(pores: int) -> Circuit:
    """The network of the tiled pack, conductances over their median.

    Pores that no open path joins to a plane are left out.
    """
    pack = read_pack(TILE)
    tiles = pores / PORES_PER_GRAIN / len(pack)
    across = max(round(tiles ** (1.0 / 3.0)), 1)
    times = max(round(tiles / across**2), 1), across, across
    grains = tiled(pack, times, SHAKE, np.random.default_rng(0))
    network = build_network(grains, periodic=(False, True, True), walls="slip")
    x, (low, high) = network.pore_position[:, 0], network.box[0]
    tolerance = 1e-9 * (high - low)
    total = len(x)
    node = np.where(
        x <= low + tolerance, total, np.where(x >= high - tolerance, total + 1, network.pore_group)
    )
    conductance = LAWS[LAW](network) * network.throat_share
    ends = node[network.throat_pores]
    use = (conductance > 0) & (ends[:, 0] != ends[:, 1]) & (ends.min(axis=1) < total)
    ends, conductance = ends[use], conductance[use]
    group = groups(ends, total + 2)
    tied = np.isin(group[:total], group[total:])
    index = np.append(np.cumsum(tied) - 1, [tied.sum(), tied.sum() + 1])
    live = np.isin(group[ends[:, 0]], group[total:])
    return Circuit(
        ends=index[ends[live]],
        conductance=conductance[live] / np.median(conductance),
        count=int(tied.sum()),
    )


def exact_fluxes(circuit: Circuit) -> Array:
    """Fluxes (K,), computed in 80 digits.

    Pores are taken out one by one, the one with the fewest neighbours first. The star of its links
    is replaced by the mesh of conductances g_i g_j / sum(g) (Rosen 1924), which only adds and so
    loses no digits. Then the pores are put back in reverse order, each at the mean of its
    neighbours' pressures.
    """
    with decimal.localcontext(prec=DIGITS):
        mesh: list[dict[int, Decimal]] = [{} for _ in range(circuit.count + 2)]
        given = [Decimal(float(value)) for value in circuit.conductance]
        for (a, b), value in zip(circuit.ends.tolist(), given, strict=True):
            mesh[a][b] = mesh[b][a] = mesh[a].get(b, Decimal(0)) + value
        pressure = [Decimal(0)] * (circuit.count + 2)
        pressure[circuit.count] = Decimal(1)
        for node, star in reversed(_eliminated(mesh, circuit.count)):
            total = sum(star.values(), Decimal(0))
            pressure[node] = (
                sum((g * pressure[other] for other, g in star.items()), Decimal(0)) / total
            )
        ends = circuit.ends.tolist()
        return np.array(
            [float(g * (pressure[a] - pressure[b])) for (a, b), g in zip(ends, given, strict=True)]
        )


def _eliminated(
    mesh: list[dict[int, Decimal]], count: int
) -> list[tuple[int, dict[int, Decimal]]]:
    """Each pore with its neighbours at the time it was taken out."""
    left, order = set(range(count)), []
    while left:
        node = min(left, key=lambda one: len(mesh[one]))
        left.remove(node)
        star = list(mesh[node].items())
        total = sum((g for _, g in star), Decimal(0))
        for at, (a, g) in enumerate(star):
            del mesh[a][node]
            for b, h in star[at + 1 :]:
                mesh[a][b] = mesh[b][a] = mesh[a].get(b, Decimal(0)) + g * h / total
        order.append((node, mesh[node]))
    return order
