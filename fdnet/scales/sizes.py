"""The sizes of a case in closed form: diameters of its curves, and what they leave out."""

from collections.abc import Iterator

from fdnet.case.case import Case, InvasionCase
from fdnet.case.sizes import Sizes
from fdnet.case.spheres import Spheres
from fdnet.scales.densest import densest_porosity, reach_text
from fdnet.sizes.curve import SizeCurve

SHARES = (0.1, 0.5, 0.9)
"""Shares by volume whose diameters are shown: D10, D50 and D90."""
MOST_MISFIT = 0.05
"""Difference of a law to a given diameter, over it, above which a warning names it: a quarter of
the step between two sieves of the series R 40/3 (ISO 565), 19 %."""
_SOURCES = {
    "log-normal": "Hatch & Choate 1929",
    "rosin-rammler": "Rosin & Rammler 1933",
    "measured": "as measured, straight over ln d",
}


def sized(case: Case) -> dict[str, Spheres]:
    """Grains and fines by the names of their tables."""
    fines = {"fines": case.fines} if isinstance(case, InvasionCase) else {}
    return {"grains": case.grains, **fines}


def diameter_at(curve: SizeCurve, share: float) -> float | None:
    """Diameter, m, that `share` of all solids is finer than; None where that size is left out."""
    inside = (share - curve.below) / curve.kept
    return curve.size_at(inside) if 0 <= inside <= 1 else None


def size_rows(case: Case) -> list[tuple[str, str, float, str, str, str]]:
    """Rows of the table of scales: name, symbol, value, unit, formula, source.

    They are the diameters of every measured curve next to those given, and its ends.
    """
    rows = []
    for name, spheres in sized(case).items():
        if spheres.measured:
            rows += [*_curve_rows(name, spheres), *_end_rows(name, spheres.curve)]
    return rows


def _curve_rows(name: str, spheres: Spheres) -> Iterator[tuple[str, str, float, str, str, str]]:
    law, asked = "measured", dict[float, float]()
    if spheres.sizes is not None and spheres.sizes.fit is not None:
        law, asked = spheres.sizes.fit.name, spheres.sizes.asked
    for share in SHARES:
        value = diameter_at(spheres.curve, share)
        if value is None:
            continue
        given = asked.get(share)
        compared = (
            "" if given is None else f", given {given:.4g} m ({100 * (value / given - 1):+z.1f} %)"
        )
        yield (
            f"{name}: {100 * share:.0f} % by volume finer than",
            f"D{100 * share:.0f}",
            value,
            "m",
            f"{law} curve{compared}",
            _SOURCES[law],
        )


def _end_rows(name: str, curve: SizeCurve) -> list[tuple[str, str, float, str, str, str]]:
    return [
        (
            f"{name}: smallest diameter placed",
            "d_min",
            curve.low,
            "m",
            _cut_text(curve.below, "finer"),
            "cut",
        ),
        (
            f"{name}: largest diameter placed",
            "d_max",
            curve.high,
            "m",
            _cut_text(curve.above, "coarser"),
            "cut",
        ),
        (
            f"{name}: number mean diameter",
            "<d>",
            curve.mean(1),
            "m",
            "moment of the curve",
            "exact",
        ),
    ]


def _cut_text(share: float, side: str) -> str:
    return f"{100 * share:.3g} % of the solids are {side} and left out"


def size_warnings(case: Case) -> list[str]:
    """What curves miss and what they leave out, one sentence each."""
    warnings = []
    for name, spheres in sized(case).items():
        if spheres.measured:
            warnings += [*_misfit_warnings(name, spheres), *_cut_warnings(name, spheres.curve)]
    if isinstance(case, InvasionCase) and case.fines.measured:
        given, placed = case.fines.volume_fraction, case.fines.placed_fraction
        if placed < given:
            warnings.append(
                f"fines: the suspension carries {100 * placed:.3g} % of fines by volume instead "
                f"of {100 * given:.3g} %, because the sizes left out are not in it"
            )
    return warnings + _dense_warnings(case)


def _dense_warnings(case: Case) -> list[str]:
    """The sand is denser than rigid spheres of its sizes get."""
    porosity = case.grains.porosity
    if not case.grains.measured or case.grains.count is not None or porosity is None:
        return []
    rigid = densest_porosity(case.grains)
    if porosity >= rigid:
        return []
    return [f"grains.porosity: {reach_text(rigid)}; at {porosity:g} grains overlap"]


def _curves(name: str, spheres: Spheres) -> Iterator[tuple[str, Sizes]]:
    """The given curves by the key that gives them."""
    if spheres.sizes is not None:
        yield f"{name}.sizes", spheres.sizes
    for number, one in enumerate(getattr(spheres, "materials", None) or ()):
        yield f"{name}.materials.{number}.sizes", one.sizes


def _misfit_warnings(name: str, spheres: Spheres) -> Iterator[str]:
    for key, sizes in _curves(name, spheres):
        fit = sizes.fit
        if fit is not None and fit.worst > MOST_MISFIT:
            missed = ", ".join(
                f"D{100 * share:.0f} by {100 * off:+z.0f} %" for share, off in fit.misfit.items()
            )
            yield (
                f"{key}: the {fit.name} curve misses {missed}; give the measured curve (size and "
                "passing, or a file) if it matters"
            )


def _cut_warnings(name: str, curve: SizeCurve) -> Iterator[str]:
    parts = [
        f"{100 * share:.3g} % of the solids ({side} than {1e6 * size:.3g} um)"
        for share, side, size in (
            (curve.below, "finer", curve.low),
            (curve.above, "coarser", curve.high),
        )
        if share > 1e-9
    ]
    if parts:
        yield f"{name}: {' and '.join(parts)} are left out; see sizes.cut_percent" + (
            " and fines.cut_um" if name == "fines" else ""
        )
