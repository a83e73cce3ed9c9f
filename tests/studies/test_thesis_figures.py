"""The figures of the thesis: what they show, not how they look.

The sources are two runs of a jittered lattice with fines placed by hand.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from builders import tiny
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

from fdnet.spheres.snapshot import Kind, resting
from validation.thesis.figures.canvas import few_colours
from validation.thesis.figures.deposition import distances, tetrahedra
from validation.thesis.figures.depth import (
    compared_fraction,
    invaded_fraction,
    porosity_reduction,
    total_reduction,
)
from validation.thesis.figures.draw_all import draw_all, filled_in
from validation.thesis.figures.drawings import FIGURES
from validation.thesis.figures.packs import fines_by_size, growth, middle_slab, pack
from validation.thesis.figures.permeability import compared_permeability, permeability, ratios
from validation.thesis.figures.pores_and_throats import (
    contents,
    density,
    sizes,
    throat_porosity,
    throats_by_depth,
)
from validation.thesis.figures.scans import invasion_depth, over_seeds
from validation.thesis.figures.sources import NO_NUMBERS, Sources
from validation.thesis.figures.tables import (
    POROSITY_CLASSES,
    FigureTables,
    ScanRow,
    distances_by_class,
    scan_row,
    tetrahedra_counted,
)
from validation.thesis.numbers.examine import examine
from validation.thesis.numbers.first_millimetre import first_millimetre
from validation.thesis.numbers.results import result_rows
from validation.thesis.numbers.values import (
    DepositionClaim,
    Statistic,
    ThesisSpecimen,
    percent,
    thesis_values,
)
from validation.thesis.numbers.whole_pores import share_within, whole_pores
from validation.thesis.runs.state import ENDING, State

FINE = 0.04e-3
DEPTHS = {1: [0.5] * 3 + [1.0], 2: [0.5] * 2 + [1.0, 1.5]}
"""mm, of the invaded fines by seed; they lie in the holes between eight grains."""
HOLES = [(0.55, 0.55), (1.05, 0.55), (0.55, 1.05), (1.05, 1.05)]
NUMBERS = ThesisSpecimen(
    id="1",
    porosity=0.01,
    damaged_porosity=(0.0,),
    invaded_depth_mm=2.0,
    invaded_count=704,
    fraction_first_bin=0.7,
    fraction_beyond_0p5mm=0.05,
    face_porosity_loss=0.05,
    section_reduction=(0.25, 0.04),
    size_classes_mm=((0.02, 0.03), (0.035, 0.05)),
    statistics=(
        Statistic(specimen="1", quantity="throat radius", value=0.3, between=(0.0, 0.05)),
    ),
    deposition=(
        DepositionClaim(throat_porosity=(0.0, 0.4), nearer="axis", value=0.5, sense="about"),
    ),
)


def lattice(box):
    """6 x 3 x 3 grains nearly touching, moved a little so that no eight lie on one sphere."""
    place = np.stack(
        np.meshgrid(np.arange(6), np.arange(3), np.arange(3), indexing="ij"), axis=-1
    ).reshape(-1, 3)
    jitter = np.random.default_rng(5).uniform(-1, 1, place.shape)
    position = 1e-3 * (np.array([0.25, 0.3, 0.3]) + 0.5 * place + 0.01 * jitter)
    return resting(position, 0.24e-3, box)


@cache
def run(seed):
    case = tiny(f"seed={seed}", "grains.radius_mm=0.24", "fines.radius_mm=0.04")
    box = np.array([[0, 3e-3], [0, 1.6e-3], [0, 1.6e-3]])
    grains = lattice(box)
    invaded = [
        (x * 1e-3, y * 1e-3, z * 1e-3) for x, (y, z) in zip(DEPTHS[seed], HOLES, strict=True)
    ]
    fines = resting(np.array([*invaded, (-0.3e-3, 0.8e-3, 0.8e-3)]), FINE, box, Kind.FINE)
    state = State(
        case=case,
        grains=grains,
        damaged=grains.joined(fines),
        history=np.zeros((1, 4)),
        ending=dict.fromkeys(ENDING, 0),
    )
    return examine("specimen1", state)


def sources(*seeds, specimens=("specimen1",), **tables):
    runs = [run(seed) for seed in seeds or (1,)]
    return Sources(
        examined=dict.fromkeys(specimens, runs),
        thesis=dict.fromkeys(specimens, NUMBERS),
        tables=FigureTables(**tables),
    )


def drawn(draw, given, **which):
    figure = Figure(layout="constrained")
    draw(figure, given, **which)
    figure.draw_without_rendering()
    return figure


def labelled(axes, words):
    """The artist whose label begins with `words`."""
    (artist,) = [one for one in axes.get_children() if str(one.get_label()).startswith(words)]
    return artist


def test_the_invaded_fraction_is_of_the_fines_inside():
    axes = drawn(invaded_fraction, sources(), specimen="specimen1").axes[0]
    heights, edges, _ = labelled(axes, "4 invaded fines (thesis 704)").get_data()
    assert edges == pytest.approx(np.arange(0, 3.01, 0.25))
    assert heights == pytest.approx([0, 0, 0.75, 0, 0.25] + [0] * 7)
    assert labelled(axes, "thesis, its first bin").get_ydata() == [0.7]
    assert labelled(axes, "deepest fine").get_xdata()[0] == pytest.approx(1.0)
    assert labelled(axes, "thesis: depth").get_xdata()[0] == 2.0
    assert labelled(axes, "deeper than 0.5 mm: 25 % (thesis: below 5 %)") is not None


def test_several_seeds_show_their_mean_and_range():
    axes = drawn(invaded_fraction, sources(1, 2), specimen="specimen1").axes[0]
    heights = (
        labelled(axes, "4 invaded fines (thesis 704), mean and range of 2 seeds").get_data().values
    )
    assert heights[[2, 4, 6]] == pytest.approx([0.625, 0.25, 0.125])
    segments = axes.collections[0].get_segments()
    assert segments[2][:, 1] == pytest.approx([0.5, 0.75])


def test_curves_of_several_seeds_have_a_band():
    given = sources(1, 2, specimens=("specimen3", "specimen6"))
    axes = drawn(compared_fraction, given, specimens=("specimen3", "specimen6")).axes[0]
    band = axes.collections[0].get_paths()[0].vertices
    assert band[:, 1].max() == pytest.approx(0.75)
    assert labelled(
        axes, "specimen 3: fines 0.08 mm across"
    ).get_data().values.sum() == pytest.approx(1.0)


def test_the_lost_porosity_is_the_fines_volume_over_the_box():
    axes = drawn(porosity_reduction, sources(), specimen="specimen1").axes[0]
    heights, edges, _ = labelled(axes, "bins of 0.25 mm").get_data()
    fine = 4 / 3 * np.pi * 0.04**3 / (0.25 * 1.6**2)
    assert heights[[1, 2, 3, 4]] == pytest.approx(np.array([1.5, 1.5, 0.5, 0.5]) * fine, rel=0.05)
    assert heights[5:] == pytest.approx(0, abs=1e-4)
    whole = labelled(axes, "whole specimen").get_ydata()[0]
    assert whole == pytest.approx(np.average(heights, weights=np.diff(edges)), abs=1e-5)
    assert labelled(axes, "thesis, initial less damaged").get_ydata()[0] == 0.01


def test_the_total_loss_stands_beside_that_of_the_first_millimetre():
    given = sources(1, 2, specimens=("specimen1", "specimen3"))
    axes = drawn(total_reduction, given, specimens=("specimen1", "specimen3")).axes[0]
    whole, first = axes.containers
    fine = 4 / 3 * np.pi * 0.04**3 / 1.6**2
    assert [bar.get_height() for bar in whole] == pytest.approx([4 * fine / 3] * 2, rel=0.05)
    assert [bar.get_height() for bar in first] == pytest.approx([3 * fine] * 2, rel=0.05)
    low, high = axes.collections[1].get_segments()[0][:, 1]
    assert (low, high) == pytest.approx((2.5 * fine, 3.5 * fine), rel=0.05)


def test_permeability_stands_beside_the_thesis_s_sections():
    examined = run(1)
    axes = drawn(permeability, sources(), specimen="specimen1").axes[0]
    wanted = [s.k_damaged / s.k_initial for s in examined.thesis.sections]
    assert labelled(axes, "the thesis's laws, section cut out").get_data().values == pytest.approx(
        wanted
    )
    wanted = [s.k_damaged_inplace / s.k_initial_inplace for s in examined.default.sections]
    assert labelled(
        axes, "fdnet's default laws, section in place"
    ).get_data().values == pytest.approx(wanted)
    points = labelled(axes, "thesis, 1 mm sections")
    assert list(points.get_xdata()) == [0.5, 1.5]
    assert list(points.get_ydata()) == pytest.approx([0.75, 0.96])


def test_compared_permeability_has_a_panel_for_each_pair_of_laws():
    names = ("specimen3", "specimen6")
    figure = drawn(compared_permeability, sources(specimens=names), specimens=names)
    for axes, analysis in zip(figure.axes, (run(1).thesis, run(1).default), strict=True):
        assert labelled(axes, "specimen 3").get_ydata() == pytest.approx(
            ratios(analysis, inplace=False)
        )


def test_the_first_section_holds_whole_pores_and_their_throats():
    cut = whole_pores(run(1))
    network = run(1).thesis.network
    assert len(cut.pore_radius) == np.sum(
        (network.pore_position[:, 0] < 1e-3) & (network.pore_share == 1)
    )
    assert 0 < len(cut.throat_radius) < len(network.throat_radius)
    assert cut.throat_depth.max() < 1.0
    inside = 3 * 4 / 3 * np.pi * 0.04**3
    assert np.sum(cut.pore_volume - cut.pore_volume_left) == pytest.approx(inside, rel=1e-3)


def test_sizes_are_densities_of_all():
    figure = drawn(sizes, sources(), specimen="specimen1")
    cut = whole_pores(run(1))
    heights, edges, _ = labelled(figure.axes[0], f"{len(cut.throat_radius)} throats").get_data()
    within = share_within(cut.throat_radius, 0.0, edges[-1])
    assert np.sum(heights * np.diff(edges)) == pytest.approx(within, abs=0.01)
    assert "(thesis: about 30 %)" in figure.axes[0].get_title(loc="left")


def test_density_counts_what_lies_outside_in_the_whole():
    assert density(np.array([0.1, 0.6, 0.7, 3.0]), np.array([0.0, 0.5, 1.0])) == pytest.approx(
        [0.5, 1.0]
    )


def test_throats_are_closed_empty_filled_or_blocked():
    cut = whole_pores(run(1))
    shares = contents(cut)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert shares["with fines"] == pytest.approx(np.mean((cut.throat_fines > 0) & ~cut.blocked))
    left, right = drawn(throat_porosity, sources(), specimen="specimen1").axes
    assert [bar.get_height() for bar in left.patches] == pytest.approx(list(shares.values()))
    assert right.patches[0].get_data().values.sum() * 0.05 == pytest.approx(1.0)


def test_a_blocked_throat_is_not_among_those_with_fines():
    cut = replace(
        whole_pores(run(1)),
        throat_radius=np.array([0.0, 0.1, 0.1, 0.1, 0.1]),
        throat_fines=np.array([0, 0, 1, 2, 0]),
        blocked=np.array([False, False, False, True, True]),
    )
    assert list(contents(cut).values()) == pytest.approx([0.2, 0.2, 0.2, 0.4])


def test_throats_by_depth_count_each_once():
    axes = drawn(throats_by_depth, sources(), specimen="specimen1").axes[0]
    count = len(whole_pores(run(1)).throat_radius)
    assert labelled(axes, f"all throats, {count}").get_data().values.sum() == count


def test_the_slab_is_one_grain_thick():
    y = np.array([0.7, 0.85, 1.2, 1.35]) * 1e-3
    grains = resting(np.column_stack([np.full(4, 1e-3), y, y]), 0.24e-3, run(1).state.grains.box)
    assert middle_slab(grains).position[:, 1] == pytest.approx(y[1:3])


def test_far_grains_are_darker_and_painted_first():
    axes = drawn(pack, sources(), specimen="specimen1").axes[0]
    tones = axes.collections[0].get_facecolors()[:, 0]
    assert len(tones) == 54
    assert tones[0] < tones[-1]
    assert np.all(np.diff(tones) >= 0)
    last = axes.collections[0].get_offsets()[-1]
    front = run(1).state.grains.position[np.argmin(run(1).state.grains.position[:, 1])]
    assert last == pytest.approx(1e3 * front[[0, 2]])


def test_fines_are_counted_by_size_class():
    figure = drawn(fines_by_size, sources(), specimen="specimen1")
    small = labelled(figure.axes[1], "radius 0.02–0.03 mm, 0 fines").get_data().values
    large, edges, _ = labelled(figure.axes[1], "radius 0.035–0.05 mm, 4 fines").get_data()
    assert edges[1] == pytest.approx(0.5)
    assert small.sum() == 0
    assert list(large[:3]) == [0, 3, 1]


def scan(seed, value, depth, specimen="quick-specimen7"):
    return ScanRow(
        specimen=specimen,
        seed=seed,
        value=value,
        depth_mean_mm=0.5 * depth,
        depth_p95_mm=depth,
        depth_max_mm=2 * depth,
    )


def test_the_drag_figure_shows_the_mean_and_range_over_seeds():
    rows = [scan(1, 10.0, 2.0), scan(2, 10.0, 4.0), scan(1, 1.0, 1.0)]
    values, ranges = over_seeds(rows, "depth_p95_mm")
    assert values == pytest.approx([1.0, 10.0])
    assert ranges == pytest.approx(np.array([[1.0, 1.0, 1.0], [3.0, 2.0, 4.0]]))
    axes = drawn(invasion_depth, sources(drag=rows, specimens=("table3",))).axes[0]
    assert list(labelled(axes, "deepest fine").get_ydata()) == pytest.approx([2.0, 6.0])
    assert axes.get_xscale() == "log"
    assert axes.get_title(loc="left") == "specimen 7, quick form"
    assert list(labelled(axes, "thesis, Table 3").get_ydata()) == [2.0]


def test_table_3_stands_beside_its_own_fines_alone():
    rows = [scan(1, 1.0, 1.0, "quick-specimen5"), scan(1, 1.0, 2.0, "quick-specimen7")]
    five, seven = drawn(invasion_depth, sources(drag=rows, specimens=("table3",))).axes
    assert not [line for line in five.lines if line.get_label().startswith("thesis")]
    assert labelled(seven, "mean depth").get_ydata() == [1.0]
    assert labelled(seven, "thesis") is not None


def test_distances_are_shares_by_place():
    given = sources(
        distances={"below 0.4": np.array([0.2, 0.45, 0.75, 1.5])}, specimens=("specimen5",)
    )
    axes = drawn(distances, given, porosity="below 0.4").axes[0]
    assert sum(bar.get_height() for bar in axes.patches) == pytest.approx(1.0)
    labels = [one.get_label() for one in axes.containers]
    assert labels == [
        "nearer the axis: 50 %",
        "nearer the wall: 25 %",
        "centred outside the throat: 25 %",
    ]
    assert "thesis: about 50 % nearer the axis" in axes.get_title(loc="left")


def test_tetrahedra_stand_side_by_side():
    axes = drawn(
        tetrahedra, sources(tetrahedra={"specimen1": (50, 12), "specimen5": (400, 11)})
    ).axes[0]
    assert [bar.get_height() for bar in axes.patches] == [50, 400, 12, 11]


def test_all_that_is_there_is_drawn_and_what_is_missing_named(tmp_path):
    rows = [scan(1, 1.0, 1.0), scan(2, 1.0, 2.0)]
    tables = FigureTables(
        drag=rows, friction=rows, supply=rows, distances={"below 0.4": np.array([0.3])}
    )
    figures = draw_all(
        {"specimen1": [run(1), run(2)]}, tmp_path, thesis={"specimen1": NUMBERS}, tables=tables
    )
    assert [one.name for one in figures] == list(FIGURES)
    by_name = {one.name: one for one in figures}
    for one in figures:
        assert (one.path is None) == bool(one.missing)
        if one.path is not None:
            assert one.path.stat().st_size < 150_000
    made = {name for name, one in by_name.items() if one.path is not None}
    assert {name for name in made if "specimen1" in name} == {
        name for name in FIGURES if "specimen1" in name
    }
    assert "figure_56_distances_specimen5.png" in made
    assert by_name["figure_57_distances_specimen5.png"].missing == ("distances 0.4 to 0.6",)
    assert by_name["figure_72_permeability.png"].missing == ("specimen3", "specimen6")
    assert by_name["figure_33-35_tetrahedra.png"].missing == ("tetrahedra",)
    caption = by_name["figure_15_invaded_fraction_specimen1.png"].caption
    assert caption.startswith("Thesis Figure 15, specimen 1:")
    assert "about 70% in its first bin" in caption
    assert (
        "Thesis: throat radius 0 to 0.05 mm: about 30 %."
        in by_name["figure_42_sizes_specimen1.png"].caption
    )


def test_every_figure_of_the_thesis_that_can_be_drawn_is_in_the_table():
    numbers = {9, 13, *range(14, 23), 33, 42, *range(44, 74)}
    assert {
        int(name.split("_")[1].split("-")[0].rstrip("BCb")) for name in FIGURES if name[0] == "f"
    } == numbers


def test_a_growing_pack_shows_the_velocities_of_each_state():
    """Arrows are the grains' velocities in x and z, the title names the fastest of all grains."""
    box = np.array([[0, 3e-3], [0, 1.6e-3], [0, 1.6e-3]])
    grains = lattice(box)
    stages = [
        replace(grains, velocity=speed * np.tile([0.6, 0.0, 0.8], (len(grains), 1)))
        for speed in (2.0, 5.0, 0.0)
    ]
    figure = Figure()
    growth(figure, Sources(examined={}, tables=FigureTables(growth=stages)))
    for axes, speed in zip(figure.axes, (2.0, 5.0, 0.0), strict=True):
        (arrows,) = [one for one in axes.collections if isinstance(one, Quiver)]
        assert np.allclose(arrows.U, 0.6 * speed)
        assert np.allclose(arrows.V, 0.8 * speed)
        assert f"fastest grain {speed:.2g} m/s" in axes.get_title(loc="left")


def test_sentences_without_their_number_are_left_out():
    assert filled_in("{specimen1.reductions[1]:g} there", {"specimen1": NUMBERS}) == "0.04 there"
    assert filled_in("{specimen1.reductions[5]:g} there", {"specimen1": NUMBERS}) == ""
    assert filled_in("{specimen2.invaded_depth_mm:g} mm", {"specimen1": NUMBERS}) == ""
    assert filled_in("{specimen1.invaded_depth_mm:g} mm", {"specimen1": NO_NUMBERS}) == ""


def test_the_values_file_gives_each_specimen_its_numbers():
    numbers = thesis_values().by_case
    assert set(numbers) == {"table3", *(f"specimen{number}" for number in range(1, 9))}
    assert numbers["specimen5"].porosity_loss == pytest.approx(0.08)
    assert numbers["specimen5"].reductions[0] == 0.32
    assert numbers["specimen8"].reductions == (0.25,)
    claims = numbers["specimen5"].deposition
    assert [one.nearer for one in claims] == ["axis", "wall", "wall"]
    assert [one.throat_porosity for one in claims] == list(POROSITY_CLASSES.values())
    assert not numbers["specimen1"].deposition
    assert numbers["specimen7"].size_classes_mm == ((0.025, 0.03), (0.045, 0.05))
    assert numbers["specimen1"].invaded_depth_mm == 4.0
    (share,) = [one for one in numbers["specimen1"].statistics if one.quantity == "throat length"]
    assert (share.between, share.words) == ((0.2, 0.6), "about 80 %")


def test_tables_are_filled_from_what_is_examined():
    assert tetrahedra_counted({"specimen1": [run(1)], "specimen2": []})["specimen1"][0] > 0
    by_class = distances_by_class([run(1), run(2)])
    assert list(by_class) == list(POROSITY_CLASSES)
    sections = [first_millimetre(run(seed), whole=True) for seed in (1, 2)]
    pairs = [np.sum(section.throat_weight[section.occupancy.pair_throat]) for section in sections]
    assert sum(len(one) for one in by_class.values()) == sum(pairs) > 0
    assert distances_by_class([]) == {}


def test_a_scan_s_row_is_a_result():
    row = result_rows(run(2))[0]
    scanned = scan_row("specimen5", 0.3, row)
    assert (scanned.seed, scanned.value, scanned.count_first_mm) == (2, 0.3, row.count_first_mm)
    assert (scanned.depth_mean_mm, scanned.depth_max_mm) == pytest.approx((0.875, 1.5))
    assert scanned.depth_p95_mm == row.invasion_depth_p95_mm


def test_percent():
    assert [percent(one) for one in (0.0, 0.0333, 0.704, 0.998)] == [
        "0 %",
        "3.3 %",
        "70 %",
        "100 %",
    ]


def test_few_colours_keep_the_frequent_ones():
    pixels = np.full((10, 30, 3), 255, np.uint8)
    pixels[0, :, 1] = np.arange(30)
    pixels[1] = [10, 20, 30]
    index, palette = few_colours(pixels)
    assert np.array_equal(palette[index], pixels)
    many = np.zeros((100, 100, 3), np.uint8)
    many[:50, :, 0], many[:50, :, 1] = np.arange(50)[:, None], np.arange(100)
    index, palette = few_colours(many)
    assert np.all(palette[index][50:] == 0)
    assert len(palette) == 64
