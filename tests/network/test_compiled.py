"""Compiled code is kept apart for every state of the sources."""

import tempfile

import numba

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
