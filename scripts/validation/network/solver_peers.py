"""Methods to solve a network of pores: fdnet's own, its parts one by one, and others."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pyamg
from scipy import sparse
from scipy.sparse.linalg import spsolve

from fdnet.errors import FlowError
from fdnet.network.flow.flow import TOLERANCE
from fdnet.network.flow.solver import (
    balance_links,
    conjugate_gradients,
    direct,
    laplacian,
    ruge_stuben,
)
from fdnet.spheres.snapshot import Array
from validation.network.circuit import Circuit

FDNET, DIRECT, SPSOLVE = "fdnet", "METIS + splu", "spsolve"
FDNET_DIRECT, FDNET_MULTIGRID = "fdnet, direct", "fdnet, multigrid"
RUGE_STUBEN, UNIT_DIAGONAL = "CG + Ruge-Stuben", "CG + Ruge-Stuben, unit diagonal"
JACOBI, AGGREGATION = "CG + Jacobi", "CG + smoothed aggregation"
ITERATIVE = {RUGE_STUBEN: 1_000, UNIT_DIAGONAL: 1_000, AGGREGATION: 1_000, JACOBI: 20_000}
"""The iterative methods and the most steps of each."""
OWN_CHOICES: dict[str, int | None] = {FDNET: None, FDNET_DIRECT: 1_000_000_000, FDNET_MULTIGRID: 0}
"""Pores up to which fdnet solves directly: as it chooses, always, never."""
METHODS = (*OWN_CHOICES, DIRECT, SPSOLVE, *ITERATIVE)

Precondition = Callable[[Array], Array]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Solved:
    """A solved circuit.

    Attributes:
        flux: (K,) of the links, from the first to the second end.
        steps: that an iterative method took; nan for direct methods.
    """

    flux: Array
    steps: float


def solve_by(method: str, circuit: Circuit, tolerance: float) -> Solved:
    """The circuit solved by one of `METHODS`.

    Iterative methods stop when the norm of the residual is `tolerance` times that of the source.

    Raises:
        FlowError: the steps run out, the system is singular, or fdnet's check refuses the result.
    """
    if method in OWN_CHOICES:
        return _own(circuit, OWN_CHOICES[method])
    matrix, source = _system(circuit)
    steps = float("nan")
    if method == DIRECT:
        pressure = direct(matrix)(source, 0.0)
    elif method == SPSOLVE:
        pressure = spsolve(matrix.tocsc(), source)
    else:
        pressure, steps = _iterated(method, matrix, source, tolerance)
    if not np.all(np.isfinite(pressure)):
        raise FlowError(f"{method}: pressures are not finite")
    return Solved(flux=circuit.fluxes(pressure), steps=steps)


def _own(circuit: Circuit, direct_up_to: int | None) -> Solved:
    """As `solve_flow` does it: both planes are node 0."""
    node = np.where(circuit.ends >= circuit.count, 0, circuit.ends + 1)
    jump = 1.0 * (circuit.ends[:, 0] == circuit.count) - 1.0 * (
        circuit.ends[:, 1] == circuit.count
    )
    balance = balance_links(
        node, circuit.conductance, jump, circuit.count + 1, direct_up_to=direct_up_to
    )
    if balance.defect > TOLERANCE:
        raise FlowError(f"fdnet: residual {balance.defect:.2g}, expected <= {TOLERANCE:g}")
    return Solved(flux=balance.flux, steps=float("nan"))


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
    scale = np.ones(len(source))
    if method == UNIT_DIAGONAL:
        scale = 1.0 / np.sqrt(matrix.diagonal())
        matrix = (sparse.diags(scale) @ matrix @ sparse.diags(scale)).tocsr()
    precondition, steps = _preconditioner(method, matrix), 0

    def counted(missing: Array) -> Array:
        nonlocal steps
        steps += 1
        return precondition(missing)

    most, right = ITERATIVE[method], source * scale
    within = tolerance * _norm(right)
    pressure = scale * conjugate_gradients(
        matrix, right, counted, within=within, size=_norm, steps=most
    )
    if np.any(np.isnan(pressure)):
        raise FlowError(
            f"{method}: residual not below {tolerance:g} of the source in {most} steps"
        )
    return pressure, float(steps)


def _norm(values: Array) -> float:
    return float(np.linalg.norm(values))


def _preconditioner(method: str, matrix: sparse.csr_matrix) -> Precondition:
    if method == JACOBI:
        inverse = 1.0 / matrix.diagonal()
        return lambda missing: inverse * missing
    if method == AGGREGATION:
        return pyamg.smoothed_aggregation_solver(matrix).aspreconditioner().matvec
    return ruge_stuben(matrix)
