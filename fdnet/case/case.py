"""The whole case, what must hold between its keys, and what differs between two.

A case says what the specimen is. It is validated when it is made and never changes. It holds no
paths and no binary: `fdnet.case.file` reads one from TOML, `Case.toml()` writes it back with every
default. Its tables are in the modules next to this one.
"""

import hashlib
import json
import math
import tomllib
from collections.abc import Collection, Iterator, Mapping
from typing import Annotated, Any, Self

import tomli_w
from pydantic import Field, model_validator

from fdnet.case import tables
from fdnet.case.spheres import Fines, Grains, Spheres
from fdnet.errors import CaseError
from fdnet.names import LIGGGHTS_STAGES, STAGES, Stage

POLICIES = ("max_hours", "max_overlap")
"""Keys of [run] that decide whether a run may go on, not what it computes."""
KEYS = (
    *("name", "seed", "box", "grains", "fines", "fluid", "well", "drag", "gravity", "contact"),
    *("invasion", "cake", "clean_up", "bonds", "run", "analysis"),
)
"""Keys at the top of a case file, in the order in which they are written."""


def without_old_keys(data: dict[str, Any]) -> dict[str, Any]:
    """The tables of a recorded case without the keys, of no result, that only older runs have."""
    data.pop("given", None)  # texts for the same values
    data.get("run", {}).pop("on_overlap", None)
    return data


class Case(tables.Part):
    """A pack of grains. Without fines it stays intact: it is made and analysed, not invaded.

    The keys carry the unit of the user: `radius_mm`. Properties such as `size_m` give SI. Make one
    with `fdnet.read_case` or `fdnet.case_from`, which raise CaseError that lists every problem;
    this class has no key `fines` (see `InvasionCase`) and raises the error of pydantic.

    Examples:
        >>> import fdnet
        >>> case = fdnet.read_case("cases/quick.toml")
        >>> isinstance(case, fdnet.Case), case.name
        (True, 'quick')
        >>> case.digest() == fdnet.read_case("cases/quick.toml").digest()
        True
    """

    name: Annotated[str, Field(min_length=1, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
    """Name of case and run folder: letters, digits, dot, underscore and hyphen."""
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 1
    """Seed of all random numbers."""
    box: tables.Box
    grains: Grains
    fluid: tables.Fluid = tables.Fluid()
    well: tables.Well | None = None
    drag: tables.Drag = tables.Drag()
    gravity: tables.Gravity = tables.Gravity()
    contact: tables.ContactLaw = tables.ContactLaw()
    bonds: tables.Bonds | None = None
    run: tables.Run = tables.Run()
    analysis: tables.AnalysisChoices = tables.AnalysisChoices()

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
        x, y, z = self.box.size_mm
        return x * 1e-3, y * 1e-3, z * 1e-3

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Which directions are periodic; the flow direction never is."""
        sideways = self.box.sides == "periodic"
        return False, sideways, sideways

    @property
    def wall_friction(self) -> float:
        """Friction of the side walls: the one given, or that of the grains."""
        given = self.box.wall_friction
        return self.grains.friction if given is None else given

    def data(self) -> dict[str, Any]:
        """All keys that have a value, defaults written out (TOML knows no null).

        Keys that only the other contact model reads are left out.
        """
        data = self.model_dump(mode="json", exclude_none=True)
        for name in ("grains", "fines"):
            for key in self.contact.other_keys & data.get(name, {}).keys():
                del data[name][key]
        return {key: data[key] for key in KEYS if key in data}

    def toml(self) -> str:
        """The case as TOML, with every default."""
        return tomli_w.dumps(self.data())

    def digest(self, stage: str = "analyse") -> str:
        """Hash of what `stage` depends on.

        "pack" ignores fluid, run and analysis, and of the fines all but what decides the ratio of
        stiffnesses. "invade" ignores the analysis, but for side walls of a fluid that the network
        is made for, and the clean-up; "clean_up" the analysis. No result depends on `POLICIES` or
        on the bonds, which mechanics alone reads. One stiffness for both counts once.
        """
        data = self.data()
        data.pop("bonds", None)
        data["run"] = {key: value for key, value in data["run"].items() if key not in POLICIES}
        packing = data["grains"]["packing_stiffness_N_m"]
        if stage != "pack" and packing == self.run.stiffness_N_m:
            data["grains"].pop("packing_stiffness_N_m")
        if stage in LIGGGHTS_STAGES:
            walls = data.pop("analysis")["walls"]
            followed = stage != "pack" and self.drag.field == "network"
            data |= {"walls": walls} if followed and self.box.sides == "walls" else {}
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
        fines, keys = self.spheres.get("fine"), sorted(tables.MODEL_KEYS["hertz"])
        size = {"mean_radius_m": fines.mean_radius_m} if fines else {}
        given = {key: data["fines"][key] for key in keys} if fines else {}
        return {"model": self.contact.model, "fines": size | given}

    def same_specimen(self, text: bytes) -> bool:
        """Whether a case.toml as `toml` wrote it is this case but for `POLICIES`."""
        try:
            data = without_old_keys(tomllib.loads(text.decode()))
            return case_type(data).model_validate(data).digest() == self.digest()
        except ValueError:
            return False


class InvasionCase(Case):
    """A pack of grains and the fines that invade it: a `Case` with the table `fines`.

    Make one with `fdnet.read_case` or `fdnet.case_from`. Keys are in the unit of their name (mm,
    MPa, ms), the properties beside them in SI.

    Examples:
        >>> import fdnet
        >>> case = fdnet.read_case("cases/quick.toml", assignments=["fines.concentration=0.05"])
        >>> isinstance(case, fdnet.InvasionCase), case.fines.concentration
        (True, 0.05)
    """

    fines: Fines
    invasion: tables.InvasionChoices | None = None
    cake: tables.MudCake | None = None
    clean_up: tables.CleanUp | None = None

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


# ---- Which keys of two cases differ, in words.
MOST_NAMED = 4  # Most differing keys that a message names


def difference_text(asked: Case, kept: Mapping[str, Any]) -> str:
    """The dotted keys in which a case differs from the tables of another, with both values.

    Keys that decide only whether a run may go on are left out. Empty where nothing differs.
    """
    mine, other = dict(_flat(asked.data())), dict(_flat(kept))
    named = [
        f"{key} = {str(other.get(key, 'absent'))[:40]} there, "
        f"{str(mine.get(key, 'absent'))[:40]} here"
        for key in sorted(mine.keys() | other.keys())
        if mine.get(key) != other.get(key) and key.removeprefix("run.") not in POLICIES
    ]
    more = f"; and {len(named) - MOST_NAMED} more keys" if len(named) > MOST_NAMED else ""
    return "; ".join(named[:MOST_NAMED]) + more


def _flat(table: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


# ---- What must hold between the keys of a case.
WIDEST_THROAT = math.sqrt(2) - 1
"""Radius of the widest throat between touching grains over their radius: four in a square."""
EXCLUSIVE = {
    ("fines.cut_um", "fines.radius_mm"): "a cut is one of measured sizes; leave it out",
    ("fines.count", "fines.slab_mm"): "give one of the two, or none: then mud comes until the end",
    ("well.radius_mm", "fluid.velocity_m_s"): "each gives the velocity; keep one of them",
    ("well.radius_mm", "fluid.darcy_length_mm"): "each gives the velocity; keep one of them",
    ("clean_up.drawdown_MPa", "fluid.velocity_m_s"): "nothing says on which way the drawdown is "
    "lost; give fluid.overbalance_MPa with [well] or fluid.darcy_length_mm, not the velocity",
    ("cake.permeability_m2", "cake.api_filtrate_mL"): "each gives the cake; keep one of them",
    ("run.cap_ms", "run.duration_ms"): "give one of the two",
}
"""Two keys that exclude each other, and why."""
OF_THE_NETWORK = ("drag.drive", "drag.update_travel", "run.stop_rate", "run.stop_pore_volumes")
"""Keys of a flow that follows the deposit; the uniform field keeps its first velocity."""


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


class Known:
    """The tables of a case, and their keys about which something can be said.

    That is none whose own value was refused (`bad`), and no size or solids not given exactly once.
    """

    def __init__(self, given: Mapping[str, Any], bad: Collection[str]) -> None:
        self.tables, self.bad, self.unclear = given, set(bad), set(bad)
        for name in ("grains", "fines"):
            if self[name] is None or not self[name].has_one_curve:
                self.unclear.add(f"{name}.radius_mm")
        if self["fines"] is None or not self["fines"].has_one_concentration:
            self.unclear.add("fines.concentration")

    def __getitem__(self, name: str) -> Any:
        """A table, or None."""
        return self.tables.get(name)

    def given(self, *keys: str) -> bool:
        """Whether the tables of these dotted keys are there, and none of the keys was refused."""
        return not set(keys) & self.bad and all(self[key.split(".")[0]] for key in keys)

    def good(self, *keys: str) -> bool:
        """Whether something can be said about these dotted keys."""
        return self.given(*keys) and not set(keys) & self.unclear

    def value(self, key: str) -> Any:
        """Of a dotted key; None where it has none, or nothing can be said about it."""
        name, _, last = key.partition(".")
        return getattr(self[name], last) if self.good(key) else None


def cross_problems(given: Mapping[str, Any], bad: Collection[str] = ()) -> Iterator[str]:
    """What is wrong between the keys of a case, but for rules on its `bad` or absent keys."""
    known = Known(given, bad)
    yield from _of_the_spheres(known)
    for keys, why in EXCLUSIVE.items():
        first, second = map(known.value, keys)
        if first is not None and second is not None:
            yield f"{keys[0]}: {first} with {keys[1]}: {second}: {why}"
    yield from _of_the_amounts(known)
    yield from _of_the_invasion(known)
    yield from _of_the_forces(known)
    yield from _of_the_contacts(known)
    yield from _of_the_analysis(known)


def _of_the_spheres(known: Known) -> Iterator[str]:
    """Sizes and solids are given once, and fines are smaller than grains."""
    grains, fines = known["grains"], known["fines"]
    for name, keys in {
        "grains": ("radius_mm", "sizes"),
        "fines": ("radius_mm", "sizes", "materials"),
    }.items():
        if known.given(*(f"{name}.{key}" for key in keys)) and not known[name].has_one_curve:
            there = [f"{name}.{key}" for key in keys if getattr(known[name], key) is not None]
            what = (
                f"{there[1]}: given beside {there[0]}" if there else f"{name}.radius_mm: missing"
            )
            yield f"{what}, give exactly one of {', '.join(keys[:-1])} and {keys[-1]}"
        pair = known.value(f"{name}.radius_mm")
        if isinstance(pair, tuple) and pair[0] >= pair[1]:
            yield f"{name}.radius_mm: {list(pair)} must rise, [smallest, largest]"
    solids = ("concentration", "solids_kg_m3", "materials", "density_kg_m3")
    if known.given(*(f"fines.{key}" for key in solids)):
        if not fines.has_one_concentration:
            yield (
                f"fines.solids_kg_m3: {fines.solids_kg_m3} with fines.concentration: "
                f"{fines.concentration}, give exactly one of the two"
            )
        elif fines.volume_fraction > (most := tables.MAX_CONCENTRATION):
            yield (
                f"{concentration_text(fines)} is {100 * fines.volume_fraction:.3g} % of the mud's "
                f"volume, expected at most {100 * most:.0f} % "
                f"({most * fines.solids_density_kg_m3:.3g} kg/m3), because more do not fit at "
                "random places; a mass of solids goes to fines.solids, in kg/m3 or lb/bbl"
            )
    names = [one.name for one in known.value("fines.materials") or ()]
    for twice in {name for name in names if names.count(name) > 1}:
        yield f"fines.materials: {twice!r} is listed twice, give each material once"
    if not known.good("grains.radius_mm", "fines.radius_mm"):
        return
    largest, smallest = 2 * grains.radius_range_m[1], 2 * fines.radius_range_m[0]
    if fines.measured and smallest > WIDEST_THROAT * largest:
        yield (
            f"fines.sizes: the smallest fine has {1e3 * smallest:.3g} mm, above every throat "
            f"between touching grains of up to {1e3 * largest:.3g} mm (at most "
            f"{1e3 * WIDEST_THROAT * largest:.3g} mm): nothing could invade; check the units of "
            "both curves"
        )
    elif fines.radius_range_m[1] >= grains.radius_range_m[0]:
        yield (
            f"{size_text('fines', fines)}, expected below {size_text('grains', grains)}: "
            "solids as large as the grains only lie in the cake"
            + ("; leave them out by fines.sizes.cut_percent" if fines.measured else "")
        )


def _of_the_amounts(known: Known) -> Iterator[str]:
    """Grains fit into the box and fines into their slab, and there are not too many of them."""
    box, grains, fines = known["box"], known["grains"], known["fines"]
    if known.good("grains.porosity", "grains.count") and grains.porosity is grains.count is None:
        yield "grains.porosity: missing, give it (0 to 1) or grains.count"
    counted = known.good("fines.count", "fines.slab_mm")
    if counted and fines.endless and known.value("fines.supply") == "slab":
        yield (
            "fines.supply: 'slab' puts all fines in at the start, but nothing says how many; give "
            "fines.count or fines.slab_mm, or take 'batches'"
        )
    if known.good("box.size_mm", "grains.radius_mm", "grains.porosity", "grains.count"):
        volume, grain = math.prod(box.size_mm), grains.mean_volume_m3 * 1e9
        solid = 1 - grains.porosity if grains.porosity is not None else 0.0
        expected = grains.count or solid * volume / grain
        if expected > tables.MOST_GRAINS:
            yield (
                f"box.size_mm: {list(box.size_mm)} holds {expected:.3g} grains; expected at most "
                f"{tables.MOST_GRAINS:.0e}"
            )
        if grains.count is not None and grains.count * grain >= volume:
            yield (
                f"grains.count: {grains.count} spheres sum to more than the box; expected at most "
                f"{int(volume / grain)}"
            )
    if known.good("box.size_mm", "box.sides", "grains.radius_mm"):
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
    supply = ("radius_mm", "count", "slab_mm", "concentration", "solids_kg_m3")
    if known.good("box.size_mm", *(f"fines.{key}" for key in supply)):
        area, fraction = box.size_mm[1] * box.size_mm[2], fines.placed_fraction
        volume = fines.mean_volume_m3 * 1e9
        count = fines.count or fraction * area * (fines.slab_mm or 0.0) / volume
        length = fines.slab_mm or count * volume / (fraction * area)
        if count > tables.MOST_FINES:
            yield (
                f"fines.count: {count:.3g} fines, expected at most {tables.MOST_FINES:.0e}; "
                "shorten the slab" + " or raise fines.cut_um" * fines.measured
            )
        if length > tables.MOST_SLAB * box.size_mm[0]:
            yield (
                f"{concentration_text(fines)} makes a slab of {length:.3g} mm, "
                f"expected at most {tables.MOST_SLAB} box lengths; raise it or supply fewer fines"
            )
    outer, radius = known.value("well.drainage_radius_m"), known.value("well.radius_mm")
    if outer is not None and radius is not None and outer <= 1e-3 * radius:
        yield (
            f"well.drainage_radius_m: {outer:g} m is not above the radius of the well, "
            f"well.radius_mm = {radius:g}"
        )


def _of_the_invasion(known: Known) -> Iterator[str]:
    """What size classes on the network exclude, and what they need."""
    method = known.value("invasion.method")
    by_classes = method in ("network", "both")
    if known.given("cake.permeability_m2") and not by_classes:
        yield (
            "cake: the table belongs to invasion.method = 'network' or 'both'; leave it out, for "
            "spheres make their own cake"
        )
    pair = ("release_stress_Pa", "release_time_s")
    lacking = [key for key in pair if known.value(f"invasion.{key}") is None]
    if known.good(*(f"invasion.{key}" for key in pair)) and len(lacking) == 1:
        yield f"invasion.{lacking[0]}: is missing, expected with the other key of the release"
    if by_classes and known.given("clean_up.drawdown_MPa"):
        yield (
            f"clean_up: with invasion.method = {method!r} nothing turns the flow back; leave the "
            "table out, or take 'liggghts'"
        )
    if method == "both" and known.value("drag.field") == "uniform":
        yield (
            "drag.field: 'uniform' with invasion.method = 'both', whose spheres and classes share "
            "one flow; leave it out, or take 'network'"
        )
    coupled = known.value("drag.field") == "network"
    if known.value("grains.motion") == "mobile" and (by_classes or coupled):
        what = f"invasion.method = {method!r}" if by_classes else "drag.field 'network'"
        yield (
            f"grains.motion: 'mobile' with {what}, whose pores are those of grains that stay; "
            "take 'fixed', or spheres with drag.field = 'uniform'"
        )


def _of_the_forces(known: Known) -> Iterator[str]:
    """The network has one way for some keys of [drag] that the uniform field leaves open."""
    drag, fines = known["drag"], known["fines"]
    driven = known.value("drag.drive_velocity_m_s")
    if isinstance(driven, float | int) and known.value("contact.cohesion_J_m3") is not None:
        yield (
            f"drag.drive_velocity_m_s: {driven} with contact.cohesion_J_m3: the forces of the "
            "fluid are scaled, cohesion is not, so their ratio would be wrong; leave out one of "
            "the two"
        )
    if not known.good("drag.field"):
        return
    if drag.coupled:
        for key in tables.OF_THE_UNIFORM:
            value, only = getattr(drag, key), tables.Drag.model_fields[key].default
            if known.good(f"drag.{key}") and value != only:
                yield (
                    f"drag.{key}: {value!r} belongs to drag.field 'uniform'; leave it out, or set "
                    "drag.field = 'uniform'"
                )
        rate = known.value("run.stop_rate")
        if rate is not None and known.value("drag.drive") == "rate":
            yield (
                f"run.stop_rate: {rate:g} needs a rate that falls; leave it out, or set "
                "drag.drive = 'pressure'"
            )
        return
    for key in OF_THE_NETWORK:
        if (value := known.value(key)) is not None:
            yield (
                f"{key}: {value!r} belongs to drag.field 'network'; the uniform field always has "
                "its first velocity; leave it out"
            )
    if not known.good("drag.scheme"):
        return
    every = known.value("drag.refresh_steps")
    if drag.scheme != "held" and every not in (None, 1):
        yield f"drag.refresh_steps: {every} belongs to drag.scheme 'held', not {drag.scheme!r}"
    if drag.scheme == "viscous" and known.good("fines.radius_mm") and not fines.one_size:
        yield (
            f"drag.scheme: 'viscous' needs fines of one size, {size_text('fines', fines)} "
            "(LIGGGHTS's viscous force is one number a material); take 'held' or 'implicit'"
        )
    if drag.scheme == "implicit" and known.value("drag.upstream") == "darcy":
        yield (
            "drag.upstream: 'darcy' changes the fluid's velocity at x = 0, drag.scheme 'implicit' "
            "keeps one a fine; take 'interstitial', or another drag.scheme"
        )
    if drag.scheme != "held" and known.value("drag.inertia") == "schiller-naumann":
        yield (
            "drag.inertia: 'schiller-naumann' makes the drag coefficient depend on the slip, "
            f"drag.scheme {drag.scheme!r} keeps one a fine; take 'held'"
        )


def _of_the_contacts(known: Known) -> Iterator[str]:
    """The contact model takes what grains and fines give, and can do what is asked of it."""
    contact, bonds = known["contact"], known["bonds"]
    read = sorted(tables.MODEL_KEYS["hooke"] | tables.MODEL_KEYS["hertz"] | {"damping_ratio"})
    for name in ("grains", "fines"):
        if not known.good("contact.model", *(f"{name}.{key}" for key in read)):
            continue
        spheres = known[name]
        unread = sorted(contact.other_keys & spheres.model_fields_set)
        if unread:
            yield (
                f"{', '.join(f'{name}.{key}' for key in unread)}: not read by contact.model "
                f"{contact.model!r}; leave out, or choose the other contact.model"
            )
        if contact.model == "hertz" and spheres.damping_ratio > tables.DEEPEST_DAMPING:
            yield (
                f"{name}.damping_ratio: {spheres.damping_ratio:g} with contact.model 'hertz', "
                f"expected at most {tables.DEEPEST_DAMPING:g} (a restitution above 0.05)"
            )
    cohesion = known.value("contact.cohesion_J_m3")
    if cohesion is not None and known.value("contact.model") == "hooke":
        yield (
            f"contact.cohesion_J_m3: {cohesion:g} with contact.model 'hooke': the attraction of "
            "LIGGGHTS's SJKR grows with the overlap as a linear spring does, so it would only "
            "soften the contact and never pull; take contact.model = 'hertz'"
        )
    rolling = known.value("contact.rolling_friction")
    frictions = {known.value("grains.friction"), known.value("fines.friction")}
    if rolling is not None and 0 in frictions and None not in frictions:
        yield (
            f"contact.rolling_friction: {rolling:g} without friction (grains.friction or "
            "fines.friction is 0): spheres that slide do not roll; give both a friction, or leave "
            "contact.rolling_friction out"
        )
    strengths = ("tensile_strength_MPa", "shear_strength_MPa")
    if known.good(*(f"bonds.{key}" for key in strengths)):
        absent = [key for key in strengths if getattr(bonds, key) is None]
        if len(absent) == 1:
            yield (
                f"bonds.{absent[0]}: missing next to the other strength; give both, or neither: "
                "then bonds never break"
            )


def _of_the_analysis(known: Known) -> Iterator[str]:
    """Its laws go together; sections and bins are as a case gives them, not as Python does."""
    analysis, thickness = known["analysis"], known.value("analysis.profile_bin_mm")
    if isinstance(known.value("analysis.sections"), tuple):
        yield f"analysis.sections: {analysis.sections}: a case gives the number of sections"
    if known.good("analysis.law", "analysis.damage_law"):
        yield from analysis.refusals()
    if known.good("analysis.profile_bin_mm") and thickness is None:
        yield "analysis.profile_bin_mm: missing, a case gives the thickness of its bins"
    elif thickness and known.good("box.size_mm"):
        length = known["box"].size_mm[0]
        if length / thickness > tables.MOST_BINS:
            yield (
                f"analysis.profile_bin_mm: {thickness:g} cuts {length:g} mm into more than "
                f"{tables.MOST_BINS} bins; expected at least {length / tables.MOST_BINS:.3g}"
            )
