"""How deep fines are pressed into grains, as predicted: by impact and by drag."""

import math
from dataclasses import dataclass

from fdnet.case.case import InvasionCase
from fdnet.errors import CaseError
from fdnet.scales.forces.push import Push, arrival_velocity, pore_width
from fdnet.scales.hertz import overlap_of_impact, overlap_under
from fdnet.scales.springs import Contact, mass_range, pair_radius

MOST_OVERLAP = 0.5
"""Predicted overlap over a fine's diameter from which a case is refused: beyond it a fine could
pass through a grain."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlaps:
    """Predicted overlaps of a fine with a grain, over the diameter of the largest fine.

    Attributes:
        drag: by drag and pressure gradient F on a fine at rest: F / k, or by Hertz.
        impact: by a fine that arrives at its fastest velocity w: w sqrt(m / k), or by Hertz.
    """

    drag: float
    impact: float


def overlaps_of(case: InvasionCase, contact: Contact, push: Push, porosity: float) -> Overlaps:
    """The overlaps in the `contact` of a grain and a fine, in a pack of a porosity.

    A fine comes with the fluid and gains speed by the pressure gradient across a pore.
    """
    radius, mass = case.fines.radius_range_m[1], mass_range(case.fines)[1]
    width = pore_width(porosity, case.grains.sauter_diameter_m)
    lightest = min(one.density for one in case.fines.components)
    velocity = arrival_velocity(push, radius, lightest, width)
    force = push.force(radius)
    if contact.elastic:
        modulus, joint = contact.elastic.modulus, pair_radius(case, ("grain", "fine"), radius)
        impact = overlap_of_impact(mass, velocity, modulus, joint)
        drag = overlap_under(force, modulus, joint)
    else:
        impact = velocity * math.sqrt(mass / contact.normal_stiffness)
        drag = force / contact.normal_stiffness
    return Overlaps(impact=impact / (2 * radius), drag=drag / (2 * radius))


def overlap_warnings(case: InvasionCase, overlaps: Overlaps) -> list[str]:
    """Overlaps above `run.max_overlap`, in words.

    Raises CaseError when drag or impact alone would press a fine half through a grain.
    """
    _refuse_deep(overlaps)
    return [
        f"predicted overlap under {name} is {100 * getattr(overlaps, name):.2g} % of a fine's "
        f"diameter (above run.max_overlap, {100 * case.run.max_overlap:.3g} %): raise "
        "run.stiffness_N_m"
        for name in ("impact", "drag")
        if getattr(overlaps, name) > case.run.max_overlap
    ]


def _refuse_deep(overlaps: Overlaps) -> None:
    """Raises CaseError when drag or impact alone would press a fine half through a grain."""
    remedies = {
        "drag": "drag.multiplier, fluid.viscosity_cP or fluid.velocity_m_s",
        "impact": "the velocity (fluid.velocity_m_s)",
    }
    for name, remedy in remedies.items():
        overlap = getattr(overlaps, name)
        if overlap > MOST_OVERLAP:
            raise CaseError(
                f"run.stiffness_N_m: {name} alone would press a fine {100 * overlap:.3g} % of its "
                f"diameter into a grain (limit {100 * MOST_OVERLAP:.0f} %); raise it, or lower "
                f"{remedy}"
            )
