"""The laws by the names that a case or the command line gives them."""

from collections.abc import Mapping
from functools import partial

from fdnet.case.names import DEFAULT_LAW
from fdnet.errors import CaseError
from fdnet.network.laws.conductance import (
    Law,
    effective_law,
    lubrication_law,
    thesis_law,
)
from fdnet.network.laws.damage import DamageLaw
from fdnet.network.laws.section_archie import section_archie_damage
from fdnet.network.laws.thesis_damage import CODE_THRESHOLD, TEXT_THRESHOLD, thesis_damage

__all__ = ["DAMAGE_LAWS", "DEFAULT_LAW", "LAWS"]

LAWS: Mapping[str, Law] = {
    "thesis": thesis_law,
    "effective": effective_law,
    "lubrication": lubrication_law,
}
"""Conductance laws of clean throats by name: functions of a network that return (T,) m3.

Examples:
    >>> import fdnet
    >>> sorted(fdnet.LAWS)
    ['effective', 'lubrication', 'thesis']
"""

_THESIS_THRESHOLDS = {"thesis": TEXT_THRESHOLD, "thesis-code": CODE_THRESHOLD}

DAMAGE_LAWS: Mapping[str, DamageLaw] = {
    "thesis": thesis_damage,
    "thesis-code": partial(thesis_damage, clogging_threshold=CODE_THRESHOLD),
    "section-archie": section_archie_damage,
}
"""Damage laws by name: functions that lower the clean conductance (T,) m3 of throats with fines.

Examples:
    >>> import fdnet
    >>> sorted(fdnet.DAMAGE_LAWS)
    ['section-archie', 'thesis', 'thesis-code']
"""


def damage_law(
    name: str, *, clogging_threshold: float | None = None, middle_band: str = "threshold"
) -> DamageLaw:
    """The damage law of this name, made with the options that it has.

    Args:
        name: a key of `DAMAGE_LAWS`.
        clogging_threshold: throat porosity below which the thesis laws take a throat as clogged;
            None for the threshold of the law. Only these two laws have options.
        middle_band: see `thesis_damage`.

    Raises:
        CaseError: the name is unknown.
    """
    if name not in DAMAGE_LAWS:
        raise CaseError(
            f"analysis.damage_law: {name!r} is not known; choose one of {sorted(DAMAGE_LAWS)}"
        )
    if name not in _THESIS_THRESHOLDS:
        return DAMAGE_LAWS[name]
    own = _THESIS_THRESHOLDS[name]
    return partial(
        thesis_damage,
        clogging_threshold=own if clogging_threshold is None else clogging_threshold,
        middle_band=middle_band,
    )
