"""The pack of grains in closed form: its porosity, the number of grains, and how it is grown."""

import math

from fdnet.case.case import Case
from fdnet.scales.hertz import REFERENCE_OVERLAP
from fdnet.scales.springs import Contact, mass_range

PACK_STAGES, PACK_STAGE_STEPS, PACK_RELAX_STEPS, PACK_START, PACK_STEP = 30, 300, 20_000, 0.6, 0.15
"""Growth of a pack: number of stages and steps in each, steps of the first relaxation, radius at
the start over the final one, time step over sqrt(m/k)."""


def target_porosity(case: Case) -> float:
    """The porosity that the case names; with `grains.count` that of the plain sum of spheres."""
    if case.grains.count is not None:
        return 1 - case.grains.count * case.grains.mean_volume_m3 / math.prod(case.size_m)
    assert case.grains.porosity is not None
    return case.grains.porosity


def grain_count(case: Case) -> int:
    """First guess of the number of grains, (1 - phi) V / v, or the count that is given."""
    if case.grains.count is not None:
        return case.grains.count
    return max(
        1, round((1 - target_porosity(case)) * math.prod(case.size_m) / case.grains.mean_volume_m3)
    )


def pack_step(case: Case, contacts: dict[str, Contact]) -> float:
    """Time step of packing, s: `PACK_STEP` of sqrt(m/k) of the lightest grain.

    The stiffness of Hertz contacts is that of its tangent at `grains.max_overlap`.
    """
    contact = contacts["grain-grain"]
    stiffness = contact.normal_stiffness
    if contact.elastic:
        size = case.grains.radius_range_m[0] / case.grains.mean_radius_m
        stiffness *= 1.5 * size * math.sqrt(case.grains.max_overlap / REFERENCE_OVERLAP)
    return PACK_STEP * math.sqrt(mass_range(case.grains)[0] / stiffness)
