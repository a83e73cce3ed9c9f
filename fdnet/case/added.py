"""Keys that cases did not have when their digests were first kept.

A digest names what a result was made from. A new key whose value means "as before" changes no
result, so it must change no digest either: run folders and stored states would be orphaned. They
hold their case with every key written out, so a key that they lack means "as before" too, whatever
its default is now.
"""

from collections.abc import Mapping
from typing import Any

AS_BEFORE: dict[str, Any] = {
    "contact.model": "hooke",
    "contact.restitution": "dry",
    "drag.crowd": "none",
    "drag.inertia": "none",
    "drag.pressure_gradient": False,
    "fluid.darcy_law": "darcy",
}
"""New dotted keys, with the value that means what a case without the key meant. A key that is
absent by default (None) needs no entry: it is not among the data of a case."""


def without_added(
    data: Mapping[str, Any], as_before: Mapping[str, Any] = AS_BEFORE
) -> dict[str, Any]:
    """The tables of a case without the new keys that mean "as before", and without empty tables.

    `data` holds tables of keys, each at most one level deep, as `Case.data` gives them.
    """
    kept: dict[str, Any] = {}
    for name, table in data.items():
        if not isinstance(table, Mapping):
            kept[name] = table
            continue
        keys = {
            key: value
            for key, value in table.items()
            if (dotted := f"{name}.{key}") not in as_before or as_before[dotted] != value
        }
        if keys:
            kept[name] = keys
    return kept


def completed(data: Mapping[str, Any], as_before: Mapping[str, Any] = AS_BEFORE) -> dict[str, Any]:
    """The tables of a recorded case, as `Case.data` gave them once, with the new keys they lack.

    A case without fines gets no table of fines.
    """
    tables = dict(data)
    for dotted, value in as_before.items():
        name, key = dotted.split(".")
        if name in data or name != "fines":
            tables[name] = {key: value} | tables.get(name, {})
    return tables
