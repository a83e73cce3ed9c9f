"""numba's compiler with a cache that follows the sources.

numba keeps compiled functions next to their own file and does not notice when a function that they
call changes in another module. Here the cache lies in a folder named after a digest of all sources
of this package, of the versions that compile them and of numba's settings, so old code never runs
for a changed file, and all installations with the same digest share it. NUMBA_CACHE_DIR, when set,
is used instead, as numba uses it.
"""

import contextlib
import hashlib
import os
import stat
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import types
from numba.core import config
from numba.core.caching import IndexDataCacheFile
from numba.extending import intrinsic

_SETTINGS = (
    *("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "ENABLE_AVX", "USING_SVML"),
    *("BOUNDSCHECK", "DEBUGINFO_DEFAULT"),
)
"""Settings of numba that change the code and that its own index does not tell apart."""


def cache_folder(sources: Path, root: Path) -> Path:
    """Folder below `root` for the code that is compiled from all modules in `sources`."""
    versions = [version(name) for name in ("numba", "llvmlite", "numpy")]
    settings = [getattr(config, name, None) for name in _SETTINGS]
    digest = hashlib.sha256(repr((versions, settings)).encode())
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
    """`wanted`, closed to others, for its code is run; or a new folder where it is somebody's."""
    with contextlib.suppress(OSError):
        wanted.mkdir(mode=0o700, exist_ok=True)
        status = wanted.lstat()
        ours = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid()
        if ours and not status.st_mode & 0o022:
            return wanted
    return Path(tempfile.mkdtemp(prefix="fdnet-"))


_PACKAGE = Path(__file__).parent
_SHARED: Path | None = None
"""The folder of the cache; None where the user's NUMBA_CACHE_DIR is taken."""
if not config.CACHE_DIR:  # type: ignore[attr-defined]
    _SHARED = cache_folder(_PACKAGE, _writable_root())
    config.CACHE_DIR = str(_SHARED)  # type: ignore[attr-defined]

COLD = _SHARED is not None and not any(_SHARED.rglob("*.nbi"))
"""Whether this version had compiled nothing when the process began."""
_said: set[str] = set()


def say_compiling() -> None:
    """Say once why the first analysis of a version takes longer."""
    if COLD and "compiling" not in _said:
        _said.add("compiling")
        print("fdnet: compiling, once for this version, about 40 s", file=sys.stderr, flush=True)


def _say_once(folder: str, what: str, error: Exception) -> None:
    """Report a cache that fails, once a process: it costs seconds, no result depends on it."""
    if what not in _said:
        _said.add(what)
        reason = str(error) or type(error).__name__
        print(f"fdnet: {folder}: the cache of compiled code {what} ({reason})", file=sys.stderr)


class _CheckedFile(IndexDataCacheFile):
    """numba's files of one function.

    A file that cannot be read is left aside and made anew. Where nothing can be written the
    function is compiled again in every process.
    """

    def load(self, key: Any) -> Any:
        """The compiled code for a signature, or None."""
        try:
            kept = super().load(key)
            if kept is None:
                return None
            own, data = kept
            if own != key:  # two processes took one name for the codes of two signatures
                raise ValueError("it is the code of another signature")
            return data
        except Exception as error:
            _say_once(self._cache_path, "was bad and is made anew", error)
            with contextlib.suppress(OSError):
                os.replace(self._index_path, self._index_path + ".bad")
            return None

    def save(self, key: Any, data: Any) -> None:
        """Keep the compiled code for a signature, if it can be written."""
        try:
            super().save(key, (key, data))
        except Exception as error:
            _say_once(self._cache_path, "cannot be written and is done without", error)


def _checked(function: Any, files: IndexDataCacheFile) -> _CheckedFile:
    """The files of a function; in the shared folder neither place nor age of its source counts."""
    name, source = files._index_name.removesuffix(".nbi"), Path(function.__code__.co_filename)
    folder = Path(files._cache_path)
    if _SHARED and folder.is_relative_to(_SHARED) and source.is_relative_to(_PACKAGE):
        folder = _SHARED / source.parent.relative_to(_PACKAGE)
        folder.mkdir(parents=True, exist_ok=True)
        return _CheckedFile(str(folder), name, "")
    return _CheckedFile(str(folder), name, files._source_stamp)


_PLAIN: dict[str, Any] = {
    **{"_nrt": True, "error_model": "python", "fastmath": False},
    "no_cfunc_wrapper": True,  # for C, which never calls: a sixth of the time of the compiler
}
"""Where these are not given, numba takes them from the function that makes the first call.

No function may round other than written (`fastmath`). A function that several others call has a
copy in the code of each. LLVM would round each copy in its own way, and which copy runs depends on
what the process loaded or compiled before.
"""
_LOOPS: dict[str, Any] = {"error_model": "numpy", "nogil": True}


def compiled(function: Any, **options: Any) -> Any:
    """The function, compiled by numba when it is first called, with its code kept on disk.

    `options` are those of numba's compiler. numba optimises a function anew in each that calls it,
    so a short chain of calls is compiled faster than a long one. An array that is made in compiled
    code, or set from another or from a tuple, costs half a second more. For a whole number that is
    written out a function is compiled apart, for `np.int64(0)` it is not.
    """
    options = _PLAIN | options
    try:
        result: Any = numba.njit(cache=True, **options)(function)
        result._cache._cache_file = _checked(function, result._cache._cache_file)
    except (RuntimeError, OSError, AttributeError) as error:
        _say_once(str(config.CACHE_DIR), "cannot be used", error)  # type: ignore[attr-defined]
        return numba.njit(function, **options)
    return result


def compiled_for_loops(function: Any) -> Any:
    """`compiled` so that the processor works on several numbers of a loop at once.

    A division by 0 gives an infinite number or none and does not end the function.
    """
    return compiled(function, **_LOOPS)


def loops_in_place(function: Any) -> Any:
    """`compiled_for_loops` for a function that writes into the arrays that it is given.

    It may neither make an array nor return one. Then nobody has to count who still holds which
    array, which numba otherwise does for each array of a tuple at each call (numba issue 2345).
    """
    return compiled(function, **_LOOPS, _nrt=False)


def loops_inside(function: Any) -> Any:
    """`loops_in_place` for compiled functions alone: Python cannot call it. Compiled sooner."""
    return compiled(function, **_LOOPS, _nrt=False, no_cpython_wrapper=True)


def _bits_of(_: Any, number: Any) -> Any:
    def generate(context: Any, builder: Any, _: Any, given: Any) -> Any:
        return builder.bitcast(given[0], context.get_value_type(types.uint64))

    return types.uint64(types.float64), generate


def _number_of(_: Any, bits: Any) -> Any:
    def generate(context: Any, builder: Any, _: Any, given: Any) -> Any:
        return builder.bitcast(given[0], context.get_value_type(types.float64))

    return types.float64(types.uint64), generate


bits_of: Any = intrinsic(_bits_of)
"""The bits of a number of double precision, as a whole number; for compiled functions only."""
number_of: Any = intrinsic(_number_of)
"""The number of double precision that has these bits; for compiled functions only."""


# ---- Work on several processor cores at once, in the threads of this process.
Part = TypeVar("Part")
Result = TypeVar("Result")
MOST_CORES = 8
"""More would hardly help, for some of the work runs on one core, and each takes some 80 MB."""
_here = threading.local()


def on_all_cores(work: Callable[[Part], Result], parts: Iterable[Part]) -> list[Result]:
    """What `work` gives for each of the `parts`, on up to `MOST_CORES` cores of this process.

    The environment variable NUMBA_NUM_THREADS may say fewer. Only functions that are
    `compiled_for_loops` run side by side. No part may write to what another one reads or writes,
    so the result does not depend on the number of cores. Work that is such a part itself does its
    own parts one after the other. The first error of a part is raised.
    """
    every = list(parts)
    most = int(config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    cores = min(most, MOST_CORES, len(every))
    if cores <= 1 or getattr(_here, "is_part", False):
        return [work(part) for part in every]
    with ThreadPoolExecutor(cores, initializer=setattr, initargs=(_here, "is_part", True)) as pool:
        return list(pool.map(work, every))
