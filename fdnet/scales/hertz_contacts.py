"""Hertz-Mindlin contacts of a case: moduli, softened by one factor, and their stable step."""

import math

from fdnet.case.case import Case
from fdnet.scales.hertz import (
    REFERENCE_OVERLAP,
    STEP_OVERLAP,
    Elastic,
    collision_time,
    elastic,
    secant_stiffness,
    tangential_stiffness,
)
from fdnet.scales.springs import (
    Contact,
    damping_and_stokes,
    effective_mass,
    mass_range,
    pair_radius,
    pairs_of,
    stiffness_of,
)


def hertz_contacts(case: Case, velocity: float) -> dict[str, Contact]:
    """The Hertz-Mindlin contact of each pair of materials, in a fluid of a velocity in m/s."""
    factor = hertz_factor(case)
    return {f"{a}-{b}": _contact(case, (a, b), factor, velocity) for a, b in pairs_of(case)}


def hertz_factor(case: Case) -> float:
    """Factor on all Young's moduli: run.stiffness_N_m over the stiffness of the stiffest pair.

    Pairs of a fine count, those of grains only in a case without fines.
    """
    if case.run.stiffness_N_m == "nominal":
        return 1.0
    pairs = [pair for pair in pairs_of(case) if "fine" in pair] or pairs_of(case)
    return stiffness_of(case) / max(_stiffness(case, pair, 1.0) for pair in pairs)


def material_of(case: Case, name: str, factor: float) -> tuple[float, float]:
    """Young's modulus, Pa, times `factor`, and Poisson's ratio; walls are of grains' material."""
    spheres = case.spheres["grain" if name == "wall" else name]
    return factor * spheres.youngs_modulus_Pa, spheres.poissons_ratio


def pair_elastic(case: Case, pair: tuple[str, str], factor: float) -> Elastic:
    """Elastic constants of a pair of materials, softened by `factor`."""
    return elastic(material_of(case, pair[0], factor), material_of(case, pair[1], factor))


def _lighter(pair: tuple[str, str]) -> str:
    return "fine" if "fine" in pair else "grain"


def _stiffness(case: Case, pair: tuple[str, str], factor: float) -> float:
    """Force over overlap at the reference overlap, N/m, of spheres of mean size."""
    radius = case.spheres[_lighter(pair)].mean_radius_m
    return secant_stiffness(
        pair_elastic(case, pair, factor).modulus,
        pair_radius(case, pair, radius),
        REFERENCE_OVERLAP * 2 * radius,
    )


def tangent_stiffness(case: Case, pair: tuple[str, str], factor: float, overlap: float) -> float:
    """dF/d(delta), N/m, of the smallest sphere at an overlap over its diameter."""
    radius = case.spheres[_lighter(pair)].radius_range_m[0]
    return 1.5 * secant_stiffness(
        pair_elastic(case, pair, factor).modulus,
        pair_radius(case, pair, radius),
        overlap * 2 * radius,
    )


def _contact(case: Case, pair: tuple[str, str], factor: float, velocity: float) -> Contact:
    lighter = case.spheres[_lighter(pair)]
    constants, mass = pair_elastic(case, pair, factor), effective_mass(case, pair)
    radius = pair_radius(case, pair, lighter.mean_radius_m)
    overlap = REFERENCE_OVERLAP * 2 * lighter.mean_radius_m
    normal = _stiffness(case, pair, factor)
    damping, stokes = damping_and_stokes(case, pair, velocity)
    stiffest = tangent_stiffness(case, pair, factor, STEP_OVERLAP)
    frictions = [
        case.wall_friction if name == "wall" else case.spheres[name].friction for name in pair
    ]
    return Contact(
        pair="-".join(pair),
        normal_stiffness=normal,
        shear_stiffness=tangential_stiffness(constants.shear, radius, overlap),
        friction=min(frictions),
        damping_ratio=damping,
        damping_rate=2 * damping * math.sqrt(1.25 * normal / mass),
        contact_time=collision_time(mass, velocity, constants.modulus, radius),
        step_limit=math.sqrt(mass_range(lighter)[0] / stiffest),
        elastic=constants,
        stokes=stokes,
    )
