"""LAMMPS's three spheres in the table: what is reproduced on this binary, and what is not."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from fdnet.case.spheres import SHEAR_RATIO
from validation.dem.neck import LEAVES_AFTER, Neck, factor_step, leaving_time
from validation.engine.error_rows import against_exact
from validation.engine.study import DONE, Measured, Point, Row
from validation.outside.answers import Answer, percent_error

SERIES, KNOB, LEAVES = "three spheres", "contacts", "leaves after, s"
LAMMPS, FDNET = "LAMMPS's own", "soft shear on a soft spring"
NECKS: Mapping[str, Neck] = {
    FDNET: Neck(stiffness=12.5, shear_ratio=SHEAR_RATIO, step=factor_step(12.5, 0.1)),
    LAMMPS: Neck(stiffness=1e4, shear_ratio=0.8235, step=1e-6),
}
TOLERANCE = 0.2
_TEST = "tests/dem/test_contacts.py"


def points(quick: bool) -> list[Point]:
    """Both contacts; the quick form leaves out LAMMPS's, which takes longest."""
    names = [FDNET] if quick else [FDNET, LAMMPS]
    return [Point(series=SERIES, knob=KNOB, value=name) for name in names]


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """When the fine leaves the neck; infinite where it is held."""
    return {LEAVES: leaving_time(NECKS[str(point.value)], work / point.slug)}


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Relative errors against LAMMPS's example."""
    own = [one for one in measured if one.point.series == SERIES]
    return against_exact(own, LEAVES, lambda _: LEAVES_AFTER)


def answers(rows: Sequence[Row]) -> list[Answer]:
    """One line for each of the two contacts."""
    lines = []
    for row in rows:
        if row.series != SERIES or row.status != DONE:
            continue
        neck, held = NECKS[str(row.value)], math.isinf(row.observed)
        lines.append(
            Answer(
                what=f"fine of 1/20 in the neck of two grains leaves; k {neck.stiffness:g} N/m, "
                f"k_t/k_n {neck.shear_ratio:g}",
                expected=f"after {LEAVES_AFTER:g} s (LAMMPS, `examples/granular/in.sync_verlet`)",
                measured="never (held for 0.2 s)"
                if held
                else f"{row.observed:.3f} s, {percent_error(row.error)}",
                holds=not held and abs(row.error) < TOLERANCE,
                verdict="**not reproduced**: the unpatched integrator holds it; fdnet warns"
                if held
                else "",
                test=_TEST,
            )
        )
    return lines
