"""numba's compiler with a cache that follows the sources.

numba keeps compiled functions next to their own file and does not notice when a function that they
call changes in another module. Here the cache lies in a folder named after a digest of all sources
of this package, so old code never runs for a changed file. It also works where the folder of the
package cannot be written. NUMBA_CACHE_DIR, when set, is used instead.
"""

import contextlib
import hashlib
import os
import stat
import tempfile
from pathlib import Path

import numba
from numba.core import config

__all__ = ["compiled"]


def cache_folder(sources: Path, root: Path) -> Path:
    """Folder below `root` for the code that is compiled from all modules in `sources`."""
    digest = hashlib.sha256()
    for path in sorted(sources.rglob("*.py")):
        digest.update(str(path.relative_to(sources)).encode() + b"\0" + path.read_bytes())
    return root / f"numba-{digest.hexdigest()[:16]}"


def _writable_root() -> Path:
    """The cache folder of the user, or one of our own where that cannot be written."""
    wanted = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "fdnet"
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted
    except (OSError, RuntimeError):
        return _own_folder(Path(tempfile.gettempdir()) / f"fdnet-{os.getuid()}")


def _own_folder(wanted: Path) -> Path:
    """`wanted`, closed to others, or a new folder where somebody else made it.

    Cached code is run without a check, so nobody else may write it.
    """
    with contextlib.suppress(OSError):
        wanted.mkdir(mode=0o700, exist_ok=True)
        status = wanted.lstat()
        ours = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid()
        if ours and not status.st_mode & 0o022:
            return wanted
    return Path(tempfile.mkdtemp(prefix="fdnet-"))


if not config.CACHE_DIR:  # type: ignore[attr-defined]
    _folder = cache_folder(Path(__file__).parent, _writable_root())
    config.CACHE_DIR = str(_folder)  # type: ignore[attr-defined]

compiled = numba.njit(cache=True)
