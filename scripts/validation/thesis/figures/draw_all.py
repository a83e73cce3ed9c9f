"""Draw every figure of the thesis for which the sources are there."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from validation.thesis.figures.canvas import canvas
from validation.thesis.figures.drawing import Drawing
from validation.thesis.figures.drawings import FIGURES
from validation.thesis.figures.sources import Sources
from validation.thesis.figures.tables import POROSITY_CLASSES, FigureTables
from validation.thesis.numbers.examine import Examined
from validation.thesis.numbers.values import ThesisSpecimen


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """A figure that was drawn, or that was left out.

    Attributes:
        name: its file name.
        path: where it was drawn; None when it was left out.
        caption: the text under it.
        missing: the sources that it lacks.
    """

    name: str
    path: Path | None
    caption: str
    missing: tuple[str, ...] = ()


def draw_all(
    examined: Mapping[str, Sequence[Examined]],
    folder: str | Path,
    *,
    thesis: Mapping[str, ThesisSpecimen] | None = None,
    tables: FigureTables | None = None,
) -> list[Drawn]:
    """Draw the figures in the thesis's order.

    Args:
        examined: examined runs by specimen ("specimen1"), one a seed.
        folder: where the figures go; it is made when missing.
        thesis: the thesis's numbers by specimen, and "table3"; left out of the figures when None.
        tables: tables of scans, tetrahedra, distances and the growth of a pack.
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    sources = Sources(examined=examined, thesis=thesis or {}, tables=tables or FigureTables())
    return [_drawn(name, drawing, sources, target) for name, drawing in FIGURES.items()]


def filled_in(sentence: str, thesis: Mapping[str, ThesisSpecimen]) -> str:
    """A sentence with its numbers of the thesis, such as "{specimen1.porosity_loss:g}".

    Returns an empty string when the thesis has no such number.
    """
    try:
        return sentence.format(**thesis)
    except (KeyError, IndexError, TypeError):
        return ""


def _drawn(name: str, drawing: Drawing, sources: Sources, folder: Path) -> Drawn:
    caption = " ".join([drawing.caption, *_thesis_sentences(drawing, sources)])
    missing = tuple(_missing(drawing, sources))
    if missing:
        return Drawn(name=name, path=None, caption=caption, missing=missing)
    with canvas(folder / name) as figure:
        drawing.draw(figure, sources)
    return Drawn(name=name, path=folder / name, caption=caption)


def _thesis_sentences(drawing: Drawing, sources: Sources) -> Iterator[str]:
    """The thesis's numbers on what the figure shows, as far as they are known."""
    yield from filter(None, (filled_in(one, sources.thesis) for one in drawing.thesis))
    for specimen in drawing.specimens[:1]:
        for one in sources.numbers(specimen).statistics:
            if one.quantity in drawing.quantities:
                yield f"Thesis: {one.subject}: {one.words}."
    if drawing.table == "distances" and drawing.key is not None:
        claim = sources.numbers("specimen5").deposition_in(POROSITY_CLASSES[drawing.key])
        if claim is not None:
            yield f"Thesis: {claim.words}."


def _missing(drawing: Drawing, sources: Sources) -> Iterator[str]:
    for specimen in drawing.specimens:
        if not sources.examined.get(specimen):
            yield specimen
    if drawing.table is not None:
        table = getattr(sources.tables, drawing.table)
        if drawing.key is not None:
            table = table.get(drawing.key, ())
        if not len(table):
            yield " ".join(filter(None, (drawing.table, drawing.key)))
