"""Compiled code is kept apart for every state of the sources."""

import numba

from fdnet.network.compiled import cache_folder


def test_a_changed_source_has_a_cache_of_its_own(tmp_path):
    (tmp_path / "one.py").write_text("a = 1\n")
    (tmp_path / "two.py").write_text("b = 1\n")
    before = cache_folder(tmp_path, tmp_path / "cache")
    assert cache_folder(tmp_path, tmp_path / "cache") == before
    (tmp_path / "two.py").write_text("b = 2\n")
    assert cache_folder(tmp_path, tmp_path / "cache") != before


def test_compiled_code_lies_there():
    assert "numba-" in str(numba.config.CACHE_DIR)
