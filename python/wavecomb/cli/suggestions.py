# SPDX-License-Identifier: Apache-2.0
"""Suggestions for options that do not exist, by likeness and by other renderers' names."""

from __future__ import annotations

from difflib import get_close_matches

import click

SYNONYMS = {
    "--samples": "--spp",
    "--sample-count": "--spp",
    "--samples-per-pixel": "--spp",
    "--pixel-samples": "--spp",
    "--resolution": "--size",
    "--res": "--size",
    "--width": "--size",
    "--height": "--size",
    "--out": "--output",
    "--outfile": "--output",
    "--destination": "--output",
    "--image": "--output",
    "--bounces": "--max-depth",
    "--max-bounces": "--max-depth",
    "--depth": "--max-depth",
    "--ray-depth": "--max-depth",
    "--crop-window": "--region",
    "--layers": "--aov",
    "--aovs": "--aov",
    "--passes": "--aov",
    "--frame-range": "--frames",
    "--range": "--frames",
    "--start-frame": "--frames",
    "--time": "--frame",
    "--timeout": "--time-limit",
    "--max-time": "--time-limit",
    "--denoiser": "--denoise",
    "--jobs": "--threads",
    "--cores": "--threads",
    "--cam": "--camera",
    "--variance": "--noise",
    "--noise-threshold": "--noise",
    "--error-threshold": "--noise",
    "--snapshot": "--checkpoint",
    "--continue": "--resume",
    "--statistics": "--stats",
    "--silent": "--quiet",
}
"""Names that other renderers and tools use, and the option of the same meaning."""


def message_of(error: click.ClickException) -> str:
    """The message of an error of the command line, with suggestions for a misspelt option."""
    if not isinstance(error, click.NoSuchOption) or error.ctx is None:
        return error.format_message()
    wanted = suggestions(error.option_name, options_of(error.ctx))
    if not wanted:
        return error.message
    return f"{error.message.rstrip('.')}; did you mean {' or '.join(wanted)}?"


def options_of(context: click.Context) -> list[str]:
    """All options of a command."""
    shown = [one for one in context.command.get_params(context) if not getattr(one, "hidden", 0)]
    return [name for one in shown for name in (*one.opts, *one.secondary_opts)]


def suggestions(name: str, options: list[str]) -> list[str]:
    """Options that a misspelt one may stand for, the likeliest first; three at most.

    >>> suggestions("--smaples", ["--spp", "--size", "--shutter"])
    ['--spp']
    >>> suggestions("--ouput", ["-o", "--output"])
    ['--output']
    """
    words = {option: option for option in options if option.startswith("--")}
    words |= {word: one for word, one in SYNONYMS.items() if one in words and word not in words}
    if name in words:
        return [words[name]]
    found = get_close_matches(name, words, n=6, cutoff=0.6)
    return list(dict.fromkeys(words[word] for word in found))[:3]
