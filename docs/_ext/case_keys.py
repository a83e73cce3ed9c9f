"""The keys of a case file as rows of a table, made from the models themselves."""

import ast
import inspect
import textwrap
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

UNITS = {
    "_GPa_m": "GPa/m",
    "_kg_m3": "kg/m³",
    "_J_m3": "J/m³",
    "_percent": "%",
    "_um": "µm",
    "_m_s2": "m/s²",
    "_N_m": "N/m",
    "_m_s": "m/s",
    "_GPa": "GPa",
    "_MPa": "MPa",
    "_cP": "cP",
    "_mD": "mD",
    "_mm": "mm",
    "_ms": "ms",
    "_hours": "h",
    "_s": "s",
    "_m": "m",
}
"""End of a key and the unit it stands for; the longer ends first."""
SPACE = "\N{NO-BREAK SPACE}"


def key_rows(part: str) -> Iterator[tuple[str, ...]]:
    """Key, unit, default, range and meaning, in Markdown, of every key of the table `part`.

    A dotted `part` is a table inside another, such as grains.sizes.
    """
    from fdnet.case.case import InvasionCase

    model: type[BaseModel] = InvasionCase
    for name in part.split(".") if part else ():
        inner = part_model(model.model_fields[name].annotation)
        assert inner is not None, part
        model = inner
    for name, field in model.model_fields.items():
        if part or part_model(field.annotation) is None:
            key = f"{part}.{name}" if part else name
            yield (
                f"`{key}`",
                unit_of(name),
                _default(field),
                _range(field),
                meaning_of(model, name),
            )


def meaning_of(model: type[BaseModel], name: str) -> str:
    """What a key means: its `description`, or the text below it in its class."""
    described = model.model_fields[name].description
    classes = [one for one in model.__mro__ if name in inspect.get_annotations(one)]
    return described or _texts(classes[0]).get(name, "")


@cache
def _texts(model: type) -> dict[str, str]:
    """The text below each key of a class."""
    body = ast.parse(textwrap.dedent(inspect.getsource(model))).body[0]
    assert isinstance(body, ast.ClassDef)
    return {
        key.target.id: " ".join(str(text.value.value).split())
        for key, text in pairwise(body.body)
        if isinstance(key, ast.AnnAssign) and isinstance(key.target, ast.Name)
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
    }


def part_model(annotation: Any) -> type[BaseModel] | None:
    """The model that a key's type names, None where the key holds a plain value."""
    for kind in (annotation, *get_args(annotation)):
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            return kind
    for kind in get_args(annotation):
        kind = getattr(kind, "__origin__", kind) if hasattr(kind, "__metadata__") else kind
        inner = part_model(kind) if get_origin(kind) is tuple else None
        if inner is not None:
            return inner
    return None


def unit_of(key: str) -> str:
    """The unit in a key's name, a dash without one."""
    return next((unit for end, unit in UNITS.items() if key.endswith(end)), "–")


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "**required**"
    return "–" if field.default is None else f"`{_toml(field.default)}`"


def _toml(value: Any) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and abs(value) >= 1e4:
        return f"{value:g}".replace("e+", "e").replace("e0", "e")
    return f'"{value}"' if isinstance(value, str) else str(value)


def _range(field: FieldInfo) -> str:
    parts = list(_ranges(field.annotation, [*field.metadata]))
    return " or ".join(dict.fromkeys(parts))


def _ranges(annotation: Any, metadata: list[Any]) -> Iterator[str]:
    """What values a type takes; `metadata` are its bounds."""
    arguments = get_args(annotation)
    if part_model(annotation) is not None and get_origin(annotation) is None:
        yield "table"
    elif arguments and part_model(arguments[0]) is not None and ... in arguments:
        yield "list of tables"
    elif get_origin(annotation) is tuple and ... in arguments:
        yield f"list, each {next(_ranges(arguments[0], []))}"
    elif get_origin(annotation) is Literal:
        yield ", ".join(f"`{_toml(value)}`" for value in arguments)
    elif get_origin(annotation) is tuple:
        each = next(_ranges(arguments[0], metadata))
        yield f"list of {len(arguments)}, each {each}"
    elif hasattr(annotation, "__metadata__"):
        yield from _ranges(annotation.__origin__, [*metadata, *annotation.__metadata__])
    elif arguments:
        for kind in arguments:
            if kind is not type(None):
                yield from _ranges(kind, metadata)
    elif annotation is bool:
        yield "`true`, `false`"
    elif annotation is str:
        yield "text"
    else:
        yield _bounds(metadata) or ("whole number" if annotation is int else "number")


def _bounds(metadata: list[Any]) -> str:
    """Bounds as signs; the range 1e-18 to 1e15, which stands for any positive number, is "> 0".

    The sign is escaped, as a Markdown text that starts with it is a quotation.
    """
    bounds: dict[str, Any] = {}
    for item in metadata:
        for part in getattr(item, "metadata", [item]):
            for name in ("gt", "ge", "lt", "le"):
                if getattr(part, name, None) is not None:
                    bounds[name] = getattr(part, name)
    if (bounds.get("ge"), bounds.get("le")) == (1e-18, 1e15):
        bounds = {"gt": 0}
    signs = {"gt": "\\>", "ge": "≥", "lt": "<", "le": "≤"}
    return ", ".join(f"{signs[name]}{SPACE}{_plain(value)}" for name, value in bounds.items())


def _plain(value: float) -> str:
    return "2³¹" if value == 2**31 else f"{value:g}"
