"""Conductance of throats with fines: laws side by side, by name."""

from functools import partial

from fdnet.network.damage_law import CLEAN, Damage, DamageLaw
from fdnet.network.kozeny_damage import kozeny_damage, side_kozeny_damage
from fdnet.network.thesis_damage import CODE_THRESHOLD, thesis_damage

__all__ = ["CLEAN", "DAMAGE_LAWS", "DEFAULT_DAMAGE_LAW", "Damage"]

DAMAGE_LAWS: dict[str, DamageLaw] = {
    "thesis": thesis_damage,
    "thesis-code": partial(thesis_damage, default_threshold=CODE_THRESHOLD),
    "kozeny": kozeny_damage,
    "side-kozeny": side_kozeny_damage,
}
DEFAULT_DAMAGE_LAW = "side-kozeny"
