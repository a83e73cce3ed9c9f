"""Movies, and the flow at the states of a run: in order, with their times, and what is refused."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fdnet import solve_flow
from fdnet.cli import main
from fdnet.errors import CaseError
from fdnet.report import picture as pictures
from fdnet.report.picture import LAST_FRAMES, MovieFrame, Scene, write_movie
from fdnet.run import movie
from fdnet.run.movie import DrawnState, fluxes_of, movie_of

GREYS = (40, 120, 200)
HALF = {"rate_over_initial": 0.5}


def drawn(scene, frames, targets, *, seconds):
    """Stands for the drawing process: one grey picture for each frame."""
    for target, grey in zip(targets, GREYS, strict=False):
        Image.new("RGB", (1500, 950), (grey,) * 3).save(target)


def written(path):
    """A movie of three states of no run."""
    scene = Scene(grains=path.parent / "g.vtp", box=np.array([[0.0, 4e-3], [0, 2e-3], [0, 2e-3]]))
    files = [path.parent / f"{number}.vtp" for number in range(len(GREYS))]
    frames = [MovieFrame(spheres=file, words=f"{file.stem} ms") for file in files]
    return write_movie(path, frames, scene, per_second=4.0)


def test_a_gif_shows_the_states_in_order_and_stays_on_the_last(tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "draw_frames", drawn)
    path = written(tmp_path / "m.gif")
    seen, total = [], 0
    with Image.open(path) as picture:
        for number in range(picture.n_frames):
            picture.seek(number)
            total += picture.info["duration"]
            seen.append(picture.convert("L").getpixel((700, 400)))
    assert total == 250 * (len(GREYS) + LAST_FRAMES)
    assert list(dict.fromkeys(seen)) == pytest.approx(GREYS, abs=3)


def test_what_makes_no_movie_leaves_no_file(tmp_path, monkeypatch):
    def fail(*_, **__):
        raise OSError("no context")

    monkeypatch.setattr(pictures, "draw_frames", fail)
    for name, said in (("m.avi", "expected .gif, .mp4 or"), ("m.gif", "because no context")):
        with pytest.raises(CaseError, match=said):
            written(tmp_path / name)
        assert not (tmp_path / name).exists()
    with pytest.raises(CaseError, match=r"--fps: 99, expected 0.5 to 30"):
        movie_of(tmp_path, per_second=99)
    with pytest.raises(CaseError, match="holds no fdnet run"):
        movie_of(tmp_path)


@pytest.fixture
def copied(finished, tmp_path):
    return Path(shutil.copytree(finished.path, tmp_path / "run"))


@pytest.fixture
def shown(monkeypatch):
    """The files that a movie is made of, without drawing it."""
    seen = []

    def write(path, frames, scene, *, per_second):
        seen.extend(frame.spheres.name for frame in frames)
        return path

    monkeypatch.setattr(movie, "write_movie", write)
    return seen


@pytest.mark.liggghts
def test_a_movie_replaces_no_file_unasked(copied, tmp_path, shown):
    for name in ("m.gif", "m.png", None):
        there = copied / "invasion.gif" if name is None else tmp_path / name
        there.write_text("mine")
        target = None if name is None else there
        with pytest.raises(CaseError, match=f"{there.name}: is there already; .*--force"):
            movie_of(copied, target)
        assert movie_of(copied, target, force=True) == there


@pytest.mark.liggghts
def test_a_movie_shows_the_states_of_its_run_alone(copied, tmp_path, shown):
    whole = sorted((copied / "frames").glob("spheres_*.vtp"), key=lambda p: int(p.stem[8:]))
    names = [path.name for path in whole]
    for other in ("spheres_old.vtp", "spheres_.vtp", "spheres_1.vtp.bak", "spheres_7.vtp"):
        shutil.copy(whole[0], copied / "frames" / other)
    movie_of(copied, tmp_path / "m.gif")
    assert shown[1:] == names
    whole[0].unlink()
    with pytest.raises(CaseError, match=rf"{names[0]}: is missing; put the file back"):
        movie_of(copied, tmp_path / "m.gif")


@pytest.mark.liggghts
def test_a_movie_of_a_changed_run_is_refused(copied, tmp_path, shown):
    frame = sorted((copied / "frames").glob("spheres_*.vtp"))[1]
    others = ("spheres_initial.vtp", "history.csv", "profile.csv")
    for path in (frame, *(copied / name for name in others)):
        whole = path.read_bytes()
        path.write_bytes(whole.replace(b"1", b"2", 1))
        with pytest.raises(CaseError, match=rf"{path.name}: is not the file that the run wrote"):
            movie_of(copied, tmp_path / "m.gif")
        path.write_bytes(whole)


# ---- The flow at the states of a run.
@pytest.mark.liggghts
def test_fluxes_are_those_of_the_run_before_and_after(finished):
    """throats.csv holds the fluxes of both states over the same drop of pressure."""
    network, table = finished.network(), finished.throats
    files = [finished.path / f"spheres_{state}.vtp" for state in ("initial", "damaged", "initial")]
    states = [DrawnState(file, row) for file, row in zip(files, ({}, {}, HALF), strict=True)]
    initial, damaged, slower = fluxes_of(finished, network, states)
    first = solve_flow(network, table["conductance_initial_m3"].to_numpy()).inflow
    for (values, _), name, share in (
        (initial, "initial", 1.0),
        (damaged, "damaged", 1.0),
        (slower, "initial", 0.5),
    ):
        expected = 100.0 * share * np.abs(table[f"flux_{name}_m3"]) / first
        assert values == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert slower[1] == pytest.approx(1.0)


@pytest.mark.liggghts
def test_the_command_draws_before_and_after(finished, tmp_path, capsys):
    target = tmp_path / "flux.png"
    assert main(["movie", str(finished.path), "--show", "flux", "--out", str(target)]) == 0
    assert f"picture: {target}" in capsys.readouterr().out
    with Image.open(target) as picture:
        upper, lower = np.array_split(np.asarray(picture.convert("RGB"), float), 2)
    fines = [np.mean(part @ [1.0, 0.0, -1.0] > 150.0) for part in (upper, lower)]
    assert fines[0] < 1e-4 < 1e-3 < fines[1], "the clean sand holds no orange fine"
