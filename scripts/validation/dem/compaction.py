"""Porosity and permeability of sand under stress, and how far bonds hold grains in the flow."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fdnet.case.case import Case
from fdnet.case.file import case_from
from fdnet.mechanics.elastic import carrying
from fdnet.mechanics.of_case import pack_material
from fdnet.mechanics.springs import (
    Cement,
    PackMaterial,
    bond_springs,
    contact_springs,
    kinematics,
    solver_of,
    stiffness_matrix,
)
from fdnet.mechanics.triaxial import Triaxial, confined
from fdnet.network.permeability import analyse
from fdnet.spheres.snapshot import Array, Snapshot
from validation.dem.mechanics_figure import Panel, draw_ranges
from validation.dem.mechanics_page import compaction_page
from validation.dem.runs import grains_of
from validation.engine.error_rows import against_reference
from validation.engine.study import Measured, Point, Row, Study

QUARTZ, FIELD = "sand of quartz", "sand of 4.8 GPa"
STIFFNESS: Mapping[str, float] = {QUARTZ: 9.43e7, FIELD: 7.2e6}
"""Normal stiffness of the grains, N/m: 4 E R of quartz, and one whose pack has the 4.8 GPa of the
thesis's Figure 10."""
BONDS: Mapping[str, Cement] = {
    "bonds of the thesis": Cement(radius_ratio=1.0, normal=95e9, shear=40e9),
    "bonds of 4.8 GPa": Cement(radius_ratio=1.0, normal=1.84e13, shear=7.7e12),
}
"""Cement that alone carries a pack of porosity 0.40."""
PRESSURES = (0.0, 3.5, 7.0, 14.0, 35.0)
"""Isotropic effective stress, MPa."""
MEASURED_TREND = 0.0021
"""Fall of ln k with effective stress, 1/MPa, in specimens of medium-grained sand (Nazarova,
Nazarov, Golikov and Skulkin, Journal of Mining Science 55, 708, 2019)."""
GRADIENT = 3.5e6 / 8e-3
"""Fall of pressure over the specimen of the thesis, Pa/m."""
_EDGE, _SHEAR = 2.4, 34.0 / 94.3


def points(quick: bool) -> list[Point]:
    """Stress on two sands, and bonded packs of specimen 5's porosity in the flow."""
    seeds = range(1, 2 if quick else 4)
    stresses = PRESSURES[:2] if quick else PRESSURES
    chosen = [
        Point(series=series, knob="stress", value=value, seed=seed)
        for value in stresses
        for series in STIFFNESS
        for seed in seeds
    ]
    return chosen + [
        Point(series=series, knob="porosity", value=0.40, seed=seed)
        for series in BONDS
        for seed in seeds
    ]


def _case(seed: int, stiffness: float, porosity: float) -> Case:
    return case_from(
        {
            "name": "cube",
            "seed": seed,
            "box": {"size_mm": [_EDGE] * 3, "wall_friction": 0.0},
            "grains": {
                "radius_mm": 0.25,
                "porosity": porosity,
                "density_kg_m3": 2650.0,
                "normal_stiffness_N_m": stiffness,
                "shear_stiffness_N_m": _SHEAR * stiffness,
            },
        }
    )


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """Porosity and permeability under a stress, or the largest displacement of a bonded grain."""
    if point.series in BONDS:
        case = _case(point.seed, STIFFNESS[QUARTZ], float(point.value))
        springs = pack_material(case, grains_of(case, work))
        material = PackMaterial(
            normal=springs.normal, shear=springs.shear, cement=BONDS[point.series]
        )
        moved = displacement_under_flow(
            grains_of(case, work), material, GRADIENT, periodic=case.periodic
        )
        return {"moved": float(moved[:, 0].max())}
    case = _case(point.seed, STIFFNESS[point.series], 0.36)
    grains = grains_of(case, work)
    if point.value:
        material = replace(pack_material(case, grains), glued=False)
        test = Triaxial(confining=1e6 * float(point.value))
        grains = confined(grains, material, test, case.periodic)[0].grains
    result = analyse(grains, None, periodic=case.periodic)
    return {"porosity": result.porosity_initial, "k": result.k_initial}


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Changes over the same pack without stress; displacements over their own mean."""
    rows = []
    for series in STIFFNESS:
        runs = [run for run in measured if run.point.series == series]
        for name in ("porosity", "k"):
            rows += against_reference(runs, name, lambda run: run.point.value == 0.0)
    for series in BONDS:
        runs = [run for run in measured if run.point.series == series]
        rows += against_reference(runs, "moved", lambda run: True)
    return rows


def draw_stress(rows: Sequence[Row], path: Path) -> None:
    """Permeability and porosity over those without stress."""
    sands = tuple(STIFFNESS)
    panels: list[Panel] = [
        (f"{what} over that without stress", "effective stress, MPa", sands, name, _share)
        for what, name in (("permeability", "k"), ("porosity", "porosity"))
    ]
    draw_ranges([row for row in rows if row.value != 0.0], path, panels)


def _share(row: Row) -> float:
    return 1 + row.error


STUDY = Study(
    name="compaction",
    title="Sand under stress",
    knob_label="effective stress, MPa",
    points=points,
    measure=measure,
    judge=judge,
    panels=(),
    needs_liggghts=True,
    draw=draw_stress,
    page=lambda rows: compaction_page(rows, tuple(STIFFNESS), tuple(BONDS), MEASURED_TREND),
)


def displacement_under_flow(
    grains: Snapshot,
    material: PackMaterial,
    gradient: float,
    *,
    periodic: tuple[bool, bool, bool],
) -> Array:
    """Displacement (N, 3), m, of the grains by a fall of pressure along x of `gradient` Pa/m.

    The fluid pushes each grain with the gradient times the volume of the box over the number of
    grains that carry; the plates at the ends, to which the outermost grains are glued, hold the
    pack. Grains that carry nothing stay where they are.
    """
    joints, kept = carrying(grains, material, periodic)
    length = float(grains.radius.mean())
    springs = contact_springs(joints, material) + bond_springs(joints, material)
    moving = np.flatnonzero(np.repeat(kept, 6))
    live = kinematics(joints, len(grains), length=length).of_grains[:, moving]
    push = np.zeros((len(grains), 6))
    volume = float(np.prod(np.diff(grains.box, axis=1)))
    push[kept, 0] = gradient * volume / max(1, int(kept.sum()))
    moved = np.zeros(6 * len(grains))
    moved[moving] = solver_of(stiffness_matrix(live, springs))(push.ravel()[moving])
    return moved.reshape(-1, 6)[:, :3]
