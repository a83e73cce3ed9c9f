"""Movies: the states in order with their times, and what is refused."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fdnet.errors import CaseError
from fdnet.report import picture as pictures
from fdnet.report.picture import LAST_FRAMES, MovieFrame, Scene, write_movie
from fdnet.run import movie
from fdnet.run.movie import movie_of

BOX = np.array([[0.0, 4e-3], [0.0, 2e-3], [0.0, 2e-3]])
GREYS = (40, 120, 200)


def drawn(scene, frames, targets, *, seconds):
    """Stands for the drawing process: one grey picture for each frame."""
    assert (scene.title, scene.limits) in [("", (0.0, 0.0)), ("flux", (0.1, 10.0))]
    assert all(bool(frame.lines) == bool(scene.title) for frame in frames)
    for target, grey in zip(targets, GREYS, strict=False):
        Image.new("RGB", (1500, 950), (grey,) * 3).save(target)


def frames_of(folder):
    return [MovieFrame(spheres=folder / f"{n}.vtp", words=f"{n} ms") for n in range(len(GREYS))]


def scene_of(folder, **flow):
    return Scene(grains=folder / "g.vtp", box=BOX, **flow)


def test_a_gif_shows_the_states_in_order_and_stays_on_the_last(tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "draw_frames", drawn)
    path = write_movie(tmp_path / "m.gif", frames_of(tmp_path), scene_of(tmp_path), per_second=4.0)
    seen, total = [], 0
    with Image.open(path) as picture:
        for number in range(picture.n_frames):
            picture.seek(number)
            total += picture.info["duration"]
            seen.append(picture.convert("L").getpixel((700, 400)))
    assert total == 250 * (len(GREYS) + LAST_FRAMES)
    assert list(dict.fromkeys(seen)) == pytest.approx(GREYS, abs=3)


def test_a_png_has_the_states_below_each_other_with_the_flow_of_each(tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "draw_frames", drawn)
    frames = [
        MovieFrame(spheres=tmp_path / f"{n}.vtp", words=f"{n}", lines=tmp_path / f"flow_{n}.vtp")
        for n in range(2)
    ]
    scene = scene_of(tmp_path, title="flux", limits=(0.1, 10.0))
    path = write_movie(tmp_path / "m.png", frames, scene, per_second=4.0)
    with Image.open(path) as picture:
        width, height = picture.size
        seen = [picture.convert("L").getpixel((width // 2, height * n // 4)) for n in (1, 3)]
    assert seen == pytest.approx(GREYS[:2], abs=3)


@pytest.mark.parametrize(
    ("name", "reason", "said"),
    [("m.avi", "", r"expected .gif, .mp4 or .png"), ("m.gif", "no context", "because no context")],
)
def test_what_makes_no_movie_leaves_no_file(tmp_path, monkeypatch, name, reason, said):
    def fail(*_, **__):
        raise OSError(reason)

    monkeypatch.setattr(pictures, "draw_frames", fail)
    with pytest.raises(CaseError, match=said):
        write_movie(tmp_path / name, frames_of(tmp_path), scene_of(tmp_path), per_second=4.0)
    assert not (tmp_path / name).exists()


def test_an_odd_speed_and_a_folder_without_a_run_are_refused(tmp_path):
    with pytest.raises(CaseError, match=r"--fps: 99, expected 0.5 to 30"):
        movie_of(tmp_path, per_second=99)
    with pytest.raises(CaseError, match=r"--show: 'cake' is not known"):
        movie_of(tmp_path, show="cake")
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


def a_frame(folder):
    return sorted((folder / "frames").glob("spheres_*.vtp"))[1]


@pytest.mark.liggghts
@pytest.mark.parametrize("name", ["m.gif", "m.png", None])
def test_a_movie_replaces_no_file_unasked(copied, tmp_path, shown, name):
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
    for other in ("spheres_old.vtp", "spheres_.vtp", "spheres_1.vtp.bak"):
        shutil.copy(whole[0], copied / "frames" / other)
    movie_of(copied, tmp_path / "m.gif")
    assert shown[1:] == names
    shutil.copy(whole[0], copied / "frames" / "spheres_7.vtp")
    with pytest.raises(CaseError, match=r"spheres_7\.vtp: is no state that this run wrote"):
        movie_of(copied, tmp_path / "m.gif")


@pytest.mark.liggghts
@pytest.mark.parametrize("digests", [True, False])
@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: path.write_bytes(path.read_bytes()[:3000]),
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(path.read_bytes()[:-20]),
        lambda path: (path.unlink(), path.mkdir()),
    ],
)
def test_a_cut_state_is_named_and_not_drawn_empty(copied, tmp_path, shown, spoil, digests):
    """Also in a run whose manifest has no digests of its states."""
    path = a_frame(copied)
    spoil(path)
    if not digests:
        file = copied / "manifest.json"
        manifest = json.loads(file.read_text())
        files = {k: v for k, v in manifest["files"].items() if not k.startswith("frames/")}
        file.write_text(json.dumps(manifest | {"files": files}))
    with pytest.raises(CaseError, match=path.name):
        movie_of(copied, tmp_path / "m.gif")
    assert not shown


@pytest.mark.liggghts
@pytest.mark.parametrize("name", ["frames", "spheres_initial.vtp", "history.csv", "profile.csv"])
def test_a_movie_of_a_changed_run_is_refused(copied, tmp_path, shown, name):
    path = a_frame(copied) if name == "frames" else copied / name
    path.write_bytes(path.read_bytes().replace(b"1", b"2", 1))
    with pytest.raises(CaseError, match=rf"{path.name}: is not the file that the run wrote"):
        movie_of(copied, tmp_path / "m.gif")
