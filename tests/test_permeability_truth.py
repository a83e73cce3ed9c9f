"""The packs of known permeability (resolved Stokes flow) through the command."""

import csv
import json
import math

import pytest

from fdnet.cli import main
from fdnet.names import (
    ALL_SPHERES,
    AUTO,
    DAMAGE_LAW_NAMES,
    DEFAULT_LAW,
    LAW_NAMES,
    SECTION_ARCHIE,
)
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS
from validation.truth.packs import DATA, truth_tables

ROWS = [row for path in truth_tables() for row in csv.DictReader(path.open()) if row["file"]]
TRUTH = {f"{row['case']}-{row['axis']}": row for row in ROWS if (DATA / row["file"]).exists()}
INTACT = [name for name, row in TRUTH.items() if not row["k_over_k0"]]
FILLED = [name for name, row in TRUTH.items() if row["k_over_k0"]]
LONG = {"packC_r10_d5-x", "packC_r10_d8-x"}
"""Packs of thousands of fines, which `scripts/accuracy.py` compares too."""


def error(name: str) -> float:
    """Truth's own relative error."""
    return float(TRUTH[name]["relative_error"].rstrip("%")) / 100.0


def run(capsys: pytest.CaptureFixture[str], name: str, *more: str) -> dict:
    row = TRUTH[name]
    box = ",".join(["0", row["edge_mm"]] * 3)
    command = [
        "permeability",
        str(DATA / row["file"]),
        "--units",
        "mm",
        "--box",
        box,
        "--periodic",
        "xyz",
    ]
    assert main([*command, "--axis", row["axis"], "--json", *more]) == 0
    return json.loads(capsys.readouterr().out)


def ratios(modelled: dict[str, float], key: str) -> dict[str, float]:
    """The computed value over that of resolved flow, of each pack."""
    return {name: value / float(TRUTH[name][key]) for name, value in modelled.items()}


def root_mean_square(ratio: dict[str, float]) -> float:
    return math.sqrt(sum(math.log(value) ** 2 for value in ratio.values()) / len(ratio))


def test_intact_packs_and_lattices_within_2_percent_and_3_in_the_mean_square(capsys):
    """Porosity 0.30 (overlapping) to 0.45, radii 1:1 to 1:3, SC, BCC, FCC; nothing is fitted."""
    ratio = ratios({name: run(capsys, name)["k_initial_m2"] * 1e6 for name in INTACT}, "k_mm2")
    assert not {name: at for name, at in ratio.items() if abs(at - 1) > 0.02 + error(name)}
    assert root_mean_square(ratio) < 0.03


@pytest.mark.parametrize(
    "names",
    [
        pytest.param([name for name in FILLED if name not in LONG], id="without the two longest"),
        pytest.param(FILLED, id="all", marks=pytest.mark.nightly),
    ],
)
def test_loss_by_fines_within_10_percent_and_5_in_the_mean_square(capsys, names):
    """k/k0 from 0.89 down to 0.0175, fines 1/5 and 1/10, even and in layers."""
    result = {name: run(capsys, name) for name in names}
    kept = {name: 1 - one["k_reduction"] for name, one in result.items()}
    ratio = ratios(kept, "k_over_k0")
    assert not {name: at for name, at in ratio.items() if abs(at - 1) > 0.10 + error(name)}
    assert root_mean_square(ratio) < 0.05
    assert all(one["porosity_damaged"] < one["porosity_initial"] for one in result.values())


def test_names_offered_are_the_laws_there_are():
    assert set(LAW_NAMES) == set(LAWS)
    assert set(DAMAGE_LAW_NAMES) == {AUTO, ALL_SPHERES, *DAMAGE_LAWS}


def test_compared_laws_give_what_each_gives_alone(capsys, tmp_path):
    table = tmp_path / "laws.csv"
    result = run(capsys, "packC_r5_d2-x", "--compare-laws", "--sections", "2", "--csv", str(table))
    pairs = {(one["law"], one["damage_law"]): one for one in result["laws"]}
    two_scale = {(law, damage) for law in LAWS for damage in DAMAGE_LAWS}
    assert set(pairs) == two_scale | {(DEFAULT_LAW, name) for name in (AUTO, ALL_SPHERES)}
    assert result["k_damaged_m2"] == pairs[DEFAULT_LAW, result["damage_law_used"]]["k_damaged_m2"]
    assert (result["damage_law_used"], result["damage_law_other"]) == (ALL_SPHERES, SECTION_ARCHIE)
    alone = run(
        capsys, "packC_r5_d2-x", "--law", "thesis", "--damage-law", "thesis", "--sections", "2"
    )
    both = pairs["thesis", "thesis"]
    for key in (
        "k_initial_m2",
        "k_damaged_m2",
        "sections",
        "porosity_damaged",
        "solver",
        "network_counts",
    ):
        assert both[key] == alone[key], key
    assert both["warnings"] == alone["warnings"][1:]  # the first is on the laws of the thesis
    with table.open() as rows:
        written = {
            (row["law"], row["damage_law"]): float(row["k_damaged_m2"])
            for row in csv.DictReader(rows)
        }
    assert written == pytest.approx(
        {pair: one["k_damaged_m2"] for pair, one in pairs.items()}, rel=1e-8
    )


@pytest.mark.parametrize(("periodic", "axis"), [("xyz", "x"), ("yz", "x"), ("xy", "z"), ("", "y")])
def test_sections_in_place_recombine_in_series(capsys, periodic, axis):
    """L / k = sum of dx / k over the sections, damaged and not, with walls and without."""
    more = ("--sections", "4", "--axis", axis, "--periodic", periodic)
    result = run(capsys, "packC_r5_d2-x", *more)
    for name in ("initial", "damaged"):
        rows = result["sections"]
        thickness = [row["x_hi_m"] - row["x_lo_m"] for row in rows]
        series = sum(
            dx / row[f"k_{name}_inplace_m2"] for dx, row in zip(thickness, rows, strict=True)
        )
        assert sum(thickness) / series == pytest.approx(result[f"k_{name}_m2"], rel=1e-9)


def test_sections_are_printed_with_their_units(capsys):
    box = ",".join(["0", TRUTH["packC_r5_d2-x"]["edge_mm"]] * 3)
    assert (
        main(
            [
                "permeability",
                str(DATA / "packC_r5_d2.csv"),
                "--units",
                "mm",
                "--box",
                box,
                "--sections",
                "3",
            ]
        )
        == 0
    )
    said = capsys.readouterr().out
    assert "from m" in said
    assert len([row for row in said.splitlines() if row.startswith(" ")]) == 4
