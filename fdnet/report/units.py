"""Numbers and words for a reader, each written in one way in text, pages and notebooks."""

from typing import Any

from fdnet.case.fluid import M2_PER_MD

MILLIDARCY = M2_PER_MD
"""One millidarcy in m2: a darcy is 1 cP cm/s under 1 atm/cm (API RP 27, 1952)."""


def millidarcy(permeability: float) -> float:
    """Permeability in m2 as mD."""
    return permeability / MILLIDARCY


def in_millidarcy(permeability: Any) -> str:
    """Permeability in m2 as mD with four digits and without a unit; a dash for None or NaN."""
    if permeability is None or permeability != permeability:
        return "–"
    value = float(f"{millidarcy(permeability):.4g}")
    return f"{value:,.10g}" if value == 0 or abs(value) >= 1e-3 else f"{value:.3e}"


def percent(share: float | None) -> str:
    """A share in percent with one digit and without a sign of percent; a dash for None."""
    return "–" if share is None else f"{100 * share:z.1f}"


def two_digits(share: float) -> str:
    """A share in percent with two digits and the sign of percent."""
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"


def millimetres(length: float | None) -> str:
    """A length in m as mm with three digits and the unit; a dash for None."""
    return "–" if length is None else f"{1e3 * length:.3g} mm"


SHOWS = {
    "bridges": "holds the fines: the face plugged",
    "passes": "lets the fines pass",
    "undecided": "ended before one could see whether the sand holds the fines",
}
"""What the sand did with the fines, by `run_shows` of the summary: "The run ..."."""
AGREES = {True: "agrees", False: "disagrees", None: "not decided"}
"""Whether a rule of thumb and the run say the same."""
