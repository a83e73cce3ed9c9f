"""A fine that falls in a fluid at rest, by fdnet's own decks: it relaxes to Stokes's velocity.

v(t) = v_T (1 - exp(-t / tau)) with v_T = tau g and tau = 2 r^2 rho / (9 mu) (Stokes 1851).
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from validation.dem.runs import relaxation_run
from validation.engine.error_rows import sizes
from validation.engine.study import DONE, Measured, Point, Row
from validation.outside.answers import Answer

SERIES, KNOB, ERROR = "fine that falls", "drag scheme", "relaxation_error"
SCHEMES = ("every step", "held", "viscous", "implicit")
TOLERANCE = 0.01
_OVER_TAU: Mapping[str, float] = {"held": 0.02}
_STEP_OVER_TAU = 0.005


def points(quick: bool) -> list[Point]:
    """Every scheme of the drag."""
    names = SCHEMES[:1] if quick else SCHEMES
    return [Point(series=SERIES, knob=KNOB, value=name) for name in names]


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """Largest error of the velocity over v_T, from the start to three tau."""
    over_tau = _OVER_TAU.get(str(point.value), _STEP_OVER_TAU)
    every = point.value == SCHEMES[0]
    keys = "drag.refresh_steps=1" if every else f"drag.scheme={point.value}"
    return relaxation_run(work, point.slug, keys, over_tau=over_tau)


def judge(measured: Sequence[Measured]) -> list[Row]:
    """The largest errors, as they are."""
    return sizes([one for one in measured if one.point.series == SERIES], ERROR)


def answers(rows: Sequence[Row]) -> list[Answer]:
    """The scheme with the largest error."""
    own = [row for row in rows if row.series == SERIES and row.status == DONE]
    if not own:
        return []
    worst = max(own, key=lambda row: row.error)
    return [
        Answer(
            what="fine that falls from rest: velocity until three relaxation times",
            expected="v_T (1 − exp(−t/τ)), v_T = 2 r² ρ g / (9 μ) (Stokes 1851)",
            measured=f"within {100 * worst.error:.2g} % of v_T, worst of "
            f"{len(own)} drag schemes ({worst.value})",
            holds=worst.error < TOLERANCE,
            test="tests/dem/test_motion.py",
        )
    ]
