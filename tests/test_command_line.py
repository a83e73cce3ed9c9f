"""The command line as a whole: its help, what it suggests, and what completes it."""

import re
import shutil
import subprocess
import sys

import pytest

from fdnet.cli import FORMER, _parser, commands_of, main

LISTED = (
    *("init", "run", "check", "permeability", "stokes"),
    *("movie", "mechanics", "ensemble", "sweep", "compare", "core", "well"),
)


def ended(arguments: list[str]) -> int:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    return int(end.value.code or 0)


def test_fdnet_alone_lists_twelve_commands(capsys):
    assert main([]) == 0
    alone = capsys.readouterr().out
    assert ended(["--help"]) == 0
    assert capsys.readouterr().out == alone
    assert tuple(re.findall(r"^    (\w+)(?: |$)", alone, re.M)) == LISTED
    assert set(commands_of(_parser())) == {*LISTED, "render"}


def test_every_command_has_a_sentence_an_example_and_options_in_groups(capsys):
    for name, parser in commands_of(_parser()).items():
        assert ended([name, "--help"]) == 0
        text = capsys.readouterr().out
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
        *(([name], f"{name} is gone; use {now}") for name, now in FORMER.items()),
    ],
)
def test_a_slip_is_one_line_that_names_what_was_meant(arguments, said, capsys):
    assert ended(arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


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
    case = str(root / "cases" / "quick.toml")
    assert main(["run", case, "--dry-run"]) == 0
    dry = capsys.readouterr().out
    assert not list(tmp_path.iterdir())
    assert main(["render", case, "--out", "decks"]) == 0
    assert capsys.readouterr().out.startswith(dry)
    assert main(["run", case, "--dry-run", "--set", "run.max_hours=1e-6"]) == 2
    assert "fdnet run refuses this case" in capsys.readouterr().err


def test_strict_ends_with_2_where_anything_is_odd(root, capsys):
    case = str(root / "cases" / "quick" / "specimen5.toml")
    assert main(["check", case]) == 0
    said = capsys.readouterr()
    assert main(["check", case, "--strict"]) == 2
    strict = capsys.readouterr()
    assert strict.out == said.out
    assert "--strict:" in strict.err
    assert not said.err
    assert main(["check", str(root / "cases" / "quick.toml"), "--strict"]) == 0
