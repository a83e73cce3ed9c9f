"""Decks by meaning: commands are there or left out, and variables offered and used agree."""

import math
import re
from importlib.resources import files

import jinja2
import numpy as np
import pytest
from builders import followed, naming, resting_spheres, tiny
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


def invade_text(*assignments: str) -> str:
    return invade_deck(*assignments).text


def pack_text(*assignments: str) -> str:
    return render_pack(tiny(*assignments), count=66).text


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
    assert not has(invade_text("gravity.mode=on"), "grav_grains|buoyancy density")


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
    assert has(invade_text(), r"variable still equal \$\{most\}$")
    keys = ("run.plug_rate=0.3", "run.plug_time_ms=0.2")
    area, volume = 1.6e-3**2, 4 / 3 * math.pi * (0.05e-3) ** 3
    arrivals = 0.1 * area * scales_of(tiny(*keys)).upstream_velocity * 0.2e-3 / volume
    allowed = math.floor(0.3 * arrivals)
    assert has(invade_text(*keys), rf"variable still equal \$\{{most\}}\+{allowed}$")


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


# ---- Each option of a case gives its exact lines, computed here by hand.
HOOKE = "wall/gran model hooke/stiffness"
MU = "fix mu all property/global coefficientFriction peratomtypepair 3"
PAIR = "pair_style gran model hooke/stiffness tangential history"
GRAVITY = "fix grav_fines fines gravity"
END, OFF = "limitForce on", "tangential_damping off"
DRAG = 6.0 * math.pi * 0.05  # Stokes's 6 pi mu of 50 cP, N s/m2
WALL = f"fix wy1 fines {HOOKE} primitive type 3 yplane 0.0016 {END}"
INVADE = {
    (): [
        *("boundary f f f", f"{MU} 0.55 0.55 0.0 0.55 0.55 0.0 0.0 0.0 0.0"),
        *(f"{PAIR} {OFF} {END}", WALL),
        *("fix still grains freeze", "fix integ fines nve/sphere"),
        f"variable fx atom {DRAG!r}*r*(f_uf[1]-vx)",
    ],
    ("box.sides=periodic",): ["boundary f p p", f"-{WALL}"],
    ("box.wall_friction=0.3",): [
        f"{MU} 0.55 0.55 0.3 0.55 0.55 0.3 0.3 0.3 0.3",
        f"fix wy1 fines {HOOKE} tangential history primitive type 3 yplane 0.0016 {OFF} {END}",
    ],
    ("fines.friction=0.4",): [f"{MU} 0.55 0.4 0.0 0.4 0.4 0.0 0.0 0.0 0.0"],
    ("grains.friction=0.2",): [f"{MU} 0.2 0.2 0.0 0.2 0.55 0.0 0.0 0.0 0.0"],
    ("contact.rolling_friction=0.1",): [
        "fix roll all property/global coefficientRollingFriction peratomtypepair 3" + 9 * " 0.1",
        f"{PAIR} rolling_friction epsd2 {OFF} {END}",
    ],
    ("contact.restitution=liquid",): [f"{PAIR} {OFF} limitForce off"],
    ("contact.model=hertz",): [
        *("hard_particles yes", f"pair_style gran model hertz tangential history {OFF} {END}"),
        WALL.replace("hooke/stiffness", "hertz"),
    ],
    ("grains.motion=mobile",): [
        *("fix integ all nve/sphere", "-fix still grains freeze", WALL.replace("fines", "all")),
        f"fix wx1 grains {HOOKE} primitive type 3 xplane 0.003 {END}",
    ],
    ("drag.multiplier=2.0",): [f"variable fy atom {2.0 * DRAG!r}*r*(f_uf[2]-vy)"],
    ("fluid.velocity_m_s=0.5",): ["set group fines property/atom uf 0.5 0.0 0.0"],
    ("drag.refresh_steps=5",): ["fix st fines store/state 5 v_fx v_fy v_fz"],
    ("run.time_step_s=2e-8",): ["timestep 2e-08"],
    ("run.cap_ms=0.5",): ["variable chunk loop 1 20"],
    ("gravity.mode=on",): [f"{GRAVITY} {9.81 * (1 - 1095 / 2146)} vector 0.0 0.0 -1.0"],
    ("gravity.mode=on", "gravity.buoyancy=false"): [
        *("# left out: buoyancy (switched off)", f"{GRAVITY} 9.81 vector 0.0 0.0 -1.0")
    ],
}
"""Lines by what is set; a hyphen stands before one that is left out."""
PACK = {
    (): ["boundary f f f", f"fix wx1 all {HOOKE} primitive type 2 xplane 0.003 {END}"],
    ("box.sides=periodic",): [
        *("boundary f p p", f"-fix wy0 all {HOOKE} primitive type 2 yplane 0.0 {END}")
    ],
    ("grains.packing_stiffness_N_m=2000",): [
        "fix kn all property/global kn peratomtypepair 2" + 4 * " 2000.0"
    ],
    ("contact.model=hertz",): [f"pair_style gran model hertz {END}"],
}


@pytest.mark.parametrize(("options", "text"), [(INVADE, invade_text), (PACK, pack_text)])
def test_every_option_has_its_lines(options, text):
    for chosen, wanted in options.items():
        lines = text(*chosen).splitlines()
        for line in wanted:
            with naming(chosen, line):
                assert (line.removeprefix("-") in lines) is not line.startswith("-")
