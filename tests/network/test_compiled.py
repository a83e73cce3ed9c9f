"""Compiled code is kept apart for every state of the sources."""

import ast
import os
import shutil
import subprocess
import sys
import tempfile

import numba
import numpy as np
import pytest

from fdnet.network import compiled as module
from fdnet.network.compiled import _own_folder, cache_folder


def test_a_changed_source_has_a_cache_of_its_own(tmp_path):
    (tmp_path / "one.py").write_text("a = 1\n")
    (tmp_path / "two.py").write_text("b = 1\n")
    before = cache_folder(tmp_path, tmp_path / "cache")
    assert cache_folder(tmp_path, tmp_path / "cache") == before
    (tmp_path / "two.py").write_text("b = 2\n")
    assert cache_folder(tmp_path, tmp_path / "cache") != before


def test_compiled_code_lies_there():
    assert "numba-" in str(numba.config.CACHE_DIR)


def test_a_folder_that_others_may_have_filled_is_not_used(tmp_path, monkeypatch):
    """In a place all can write to, code of somebody else must not be run."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    own = _own_folder(tmp_path / "own")
    assert own == tmp_path / "own"
    assert _own_folder(own) == own
    assert own.stat().st_mode & 0o077 == 0
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    (tmp_path / "link").symlink_to(own)
    for name in ("open", "link"):
        assert _own_folder(tmp_path / name) not in (tmp_path / name, own)


def test_an_installation_in_another_place_uses_the_same_code(tmp_path, root):
    """Else every environment with the same sources would compile for a minute."""
    ask = (
        "from fdnet.network.fines.crowding import weighted_volume as one\n"
        "import fdnet\n"
        "print(fdnet.__file__, one(1.0, 0.5, 2.0), sum(one.stats.cache_hits.values()))"
    )
    shutil.copytree(root / "fdnet", tmp_path / "fdnet", ignore=shutil.ignore_patterns("data"))
    for path in (tmp_path / "fdnet/network").rglob("*.py"):
        os.utime(path, (1e9, 1e9))  # numba before 0.68 asks for the age of the source
    answers = []
    for place in (root, tmp_path):
        said = call([sys.executable, "-P", "-c", ask], tmp_path, PYTHONPATH=str(place))
        answers.append(said.stdout.split() or said.stderr)
    (first, value, compiled), (second, same, read) = answers
    assert (first, second) == (
        str(root / "fdnet/__init__.py"),
        str(tmp_path / "fdnet/__init__.py"),
    )
    assert (value, compiled, read) == (same, "0", "1")


SOURCE = """
import sys
from fdnet.network.fines import deposit
from fdnet.network.compiled import compiled

@compiled
def twice(x):
    return 2 * x

print(twice(int(sys.argv[1])), twice.stats.cache_hits and 1 or 0)
"""


@pytest.fixture
def cached(tmp_path):
    """A program with one compiled function, run once: command and folder of its cache."""
    (tmp_path / "program.py").write_text(SOURCE)
    first = call_program(tmp_path)
    assert (first.stdout.split(), first.stderr) == (["42", "0"], "")
    second = call_program(tmp_path)
    assert second.stdout.split() == ["42", "1"]
    return tmp_path


def call_program(folder):
    return call([sys.executable, str(folder / "program.py"), "21"], folder)


def call(command, folder, **settings):
    environment = os.environ | {"XDG_CACHE_HOME": str(folder / "cache")} | settings
    environment.pop("NUMBA_CACHE_DIR", None)
    return subprocess.run(
        command, env=environment, cwd=folder, capture_output=True, text=True, timeout=120
    )


def flipped(content: bytes) -> bytes:
    middle = len(content) * 2 // 3
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


SPOILT = {
    "empty": lambda content: b"",
    "cut": lambda content: content[: len(content) // 2],
    "zeros": lambda content: bytes(len(content)),
    "one bit": flipped,
}


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
@pytest.mark.parametrize("how", SPOILT)
def test_a_bad_cache_is_left_aside_and_made_anew(cached, kind, how):
    files = list(cached.rglob(f"program.twice*.{kind}"))
    assert len(files) == 1
    files[0].write_bytes(SPOILT[how](files[0].read_bytes()))
    again = call_program(cached)
    assert again.stdout.split() == ["42", "0"], again.stderr
    assert again.stderr.count("\n") == 1
    assert str(files[0].parent) in again.stderr
    mended = call_program(cached)
    assert (mended.stdout.split(), mended.stderr) == (["42", "1"], "")


def test_a_cache_that_cannot_be_written_is_done_without(cached):
    """A folder in the place of the index stands for a full disk: writing fails."""
    for path in cached.rglob("program.twice*.nbi"):
        path.unlink()
        path.mkdir()
        (path / "x").write_text("")
        path.with_name(path.name + ".bad").write_text("")
    again = call_program(cached)
    assert again.stdout.split() == ["42", "0"], again.stderr
    assert 1 <= again.stderr.count("\n") <= 2
    assert "Traceback" not in again.stderr


def test_a_full_disk_under_the_cache_is_reported_once(tmp_path, monkeypatch, capsys):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module.IndexDataCacheFile, "_open_for_write", full)
    module._said.clear()
    file = module._CheckedFile(str(tmp_path), "name", "stamp")
    for key in ("a", "b"):
        file.save(key, 1)
        assert file.load(key) is None
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    assert str(tmp_path) in text
    assert "No space left" in text


def test_code_of_another_signature_is_not_run(tmp_path, capsys):
    """Two processes that save at the same moment may take one name for their codes."""
    module._said.clear()
    file = module._CheckedFile(str(tmp_path), "name", "stamp")
    for key in ("a", "b"):
        file.save(key, f"code of {key}")
    assert file.load("a") == "code of a"
    file._save_index({"a": file._data_name(2), "b": file._data_name(2)})
    assert file.load("a") is None
    assert "another signature" in capsys.readouterr().err


@pytest.mark.parametrize("setting", ["OPT", "USING_SVML"])
def test_code_by_other_settings_of_numba_lies_apart(tmp_path, monkeypatch, setting):
    before = cache_folder(tmp_path, tmp_path)
    monkeypatch.setattr(numba.config, setting, "other")
    assert cache_folder(tmp_path, tmp_path) != before


@module.loops_in_place
def _first_of_new(numbers):
    return np.zeros(len(numbers))[0]


def test_a_function_in_place_may_not_make_an_array():
    """Nobody would count who holds it, so it would never be given back."""
    with pytest.raises(numba.core.errors.NumbaError, match="array"):
        _first_of_new(np.ones(3))


@module.compiled
def _product_less(one, two, three):
    return one * two - three


@module.loops_in_place
def _asked_by_loops(one, two, three):
    return _product_less(one, two, three)


def test_a_function_is_compiled_the_same_whoever_calls_it_first():
    """Else it would keep the rounding of that caller, here and in later processes."""
    one = 1.0 + 2.0**-30
    rounded = one * one
    assert _asked_by_loops(one, one, rounded) == 0.0
    assert _product_less(one, one, rounded) == 0.0


@module.compiled_for_loops
def _product_less_in_loops(one, two, three):
    return one * two - three


def test_no_function_rounds_other_than_written():
    """A fused product and sum would not be 0, and which copy is fused depends on the process."""
    one = 1.0 + 2.0**-30
    assert _product_less_in_loops(one, one, one * one) == 0.0


def test_no_function_in_place_returns_an_array(root):
    """A caller that counts references would give it back too early."""
    for path in (root / "fdnet/network").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                marks = {getattr(mark, "id", "") for mark in node.decorator_list}
                if marks & {"compiled_in_place", "loops_in_place"}:
                    assert "Array" not in ast.unparse(node.returns), f"{path.name}: {node.name}"


def test_a_run_compiles_next_to_liggghts(tmp_path):
    """In an empty cache it says so and leaves code behind; then there is nothing to do."""
    code = (
        "import sys, time\n"
        "from pathlib import Path\n"
        "from fdnet.network.warm_up import compiling\n"
        "with compiling('yz', wanted=True):\n"
        "    for _ in range(600):\n"
        "        if any(Path(sys.argv[1]).rglob('*.nbi')):\n"
        "            break\n"
        "        time.sleep(0.1)\n"
    )
    inherited = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    cache = {**inherited, "XDG_CACHE_HOME": str(tmp_path)}
    for said in (True, False):
        done = subprocess.run(
            [sys.executable, "-c", code, str(tmp_path)],
            capture_output=True,
            text=True,
            check=True,
            env=cache,
        )
        assert ("compiling, once for this version" in done.stderr) == said
        assert list(tmp_path.rglob("*.nbi"))
