"""Case files as people write them: values with their units, and curves in files of their own.

A key without the unit in its name takes a text with the unit, `viscosity = "10 cP"`, and stands
for the key with the unit, `viscosity_cP = 10`. A share takes a percentage, `porosity = "38 %"`.
What was given so is kept in the table `given` of the resolved case.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

from fdnet.case.size_file import read_size_file
from fdnet.case.sizes import Sizes
from fdnet.case.units import SUFFIXES, converted, share_of, stem_of, suffix_of
from fdnet.case.values import Part

FILE = "file"
"""Key of a table of sizes that names a file with the curve."""


@dataclass(slots=True)
class Spoken:
    """Nested tables in the keys of the models.

    Attributes:
        data: the tables.
        given: what was written, by dotted key.
        problems: what could not be understood, one sentence each.
        bad: dotted keys, of at most two parts, whose value was refused.
    """

    data: dict[str, Any]
    given: dict[str, str] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    bad: set[str] = field(default_factory=set)

    def refuse(self, key: str, problem: str) -> None:
        """Note a problem with the dotted `key`."""
        self.problems.append(f"{key}: {problem}")
        self.bad.add(".".join(key.split(".")[:2]))


def plain_tables(model: type[Part], data: Mapping[str, Any], folder: Path) -> Spoken:
    """The tables of a case file with every text turned into the number that its key takes.

    `folder` is where files that the case names are looked for.
    """
    spoken = Spoken(data={})
    earlier = data.get("given")
    if isinstance(earlier, Mapping):
        data = {key: value for key, value in data.items() if key != "given"}
    spoken.data = _table(spoken, model, data, path="", folder=folder)
    _drop_bad(spoken)
    if isinstance(earlier, Mapping):
        kept = {str(key): text for key, text in earlier.items() if _holds(key, text, spoken.data)}
        spoken.given = kept | spoken.given
    if spoken.given:
        spoken.data["given"] = spoken.given
    return spoken


def _table(
    spoken: Spoken, model: type[Part], table: Mapping[str, Any], *, path: str, folder: Path
) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key, value in table.items():
        dotted, fields = f"{path}{key}", model.model_fields
        inner = _inner(fields[key].annotation) if key in fields else None
        if inner is not None and isinstance(value, Mapping):
            result[key] = _table(spoken, inner, value, path=f"{dotted}.", folder=folder)
        elif inner is not None and isinstance(value, list) and key == "materials":
            result[key] = [
                _table(spoken, inner, one, path=f"{dotted}.{number}.", folder=folder)
                if isinstance(one, Mapping)
                else one
                for number, one in enumerate(value)
            ]
        elif key in fields:
            result[key] = _percentage(spoken, dotted, key, value)
        elif model is Sizes and key == FILE:
            _put(result, _curve(spoken, dotted, value, table, folder))
        else:
            _put(result, _with_unit(spoken, model, table, key=key, dotted=dotted))
    return result


def _drop_bad(spoken: Spoken) -> None:
    """Take out the keys that were refused, so that nothing else is said of them."""
    for dotted in spoken.bad:
        name, _, key = dotted.partition(".")
        table = spoken.data if not key else spoken.data.get(name)
        if isinstance(table, dict):
            table.pop(key or name, None)


def _put(result: dict[str, Any], more: Mapping[str, Any]) -> None:
    for key, value in more.items():
        result.setdefault(key, value)


def _inner(annotation: Any) -> type[Part] | None:
    """The table that a key holds, one or a list of them; None for a plain value."""
    if isinstance(annotation, type) and issubclass(annotation, Part):
        return annotation
    return next((inner for kind in get_args(annotation) if (inner := _inner(kind))), None)


def _percentage(spoken: Spoken, dotted: str, key: str, value: Any) -> Any:
    """A share as a text with a percent sign; any other value as it is."""
    if not isinstance(value, str) or suffix_of(key) or not value.rstrip().endswith("%"):
        return value
    try:
        share = share_of(value)
    except ValueError as error:
        spoken.refuse(dotted, f"{value!r}: {error}")
        return value
    spoken.given[dotted] = value
    return share


def _with_unit(
    spoken: Spoken, model: type[Part], table: Mapping[str, Any], *, key: str, dotted: str
) -> dict[str, Any]:
    """The key with the unit in its name, for one that leaves the unit to its value."""
    meant = [f"{key}{suffix}" for suffix in SUFFIXES if f"{key}{suffix}" in model.model_fields]
    if len(meant) != 1:
        return {key: table[key]}
    target, value = meant[0], table[key]
    if target in table:
        spoken.refuse(dotted, f"given next to {target}, give one of the two")
        spoken.bad.add(_two_parts(dotted, target))
        return {}
    texts = list(value) if isinstance(value, list | tuple) else [value]
    if not all(isinstance(one, str) for one in texts):
        spoken.refuse(
            dotted, f"{value!r} has no unit; write it with its unit, in quotes, or as {target}"
        )
    else:
        try:
            numbers = [converted(one, suffix_of(target)) for one in texts]
        except ValueError as error:
            spoken.refuse(dotted, f"{value!r}: {error}")
        else:
            spoken.given[dotted] = ", ".join(texts)
            return {target: numbers if isinstance(value, list | tuple) else numbers[0]}
    spoken.bad.add(_two_parts(dotted, target))
    return {}


def _two_parts(dotted: str, target: str) -> str:
    """The key `target` next to `dotted`, by at most its first two parts."""
    return ".".join([*dotted.split(".")[:-1], target][:2])


def _curve(
    spoken: Spoken, dotted: str, value: Any, table: Mapping[str, Any], folder: Path
) -> dict[str, Any]:
    """The points of the file that a table of sizes names."""
    others = [key for key in table if stem_of(key) in ("size", "passing", "D10", "D50", "D90")]
    if not isinstance(value, str):
        spoken.refuse(dotted, f"{value!r} should be the path of a CSV file, in quotes")
    elif others:
        spoken.refuse(dotted, f"given next to {others[0]}, give one of the two")
    else:
        try:
            size, passing = read_size_file(folder, value, by=str(table.get("by", "mass")))
        except ValueError as error:
            spoken.refuse(dotted, str(error))
        else:
            spoken.given[dotted] = value
            return {"size_mm": size, "passing_percent": passing}
    return {}


def _holds(key: Any, text: Any, data: Mapping[str, Any]) -> bool:
    """Whether what was once given still is what the tables hold."""
    *names, last = str(key).split(".")
    table: Any = data
    for name in names:
        if isinstance(table, list) and name.isdecimal():
            table = dict(enumerate(table)).get(int(name[:9]))
        else:
            table = table.get(name) if isinstance(table, Mapping) else None
    if not isinstance(table, Mapping) or not isinstance(text, str):
        return False
    if last == FILE:
        return "size_mm" in table
    try:
        if last in table:
            return bool(table[last] == share_of(text))
        targets = [f"{last}{suffix}" for suffix in SUFFIXES if f"{last}{suffix}" in table]
        numbers = [converted(one, suffix_of(targets[0])) for one in text.split(", ")]
        return table[targets[0]] in (numbers, numbers[0])
    except (ValueError, IndexError):
        return False
