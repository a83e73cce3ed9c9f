"""The mechanics of packs: size, the same test in LIGGGHTS, sand under stress, bonds in the flow.

    python scripts/validation.py mechanics [--quick] [--only NAME] [--out DIR] [--rows FILE.csv]

Rows of all runs: docs/validation/mechanics.csv. Answer: docs/evidence/scoreboard.md.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import t as student

from fdnet.case.case import Case
from fdnet.case.file import case_from
from fdnet.dem import deck
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.files import write_text
from fdnet.mechanics.elastic import carrying, elastic_of
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
from fdnet.mechanics.triaxial import Triaxial, confined, triaxial
from fdnet.network.permeability import analyse
from fdnet.scales.contacts import series, sphere_mass
from fdnet.scales.scales import scales_of
from fdnet.spheres.dump import COLUMNS, FORMAT, read_frame
from fdnet.spheres.snapshot import Array, Snapshot, resting
from validation.comparisons import (
    BLACK,
    BLUE,
    ORANGE,
    TEMPLATES,
    Finding,
    Trial,
    chapter_of,
    command,
    packed,
    the_binary,
)

PRESSURE, RATE, STRAIN = 2e4, 2.5, 0.02
"""Confining stress, Pa, strain rate, 1/s, and strain of the unbonded test: a contact overlaps by
5e-4 of a diameter, and the inertial number is below 1e-3."""
TREND = 0.0021
"""Fall of ln k with stress, 1/MPa (Nazarova and others, J. Mining Sci. 55, 708, 2019)."""
ITSELF = "fdnet itself"
"""Source of what is compared with a finer or larger form of the same."""
QUARTZ = 9.43e7
"""Normal stiffness of quartz, 4 E R, N/m; 7.2e6 gives a pack the thesis's 4.8 GPa."""


def case_of(
    seed: int, edge: float, sides: str, stiffness: float = 2e4, porosity: float = 0.36
) -> Case:
    """A cube of sand; its edge is in mm, the stiffness of its grains in N/m."""
    shear = 0.36 if stiffness == 2e4 else 34.0 / 94.3
    grains = {"radius_mm": 0.25, "porosity": porosity, "density_kg_m3": 2650.0}
    springs = {"normal_stiffness_N_m": stiffness, "shear_stiffness_N_m": shear * stiffness}
    tables = {
        "name": "cube",
        "seed": seed,
        "box": {"size_mm": [edge] * 3, "sides": sides, "wall_friction": 0.0},
        "grains": grains | springs,
    }
    return case_from(tables | ({"run": {"stiffness_N_m": "nominal"}} if stiffness == 2e4 else {}))


def moduli(trial: Trial, *, sides: str) -> dict[str, float]:
    """Young's and shear modulus of one cube."""
    case = case_of(trial.seed, trial.value, sides)
    grains = packed(case, trial.folder.parent)
    result = elastic_of(grains, pack_material(case, grains), periodic=case.periodic).averaged
    return {"young": result.young, "shear": result.shear}


# ---- The triaxial test in LIGGGHTS: six smooth plates, whose stresses are held by servo.


class Curve(NamedTuple):
    """Lengths of the box (M, 3), m, stresses (M, 3), Pa, and the grains at the end."""

    side: Array
    stress: Array
    grains: Snapshot


def run_servo(case: Case, grains: Snapshot, folder: Path, *, steps: int, rate: float) -> Curve:
    """One stage: `PRESSURE` on all sides without friction, or a strain rate along x with it."""
    folder.mkdir(parents=True, exist_ok=True)
    side, stiffness = np.ptp(grains.box, axis=1), series(*[case.grains.normal_stiffness_N_m] * 2)
    density, radius = case.grains.density_kg_m3, case.grains.mean_radius_m
    mass = sphere_mass(radius, density)
    step = 0.1 * math.sqrt(sphere_mass(case.grains.radius_range_m[0], density) / stiffness)
    placed = resting(grains.position - grains.box[:, 0], grains.radius, _box(side))
    room = np.column_stack([-side, 2 * side])
    of_each = np.full(len(grains), density)
    deck.write_data(folder / "triaxial.data", placed, bounds=room, density=of_each, types=2)
    plates = [f"{axis}{end}" for axis in "xyz" for end in "01"]
    for number, name in enumerate(plates):
        axis = number // 2
        write_text(folder / f"{name}.stl", _plate(axis, number % 2 * side[axis], side))
    law = deck.wall_law(case, "pack", friction=rate > 0)
    left = [deck.LeftOut(what="fines, fluid and gravity", why="a test of the grains alone")]
    area = float(np.prod(side)) / float(side.max())
    variables = deck.header_variables(case, "pack", left, 1) | {
        "boundary": "f f f",
        "contacts": deck.contact_variables(case, scales_of(case), "pack", friction=rate > 0),
        "plates": plates,
        "plate_names": " ".join(plates),
        "wall_model": f"model {law['model']}",
        "wall_settings": law["settings"],
        "skin": deck.number(0.4 * case.grains.radius_range_m[0]),
        "time_step": deck.number(step),
        "viscous": deck.number(0.02 * math.sqrt(stiffness * mass)),
        "side": [deck.number(value) for value in side],
        "axial_speed": deck.number(rate * side[0]) if rate else "",
        "gain": deck.number(0.1 * area / (20 * stiffness * step)),
        "stress": deck.number(PRESSURE),
        "steps": steps or (steps := round(STRAIN / RATE / step)),
        "every": max(1, steps // 200),
        "dump_columns": COLUMNS,
        "dump_format": FORMAT,
    }
    text = deck.render_text("triaxial.in.j2", variables, folder=TEMPLATES)
    write_text(folder / "in.triaxial", text)
    run_deck(folder, "in.triaxial", Launch(binary=the_binary()))
    table, frame = np.loadtxt(folder / "curve.txt", ndmin=2), read_frame(folder / "end.dump")
    place = np.column_stack([frame.column(axis) for axis in "xyz"])
    end = resting(place, frame.column("radius"), _box(table[-1, :3]))
    return Curve(table[:, :3], table[:, 3:], end)


def _box(side: Array) -> Array:
    return np.column_stack([np.zeros(3), side])


def _plate(axis: int, place: float, side: Array) -> str:
    """An STL plate of two triangles across `axis` at `place` m, twice as wide as the box."""
    corners = np.zeros((4, 3))
    corners[:, axis] = place
    for across, ends in ((1, (-0.5, 1.5, 1.5, -0.5)), (2, (-0.5, -0.5, 1.5, 1.5))):
        corners[:, (axis + across) % 3] = np.array(ends) * side[(axis + across) % 3]
    text = "solid plate\n"
    for triangle in ((0, 1, 2), (0, 2, 3)):
        text += f"facet normal {' '.join(str(int(k == axis)) for k in range(3))}\nouter loop\n"
        text += "".join(f"vertex {x:.15g} {y:.15g} {z:.15g}\n" for x, y, z in corners[[*triangle]])
        text += "endloop\nendfacet\n"
    return text + "endsolid plate\n"


def unbonded(trial: Trial, *, liggghts: bool) -> dict[str, float]:
    """Axial over side stress and volume of a pack that LIGGGHTS pressed, by strain."""
    case = case_of(trial.seed, 2.4, "walls")
    grains = packed(case, trial.folder.parent)
    pressed = run_servo(case, grains, trial.folder / "pressed", steps=12_000, rate=0.0).grains
    if liggghts:
        curve = run_servo(case, pressed, trial.folder, steps=0, rate=RATE)
        strains = -np.log(curve.side / curve.side[0])
        strain, volume = strains[:, 0], strains.sum(axis=1)
        ratio = curve.stress[:, 0] / curve.stress[:, 1:].mean(axis=1)
    else:
        test = Triaxial(confining=PRESSURE, strain=STRAIN, steps=40, relieved=False)
        rows = triaxial(pressed, pack_material(case, pressed), test, periodic=(False,) * 3).rows
        seen = [(row.axial_strain, row.axial / row.side, row.volume_strain) for row in rows]
        strain, ratio, volume = np.array(seen).T
    half, end = (strain >= 0.25 * STRAIN) & (strain <= 0.6 * STRAIN), strain >= 0.75 * STRAIN
    rise = float(np.interp(0.1 * STRAIN, strain, ratio) - ratio[0])
    means = {"ratio_half": float(ratio[half].mean()), "ratio_end": float(ratio[end].mean())}
    return {"slope": rise / (0.1 * STRAIN), **means, "dilation": float(-volume[-1])}


# ---- Sand under isotropic stress, and bonded grains in the flow.


def stress(trial: Trial, *, stiffness: float) -> dict[str, float]:
    """Porosity and permeability under the stress of the trial, MPa."""
    case = case_of(trial.seed, 2.4, "periodic", stiffness)
    grains = packed(case, trial.folder.parent)
    if trial.value:
        material = replace(pack_material(case, grains), glued=False)
        test = Triaxial(confining=1e6 * trial.value)
        grains = confined(grains, material, test, case.periodic)[0].grains
    result = analyse(grains, None, periodic=case.periodic)
    return {"porosity": result.porosity_initial, "k": result.k_initial}


def displacement_under_flow(
    grains: Snapshot, material: PackMaterial, gradient: float, *, periodic: tuple[bool, bool, bool]
) -> Array:
    """Displacement (N, 3), m, of the grains by a fall of pressure along x of `gradient` Pa/m.

    The fluid pushes each grain that carries with an equal share of the gradient times the volume
    of the box; the plates at the ends, to which the outermost grains are glued, hold the pack.
    """
    joints, kept = carrying(grains, material, periodic)
    springs = contact_springs(joints, material) + bond_springs(joints, material)
    moving, length = np.flatnonzero(np.repeat(kept, 6)), float(grains.radius.mean())
    live = kinematics(joints, len(grains), length=length).of_grains[:, moving]
    push, volume = np.zeros((len(grains), 6)), float(np.prod(np.diff(grains.box, axis=1)))
    push[kept, 0] = gradient * volume / max(1, int(kept.sum()))
    moved = np.zeros(6 * len(grains))
    moved[moving] = solver_of(stiffness_matrix(live, springs))(push.ravel()[moving])
    return moved.reshape(-1, 6)[:, :3]


def bonds(trial: Trial, *, normal: float, shear: float) -> dict[str, float]:
    """The largest displacement by the thesis's fall of pressure, 3.5 MPa over 8 mm."""
    case = case_of(trial.seed, 2.4, "periodic", QUARTZ, trial.value)
    grains = packed(case, trial.folder.parent)
    cement = Cement(radius_ratio=1.0, normal=normal, shear=shear)
    springs = pack_material(case, grains)
    material = PackMaterial(normal=springs.normal, shear=springs.shear, cement=cement)
    moved = displacement_under_flow(grains, material, 3.5e6 / 8e-3, periodic=case.periodic)
    return {"moved": float(moved[:, 0].max())}


# ---- The judges.


def judge_moduli(rows: pd.DataFrame) -> list[Finding]:
    """Young's modulus over that of the largest periodic cube."""
    own = rows[rows.quantity == "young"]
    young = {
        (name, edge): float(own[(own.comparison == name) & (own.value == edge)].observed.mean())
        for name, edge in sorted(set(zip(own.comparison, own.value, strict=True)))
    }
    most = max((edge for name, edge in young if "periodic" in name), default=0.0)
    lines = []
    for (name, edge), value in young.items():
        share = value / young.get(("moduli, periodic sides", most), math.nan)
        if edge < most and ("walls" in name or edge == min(edge for _, edge in young)):
            what = f"{name}: Young's, {edge:g} mm over {most:g} mm"
            lines.append(Finding(what, "1 ± 10 %", ITSELF, f"{share:.3f}", (share - 1) / 0.1))
    return lines


def judge_test(rows: pd.DataFrame) -> list[Finding]:
    """Differences of equal seeds and their 95 % bands (Student)."""
    words = {
        "slope": "triaxial test: slope at 0.2 %",
        "ratio_half": "axial over side stress, 1 %",
        "ratio_end": "axial over side stress, 2 %",
        "dilation": "volume gained, 2 %",
    }
    lines = []
    for quantity, what in words.items():
        own = rows[rows.quantity == quantity].pivot(
            index="seed", columns="comparison", values="observed"
        )
        if own.shape[1] == 2 and len(own) > 1:
            dem, static = own["unbonded test, LIGGGHTS"], own["unbonded test, quasi-static"]
            apart, mean = static - dem, dem.mean()
            band = student.ppf(0.975, len(own) - 1) * apart.std() / math.sqrt(len(own))
            seen = f"{static.mean():.3g}"
            over = apart.mean() / band
            lines.append(Finding(what, f"{mean:.3g} ± {band:.2g}", "LIGGGHTS", seen, over))
    return lines


def judge_stress(rows: pd.DataFrame) -> list[Finding]:
    """Permeability at the largest stress over that without."""
    k = rows[rows.quantity == "k"].groupby("value")["observed"].mean()
    if len(k) < 2:
        return []
    most = max(k.index)
    share, law = k[most] / k[0.0], math.exp(-TREND * most)
    what = f"k of {rows.comparison.iloc[0]}, {most:g} MPa over 0"
    over = (share - law) / 0.02
    return [Finding(what, f"{law:.3f} ± 0.02", "Nazarova 2019", f"{share:.3f}", over)]


def judge_moved(rows: pd.DataFrame) -> list[Finding]:
    """The largest displacement over the radius of a grain."""
    if rows.empty:
        return []
    moved, what = (
        rows.observed.max(),
        f"a grain with {rows.comparison.iloc[0]} moves, of its radius",
    )
    share = moved / 2.5e-4
    return [Finding(what, "below 1 %", ITSELF, f"{100 * share:.2g} %", share / 0.01)]


def draw_stress(axes: Any, rows: pd.DataFrame) -> None:
    """Permeability over that without stress, with the range of the seeds and the measured law."""
    for name, colour in (("sand of quartz", BLUE), ("sand of 4.8 GPa", ORANGE)):
        own = rows[(rows.comparison == name) & (rows.quantity == "k")]
        if len(own):
            k = own.pivot(index="value", columns="seed", values="observed")
            share = k / k.loc[0.0]
            axes.fill_between(
                share.index, share.min(axis=1), share.max(axis=1), color=colour, alpha=0.3
            )
            axes.plot(share.index, share.mean(axis=1), "o-", color=colour, label=name)
    along = np.linspace(0.0, 35.0, 20)
    axes.plot(along, np.exp(-TREND * along), "--", color=BLACK, label="measured (Nazarova 2019)")
    axes.set(xlabel="effective stress, MPa", ylabel="permeability over that without stress")
    axes.legend(fontsize=8)


CHAPTER = chapter_of(Path(__file__).with_suffix(".toml"), globals(), draw_stress)


def main(arguments: list[str]) -> int:
    """The command `validation.py mechanics`."""
    return command("mechanics", CHAPTER, arguments)
