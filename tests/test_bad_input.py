"""Bad sizes, units and amounts get one clear error each; a slip in a key gets a sensible hint."""

from pathlib import Path

import pytest
from builders import tiny

from fdnet.case.case import difference_text
from fdnet.case.file import case_from, set_keys
from fdnet.cli import _parser, main
from fdnet.run.folder import mark_folder

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
[run]
stiffness = "100 N/m"
"""
SAND = '{ D10 = "0.25 mm", D50 = "0.40 mm", D90 = "0.60 mm" }'
MUD = '{ D10 = "30 um", D50 = "40 um", D90 = "60 um" }'
POINTS = '{{ size = ["20 um", "40 um", "80 um"], passing_percent = {} }}'


def written(folder: Path, **changed: str) -> Path:
    good = {"sand": SAND, "mud": MUD, "solids": 'concentration = "5 %"', "more": ""}
    path = folder / "bad.toml"
    path.write_text(SAND_AND_MUD.format(**{**good, **changed}), encoding="utf-8")
    return path


def test_the_case_itself_is_good(tmp_path, capsys):
    assert main(["check", str(written(tmp_path))]) == 0


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"mud": POINTS.format("[50.0, 20.0, 100.0]")}, "the curve must not fall: 50 % pass"),
        ({"mud": POINTS.format("[0.0, 50.0, 90.0]")}, "the curve ends at 90 % at 0.08 mm"),
        ({"mud": '{ D10 = "60 um", D50 = "40 um" }'}, "must rise from D10 to D90"),
        ({"mud": '{ D10 = "20 um", D50 = "40 cP" }'}, "'cP' is a unit of viscosity"),
        ({"mud": '{ D10 = "20 um", D50_mm = 0.04, D50 = "40 um" }'}, "give one of the two"),
        ({"sand": SAND.replace("0.25 mm", "0.25")}, "'0.25': has no unit"),
        ({"mud": '{ D10 = "420 um", D50 = "430 um", D90 = "440 um" }'}, "above every throat"),
        ({"mud": '{ D10 = "50 um", D50 = "150 um", D90 = "300 um" }'}, "is not below"),
        (
            {
                "sand": '{ D50 = "0.40 mm", D90 = "0.402 mm" }',
                "mud": '{ D50 = "0.20 mm", D90 = "0.21 mm" }',
            },
            "above every throat between touching grains",
        ),
        ({"solids": 'concentration = "45 %"'}, "fines.concentration: 0.45"),
        ({"solids": 'solids = "400 lb/bbl"'}, "expected at most"),
        ({"solids": 'solids = "25 ppb"'}, "pounds per barrel or parts per billion"),
        ({"solids": 'concentration = "5 %"\nsolids = "25 lb/bbl"'}, "give exactly one of the two"),
    ],
)
def test_bad_input_is_one_clear_error(changed, message, tmp_path, capsys):
    path = written(tmp_path, **changed)
    assert main(["check", str(path)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert "1 problem:" in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("fines.D50_um", "did you mean fines.sizes ="),
        ("fines.radius_um", "did you mean fines.radius_mm?"),
        ("fluid.viscosity_Pa_s", "did you mean fluid.viscosity_cP?"),
        ("fines.porosity", "did you mean grains.porosity?"),
        ("grains.frictoin", "did you mean grains.friction?"),
        ("fines.spread", "unknown key (given 1)"),
    ],
)
def test_an_unknown_key_is_met_with_the_one_that_is_meant(key, hint):
    from fdnet.errors import CaseError

    with pytest.raises(CaseError) as caught:
        case_from(set_keys(tiny().data(), [f"{key}=1"]))
    assert hint in str(caught.value)
    assert "slab_mm?" not in str(caught.value)


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


def test_what_differs_between_two_cases_is_named_by_key():
    mine = tiny("grains.friction=0.3", "run.on_overlap=stop")
    assert difference_text(mine, tiny().data()) == "grains.friction = 0.55 there, 0.3 here"
    assert difference_text(tiny(), tiny().data()) == ""
    many = tiny(*(f"fluid.{key}=2.0" for key in ("viscosity_cP", "density_kg_m3")), "seed=9",
                "fines.count=7", "grains.count=50", "analysis.sections=2")  # fmt: skip
    assert difference_text(many, tiny().data()).endswith(", and 2 more keys")


def commands() -> list[str]:
    """The names of all commands, from the parser itself."""
    parsers = [one for one in _parser()._actions if isinstance(one.choices, dict)]
    return [name for one in parsers for name in one.choices]


@pytest.mark.parametrize("command", commands())
def test_every_command_explains_itself(capsys, command):
    with pytest.raises(SystemExit) as ended:
        main([command, "--help"])
    assert ended.value.code == 0
    screen = capsys.readouterr().out
    assert f"fdnet {command}" in screen
    assert "%%" not in screen
