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
SIGNS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
SPACE = "\N{NO-BREAK SPACE}"


def key_rows(part: str) -> Iterator[tuple[str, str, str]]:
    """Key, default and meaning, in Markdown, of every key of the table `part`.

    A dotted `part` is a table inside another, such as grains.sizes. The unit stands with the
    default; choices that the meaning does not name, and bounds other than "above 0", follow it.
    """
    from fdnet.case.case import InvasionCase

    model: type[BaseModel] = InvasionCase
    for name in part.split(".") if part else ():
        inner = part_model(model.model_fields[name].annotation)
        assert inner is not None, part
        model = inner
    for name, field in model.model_fields.items():
        if part or part_model(field.annotation) is None:
            yield f"`{name}`", _default(name, field), _meaning(model, name)


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


def _default(name: str, field: FieldInfo) -> str:
    if field.is_required():
        return "**required**"
    if field.default in (None, {}):
        return ""
    unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), "")
    text = " ".join(filter(None, (f"`{_toml(field.default)}`", unit)))
    return text.replace(" ", SPACE) if unit else text


def _toml(value: Any) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and abs(value) >= 1e4:
        return f"{value:g}".replace("e+", "e").replace("e0", "e")
    return f'"{value}"' if isinstance(value, str) else str(value)


def _meaning(model: type[BaseModel], name: str) -> str:
    text, field = meaning_of(model, name), model.model_fields[name]
    limits = [one for one in _limits(field.annotation, [*field.metadata]) if one not in text]
    return f"{text} ({', '.join(dict.fromkeys(limits))})" if limits else text


def _limits(annotation: Any, metadata: list[Any]) -> Iterator[str]:
    """Choices and bounds of a type; `metadata` are its bounds."""
    if get_origin(annotation) is Literal:
        yield from (_toml(value) for value in get_args(annotation) if value is not None)
    elif hasattr(annotation, "__metadata__"):
        yield from _limits(annotation.__origin__, [*metadata, *annotation.__metadata__])
    elif part_model(annotation) is None and annotation is not str:
        yield from _bounds(metadata)
        for kind in get_args(annotation):
            yield from _limits(kind, [])


def _bounds(metadata: list[Any]) -> Iterator[str]:
    """Upper bounds as signs; a range far beyond use has none."""
    bounds: dict[str, Any] = {}
    for item in metadata:
        for part in getattr(item, "metadata", [item]):
            for name in SIGNS:
                if getattr(part, name, None) is not None:
                    bounds[name] = getattr(part, name)
    if (bounds.get("ge"), bounds.get("le")) != (1e-18, 1e15):
        for name, value in bounds.items():
            if name in ("lt", "le"):
                yield f"{SIGNS[name]}{SPACE}{'2³¹' if value == 2**31 else f'{value:g}'}"
