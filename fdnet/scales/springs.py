"""Contacts of pairs of materials, and linear (Hooke) ones: springs in series, viscous damping."""

import math
from dataclasses import dataclass

from fdnet.case.case import Case
from fdnet.case.spheres import Spheres
from fdnet.scales.hertz import Elastic, joint_radius, restitution_of
from fdnet.scales.restitution import LEAST, is_wet, pair_stokes, wet_ratio

PAIRS = (
    ("grain", "grain"),
    ("grain", "wall"),
    ("grain", "fine"),
    ("fine", "fine"),
    ("fine", "wall"),
)
"""Pairs of materials in contact."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """Contact of one pair of materials, as it is used.

    A Hertz contact has no stiffness of its own: its stiffnesses are those at an overlap of
    `fdnet.scales.hertz.REFERENCE_OVERLAP`.

    Attributes:
        pair: names of the two materials, such as "grain-fine".
        normal_stiffness: N/m, force over overlap.
        shear_stiffness: N/m.
        friction: coefficient of sliding friction.
        damping_ratio: damping over the critical one.
        damping_rate: 1/s, viscous damping force over effective mass and velocity.
        contact_time: s, half a period of the damped oscillation; of a Hertz contact the duration
            of an undamped collision at the velocity of the fluid.
        step_limit: s, sqrt(m/k) of the lighter sphere.
        elastic: constants of a Hertz contact; None when the contact is linear.
        stokes: impact Stokes number at the velocity of the fluid; None where the restitution does
            not depend on it.
    """

    pair: str
    normal_stiffness: float
    shear_stiffness: float
    friction: float
    damping_ratio: float
    damping_rate: float
    contact_time: float
    step_limit: float
    elastic: Elastic | None = None
    stokes: float | None = None

    @property
    def restitution(self) -> float:
        """Coefficient of restitution of a contact that may pull: exp(-pi z / sqrt(1 - z^2))."""
        return restitution_of(self.damping_ratio)


def series(first: float, second: float) -> float:
    """Two springs in series, kA kB / (kA + kB) (PFC's rule for a contact)."""
    return first * second / (first + second)


def sphere_mass(radius: float, density: float) -> float:
    """4/3 pi r^3 rho, kg."""
    return 4 / 3 * math.pi * radius**3 * density


def mass_range(spheres: Spheres) -> tuple[float, float]:
    """Mass of the smallest and of the largest sphere, kg."""
    if not spheres.measured:
        low, high = spheres.radius_range_m
        return sphere_mass(low, spheres.density_kg_m3), sphere_mass(high, spheres.density_kg_m3)
    ends = [
        (
            sphere_mass(0.5 * one.curve.low, one.density),
            sphere_mass(0.5 * one.curve.high, one.density),
        )
        for one in spheres.components
    ]
    return min(low for low, _ in ends), max(high for _, high in ends)


def _nominal(case: Case) -> dict[str, tuple[float, float, float]]:
    """Per material: normal and shear stiffness, friction. Walls are of the grains' material."""
    table = {
        name: (spheres.normal_stiffness_N_m, spheres.tangential_stiffness, spheres.friction)
        for name, spheres in case.spheres.items()
    }
    return table | {"wall": (*table["grain"][:2], case.wall_friction)}


def pairs_of(case: Case) -> list[tuple[str, str]]:
    """Pairs of materials that may touch; walls do not touch each other."""
    return [pair for pair in PAIRS if set(pair) <= {*case.spheres, "wall"}]


def stiffness_of(case: Case) -> float:
    """`run.stiffness_N_m` where it is a number; `stiff_enough` has put one for "auto"."""
    given = case.run.stiffness_N_m
    assert not isinstance(given, str)
    return given


def hooke_factor(case: Case) -> float:
    """Factor on all contact stiffnesses: run.stiffness_N_m over that of the stiffest pair."""
    if case.run.stiffness_N_m == "nominal":
        return 1.0
    nominal = _nominal(case)
    return stiffness_of(case) / max(
        series(nominal[a][0], nominal[b][0]) for a, b in pairs_of(case)
    )


def hooke_contacts(case: Case, velocity: float) -> dict[str, Contact]:
    """The linear contact of each pair of materials, in a fluid of a velocity in m/s."""
    return {f"{a}-{b}": _contact(case, (a, b), velocity) for a, b in pairs_of(case)}


def _contact(case: Case, pair: tuple[str, str], velocity: float) -> Contact:
    nominal, factor = _nominal(case), hooke_factor(case)
    first, second = pair
    normal = factor * series(nominal[first][0], nominal[second][0])
    damping, stokes = damping_and_stokes(case, pair, velocity)
    frequency = math.sqrt(normal / effective_mass(case, pair))
    lightest = case.spheres["fine" if "fine" in pair else "grain"]
    return Contact(
        pair=f"{first}-{second}",
        normal_stiffness=normal,
        shear_stiffness=factor * series(nominal[first][1], nominal[second][1]),
        friction=min(nominal[first][2], nominal[second][2]),
        damping_ratio=damping,
        damping_rate=2 * damping * frequency,
        contact_time=math.pi / (frequency * math.sqrt(1 - damping**2)),
        step_limit=math.sqrt(mass_range(lightest)[0] / normal),
        stokes=stokes,
    )


def damping_and_stokes(
    case: Case, pair: tuple[str, str], velocity: float
) -> tuple[float, float | None]:
    """Damping ratio of a contact, and the impact Stokes number where that decides it.

    Dry it is the mean of the two materials, a wall taking the sphere's. `velocity` is the fluid's,
    m/s.
    """
    spheres = [case.spheres[name] for name in pair if name != "wall"]
    dry = sum(one.damping_ratio for one in spheres) / len(spheres)
    if not is_wet(case, pair):
        return dry, None
    radius = pair_radius(case, pair, case.spheres["fine"].mean_radius_m)
    mass = effective_mass(case, pair)
    stokes = pair_stokes(mass, radius, velocity, case.fluid.viscosity_Pa_s)
    return wet_ratio(dry, stokes, least=LEAST[case.contact.model]), stokes


def pair_radius(case: Case, pair: tuple[str, str], radius: float) -> float:
    """R*, m, of a sphere of `radius` m, the lighter one of the pair, and its partner."""
    if "wall" in pair:
        return radius
    mixed = "fine" in pair and "grain" in pair
    return joint_radius(radius, case.grains.mean_radius_m if mixed else radius)


def effective_mass(case: Case, pair: tuple[str, str]) -> float:
    """m1 m2 / (m1 + m2) of a typical contact, kg.

    Walls have infinite mass, and fixed grains too while fines invade; so it is in LIGGGHTS.
    """
    fixed = {"wall", "grain"} if "fine" in pair and case.grains.motion == "fixed" else {"wall"}
    return 1 / sum(0.0 if name in fixed else _inverse_mass(case.spheres[name]) for name in pair)


def _inverse_mass(spheres: Spheres) -> float:
    return 1 / sphere_mass(spheres.mean_radius_m, spheres.mean_density_kg_m3)
