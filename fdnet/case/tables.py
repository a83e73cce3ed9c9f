"""The tables of a case: their keys, units, ranges and defaults.

The keys carry the unit of the user; properties give the same values in SI for everything else.
"""

import inspect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
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

from fdnet.errors import CaseError
from fdnet.names import (
    ALL_SPHERES,
    AUTO,
    DEFAULT_LAW,
    MOST_SECTIONS,
    MOST_SPHERES,
    REMOVED_LAWS,
    DamageLawName,
    LawName,
    WallName,
)

MAX_CONCENTRATION = 0.30
"""Random sequential addition of spheres saturates near 0.38 (Torquato, Uche & Stillinger 2006)."""

MOST_GRAINS, MOST_FINES, MOST_SLAB, MOST_BINS = 10_000_000, 10_000_000, 1000, 10_000
"""Upper bounds: grains, fines, slab over box length, profile bins."""

LEAST_SKIN, MOST_NEIGHBOUR_BINS = 0.01, 10_000_000
"""Smallest skin over the smallest fine's radius, most bins of the neighbour search in the box."""

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


def still_there(name: Any, removed: Mapping[str, str]) -> Any:
    """The name as given. Refuses one that is gone, with the one of `removed` to take instead."""
    if isinstance(name, str) and name in removed:
        text = "is no longer there; take '{instead}'"
        raise PydanticCustomError("removed", text, {"instead": removed[name]})
    return name


M2_PER_MD = 9.869233e-16
"""One millidarcy in m2."""


class Fluid(Part):
    """[fluid], the mud's liquid.

    Its velocity is given, or follows from the overbalance by Darcy's law.
    """

    viscosity_cP: Positive = 50.0
    """Dynamic viscosity."""
    density_kg_m3: Positive = 1095.0
    """Density; it decides buoyancy and the particle Reynolds number."""
    overbalance_MPa: Positive = 3.5
    """Pressure of the mud above that of the formation; it drives the fluid by Darcy's law."""
    velocity_m_s: Positive | None = None
    """Interstitial velocity along x. When absent it follows from the overbalance and `[well]` or
    `darcy_length_mm`."""
    darcy_length_mm: Positive | None = None
    """Length of a plug over which the whole overbalance is lost. When absent, without a well: the
    length of the box, which warns."""
    darcy_law: Literal["ergun", "darcy"] = "ergun"
    """The overbalance makes the velocity with the loss by inertia ("ergun"), or by the viscous
    loss alone ("darcy"), which warns where inertia takes 5 % or more."""

    viscosity_Pa_s: ClassVar = InSI[float]("viscosity_cP", 1e-3)
    """Dynamic viscosity, Pa s."""

    @property
    def stokes_coefficient_Pa_s(self) -> float:
        """6 pi viscosity: the drag force over radius and relative velocity, Pa s (Stokes 1851)."""
        return 6 * math.pi * self.viscosity_cP * 1e-3

    darcy_length_m: ClassVar = InSI[float | None]("darcy_length_mm", 1e-3)
    """Length over which the overbalance is lost, m; None: the length of the box."""
    overbalance_Pa: ClassVar = InSI[float]("overbalance_MPa", 1e6)
    """Pressure of the mud above that of the formation, Pa."""


class Well(Part):
    """[well], a vertical well in its formation: the overbalance is lost in radial flow around it.

    The specimen is a piece of the formation at the face of the well.
    """

    radius_mm: Positive
    """Radius of the well, to the formation face."""
    drainage_radius_m: Positive = 100.0
    """Radius at which the pressure is that of the undisturbed formation; 100 m is a well on 3 ha.
    It counts by its logarithm: half or twice of it moves the velocity by 10 %."""
    formation_permeability_mD: Positive | None = None
    """Permeability of the formation. When absent: that of the pack by Carman and Kozeny, by the
    network where the flow follows the deposit."""

    radius_m: ClassVar = InSI[float]("radius_mm", 1e-3)
    """Radius of the well, m."""
    formation_permeability_m2: ClassVar = InSI[float | None](
        "formation_permeability_mD", M2_PER_MD
    )
    """Permeability of the formation, m2; None: that of the pack."""


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
    """Rebound of fines: "liquid" lowers the restitution by exp(-35 / St), St being the impact
    Stokes number; "dry" takes `damping_ratio` as it is."""
    rolling_friction: Positive | None = None
    """Largest rolling torque of a contact over normal force and effective radius. When absent
    nothing resists rolling."""
    cohesion_J_m3: Positive | None = None
    """Attraction of a fine's contact over its area (LIGGGHTS's SJKR). It needs "hertz". When
    absent nothing attracts."""

    @property
    def other_keys(self) -> frozenset[str]:
        """Keys of [grains] and [fines] that the other contact model reads."""
        return frozenset().union(*(MODEL_KEYS[name] for name in MODEL_KEYS if name != self.model))


class Bonds(Part):
    """[bonds], parallel bonds: a disc of elastic cement between two grains.

    Only `fdnet mechanics` reads them; the invasion has no bonds.
    """

    radius_ratio: Annotated[float, Field(gt=0, le=1)]
    """Radius of a bond over that of the smaller of its two grains."""
    normal_stiffness_GPa_m: Positive = 95.0
    """Normal stiffness of a bond per area of its disc."""
    shear_stiffness_GPa_m: Positive = 40.0
    """Shear stiffness of a bond per area of its disc."""
    tensile_strength_MPa: Positive | None = None
    """Largest tensile stress of a bond. When absent, bonds never break; give it together with the
    shear strength."""
    shear_strength_MPa: Positive | None = None
    """Largest shear stress of a bond; see the tensile strength."""
    gap_ratio: Annotated[float, Field(ge=0, le=0.5)] = 0.01
    """Widest gap that a bond bridges, over the smaller diameter of its two grains."""

    normal_stiffness_Pa_m: ClassVar = InSI[float]("normal_stiffness_GPa_m", 1e9)
    """Normal stiffness per area, Pa/m."""
    shear_stiffness_Pa_m: ClassVar = InSI[float]("shear_stiffness_GPa_m", 1e9)
    """Shear stiffness per area, Pa/m."""
    tensile_strength_Pa: ClassVar = InSI[float | None]("tensile_strength_MPa", 1e6)
    """Tensile strength, Pa; None: bonds never break."""
    shear_strength_Pa: ClassVar = InSI[float | None]("shear_strength_MPa", 1e6)
    """Shear strength, Pa; None: bonds never break."""


FLOW_TRAVEL, MOST_TRAVEL = 1.0, 10.0
"""Diameters of the smallest fine between two updates of the flow: by default, and at most."""
OF_THE_UNIFORM = ("scheme", "refresh_steps", "upstream", "pressure_gradient", "inertia")
"""Keys of [drag] that only the uniform field leaves open."""


class Box(Part):
    """[box], the specimen.

    Flow and depth run along the first side; x = 0 is the formation face.
    """

    size_mm: Triple
    """Three side lengths; the mud flows along the first."""
    sides: Literal["walls", "periodic"] = "periodic"
    """What bounds the box in y and z: "periodic" images of itself, or solid "walls"."""
    wall_friction: NonNegative | None = None
    """Sliding friction of side walls. When absent: that of the grains. A contact takes the smaller
    value of wall and sphere."""

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Side lengths (x, y, z), m."""
        x, y, z = self.size_mm
        return x * 1e-3, y * 1e-3, z * 1e-3

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Which directions are periodic; the flow direction never is."""
        sideways = self.sides == "periodic"
        return False, sideways, sideways


class Drag(Part):
    """[drag], the forces of the fluid on every fine.

    Drag by its slip, and that of the pressure gradient. Where the fluid follows the deposit the
    drag is that of Beetstra and others (2007), with the porosity and the Reynolds number around
    each fine.
    """

    field: Literal["network", "uniform"] = "network"
    """"network": the fluid follows the pores and the deposit in them. "uniform": one velocity
    everywhere, and the drag of a lone sphere."""
    multiplier: Positive = 1.0
    """Factor on the drag."""
    scheme: Literal["implicit", "held", "viscous"] = Field(
        "implicit",
        description='With the field "uniform": "held" (when absent) keeps the force for '
        '`refresh_steps` steps, "viscous" takes viscous damping (fines of one size), "implicit" '
        'is stable at any step, and is what the field "network" takes.',
    )
    refresh_steps: Annotated[int, Field(ge=1)] | None = None
    """Steps for which "held" keeps the force. When absent: at most 0.05 of the relaxation time."""
    drive_velocity_m_s: Positive | Literal["auto", "fluid"] = Field(
        "auto",
        description="Velocity in the pores of the simulation, to shorten a run with a weak push. "
        "All forces are scaled by the same factor. Allowed up to an impact Stokes number of 1; "
        '"auto" (when absent with the field "network") drives to 0.1, but never slower than the '
        'fluid moves and not with cohesion; "fluid" (when absent with "uniform") is its own.',
    )
    upstream: Literal["darcy", "interstitial"] = "darcy"
    """Velocity upstream of the face: "darcy", or, with the field "uniform", "interstitial" as in
    the pack, which brings the mud too fast."""
    pressure_gradient: bool = True
    """Whether the pressure gradient pushes the fines inside the pack. Only the field "uniform" can
    leave it out; the thesis's cases do."""
    inertia: Literal["schiller-naumann", "none"] = Field(
        "schiller-naumann",
        description='With the field "uniform" and the scheme "held": drag times '
        '1 + 0.15 Re^0.687 (Re up to 800; when absent), or "none", Stokes drag at any speed, as '
        "with the other schemes.",
    )
    drive: Literal["pressure", "rate"] | None = None
    """What stays constant with the field "network": "pressure" (when absent) or "rate"."""
    update_travel: Annotated[float, Field(gt=0, le=MOST_TRAVEL)] | None = Field(
        None,
        description="How far the fluid carries a fine, in diameters of the smallest fine, before "
        'the forces on all fines are computed anew with the field "network". When absent: '
        f"{FLOW_TRAVEL:g}.",
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
    """"auto" leaves gravity out where weight over drag is below `negligible_below`."""
    acceleration_m_s2: Vector = (0.0, 0.0, -9.81)
    """Gravity vector (x, y, z), in any direction."""
    buoyancy: bool = True
    """Whether the fluid's buoyancy acts on fines and mobile grains."""
    negligible_below: NonNegative = 1e-3
    """Ratio of weight to drag below which mode "auto" leaves gravity out."""


DEFAULT_STIFFNESS = 1.0e4
"""N/m, of the stiffest contact."""


class Run(Part):
    """[run], run control: contact stiffness, time step, when to stop and what to refuse.

    `max_hours`, `max_overlap` and `on_overlap` decide only whether a run may go on. No result
    depends on them, so they may be changed when a run is resumed. Times in ms are physical times;
    they differ from those of the simulation with `drag.drive_velocity_m_s`.
    """

    stiffness_N_m: Positive | Literal["nominal", "auto"] = "auto"
    """Stiffness of the stiffest contact; all others keep their ratio to it. With "hertz": force
    over overlap of a fine's stiffest contact at 1 % of its diameter. "nominal" keeps the real
    stiffness. "auto" takes the least that keeps predicted overlaps at 3 %: in the uniform field at
    least the default; where the flow follows the deposit, a fifth of what its largest forces
    need, raised at a checkpoint when the overlaps that are seen ask for it."""
    max_hours: Positive = 24.0
    """A case that is expected to run longer is refused before it starts."""
    max_overlap: Fraction = 0.05
    """Overlap of a fine, over the smaller diameter, above which `on_overlap` applies. Springs by
    "auto" aim at 3 %, and few fines are pressed in deeper."""
    on_overlap: Literal["warn", "stop"] = "warn"
    """What follows then: a warning ("warn"), or the run stops with its state kept ("stop")."""
    time_step_factor: Annotated[float, Field(gt=0, le=CONTACT_STEP_LIMIT)] | None = None
    """Time step over sqrt(m/k) of the lightest sphere and stiffest contact. Up to 0.3 is stable
    for linear contacts without rolling friction and with damping ratios up to 0.48; all others
    take at most 0.2. When absent: 0.2; where springs grow with the load (stiffness "auto", field
    "network") the largest that is stable, or less, down to 0.1, so that small fines do not lock
    between grains."""
    time_step_s: Positive | None = None
    """Time step of the invasion, instead of `time_step_factor`."""
    duration_ms: Positive | None = None
    """Length of the invasion. It replaces the stop rule and excludes `cap_ms`."""
    plug_time_ms: Positive | None = None
    """The face counts as plugged when no fine crossed it for this time. When absent: until the
    fluid has passed four grain diameters and ten fines have arrived."""
    plug_rate: Annotated[float, Field(ge=0, lt=1)] = 0.05
    """Share of the undisturbed supply that may still cross the face while it counts as plugged."""
    stop_rate: Fraction | None = None
    """Share of the first rate below which the invasion ends as plugged (field "network")."""
    stop_pore_volumes: Positive | None = None
    """The invasion ends when so many volumes of its intact pores have passed (field "network")."""
    cap_ms: Positive | None = None
    """The invasion ends at this time at the latest. When absent it follows from slab, plug time
    and velocity."""
    checkpoint_ms: Positive | None = None
    """Time between checkpoints. When absent: the fluid passes about one grain diameter."""
    skin_mm: Positive | None = None
    """Skin of LIGGGHTS's neighbour search. When absent: 0.3 of the radius of the smallest fine;
    with the field "uniform" the radius."""
    neighbour_bin_mm: Positive | None = None
    """Bin width of LIGGGHTS's neighbour search. When absent LIGGGHTS chooses it."""

    duration_s: ClassVar = InSI[float | None]("duration_ms", 1e-3)
    """Length of the invasion, s; None: until the stop rule holds."""
    plug_time_s: ClassVar = InSI[float | None]("plug_time_ms", 1e-3)
    """Time without a crossing after which the face counts as plugged, s, if given."""
    cap_s: ClassVar = InSI[float | None]("cap_ms", 1e-3)
    """Time at which the invasion ends at the latest, s, if given."""
    checkpoint_s: ClassVar = InSI[float | None]("checkpoint_ms", 1e-3)
    """Time between checkpoints, s, if given."""
    skin_m: ClassVar = InSI[float | None]("skin_mm", 1e-3)
    """Skin of the neighbour search, m, if given."""
    neighbour_bin_m: ClassVar = InSI[float | None]("neighbour_bin_mm", 1e-3)
    """Bin width of the neighbour search, m, if given."""


class CleanUp(Part):
    """[clean_up], production after the invasion.

    The flow is turned back, from the formation to the well.

    Friction, rolling resistance and cohesion are those of the invasion.
    """

    drawdown_MPa: Positive
    """Pressure of the formation above that of the well, lost on the same way as the
    overbalance."""
    duration_ms: Positive | None = None
    """Length of the clean-up. It replaces the stop rule and excludes `cap_ms`."""
    quiet_ms: Positive | None = None
    """The clean-up ends when no fine has come out for this time. When absent: the time in which
    the fluid passes the specimen once."""
    cap_ms: Positive | None = None
    """The clean-up ends at this time at the latest. When absent: twenty times the time in which
    the fluid passes the specimen."""

    drawdown_Pa: ClassVar = InSI[float]("drawdown_MPa", 1e6)
    """Pressure of the formation above that of the well, Pa."""

    def fluid_of(self, fluid: Fluid) -> Fluid:
        """The fluid with the drawdown for its overbalance."""
        return fluid.model_copy(update={"overbalance_MPa": self.drawdown_MPa})

    def run_of(self, run: Run) -> Run:
        """The control of the invasion with the length of the clean-up."""
        own = dict.fromkeys(("cap_ms", "plug_time_ms", "checkpoint_ms"))
        return run.model_copy(update=own | {"duration_ms": self.duration_ms})

    duration_s: ClassVar = InSI[float | None]("duration_ms", 1e-3)
    """Length of the clean-up, s; None: until the stop rule holds."""
    quiet_s: ClassVar = InSI[float | None]("quiet_ms", 1e-3)
    """Time without a fine that comes out which ends the clean-up, s, if given."""
    cap_s: ClassVar = InSI[float | None]("cap_ms", 1e-3)
    """Time at which the clean-up ends at the latest, s, if given."""


class InvasionChoices(Part):
    """[invasion], how the mud is let in: as spheres, or as size classes on the pore network.

    With "network" these are all solids of the mud, also those below `fines.cut_um`.
    """

    method: Literal["liggghts", "network", "both"] = "liggghts"
    """"liggghts": every fine is a sphere. "network": the fast model, whose solids are
    concentrations of size classes; `fdnet run --fast` asks for it. "both": spheres above
    `fines.cut_um`, and what is finer as classes in the same flow."""
    classes: Annotated[int, Field(ge=1, le=40)] = 8
    """Size classes, equal over the logarithm of the diameter."""
    sticking: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Share of the contacts of fines with grains that stick; 0 leaves attachment out."""
    release_stress_Pa: Positive | None = None
    """Wall stress of a throat above which the flow lifts what is held in throats and sticks to
    grains. When absent: what is held stays."""
    release_time_s: Positive | None = None
    """Time in which it lifts all but 1/e, with `invasion.release_stress`."""


class MudCake(Part):
    """[cake], the measured cake of the mud, for invasion.method = "network" or "both".

    Clay and colloids make a mud's cake some million times tighter than its coarse solids do alone.
    """

    permeability_m2: Annotated[float, Field(gt=0, le=1e-9)] | None = None
    """Permeability of the cake. When absent, without a filtrate too: that of Carman and Kozeny for
    the classes in it."""
    api_filtrate_mL: Positive | None = None
    """Filtrate of the API's press instead: 30 minutes at 690 kPa through 45.8 cm2."""

    api_filtrate_m3: ClassVar = InSI[float | None]("api_filtrate_mL", 1e-6)
    """Filtrate of the API's press, m3, if given."""


def _count_or_edges(value: Any) -> str:
    """A case file gives a count; only Python gives edges, as a tuple."""
    return "[edges]" if isinstance(value, tuple) else "[count]"


Function = TypeVar("Function", bound=Callable[..., Any])
Count = Annotated[int, Field(ge=1, le=MOST_SECTIONS), Tag("[count]")]
Edges = Annotated[tuple[Finite, ...], Tag("[edges]")]
Sections = Annotated[Count | Edges, Discriminator(_count_or_edges)]


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
    """[analysis], how permeability is computed.

    The default laws are fdnet's most accurate pair.
    """

    sections: Sections = 8
    """Number of equal slabs along the flow in `sections.csv`. In Python also the edges (S+1,) of
    the slabs, m."""
    law: LawName = DEFAULT_LAW
    """Conductance of a clean throat."""
    damage_law: DamageLawName = Field(
        AUTO,
        description='How fines lower the permeability: "all-spheres", the network of grains and '
        "fines together, or a law that damages the throats between grains. "
        f'"auto" takes "all-spheres" up to {MOST_SPHERES:,} spheres and "section-archie" above.',
    )
    clogging_threshold: Fraction | None = None
    """Throat porosity below which the thesis's damage laws take a throat as clogged. When absent:
    0.40 ("thesis") or 0.36 ("thesis-code")."""
    middle_band: Literal["threshold", "position"] = "threshold"
    """Rule of the thesis's damage laws for a throat porosity of 0.36 to 0.80: by
    `clogging_threshold` alone, or by where the fines lie in the throat."""
    throat_overlap: Literal["exact", "two-plane"] = "exact"
    """Volume of a fine inside a throat: exact, or by the thesis's two planes."""
    profile_bin_mm: Positive | None = 0.25
    """Width of the depth bins in `profile.csv`. In Python also None, the mean radius of the
    grains."""
    walls: WallName = "no-slip"
    """Whether side walls hold the fluid or let it slip; known to "lubrication", "section-archie"
    and "all-spheres"."""

    @field_validator("law", "damage_law", mode="before")
    @classmethod
    def _is_there(cls, name: Any) -> Any:
        return still_there(name, REMOVED_LAWS)

    def refusals(self) -> Iterator[str]:
        """Why laws do not go together, one sentence each."""
        if self.damage_law == ALL_SPHERES and self.law != DEFAULT_LAW:
            yield (
                f"analysis.damage_law: {self.damage_law!r} needs a network of all spheres, whose "
                f"law is {DEFAULT_LAW!r}, analysis.law is {self.law!r}; take analysis.law = "
                f"{DEFAULT_LAW!r}, or another damage law"
            )

    profile_bin_m: ClassVar = InSI[float | None]("profile_bin_mm", 1e-3)
    """Width of the depth bins, m; None stands for the mean radius of the grains."""

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


def with_visible_choices(function: Function) -> Function:
    """The function, whose `**choices: Unpack[AnalysisKeys]` is shown as the single keywords.

    Their defaults are shown as they are without `options`.
    """
    shown = inspect.signature(function)
    usual, kinds = AnalysisChoices.of_pack(), AnalysisKeys.__annotations__
    plain = [one for one in shown.parameters.values() if one.kind is not one.VAR_KEYWORD]
    single = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=getattr(usual, name), annotation=kind
        )
        for name, kind in kinds.items()
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
    what = (
        item["msg"].replace("Input should be", "should be").replace("should be a valid", "is no")
    )
    return f"analysis.{key}: {item['input']!r} {what}"
