"""Cohesion of Hertz contacts by LIGGGHTS's SJKR: attraction c times the area of contact.

Two spheres that overlap by delta intersect in a circle of the area 2 pi R* delta, to first order.
The force 4/3 E* sqrt(R*) delta^(3/2) - 2 pi c R* delta pulls below the overlap at rest, most at
4/9 of it. With linear springs both terms grow alike and nothing would pull.
"""

import math
from dataclasses import dataclass

from fdnet.case.case import InvasionCase
from fdnet.errors import CaseError
from fdnet.scales.overlaps import MOST_OVERLAP
from fdnet.scales.springs import Contact, pair_radius


@dataclass(frozen=True, slots=True, kw_only=True)
class PullOff:
    """What it takes to part two cohesive spheres.

    Attributes:
        force: N, the largest pull that the contact bears.
        overlap: m, at this pull.
        resting: m, the overlap without a pull.
    """

    force: float
    overlap: float
    resting: float


def pull_off(cohesion: float, modulus: float, radius: float) -> PullOff:
    """Of a cohesion c in J/m3, E* in Pa and R* in m.

    The force is 2/3 (pi c)^3 R*^2 / E*^2 at the overlap (pi c / E*)^2 R*; at rest it is 9/4 of it.
    """
    overlap = (math.pi * cohesion / modulus) ** 2 * radius
    force = 2 / 3 * (math.pi * cohesion) ** 3 * radius**2 / modulus**2
    return PullOff(force=force, overlap=overlap, resting=2.25 * overlap)


def pull_off_of(case: InvasionCase, contact: Contact) -> PullOff:
    """Of the largest fine and a grain, whose `contact` it is; all zero without cohesion."""
    density, radius = case.contact.cohesion_J_m3, case.fines.radius_range_m[1]
    if density is None or contact.elastic is None:
        return PullOff(force=0.0, overlap=0.0, resting=0.0)
    joint = pair_radius(case, ("grain", "fine"), radius)
    return pull_off(density, contact.elastic.modulus, joint)


def cohesion_warnings(case: InvasionCase, contact: Contact) -> list[str]:
    """A resting overlap above `run.max_overlap`, in words.

    Raises CaseError when cohesion alone would draw a fine half into a grain.
    """
    share = _resting_share(case, contact)
    if share > MOST_OVERLAP:
        raise CaseError(
            f"contact.cohesion_J_m3: {case.contact.cohesion_J_m3:g} draws a fine "
            f"{100 * share:.3g} % of its diameter into a grain (limit "
            f"{100 * MOST_OVERLAP:.0f} %); lower it, or raise run.stiffness_N_m"
        )
    if share <= case.run.max_overlap:
        return []
    return [
        f"cohesion draws a fine {100 * share:.2g} % of its diameter into a grain (above "
        f"run.max_overlap, {100 * case.run.max_overlap:.3g} %): lower contact.cohesion_J_m3 or "
        "raise run.stiffness_N_m"
    ]


def _resting_share(case: InvasionCase, contact: Contact) -> float:
    return pull_off_of(case, contact).resting / (2 * case.fines.radius_range_m[1])
