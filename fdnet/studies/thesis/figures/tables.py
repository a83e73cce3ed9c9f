"""The tables that figures of other things than profiles are drawn from, out of what is examined and its results."""

from collections.abc import Mapping, Sequence

import numpy as np

from fdnet.spheres.snapshot import Array
from fdnet.studies.thesis.figures.canvas import DISTANCE_CLASSES, ScanRow
from fdnet.studies.thesis.figures.thesis_marks import CLASS_BOUNDS
from fdnet.studies.thesis.numbers.counts import count_tetrahedra
from fdnet.studies.thesis.numbers.deposition import fines_in_class
from fdnet.studies.thesis.numbers.examine import Examined
from fdnet.studies.thesis.numbers.first_section import first_section
from fdnet.studies.thesis.numbers.results import ResultRow


def tetrahedra_counted(examined: Mapping[str, Sequence[Examined]]) -> dict[str, tuple[int, int]]:
    """By specimen, of its first seed: tetrahedra with all spheres, and with the grains alone."""
    counts = {name: count_tetrahedra(runs[0]) for name, runs in examined.items() if runs}
    return {name: (one.tetrahedra_all, one.tetrahedra_grains) for name, one in counts.items()}


def distances_found(runs: Sequence[Examined]) -> dict[str, Array]:
    """By class of throat porosity: distances (K,) of fines from the axis over the radius, of all seeds together."""
    sections = [first_section(run, whole=True) for run in runs]
    return {
        name: np.concatenate([fines_in_class(section, bounds).distance for section in sections])
        for name, bounds in zip(DISTANCE_CLASSES, CLASS_BOUNDS, strict=True)
        if sections
    }


def scan_row(specimen: str, value: float, row: ResultRow) -> ScanRow:
    """A run of a scan as its figure shows it: `value` of what is scanned, and its results (any pair of laws)."""
    return ScanRow(
        specimen=specimen,
        seed=row.seed,
        value=value,
        depth_mean_mm=row.mean_depth_mm,
        depth_p95_mm=row.invasion_depth_p95_mm,
        depth_max_mm=row.invasion_depth_mm,
        count_first_mm=row.count_first_mm,
        porosity_loss_first_mm=row.porosity_loss_first_mm,
    )
