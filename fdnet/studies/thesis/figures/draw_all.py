"""All figures of the thesis that there is something to draw from, into one folder."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fdnet.studies.thesis.figures.canvas import Sources, Tables, canvas
from fdnet.studies.thesis.figures.drawings import FIGURES, Drawing
from fdnet.studies.thesis.figures.marks import ThesisMarks, said
from fdnet.studies.thesis.numbers.examine import Examined


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """A figure made at `path`, or left out (None) because of what is `missing`."""

    name: str
    path: Path | None
    caption: str
    missing: tuple[str, ...] = ()


def draw_all(
    examined: Mapping[str, Sequence[Examined]],
    folder: str | Path,
    *,
    thesis: Mapping[str, ThesisMarks] | None = None,
    tables: Tables | None = None,
) -> list[Drawn]:
    """Draw what there is into `folder` (made if missing), in the thesis's order; what is missing is named.

    `examined` runs, one a seed, by specimen ("specimen1"); `thesis` its numbers by specimen ("table3" too); `tables`
    of other studies.
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    sources = Sources(examined=examined, thesis=thesis or {}, tables=tables or Tables())
    return [_drawn(name, drawing, sources, target) for name, drawing in FIGURES.items()]


def _drawn(name: str, drawing: Drawing, sources: Sources, folder: Path) -> Drawn:
    caption = " ".join([drawing.caption, *_told(drawing, sources)])
    missing = tuple(_missing(drawing, sources))
    if missing:
        return Drawn(name=name, path=None, caption=caption, missing=missing)
    with canvas(folder / name) as figure:
        drawing.draw(figure, sources)
    return Drawn(name=name, path=folder / name, caption=caption)


def _told(drawing: Drawing, sources: Sources) -> Iterator[str]:
    """What the thesis says of the figure, as far as it is known."""
    yield from filter(None, (said(sentence, sources.thesis) for sentence in drawing.thesis))
    for specimen in drawing.specimens[:1]:
        for one in sources.marks(specimen).statistics:
            if one.quantity in drawing.quantities:
                yield f"Thesis: {one.what} {one.words}."
    if drawing.table == "distances" and drawing.key is not None:
        near = sources.marks("specimen5").deposition.get(drawing.key)
        if near is not None:
            yield f"Thesis: {near.words} nearer the {near.quantity}."


def _missing(drawing: Drawing, sources: Sources) -> Iterator[str]:
    for specimen in drawing.specimens:
        if not sources.examined.get(specimen):
            yield specimen
    if drawing.table is not None:
        found = getattr(sources.tables, drawing.table)
        if drawing.key is not None:
            found = found.get(drawing.key, ())
        if not len(found):
            yield " ".join(filter(None, (drawing.table, drawing.key)))
