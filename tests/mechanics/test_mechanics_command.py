"""`fdnet mechanics` on a small pack of the real binary, and what it refuses."""

import json
import shutil

import pytest

from fdnet.case.file import case_from, recorded_case
from fdnet.cli import main
from fdnet.errors import CaseError
from fdnet.report.html import mechanics_html as section_html
from fdnet.report.html import put_mechanics

CASE = """
name = "sand"
seed = 3
[box]
size_mm = [2.4, 2.4, 2.4]
[grains]
radius_mm = 0.25
porosity = {porosity}
normal_stiffness_N_m = 9.43e7
shear_stiffness_N_m = 3.4e7
"""
BONDS = ("bonds.radius_ratio=0.5", "bonds.normal_stiffness_GPa_m=2e5")


@pytest.fixture(scope="module")
def packed(tmp_path_factory):
    """A run folder with a dense pack and its mechanics, and the numbers that were printed."""
    folder = tmp_path_factory.mktemp("mechanics")
    (folder / "sand.toml").write_text(CASE.format(porosity=0.36))
    out = folder / "run"
    assert main(["mechanics", str(folder / "sand.toml"), "--out", str(out), "--quiet"]) == 0
    return out


def printed(capsys, *arguments):
    assert main(["mechanics", *map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.liggghts
def test_numbers_of_the_contract(packed, capsys):
    numbers = printed(capsys, packed)
    kept = json.loads((packed / "mechanics" / "mechanics.json").read_text())
    assert kept["young_modulus_Pa"] == numbers["young_modulus_Pa"]
    bulk, shear = numbers["bulk_modulus_Pa"], numbers["shear_modulus_Pa"]
    young = 9 * bulk * shear / (3 * bulk + shear)
    assert numbers["young_modulus_Pa"] == pytest.approx(young, rel=1e-9)
    density = 2650 * (1 - 0.36)
    assert numbers["s_wave_m_s"] == pytest.approx((shear / density) ** 0.5, rel=0.01)
    assert numbers["p_wave_m_s"] > numbers["s_wave_m_s"] > 0
    assert 4 < numbers["coordination"] < 9
    assert numbers["rattlers"] >= 0
    assert any("no table [bonds]" in text for text in numbers["warnings"])


@pytest.mark.liggghts
def test_stiffness_and_bonds_may_be_set_anew_on_a_pack(packed, capsys):
    first = printed(capsys, packed)
    stiffer = [f"grains.{key}" for key in ("normal_stiffness_N_m=1.886e8",)]
    stiffer += ["grains.shear_stiffness_N_m=6.8e7"]
    double = printed(capsys, packed, *[part for one in stiffer for part in ("--set", one)])
    ratio = double["young_modulus_Pa"] / first["young_modulus_Pa"]
    assert ratio == pytest.approx(2.0, rel=1e-6)
    bonded = printed(capsys, packed, *[part for one in BONDS for part in ("--set", one)])
    assert bonded["young_modulus_Pa"] > first["young_modulus_Pa"]
    assert bonded["bonds"] > 100


@pytest.mark.liggghts
def test_hertz_contacts_stiffen_with_the_third_root_of_pressure(packed):
    from fdnet.mechanics.of_case import pack_material
    from fdnet.spheres.snapshot import resting

    data = recorded_case(packed / "case.toml").data()
    del data["grains"]["normal_stiffness_N_m"], data["grains"]["shear_stiffness_N_m"]
    case = case_from(data | {"contact": {"model": "hertz"}})
    pair = resting([[1e-3, 1e-3, 1e-3], [1.5e-3, 1e-3, 1e-3]], 2.5e-4, [[0, 2.4e-3]] * 3)
    soft, stiff = (pack_material(case, pair, pressure) for pressure in (1e6, 8e6))
    assert stiff.normal / soft.normal == pytest.approx(2.0, rel=1e-9)
    with pytest.raises(CaseError, match="--confining_MPa"):
        pack_material(case, pair)


@pytest.mark.liggghts
def test_the_report_gets_its_section(packed, tmp_path):
    page = tmp_path / "report.html"
    page.write_text(
        "<p>one</p>\n<!-- mechanics begins -->\nold\n<!-- mechanics ends -->\n<p>two</p>"
    )
    put_mechanics(page, packed / "mechanics")
    text = page.read_text()
    assert "Young&#x27;s modulus" in text
    assert "old" not in text
    assert text.startswith("<p>one</p>")
    assert text.endswith("<p>two</p>")


@pytest.mark.liggghts
@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("bonds.tensile_strength_MPa=5", "bonds.radius_ratio: missing"),
        ("bonds.radius_ratio=1.5", "less than or equal to 1"),
        ("grains.radius_mm=0.2", "belongs to another case"),
        ("bonds.width=1", "unknown key"),
    ],
)
def test_bad_keys_are_refused(packed, capsys, assignment, words):
    assert main(["mechanics", str(packed), "--set", assignment]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.liggghts
@pytest.mark.parametrize("value", ["-1", "0", "nan"])
def test_a_confining_stress_is_above_zero(packed, capsys, value):
    assert main(["mechanics", str(packed), "--confining_MPa", value]) == 2
    assert "expected a stress above 0" in capsys.readouterr().err


@pytest.mark.liggghts
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "give --confining_MPa"),
        (["--confining_MPa", "1", "--strain", "0.9"], "--strain: 0.9"),
        (["--confining_MPa", "1", "--steps", "0"], "--steps: 0"),
        (["--confining_MPa", "1e6"], "expected at most 5 %"),
    ],
)
def test_bad_triaxial_tests_are_refused(packed, capsys, arguments, words):
    assert main(["mechanics", str(packed), "--triaxial", *arguments]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.liggghts
def test_a_triaxial_test_leaves_its_curve(packed, capsys):
    numbers = printed(
        capsys, packed, "--triaxial", "--confining_MPa", 5, "--strain", 2e-4, "--steps", 2
    )
    test = numbers["triaxial"]
    lines = (packed / "mechanics" / "stress_strain.csv").read_text().splitlines()
    assert len(lines) == 5
    assert lines[0].startswith("axial_strain,volume_strain,axial_Pa,side_Pa,broken_in_tension")
    assert (packed / "mechanics" / "stress_strain.png").stat().st_size > 5000
    assert 0.5 < test["young_modulus_Pa"] / numbers["young_modulus_x_Pa"] < 1.1
    assert test["peak_Pa"] > 0


def test_one_strength_alone_is_refused():
    data = {
        "name": "a",
        "box": {"size_mm": [2.4, 2.4, 2.4]},
        "grains": {"radius_mm": 0.25, "porosity": 0.36},
        "bonds": {"radius_ratio": 0.5, "tensile_strength_MPa": 3.0},
    }
    with pytest.raises(CaseError, match=r"bonds.shear_strength_MPa: missing"):
        case_from(data)


def test_a_folder_without_a_run_is_refused(tmp_path, capsys):
    assert main(["mechanics", str(tmp_path)]) == 2
    assert "holds no fdnet run" in capsys.readouterr().err


def test_bonds_change_no_digest():
    data = {
        "name": "a",
        "box": {"size_mm": [2.4, 2.4, 2.4]},
        "grains": {"radius_mm": 0.25, "porosity": 0.36},
    }
    bonded = case_from(data | {"bonds": {"radius_ratio": 0.5}})
    assert bonded.digest() == case_from(data).digest()


@pytest.mark.liggghts
def test_a_pack_whose_grains_hardly_touch_is_refused(tmp_path, capsys):
    (tmp_path / "loose.toml").write_text(CASE.format(porosity=0.5))
    out = str(tmp_path / "run")
    assert main(["mechanics", str(tmp_path / "loose.toml"), "--out", out, "--quiet"]) == 4
    assert "carries no load along x" in capsys.readouterr().err


def edited(**keys):
    """Puts keys into mechanics.json; None takes one out."""

    def edit(path):
        data = json.loads(path.read_text()) | keys
        path.write_text(json.dumps({k: v for k, v in data.items() if v is not None}))

    return edit


@pytest.mark.liggghts
@pytest.mark.parametrize(
    "spoil",
    [
        edited(bulk_modulus_Pa=None),
        edited(warnings=None),
        edited(warnings="none"),
        edited(young_modulus_Pa="stiff"),
        edited(poisson_ratio=float("nan")),
        edited(triaxial=[1]),
        lambda path: path.write_text("[1]"),
        lambda path: path.write_text(""),
        lambda path: path.write_bytes(b"{\xff}"),
        lambda path: (path.unlink(), path.mkdir()),
    ],
)
def test_numbers_of_another_shape_are_refused_in_the_report(packed, tmp_path, spoil):
    folder = tmp_path / "mechanics"
    shutil.copytree(packed / "mechanics", folder)
    spoil(folder / "mechanics.json")
    with pytest.raises(CaseError, match=r"mechanics\.json: .*measure it anew"):
        section_html(folder)


@pytest.mark.liggghts
def test_a_page_that_is_no_text_is_refused(packed, tmp_path, capsys):
    run = tmp_path / "run"
    shutil.copytree(packed, run)
    (run / "report.html").write_bytes(b"<p>\xff</p>")
    assert main(["mechanics", str(run)]) == 2
    assert "report.html: cannot be read as a page" in capsys.readouterr().err
    (run / "report.html").write_text("<p>mine</p>")
    assert main(["mechanics", str(run)]) == 0
    assert "has no place for the mechanics" in capsys.readouterr().err
