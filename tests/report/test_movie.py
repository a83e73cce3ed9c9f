"""Movies: the states in order with their times, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fdnet.errors import CaseError
from fdnet.report import movie
from fdnet.report.movie import LAST_FRAMES, MovieFrame, Scene, write_movie
from fdnet.run.movie import movie_of

BOX = np.array([[0.0, 4e-3], [0.0, 2e-3], [0.0, 2e-3]])
GREYS = (40, 120, 200)


def drawn(module, arguments, *, seconds):
    """Stands for the drawing process: one grey picture for each frame."""
    _, box, *flow, folder = arguments[: 3 if module == "movie_frames" else 5]
    frames = arguments[3:] if module == "movie_frames" else arguments[5::2]
    assert flow == ([] if module == "movie_frames" else ["--title=flux", "--limits=0.1,10.0"])
    assert box == "--box=0.0,0.004,0.0,0.002,0.0,0.002"
    for number, grey in enumerate(GREYS[: len(frames)]):
        Image.new("RGB", (1500, 950), (grey,) * 3).save(Path(folder, f"{number:04d}.png"))
    return ""


def frames_of(folder):
    return [MovieFrame(spheres=folder / f"{n}.vtp", words=f"{n} ms") for n in range(len(GREYS))]


def scene_of(folder, **flow):
    return Scene(grains=folder / "g.vtp", box=BOX, **flow)


def test_a_gif_shows_the_states_in_order_and_stays_on_the_last(tmp_path, monkeypatch):
    monkeypatch.setattr(movie, "draw_frames", drawn)
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
    monkeypatch.setattr(movie, "draw_frames", drawn)
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
    monkeypatch.setattr(movie, "draw_frames", lambda *_, **__: reason)
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
