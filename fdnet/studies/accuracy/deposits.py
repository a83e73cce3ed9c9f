"""Deposits beyond the range of the truth: fines of a third of a grain, and pores full of fines."""

from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.names import SECTION_ARCHIE
from fdnet.scales.darcy import carman_kozeny
from fdnet.spheres.snapshot import Kind, Snapshot
from fdnet.studies.accuracy.measurement import PAIRS, measure_loss, network_of
from fdnet.studies.accuracy.rows import RULES
from fdnet.studies.truth.made_packs import made_deposit
from fdnet.studies.truth.packs import MM, RADIUS, read_pack, snapshot

Row = dict[str, Any]
INTACT = "packH_40_eps40"
"""The pack that holds all of these deposits."""
LARGE_FINE = {"seed": 408, "intact": INTACT, "fine": RADIUS / 3.0}
BED_PAIRS = tuple(pair for pair in PAIRS if not pair.endswith(SECTION_ARCHIE))
"""The pairs of laws that go by volume. The bed counts overlaps twice; sections see them once."""
BED_SHARE = 0.6
"""Share of every void that the bed of fines takes."""


def large_fine_rows(folder: Path, points: tuple[float, ...] = (0.04, 0.10, 0.16)) -> list[Row]:
    """k/k0 of all `RULES` with fines of a third of a grain that take `points` of the porosity."""
    rows = []
    for lost in points:
        pack = made_deposit(LARGE_FINE | {"lost": lost}, folder)[0]
        loss = measure_loss(pack, network_of(pack))
        row = {"points": 100 * lost, "fines": len(pack.fines())}
        rows.append(row | {name: loss.ratio(name) for name in RULES})
    return rows


def bed_rows(folder: Path, ratios: tuple[float, ...] = (5.0, 10.0, 20.0, 40.0)) -> list[Row]:
    """k/k0 with every pore full of a random bed of fines, by `BED_PAIRS` and as a porous medium.

    Centres are uniform in the void, overlaps are counted twice, and the bed has porosity 0.4. As
    a porous medium ("bed") it has the permeability of Carman and Kozeny times the porosity of the
    pack to the power of 1.5 (Bruggeman 1935). `ratios`: radius of a grain over that of a fine.
    """
    grains, edge = read_pack(folder / f"{INTACT}.csv")
    network = network_of(grains)
    void = float(np.sum(network.pore_volume))
    rows = []
    for ratio in ratios:
        fine = RADIUS * MM / ratio
        count = round(BED_SHARE * void / (4.0 / 3.0 * np.pi * fine**3))
        fines = bed(grains, edge, RADIUS / ratio, count)
        loss = measure_loss(grains.joined(fines), network, pairs=BED_PAIRS, whole=False)
        porous = carman_kozeny(1.0 - BED_SHARE, 2.0 * fine) * (void / (edge * MM) ** 3) ** 1.5
        row = {
            "ratio": ratio,
            "fines": len(fines),
            "pores": len(network.pore_volume),
            "bed": porous / loss.intact["lubrication"],
        }
        rows.append(row | {name: loss.ratio(name) for name in BED_PAIRS})
    return rows


def bed(grains: Snapshot, edge: float, fine: float, count: int) -> Snapshot:
    """`count` fines of radius `fine` (mm) with centres uniform in the void of the periodic cube.

    No grain lies nearer to a centre than `fine`; `edge` of the cube in mm.
    """
    rng = np.random.default_rng(1)
    centres = np.zeros((0, 3))
    while len(centres) < count:
        place = rng.random((20_000, 3)) * edge
        near = np.full(len(place), np.inf)
        for centre, radius in zip(grains.position / MM, grains.radius / MM, strict=True):
            apart = place - centre
            apart -= edge * np.round(apart / edge)
            near = np.minimum(near, np.linalg.norm(apart, axis=1) - radius)
        centres = np.vstack([centres, place[near >= fine]])[:count]
    return snapshot(centres, np.full(count, fine), edge, np.full(count, Kind.FINE))
