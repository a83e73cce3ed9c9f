"""Case files: TOML in, a Case out, and every problem named at once."""

import copy
import difflib
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from fdnet.case.case import Case
from fdnet.case.rules import cross_problems
from fdnet.case.values import Part
from fdnet.errors import CaseError


def known_keys(model: type[BaseModel] = Case, prefix: str = "") -> Iterator[str]:
    """Every dotted key a case file may hold."""
    for name, field in model.model_fields.items():
        yield prefix + name
        part = _part_of(field.annotation)
        if part is not None:
            yield from known_keys(part, f"{prefix}{name}.")


def case_from(data: Mapping[str, Any], *, source: str = "case") -> Case:
    """A Case from nested tables.

    Raises CaseError that lists every problem: dotted path, value given, what is allowed, nearest known key.
    """
    problems = _schema_problems(Case, data)
    parts = {
        name: _usable_part(field.annotation, data[name])
        for name, field in Case.model_fields.items()
        if name in data
    }
    named = [problem.split(":")[0] for problem in problems]
    problems += [
        p
        for p in cross_problems(parts)
        if not any(p in q for q in problems) and not any(key in p for key in named)
    ]
    if problems:
        raise CaseError(
            f"{source}: {len(problems)} problem{'s' * (len(problems) > 1)}: "
            + " | ".join(problems)
        )
    return Case.model_validate(data)


def _usable_part(annotation: Any, data: Any) -> Part | None:
    """The part without its bad keys, so that checks between parts still see its good ones; None if hopeless."""
    model = _part_of(annotation)
    if model is None or not isinstance(data, dict):
        return None
    try:
        return model.model_validate(data)
    except ValidationError as error:
        bad = {item["loc"][0] for item in error.errors() if item["loc"]}
    rest = {key: value for key, value in data.items() if key not in bad}
    return model.model_validate(rest) if not _schema_problems(model, rest) else None


def _part_of(annotation: Any) -> type[Part] | None:
    candidates = (annotation, *getattr(annotation, "__args__", ()))
    return next((t for t in candidates if isinstance(t, type) and issubclass(t, Part)), None)


def _schema_problems(model: type[BaseModel], data: Any) -> list[str]:
    try:
        model.model_validate(data)
    except ValidationError as error:
        lines = [_problem(dict(item)) for item in error.errors()]
        return list(dict.fromkeys(lines))
    return []


def _problem(item: dict[str, Any]) -> str:
    path = ".".join(str(part) for part in item["loc"] if not _is_union_tag(part))
    given = item["input"]
    if item["type"] == "extra_forbidden":
        near = difflib.get_close_matches(path, list(known_keys()), n=1, cutoff=0.5)
        hint = f"; did you mean {near[0]}?" if near else ""
        return f"{path}: unknown key (given {given!r}){hint}"
    if item["type"] == "missing":
        return f"{path}: missing, a value is needed"
    message = item["msg"].removeprefix("Value error, ")
    if item["type"] == "value_error":
        return f"{path}: {message}" if path else message
    message = message.replace("Input should be", "should be").replace("a valid tuple", "a list")
    return f"{path}: {given!r} {message}"


def _is_union_tag(part: Any) -> bool:
    return isinstance(part, str) and ("[" in part or part in ("float", "int", "constrained-float"))


def set_keys(data: dict[str, Any], assignments: list[str]) -> dict[str, Any]:
    """`data` with dotted `key=value` assignments put in; values are read as TOML, bare words as text.

    Raises CaseError for a malformed assignment.
    """
    result = copy.deepcopy(data)
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        names = key.strip().split(".")
        if not equals or not all(names):
            raise CaseError(
                f"--set {assignment}: expected key=value with a dotted key, e.g. fines.radius_mm=0.05"
            )
        table = result
        for name in names[:-1]:
            table = table.setdefault(name, {})
            if not isinstance(table, dict):
                raise CaseError(f"--set {assignment}: {name} is a value, not a table")
        table[names[-1]] = _toml_value(text.strip())
    return result


def _toml_value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def read_case(path: Path, *, assignments: list[str] | None = None) -> Case:
    """The case in the TOML file at `path`. Raises CaseError: unreadable file, bad TOML, any invalid parameter."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise CaseError(
            f"{path}: cannot be read as a case file: {error}; give the path of a TOML file"
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise CaseError(f"{path}: not valid TOML: {error}") from error
    return case_from(set_keys(data, assignments or []), source=str(path))
