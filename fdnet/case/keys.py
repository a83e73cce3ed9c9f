"""The keys of a case file, and the one that an unknown key means."""

import difflib
import re
from collections.abc import Iterator
from typing import Any, get_args

from pydantic.fields import FieldInfo

from fdnet.case.case import InvasionCase
from fdnet.case.units import stem_of
from fdnet.case.values import Part

_DIAMETER = re.compile(r"[dD]_?\d\d")


def known_keys(model: type[Part] = InvasionCase, prefix: str = "") -> Iterator[str]:
    """Every dotted key that a case file may hold."""
    for name, field in model.model_fields.items():
        yield prefix + name
        table = table_of(field)
        for inner in [table] if table is not None else _inner_tables(field.annotation):
            yield from known_keys(inner, f"{prefix}{name}.")


def table_of(field: FieldInfo) -> type[Part] | None:
    """The class of a table's keys, also where the table may be absent; None for a plain key."""
    for kind in (field.annotation, *get_args(field.annotation)):
        if isinstance(kind, type) and issubclass(kind, Part):
            return kind
    return None


def _inner_tables(annotation: Any) -> Iterator[type[Part]]:
    """The tables that a key may hold, one or a list of them."""
    for kind in get_args(annotation):
        if isinstance(kind, type) and issubclass(kind, Part):
            yield kind
        else:
            yield from _inner_tables(kind)


REMOVED_KEYS = {"clean_up.lift_cake": "the cake is always lifted, remove the key"}
"""Keys that are gone, and what to do without each."""


def nearest(path: str) -> str:
    """The known key that is nearest to an unknown one, in words; empty where none is near."""
    table, _, key = path.rpartition(".")
    if path in REMOVED_KEYS:
        return f"; {REMOVED_KEYS[path]}"
    if table in ("grains", "fines") and _DIAMETER.match(key):
        return f'; did you mean {table}.sizes = {{ D10 = "20 um", D50 = "40 um", ... }}?'
    here = [one for one in known_keys() if one.rpartition(".")[0] == table]
    stems = {one: stem_of(one.rpartition(".")[2]) for one in here}
    same = [one for one in here if stems[one] == stem_of(key)]
    near = same or _near(key, here) or _named_alike(key) or _near(key, list(known_keys()))
    return f"; did you mean {near[0]}?" if near else ""


def _near(key: str, keys: list[str]) -> list[str]:
    """The key of nearly the same spelling; tables and units count for nothing."""
    stems = {stem_of(one.rpartition(".")[2]): one for one in reversed(keys)}
    return [stems[one] for one in difflib.get_close_matches(stem_of(key), stems, n=1, cutoff=0.65)]


def _named_alike(key: str) -> list[str]:
    """A key of another table with the same name."""
    return [one for one in known_keys() if stem_of(one.rpartition(".")[2]) == stem_of(key)]
