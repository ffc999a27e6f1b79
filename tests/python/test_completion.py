# SPDX-License-Identifier: Apache-2.0
"""Tests command-line completion in real shells, and a first run without arguments."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from parts import needs, only_where

from wavecomb.cli import main
from wavecomb.cli.group import NAMES

BASH = """
source {script}
complete -p wavecomb > /dev/null || exit 9
COMP_WORDS=({words}) COMP_CWORD={at}
_wavecomb_completion wavecomb
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the command `wavecomb`, for PATH."""
    folder = tmp_path_factory.mktemp("bin")
    file = folder / "wavecomb"
    file.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m wavecomb "$@"\n')
    file.chmod(0o755)
    return folder


def script(shell: str, folder: Path) -> Path:
    result = CliRunner().invoke(main, ["completion", shell])
    assert result.exit_code == 0, result.output
    path = folder / f"completion.{shell}"
    path.write_text(result.stdout)
    return path


def bash(command: Path, folder: Path, *words: str) -> list[str]:
    """Returns the completions that bash offers for the last word."""
    typed = " ".join(f"'{word}'" for word in ("wavecomb", *words))
    text = BASH.format(script=script("bash", folder), words=typed, at=len(words))
    path = f"{command}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "--norc", "-c", text], env=os.environ | {"PATH": path}, cwd=folder,
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.split()


@pytest.mark.slow
@needs("bin:bash")
def test_bash_completes_commands_options_and_values(command: Path, tmp_path: Path) -> None:
    assert bash(command, tmp_path, "re") == ["render"]
    assert set(bash(command, tmp_path, "")) == set(NAMES)
    assert "--tone-map" in bash(command, tmp_path, "render", "--to")
    assert bash(command, tmp_path, "render", "--tone-map", "n") == ["neutral"]


@pytest.mark.slow
@needs("bin:bash", "wavecomb._core")
def test_bash_knows_the_tables(command: Path, tmp_path: Path) -> None:
    """Bash completes settings of the core, AOVs, scenes and commands of a group."""
    assert "--wave-size" in bash(command, tmp_path, "render", "--wave")
    assert bash(command, tmp_path, "render", "--policy", "texture-") == ["texture-locality"]
    assert bash(command, tmp_path, "render", "--aov", "crypto_o") == ["crypto_object"]
    assert "cornell" in bash(command, tmp_path, "scene", "cor")
    assert "submit" in bash(command, tmp_path, "farm", "sub")


@only_where(shutil.which("zsh"), "no zsh")
def test_zsh_takes_the_script(tmp_path: Path) -> None:
    text = f"autoload -U compinit; compinit -D -u; source {script('zsh', tmp_path)}"
    done = subprocess.run(
        ["zsh", "-f", "-c", f"{text}; print -r -- ${{_comps[wavecomb]}}"],
        env=os.environ | {"HOME": str(tmp_path)}, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.stdout.strip(), done.stderr) == ("_wavecomb_completion", "")


@only_where(shutil.which("fish"), "no fish")
def test_fish_completes(command: Path, tmp_path: Path) -> None:
    path = f"{command}{os.pathsep}{os.environ['PATH']}"
    text = f"source {script('fish', tmp_path)}; complete -C 'wavecomb render --tone-map n'"
    done = subprocess.run(
        ["fish", "--no-config", "-c", text],
        env=os.environ | {"PATH": path, "HOME": str(tmp_path)}, capture_output=True, text=True,
        timeout=60,
    )  # fmt: skip
    assert done.stdout.split() == ["neutral"], done.stderr


def test_a_shell_that_is_not_known() -> None:
    result = CliRunner().invoke(main, ["completion", "tcsh"])
    assert result.exit_code == 2 and "'tcsh' is not one of" in result.stderr


def test_without_arguments_it_says_what_to_do() -> None:
    result = CliRunner().invoke(main, [])
    assert result.exit_code == 2 and result.stdout == ""
    lines = result.stderr.splitlines()
    assert lines[0].startswith("Wavecomb ") and len(lines) <= 9
    for words in ("wavecomb render ", "wavecomb scene ", "wavecomb doctor", "wavecomb --help"):
        assert words in result.stderr
    assert "error" not in result.stderr


@pytest.mark.parametrize("group", ["farm", "bench"])
def test_a_group_without_arguments_shows_its_commands(group: str) -> None:
    result = CliRunner().invoke(main, [group])
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) > 5 and "Commands:" in result.stderr
