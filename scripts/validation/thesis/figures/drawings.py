"""The figures of the thesis by file name: how each is drawn, from what, and its caption."""

from dataclasses import replace
from functools import partial

from validation.thesis.figures import deposition as draw_deposition
from validation.thesis.figures import depth as draw_depth
from validation.thesis.figures import packs as draw_packs
from validation.thesis.figures import permeability as draw_permeability
from validation.thesis.figures import pores_and_throats as draw_pores
from validation.thesis.figures import scans as draw_scans
from validation.thesis.figures.drawing import Drawing, NamedDrawing, of_one, of_several
from validation.thesis.figures.tables import POROSITY_CLASSES

BY_SIZE = ("specimen1", "specimen2", "specimen7", "specimen3")
BY_POROSITY = ("specimen3", "specimen6")
SECTION_FIGURES = {
    "specimen1": (42, 44, 45, 46, 47, 48),
    "specimen5": range(50, 56),
    "specimen8": range(59, 65),
}
"""Numbers of the thesis's figures of a specimen's first millimetre.

Their subjects are sizes, lengths, throats by depth, throat porosity, pore volume, conductance.
"""
CALLED_SPECIMEN_7 = " (The thesis calls it specimen 7 there.)"


def _packs() -> list[NamedDrawing]:
    slab = (
        "fines (orange) at the end, in a slab one grain thick through the middle, seen from the "
        "side; the dashed line is the formation face."
    )
    grains = "the pack; nearer grains are lighter."
    invaded = draw_packs.invaded_pack
    return [
        of_one("figure_09_pack", "specimen1", draw_packs.pack, grains),
        of_one("figure_13B_invasion", "specimen1", invaded, slab),
        of_one("figure_13C_invasion", "specimen6", invaded, slab),
    ]


def _depths() -> list[NamedDrawing]:
    share = "share of the invaded fines by depth, in bins of 0.25 mm."
    lost = "porosity lost to the fines by depth, overlap counted once."
    by_size = (
        "the invaded fines alone, large ones orange, small ones black, the others grey; below, "
        "their number by depth."
    )
    first_bin = (
        "Thesis: about {it.fraction_first_bin:.0%} in its first bin, whose width it does not give."
    )
    beyond = "Thesis: fewer than {it.fraction_beyond_0p5mm:.0%} deeper than 0.5 mm."
    depth = "Thesis: depth {it.invaded_depth_mm:g} mm."
    face = "Thesis: about {it.face_porosity_loss:g} at the face."
    whole = "Thesis: initial and damaged porosity differ by {it.porosity_loss:.2g}."

    def fraction(number: int, specimen: str, *thesis: str) -> NamedDrawing:
        name = f"figure_{number}_invaded_fraction"
        return of_one(name, specimen, draw_depth.invaded_fraction, share, *thesis)

    def loss(number: int, specimen: str) -> NamedDrawing:
        name = f"figure_{number}_porosity_reduction"
        return of_one(name, specimen, draw_depth.porosity_reduction, lost, face, whole)

    return [
        fraction(15, "specimen1", first_bin, beyond, depth),
        loss(16, "specimen1"),
        fraction(17, "specimen5", first_bin, depth),
        loss(18, "specimen5"),
        fraction(19, "specimen6", first_bin, depth),
        loss(20, "specimen6"),
        of_one("figure_21_fines_by_size", "specimen7", draw_packs.fines_by_size, by_size),
        loss(22, "specimen8"),
    ]


def _drag() -> list[NamedDrawing]:
    drawing = Drawing(
        draw=draw_scans.invasion_depth,
        caption="Thesis Figure 14: depth of the invaded fines against the multiplier of "
        "Stokes's drag.",
        table="drag",
        thesis=["Thesis, Table 3, with the nominal drag: {table3.invaded_depth_mm:g} mm."],
    )
    return [("figure_14_drag.png", drawing)]


def _tetrahedra() -> list[NamedDrawing]:
    drawing = Drawing(
        draw=draw_deposition.tetrahedra,
        caption="Thesis Figures 33-35: tetrahedra in the first 1 mm with all spheres and with the "
        "grains alone.",
        table="tetrahedra",
    )
    return [("figure_33-35_tetrahedra.png", drawing)]


def _sections(specimen: str) -> list[NamedDrawing]:
    """The figures of one specimen's first millimetre.

    Each kind is a file name, the thesis's quantities, the function and the caption.
    """
    kinds = (
        (
            "sizes",
            ("throat radius", "pore radius"),
            draw_pores.sizes,
            "inscribed radii of throats and pore bodies.",
        ),
        ("lengths", ("throat length",), draw_pores.lengths, "throat lengths."),
        (
            "throats_by_depth",
            ("throats blocked",),
            draw_pores.throats_by_depth,
            "all throats and those that a fine blocks, by depth.",
        ),
        (
            "throat_porosity",
            draw_pores.CONTENTS,
            draw_pores.throat_porosity,
            "what the throats hold, and the porosity of those with fines.",
        ),
        (
            "pore_volume",
            ("pore volume",),
            draw_pores.volumes,
            "void volume of the pores before and after the invasion.",
        ),
        (
            "conductance",
            (),
            draw_pores.conductances,
            "conductance of the throats before and after the invasion.",
        ),
    )
    drawings = []
    for number, (words, quantities, draw, text) in zip(
        SECTION_FIGURES[specimen], kinds, strict=True
    ):
        caption = f"in the first 1 mm, {text}{_other_name(specimen)}"
        name, drawing = of_one(f"figure_{number}_{words}", specimen, draw, caption)
        drawings.append((name, replace(drawing, quantities=quantities)))
    return drawings


def _other_name(specimen: str) -> str:
    return CALLED_SPECIMEN_7 if specimen == "specimen8" else ""


def _permeability(number: int, specimen: str) -> NamedDrawing:
    text = (
        "damaged over intact permeability, k/k₀, of sections of 1 mm, cut out of the specimen and "
        "in place."
    )
    first = "Thesis, first section: 1 - k/k₀ = {it.reductions[0]:.2g}."
    draw = draw_permeability.permeability
    name = f"figure_{number}_permeability"
    return of_one(name, specimen, draw, text + _other_name(specimen), first)


def _distances() -> list[NamedDrawing]:
    text = "distance of the fines' centres from the throat's axis over its radius, throat porosity"
    titles = {
        "56": "Thesis Figure 56, specimen 5",
        "57": "Thesis Figure 57, specimen 5",
        "57b": "Not drawn in the thesis, next to Figure 57, specimen 5",
    }
    return [
        (
            f"figure_{number}_distances_specimen5.png",
            Drawing(
                draw=partial(draw_deposition.distances, porosity=porosity),
                caption=f"{title}: {text} {porosity}.",
                table="distances",
                key=porosity,
            ),
        )
        for (number, title), porosity in zip(titles.items(), POROSITY_CLASSES, strict=True)
    ]


def _comparisons() -> list[NamedDrawing]:
    size = "fines of several sizes, porosity about 0.30"
    porosity = "two porosities, the finest fines"
    first = "Thesis, first section of specimen {0}: 1 - k/k₀ = {{specimen{0}.reductions[0]:.2g}}."
    lost = "porosity lost along depth"
    total = "porosity lost in the whole specimen and in its first 1 mm"
    share = "share of the invaded fines along depth"
    ratio = "damaged over intact permeability, k/k₀, of sections of 1 mm"
    by_loss, by_total = draw_depth.compared_porosity, draw_depth.total_reduction
    by_share, by_ratio = draw_depth.compared_fraction, draw_permeability.compared_permeability
    sizes, porosities = BY_SIZE, BY_POROSITY
    one, three, six = (first.format(number) for number in (1, 3, 6))
    loss_name, share_name, ratio_name = "porosity_reduction", "invaded_fraction", "permeability"
    return [
        of_several(f"figure_66_{loss_name}", sizes, by_loss, f"{lost}, {size}."),
        of_several("figure_67_total_reduction", sizes, by_total, f"{total}, {size}."),
        of_several(f"figure_68_{share_name}", sizes, by_share, f"{share}, {size}."),
        of_several(f"figure_69_{ratio_name}", sizes, by_ratio, f"{ratio}, {size}.", one, three),
        of_several(f"figure_70_{loss_name}", porosities, by_loss, f"{lost}, {porosity}."),
        of_several(f"figure_71_{share_name}", porosities, by_share, f"{share}, {porosity}."),
        of_several(
            f"figure_72_{ratio_name}", porosities, by_ratio, f"{ratio}, {porosity}.", three, six
        ),
    ]


def _scans() -> list[NamedDrawing]:
    against = (
        "Fines in the first 1 mm, porosity lost there, and depth above which 95 % of the invaded "
        "fines lie, against"
    )
    friction = f"{against} the friction of the fines, which the thesis does not give."
    supply = f"{against} the number of fines supplied, which the thesis does not give."
    return [
        (
            "scan_friction.png",
            Drawing(draw=draw_scans.friction, caption=friction, table="friction"),
        ),
        ("scan_supply.png", Drawing(draw=draw_scans.supply, caption=supply, table="supply")),
    ]


def _growth() -> NamedDrawing:
    caption = (
        "Thesis Figures 73 and 74: growth of a pack, in a slab one grain thick; the arrows are "
        "the velocities of the grains."
    )
    drawing = Drawing(draw=draw_packs.growth, caption=caption, table="growth")
    return "figure_73-74_growth.png", drawing


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
