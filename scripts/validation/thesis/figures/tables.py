"""Tables that some figures are drawn from, made of examined runs and result rows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fdnet.spheres.snapshot import Array, Snapshot
from validation.thesis.numbers.deposition import fines_in_class
from validation.thesis.numbers.examine import Examined
from validation.thesis.numbers.first_millimetre import first_millimetre
from validation.thesis.numbers.results import ResultRow
from validation.thesis.numbers.tetrahedra import count_tetrahedra

POROSITY_CLASSES: Mapping[str, tuple[float, float]] = {
    "below 0.4": (0.0, 0.4),
    "0.4 to 0.6": (0.4, 0.6),
    "above 0.6": (0.6, 1.0),
}
"""Classes of throat porosity in Figures 56 and 57, [low, high)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanRow:
    """One run of a scan.

    Attributes:
        specimen: case that is scanned.
        seed: seed of the run.
        value: value of the quantity that is scanned.
        depth_mean_mm: mean depth of the invaded fines.
        depth_p95_mm: depth above which 95 % of them lie.
        depth_max_mm: depth of the deepest.
        count_first_mm: fines in the first millimetre.
        porosity_loss_first_mm: porosity lost in the first millimetre.
    """

    specimen: str
    seed: int
    value: float
    depth_mean_mm: float
    depth_p95_mm: float
    depth_max_mm: float
    count_first_mm: float = float("nan")
    porosity_loss_first_mm: float = float("nan")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FigureTables:
    """Tables of the figures that show something else than profiles of single runs.

    Attributes:
        drag: runs over the multiplier of the drag.
        friction: runs over the friction of the fines.
        supply: runs over the number of fines supplied, relative to that of the case.
        tetrahedra: by specimen, tetrahedra of all spheres and of the grains alone.
        distances: by class of throat porosity, (K,) distances of fines from the throat's axis
            over the throat's radius.
        growth: a pack after its first and last stage of growth, and at rest.
    """

    drag: Sequence[ScanRow] = ()
    friction: Sequence[ScanRow] = ()
    supply: Sequence[ScanRow] = ()
    tetrahedra: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    distances: Mapping[str, Array] = field(default_factory=dict)
    growth: Sequence[Snapshot] = ()


def tetrahedra_counted(examined: Mapping[str, Sequence[Examined]]) -> dict[str, tuple[int, int]]:
    """Tetrahedra of all spheres and of the grains alone, by specimen, of its first seed."""
    counts = {name: count_tetrahedra(runs[0]) for name, runs in examined.items() if runs}
    return {name: (one.tetrahedra_all, one.tetrahedra_grains) for name, one in counts.items()}


def distances_by_class(runs: Sequence[Examined]) -> dict[str, Array]:
    """Distances (K,) of fines from the throat's axis over its radius, of all runs together.

    The keys are those of POROSITY_CLASSES; the mapping is empty without runs.
    """
    sections = [first_millimetre(run, whole=True) for run in runs]
    return {
        name: np.concatenate([fines_in_class(section, bounds).distance for section in sections])
        for name, bounds in POROSITY_CLASSES.items()
        if sections
    }


def scan_row(specimen: str, value: float, row: ResultRow) -> ScanRow:
    """The row of a scan's figure for a run with `value` of what is scanned."""
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
