"""Decks by meaning: commands are there or left out, and variables offered and used agree."""

import math
import re
from importlib.resources import files

import jinja2
import numpy as np
import pytest
from bench import drag_text
from builders import followed, resting_spheres, tiny
from jinja2 import nodes

from fdnet.dem.deck import number, render_text, specimen_box, used_variables
from fdnet.dem.invade_deck import render_decks, render_invade, write_batches
from fdnet.dem.packing import draw_radii, render_pack
from fdnet.errors import CaseError, DeckError
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
    return render_pack(case, scales_of(case), count=66).text


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
    sums = (nodes.Add, nodes.Sub, nodes.Mul, nodes.Div, nodes.FloorDiv, nodes.Mod, nodes.Pow)
    forbidden = (*sums, nodes.Neg, nodes.Concat, nodes.Filter, nodes.Assign)
    for entry in files("liggghts_templates").iterdir():
        if entry.name.endswith(".j2"):
            tree = jinja2.Environment().parse(entry.read_text())
            assert not list(tree.find_all(forbidden)), entry.name


def test_each_scheme_of_the_drag_has_its_own_lines_and_no_others():
    own = {
        "held": "store/state",
        "implicit": "couple/cfd/force/implicit CrankNicolson 1.0",
        "viscous": "fix drag fines viscous",
    }
    for scheme in own:
        text = drag_text(tiny(f"drag.scheme={scheme}"))
        for other, line in own.items():
            assert (line in text) == (other == scheme), (scheme, other)
        assert (" uf " in text) == (scheme != "viscous")
        assert ("run 0" in text) == (scheme != "viscous")
    assert has(invade_text(), r"^fix st fines store/state \d+ v_fx")
    every = invade_text("drag.refresh_steps=1")
    assert has(every, r"^fix drag fines addforce v_fx v_fy v_fz$")
    assert not has(every, "store/state")
    held = invade_text("drag.inertia=schiller-naumann")
    assert has(held, r"^variable fx atom v_cr\*v_sx$")
    assert has(held, r"^fix drag fines addforce v_hx v_hy v_hz$")


def test_drag_is_stokes_with_the_multiplier():
    """6 pi mu M r u; upstream less by 6 pi mu M r (u - q), q Darcy's velocity."""
    text = invade_text("drag.multiplier=30")
    value = float(re.search(r"variable fx atom ([-+.\de]+)\*r\*\(f_uf\[1\]-vx\)", text).group(1))
    assert value == pytest.approx(6 * math.pi * 0.05 * 30)
    viscous = ("drag.scheme=viscous", "fluid.velocity_m_s=2.0")
    case = tiny(*viscous, "drag.multiplier=3.0", "drag.upstream=darcy")
    text, damping = drag_text(case), 6 * math.pi * 0.05 * 3 * 5e-5
    part = r"(\S+) 0.0 0.0"
    push, slower = (
        float(re.search(rf"{one} fines addforce {part}", text).group(1))
        for one in ("push", "slow")
    )
    assert float(re.search(r"drag fines viscous (\S+)", text).group(1)) == pytest.approx(damping)
    assert push == pytest.approx(damping * 2.0)
    assert slower == pytest.approx(-damping * 2.0 * (1 - scales_of(case).porosity))
    assert "region" not in drag_text(tiny(*viscous))
    case = tiny("drag.scheme=implicit", "fines.radius_mm=[0.04, 0.06]", "fluid.velocity_m_s=2.0")
    for resume in (False, True):
        text = drag_text(case, resume)
        assert f"variable ksl atom {number(6 * math.pi * 0.05)}*r" in text
        assert "set group fines property/atom Ksl v_ksl" in text
        assert "set group fines property/atom uf 2.0 0.0 0.0" in text


def test_what_a_scheme_cannot_do_is_refused():
    """Each names key and value; what needs a fluid that fdnet computes is said too."""
    sizes = "fines.radius_mm=[0.04, 0.06]"
    for keys, message in (
        (["drag.scheme=viscous", sizes], "needs fines of one size"),
        (["drag.scheme=implicit", "drag.upstream=darcy"], "keeps one a fine"),
        (["drag.scheme=implicit", "drag.refresh_steps=5"], "'held', not 'implicit'"),
        (["drag.scheme=viscous", "drag.refresh_steps=5"], "'held', not 'viscous'"),
        (["drag.scheme=explicit"], "drag.scheme: 'explicit'"),
        (["drag.update_travel=0.2"], "drag.update_travel: 0.2 belongs to a drag"),
        (["drag.crowd=beetstra", "drag.scheme=viscous"], "has one damping for all fines"),
    ):
        with pytest.raises(CaseError) as error:
            tiny(*keys)
        assert message in str(error.value), keys


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
    for text in (invade_text(), pack_text()):
        assert has(text, "thermo_modify lost error")
        assert commands(text)[-1] == 'print "DECK_DONE"'
        assert has(text, r"^timestep ")
        assert not has(text, "multi|screen none")
    assert has(pack_text(), r"^set group all density 2650.0 diameter v_d")
    assert not has(pack_text(), r"^set group all diameter v_"), "LIGGGHTS takes both at once"


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
    key, history = f"contact.model={model}", f"gran model {law} tangential history"
    text = invade_text(key, "box.wall_friction=0.3")
    assert has(text, rf"^pair_style {history} tangential_damping off")
    assert has(text, rf"^fix wy0 fines wall/{history} primitive type 3")
    assert has(invade_text(key), rf"^fix wy0 fines wall/gran model {law} primitive type 3 yplane")
    assert has(pack_text(key), rf"^pair_style gran model {law} limitForce on")
    assert has(pack_text(key), rf"^fix wx0 all wall/gran model {law} primitive type 2 xplane")


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


def test_contact_options_that_are_not_asked_for_are_left_out_and_named():
    words, wall = "rolling|ohesi|limitForce off|cohere", "box.wall_friction=0.3"
    assert not has(invade_text(wall), words)
    options = ("loss of rebound in the liquid", "rolling resistance", "cohesion")
    for what in options:
        assert f"# left out: {what} (not asked for)" in invade_text(wall)
    keys = ("contact.rolling_friction=0.1", "contact.cohesion_J_m3=1e4", "contact.model=hertz")
    keys += ("contact.restitution=liquid",)
    text, plain = invade_text(*keys, wall), invade_text(*keys)
    model = "hertz tangential history cohesion sjkr rolling_friction epsd2"
    assert has(text, f"^pair_style gran model {model} tangential_damping off limitForce off$")
    assert has(text, f"^fix wy0 fines wall/gran model {model} primitive type 3")
    assert has(text, "^fix roll .* 3 " + " ".join(["0.1"] * 9))
    assert has(text, "^fix cohere .* 3 0.0 10000.0 0.0 10000.0 10000.0 10000.0 0.0 10000.0 0.0")
    assert has(plain, "^fix wy0 fines wall/gran model hertz cohesion sjkr primitive")
    assert not any(f"# left out: {what}" in text for what in options)
    assert not has(pack_text(*keys), words), "grains settle without them"
    wet = invade_text(*keys[2:], "fluid.velocity_m_s=1.0")
    assert has(wet, r"^fix bounce .*peratomtypepair 3 0\.52\d+ 0\.0501\d* 0\.52\d+ 0\.0501")


def test_all_forces_of_a_driven_deck_are_scaled_alike():
    keys = ("well={radius_mm=108.0, drainage_radius_m=100.0}", "drag.scheme=viscous")
    keys += ("gravity.mode=on", "run.duration_ms=20.0")

    def forces(*more: str) -> list[float]:
        lines = invade_text(*keys, *more).splitlines()
        starts = ("fix push", "fix grav")
        return [float(line.split()[4]) for one in starts for line in lines if line.startswith(one)]

    speed = scales_of(tiny(keys[0])).interstitial_velocity
    fast = forces(f"drag.drive_velocity_m_s={4 * speed}")
    assert fast == pytest.approx([4 * one for one in forces()], rel=1e-12)
    assert len(fast) == 2


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


BATCHED = ("fines.supply=batches", "fines.count=900", "run.checkpoint_ms=0.005")


def test_the_deck_takes_each_batch_in_once_and_gives_it_its_drag(tmp_path):
    """LIGGGHTS stores nothing for atoms that come later: they would feel no drag."""
    for keys, sets, stored in (
        (("drag.scheme=viscous",), set(), []),
        (("drag.scheme=implicit",), {"uf", "Ksl"}, []),
        (("drag.scheme=held",), {"uf"}, ["v_fx v_fy v_fz"]),
        (("drag.refresh_steps=1",), {"uf"}, []),
    ):
        case, folder = tiny(*BATCHED, *keys), tmp_path / keys[0]
        folder.mkdir()
        scales = scales_of(case)
        write_batches(case, scales, grain_of(case), folder)
        parts = sorted((folder / "supply").glob("*.in"))
        last = len(parts) + 1
        assert {one.name for one in parts} == {f"batch_{n}.in" for n in range(2, last + 1)}
        text = render_invade(case, scales, grain_of(case)).text
        assert f'if "${{chunk}} < 2 || ${{chunk}} > {last}" then "jump SELF fed"' in text
        batch = (folder / "supply" / "batch_2.in").read_text()
        starts = [line.split() for line in batch.splitlines()]
        given = [one[4] for one in starts if one[:4] == ["set", "group", "batch", "property/atom"]]
        assert set(given) == sets, keys
        assert any(one[:3] == ["velocity", "batch", "set"] for one in starts)
        again = re.findall(r"(?m)^unfix drag\nunfix st\nfix st fines store/state \d+ (.*)$", batch)
        assert again == stored, keys
        assert len(re.findall("(?m)^fix drag fines addforce", batch)) == len(again)
    assert "batch_" not in invade_text("fines.supply=batches", "fines.count=20"), "one batch"


def test_render_shows_the_coupled_parts_with_what_it_is_fed_and_replaces_nothing(tmp_path):
    coupled = tiny("drag.crowd=beetstra", "fines.supply=batches", "run.checkpoint_ms=0.05")
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
    assert "set group fines property/atom cd v_cd" in (folder / "fluid.in").read_text()
    assert "f_uf" not in (folder / "ask.in").read_text()
    render_decks(followed(), tmp_path / "followed")
    assert "f_uf[3]" in (tmp_path / "followed/invade/ask.in").read_text()
    render_decks(tiny(), tmp_path / "plain")
    assert [one.name for one in (tmp_path / "plain" / "invade").iterdir()] == ["in.invade"]
