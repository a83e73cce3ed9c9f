"""What the laws make of the cases: permeability intact and with fines, refits, and the choices within the laws."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.interpolate import CubicSpline
from truth_packs import made_deposit

from fdnet.network import geometry
from fdnet.network.laws.conductance import Law, lubrication_law, series_law
from fdnet.network.laws.lubrication import TIP, WIDENING, half_resistances, summed
from fdnet.network.laws.named import LAWS
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.network.tessellation import delaunay
from fdnet.scales.velocity import carman_kozeny
from fdnet.spheres.snapshot import Array, Kind, Snapshot
from fdnet.studies.network.law_models import (
    PAIRS,
    RESOLVED,
    loss,
    network_of,
    permeability,
    resolved,
)
from fdnet.studies.truth.packs import MM, RADIUS, read_pack, snapshot
from fdnet.studies.truth.truth import EQUAL, UNEQUAL, Case

Row = dict[str, Any]
SAMPSON = (9.0 * np.pi / 16.0) ** 2
WEIGHTS = np.linspace(0.0, 0.7, 8)
LARGE_FINE = {"seed": 408, "intact": "packH_40_eps40", "fine": RADIUS / 3.0}
BED_SHARE = 0.6


def intact_row(case: Case) -> Row:
    """Model over truth of each law."""
    network = network_of(case.pack)
    return head(case) | {
        law: permeability(network, rule(network)) / case.k for law, rule in LAWS.items()
    }


def damaged_row(case: Case) -> Row:
    """k/k0 and k, model over truth, of each pair of laws and of all spheres as grains."""
    network = network_of(case.pack)
    found = loss(case.pack, network)
    whole = resolved(case.pack)
    found[RESOLVED] = whole / found["k0"]["lubrication"], whole
    row = head(case) | {"k_over_k0": case.ratio}
    for name in (*map(" + ".join, PAIRS), RESOLVED):
        row |= {name: found[name][0] / case.ratio, f"{name}: k": found[name][1] / case.k}
    return row


def head(case: Case) -> Row:
    return {
        "case": case.name,
        "group": case.group,
        "grains": len(case.pack.grains()),
        "fines": len(case.pack.fines()),
        "k_true_m2": case.k,
        "truth_error": case.error,
        "known_before": case.known,
    }


def rms(ratios: Array) -> float:
    """Root mean square of ln(model / truth)."""
    return float(np.sqrt(np.mean(np.log(np.asarray(ratios)) ** 2)))


def worst(ratios: Array) -> float:
    """The ratio furthest from 1, by its logarithm."""
    ratios = np.asarray(ratios)
    return float(ratios[np.argmax(np.abs(np.log(ratios)))])


def refitted_series(cases: list[Case]) -> Row:
    """The weight of `series` fitted to random packs of equal grains, one pack (all its axes) left out at a time."""
    cases = [case for case in cases if case.group == EQUAL and case.ratio is None]
    logs = []
    for case in cases:
        network = network_of(case.pack)
        at = [
            permeability(network, series_law(network, weight=float(weight))) / case.k
            for weight in WEIGHTS
        ]
        logs.append(CubicSpline(WEIGHTS, np.log(at)))
    packs = np.array([case.name.split()[0] for case in cases])
    tried = np.linspace(WEIGHTS[0], WEIGHTS[-1], 1401)
    squares = np.array([log(tried) ** 2 for log in logs])
    weights = [tried[np.argmin(squares[packs != pack].sum(axis=0))] for pack in packs]
    held_out = [float(np.exp(log(weight))) for log, weight in zip(logs, weights, strict=True)]
    best = tried[np.argmin(squares.sum(axis=0))]
    fitted = [float(np.exp(log(best))) for log in logs]
    span = float(min(weights)), float(max(weights))
    return {"weight": float(best), "weights": span, "fitted": fitted, "held_out": held_out}


def section_by_area(network: Network) -> Array:
    """Conductance (T,) as `lubrication_law`, each section taken as the round one of its open area."""
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


def choice_rows(
    cases: list[Case], choices: Mapping[str, Callable[[Network], Array]] = CHOICES
) -> list[Row]:
    """Model over truth of variants of the default law, intact."""
    networks = [(case, network_of(case.pack)) for case in cases]
    return [
        {"choice": name}
        | {case.name: permeability(network, law(network)) / case.k for case, network in networks}
        for name, law in choices.items()
    ]


def polydisperse_rows(cases: list[Case]) -> list[Row]:
    """Intact packs of unequal grains: power tessellation, and Delaunay's in its place."""
    rows = []
    for case in cases:
        if case.group != UNEQUAL or case.ratio is not None:
            continue
        for tessellation, spread in (("power", delaunay.EQUAL_SPREAD), ("Delaunay", np.inf)):
            with patch.object(delaunay, "EQUAL_SPREAD", spread):
                network = network_of(case.pack)
            row = head(case) | {"tessellation": tessellation, "pores": len(network.pore_volume)}
            row |= {
                law: permeability(network, rule(network)) / case.k for law, rule in LAWS.items()
            }
            rows.append(row | {"void_negative": network.counts["void_negative"]})
    return rows


def large_fine_rows(folder: Path, points: tuple[float, ...] = (0.04, 0.10, 0.16)) -> list[Row]:
    """k/k0 with fines of 1/3 of a grain, for which there is no Stokes truth; in its place all spheres as grains."""
    rows = []
    for lost in points:
        pack = made_deposit(LARGE_FINE | {"lost": lost}, folder)[0]
        network = network_of(pack)
        found = loss(pack, network)
        row = {
            "points": 100 * lost,
            "fines": len(pack.fines()),
            RESOLVED: resolved(pack) / found["k0"]["lubrication"],
        }
        rows.append(row | {" + ".join(pair): found[" + ".join(pair)][0] for pair in PAIRS})
    return rows


def bed_rows(folder: Path, ratios: tuple[float, ...] = (5.0, 10.0, 20.0, 40.0)) -> list[Row]:
    """Every pore of pack H filled with a random bed of fines of porosity 0.4 (centres uniform in the void, overlaps
    counted twice), beside the same bed as a porous medium: Carman-Kozeny times porosity^1.5 (Bruggeman 1935)."""
    grains, edge = read_pack(folder / "packH_40_eps40.csv")
    network = network_of(grains)
    void = float(np.sum(network.pore_volume))
    rows = []
    for ratio in ratios:
        fine = RADIUS * MM / ratio
        fines = bed(
            grains, edge, RADIUS / ratio, round(BED_SHARE * void / (4.0 / 3.0 * np.pi * fine**3))
        )
        found = loss(grains.joined(fines), network)
        porous = carman_kozeny(1.0 - BED_SHARE, 2.0 * fine) * (void / (edge * MM) ** 3) ** 1.5
        expected = porous / found["k0"]["lubrication"]
        row = {"ratio": ratio, "fines": len(fines), "bed": expected}
        rows.append(row | {" + ".join(pair): found[" + ".join(pair)][0] for pair in PAIRS})
    return rows


def bed(grains: Snapshot, edge: float, fine: float, count: int) -> Snapshot:
    """`count` fines of radius `fine` (mm), centres uniform where no grain is nearer than `fine`."""
    rng = np.random.default_rng(1)
    found = np.zeros((0, 3))
    while len(found) < count:
        place = rng.random((20_000, 3)) * edge
        near = np.full(len(place), np.inf)
        for centre, radius in zip(grains.position / MM, grains.radius / MM, strict=True):
            apart = place - centre
            apart -= edge * np.round(apart / edge)
            near = np.minimum(near, np.linalg.norm(apart, axis=1) - radius)
        found = np.vstack([found, place[near >= fine]])[:count]
    return snapshot(found, np.full(count, fine), edge, np.full(count, Kind.FINE))
