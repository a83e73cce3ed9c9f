"""Pictures and movies of spheres and flow, drawn by OpenGL in a process of its own.

Without usable OpenGL, VTK ends its process with no Python error; in a child that costs the
picture alone. The child is `python -m fdnet.report.picture`; what it draws comes on standard
input.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fdnet.errors import CaseError, Doubt
from fdnet.files import replacing
from fdnet.spheres.snapshot import Array, Kind

MM, MICRON = 1e3, 1e6
PNG_START, PNG_END = b"\x89PNG\r\n\x1a\n", b"IEND"


class MovieFrame(NamedTuple):
    """One state: its file of spheres (.vtp), what stands above it, and its flow (.vtp) if any."""

    spheres: Path
    words: str = ""
    lines: Path | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Scene:
    """What all frames share: a file of spheres (.vtp) with the grains, for states may hold the
    fines alone; the box (3, 2) m; and whether standard error says how many are drawn."""

    grains: Path
    box: Array
    told: bool = False


def render_spheres_png(
    path: str | Path, spheres_vtp: str | Path, box: Array, *, seconds: float = 120.0
) -> str:
    """Draw the 3-D view of `spheres_vtp` into `path`; `box` is (3, 2) m.

    Returns "" or the reason why there is no picture; only a complete one replaces `path`.
    """
    spheres = Path(spheres_vtp)
    scene = Scene(grains=spheres, box=box)
    try:
        with replacing(path) as part:
            draw_frames(scene, [MovieFrame(spheres)], [part], seconds=seconds)
    except subprocess.TimeoutExpired:
        return Doubt("no-picture", f"the 3-D picture was given up after {seconds:g} s")
    except OSError as error:
        return Doubt("no-picture", f"no 3-D picture: {error}")
    return ""


def draw_frames(
    scene: Scene, frames: Sequence[MovieFrame], targets: Sequence[Path], *, seconds: float
) -> None:
    """Draw each frame into its target (.png) in a child process.

    Raises subprocess.TimeoutExpired after `seconds`, OSError when the child fails or leaves no
    complete picture.
    """
    rows = [
        [str(path.absolute()) if path else "" for path in (one.spheres, one.lines, target)]
        for one, target in zip(frames, targets, strict=True)
    ]
    work = {"grains": str(scene.grains.absolute()), "box": np.asarray(scene.box).tolist()}
    work |= {"told": scene.told, "frames": rows}
    package = str(Path(__file__).resolve().parents[2])
    before = os.environ.get("PYTHONPATH")
    done = subprocess.run(
        drawing_command(),
        input=json.dumps(work),
        stdout=2 if scene.told else subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        timeout=seconds,
        check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, (package, before)))},
    )
    if done.returncode:
        printed = [line.strip() for line in (done.stderr or "").splitlines() if line.strip()]
        kind = "exit code" if done.returncode > 0 else "signal"
        why = re.sub(r".*\|\s*", "", printed[-1])[:200] if printed else "no usable OpenGL?"
        raise OSError(f"the drawing process ended with {kind} {abs(done.returncode)}; {why}")
    for target in targets:
        picture = target.read_bytes() if target.is_file() else b""
        if not (picture.startswith(PNG_START) and PNG_END in picture[-12:]):
            raise OSError("the drawing process left no complete PNG")


def drawing_command() -> list[str]:
    """The child, with the software OpenGL that the set-up may have installed."""
    libraries = Path(__file__).resolve().parents[2] / ".prefix" / "bin" / "with-libraries"
    first = [str(libraries)] if os.access(libraries, os.X_OK) else []
    return [*first, sys.executable, "-m", "fdnet.report.picture"]


# ---- States of a run as a movie, one after the other (GIF or MP4), or below each other (PNG).
SECONDS_PER_FRAME = 30.0  # Time that drawing one state may take
WIDTHS = (880, 1200)  # Pixels of a movie, and of pictures below each other, across
TITLE = 44  # Pixels above each picture, for its words
LAST_FRAMES = 6  # How long the last state stays, in frames
COLOURS = 256
INK = (20, 20, 20)


def write_movie(
    target: Path, frames: Sequence[MovieFrame], scene: Scene, *, per_second: float
) -> Path:
    """Draw the states, at least one, and write them in order as one file: a movie, .gif or .mp4,
    or a picture of all states below each other, .png.

    Raises CaseError for another suffix, where nothing could be drawn, or for MP4 without
    imageio-ffmpeg.
    """
    refuse_suffix(target)
    write = {".gif": _write_gif, ".mp4": _write_mp4, ".png": _write_panels}[target.suffix.lower()]
    seconds = 60 + SECONDS_PER_FRAME * len(frames)
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder, f"{number:04d}.png") for number in range(len(frames))]
        try:
            draw_frames(scene, frames, files, seconds=seconds)
        except (OSError, subprocess.TimeoutExpired) as error:
            late = isinstance(error, subprocess.TimeoutExpired)
            reason = f"the drawing was given up after {seconds:g} s" if late else str(error)
            raise CaseError(
                f"{target}: not drawn, because {reason}; install software OpenGL "
                "(docs/start/install.md), or open invasion.pvd in ParaView"
            ) from error
        width, pairs = WIDTHS[write is _write_panels], zip(files, frames, strict=True)
        pictures = [_worded(file, frame.words, width) for file, frame in pairs]
        with replacing(target) as part:
            write(part, pictures, per_second)
    return target


def refuse_suffix(target: Path) -> None:
    """Raise CaseError where the name ends in nothing that a movie can be written as."""
    if target.suffix.lower() not in (".gif", ".mp4", ".png"):
        raise CaseError(f"{target}: ends in {target.suffix!r}, expected .gif, .mp4 or .png")
    if target.suffix.lower() == ".mp4" and find_spec("imageio_ffmpeg") is None:
        advice = "install it with pip install 'fdnet[movie]', or give a name that ends in .gif"
        raise CaseError(f"{target}: MP4 needs the package imageio-ffmpeg; {advice}")


def _worded(path: Path, words: str, width: int) -> Any:
    """A picture with words above it; both sides are even, as MP4 wants them."""
    from PIL import Image, ImageDraw, ImageFont

    with Image.open(path) as picture:
        height = 2 * round(0.5 * width * picture.height / picture.width)
        whole = Image.new("RGB", (width, height + TITLE), "white")
        whole.paste(picture.convert("RGB").resize((width, height)), (0, TITLE))
    font = ImageFont.load_default(size=24)
    ImageDraw.Draw(whole).text((16, 12), words, fill=INK, font=font)
    return whole


def _write_panels(path: Path, pictures: Sequence[Any], _: float) -> None:
    from PIL import Image

    whole = Image.fromarray(np.concatenate([np.asarray(one) for one in pictures]))
    whole.quantize(COLOURS).save(path, "PNG", optimize=True)


def _write_gif(path: Path, pictures: Sequence[Any], per_second: float) -> None:
    from PIL import Image

    # of the first too: the last may hide the face behind a cake
    both = np.concatenate([np.asarray(one) for one in (pictures[0], pictures[-1])])
    colours = Image.fromarray(both).quantize(COLOURS, Image.Quantize.FASTOCTREE)
    first, *more = (one.quantize(palette=colours, dither=0) for one in _lingering(pictures))
    every: Any = {"save_all": True, "append_images": more, "loop": 0}
    first.save(path, "GIF", duration=round(1000 / per_second), **every)


def _write_mp4(path: Path, pictures: Sequence[Any], per_second: float) -> None:
    import imageio_ffmpeg

    how: Any = {"fps": per_second, "output_params": ["-f", "mp4"]}
    stream = imageio_ffmpeg.write_frames(str(path), pictures[0].size, **how)
    stream.send(None)
    for picture in _lingering(pictures):
        stream.send(picture.tobytes())
    stream.close()


def _lingering(pictures: Sequence[Any]) -> list[Any]:
    """The pictures of a movie, which stays on the last."""
    return [*pictures, *[pictures[-1]] * LAST_FRAMES]


# ------------------------------------------------------------------------------------------------
# What the child draws: fines in colour before the grains of the far half, or, where the flow is
# shown, orange fines and coloured lines among grains of glass. Lengths are in mm.


UPSTREAM_SHOWN = 0.12  # Share of the length upstream of the face up to which fines are shown
DEEPEST = 0.97
"""Share of the fines up to whose depth the colours reach; a few deep ones take the last colour."""
TRIANGLES = 6e5
"""About half the triangles all fines together may have: memory and time of the picture."""
FACE_COLOUR, FINE_COLOUR, GRAIN_COLOUR, GLASS_COLOUR = "#0072B2", "#E66100", "#E2E2E2", "#B8B8B8"
GLASS = 0.10  # Opacity of a grain where the flow is shown
NOTHING = 1e-30  # Drawn for a flux of 0, which has no logarithm
WIDEST = 0.12  # Radius of the pipe of the largest flux, in radii of a grain
THINNEST_PIPE = 0.12  # Radius of the pipe of a flux below the colours, over that of the largest
FLOW_COLOURS = ["#E4F4CB", "#C7E9B4", "#7FCDBB", "#41B6C4", "#1D91C0", "#225EA8", "#253494"]
FLOW_COLOURS += ["#081D58"]
"""From the lower to the upper limit (YlGnBu of ColorBrewer)."""
FLUX = "flux of a throat,\n% of the first flow"  # Title of these colours
BRIGHTEST, DECADES = 99.5, 2.0
"""Percentile of the first state's values at which they end, and how many decades they show."""


OBLIQUE, BROADSIDE = ((-1.1, -1.9, 0.9), (1500, 950)), ((-0.55, -1.9, 0.75), (1500, 760))
"""Where the fines, and the flow, are seen from, as seen from the middle of the box, and pixels.

From the front, a little from upstream and above; the mud should not hide the flow.
"""


def draw_pictures(work: dict[str, Any]) -> None:
    """Draw each frame of what `draw_frames` sends; the colours are the same in all of them."""
    import pyvista as pv

    bounds, still = np.array(work["box"]) * MM, pv.read(work["grains"])
    flow = work["frames"][0][1]  # of the first state; "" where no flow is shown
    toward, window = BROADSIDE if flow else OBLIQUE
    limits = colour_limits(pv.read(flow).cell_data["value"]) if flow else (0.0, 0.0)
    colours = {} if flow else colours_of(pv.read(work["frames"][-1][0]), bounds)
    for number, (spheres, lines, target) in enumerate(work["frames"], 1):
        state = pv.read(spheres)
        plotter: Any = pv.Plotter(off_screen=True, window_size=list(window))
        plotter.set_background("white")
        if flow:
            grains = still.point_data["kind"] == Kind.GRAIN
            glass = {"color": GLASS_COLOUR, "opacity": GLASS, "smooth_shading": True}
            plotter.add_mesh(_balls(still, grains, 24), **glass)
            _add_fines(plotter, state, bounds, color=FINE_COLOUR, ambient=0.25)
            radius = float(still.point_data["radius_m"].mean()) * MM
            _add_lines(plotter, pv.read(lines), radius, limits)
        else:
            own = state.n_points and np.any(state.point_data["kind"] == Kind.GRAIN)
            packed = state if own else still
            far = packed.points[:, 1] * MM > bounds[1].mean()
            far &= packed.point_data["kind"] == Kind.GRAIN
            if far.any():
                grey = {"color": GRAIN_COLOUR, "smooth_shading": True, "ambient": 0.15}
                plotter.add_mesh(_balls(packed, far, 32), **grey)
            _add_fines(plotter, state, bounds, **colours)
        _add_frame(plotter, bounds, depth_only=bool(flow))
        _look(plotter, bounds, toward)
        plotter.screenshot(target)
        plotter.close()
        if work["told"]:
            print(f"movie: {number} of {len(work['frames'])} states drawn", flush=True)


def _balls(spheres: Any, mask: Array, resolution: int) -> Any:
    """Spheres as triangles in mm, carrying `radius_um` and `depth_mm`."""
    import pyvista as pv

    points = pv.PolyData(spheres.points[mask] * MM)
    radius = spheres.point_data["radius_m"][mask]
    points.point_data["diameter"] = 2 * radius * MM
    points.point_data["radius_um"] = radius * MICRON
    points.point_data["depth_mm"] = points.points[:, 0]
    ball = pv.Sphere(radius=0.5, theta_resolution=resolution, phi_resolution=resolution)
    return points.glyph(geom=ball, scale="diameter", orient=False)


def _shown_fines(spheres: Any, bounds: Array) -> Array:
    """Which of the spheres are fines that are not far upstream."""
    if not spheres.n_points:
        return np.zeros(0, bool)
    shown = spheres.points[:, 0] * MM > bounds[0, 0] - UPSTREAM_SHOWN * np.ptp(bounds[0])
    return np.asarray((spheres.point_data["kind"] == Kind.FINE) & shown)


def colours_of(spheres: Any, bounds: Array) -> dict[str, Any]:
    """How the fines are coloured: by radius, or by depth where they are (nearly) of one size."""
    mask = _shown_fines(spheres, bounds)
    radius = spheres.point_data["radius_m"][mask] * MICRON if spheres.n_points else np.zeros(0)
    if len(radius) and np.ptp(radius) >= 0.02 * radius.max():
        name, title, limits = "radius_um", "fines, radius (µm)", [radius.min(), radius.max()]
    else:
        depth = spheres.points[mask, 0] * MM if len(radius) else np.zeros(1)
        deepest = min(float(np.quantile(depth, DEEPEST)), bounds[0, 1])
        name, title = "depth_mm", "fines, depth (mm)"
        limits = [bounds[0, 0], max(deepest, 0.1 * bounds[0, 1])]
    bar = _bar(title, labels=5)
    return {"scalars": name, "clim": limits, "cmap": "plasma", "scalar_bar_args": bar}


def _bar(title: str, *, labels: int) -> dict[str, Any]:
    letters = {"color": "black", "title_font_size": 22, "label_font_size": 22, "fmt": "%.3g"}
    place = {"vertical": True, "position_x": 0.88, "position_y": 0.15, "width": 0.07}
    return {"title": f"{title}\n", "n_labels": labels, "height": 0.65, **letters, **place}


def _add_fines(plotter: Any, spheres: Any, bounds: Array, **style: Any) -> None:
    mask = _shown_fines(spheres, bounds)
    if mask.any():
        drawn = _balls(spheres, mask, int(np.clip(np.sqrt(TRIANGLES / mask.sum()), 5, 16)))
        plotter.add_mesh(drawn, smooth_shading=True, **style)


def colour_limits(values: Array) -> tuple[float, float]:
    """Two decades below the largest values (N,), rounded to one digit; of values above 0."""
    most = float(np.percentile(values[values > 0], BRIGHTEST)) if np.any(values > 0) else 1.0
    digit = 10.0 ** np.floor(np.log10(most))
    high = float(np.ceil(most / digit) * digit)
    return high / 10.0**DECADES, high


def _add_lines(plotter: Any, mesh: Any, radius: float, limits: tuple[float, float]) -> None:
    """Throats as pipes among grains of a mean `radius`, as wide as their flux."""
    mesh.points = mesh.points * MM
    if not mesh.n_points:
        return
    scale = {"scalars": "value", "log_scale": True, "clim": limits, "cmap": FLOW_COLOURS}
    look = {"ambient": 0.35, "smooth_shading": True, "scalar_bar_args": _bar(FLUX, labels=3)}
    plotter.add_mesh(_pipes(mesh, radius, limits[1]), **scale, **look)


def _pipes(mesh: Any, radius: float, most: float) -> Any:
    """Pipes whose radius grows like the fourth root of the flux, as that of Poiseuille's does."""
    import pyvista as pv

    value = np.asarray(mesh.cell_data["value"])
    width = WIDEST * radius * np.clip(value / most, THINNEST_PIPE**4, 1.0) ** 0.25
    ends = np.asarray(mesh.lines).reshape(-1, 3)[:, 1:]
    lines = np.insert(np.arange(ends.size).reshape(-1, 2), 0, 2, axis=1)
    apart = pv.PolyData(np.asarray(mesh.points)[ends.ravel()], lines=lines.ravel())
    apart.point_data["width"] = np.repeat(width, 2)
    apart.point_data["value"] = np.repeat(np.maximum(value, NOTHING), 2)
    return apart.tube(scalars="width", absolute=True, n_sides=10, capping=True)


def _add_frame(plotter: Any, bounds: Array, *, depth_only: bool) -> None:
    """The box with its scales (mm), or that of the depth alone, and the formation face."""
    import pyvista as pv

    (x0, _), (y0, y1), (z0, z1) = bounds
    sides = tuple(bounds.ravel())
    plotter.add_mesh(pv.Box(sides), style="wireframe", color="black", line_width=2)
    size: Any = {"i_size": z1 - z0, "j_size": y1 - y0, "i_resolution": 1, "j_resolution": 1}
    face = pv.Plane(center=(x0, (y0 + y1) / 2, (z0 + z1) / 2), direction=(1, 0, 0), **size)
    edge = {"show_edges": True, "edge_color": FACE_COLOUR, "line_width": 3}
    plotter.add_mesh(face, color=FACE_COLOUR, opacity=0.18, **edge)
    place, text = [(x0, y1, z1 + 0.12 * (z1 - z0))], ["formation face x = 0"]
    alone = {"shape": None, "show_points": False, "always_visible": True}
    plotter.add_point_labels(place, text, font_size=22, text_color=FACE_COLOUR, **alone)
    titles = {"xtitle": "x (mm)", "ytitle": " ", "ztitle": " "}
    if not depth_only:
        titles |= {"ytitle": f"y: {y0:.3g} to {y1:.3g} mm", "ztitle": "z (mm)"}
    labels = {"show_ylabels": False, "show_zlabels": not depth_only, "fmt": "%.3g"}
    labels |= {"n_xlabels": 5, "n_ylabels": 3, "n_zlabels": 3, "font_size": 18, "color": "black"}
    plotter.show_bounds(bounds=sides, location="outer", grid=False, **titles, **labels)


def _look(plotter: Any, bounds: Array, toward: tuple[float, float, float]) -> None:
    """Look at the box so that it fills the window left of the scalar bar."""
    eye = np.array(toward) / np.linalg.norm(toward)
    right = np.cross([0.0, 0.0, 1.0], eye)
    right /= np.linalg.norm(right)
    up = np.cross(eye, right)
    wide, high = plotter.window_size
    corners = np.stack(np.meshgrid(*bounds), axis=-1).reshape(-1, 3) - bounds.mean(axis=1)
    width, height = np.ptp(corners @ right), np.ptp(corners @ up)
    scale = max(0.62 * height, 0.7 * width * high / wide)  # half the height of the window, mm
    focus = bounds.mean(axis=1) + 0.08 * scale * wide / high * right - 0.05 * scale * up
    distance = 4.6 * scale  # the axis labels grow with it
    plotter.camera_position = [tuple(focus + distance * eye), tuple(focus), (0, 0, 1)]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = scale
    plotter.reset_camera_clipping_range()


if __name__ == "__main__":
    draw_pictures(json.load(sys.stdin))
