"""What can go wrong, one class for each stage.

Each message names what is wrong, where, what was expected and what to do.
"""


class FdnetError(Exception):
    """Anything fdnet refuses; `exit_code` is what the command line ends with."""

    exit_code = 2


class CaseError(FdnetError):
    """A parameter is missing, unknown or outside its range, or a file or folder cannot be used."""

    exit_code = 2


class DeckError(FdnetError):
    """A template or variable is missing, or a variable is offered but never used."""

    exit_code = 2


class LiggghtsError(FdnetError):
    """LIGGGHTS cannot start, failed, or did not really finish."""

    exit_code = 3


class DumpError(LiggghtsError):
    """A dump is malformed or truncated; the message carries path, line and step."""


class NetworkError(FdnetError):
    """Degenerate geometry: no tetrahedra, coincident grains, empty inlet or outlet set."""

    exit_code = 4


class FlowError(FdnetError):
    """A conductance is not finite or negative, or the solve did not converge."""

    exit_code = 4
