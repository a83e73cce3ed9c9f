"""The tables of a case: their keys, units, ranges and defaults.

The keys carry the unit of the user; properties give the same values in SI for everything else.
"""

import inspect
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Generic, Literal, TypedDict, TypeVar

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from fdnet import names
from fdnet.errors import CaseError

MAX_CONCENTRATION = 0.30
"""Random sequential addition of spheres saturates near 0.38 (Torquato, Uche & Stillinger 2006)."""

MOST_GRAINS, MOST_FINES, MOST_SLAB, MOST_BINS = 10_000_000, 10_000_000, 1000, 10_000
"""Upper bounds: grains, fines, slab over box length, profile bins."""

CONTACT_STEP_LIMIT = 0.3
"""Largest time step over sqrt(m/k).

Dense packs without damping keep their energy at 0.4. It grows at 0.5, and at 0.4 in a dilute gas.
"""


def as_tuple(value: Any) -> Any:
    """A list of a case file as a tuple; anything else as it is."""
    return tuple(value) if isinstance(value, list) else value


Positive = Annotated[float, Field(ge=1e-18, le=1e15, allow_inf_nan=False)]
Fraction = Annotated[float, Field(gt=0, lt=1)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Pair = Annotated[tuple[Positive, Positive], BeforeValidator(as_tuple)]
Triple = Annotated[tuple[Positive, Positive, Positive], BeforeValidator(as_tuple)]
Vector = Annotated[tuple[Finite, Finite, Finite], BeforeValidator(as_tuple)]
Radius = Annotated[Positive | Pair, Field(union_mode="smart")]


Value = TypeVar("Value", float, float | None)


class InSI(Generic[Value]):
    """The value of a key times the factor from its unit to SI; None stays None."""

    def __init__(self, key: str, factor: float) -> None:
        self.key, self.factor = key, factor

    def __get__(self, table: Any, owner: Any = None) -> Value:
        given: Any = getattr(table, self.key)
        value: Any = None if given is None else given * self.factor
        return value


class Part(BaseModel):
    """A table of the case file: frozen, no unknown keys, no conversion of text to numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    def __repr_args__(self) -> Iterable[tuple[str | None, Any]]:
        """The keys that were given; the others have their defaults."""
        given = self.model_fields_set
        return ((key, value) for key, value in super().__repr_args__() if key in given)

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """A signature of keys and defaults; the types stand in the reference."""
        keys = cls.__signature__.parameters.values()
        plain = [one.replace(annotation=inspect.Parameter.empty) for one in keys]
        cls.__signature__ = inspect.Signature(plain)


def still_there(name: Any, removed: Mapping[str, str]) -> Any:
    """The name as given. Refuses one that is gone, with the one of `removed` to take instead."""
    if isinstance(name, str) and name in removed:
        text = "is no longer there; take '{instead}'"
        raise PydanticCustomError("removed", text, {"instead": removed[name]})
    return name


M2_PER_MD = 9.869233e-16  # One millidarcy in m2


class Fluid(Part):
    """[fluid], the mud's liquid. Its velocity is given, or follows from the overbalance."""

    viscosity_cP: Positive = 50.0
    """Dynamic viscosity."""
    density_kg_m3: Positive = 1095.0
    """Its density."""
    overbalance_MPa: Positive = 3.5
    """Pressure of the mud above that of the formation."""
    velocity_m_s: Positive | None = None
    """Velocity in the pores. When absent: by the overbalance and `[well]` or `darcy_length_mm`."""
    darcy_length_mm: Positive | None = None
    """Length of a plug that takes the whole overbalance. When absent, without a well: the length
    of the box, which warns."""
    darcy_law: Literal["ergun", "darcy"] = "ergun"
    """Whether inertia takes its share of the overbalance ("ergun"), or not ("darcy")."""

    viscosity_Pa_s: ClassVar = InSI[float]("viscosity_cP", 1e-3)

    @property
    def stokes_coefficient_Pa_s(self) -> float:
        """6 pi viscosity: the drag force over radius and relative velocity, Pa s (Stokes 1851)."""
        return 6 * math.pi * self.viscosity_cP * 1e-3

    darcy_length_m: ClassVar = InSI[float | None]("darcy_length_mm", 1e-3)
    overbalance_Pa: ClassVar = InSI[float]("overbalance_MPa", 1e6)


class Well(Part):
    """[well], a well at whose face the specimen lies: the overbalance is lost in radial flow."""

    radius_mm: Positive
    """Radius of the well, to the formation face."""
    drainage_radius_m: Positive = 100.0
    """Radius of the undisturbed formation; half or twice of it moves the velocity by 10 %."""
    formation_permeability_mD: Positive | None = None
    """Permeability of the formation. When absent: that of the pack."""

    radius_m: ClassVar = InSI[float]("radius_mm", 1e-3)
    formation_permeability_m2: ClassVar = InSI[float | None](
        "formation_permeability_mD", M2_PER_MD
    )


MODEL_KEYS = {
    "hooke": frozenset({"normal_stiffness_N_m", "shear_stiffness_N_m"}),
    "hertz": frozenset({"youngs_modulus_GPa", "poissons_ratio"}),
}
"""Keys of [grains] and [fines] that only one contact model reads."""
DEEPEST_DAMPING = 0.69
"""Damping ratio up to which LIGGGHTS's Hertz model takes the restitution (above 0.05)."""


class ContactLaw(Part):
    """[contact], the law of all contacts; what is not asked for is left out of the deck."""

    model: Literal["hooke", "hertz"] = "hooke"
    """"hooke": linear springs. "hertz": Hertz-Mindlin contacts of the moduli."""

    restitution: Literal["liquid", "dry"] = "liquid"
    """Rebound of fines: by exp(-35 / St) lower in a "liquid", St being the impact Stokes number;
    "dry" as `damping_ratio` has it."""
    rolling_friction: Positive | None = None
    """Largest rolling torque over normal force and effective radius. When absent nothing resists
    rolling."""
    cohesion_J_m3: Positive | None = None
    """Attraction over the area of a fine's contact (LIGGGHTS's SJKR); it needs "hertz". When
    absent nothing attracts."""

    @property
    def other_keys(self) -> frozenset[str]:
        """Keys of [grains] and [fines] that the other contact model reads."""
        return frozenset().union(*(MODEL_KEYS[name] for name in MODEL_KEYS if name != self.model))


class Bonds(Part):
    """[bonds], discs of elastic cement between two grains; `fdnet mechanics` alone reads them."""

    radius_ratio: Annotated[float, Field(gt=0, le=1)]
    """Radius of a bond over that of the smaller grain."""
    normal_stiffness_GPa_m: Positive = 95.0
    """Normal stiffness of a bond per area of its disc."""
    shear_stiffness_GPa_m: Positive = 40.0
    """Shear stiffness of a bond per area of its disc."""
    tensile_strength_MPa: Positive | None = None
    """Largest tensile stress of a bond. When absent, with the shear strength, bonds never
    break."""
    shear_strength_MPa: Positive | None = None
    """Largest shear stress of a bond."""
    gap_ratio: Annotated[float, Field(ge=0, le=0.5)] = 0.01
    """Widest gap that a bond bridges, over the smaller diameter."""

    normal_stiffness_Pa_m: ClassVar = InSI[float]("normal_stiffness_GPa_m", 1e9)
    shear_stiffness_Pa_m: ClassVar = InSI[float]("shear_stiffness_GPa_m", 1e9)
    tensile_strength_Pa: ClassVar = InSI[float | None]("tensile_strength_MPa", 1e6)
    shear_strength_Pa: ClassVar = InSI[float | None]("shear_strength_MPa", 1e6)


FLOW_TRAVEL, MOST_TRAVEL = 1.0, 10.0
"""Diameters of the smallest fine between two updates of the flow: by default, and at most."""
OF_THE_UNIFORM = ("scheme", "refresh_steps", "upstream", "pressure_gradient", "inertia")
"""Keys of [drag] that only the uniform field leaves open."""


class Box(Part):
    """[box], the specimen: flow and depth run along the first side from the face, x = 0."""

    size_mm: Triple
    """Three side lengths; the mud flows along the first."""
    sides: Literal["walls", "periodic"] = "periodic"
    """What bounds the box in y and z: "periodic" images of itself, or "walls"."""
    wall_friction: NonNegative | None = None
    """Sliding friction of side walls. When absent: that of the grains."""


class Drag(Part):
    """[drag], the forces of the fluid on every fine: drag by its slip, and the pressure gradient.

    Where the fluid follows the deposit, drag is that of Beetstra and others (2007).
    """

    field: Literal["network", "uniform"] = "network"
    """"network": the fluid follows the pores and the deposit in them. "uniform": one velocity
    everywhere, and the drag of a lone sphere."""
    multiplier: Positive = 1.0
    """Factor on the drag."""
    scheme: Literal["implicit", "held", "viscous"] = Field(
        "implicit",
        description='How forces act with the field "uniform": "held" (when absent) for '
        '`refresh_steps` steps, "viscous" as damping (fines of one size), "implicit" at any step.',
    )
    refresh_steps: Annotated[int, Field(ge=1)] | None = None
    """Steps for which "held" keeps a force. When absent: 0.05 of the relaxation time at most."""
    drive_velocity_m_s: Positive | Literal["auto", "fluid"] = Field(
        "auto",
        description="Velocity in the simulated pores, to shorten a run with a weak push; all "
        'forces are scaled alike. "fluid" (when absent with "uniform"): its own. "auto": up '
        "to an impact Stokes number of 0.1, not with cohesion. A number: up to 0.3.",
    )
    upstream: Literal["darcy", "interstitial"] = "darcy"
    """Velocity upstream of the face; "interstitial", that in the pores, brings the mud too
    fast."""
    pressure_gradient: bool = True
    """Whether the pressure gradient pushes the fines; only the field "uniform" can leave it
    out."""
    inertia: Literal["schiller-naumann", "none"] = Field(
        "schiller-naumann",
        description='Drag times 1 + 0.15 Re^0.687 (with "held"; Re up to 800), or "none": Stokes '
        "drag at any speed.",
    )
    drive: Literal["pressure", "rate"] | None = None
    """What stays constant with the field "network": "pressure" (when absent) or "rate"."""
    update_travel: Annotated[float, Field(gt=0, le=MOST_TRAVEL)] | None = Field(
        None,
        description="Way of the fluid, in diameters of the smallest fine, after which the field "
        f'"network" is computed anew. When absent: {FLOW_TRAVEL:g}.',
    )

    @model_validator(mode="before")
    @classmethod
    def _as_usual_in_a_uniform_field(cls, given: Any) -> Any:
        if not isinstance(given, Mapping) or given.get("field") != "uniform":
            return given
        filled = {"scheme": "held", "drive_velocity_m_s": "fluid"} | dict(given)
        if filled["scheme"] in ("implicit", "viscous"):
            filled.setdefault("inertia", "none")
        return filled

    @field_validator("scheme", mode="before")
    @classmethod
    def _is_there(cls, name: Any) -> Any:
        return still_there(name, {"every_step": "held"})

    @property
    def coupled(self) -> bool:
        """Whether fdnet computes the forces on each fine while LIGGGHTS waits."""
        return self.field == "network"

    @property
    def slowed(self) -> bool:
        """Whether the deposit slows the mud down."""
        return self.coupled and self.drive != "rate"

    @property
    def travel_diameters(self) -> float:
        """Diameters of the smallest fine between two updates of a coupled invasion."""
        return FLOW_TRAVEL if self.update_travel is None else self.update_travel


class Gravity(Part):
    """[gravity], weight and buoyancy of the moving spheres."""

    mode: Literal["auto", "on", "off"] = "auto"
    """"auto" leaves gravity out below `negligible_below`."""
    acceleration_m_s2: Vector = (0.0, 0.0, -9.81)
    """Gravity vector (x, y, z)."""
    buoyancy: bool = True
    """Whether buoyancy acts on what moves."""
    negligible_below: NonNegative = 1e-3
    """Weight over drag that is negligible."""


DEFAULT_STIFFNESS = 1.0e4  # N/m, of the stiffest contact


class Run(Part):
    """[run], run control: contact stiffness, time step, when to stop and what to refuse.

    Times in ms are physical ones, also with `drag.drive_velocity_m_s`.
    """

    stiffness_N_m: Positive | Literal["nominal", "auto"] = "auto"
    """Stiffness of the stiffest contact (with "hertz" at an overlap of 1 %); the others keep their
    ratio to it. "nominal": that of the materials. "auto": the least that keeps predicted overlaps
    at 3 %, in the uniform field at least 1e4; where the flow follows the deposit it starts at a
    fifth of that and rises with the overlaps that are seen."""
    max_hours: Positive = 24.0
    """A case that is expected to run longer is refused."""
    max_overlap: Fraction = 0.05
    """Overlap of a fine, over the smaller diameter, above which the run warns."""
    time_step_factor: Annotated[float, Field(gt=0, le=CONTACT_STEP_LIMIT)] | None = None
    """Time step over sqrt(m/k) of the lightest sphere and stiffest contact; above 0.2 for linear
    contacts without rolling friction and with damping ratios up to 0.48 alone. When absent: 0.2;
    where springs grow with the load, 0.1 to 0.3 as stability and small fines ask for."""
    time_step_s: Positive | None = None
    """Time step of the invasion, instead of `time_step_factor`."""
    duration_ms: Positive | None = None
    """Length of the invasion, instead of the stop rule."""
    plug_time_ms: Positive | None = None
    """The face is plugged when no fine crossed it for this time. When absent: until the fluid has
    passed four grains and ten fines have arrived."""
    plug_rate: Annotated[float, Field(ge=0, lt=1)] = 0.05
    """Share of the undisturbed supply that may cross a plugged face; inside, of its velocity."""
    stop_rate: Fraction | None = None
    """Share of the first rate below which the face is plugged (field "network")."""
    stop_pore_volumes: Positive | None = None
    """Volumes of the intact pores after which the invasion ends (field "network")."""
    cap_ms: Positive | None = None
    """Longest invasion. When absent: by slab, plug time and velocity."""
    checkpoint_ms: Positive | None = None
    """Time between checkpoints. When absent: the fluid passes about one grain diameter."""

    duration_s: ClassVar = InSI[float | None]("duration_ms", 1e-3)
    plug_time_s: ClassVar = InSI[float | None]("plug_time_ms", 1e-3)
    cap_s: ClassVar = InSI[float | None]("cap_ms", 1e-3)
    checkpoint_s: ClassVar = InSI[float | None]("checkpoint_ms", 1e-3)


class CleanUp(Part):
    """[clean_up], production after the invasion: the flow is turned back, at the drawdown."""

    drawdown_MPa: Positive
    """Pressure of the formation above that of the well, lost on the way of the overbalance."""
    duration_ms: Positive | None = None
    """Length of the clean-up. When absent it ends when no fine comes out while the fluid passes
    the specimen once, at the latest after twenty passages."""

    drawdown_Pa: ClassVar = InSI[float]("drawdown_MPa", 1e6)
    duration_s: ClassVar = InSI[float | None]("duration_ms", 1e-3)

    def fluid_of(self, fluid: Fluid) -> Fluid:
        """The fluid with the drawdown for its overbalance."""
        return fluid.model_copy(update={"overbalance_MPa": self.drawdown_MPa})

    def run_of(self, run: Run) -> Run:
        """The control of the invasion with the length of the clean-up."""
        own = dict.fromkeys(("cap_ms", "plug_time_ms", "checkpoint_ms"))
        return run.model_copy(update=own | {"duration_ms": self.duration_ms})


class InvasionChoices(Part):
    """[invasion], how the mud is let in: as spheres, or as size classes on the pore network."""

    method: Literal["liggghts", "network", "both"] = "liggghts"
    """"liggghts": every fine is a sphere. "network": all solids are size classes, as with `fdnet
    run --fast`. "both": spheres above `fines.cut_um`, classes below it."""
    classes: Annotated[int, Field(ge=1, le=40)] = 8
    """Number of size classes, equal over ln d."""
    sticking: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Share of the contacts of fines with grains that stick."""
    release_stress_Pa: Positive | None = None
    """Wall stress of a throat above which the flow lifts what is held in throats and sticks to
    grains. When absent: what is held stays."""
    release_time_s: Positive | None = None
    """Time in which it lifts all but 1/e, with `invasion.release_stress`."""


class MudCake(Part):
    """[cake], the measured cake of the mud for size classes; clay makes it very tight."""

    permeability_m2: Annotated[float, Field(gt=0, le=1e-9)] | None = None
    """Permeability of the cake. When both are absent: by Carman and Kozeny for its classes."""
    api_filtrate_mL: Positive | None = None
    """Filtrate of the API's press instead: 30 minutes, 690 kPa, 45.8 cm2."""

    api_filtrate_m3: ClassVar = InSI[float | None]("api_filtrate_mL", 1e-6)


# A case file gives a count; only Python gives edges, as a tuple.
Count = Annotated[int, Field(ge=1, le=names.MOST_SECTIONS), Tag("[count]")]
Edges = Annotated[tuple[Finite, ...], Tag("[edges]")]
_KIND = Discriminator(lambda value: "[edges]" if isinstance(value, tuple) else "[count]")
Sections = Annotated[Count | Edges, _KIND]


class AnalysisKeys(TypedDict, total=False):
    """The keywords of `AnalysisChoices.of_pack` and of `fdnet.analyse`; see `AnalysisChoices`."""

    sections: int | Sequence[float]
    law: str
    damage_law: str
    clogging_threshold: float | None
    middle_band: str
    throat_overlap: str
    profile_bin_mm: float | None
    walls: str


class AnalysisChoices(Part):
    """[analysis], how permeability is computed; the default laws are the most accurate pair."""

    sections: Sections = 8
    """Number of equal slabs along the flow; in Python also their edges, m."""
    law: names.LawName = names.DEFAULT_LAW
    """Conductance of a clean throat."""
    damage_law: names.DamageLawName = Field(
        names.AUTO,
        description='How fines lower the permeability: "all-spheres", the network of grains and '
        'fines, or a law that damages the throats of the grains. "auto": "all-spheres" up to '
        f'{names.MOST_SPHERES:,} spheres, "section-archie" above.',
    )
    clogging_threshold: Fraction | None = None
    """Throat porosity below which the thesis's laws close a throat. When absent: 0.40 ("thesis")
    or 0.36 ("thesis-code")."""
    middle_band: Literal["threshold", "position"] = "threshold"
    """The thesis's rule for a throat porosity of 0.36 to 0.80: by `clogging_threshold`, or by
    where the fines lie."""
    throat_overlap: Literal["exact", "two-plane"] = "exact"
    """Volume of a fine in a throat: exact, or by the thesis's two planes."""
    profile_bin_mm: Positive | None = 0.25
    """Width of the bins of `profile.csv`."""
    walls: names.WallName = "no-slip"
    """Whether side walls hold the fluid; the thesis's laws do not know it."""

    @field_validator("law", "damage_law", mode="before")
    @classmethod
    def _is_there(cls, name: Any) -> Any:
        return still_there(name, names.REMOVED_LAWS)

    def refusals(self) -> Iterator[str]:
        """Why laws do not go together, one sentence each."""
        if self.damage_law == names.ALL_SPHERES and self.law != names.DEFAULT_LAW:
            yield (
                f"analysis.damage_law: {self.damage_law!r} needs a network of all spheres, whose "
                f"law is {names.DEFAULT_LAW!r}, analysis.law is {self.law!r}; take analysis.law = "
                f"{names.DEFAULT_LAW!r}, or another damage law"
            )

    profile_bin_m: ClassVar = InSI[float | None]("profile_bin_mm", 1e-3)

    @classmethod
    def of_pack(cls, **keys: Any) -> "AnalysisChoices":
        """Choices without a case: one section and bins of a mean grain radius, or as given.

        `keys` are those of `AnalysisKeys`. Raises CaseError that names every key with a bad value.
        """
        given = {"sections": 1, "profile_bin_mm": None} | keys
        given["sections"] = _plain_sections(given["sections"])
        try:
            choices = cls.model_validate(given)
        except ValidationError as error:
            raise CaseError("; ".join(map(_refusal, error.errors()))) from None
        for refusal in choices.refusals():
            raise CaseError(refusal)
        return choices

    def changed(self, **keys: Any) -> "AnalysisChoices":
        """The same choices with `keys` changed. Raises CaseError as `of_pack` does."""
        return type(self).of_pack(**self.model_dump() | keys) if keys else self


Function = TypeVar("Function", bound=Callable[..., Any])


def with_visible_choices(function: Function) -> Function:
    """The function, whose `**choices: Unpack[AnalysisKeys]` is shown as the single keywords."""
    shown, usual = inspect.signature(function), AnalysisChoices.of_pack()
    plain = [one for one in shown.parameters.values() if one.kind is not one.VAR_KEYWORD]
    single = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=getattr(usual, name), annotation=kind
        )
        for name, kind in AnalysisKeys.__annotations__.items()
    ]
    function.__dict__["__signature__"] = shown.replace(parameters=[*plain, *single])
    return function


def _plain_sections(value: Any) -> Any:
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, list | tuple | np.ndarray):
        return tuple(np.asarray(value, dtype=float).ravel().tolist())
    return value


def _refusal(item: Any) -> str:
    key = str(item["loc"][0])
    if item["type"] == "extra_forbidden":
        known = ", ".join(AnalysisChoices.model_fields)
        return f"analysis.{key}: unknown key; choose some of {known}"
    return f"analysis.{key}: {item['input']!r} {item['msg'].replace('Input should', 'should')}"
