"""The tables [grains] and [fines] of a case, and their curves of sizes.

All sizes of a curve are diameters, as sieves and laser instruments give them.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from fdnet.case.tables import Fraction, InSI, NonNegative, Part, Positive, Radius, as_tuple
from fdnet.sizes import (
    NUMBER,
    SURFACE,
    VOLUME,
    Fit,
    Law,
    Points,
    SizeCurve,
    Uniform,
    best_fit,
    blended,
    cut_curve,
)

MOST_POINTS = 1000  # Most rows of a measured curve
_POWERS = {"volume": VOLUME, "mass": VOLUME, "surface": SURFACE, "number": NUMBER}
_ROUNDING = 1e-6
LEAST_RATIO, MOST_RATIO = 1.001, 1000.0
"""Smallest and largest ratio of two neighbours of D10, D50 and D90; spheres of nearly one size are
given by `radius_mm`."""

Lengths = Annotated[
    tuple[Positive, ...], BeforeValidator(as_tuple), Field(min_length=2, max_length=MOST_POINTS)
]
Percent = Annotated[float, Field(ge=0, le=100)]
Percents = Annotated[
    tuple[Percent, ...], BeforeValidator(as_tuple), Field(min_length=2, max_length=MOST_POINTS)
]
Cut = Annotated[tuple[Percent, Percent], BeforeValidator(as_tuple)]


class Sizes(Part):
    """A curve of sizes: D10, D50 and D90, or the points of a sieve or laser measurement."""

    D10_mm: Positive | None = None
    """Diameter that 10 % are finer than."""
    D50_mm: Positive | None = None
    """Median diameter."""
    D90_mm: Positive | None = None
    """Diameter that 90 % are finer than."""
    shape: Literal["log-normal", "rosin-rammler"] | None = None
    """Law through the diameters. When absent: that which fits best, "log-normal" for two."""
    size_mm: Lengths | None = None
    """Diameters of a measured curve, rising."""
    passing_percent: Percents | None = None
    """What is finer than each of `size_mm`, rising to 100."""
    by: Literal["mass", "volume", "surface", "number"] = "mass"
    """What the percentages count."""
    cut_percent: Cut = (1.0, 99.0)
    """Ends of the curve by volume; what is finer and coarser is left out."""

    @model_validator(mode="after")
    def _is_a_curve(self) -> Self:
        if problem := _problem(self):
            raise PydanticCustomError("size_curve", "{problem}", {"problem": problem})
        return self

    @property
    def asked(self) -> dict[float, float]:
        """Diameters, m, by the share that is finer, of those among D10, D50 and D90 given."""
        given = {0.1: self.D10_mm, 0.5: self.D50_mm, 0.9: self.D90_mm}
        return {share: size * 1e-3 for share, size in given.items() if size is not None}

    @property
    def points(self) -> Iterator[tuple[float, float]]:
        """Share finer and diameter, m, of each point of a measured curve."""
        for size, finer in zip(self.size_mm or (), self.passing_percent or (), strict=False):
            yield finer / 100, size * 1e-3

    @cached_property
    def fit(self) -> Fit | None:
        """The law through D10, D50 and D90; None for a measured curve."""
        return best_fit(self.asked, self.shape) if self.size_mm is None else None

    @cached_property
    def law(self) -> Law:
        """The law of the whole, by `by`."""
        if self.fit is not None:
            return self.fit.law
        finer, size = zip(*self.points, strict=True)
        return Points(size, (*finer[:-1], 1.0))

    def curve(self, finest: float = 0.0) -> SizeCurve:
        """The curve between its cuts, m; nothing finer than `finest` m."""
        low, high = self.cut_percent
        cut = (low / 100, high / 100)
        return cut_curve(self.law, by=_POWERS[self.by], cut=cut, finest=finest)


def _problem(sizes: Sizes) -> str:
    """The first problem of a curve, or ""."""
    given, (low, high) = sizes.asked, sizes.cut_percent
    measured = sizes.size_mm is not None or sizes.passing_percent is not None
    if low >= high:
        return f"cut_percent [{low}, {high}] must rise, [finest, coarsest]"
    if measured:
        beside = "gives D10, D50 or D90 beside a measured curve; give one of the two"
        return beside if given else _measured_problem(sizes)
    if len(given) < 2:
        return (
            f"gives {len(given)} of D10, D50 and D90, expected two or three of them (one diameter "
            "has no spread), or size and passing of a measured curve, or a file"
        )
    if not all(LEAST_RATIO <= b / a <= MOST_RATIO for a, b in pairwise(given.values())):
        texts = ", ".join(f"D{100 * share:.0f} {1e3 * size:g} mm" for share, size in given.items())
        return (
            f"{texts}: must rise from D10 to D90, each {LEAST_RATIO} to {MOST_RATIO:g} times the "
            "one before"
        )
    if not 0 < low < high < 100:
        return (
            f"cut_percent [{low}, {high}]: the law of D10, D50 and D90 has no ends, "
            "expected cuts above 0 and below 100"
        )
    return ""


def _measured_problem(sizes: Sizes) -> str:
    """The first problem of a measured curve, or ""."""
    size, finer = sizes.size_mm, sizes.passing_percent
    if size is None or finer is None:
        return "a measured curve needs both size_mm and passing_percent"
    if len(size) != len(finer):
        return f"{len(size)} sizes with {len(finer)} percentages, expected as many of both"
    if sizes.shape is not None:
        return f"shape {sizes.shape!r} belongs to D10, D50 and D90, not to a measured curve"
    if finer[0] > 0 and sizes.by in ("number", "surface"):
        return (
            f"the curve by {sizes.by} begins at {finer[0]:g} %, expected 0 %: spheres of unknown "
            "size have no volume"
        )
    for (a, b), (p, q) in zip(pairwise(size), pairwise(finer), strict=True):
        if b < (1 + _ROUNDING) * a:
            return f"size_mm must rise, but {b:g} mm follows {a:g} mm"
        if p > q:
            return (
                f"the curve must not fall: {p:g} % pass {a:g} mm, but {q:g} % pass {b:g} mm; "
                "are these percentages of each fraction, or retained?"
            )
    ends = abs(finer[-1] - 100) <= 100 * _ROUNDING
    return "" if ends else f"the curve ends at {finer[-1]:g} % at {size[-1]:g} mm, expected 100 %"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solid:
    """One material of some spheres."""

    name: str  # as the case gives it; empty where there is one material
    share: float  # of the volume of all solids of the case
    curve: SizeCurve  # diameters, m
    density: float  # kg/m3


class Material(Part):
    """One kind of solids in the mud."""

    name: str = Field(min_length=1, max_length=60)
    """Name of the material."""
    share: Positive
    """Its share of the solids by mass, over the sum of shares."""
    sizes: Sizes
    """As `fines.sizes`."""
    density_kg_m3: Positive | None = None
    """Its density. When absent: `fines.density_kg_m3`."""


SHEAR_RATIO = 0.04
"""Tangential over normal stiffness of a material that gives none: small enough that no fine larger
than 1/378 of a grain at friction 0.55 locks between two grains (`fdnet.scales.contacts`)."""


class Spheres(Part):
    """What grains and fines share: sizes, density and the parameters of their contacts."""

    radius_mm: Radius | None = None
    """Radius, or [smallest, largest] of radii uniform by number."""
    sizes: Sizes | None = None
    """A curve of diameters instead."""
    density_kg_m3: Positive
    """Density of the solid."""
    normal_stiffness_N_m: Positive
    """Normal contact stiffness of the material; two in contact are springs in series."""
    shear_stiffness_N_m: Positive | None = None
    """Tangential contact stiffness of the material; see `SHEAR_RATIO`."""
    youngs_modulus_GPa: Positive
    """Young's modulus, for "hertz"."""
    poissons_ratio: Annotated[float, Field(ge=0, le=0.5)]
    """Poisson's ratio, for "hertz"."""
    friction: NonNegative = 0.55
    """Sliding friction; a contact takes the smaller of two."""
    damping_ratio: Annotated[float, Field(ge=0, lt=1)] = 0.2
    """Damping over critical damping; a contact takes the mean of two."""

    @property
    def tangential_stiffness(self) -> float:
        """Tangential contact stiffness, N/m: the one given, or `SHEAR_RATIO` of the normal one."""
        given = self.shear_stiffness_N_m
        return SHEAR_RATIO * self.normal_stiffness_N_m if given is None else given

    youngs_modulus_Pa: ClassVar = InSI[float]("youngs_modulus_GPa", 1e9)

    @cached_property
    def components(self) -> tuple[Solid, ...]:
        """The materials that the spheres are of: one."""
        return (Solid(name="", share=1.0, curve=self._own_curve(), density=self.density_kg_m3),)

    @cached_property
    def curve(self) -> SizeCurve:
        """The curve of the diameters, m, of all spheres."""
        return blended(
            [one.share for one in self.components], [one.curve for one in self.components]
        )

    @property
    def mean_density_kg_m3(self) -> float:
        """Mass over volume of the spheres that are placed."""
        if len(self.components) == 1:
            return self.components[0].density
        volumes = [one.share * one.curve.kept for one in self.components]
        masses = [one.density * v for one, v in zip(self.components, volumes, strict=True)]
        return sum(masses) / sum(volumes)

    @property
    def finest_m(self) -> float:
        """Diameter, m, below which sizes are left out."""
        return 0.0

    def _own_curve(self) -> SizeCurve:
        if self.sizes is not None:
            return self.sizes.curve(self.finest_m)
        pair = self.radius_mm if isinstance(self.radius_mm, tuple) else (self.radius_mm,) * 2
        low, high = (2 * ((radius or 0.0) * 1e-3) for radius in pair)
        return SizeCurve(law=Uniform(low, high), by=NUMBER, low=low, high=high)

    @property
    def has_one_curve(self) -> bool:
        """Whether the sizes are given, and once only."""
        return sum(key is not None for key in self._size_keys) == 1

    @property
    def _size_keys(self) -> tuple[Any, ...]:
        return self.radius_mm, self.sizes

    @property
    def measured(self) -> bool:
        """Whether the sizes are given by curves, and not by `radius_mm`."""
        return self.radius_mm is None

    @property
    def radius_range_m(self) -> tuple[float, float]:
        """Smallest and largest radius, m."""
        return 0.5 * self.curve.low, 0.5 * self.curve.high

    @property
    def ends(self) -> list[tuple[float, float]]:
        """Radius, m, and density of the smallest and the largest sphere of each material."""
        return [
            (0.5 * diameter, one.density)
            for one in self.components
            for diameter in (one.curve.low, one.curve.high)
        ]

    @property
    def one_size(self) -> bool:
        """Whether all radii are equal."""
        return isinstance(self.radius_mm, float | int)

    @property
    def mean_radius_m(self) -> float:
        """Number mean of the radius, m."""
        if self.measured:
            return 0.5 * self.curve.mean(1)
        low, high = self.radius_range_m
        return 0.5 * (low + high)

    @property
    def mean_volume_m3(self) -> float:
        """Mean sphere volume; of a radius uniform in [a, b] it is pi/3 (a + b)(a^2 + b^2)."""
        if self.measured:
            return math.pi / 6 * self.curve.mean(3)
        low, high = self.radius_range_m
        return math.pi / 3 * (low + high) * (low**2 + high**2)

    @property
    def sauter_diameter_m(self) -> float:
        """Diameter of equal volume to surface ratio, <d^3>/<d^2>."""
        if self.measured:
            return self.curve.mean(3) / self.curve.mean(2)
        low, high = self.radius_range_m
        cubes, squares = 0.25 * (low + high) * (low**2 + high**2), low**2 + low * high + high**2
        return 2 * cubes / (squares / 3)


Materials = Annotated[
    tuple[Material, ...], BeforeValidator(as_tuple), Field(min_length=1, max_length=20)
]


class Grains(Spheres):
    """[grains], the sand grains of the formation; either `porosity` or `count` is given."""

    porosity: Fraction | None = None
    """Porosity of the pack within 0.003, overlaps counted once."""
    count: Annotated[int, Field(ge=1)] | None = None
    """Number of grains, instead of `porosity`."""
    density_kg_m3: Positive = 2650.0
    """Density of the grains."""
    normal_stiffness_N_m: Positive = 94.3e9
    """Normal contact stiffness of grains and walls; `run.stiffness_N_m` scales all alike."""
    shear_stiffness_N_m: Positive | None = None
    """Tangential one. When absent: 0.04 of the normal one, so that no fine locks in."""
    youngs_modulus_GPa: Positive = 94.3
    """Young's modulus of grains and walls, for "hertz" (quartz)."""
    poissons_ratio: Annotated[float, Field(ge=0, le=0.5)] = 0.387
    """Poisson's ratio of grains and walls, for "hertz"."""
    motion: Literal["fixed", "mobile"] = "fixed"
    """"fixed" grains stay during the invasion, "mobile" ones are pushed by fines."""
    max_overlap: Fraction = 0.15
    """Overlap of two grains, over the smaller diameter, above which a pack is refused."""
    packing_stiffness_N_m: Positive = 1.0e4
    """Stiffness of the stiffest contact while the pack is made; another one makes another pack."""


class Fines(Spheres):
    """[fines], the solids of the mud; without this table the intact pack alone is analysed."""

    density_kg_m3: Positive = 2146.0
    """Density of the fines."""
    normal_stiffness_N_m: Positive = 63.0e9
    """Normal contact stiffness."""
    shear_stiffness_N_m: Positive | None = None
    """Tangential one. When absent: 0.04 of the normal one."""
    youngs_modulus_GPa: Positive = 63.0
    """Young's modulus, for "hertz"."""
    poissons_ratio: Annotated[float, Field(ge=0, le=0.5)] = 0.212
    """Poisson's ratio, for "hertz"."""
    materials: Materials | None = None
    """Several materials instead."""
    cut_um: Positive | None = None
    """Diameter of measured sizes below which solids are no spheres: they are size classes with
    invasion.method = "both", else left out, which a warning names."""
    concentration: Annotated[float, Field(ge=1e-9)] | None = 0.10
    """Volume of solids over that of the mud, at most 0.3: more do not fit at random places."""
    solids_kg_m3: Positive | None = None
    """Mass of solids over volume of mud, instead of `concentration`."""
    count: Annotated[int, Field(ge=1)] | None = None
    """Number of fines. When absent, without `slab_mm`, mud comes until the stop rule, at most ten
    times what plugged the shipped cases, or two pore volumes of fines that pass."""
    slab_mm: Positive | None = None
    """Length of the slab of mud, instead of `count`."""
    supply: Literal["slab", "batches"] = "batches"
    """Whether fines are put in as they arrive, which is faster, or all at the start ("slab")."""

    slab_m: ClassVar = InSI[float | None]("slab_mm", 1e-3)

    @model_validator(mode="before")
    @classmethod
    def _one_concentration(cls, data: Any) -> Any:
        """The default of `concentration` gives way to `solids_kg_m3`."""
        by_mass = isinstance(data, Mapping) and data.get("solids_kg_m3") is not None
        return {"concentration": None, **data} if by_mass else data

    @model_validator(mode="after")
    def _something_is_left(self) -> Self:
        sizes = [self.sizes] if self.sizes is not None else []
        for one in [*sizes, *(material.sizes for material in self.materials or ())]:
            largest = one.curve().high
            if self.finest_m >= largest:
                problem = (
                    f"cut_um {self.cut_um:g} leaves nothing of a curve that ends at "
                    f"{1e6 * largest:.3g} um; lower it"
                )
                raise PydanticCustomError("size_curve", "{problem}", {"problem": problem})
        return self

    @property
    def _size_keys(self) -> tuple[Any, ...]:
        return self.radius_mm, self.sizes, self.materials

    @property
    def endless(self) -> bool:
        """Whether the mud comes until the stop rule."""
        return self.count is None and self.slab_mm is None

    @property
    def finest_m(self) -> float:
        """Diameter, m, below which sizes are left out."""
        return (self.cut_um or 0.0) * 1e-6

    @cached_property
    def components(self) -> tuple[Solid, ...]:
        """The materials that the fines are of, with their shares by volume of what is kept."""
        if self.materials is None:
            return super().components
        usual = self.density_kg_m3
        volumes = [one.share / (one.density_kg_m3 or usual) for one in self.materials]
        return tuple(
            Solid(
                name=one.name,
                share=volume / sum(volumes),
                curve=one.sizes.curve(self.finest_m),
                density=one.density_kg_m3 or usual,
            )
            for one, volume in zip(self.materials, volumes, strict=True)
        )

    @property
    def solids_density_kg_m3(self) -> float:
        """Mass over volume of all solids of the mud, those that are left out as well."""
        return sum(one.share * one.density for one in self.components)

    @property
    def has_one_concentration(self) -> bool:
        """Whether the solids of the mud are given, and once only."""
        return (self.solids_kg_m3 is None) != (self.concentration is None)

    @property
    def volume_fraction(self) -> float:
        """Volume of all solids over that of the suspension."""
        if self.solids_kg_m3 is not None:
            return self.solids_kg_m3 / self.solids_density_kg_m3
        return self.concentration or 0.0

    @property
    def placed_fraction(self) -> float:
        """Volume of the fines over that of the suspension: the solids without what is left out."""
        return self.volume_fraction * self.curve.kept if self.measured else self.volume_fraction
