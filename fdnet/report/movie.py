"""The invasion as a movie: the states of a run drawn one after the other, as GIF or MP4."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fdnet.errors import CaseError
from fdnet.files.atomic import replacing
from fdnet.report.child import box_text, draw_frames
from fdnet.spheres.snapshot import Array

SECONDS_PER_FRAME = 30.0
"""Time that drawing one state may take."""
SIZE = (960, 608)
"""Pixels of a movie; both even, as MP4 wants them."""
LAST_FRAMES = 6
"""How long the last state stays, in frames."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MovieFrame:
    """One state: its file of spheres (.vtp), and what stands above it."""

    spheres: Path
    words: str


def write_movie(
    target: Path, grains: Path, frames: Sequence[MovieFrame], *, box: Array, per_second: float
) -> Path:
    """Draw the states in a child process and write them as one file.

    Args:
        target: the movie; its suffix .gif or .mp4 says which kind.
        grains: spheres_initial.vtp, for states that hold the fines alone.
        frames: at least one, in order.
        box: (3, 2) m.
        per_second: frames a second.

    Raises:
        CaseError: another suffix, nothing could be drawn, or MP4 without imageio-ffmpeg.
    """
    write = _writer(target)
    with tempfile.TemporaryDirectory() as folder:
        files = [str(frame.spheres.absolute()) for frame in frames]
        arguments = [str(grains.absolute()), f"--box={box_text(box)}", folder, *files]
        reason = draw_frames(arguments, seconds=60 + SECONDS_PER_FRAME * len(frames))
        if reason:
            raise CaseError(
                f"{target}: no movie, because {reason}; the set-up installs software OpenGL, and "
                "invasion.pvd opens in ParaView without it"
            )
        pictures = [
            _captioned(Path(folder, f"{number:04d}.png"), frame.words)
            for number, frame in enumerate(frames)
        ]
        with replacing(target) as part:
            write(part, pictures + [pictures[-1]] * LAST_FRAMES, per_second)
    return target


def _writer(target: Path) -> Any:
    if target.suffix.lower() == ".gif":
        return _write_gif
    if target.suffix.lower() != ".mp4":
        raise CaseError(f"{target}: ends in {target.suffix!r}, expected .gif or .mp4")
    try:
        import imageio_ffmpeg  # noqa: F401
    except ModuleNotFoundError as error:
        raise CaseError(
            f"{target}: MP4 needs the package imageio-ffmpeg; install it with pip install "
            "imageio-ffmpeg, or give a name that ends in .gif"
        ) from error
    return _write_mp4


def _captioned(path: Path, words: str) -> Any:
    from PIL import Image, ImageDraw, ImageFont

    with Image.open(path) as picture:
        drawn = picture.convert("RGB").resize(SIZE)
    font = ImageFont.load_default(size=22)
    ImageDraw.Draw(drawn).text((16, 12), words, fill=(20, 20, 20), font=font)
    return drawn


def _write_gif(path: Path, pictures: Sequence[Any], per_second: float) -> None:
    colours = pictures[-1].quantize(256)
    small = [picture.quantize(palette=colours, dither=0) for picture in pictures]
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
    for picture in pictures:
        stream.send(picture.tobytes())
    stream.close()
