"""What must hold of the sizes of grains and fines, and of the solids in the mud."""

import math
from collections.abc import Iterator

from fdnet.case.particles import Fines, Grains
from fdnet.case.rule import Rule
from fdnet.case.spheres import Spheres
from fdnet.case.values import MAX_CONCENTRATION

WIDEST_THROAT = math.sqrt(2) - 1
"""Radius of the widest throat between touching grains over their radius: four in a square."""


def size_text(name: str, spheres: Spheres) -> str:
    """The sizes of grains or fines as the case gives them, for a message."""
    if not spheres.measured:
        radius = spheres.radius_mm
        shown = list(radius) if isinstance(radius, tuple) else radius
        return f"{name}.radius_mm: {shown}" if name == "fines" else f"{name}.radius_mm {shown}"
    low, high = (2e3 * radius for radius in spheres.radius_range_m)
    return f"{name}.sizes: diameters of {low:.3g} to {high:.3g} mm"


def concentration_text(fines: Fines) -> str:
    """The solids of the mud as the case gives them, for a message."""
    if fines.solids_kg_m3 is not None:
        return f"fines.solids_kg_m3: {fines.solids_kg_m3:g}"
    return f"fines.concentration: {fines.concentration:g}"


def _one_curve(name: str) -> Rule:
    keys = ("radius_mm", "sizes", "materials") if name == "fines" else ("radius_mm", "sizes")

    def check(spheres: Spheres) -> Iterator[str]:
        given = [key for key in keys if getattr(spheres, key) is not None]
        *others, last = keys
        choice = f"give exactly one of {', '.join(others)} and {last}"
        if not given:
            yield f"{name}.radius_mm: missing, {choice}"
        elif len(given) > 1:
            yield f"{name}.{given[1]}: given beside {name}.{given[0]}, {choice}"

    return Rule(tuple(f"{name}.{key}" for key in keys), check)


def _cut(fines: Fines) -> Iterator[str]:
    if fines.cut_um is not None and not fines.measured and fines.has_one_curve:
        yield (
            f"fines.cut_um: {fines.cut_um:g} cuts measured sizes, but the case gives "
            "fines.radius_mm; leave it out or give fines.sizes"
        )


def _solids(fines: Fines) -> Iterator[str]:
    """The solids are given once, and are no more than fit."""
    if not fines.has_one_concentration:
        yield (
            f"fines.solids_kg_m3: {fines.solids_kg_m3} with fines.concentration: "
            f"{fines.concentration}, give exactly one of the two"
        )
    elif fines.solids_kg_m3 is not None and fines.volume_fraction > MAX_CONCENTRATION:
        most = MAX_CONCENTRATION * fines.solids_density_kg_m3
        yield (
            f"fines.solids_kg_m3: {fines.solids_kg_m3:g} of solids of "
            f"{fines.solids_density_kg_m3:.4g} kg/m3 is {100 * fines.volume_fraction:.3g} % by "
            f"volume; expected at most {most:.3g} ({100 * MAX_CONCENTRATION:.0f} %: more do not "
            "fit at random places)"
        )


def _friction(fines: Fines) -> Iterator[str]:
    for number, one in enumerate(fines.materials or ()):
        if one.friction is not None and one.friction != fines.friction:
            yield (
                f"fines.materials.{number}.friction: {one.friction:g} of {one.name!r}, but all "
                f"fines are of one contact material with fines.friction {fines.friction:g}; set "
                "fines.friction for all"
            )


def _names(fines: Fines) -> Iterator[str]:
    names = [one.name for one in fines.materials or ()]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        yield f"fines.materials: {twice[0]!r} is listed twice, give each material once"


def _some_throat(grains: Grains, fines: Fines) -> Iterator[str]:
    """Measured fines of which none fits through any throat between touching grains."""
    if not fines.measured:
        return
    widest = 2 * WIDEST_THROAT * grains.radius_range_m[1]
    smallest = 2 * fines.radius_range_m[0]
    if smallest > widest:
        yield (
            f"fines.sizes: the smallest fine has {1e3 * smallest:.3g} mm, above every throat "
            f"between touching grains of up to {2e3 * grains.radius_range_m[1]:.3g} mm (at most "
            f"{1e3 * widest:.3g} mm): nothing could invade; check the units of both curves"
        )


SIZE_RULES = (
    _one_curve("grains"),
    _one_curve("fines"),
    Rule(("fines.radius_mm", "fines.cut_um"), _cut),
    Rule(
        (
            "fines.concentration",
            "fines.solids_kg_m3",
            "fines.materials",
            "fines.density_kg_m3",
        ),
        _solids,
    ),
    Rule(("fines.materials", "fines.friction"), _friction),
    Rule(("fines.materials",), _names),
)
"""Rules of sizes, in the order in which their problems are reported."""
SOME_THROAT = Rule(("grains.radius_mm", "fines.radius_mm"), _some_throat)
"""Some fine fits through some throat."""
