"""What the figures share: files, styles of the specimens, curves with their range over seeds."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.file import QUICK
from fdnet.files import replacing
from fdnet.report.figures import STYLE
from fdnet.spheres.snapshot import Array
from validation.engine.palette import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    YELLOW,
)
from validation.thesis.numbers.examine import Examined
from validation.thesis.numbers.values import specimen_number

MM = 1e3
DPI = 150
COLOURS = 64
"""Colours kept in a PNG, its most frequent; the file is a third as large as with all colours."""
SPECIMEN_COLOURS = {
    "specimen1": BLUE,
    "specimen2": GREEN,
    "specimen3": ORANGE,
    "specimen4": SKY,
    "specimen5": YELLOW,
    "specimen6": BLACK,
    "specimen7": PURPLE,
    "specimen8": GREY,
}
SPECIMEN_MARKERS = dict(zip(SPECIMEN_COLOURS, "os^PXvDd", strict=True))
DEPTH_LABEL = "depth from the formation face (mm)"
THESIS = {
    "color": "black",
    "marker": "D",
    "markersize": 7,
    "markerfacecolor": "white",
    "markeredgewidth": 1.6,
}
"""Style of a number of the thesis."""


@contextmanager
def canvas(path: Path) -> Iterator[Any]:
    """A figure without pyplot's global state, saved to `path` at the end of the block."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(7.2, 4.4), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        with replacing(path) as part:
            _save(figure, part)


def _save(figure: Any, path: Path) -> None:
    from PIL import Image  # a requirement of matplotlib

    figure.canvas.draw()
    index, palette = few_colours(np.asarray(figure.canvas.buffer_rgba())[:, :, :3])
    picture = Image.fromarray(index)
    picture.putpalette(palette.tobytes())
    picture.save(path, optimize=True, dpi=(DPI, DPI))


def few_colours(pixels: Array) -> tuple[Array, Array]:
    """Reduce the pixels (H, W, 3) of a picture to its COLOURS most frequent colours.

    Returns the index (H, W) of the nearest colour, and the colours (at most COLOURS, 3).
    """
    code = pixels.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
    unique, place, count = np.unique(code, return_inverse=True, return_counts=True)
    every = np.column_stack([unique >> 16, (unique >> 8) & 255, unique & 255]).astype(np.int32)
    palette = every[np.argsort(-count, kind="stable")[:COLOURS]]
    squares = (
        np.sum(every**2, axis=1)[:, None] - 2 * every @ palette.T + np.sum(palette**2, axis=1)
    )
    nearest = np.argmin(squares, axis=1).astype(np.uint8)
    return nearest[place].reshape(code.shape), palette.astype(np.uint8)


def steps(axes: Any, edges: Array, rows: Any, *, colour: str, label: str, line: Any = "-") -> None:
    """Steps between `edges` (B+1,) of the mean and range of `rows` (S, B), one row a seed."""
    rows = np.atleast_2d(np.asarray(rows, float))
    axes.stairs(
        rows.mean(axis=0),
        edges,
        baseline=None,
        color=colour,
        label=label,
        linestyle=line,
        linewidth=2,
    )
    if len(rows) > 1:
        low, high = (np.append(one, one[-1]) for one in (rows.min(axis=0), rows.max(axis=0)))
        axes.fill_between(edges, low, high, step="post", color=colour, alpha=0.2, linewidth=0)


def bars(axes: Any, edges: Array, rows: Any, *, colour: str, label: str) -> None:
    """Filled steps of the mean of `rows` (S, B), one row a seed, with lines over their range."""
    rows = np.atleast_2d(np.asarray(rows, float))
    mean = rows.mean(axis=0)
    axes.stairs(mean, edges, fill=True, color=colour, alpha=0.55, label=label)
    if len(rows) > 1:
        axes.vlines(
            (edges[1:] + edges[:-1]) / 2,
            rows.min(axis=0),
            rows.max(axis=0),
            color="black",
            linewidth=1,
        )


def seeds(runs: Collection[Any]) -> str:
    """Words on the number of seeds behind a mean and its band; empty for one seed."""
    return f", mean and range of {len(runs)} seeds" if len(runs) > 1 else ""


def titled(name: str) -> str:
    """A run's name for a title: "specimen 1", or "specimen 1, quick form"."""
    plain = name.removeprefix(QUICK).replace("specimen", "specimen ")
    return f"{plain}, quick form" if name.startswith(QUICK) else plain


def own_style(name: str) -> dict[str, str]:
    """Colour and marker of a run's specimen."""
    specimen = f"specimen{specimen_number(name) or ''}"
    return {
        "color": SPECIMEN_COLOURS.get(specimen, BLACK),
        "marker": SPECIMEN_MARKERS.get(specimen, "x"),
    }


def sized(run: Examined, name: str) -> str:
    """The specimen and the diameter of its fines in mm, for a title."""
    radii = sorted(set(run.state.case.fines.radius_range_m))
    across = "-".join(f"{2e3 * radius:.3g}" for radius in radii)
    return f"{titled(name)}: fines {across} mm across"


def circles(axes: Any, centre: Array, radius: Array, **style: Any) -> None:
    """Circles of `radius` (N,) about `centre` (N, 2), in units of the axes, painted in order."""
    from matplotlib.collections import EllipseCollection

    wide = 2 * radius
    places: Any = {"units": "xy", "offsets": centre, "offset_transform": axes.transData}
    axes.add_collection(EllipseCollection(wide, wide, np.zeros(len(wide)), **places, **style))
