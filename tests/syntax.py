# SPDX-License-Identifier: Apache-2.0
"""Syntax checks of edited copies of the C++ sources."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

from parts import not_here

ROOT = Path(__file__).resolve().parents[1]


def command(check_only: bool = True) -> list[str]:
    """Returns the library's compiler command, without the folder of headers.

    Args:
        check_only: Whether the command only checks the syntax of its files.
    """
    commands = ROOT / "build" / "editable" / "compile_commands.json"
    if not commands.exists():
        not_here("the library was not built by make build")
    entries = json.loads(commands.read_text("utf-8"))
    entry = next(one for one in entries if "wavecomb_core.dir" in one["command"])
    words = shlex.split(entry["command"])
    kept = [words[0]]
    for at, word in enumerate(words):
        if word in ("-isystem", "-D"):
            kept += [word, words[at + 1]]
        elif re.match(r"-(std|march|D|W(all|extra|error|shadow))", word):
            kept.append(word)
    return [*kept, "-Wno-psabi", "-fsyntax-only" if check_only else "-O1"]
