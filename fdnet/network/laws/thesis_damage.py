"""The thesis's damage law: surface deposition, clogging and blocking of the throat's cylinder (Shi 2011, 3.2.4)."""

import numpy as np

from fdnet.errors import CaseError
from fdnet.network.fines.occupancy import Occupancy
from fdnet.network.laws.damage import BLOCKED, CLEAN, CLOGGING, DEPOSITION, Damage
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array, frozen

TORTUOSITY = 2.5
TEXT_THRESHOLD, CODE_THRESHOLD = 0.40, 0.36
BAND = (0.36, 0.80)
UNIFORM_DISTANCE = 2.0 / 3.0
MIDDLE_BANDS = ("threshold", "position")


def thesis_damage(
    network: Network,
    occupancy: Occupancy,
    clean: Array,
    *,
    clogging_threshold: float = TEXT_THRESHOLD,
    middle_band: str = "threshold",
) -> Damage:
    """Two-scale rule of Shi 2011, section 3.2.4, on the throat porosity phi in the inscribed cylinder.

    No fines: clean. A fine covers a section: 0. phi at or above `clogging_threshold` (0.40 in the text, 0.36 in appendix B):
    surface deposition, factor phi^2 (r_e = r_i sqrt(phi)). Below: clogging, Carman-Kozeny
    k = phi^3 D^2 / (72 * 2.5 (1 - phi)^2) over the cylinder's section; a factor above 1 is capped and counted.
    `middle_band` "position": between 0.36 and 0.80 deposition where the fines' mean distance from the axis is at
    least 2/3 of the radius (what an even spread has), else clogging. On another base law the same factor applies;
    a throat of inscribed radius 0 is closed in every law. Raises CaseError on values out of range.
    """
    if middle_band not in MIDDLE_BANDS:
        raise CaseError(
            f"analysis.middle_band: {middle_band!r} is not known; choose one of {MIDDLE_BANDS}"
        )
    if not 0.0 <= clogging_threshold <= 1.0:
        raise CaseError(
            f"analysis.clogging_threshold: {clogging_threshold} is outside 0 to 1; "
            "give the throat porosity below which fines clog a throat"
        )
    porosity = occupancy.throat_porosity
    deposits = (
        porosity >= clogging_threshold
        if middle_band == "threshold"
        else _lines_the_wall(occupancy)
    )
    kozeny = _clogged_factor(network, occupancy)
    law = np.where(deposits, DEPOSITION, CLOGGING).astype("<U10")
    law[occupancy.throat_fines == 0] = CLEAN
    law[occupancy.blocked] = BLOCKED
    factor = np.select(
        [law == CLEAN, law == BLOCKED, law == DEPOSITION], [1.0, 0.0, porosity**2], kozeny
    )
    counts = {
        "capped": int(np.sum(factor > 1.0)),
        "throats_filled": int(np.sum((porosity <= 0) & (law == CLOGGING))),
    }
    return Damage(
        conductance=frozen(clean * np.minimum(factor, 1.0)), law_used=frozen(law), counts=counts
    )


def _clogged_factor(network: Network, occupancy: Occupancy) -> Array:
    """Carman-Kozeny conductance of the filled cylinder over Hagen-Poiseuille of the clean one: 8 k / r^2."""
    porosity = np.clip(occupancy.throat_porosity, 0.0, None)
    filled = 1.0 - porosity
    use = (filled > 0) & (network.throat_radius > 0)
    size = 2.0 * occupancy.throat_fine_radius
    with np.errstate(divide="ignore", invalid="ignore"):
        k = porosity**3 * size**2 / (72.0 * TORTUOSITY * filled**2)
        return np.where(use, 8.0 * k / network.throat_radius**2, 1.0)


def _lines_the_wall(occupancy: Occupancy) -> Array:
    count = len(occupancy.throat_porosity)
    distance = np.bincount(occupancy.pair_throat, weights=occupancy.pair_distance, minlength=count)
    mean = distance / np.maximum(occupancy.throat_fines, 1)
    porosity = occupancy.throat_porosity
    return (porosity >= BAND[1]) | ((porosity >= BAND[0]) & (mean >= UNIFORM_DISTANCE))
