"""The laws on slabs of deposits that LIGGGHTS made: one row for each slab, model over truth."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.names import ALL_SPHERES, AUTO
from fdnet.network.flow.sections import Section
from fdnet.network.flow.slabs import whole_permeability
from fdnet.network.laws.named import DEFAULT_LAW
from fdnet.network.network import build_network
from fdnet.network.permeability import compare
from fdnet.network.resolved.all_spheres import all_conductances
from fdnet.network.resolved.slab import cut_out
from fdnet.spheres.snapshot import Array, Snapshot
from fdnet.studies.accuracy.goals import percent, ratio, summary
from fdnet.studies.accuracy.measurement import LOCAL, PAIRS, SIDE_KOZENY
from fdnet.studies.engine.csv_rows import read_named
from fdnet.studies.engine.markdown import markdown_table
from fdnet.studies.truth.packs import MM
from fdnet.studies.truth.slabs import SLAB_TRUTH, read_specimen

Row = dict[str, Any]
FINEST, CHOSEN = f"{DEFAULT_LAW} + {ALL_SPHERES}", f"{DEFAULT_LAW} + {AUTO}"
"""The network of all spheres, and what the default of runs and commands chooses."""
SLAB_PAIRS = (*PAIRS, LOCAL, FINEST, CHOSEN)
"""The pairs of laws that are compared on slabs."""
ALONE = "network of all spheres: k"
"""k by that network, model over truth, also where resolved flow knows it better."""
CARRYING = "carrying_throats"
"""Number of throats of that network that carry the flow."""
SOLVED = "k_damaged_resolved"
"""Whether the default takes k with fines from resolved flow."""


def slab_rows(folder: Path, known: Iterable[str], names: Sequence[str] = SLAB_PAIRS) -> list[Row]:
    """Model over truth of k/k0 and of k on every slab whose `known_before` is among `known`.

    The slabs are sections of their specimens, cut out with the pressure held on both planes.

    Args:
        folder: of the specimens and of the table of their truth.
        known: "yes" and "no", or one of them.
        names: pairs of laws, as in `SLAB_PAIRS`.
    """
    wanted = set(known)
    return [
        _row(line, read_specimen(folder / line["file"]), names)
        for line in read_named(folder / SLAB_TRUTH)
        if line["known_before"] in wanted
    ]


def _row(line: dict[str, str], spheres: Snapshot, names: Sequence[str]) -> Row:
    planes = np.array([float(line["x_lo_mm"]), float(line["x_hi_mm"])]) * MM
    truth = {name: float(line[f"{name}_mm2"]) * MM**2 for name in ("k0", "k")}
    row: Row = {
        "case": line["slab"],
        "grains": len(spheres.grains()),
        "fines": int(np.count_nonzero(_inside(spheres.fines(), planes))),
        "k_true_m2": truth["k"],
        "truth_error": float(line["relative_error"].rstrip("%")) / 100.0,
        "known_before": line["known_before"],
        "k_over_k0": float(line["k_over_k0"]),
    }
    for name, section in zip(names, _cut_out(spheres, planes, names), strict=True):
        row |= {
            name: section.k_damaged / section.k_initial / row["k_over_k0"],
            f"{name}: k0": section.k_initial / truth["k0"],
            f"{name}: k": section.k_damaged / truth["k"],
        }
        if name == CHOSEN:
            row[SOLVED] = int(section.k_damaged_resolved)
    network = build_network(
        cut_out(spheres, (planes[0], planes[1]), (False, True, True)), periodic="yz"
    )
    k, flow = whole_permeability(network, all_conductances(network))
    return row | {ALONE: k / truth["k"], CARRYING: flow.carrying_throats}


def _inside(spheres: Snapshot, planes: Array) -> Array:
    """Whose bodies (N,) reach between the planes."""
    x, r = spheres.position[:, 0], spheres.radius
    return (x + r > planes[0]) & (x - r < planes[1])


def _cut_out(spheres: Snapshot, planes: Array, names: Sequence[str]) -> Iterator[Section]:
    """The section between the planes by each pair of laws."""
    edges = np.unique([*spheres.box[0], *planes]).tolist()
    pairs = [(law, damage_law) for law, damage_law in (name.split(" + ") for name in names)]
    for result in compare(spheres, periodic="yz", sections=edges, laws=pairs):
        yield next(s for s in result.sections if s.x_lo == planes[0])


def slab_summary(rows: list[Row], names: Sequence[str] = SLAB_PAIRS) -> str:
    """Model over truth of k0 by the default law, and of k/k0 by each pair of laws."""
    intact = f"{SIDE_KOZENY if SIDE_KOZENY in names else names[0]}: k0"
    lines = [
        [
            row["case"],
            str(row["fines"]),
            ratio(row["k_over_k0"], 4),
            percent(row["truth_error"]),
            ratio(row[intact]),
            *(ratio(row[name]) for name in names),
            f"{row[CARRYING]:.0f}{' *' * int(row.get(SOLVED, 0))}",
            row["known_before"],
        ]
        for row in rows
    ]
    ends = [summary(rows, name) for name in (intact, *names)]
    lines.append(["**rms of ln, worst**", "", "", "", *ends, "", ""])
    header = ["slab", "fines", "true k/k0", "its error"]
    return markdown_table([*header, "k0", *names, "throats", "looked at before"], lines)
