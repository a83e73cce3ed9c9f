"""Each option of a case gives its exact lines of a deck, computed here by hand."""

import math

import pytest
from builders import naming

from tests.dem.test_deck import commands, invade_text, pack_text

PLAIN = ("contact.restitution=dry",)
HOOKE = "wall/gran model hooke/stiffness"
MU = "fix mu all property/global coefficientFriction peratomtypepair 3"
PAIR = "pair_style gran model hooke/stiffness tangential history"
END, OFF = "limitForce on", "tangential_damping off"
DRAG = 6.0 * math.pi * 0.05
"""Stokes's 6 pi mu of 50 cP, N s/m2."""
WALL = f"fix wy1 fines {HOOKE} primitive type 3 yplane 0.0016 {END}"
INVADE = {
    (): [
        *(
            "boundary f f f",
            f"{MU} 0.55 0.55 0.0 0.55 0.55 0.0 0.0 0.0 0.0",
            f"{PAIR} {OFF} {END}",
        ),
        *(WALL, "fix still grains freeze", "fix integ fines nve/sphere"),
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
        lines = commands(text(*PLAIN, *chosen))
        for line in wanted:
            with naming(chosen, line):
                assert (line.removeprefix("-") in lines) is not line.startswith("-")
