"""The numbers in the prose on the studies of the invasion, each from the table of its study."""

import math
from collections.abc import Iterable
from pathlib import Path

from validation.dem import drag, size_ratio, stiffness, time_step
from validation.dem.runs import OBSERVED
from validation.engine.levels import Level, order
from validation.network import specimen_size
from validation.pages.lookup import (
    Lookup,
    exponent,
    lookup,
    percent,
    percents,
    with_band,
)

SOFT, SOFTEST = (1e2, 3e2), 1e2
DAMAGE = ("invaded", "porosity_loss", "k_ratio")


def invasion_numbers(validation: Path) -> dict[str, str]:
    """Every number by its name in docs/validation.md.in."""
    return {
        **_stiffness(lookup(validation, "stiffness")),
        **_time_step(lookup(validation, "time-step")),
        **_drag(lookup(validation, "drag")),
        **_specimen_size(lookup(validation, "specimen-size")),
        **_size_ratio(lookup(validation, "size-ratio")),
    }


def standing_out(levels: Iterable[Level]) -> list[Level]:
    """Levels whose error exceeds its band, the reference apart."""
    return [level for level in levels if not level.reference and level.size > level.half_width]


def _stiffness(table: Lookup) -> dict[str, str]:
    long, coarse = stiffness.LONG, stiffness.COARSE
    soft = [
        table.error(series, name, value)
        for series in (long, coarse)
        for name in DAMAGE
        for value in SOFT
    ]
    deep = [
        level
        for level in standing_out(table.levels(coarse, "mean_depth"))
        if float(level.value) >= 1e4
    ]
    overlap = table.levels(stiffness.COLLISION, "overlap_over_diameter")
    cost = {level.value: level.cost for level in table.levels(long, "invaded")}
    stiffer = math.sqrt(stiffness.NOMINAL / 1e7)
    return {
        "nominal_hours": f"{cost[1e7] * stiffer / 3600:.1f}",
        "overlap_exponent": f"{-exponent(overlap):.2f}",
        "soft_errors": percents(soft),
        "deep_fines": " and ".join(
            f"{with_band(level)} % at {float(level.value):.0e} N/m".replace("e+0", "e")
            for level in deep
        ),
        "scatter_count": percent(table.scatter(long, "invaded", 1e6), 1),
        "scatter_count_coarse": percent(table.scatter(coarse, "invaded", 1e6), 1),
        "scatter_k": percent(table.scatter(long, "k_ratio_first", 1e6)),
        "scatter_k_coarse": percent(table.scatter(coarse, "k_ratio_first", 1e6)),
        "hundredfold": f"{cost[1e6] / cost[1e4]:.0f}",
        "stiffness_restitution": percent(
            table.error(stiffness.COLLISION, "restitution_error", 1e4), 2
        ),
    }


def _time_step(table: Lookup) -> dict[str, str]:
    steps = {"cost": "steps"}
    collision = table.levels(time_step.COLLISION, "overlap_error", **steps)
    energy = [
        level
        for level in table.levels(time_step.ENERGY, "energy_drift", **steps)
        if float(level.value) <= 0.4
    ]
    longest = table.level(time_step.ENERGY, "energy_drift", 0.5)
    invaded = [
        level
        for name in OBSERVED
        for level in table.levels(time_step.INVASION, name)
        if not level.reference
    ]
    depth, inside = (
        table.level(time_step.LONGEST, name, 0.3) for name in ("mean_depth", "invaded")
    )
    return {
        "longest_depth": with_band(depth),
        "longest_inside": f"{percent(inside.size, 1)} ± {percent(inside.half_width, 1)}",
        "collision_order": f"{order(collision):.1f}",
        "energy_order": f"{order(energy):.1f}",
        "energy_drift": percent(longest.error, 2),
        "step_means": str(len(invaded)),
        "step_standing_out": str(len(standing_out(invaded))),
        "step_by_chance": f"{0.05 * len(invaded):.1g}",
    }


def _drag(table: Lookup) -> dict[str, str]:
    series = (drag.HOLDING, drag.OTHER)
    means = [level for name in OBSERVED for one in series for level in table.levels(one, name)]
    means = [level for level in means if not level.reference]
    held = {one: table.cost(one, "invaded", 0.05) for one in (drag.HOLDING, drag.WINDOW_HOLDING)}
    viscous = {
        drag.HOLDING: table.cost(drag.OTHER, "invaded", drag.VISCOUS),
        drag.WINDOW_HOLDING: table.cost(drag.WINDOW_OTHER, "invaded", drag.VISCOUS),
    }
    implicit = [table.error(drag.IMPLICIT, "relaxation_error", n) for n in (0.1, 0.05)]
    return {
        "held_fall": percent(table.error(drag.HELD, "relaxation_error", 1.0)),
        "drag_means": str(len(means)),
        "drag_standing_out": str(len(standing_out(means))),
        "held_depth": with_band(table.level(drag.HOLDING, "mean_depth", 0.05)),
        "viscous_saves": percents(1 - viscous[one] / held[one] for one in held),
        "implicit_order": f"{math.log2(implicit[0] / implicit[1]):.1f}",
        "implicit_long": percent(table.error(drag.IMPLICIT, "relaxation_error", 10.0)),
        "implicit_restarted": percent(table.error(drag.RESTARTED, "relaxation_error", 0.05), 1),
        "explicit_same": percent(table.error(drag.EVERY, "relaxation_error", 0.05), 1),
    }


def _specimen_size(table: Lookup) -> dict[str, str]:
    intact = f"{specimen_size.INTACT}, {specimen_size.PERIODIC}"
    invaded = f"{specimen_size.INVADED}, {specimen_size.PERIODIC}"
    walled = f"{specimen_size.INVADED}, {specimen_size.WALLS}"
    quick, five = (f"{specimen_size.INVADED}, {name}" for name in ("quick case", "specimen 5"))
    own = {name: float(grains) for name, (_, grains) in specimen_size.NAMED.items()}
    grains = {quick: own["quick case"], five: own["specimen 5"]}
    largest = table.levels(walled, "k_ratio_first")[-1]
    k = [level for level in table.levels(intact, "one run's k_initial") if not level.reference]
    loss = table.levels(invaded, "one run's porosity_loss_first")
    return {
        "size_k_exponent": f"{-exponent(k[:-1]):.1f}",
        "size_loss_exponent": f"{-exponent(loss[:-1]):.1f}",
        "walled_k_excess": percent(largest.error),
        "walled_k_grains": f"{float(largest.value):,.0f}",
        "walled_intact": percent(
            table.levels(f"{specimen_size.INTACT}, {specimen_size.WALLS}", "k_initial")[-1].error
        ),
        "quick_k_ratio": percent(table.error(quick, "k_ratio_first", grains[quick])),
        "five_k_ratio": percent(table.error(five, "k_ratio_first", grains[five])),
        "quick_scatter": percent(table.scatter(quick, "k_ratio_first", grains[quick])),
        "five_scatter": percent(table.scatter(five, "k_ratio_first", grains[five])),
        "bulk_scatter": percent(table.scatter(invaded, "k_ratio_first", float(largest.value))),
        "quick_k": percent(table.error(quick, "k_initial", grains[quick])),
        "five_k": percent(table.error(five, "k_initial", grains[five])),
    }


def _size_ratio(table: Lookup) -> dict[str, str]:
    def most(shear: str, ratios: Iterable[int]) -> str:
        names = {f"1/{ratio}" for ratio in ratios}
        return str(
            max(
                size_ratio.held_of(row)
                for row in table.rows
                if row.quantity == size_ratio.HELD
                and row.series.split(", ")[0] in names
                and row.series.split(", ")[1] == shear
            )
        )

    return {
        "ratio_material": most(size_ratio.MATERIAL, [30]),
        "ratio_default": most(size_ratio.DEFAULT, [10, 20, 30]),
    }
