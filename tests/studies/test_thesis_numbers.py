"""The thesis's numbers and ours, on a simple cubic lattice with fines placed by hand.

Cells of edge A have grains of radius R = A/2 at their corners. Each cell is one pore of radius
(sqrt(3)/2 - 1/2) A. Each square face is two throats (its triangles) on one axis, of length A and
radius (1/sqrt(2) - 1/2) A. Layers of whole cells are centred at 0.6, 1.1 and 1.6 mm; the faces of
the specimen cut the layers at the ends.
"""

from dataclasses import fields, replace
from itertools import combinations
from math import pi, sqrt

import numpy as np
import pytest
from builders import resting_spheres, tiny
from scipy.spatial import Delaunay

from fdnet.dem.deck import specimen_box
from fdnet.errors import CaseError
from fdnet.spheres.snapshot import Kind, resting
from validation.engine.bands import wilson_interval
from validation.thesis.numbers.deposition import deposition, write_deposition
from validation.thesis.numbers.examine import DEFAULT_PAIR, THESIS_PAIR, Examined, examine
from validation.thesis.numbers.first_millimetre import first_millimetre
from validation.thesis.numbers.grains_alone import sizes_of_grains_alone
from validation.thesis.numbers.invasion import deep_near_wall, porosity_loss
from validation.thesis.numbers.results import (
    COLUMNS,
    read_results,
    result_rows,
    write_results,
)
from validation.thesis.numbers.statistics import (
    POROSITY,
    SINGLES,
    SIZES,
    measure,
    share_of_sizes,
    statistics,
    within,
    write_statistics,
)
from validation.thesis.numbers.tetrahedra import count_tetrahedra, tetrahedra, write_tetrahedra
from validation.thesis.numbers.values import (
    ThesisSpecimen,
    specimen_number,
    thesis_of,
    thesis_values,
)
from validation.thesis.runs.state import State

MM = 1e-3
A, R = 0.5, 0.25
TUBE = (1 / sqrt(2) - 0.5) * A
WIDE, THIN = 0.1, 0.02
# x, y, z, radius in mm; all lie midway between two cells, some on the axis of the face's throats;
# the three wide ones are a little apart, so that none lies inside others, which would leave it out
APART = 2e-4
FINES = [
    [0.6, 0.0, 0.25, 0.05],
    [0.6, 0.5 + 0.5, 0.25 + 0.08, THIN],
    [0.6 + 0.11, 0.5, 0.75, THIN],
    *([0.6, 0.5 + y, 1.25 + z, WIDE] for y, z in ((-APART, 0.0), (APART, 0.0), (0.0, APART))),
    [1.6, 1.0, 1.25, 0.05],
    [-0.3, 0.5, 0.5, 0.05],
]


def ball(radius):
    return 4 / 3 * pi * radius**3


def state(*assignments, fines=FINES):
    case = tiny(
        "box.size_mm=[2.2,2.0,2.0]", "box.sides=periodic", "analysis.sections=2", *assignments
    )
    box = MM * np.array([[0.0, 2.2], [0.0, 2.0], [0.0, 2.0]])
    x, side = 0.35 + A * np.arange(4), A * np.arange(4)
    place = MM * np.stack(np.meshgrid(x, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    grains = resting_spheres(place, R * MM, box, kind=Kind.GRAIN)
    fines = MM * np.array(fines)
    small = resting_spheres(fines[:, :3], 1.0, box, kind=Kind.FINE, first=1000)
    ending = {
        "supplied": len(fines),
        "passed": 0,
        "upstream": 1,
        "stop_reason": "plugged",
        "seconds": 12.0,
    }
    ending |= {
        "pack_seconds": 1.5,
        "steps": 1000,
        "dt_s": 2e-6,
        "max_overlap": 0.01,
        "warnings": [],
    }
    return State(
        case=case,
        grains=grains,
        damaged=grains.joined(replace(small, radius=fines[:, 3])),
        history=np.zeros((1, 4)),
        ending=ending,
    )


@pytest.fixture(scope="module")
def lattice():
    return examine("specimen5-5to6", state())


def test_every_number_told_has_its_source():
    values = thesis_values()
    assert sorted(values.specimens) == [*"12345678", "table3"]
    plain = {
        "id",
        "porosity",
        "fine_diameter_mm",
        "fine_radius_mm",
        "grain_radius_mm",
        "sources",
        "senses",
        "statistics",
        "deposition",
    }
    for one in values.specimens.values():
        given = {
            field.name
            for field in fields(ThesisSpecimen)
            if getattr(one, field.name) not in (None, {}, ())
        } - plain
        assert given == set(one.sources), one.id
        assert set(one.senses) <= given
    for number in (*values.statistics, *(one for one in values.deposition if one.nearer)):
        assert number.source.startswith(("Figure", "Table", "section"))
        assert number.sense in ("exact", "about", "at least", "at most")
    for number in values.statistics:
        assert number.quantity in (SINGLES if number.between is None else {*SIZES, POROSITY})


def test_tables_8_and_10_are_read_by_section():
    assert thesis_of("specimen1").reductions == (0.25, 0.038, 0.033, 0.037, 0, 0, 0, 0)
    assert thesis_of("specimen5").reductions == (0.32, 0.047, 0.078, 0.057, 0.006, 0.003, 0, 0)
    assert thesis_of("specimen6").reductions == (0.40,)
    assert thesis_of("specimen2").reductions == ()


@pytest.mark.parametrize(
    ("run", "number"),
    [
        ("specimen1", "1"),
        ("specimen1-7to8", "1"),
        ("specimen1-1410", "1"),
        ("specimen5 friction=0", "5"),
        ("specimen8-quick", "8"),
        ("table3", "table3"),
        ("table3-drag2", "table3"),
        ("specimen10", None),
        ("quick", None),
    ],
)
def test_a_run_is_compared_with_its_specimen(run, number):
    assert specimen_number(run) == number


def test_one_row_for_each_pair_of_laws_with_the_thesis_beside_it(lattice):
    rows = result_rows(lattice)
    assert [(row.law, row.damage_law) for row in rows] == [THESIS_PAIR, DEFAULT_PAIR]
    for row, analysis in zip(rows, lattice.analyses.values(), strict=True):
        assert row.k_reduction == analysis.k_reduction
        assert row.k_reductions[:2] == tuple(one.k_reduction for one in analysis.sections)
        second = analysis.sections[1]
        assert (
            row.k_reductions_inplace[1] == 1 - second.k_damaged_inplace / second.k_initial_inplace
        )
        assert np.all(np.isnan([*row.k_reductions[2:], *row.k_reductions_inplace[2:]]))
        assert row.thesis_k_reductions == thesis_of("specimen5").section_reduction
        assert (row.thesis_depth_mm, row.thesis_count_first_mm) == (8.0, 2000)
        assert np.isnan(row.thesis_invaded_count)


def test_fines_are_counted_by_depth(lattice):
    row = result_rows(lattice)[0]
    assert (row.supplied_count, row.invaded_count, row.count_first_mm) == (8, 7, 6)
    assert row.invasion_depth_mm == pytest.approx(1.6)
    assert row.mean_depth_mm == pytest.approx((6 * 0.6 + 0.11 + 1.6) / 7)
    assert (row.fraction_first_0p25mm, row.fraction_beyond_0p5mm) == (0, 1)
    assert row.fraction_first_mm == pytest.approx(6 / 7)
    assert row.time_ms == pytest.approx(2.0)
    assert row.porosity_loss_first_mm == porosity_loss(lattice.state, lattice.thesis, MM)


def test_deep_fines_near_a_wall():
    """Of four beyond 1 mm two lie within 0.25 mm of a side.

    One at the face and one beyond the outlet do not count.
    """
    case = tiny("grains.radius_mm=0.25")
    x, y, z = (
        [1.2, 1.4, 1.6, 2.9, 0.1, 3.1],
        [0.2, 0.8, 0.8, 0.8, 0.1, 0.1],
        [0.8, 0.8, 1.4, 1.3, 0.8, 0.8],
    )
    spheres = resting(1e-3 * np.column_stack([x, y, z]), 1e-5, specimen_box(case), Kind.FINE)
    made = State(
        case=case, grains=spheres.grains(), damaged=spheres, history=np.zeros((1, 4)), ending={}
    )
    assert deep_near_wall(made) == 0.5
    assert np.isnan(deep_near_wall(replace(made, case=tiny("box.sides=periodic"))))
    assert np.isnan(
        deep_near_wall(replace(made, damaged=spheres.where(spheres.position[:, 0] < 1e-3)))
    )


@pytest.mark.parametrize(
    "cut", ["analysis.profile_bin_mm=0.2", "analysis.sections=11", "analysis.sections=3"]
)
def test_porosity_loss_of_the_first_millimetre_whatever_the_cuts(cut):
    """Fines apart from the grains; the three that are almost at one place count once."""
    filled = ball(0.05) + 2 * ball(THIN) + ball(WIDE)
    changed = examine("specimen5", state(cut))
    assert porosity_loss(changed.state, changed.thesis, MM) == pytest.approx(
        filled / 4.0, rel=0.02
    )


def test_results_survive_their_file(lattice, tmp_path):
    rows = [
        *result_rows(lattice),
        *result_rows(Examined(**_parts(lattice) | {"id": "other", "seed": 7})),
    ]
    again = read_results(write_results(tmp_path / "results.csv", rows))
    assert [row.id for row in again] == ["specimen5-5to6"] * 2 + ["other"] * 2
    for one, other in zip(rows, again, strict=True):
        for field in fields(one):
            before, after = getattr(one, field.name), getattr(other, field.name)
            assert type(after) is type(before), field.name
            if isinstance(before, str):
                assert after == before
            else:
                assert after == pytest.approx(before, rel=1e-8, nan_ok=True), field.name
    assert np.isnan(again[2].thesis_depth_mm)
    header = (tmp_path / "results.csv").read_text().splitlines()[0].split(",")
    assert header == list(COLUMNS)
    assert header[18:34] == [f"k_reduction_{s}" for s in range(1, 9)] + [
        f"k_reduction_inplace_{s}" for s in range(1, 9)
    ]


def test_a_table_with_other_columns_is_refused(tmp_path):
    path = tmp_path / "results.csv"
    path.write_text("id,seed\nquick,1\n")
    with pytest.raises(CaseError, match="expected"):
        read_results(path)


def test_more_sections_than_columns_are_refused(lattice):
    crowded = replace(lattice.thesis, sections=lattice.thesis.sections * 5)
    with pytest.raises(CaseError, match="10 sections"):
        result_rows(Examined(**_parts(lattice) | {"analyses": {THESIS_PAIR: crowded}}))


def test_sizes_of_the_lattice(lattice):
    section = first_millimetre(lattice, whole=True)
    # 16 cells; their faces across y and z, and those towards the second layer, at 0.85 mm
    assert section.throat_weight.sum() == 2 * (32 + 16)
    assert np.sum(section.pore_weight * section.network.pore_volume) == pytest.approx(
        16 * (A**3 - ball(R)) * MM**3
    )
    pore, throat = (sqrt(3) / 2 - 0.5) * A, TUBE
    for quantity, size in (("pore radius", pore), ("throat radius", throat), ("throat length", A)):
        assert measure(section, quantity, (0.999 * size, 1.001 * size)) == (1.0, "share")
        assert measure(section, quantity, (0.0, 0.999 * size)) == (0.0, "share")
    inscribed = "volume of the inscribed sphere of a pore"
    assert measure(section, inscribed, (0.999 * ball(pore), 1.001 * ball(pore)))[0] == 1.0


def test_sizes_of_the_grains_alone(lattice):
    """A regular tetrahedron of touching grains, and a fifth grain mirrored in one of its facets.

    They are two pores of radius (sqrt(3/2) - 1) R, centred sqrt(2/3) R / 2 off the facet that they
    share, whose inscribed radius is (2/sqrt(3) - 1) R.
    """
    corner = R * np.array([[1, 1 / sqrt(3), 0], [-1, 1 / sqrt(3), 0], [0, -2 / sqrt(3), 0]])
    tips = R * np.array([[0, 0, sqrt(8 / 3)], [0, 0, -sqrt(8 / 3)], [8, 0, 0], [9, 1, 0]])
    box = lattice.state.grains.box
    grains = resting_spheres(MM * (np.vstack([corner, tips]) + 0.5), R * MM, box, kind=Kind.GRAIN)
    changed = Examined(
        **_parts(lattice) | {"state": replace(lattice.state, grains=grains, damaged=grains)}
    )
    sizes = sizes_of_grains_alone(changed)
    assert sizes.pore_radius == pytest.approx([(sqrt(1.5) - 1) * R * MM] * 2)
    assert sizes.throat_radius == pytest.approx([(2 / sqrt(3) - 1) * R * MM])
    assert sizes.throat_length == pytest.approx([sqrt(2 / 3) * R * MM])
    # porosity of that tetrahedron, edge 2 R
    void = 0.220364 * (2 * R) ** 3 / (6 * sqrt(2))
    assert 1e9 * sizes.pore_volume == pytest.approx([void] * 2, rel=1e-5)
    for quantity, size in (("throat length", sqrt(2 / 3) * R), ("pore volume", void)):
        assert share_of_sizes(sizes, quantity, (0.999 * size, 1.001 * size)) == 1.0


def test_throats_of_the_grains_alone_are_the_facets_that_two_tetrahedra_share(lattice):
    place = 0.2 + 0.7 * np.random.default_rng(3).random((12, 3))
    grains = resting_spheres(MM * place, 0.05 * MM, lattice.state.grains.box, kind=Kind.GRAIN)
    changed = Examined(
        **_parts(lattice) | {"state": replace(lattice.state, grains=grains, damaged=grains)}
    )
    corners = [set(one.tolist()) for one in Delaunay(place).simplices]
    shared = [
        sorted(one & other) for one, other in combinations(corners, 2) if len(one & other) == 3
    ]
    side = np.array(
        [[np.linalg.norm(place[a] - place[b]) for a, b in combinations(one, 2)] for one in shared]
    ).T
    half = side.sum(axis=0) / 2
    area = np.sqrt(half * np.prod(half - side, axis=0))
    # equal grains: the circle touching three is their circumcircle less the radius
    expected = np.maximum(np.prod(side, axis=0) / (4 * area) - 0.05, 0)
    assert np.sort(1e3 * sizes_of_grains_alone(changed).throat_radius) == pytest.approx(
        np.sort(expected)
    )


def test_a_pore_whose_sphere_is_centred_outside_has_no_radius(lattice):
    """A flat tetrahedron: three grains around a fourth just above their plane."""
    place = [[0.3, 0, 0], [-0.15, 0.26, 0], [-0.15, -0.26, 0], [0, 0, 0.05]]
    grains = resting_spheres(
        MM * (np.array(place) + 0.5), 0.1 * MM, lattice.state.grains.box, kind=Kind.GRAIN
    )
    changed = Examined(
        **_parts(lattice) | {"state": replace(lattice.state, grains=grains, damaged=grains)}
    )
    sizes = sizes_of_grains_alone(changed)
    assert (sizes.pore_weight.tolist(), sizes.sphere_weight.tolist()) == ([1.0], [0.0])
    few = replace(lattice.state, damaged=grains.where(np.arange(4) < 3))
    assert (
        len(sizes_of_grains_alone(Examined(**_parts(lattice) | {"state": few})).throat_radius) == 0
    )


def test_parts_cut_by_the_face_fill_the_section(lattice):
    """The layer at the face is 0.35 mm deep, of which the mirrored half does not count."""
    section = first_millimetre(lattice, whole=False)
    filled = np.sum(section.pore_weight * section.network.pore_tetra_volume)
    assert filled == pytest.approx((0.35 + A) * 4.0 * MM**3)


def test_fines_in_throats_and_bodies(lattice):
    section = first_millimetre(lattice, whole=True)
    inside = {"A": ball(0.05), "B": ball(THIN), "D": 3 * ball(WIDE)}
    tube = pi * TUBE**2 * A
    assert measure(section, "throats with fines", None)[0] == pytest.approx(8 / 96)
    assert measure(section, "throats without fines", None)[0] == pytest.approx(88 / 96)
    assert measure(section, "throats blocked", None)[0] == 0
    assert measure(section, "throats of radius 0", None) == (0.0, "count")
    # what lies of the third fine in its throats: the only one not wholly inside
    occupancy = lattice.thesis.occupancy
    third = 1e9 * occupancy.pair_volume[np.isclose(occupancy.pair_distance, 0.11 / TUBE)]
    assert len(third) == 2
    assert np.all((third > 0) & (third < ball(THIN)))
    throats = 2 * sum(inside.values()) + third.sum()
    bodies = ball(0.05) + 2 * ball(THIN) + 3 * ball(WIDE)
    assert measure(section, "volume of fines in throats", None)[0] == pytest.approx(throats)
    assert measure(section, "volume of fines in pore bodies", None)[0] == pytest.approx(bodies)
    assert measure(section, "share of throats in the volume of fines", None)[0] == pytest.approx(
        throats / (throats + bodies)
    )
    assert measure(section, "overall throat porosity", None)[0] == pytest.approx(
        1 - throats / (96 * tube)
    )
    void = 16 * (A**3 - ball(R))
    assert measure(section, "overall pore-body porosity", None)[0] == pytest.approx(
        1 - bodies / void
    )
    assert measure(section, "mean porosity of throats with fines", None)[0] == pytest.approx(
        1 - throats / (8 * tube)
    )
    assert measure(section, "porosity of throats with fines", (0.6, 1.0))[0] == pytest.approx(
        6 / 8
    )


def test_statistics_name_the_figure_of_their_own_specimen_only(lattice, tmp_path):
    rows = statistics(lattice)
    compared = [row for row in rows if row.source]
    mine = [one for one in thesis_values().statistics if one.specimen == "5"]
    # sizes in three ways, the rest in two
    assert len(compared) == 2 * len(mine) + sum(one.quantity in SIZES for one in mine)
    assert {(row.source, row.thesis) for row in compared} == {
        (one.source, one.value) for one in mine
    }
    assert all(np.isnan(row.thesis) and not row.sense for row in rows if not row.source)
    lines = write_statistics(tmp_path / "statistics.csv", rows).read_text().splitlines()
    assert lines[0] == "id,seed,source,quantity,ours,thesis,sense,unit,note"
    assert len(lines) == 1 + len(rows)


def test_bands_hold_their_low_end_and_not_their_high_one():
    values = np.array([-0.1, 0.0, 0.4, 0.6, 1.0])
    assert within(values, (0.0, 0.4)).tolist() == [True, True, False, False, False]
    assert within(values, (0.4, 0.6)).tolist() == [False, False, True, False, False]
    assert within(values, (0.6, 1.0)).tolist() == [False, False, False, True, True]


def test_deposition_by_throat_porosity(lattice, tmp_path):
    rows = {(row.low, row.high): row for row in deposition(lattice)}
    clogged, middle, open_ = rows[0.0, 0.4], rows[0.4, 0.6], rows[0.6, 1.0]
    assert (clogged.throats, clogged.fines, clogged.nearer_axis, clogged.law) == (
        2,
        6,
        1.0,
        "clogging",
    )
    assert clogged.decided
    assert (middle.fines, middle.law, middle.decided) == (0, "", False)
    assert (open_.throats, open_.fines, open_.law) == (6, 6, "deposition")
    shares = (open_.nearer_axis, open_.nearer_wall, open_.beyond_wall)
    assert shares == pytest.approx((1 / 3, 1 / 3, 1 / 3))
    # 4 of 6 nearer the wall prove nothing
    assert not open_.decided
    assert open_.nearer_axis_volume / open_.nearer_wall_volume == pytest.approx((0.05 / THIN) ** 3)
    assert (clogged.nearer, clogged.thesis) == ("axis", 0.50)
    assert (open_.nearer, open_.thesis, open_.sense) == ("wall", 0.85, "at least")
    assert (
        len(
            write_deposition(tmp_path / "deposition.csv", list(rows.values()))
            .read_text()
            .splitlines()
        )
        == 7
    )


def test_wilson_interval_of_eight_in_ten():
    """0.490 to 0.943: the worked value in every textbook table; mirrored for two in ten."""
    low, high = wilson_interval(8, 10)
    assert (low, high) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    assert wilson_interval(2, 10) == pytest.approx((1 - high, 1 - low))
    assert np.all(np.isnan(wilson_interval(0, 0)))


def test_a_point_within_a_tetrahedron_makes_four_of_it():
    corner = MM * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    assert tetrahedra(corner) == 1
    assert tetrahedra(np.vstack([corner, [[0, 0, 0]]])) == 4
    assert tetrahedra(corner[:3]) == 0


def test_tetrahedra_of_the_first_millimetre(lattice, tmp_path):
    """Four grains there and a fine between them; what is upstream or deeper does not count."""
    place = 0.5 + 0.3 * np.array(
        [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1], [6, 0, 0], [7, 0, 0]]
    )
    box = lattice.state.grains.box
    grains = resting_spheres(MM * place, R * MM, box, kind=Kind.GRAIN)
    small = [[0.5, 0.5, 0.5], [-0.1, 0.5, 0.5], [1.01, 0.6, 0.7]]
    fines = resting_spheres(MM * np.array(small), 0.05 * MM, box, kind=Kind.FINE, first=1000)
    changed = replace(lattice.state, grains=grains, damaged=grains.joined(fines))
    count = count_tetrahedra(Examined(**_parts(lattice) | {"state": changed}))
    assert (count.grains, count.fines, count.tetrahedra_grains, count.tetrahedra_all) == (
        4,
        1,
        1,
        4,
    )
    assert count.ratio == 4
    assert (
        write_tetrahedra(tmp_path / "counts.csv", [count])
        .read_text()
        .endswith("specimen5-5to6,1,4,1,4,1,4\n")
    )


def _parts(examined):
    return {field.name: getattr(examined, field.name) for field in fields(examined)}
