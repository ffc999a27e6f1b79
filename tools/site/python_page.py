# SPDX-License-Identifier: Apache-2.0
"""Generate the page of the public Python names from docstrings and the core's stub."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from pathlib import Path
from typing import Any

import wavecomb
from wavecomb.options import settings

SECTIONS = "Args|Attributes|Returns|Yields|Raises|Contract"
PARTS = re.compile(rf"^(?=(?:{SECTIONS}):$)|\n(?=\S)(?<=\n\n)", re.MULTILINE)
ITEM = re.compile(r"^(\*{0,2}[\w.]+): (.*)", re.MULTILINE)


def python_page() -> str:
    """Make the page: a table of all names, functions first, then each name in this order."""
    stub = core_classes()
    names = sorted(name for name in wavecomb.__all__ if name != "__version__")
    names.sort(key=lambda name: inspect.isclass(getattr(wavecomb, name)))
    parts = ["# Python\n", "The package `wavecomb` has the following public names. "
             "[Python](../python.md) shows how to use them.\n",
             "| name | content |", "| --- | --- |"]  # fmt: skip
    for name in names:
        text = text_of(name, stub)
        first = " ".join(re.split(r"\n\n|(?<=\.)\s", text)[0].split())
        first = first.replace("|", "\\|").replace("``", "`")
        parts.append(f"| [`{name}`](#wavecomb{name.lower()}) | {escaped(first)} |")
    parts.append("")
    for name in names:
        thing = getattr(wavecomb, name)
        parts.append(f"## wavecomb.{name}\n")
        if inspect.isfunction(thing):
            parts.append(f"```python\n{name}{signature(thing)}\n```\n")
        parts.append(docstring(text_of(name, stub)))
        if inspect.ismodule(thing):
            for function in public_functions(thing):
                parts += entry(f"{name}.{function.__name__}", function)
        if not inspect.isclass(thing):
            continue
        if thing.__module__ == "wavecomb._core":
            parts += core_members(stub[name])
            continue
        for method, function in vars(thing).items():
            if not method.startswith("_") and inspect.isfunction(function):
                parts += entry(f"{name}.{method}", function)
    return "\n".join(parts)


def public_functions(module: Any) -> list[Any]:
    """Return the functions of a module that its `__all__` lists, or that it defines."""
    named = getattr(module, "__all__", None)
    return [
        one
        for name, one in inspect.getmembers(module, inspect.isfunction)
        if (name in named if named else one.__module__ == module.__name__ and name[0] != "_")
    ]


def entry(title: str, function: Any) -> list[str]:
    """Return the heading, signature and documentation of a function of a class or module."""
    name = title.rpartition(".")[2]
    shown = f"```python\n{name}{signature(function)}\n```\n"
    return [f"### {title}\n", shown, docstring(inspect.getdoc(function) or "")]


def core_classes() -> dict[str, ast.ClassDef]:
    """Return the classes of the stub of the native core, which has their documentation."""
    stub = Path(wavecomb.__file__).with_name("_core.pyi").read_text(encoding="utf-8")
    return {one.name: one for one in ast.parse(stub).body if isinstance(one, ast.ClassDef)}


def text_of(name: str, stub: dict[str, ast.ClassDef]) -> str:
    """Return the documentation of a public name."""
    thing = getattr(wavecomb, name)
    if inspect.isclass(thing) and thing.__module__ == "wavecomb._core":
        return ast.get_docstring(stub[name]) or ""
    return inspect.getdoc(thing) or ""


def core_members(owner: ast.ClassDef) -> list[str]:
    """Return a table of the properties of a core class, then its methods."""
    properties, methods = [], []
    for one in owner.body:
        if isinstance(one, ast.AnnAssign):
            properties.append((ast.unparse(one.target), ast.unparse(one.annotation), ""))
        if not isinstance(one, ast.FunctionDef) or one.name.startswith("_"):
            continue
        decorators = {ast.unparse(mark) for mark in one.decorator_list}
        text = ast.get_docstring(one) or ""
        if "property" in decorators:
            answer = ast.unparse(one.returns) if one.returns else ""
            properties.append((one.name, answer, " ".join(text.split())))
        elif not any(mark.endswith(".setter") for mark in decorators):
            methods += [f"### {owner.name}.{one.name}\n",
                        f"```python\n{one.name}{stub_signature(one)}\n```\n",
                        docstring(text)]  # fmt: skip
    parts = ["| property | type | content |", "| --- | --- | --- |"] if properties else []
    for name, kind, text in properties:
        if owner.name == "Settings" and name in settings() and not text:
            text = settings()[name].help
        kind, text = kind.replace("|", "\\|"), escaped(text).replace("|", "\\|")
        parts.append(f"| `{name}` | `{kind}` | {text.replace('``', '`')} |")
    return [*parts, "", *methods]


def stub_signature(function: ast.FunctionDef) -> str:
    """Format the signature of a method of the stub without `self`."""
    arguments = ast.parse(ast.unparse(function).partition("\n")[0] + " ...").body[0]
    assert isinstance(arguments, ast.FunctionDef)
    arguments.args.args = arguments.args.args[1:]
    answer = f" -> {ast.unparse(function.returns)}" if function.returns else ""
    return formatted(ast.unparse(arguments.args)) + answer


def signature(function: Any) -> str:
    """Format a signature as in Python source, with one line per argument if it is long."""
    text = str(inspect.signature(function)).replace("'", "")
    text = re.sub(r"^\(self(, )?", "(", text)
    inside, _, answer = text[1:].rpartition(")")
    return formatted(inside) + answer


def formatted(arguments: str) -> str:
    """Format arguments in parentheses, with one line for each if they are long.

    >>> formatted("name: str='', *, size: tuple[int, int]=(4, 3)")
    "(name: str = '', *, size: tuple[int, int] = (4, 3))"
    """
    each, depth = [""], 0
    for letter in arguments:
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            each.append("")
        else:
            each[-1] += letter
    spaced = [re.sub(r"^(\w+: [^=]+?) ?= ?", r"\1 = ", one.strip()) for one in each]
    if len(short := f"({', '.join(spaced)})") < 70:
        return short
    return "(\n" + "".join(f"    {one},\n" for one in spaced) + ")"


def docstring(text: str) -> str:
    """Convert a docstring: Google's sections become headings and lists, examples become code."""
    out: list[str] = []
    text = text.replace("``", "`").replace("  # doctest: +SKIP", "")
    # A section is its title and the indented or empty lines after it.
    for part in PARTS.split(text):
        title, _, body = part.partition("\n")
        if re.fullmatch(f"(?:{SECTIONS}):", title):
            items = ITEM.sub(r"- `\1`: \2", escaped(textwrap.dedent(body)))
            out += [f"**{title[:-1]}**", items]
        else:
            out.append(examples(part))
    return "\n\n".join(out) + "\n"


def examples(text: str) -> str:
    """Make blocks of code of the examples in a text without sections."""
    out: list[str] = []
    is_code = False
    for line in text.splitlines():
        if line.startswith((">>>", "...")) or (is_code and line.strip()):
            out += [] if is_code else ["", "```pycon"]
            is_code = True
        elif is_code:
            out.append("```")
            is_code = False
        out.append(line if is_code else escaped(line))
    return "\n".join([*out, *["```"] * is_code])


def escaped(text: str) -> str:
    """Escape angle brackets, so that they are not markup."""
    return text.replace("<", "&lt;")
