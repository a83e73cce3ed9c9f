"""One line of the page of outside numbers."""

from dataclasses import dataclass

EXACT = 1e-5
"""Relative error below which no digit of it is shown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What was asked for, what came out, and whether they agree.

    Attributes:
        what: the quantity.
        expected: its value from outside, with the source.
        measured: what came out, with its band.
        holds: whether it is as expected; None where it is neither.
        verdict: words in place of "holds" and "fails"; "" for these.
        test: file of the reduced form.
    """

    what: str
    expected: str
    measured: str
    holds: bool | None
    test: str
    verdict: str = ""

    @property
    def word(self) -> str:
        """The verdict in words."""
        return self.verdict or {True: "holds", False: "**fails**", None: "open"}[self.holds]


def percent_error(error: float) -> str:
    """A relative error with its sign, in percent."""
    if abs(error) < EXACT:
        return f"within {100 * EXACT:g} %"
    return f"{100 * error:+.2g} %".replace("-", "−")
