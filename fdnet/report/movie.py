"""States of a run as a movie, one after the other (GIF or MP4), or below each other (PNG)."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fdnet.errors import CaseError
from fdnet.files import replacing
from fdnet.report.child import box_text, draw_frames
from fdnet.spheres.snapshot import Array

SECONDS_PER_FRAME = 30.0
"""Time that drawing one state may take."""
WIDTH, PANEL_WIDTH = 880, 1200
"""Pixels of a movie, and of pictures below each other, across."""
TITLE = 44
"""Pixels above each of the pictures below each other."""
LAST_FRAMES = 6
"""How long the last state stays, in frames."""
COLOURS, GIF_COLOURS = 256, 128
INK = (20, 20, 20)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MovieFrame:
    """One state: its file of spheres (.vtp), what stands above it, and its flow (.vtp) if any."""

    spheres: Path
    words: str
    lines: Path | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Scene:
    """What all frames share.

    Attributes:
        grains: spheres_initial.vtp; states may hold the fines alone.
        box: (3, 2) m.
        title: of the colours of the flow; "" where no flow is shown.
        limits: of these colours.
    """

    grains: Path
    box: Array
    title: str = ""
    limits: tuple[float, float] = (0.0, 0.0)


def write_movie(
    target: Path, frames: Sequence[MovieFrame], scene: Scene, *, per_second: float
) -> Path:
    """Draw the states in a child process and write them as one file.

    Args:
        target: the movie, .gif or .mp4, or a picture of all states below each other, .png.
        frames: at least one, in order.
        scene: what all frames share.
        per_second: frames a second.

    Raises:
        CaseError: another suffix, nothing could be drawn, or MP4 without imageio-ffmpeg.
    """
    refuse_suffix(target)
    write = _WRITERS[target.suffix.lower()]
    still = target.suffix.lower() == ".png"
    with tempfile.TemporaryDirectory() as folder:
        module, arguments = _drawing(frames, scene, folder)
        reason = draw_frames(module, arguments, seconds=60 + SECONDS_PER_FRAME * len(frames))
        if reason:
            raise CaseError(
                f"{target}: not drawn, because {reason}; the set-up installs software OpenGL, and "
                "invasion.pvd opens in ParaView without it"
            )
        files = [Path(folder, f"{number:04d}.png") for number in range(len(frames))]
        words = [frame.words for frame in frames]
        pictures = list(map(_titled if still else _captioned, files, words))
        with replacing(target) as part:
            write(part, pictures, per_second)
    return target


def _drawing(frames: Sequence[MovieFrame], scene: Scene, folder: str) -> tuple[str, list[str]]:
    """The module that draws the frames into a folder, and its arguments."""
    common = [str(scene.grains.absolute()), f"--box={box_text(scene.box)}"]
    if not scene.title:
        return "movie_frames", [*common, folder, *(str(one.spheres.absolute()) for one in frames)]
    low, high = scene.limits
    scale = [f"--title={scene.title}", f"--limits={low!r},{high!r}"]
    pairs = [(str(one.spheres.absolute()), str(one.lines)) for one in frames]
    return "flow_frames", [*common, *scale, folder, *(name for pair in pairs for name in pair)]


def refuse_suffix(target: Path) -> None:
    """Raise CaseError where the name ends in nothing that a movie can be written as."""
    if target.suffix.lower() not in _WRITERS:
        raise CaseError(f"{target}: ends in {target.suffix!r}, expected .gif, .mp4 or .png")
    if target.suffix.lower() == ".mp4" and find_spec("imageio_ffmpeg") is None:
        raise CaseError(
            f"{target}: MP4 needs the package imageio-ffmpeg; install it with pip install "
            "imageio-ffmpeg, or give a name that ends in .gif"
        )


def _captioned(path: Path, words: str) -> Any:
    """A frame of a movie, with words on it; both sides are even, as MP4 wants them."""
    from PIL import Image, ImageDraw

    with Image.open(path) as picture:
        height = 2 * round(0.5 * WIDTH * picture.height / picture.width)
        drawn = picture.convert("RGB").resize((WIDTH, height))
    ImageDraw.Draw(drawn).text((16, 12), words, fill=INK, font=_font(22))
    return drawn


def _titled(path: Path, words: str) -> Any:
    """A picture with a title above it."""
    from PIL import Image, ImageDraw

    with Image.open(path) as picture:
        height = round(PANEL_WIDTH * picture.height / picture.width)
        drawn = Image.new("RGB", (PANEL_WIDTH, height + TITLE), "white")
        drawn.paste(picture.convert("RGB").resize((PANEL_WIDTH, height)), (0, TITLE))
    ImageDraw.Draw(drawn).text((16, 12), words, fill=INK, font=_font(26))
    return drawn


def _font(size: int) -> Any:
    from PIL import ImageFont

    return ImageFont.load_default(size=size)


def _write_panels(path: Path, pictures: Sequence[Any], _: float) -> None:
    from PIL import Image

    heights = [picture.height for picture in pictures]
    whole = Image.new("RGB", (PANEL_WIDTH, sum(heights)), "white")
    for number, picture in enumerate(pictures):
        whole.paste(picture, (0, sum(heights[:number])))
    whole.quantize(COLOURS).save(path, "PNG", optimize=True)


def _write_gif(path: Path, pictures: Sequence[Any], per_second: float) -> None:
    colours = pictures[-1].quantize(GIF_COLOURS)
    small = [picture.quantize(palette=colours, dither=0) for picture in _lingering(pictures)]
    milliseconds = round(1000 / per_second)
    small[0].save(
        path, "GIF", save_all=True, append_images=small[1:], duration=milliseconds, loop=0
    )


def _write_mp4(path: Path, pictures: Sequence[Any], per_second: float) -> None:
    import imageio_ffmpeg

    extra = ["-f", "mp4"]
    stream = imageio_ffmpeg.write_frames(
        str(path), pictures[0].size, fps=per_second, output_params=extra
    )
    stream.send(None)
    for picture in _lingering(pictures):
        stream.send(picture.tobytes())
    stream.close()


def _lingering(pictures: Sequence[Any]) -> list[Any]:
    """The pictures of a movie, which stays on the last."""
    return [*pictures, *[pictures[-1]] * LAST_FRAMES]


_WRITERS: dict[str, Any] = {".gif": _write_gif, ".png": _write_panels, ".mp4": _write_mp4}
