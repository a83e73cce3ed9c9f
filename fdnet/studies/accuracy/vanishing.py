"""One fine that shrinks: by the network of all spheres it must change k less and less, to nothing.

A grid of resolved flow cannot show this, but the answer is known: without the fine, k is that of
the grains.
"""

from pathlib import Path
from typing import Any

import numpy as np

from fdnet.spheres.snapshot import Array, Kind, Snapshot
from fdnet.studies.accuracy.measurement import resolved
from fdnet.studies.truth.packs import MM, read_pack, snapshot

Row = dict[str, Any]
PLACES = "packH_r5_d1"
"""The pack whose fines say where on the grains the fine is put."""
RATIOS = (0.2, 0.1, 0.05, 0.02, 0.005)
"""Radii of the fine over that of a grain."""


def vanishing_rows(folder: Path, ratios: tuple[float, ...] = RATIOS, every: int = 1) -> list[Row]:
    """k with one fine over k without, less 1: mean, least and most over the places, by `ratios`.

    `every` takes only each so many-th place. The fine touches the grain nearest to the place.
    """
    pack, edge = read_pack(folder / f"{PLACES}.csv")
    grains, places = pack.grains(), pack.fines().position[::every]
    k0 = resolved(grains)
    rows = []
    for ratio in ratios:
        changes = [
            resolved(grains.joined(_touching(grains, place, ratio, edge))) / k0 - 1.0
            for place in places
        ]
        ends = {"mean": np.mean(changes), "least": min(changes), "most": max(changes)}
        rows.append({"ratio": ratio, "places": len(places)} | ends)
    return rows


def _touching(grains: Snapshot, place: Array, ratio: float, edge: float) -> Snapshot:
    """A fine on the grain nearest to `place` (3,) m, in its direction; `edge` mm of the cube."""
    size = edge * MM
    away = place - grains.position
    away -= size * np.round(away / size)
    apart = np.linalg.norm(away, axis=1)
    nearest = int(np.argmin(apart - grains.radius))
    radius = ratio * grains.radius[nearest]
    reach = grains.radius[nearest] + radius
    centre = grains.position[nearest] + away[nearest] / apart[nearest] * reach
    inside = np.mod(centre, size)[None] / MM
    return snapshot(inside, np.array([radius / MM]), edge, np.array([Kind.FINE]))
