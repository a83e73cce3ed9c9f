"""Curves of sizes in a case: what is accepted, refused, left out, placed and run."""

import json
import math
import tomllib

import numpy as np
import pytest

import fdnet
from fdnet.case.file import case_from, parse_sizes, read_case, read_size_file
from fdnet.dem.deck import specimen_box
from fdnet.dem.invade_deck import InvadeInputs
from fdnet.dem.supply import batches_of, densities, drawn_fines, place_batches
from fdnet.errors import CaseError
from fdnet.scales.contacts import mass_range
from fdnet.scales.scales import scales_of
from fdnet.scales.table import scale_rows
from fdnet.spheres.snapshot import Kind, resting

SAND = {"D10": "0.25 mm", "D50": "0.40 mm", "D90": "0.60 mm"}
MUD = {"D10": "20 um", "D50": "40 um", "D90": "80 um"}
BARITE = {"D50": "30 um", "D90": "50 um"}
MIXTURE = [
    {"name": "CaCO3", "density": "2.71 g/cc", "share": 3.0, "sizes": MUD},
    {"name": "barite", "density": "4.2 g/cc", "share": 1.0, "sizes": BARITE},
]


def measured(*, grains=SAND, fines=MUD, **keys) -> dict:
    more = {"cut": "25 um", "slab": "0.5 mm", "concentration": "5 %"} | keys
    return {
        "name": "measured",
        "box": {"size_mm": [3.0, 2.4, 2.4]},
        "grains": {"sizes": grains, "porosity": 0.38},
        "fines": ({"sizes": fines} if fines else {}) | more,
    }


def problem(data: dict) -> str:
    with pytest.raises(CaseError, match="1 problem:") as caught:
        case_from(data)
    return str(caught.value)


def test_sizes_are_diameters_and_their_moments_are_used():
    """A log-normal curve between cuts; volumes by number from its third moment."""
    case = case_from(measured())
    fines, spread = case.fines, math.log(2) / 1.2815515655446004
    assert fines.sizes.fit.law.spread == pytest.approx(spread)
    coarsest = 20e-6 * math.exp(2.3263478740408408 * spread)
    assert fines.radius_range_m == pytest.approx((12.5e-6, coarsest))
    assert fines.mean_volume_m3 == pytest.approx(math.pi / 6 * fines.curve.mean(3), rel=1e-12)
    assert not fines.one_size
    assert fines.placed_fraction == pytest.approx(0.05 * fines.curve.kept)
    rows = {row[0]: row for row in scale_rows(case, scales_of(case))}
    row = rows["grains: 50 % by volume finer than"]
    assert row[2] == pytest.approx((0.25 * 0.40 * 0.60) ** (1 / 3) * 1e-3, rel=1e-6)
    assert "given 0.0004 m (-2.1 %)" in row[4]
    assert "fines: 10 % by volume finer than" not in rows


def test_a_bad_curve_gets_one_clear_problem():
    three = {"size_mm": [0.1, 0.2, 0.3]}
    by_number = {"size_mm": [0.1, 0.2], "passing_percent": [5, 100], "by": "number"}
    for part, expected in [
        ({"D50": "40 um"}, "gives 1 of D10, D50 and D90"),
        ({"D10": "20 um", "size_mm": [0.1, 0.2], "passing_percent": [0, 100]}, "beside a meas"),
        (three | {"passing_percent": [0, 60, 50]}, "the curve must not fall"),
        (three | {"passing_percent": [0, 100]}, "3 sizes with 2 percentages"),
        (SAND | {"cut_percent": [0.0, 99.0]}, "has no ends"),
        (by_number, "spheres of unknown size have no volume"),
        ({"D10": "20 psi", "D50": "40 um"}, "'psi' is a unit of pressure"),
        ({"file": "none.csv"}, "cannot be read as a table of sizes"),
    ]:
        assert expected in problem(measured(grains=part)), part
    coarse, medium = {"D10": "1.0 mm", "D90": "1.05 mm"}, {"D10": "0.6 mm", "D90": "0.65 mm"}
    big = measured(grains=coarse, fines=medium) | {"box": {"size_mm": [9.0] * 3}}
    for data, expected in [
        (measured(cut="150 um"), "leaves nothing of a curve that ends at 141 um"),
        (measured(fines={"D10": "0.1 mm", "D90": "1 mm"}), ", expected below grains.sizes"),
        (big, "above every throat between touching grains"),
        (measured(radius_mm=0.02), "give exactly one of radius_mm, sizes and materials"),
        (measured(fines=None, materials=[MIXTURE[0]] * 2), "'CaCO3' is listed twice"),
    ]:
        assert expected in problem(data), expected


def test_materials_have_their_shares_of_mass_and_their_densities(tmp_path):
    """Also in the data files of the batches, read back by id."""
    data = measured(fines=None, materials=MIXTURE, supply="batches", slab="3 mm")
    case = case_from(data | {"run": {"checkpoint_ms": 0.005}, "drag": {"field": "uniform"}})
    scales, fines = scales_of(case), case.fines
    counts = batches_of(case, scales).counts
    density, drawn = densities(case, counts), drawn_fines(case, counts)
    mass = density * np.concatenate([batch.radius for batch in drawn]) ** 3
    assert set(density) == {2710.0, 4200.0}
    first, second = fines.components
    ratio = np.sum(mass[density == 4200]) / np.sum(mass[density == 2710])
    assert ratio == pytest.approx(second.curve.kept / (3 * first.curve.kept), rel=0.01)
    assert fines.solids_density_kg_m3 == pytest.approx(4 / (3 / 2710 + 1 / 4200))
    assert mass_range(fines)[0] == pytest.approx(2710 * math.pi / 6 * 25e-6**3)
    assert case_from(tomllib.loads(case.toml())) == case
    grain = resting(np.array([[1.5e-3, 1.2e-3, 1.2e-3]]), 2e-4, specimen_box(case))
    InvadeInputs(case, scales, grain, tmp_path).write()
    rows = {}
    for path in [tmp_path / "invade.data", *(tmp_path / "supply").glob("*.data")]:
        lines = path.read_text().split("Atoms\n\n")[1].splitlines()
        rows |= {int(line.split()[0]): [float(x) for x in line.split()[1:4]] for line in lines}
    placed = np.concatenate([batch.radius for batch in place_batches(case, scales, grain)])
    assert len(rows) == len(density) + 1
    start = int(grain.id.max()) + 1
    for number, (own, radius) in enumerate(zip(density, placed, strict=True), start):
        assert rows[number] == pytest.approx([Kind.FINE, 2 * radius, own])


# ---- Tables of sizes.
CURVE = ((0.075, 0), (0.15, 6), (0.3, 35), (0.6, 85), (1.18, 100))


def test_tables_of_instruments_and_sieves_are_read(tmp_path):
    sizes, finer = parse_sizes("size_um,passing_percent\n10,0\n20,40.5\n80,100\n")
    assert sizes == pytest.approx([0.01, 0.02, 0.08])
    assert finer == [0, 40.5, 100]
    for header, rows, encoding in [
        ("Size (µm),Vol Under %", [(1e3 * d, f) for d, f in CURVE], "cp1252"),
        ("r_mm;mass % finer", [(d / 2, f) for d, f in CURVE], "utf-8-sig"),
        ("sieve (mm),fraction finer", [(d, f / 100) for d, f in CURVE], "utf-8"),
        ("d [mm]\tcum. fraction retained", [(d, 1 - f / 100) for d, f in CURVE], "utf-8"),
    ]:
        sep = next(one for one in ";\t," if one in header)
        text = "\r\n".join([header, *(sep.join(map(str, row)) for row in rows)])
        (tmp_path / "s.csv").write_bytes(text.encode(encoding))
        sizes, finer = read_size_file(tmp_path, "s.csv")
        assert sizes == pytest.approx([size for size, _ in CURVE]), header
        assert finer == pytest.approx([share for _, share in CURVE]), header
    sand, path = tmp_path / "sand.csv", tmp_path / "case.toml"
    head = "# made by hand\nSieve (µm);Cumulative % retained\n"  # turned round
    sand.write_text(head + "850;0\n600;10,5\n425;44\n212;97\n180;100\n")
    text = 'name = "sand"\nbox.size_mm = [4.0, 2.4, 2.4]\n'
    path.write_text(text + 'grains = { porosity = 0.4, sizes = { file = "sand.csv" } }\n')
    case = read_case(path)
    assert case.grains.sizes.size_mm == pytest.approx((0.18, 0.212, 0.425, 0.6, 0.85))
    assert case.grains.sizes.passing_percent == pytest.approx((0, 3, 56, 89.5, 100))
    path.write_text(case.toml())
    sand.unlink()
    assert read_case(path) == case


def test_a_table_that_may_mean_several_things_is_refused():
    for text, expected in [
        ("size,passing %\n1,2\n3,4\n", "0 columns"),
        ("size_um,volume %\n1,2\n3,4\n", "are cumulative percentages, expected one"),
        ("size_um,retained %\n1,2\n3,4\n", "share on each sieve, or on it and all above"),
        ("size_um,passing %,finer %\n1,2,2\n3,4,4\n", "2 columns"),
        ("size_um,passing %\n1 mm,2\n3,4\n", "'1 mm' is no number; units stand in the names"),
        ("size_um,passing %\n1,2\n", "at least two rows"),
        ("size_um,Percent Finer\n1,0\n2,0.4\n3,1\n", "its numbers end at 1, expected 100"),
        ("size_um,fraction finer\n1,0\n2,40\n3,100\n", "its numbers end at 100, expected 1"),
        ("size_um,Cumulative number %\n1,0\n2,100\n", "counts number, but the case says by"),
        ("size_um,% finer or coarser\n1,0\n2,100\n", "finer or coarser"),
    ]:
        with pytest.raises(ValueError, match=expected):
            parse_sizes(text)


# ---- A run through the real binary.
CALCITE, HEAVIER = (
    {"D10": "25 um", "D50": "50 um", "D90": "90 um"},
    {"D10": "40 um", "D90": "80 um"},
)
SOLIDS = {"cut": "50 um", "solids": "60 lb/bbl", "slab": "0.25 mm", "supply": "batches"}
RUN = {
    "name": "measured",
    "box": {"size": ["1.9 mm", "1.8 mm", "1.8 mm"], "sides": "periodic"},
    "grains": {"sizes": SAND, "porosity": "38 %"},
    "fines": SOLIDS
    | {"materials": [MIXTURE[0] | {"sizes": CALCITE}, MIXTURE[1] | {"sizes": HEAVIER}]},
    "fluid": {"viscosity": "10 cP", "velocity_m_s": 0.6},
    "run": {"stiffness": "100 N/m", "duration": "0.6 ms"},
    "analysis": {"sections": 2},
}


@pytest.mark.liggghts
def test_a_sand_and_a_mud_run_to_their_summary(binary, tmp_path):
    """Grain to smallest fine 1 : 17, two materials, units throughout."""
    case = case_from(RUN)
    assert case.grains.radius_range_m[1] > 15 * case.fines.radius_range_m[0]
    run = fdnet.run_case(case, tmp_path / "run", stages=("pack", "invade", "analyse"))
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    counts = [summary[f"{name}_count"] for name in ("invaded", "passed", "upstream")]
    assert summary["supplied_count"] == sum(counts) > 50
    grains, fines = summary["sizes"]["grains"], summary["sizes"]["fines"]
    assert (grains["law"], fines["law"]) == ("log-normal", "mixture")
    assert grains["asked_m"] == pytest.approx({"D10": 2.5e-4, "D50": 4e-4, "D90": 6e-4})
    for name in ("D10", "D50", "D90"):
        assert grains["placed_m"][name] == pytest.approx(grains["curve_m"][name], rel=0.05)
    assert fines["placed_count"] == summary["supplied_count"]
    assert fines["curve_m"]["D10"] is None
    assert fines["placed_m"]["D90"] == pytest.approx(fines["curve_m"]["D90"], rel=0.05)
    assert fines["finer_left_out"] == pytest.approx(case.fines.curve.below)
    assert "of the solids (finer than 50 um)" in " ".join(summary["warnings"])
    assert np.min(run.spheres().fines().radius) >= 25e-6 * (1 - 1e-9)
    assert abs(summary["porosity_initial"] - 0.38) <= 0.003
