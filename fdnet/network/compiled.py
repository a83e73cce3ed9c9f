"""numba's compiler with a cache that follows the sources.

numba keeps compiled functions beside their own file and does not notice when a function they call changes in another
module. Here the cache lies in a folder named after a digest of all sources of this package, so a changed file is never
answered by old code; it also works where the package's own folder cannot be written. NUMBA_CACHE_DIR, when set, wins.
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
    """Folder below `root` for the code compiled from all modules in `sources`."""
    digest = hashlib.sha256()
    for path in sorted(sources.rglob("*.py")):
        digest.update(str(path.relative_to(sources)).encode() + b"\0" + path.read_bytes())
    return root / f"numba-{digest.hexdigest()[:16]}"


def _writable_root() -> Path:
    wanted = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "fdnet"
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted
    except (OSError, RuntimeError):
        return _own_folder(Path(tempfile.gettempdir()) / f"fdnet-{os.getuid()}")


def _own_folder(wanted: Path) -> Path:
    """`wanted`, closed to others, or a new one where somebody else made it: cached code is run as it is found."""
    with contextlib.suppress(OSError):
        wanted.mkdir(mode=0o700, exist_ok=True)
        told = wanted.lstat()
        if stat.S_ISDIR(told.st_mode) and told.st_uid == os.getuid() and not told.st_mode & 0o022:
            return wanted
    return Path(tempfile.mkdtemp(prefix="fdnet-"))


if not config.CACHE_DIR:  # type: ignore[attr-defined]
    config.CACHE_DIR = str(cache_folder(Path(__file__).parent, _writable_root()))  # type: ignore[attr-defined]

compiled = numba.njit(cache=True)
