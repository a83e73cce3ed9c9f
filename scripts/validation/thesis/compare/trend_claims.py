"""The seven trends of the thesis's chapter 4 and Figure 14, and the comparisons they claim."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from validation.thesis.compare.trend_quantities import RESPONSES
from validation.thesis.numbers.values import thesis_of
from validation.thesis.runs.plan import SPECIMENS

TRENDS = (
    "finer fines go deeper; fines of 1/3 of the grain size stop at the face",
    "fines below 1/5 of the grain size reduce porosity by about the same amount whatever their "
    "size",
    "finer fines impair permeability more, at the face and deep in the pack",
    "a spread of fine sizes gives a more even impairment than one size",
    "impairment is largest in the first millimetre",
    "higher initial porosity: more invasion, more impairment",
    "larger drag: deeper invasion",
)
MORE, ALIKE, ABOVE = "more", "alike", "above"
"""`one` has more than `other`, or as much within MARGIN of the larger, or more than `bound`."""
MARGIN = 0.20
"""Largest difference of two losses of porosity that counts as "about the same amount".

It is a share of the larger; the losses in the thesis itself are within 13 %.
"""
BY_SIZE = (SPECIMENS[0:3], SPECIMENS[3:6])
"""Specimens from coarse to fine, at porosity 0.30 and at 0.40."""
SPREAD = SPECIMENS[6]
"""The specimen with a spread of fine sizes, between those of specimens 2 and 3."""
SMALL = ((SPECIMENS[1], SPECIMENS[2], SPREAD), SPECIMENS[4:6])
"""Specimens with fines of 1/5 of the grain size and below, at porosity 0.30 and at 0.40."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One comparison that a trend claims, at full scale and in the quick forms.

    Attributes:
        trend: number of the trend, from 1.
        sense: MORE, ALIKE or ABOVE.
        quantity: what is compared, a name of QUANTITIES or RESPONSES.
        one: the specimen that has more.
        other: the specimen that it is compared with; empty for a bound.
        bound: the value that it is compared with for ABOVE.
    """

    trend: int
    sense: str
    quantity: str
    one: str
    other: str = ""
    bound: float = 0.0


def claims(scanned: Collection[str] = SPECIMENS) -> list[Claim]:
    """All comparisons; those of the drag are for the specimens `scanned`."""
    drag = [
        Claim(trend=7, sense=ABOVE, quantity=quantity, one=one)
        for quantity in RESPONSES
        for one in scanned
    ]
    return [*_depth(), *_alike(), *_impairment(), *_even(), *_first(), *_porosity(), *drag]


def _depth() -> Iterator[Claim]:
    for quantity in ("mean depth", "depth of 95 %"):
        yield from _finer(1, quantity)
    for coarse, *finer in BY_SIZE:
        for fine in finer:
            yield Claim(
                trend=1, sense=MORE, quantity="fines in the first mm", one=coarse, other=fine
            )
        yield Claim(
            trend=1,
            sense=ABOVE,
            quantity="fines in the first mm",
            one=coarse,
            bound=share_at_the_face(),
        )


def share_at_the_face() -> float:
    """The share of fines that "stop at the face", in per cent.

    It is the share in the first millimetre of the thesis's specimen 1.
    """
    thesis = thesis_of(SPECIMENS[0])
    assert thesis is not None
    assert thesis.count_first_mm is not None
    assert thesis.invaded_count is not None
    return 100 * thesis.count_first_mm / thesis.invaded_count


def _alike() -> Iterator[Claim]:
    for quantity in ("porosity loss", "porosity loss in the first mm"):
        for runs in SMALL:
            for at, one in enumerate(runs):
                for other in runs[at + 1 :]:
                    yield Claim(trend=2, sense=ALIKE, quantity=quantity, one=one, other=other)


def _impairment() -> Iterator[Claim]:
    for quantity in ("k reduction in the first mm", "k reduction from 1 to 4 mm"):
        yield from _finer(3, quantity)


def _even() -> Iterator[Claim]:
    """A more even impairment has a smaller share of the reduction in the first section."""
    for one in BY_SIZE[0]:
        yield Claim(
            trend=4,
            sense=MORE,
            quantity="first mm's share in the k reduction",
            one=one,
            other=SPREAD,
        )


def _first() -> Iterator[Claim]:
    for one in SPECIMENS:
        yield Claim(
            trend=5, sense=ABOVE, quantity="first mm's k reduction beyond any other's", one=one
        )


def _porosity() -> Iterator[Claim]:
    quantities = (
        "invaded fines",
        "mean depth",
        "porosity loss",
        "porosity loss in the first mm",
        "k reduction",
        "k reduction in the first mm",
    )
    for quantity in quantities:
        for dense, loose in zip(*BY_SIZE, strict=True):
            yield Claim(trend=6, sense=MORE, quantity=quantity, one=loose, other=dense)


def _finer(trend: int, quantity: str) -> Iterator[Claim]:
    """Each size is compared with the next coarser, and the finest with the coarsest."""
    for coarse, middle, fine in BY_SIZE:
        for one, other in ((middle, coarse), (fine, middle), (fine, coarse)):
            yield Claim(trend=trend, sense=MORE, quantity=quantity, one=one, other=other)
