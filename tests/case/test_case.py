"""Case files: every problem is named at once, with its value, what is expected and what to do."""

import copy
import datetime
import hashlib
from pathlib import Path

import pandas as pd
import pytest
from builders import TINY, answer, tiny

from fdnet.case.case import KEYS, Case, InvasionCase, with_fines
from fdnet.case.file import case_from, known_keys, read_case, set_keys
from fdnet.cli import main
from fdnet.errors import CaseError
from fdnet.run.folder import mark_folder
from fdnet.scales.scales import InvasionScales, Scales, scales_of


def problems(data: dict) -> str:
    with pytest.raises(CaseError) as caught:
        case_from(data)
    return str(caught.value)


def changed(**parts: dict) -> dict:
    data = copy.deepcopy(TINY)
    for name, values in parts.items():
        data.setdefault(name, {}).update(values)
    return data


def test_every_problem_is_listed_at_once():
    text = problems(
        {
            "name": "a b",
            "box": {"size_mm": [8, 4]},
            "grains": {"radius_mm": "0.25", "porosity": 1.3, "frction": 2},
            "fines": {"radius_mm": 0.08, "supply": "slab"},
            "drag": {"multiplier": True},
        }
    )
    for part in (
        "name: 'a b'",
        "box.size_mm",
        "grains.radius_mm: '0.25'",
        "grains.porosity: 1.3",
        "grains.frction: unknown key",
        "did you mean grains.friction?",
        "fines.supply: 'slab' puts all fines in at the start, but nothing says how many",
        "drag.multiplier: True",
    ):
        assert part in text
    assert "\n" not in text


def test_a_bad_value_is_named_with_its_path():
    for part, values, expected in [
        ("fines", {"radius_mm": 0.3}, "expected below grains.radius_mm 0.25"),
        ("fines", {"slab_mm": 2.0}, "give one of the two, or none"),
        ("fines", {"concentration": 40.0}, "a mass of solids goes to fines.solids"),
        ("fines", {"concentration": 5e-324}, "or equal to 0.000000001"),
        ("grains", {"radius_mm": [0.3, 0.2]}, "must rise"),
        ("grains", {"count": 0}, "grains.count: 0"),
        ("box", {"size_mm": [3.0, 0.4, 1.6]}, "a grain does not fit"),
        ("box", {"size_mm": [3.0, 0.9, 1.6], "sides": "periodic"}, "its own image"),
        ("box", {"size_mm": [3.0, float("inf"), 1.6]}, "finite number"),
        ("box", {"size_mm": [3.0, 1e16, 1.6]}, "less than or equal to"),
        ("gravity", {"acceleration_m_s2": [1.0, 0.0]}, "gravity.acceleration_m_s2"),
        ("drag", {"crowd": "beetstra"}, "drag.crowd: unknown key"),
        ("drag", {"update_travel": 0.2}, "drag.update_travel: 0.2 belongs to drag.field 'netwo"),
        ("drag", {"scheme": "viscous", "inertia": "schiller-naumann"}, "depend on the slip"),
        ("drag", {"pressure_gradient": 1}, "drag.pressure_gradient: 1"),
        ("run", {"duration_ms": 1.0, "cap_ms": 2.0}, "give one of the two"),
        ("analysis", {"profile_bin_mm": 1e-9}, "more than 10000 bins"),
        ("analysis", {"sections": 10**6}, "less than or equal to"),
        ("fines", {"count": 10**9}, "expected at most 1e+07"),
        ("fines", {"concentration": 1e-8}, "box lengths"),
        ("grains", {"count": 200}, "sum to more than the box; expected at most 117"),
        ("drag", {"field": "network"}, "drag.upstream: 'interstitial' belongs to drag.field 'un"),
        ("run", {"stop_rate": 0.1}, "run.stop_rate: 0.1 belongs to drag.field 'network'"),
        ("drag", {"scheme": "viscous", "refresh_steps": 5}, "belongs to drag.scheme 'held'"),
        ("run", {"time_step_factor": 0.4}, "run.time_step_factor: 0.4"),
        ("run", {"skin_mm": 0.1}, "fdnet chooses the neighbour search, remove the key"),
        ("clean_up", {"drawdown_MPa": 1.0, "quiet_ms": 1.0}, "give clean_up.duration_ms, or"),
        ("run", {"max_hours": 0.0}, "run.max_hours: 0.0"),
        ("run", {"max_overlap": 1.0}, "run.max_overlap: 1.0"),
        ("run", {"stiffness_N_m": "nominel"}, "run.stiffness_N_m: 'nominel'"),
        ("analysis", {"law": "darcy"}, "analysis.law: 'darcy'"),
        ("analysis", {"damage_law": "kozeny"}, "'kozeny' is no longer there; take 'section-arc"),
        ("drag", {"scheme": "every_step"}, "'every_step' is no longer there; take 'held'"),
        ("fluid", {"viscosity_Pas": 0.05}, "unknown key"),
    ]:
        assert expected in problems(changed(**{part: values}))


def test_a_case_without_fines_is_a_type_of_its_own():
    bare = case_from({key: value for key, value in TINY.items() if key != "fines"})
    assert (type(bare), type(tiny())) == (Case, InvasionCase)
    assert bare.stages == ("pack", "analyse", "report")
    assert tiny().stages == ("pack", "invade", "analyse", "report")
    assert (set(bare.spheres), set(tiny().spheres)) == ({"grain"}, {"grain", "fine"})
    assert (type(scales_of(bare)), type(scales_of(tiny()))) == (Scales, InvasionScales)
    assert bare.digest("pack") != tiny().digest("pack")
    assert bare.same_specimen(bare.toml().encode())
    assert not bare.same_specimen(tiny().toml().encode())
    assert with_fines(tiny()) == tiny()
    with pytest.raises(CaseError, match=r"tiny: has no table \[fines\]"):
        with_fines(bare)


def test_every_table_is_written():
    assert set(KEYS) == set(InvasionCase.model_fields)
    well = "well={radius_mm=108.0, drainage_radius_m=100.0}"
    clean_up, bonds = "clean_up.drawdown_MPa=1.0", "bonds={radius_ratio=0.5}"
    settings = (well, bonds, "invasion.classes=8")
    written = list(tiny(*settings, clean_up).data())
    cake = ("invasion.method=network", "cake.permeability_m2=1e-18")
    written.insert(written.index("clean_up"), "cake")
    assert written == list(KEYS)
    assert "cake" in tiny(*settings, *cake).data()
    assert {"fines", "fines.radius_mm"} <= set(known_keys())
    with pytest.raises(CaseError, match="name"):
        case_from(set_keys({**TINY, "name": datetime.date(2020, 1, 1)}, []))
    assert "grains.porosity: missing" in problems({**TINY, "grains": {"radius_mm": 0.25}})


def test_stages_depend_only_on_their_own_keys():
    for key, stages in {
        "analysis.law=thesis": {"analyse"},
        "fines.count=301": {"invade", "analyse"},
        "seed=2": {"pack", "invade", "analyse"},
        "run.max_hours=1.0": set(),
        "run.max_overlap=0.1": set(),
    }.items():
        case, other = tiny(), tiny(key)
        moved = {one for one in DIGESTS if other.digest(one) != case.digest(one)}
        assert moved == stages, key


DIGESTS = ("pack", "invade", "analyse")


def test_set_reads_values_as_toml_and_refuses_nonsense():
    data = set_keys(TINY, ["fines.radius_mm=[0.03, 0.05]", "box.sides=periodic", "seed=7"])
    assert data["fines"]["radius_mm"] == [0.03, 0.05]
    assert data["box"]["sides"] == "periodic"
    assert (data["seed"], TINY["seed"]) == (7, 1)
    for bad in ("fines.radius_mm", "=3", "name.x=3"):
        with pytest.raises(CaseError, match="--set"):
            set_keys(TINY, [bad])


def test_unreadable_and_malformed_files(tmp_path: Path):
    (tmp_path / "bad.toml").write_text("name = ")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    for name, said in (
        ("none.toml", "cannot be read as a case file"),
        ("bad.toml", r"bad\.toml: not valid TOML"),
        ("bytes.toml", "cannot be read"),
    ):
        with pytest.raises(CaseError, match=said):
            read_case(tmp_path / name)


def test_fixed_keys_of_the_contract_exist():
    fixed = {
        "box": "size_mm sides",
        "grains": "radius_mm porosity density_kg_m3 friction motion",
        "fines": "radius_mm density_kg_m3 friction concentration",
        "fluid": "viscosity_cP density_kg_m3 overbalance_MPa",
        "drag": "field multiplier",
        "analysis": "sections law damage_law",
    }
    names = {f"{table}.{key}" for table, keys in fixed.items() for key in keys.split()}
    assert names | {"name", "seed"} <= set(known_keys())


def test_shipped_cases_keep_their_digests_and_their_text(root: Path):
    """Any other digest would orphan the run folders and stored states that were made from them."""
    table = pd.read_csv(root / "tests/data/case_digests.csv", dtype=str).set_index("case")
    shipped = {p.relative_to(root / "cases") for p in (root / "cases").rglob("*.toml")}
    shipped -= {path for path in shipped if path.parts[0] == "sweeps"}
    assert shipped == {Path(f"{name}.toml") for name in table.index}
    for name, row in table.iterrows():
        path = root / "cases" / f"{name}.toml"
        assert len(path.read_text().splitlines()) < 60
        case = read_case(path)
        assert case.name == name.replace("quick/", "quick-")
        assert list(row[[*DIGESTS]]) == [case.digest(stage) for stage in DIGESTS], name
        assert row["text"] == hashlib.sha256(case.toml().encode()).hexdigest()[:16], name


def test_a_box_for_more_grains_than_memory_is_refused():
    huge = {"box": {"size_mm": [800.0] * 3}, "grains": {"radius_mm": 0.25, "porosity": 0.4}}
    said = "box.size_mm: [800.0, 800.0, 800.0] holds 4.69e+09 grains; expected at"
    assert said in problems(TINY | huge)


# ---- Sizes, units and amounts at the command line.
SAND_AND_MUD = """
name = "bad"
[box]
size = ["3 mm", "2.4 mm", "2.4 mm"]
[grains]
sizes = {sand}
porosity = "38 %"
[fines]
sizes = {mud}
{solids}
slab = "1 mm"
{more}
[well]
radius = "108 mm"
drainage_radius = "100 m"
"""

SAND = '{ D10 = "0.25 mm", D50 = "0.40 mm", D90 = "0.60 mm" }'

MUD = '{ D10 = "30 um", D50 = "40 um", D90 = "60 um" }'

POINTS = '{{ size = ["20 um", "40 um", "80 um"], passing_percent = {} }}'


def written(folder: Path, **changed: str) -> Path:
    good = {"sand": SAND, "mud": MUD, "solids": 'concentration = "5 %"', "more": ""}
    path = folder / "bad.toml"
    path.write_text(SAND_AND_MUD.format(**{**good, **changed}), encoding="utf-8")
    return path


def test_bad_input_is_one_clear_error(tmp_path, capsys):
    assert main(["check", str(written(tmp_path))]) == 0, "the case itself is good"
    coarse = '{ D10 = "420 um", D50 = "430 um", D90 = "440 um" }'
    wide = '{ D10 = "50 um", D50 = "150 um", D90 = "300 um" }'
    sand, mud = '{ D50 = "0.40 mm", D90 = "0.402 mm" }', '{ D50 = "0.20 mm", D90 = "0.21 mm" }'
    both = 'concentration = "5 %"\nsolids = "25 lb/bbl"'
    for changed, message in (
        ({"mud": POINTS.format("[50.0, 20.0, 100.0]")}, "the curve must not fall: 50 % pass"),
        ({"mud": POINTS.format("[0.0, 50.0, 90.0]")}, "the curve ends at 90 % at 0.08 mm"),
        ({"mud": '{ D10 = "60 um", D50 = "40 um" }'}, "must rise from D10 to D90"),
        ({"mud": '{ D10 = "20 um", D50 = "40 cP" }'}, "'cP' is a unit of viscosity"),
        ({"mud": '{ D10 = "20 um", D50_mm = 0.04, D50 = "40 um" }'}, "give one of the two"),
        ({"sand": SAND.replace("0.25 mm", "0.25")}, "'0.25': has no unit"),
        ({"mud": coarse}, "above every throat"),
        ({"mud": wide}, "solids as large as the grains"),
        ({"sand": sand, "mud": mud}, "above every throat between touching grains"),
        ({"solids": 'concentration = "45 %"'}, "45 % of the mud's volume, expected at most 30"),
        ({"solids": 'solids = "400 lb/bbl"'}, "expected at most"),
        ({"solids": 'solids = "25 ppb"'}, "pounds per barrel or parts per billion"),
        ({"solids": both}, "give exactly one of the two"),
    ):
        code, *said = answer(capsys, "check", written(tmp_path, **changed))
        assert (code, message in said[1]) == (2, True), said
        assert "1 problem:" in said[1]
        assert said[1].count("\n") == 1


def test_an_unknown_key_is_met_with_the_one_that_is_meant():
    for key, hint in [
        ("fines.D50_um", "did you mean fines.sizes ="),
        ("fines.radius_um", "did you mean fines.radius_mm?"),
        ("fluid.viscosity_Pa_s", "did you mean fluid.viscosity_cP?"),
        ("fines.porosity", "did you mean grains.porosity?"),
        ("grains.frictoin", "did you mean grains.friction?"),
        ("fines.spread", "unknown key (given 1)"),
    ]:
        said = problems(set_keys(tiny().data(), [f"{key}=1"]))
        assert hint in said
        assert "slab_mm?" not in said


def test_a_run_of_another_case_is_refused_with_the_keys_that_differ(tmp_path, capsys):
    case, run = tmp_path / "case.toml", tmp_path / "run"
    case.write_text(tiny().toml())
    run.mkdir()
    mark_folder(run)
    (run / "case.toml").write_text(tiny("fines.count=200", "run.max_hours=1.0").toml())
    assert main(["run", str(case), "--out", str(run), "--resume"]) == 2
    error = capsys.readouterr().err
    assert "fines.count = 200 there, 300 here" in error
    assert "repeat the --set" in error
    assert "max_hours" not in error


# ---- Side walls of the analysis count in the digest of a stage whose fluid is made with them.
NETWORK = ('drag={field = "network"}',)

LIFTED = ("clean_up.drawdown_MPa=1.0",)

PERIODIC = ("box.sides=periodic",)


def moved_by(*keys: str) -> set[str]:
    """The stages whose digest is another one where the walls slip."""
    held, slip = tiny(*keys), tiny(*keys, "analysis.walls=slip")
    stages = ("pack", "invade", "clean_up", "analyse")
    return {stage for stage in stages if held.digest(stage) != slip.digest(stage)}


def test_walls_count_where_the_fluid_is_made_with_them():
    """The analysis itself always depends on them; a pack never does."""
    for keys, stages in [
        (NETWORK, {"invade", "clean_up"}),
        ((*NETWORK, *LIFTED, "run.stiffness_N_m=auto"), {"invade", "clean_up"}),
        (LIFTED, set()),
        ((), set()),
        ((*NETWORK, *PERIODIC), set()),
    ]:
        assert moved_by(*keys) == {*stages, "analyse"}, keys
