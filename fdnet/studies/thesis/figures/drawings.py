"""The figures of the thesis by file name: how each is drawn, from what, and what stands under it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from fdnet.studies.thesis.figures import deposition as draw_deposition
from fdnet.studies.thesis.figures import depth as draw_depth
from fdnet.studies.thesis.figures import packs as draw_packs
from fdnet.studies.thesis.figures import permeability as draw_permeability
from fdnet.studies.thesis.figures import scans as draw_scans
from fdnet.studies.thesis.figures import sections as draw_sections
from fdnet.studies.thesis.figures.canvas import DISTANCE_CLASSES, Sources, titled

Named = tuple[str, "Drawing"]
BY_SIZE = ("specimen1", "specimen2", "specimen7", "specimen3")
BY_POROSITY = ("specimen3", "specimen6")


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """How a figure is made: `draw(figure, sources)`; the `specimens` it needs, and which of the other `table`s, under
    which `key`; its `caption`, and sentences of the `thesis` which stand when their numbers are known; `quantities`
    of the first specimen's statistics that the caption tells too."""

    draw: Callable[[Any, Sources], None]
    caption: str
    specimens: Sequence[str] = ()
    table: str | None = None
    key: str | None = None
    thesis: Sequence[str] = ()
    quantities: Sequence[str] = ()


def _single(name: str, specimen: str, draw: Any, what: str, *thesis: str) -> Named:
    """A figure of one specimen: `name` "figure_15_...", `what` is said of it; `{it` in the thesis's sentences."""
    drawing = Drawing(
        draw=partial(draw, specimen=specimen),
        specimens=(specimen,),
        caption=f"Thesis Figure {_number(name)}, {titled(specimen)}: {what}",
        thesis=[sentence.replace("{it", "{" + specimen) for sentence in thesis],
    )
    return f"{name}_{specimen}.png", drawing


def _together(name: str, specimens: Sequence[str], draw: Any, what: str, *thesis: str) -> Named:
    drawing = Drawing(
        draw=partial(draw, specimens=specimens),
        specimens=specimens,
        caption=f"Thesis Figure {_number(name)}: {what}",
        thesis=thesis,
    )
    return f"{name}.png", drawing


def _number(name: str) -> str:
    """ "15" of "figure_15_invaded_fraction", "33-35" of "figure_33-35_tetrahedra"."""
    return name.split("_")[1].lstrip("0")


def _packs() -> list[Named]:
    slab = (
        "slab one grain thick through the middle, seen from the side; the face is the dashed line."
    )
    return [
        _single(
            "figure_09_pack",
            "specimen1",
            draw_packs.pack,
            "the pack, its grains lighter the nearer they are.",
        ),
        _single(
            "figure_13B_invasion",
            "specimen1",
            draw_packs.invaded_pack,
            f"fines (orange) at the end, {slab}",
        ),
        _single(
            "figure_13C_invasion",
            "specimen6",
            draw_packs.invaded_pack,
            f"fines (orange) at the end, {slab}",
        ),
    ]


def _depths() -> list[Named]:
    fraction, loss = draw_depth.invaded_fraction, draw_depth.porosity_reduction
    share = "share of the invaded fines by depth, in bins of 0.25 mm."
    lost = "porosity lost to the fines by depth, overlap counted once."
    bin_said = (
        "Thesis: about {it.fraction_first_bin:.0%} in its first bin, whose width it does not give."
    )
    beyond_said = "Thesis: fewer than {it.fraction_beyond_0p5mm:.0%} deeper than 0.5 mm."
    depth_said = "Thesis: depth {it.depth_mm:g} mm."
    face_said = "Thesis: about {it.face_porosity_loss:g} at the face."
    all_said = "Thesis: {it.porosity_loss:.2g} between initial and damaged porosity."
    return [
        _single(
            "figure_15_invaded_fraction",
            "specimen1",
            fraction,
            share,
            bin_said,
            beyond_said,
            depth_said,
        ),
        _single("figure_16_porosity_reduction", "specimen1", loss, lost, face_said, all_said),
        _single("figure_17_invaded_fraction", "specimen5", fraction, share, bin_said, depth_said),
        _single("figure_18_porosity_reduction", "specimen5", loss, lost, face_said, all_said),
        _single("figure_19_invaded_fraction", "specimen6", fraction, share, bin_said, depth_said),
        _single("figure_20_porosity_reduction", "specimen6", loss, lost, face_said, all_said),
        _single("figure_21_fines_by_size", "specimen7", draw_packs.fines_by_size, SIZES),
        _single("figure_22_porosity_reduction", "specimen8", loss, lost, face_said, all_said),
    ]


SIZES = "the invaded fines alone, large ones orange, small ones black, the others grey; below, their number by depth."


def _drag() -> list[Named]:
    caption = (
        "Thesis Figure 14: depth of the invaded fines against the multiplier of Stokes's drag."
    )
    said = "Thesis, Table 3, with the nominal drag: {table3.depth_mm:g} mm."
    return [
        (
            "figure_14_drag.png",
            Drawing(draw=draw_scans.invasion_depth, caption=caption, table="drag", thesis=[said]),
        )
    ]


def _tetrahedra() -> list[Named]:
    caption = "Thesis Figures 33-35: tetrahedra in the first 1 mm with all spheres and with the grains alone."
    drawing = Drawing(draw=draw_deposition.tetrahedra, caption=caption, table="tetrahedra")
    return [("figure_33-35_tetrahedra.png", drawing)]


NUMBERS = {
    "specimen1": (42, 44, 45, 46, 47, 48),
    "specimen5": range(50, 56),
    "specimen8": range(59, 65),
}
"""The thesis's figures of a specimen's sizes, lengths, throats by depth, throat porosity, pore volume, conductance."""
NOTE = " (The thesis calls it specimen 7 there.)"


def _sections(specimen: str) -> list[Named]:
    kinds = (
        (
            "sizes",
            ("throat radius", "pore radius"),
            draw_sections.sizes,
            "inscribed radii of throats and pore bodies.",
        ),
        ("lengths", ("throat length",), draw_sections.lengths, "throat lengths."),
        (
            "throats_by_depth",
            ("throats blocked",),
            draw_sections.throats_by_depth,
            "all throats and those that a fine blocks, by depth.",
        ),
        (
            "throat_porosity",
            draw_sections.CONTENTS,
            draw_sections.throat_porosity,
            "what the throats hold, and the porosity of those with fines.",
        ),
        (
            "pore_volume",
            ("pore volume",),
            draw_sections.volumes,
            "void volume of the pores before and after the invasion.",
        ),
        (
            "conductance",
            (),
            draw_sections.conductances,
            "conductance of the throats before and after the invasion.",
        ),
    )
    note = NOTE if specimen == "specimen8" else ""
    made = (
        (
            _single(
                f"figure_{number}_{words}", specimen, draw, f"in the first 1 mm, {what}{note}"
            ),
            quantities,
        )
        for number, (words, quantities, draw, what) in zip(NUMBERS[specimen], kinds, strict=True)
    )
    return [
        (name, replace(drawing, quantities=quantities)) for (name, drawing), quantities in made
    ]


def _permeability(number: int, specimen: str) -> Named:
    what = "damaged over intact permeability of 1 mm sections, cut out and in place."
    first = "Thesis, first section: 1 - k/k₀ = {it.reductions[0]:.2g}."
    note = NOTE if specimen == "specimen8" else ""
    return _single(
        f"figure_{number}_permeability",
        specimen,
        draw_permeability.permeability,
        what + note,
        first,
    )


def _distances() -> list[Named]:
    numbers = ("56", "57", "57b")
    words = (
        "distance of the fines' centres from the throat's axis over its radius, throat porosity"
    )
    return [
        (
            f"figure_{number}_distances_specimen5.png",
            Drawing(
                draw=partial(draw_deposition.distances, kind=kind),
                caption=f"{_thesis_figure(number)}, specimen 5: {words} {kind}.",
                table="distances",
                key=kind,
            ),
        )
        for number, kind in zip(numbers, DISTANCE_CLASSES, strict=True)
    ]


def _thesis_figure(number: str) -> str:
    return (
        f"Thesis Figure {number}"
        if number.isdecimal()
        else "Beside Figure 57, not drawn in the thesis"
    )


def _comparisons() -> list[Named]:
    size, porosity = (
        "fines of several sizes, porosity about 0.30",
        "two porosities, the finest fines",
    )
    first = "Thesis, first section of specimen {0}: 1 - k/k₀ = {{specimen{0}.reductions[0]:.2g}}."
    lost, total = (
        "porosity lost along depth",
        "porosity lost in the whole specimen and in its first 1 mm",
    )
    share, k = (
        "share of the invaded fines along depth",
        "damaged over intact permeability of 1 mm sections",
    )
    compared = draw_permeability.compared_permeability
    return [
        _together(
            "figure_66_porosity_reduction",
            BY_SIZE,
            draw_depth.compared_porosity,
            f"{lost}, {size}.",
        ),
        _together(
            "figure_67_total_reduction", BY_SIZE, draw_depth.total_reduction, f"{total}, {size}."
        ),
        _together(
            "figure_68_invaded_fraction",
            BY_SIZE,
            draw_depth.compared_fraction,
            f"{share}, {size}.",
        ),
        _together(
            "figure_69_permeability",
            BY_SIZE,
            compared,
            f"{k}, {size}.",
            first.format(1),
            first.format(3),
        ),
        _together(
            "figure_70_porosity_reduction",
            BY_POROSITY,
            draw_depth.compared_porosity,
            f"{lost}, {porosity}.",
        ),
        _together(
            "figure_71_invaded_fraction",
            BY_POROSITY,
            draw_depth.compared_fraction,
            f"{share}, {porosity}.",
        ),
        _together(
            "figure_72_permeability",
            BY_POROSITY,
            compared,
            f"{k}, {porosity}.",
            first.format(3),
            first.format(6),
        ),
    ]


def _scans() -> list[Named]:
    against = "Count and lost porosity of the first 1 mm, and depth of 95 % of the invaded fines, against"
    friction = f"{against} the friction of the fines, of which the thesis tells nothing."
    supply = f"{against} the fines supplied, of which the thesis tells nothing."
    return [
        (
            "scan_friction.png",
            Drawing(draw=draw_scans.friction, caption=friction, table="friction"),
        ),
        ("scan_supply.png", Drawing(draw=draw_scans.supply, caption=supply, table="supply")),
    ]


def _growth() -> Named:
    caption = (
        "Thesis Figures 73 and 74: growth of a pack; slab one grain thick, arrows are velocities."
    )
    return "figure_73-74_growth.png", Drawing(
        draw=draw_packs.growth, caption=caption, table="growth"
    )


FIGURES: dict[str, Drawing] = dict(
    [
        *_packs(),
        *_drag(),
        *_depths(),
        *_tetrahedra(),
        *_sections("specimen1"),
        _permeability(49, "specimen1"),
        *_sections("specimen5"),
        *_distances(),
        _permeability(58, "specimen5"),
        *_sections("specimen8"),
        _permeability(65, "specimen8"),
        *_comparisons(),
        *_scans(),
        _growth(),
    ]
)
"""In the thesis's order, the scans before the appendix."""
