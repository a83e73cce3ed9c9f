"""Decks by meaning: commands are there or left out, and variables offered and used agree."""

import math
import re
from importlib.resources import files

import jinja2
import numpy as np
import pytest
from builders import followed, resting_spheres, tiny
from jinja2 import nodes

from fdnet.dem.deck import specimen_box
from fdnet.dem.invade_deck import render_decks, render_invade
from fdnet.dem.packing import draw_radii, render_pack
from fdnet.errors import CaseError
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Kind


def grain_of(case):
    """A single grain, not touching the sides."""
    return resting_spheres([[2e-4, 8e-4, 8e-4]], 2.5e-4, specimen_box(case), kind=Kind.GRAIN)


def invade_deck(*assignments: str, **more):
    case = tiny(*assignments)
    return render_invade(case, scales_of(case), grain_of(case), **more)


def invade_text(*assignments: str, ranks: int = 1) -> str:
    return invade_deck(*assignments, ranks=ranks).text


def pack_text(*assignments: str) -> str:
    case = tiny(*assignments)
    return render_pack(case, count=66).text


def commands(text: str) -> list[str]:
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def has(text: str, pattern: str) -> bool:
    return any(re.search(pattern, line) for line in commands(text))


def test_templates_hold_no_arithmetic():
    """No operators and no filters: every number is computed in Python."""
    sums = (nodes.Add, nodes.Sub, nodes.Mul, nodes.Div, nodes.FloorDiv, nodes.Mod, nodes.Pow)
    forbidden = (*sums, nodes.Neg, nodes.Concat, nodes.Filter, nodes.Assign)
    for entry in files("liggghts_templates").iterdir():
        if entry.name.endswith(".j2"):
            tree = jinja2.Environment().parse(entry.read_text())
            assert not list(tree.find_all(forbidden)), entry.name


def test_gravity_is_left_out_when_negligible_and_reported():
    text = invade_text()
    assert not has(text, "gravity|buoyancy")
    assert "# left out: gravity and buoyancy (gravity is" in text
    on = invade_text("gravity.mode=on")
    pull = 9.81 * (1 - 1095 / 2146)
    assert has(on, rf"^fix grav_fines fines gravity {pull} vector 0.0 0.0 -1.0$")
    assert not has(on, "grav_grains|buoyancy density")
    heavy = invade_text("gravity.mode=on", "gravity.buoyancy=false")
    assert has(heavy, r"^fix grav_fines fines gravity 9.81 vector 0.0 0.0 -1.0$")
    assert "# left out: buoyancy (switched off)" in heavy


def test_the_neighbour_search_is_the_measured_best():
    assert has(invade_text(), r"^neighbor 5e-05 bin$")


def test_lost_atoms_are_errors_and_the_end_is_marked():
    for text in (invade_text(), pack_text()):
        assert has(text, "thermo_modify lost error")
        assert commands(text)[-1] == 'print "DECK_DONE"'
        assert has(text, r"^timestep ")
        assert not has(text, "multi|screen none")
    assert has(pack_text(), r"^set group all density 2650.0 diameter v_d")
    assert not has(pack_text(), r"^set group all diameter v_"), "LIGGGHTS takes both at once"


def test_radii_are_uniform_by_number_and_the_last_closes_the_target():
    case = tiny("grains.radius_mm=[0.15,0.25]")
    radii = draw_radii(case, 2000)
    assert radii.min() >= 0.15e-3
    assert radii.max() <= 0.25e-3
    counts, _ = np.histogram(radii, bins=4, range=(0.15e-3, 0.25e-3))
    assert np.all(np.abs(counts - 500) < 100)
    short = 2000 * case.grains.mean_volume_m3 - 4 / 3 * math.pi * np.sum(radii[:-1] ** 3)
    expected = np.clip(np.cbrt(max(short, 0) * 3 / (4 * math.pi)), 0.15e-3, 0.25e-3)
    assert radii[-1] == pytest.approx(expected)


def test_the_stop_rule_allows_a_share_of_the_inflow():
    """At rate 0 not one; else the share of c A u t_plug / v fines, over the whole plug time."""
    strict = invade_text()
    assert has(strict, r"variable still equal \$\{most\}$")
    case = tiny("run.plug_rate=0.3", "run.plug_time_ms=0.2")
    scales = scales_of(case)
    area, volume = 1.6e-3**2, 4 / 3 * math.pi * (0.05e-3) ** 3
    arrivals = 0.1 * area * scales.upstream_velocity * 0.2e-3 / volume
    text = invade_text("run.plug_rate=0.3", "run.plug_time_ms=0.2")
    assert has(text, rf"variable still equal \$\{{most\}}\+{math.floor(0.3 * arrivals)}$")


def test_the_deck_watches_where_it_can_and_says_where_it_cannot():
    assert "fix overlap all print 50 " in invade_deck().text
    for deck, why in (
        (invade_deck("grains.motion=mobile"), "pairs of grains"),
        (invade_deck("fines.radius_mm=[0.04,0.05]"), "unequal"),
        (invade_deck(packed=False), "once they are packed"),
    ):
        assert "compute" not in deck.text
        left = [one.why for one in deck.left_out if one.what == "overlap between checkpoints"]
        assert why in left[0]


def test_render_shows_the_coupled_parts_with_what_it_is_fed_and_replaces_nothing(tmp_path):
    coupled = followed("fines.supply=batches", "run.checkpoint_ms=0.05")
    render_decks(coupled, tmp_path / "coupled")
    folder = tmp_path / "coupled" / "invade"
    text = (folder / "in.invade").read_text()
    assert "jump" not in text
    for name in ("ask.in", "fluid.in", "checkpoint.in"):
        assert f"include {name}" in text
        theirs = tmp_path / f"theirs {name}"
        (theirs / "invade").mkdir(parents=True)
        (theirs / "invade" / name).write_text("mine")
        with pytest.raises(CaseError, match=rf"invade/{name}: is there already"):
            render_decks(coupled, theirs)
        assert [one.read_text() for one in theirs.rglob("*") if one.is_file()] == ["mine"]
    assert "set group fines property/atom Ksl v_cd" in (folder / "fluid.in").read_text()
    assert "f_uf[3]" in (folder / "ask.in").read_text()
    render_decks(tiny(), tmp_path / "plain")
    assert [one.name for one in (tmp_path / "plain" / "invade").iterdir()] == ["in.invade"]
