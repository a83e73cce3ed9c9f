"""Decks by meaning: commands are there or left out, and variables offered and used agree."""

import math
import re

import numpy as np
import pytest
from builders import tiny

from fdnet.dem.deck import render_text, used_variables
from fdnet.dem.invade_deck import render_invade
from fdnet.dem.packing import draw_radii, render_pack
from fdnet.errors import DeckError
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Kind, Snapshot


def one_grain(case) -> Snapshot:
    box = np.column_stack([np.zeros(3), case.size_m])
    return Snapshot(
        step=0,
        time_s=0.0,
        box=box,
        id=np.array([1]),
        kind=np.array([Kind.GRAIN]),
        position=np.array([[2e-4, 8e-4, 8e-4]]),
        radius=np.array([2.5e-4]),
        velocity=np.zeros((1, 3)),
    )


def invade_text(*assignments: str, ranks: int = 1) -> str:
    case = tiny(*assignments)
    return render_invade(case, scales_of(case), one_grain(case), ranks=ranks).text


def commands(text: str) -> list[str]:
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def has(text: str, pattern: str) -> bool:
    return any(re.search(pattern, line) for line in commands(text))


def test_missing_template_and_variables_are_errors():
    with pytest.raises(DeckError, match="template not found"):
        used_variables("nothing.in.j2")
    with pytest.raises(DeckError, match="offered but never used: spare"):
        render_text("_walls.in.j2", {"walls": [], "spare": 1})
    with pytest.raises(DeckError, match="walls"):
        render_text("_walls.in.j2", {})


def test_templates_hold_no_arithmetic():
    """No operators and no filters: every number is computed in Python."""
    from importlib.resources import files

    import jinja2
    from jinja2 import nodes

    forbidden = (
        nodes.Add,
        nodes.Sub,
        nodes.Mul,
        nodes.Div,
        nodes.FloorDiv,
        nodes.Mod,
        nodes.Pow,
        nodes.Neg,
        nodes.Concat,
        nodes.Filter,
        nodes.Assign,
    )
    for entry in files("liggghts_templates").iterdir():
        if entry.name.endswith(".j2"):
            tree = jinja2.Environment().parse(entry.read_text())
            assert not list(tree.find_all(forbidden)), entry.name


def test_drag_is_stokes_with_the_multiplier():
    text = invade_text("drag.multiplier=30")
    value = float(re.search(r"variable fx atom ([-+.\de]+)\*r\*\(f_uf\[1\]-vx\)", text).group(1))
    assert value == pytest.approx(6 * math.pi * 0.05 * 30)
    assert has(text, r"^fix drag fines addforce")


def test_drag_held_for_more_than_a_step_is_stored():
    assert has(invade_text(), r"^fix st fines store/state \d+ v_fx")
    assert has(invade_text("drag.refresh_steps=1"), r"^fix drag fines addforce v_fx v_fy v_fz$")
    assert not has(invade_text("drag.refresh_steps=1"), "store/state")


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


def test_each_group_of_spheres_has_the_gravity_of_its_own_density():
    """Also light ones, which rise: the direction turns, the magnitude stays positive."""
    text = invade_text(
        "gravity.mode=on",
        "gravity.acceleration_m_s2=[3.0, 0.0, -4.0]",
        "grains.motion=mobile",
        "fines.density_kg_m3=1000.0",
    )
    light, heavy = 5 * (1095 / 1000 - 1), 5 * (1 - 1095 / 2650)
    fines = re.search(r"(?m)^fix grav_fines fines gravity (\S+) vector -0.6 0.0 0.8$", text)
    grains = re.search(r"(?m)^fix grav_grains grains gravity (\S+) vector 0.6 0.0 -0.8$", text)
    assert float(fines[1]) == pytest.approx(light)
    assert float(grains[1]) == pytest.approx(heavy)


def test_the_forces_of_the_fluid_that_are_not_asked_for_are_left_out_and_named():
    text = invade_text()
    for what in ("force of the pressure gradient (switched off)", "drag in a crowd (not asked"):
        assert f"# left out: {what}" in text
    assert "# left out: drag at finite Reynolds numbers (not asked for)" in text
    assert not has(text, "gradient|pores|slip")
    asked = invade_text("drag.pressure_gradient=true", "drag.inertia=schiller-naumann")
    assert not re.search(r"left out: (force|drag at)", asked)
    assert "the fluid pushes the fines only" in invade_text(
        "drag.pressure_gradient=true", "grains.motion=mobile"
    )


def test_the_pressure_gradient_acts_on_the_volume_of_each_fine_inside_the_pack():
    gradient = scales_of(tiny()).pressure_gradient
    one = invade_text("drag.pressure_gradient=true")
    force = re.search(r"(?m)^fix gradient fines addforce (\S+) 0.0 0.0 region pores$", one)
    assert float(force[1]) == pytest.approx(4 / 3 * math.pi * 5e-5**3 * gradient)
    end = re.search(r"(?m)^region pores block 0.0 (\S+) INF INF INF INF units box$", one)
    assert float(end[1]) == np.nextafter(3e-3, 0)
    many = invade_text("drag.pressure_gradient=true", "fines.radius_mm=[0.04, 0.06]")
    formula = re.search(r"(?m)^variable gx atom (\S+)\*mass$", many)
    assert float(formula[1]) == pytest.approx(gradient / 2146)
    assert has(many, r"^fix gradient fines addforce v_gx 0.0 0.0 region pores$")


def test_fixed_grains_are_frozen_and_mobile_ones_are_held_by_planes():
    fixed, mobile = invade_text(), invade_text("grains.motion=mobile")
    assert has(fixed, r"^fix still grains freeze$")
    assert not has(fixed, "^neigh_modify.*exclude")
    assert not has(fixed, "xplane")
    assert has(fixed, r"^fix integ fines nve/sphere")
    assert not has(mobile, "freeze")
    assert has(mobile, r"^fix wx0 grains wall/gran .*xplane 0.0")
    assert has(mobile, r"^fix integ all nve/sphere")


def test_sides_friction_and_ranks_leave_lines_out():
    assert has(invade_text(), "yplane")
    assert not has(invade_text("box.sides=periodic"), "yplane")
    assert has(invade_text("box.sides=periodic"), r"^boundary f p p")
    assert has(invade_text(), "tangential history")
    smooth = invade_text("fines.friction=0.0")
    assert not has(smooth, "tangential history|coefficientFriction")
    assert not has(invade_text(), "^processors")
    assert has(invade_text(ranks=2), r"^processors 1 \* \*")


def test_the_neighbour_search_is_the_cases_or_the_measured_best():
    assert has(invade_text(), r"^neighbor 5e-05 bin$")
    assert not has(invade_text(), "binsize")
    own = invade_text("run.skin_mm=0.02", "run.neighbour_bin_mm=0.2")
    assert has(own, r"^neighbor 2e-05 bin$")
    assert has(own, r"^neigh_modify binsize 0.0002$")


def test_lost_atoms_are_errors_and_the_end_is_marked():
    case = tiny()
    for text in (invade_text(), render_pack(case, count=66).text):
        assert has(text, "thermo_modify lost error")
        assert commands(text)[-1] == 'print "DECK_DONE"'
        assert has(text, r"^timestep ")
        assert not has(text, "multi|screen none")


def test_the_set_command_never_meets_its_unset_number():
    case = tiny()
    text = render_pack(case, count=66).text
    assert has(text, r"^set group all density 2650.0 diameter v_d")
    assert not has(text, r"^set group all diameter v_")


def test_pair_matrices_are_symmetric_series_values():
    text = invade_text()
    row = next(line for line in commands(text) if line.startswith("fix kn "))
    values = np.array(row.split()[7:], float).reshape(3, 3)
    assert np.array_equal(values, values.T)
    scales = scales_of(tiny())
    assert values[0, 1] == scales.contacts["grain-fine"].normal_stiffness
    assert values[1, 1] == scales.contacts["fine-fine"].normal_stiffness


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


@pytest.mark.parametrize(("model", "law"), [("hooke", "hooke/stiffness"), ("hertz", "hertz")])
def test_pairs_and_walls_have_the_contact_model_of_the_case(model, law):
    """Walls without friction of their own have no tangential model."""
    text = invade_text(f"contact.model={model}", "box.wall_friction=0.3")
    assert has(text, rf"^pair_style gran model {law} tangential history tangential_damping off")
    assert has(text, rf"^fix wy0 fines wall/gran model {law} tangential history primitive type 3")
    smooth = invade_text(f"contact.model={model}")
    assert has(smooth, rf"^fix wy0 fines wall/gran model {law} primitive type 3 yplane")
    case = tiny(f"contact.model={model}")
    pack = render_pack(case, count=66).text
    assert has(pack, rf"^pair_style gran model {law} limitForce on")
    assert has(pack, rf"^fix wx0 all wall/gran model {law} primitive type 2 xplane")


def test_moduli_that_liggghts_would_refuse_are_said_to_be_meant():
    """It wants to be told of a Young's modulus below 5e6 or above 1e9 Pa."""
    for stiffness, soft, hard in (
        ("1.0", True, False),
        ("1e2", False, False),
        ("1e6", False, True),
    ):
        text = invade_text(
            "contact.model=hertz", f"run.stiffness_N_m={stiffness}", "fluid.velocity_m_s=1e-3"
        )
        assert has(text, "^soft_particles yes") is soft
        assert has(text, "^hard_particles yes") is hard
    assert not has(invade_text(), "_particles yes")


def test_held_drag_at_a_finite_reynolds_number_stores_the_force():
    held = invade_text("drag.inertia=schiller-naumann")
    assert has(held, r"^variable fx atom v_cr\*v_sx$")
    assert has(held, r"^fix drag fines addforce v_hx v_hy v_hz$")
