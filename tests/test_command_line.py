"""The command line as a whole: its help, what it suggests, and what completes it."""

import re
import shutil
import subprocess
import sys

import pytest
from builders import answer

from fdnet.cli import _parser, commands_of

LISTED = "init run check permeability stokes movie mechanics ensemble sweep compare core well"


def test_fdnet_alone_lists_twelve_commands(capsys):
    _, alone, _ = answer(capsys)
    assert answer(capsys, "--help") == (0, alone, "")
    assert re.findall(r"^    (\w+)(?: |$)", alone, re.M) == LISTED.split()
    assert set(commands_of(_parser())) == {*LISTED.split(), "render"}


def test_every_command_has_a_sentence_an_example_and_options_in_groups(capsys):
    for name, parser in commands_of(_parser()).items():
        code, text, _ = answer(capsys, name, "--help")
        assert code == 0
        assert re.search(r"^[A-Z].*\.$", text, re.M), name
        assert f"\n  fdnet {name} " in text.partition("example")[2], name
        own = text.partition("\noptions:\n")[2].partition("\n\n")[0]
        assert re.findall(r"^  (-\S+)", own, re.M) == ["-h,", "--debug"], name
        options = [flag for one in parser._actions for flag in one.option_strings]
        assert not [flag for flag in options if "_" in flag], name


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["runn"], "did you mean run?"),
        (["mine.toml"], "did you mean run mine.toml?"),
        (["run", "mine.toml", "--jsno"], "did you mean --json?"),
        (["mechanics", "mine.toml", "--confining_MPa=5"], "did you mean --confining-MPa?"),
        (["run"], "required: CASE.toml"),
    ],
)
def test_a_slip_is_one_line_that_names_what_was_meant(arguments, said, capsys):
    code, _, error = answer(capsys, *arguments)
    assert (code, error.count("\n"), said in error) == (2, 1, True), error


def test_a_shell_completes_commands_options_and_choices():
    script = subprocess.run(
        [sys.executable, "-m", "fdnet", "--completion"], capture_output=True, text=True, check=True
    ).stdout
    ask = 'COMP_WORDS=(fdnet "$@"); COMP_CWORD=$#; _fdnet; echo "${COMPREPLY[@]}"'
    for words, offered in [
        (["sw"], "sweep"),
        (["run", "--js"], "--json"),
        (["permeability", "--axis", ""], "x y z all"),
        (["init", "--from", "wel"], "well"),
        (["run", ""], ""),
    ]:
        command = ["bash", "-c", f"{script}\n{ask}", "bash", *words]
        said = subprocess.run(command, capture_output=True, text=True, check=True)
        assert (said.stdout.strip(), said.stderr) == (offered, ""), words
    if shutil.which("zsh"):  # without a start-up file, which would load what completes
        command = ["zsh", "-fc", f"{script}\nprint -r -- $_comps[fdnet]"]
        said = subprocess.run(command, capture_output=True, text=True, check=True)
        assert (said.stdout.strip(), said.stderr) == ("_bash_complete -o default -F _fdnet", "")


def test_a_dry_run_prints_the_scales_and_writes_nothing(tmp_path, root, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    case = root / "cases" / "quick.toml"
    code, dry, _ = answer(capsys, "run", case, "--dry-run")
    assert (code, list(tmp_path.iterdir())) == (0, [])
    code, rendered, _ = answer(capsys, "render", case, "--out", "decks")
    assert (code, rendered.startswith(dry)) == (0, True)
    code, _, error = answer(capsys, "run", case, "--dry-run", "--set", "run.max_hours=1e-6")
    assert (code, "fdnet run refuses this case" in error) == (2, True)


def test_strict_ends_with_2_where_anything_is_odd(root, capsys):
    case = root / "cases" / "quick" / "specimen5.toml"
    code, said, error = answer(capsys, "check", case)
    assert (code, error) == (0, "")
    code, strict, error = answer(capsys, "check", case, "--strict")
    assert (code, strict, "--strict:" in error) == (2, said, True)
    code, said, _ = answer(capsys, "check", root / "cases" / "quick.toml", "--strict", "--fast")
    assert (code, "for the flow" in said) == (0, False)  # the fast model needs no such updates
