"""How deep fines are pressed into grains, as predicted: by impact, by drag, in a deposit."""

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
LARGEST_CHAIN = 6.0
"""Largest force between two spheres of a deposit over the drop of pressure times the section of a
throat. Forces in packs of spheres go far beyond their mean, with an exponential tail (Radjai and
others, Phys. Rev. Lett. 77, 274, 1996). Runs of the quick specimen 5 had 1 to 8."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlaps:
    """Predicted overlaps of a fine with a grain, over the diameter of the largest fine.

    Attributes:
        drag: by drag and pressure gradient F on a fine at rest: F / k, or by Hertz.
        impact: by a fine that arrives at its fastest velocity w: w sqrt(m / k), or by Hertz.
        deposit: where the flow follows the deposit, by `deposit_force`; 0 in the uniform field.
    """

    drag: float
    impact: float
    deposit: float


def deposit_force(case: InvasionCase, pressure: float, throat: float) -> float:
    """Largest force, N, on a fine of a deposit that takes up all the `pressure` Pa.

    The pressure acts on the section of a throat, of the width `throat` m. Contacts hand the forces
    on to each other, so that some bear several times as much (`LARGEST_CHAIN`). The uniform field
    knows of no such pressure: 0.
    """
    if case.drag.field != "network":
        return 0.0
    return LARGEST_CHAIN * pressure * math.pi / 4.0 * throat**2


def overlaps_of(
    case: InvasionCase, contact: Contact, push: Push, porosity: float, *, deposit: float
) -> Overlaps:
    """The overlaps in the `contact` of a grain and a fine, in a pack of a porosity.

    A fine comes with the fluid and gains speed by the pressure gradient across a pore. In a
    deposit it bears the force `deposit`, N.
    """
    radius, mass = case.fines.radius_range_m[1], mass_range(case.fines)[1]
    width = pore_width(porosity, case.grains.sauter_diameter_m)
    lightest = min(one.density for one in case.fines.components)
    velocity = arrival_velocity(push, radius, lightest, width)
    force = push.force(radius)
    if contact.elastic:
        modulus, joint = contact.elastic.modulus, pair_radius(case, ("grain", "fine"), radius)
        impact = overlap_of_impact(mass, velocity, modulus, joint)
        drag, held = (overlap_under(one, modulus, joint) for one in (force, deposit))
    else:
        impact = velocity * math.sqrt(mass / contact.normal_stiffness)
        drag, held = force / contact.normal_stiffness, deposit / contact.normal_stiffness
    return Overlaps(
        impact=impact / (2 * radius), drag=drag / (2 * radius), deposit=held / (2 * radius)
    )


def overlap_warnings(case: InvasionCase, overlaps: Overlaps) -> list[str]:
    """Overlaps above `run.max_overlap`, in words.

    Raises CaseError when one of them alone would press a fine half through a grain.
    """
    _refuse_deep(overlaps)
    return _deposit_warnings(case, overlaps.deposit) + [
        f"predicted overlap under {name} is {100 * getattr(overlaps, name):.2g} % of a fine's "
        f"diameter (above run.max_overlap, {100 * case.run.max_overlap:.3g} %): raise "
        "run.stiffness_N_m"
        for name in ("impact", "drag")
        if getattr(overlaps, name) > case.run.max_overlap
    ]


def _deposit_warnings(case: InvasionCase, overlap: float) -> list[str]:
    """A deposit that presses its fines too deep into each other, with the stiffness it needs."""
    if overlap <= case.run.max_overlap:
        return []
    hertz = case.contact.model == "hertz"
    raised = (overlap / case.run.max_overlap) ** (1.5 if hertz else 1.0)
    given = case.run.stiffness_N_m
    remedy = (
        "; the materials are too soft for this pressure"
        if given == "nominal"
        else f": set run.stiffness_N_m = {two_digits_up(raised * given):g}, or 'auto'"
    )
    return [
        f"predicted overlap of fines that hold the whole pressure is {100 * overlap:.2g} % of a "
        f"fine's diameter (above run.max_overlap, {100 * case.run.max_overlap:.3g} %){remedy}"
    ]


def two_digits_up(value: float) -> float:
    """The next number of two digits that is not below `value`, above 0."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit - 1e-9) * unit


def _refuse_deep(overlaps: Overlaps) -> None:
    """Raises CaseError when one of them alone would press a fine half through a grain."""
    remedies = {
        "drag": "drag.multiplier, fluid.viscosity_cP or fluid.velocity_m_s",
        "impact": "the velocity (fluid.velocity_m_s)",
        "deposit": "the pressure (fluid.overbalance_MPa, fluid.velocity_m_s)",
    }
    for name, remedy in remedies.items():
        overlap = getattr(overlaps, name)
        if overlap > MOST_OVERLAP:
            raise CaseError(
                f"run.stiffness_N_m: {name} alone would press a fine {100 * overlap:.3g} % of its "
                f"diameter into a grain (limit {100 * MOST_OVERLAP:.0f} %); set it to "
                f"'auto', raise it, or lower {remedy}"
            )
