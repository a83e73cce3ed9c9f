"""What is doubtful about the forces of the fluid on the fines, in words."""

from fdnet.case.case import InvasionCase
from fdnet.scales.forces.push import Push
from fdnet.scales.forces.reynolds import MOST_REYNOLDS, drag_factor
from fdnet.scales.forces.throat import MOST_RATIO, held_factor

BRIDGING = 0.5
"""Largest fine over the width of the throats, above which geometry decides where fines stop."""

STOKES_REYNOLDS = 1.0
"""Reynolds number above which Stokes's drag is more than 15 % too small."""

THROAT_FACTOR = 2.0
"""Drag in a throat over that of a lone sphere, from which fdnet warns."""


def reynolds_warnings(
    case: InvasionCase, push: Push, reynolds: float, *, throat_ratio: float
) -> list[str]:
    """Drag at the Reynolds number of the largest fine that is held; empty where Stokes's holds.

    `throat_ratio` is its diameter over that of the throats: it says whether the drag matters.
    """
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
    if case.drag.scheme != "held" and not case.drag.coupled:
        remedy += ' with drag.scheme = "held"'
    return [
        f"{outside}: the drag on a fine at rest is {drag_factor(reynolds):.3g} times as large by "
        f"Schiller and Naumann, which matters {_matters(throat_ratio)}; {remedy}"
    ]


def _matters(throat_ratio: float) -> str:
    """Whether a stronger push changes what the fines do, as measured (docs/physics.md, section 3).

    Six times the force moved no count of fines of 1/3 of a grain beyond chance; of fines of 1/10
    more passed, and they went deeper.
    """
    if throat_ratio >= BRIDGING:
        return "little here: such wide fines stop where they no longer fit"
    return "here: such narrow fines would go deeper with it"


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


def throat_warnings(case: InvasionCase, ratio: float) -> list[str]:
    """By how much the drag of a lone sphere is too small between the walls of a throat.

    `ratio` is the diameter of the largest fine over that of the throats. Where the flow follows
    the deposit a fine that stands feels the pressures of the network instead.
    """
    if case.drag.field == "network":
        return []
    diameter = 2e3 * case.fines.radius_range_m[1]
    who = f"the largest fine ({diameter:.3g} mm) is {ratio:.2g} of the width of the throats"
    if ratio > MOST_RATIO:
        return [
            f"{who} (tubes of the pack's permeability): it closes them, and there the pressure "
            "drop across it is its force, not the drag of a lone sphere"
        ]
    factor = held_factor(ratio)
    if factor < THROAT_FACTOR:
        return []
    return [
        f"{who} (tubes of the pack's permeability): at rest on the axis of one it feels "
        f"{factor:.2g} times the drag of a lone sphere, by which the drag is too small there"
    ]
