"""What the thesis's figures share: sources, files, colours, and curves with their range over seeds."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.atomic import replacing
from fdnet.report.figures import STYLE
from fdnet.spheres.snapshot import Array, Snapshot
from fdnet.studies.thesis.figures.marks import NONE, ThesisMarks
from fdnet.studies.thesis.numbers.examine import Examined
from fdnet.studies.thesis.numbers.values import specimen_number
from fdnet.studies.thesis.runs.plan import QUICK

MM = 1e3
DPI = 150
COLOURS = 64
"""In a PNG, those it has most of: a third of the size of one of all."""
BLACK, BLUE, SKY, GREEN, ORANGE, PURPLE, YELLOW, GREY = (
    "#000000",
    "#0072B2",
    "#56B4E9",
    "#009E73",
    "#D55E00",
    "#CC79A7",
    "#E69F00",
    "#7F7F7F",
)
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
DISTANCE_CLASSES = ("below 0.4", "0.4 to 0.6", "above 0.6")
DEPTH_LABEL = "depth from the formation face (mm)"
THESIS = {
    "color": "black",
    "marker": "D",
    "markersize": 7,
    "markerfacecolor": "white",
    "markeredgewidth": 1.6,
}
"""How a number of the thesis is drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanRow:
    """One run of a scan: `value` of what is scanned; the invaded fines' depths mm, and the first millimetre's count
    and lost porosity."""

    specimen: str
    seed: int
    value: float
    depth_mean_mm: float
    depth_p95_mm: float
    depth_max_mm: float
    count_first_mm: float = float("nan")
    porosity_loss_first_mm: float = float("nan")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Tables:
    """What other studies found: `drag`, `friction`, `supply` rows of scans over the drag multiplier, the fines'
    friction and the fines supplied over those of the case; `tetrahedra` by specimen, how many with all spheres and with
    the grains alone; `distances` by class of throat porosity (`DISTANCE_CLASSES`), (K,) of a fine's centre from the
    throat's axis over the throat's radius; `growth` a pack after its first and last stage of growth, and at rest."""

    drag: Sequence[ScanRow] = ()
    friction: Sequence[ScanRow] = ()
    supply: Sequence[ScanRow] = ()
    tetrahedra: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    distances: Mapping[str, Array] = field(default_factory=dict)
    growth: Sequence[Snapshot] = ()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sources:
    """What there is to draw from: runs by specimen, one a seed; the thesis's numbers; and other studies' tables."""

    examined: Mapping[str, Sequence[Examined]]
    thesis: Mapping[str, ThesisMarks] = field(default_factory=dict)
    tables: Tables = field(default_factory=Tables)

    def marks(self, specimen: str) -> ThesisMarks:
        """What the thesis says on a specimen."""
        return self.thesis.get(specimen, NONE)


@contextmanager
def canvas(path: Path) -> Iterator[Any]:
    """A figure without pyplot's global state, saved to `path` when filled."""
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
    from PIL import Image  # matplotlib's own

    figure.canvas.draw()
    index, palette = few_colours(np.asarray(figure.canvas.buffer_rgba())[:, :, :3])
    picture = Image.fromarray(index)
    picture.putpalette(palette.tobytes())
    picture.save(path, optimize=True, dpi=(DPI, DPI))


def few_colours(pixels: Array) -> tuple[Array, Array]:
    """Index (H, W) into a palette (<= COLOURS, 3) of the most frequent colours of `pixels` (H, W, 3), the nearest."""
    code = pixels.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
    found, place, count = np.unique(code, return_inverse=True, return_counts=True)
    every = np.column_stack([found >> 16, (found >> 8) & 255, found & 255]).astype(np.int32)
    palette = every[np.argsort(-count, kind="stable")[:COLOURS]]
    squares = (
        np.sum(every**2, axis=1)[:, None] - 2 * every @ palette.T + np.sum(palette**2, axis=1)
    )
    nearest = np.argmin(squares, axis=1).astype(np.uint8)
    return nearest[place].reshape(code.shape), palette.astype(np.uint8)


def steps(axes: Any, edges: Array, rows: Any, *, colour: str, label: str, line: Any = "-") -> None:
    """The mean of `rows` (S, B), one a seed, as steps between `edges` (B+1,), with the band of their range."""
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
    """The mean of `rows` (S, B) as filled steps from 0, with lines over the range of the seeds."""
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
    """ "", or how many seeds the mean and its band are of."""
    return f", mean and range of {len(runs)} seeds" if len(runs) > 1 else ""


def titled(name: str) -> str:
    """Such as "specimen 1" of "specimen1" and "specimen 1, quick form" of "quick-specimen1"."""
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
    """The specimen, its fines' diameter mm and the pack's porosity as measured."""
    radii = sorted(set(run.state.case.fines.radius_range_m))
    across = "-".join(f"{2e3 * radius:.3g}" for radius in radii)
    return f"{titled(name)}: fines {across} mm across"


def circles(axes: Any, centre: Array, radius: Array, **style: Any) -> None:
    """Circles of `radius` (N,) about `centre` (N, 2) in the units of the axes, later ones over earlier ones."""
    from matplotlib.collections import EllipseCollection

    wide = 2 * radius
    places: Any = {"units": "xy", "offsets": centre, "offset_transform": axes.transData}
    axes.add_collection(EllipseCollection(wide, wide, np.zeros(len(wide)), **places, **style))
