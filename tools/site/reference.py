# SPDX-License-Identifier: Apache-2.0
"""Generate reference pages from the program's tables and docstrings."""

from __future__ import annotations

import dataclasses
import inspect
import re
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import click
from python_page import python_page

from wavecomb.cli import main
from wavecomb.cli.command import OTHERS, grouped
from wavecomb.core_table import camera_parameters, light_parameters, material_parameters
from wavecomb.load_options import LoadOptions, rows
from wavecomb.options import default_text, settings
from wavecomb.run import aovs

ROOT = Path(__file__).resolve().parents[2]
NOTE = "`make docs` generates this page from the program's tables.\n"
ABOUT = {
    "picture": "Image",
    "work": "Amount of work",
    "order": "Order of work, which changes no bit of the image",
}


def pages() -> dict[str, str]:
    """Return the Markdown text of each generated page, by file name."""
    return {
        "options.md": options_page(),
        "settings.md": settings_page(),
        "loading.md": loading_page(),
        "layers.md": layers_page(),
        "lights.md": lights_page(),
        "materials.md": materials_page(),
        "cameras.md": cameras_page(),
        "python.md": python_page(),
        "cpp.md": cpp_page(),
    }


def cell(text: object) -> str:
    """Escape text for a table cell, so that the text neither ends the cell nor acts as markup."""
    plain = " ".join(str(text).split()).replace("|", "\\|")
    return plain.replace("<", "&lt;").replace("{", "&#123;").replace("*", "\\*")


def code(text: object) -> str:
    """Format a name as code for a table cell."""
    plain = " ".join(str(text).split()).replace("|", "\\|")
    return f"`{plain}`" if plain else ""


def table(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    """Format a Markdown table."""
    lines = [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}"]
    lines += [f"| {' | '.join(row)} |" for row in body]
    return "\n".join(lines) + "\n"


def bounds(least: float | None, most: float | None) -> str:
    """Format the range of a number; None means that there is no bound."""
    ends = [f"{end:.10g}" if end is not None and abs(end) < 1e30 else "" for end in (least, most)]
    if ends[0] and ends[1]:
        return f"{ends[0]} to {ends[1]}"
    return f"from {ends[0]}" if ends[0] else f"to {ends[1]}" if ends[1] else ""


def options_page() -> str:
    """Make the page of all commands and their options."""
    parts = ["# Options of all commands\n", NOTE]
    root = click.Context(main, info_name="wavecomb")
    for path, command, context in walk(main, root):
        parts.append(f"## wavecomb {path}\n")
        text = inspect.cleandoc(command.help or "").replace("\b\n", "").partition("\f")[0]
        parts.append(f"{cell(text.partition(chr(10) + chr(10))[0])}\n")
        for title, options in groups_of(command, context):
            records = [one.get_help_record(context) for one in options]
            body = [option_row(*record) for record in records if record and record[1]]
            if body:
                parts += [f"**{title}**\n"] if title else []
                parts.append(table(("option", "value", "effect", "default"), body))
    return "\n".join(parts)


def groups_of(command: Any, context: click.Context) -> list[tuple[str, list[Any]]]:
    """Return arguments and options of a command in the groups of its help, with their titles."""
    params = [one for one in command.get_params(context) if "--help" not in one.opts]
    options = [one for one in params if isinstance(one, click.Option)]
    groups: list[tuple[str, list[Any]]] = list(grouped(options, full=True))
    if [title for title, _ in groups] == [OTHERS]:
        groups = [("", groups[0][1])]
    listed = {one.name for _, some in groups for one in some}
    groups.insert(0, ("", [one for one in params if one.name not in listed]))
    return groups


def option_row(usage: str, text: str) -> tuple[str, str, str, str]:
    """Return the cells of an option from its help: names, value, effect, default.

    >>> option_row("-o, --output FILE", "Image.  [default: out.exr]")
    ('`-o, --output`', '`FILE`', 'Image.', 'out.exr')
    """
    names, value = re.fullmatch(r"((?:-\S+(?:,| /)? ?)*)(.*)", usage, re.DOTALL).groups()  # type: ignore[union-attr]
    if not names:  # the row describes a positional argument of the command
        names, value = value, ""
    choices = re.fullmatch(r"\[(.*\|.*)\]", value)
    shown = ", ".join(map(code, choices[1].split("|"))) if choices else code(value)
    in_brackets = re.compile(r"\s*\[((?:default: |required|\S*x[<>]=?|\S*<=?x)[^\[\]]*)\]")
    default = ""
    notes = "; ".join(in_brackets.findall(text))
    for note in filter(None, notes.split("; ")):
        ends = re.fullmatch(r"(?:(\S+?)<=?)?x(?:[<>]=?(\S+))?", note)
        if ends and not ends[1]:
            shown += f", from {ends[2]}" if ">" in note else f", to {ends[2]}"
        elif ends:
            shown += f", {ends[1]} to {ends[2]}"
        else:
            default = note.removeprefix("default: ")
    effect = in_brackets.sub("", text)
    return code(names), shown, cell(effect), cell(default)


def walk(group: Any, context: click.Context, before: str = "") -> Iterable[tuple[str, Any, Any]]:
    """Yield the commands of a group and its subgroups, with their paths."""
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if command is None or command.hidden:
            continue
        path = f"{before}{name}"
        inside = click.Context(command, info_name=name, parent=context)
        yield path, command, inside
        if isinstance(command, click.Group):
            yield from walk(command, inside, f"{path} ")


def settings_page() -> str:
    """Make the page of render settings."""
    parts = ["# Settings of a render\n", NOTE,
             "Keywords of `wavecomb.render`, fields of `wavecomb.Settings`, keys of a suite. As "
             "options of commands they have `-` for `_`. *Expectation*: whether the setting "
             "changes the image that more and more samples converge to; `wavecomb merge` refuses "
             "images in which such settings differ.\n"]  # fmt: skip
    for group, title in ABOUT.items():
        parts.append(f"## {title}\n")
        body = []
        for name, row in settings().items():
            if row.group != group:
                continue
            choices = "<br>".join(f"`{key}`: {cell(text)}" for key, text in row.choices.items())
            values = choices or bounds(row.least, row.most) or row.kind
            zero = f" 0: {row.zero}." if row.zero else ""
            changes = "yes" if row.changes_expectation else ""
            help_text = cell(row.help + zero)
            body.append((code(name), help_text, code(default_text(row)), values, changes))
        parts.append(table(("setting", "", "default", "values", "expectation"), body))
    return "\n".join(parts)


def loading_page() -> str:
    """Make the page of options for loading a stage."""
    item = re.compile(r"^    (\w+): (.+?)(?=^    \w+:|\Z)", re.DOTALL | re.MULTILINE)
    about = dict(item.findall(attributes(LoadOptions)))
    body = []
    with_option = rows()
    for field in dataclasses.fields(LoadOptions):
        row = with_option.get(field.name)
        option = row.option if row is not None else ""
        body.append((code(field.name), code(option), cell(about.get(field.name, ""))))
    head = "Keywords of `wavecomb.load`, `wavecomb.render` and `wavecomb.render_frames`.\n"
    return "\n".join(
        ["# Options of loading a stage\n", NOTE, head, table(("keyword", "option", ""), body)]
    )


def attributes(owner: Any) -> str:
    """Return the section "Attributes" of a class's docstring."""
    return inspect.getdoc(owner).partition("Attributes:\n")[2] + "\n"  # type: ignore[union-attr]


def layers_page() -> str:
    """Make the page of AOVs."""
    body = [(code(row.name), str(row.channels or ""), cell(row.kind.replace("_", " ")),
             cell(row.title)) for row in aovs.core_aovs().values()]  # fmt: skip
    several = [(code(name), ", ".join(map(code, names))) for name, names in aovs.groups().items()]
    return "\n".join([
        "# Layers\n", NOTE,
        "Names for `--aov` and `aovs=[...]`; [AOVs](../aovs.md) says what they hold. `beauty`, "
        "`samples`, `error` and `variance` are layers, too.\n",
        table(("AOV", "channels", "samples become a pixel by", "in the window"), body),
        "Names that stand for several:\n", table(("name", "AOVs"), several),
    ])  # fmt: skip


def lights_page() -> str:
    """Make the page of light parameters."""
    body = []
    for row in light_parameters().values():
        values = ", ".join(map(code, row.choices)) or bounds(row.least, row.most) or row.kind
        usd = code(f"inputs:{row.input}" if row.input else "")
        body.append((code(row.name), cell(row.help), usd, values, ", ".join(row.kinds)))
    head = ("parameter", "", "UsdLux", "values", "lights")
    return "\n".join(["# Parameters of lights\n", NOTE, table(head, body)])


def materials_page() -> str:
    """Make the page of material parameters."""
    body = [(code(row.name), row.kind, code(row.default), bounds(row.least, row.most),
             code(row.program)) for row in material_parameters().values()]  # fmt: skip
    head = ("parameter", "kind", "default", "values", "of the program alone")
    return "\n".join(["# Parameters of materials\n", NOTE,
                      "Keywords of `SceneBuilder.add_material`.\n", table(head, body)])  # fmt: skip


def cameras_page() -> str:
    """Make the page of camera parameters."""
    body = []
    for row in camera_parameters().values():
        values = ", ".join(map(code, row.choices)) or bounds(row.least, None) or row.kind
        default = "" if row.default is None else code(row.default)
        body.append((code(row.name), cell(row.help), default, values))
    return "\n".join(["# Parameters of cameras\n", NOTE, "Keywords of `SceneBuilder.set_camera`.\n",
                      table(("parameter", "", "default", "values"), body)])  # fmt: skip


def public_headers() -> list[Path]:
    """Return the public headers, for programs that link with the core."""
    text = (ROOT / "tools" / "words" / "public_headers.txt").read_text(encoding="utf-8")
    return [ROOT / "src" / "wavecomb" / line for line in text.splitlines()
            if line and not line.startswith("#")]  # fmt: skip


def first_sentence(source: str) -> str:
    """Return the first sentence of the first comment of a C++ file, without the license."""
    comment = re.search(r"(?:^///? (?!SPDX).+\n)+", source, re.MULTILINE)
    text = " ".join(re.findall(r"^///? (.+)", comment[0], re.MULTILINE)) if comment else ""
    return re.split(r"(?<=\.) ", text)[0]


def cpp_page() -> str:
    """Make the page on using the core from C++: example, headers, and link to Doxygen's pages."""
    body = []
    for path in public_headers():
        name = path.relative_to(ROOT / "src").as_posix()
        body.append((code(name), cell(first_sentence(path.read_text(encoding="utf-8")))))
    example = (ROOT / "examples" / "cpp" / "render_sphere.cpp").read_text(encoding="utf-8")
    pages = (
        'Classes and functions are on <a href="../cpp/annotated.html">the pages of Doxygen</a>.\n'
        if shutil.which("doxygen")
        else "Build the site with Doxygen installed (`apt install doxygen`) for classes and "
        "functions.\n"
    )
    return "\n".join([
        "# C++\n", "Install the core and its headers from a build, and link with it:\n",
        "```sh\n.venv/bin/cmake --install build/editable --component dev --prefix PREFIX\n```\n",
        "```cmake\nfind_package(wavecomb REQUIRED)\n"
        "target_link_libraries(mine PRIVATE wavecomb::core)\n```\n",
        pages, table(("header", "content"), body),
        "## Example\n", f"```cpp\n{example}```\n",
    ])  # fmt: skip
