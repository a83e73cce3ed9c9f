"""The study of laws: errors as accuracy.md states them, and resolved flow that converges."""

import csv

import pytest

from fdnet.names import DEFAULT_LAW
from fdnet.network.laws.named import LAWS
from validation.accuracy import ALL_PAIRS, ARCHIE, FINEST, PACKS
from validation.command import run_study
from validation.engine.table import read_rows
from validation.network import laws
from validation.truth import EQUAL, LATTICE

FIFTH = "fines of 1/5"


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    out = tmp_path_factory.mktemp("study") / "out"
    run_study(laws.STUDY, out, quick=True)
    return read_rows(out / "laws.csv")


def errors(rows, series, quantity="k"):
    return {
        row.value: row.error for row in rows if row.series == series and row.quantity == quantity
    }


def test_the_default_law_is_within_its_stated_span(rows):
    """accuracy.md: random packs worst 1.2 %, touching lattices 1.2 %; nothing fitted."""
    assert abs(errors(rows, EQUAL)[DEFAULT_LAW]) < 0.012
    assert abs(errors(rows, LATTICE)[DEFAULT_LAW]) < 0.012


@pytest.mark.parametrize(("group", "file_case"), [(EQUAL, "H_40_eps40"), (LATTICE, "SC_touching")])
def test_every_law_has_the_error_of_the_page(rows, root, group, file_case):
    with (root / "docs" / "validation" / PACKS).open(newline="") as file:
        known = next(row for row in csv.DictReader(file) if row["case"] == file_case)
    assert {law: 1 + off for law, off in errors(rows, group).items()} == {
        law: pytest.approx(float(known[f"{law}: k0"]), abs=2e-5) for law in LAWS
    }


def test_every_damage_law_has_the_error_of_the_page(rows, root):
    with (root / "docs" / "validation" / PACKS).open(newline="") as file:
        known = next(row for row in csv.DictReader(file) if row["case"] == laws.DAMAGED)
    of_fifth = errors(rows, FIFTH, "k/k0")
    assert {name: 1 + of_fifth[name] for name in ALL_PAIRS} == {
        name: pytest.approx(float(known[name]), abs=2e-4) for name in ALL_PAIRS
    }
    assert abs(of_fifth[FINEST]) < abs(of_fifth[ARCHIE]) < 0.08 < of_fifth["thesis + thesis"]


def test_resolved_flow_converges_from_above_and_two_grids_are_nearer(rows):
    one, two = errors(rows, laws.GRID), errors(rows, laws.TWO_GRIDS)
    assert one[16] > 1.5 * one[24] > 1.5**1.5 * one[32] > 0
    assert abs(two[24]) < 0.5 * one[24]


def test_truth_brings_its_own_uncertainty(rows):
    assert {row.error_uncertainty for row in rows if row.series == FIFTH} == {0.013}
    own = laws.cases()[laws.INTACT].error
    assert {row.error_uncertainty for row in rows if row.series == EQUAL} == {own}
