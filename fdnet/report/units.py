"""Permeability in the units of the field: millidarcy, next to square metres."""

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
