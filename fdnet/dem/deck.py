"""Decks: the text of a LIGGGHTS input, rendered from the templates under StrictUndefined."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import jinja2
from jinja2 import meta

from fdnet.errors import DeckError


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """Something that a deck does without.

    Attributes:
        what: is left out.
        why: it is not needed.
    """

    what: str
    why: str

    def __str__(self) -> str:
        return f"{self.what} ({self.why})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Deck:
    """A rendered deck.

    Attributes:
        text: LIGGGHTS input.
        stage: "pack" or "invade".
        digest: of what the stage depends on in its case.
        left_out: what a general deck would have and this one does without.
    """

    text: str
    stage: str
    digest: str
    left_out: tuple[LeftOut, ...]


@cache
def _environment() -> jinja2.Environment:
    folder = files("liggghts_templates")
    loader = jinja2.FunctionLoader(lambda name: _source(folder, name))
    return jinja2.Environment(
        loader=loader,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )


def _source(folder: Any, name: str) -> str | None:
    entry = folder / name
    return entry.read_text(encoding="utf-8") if entry.is_file() else None


def used_variables(template: str) -> set[str]:
    """Names the template and everything it includes take from outside."""
    return set(_used(template))


def _used(template: str) -> Iterator[str]:
    environment = _environment()
    try:
        loader = environment.loader
        source, _, _ = loader.get_source(environment, template)  # type: ignore[union-attr]
    except jinja2.TemplateNotFound as error:
        raise DeckError(
            f"liggghts_templates/{error.name}: template not found; reinstall fdnet"
        ) from error
    tree = environment.parse(source)
    yield from meta.find_undeclared_variables(tree)
    for name in meta.find_referenced_templates(tree):
        if name:
            yield from _used(name)


def render_text(template: str, variables: dict[str, Any]) -> str:
    """The template with `variables` put in.

    Raises DeckError: a template or variable is missing, or a variable is offered but never used.
    """
    unused = set(variables) - used_variables(template)
    if unused:
        raise DeckError(
            f"{template}: variables offered but never used: {', '.join(sorted(unused))}"
        )
    try:
        return _environment().get_template(template).render(variables)
    except jinja2.UndefinedError as error:
        raise DeckError(f"{template}: {error.message}; expected a value from fdnet.dem") from error
    except jinja2.TemplateSyntaxError as error:
        raise DeckError(f"{error.name or template}:{error.lineno}: {error.message}") from error


def number(value: float) -> str:
    """A float as LIGGGHTS reads it back exactly."""
    return repr(float(value))
