"""How deep the damage reaches and how much permeability is left there."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fdnet.case.names import ALL_SPHERES
from fdnet.run.answer.skin import Step

if TYPE_CHECKING:
    from fdnet.network.analysis import Analysis

DAMAGED_FROM = 0.05
"""Share of its permeability that a layer must have lost to count as damaged."""
_TOUCH = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Zone:
    """The damaged zone.

    Attributes:
        depth: m, where its deepest damaged layer ends; 0 without damage.
        ratio: permeability of the zone with the fines over that without, layers in series; 1
            without damage.
        before: m2, permeability of the zone without the fines; None without damage.
        after: m2, with the fines; None without damage.
        open_end: whether the last layer of the specimen is damaged too, so that the damage may
            reach further than the specimen.
    """

    depth: float
    ratio: float
    before: float | None
    after: float | None
    open_end: bool


def steps_of(analysis: "Analysis") -> list[Step]:
    """Permeability by depth, in place: thin layers of the first millimetre, then the sections.

    The layers are left out where the sections are not by the same law, and where those in a
    section resist more than it does. Sections that the layers reach into keep what is left of
    their resistance.
    """
    whole = [
        Step(near=s.x_lo, far=s.x_hi, before=s.k_initial_inplace, after=s.k_damaged_inplace)
        for s in analysis.sections
    ]
    layers = analysis.layers
    if layers is None or analysis.damage_law_used != ALL_SPHERES:
        return whole
    thin = [
        Step(near=float(a), far=float(b), before=float(k0), after=float(k1))
        for a, b, k0, k1 in zip(
            layers.edges[:-1], layers.edges[1:], layers.k_initial, layers.k_damaged, strict=True
        )
    ]
    end = thin[-1].far
    behind = [one for one in whole if one.near >= end * (1 - _TOUCH)]
    cut = [one for one in whole if one.near < end * (1 - _TOUCH) < end * (1 + _TOUCH) < one.far]
    for one in cut:
        inside = [layer for layer in thin if layer.near >= one.near - _TOUCH * end]
        before, after = (_rest(one, inside, which) for which in ("before", "after"))
        if before is None or after is None:
            return whole
        behind = [Step(near=end, far=one.far, before=before, after=after), *behind]
    return [*thin, *behind]


def _rest(section: Step, inside: Sequence[Step], which: str) -> float | None:
    """Permeability of the rest of a section, m2, whose resistances in series make up the whole.

    None where the layers inside resist as much as the section or more.
    """
    k, parts = getattr(section, which), [getattr(one, which) for one in inside]
    if k <= 0 or any(part <= 0 for part in parts):
        return k
    resistance = (section.far - section.near) / k - sum(
        (one.far - one.near) / part for one, part in zip(inside, parts, strict=True)
    )
    return (section.far - inside[-1].far) / resistance if resistance > 0 else None


def zone_of(steps: Sequence[Step]) -> Zone:
    """The zone from the face to the end of the deepest layer that lost `DAMAGED_FROM` or more."""
    damaged = [index for index, one in enumerate(steps) if one.lost >= DAMAGED_FROM]
    if not damaged:
        return Zone(depth=0.0, ratio=1.0, before=None, after=None, open_end=False)
    inside = steps[: damaged[-1] + 1]
    before, after = (series([(s.far - s.near, k) for s, k in pairs]) for pairs in _both(inside))
    return Zone(
        depth=inside[-1].far,
        ratio=after / before if before > 0 else 0.0,
        before=before,
        after=after,
        open_end=len(inside) == len(steps),
    )


def _both(steps: Sequence[Step]) -> Iterator[list[tuple[Step, float]]]:
    yield [(one, one.before) for one in steps]
    yield [(one, one.after) for one in steps]


def series(layers: Sequence[tuple[float, float]]) -> float:
    """Permeability, m2, of layers (thickness m, permeability m2) in series; 0 if one has 0."""
    if any(k <= 0 for _, k in layers):
        return 0.0
    return sum(thick for thick, _ in layers) / sum(thick / k for thick, k in layers)
