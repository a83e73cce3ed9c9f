"""Names of the laws and walls that a case, the command line and Python share, and their bounds.

This module imports nothing heavy, so that `fdnet --help` answers at once.
"""

from typing import Literal, get_args

LawName = Literal["thesis", "effective", "lubrication"]
DamageLawName = Literal["auto", "all-spheres", "section-archie", "thesis", "thesis-code"]
WallName = Literal["no-slip", "slip"]
LAW_NAMES: tuple[LawName, ...] = get_args(LawName)
DAMAGE_LAW_NAMES: tuple[DamageLawName, ...] = get_args(DamageLawName)
WALL_NAMES: tuple[WallName, ...] = get_args(WallName)
DEFAULT_LAW: LawName = "lubrication"
AUTO: DamageLawName = "auto"
"""The damage law of the default: the most accurate that its cost allows."""
ALL_SPHERES: DamageLawName = "all-spheres"
"""The damage law that "auto" takes for up to `MOST_SPHERES` spheres; it needs `DEFAULT_LAW`."""
FLOW_LAW = "by section-archie with the standing fines"
"""The law of the permeability that a flow that follows its deposit meets."""
SECTION_ARCHIE: DamageLawName = "section-archie"
"""The damage law that "auto" takes for more of them, and with other conductance laws."""
SIZE_CLASSES = "size-classes"
"""The law of the fast model (`invasion.method` = "network"): of the filled share of each pore."""
MOST_SPHERES = 300_000
"""Grains and fines up to which "auto" takes `all-spheres`.

So many take 260 s of one core and 2.1 GB in eight sections
(docs/validation/benchmark_spheres.csv).
"""
THESIS_LAWS = ("thesis", "thesis-code")
"""Laws that are off by factors (docs/evidence/accuracy.md): kept to compare with the thesis."""
MOST_SECTIONS = 1000
REMOVED_LAWS = {
    "hydraulic": DEFAULT_LAW,
    "series": DEFAULT_LAW,
    "combined": AUTO,
    "upscaled": ALL_SPHERES,
    "kozeny": SECTION_ARCHIE,
    "side-kozeny": SECTION_ARCHIE,
}
"""Laws that are gone, and the more accurate one to take in the place of each."""


def off_by_factors(law: str, damage_law: str, *, fines: bool) -> bool:
    """Whether a permeability by these laws, with or without fines, is wrong by factors."""
    return law in THESIS_LAWS or (fines and damage_law in THESIS_LAWS)


def law_pairs() -> list[tuple[LawName, DamageLawName]]:
    """All pairs of a conductance law and a damage law that go together."""
    two_scale = [name for name in DAMAGE_LAW_NAMES if name not in (AUTO, ALL_SPHERES)]
    pairs = [(law, damage_law) for law in LAW_NAMES for damage_law in two_scale]
    return [*pairs, (DEFAULT_LAW, ALL_SPHERES)]


# ---- The stages of a run, in order.
Stage = Literal["pack", "invade", "clean_up", "analyse", "report"]
STAGES: tuple[Stage, ...] = get_args(Stage)
LIGGGHTS_STAGES = STAGES[:3]  # The stages that LIGGGHTS carries out, each in a folder of its name
