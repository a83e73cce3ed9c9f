"""Fines that are driven faster than the fluid moves them, with the same ratios of forces.

Where the inertia of a fine does not matter, its way depends on the ratios of the forces alone:
drag, pressure gradient, weight. A simulation may then multiply the fluid's velocity, and with it
every force, by one factor s = u_DEM / u. Every fine goes the same way in 1 / s of the time.
Inertia does not matter while the impact Stokes number is well below 1: a fine that is stopped by a
grain has lost its momentum to the liquid within that share of its radius.
"""

from dataclasses import dataclass

from fdnet.case.case import InvasionCase
from fdnet.errors import CaseError

AUTO_STOKES = 0.1
"""Impact Stokes number to which "auto" drives the largest fine."""
STOKES_WARNING, STOKES_LIMIT = 0.3, 1.0
"""Impact Stokes number of a driven case: above the first value fdnet warns, above the second it
refuses the case."""
_ROUNDING = 1 + 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """How fast the simulated fluid moves.

    Attributes:
        velocity: m/s, in the pores.
        factor: velocity over the fluid's own: the factor on all forces on a fine, and physical
            time over simulated time.
        impact_stokes: impact Stokes number of the largest fine, free in this fluid.
    """

    velocity: float
    factor: float
    impact_stokes: float


def impact_stokes(relaxation_time: float, velocity: float, radius: float) -> float:
    """tau v / r = m v / (6 pi mu r^2): the way on which drag stops a sphere, over its radius.

    For the drag relaxation time in s, the velocity of the sphere in m/s and its radius in m
    (Joseph and others, J. Fluid Mech. 433, 329, 2001).
    """
    return relaxation_time * velocity / radius


def drive_of(
    case: InvasionCase, velocity: float, relaxation_time: float, *, free: float | None = None
) -> Drive:
    """The velocity that the case asks for, or the fluid's own.

    "auto" never drives slower than the fluid moves.

    Args:
        case: the case.
        velocity: of the fluid in the pores, m/s.
        relaxation_time: of the largest fine, s.
        free: velocity of a free fine in this fluid, m/s: faster where a pressure gradient pushes
            it; the fluid's own if not given.

    Raises:
        CaseError: a driven case whose impact Stokes number is above `STOKES_LIMIT`, as simulated
            or at the fluid's own velocity.
    """
    radius, asked = case.fines.radius_range_m[1], case.drag.drive_velocity_m_s
    own = impact_stokes(relaxation_time, velocity if free is None else free, radius)
    driven = velocity
    if asked == "auto":
        driven = velocity * max(1.0, AUTO_STOKES / own)
    elif asked is not None:
        driven = asked
    factor = driven / velocity
    drive = Drive(velocity=driven, factor=factor, impact_stokes=own * factor)
    if asked is not None:
        _refuse_inertia(drive, own)
    return drive


def _refuse_inertia(drive: Drive, own_stokes: float) -> None:
    if own_stokes > STOKES_LIMIT * _ROUNDING:
        raise CaseError(
            f"drag.drive_velocity_m_s: the impact Stokes number of the fines is {own_stokes:.2g} "
            f"in the fluid itself (limit {STOKES_LIMIT:g}), so their inertia matters and no other "
            "velocity gives the same result; leave the key out"
        )
    if drive.impact_stokes > STOKES_LIMIT * _ROUNDING:
        most = drive.velocity * STOKES_LIMIT / drive.impact_stokes
        raise CaseError(
            f"drag.drive_velocity_m_s: {drive.velocity:g} m/s makes the impact Stokes number "
            f"{drive.impact_stokes:.2g} (limit {STOKES_LIMIT:g}): the fines' inertia would "
            f"matter; expected at most {most:.2g} m/s"
        )


def drive_warnings(case: InvasionCase, drive: Drive) -> list[str]:
    """A driven case in which inertia may begin to matter; empty when it does not."""
    if case.drag.drive_velocity_m_s is None or drive.impact_stokes <= STOKES_WARNING * _ROUNDING:
        return []
    lower = drive.velocity * STOKES_WARNING / drive.impact_stokes
    return [
        f"drag.drive_velocity_m_s: at {drive.velocity:.3g} m/s the impact Stokes number is "
        f"{drive.impact_stokes:.2g} (above {STOKES_WARNING:g}), so the fines' inertia may begin "
        f"to matter: lower it to {lower:.2g} m/s"
    ]
