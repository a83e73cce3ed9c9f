"""The wheel carries the templates: installed elsewhere it renders a deck."""

import os
import subprocess
import sys


def test_a_wheel_installed_elsewhere_renders_a_deck(root, tmp_path):
    build = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--no-deps",
        "--quiet",
        "--disable-pip-version-check",
        "-w",
        str(tmp_path),
        str(root),
    ]
    built = subprocess.run(build, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    wheel = next(tmp_path.glob("fdnet-*.whl"))
    target = tmp_path / "site"
    subprocess.run(
        [
            sys.executable,
            "-m",
            "pip",
            "install",
            "--no-deps",
            "--quiet",
            "--disable-pip-version-check",
            "--target",
            str(target),
            str(wheel),
        ],
        check=True,
        capture_output=True,
    )
    code = (
        "import fdnet, liggghts_templates, sys; from fdnet.cli import main; "
        "print(fdnet.__file__, liggghts_templates.__file__); sys.exit(main())"
    )
    environment = os.environ | {"PYTHONPATH": str(target)}
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            code,
            "render",
            str(root / "cases" / "quick.toml"),
            "--out",
            str(tmp_path / "decks"),
        ],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env=environment,
    )
    assert done.returncode == 0, done.stderr
    assert all(path.startswith(str(target)) for path in done.stdout.splitlines()[0].split())
    assert "fix drag fines addforce" in (tmp_path / "decks" / "invade" / "in.invade").read_text()
    assert (target / "fdnet" / "report" / "report.html.j2").exists()
    assert (target / "fdnet" / "cases" / "quick" / "specimen1.toml").exists()
