"""The 3-D picture of a sphere file, drawn in a process of its own, which OpenGL may end.

Usage: python -m fdnet.report.picture SPHERES.vtp --box=x0,x1,y0,y1,z0,z1 PICTURE.png
The bounds are in m. See `fdnet.report.child.render_spheres_png`.
"""

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from fdnet.spheres.snapshot import Array, Kind

MM, MICRON = 1e3, 1e6
WINDOW = [1500, 950]
UPSTREAM_SHOWN = 0.12
DEEPEST = 0.97
"""Share of the fines up to whose depth the colours reach; a few deep ones take the last colour."""
FACETS = (
    6e5  # about half the triangles all fines together may have: memory and time of the picture
)
FACE_COLOUR = "#0072B2"
OBLIQUE = (-1.1, -1.9, 0.9)
"""Where the view is from, as seen from the middle of the box."""


def render(source: str, box: Array, target: str) -> None:
    """Draw `source` into `target`: grains of the far half grey, fines in colour, axes in mm.

    Fines further upstream than `UPSTREAM_SHOWN` of the length stay out of the picture.
    """
    import pyvista as pv

    spheres = pv.read(source)
    bounds = box * MM
    plotter: Any = pv.Plotter(off_screen=True, window_size=WINDOW)
    plotter.set_background("white")
    add_grains(plotter, spheres, bounds)
    add_fines(plotter, spheres, bounds, colours_of(spheres, bounds))
    add_frame(plotter, bounds)
    look(plotter, bounds)
    plotter.screenshot(target)
    plotter.close()


def balls(spheres: Any, mask: Array, resolution: int) -> Any:
    """Spheres as triangles in mm, carrying `radius` in um and `depth` in mm."""
    import pyvista as pv

    points = pv.PolyData(spheres.points[mask] * MM)
    radius = spheres.point_data["radius_m"][mask]
    points.point_data["diameter"] = 2 * radius * MM
    points.point_data["radius_um"] = radius * MICRON
    points.point_data["depth_mm"] = points.points[:, 0]
    ball = pv.Sphere(radius=0.5, theta_resolution=resolution, phi_resolution=resolution)
    return points.glyph(geom=ball, scale="diameter", orient=False)


def add_grains(plotter: Any, spheres: Any, bounds: Array) -> None:
    """The grains of the far half, grey; `bounds` are in mm."""
    far = (spheres.point_data["kind"] == Kind.GRAIN) & (
        spheres.points[:, 1] * MM > bounds[1].mean()
    )
    if far.any():
        plotter.add_mesh(
            balls(spheres, far, 32), color="#E2E2E2", smooth_shading=True, ambient=0.15
        )


def colours_of(spheres: Any, bounds: Array) -> tuple[str, str, list[float]]:
    """What the fines are coloured by: by radius, or by depth when they are (nearly) of one size.

    Returns the name of the array, the title of the scale and its limits; `bounds` are in mm.
    """
    mask = shown_fines(spheres, bounds)
    radius = spheres.point_data["radius_m"][mask] if spheres.n_points else np.zeros(0)
    if len(radius) and np.ptp(radius) >= 0.02 * radius.max():
        limits = [radius.min() * MICRON, radius.max() * MICRON]
        return "radius_um", "fines, radius (µm)", limits
    depth = spheres.points[mask, 0] * MM if len(radius) else np.zeros(1)
    deepest = min(float(np.quantile(depth, DEEPEST)), bounds[0, 1])
    limits = [bounds[0, 0], max(deepest, 0.1 * bounds[0, 1])]
    return "depth_mm", "fines, depth (mm)", limits


def shown_fines(spheres: Any, bounds: Array) -> Array:
    """Which of the spheres are fines that are not far upstream; `bounds` are in mm."""
    if not spheres.n_points:
        return np.zeros(0, bool)
    shown = spheres.points[:, 0] * MM > bounds[0, 0] - UPSTREAM_SHOWN * np.ptp(bounds[0])
    return np.asarray((spheres.point_data["kind"] == Kind.FINE) & shown)


def add_fines(
    plotter: Any, spheres: Any, bounds: Array, colours: tuple[str, str, list[float]]
) -> None:
    """Fines that are not far upstream, coloured as `colours_of` says; `bounds` are in mm."""
    mask, (name, title, limits) = shown_fines(spheres, bounds), colours
    if not mask.any():
        return
    drawn = balls(spheres, mask, int(np.clip(np.sqrt(FACETS / mask.sum()), 5, 16)))
    bar = {
        "title": f"{title}\n",
        "color": "black",
        "title_font_size": 22,
        "label_font_size": 22,
        "fmt": "%.3g",
        "n_labels": 5,
        "vertical": True,
        "position_x": 0.88,
        "position_y": 0.15,
        "width": 0.07,
        "height": 0.65,
    }
    plotter.add_mesh(
        drawn, scalars=name, clim=limits, cmap="plasma", smooth_shading=True, scalar_bar_args=bar
    )


def add_frame(plotter: Any, bounds: Array, *, depth_only: bool = False) -> None:
    """The box with its scales (mm), or that of the depth alone, and the formation face."""
    import pyvista as pv

    (x0, x1), (y0, y1), (z0, z1) = bounds
    plotter.add_mesh(
        pv.Box((x0, x1, y0, y1, z0, z1)), style="wireframe", color="black", line_width=2
    )
    face = pv.Plane(
        center=(x0, (y0 + y1) / 2, (z0 + z1) / 2),
        direction=(1, 0, 0),
        i_size=z1 - z0,
        j_size=y1 - y0,
        i_resolution=1,
        j_resolution=1,
    )
    plotter.add_mesh(
        face,
        color=FACE_COLOUR,
        opacity=0.18,
        show_edges=True,
        edge_color=FACE_COLOUR,
        line_width=3,
    )
    plotter.add_point_labels(
        [(x0, y1, z1 + 0.12 * (z1 - z0))],
        ["formation face x = 0"],
        font_size=22,
        text_color=FACE_COLOUR,
        shape=None,
        show_points=False,
        always_visible=True,
    )
    plotter.show_bounds(
        bounds=(x0, x1, y0, y1, z0, z1),
        xtitle="x (mm)",
        ytitle=" " if depth_only else f"y: {y0:.3g} to {y1:.3g} mm",
        show_ylabels=False,
        show_zlabels=not depth_only,
        ztitle=" " if depth_only else "z (mm)",
        color="black",
        font_size=18,
        location="outer",
        grid=False,
        fmt="%.3g",
        n_xlabels=5,
        n_ylabels=3,
        n_zlabels=3,
    )


def look(
    plotter: Any,
    bounds: Array,
    *,
    toward: tuple[float, float, float] = OBLIQUE,
    window: Sequence[int] = WINDOW,
) -> None:
    """Look from the direction `toward`, by default the front, a little from upstream and above.

    The projected box fills the `window` (pixels) left of the scalar bar.
    """
    eye = np.array(toward) / np.linalg.norm(toward)
    right = np.cross([0.0, 0.0, 1.0], eye)
    right /= np.linalg.norm(right)
    up = np.cross(eye, right)
    corners = np.stack(np.meshgrid(*bounds), axis=-1).reshape(-1, 3) - bounds.mean(axis=1)
    width, height = np.ptp(corners @ right), np.ptp(corners @ up)
    scale = max(
        0.62 * height, 0.7 * width * window[1] / window[0]
    )  # half the height of the window, mm
    focus = bounds.mean(axis=1) + 0.08 * scale * window[0] / window[1] * right - 0.05 * scale * up
    distance = 4.6 * scale  # the axis labels grow with it
    plotter.camera_position = [tuple(focus + distance * eye), tuple(focus), (0, 0, 1)]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = scale
    plotter.reset_camera_clipping_range()


def parsed_box(text: str) -> Array:
    """The box (3, 2) of an argument --box=x0,x1,y0,y1,z0,z1."""
    return np.array([float(value) for value in text.removeprefix("--box=").split(",")]).reshape(
        3, 2
    )


def main(arguments: list[str]) -> None:
    source, bounds, target = arguments
    render(source, parsed_box(bounds), target)


if __name__ == "__main__":
    main(sys.argv[1:])
