"""Stokes truth of slabs: each finished grid is a row, and a slab's grids give its permeability."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import hypot
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from fdnet.network.stokes import StokesFlow, extrapolate, solve_slab
from fdnet.spheres.geometry import measure_porosity
from fdnet.spheres.snapshot import Snapshot
from validation.engine.csv_rows import read_named, write_named
from validation.engine.markdown import markdown_table
from validation.truth.grids import flow_of
from validation.truth.made_slabs import SLABS
from validation.truth.packs import MM
from validation.truth.slabs import SLAB_GRIDS, SLAB_TRUTH, read_specimen
from validation.truth.specimens import SPECIMENS

GRAINS, DEPOSIT = "grains", "deposit"
TOLERANCE = 5e-4
"""Of the solves: k ends 2.2e-4 too high (docs/stokes.md)."""
SAFETY = 2.0
"""Error over the largest change of k when one of three grids is left out."""
GRIDS = (
    "slab",
    "solid",
    "cells",
    "k_mm2",
    "iterations",
    "slip",
    "unknowns",
    "seconds",
)
TRUTH = (
    "slab",
    "file",
    "x_lo_mm",
    "x_hi_mm",
    "k0_mm2",
    "k0_error",
    "k_mm2",
    "k_over_k0",
    "relative_error",
    "order",
    "known_before",
    "grids",
)


def solve_slabs(names: Sequence[str], folder: Path, cells: Sequence[int] = ()) -> None:
    """Solves slabs (all of them if `names` is empty) without and with their fines, grid by grid.

    A finished grid is a row of the grids in `folder` and is not solved again; the table of the
    truth is written anew after every grid.

    Args:
        names: of `SLABS`.
        folder: of the specimens' files and of both tables.
        cells: on the longest edge, one number for each grid; those of the slab if empty.
    """
    for slab in (SLABS[name] for name in names or SLABS):
        spheres = read_specimen(folder / f"{slab.specimen}.csv")
        for solid, pack in ((GRAINS, spheres.grains()), (DEPOSIT, spheres)):
            for count in cells or slab.cells:
                rows = _rows(folder / SLAB_GRIDS)
                key = {"slab": slab.name, "solid": solid, "cells": str(count)}
                if any(key.items() <= row.items() for row in rows):
                    continue
                flow = solve_slab(
                    pack,
                    (slab.x_lo_mm * MM, slab.x_hi_mm * MM),
                    cells=count,
                    tolerance=TOLERANCE,
                )
                new = key | {
                    "k_mm2": f"{flow.k / MM**2:.7e}",
                    "iterations": str(flow.iterations),
                    "slip": f"{flow.residual:.2e}",
                    "unknowns": str(flow.unknowns),
                    "seconds": f"{flow.seconds:.1f}",
                }
                print(slab.name, solid, count, f"{flow.seconds:.1f} s", flush=True)
                write_named(folder / SLAB_GRIDS, [*rows, new], columns=GRIDS)
                write_named(folder / SLAB_TRUTH, tabulated([*rows, new]), columns=TRUTH)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """A permeability at zero spacing, from two grids or more.

    Attributes:
        k_mm2: where k0 + C h^2, fitted to the three finest grids by least squares, meets h = 0,
            mm2. On two grids it is Richardson's extrapolation.
        relative_error: `SAFETY` times the largest change of k when one of the three grids is left
            out, and at least twice the tolerance of the solves; with two grids, a third of the
            step of the extrapolation.
        order: of convergence as seen on the three grids; None where they show none.
    """

    k_mm2: float
    relative_error: float
    order: float | None


def limit(flows: Sequence[StokesFlow]) -> Limit:
    """The permeability at zero spacing from grids (two or more) of one cell, k in mm2."""
    grids = sorted(flows, key=lambda flow: flow.cells)[-3:]
    if len(grids) < 3:
        end = extrapolate(*grids)
        return Limit(k_mm2=end.k, relative_error=end.error, order=None)
    squares, k = [flow.cells**-2.0 for flow in grids], [flow.k for flow in grids]
    best = float(np.polyfit(squares, k, 1)[1])
    change = max(abs(extrapolate(*pair).k - best) for pair in combinations(grids, 2))
    error = max(SAFETY * change / best, 2.0 * TOLERANCE)
    return Limit(k_mm2=best, relative_error=error, order=_order(grids))


def _order(grids: Sequence[StokesFlow]) -> float | None:
    """The order p with which k = k0 + C h^p passes through three grids, between 0.1 and 8."""
    k, h = [flow.k for flow in grids], [1.0 / flow.cells for flow in grids]

    def excess(p: float) -> float:
        return (k[0] - k[1]) * (h[1] ** p - h[2] ** p) - (k[1] - k[2]) * (h[0] ** p - h[1] ** p)

    return float(brentq(excess, 0.1, 8.0)) if excess(0.1) * excess(8.0) < 0.0 else None


def tabulated(rows: Sequence[dict[str, str]]) -> list[dict[str, str]]:
    """The truth of the slabs with two grids or more of both solids, in the order of `SLABS`."""
    table = []
    for slab in SLABS.values():
        grids = {
            solid: [
                flow_of(row) for row in rows if (row["slab"], row["solid"]) == (slab.name, solid)
            ]
            for solid in (GRAINS, DEPOSIT)
        }
        if min(map(len, grids.values())) < 2:
            continue
        intact, damaged = limit(grids[GRAINS]), limit(grids[DEPOSIT])
        error = hypot(intact.relative_error, damaged.relative_error)
        table.append(
            {
                "slab": slab.name,
                "file": f"{slab.specimen}.csv",
                "x_lo_mm": f"{slab.x_lo_mm:g}",
                "x_hi_mm": f"{slab.x_hi_mm:g}",
                "k0_mm2": f"{intact.k_mm2:.5g}",
                "k0_error": f"{100 * intact.relative_error:.2g}%",
                "k_mm2": f"{damaged.k_mm2:.5g}",
                "k_over_k0": f"{damaged.k_mm2 / intact.k_mm2:.4g}",
                "relative_error": f"{100 * error:.2g}%",
                "order": f"{damaged.order:.2f}" if damaged.order else "",
                "known_before": slab.known_before,
                "grids": "+".join(map(str, sorted(flow.cells for flow in grids[DEPOSIT]))),
            }
        )
    return table


def _rows(path: Path) -> list[dict[str, str]]:
    return read_named(path) if path.exists() else []


def slab_table(folder: Path) -> str:
    """What the slabs are and how exact their truth is, in Markdown, from the files in `folder`."""
    lines = []
    for row in read_named(folder / SLAB_TRUTH):
        spheres = read_specimen(folder / row["file"])
        porosity = measure_porosity(spheres.grains(), periodic=(False, True, True)).mean
        low, high = float(row["x_lo_mm"]), float(row["x_hi_mm"])
        lines.append(
            [
                row["slab"],
                _radii(spheres.fines()),
                _radii(spheres.grains()),
                f"{SPECIMENS[SLABS[row['slab']].specimen].friction:g}",
                f"{porosity:.3f}",
                str(_centred(spheres, low, high)),
                str(_centred(spheres, -float("inf"), 0.0)),
                f"{low:g} to {high:g}",
                row["relative_error"],
                row["order"],
                row["grids"],
                row["known_before"],
            ]
        )
    header = ["slab", "fines, mm", "grains, mm", "friction", "porosity", "fines in the slab"]
    header += ["fines upstream", "slab, mm", "error of k/k0", "order", "cells", "known before"]
    return markdown_table(header, lines)


def _radii(spheres: Snapshot) -> str:
    least, most = spheres.radius.min() / MM, spheres.radius.max() / MM
    return f"{least:.3g}" if most - least < 1e-6 else f"{least:.3g} to {most:.3g}"


def _centred(spheres: Snapshot, low: float, high: float) -> int:
    """Fines with their centres between two depths, mm."""
    x = spheres.fines().position[:, 0] / MM
    return int(((x >= low) & (x < high)).sum())
