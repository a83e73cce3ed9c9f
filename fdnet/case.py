"""Case: what the specimen is. Validated once, at birth; lengths and pressures carry their unit in the key.

A case holds no paths and no binary. `fdnet.case_file` reads one from TOML, `Case.toml()` writes it back with
every default.
"""

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

import tomli_w
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

MAX_CONCENTRATION = 0.30
"""Random sequential addition of spheres saturates near 0.38 (Torquato, Uche & Stillinger 2006)."""

MOST_FINES, MOST_SLAB, MOST_BINS, MOST_SECTIONS = 10_000_000, 1000, 10_000, 1000
"""Bounds on what a case may ask for: number of fines, slab over box length, profile bins, sections."""

CONTACT_STEP_LIMIT = 0.2
"""Largest time step over sqrt(m/k): at 0.3 energy still holds, at 0.5 it grows (measured, docs/physics.md)."""


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


Positive = Annotated[float, Field(ge=1e-18, le=1e15, allow_inf_nan=False)]
Fraction = Annotated[float, Field(gt=0, lt=1)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Pair = Annotated[tuple[Positive, Positive], BeforeValidator(_as_tuple)]
Triple = Annotated[tuple[Positive, Positive, Positive], BeforeValidator(_as_tuple)]
Vector = Annotated[tuple[Finite, Finite, Finite], BeforeValidator(_as_tuple)]
Radius = Annotated[Positive | Pair, Field(union_mode="smart")]


class Part(BaseModel):
    """A table of the case file: frozen, no unknown keys, no silent conversion of text to numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Spheres(Part):
    """What grains and fines share: sizes, density and linear (Hooke) contact parameters."""

    radius_mm: Radius
    density_kg_m3: Positive
    normal_stiffness_N_m: Positive
    shear_stiffness_N_m: Positive
    friction: NonNegative = 0.55
    damping_ratio: Annotated[float, Field(ge=0, lt=1)] = 0.2

    @property
    def radius_range_m(self) -> tuple[float, float]:
        """Smallest and largest radius, m; radii are uniform by number between them."""
        pair = self.radius_mm if isinstance(self.radius_mm, tuple) else (self.radius_mm, self.radius_mm)
        return pair[0] * 1e-3, pair[1] * 1e-3

    @property
    def mean_radius_m(self) -> float:
        """Number mean of the radius, m."""
        low, high = self.radius_range_m
        return 0.5 * (low + high)

    @property
    def mean_volume_m3(self) -> float:
        """Mean sphere volume of a radius uniform in [a, b]: pi/3 (a + b)(a^2 + b^2)."""
        low, high = self.radius_range_m
        return math.pi / 3 * (low + high) * (low**2 + high**2)

    @property
    def sauter_diameter_m(self) -> float:
        """Diameter of equal volume to surface ratio, 6 V/S = 2 <r^3>/<r^2>, radius uniform in [a, b]."""
        low, high = self.radius_range_m
        return 2 * (0.25 * (low + high) * (low**2 + high**2)) / ((low**2 + low * high + high**2) / 3)


class Box(Part):
    """The specimen: flow and depth along the first side; `sides` is what bounds the other two."""

    size_mm: Triple
    sides: Literal["walls", "periodic"] = "walls"
    wall_friction: NonNegative = 0.0


class Grains(Spheres):
    """The skeleton. `porosity` counts overlap once; `count` overrides it."""

    porosity: Fraction | None = None
    count: Annotated[int, Field(ge=1)] | None = None
    density_kg_m3: Positive = 2650.0
    normal_stiffness_N_m: Positive = 94.3e9
    shear_stiffness_N_m: Positive = 34.0e9
    motion: Literal["fixed", "mobile"] = "fixed"
    max_overlap: Fraction = 0.15


class Fines(Spheres):
    """The invading particles: a slab upstream, given by its length or by the number of fines."""

    density_kg_m3: Positive = 2146.0
    normal_stiffness_N_m: Positive = 63.0e9
    shear_stiffness_N_m: Positive = 26.0e9
    concentration: Annotated[float, Field(gt=0, le=MAX_CONCENTRATION)] = 0.10
    count: Annotated[int, Field(ge=1)] | None = None
    slab_mm: Positive | None = None


class Fluid(Part):
    """The mud's liquid. Its velocity is given, or follows from Darcy's law and Carman-Kozeny."""

    viscosity_cP: Positive = 50.0
    density_kg_m3: Positive = 1095.0
    overbalance_MPa: Positive = 3.5
    velocity_m_s: Positive | None = None
    darcy_length_mm: Positive | None = None


class Drag(Part):
    """Stokes drag on every fine: evaluated every step, or held for `refresh_steps` steps."""

    field: Literal["uniform", "network"] = "uniform"
    multiplier: Positive = 1.0
    scheme: Literal["every_step", "held"] = "held"
    refresh_steps: Annotated[int, Field(ge=1)] | None = None
    upstream: Literal["interstitial", "darcy"] = "interstitial"


class Gravity(Part):
    """`auto` leaves gravity out of the deck where gravity over drag is below `negligible_below`."""

    mode: Literal["auto", "on", "off"] = "auto"
    acceleration_m_s2: Vector = (0.0, 0.0, -9.81)
    buoyancy: bool = True
    negligible_below: NonNegative = 1e-3


class Run(Part):
    """Run control. Times left out are derived from the case (see `fdnet render`)."""

    stiffness_N_m: Positive | None = 1.0e4
    time_step_factor: Annotated[float, Field(gt=0, le=CONTACT_STEP_LIMIT)] = 0.1
    time_step_s: Positive | None = None
    duration_ms: Positive | None = None
    plug_time_ms: Positive | None = None
    cap_ms: Positive | None = None
    checkpoint_ms: Positive | None = None


class AnalysisChoices(Part):
    """How permeability is computed; the default laws are fdnet's most accurate pair."""

    sections: Annotated[int, Field(ge=1, le=MOST_SECTIONS)] = 8
    law: Literal["thesis", "effective", "hydraulic", "series", "lubrication"] = "lubrication"
    damage_law: Literal["thesis", "thesis-code", "kozeny", "side-kozeny"] = "side-kozeny"
    clogging_threshold: Fraction | None = None
    middle_band: Literal["threshold", "position"] = "threshold"
    throat_overlap: Literal["exact", "two-plane"] = "exact"
    profile_bin_mm: Positive = 0.25
    walls: Literal["no-slip", "slip"] = "no-slip"


class Case(Part):
    """One specimen. Without `fines` the pack stays intact and no invasion is run."""

    name: Annotated[str, Field(min_length=1, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 1
    box: Box
    grains: Grains
    fines: Fines | None = None
    fluid: Fluid = Fluid()
    drag: Drag = Drag()
    gravity: Gravity = Gravity()
    run: Run = Run()
    analysis: AnalysisChoices = AnalysisChoices()

    @model_validator(mode="after")
    def _parts_fit(self) -> "Case":
        found = list(cross_problems({name: getattr(self, name) for name in type(self).model_fields}))
        if found:
            raise ValueError("; ".join(found))
        return self

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Box sides, m."""
        x, y, z = self.box.size_mm
        return x * 1e-3, y * 1e-3, z * 1e-3

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Which directions are periodic; the flow direction never is."""
        sideways = self.box.sides == "periodic"
        return False, sideways, sideways

    def data(self) -> dict[str, Any]:
        """All keys with a value, defaults written out (TOML has no null: keys without a value are left out)."""
        return _without_none(self.model_dump(mode="json"))

    def toml(self) -> str:
        """The full resolved case as TOML."""
        return tomli_w.dumps(self.data())

    def digest(self, stage: str = "analyse") -> str:
        """Hash of what `stage` depends on: "pack" ignores fines, fluid and analysis, "invade" the analysis."""
        data = self.data()
        if stage in ("pack", "invade"):
            data.pop("analysis")
            data.pop("name")
        if stage == "pack":
            data["grains"].pop("motion")
            fines = self.fines.normal_stiffness_N_m if self.fines else None
            scaling = {"stiffness": self.run.stiffness_N_m, "fines_stiffness": fines}
            data = {key: data[key] for key in ("seed", "box", "grains")} | scaling
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return value


def cross_problems(parts: Mapping[str, Any]) -> Iterator[str]:
    """What is wrong between the parts of a case; parts that did not validate are absent or None."""
    box, grains, fines = parts.get("box"), parts.get("grains"), parts.get("fines")
    for name, spheres in (("grains", grains), ("fines", fines)):
        pair = spheres.radius_mm if spheres else None
        if isinstance(pair, tuple) and pair[0] >= pair[1]:
            yield f"{name}.radius_mm: {list(pair)} must rise, [smallest, largest]"
    if grains and grains.porosity is None and grains.count is None:
        yield "grains.porosity: missing, give it (0 to 1) or grains.count"
    if fines and (fines.count is None) == (fines.slab_mm is None):
        yield f"fines.count: {fines.count} with fines.slab_mm: {fines.slab_mm}, give exactly one of the two"
    if box and grains:
        yield from _box_problems(box, grains)
    if box and fines:
        yield from _supply_problems(box, fines)
    if grains and fines and fines.radius_range_m[1] >= grains.radius_range_m[0]:
        yield (
            f"fines.radius_mm: {fines.radius_mm} is not below grains.radius_mm {grains.radius_mm} "
            "(the network needs a clear gap)"
        )
    yield from _choice_problems(parts)


def _choice_problems(parts: Mapping[str, Any]) -> Iterator[str]:
    drag, gravity, run, box, analysis = (parts.get(name) for name in ("drag", "gravity", "run", "box", "analysis"))
    if drag and drag.field == "network":
        yield "drag.field: 'network' is not available yet; expected 'uniform'"
    if drag and drag.scheme == "every_step" and drag.refresh_steps not in (None, 1):
        yield f"drag.refresh_steps: {drag.refresh_steps} belongs to drag.scheme 'held', not 'every_step'"
    if gravity and gravity.mode != "off" and gravity.buoyancy:
        pulled = [component for component in gravity.acceleration_m_s2 if component]
        if len(pulled) > 1 or any(component > 0 for component in pulled):
            yield (
                f"gravity.acceleration_m_s2: {list(gravity.acceleration_m_s2)}: LIGGGHTS's buoyancy needs "
                "gravity down one axis, "
                "e.g. [0.0, 0.0, -9.81]; turn it, or set gravity.buoyancy = false"
            )
    if run and run.duration_ms is not None and run.cap_ms is not None:
        yield f"run.cap_ms: {run.cap_ms} beside run.duration_ms {run.duration_ms}: give one of the two"
    if box and analysis and box.size_mm[0] / analysis.profile_bin_mm > MOST_BINS:
        yield (
            f"analysis.profile_bin_mm: {analysis.profile_bin_mm:g} cuts {box.size_mm[0]:g} mm into more than "
            f"{MOST_BINS} bins; "
            f"expected at least {box.size_mm[0] / MOST_BINS:.3g}"
        )


def _supply_problems(box: Box, fines: Fines) -> Iterator[str]:
    """The slab must hold its fines and stay a slab; their number is bounded by memory."""
    area = box.size_mm[1] * box.size_mm[2]
    volume = fines.mean_volume_m3 * 1e9
    count = fines.count or fines.concentration * area * (fines.slab_mm or 0.0) / volume
    length = fines.slab_mm or count * volume / (fines.concentration * area)
    if count > MOST_FINES:
        yield f"fines.count: {count:.3g} fines, expected at most {MOST_FINES:.0e}; shorten the slab"
    if length > MOST_SLAB * box.size_mm[0]:
        yield (
            f"fines.concentration: {fines.concentration:g} makes a slab of {length:.3g} mm, expected at most "
            f"{MOST_SLAB} box lengths; "
            "raise it or supply fewer fines"
        )


def _box_problems(box: Box, grains: Grains) -> Iterator[str]:
    if grains.count is not None and grains.count * grains.mean_volume_m3 * 1e9 >= math.prod(box.size_mm):
        room = int(math.prod(box.size_mm) / (grains.mean_volume_m3 * 1e9))
        yield f"grains.count: {grains.count} spheres sum to more than the box; expected at most {room}"
    diameter_mm = 2e3 * grains.radius_range_m[1]
    need = 2.0 if box.sides == "periodic" else 1.0
    for axis, side in zip("xyz", box.size_mm, strict=True):
        least = diameter_mm * (need if axis != "x" else 1.0)
        if side < least:
            why = "a grain would meet its own image" if need == 2.0 and axis != "x" else "a grain does not fit"
            yield f"box.size_mm: side {axis} is {side:g} mm, expected at least {least:g} mm ({why})"
