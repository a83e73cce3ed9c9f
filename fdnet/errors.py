"""What can go wrong, one class for each stage, and warnings, each with its kind.

Each message names what is wrong, where, what was expected and what to do.
"""

import errno
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache


class FdnetError(Exception):
    """Anything that fdnet refuses; the other errors are kinds of it.

    `exit_code` is the exit code of the command line.

    Examples:
        >>> import fdnet
        >>> try:
        ...     fdnet.open_run("no/such/folder")
        ... except fdnet.FdnetError as error:
        ...     print(error)
        no/such/folder: does not exist; give the folder of a finished fdnet run
    """

    exit_code = 2


class CaseError(FdnetError):
    """A parameter is missing, unknown or out of range, or an input or run folder cannot be used.

    Examples:
        >>> import fdnet
        >>> fdnet.Snapshot.from_arrays([[0, 0, 0]], -1.0)
        Traceback (most recent call last):
            ...
        fdnet.errors.CaseError: radius holds -1.0, expected numbers above 0, m
    """

    exit_code = 2


class DeckError(FdnetError):
    """A template or variable is missing, or a variable is offered but never used.

    Examples:
        >>> import fdnet
        >>> fdnet.DeckError.exit_code
        2
    """

    exit_code = 2


class LiggghtsError(FdnetError):
    """LIGGGHTS cannot start, failed, or did not really finish.

    Examples:
        >>> import fdnet
        >>> fdnet.run_case("cases/quick.toml", "runs/other", liggghts="/no/such/program")
        Traceback (most recent call last):
            ...
        fdnet.errors.LiggghtsError: ...
    """

    exit_code = 3


class DumpError(LiggghtsError):
    """A dump is malformed or cut; the message carries path, line and step.

    Its exit code is 3 for a dump of a run of fdnet, and 2 for a file that a user gives. `cut`
    tells that the file or a frame ends too early.

    Examples:
        >>> import fdnet, pathlib
        >>> _ = pathlib.Path("cut.dump").write_text("ITEM: TIMESTEP\\n")
        >>> fdnet.read_spheres("cut.dump")
        Traceback (most recent call last):
            ...
        fdnet.errors.DumpError: cut.dump:1: ...
    """

    cut = False


class NetworkError(FdnetError):
    """The geometry is degenerate: no tetrahedra, coincident grains, no inlet or no outlet.

    Examples:
        >>> import fdnet
        >>> fdnet.build_network(fdnet.Snapshot.from_arrays([[0, 0, 0], [1, 0, 0]], 0.5))
        Traceback (most recent call last):
            ...
        fdnet.errors.NetworkError: tessellation: 2 of 2 grains reach into the box; ...
    """

    exit_code = 4


class FlowError(FdnetError):
    """A conductance is not finite or negative, or the solve did not converge.

    Examples:
        >>> import fdnet, numpy as np
        >>> places = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]
        >>> network = fdnet.build_network(fdnet.Snapshot.from_arrays(places, 0.5))
        >>> fdnet.solve_flow(network, np.full(len(network.throat_radius), -1.0))
        Traceback (most recent call last):
            ...
        fdnet.errors.FlowError: throat 0: conductance -1.0 m3 is not finite or negative ...
    """

    exit_code = 4


class MechanicsError(FdnetError):
    """A pack does not carry a load, or its mechanics cannot be solved.

    Examples:
        >>> import fdnet
        >>> case = fdnet.read_case("cases/quick.toml")
        >>> alone = fdnet.Snapshot.from_arrays([[0, 0, 0]], 0.5, box=[[-2, 2]] * 3)
        >>> fdnet.elastic_moduli(alone, case)
        Traceback (most recent call last):
            ...
        fdnet.errors.MechanicsError: ... carries no load along x: ...
    """

    exit_code = 4


_CURES = {
    errno.ENOSPC: "free space or files (inodes)",
    errno.EDQUOT: "free space or files (inodes)",
    errno.EMFILE: "raise the number of files that may be open (ulimit -n)",
    errno.ENFILE: "wait until other programs have closed files",
}
"""What to do about an error of the system."""


def cure_of(error: OSError) -> str:
    """What a user can do about an error of the system."""
    return _CURES.get(error.errno or 0, "free space or mend permissions")


def words_of(error: Exception) -> str:
    """What the system refused, in one line; "" for an error of another kind."""
    if isinstance(error, MemoryError):
        return f"not enough memory ({error}); supply fewer fines, or take a machine with more"
    if isinstance(error, OSError):
        where, what = error.filename or "system", error.strerror or error
        return f"{where}: {what}; {cure_of(error)}, then repeat the command (a run: with --resume)"
    if isinstance(error, ImportError | SystemError):  # Python's own, when memory runs out
        what = " ".join(str(error).split())[:200]
        return (
            f"a library cannot be loaded ({what}); give fdnet more memory, or install it again "
            "with scripts/setup.sh, then repeat the command (a run: with --resume)"
        )
    return ""


VIEW = "install VTK and pyvista with pip install 'fdnet[view]'"
"""What to do where they are missing: they serve 3-D pictures, movies and ParaView files alone."""


# ------------------------------------------------------------------------------------------------
# Warnings: each is raised as a `Doubt`, a text with its kind. `warnings.toml` has, for every kind,
# what follows from it, what to do, and where to read on.


PAGE = "docs/reference/warnings.md"
MIDDLE = 25  # Rank of a warning that has no kind, among those by importance
SHOWN = 3  # Most warnings on the first screen; the others are in the report and the summary


class Doubt(str):
    """A warning: its text, to be used as any other text, with the key of `warnings.toml`."""

    kind: str

    def __new__(cls, kind: str, text: str) -> "Doubt":
        doubt = super().__new__(cls, text)
        doubt.kind = kind
        return doubt

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]
        return self.kind, str(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One kind of warning."""

    key: str  # its place on the page
    follows: str
    do: str
    read: str  # page of the documentation
    says: tuple[str, ...] = ()  # which of "follows" and "do" the warning says itself


@cache
def catalogue() -> dict[str, Entry]:
    """All kinds of warnings by their keys."""
    import tomllib
    from importlib.resources import files

    text = files("fdnet").joinpath("warnings.toml").read_text(encoding="utf-8")
    rows = tomllib.loads(text)["warning"]
    return {one["key"]: Entry(**one | {"says": tuple(one.get("says", ()))}) for one in rows}


def explained(warning: str) -> str:
    """The warning with what it does not say itself: what follows, what to do, where to read.

    A text that is no `Doubt` stays as it is.
    """
    if not isinstance(warning, Doubt):
        return warning
    entry = catalogue()[warning.kind]
    missing = [
        f"{label}: {getattr(entry, name)}"
        for name, label in (("follows", "what follows"), ("do", "what to do"))
        if name not in entry.says
    ]
    return "; ".join([warning.rstrip("."), *missing]) + f" (see {PAGE}#{entry.key})"


def by_importance(sentences: Iterable[str]) -> list[str]:
    """Explained warnings, each once, in the order of their kinds; others keep the middle."""
    order = {key: rank for rank, key in enumerate(catalogue())}

    def rank(sentence: str) -> float:
        _, found, key = sentence.rpartition(f" (see {PAGE}#")
        return order.get(key.rstrip(")"), MIDDLE) if found else MIDDLE

    return sorted(dict.fromkeys(sentences), key=rank)
