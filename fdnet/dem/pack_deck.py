"""The packing deck and its data file: small spheres at random places, to be grown and relaxed."""

import math
from pathlib import Path

import numpy as np

from fdnet.case.case import Case
from fdnet.dem.contact_lines import contact_variables, damped_alike
from fdnet.dem.deck import Deck, LeftOut, number, render_text
from fdnet.dem.scene import (
    box_of,
    header_variables,
    wall_variables,
    write_data,
)
from fdnet.errors import DumpError
from fdnet.scales.grain_pack import (
    PACK_RELAX_STEPS,
    PACK_STAGE_STEPS,
    PACK_STAGES,
    PACK_START,
)
from fdnet.scales.scales import Scales
from fdnet.scales.springs import sphere_mass
from fdnet.spheres.dump import COLUMNS, FORMAT
from fdnet.spheres.snapshot import Array, Snapshot, resting

PACK_DAMPING = 0.4 / math.sqrt(2)
"""Damping of two grains over the critical one: 0.8 sqrt(k/m) of their joint mass m/2."""
RELAX_RUN_STEPS = 2500
"""Steps between two tests for rest."""
RADIUS_TOLERANCE = 1e-9
"""Largest relative difference by the rounding of the stages of growth."""
REST_RUNS = 4 * PACK_RELAX_STEPS // RELAX_RUN_STEPS
"""Most tests for rest."""


def write_pack_inputs(
    case: Case,
    scales: Scales,
    folder: Path,
    *,
    count: int,
    ranks: int = 1,
    shown: tuple[int, ...] = (),
    places: int = 0,
) -> Deck:
    """Write in.pack and pack.data, `count` small spheres at random, into `folder`.

    `places` numbers the sets of random places that the same grains may start from. For `shown` see
    `render_pack`.
    """
    deck = render_pack(case, scales, count=count, ranks=ranks, shown=shown)
    (folder / "in.pack").write_text(deck.text)
    radii = draw_radii(case, count)
    rng = np.random.default_rng([case.seed, count, *([places] if places else [])])
    small, size = PACK_START * radii, np.array(case.size_m)
    margin = small[:, None] * np.array(
        [1.0, *([0.0, 0.0] if case.box.sides == "periodic" else [1.0, 1.0])]
    )
    place = margin + rng.random((count, 3)) * (size - 2 * margin)
    seeds = resting(place, small, box_of(case))
    write_data(
        folder / "pack.data",
        seeds,
        bounds=box_of(case),
        density=np.full(count, case.grains.density_kg_m3),
        types=2,
    )
    return deck


def draw_radii(case: Case, count: int) -> Array:
    """`count` radii (N,) m.

    Of a measured curve they are its strata in random order. Of a range they are uniform by number,
    the last one chosen so that the sum of volumes comes as near to the expected one as it can.
    """
    if case.grains.measured:
        order = np.random.default_rng([case.seed, 7]).permutation(count)
        return 0.5 * case.grains.curve.strata(count)[order]
    low, high = case.grains.radius_range_m
    radii = np.random.default_rng([case.seed, 7]).uniform(low, high, count)
    if low < high and count > 1:
        wanted = count * case.grains.mean_volume_m3 - 4 / 3 * math.pi * np.sum(radii[:-1] ** 3)
        radii[-1] = np.clip(np.cbrt(max(wanted, 0.0) * 3 / (4 * math.pi)), low, high)
    return radii


def check_radii(grains: Snapshot, case: Case, path: Path) -> None:
    """Raise DumpError unless the grains read from `path` have the radii that the case asks for."""
    asked = draw_radii(case, len(grains))
    wrong = np.flatnonzero(np.abs(grains.radius - asked) > RADIUS_TOLERANCE * asked)
    if len(wrong):
        first = wrong[0]
        raise DumpError(
            f"{path}: {len(wrong)} of {len(grains)} grains have another radius than the case asks "
            f"for, the first (id {grains.id[first]:.0f}) {grains.radius[first]:.9g} m, expected "
            f"{asked[first]:.9g} m; the file was changed, or it is the pack of another case: "
            "start over with --force"
        )


def render_pack(
    case: Case, scales: Scales, *, count: int, ranks: int = 1, shown: tuple[int, ...] = ()
) -> Deck:
    """The packing deck: soft springs without friction, viscous damping, growth, test for rest.

    After the stages of growth in `shown` (1 to `PACK_STAGES`) it also dumps to
    post/grown_STAGE.dump.
    """
    stiffness = scales.contacts["grain-grain"].normal_stiffness
    low, high = case.grains.radius_range_m
    mass = sphere_mass(low, case.grains.density_kg_m3)
    left_out = [
        LeftOut(what="friction and tangential history", why="grains are packed frictionless"),
        LeftOut(what="gravity", why="only the geometry of the pack is wanted"),
        LeftOut(what="fines and fluid", why="the pack is made before the invasion"),
    ]
    if ranks == 1:
        left_out.append(LeftOut(what="MPI processor grid", why="one rank"))
    rate = 0.8 * math.sqrt(stiffness / mass)
    contacts = damped_alike(
        case, contact_variables(case, scales, "pack", friction=False), PACK_DAMPING, rate
    )
    text = render_text(
        "pack.in.j2",
        header_variables(case, "pack", left_out, ranks)
        | {
            "skin": number(0.4 * low),
            "contacts": contacts,
            "walls": wall_variables(case, "pack", friction=False),
            "time_step": number(scales.pack_step),
            "viscous": number(0.03 * math.sqrt(stiffness * mass)),
            "thermo_steps": RELAX_RUN_STEPS,
            "density": number(case.grains.density_kg_m3),
            "stages": [
                number((PACK_START + (1 - PACK_START) * s / PACK_STAGES) / PACK_START)
                for s in range(1, PACK_STAGES + 1)
            ],
            "stage_steps": PACK_STAGE_STEPS,
            "shown": shown,
            "relax_runs": REST_RUNS,
            "relax_steps": RELAX_RUN_STEPS,
            "rest_energy": number(count * 1e-10 * 0.5 * stiffness * (0.02 * high) ** 2),
            "dump_columns": COLUMNS,
            "dump_format": FORMAT,
        },
    )
    return Deck(text=text, stage="pack", digest=case.digest("pack"), left_out=tuple(left_out))
