"""Case files: a case is read from TOML, and all its problems are named at once."""

import copy
import tomllib
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from fdnet.case.added import completed
from fdnet.case.case import Case, case_type
from fdnet.case.keys import nearest, table_of
from fdnet.case.rules import cross_problems
from fdnet.case.sizes import Sizes
from fdnet.case.spoken import plain_tables
from fdnet.case.units import stem_of, suffix_of
from fdnet.case.values import Part
from fdnet.errors import CaseError
from fdnet.files.paths import SMALL, expanded, file_bytes


def case_from(data: Mapping[str, Any], *, source: str = "case", folder: str | Path = ".") -> Case:
    """A case from nested tables; an InvasionCase when there is a table of fines.

    Args:
        data: the tables and keys of a case file. A key carries its unit, `radius_mm` is in mm, or
            its value does, `radius = "0.25 mm"`.
        source: how messages name these tables.
        folder: where files that `data` names are looked for.

    Returns:
        The case, with the default of every key that `data` leaves out.

    Raises:
        CaseError: it lists every problem: dotted key, value given, what is allowed, and for an
            unknown key the nearest known one.

    Examples:
        >>> import fdnet
        >>> tables = fdnet.read_case("cases/quick.toml").data()
        >>> tables["fines"]["radius_mm"] = 0.05
        >>> case = fdnet.case_from(tables)
        >>> isinstance(case, fdnet.InvasionCase), case.fines.radius_mm
        (True, 0.05)
        >>> fdnet.case_from(tables | {"fines": {"radius": 0.05}})
        Traceback (most recent call last):
        ...
        fdnet.errors.CaseError: ...
    """
    model = case_type(data)
    for key in _long_numbers(data):
        raise CaseError(f"{source}: 1 problem: {key}: holds a whole number of more than 18 digits")
    spoken = plain_tables(model, data, Path(folder))
    try:
        case = model.model_validate(spoken.data)
        if not spoken.problems:
            return case
        problems = spoken.problems
    except ValidationError as error:
        problems = [*spoken.problems, *_problems(model, spoken.data, error, spoken.bad)]
    plural = "s" if len(problems) > 1 else ""
    raise CaseError(f"{source}: {len(problems)} problem{plural}: {' | '.join(problems)}")


def sizes_from(table: Mapping[str, Any], *, source: str, folder: Path) -> Sizes:
    """A curve of sizes from the keys of its table; see `case_from`.

    Raises CaseError that lists every problem.
    """
    spoken = plain_tables(Sizes, table, folder)
    problems = list(spoken.problems)
    try:
        if not problems:
            known = Sizes.model_fields
            return Sizes.model_validate({k: v for k, v in spoken.data.items() if k in known})
    except ValidationError as error:
        problems += [_problem(dict(item)).lstrip(": ") for item in error.errors()]
    raise CaseError(f"{source}: the sizes make no curve: {' | '.join(problems)}")


def _long_numbers(value: Any, key: str = "") -> Iterator[str]:
    """Dotted keys of whole numbers that no double or 64-bit number holds."""
    if isinstance(value, Mapping):
        for name, one in value.items():
            yield from _long_numbers(one, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list | tuple):
        for one in value:
            yield from _long_numbers(one, key)
    elif isinstance(value, int) and abs(value) >= 10**18:
        yield key


def _problems(
    model: type[Case], data: Mapping[str, Any], error: ValidationError, refused: Collection[str]
) -> list[str]:
    """The problems of single keys, then those between the keys that are good.

    Keys that were `refused` before are missing from `data`, of which nothing is said again.
    """
    items = [item for item in error.errors() if item["type"] != "value_error"]
    items = [item for item in items if ".".join(map(str, item["loc"][:2])) not in refused]
    bad = {".".join(map(str, item["loc"][:2])) for item in items} | set(refused)
    tables = {name: _good_keys(name, field, data, bad) for name, field in _tables_of(model)}
    return [*dict.fromkeys(_problem(dict(item)) for item in items), *cross_problems(tables, bad)]


def _good_keys(
    name: str, field: FieldInfo, data: Mapping[str, Any], bad: Collection[str]
) -> Part | None:
    """A table without its bad keys; None where it is missing or cannot do without them."""
    if name not in data:
        return None if field.is_required() else field.default
    table, values = table_of(field), data[name]
    if table is None or not isinstance(values, dict):
        return None
    good = {key: value for key, value in values.items() if f"{name}.{key}" not in bad}
    try:
        return table.model_validate(good)
    except ValidationError:
        return None


def _tables_of(model: type[Part]) -> list[tuple[str, FieldInfo]]:
    return [(name, field) for name, field in model.model_fields.items() if table_of(field)]


def _problem(item: dict[str, Any]) -> str:
    path = ".".join(str(part) for part in item["loc"] if not _is_union_tag(part))
    given = item["input"]
    if item["type"] == "extra_forbidden":
        return f"{path}: unknown key (given {given!r}){nearest(path)}"
    if item["type"] == "missing":
        return f"{path}: missing, a value is needed"
    if item["type"] == "size_curve":
        return f"{path}: {item['msg']}"
    message = (
        item["msg"].replace("Input should be", "should be").replace("a valid tuple", "a list")
    )
    key = path.rsplit(".", 1)[-1]
    if isinstance(given, str) and suffix_of(key) and given[:1].isdigit():
        message += f"; a value with its unit goes to {stem_of(key)}"
    return f"{path}: {given!r} {message}"


def _is_union_tag(part: Any) -> bool:
    return isinstance(part, str) and ("[" in part or part in ("float", "int", "constrained-float"))


_LONGEST_WORD = 1000
_MOST_NAMES = 8
"""Most parts of a dotted key; no key of a case has so many."""


def set_keys(data: dict[str, Any], assignments: list[str]) -> dict[str, Any]:
    """`data` with dotted `key=value` assignments put in.

    Values are read as TOML, bare words as text. Raises CaseError for a malformed assignment.
    """
    result = copy.deepcopy(data)
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        names = key.strip().split(".")
        if len(names) > _MOST_NAMES:
            raise CaseError(
                f"--set {assignment[:60]}...: the key has {len(names)} parts, expected at most "
                f"{_MOST_NAMES}, e.g. fines.radius_mm=0.05"
            )
        if not equals or not all(names):
            raise CaseError(
                f"--set {assignment}: expected key=value with a dotted key, "
                "e.g. fines.radius_mm=0.05"
            )
        _put(result, names, _toml_value(text.strip()), f"--set {assignment}")
    return result


def put_keys(data: dict[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """`data` with the `values` of dotted keys put in, as `set_keys` does with texts.

    Raises CaseError where a key lies in something that is no table.
    """
    result = copy.deepcopy(data)
    for key, value in values.items():
        _put(result, key.split("."), value, f"{key} = {value!r}")
    return result


def _put(data: dict[str, Any], names: list[str], value: Any, source: str) -> None:
    """Put one key in; the same key with another unit, or without one, goes away."""
    table = data
    for name in names[:-1]:
        table = table.setdefault(name, {})
        if not isinstance(table, dict):
            raise CaseError(f"{source}: {name} is a value, not a table")
    for other in [name for name in table if stem_of(name) == stem_of(names[-1])]:
        del table[other]
    table[names[-1]] = value


def _toml_value(text: str) -> Any:
    try:
        table = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        table = {"value": text}
        if "\n" in text or len(text) > _LONGEST_WORD:
            table = {}
    if set(table) != {"value"}:
        raise CaseError(f"--set: {text[:60]!r} is not one value; give each key a --set of its own")
    return table["value"]


def read_case(
    path: str | Path,
    *,
    assignments: list[str] | None = None,
    values: Mapping[str, Any] | None = None,
) -> Case:
    """The case in the TOML file at `path`, with dotted `assignments` ("key=value") put in.

    `values` does the same with values by dotted key. Lengths in the file are in mm, as its keys
    say. Raises CaseError when the file cannot be read, is not TOML, or holds an invalid parameter;
    the message lists every problem.

    Examples:
        >>> import fdnet
        >>> case = fdnet.read_case("cases/quick.toml", assignments=["analysis.sections=3"])
        >>> case.analysis.sections
        3
    """
    try:
        data = put_keys(set_keys(_tables(path), assignments or []), values or {})
        return case_from(data, source=str(path), folder=expanded(path).parent)
    except RecursionError as error:
        raise CaseError(f"{path}: its tables or lists are nested too deeply for a case") from error


def recorded_case(path: Path) -> Case:
    """The case that a run folder holds, perhaps of an earlier version (`fdnet.case.added`).

    Raises CaseError as `read_case` does.
    """
    return case_from(completed(_tables(path)), source=str(path), folder=path.parent)


def _tables(path: str | Path) -> dict[str, Any]:
    return toml_tables(path, "a case file")


def toml_tables(path: str | Path, what: str) -> dict[str, Any]:
    """The tables of a TOML file; `what` names it in messages.

    Raises CaseError where it cannot be read or is no TOML.
    """
    data = file_bytes(path, most=SMALL, what=what)
    try:
        return tomllib.loads(data.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise CaseError(f"{path}: cannot be read as {what}: {error}; save it as UTF-8") from error
    except RecursionError as error:
        raise CaseError(f"{path}: its tables or lists are nested too deeply") from error
    except ValueError as error:
        raise CaseError(f"{path}: not valid TOML: {error}") from error
