"""Nobody's files are lost: what fdnet did not write is neither overwritten nor deleted."""

import json
import os
import shutil
from pathlib import Path

import pytest
from builders import answer, naming, tiny

import fdnet
from fdnet.errors import CaseError
from fdnet.files import write_text
from fdnet.run import pipeline
from fdnet.run.records import RunOptions

CUBE = "x_m,y_m,z_m,radius_m\n" + "".join(
    f"{x + 0.5},{y + 0.5},{z + 0.5},0.5\n" for x in range(3) for y in range(3) for z in range(3)
)


def content(folder: Path) -> dict[str, bytes]:
    """Every file below `folder` and what it holds."""
    return {str(p): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def foreign(folder: Path, name: str, text: str) -> Path:
    """A folder of somebody else's with `name` in it and results of theirs."""
    for file, words in ((name, text), ("report.html", "mine"), ("summary.json", "{}")):
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(words)
    (folder / "figures").mkdir()
    (folder / "figures" / "mine.png").write_text("mine")
    (folder / "pack").mkdir(exist_ok=True)
    (folder / "pack" / "clothes.txt").write_text("mine")
    return folder


@pytest.mark.liggghts
def test_a_folder_of_somebody_else_is_refused_whole(tmp_path, case_file, capsys):
    """Also one with an empty lock, a manifest or a case of another program; --force or not."""
    for number, (name, text) in enumerate(
        [
            (".lock", ""),
            (".lock", "pid 77\n"),
            ("manifest.json", '{"name": "web app", "icons": []}'),
            ("manifest.json", '{"format": 1, "name": "another program"}'),
            ("manifest.json", "not JSON"),
            ("pack/stage.json", '{"stage": "theatre"}'),
            ("pack/stage.json", '{"format": 1}'),
            (".unfinished", "symphony\n"),
            (".fdnet-run", "\n"),
            ("case.toml", case_file.read_text()),
        ]
    ):
        out = foreign(tmp_path / f"theirs {number}", name, text)
        before = content(out)
        for extra in ([], ["--force"], ["--resume"]):
            with naming(name, text, extra):
                code, _, err = answer(capsys, "run", case_file, "--out", out, "--quiet", *extra)
                assert code == 2
                assert "holds no fdnet run" in err
                assert "--force" not in err
                assert content(out) == before


@pytest.mark.liggghts
def test_a_folder_of_ours_is_known_and_freed_of_half_written_files(tmp_path, case_file, capsys):
    """By its mark or its content; one with the empty lock of a session killed at once, too."""
    out = tmp_path / "run"
    out.mkdir()
    (out / ".lock").touch()
    pack = ["run", case_file, "--out", out, "--quiet", "--stages", "pack"]
    assert answer(capsys, *pack)[0] == 0
    assert (out / ".fdnet-run").read_text().startswith("fdnet run folder")
    (out / ".fdnet-run").unlink()
    (out / "figures").mkdir()
    for name in (".sections.999.part.csv", "figures/.sections.12.part.png", "pack/.x.7.part"):
        (out / name).write_text("half")
    (out / "my.part.csv").write_text("mine")
    assert answer(capsys, *pack)[0] == 0
    assert [path.name for path in out.rglob("*.part*")] == ["my.part.csv"]


@pytest.mark.liggghts
def test_a_refused_run_leaves_what_another_put_into_its_new_folder(tmp_path, monkeypatch):
    def refuse(session):
        (session.path / "notes.txt").write_text("mine")
        raise CaseError("refused")

    monkeypatch.setattr(pipeline, "pack_stage", refuse)
    with pytest.raises(CaseError, match="refused"):
        pipeline.run_stages(tiny(), RunOptions(out=tmp_path / "run", show_progress=False))
    assert [p.name for p in (tmp_path / "run").iterdir()] == ["notes.txt"]


def test_decks_are_never_written_over_a_file(tmp_path, case_file, capsys):
    for name in ("pack/pack.data", "pack/in.pack", "invade/in.invade", ".fdnet-run"):
        out = tmp_path / name.replace("/", " ")
        (out / name).parent.mkdir(parents=True)
        (out / name).write_text("fdnet run folder, format 1\n")
        before = content(out)
        code, _, err = answer(capsys, "render", case_file, "--out", out)
        assert code == 2
        assert ("run folder" if name == ".fdnet-run" else "is there already") in err
        assert content(out) == before, name


def test_a_device_a_pipe_or_a_folder_is_never_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "folder"):
        with pytest.raises(CaseError, match="is no ordinary file"):
            write_text(tmp_path / name, "x")
    assert (tmp_path / "pipe").is_fifo()


@pytest.mark.liggghts
def test_the_home_folder_is_meant_by_a_tilde(tmp_path, case_file, capsys, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "home").mkdir()
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    shutil.copy(case_file, tmp_path / "home" / "case.toml")
    (tmp_path / "home" / "s.csv").write_text(CUBE)
    stages = ("pack", "invade", "analyse")
    given = ("~/case.toml", "--out=~/run", "--quiet", "--stages", ",".join(stages))
    assert answer(capsys, "run", *given)[0] == 0
    assert answer(capsys, "render", "~/case.toml", "--out=~/decks")[0] == 0
    assert answer(capsys, "permeability", "~/s.csv")[0] == 0
    assert not list((tmp_path / "here").iterdir())
    assert (tmp_path / "home" / "decks").is_dir()
    assert fdnet.open_run("~/run").sections is not None
    assert len(fdnet.read_spheres("~/s.csv")) == 27
    assert fdnet.read_case("~/case.toml").name == "tiny"
    again = fdnet.run_case("~/case.toml", "~/run", stages=stages)
    assert again.path == tmp_path / "home" / "run"
    assert json.loads((tmp_path / "home" / "run" / "manifest.json").read_text())["case"] == "tiny"


def test_no_folder_is_made_whose_name_is_a_tilde(tmp_path, case_file, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for command in ("run", "render"):
        code, _, err = answer(capsys, command, case_file, "--out=./~/runs/a")
        assert code == 2
        assert "folder with the name ~" in err
    code, _, err = answer(capsys, "run", case_file, "--out=~nobody-of-that-name/a")
    assert code == 2
    assert "home folder" in err
    assert not (tmp_path / "~").exists()
