"""What a specimen hands up to the model: filtration, damage, the closing deposit, the cake.

Of fines that enter at constant concentration and come to rest, the deposit obeys

    ds/dx = - rate (1 + growth s) s

whatever the time at which each came (Herzig et al. 1970), so the depths of the fines give rate and
growth. With g = ln(1 + growth s(0)) and w = (1 - exp(-g)) exp(-rate x), the share that gets deeper
than x is ln(1 - w) / -g. The fit is that of the largest likelihood, each fine counting by its
volume, those that passed by the share that gets through the length.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from fdnet.case.case import InvasionCase
from fdnet.errors import CaseError
from fdnet.files import expanded
from fdnet.formation.model import FineClass, Medium
from fdnet.report.figures import BLUE, DEPTH_LABEL, GREY, MM, draw, stairs
from fdnet.run.by_classes import FIRST_DRAWN, Rested, rested_classes
from fdnet.run.finished import FinishedRun, open_run
from fdnet.run.folder import MANIFEST
from fdnet.spheres.snapshot import Array

FEWEST, LEAST_LOSS, MISFIT, DRAWS, PLACES = 30, 0.02, 0.1, 24, 800
"""Fines that a fit needs, least loss that gives a damage, misfit that is said, draws, places."""


class DepthFit(NamedTuple):
    """The filtration that the depths of fines tell."""

    values: Array  # (2,) ln(rate m) and g
    covariance: Array  # (2, 2) of them
    misfit: float  # largest difference of the shares that get deeper


def fit_depths(fines: Rested, length: float) -> DepthFit:
    """The filtration of fines in a specimen of `length` m; constant where they are too few."""
    depth, volume, passed = fines.depth, fines.volume, fines.passed
    whole = float(volume.sum())
    far = max(float(depth @ volume + passed * length) / max(whole, 1e-300), 1e-6 * length)
    if fines.number < FEWEST:
        error = 1 / max(fines.number, 1.0)
        return DepthFit(np.array([-math.log(far), 1e-6]), np.diag([error, 1e-30]), 0.0)
    weight = np.append(volume, passed) * fines.number / whole

    def logs(values: Array) -> Array:
        rate, g = math.exp(values[0]), values[1] if abs(values[1]) > 1e-6 else 1e-6
        w = -math.expm1(-g) * np.exp(-rate * np.append(depth, length))
        inside = values[0] + np.log(w / g) - np.log1p(-w)
        return np.append(inside[:-1], np.log(np.log1p(-w[-1]) / -g) if passed else 0.0)

    first, bounds = [-math.log(far), 0.5], ((0.0, 18.0), (-4.0, 8.0))
    best = minimize(lambda v: -(weight @ logs(v)), first, bounds=bounds, method="Nelder-Mead").x
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
    spread = float(np.sum(apart(best) ** 2)) / max(len(kept) - 1, 1)
    return best, math.sqrt(spread / float(np.sum(slope**2)))


class HandedUp(NamedTuple):
    """What a specimen hands up, and the evidence for it."""

    run: FinishedRun
    medium: Medium  # rock and mud of `fdnet.formation.model.march`
    fitted: Array  # (F,) deposit at `places_of` the run, by the fit
    notes: tuple[str, ...]  # what could not be told, and what was assumed


def places_of(run: FinishedRun) -> Array:
    """(F,) m, even depths of the specimen."""
    return (np.arange(PLACES) + 0.5) * (run.case.size_m[0] / PLACES)


def kept_by(run: FinishedRun) -> Array:
    """(S,) k / k0 of the sections of a run, in place."""
    after, before = (run.sections[f"k_{one}_inplace_m2"] for one in ("damaged", "initial"))
    return (after / before).to_numpy()


def hand_up(source: str | Path | FinishedRun) -> list[HandedUp]:
    """What a run hands up, in SI units; behind it `DRAWS` draws within its errors, or other seeds.

    The fines of LIGGGHTS are one class, and each class of the network is one of its own.

    Args:
        source: a run, its folder, or the folder of an ensemble.

    Raises:
        CaseError: the specimen cannot tell the filtration or the damage; the message says why.

    Examples:
        >>> import fdnet
        >>> fdnet.hand_up("runs/quick")[0].medium.mud[0].rate > 0
        True
    """
    if isinstance(source, FinishedRun):
        return _of_run(source)
    folder = expanded(source)
    folders = [one.parent for one in sorted((folder / "runs").glob(f"*/{MANIFEST}"))]
    runs = [open_run(one) for one in folders or [folder]]
    cases = [{**one.case.data(), "seed": 0} for one in runs]
    if any(case != cases[0] for case in cases):
        raise CaseError(
            f"{folder}: its runs differ by more than the seed; give one of them, or an ensemble"
        )
    return [_of_run(run)[0] for run in runs] if runs[1:] else _of_run(runs[0])


def _rested(run: FinishedRun, case: InvasionCase) -> list[Rested]:
    """The spheres as one kind, then each class of the network."""
    classes = rested_classes(run, case) if case.by_classes or case.with_classes else []
    if case.by_classes:
        return classes
    fines = run.spheres().fines()
    fines = fines.where(fines.id < FIRST_DRAWN)
    inside = (fines.position[:, 0] >= 0) & (fines.position[:, 0] < case.size_m[0])
    volume = 4 / 3 * np.pi * fines.radius**3
    last = run.history if case.with_classes else run.summary
    spheres = Rested(
        name=f"{2e6 * fines.radius.mean():.3g} µm",
        concentration=case.fines.volume_fraction - sum(one.concentration for one in classes),
        depth=fines.position[inside, 0],
        volume=volume[inside],
        passed=float(np.max(last["passed_count"])) * float(volume.mean()),
        number=float(volume[inside].sum() ** 2 / max(np.sum(volume[inside] ** 2), 1e-300)),
    )
    return [spheres, *classes]


def _of_run(run: FinishedRun) -> list[HandedUp]:
    case, summary, start = run.case, run.summary, f"{run.path}: "
    if not isinstance(case, InvasionCase) or not summary["supplied_count"]:
        raise CaseError(f"{start}no fines were supplied, so nothing is filtered")
    length, area = case.size_m[0], math.prod(case.size_m[1:])
    kinds, passed = _rested(run, case), summary["passed_count"]
    shut = summary["stop_reason"] == "plugged"
    found = round(sum(one.number for one in kinds))
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
    mud = [FineClass(one.name, one.concentration, 0.0) for one in kinds]
    medium, notes = _without_filtration(run, case, mud, shut)
    if found < FEWEST:
        notes.append(f"only {found} fines entered before the face closed: all is cake")
        return [HandedUp(run, medium, np.zeros(PLACES), tuple(notes))]
    fits = [fit_depths(one, length) for one in kinds]
    if (worst := max(fit.misfit for fit in fits)) > MISFIT:
        notes.append(f"the fitted depths differ from the measured by {worst:.0%} of the fines")
    if few := [one.name for one in kinds if one.number < FEWEST]:
        notes.append(
            f"too little of the fines of {', '.join(few)} rests inside for more than one number: "
            "their filtration is taken as constant"
        )
    kept, x = kept_by(run), places_of(run)
    paths = (kept > 0) & np.isfinite(kept)
    if not paths.any() or kept[paths].min() > 1 - LEAST_LOSS:
        raise CaseError(
            f"{start}no open section lost {LEAST_LOSS:.0%} of its permeability, so the harm of a "
            "deposit cannot be told; supply more mud"
        )
    low, high = run.sections[paths][["x_lo_m", "x_hi_m"]].to_numpy().T[..., None]
    share = ((x >= low) & (x < high)).astype(float)
    share /= share.sum(axis=1, keepdims=True)
    amounts = np.array([(one.volume.sum() + one.passed) / area for one in kinds])
    spread = np.array([max(one.number, 1.0) for one in kinds]) ** -0.5
    best = np.array([fit.values for fit in fits])
    errors = [np.linalg.cholesky(fit.covariance) for fit in fits]
    random, many = np.random.default_rng(0), list[HandedUp]()
    for number in range(DRAWS + 1):  # the first is the fit itself
        normal = random.standard_normal((len(kinds), 3)) * (number > 0)
        logs, g = (best + [e @ z for e, z in zip(errors, normal[:, :2], strict=True)]).T
        rate, amount = np.exp(logs), amounts * (1 + normal[:, 2] * spread)
        face = float(np.sum(amount * rate * np.expm1(g) / g))
        w = -np.expm1(-g) * np.exp(-np.outer(x, rate))
        fitted = np.sum(amount * rate * w / (1 - w) / g, axis=1)
        harm, error = fit_damage(kept[paths], fitted, share)
        drawn = zip(mud, rate.tolist(), (np.expm1(g) / face).tolist(), strict=True)
        own = replace(
            medium,
            damage=math.exp(harm + error * random.standard_normal() * (number > 0)),
            mud=tuple(one._replace(rate=of_it, growth=growth) for one, of_it, growth in drawn),
            closing=face,
        )
        many.append(HandedUp(run, own, fitted, tuple(notes)))
    return many


def _without_filtration(
    run: FinishedRun, case: InvasionCase, mud: Sequence[FineClass], shut: bool
) -> tuple[Medium, list[str]]:
    """Rock and mud whose face is closed, and notes.

    The cake is that of the packed slices, also where they are thinner than a cake should be. The
    share that back-flow takes is that of the run's clean-up.
    """
    notes, k, cleaned = list[str](), None, run.summary.get("clean_up")
    cake = run.summary.get("cake") or {}
    if not cake.get("packed_thickness_m"):
        notes.append("no packed cake stands before the face: its permeability is not known")
        cake = {"porosity": 0.5}
    elif (k := cake["k_m2"]) is None:
        notes.append(f"{cake['no_cake_yet']}; its permeability is taken as if it were one")
        k = cake["packed_thickness_m"] / cake["resistance_1_m"]
    share = cleaned["came_out"] / max(cleaned["inside_before"], 1) if cleaned else 0.0
    if share:
        notes.append(
            f"back-flow takes {share:.0%} of the deposit, as the clean-up of the run did; that "
            "it falls to 1/e with each pore volume of the specimen is assumed"
        )
    if not shut:
        notes.append(
            f"the run ended by {run.summary['stop_reason']} and not by a closed face: what "
            "follows when the face has this deposit is not known"
        )
    medium = Medium(
        porosity=run.porosity_initial,
        permeability=run.k_initial_m2,
        viscosity=case.fluid.viscosity_Pa_s,
        mud=tuple(mud),
        closing=0.0,
        cake_porosity=cake["porosity"],
        cake_permeability=k if shut else None,
        released=share,
        release_rate=1 / (run.porosity_initial * case.size_m[0]),
    )
    return medium, notes


def draw_fit(handed: Sequence[HandedUp], path: Path) -> Path:
    """Deposit by depth and k / k0 of the sections, measured and by the model; of each run."""
    runs = {one.run.path: one.run for one in handed}

    def fill(figure: Any) -> None:
        above, below = figure.subplots(2, 1, sharex=True)
        for run in runs.values():
            taken = run.profile["porosity_initial"] - run.profile["porosity_damaged"]
            stairs(above, _edges(run.profile), taken.where(taken > 0), color=GREY)
            stairs(below, _edges(run.sections), kept_by(run), color=GREY)
        line: Any = {"color": BLUE, "linewidth": 1.0, "alpha": 0.5}
        for one in handed:
            x = places_of(one.run) * MM
            above.plot(x, one.fitted, **line)
            below.plot(x, 1 / one.medium.loss(one.fitted), **line)
        above.set(yscale="log", ylabel="deposit (share of volume)", ylim=(1e-4, 1))
        below.set(xlabel=DEPTH_LABEL, ylabel="k / k0", ylim=(0, 1.05))

    return draw(path, fill)


def _edges(table: Any) -> Array:
    return np.append(table["x_lo_m"], table["x_hi_m"].iloc[-1])
