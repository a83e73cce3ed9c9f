"""What a specimen hands up to the model, and what that says of a core and a well, with bands.

The depths of the fines give rate and growth: the share that gets deeper than x is ln(1 - w) / -g,
with g = ln(1 + growth s(0)) and w = (1 - exp(-g)) exp(-rate x) (docs/theory/from_core_to_well.md).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import curve_fit, minimize

from fdnet.case.case import InvasionCase
from fdnet.errors import CaseError
from fdnet.files import expanded, write_text
from fdnet.formation.model import CAKE_SKINS, Column, Flood, March, Medium, march
from fdnet.report.figures import BLUE, DEPTH_LABEL, GREY, MM, draw
from fdnet.report.html import FORMATION, formation_html, put_section
from fdnet.report.tables import plain_json
from fdnet.run.answer import DAMAGED_FROM, flow_lost, hawkins
from fdnet.run.by_classes import FIRST_DRAWN, Rested, rested_classes
from fdnet.run.finished import FinishedRun, open_run
from fdnet.run.folder import MANIFEST, locked
from fdnet.scales.flow import USUAL_WELL, api_permeability
from fdnet.spheres.snapshot import Array
from fdnet.statistics.bands import student_band

FEWEST, LEAST_LOSS, DRAWS, PLACES, CELLS = 30, 0.02, 24, 800, 120
"""Fines that a fit needs, least loss that gives a damage, draws, places of a fit, cells."""
DEPTHS = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)
"""Depths, m, at which a well gives k / k0."""
SHOTS, SHOT_LENGTH, SHOT_RADIUS = 13.0, 0.3, 0.005
"""Perforations: number a metre (4 a foot), length and radius, m."""


# ---- What a specimen hands up.
def fit_depths(
    fines: Rested, length: float, random: np.random.Generator | None = None
) -> tuple[float, float, float]:
    """Rate (1/m), g, and volume (m3) of the fines that got into a specimen of `length` m.

    That of the largest likelihood, each fine by its volume, those that passed by the share that
    gets through; constant where they are too few. With `random` each counts by chance.
    """
    depth, whole = np.append(fines.depth, length), float(fines.volume.sum())
    single = max(whole, 1e-300) / max(fines.number, 1.0)
    count = np.append(fines.volume, fines.passed) / single
    count = count if random is None else random.gamma(count)
    far = max(float(count @ depth) / max(float(count[:-1].sum()), 1e-300), 1e-6 * length)
    if fines.number < FEWEST:
        return 1 / far, 1e-6, single * float(count.sum())

    def unlikely(values: Array) -> float:
        rate, g = math.exp(values[0]), values[1] if abs(values[1]) > 1e-6 else 1e-6
        w = -math.expm1(-g) * np.exp(-rate * depth)
        inside = values[0] + np.log(w / g) - np.log1p(-w)
        beyond = np.log(np.log1p(-w[-1]) / -g) if count[-1] else 0.0
        return -float(count[:-1] @ inside[:-1] + count[-1] * beyond)

    first, bounds = [-math.log(far), 0.5], ((0.0, 18.0), (-4.0, 8.0))
    best = minimize(unlikely, first, bounds=bounds, method="Nelder-Mead").x.tolist()
    return math.exp(best[0]), best[1], single * float(count.sum())


def fit_damage(kept: Array, deposit: Array, share: Array) -> tuple[float, float]:
    """ln(damage) of k = k0 / (1 + damage s)^2 and its standard error.

    From k / k0 of sections (S,) and the deposit at places (F,), `share` (S, F) being the part of
    a section that each stands for; they resist one after the other. One section has no error.
    """

    def law(_: Any, value: float) -> Array:
        return -np.log(share @ (1 + math.exp(value) * deposit) ** 2)

    best, spread = curve_fit(law, None, np.log(kept), p0=2.0)
    return float(best[0]), math.sqrt(spread[0, 0]) if kept[1:].size else 0.0


class HandedUp(NamedTuple):
    """What a specimen hands up, and the evidence for it."""

    run: FinishedRun
    medium: Medium  # rock and mud of `fdnet.formation.model.march`
    x: Array  # (F,) m, even depths of the specimen
    fitted: Array  # (F,) deposit there, by the fit
    notes: tuple[str, ...]  # what could not be told, and what was assumed
    api_filtrate: float | None  # m3, that the cake is known by


def hand_up(
    source: str | Path | FinishedRun, *, api_filtrate: float | None = None
) -> list[HandedUp]:
    """What a run hands up, in SI units; behind it `DRAWS` samples of its fines, or other seeds.

    The fines of LIGGGHTS are one class, and each class of the network is one of its own. Raises
    CaseError where the specimen cannot tell the filtration or the damage.

    Args:
        source: a run, its folder, or the folder of an ensemble.
        api_filtrate: m3 in the API's test, which the permeability of the cake follows from.

    Examples:
        >>> import fdnet
        >>> fdnet.hand_up("runs/quick")[0].medium.closing > 0
        True
    """
    _above_zero(api_filtrate=api_filtrate)
    if isinstance(source, FinishedRun):
        return _of_run(source, api_filtrate, DRAWS)
    folder = expanded(source)
    folders = [one.parent for one in sorted((folder / "runs").glob(f"*/{MANIFEST}"))]
    runs = [open_run(one) for one in folders or [folder]]
    if any({**one.case.data(), "seed": 0} != {**runs[0].case.data(), "seed": 0} for one in runs):
        raise CaseError(
            f"{folder}: its runs differ by more than the seed; give one of them, or an ensemble"
        )
    draws = 0 if runs[1:] else DRAWS
    return [handed for run in runs for handed in _of_run(run, api_filtrate, draws)]


def kept_by(run: FinishedRun) -> Array:
    """(S,) k / k0 of the sections of a run, in place."""
    after, before = (run.sections[f"k_{one}_inplace_m2"] for one in ("damaged", "initial"))
    return (after / before).to_numpy()


def _rested(run: FinishedRun, case: InvasionCase) -> list[Rested]:
    """The spheres as one kind, then each class of the network."""
    classes = rested_classes(run, case) if "method" in run.summary else []
    if case.by_classes:
        return classes
    fines = run.spheres().fines()
    fines = fines.where(fines.id < FIRST_DRAWN)
    x, volume = fines.position[:, 0], 4 / 3 * np.pi * fines.radius**3
    rest, last = (x >= 0) & (x < case.size_m[0]), run.history if classes else run.summary
    spheres = Rested(
        name=f"{2e6 * fines.radius.mean():.3g} µm",
        concentration=case.fines.volume_fraction - sum(one.concentration for one in classes),
        depth=x[rest],
        volume=volume[rest],
        passed=float(np.max(last["passed_count"])) * float(volume.mean()),
        number=float(volume[rest].sum() ** 2 / max(np.sum(volume[rest] ** 2), 1e-300)),
    )
    return [spheres, *classes]


def _of_run(run: FinishedRun, api_filtrate: float | None, draws: int) -> list[HandedUp]:
    case, summary, start = run.case, run.summary, f"{run.path}: "
    if not isinstance(case, InvasionCase) or not summary["supplied_count"]:
        raise CaseError(f"{start}no fines were supplied, so nothing is filtered")
    length, kinds, passed = case.size_m[0], _rested(run, case), summary["passed_count"]
    found = round(sum(one.number for one in kinds))
    if found == 0 and passed:
        raise CaseError(
            f"{start}all {passed} fines passed {1e3 * length:g} mm, none was filtered: the rate "
            f"of filtration is below {3 / passed / length:.2g} 1/m (95 %); take a longer specimen"
        )
    if found < FEWEST and summary["stop_reason"] != "plugged":
        raise CaseError(
            f"{start}{found} fines inside, {FEWEST} are needed to fit a rate of filtration, or a "
            "face that closes; supply more mud"
        )
    medium, notes = _without_filtration(run, case, kinds, api_filtrate)
    x = (np.arange(PLACES) + 0.5) * (length / PLACES)
    if found < FEWEST:
        notes.append(f"only {found} fines entered before the face closed: all is cake")
        return [HandedUp(run, medium, x, 0.0 * x, tuple(notes), api_filtrate)]
    if few := [one.name for one in kinds if one.number < FEWEST]:
        notes.append(
            f"too little of the fines of {', '.join(few)} rests inside for more than one number: "
            "their filtration is taken as constant"
        )
    kept = kept_by(run)
    paths = (kept > 0) & np.isfinite(kept)
    if not paths.any() or kept[paths].min() > 1 - LEAST_LOSS:
        raise CaseError(
            f"{start}no open section lost {LEAST_LOSS:.0%} of its permeability, so the harm of a "
            "deposit cannot be told; supply more mud"
        )
    low, high = run.sections[paths][["x_lo_m", "x_hi_m"]].to_numpy().T[..., None]
    share = ((x >= low) & (x < high)).astype(float)
    share /= share.sum(axis=1, keepdims=True)
    random, many = np.random.default_rng(0), list[HandedUp]()
    for sample in [None, *[random] * draws]:  # the first is the fit itself
        fits = [fit_depths(one, length, sample) for one in kinds]
        rate, g, volume = np.array(fits).T
        amount = rate * volume / math.prod(case.size_m[1:]) / g
        face = float(amount @ np.expm1(g))
        w = -np.expm1(-g) * np.exp(-np.outer(x, rate))
        fitted = w / (1 - w) @ amount
        harm, error = fit_damage(kept[paths], fitted, share)
        damage = math.exp(harm + (error * sample.standard_normal() if sample else 0.0))
        own = replace(medium, damage=damage, rate=rate, growth=np.expm1(g) / face, closing=face)
        many.append(HandedUp(run, own, x, fitted, tuple(notes), api_filtrate))
    return many


def _without_filtration(
    run: FinishedRun, case: InvasionCase, kinds: Sequence[Rested], api_filtrate: float | None
) -> tuple[Medium, list[str]]:
    """Rock and mud whose face is closed, and notes.

    Without an API filtrate the cake is that of the packed slices, also where they are thinner than
    a cake should be. The share that back-flow takes is that of the run's clean-up.
    """
    notes, k, cleaned = list[str](), None, run.summary.get("clean_up")
    cake, stop = run.summary.get("cake") or {}, run.summary["stop_reason"]
    solids, pores = np.array([one.concentration for one in kinds]), cake.get("porosity") or 0.5
    mud = {"viscosity": case.fluid.viscosity_Pa_s, "porosity": pores}
    if stop != "plugged":
        notes.append(
            f"the run ended by {stop} and not by a closed face: what follows when the face has "
            "this deposit is not known"
        )
    if api_filtrate is not None:
        k = api_permeability(api_filtrate, **mud, solids=float(solids.sum()))
    elif not cake.get("packed_thickness_m"):
        notes.append("no packed cake stands before the face: its permeability is not known")
    elif stop == "plugged" and (k := cake["k_m2"]) is None:
        notes.append(f"{cake['no_cake_yet']}; its permeability is taken as if it were one")
        k = cake["packed_thickness_m"] / cake["resistance_1_m"]
    share = cleaned["came_out"] / max(cleaned["inside_before"], 1) if cleaned else 0.0
    if share:
        notes.append(
            f"back-flow takes {share:.0%} of the deposit, as the clean-up of the run did; that "
            "it falls to 1/e with each pore volume of the specimen is assumed"
        )
    medium = Medium(
        porosity=run.porosity_initial,
        permeability=run.k_initial_m2,
        viscosity=case.fluid.viscosity_Pa_s,
        names=tuple(one.name for one in kinds),
        solids=solids,
        rate=0.0 * solids,
        growth=0.0 * solids,
        closing=0.0,
        cake_porosity=pores,
        cake_permeability=k,
        released=share,
        release_rate=1 / (run.porosity_initial * case.size_m[0]),
    )
    return medium, notes


# ---- A core and a well.
def core_flood(
    source: str | Path | FinishedRun | list[HandedUp],
    *,
    length: float,
    diameter: float = 0.038,
    rate: float | None = None,
    pressure: float | None = None,
    minutes: float = 30.0,
    back_flow: float = 10.0,
    sections: int = 4,
    api_filtrate: float | None = None,
) -> dict[str, Any]:
    """A core of the specimen's sand flooded with its mud; then the flow is turned back.

    It gives numbers in SI by name, with the ends of their 95 % bands as `_low` and `_high` (`_of`:
    how many seeds or fits have one, where not all have), rows by place, what was `handed_up`,
    `warnings`, and the answer in `words`. Raises CaseError where an argument is not above 0, or
    the specimen cannot tell.

    Args:
        source: a run, its folder, the folder of an ensemble, or what `hand_up` gave of it.
        length, diameter: m.
        rate, pressure: m3/s, or Pa over the core and its cake; one of them.
        minutes: of the flood.
        back_flow: pore volumes that flow back, where the run had a clean-up.
        sections: equal ones, between pressure taps.
        api_filtrate: m3 in the API's test, which the permeability of the cake follows from.

    Examples:
        >>> import fdnet
        >>> core = fdnet.core_flood("runs/quick", length=0.076, rate=1.7e-8)
        >>> 0 < core["k_over_k0"] < 1
        True
    """
    if (rate is None) == (pressure is None):
        raise CaseError("a core takes a rate or a pressure; give one of --rate and --pressure")
    _above_zero(length=length, diameter=diameter, minutes=minutes, sections=sections)
    _above_zero(rate=rate, pressure=pressure, back_flow=back_flow)
    area, taps = math.pi * diameter**2 / 4, np.linspace(0.0, length, sections + 1)
    drive = Flood(60 * minutes, pressure or math.nan, rate)

    def flooded(medium: Medium, _: Any) -> dict[str, Any]:
        column = _column(medium, length, area)
        made = march(column, medium, [drive], taps=taps)
        kept = {"k_over_k0": made.k_over_k0[-1]}
        if medium.released:
            flow = abs(float(made.rate[0]))
            back = Flood(back_flow * medium.porosity * area * length / flow, rate=-flow)
            after = march(column, medium, [drive, back], taps=taps)
            kept["return_k_over_k0"] = after.k_over_k0[-1]
        drops = np.cumsum(made.parts[-1, ::-1])[::-1]
        table = {"x_lo_m": taps[:-1], "x_hi_m": taps[1:], "pressure_Pa": drops[1:-1], **kept}
        return {
            **{name: float(sections / np.sum(1 / of_each)) for name, of_each in kept.items()},
            **_common(medium, column, made),
            "rate_m3_s": float(made.rate[-1]),
            "pressure_Pa": float(drops[0]),
            "effluent_over_c0": float(made.effluent[-1].sum() / medium.solids.sum()),
            "sections": pd.DataFrame(table).to_dict("records"),
        }

    found = _banded(source, flooded, api_filtrate)
    face = found["sections"][0]
    words = [
        f"A core of {1e3 * length:g} mm keeps {with_band(found, 'k_over_k0')} of its k0.",
        f"Its first {1e3 * taps[1]:.3g} mm keep {with_band(face, 'k_over_k0')}.",
    ]
    if (name := "return_k_over_k0") in face:
        words.append(
            f"After a back-flow of {back_flow:g} pore volumes they are {with_band(found, name)} "
            f"and {with_band(face, name)}."
        )
    return found | {"words": words}


def well_invasion(
    source: str | Path | FinishedRun | list[HandedUp],
    *,
    hours: float = 12.0,
    pressure: float | None = None,
    radius: float | None = None,
    api_filtrate: float | None = None,
) -> dict[str, Any]:
    """A metre of a well drilled through the specimen's sand with its mud, open and perforated.

    It gives numbers, and raises errors, as `core_flood` does. The skin of the damage is integrated
    over the depth (`skin`) and by Hawkins; the lost flow is the share of the productivity; the
    skin of the cake counts while the cake stands.

    Args:
        source, api_filtrate: as of `core_flood`.
        hours: that the mud stands.
        pressure: Pa, overbalance; without it that of the case.
        radius: m, of the well; without it that of the case, or 108 mm.

    Examples:
        >>> import fdnet
        >>> fdnet.well_invasion("runs/quick", hours=12)["skin"] > 0
        True
    """
    _above_zero(hours=hours, pressure=pressure, radius=radius)

    def drilled(medium: Medium, case: Any) -> dict[str, Any]:
        usual, outer = USUAL_WELL
        if case.well is not None:
            usual, outer = case.well.radius_m, case.well.drainage_radius_m
        well, over = radius or usual, pressure or case.fluid.overbalance_Pa
        if well + SHOT_LENGTH >= outer:
            most = f"{outer - SHOT_LENGTH:g} m, the drainage radius less a perforation"
            raise CaseError(f"radius: {well:g} m, expected below {most}")
        if not over:
            raise CaseError("the case has no fluid.overbalance_MPa; give --pressure")
        deep, answers = 20 / min(medium.rate[medium.rate > 0], default=20.0), []
        for hole, high in ((SHOT_RADIUS, SHOTS * SHOT_LENGTH), (well, 1.0)):
            area, length = 2 * math.pi * hole * high, min(outer - hole, deep)
            column = _column(medium, length, area, well=hole, outer=outer - hole)
            made = march(column, medium, [Flood(3600 * hours, over)])
            loss = medium.loss(made.end.deposit.sum(axis=0))
            skin = column.skin(loss) / high
            answers.append({"skin": skin, "flow_lost": flow_lost(skin, well=well, drainage=outer)})
        zone = int(np.max(np.flatnonzero(1 / loss <= 1 - DAMAGED_FROM) + 1, initial=0))
        rings, depth = np.diff(column.reach(column.edges))[:zone], float(column.edges[zone])
        ratio = float(rings.sum() / (rings @ loss[:zone])) if zone else 1.0
        found = _common(medium, column, made)
        if medium.cake_permeability:
            thin = CAKE_SKINS["inward"](found["cake_thickness_m"] / well)
            found["skin_cake"] = thin * medium.permeability / medium.cake_permeability
        pores, middle = math.pi * medium.porosity, (column.edges[:-1] + column.edges[1:]) / 2
        left = np.interp(DEPTHS, middle, 1 / loss, right=1.0)
        return {
            **found,
            "invasion_radius_m": math.sqrt(well**2 + found["filtrate_m3"] / pores),
            **answers[1],
            "skin_hawkins": hawkins(ratio, well=well, damaged=well + depth),
            "damaged_depth_m": depth,
            "perforated": answers[0],
            "k_over_k0": pd.DataFrame({"depth_m": DEPTHS, "k_over_k0": left}).to_dict("records"),
        }

    found = _banded(source, drilled, api_filtrate)
    shot = found["perforated"]
    words = [
        f"The damage is a skin of {with_band(found, 'skin')} and costs an open hole "
        f"{with_band(found, 'flow_lost')} of its productivity.",
        f"It matters where the flow has less room: perforations that met this mud ({SHOTS:g} a "
        f"metre, {1e3 * SHOT_LENGTH:g} mm long, {1e3 * SHOT_RADIUS:g} mm radius) have a skin of "
        f"{with_band(shot, 'skin')} and lose {with_band(shot, 'flow_lost')}.",
        f"In {found['time_s'] / 3600:.3g} h {with_band(found, 'filtrate_m3')} m3 of filtrate a "
        f"metre reach a radius of {with_band(found, 'invasion_radius_m')} m.",
    ]
    return found | {"words": words}


def _column(medium: Medium, length: float, area: float, **around: float) -> Column:
    """Cells that grow by one factor, slowly within the reach of filtration by a closing face."""
    steepest = float((medium.rate * (1 + np.maximum(medium.growth, 0) * medium.closing)).max())
    scale = 1 / (steepest + 1 / length)
    edges = np.geomspace(scale, scale + length, CELLS + 1) - scale
    return Column(edges=edges, area=area, **around)


def _common(medium: Medium, column: Column, made: March) -> dict[str, Any]:
    """What a core and a well have in common; of several classes each number has its name."""
    inside = np.cumsum(made.end.deposit.sum(axis=0) * column.volume)
    handed: dict[str, Any] = {}
    for name, rate, growth in zip(medium.names, medium.rate, medium.growth, strict=True):
        end = f"_{name}" if medium.names[1:] else ""
        handed |= {f"rate_1_m{end}": float(rate), f"growth{end}": float(growth)}
    handed |= {"closing_deposit": medium.closing, "damage": medium.damage}
    return {
        "time_s": float(made.time[-1]),
        "closed_at_s": made.closed_at,
        "filtrate_m3": float(made.filtrate[-1]),
        "cake_thickness_m": float(made.end.cake / column.area),
        "depth_p95_m": float(np.interp(0.95 * inside[-1], inside, column.edges[1:])),
        "stopped": made.stopped,
        "handed_up": handed | {"cake_permeability_m2": medium.cake_permeability},
    }


# ---- Bands, words and files.
def _banded(
    source: Any, by_model: Callable[[Medium, Any], dict[str, Any]], api_filtrate: float | None
) -> dict[str, Any]:
    """What the model gives for all that is handed up, with bands: of seeds, or of the fits."""
    many = source if isinstance(source, list) else hand_up(source, api_filtrate=api_filtrate)
    if not many:
        raise CaseError("core or well: an empty list, expected what hand_up gives of a run")
    if (by := many[0].api_filtrate) != api_filtrate:
        raise CaseError(f"api_filtrate: {api_filtrate}, expected {by} as it was handed up with")
    seeds = len({one.run.path for one in many})
    each = [by_model(one.medium, one.run.case) for one in many]
    notes = [note for one in many for note in one.notes]
    for stopped in filter(None, (one.pop("stopped") for one in each)):
        what = "" if api_filtrate else "; give --api-filtrate"
        notes.append(f"{stopped}: the numbers are those of that time{what}")
    found = _merged(each, seeds)
    return found | {"seeds": seeds, "warnings": list(dict.fromkeys(notes))}


def _merged(trees: Sequence[Any], seeds: int) -> Any:
    """The first of the trees, a number that differs between them with its band.

    The first is that of a single run, and the mean takes its place where there are several. Where
    some have no such number, `_of` says how many have one.
    """
    if isinstance(trees[0], list):
        return [_merged(row, seeds) for row in zip(*trees, strict=False)]
    result: dict[str, Any] = {}
    for key in dict.fromkeys(key for tree in trees for key in tree):
        known = [tree[key] for tree in trees if tree.get(key) is not None]
        value = known[0] if known and seeds > 1 else trees[0].get(key)
        result[key] = _merged(known, seeds) if isinstance(value, dict | list) else value
        if isinstance(value, float) and not np.allclose(known, value, 1e-9, 0):
            low, high = np.percentile(known, (2.5, 97.5)).tolist()
            if seeds > 1:
                band = student_band(known)
                value, low, high = band.mean, band.low, band.high
            result |= {key: value, f"{key}_low": low, f"{key}_high": high}
        if 0 < len(known) < len(trees):
            whose = "seeds" if seeds > 1 else "fits"
            result[f"{key}_of"] = f"{len(known)} of {len(trees)} {whose}"
    return result


def with_band(row: Mapping[str, Any], key: str) -> str:
    """The number of a row with its band, and of whom it is; a share in percent.

    A number that a single run does not have is unknown, even where some of its fits have one.
    """
    of = row.get(f"{key}_of")
    if row[key] is None:
        return f"unknown ({of} have it)" if of else "unknown"
    share = key.endswith(("_over_k0", "_lost"))
    values = [row[key], row.get(f"{key}_low"), row.get(f"{key}_high")]
    one, *band = (None if v is None else f"{100 * v:.3g}" if share else f"{v:.3g}" for v in values)
    unit, whose = " %" if share else "", f", {of}" if of else ""
    ends = "" if None in band else f" ({band[0]} to {band[1]}{unit})"
    return f"{one}{unit}{ends}{whose}"


def _above_zero(**given: float | None) -> None:
    for name, value in given.items():
        if value is not None and not 0 < value < math.inf:
            raise CaseError(f"{name}: {value:g}, expected a number above 0")


def keep(folder: Path, name: str, found: Mapping[str, Any], handed: Sequence[HandedUp]) -> None:
    """Keep the numbers and the fit in `formation` below the folder, and in its report."""
    out, report = folder / FORMATION, folder / "report.html"
    with locked(folder):
        out.mkdir(exist_ok=True)
        write_text(out / f"{name}.json", plain_json(found)[1] + "\n")
        _draw_fit(handed, out / "handed_up.svg")
        if report.is_file():
            put_section(report, FORMATION, formation_html(out))


def _draw_fit(handed: Sequence[HandedUp], path: Path) -> None:
    """Deposit by depth and k / k0 of the sections, measured and by the model; of each run."""

    def fill(figure: Any) -> None:
        above, below = figure.subplots(2, 1, sharex=True)
        for run in {one.run.path: one.run for one in handed}.values():
            taken = run.profile["porosity_initial"] - run.profile["porosity_damaged"]
            filled = (above, run.profile, taken.where(taken > 0))
            for axes, table, values in (filled, (below, run.sections, kept_by(run))):
                axes.hlines(values, table["x_lo_m"] * MM, table["x_hi_m"] * MM, color=GREY)
        for one in handed:
            for axes, values in ((above, one.fitted), (below, 1 / one.medium.loss(one.fitted))):
                axes.plot(one.x * MM, values, color=BLUE, linewidth=1.0, alpha=0.5)
        above.set(yscale="log", ylabel="deposit (share of volume)", ylim=(1e-4, 1))
        below.set(xlabel=DEPTH_LABEL, ylabel="k / k0", ylim=(0, 1.05))

    draw(path, fill)
