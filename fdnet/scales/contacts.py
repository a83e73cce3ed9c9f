"""Contacts: stiffness, restitution, overlap, cohesion, and fines that lock between grains."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from fdnet.case.case import Case, InvasionCase
from fdnet.case.spheres import Spheres
from fdnet.errors import CaseError, Doubt
from fdnet.scales.drag import Push, arrival_velocity, pore_width, push_of, throat_width
from fdnet.scales.flow import Drive, Velocity

# ------------------------------------------------------------------------------------------------
# Hertz-Mindlin contacts in closed form, for pairs of spheres and for a sphere and a plane.
#
# Sources: Hertz (1882) and Johnson, Contact Mechanics (1985), chapters 4 and 11, for force, impact
# and duration; Mindlin (1949) for the tangential stiffness; Antypov and Elliott (EPL 94, 50004,
# 2011) for the damped collision.


REFERENCE_OVERLAP = 0.01
"""Overlap over the smaller diameter at which a Hertz contact has the stiffness that is asked."""
STEP_OVERLAP = 0.04
"""Overlap over the smaller diameter whose tangent stiffness sets the time step. It is three times
the stiffness at `REFERENCE_OVERLAP`."""


class PairModuli(NamedTuple):
    """Elastic constants of a pair of materials, as they are used."""

    modulus: float  # E* = 1 / ((1 - nu1^2) / E1 + (1 - nu2^2) / E2), Pa
    shear: float  # G* = 1 / ((2 - nu1) / G1 + (2 - nu2) / G2), Pa, with G = E / 2 (1 + nu)


def elastic(first: tuple[float, float], second: tuple[float, float]) -> PairModuli:
    """Of two materials, each with Young's modulus in Pa and Poisson's ratio."""
    (e1, nu1), (e2, nu2) = first, second
    return PairModuli(
        modulus=1 / ((1 - nu1**2) / e1 + (1 - nu2**2) / e2),
        shear=1 / (2 * (2 - nu1) * (1 + nu1) / e1 + 2 * (2 - nu2) * (1 + nu2) / e2),
    )


def joint_radius(first: float, second: float) -> float:
    """R* = 1 / (1/r1 + 1/r2), m; a plane has the radius infinity."""
    return 1 / (1 / first + 1 / second)


def secant_stiffness(modulus: float, radius: float, overlap: float) -> float:
    """F / delta = 4/3 E* sqrt(R* delta), N/m; the tangent stiffness is 1.5 times that."""
    return 4 / 3 * modulus * math.sqrt(radius * overlap)


def tangential_stiffness(shear: float, radius: float, overlap: float) -> float:
    """8 G* sqrt(R* delta), N/m (Mindlin 1949), without slip."""
    return 8 * shear * math.sqrt(radius * overlap)


def overlap_under(force: float, modulus: float, radius: float) -> float:
    """(3 F / (4 E* sqrt(R*)))^(2/3), m, at rest under a force in N."""
    return float((0.75 * force / (modulus * math.sqrt(radius))) ** (2 / 3))


def overlap_of_impact(
    mass: float, velocity: float, modulus: float, radius: float, *, damping: float = 0.0
) -> float:
    """Largest overlap, m, of a collision of effective mass in kg at a velocity in m/s.

    Undamped (15 m v^2 / (16 E* sqrt(R*)))^(2/5). With a force of damping that goes with
    delta^(1/4), as in LIGGGHTS, delta^(5/4) is the way of a linear oscillator of the ratio
    `damping`, so that the factor is that of the oscillator to the power 4/5.
    """
    free = float((15 * mass * velocity**2 / (16 * modulus * math.sqrt(radius))) ** 0.4)
    if damping == 0:
        return free
    s = math.sqrt(1 - damping**2)
    return free * math.exp(-0.8 * damping / s * math.atan2(s, damping))


def collision_time(mass: float, velocity: float, modulus: float, radius: float) -> float:
    """2.87 (m^2 / (R* E*^2 v))^(1/5), s, of an undamped collision.

    Times v and over the largest overlap it is 2.943; times (15/16)^(2/5) that is 2.87.
    """
    constant = 0.8 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9)
    return constant * overlap_of_impact(mass, velocity, modulus, radius) / velocity


def restitution_of(damping: float) -> float:
    """exp(-pi z / sqrt(1 - z^2)), of a contact of the damping ratio z < 1 that may pull.

    It holds for linear and, with the damping of LIGGGHTS, for Hertz contacts.
    """
    return math.exp(-math.pi * damping / math.sqrt(1 - damping**2))


# ------------------------------------------------------------------------------------------------
# Rebound in a liquid: the restitution of a contact from the impact Stokes number.
#
# No rebound below an impact Stokes number of about 10, the dry restitution from about 500 on
# (Joseph and others, J. Fluid Mech. 433, 329, 2001; Gondret and others, Phys. Fluids 14, 643,
# 2002); exp(-35 / St) of it between them (Legendre and others, Phys. Fluids 17, 097105, 2005).


FILM = 35.0
"""Stokes number at which the liquid leaves exp(-1) of the dry restitution (Legendre 2005)."""
LEAST: Mapping[str, float] = {"hooke": 1e-6, "hertz": 0.0501}
"""Least restitution by contact model, below which nothing is lowered further. LIGGGHTS's Hertz
model takes 0.05 and less for an error; for linear contacts it keeps the damping ratio below 1."""

SAFE_FACTOR = 0.2  # Time step over sqrt(m/k) that is accepted with any contact
LEFT = 0.18
"""Restitution that is left to linear contacts where the flow follows the deposit in longer steps,
which are stable with it (damping ratio 0.48): drag has stopped a fine before it could rebound."""


def pair_stokes(mass: float, radius: float, velocity: float, viscosity: float) -> float:
    """m_eff v / (6 pi mu R*^2), the impact Stokes number of a pair (Joseph and others 2001)."""
    return mass * velocity / (6 * math.pi * viscosity * radius**2)


def wet_ratio(dry_ratio: float, stokes: float, *, least: float) -> float:
    """Damping ratio z = -ln e / sqrt(ln^2 e + pi^2) of e, exp(-35 / St) of that of `dry_ratio`."""
    log = -math.pi * dry_ratio / math.sqrt(1 - dry_ratio**2) - FILM / stokes
    log = max(log, math.log(least))
    return -log / math.hypot(log, math.pi)


# ------------------------------------------------------------------------------------------------
# The contacts of a case: linear (Hooke) springs in series, or Hertz-Mindlin, viscously damped.
#
# Walls are of the grains' material. One factor softens all stiffnesses, or Young's moduli.


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
    `fdnet.scales.contacts.REFERENCE_OVERLAP`.
    """

    pair: str  # names of the two materials, such as "grain-fine"
    normal_stiffness: float  # N/m, force over overlap
    shear_stiffness: float  # N/m
    friction: float  # coefficient of sliding friction
    damping_ratio: float  # damping over the critical one
    damping_rate: float  # 1/s, viscous damping force over effective mass and velocity
    # s, half a damped oscillation; by Hertz an undamped collision at the velocity of the fluid
    contact_time: float
    step_limit: float  # s, sqrt(m/k) of the lighter sphere
    elastic: PairModuli | None = None  # of a Hertz contact
    # impact Stokes number at the velocity of the fluid, where the restitution depends on it
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
    """Mass of the lightest and of the heaviest sphere, kg."""
    masses = [sphere_mass(radius, density) for radius, density in spheres.ends]
    return min(masses), max(masses)


def contacts_of(case: Case, velocity: float) -> dict[str, Contact]:
    """The contact of each pair of materials, by its name, in a fluid of a velocity in m/s."""
    factor = stiffness_factor(case)
    return {"-".join(pair): _contact(case, pair, factor, velocity) for pair in _pairs_of(case)}


def stiffness_factor(case: Case) -> float:
    """Factor from the materials' stiffness, or Young's moduli, to those that are used.

    With Hertz contacts pairs of a fine count, those of grains only in a case without fines.
    """
    given, pairs = case.run.stiffness_N_m, _pairs_of(case)
    if given == "nominal":
        return 1.0
    assert not isinstance(given, str)  # `stiff_enough` has put a number for "auto"
    if case.contact.model == "hertz":
        pairs = [pair for pair in pairs if "fine" in pair] or pairs
        return given / max(_secant(case, pair, 1.0) for pair in pairs)
    normal = {name: _spheres(case, name).normal_stiffness_N_m for pair in pairs for name in pair}
    return given / max(series(normal[a], normal[b]) for a, b in pairs)


def _pairs_of(case: Case) -> list[tuple[str, str]]:
    """Pairs of materials that may touch; walls do not touch each other."""
    return [pair for pair in PAIRS if set(pair) <= {*case.spheres, "wall"}]


def _spheres(case: Case, name: str) -> Spheres:
    """The spheres of a material's name, or the lighter ones of a pair of names."""
    return case.spheres["fine" if "fine" in name else "grain"]


def _contact(case: Case, pair: tuple[str, str], factor: float, velocity: float) -> Contact:
    lighter, mass = _spheres(case, "".join(pair)), _effective_mass(case, pair)
    damping, stokes = _damping_and_stokes(case, pair, velocity)
    constants = None
    if case.contact.model == "hooke":
        first, second = (_spheres(case, name) for name in pair)
        normal = factor * series(first.normal_stiffness_N_m, second.normal_stiffness_N_m)
        shear = factor * series(first.tangential_stiffness, second.tangential_stiffness)
        stiffest, frequency = normal, math.sqrt(normal / mass)
        rate = 2 * damping * frequency
        time = math.pi / (frequency * math.sqrt(1 - damping**2))
    else:
        constants, size = pair_elastic(case, pair, factor), lighter.mean_radius_m
        normal, joint = _secant(case, pair, factor), pair_radius(case, pair, size)
        shear = tangential_stiffness(constants.shear, joint, REFERENCE_OVERLAP * 2 * size)
        rate = 2 * damping * math.sqrt(1.25 * normal / mass)
        time = collision_time(mass, velocity, constants.modulus, joint)
        least = lighter.radius_range_m[0]
        smallest, deep = pair_radius(case, pair, least), STEP_OVERLAP * 2 * least
        stiffest = 1.5 * secant_stiffness(constants.modulus, smallest, deep)
    return Contact(
        pair="-".join(pair),
        normal_stiffness=normal,
        shear_stiffness=shear,
        friction=_friction(case, pair),
        damping_ratio=damping,
        damping_rate=rate,
        contact_time=time,
        step_limit=math.sqrt(mass_range(lighter)[0] / stiffest),
        elastic=constants,
        stokes=stokes,
    )


def _secant(case: Case, pair: tuple[str, str], factor: float) -> float:
    """Force over overlap at the reference overlap, N/m, of spheres of mean size."""
    radius = _spheres(case, "".join(pair)).mean_radius_m
    return secant_stiffness(
        pair_elastic(case, pair, factor).modulus,
        pair_radius(case, pair, radius),
        REFERENCE_OVERLAP * 2 * radius,
    )


def _friction(case: Case, pair: tuple[str, str]) -> float:
    """The smaller friction of the two materials."""
    return min(
        case.wall_friction if name == "wall" else case.spheres[name].friction for name in pair
    )


def _damping_and_stokes(
    case: Case, pair: tuple[str, str], velocity: float
) -> tuple[float, float | None]:
    """Damping ratio of a contact, and the impact Stokes number where the liquid decides it."""
    spheres = [case.spheres[name] for name in pair if name != "wall"]
    dry = sum(one.damping_ratio for one in spheres) / len(spheres)
    if "fine" not in pair or case.contact.restitution != "liquid":
        return dry, None
    radius = pair_radius(case, pair, case.spheres["fine"].mean_radius_m)
    mass = _effective_mass(case, pair)
    stokes = pair_stokes(mass, radius, velocity, case.fluid.viscosity_Pa_s)
    return wet_ratio(dry, stokes, least=least_restitution(case)), stokes


def least_restitution(case: Case) -> float:
    """Restitution below which the liquid lowers nothing further."""
    least = LEAST[case.contact.model]
    followed = isinstance(case, InvasionCase) and case.drag.coupled
    longer = (case.run.time_step_factor or SAFE_FACTOR) > SAFE_FACTOR
    return max(least, LEFT) if followed and longer and case.contact.model == "hooke" else least


def material_of(case: Case, name: str, factor: float) -> tuple[float, float]:
    """Young's modulus, Pa, times `factor`, and Poisson's ratio."""
    spheres = _spheres(case, name)
    return factor * spheres.youngs_modulus_Pa, spheres.poissons_ratio


def pair_elastic(case: Case, pair: tuple[str, str], factor: float) -> PairModuli:
    """Elastic constants of a pair of materials, softened by `factor`."""
    return elastic(material_of(case, pair[0], factor), material_of(case, pair[1], factor))


def pair_radius(case: Case, pair: tuple[str, str], radius: float) -> float:
    """R*, m, of a sphere of `radius` m, the lighter one of the pair, and its partner."""
    if "wall" in pair:
        return radius
    mixed = "fine" in pair and "grain" in pair
    return joint_radius(radius, case.grains.mean_radius_m if mixed else radius)


def _effective_mass(case: Case, pair: tuple[str, str]) -> float:
    """m1 m2 / (m1 + m2) of a typical contact, kg.

    Walls have infinite mass, and fixed grains too while fines invade; so it is in LIGGGHTS.
    """
    fixed = {"wall", "grain"} if "fine" in pair and case.grains.motion == "fixed" else {"wall"}
    free = [case.spheres[name] for name in pair if name not in fixed]
    return 1 / sum(1 / sphere_mass(one.mean_radius_m, one.mean_density_kg_m3) for one in free)


# ---- How deep fines are pressed into grains, as predicted: by impact, by drag, in a deposit.
MOST_OVERLAP = 0.5
"""Predicted overlap over a fine's diameter from which a case is refused: beyond it a fine could
pass through a grain."""
LARGEST_CHAIN = 6.0
"""Largest force between two spheres of a deposit over the drop of pressure times the section of a
throat. Forces in packs of spheres go far beyond their mean, with an exponential tail (Radjai and
others, Phys. Rev. Lett. 77, 274, 1996). Runs of the quick specimen 5 had 1 to 8."""


class Overlaps(NamedTuple):
    """Predicted overlaps of a fine with a grain, over the diameter of the largest fine."""

    drag: float  # by drag and pressure gradient F on a fine at rest: F / k, or by Hertz
    impact: float  # by a fine that arrives at its fastest velocity w: w sqrt(m / k), or by Hertz
    # where the flow follows the deposit, by the force of the pressure on it; else 0
    deposit: float


def overlaps_of(
    case: InvasionCase,
    contact: Contact,
    flow: Velocity,
    drive: Drive,
    porosity: float,
    pressure: float,
) -> Overlaps:
    """The overlaps in the `contact` of a grain and a fine, as simulated, in a pack of a porosity.

    A deposit bears the `pressure`, Pa of the fluid itself, on the section of a throat, and some of
    its contacts several times as much (`LARGEST_CHAIN`).
    """
    push = push_of(case, drive.velocity, flow.pressure_gradient, factor=drive.factor)
    deposit = 0.0
    if case.drag.coupled:
        throat = throat_width(porosity, flow.permeability)
        deposit = LARGEST_CHAIN * drive.factor * pressure * math.pi / 4.0 * throat**2
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
    wide = 2 * radius
    return Overlaps(impact=impact / wide, drag=drag / wide, deposit=held / wide)


def overlap_warnings(case: InvasionCase, overlaps: Overlaps) -> list[Doubt]:
    """Overlaps above `run.max_overlap`, in words.

    Raises CaseError when one of them alone would press a fine half through a grain.
    """
    for name in ("drag", "impact", "deposit"):
        overlap = getattr(overlaps, name)
        if overlap > MOST_OVERLAP:
            raise CaseError(
                f"run.stiffness_N_m: {name} alone would press a fine {100 * overlap:.3g} % of its "
                f"diameter into a grain (limit {100 * MOST_OVERLAP:.0f} %); set it to 'auto', "
                "raise it, or lower drag or pressure (fluid.velocity_m_s, fluid.overbalance_MPa, "
                "drag.multiplier)"
            )
    limit, warnings = case.run.max_overlap, []
    above = f"of a fine's diameter (above run.max_overlap, {100 * limit:.3g} %)"
    if overlaps.deposit > limit:
        given, power = case.run.stiffness_N_m, 1.5 if case.contact.model == "hertz" else 1.0
        remedy = "; the materials are too soft for this pressure"
        if not isinstance(given, str):
            enough = two_digits_up((overlaps.deposit / limit) ** power * given)
            remedy = f": set run.stiffness_N_m = {enough:g}, or 'auto'"
        text = (
            "predicted overlap of fines that hold the whole pressure is "
            f"{100 * overlaps.deposit:.2g} % {above}{remedy}"
        )
        warnings.append(Doubt("pressure-on-the-deposit", text))
    for name, overlap in (("impact", overlaps.impact), ("drag", overlaps.drag)):
        if overlap > limit:
            text = f"predicted overlap under {name} is {100 * overlap:.2g} % {above}"
            warnings.append(Doubt("predicted-overlap", f"{text}: raise run.stiffness_N_m"))
    return warnings


def two_digits_up(value: float) -> float:
    """The next number of two digits that is not below `value`, above 0."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit - 1e-9) * unit


# ------------------------------------------------------------------------------------------------
# Cohesion of Hertz contacts by LIGGGHTS's SJKR: attraction c times the area of contact.
#
# Two spheres that overlap by delta intersect in a circle of the area 2 pi R* delta, to first
# order. The force 4/3 E* sqrt(R*) delta^(3/2) - 2 pi c R* delta pulls below the overlap at rest,
# most at 4/9 of it. With linear springs both terms grow alike and nothing would pull.


class PullOff(NamedTuple):
    """What it takes to part two cohesive spheres."""

    force: float  # N, the largest pull that the contact bears
    overlap: float  # m, at this pull
    resting: float  # m, the overlap without a pull


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


def cohesion_warnings(case: InvasionCase, contact: Contact) -> list[Doubt]:
    """A resting overlap above `run.max_overlap`, in words.

    Raises CaseError when cohesion alone would draw a fine half into a grain.
    """
    share = pull_off_of(case, contact).resting / (2 * case.fines.radius_range_m[1])
    what = f"draws a fine {100 * share:.3g} % of its diameter into a grain"
    do = "lower contact.cohesion_J_m3, or raise run.stiffness_N_m"
    if share > MOST_OVERLAP:
        limit = f"limit {100 * MOST_OVERLAP:.0f} %"
        given = f"contact.cohesion_J_m3: {case.contact.cohesion_J_m3:g}"
        raise CaseError(f"{given} {what} ({limit}); {do}")
    if share <= case.run.max_overlap:
        return []
    limit = f"above run.max_overlap, {100 * case.run.max_overlap:.3g} %"
    return [Doubt("cohesion", f"cohesion {what} ({limit}): {do}")]


# ------------------------------------------------------------------------------------------------
# Whether fines lock in the groove between two grains, from which the fluid should roll them.
#
# Friction can hold a fine in the groove at the neck of two grains only if it is above the slope of
# its sides. Two things press it in, and both need a stiff tangential spring (docs/physics.md,
# section 1): the spring itself, if k_t / k_n > f t, and LIGGGHTS's integrator, which adds the slip
# of half a step ago along the normal of now (Vyas and others, Comput. Phys. Commun. 310, 109524).


MOST_FALSE_FORCE = 0.5
"""False force of the integrator over the push of the fluid, up to which no fine was seen to be
held by it (docs/evidence/error_against_time.md)."""
_ROUNDING = 1 + 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Sticking:
    """How far a fine may lock between two touching grains."""

    size_ratio: float  # radius of the fine over that of the largest grain
    friction: float  # coefficient of friction of a fine against a grain
    slope: float  # of the sides of the groove; friction below it holds no fine
    shear_ratio: float  # tangential over normal contact stiffness, force over overlap
    push: float  # force of the fluid on the fine at rest over k r of the contact
    false_force: float  # that the integrator adds in a quarter turn, over the push
    linear: bool = True  # whether the tangential stiffness can be chosen (Hertz-Mindlin's cannot)

    @property
    def by_springs(self) -> bool:
        """Whether the tangential springs can lock the fine."""
        return self.friction > self.slope and self.shear_ratio > self.friction * self.slope

    @property
    def by_integrator(self) -> bool:
        """Whether the integrator may press the fine in."""
        too_large = self.false_force > MOST_FALSE_FORCE * _ROUNDING
        return self.friction > self.slope and too_large


def groove_slope(size_ratio: float) -> float:
    """sqrt((1 + q)^2 - 1), slope of the sides of the groove between two touching grains."""
    return math.sqrt((1 + size_ratio) ** 2 - 1)


def false_force(shear_stiffness: float, velocity: float, step: float) -> float:
    """Tangential force, N, that the integrator adds in a quarter turn: (pi/4) k_t v dt.

    For a tangential stiffness in N/m, the velocity of the fine in m/s and a time step in s.
    """
    return math.pi / 4 * shear_stiffness * velocity * step


def fall_velocity(push: float, mass: float, distance: float) -> float:
    """sqrt(2 F s / m), m/s: what a force of `push` N gives a mass in kg over a distance in m."""
    return math.sqrt(2 * push * distance / mass)


def sticking_of(case: InvasionCase, contact: Contact, push: Push, step: float) -> Sticking:
    """Of the smallest fine between two of the largest grains, which locks most easily.

    `step` is the time step, s. A fine rolls no faster than it drifts freely.
    """
    radius, grain = case.fines.radius_range_m[0], case.grains.radius_range_m[1]
    mass = sphere_mass(radius, min(one.density for one in case.fines.components))
    force, slope = push.force(radius), groove_slope(radius / grain)
    drift = push.velocity + push.drift(radius)
    rolling = min(drift, fall_velocity(force, mass, slope * grain))
    return Sticking(
        size_ratio=radius / grain,
        friction=contact.friction,
        slope=slope,
        shear_ratio=contact.shear_stiffness / contact.normal_stiffness,
        push=force / (contact.normal_stiffness * radius),
        false_force=false_force(contact.shear_stiffness, rolling, step) / force,
        linear=contact.elastic is None,
    )


def sticking_warnings(sticking: Sticking) -> list[Doubt]:
    """Fines that may lock between grains, in words; empty when none do."""
    if not sticking.by_springs and not sticking.by_integrator:
        return []
    text = (
        f"fines of 1/{1 / sticking.size_ratio:.3g} of a grain may lock between grains: friction "
        f"{sticking.friction:g} (above the slope {sticking.slope:.2g} of the groove), "
        f"push F/(k r) {sticking.push:.1e}, "
    )
    if sticking.by_springs:
        remedy = (
            "leave out grains.shear_stiffness_N_m and fines.shear_stiffness_N_m"
            if sticking.linear
            else "take contact.model = 'hooke'"
        )
        text += (
            f"tangential over normal stiffness {sticking.shear_ratio:.2g} (above "
            f"{sticking.friction * sticking.slope:.2g}): {remedy}"
        )
    else:
        excess = sticking.false_force / MOST_FALSE_FORCE
        text += (
            f"false force of the integrator over the push {sticking.false_force:.2g} (above "
            f"{MOST_FALSE_FORCE:g}): divide run.time_step_factor by {excess:.2g}, or "
            f"run.stiffness_N_m by {excess**2:.2g} as far as overlaps allow"
        )
    return [Doubt("fines-lock", f"{text}, or lower friction to {sticking.slope:.2g}")]
