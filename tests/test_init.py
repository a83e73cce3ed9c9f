"""`fdnet init`: a case file that runs, from what an engineer knows."""

import tomllib
from pathlib import Path

import pytest

from fdnet.case.file import first_sentence, read_case
from fdnet.cli import main
from fdnet.scales.cost import cost_of
from fdnet.scales.scales import scales_of

SAND = {"sand_d10": "0.25 mm", "sand_d50": "0.40 mm", "sand_d90": "0.60 mm"}
MUD = {"mud_d50": "40 um", "solids": "5 %", "viscosity": "10 cP", "overbalance": "300 psi"}


def init(out: Path, *extra: str, **changed: str) -> int:
    given = {**SAND, "porosity": "0.38", **MUD, **changed}
    pairs = ((f"--{key.replace('_', '-')}", text) for key, text in given.items() if text)
    words = [word for pair in pairs for word in pair]
    return main(["init", *words, "--out", str(out), *extra])


@pytest.mark.parametrize("median", [30, 100])
def test_the_case_of_a_sand_and_a_mud_is_sized_by_them(median, tmp_path, capsys):
    """Each size against its reason: the box by the grains, the cuts, contacts and the time."""
    out = tmp_path / "case.toml"
    assert init(out, mud_d50=f"{median} um") == 0
    case = read_case(out)
    scales, cost = scales_of(case), cost_of(case, scales_of(case))
    length, width, _ = case.size_m
    grain = case.grains.sauter_diameter_m
    assert width >= 2 * 2 * case.grains.radius_range_m[1]
    assert width >= 4.9 * grain
    assert length / case.analysis.sections >= 1.5 * grain
    assert 2 * case.fines.radius_range_m[1] < 2 * case.grains.radius_range_m[0]
    assert case.invasion is None or case.invasion.method == "both"
    assert max(scales.impact_overlap, scales.drag_overlap) <= case.run.max_overlap
    said = capsys.readouterr().out
    assert cost.seconds <= 600
    assert f"LIGGGHTS takes {100 * case.fines.curve.kept:.2g} % of the solids" in said
    assert ("the network takes" in said) == case.with_classes
    assert case.fines.endless
    assert case.fines.sizes.D10_mm == pytest.approx(5e-4 * median)
    assert case.well.radius_mm == 108.0
    text = out.read_text()
    assert "drainage_radius" not in text
    assert case.well.drainage_radius_m == 100.0
    text = text.replace(chr(10) + "# ", " ")
    share = f"{100 * case.fines.curve.below:.0f} % of the solids are finer"
    assert (share in text) == (case.fines.cut_um is not None)
    assert "assumed" in text
    assert max(map(len, out.read_text().splitlines())) <= 99


def test_an_ordinary_mud_fits_its_time_and_one_too_fine_is_the_networks(tmp_path, capsys):
    """Carbonate of 5 to 70 um in a sand of 450 um took 11 h or was refused as spheres alone."""
    sand = {"sand_d10": "0.3 mm", "sand_d50": "0.45 mm", "sand_d90": "0.65 mm"}
    mud = {"mud_d10": "5 um", "mud_d50": "25 um", "mud_d90": "70 um", "solids": "40 kg/m3"}
    for size, most in (("quick", 600), ("standard", 4 * 3600)):
        out = tmp_path / f"{size}.toml"
        assert init(out, "--size", size, overbalance="35 bar", **sand, **mud) == 0
        case = read_case(out)
        assert case.with_classes
        assert case.fines.curve.kept > 0.05
        assert cost_of(case, scales_of(case)).seconds <= most
    finest = tmp_path / "finest.toml"
    assert init(finest, mud_d50="1 um") == 0
    assert read_case(finest).by_classes
    assert "the network takes all solids" in capsys.readouterr().out


def test_more_time_leaves_less_out_and_makes_a_wider_box(tmp_path):
    quick, standard = tmp_path / "quick.toml", tmp_path / "standard.toml"
    assert init(quick) == init(standard, "--size", "standard") == 0
    small, large = read_case(quick), read_case(standard)
    assert large.fines.curve.kept > small.fines.curve.kept
    assert large.size_m[1] > small.size_m[1]
    dense = tmp_path / "dense.toml"
    assert init(dense, porosity="32 %") == 0


def test_sizes_may_be_in_files_named_from_anywhere(tmp_path, monkeypatch):
    (tmp_path / "lab").mkdir()
    (tmp_path / "cases").mkdir()
    table = "sieve (mm),passing %\n0.2,0\n0.3,30\n0.45,70\n0.7,100\n"
    (tmp_path / "lab" / "sand.csv").write_text(table)
    monkeypatch.chdir(tmp_path / "lab")
    out = tmp_path / "cases" / "case.toml"
    none = dict.fromkeys(("sand_d10", "sand_d50", "sand_d90"), "")
    assert init(out, "--sand-file", "sand.csv", **none) == 0
    assert tomllib.loads(out.read_text())["grains"]["sizes"]["file"] == "../lab/sand.csv"
    assert read_case(out).grains.sizes.size_mm == (0.2, 0.3, 0.45, 0.7)


def test_answers_that_make_no_case_are_refused(tmp_path, capsys):
    three = {"viscosity": "10", "mud_d50": "x", "solids": ""}
    missing = '2 answers are missing: --sand-d50 "0.40 mm", --solids'
    out = tmp_path / "case.toml"
    out.write_text("mine")
    assert init(out, sand_d50="") == 2
    assert "is there already" in capsys.readouterr().err
    assert out.read_text() == "mine"
    out.unlink()
    for changed, message in (
        ({"sand_d50": "", "solids": ""}, missing),
        ({"overbalance": "300"}, "--overbalance: '300': has no unit"),
        ({"sand_d50": "0.2 mm"}, "--sand: the sizes make no curve"),
        ({"mud_d50": "0.4"}, "--mud-d50: '0.4': has no unit"),
        ({"mud_d50": "400 um"}, "as coarse as the finest sand"),
        ({"solids": "45 %"}, "--solids: 0.45"),
        ({"porosity": "38 mm"}, "--porosity: '38 mm': 'mm' is a unit of length"),
        (three, "| --viscosity: '10': has no unit"),
        (three, "| 1 answer is missing: --solids"),
        ({"porosity": "200 %", "sand_d50": "0.1 mm"}, "| --porosity: 2.0 should be less than 1"),
    ):
        assert init(out, **changed) == 2, message
        error = capsys.readouterr().err
        assert message in error
        assert len(error.splitlines()) == 1
        assert not out.exists()


def answering(monkeypatch, replies):
    """A terminal that gives the first of `replies` to what begins with its key; "" otherwise."""
    asked: list[str] = []

    def answer(prompt: str) -> str:
        asked.append(prompt)
        left = next((one for start, one in replies.items() if prompt.startswith(start)), [])
        return left.pop(0) if left else ""

    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", answer)
    return asked


def test_one_bad_answer_is_asked_for_again_and_the_others_stay(tmp_path, monkeypatch, capsys):
    replies = {
        "Sand, D50": ["0.40", "0.40 mm"],
        "Porosity": ["", "38 %"],
        "Solids in the mud": ["45 %", "5 %"],
        "Viscosity": ["ten cP", "10 cP"],
    }
    asked, out = answering(monkeypatch, replies), tmp_path / "case.toml"
    assert init(out, **dict.fromkeys(("sand_d50", "porosity", "solids", "viscosity"), "")) == 0
    case = read_case(out)
    assert (case.grains.sizes.D50_mm, case.fluid.viscosity_cP) == (0.4, 10)
    assert case.fines.concentration == pytest.approx(0.05)
    assert not any(replies.values())
    assert sum(prompt.startswith("Porosity") for prompt in asked) == 2
    said = capsys.readouterr().err
    for text in ("it needs an answer, as", "'0.40': has no unit", "'ten cP'", "--solids: 0.45"):
        assert text in said


def test_cases_lists_and_copies_what_comes_with_fdnet(tmp_path, capsys, root, monkeypatch):
    assert main(["init", "--list"]) == 0
    listed = {line.split()[0] for line in capsys.readouterr().out.splitlines()}
    full = {path.stem for path in (root / "cases").glob("*.toml")}
    quick = {f"quick-{path.stem}" for path in (root / "cases" / "quick").glob("*.toml")}
    assert listed == full | quick
    monkeypatch.chdir(tmp_path)
    assert main(["init", "--from", "quick-specimen1"]) == 0
    copied = tmp_path / "quick-specimen1.toml"
    assert copied.read_text() == (root / "cases/quick/specimen1.toml").read_text()
    copied.write_text("mine")
    assert main(["init", "--from", "quick-specimen1"]) == 2
    assert copied.read_text() == "mine"
    assert "--force" in capsys.readouterr().err
    assert main(["init", "--from", "quick-specimen1", "--force"]) == 0
    assert main(["init", "--from", "quik"]) == 2
    assert "did you mean quick?" in capsys.readouterr().err
    assert main(["init", "--from", "quick", "--solids", "5 %"]) == 2
    assert "leave --solids out" in capsys.readouterr().err
    text = "# A box of 4 x 2.4 mm, that is small." + chr(10) + "# More." + chr(10)
    assert first_sentence(text) == "A box of 4 x 2.4 mm, that is small"
