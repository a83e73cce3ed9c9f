"""Pictures and movies by OpenGL, drawn in a process of their own, which OpenGL may end."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fdnet.files import replacing
from fdnet.spheres.snapshot import Array

PNG_START, PNG_END = b"\x89PNG\r\n\x1a\n", b"IEND"


def render_spheres_png(
    path: str | Path, spheres_vtp: str | Path, box: Array, *, seconds: float = 120.0
) -> str:
    """Draw the 3-D view of `spheres_vtp` into `path` in a child process.

    Returns "" or the reason why there is no picture; nothing is raised, and only a complete
    picture replaces `path`. `box` is (3, 2) m. Without usable OpenGL, VTK ends its process with no
    Python error; in a child process that costs the picture alone.
    """
    try:
        with replacing(path) as part:
            _run([*_command(spheres_vtp, box), str(part.absolute())], seconds)
            _refuse_half(part)
    except subprocess.TimeoutExpired:
        return f"the 3-D picture was given up after {seconds:g} s"
    except OSError as error:
        return f"no 3-D picture: {error}"
    return ""


def draw_frames(module: str, arguments: Sequence[str], *, seconds: float) -> str:
    """Run `module` (`movie_frames` or `flow_frames` of `fdnet.report`) in a child process.

    Returns "" or the reason why there are no frames.
    """
    try:
        _run([*_python(), "-m", f"fdnet.report.{module}", *arguments], seconds)
    except subprocess.TimeoutExpired:
        return f"the drawing was given up after {seconds:g} s"
    except OSError as error:
        return str(error)
    return ""


def _run(words: Sequence[str], seconds: float) -> None:
    """Run a child process. Raises TimeoutExpired after `seconds`, OSError when it fails."""
    done = subprocess.run(
        words,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=seconds,
        check=False,
        stdin=subprocess.DEVNULL,
        env=_child_environment(),
    )
    _refuse_failure(done)


def _command(spheres_vtp: str | Path, box: Array) -> list[str]:
    """The child's command line for one picture."""
    source = str(Path(spheres_vtp).absolute())
    return [*_python(), "-m", "fdnet.report.picture", source, f"--box={box_text(box)}"]


def box_text(box: Array) -> str:
    """The bounds of a box (3, 2) as the children of this module read them."""
    return ",".join(repr(float(value)) for value in np.asarray(box).ravel())


def _python() -> list[str]:
    """The interpreter, with the software OpenGL that the set-up may have installed."""
    libraries = Path(__file__).resolve().parents[2] / ".prefix" / "bin" / "with-libraries"
    return [*([str(libraries)] if os.access(libraries, os.X_OK) else []), sys.executable]


def _child_environment() -> dict[str, str]:
    """The environment with this very package first on the child's path."""
    here, before = str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH")
    return os.environ | {"PYTHONPATH": os.pathsep.join([here, before] if before else [here])}


class _NoPictureError(OSError):
    """Leaves `replacing` without replacing anything."""


def _refuse_failure(done: "subprocess.CompletedProcess[str]") -> None:
    """Raise _NoPictureError, with the reason, unless the child ended well."""
    if done.returncode:
        printed = [line.strip() for line in (done.stderr or "").splitlines() if line.strip()]
        how = (
            f"signal {-done.returncode}" if done.returncode < 0 else f"exit code {done.returncode}"
        )
        why = printed[-1][:200] if printed else "no usable OpenGL?"
        raise _NoPictureError(f"the drawing process ended with {how}; {why}")


def _refuse_half(part: Path) -> None:
    """Raise _NoPictureError unless `part` is a whole PNG."""
    picture = part.read_bytes() if part.is_file() else b""
    if not (picture.startswith(PNG_START) and PNG_END in picture[-12:]):
        raise _NoPictureError("the drawing process left no complete PNG")
