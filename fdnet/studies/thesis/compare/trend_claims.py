"""The seven trends of the thesis's chapter 4 (and Figure 14), each as the comparisons that it claims."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from fdnet.studies.thesis.compare.trend_quantities import RESPONSES
from fdnet.studies.thesis.numbers.values import thesis_of
from fdnet.studies.thesis.runs.plan import SPECIMENS

TRENDS = (
    "finer fines go deeper; fines of 1/3 of the grain size stop at the face",
    "fines below 1/5 of the grain size reduce porosity by about the same amount whatever their size",
    "finer fines impair permeability more, at the face and deep in the pack",
    "a spread of fine sizes gives a more even impairment than one size",
    "impairment is largest in the first millimetre",
    "higher initial porosity: more invasion, more impairment",
    "larger drag: deeper invasion",
)
MORE, ALIKE, ABOVE = "more", "alike", "above"
"""`one` has more than `other`; as much within MARGIN of the larger; more than `bound`."""
MARGIN = 0.20
"""Of the larger of two losses of porosity: what still is "about the same amount". The thesis's own are within 13 %."""
BY_SIZE = (SPECIMENS[0:3], SPECIMENS[3:6])
"""From coarse to fine, at porosity 0.30 and 0.40."""
SPREAD = SPECIMENS[6]
"""At porosity 0.30, its fines between those of specimens 2 and 3."""
SMALL = ((SPECIMENS[1], SPECIMENS[2], SPREAD), SPECIMENS[4:6])
"""Fines of 1/5 of the grain size and below."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """`quantity` of the runs `one` is MORE than, or ALIKE, that of `other`, or ABOVE `bound`. Names of specimens; the
    quick forms are held to the same."""

    trend: int
    sense: str
    quantity: str
    one: str
    other: str = ""
    bound: float = 0.0


def claims(scanned: Collection[str] = SPECIMENS) -> list[Claim]:
    """All comparisons; those of the drag for the specimens `scanned`."""
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
    """What "stop at the face" means, %: the share that the thesis has in the first millimetre of its specimen 1."""
    told = thesis_of(SPECIMENS[0])
    assert told is not None
    assert told.count_first_mm is not None
    assert told.invaded_count is not None
    return 100 * told.count_first_mm / told.invaded_count


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
    """More even: a smaller share of the reduction in the first section."""
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
    """Each size against the next coarser, and the finest against the coarsest."""
    for coarse, middle, fine in BY_SIZE:
        for one, other in ((middle, coarse), (fine, middle), (fine, coarse)):
            yield Claim(trend=trend, sense=MORE, quantity=quantity, one=one, other=other)
