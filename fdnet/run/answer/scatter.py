"""How much the answer of one seed differs from that of another, from published repeats."""

from dataclasses import dataclass

SOURCE = "docs/thesis/results.csv"


@dataclass(frozen=True, slots=True, kw_only=True)
class Scatter:
    """One standard deviation of a single run, pooled over cases.

    Attributes:
        depth: of the depth of 95 % of the fines, over its mean.
        loss: of the share of permeability that the first millimetre loses; a difference.
        runs: number of runs.
        cases: the cases whose seeds were repeated.
        source: where their results are, in words.
    """

    depth: float
    loss: float
    runs: int
    cases: tuple[str, ...]
    source: str


QUICK = Scatter(
    depth=0.36,
    loss=0.067,
    runs=30,
    cases=tuple(f"quick-specimen{number}" for number in (1, 2, 4, 5, 7, 8)),
    source=f"quick specimens 1, 2, 4, 5, 7 and 8 of {SOURCE}",
)
"""Specimens of 110 grains, 3 grains wide."""
FULL = Scatter(
    depth=0.42,
    loss=0.019,
    runs=12,
    cases=tuple(f"specimen{number}" for number in (1, 2, 4, 5)),
    source=f"specimens 1, 2, 4 and 5 of {SOURCE}",
)
"""Specimens of 1,200 to 1,400 grains, 8 grains wide."""
QUICK_GRAINS = 500
"""Number of grains below which a specimen is compared with the quick ones."""


def scatter_of(grains: int) -> Scatter:
    """The scatter of published specimens of about as many grains."""
    return QUICK if grains < QUICK_GRAINS else FULL
