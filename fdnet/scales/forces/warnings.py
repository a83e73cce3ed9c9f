"""What is doubtful about the forces of the fluid on the fines, in words."""

from fdnet.case.case import InvasionCase
from fdnet.scales.forces.push import Push
from fdnet.scales.forces.reynolds import MOST_REYNOLDS, drag_factor

STOKES_REYNOLDS = 1.0
"""Reynolds number above which Stokes's drag is more than 15 % too small."""


def reynolds_warnings(case: InvasionCase, push: Push, reynolds: float) -> list[str]:
    """Drag at the Reynolds number of the largest fine that is held; empty where Stokes's holds."""
    if case.drag.inertia != "none":
        return _beyond(case, push, reynolds)
    if reynolds <= STOKES_REYNOLDS:
        return []
    outside = (
        f"particle Reynolds number {reynolds:.2g} is outside the range of Stokes drag (below 1)"
    )
    if reynolds > MOST_REYNOLDS:
        return [f"{outside} and of Schiller and Naumann's (below {MOST_REYNOLDS:g})"]
    remedy = 'set drag.inertia = "schiller-naumann"'
    if case.drag.scheme not in ("held", "every_step"):
        remedy += ' with drag.scheme = "held"'
    return [
        f"{outside}: the drag on a fine at rest is {drag_factor(reynolds):.3g} times as large by "
        f"Schiller and Naumann; {remedy}"
    ]


def _beyond(case: InvasionCase, push: Push, reynolds: float) -> list[str]:
    """A fine drifts so fast that its slip is beyond the correlation.

    A case in which the slip of a fine at rest is beyond it is refused (`drag_factor`).
    """
    fastest = reynolds * push.largest_slip(case.fines.radius_range_m[1]) / push.velocity
    if fastest <= MOST_REYNOLDS:
        return []
    return [
        f"particle Reynolds number {fastest:.3g} of a fine that drifts freely is outside the "
        f"range of Schiller and Naumann's drag (below {MOST_REYNOLDS:g})"
    ]
