"""Which keys of two cases differ, in words."""

from collections.abc import Iterator, Mapping
from typing import Any

from fdnet.case.case import POLICIES, Case

MOST_NAMED = 4
"""Most differing keys that a message names."""


def differences(asked: Case, kept: Mapping[str, Any]) -> list[str]:
    """The dotted keys in which a case differs from the tables of another, with both values.

    Keys that decide only whether a run may go on are left out, and what was given in words.
    """
    mine, other = dict(_flat(asked.data())), dict(_flat(kept))
    return [
        f"{key} = {_shown(other, key)} there, {_shown(mine, key)} here"
        for key in sorted(mine.keys() | other.keys())
        if mine.get(key) != other.get(key)
        and not key.startswith("given.")
        and key not in [f"run.{policy}" for policy in POLICIES]
    ]


def difference_text(asked: Case, kept: Mapping[str, Any]) -> str:
    """`differences` as the part of a message; empty where nothing differs."""
    named = differences(asked, kept)
    if not named:
        return ""
    more = f", and {len(named) - MOST_NAMED} more keys" if len(named) > MOST_NAMED else ""
    return "; ".join(named[:MOST_NAMED]) + more


def _flat(tables: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tables.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def _shown(flat: Mapping[str, Any], key: str) -> str:
    return str(flat[key])[:40] if key in flat else "absent"
