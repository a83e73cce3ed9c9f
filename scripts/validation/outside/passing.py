"""Single fines of a seventh of the grains pass every throat of a pack without overlap.

Three grains that touch leave a throat of 0.1547 grain diameters, and no three grains that do not
overlap leave a narrower one, so fines of 1/7 = 0.1429 are held by no geometry (Zhang and others,
arXiv 2605.19845, take the same ratio for free passage). Fines are kept from touching each other,
so each is a trial of its own.
"""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

from scipy.stats import binomtest

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_from
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.scales.contacts import sphere_mass
from fdnet.scales.scales import invasion_scales
from fdnet.spheres.geometry import max_overlap
from validation.dem.runs import edited_run, grains_of, the_binary
from validation.engine.error_rows import sizes
from validation.engine.study import DONE, Measured, Point, Row, ladder
from validation.outside.answers import Answer

SERIES, KNOB, HELD = "single fines in a loose pack", "grain over fine", "held"
PASSES, BLOCKED = 7.0, 5.0
"""Size ratios: one that no throat holds, and one above 0.1547 as a check of the count."""
FRICTION = 0.1
FINES, SEEDS = 1000, 3
_SIDES, _QUICK_SIDES, _QUICK_FINES = (4.0, 2.0), (2.0, 1.6), 60
SUPPLIED, OVERLAP = "supplied", "overlap of grains"
MOST_HELD = 0.01
"""Share of the fines that may be held."""
VELOCITY = 1.0
"""Velocity of the fluid, m/s."""
_GRAIN_MM, _POROSITY = 0.25, 0.42
_PASSAGES = 5.0
_ALONE = (r"^neigh_modify delay 0$", "neigh_modify delay 0\nneigh_modify exclude type 2 2")


def points(quick: bool) -> list[Point]:
    """Fines of 1/7 in several packs, and of 1/5 in one."""
    settings = {"fines": float(_QUICK_FINES if quick else FINES)}
    seeds = 1 if quick else SEEDS
    passing = ladder(SERIES, KNOB, (PASSES,), seeds=seeds, settings=settings)
    return [*passing, *ladder(SERIES, KNOB, (BLOCKED,), seeds=1, settings=settings)]


def case_of(point: Point) -> InvasionCase:
    """Fines in front of a loose periodic pack."""
    fines = int(point.settings["fines"])
    length, side = _SIDES if fines == FINES else _QUICK_SIDES
    solid = (1 - _POROSITY) * length * side**2
    grains = round(solid / sphere_mass(_GRAIN_MM, 1.0))
    return with_fines(
        case_from(
            {
                "name": "passing",
                "seed": point.seed,
                "box": {"size_mm": [length, side, side], "sides": "periodic"},
                "grains": {
                    "radius_mm": _GRAIN_MM,
                    "count": grains,
                    "friction": FRICTION,
                },
                "fines": {
                    "radius_mm": _GRAIN_MM / float(point.value),
                    "count": fines,
                    "friction": FRICTION,
                },
                "fluid": {"velocity_m_s": VELOCITY},
                "drag": {
                    "scheme": "viscous",
                    "upstream": "interstitial",
                    "pressure_gradient": False,
                },
                "run": {
                    "duration_ms": _PASSAGES * length / VELOCITY,
                    "checkpoint_ms": 0.25 * length / VELOCITY,
                    "time_step_factor": 0.2,
                },
            }
        )
    )


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """Share of the fines that are inside in the end, and the largest overlap of two grains.

    Everything is fdnet's own pack and invasion, but for one line of the deck that keeps fines
    from touching each other.
    """
    case, folder = case_of(point), work / point.slug
    grains = grains_of(case, work)
    shutil.rmtree(folder, ignore_errors=True)
    launch = Launch(binary=the_binary())
    edited_run(case, grains, folder, launch, _ALONE)
    last = invade(case, invasion_scales(case), grains, folder, launch).history[-1]
    return {
        HELD: float(last.invaded),
        SUPPLIED: float(last.upstream + last.invaded + last.passed),
        OVERLAP: max_overlap(grains, case.periodic),
        "steps": float(last.step),
    }


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Fines held and supplied, and the overlap of the grains, as they are."""
    own = [one for one in measured if one.point.series == SERIES]
    return [row for name in (HELD, SUPPLIED, OVERLAP) for row in sizes(own, name)]


def answers(rows: Sequence[Row]) -> list[Answer]:
    """The fines of 1/7 of all packs together, and those of 1/5."""
    lines = []
    for ratio in (PASSES, BLOCKED):
        own = [row for row in rows if row.series == SERIES and row.value == ratio]
        own = [row for row in own if row.status == DONE]
        if not own:
            continue
        seen = {
            name: [row.observed for row in own if row.quantity == name]
            for name in (HELD, SUPPLIED, OVERLAP)
        }
        held, fines = round(sum(seen[HELD])), round(sum(seen[SUPPLIED]))
        low, high = held_band(held, fines)
        free, packs = ratio == PASSES, len(seen[HELD])
        lines.append(
            Answer(
                what=f"single fines of 1/{ratio:g} held in a pack without overlap "
                f"(porosity {_POROSITY:g}), friction {FRICTION:g}",
                expected=f"at most {100 * MOST_HELD:g} % (narrowest throat 0.1547; "
                "[arXiv 2605.19845](https://arxiv.org/abs/2605.19845))"
                if free
                else "most of them (0.2 is above 0.1547): a check that the count can fail",
                measured=f"{held} of {fines:,} in {packs} {'packs' if packs > 1 else 'pack'}: "
                f"{100 * low:.2g} to {100 * high:.2g} % (binomial 95 %); largest overlap of two "
                f"grains {100 * max(seen[OVERLAP]):.2g} %",
                holds=high <= MOST_HELD if free else low > 0.5,
                test="tests/studies/test_outside_numbers.py",
            )
        )
    return lines


def held_band(held: int, fines: int) -> tuple[float, float]:
    """The 95 % band of the share that is held (Clopper and Pearson 1934)."""
    band = binomtest(held, fines).proportion_ci(0.95, method="exact")
    return float(band.low), float(band.high)
