"""Methods to solve a network of pores, against 80 digits or against fdnet's own solve.

Nodes 0 to count - 1 of a circuit are pores, node `count` is the inlet plane (pressure 1) and node
`count` + 1 is the outlet plane (pressure 0).
"""

import decimal
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cache
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from fdnet.errors import FlowError
from fdnet.network.flow.flow import TOLERANCE
from fdnet.network.flow.solver import (
    balance_links,
    conjugate_gradients,
    direct,
    groups,
    laplacian,
    ruge_stuben,
)
from fdnet.network.laws.named import LAWS
from fdnet.network.network import build_network
from fdnet.spheres.snapshot import Array, Snapshot, resting
from validation.study import Point, least_time
from validation.truth import read_pack

FDNET, DIRECT, SPSOLVE = "fdnet", "METIS + splu", "spsolve"
RUGE_STUBEN, JACOBI = "CG + Ruge-Stuben", "CG + Jacobi"
MOST_STEPS = {RUGE_STUBEN: 1_000, JACOBI: 20_000}
METHODS = (FDNET, DIRECT, SPSOLVE, *MOST_STEPS)
SMALL = 200
"""Pores up to which the answer is known in 80 digits."""
TILE, SHAKE, LAW, PORES_PER_GRAIN, DIGITS = "packH_40_eps40", 0.02, "lubrication", 6.5, 80


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Circuit:
    """Links between pores and the two planes."""

    ends: Array  # (K, 2) nodes that a link joins
    conductance: Array  # (K,) of the links, in any one unit
    count: int  # number of pores

    def out_of(self, flux: Array, plane: int) -> float:
        """Flux (from first to second end) out of the inlet plane (0) or the outlet plane (1)."""
        node = self.count + plane
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
        return np.asarray(self.conductance * (p[self.ends[:, 0]] - p[self.ends[:, 1]]))


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """Errors of one solve, over the inflow, with their uncertainty: the residual of the answer."""
    method, pores = str(point.settings["method"]), int(point.settings["pores"])
    decades, seed = float(point.settings["decades"]), int(point.seed)
    circuit = circuit_of(pores, decades, seed, work)
    tolerance = 1e-8 if point.value == "own" else float(point.value)
    (flux, steps), seconds = least_time(lambda: solve_by(method, circuit, tolerance))
    inflow = circuit.out_of(flux, 0)
    numbers = {
        "inflow": inflow,
        "residual": circuit.imbalance(flux) / inflow,
        "mass balance": abs(-circuit.out_of(flux, 1) / inflow - 1.0),
        "core_s": seconds,
        "steps": steps,
    }
    known = work / f"fluxes_{pores}_{decades:g}_{seed}.npy"
    if pores > SMALL and method == FDNET:
        np.save(known, flux)
    elif pores <= SMALL or known.exists():
        exact = _exact(pores, decades, seed, work) if pores <= SMALL else np.load(known)
        truth = circuit.out_of(exact, 0)
        numbers["inflow error"] = inflow / truth - 1.0
        numbers["worst throat"] = float(np.abs(flux - exact).max()) / truth
        left = circuit.imbalance(exact) / truth
        numbers |= {"inflow error ±": left, "worst throat ±": left}
    return numbers


@cache
def _exact(pores: int, decades: float, seed: int, work: Path) -> Array:
    return exact_fluxes(circuit_of(pores, decades, seed, work))


# ---- Networks, and their exact answer.
def circuit_of(pores: int, decades: float, seed: int, work: Path) -> Circuit:
    """A circuit of about `pores` pores, periodic across the flow, by the law `lubrication`.

    A pack of the Stokes truth is tiled and each grain moved by up to 2 % of its radius. Each
    conductance is divided by a factor that is log-uniform over `decades`, drawn with `seed`.
    Networks are kept in `work`.
    """
    stored = work / f"network_{pores}.npz"
    if not stored.exists():
        made = intact_circuit(pores)
        part = stored.with_suffix(".part.npz")
        np.savez(part, ends=made.ends, conductance=made.conductance, count=made.count)
        part.replace(stored)
    with np.load(stored) as file:
        circuit = Circuit(
            ends=file["ends"], conductance=file["conductance"], count=int(file["count"])
        )
    factor = 10.0 ** np.random.default_rng(seed).uniform(-decades, 0.0, len(circuit.ends))
    return replace(circuit, conductance=circuit.conductance * factor)


def intact_circuit(pores: int) -> Circuit:
    """The network of the tiled pack, conductances over their median.

    Pores that no open path joins to a plane are left out.
    """
    pack = read_pack(TILE)
    tiles = pores / PORES_PER_GRAIN / len(pack)
    across = max(round(tiles ** (1.0 / 3.0)), 1)
    grains = _tiled(pack, np.array([max(round(tiles / across**2), 1), across, across]))
    network = build_network(grains, periodic=(False, True, True), walls="slip")
    x, (low, high) = network.pore_position[:, 0], network.box[0]
    near, total = 1e-9 * (high - low), len(x)
    node = np.where(
        x <= low + near, total, np.where(x >= high - near, total + 1, network.pore_group)
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


def _tiled(pack: Snapshot, times: Array) -> Snapshot:
    """`times` (3,) copies of a periodic pack, each grain moved by up to `SHAKE` of its radius."""
    size = np.ptp(pack.box, axis=1)
    steps = np.stack(np.meshgrid(*map(np.arange, times), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    position = (pack.position + steps * size).reshape(-1, 3)
    low, size = pack.box[:, 0], times * size
    radius, kind = (np.tile(values, len(steps)) for values in (pack.radius, pack.kind))
    moved = SHAKE * radius[:, None] * np.random.default_rng(0).uniform(-1, 1, position.shape)
    box = np.stack([low, low + size], axis=1)
    return resting(low + (position + moved - low) % size, radius, box, kind)


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
        ends = circuit.ends.tolist()
        for (a, b), value in zip(ends, given, strict=True):
            mesh[a][b] = mesh[b][a] = mesh[a].get(b, Decimal(0)) + value
        pressure = [Decimal(0)] * (circuit.count + 2)
        pressure[circuit.count] = Decimal(1)
        for node, star in reversed(_eliminated(mesh, circuit.count)):
            flow = sum((g * pressure[other] for other, g in star.items()), Decimal(0))
            pressure[node] = flow / sum(star.values(), Decimal(0))
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


# ---- Methods.
def solve_by(method: str, circuit: Circuit, tolerance: float) -> tuple[Array, float]:
    """Fluxes (K,) by one of `METHODS`, and the steps of an iteration (nan of a direct method).

    Iterative methods stop when the norm of the residual is `tolerance` times that of the source.

    Raises FlowError when the steps run out, or when the system is singular.
    """
    if method == FDNET:
        return _own(circuit), np.nan
    matrix, source = _system(circuit)
    steps = np.nan
    if method == DIRECT:
        pressure = direct(matrix)(source, 0.0)
    elif method == SPSOLVE:
        pressure = spsolve(matrix.tocsc(), source)
    else:
        pressure, steps = _iterated(method, matrix, source, tolerance)
    if not np.all(np.isfinite(pressure)):
        raise FlowError(f"{method}: pressures are not finite")
    return circuit.fluxes(pressure), steps


def _own(circuit: Circuit) -> Array:
    """As `solve_flow` does it: both planes are node 0."""
    node = np.where(circuit.ends >= circuit.count, 0, circuit.ends + 1)
    inlet = 1.0 * (circuit.ends == circuit.count)
    balance = balance_links(
        node, circuit.conductance, inlet[:, 0] - inlet[:, 1], circuit.count + 1
    )
    if balance.defect > TOLERANCE:
        raise FlowError(f"fdnet: residual {balance.defect:.2g}, expected <= {TOLERANCE:g}")
    return balance.flux


def _system(circuit: Circuit) -> tuple[sparse.csr_matrix, Array]:
    """Matrix and source of the pores' mass balances, conductances over their median."""
    unit = float(np.median(circuit.conductance))
    tied, source = np.zeros(circuit.count), np.zeros(circuit.count)
    for side in (0, 1):
        own, other = circuit.ends[:, side], circuit.ends[:, 1 - side]
        for plane, sums in ((circuit.count, (tied, source)), (circuit.count + 1, (tied,))):
            next_to = (other == plane) & (own < circuit.count)
            for total in sums:
                np.add.at(total, own[next_to], circuit.conductance[next_to] / unit)
    inner = np.all(circuit.ends < circuit.count, axis=1)
    return laplacian(circuit.ends[inner], circuit.conductance[inner] / unit, tied), source


def _iterated(
    method: str, matrix: sparse.csr_matrix, source: Array, tolerance: float
) -> tuple[Array, float]:
    inverse, steps = 1.0 / matrix.diagonal(), 0
    precondition: Callable[[Array], Array] = (
        (lambda missing: inverse * missing) if method == JACOBI else ruge_stuben(matrix)
    )

    def counted(missing: Array) -> Array:
        nonlocal steps
        steps += 1
        return precondition(missing)

    def norm(values: Array) -> float:
        return float(np.linalg.norm(values))

    most, within = MOST_STEPS[method], tolerance * norm(source)
    pressure = conjugate_gradients(matrix, source, counted, within=within, size=norm, steps=most)
    if np.any(np.isnan(pressure)):
        raise FlowError(
            f"{method}: residual not below {tolerance:g} of the source in {most} steps"
        )
    return pressure, float(steps)
