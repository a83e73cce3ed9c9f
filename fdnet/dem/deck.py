"""Decks: the text, and the lines that several decks share.

Decks: the text of a LIGGGHTS input, rendered from the templates under StrictUndefined.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from jinja2 import meta

from fdnet.case.case import Case, InvasionCase
from fdnet.errors import DeckError, DumpError
from fdnet.files import write_text
from fdnet.scales.contacts import Contact, material_of, restitution_of
from fdnet.scales.drag import COEFFICIENT, EXPONENT
from fdnet.scales.scales import InvasionScales, Scales
from fdnet.spheres.dump import Frame
from fdnet.spheres.snapshot import Array, Kind, Snapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """Something that a deck does without.

    Attributes:
        what: is left out.
        why: it is not needed.
    """

    what: str
    why: str

    def __str__(self) -> str:
        return f"{self.what} ({self.why})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Deck:
    """A rendered deck.

    Attributes:
        text: LIGGGHTS input.
        stage: "pack" or "invade".
        digest: of what the stage depends on in its case.
        left_out: what a general deck would have and this one does without.
    """

    text: str
    stage: str
    digest: str
    left_out: tuple[LeftOut, ...]


@cache
def _environment() -> jinja2.Environment:
    folder = files("liggghts_templates")
    loader = jinja2.FunctionLoader(lambda name: _source(folder, name))
    return jinja2.Environment(
        loader=loader,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )


def _source(folder: Any, name: str) -> str | None:
    entry = folder / name
    return entry.read_text(encoding="utf-8") if entry.is_file() else None


def used_variables(template: str) -> set[str]:
    """Names the template and everything it includes take from outside."""
    return set(_used(template))


def _used(template: str) -> Iterator[str]:
    environment = _environment()
    try:
        loader = environment.loader
        source, _, _ = loader.get_source(environment, template)  # type: ignore[union-attr]
    except jinja2.TemplateNotFound as error:
        raise DeckError(
            f"liggghts_templates/{error.name}: template not found; reinstall fdnet"
        ) from error
    tree = environment.parse(source)
    yield from meta.find_undeclared_variables(tree)
    for name in meta.find_referenced_templates(tree):
        if name:
            yield from _used(name)


def render_text(template: str, variables: dict[str, Any]) -> str:
    """The template with `variables` put in.

    Raises DeckError: a template or variable is missing, or a variable is offered but never used.
    """
    unused = set(variables) - used_variables(template)
    if unused:
        raise DeckError(
            f"{template}: variables offered but never used: {', '.join(sorted(unused))}"
        )
    try:
        return _environment().get_template(template).render(variables)
    except jinja2.UndefinedError as error:
        raise DeckError(f"{template}: {error.message}; expected a value from fdnet.dem") from error
    except jinja2.TemplateSyntaxError as error:
        raise DeckError(f"{error.name or template}:{error.lineno}: {error.message}") from error


def number(value: float) -> str:
    """A float as LIGGGHTS reads it back exactly."""
    return repr(float(value))


# ------------------------------------------------------------------------------------------------
# The contact lines of a deck: properties of materials and pairs, and LIGGGHTS's contact model.


_MATERIALS = {"pack": ("grain", "wall"), "invade": ("grain", "fine", "wall")}
_NORMAL = {"hooke": "hooke/stiffness", "hertz": "hertz"}
SOFTEST, HARDEST = 5e6, 1e9
"""Young's moduli, Pa, beyond which LIGGGHTS asks for a confirmation in the deck."""


def contact_variables(case: Case, scales: Scales, stage: str, *, friction: bool) -> dict[str, Any]:
    """Variables of `_contacts.in.j2`: symmetric matrices row by row, and the contact model."""
    materials = _MATERIALS[stage]
    size = len(materials)
    shared = {
        "model": case.contact.model,
        "materials": " ".join(materials),
        "size": size,
        "friction": _matrix(scales, stage, "friction") if friction else "",
        "rolling": _rolling(case, size) if friction else "",
        "cohesion": _cohesion(case, stage),
        "pair_model": _models(case, stage, friction) + _settings(case, stage, friction),
    }
    if case.contact.model == "hertz":
        return shared | _hertz(case, scales, stage)
    return shared | {
        "normal": _matrix(scales, stage, "normal_stiffness"),
        "damping": _matrix(scales, stage, "damping_rate"),
        "shear": _matrix(scales, stage, "shear_stiffness"),
        "no_damping": " ".join(["0"] * size**2),
    }


def damped_alike(
    case: Case, contacts: dict[str, Any], ratio: float, rate: float
) -> dict[str, Any]:
    """The same contacts with one damping for all pairs.

    `ratio` is over the critical damping, `rate` in 1/s is what linear contacts take for it.
    """
    if case.contact.model == "hertz":
        key, value = "restitution", restitution_of(ratio)
    else:
        key, value = "damping", rate
    return contacts | {key: " ".join([number(value)] * contacts["size"] ** 2)}


def wall_law(case: Case, stage: str, *, friction: bool) -> dict[str, Any]:
    """Contact model, material and settings of a plane."""
    return {
        "model": _models(case, stage, friction),
        "material": len(_MATERIALS[stage]),
        "settings": _settings(case, stage, friction),
    }


def left_out_of_contacts(case: Case) -> list[LeftOut]:
    """What contacts could do and the case does not ask for."""
    contact = case.contact
    asked = {
        "loss of rebound in the liquid": contact.restitution == "liquid",
        "rolling resistance": contact.rolling_friction is not None,
        "cohesion": contact.cohesion_J_m3 is not None,
    }
    return [LeftOut(what=what, why="not asked for") for what, given in asked.items() if not given]


def _models(case: Case, stage: str, friction: bool) -> str:
    """LIGGGHTS's models in its order; packing knows neither friction nor cohesion."""
    words = [_NORMAL[case.contact.model]]
    if friction:
        words.append("tangential history")
    if _cohesion(case, stage):
        words.append("cohesion sjkr")
    if friction and case.contact.rolling_friction:
        words.append("rolling_friction epsd2")
    return " ".join(words)


def _settings(case: Case, stage: str, friction: bool) -> str:
    """A contact that a liquid damps may pull: the film resists parting as it does approach."""
    pulls = stage == "invade" and case.contact.restitution == "liquid"
    tangential = " tangential_damping off" if friction else ""
    return tangential + (" limitForce off" if pulls else " limitForce on")


def _rolling(case: Case, size: int) -> str:
    """The same coefficient for all pairs."""
    if case.contact.rolling_friction is None:
        return ""
    return " ".join([number(case.contact.rolling_friction)] * size**2)


def _cohesion(case: Case, stage: str) -> str:
    """Of the pairs with a fine; grains do not attract each other or a wall."""
    density, materials = case.contact.cohesion_J_m3, _MATERIALS[stage]
    if density is None or "fine" not in materials:
        return ""
    return " ".join(
        number(density if "fine" in (a, b) else 0.0) for a in materials for b in materials
    )


def _hertz(case: Case, scales: Scales, stage: str) -> dict[str, Any]:
    materials = [material_of(case, name, scales.stiffness_factor) for name in _MATERIALS[stage]]
    moduli = [modulus for modulus, _ in materials]
    return {
        "modulus": " ".join(number(modulus) for modulus in moduli),
        "poisson": " ".join(number(ratio) for _, ratio in materials),
        "soft": min(moduli) < SOFTEST,
        "hard": max(moduli) > HARDEST,
        "restitution": _matrix(scales, stage, "restitution"),
    }


def _matrix(scales: Scales, stage: str, value: str) -> str:
    """A value of all pairs of the scene's materials, row by row."""
    materials = _MATERIALS[stage]
    return " ".join(
        number(getattr(_contact(scales, a, b), value)) for a in materials for b in materials
    )


def _contact(scales: Scales, first: str, second: str) -> Contact:
    """The pair's contact in either order; walls do not touch each other, so any value serves."""
    for pair in (f"{first}-{second}", f"{second}-{first}"):
        if pair in scales.contacts:
            return scales.contacts[pair]
    return scales.contacts["grain-wall"]


# ------------------------------------------------------------------------------------------------
# Gravity and buoyancy in the invasion deck: what acts on the fines, and on grains that move.
#
# A sphere of mass m and density rho_p in a fluid of density rho_f at rest feels
# m g (1 - rho_f / rho_p), gravity and Archimedes's buoyancy, in any direction of g. That is
# LIGGGHTS's `fix gravity` with a magnitude for each group of equal density, and exact. Fines of
# several densities have the whole of gravity, and buoyancy -rho_f g 4/3 pi r^3 as a force of its
# own.
# A simulation that is driven faster than the fluid multiplies it as all forces.


WHAT = "gravity and buoyancy"


def gravity_variables(
    case: InvasionCase, scales: InvasionScales
) -> tuple[list[dict[str, Any]], list[LeftOut]]:
    """One `fix gravity` for each group that it moves, and what is left out of the deck."""
    mode, vector = case.gravity.mode, case.gravity.acceleration_m_s2
    if mode == "off" or math.hypot(*vector) == 0:
        return [], [LeftOut(what=WHAT, why="switched off")]
    if mode == "auto" and scales.gravity_over_drag < case.gravity.negligible_below:
        ratio, limit = scales.gravity_over_drag, case.gravity.negligible_below
        why = f"gravity is {ratio:.1e} of the drag, below {limit:g}"
        return [], [LeftOut(what=WHAT, why=why)]
    groups = {"fines": {one.density for one in case.fines.components}}
    if case.grains.motion == "mobile":
        groups["grains"] = {case.grains.density_kg_m3}
    pulls = []
    for name, densities in groups.items():
        mixed = len(densities) > 1
        share = 1.0 if mixed else share_of_gravity(min(densities), case)
        lift = _lift(case, scales) if mixed and case.gravity.buoyancy else []
        pulls.append(_pull(name, scales.force_factor * share, vector) | {"lift": lift})
    left_out = [] if case.gravity.buoyancy else [LeftOut(what="buoyancy", why="switched off")]
    return pulls, left_out


def share_of_gravity(density: float, case: InvasionCase) -> float:
    """1 - rho_f / rho_p of spheres of `density` kg/m3; below 0 they rise. 1 without buoyancy."""
    return 1 - case.fluid.density_kg_m3 / density * case.gravity.buoyancy


def _lift(case: InvasionCase, scales: InvasionScales) -> list[str]:
    """Buoyancy over the cube of the radius along x, y and z, N/m3, as simulated."""
    rate = 4 / 3 * math.pi * case.fluid.density_kg_m3 * scales.force_factor
    return [number(-rate * one + 0.0) for one in case.gravity.acceleration_m_s2]


def _pull(group: str, share: float, vector: tuple[float, float, float]) -> dict[str, Any]:
    magnitude, turn = abs(share) * math.hypot(*vector), math.copysign(1.0, share)
    direction = " ".join(number(turn * one / math.hypot(*vector) + 0.0) for one in vector)
    return {"group": group, "magnitude": number(magnitude), "direction": direction}


# ------------------------------------------------------------------------------------------------
# The fluid in the invasion deck: what each scheme of `drag.scheme` puts into `_drag.in.j2`.
#
# The force of the pressure gradient is the same in all schemes: constant on each fine, and only
# inside the pack. It acts on the fines alone, as the drag does.


BELOW_ZERO = -5e-324
"""The largest number below 0: a region that ends here holds exactly x < 0."""


def drag_variables(case: InvasionCase, scales: InvasionScales) -> dict[str, Any]:
    """Variables of the drag block: the scheme and, as text, the numbers that it needs."""
    if case.drag.coupled:
        hold = scales.hold_steps if scales.hold_steps > 1 else 0
        return {"coupled": True, "scheme": case.drag.scheme, "hold_steps": hold}
    coefficient = case.fluid.stokes_coefficient_Pa_s * case.drag.multiplier
    slower = scales.drive_velocity - scales.upstream_velocity
    own = (
        _viscous(case, scales, coefficient, slower)
        if case.drag.scheme == "viscous"
        else _by_radius(scales, slower)
    )
    return {
        "coupled": False,
        "scheme": case.drag.scheme,
        "coefficient": number(coefficient),
        "velocity": number(scales.drive_velocity),
        "gradient": _gradient(case, scales),
        **own,
    }


def _gradient(case: InvasionCase, scales: InvasionScales) -> dict[str, str] | None:
    """V (-grad p) inside the pack: one force, or a formula for fines of many sizes.

    Where all have one density V is taken from the mass, which is the cheaper formula.
    """
    push = scales.push
    if not push.gradient:
        return None
    end = number(np.nextafter(case.size_m[0], 0))
    densities = {one.density for one in case.fines.components}
    formula = (
        f"{number(push.gradient / min(densities))}*mass"
        if len(densities) == 1
        else f"{number(push.gradient_force(1.0))}*r*r*r"
    )
    one_size = case.fines.one_size
    return {
        "pores": f"0.0 {end} INF INF INF INF",
        "force": number(push.gradient_force(case.fines.mean_radius_m)) if one_size else "",
        "formula": "" if one_size else formula,
    }


def forces_left_out(case: InvasionCase) -> list[LeftOut]:
    """The forces of the fluid that the deck does without."""
    drag = case.drag
    return [
        LeftOut(what=what, why=why)
        for what, left, why in (
            ("force of the pressure gradient", not drag.pressure_gradient, "switched off"),
            (
                "force of the pressure gradient on the grains",
                drag.pressure_gradient and case.grains.motion == "mobile",
                "the fluid pushes the fines only",
            ),
            ("drag at finite Reynolds numbers", drag.inertia == "none", "not asked for"),
            ("drag in a crowd", drag.crowd == "none", "not asked for"),
        )
        if left
    ]


def _by_radius(scales: InvasionScales, slower: float) -> dict[str, Any]:
    """F = 6 pi mu M r (u - v), for each fine by its own radius r.

    mu is the viscosity, M the multiplier, u the fluid's and v the fine's velocity.
    """
    fluid = f"(f_uf[1]-(x<0.0)*{number(slower)})" if slower else "f_uf[1]"
    return {
        "fluid_x": fluid,
        "hold_steps": scales.hold_steps if scales.hold_steps > 1 else 0,
        "inertia": _inertia(scales) if scales.push.reynolds_slope else None,
    }


def _inertia(scales: InvasionScales) -> dict[str, str]:
    """Schiller and Naumann's factor."""
    return {
        "factor": number(COEFFICIENT),
        "exponent": number(EXPONENT),
        "reynolds": number(scales.push.reynolds_slope),
    }


def _viscous(
    case: InvasionCase, scales: InvasionScales, coefficient: float, slower: float
) -> dict[str, Any]:
    """The same force for fines of one radius, as a constant force and viscous damping.

    The constant force is 6 pi mu M r u, at x < 0 with the fluid's velocity upstream.
    """
    damping = coefficient * case.fines.mean_radius_m
    return {
        "damping": number(damping),
        "push": number(damping * scales.drive_velocity),
        "slower": number(-damping * slower) if slower else "",
        "face": number(BELOW_ZERO),
    }


# ------------------------------------------------------------------------------------------------
# What both scenes share in a deck: header, walls, and the data file of spheres.


def header_variables(
    case: Case, stage: str, left_out: list[LeftOut], ranks: int
) -> dict[str, Any]:
    """Variables of `_header.in.j2`.

    Several ranks never cut the box across the flow, because the fines crowd at the face.
    """
    sideways = "p p" if case.box.sides == "periodic" else "f f"
    return {
        "stage": stage,
        "case_name": case.name,
        "digest": case.digest(stage),
        "left_out": left_out,
        "boundary": f"f {sideways}",
        "processors": "1 * *" if ranks > 1 else "",
    }


def wall_variables(case: Case, stage: str, *, friction: bool) -> list[dict[str, Any]]:
    """Planes at the sides, and at both ends for grains that move; fines pass the ends freely."""
    size, law = case.size_m, wall_law(case, stage, friction=friction)
    ends_hold = "all" if stage == "pack" else ("grains" if case.grains.motion == "mobile" else "")
    sides_hold = (
        ""
        if case.box.sides == "periodic"
        else ("all" if stage == "pack" or ends_hold else "fines")
    )
    walls = []
    for axis, held in ((0, ends_hold), (1, sides_hold), (2, sides_hold)):
        for end, position in enumerate((0.0, size[axis])):
            if held:
                walls.append(_wall(f"w{'xyz'[axis]}{end}", held, position) | law)
    return walls


def _wall(name: str, group: str, position: float) -> dict[str, Any]:
    return {
        "id": name,
        "group": group,
        "plane": f"{name[1]}plane",
        "position": number(position),
    }


def write_data(
    path: Path, spheres: Snapshot, *, bounds: Array, density: Array, types: int
) -> None:
    """Write the spheres (N) as a LIGGGHTS data file.

    `bounds` (3, 2) m are those of the simulation box, `density` (N,) is in kg/m3, `types` is the
    number of atom types.
    """
    lines = ["spheres", "", f"{len(spheres)} atoms", f"{types} atom types", ""]
    lines += [
        f"{number(low)} {number(high)} {axis}lo {axis}hi"
        for (low, high), axis in zip(bounds, "xyz", strict=True)
    ]
    lines += ["", "Atoms", ""]
    table = np.column_stack(
        [spheres.id, spheres.kind, 2 * spheres.radius, density, spheres.position]
    )
    lines += [
        f"{atom:.0f} {kind:.0f} " + " ".join(f"{value:.17g}" for value in rest)
        for atom, kind, *rest in table
    ]
    write_text(path, "\n".join(lines) + "\n")


def box_of(case: Case) -> Array:
    """Corners (3, 2) m of the specimen's box."""
    return np.column_stack([np.zeros(3), case.size_m])


def _check_spheres(frame: Frame) -> None:
    """Raise DumpError on a type that is neither grain nor fine, or a radius not above 0."""
    for name, good, expected in (
        ("type", np.isin(frame.column("type"), list(Kind)), "1 (grain) or 2 (fine)"),
        ("radius", frame.column("radius") > 0, "a number above 0"),
    ):
        bad = np.flatnonzero(~good)
        if len(bad):
            raise DumpError(
                f"dump at step {frame.step}: the sphere with id {frame.column('id')[bad[0]]:.0f} "
                f"has {name} {frame.column(name)[bad[0]]:g}, expected {expected}; the file was "
                "changed, start over with --force"
            )


def snapshot_of(frame: Frame, case: Case, *, time_s: float) -> Snapshot:
    """A frame of a dump as a Snapshot in the specimen's box.

    Positions beyond a periodic side are moved into the box.
    """
    position = np.column_stack([frame.column(c) for c in "xyz"])
    _check_spheres(frame)
    for axis, periodic in enumerate(case.periodic):
        if periodic:
            position[:, axis] = np.mod(position[:, axis], case.size_m[axis])
    return Snapshot(
        step=frame.step,
        time_s=time_s,
        box=box_of(case),
        id=frame.column("id"),
        kind=frame.column("type"),
        position=position,
        radius=frame.column("radius"),
        velocity=np.column_stack([frame.column(f"v{c}") for c in "xyz"]),
    )
