"""Pictures of the flow through a specimen, drawn in a process of its own, which OpenGL may end.

Usage: python -m fdnet.report.flow_frames GRAINS.vtp --box=x0,x1,y0,y1,z0,z1 --title=TEXT
       --limits=LOW,HIGH FOLDER FINES.vtp LINES.vtp FINES.vtp LINES.vtp ...
The bounds are in m; the pictures are FOLDER/0000.png and so on, one for each pair of fines and
lines (throats or streamlines, with `value` on them). The logarithmic colours have the same limits
in all of them. Grains are glass, so that the flow between them can be seen.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.report.picture import (
    MM,
    UPSTREAM_SHOWN,
    add_frame,
    balls,
    look,
    parsed_box,
    shown_fines,
)
from fdnet.spheres.snapshot import Array, Kind

FINE_COLOUR, GRAIN_COLOUR = "#E66100", "#B8B8B8"
WINDOW = [1500, 760]
NOTHING = 1e-30
"""Drawn for a flux of 0, which has no logarithm."""
BROADSIDE = (-0.55, -1.9, 0.75)
"""Where the view is from: the mud upstream should not hide the specimen."""
GLASS = 0.10
"""Opacity of a grain."""
WIDEST, LINE = 0.12, 0.030
"""Radius of the pipe of the largest flux, and of a streamline, in radii of a grain."""
THINNEST = 0.12
"""Radius of the pipe of a flux below the colours, over that of the largest."""
COLOURS = ("#E4F4CB", "#C7E9B4", "#7FCDBB", "#41B6C4", "#1D91C0", "#225EA8", "#253494", "#081D58")
"""From the lower to the upper limit (YlGnBu of ColorBrewer)."""


def draw(grains: str, box: Array, scale: tuple[str, list[float]], work: list[str]) -> None:
    """Draw each pair of fines and lines into the folder that `work` begins with."""
    import pyvista as pv

    bounds, still = box * MM, pv.read(grains)
    folder, *files = work
    for number, (fines, lines) in enumerate(zip(files[::2], files[1::2], strict=True)):
        plotter: Any = pv.Plotter(off_screen=True, window_size=WINDOW)
        plotter.set_background("white")
        _add_grains(plotter, still)
        _add_fines(plotter, pv.read(fines), bounds)
        radius = float(still.point_data["radius_m"].mean()) * MM
        _add_lines(plotter, _shown(pv.read(lines), bounds), radius, scale)
        add_frame(plotter, bounds, depth_only=True)
        look(plotter, bounds, toward=BROADSIDE, window=WINDOW)
        plotter.screenshot(str(Path(folder, f"{number:04d}.png")))
        plotter.close()


def _add_grains(plotter: Any, spheres: Any) -> None:
    mask = spheres.point_data["kind"] == Kind.GRAIN
    plotter.add_mesh(
        balls(spheres, mask, 24), color=GRAIN_COLOUR, opacity=GLASS, smooth_shading=True
    )


def _add_fines(plotter: Any, spheres: Any, bounds: Array) -> None:
    mask = shown_fines(spheres, bounds)
    if mask.any():
        resolution = int(np.clip(np.sqrt(6e5 / mask.sum()), 5, 16))
        plotter.add_mesh(
            balls(spheres, mask, resolution), color=FINE_COLOUR, smooth_shading=True, ambient=0.25
        )


def _add_lines(plotter: Any, mesh: Any, radius: float, scale: tuple[str, list[float]]) -> None:
    """Pipes in mm: throats as wide as their flux says, streamlines all alike."""
    title, limits = scale
    if not mesh.n_points:
        return
    if "value" in mesh.cell_data:
        pipes = _pipes_of_throats(mesh, radius, limits)
    else:
        pipes = mesh.tube(radius=LINE * radius, n_sides=6)
    plotter.add_mesh(
        pipes,
        scalars="value",
        log_scale=True,
        clim=limits,
        cmap=list(COLOURS),
        ambient=0.35,
        smooth_shading=True,
        scalar_bar_args={
            "title": f"{title}\n",
            "color": "black",
            "title_font_size": 22,
            "label_font_size": 22,
            "fmt": "%.3g",
            "n_labels": 3,
            "vertical": True,
            "position_x": 0.88,
            "position_y": 0.15,
            "width": 0.07,
            "height": 0.65,
        },
    )


def _shown(mesh: Any, bounds: Array) -> Any:
    """The lines in mm, without streamlines as far upstream as fines are not shown either."""
    mesh.points = mesh.points * MM
    if not mesh.n_points or "value" in mesh.cell_data:
        return mesh
    start = bounds[0, 0] - UPSTREAM_SHOWN * np.ptp(bounds[0])
    return mesh.clip(normal="x", origin=(start, 0.0, 0.0), invert=False)


def _pipes_of_throats(mesh: Any, radius: float, limits: list[float]) -> Any:
    """Pipes whose radius grows like the fourth root of the flux, as that of Poiseuille's does."""
    import pyvista as pv

    value = np.asarray(mesh.cell_data["value"])
    width = WIDEST * radius * np.clip(value / limits[1], THINNEST**4, 1.0) ** 0.25
    ends = np.asarray(mesh.lines).reshape(-1, 3)[:, 1:]
    lines = np.insert(np.arange(ends.size).reshape(-1, 2), 0, 2, axis=1)
    apart = pv.PolyData(np.asarray(mesh.points)[ends.ravel()], lines=lines.ravel())
    apart.point_data["width"] = np.repeat(width, 2)
    apart.point_data["value"] = np.repeat(np.maximum(value, NOTHING), 2)
    return apart.tube(scalars="width", absolute=True, n_sides=10, capping=True)


def main(arguments: list[str]) -> None:
    grains, bounds, title, limits, *work = arguments
    low, high = (float(value) for value in limits.removeprefix("--limits=").split(","))
    scale = title.removeprefix("--title="), [low, high]
    draw(grains, parsed_box(bounds), scale, work)


if __name__ == "__main__":
    main(sys.argv[1:])
