"""What a damage law is, and the two of the thesis.

What a damage law is: a factor, never above 1, on the conductance of clean throats.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fdnet.errors import CaseError
from fdnet.network.fines.occupancy import Occupancy
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array, frozen, one_line

CLEAN, DEPOSITION, CLOGGING, BLOCKED, SECTIONS = (
    "clean",
    "deposition",
    "clogging",
    "blocked",
    "sections",
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Damage:
    """Conductance of throats (T) with fines."""

    conductance: Array  # (T,) m3, at most that of the clean throat
    law_used: Array  # (T,) which rule applied: clean, deposition, clogging, blocked or sections
    counts: Mapping[str, int]  # how many throats, pores or sides were capped or closed

    __repr__ = one_line


class DamageLaw(Protocol):
    """A damage law: from a network, its fines and the clean conductance (T,) m3 to a `Damage`.

    What else a law needs is given when it is made (`laws.named.damage_law`).
    """

    def __call__(self, network: Network, occupancy: Occupancy, clean: Array) -> Damage: ...


# ---- The damage law of the thesis: fines line, clog or block the cylinder of a throat (Shi 2011).
TORTUOSITY = 2.5
TEXT_THRESHOLD, CODE_THRESHOLD = 0.40, 0.36
"""Throat porosity below which fines clog: in the text of the thesis, and in its appendix B."""
BAND = (0.36, 0.80)  # Throat porosities between which the places of the fines may decide
UNIFORM_DISTANCE = 2.0 / 3.0
"""Mean distance from the axis, over the radius, of an even spread of fines."""
MIDDLE_BANDS = ("threshold", "position")


def thesis_damage(
    network: Network,
    occupancy: Occupancy,
    clean: Array,
    *,
    clogging_threshold: float = TEXT_THRESHOLD,
    middle_band: str = "threshold",
) -> Damage:
    """Two-scale rule by the throat porosity phi in the inscribed cylinder (Shi 2011, 3.2.4).

    - Without fines the throat stays clean. Where one fine covers a whole section it is blocked.
    - phi at or above `clogging_threshold`: surface deposition. The fines narrow the radius r to
      r sqrt(phi), so the conductance is multiplied by phi^2.
    - phi below: clogging. The fines of mean diameter D make a bed of Carman-Kozeny permeability
      k = phi^3 D^2 / (72 * 2.5 (1 - phi)^2) over the section of the cylinder. A factor above 1 is
      capped and counted.

    On another conductance law the same factor applies. A throat of inscribed radius 0 is closed in
    every law.

    Args:
        network: pores and throats.
        occupancy: what the fines fill of them.
        clean: (T,) m3, conductance without fines.
        clogging_threshold: 0.40 in the text of the thesis, 0.36 in its appendix B.
        middle_band: "threshold", or "position": between 0.36 and 0.80 deposition where the mean
            distance of the fines from the axis is at least 2/3 of the radius, which is that of an
            even spread, else clogging.

    Raises:
        CaseError: an option is unknown or out of range.
    """
    _check_options(clogging_threshold, middle_band)
    porosity = occupancy.throat_porosity
    lines_wall = (
        porosity >= clogging_threshold
        if middle_band == "threshold"
        else _lines_the_wall(occupancy)
    )
    law = np.where(lines_wall, DEPOSITION, CLOGGING).astype("<U10")
    law[occupancy.throat_fines == 0] = CLEAN
    law[occupancy.blocked] = BLOCKED
    factor = np.select(
        [law == CLEAN, law == BLOCKED, law == DEPOSITION],
        [1.0, 0.0, porosity**2],
        _clogged_factor(network, occupancy),
    )
    counts = {
        "capped": int(np.sum(factor > 1.0)),
        "throats_filled": int(np.sum((porosity <= 0) & (law == CLOGGING))),
    }
    return Damage(
        conductance=frozen(clean * np.minimum(factor, 1.0)), law_used=frozen(law), counts=counts
    )


def _check_options(clogging_threshold: float, middle_band: str) -> None:
    """Raise CaseError on an unknown middle band and on a threshold outside 0 to 1."""
    if middle_band not in MIDDLE_BANDS:
        raise CaseError(
            f"analysis.middle_band: {middle_band!r} is not known; choose one of {MIDDLE_BANDS}"
        )
    if not 0.0 <= clogging_threshold <= 1.0:
        raise CaseError(
            f"analysis.clogging_threshold: {clogging_threshold} is outside 0 to 1; "
            "give the throat porosity below which fines clog a throat"
        )


def _clogged_factor(network: Network, occupancy: Occupancy) -> Array:
    """Factor (T,) of a clogged throat: 8 k / r^2, Carman-Kozeny over Hagen-Poiseuille."""
    porosity = np.clip(occupancy.throat_porosity, 0.0, None)
    filled = 1.0 - porosity
    use = (filled > 0) & (network.throat_radius > 0)
    size = 2.0 * occupancy.throat_fine_radius
    with np.errstate(divide="ignore", invalid="ignore"):
        k = porosity**3 * size**2 / (72.0 * TORTUOSITY * filled**2)
        return np.where(use, 8.0 * k / network.throat_radius**2, 1.0)


def _lines_the_wall(occupancy: Occupancy) -> Array:
    """True (T,) where the fines line the wall, by porosity and mean distance from the axis."""
    count = len(occupancy.throat_porosity)
    distance = np.bincount(occupancy.pair_throat, weights=occupancy.pair_distance, minlength=count)
    mean = distance / np.maximum(occupancy.throat_fines, 1)
    porosity = occupancy.throat_porosity
    return (porosity >= BAND[1]) | ((porosity >= BAND[0]) & (mean >= UNIFORM_DISTANCE))
