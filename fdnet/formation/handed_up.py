"""What a specimen hands up to the model: filtration, damage, the closing deposit, the cake.

Of fines that enter at constant concentration and come to rest, the deposit obeys

    ds/dx = - rate (1 + growth s) s

whatever the time at which each came (Herzig et al. 1970), so the depths of the fines give rate and
growth. With g = ln(1 + growth s(0)) and w = (1 - exp(-g)) exp(-rate x), the share that gets deeper
than x is ln(1 - w) / -g. The fit is that of the largest likelihood, each fine counting by its
volume, those that passed by the share that gets through the length.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from fdnet.case.case import InvasionCase
from fdnet.errors import CaseError
from fdnet.files import expanded
from fdnet.formation.model import CakeOf, FineClass, Release, Rock
from fdnet.report.figures import BLUE, DEPTH_LABEL, GREY, MM, draw, stairs
from fdnet.run.finished import FinishedRun, open_run
from fdnet.run.folder import MANIFEST, is_run_folder
from fdnet.spheres.snapshot import Array

FEWEST, LEAST_LOSS, MISFIT, DRAWS, PLACES = 30, 0.02, 0.1, 24, 800
"""Fines that a fit needs, loss of a section that gives a damage, distance of two distributions
that is said, draws from a fit's errors where there are no seeds, and places of a fit."""
_BOUNDS = ((0.0, 18.0), (-4.0, 8.0))


class DepthFit(NamedTuple):
    """ln(rate m) and g of a deposit, their covariance (2, 2), largest difference of the shares."""

    values: Array
    covariance: Array
    misfit: float


def fit_depths(depth: Array, volume: Array, passed: float, length: float) -> DepthFit:
    """The filtration of fines at depths (N,) m with volumes (N,) m3; `passed` m3 got through."""
    whole = float(volume.sum())
    weight = np.append(volume, passed) * whole / np.sum(volume**2)

    def logs(values: Array) -> Array:
        rate, g = math.exp(values[0]), values[1] if abs(values[1]) > 1e-6 else 1e-6
        w = -math.expm1(-g) * np.exp(-rate * np.append(depth, length))
        inside = values[0] + np.log(w / g) - np.log1p(-w)
        return np.append(inside[:-1], np.log(np.log1p(-w[-1]) / -g) if passed else 0.0)

    best = minimize(
        lambda values: -float(weight @ logs(values)),
        [-math.log(float(depth @ volume + passed * length) / whole), 0.5],
        bounds=_BOUNDS,
        method="Nelder-Mead",
    ).x
    scores = np.stack([(logs(best + e) - logs(best - e)) / 2e-4 for e in 1e-4 * np.eye(2)])
    order = np.argsort(depth)
    reached = np.cumsum(volume[order]) / (whole + passed)
    gone = 1 + np.log1p(math.expm1(-best[1]) * np.exp(-math.exp(best[0]) * depth[order])) / best[1]
    misfit = float(np.abs(gone - reached).max())
    return DepthFit(best, np.linalg.inv((scores * weight) @ scores.T), misfit)


def fit_damage(kept: Array, deposit: Array, share: Array) -> tuple[float, float]:
    """ln(damage) of k = k0 / (1 + damage s)^2 and its standard error.

    From k / k0 of sections (S,) and the deposit at places (F,), `share` (S, F) being the part of
    a section that each stands for; they resist one after the other.
    """

    def apart(value: float) -> Array:
        return np.log(share @ (1 + math.exp(value) * deposit) ** 2) + np.log(kept)

    best = float(minimize_scalar(lambda v: np.sum(apart(v) ** 2), bounds=(-4, 12)).x)
    slope = (apart(best + 1e-4) - apart(best - 1e-4)) / 2e-4
    free = max(len(kept) - 1, 1)
    spread = float(np.sum(apart(best) ** 2)) / free
    return best, math.sqrt(spread / float(np.sum(slope**2)))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HandedUp:
    """What a specimen hands up, in the parts of `fdnet.formation.model.march`, and its evidence.

    Attributes:
        run: that it comes from.
        rock, mud, cake, release: the model's; None where the specimen cannot tell.
        closing: deposit at which the face closes, or that it had when the run ended.
        bins, deposit: (B+1,) m and (B,), the measured profile.
        fitted: (F,) deposit at F even depths of the specimen, by the fit.
        sections, kept: (S, 2) m and (S,), k / k0 of the sections in place.
        notes: what could not be told, and what was assumed.
    """

    run: FinishedRun
    rock: Rock
    mud: tuple[FineClass, ...]
    cake: CakeOf | None
    release: Release | None
    closing: float
    bins: Array
    deposit: Array
    fitted: Array
    sections: Array
    kept: Array
    notes: tuple[str, ...]

    @property
    def places(self) -> Array:
        """(F,) m, depths of `fitted`."""
        return (np.arange(len(self.fitted)) + 0.5) * (self.bins[-1] / len(self.fitted))

    def values(self) -> dict[str, float]:
        """The fitted numbers by name, SI; of several classes each with the name of its class."""
        found: dict[str, float] = {}
        for one in self.mud:
            end = f"_{one.name}" if len(self.mud) > 1 else ""
            found |= {f"rate_1_m{end}": one.rate, f"growth{end}": one.growth}
        found |= {"closing_deposit": self.closing, "damage": self.rock.damage}
        cake = self.cake
        return found | ({"cake_permeability_m2": cake.permeability} if cake else {})


def hand_up(source: str | Path | FinishedRun, *, classes: int = 1) -> list[HandedUp]:
    """What a run hands up, in SI units; behind it `DRAWS` draws within its errors, or other seeds.

    Args:
        source: a run, its folder, or the folder of an ensemble.
        classes: classes of size, of equal volume, that the fines are taken in.

    Raises:
        CaseError: the specimen cannot tell the filtration or the damage; the message says why.

    Examples:
        >>> import fdnet
        >>> fdnet.hand_up("runs/quick")[0].mud[0].rate > 0
        True
    """
    if isinstance(source, FinishedRun):
        return _of_run(source, classes)
    folder = expanded(source)
    if is_run_folder(folder) or not folder.is_dir():
        return _of_run(open_run(folder), classes)
    done = [one.parent for one in sorted((folder / "runs").glob(f"*/{MANIFEST}"))]
    if not done:
        raise CaseError(f"{folder}: holds no finished run; give a run folder or an ensemble")
    runs = [open_run(one) for one in done]
    cases = [{**one.case.data(), "seed": 0} for one in runs]
    if any(case != cases[0] for case in cases):
        raise CaseError(
            f"{folder}: its runs differ by more than the seed; give one of them, or an ensemble"
        )
    return [_of_run(run, classes)[0] for run in runs]


def _of_run(run: FinishedRun, classes: int) -> list[HandedUp]:
    case, summary, start = run.case, run.summary, f"{run.path}: "
    if not isinstance(case, InvasionCase) or not summary["supplied_count"]:
        raise CaseError(f"{start}no fines were supplied, so nothing is filtered")
    fines, length, area = run.spheres().fines(), case.size_m[0], math.prod(case.size_m[1:])
    depth, volume = fines.position[:, 0], 4 / 3 * np.pi * fines.radius**3
    inside, passed = (depth >= 0) & (depth < length), summary["passed_count"]
    found, shut, notes = int(inside.sum()), summary["stop_reason"] == "plugged", list[str]()
    _refuse(start, found, passed, length, shut, classes)
    size = np.cumsum(np.sort(volume))[np.argsort(np.argsort(fines.radius, kind="stable"))]
    own = np.ceil(size / volume.sum() * classes * (1 - 1e-12)).astype(int)
    here = [inside & (own == one + 1) for one in range(classes)]
    if min(which.sum() for which in here) < FEWEST <= found:
        raise CaseError(f"{start}a class has fewer than {FEWEST} fines inside; take fewer classes")
    through, solids = passed * float(volume.mean()), case.fines.volume_fraction
    names = [f"{2e6 * fines.radius[own == one + 1].mean():.3g} µm" for one in range(classes)]
    parts = [float(volume[own == one + 1].sum() / volume.sum()) * solids for one in range(classes)]

    bins = np.append(run.profile["x_lo_m"], run.profile["x_hi_m"].iloc[-1])
    slabs = run.sections[["x_lo_m", "x_hi_m"]].to_numpy()
    before, after = (run.sections[f"k_{s}_inplace_m2"] for s in ("initial", "damaged"))
    kept = (after / before).to_numpy()
    cake, release = _cake(summary, notes), _release(run, length, notes)
    rock = Rock(porosity=run.porosity_initial, permeability=run.k_initial_m2, damage=0.0)
    made = HandedUp(
        run=run,
        rock=rock,
        mud=tuple(FineClass(*one, 0.0) for one in zip(names, parts, strict=True)),
        cake=cake,
        release=release,
        closing=0.0,
        bins=bins,
        deposit=np.histogram(depth, bins, weights=volume)[0] / np.diff(bins) / area,
        fitted=np.zeros(PLACES),
        sections=slabs,
        kept=kept,
        notes=(),
    )
    if found < FEWEST:
        notes.append(f"only {found} fines entered before the face closed: all is cake")
        return [replace(made, notes=tuple(notes))]
    if not shut:
        made = replace(made, cake=None)
        notes.append(
            f"the run ended by {summary['stop_reason']} and not by a closed face: what follows "
            "when the face has this deposit is not known"
        )
    fits = [fit_depths(depth[one], volume[one], through, length) for one in here]
    if (worst := max(fit.misfit for fit in fits)) > MISFIT:
        notes.append(f"the fitted depths differ from the measured by {worst:.0%} of the fines")
    amounts = np.array([(volume[one].sum() + through) / area for one in here])
    random, many = np.random.default_rng(0), list[HandedUp]()
    for number in range(DRAWS + 1):
        normal = random.standard_normal((classes, 3)) * (number > 0)
        drawn = [
            fit.values + np.linalg.cholesky(fit.covariance) @ z[:2]
            for fit, z in zip(fits, normal, strict=True)
        ]
        rate, g = np.array([[math.exp(one[0]), one[1]] for one in drawn]).T
        amount = amounts * (1 + normal[:, 2] / math.sqrt(found / classes))
        face = float(np.sum(amount * rate * np.expm1(g) / g))
        w = -np.expm1(-g) * np.exp(-np.outer(made.places, rate))
        fitted = np.sum(amount * rate * w / (1 - w) / g, axis=1)
        damage, error = _damage(start, replace(made, fitted=fitted))
        harm = math.exp(damage + error * random.standard_normal() * (number > 0))
        mud = zip(names, parts, rate.tolist(), (np.expm1(g) / face).tolist(), strict=True)
        many.append(
            replace(
                made,
                rock=replace(rock, damage=harm),
                mud=tuple(FineClass(*one) for one in mud),
                closing=face,
                fitted=fitted,
                notes=tuple(notes),
            )
        )
    return many


def _refuse(start: str, found: int, passed: int, length: float, shut: bool, classes: int) -> None:
    """Raises CaseError where the depths of the fines cannot tell the filtration."""
    if found == 0 and passed:
        raise CaseError(
            f"{start}all {passed} fines passed {1e3 * length:g} mm, none was filtered: the rate "
            f"of filtration is below {3 / passed / length:.2g} 1/m (95 %); take a longer specimen"
        )
    if found < FEWEST and not shut:
        raise CaseError(
            f"{start}{found} fines inside, {FEWEST} are needed to fit a rate of filtration, or a "
            "face that closes; supply more mud"
        )
    if classes < 1 or (classes > 1 and passed):
        raise CaseError(
            f"classes: {classes}, expected 1 or more, and 1 where fines passed: their sizes "
            f"({passed} fines) are in no table"
        )


def _damage(start: str, made: HandedUp) -> tuple[float, float]:
    """`fit_damage` of the fitted deposit over the sections that have an open path."""
    kept, x = made.kept, made.places
    open_ = (kept > 0) & np.isfinite(kept)
    if not open_.any() or kept[open_].min() > 1 - LEAST_LOSS:
        raise CaseError(
            f"{start}no open section lost {LEAST_LOSS:.0%} of its permeability, so the harm of a "
            "deposit cannot be told; supply more mud"
        )
    share = (x >= made.sections[open_, :1]) & (x < made.sections[open_, 1:])
    return fit_damage(kept[open_], made.fitted, share / share.sum(axis=1, keepdims=True))


def _cake(summary: Mapping[str, Any], notes: list[str]) -> CakeOf | None:
    """The cake of the packed slices, also where they are thinner than a cake should be."""
    cake = summary.get("cake") or {}
    if not cake.get("packed_thickness_m"):
        notes.append("no packed cake stands before the face: its permeability is not known")
        return None
    k = cake["k_m2"]
    if k is None:
        notes.append(f"{cake['no_cake_yet']}; its permeability is taken as if it were one")
        k = cake["packed_thickness_m"] / cake["resistance_1_m"]
    return CakeOf(porosity=cake["porosity"], permeability=k)


def _release(run: FinishedRun, length: float, notes: list[str]) -> Release | None:
    """The share that the clean-up of the run took away; its pace is assumed."""
    cleaned = run.summary.get("clean_up")
    if not cleaned or not cleaned["inside_before"]:
        return None
    share = cleaned["came_out"] / cleaned["inside_before"]
    notes.append(
        f"back-flow takes {share:.0%} of the deposit, as the clean-up of the run did; that it "
        "falls to 1/e with each pore volume of the specimen is assumed"
    )
    return Release(share=share, rate=1 / (run.porosity_initial * length))


# ------------------------------------------------------------------------------------------------
# The fit over what it comes from.


def draw_fit(handed: Sequence[HandedUp], path: Path) -> Path:
    """Deposit by depth and k / k0 of the sections, measured and by the model; of each run."""
    return draw(path, partial(_fill, handed=handed))


def _fill(figure: Any, *, handed: Sequence[HandedUp]) -> None:
    above, below = figure.subplots(2, 1, sharex=True)
    for number, one in enumerate(handed):
        depth, deposit = one.places, one.fitted
        if number == 0 or one.run is not handed[0].run:
            stairs(above, one.bins, np.where(one.deposit > 0, one.deposit, np.nan), color=GREY)
            stairs(below, np.append(one.sections[:, 0], one.sections[-1, 1]), one.kept, color=GREY)
        above.plot(depth * MM, deposit, color=BLUE, linewidth=1.0, alpha=0.5)
        below.plot(
            depth * MM, 1 / one.rock.loss(deposit[None]), color=BLUE, linewidth=1, alpha=0.5
        )
    above.set(yscale="log", ylabel="deposit (share of volume)", ylim=(1e-4, 1))
    below.set(xlabel=DEPTH_LABEL, ylabel="k / k0", ylim=(0, 1.05))
