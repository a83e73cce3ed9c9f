"""The whole case, what must hold between its keys, and what differs between two.

A case says what the specimen is. It is validated when it is made and never changes. It holds no
paths and no binary: `fdnet.case.file` reads one from TOML, `Case.toml()` writes it back with every
default. Its tables are in the modules next to this one.
"""

import hashlib
import json
import math
import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Annotated, Any, Self

import tomli_w
from pydantic import Field, model_validator

from fdnet.case.spheres import Fines, Grains, Spheres
from fdnet.case.tables import (
    DEEPEST_DAMPING,
    LEAST_SKIN,
    MAX_CONCENTRATION,
    MODEL_KEYS,
    MOST_BINS,
    MOST_FINES,
    MOST_GRAINS,
    MOST_NEIGHBOUR_BINS,
    MOST_SLAB,
    OF_THE_UNIFORM,
    AnalysisChoices,
    Bonds,
    Box,
    CleanUp,
    ContactLaw,
    Drag,
    Fluid,
    Gravity,
    InvasionChoices,
    MudCake,
    Part,
    Run,
    Well,
)
from fdnet.errors import CaseError
from fdnet.names import LIGGGHTS_STAGES, STAGES, Stage

POLICIES = ("max_hours", "max_overlap", "on_overlap")
"""Keys of [run] that decide whether a run may go on, not what it computes."""
KEYS = (
    "name",
    "seed",
    "box",
    "grains",
    "fines",
    "fluid",
    "well",
    "drag",
    "gravity",
    "contact",
    "invasion",
    "cake",
    "clean_up",
    "bonds",
    "run",
    "analysis",
    "given",
)
"""Keys at the top of a case file, in the order in which they are written."""


class Case(Part):
    """A pack of grains. Without fines it stays intact: it is made and analysed, not invaded.

    The keys carry the unit of the user, as in a case file: `radius_mm`, `viscosity_cP`. Properties
    such as `size_m` give the same in SI.

    Make one with `fdnet.read_case` from a file, or with `fdnet.case_from` from nested tables: both
    take a table of fines, and both raise CaseError that lists every problem. This class itself has
    no key `fines` (see `InvasionCase`) and raises the error of pydantic.

    Examples:
        >>> import fdnet
        >>> case = fdnet.read_case("cases/quick.toml")
        >>> isinstance(case, fdnet.Case), case.name
        (True, 'quick')
        >>> case.digest() == fdnet.read_case("cases/quick.toml").digest()
        True
    """

    name: Annotated[str, Field(min_length=1, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
    """Name of the case: letters, digits, dot, underscore and hyphen. It also names the run folder.
    """
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 1
    """Seed of all random numbers. The same case and seed give the same result."""
    box: Box
    grains: Grains
    fluid: Fluid = Fluid()
    well: Well | None = None
    drag: Drag = Drag()
    gravity: Gravity = Gravity()
    contact: ContactLaw = ContactLaw()
    bonds: Bonds | None = None
    run: Run = Run()
    analysis: AnalysisChoices = AnalysisChoices()
    given: dict[str, str] = Field({})
    """Written by fdnet: what the case gave with units or as a file, by dotted key. The other keys
    hold the same as numbers, and only they count."""

    @model_validator(mode="after")
    def _tables_fit(self) -> Self:
        problems = list(cross_problems(dict(self)))
        if problems:
            raise ValueError("; ".join(problems))
        return self

    @property
    def spheres(self) -> dict[str, Spheres]:
        """The kinds of sphere by the name of their material in a deck."""
        return {"grain": self.grains}

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages that a run of this case consists of."""
        return tuple(stage for stage in STAGES if stage not in ("invade", "clean_up"))

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Side lengths of the box (x, y, z), m."""
        return self.box.size_m

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Which directions are periodic; the flow direction never is."""
        return self.box.periodic

    @property
    def wall_friction(self) -> float:
        """Friction of the side walls: the one given, or that of the grains."""
        given = self.box.wall_friction
        return self.grains.friction if given is None else given

    def data(self) -> dict[str, Any]:
        """All keys that have a value, defaults written out (TOML knows no null).

        Keys that only the other contact model reads are left out.
        """
        data = self.model_dump(mode="json")
        if not self.given:
            del data["given"]
        for name in ("grains", "fines"):
            for key in self.contact.other_keys & data.get(name, {}).keys():
                del data[name][key]
        return _without_none({key: data[key] for key in KEYS if key in data})

    def toml(self) -> str:
        """The case as TOML, with every default."""
        return tomli_w.dumps(self.data())

    def digest(self, stage: str = "analyse") -> str:
        """Hash of what `stage` depends on.

        "pack" ignores fluid, run and analysis, and of the fines all but what decides the ratio of
        stiffnesses. "invade" ignores the analysis and the clean-up, "clean_up" the analysis, but
        for side walls that let a fluid slip which is made with them (`walls_of_the_fluid`). No
        result depends on `POLICIES` or on the bonds, which mechanics alone reads, so no digest
        does. One stiffness for packing and invasion counts once.
        """
        data = self.data()
        data.pop("given", None)
        data.pop("bonds", None)
        data["run"] = {key: value for key, value in data["run"].items() if key not in POLICIES}
        packing = data["grains"]["packing_stiffness_N_m"]
        if stage != "pack" and packing == self.run.stiffness_N_m:
            data["grains"].pop("packing_stiffness_N_m")
        if stage in LIGGGHTS_STAGES:
            data |= walls_of_the_fluid(stage, data)
            data.pop("analysis")
            data.pop("name")
        if stage == "invade":
            data.pop("clean_up", None)
        if stage == "pack":
            data["grains"].pop("motion")
            fines = data.get("fines", {}).get("normal_stiffness_N_m")
            stiffness = data["grains"].pop("packing_stiffness_N_m")
            scaling = {"stiffness": stiffness, "fines_stiffness": fines}
            elastic = self._elastic_of_the_pack(data)
            data = {key: data[key] for key in ("seed", "box", "grains")} | scaling | elastic
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]

    def _elastic_of_the_pack(self, data: dict[str, Any]) -> dict[str, Any]:
        """What the stiffness of a pack depends on besides, with contacts that are not linear."""
        if self.contact.model == "hooke":
            return {}
        fines, keys = self.spheres.get("fine"), sorted(MODEL_KEYS["hertz"])
        size = {"mean_radius_m": fines.mean_radius_m} if fines else {}
        given = {key: data["fines"][key] for key in keys} if fines else {}
        return {"model": self.contact.model, "fines": size | given}

    def same_specimen(self, text: bytes) -> bool:
        """Whether a case.toml as `toml` wrote it is this case but for `POLICIES`."""
        try:
            data = tomllib.loads(text.decode())
            return case_type(data).model_validate(data).digest() == self.digest()
        except ValueError:
            return False


class InvasionCase(Case):
    """A pack of grains and the fines that invade it: a `Case` with the table `fines`.

    The keys of the fines carry the unit of the user too: `fines.radius_mm` is in mm. Make one with
    `fdnet.read_case` or `fdnet.case_from`.

    Examples:
        >>> import fdnet
        >>> case = fdnet.read_case("cases/quick.toml", assignments=["fines.concentration=0.05"])
        >>> isinstance(case, fdnet.InvasionCase), case.fines.concentration
        (True, 0.05)
    """

    fines: Fines
    invasion: InvasionChoices | None = None
    cake: MudCake | None = None
    clean_up: CleanUp | None = None

    @property
    def by_classes(self) -> bool:
        """Whether the pore network carries the mud, as size classes."""
        return self.invasion is not None and self.invasion.method == "network"

    @property
    def with_classes(self) -> bool:
        """Whether it carries what is finer than the cut, beside the spheres."""
        return self.invasion is not None and self.invasion.method == "both"

    @property
    def solids_fraction(self) -> float:
        """Volume of the solids that invade, as spheres and classes, over that of the mud."""
        fines = self.fines
        return fines.volume_fraction if self.with_classes else fines.placed_fraction

    @property
    def spheres(self) -> dict[str, Spheres]:
        """The kinds of sphere by the name of their material in a deck."""
        return {"grain": self.grains, "fine": self.fines}

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages that a run of this case consists of."""
        return tuple(stage for stage in STAGES if stage != "clean_up" or self.clean_up)


def walls_of_the_fluid(stage: str, data: Mapping[str, Any]) -> dict[str, str]:
    """The key of the analysis that the fluid of `stage` depends on, if it does.

    The network of `drag.field` = "network" is made with `analysis.walls`.

    Args:
        stage: "pack", "invade" or "clean_up".
        data: the tables of a case.
    """
    network = stage != "pack" and data["drag"]["field"] == "network"
    named = network and data["box"]["sides"] == "walls"
    return {"walls": data["analysis"]["walls"]} if named else {}


def case_type(data: Mapping[str, Any]) -> type[Case]:
    """The class that nested tables describe: a table of fines makes an invasion."""
    return InvasionCase if "fines" in data else Case


def with_fines(case: Case) -> InvasionCase:
    """The same case, known to have fines. Raises CaseError when it has none."""
    if not isinstance(case, InvasionCase):
        raise CaseError(
            f"case {case.name}: has no table [fines], but an invasion needs one; add it"
        )
    return case


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list):
        return [_without_none(item) for item in value]
    return value


# ------------------------------------------------------------------------------------------------
# Which keys of two cases differ, in words.


MOST_NAMED = 4
"""Most differing keys that a message names."""


def differences(asked: Case, kept: Mapping[str, Any]) -> list[str]:
    """The dotted keys in which a case differs from the tables of another, with both values.

    Keys that decide only whether a run may go on are left out, and what was given in words.
    """
    mine, other = dict(_flat(asked.data())), dict(_flat(kept))
    return [
        f"{key} = {_shown(other, key)} there, {_shown(mine, key)} here"
        for key in sorted(mine.keys() | other.keys())
        if mine.get(key) != other.get(key)
        and not key.startswith("given.")
        and key not in [f"run.{policy}" for policy in POLICIES]
    ]


def difference_text(asked: Case, kept: Mapping[str, Any]) -> str:
    """`differences` as the part of a message; empty where nothing differs."""
    named = differences(asked, kept)
    if not named:
        return ""
    more = f", and {len(named) - MOST_NAMED} more keys" if len(named) > MOST_NAMED else ""
    return "; ".join(named[:MOST_NAMED]) + more


def _flat(tables: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tables.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def _shown(flat: Mapping[str, Any], key: str) -> str:
    return str(flat[key])[:40] if key in flat else "absent"


# ------------------------------------------------------------------------------------------------
# What must hold between the keys of a case.


WIDEST_THROAT = math.sqrt(2) - 1
"""Radius of the widest throat between touching grains over their radius: four in a square."""
_OF_MODELS = sorted(MODEL_KEYS["hooke"] | MODEL_KEYS["hertz"] | {"damping_ratio"})


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


def cross_problems(tables: Mapping[str, Any], bad: Collection[str] = ()) -> Iterator[str]:
    """What is wrong between the keys of a case, in the order in which it is reported.

    A rule is passed over where one of its tables is absent or None, or one of its keys is among
    `bad`: keys whose own value was refused, so that nothing can be said about them.
    """
    at: Callable[[str], Any] = tables.get
    box, grains, fines, bonds = at("box"), at("grains"), at("fines"), at("bonds")
    fluid, well, drag, contact = at("fluid"), at("well"), at("drag"), at("contact")
    run, clean_up, analysis = at("run"), at("clean_up"), at("analysis")
    invasion, cake = at("invasion"), at("cake")
    unsized = set(bad)
    if grains is None or not grains.has_one_curve:
        unsized.add("grains.radius_mm")
    if fines is None or not fines.has_one_curve:
        unsized.add("fines.radius_mm")
    if fines is None or not fines.has_one_concentration:
        unsized.add("fines.concentration")

    def given(*keys: str) -> bool:
        there = all(tables.get(key.split(".")[0]) is not None for key in keys)
        return there and not set(keys) & set(bad)

    def good(*keys: str) -> bool:
        return given(*keys) and not set(keys) & unsized

    # the sizes of grains and fines, their number, and the solids in the mud

    if given("grains.radius_mm", "grains.sizes"):
        yield from _one_curve("grains", ("radius_mm", "sizes"), grains)
    if given("fines.radius_mm", "fines.sizes", "fines.materials"):
        yield from _one_curve("fines", ("radius_mm", "sizes", "materials"), fines)
    if (
        given("fines.radius_mm", "fines.cut_um")
        and fines.cut_um is not None
        and not fines.measured
        and fines.has_one_curve
    ):
        yield (
            f"fines.cut_um: {fines.cut_um:g} cuts measured sizes, but the case gives "
            "fines.radius_mm; leave it out or give fines.sizes"
        )
    # The solids are given once, and are no more than fit.
    if given(
        "fines.concentration", "fines.solids_kg_m3", "fines.materials", "fines.density_kg_m3"
    ):
        if not fines.has_one_concentration:
            yield (
                f"fines.solids_kg_m3: {fines.solids_kg_m3} with fines.concentration: "
                f"{fines.concentration}, give exactly one of the two"
            )
        elif fines.solids_kg_m3 is not None and fines.volume_fraction > MAX_CONCENTRATION:
            most = MAX_CONCENTRATION * fines.solids_density_kg_m3
            yield (
                f"fines.solids_kg_m3: {fines.solids_kg_m3:g} of solids of "
                f"{fines.solids_density_kg_m3:.4g} kg/m3 is {100 * fines.volume_fraction:.3g} % "
                f"by volume; expected at most {most:.3g} ({100 * MAX_CONCENTRATION:.0f} %: more "
                "do not fit at random places)"
            )
    if given("fines.materials", "fines.friction"):
        for number, one in enumerate(fines.materials or ()):
            if one.friction is not None and one.friction != fines.friction:
                yield (
                    f"fines.materials.{number}.friction: {one.friction:g} of {one.name!r}, but "
                    f"all fines are of one contact material with fines.friction "
                    f"{fines.friction:g}; set fines.friction for all"
                )
    if given("fines.materials"):
        names = [one.name for one in fines.materials or ()]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            yield f"fines.materials: {twice[0]!r} is listed twice, give each material once"
    if good("grains.radius_mm"):
        yield from _rising("grains", grains)
    if good("fines.radius_mm"):
        yield from _rising("fines", fines)
    if (
        good("grains.porosity", "grains.count")
        and grains.porosity is None
        and grains.count is None
    ):
        yield "grains.porosity: missing, give it (0 to 1) or grains.count"
    if good("fines.count", "fines.slab_mm") and fines.count and fines.slab_mm:
        yield (
            f"fines.count: {fines.count} with fines.slab_mm: {fines.slab_mm}, give one of the two,"
            " or none for mud that comes until the stop rule"
        )
    if good("fines.count", "fines.slab_mm") and fines.endless and fines.supply == "slab":
        yield (
            "fines.supply: 'slab' puts all fines in at the start, but nothing says how many; give "
            "fines.count or fines.slab_mm, or take 'batches'"
        )
    # Their number is bounded by memory, their plain sum of volumes by the box.
    if good("box.size_mm", "grains.radius_mm", "grains.porosity", "grains.count"):
        volume, grain = math.prod(box.size_mm), grains.mean_volume_m3 * 1e9
        solid = 1 - grains.porosity if grains.porosity is not None else 0.0
        expected = grains.count or solid * volume / grain
        if expected > MOST_GRAINS:
            yield (
                f"box.size_mm: {list(box.size_mm)} holds {expected:.3g} grains; expected at most "
                f"{MOST_GRAINS:.0e}"
            )
        if grains.count is not None and grains.count * grains.mean_volume_m3 * 1e9 >= volume:
            yield (
                f"grains.count: {grains.count} spheres sum to more than the box; expected at most "
                f"{int(volume / grain)}"
            )
    # A grain fits, and does not meet its own image across a periodic side.
    if good("box.size_mm", "box.sides", "grains.radius_mm"):
        diameter = 2e3 * grains.radius_range_m[1]
        for axis, side in zip("xyz", box.size_mm, strict=True):
            imaged = box.sides == "periodic" and axis != "x"
            least = diameter * (2.0 if imaged else 1.0)
            if side < least:
                why = (
                    "the largest grain would meet its own image"
                    if imaged
                    else "a grain does not fit"
                )
                why += "; grains.sizes.cut_percent leaves the largest out" * grains.measured
                yield (
                    f"box.size_mm: side {axis} is {side:g} mm, expected at least {least:g} mm "
                    f"({why})"
                )
    # The slab must hold its fines and stay a slab; their number is bounded by memory.
    if good(
        *("box.size_mm", "fines.radius_mm", "fines.count", "fines.slab_mm"),
        *("fines.concentration", "fines.solids_kg_m3"),
    ):
        area = box.size_mm[1] * box.size_mm[2]
        volume, fraction = fines.mean_volume_m3 * 1e9, fines.placed_fraction
        count = fines.count or fraction * area * (fines.slab_mm or 0.0) / volume
        length = fines.slab_mm or count * volume / (fraction * area)
        if count > MOST_FINES:
            yield (
                f"fines.count: {count:.3g} fines, expected at most {MOST_FINES:.0e}; shorten the "
                + ("slab or raise fines.cut_um" if fines.measured else "slab")
            )
        if length > MOST_SLAB * box.size_mm[0]:
            yield (
                f"{concentration_text(fines)} makes a slab of {length:.3g} mm, "
                f"expected at most {MOST_SLAB} box lengths; raise it or supply fewer fines"
            )
    if (
        good("grains.radius_mm", "fines.radius_mm")
        and fines.radius_range_m[1] >= grains.radius_range_m[0]
        and not list(_some_throat(grains, fines))
    ):
        yield (
            f"{size_text('fines', fines)}, expected below {size_text('grains', grains)}: "
            "solids as large as the grains only lie in the cake"
            + ("; leave them out by fines.sizes.cut_percent" if fines.measured else "")
        )
    if good("grains.radius_mm", "fines.radius_mm"):
        yield from _some_throat(grains, fines)
    # The skin lies between a hundredth of a fine and a grain.
    if good("run.skin_mm", "grains.radius_mm", "fines.radius_mm"):
        low, high = LEAST_SKIN * 1e3 * fines.radius_range_m[0], 1e3 * grains.radius_range_m[1]
        if run.skin_mm is not None and not low <= run.skin_mm <= high:
            yield (
                f"run.skin_mm: {run.skin_mm:g} mm, expected {low:.3g} ({LEAST_SKIN:g} of the "
                "smallest fine's radius: else neighbours are searched anew nearly every step) to "
                f"{high:.3g} (a grain's radius)"
            )
    # The bins of an invasion's neighbour search lie between memory's limit and the box.
    if good("run.neighbour_bin_mm", "box.size_mm", "fines"):
        least, most = (math.prod(box.size_mm) / MOST_NEIGHBOUR_BINS) ** (1 / 3), min(box.size_mm)
        if run.neighbour_bin_mm is not None and not least <= run.neighbour_bin_mm <= most:
            yield (
                f"run.neighbour_bin_mm: {run.neighbour_bin_mm:g} mm, expected {least:.3g} "
                f"({MOST_NEIGHBOUR_BINS:.0e} bins in the box) to {most:.3g} (its shortest side)"
            )

    # how fast the fluid moves, and how it is turned back

    # A well gives the velocity, so nothing else may.
    if good("well", "fluid.velocity_m_s", "fluid.darcy_length_mm"):
        drives = [
            f"fluid.{name} = {value:g}"
            for name in ("velocity_m_s", "darcy_length_mm")
            if (value := getattr(fluid, name)) is not None
        ]
        if drives:
            yield (
                f"well: the table [well] with {' and '.join(drives)}: each gives the velocity of "
                "the fluid; keep one of them"
            )
    if (
        good("well.radius_mm", "well.drainage_radius_m")
        and well.drainage_radius_m <= well.radius_m
    ):
        yield (
            f"well.drainage_radius_m: {well.drainage_radius_m:g} m is not above the radius of the "
            f"well, well.radius_mm = {well.radius_mm:g} ({well.radius_m:g} m)"
        )
    if (
        good("drag.drive_velocity_m_s", "contact.cohesion_J_m3")
        and drag.drive_velocity_m_s not in ("auto", "fluid")
        and contact.cohesion_J_m3 is not None
    ):
        yield (
            f"drag.drive_velocity_m_s: {drag.drive_velocity_m_s} with contact.cohesion_J_m3: the "
            "forces of the fluid are scaled, cohesion is not, so their ratio would be wrong; "
            "leave out one of the two"
        )
    if good("clean_up.drawdown_MPa", "fluid.velocity_m_s") and fluid.velocity_m_s is not None:
        yield (
            f"clean_up.drawdown_MPa: {clean_up.drawdown_MPa:g} with fluid.velocity_m_s "
            f"{fluid.velocity_m_s:g}: nothing says on which way the drawdown is lost; give "
            "fluid.overbalance_MPa with the table [well] or with fluid.darcy_length_mm instead of "
            "the velocity"
        )
    if good("clean_up.duration_ms", "clean_up.cap_ms", "clean_up.quiet_ms"):
        for name in ("cap_ms", "quiet_ms") if clean_up.duration_ms is not None else ():
            if (value := getattr(clean_up, name)) is not None:
                yield (
                    f"clean_up.{name}: {value:g} together with clean_up.duration_ms "
                    f"{clean_up.duration_ms:g}: give one of the two"
                )

    # the mud as size classes on the network

    by_classes = given("invasion.method") and invasion.method != "liggghts"
    if given("cake.permeability_m2", "cake.api_filtrate_mL"):
        given_twice = cake.permeability_m2 is not None and cake.api_filtrate_mL is not None
        if given_twice:
            yield (
                f"cake.permeability_m2: {cake.permeability_m2:g} with cake.api_filtrate_mL "
                f"{cake.api_filtrate_mL:g}: each gives the cake, keep one of them"
            )
        if not by_classes:
            yield (
                "cake: the table belongs to invasion.method = 'network' or 'both'; with spheres "
                "alone the cake is that of the fines that LIGGGHTS moves; leave it out"
            )
    if good("invasion.release_stress_Pa", "invasion.release_time_s"):
        stress, time = invasion.release_stress_Pa, invasion.release_time_s
        if (stress is None) != (time is None):
            lacking = "release_time_s" if time is None else "release_stress_Pa"
            yield (
                f"invasion.{lacking}: is missing, expected with the other key of the release; "
                "give both, or none"
            )
    if by_classes and given("clean_up.drawdown_MPa"):
        yield (
            f"clean_up: with invasion.method = {invasion.method!r} nothing turns the flow back; "
            "leave the table out, or take 'liggghts'"
        )
    if by_classes and good("grains.motion") and grains.motion == "mobile":
        yield (
            f"grains.motion: 'mobile' with invasion.method = {invasion.method!r}, whose pores are "
            "those of grains that stay; take 'fixed'"
        )
    if by_classes and good("drag.field") and invasion.method == "both" and not drag.coupled:
        yield (
            f"drag.field: {drag.field!r} with invasion.method = 'both', whose spheres and classes "
            "share one flow; leave it out, or take 'network'"
        )

    # the forces of the fluid

    # The network has one way for each of these; it alone knows the drive and the updates.
    if good("drag.field", *(f"drag.{key}" for key in OF_THE_UNIFORM)) and drag.coupled:
        for key in OF_THE_UNIFORM:
            value, only = getattr(drag, key), Drag.model_fields[key].default
            if value != only:
                yield (
                    f"drag.{key}: {value!r} belongs to drag.field 'uniform'; leave it out, or set "
                    "drag.field = 'uniform'"
                )
    for key in ("drive", "update_travel"):
        given_one = good("drag.field", f"drag.{key}") and getattr(drag, key) is not None
        if given_one and not drag.coupled:
            yield (
                f"drag.{key}: {getattr(drag, key)!r} belongs to drag.field 'network'; the uniform "
                "field always has its first velocity; leave it out"
            )
    if good("drag.field", "grains.motion") and drag.coupled and grains.motion == "mobile":
        yield (
            "grains.motion: 'mobile' with drag.field 'network', whose pores are those of grains "
            "that stay; take 'fixed', or set drag.field = 'uniform'"
        )
    if (
        good("run.stop_rate", "drag.field", "drag.drive")
        and run.stop_rate is not None
        and not drag.slowed
    ):
        yield (
            f"run.stop_rate: {run.stop_rate:g} needs a rate that falls; leave it out, or set "
            "drag.field = 'network' with drag.drive = 'pressure'"
        )
    # The uniform field keeps no account of the volume: it is the rate times the time.
    if (
        good("run.stop_pore_volumes", "drag.field")
        and run.stop_pore_volumes is not None
        and drag.field != "network"
    ):
        yield (
            f"run.stop_pore_volumes: {run.stop_pore_volumes:g} needs drag.field = 'network', but "
            f"it is {drag.field!r}; set run.duration_ms, since the uniform field keeps its rate"
        )
    if (
        good("drag.scheme", "drag.refresh_steps")
        and not drag.coupled
        and drag.scheme != "held"
        and drag.refresh_steps not in (None, 1)
    ):
        yield (
            f"drag.refresh_steps: {drag.refresh_steps} belongs to drag.scheme 'held', not "
            f"{drag.scheme!r}"
        )
    if (
        good("drag.scheme", "fines.radius_mm")
        and not drag.coupled
        and drag.scheme == "viscous"
        and not fines.one_size
    ):
        yield (
            f"drag.scheme: 'viscous' needs fines of one size, {size_text('fines', fines)} "
            "(LIGGGHTS's viscous force is one number a material); take 'held' or 'implicit'"
        )
    if (
        good("drag.scheme", "drag.upstream")
        and drag.scheme == "implicit"
        and drag.upstream == "darcy"
        and not drag.coupled
    ):
        yield (
            "drag.upstream: 'darcy' changes the fluid's velocity at x = 0, drag.scheme "
            "'implicit' keeps one a fine; take 'interstitial', or another drag.scheme"
        )
    if (
        good("drag.scheme", "drag.inertia")
        and not drag.coupled
        and drag.inertia != "none"
        and drag.scheme in ("viscous", "implicit")
    ):
        yield (
            f"drag.inertia: {drag.inertia!r} makes the drag coefficient depend on the slip, "
            f"drag.scheme {drag.scheme!r} keeps one a fine; take 'held'"
        )

    # contacts, the end of a run, and the analysis

    if good("contact.model", *(f"grains.{key}" for key in _OF_MODELS)):
        yield from _of_the_model("grains", contact, grains)
    if good("contact.model", *(f"fines.{key}" for key in _OF_MODELS)):
        yield from _of_the_model("fines", contact, fines)
    if (
        good("contact.model", "contact.cohesion_J_m3")
        and contact.cohesion_J_m3 is not None
        and contact.model == "hooke"
    ):
        yield (
            f"contact.cohesion_J_m3: {contact.cohesion_J_m3:g} with contact.model 'hooke': the "
            "attraction of LIGGGHTS's SJKR grows with the overlap as a linear spring does, so it "
            "would only soften the contact and never pull; take contact.model = 'hertz'"
        )
    if good("contact.rolling_friction", "grains.friction", "fines.friction"):
        least = min(grains.friction, fines.friction)
        if contact.rolling_friction is not None and least == 0:
            yield (
                f"contact.rolling_friction: {contact.rolling_friction:g} without friction "
                "(grains.friction or fines.friction is 0): spheres that slide do not roll; give "
                "both a friction, or leave contact.rolling_friction out"
            )
    if good("bonds.tensile_strength_MPa", "bonds.shear_strength_MPa") and (
        bonds.tensile_strength_MPa is None
    ) != (bonds.shear_strength_MPa is None):
        absent = "tensile" if bonds.tensile_strength_MPa is None else "shear"
        yield (
            f"bonds.{absent}_strength_MPa: missing next to the other strength; give both, or "
            "neither for bonds that never break"
        )
    if (
        good("run.duration_ms", "run.cap_ms")
        and run.duration_ms is not None
        and run.cap_ms is not None
    ):
        yield (
            f"run.cap_ms: {run.cap_ms} together with run.duration_ms {run.duration_ms}: "
            "give one of the two"
        )
    if good("analysis.sections") and isinstance(analysis.sections, tuple):
        yield f"analysis.sections: {analysis.sections}: a case gives the number of sections"
    if good("analysis.law", "analysis.damage_law"):
        yield from analysis.refusals()
    if good("box.size_mm", "analysis.profile_bin_mm"):
        thickness = analysis.profile_bin_mm
        if thickness is None:
            yield "analysis.profile_bin_mm: missing, a case gives the thickness of its bins"
        elif box.size_mm[0] / thickness > MOST_BINS:
            yield (
                f"analysis.profile_bin_mm: {thickness:g} cuts {box.size_mm[0]:g} mm into more "
                f"than {MOST_BINS} bins; expected at least {box.size_mm[0] / MOST_BINS:.3g}"
            )


def _one_curve(name: str, keys: tuple[str, ...], spheres: Spheres) -> Iterator[str]:
    given = [key for key in keys if getattr(spheres, key) is not None]
    choice = f"give exactly one of {', '.join(keys[:-1])} and {keys[-1]}"
    if not given:
        yield f"{name}.radius_mm: missing, {choice}"
    elif len(given) > 1:
        yield f"{name}.{given[1]}: given beside {name}.{given[0]}, {choice}"


def _rising(name: str, spheres: Spheres) -> Iterator[str]:
    pair = spheres.radius_mm
    if isinstance(pair, tuple) and pair[0] >= pair[1]:
        yield f"{name}.radius_mm: {list(pair)} must rise, [smallest, largest]"


def _some_throat(grains: Grains, fines: Fines) -> Iterator[str]:
    """Measured fines of which none fits through any throat between touching grains."""
    largest, smallest = 2 * grains.radius_range_m[1], 2 * fines.radius_range_m[0]
    widest = WIDEST_THROAT * largest
    if fines.measured and smallest > widest:
        yield (
            f"fines.sizes: the smallest fine has {1e3 * smallest:.3g} mm, above every throat "
            f"between touching grains of up to {1e3 * largest:.3g} mm (at most "
            f"{1e3 * widest:.3g} mm): nothing could invade; check the units of both curves"
        )


def _of_the_model(name: str, contact: ContactLaw, spheres: Spheres) -> Iterator[str]:
    """The contact model takes what the table `name` ("grains", "fines") gives."""
    unread = sorted(contact.other_keys & spheres.model_fields_set)
    if unread:
        yield (
            f"{', '.join(f'{name}.{key}' for key in unread)}: not read by contact.model "
            f"{contact.model!r}; leave out, or choose the other contact.model"
        )
    if contact.model == "hertz" and spheres.damping_ratio > DEEPEST_DAMPING:
        yield (
            f"{name}.damping_ratio: {spheres.damping_ratio:g} with contact.model 'hertz', "
            f"expected at most {DEEPEST_DAMPING:g} (LIGGGHTS takes a restitution above 0.05)"
        )
