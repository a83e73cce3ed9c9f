"""Names of the laws and walls that a case, the command line and Python share, and their bounds.

This module imports nothing heavy, so that `fdnet --help` answers at once.
"""

from typing import Literal, get_args

LawName = Literal["thesis", "effective", "hydraulic", "series", "lubrication"]
DamageLawName = Literal[
    "auto", "all-spheres", "thesis", "thesis-code", "kozeny", "side-kozeny", "section-archie"
]
WallName = Literal["no-slip", "slip"]
LAW_NAMES: tuple[LawName, ...] = get_args(LawName)
DAMAGE_LAW_NAMES: tuple[DamageLawName, ...] = get_args(DamageLawName)
WALL_NAMES: tuple[WallName, ...] = get_args(WallName)
DEFAULT_LAW: LawName = "lubrication"
AUTO: DamageLawName = "auto"
"""The damage law of the default: the most accurate that its cost allows."""
ALL_SPHERES: DamageLawName = "all-spheres"
DEFAULT_DAMAGE_LAW: DamageLawName = "side-kozeny"
"""The damage law that "auto" takes for sections whose damage is light."""
SECTION_ARCHIE: DamageLawName = "section-archie"
"""The damage law that it takes for more than `MOST_SPHERES` spheres."""
MOST_SPHERES = 100_000
"""Grains and fines up to which "auto" takes `all-spheres`."""
MOST_SECTIONS = 1000


def law_pairs() -> list[tuple[LawName, DamageLawName]]:
    """All pairs of a conductance law and a damage law that go together.

    `all-spheres` is a network of its own, whose law is `lubrication`.
    """
    two_scale = [name for name in DAMAGE_LAW_NAMES if name not in (AUTO, ALL_SPHERES)]
    pairs = [(law, damage_law) for law in LAW_NAMES for damage_law in two_scale]
    return [*pairs, (DEFAULT_LAW, ALL_SPHERES)]
