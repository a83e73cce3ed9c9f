"""Names of the laws and walls that a case, the command line and Python share, and their bounds.

This module imports nothing heavy, so that `fdnet --help` answers at once.
"""

from typing import Literal, get_args

LawName = Literal["thesis", "effective", "hydraulic", "series", "lubrication"]
DamageLawName = Literal["thesis", "thesis-code", "kozeny", "side-kozeny"]
WallName = Literal["no-slip", "slip"]
LAW_NAMES: tuple[LawName, ...] = get_args(LawName)
DAMAGE_LAW_NAMES: tuple[DamageLawName, ...] = get_args(DamageLawName)
WALL_NAMES: tuple[WallName, ...] = get_args(WallName)
DEFAULT_LAW: LawName = "lubrication"
DEFAULT_DAMAGE_LAW: DamageLawName = "side-kozeny"
MOST_SECTIONS = 1000
