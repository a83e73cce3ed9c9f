"""The table `sizes` of grains, fines and materials: a measured curve of sizes.

All sizes in it are diameters, as sieves and laser instruments give them.
"""

from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from fdnet.case.values import Part, Positive, as_tuple
from fdnet.sizes.curve import NUMBER, SURFACE, VOLUME, SizeCurve, cut_curve
from fdnet.sizes.fit import Fit, best_fit
from fdnet.sizes.laws import Law, Points

MOST_POINTS = 1000
"""Most rows of a measured curve."""
_POWERS = {"volume": VOLUME, "mass": VOLUME, "surface": SURFACE, "number": NUMBER}
_ROUNDING = 1e-6
LEAST_RATIO, MOST_RATIO = 1.001, 1000.0
"""Smallest and largest ratio of two neighbours of D10, D50 and D90; spheres of nearly one size are
given by `radius_mm`."""

Lengths = Annotated[
    tuple[Positive, ...], BeforeValidator(as_tuple), Field(min_length=2, max_length=MOST_POINTS)
]
Percent = Annotated[float, Field(ge=0, le=100)]
Percents = Annotated[
    tuple[Percent, ...], BeforeValidator(as_tuple), Field(min_length=2, max_length=MOST_POINTS)
]
Cut = Annotated[tuple[Percent, Percent], BeforeValidator(as_tuple)]


class Sizes(Part):
    """A curve of sizes: D10, D50 and D90, or the points of a sieve or laser measurement."""

    D10_mm: Positive | None = Field(None, description="Diameter that 10 % are finer than.")
    D50_mm: Positive | None = Field(None, description="Median diameter.")
    D90_mm: Positive | None = Field(None, description="Diameter that 90 % are finer than.")
    shape: Literal["log-normal", "rosin-rammler"] | None = Field(
        None,
        description="Law through D10, D50 and D90. When absent: the one of the two that misses "
        "them least, for two given diameters the log-normal one.",
    )
    size_mm: Lengths | None = Field(
        None, description="Diameters of a measured curve, rising; it is straight over ln d."
    )
    passing_percent: Percents | None = Field(
        None, description="What is finer than each of `size_mm`, rising to 100."
    )
    by: Literal["mass", "volume", "surface", "number"] = Field(
        "mass",
        description="What the percentages count. Mass and volume are the same for one material.",
    )
    cut_percent: Cut = Field(
        (1.0, 99.0),
        description="Ends of the curve, by volume: finer and coarser sizes are left out, and the "
        "summary says what share of the solids they are.",
    )

    @model_validator(mode="after")
    def _is_a_curve(self) -> Self:
        for problem in _problems(self):
            raise PydanticCustomError("size_curve", "{problem}", {"problem": problem})
        return self

    @property
    def asked(self) -> dict[float, float]:
        """Diameters, m, by the share that is finer, of those among D10, D50 and D90 given."""
        given = {0.1: self.D10_mm, 0.5: self.D50_mm, 0.9: self.D90_mm}
        return {share: size * 1e-3 for share, size in given.items() if size is not None}

    @property
    def points(self) -> Iterator[tuple[float, float]]:
        """Share finer and diameter, m, of each point of a measured curve."""
        for size, finer in zip(self.size_mm or (), self.passing_percent or (), strict=False):
            yield finer / 100, size * 1e-3

    @cached_property
    def fit(self) -> Fit | None:
        """The law through D10, D50 and D90; None for a measured curve."""
        return best_fit(self.asked, self.shape) if self.size_mm is None else None

    @cached_property
    def law(self) -> Law:
        """The law of the whole, by `by`."""
        if self.fit is not None:
            return self.fit.law
        assert self.size_mm is not None
        assert self.passing_percent is not None
        finer = [one / 100 for one in self.passing_percent]
        return Points(tuple(one * 1e-3 for one in self.size_mm), (*finer[:-1], 1.0))

    def curve(self, finest: float = 0.0) -> SizeCurve:
        """The curve between its cuts, m; nothing finer than `finest` m."""
        low, high = self.cut_percent
        cut = (low / 100, high / 100)
        return cut_curve(self.law, by=_POWERS[self.by], cut=cut, finest=finest)


def _problems(sizes: Sizes) -> Iterator[str]:
    given = {share: size for share, size in sizes.asked.items() if size is not None}
    measured = sizes.size_mm is not None or sizes.passing_percent is not None
    if measured and given:
        yield "gives D10, D50 or D90 beside a measured curve; give one of the two"
    elif measured:
        yield from _measured_problems(sizes)
    elif len(given) < 2:
        yield (
            f"gives {len(given)} of D10, D50 and D90, expected two or three of them (one diameter "
            "has no spread), or size and passing of a measured curve, or a file"
        )
    elif not all(LEAST_RATIO <= b / a <= MOST_RATIO for a, b in pairwise(given.values())):
        texts = ", ".join(f"D{100 * share:.0f} {1e3 * size:g} mm" for share, size in given.items())
        yield (
            f"{texts}: must rise from D10 to D90, each {LEAST_RATIO} to {MOST_RATIO:g} times the "
            "one before"
        )
    if sizes.cut_percent[0] >= sizes.cut_percent[1]:
        yield f"cut_percent {list(sizes.cut_percent)} must rise, [finest, coarsest]"
    elif not measured and not 0 < sizes.cut_percent[0] < sizes.cut_percent[1] < 100:
        yield (
            f"cut_percent {list(sizes.cut_percent)}: the law of D10, D50 and D90 has no ends, "
            "expected cuts above 0 and below 100"
        )


def _measured_problems(sizes: Sizes) -> Iterator[str]:
    size, finer = sizes.size_mm, sizes.passing_percent
    if size is None or finer is None:
        yield "a measured curve needs both size_mm and passing_percent"
    elif len(size) != len(finer):
        yield f"{len(size)} sizes with {len(finer)} percentages, expected as many of both"
    elif sizes.shape is not None:
        yield f"shape {sizes.shape!r} belongs to D10, D50 and D90, not to a measured curve"
    elif finer[0] > 0 and sizes.by in ("number", "surface"):
        yield (
            f"the curve by {sizes.by} begins at {finer[0]:g} %, expected 0 %: spheres of unknown "
            "size have no volume"
        )
    else:
        yield from _order_problems(size, finer)


def _order_problems(size: tuple[float, ...], finer: tuple[float, ...]) -> Iterator[str]:
    for (a, b), (p, q) in zip(pairwise(size), pairwise(finer), strict=True):
        if b < (1 + _ROUNDING) * a:
            yield f"size_mm must rise, but {b:g} mm follows {a:g} mm"
            return
        if p > q:
            yield (
                f"the curve must not fall: {p:g} % pass {a:g} mm, but {q:g} % pass {b:g} mm; "
                "are these percentages of each fraction, or retained?"
            )
            return
    if abs(finer[-1] - 100) > 100 * _ROUNDING:
        yield (
            f"the curve ends at {finer[-1]:g} % at {size[-1]:g} mm, expected 100 %: add the size "
            "that all passes"
        )
