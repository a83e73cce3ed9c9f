"""The laws by the names that a case or the command line gives them."""

from collections.abc import Mapping
from functools import partial

from fdnet.case.names import DEFAULT_DAMAGE_LAW, DEFAULT_LAW
from fdnet.network.laws.conductance import (
    Law,
    effective_law,
    hydraulic_law,
    lubrication_law,
    series_law,
    thesis_law,
)
from fdnet.network.laws.damage import DamageLaw
from fdnet.network.laws.kozeny_damage import kozeny_damage, side_kozeny_damage
from fdnet.network.laws.thesis_damage import CODE_THRESHOLD, thesis_damage

__all__ = ["DAMAGE_LAWS", "DEFAULT_DAMAGE_LAW", "DEFAULT_LAW", "LAWS"]

LAWS: Mapping[str, Law] = {
    "thesis": thesis_law,
    "effective": effective_law,
    "hydraulic": hydraulic_law,
    "series": series_law,
    "lubrication": lubrication_law,
}
"""Conductance laws of clean throats, each a function of a Network that returns (T,) m3."""

DAMAGE_LAWS: Mapping[str, DamageLaw] = {
    "thesis": thesis_damage,
    "thesis-code": partial(thesis_damage, default_threshold=CODE_THRESHOLD),
    "kozeny": kozeny_damage,
    "side-kozeny": side_kozeny_damage,
}
"""Laws that lower the clean conductance of throats with fines."""
