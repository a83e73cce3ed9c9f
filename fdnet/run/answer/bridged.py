"""Which throats the fines bridge, and of which sizes those fines are."""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from fdnet.network.analysis import Analysis

CLASSES = 4
"""Classes of throats by their diameter, of equal number."""
BRIDGED_FROM = 0.5
"""Share of its conductance that a throat must have lost to count as bridged."""


def bridged_throats(analysis: "Analysis") -> list[dict[str, Any]]:
    """One row for each class of open throats by diameter, from the narrowest; [] without fines.

    A throat counts as bridged when it lost half its conductance or more, and as blocked when a
    single fine covers its whole section. Diameters are in m; those of the fines are means over
    the fines in each bridged throat, and null where no throat of the class is bridged.
    """
    occupancy = analysis.occupancy
    width = 2.0 * np.asarray(analysis.network.throat_radius)
    clean = np.asarray(analysis.conductance_initial)
    use = (width > 0) & (clean > 0)
    if occupancy is None or not use.any():
        return []
    lost = np.zeros(len(width))
    lost[use] = 1.0 - np.asarray(analysis.conductance_damaged)[use] / clean[use]
    bridged = use & (lost >= BRIDGED_FROM)
    fine = 2.0 * np.asarray(occupancy.throat_fine_radius)
    edges = np.quantile(width[use], np.linspace(0, 1, CLASSES + 1))
    number = np.clip(np.searchsorted(edges, width, side="right") - 1, 0, CLASSES - 1)
    rows = []
    for index in range(CLASSES):
        own = use & (number == index)
        inside = own & bridged & (fine > 0)
        rows.append(
            {
                "throat_from_m": float(edges[index]),
                "throat_to_m": float(edges[index + 1]),
                "throats": int(own.sum()),
                "with_fines": int((own & (np.asarray(occupancy.throat_fines) > 0)).sum()),
                "bridged": int((own & bridged).sum()),
                "blocked": int((own & np.asarray(occupancy.blocked, bool)).sum()),
                **_sizes(fine[inside], width[inside]),
            }
        )
    return rows


def _sizes(fine: Any, width: Any) -> dict[str, float | None]:
    if not len(fine):
        names = ("fines_smallest_m", "fines_median_m", "fines_largest_m", "fine_over_throat")
        return dict.fromkeys(names)
    low, middle, high = (float(q) for q in np.quantile(fine, (0.0, 0.5, 1.0)))
    return {
        "fines_smallest_m": low,
        "fines_median_m": middle,
        "fines_largest_m": high,
        "fine_over_throat": float(np.median(fine / width)),
    }
