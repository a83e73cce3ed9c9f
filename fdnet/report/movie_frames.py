"""The pictures of a movie, drawn in a process of its own, which OpenGL may end.

Usage: python -m fdnet.report.movie_frames GRAINS.vtp --box=x0,x1,y0,y1,z0,z1 FOLDER FRAME.vtp ...
The bounds are in m; the pictures are FOLDER/0000.png and so on. Colours are those of the last
frame in all of them. See `fdnet.report.movie`.
"""

import sys
from pathlib import Path
from typing import Any

from fdnet.report.picture import (
    WINDOW,
    add_fines,
    add_frame,
    add_grains,
    colours_of,
    look,
    parsed_box,
)
from fdnet.spheres.snapshot import Array


def draw(grains: str, box: Array, folder: Path, frames: list[str]) -> None:
    """Draw each frame into `folder`, with the grains of the far half where it has none itself."""
    import pyvista as pv

    bounds, still = box * 1e3, pv.read(grains)
    states = [pv.read(frame) for frame in frames]
    colours = colours_of(states[-1], bounds)
    for number, state in enumerate(states):
        plotter: Any = pv.Plotter(off_screen=True, window_size=WINDOW)
        plotter.set_background("white")
        add_grains(plotter, state if _has_grains(state) else still, bounds)
        add_fines(plotter, state, bounds, colours)
        add_frame(plotter, bounds)
        look(plotter, bounds)
        plotter.screenshot(str(folder / f"{number:04d}.png"))
        plotter.close()


def _has_grains(state: Any) -> bool:
    return bool(state.n_points) and bool((state.point_data["kind"] == 1).any())


def main(arguments: list[str]) -> None:
    grains, bounds, folder, *frames = arguments
    draw(grains, parsed_box(bounds), Path(folder), frames)


if __name__ == "__main__":
    main(sys.argv[1:])
