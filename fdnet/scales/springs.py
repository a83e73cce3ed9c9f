"""Linear (Hooke) contacts of a case: springs in series, smaller friction, viscous damping, stable steps."""

import math
from dataclasses import dataclass

from fdnet.case.case import Case
from fdnet.case.particles import Spheres


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """Linear contact of one pair of materials, as used: stiffness N/m, damping_rate 1/s, times s."""

    pair: str
    normal_stiffness: float
    shear_stiffness: float
    friction: float
    damping_rate: float
    contact_time: float
    step_limit: float


def series(first: float, second: float) -> float:
    """Two springs in series, kA kB / (kA + kB) (PFC's rule for a contact)."""
    return first * second / (first + second)


def sphere_mass(radius: float, density: float) -> float:
    """4/3 pi r^3 rho, kg."""
    return 4 / 3 * math.pi * radius**3 * density


def mass_range(spheres: Spheres) -> tuple[float, float]:
    low, high = spheres.radius_range_m
    return sphere_mass(low, spheres.density_kg_m3), sphere_mass(high, spheres.density_kg_m3)


def _nominal(case: Case) -> dict[str, tuple[float, float, float]]:
    """Per material: normal and shear stiffness, friction. The walls are of the grains' material."""
    grains = case.grains
    table = {
        "grain": (grains.normal_stiffness_N_m, grains.shear_stiffness_N_m, grains.friction),
        "wall": (grains.normal_stiffness_N_m, grains.shear_stiffness_N_m, case.box.wall_friction),
    }
    if case.fines:
        table["fine"] = (
            case.fines.normal_stiffness_N_m,
            case.fines.shear_stiffness_N_m,
            case.fines.friction,
        )
    return table


def _pairs(case: Case) -> list[tuple[str, str]]:
    pairs = [("grain", "grain"), ("grain", "wall")]
    return [*pairs, ("grain", "fine"), ("fine", "fine"), ("fine", "wall")] if case.fines else pairs


def stiffness_factor(case: Case) -> float:
    """What all contact stiffnesses are multiplied by: run.stiffness_N_m over the stiffest pair's nominal value."""
    if case.run.stiffness_N_m == "nominal":
        return 1.0
    nominal = _nominal(case)
    return case.run.stiffness_N_m / max(
        series(nominal[a][0], nominal[b][0]) for a, b in _pairs(case)
    )


def contacts_of(case: Case) -> dict[str, Contact]:
    nominal, factor = _nominal(case), stiffness_factor(case)
    return {f"{a}-{b}": _contact(case, (a, b), nominal, factor) for a, b in _pairs(case)}


def _contact(
    case: Case,
    pair: tuple[str, str],
    nominal: dict[str, tuple[float, float, float]],
    factor: float,
) -> Contact:
    first, second = pair
    normal = factor * series(nominal[first][0], nominal[second][0])
    spheres = [case.grains if name == "grain" else case.fines for name in pair if name != "wall"]
    damping = sum(s.damping_ratio for s in spheres if s) / len(spheres)
    frequency = math.sqrt(
        normal
        / _effective_mass(
            case, pair, grains_fixed="fine" in pair and case.grains.motion == "fixed"
        )
    )
    small = case.fines if "fine" in pair and case.fines else case.grains
    return Contact(
        pair=f"{first}-{second}",
        normal_stiffness=normal,
        shear_stiffness=factor * series(nominal[first][1], nominal[second][1]),
        friction=min(nominal[first][2], nominal[second][2]),
        damping_rate=2 * damping * frequency,
        contact_time=math.pi / (frequency * math.sqrt(1 - damping**2)),
        step_limit=math.sqrt(mass_range(small)[0] / normal),
    )


def _effective_mass(case: Case, pair: tuple[str, str], *, grains_fixed: bool) -> float:
    """m1 m2 / (m1 + m2) of a typical contact, kg; walls and fixed grains have infinite mass, in LIGGGHTS too."""

    def inverse(name: str) -> float:
        spheres = case.grains if name == "grain" else case.fines
        if name == "wall" or (name == "grain" and grains_fixed):
            return 0.0
        assert spheres is not None
        return 1 / sphere_mass(spheres.mean_radius_m, spheres.density_kg_m3)

    return 1 / (inverse(pair[0]) + inverse(pair[1]))
