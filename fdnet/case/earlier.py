"""What a case of an earlier version means where it lacks a key of this one.

A run folder and a kept state hold their case with every key written out. A key that they lack came
later, and says nothing new while it has the value of what was done before. So the digests leave it
out then: folders and states made before the key existed keep theirs.
"""

from collections.abc import Mapping
from typing import Any

EARLIER: Mapping[str, Mapping[str, Any]] = {"drag": {"crowd": "none"}}
"""Keys by their table, each with the value that says what was done before it existed."""


def completed(data: Mapping[str, Any]) -> dict[str, Any]:
    """The tables of a recorded case, each with the `EARLIER` keys that it lacks."""
    return dict(data) | {
        name: dict(keys) | data[name] for name, keys in EARLIER.items() if name in data
    }


def without_earlier(data: Mapping[str, Any]) -> dict[str, Any]:
    """The tables of a case without the keys that say what was done before they existed."""
    return dict(data) | {
        name: {key: value for key, value in data[name].items() if keys.get(key, _NONE) != value}
        for name, keys in EARLIER.items()
        if name in data
    }


_NONE = object()
