"""How one figure of the thesis is made, and what stands under it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from validation.thesis.figures.canvas import titled
from validation.thesis.figures.sources import Sources

NamedDrawing = tuple[str, "Drawing"]
"""A file name and what is drawn into it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """How a figure is made.

    Attributes:
        draw: draws on a matplotlib figure, from the sources.
        caption: the text under the figure.
        specimens: the specimens that it needs.
        table: the field of `FigureTables` that it needs; None for none.
        key: the entry of that table that it needs; None for the whole.
        thesis: sentences with numbers of the thesis, which stand in the caption when the numbers
            are known. A number is written as "{specimen1.porosity_loss:.2g}".
        quantities: the first specimen's statistics that stand in the caption too.
    """

    draw: Callable[[Any, Sources], None]
    caption: str
    specimens: Sequence[str] = ()
    table: str | None = None
    key: str | None = None
    thesis: Sequence[str] = ()
    quantities: Sequence[str] = ()


def of_one(name: str, specimen: str, draw: Any, text: str, *thesis: str) -> NamedDrawing:
    """A figure of one specimen.

    Args:
        name: file name without the specimen, such as "figure_15_invaded_fraction".
        specimen: the specimen, such as "specimen1".
        draw: draws on a matplotlib figure, from the sources and the specimen.
        text: the caption after the figure's number and the specimen.
        thesis: sentences as in `Drawing.thesis`, with "{it" for the specimen.
    """
    drawing = Drawing(
        draw=partial(draw, specimen=specimen),
        specimens=(specimen,),
        caption=f"Thesis Figure {_number(name)}, {titled(specimen)}: {text}",
        thesis=[sentence.replace("{it", "{" + specimen) for sentence in thesis],
    )
    return f"{name}_{specimen}.png", drawing


def of_several(
    name: str, specimens: Sequence[str], draw: Any, text: str, *thesis: str
) -> NamedDrawing:
    """A figure of several specimens; the arguments are those of `of_one`."""
    drawing = Drawing(
        draw=partial(draw, specimens=specimens),
        specimens=specimens,
        caption=f"Thesis Figure {_number(name)}: {text}",
        thesis=thesis,
    )
    return f"{name}.png", drawing


def _number(name: str) -> str:
    """The figure's number: "15" of "figure_15_invaded_fraction"."""
    return name.split("_")[1].lstrip("0")
