"""What the choices within the laws are worth: the fitted weight of `series`, and those of
`lubrication`, which has nothing to fit."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from fdnet.network import geometry
from fdnet.network.laws.conductance import Law, lubrication_law, series_law
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.open_sections import TIP
from fdnet.network.laws.tube import WIDENING, summed
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.spheres.snapshot import Array
from fdnet.studies.accuracy.measurement import network_of, permeability
from fdnet.studies.truth.cases import EQUAL, Case

Row = dict[str, Any]
SAMPSON = (9.0 * np.pi / 16.0) ** 2
"""Factor on the widening that would give the flow through an orifice (Sampson 1891)."""
WEIGHTS = np.linspace(0.0, 0.7, 8)
"""Weights of `series` at which the permeability is computed; between them it is interpolated."""
TRIED = 1401
"""Weights that the fit compares."""


def refitted_series(cases: list[Case]) -> list[Row]:
    """`series` with its weight fitted to the random packs of equal grains, one row a case.

    A row holds model over truth with the weight fitted to all packs ("weight", "fitted"), and
    with the weight fitted without the case's own pack, all its axes ("weight_without",
    "held_out").
    """
    cases = [case for case in cases if case.group == EQUAL and case.ratio is None]
    logs = [_log_ratio(case) for case in cases]
    packs = np.array([case.name.split()[0] for case in cases])
    tried = np.linspace(WEIGHTS[0], WEIGHTS[-1], TRIED)
    squares = np.array([log(tried) ** 2 for log in logs])
    best = float(tried[np.argmin(squares.sum(axis=0))])
    rows = []
    for case, log, pack in zip(cases, logs, packs, strict=True):
        without = float(tried[np.argmin(squares[packs != pack].sum(axis=0))])
        rows.append(
            {
                "case": case.name,
                "weight": best,
                "fitted": float(np.exp(log(best))),
                "weight_without": without,
                "held_out": float(np.exp(log(without))),
            }
        )
    return rows


def _log_ratio(case: Case) -> CubicSpline:
    """ln(model / truth) of `series` as a function of its weight."""
    network = network_of(case.pack)
    at = [
        permeability(network, series_law(network, weight=float(weight))) / case.k
        for weight in WEIGHTS
    ]
    return CubicSpline(WEIGHTS, np.log(at))


def section_by_area(network: Network) -> Array:
    """Conductance (T,) as `lubrication_law`, each section replaced by a round one of its area."""
    low = -network.throat_heights[:, 0]
    step = (
        np.maximum(network.throat_heights.sum(axis=1), LENGTH_FLOOR * network.grain_radius) / 16.0
    )
    narrow = []
    for k in range(17):
        flat = network.throat_corner_radius**2 - (low + k * step)[:, None] ** 2
        disc = np.sqrt(np.maximum(flat, (TIP * network.throat_corner_radius) ** 2))
        area = np.maximum(
            geometry.open_area(network.throat_corner, disc), 1e-12 * network.grain_radius**2
        )
        narrow.append(np.sqrt(np.pi / area))
    sections = zip(np.stack(narrow, axis=1), step, strict=True)
    resistance = [
        (4.0 * summed(a, dz, 1, WIDENING) - summed(a, dz, 2, WIDENING)) / 3.0 for a, dz in sections
    ]
    return np.where(network.throat_radius > 0, 1.0 / np.array(resistance), 0.0)


def widened(factor: float) -> Law:
    """`lubrication_law` with another factor on the widening."""
    return lambda network: 1.0 / half_resistances(network, widening=factor).sum(axis=1)


CHOICES: Mapping[str, Law] = {
    "as it is: exact sections, widening 8/3 (second order)": lubrication_law,
    "widening (9π/16)² = 3.12 (Sampson's orifice)": widened(SAMPSON),
    "widening 0 (plain lubrication)": widened(0.0),
    "sections round, of the open area": section_by_area,
}
"""Variants of the default law."""


def choice_rows(
    cases: list[Case], choices: Mapping[str, Callable[[Network], Array]] = CHOICES
) -> list[Row]:
    """k, model over truth, of variants of the default law on packs without fines."""
    networks = [(case, network_of(case.pack)) for case in cases]
    return [
        {"choice": name}
        | {case.name: permeability(network, law(network)) / case.k for case, network in networks}
        for name, law in choices.items()
    ]
