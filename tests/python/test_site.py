# SPDX-License-Identifier: Apache-2.0
"""Tests documentation pages: links have targets, and the site is complete."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from parts import needs, only_where

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.rglob("*.md"), *(ROOT / f"{name}.md" for name in
                ("README", "CONTRIBUTING", "CHANGELOG"))])  # fmt: skip
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


def text_of(page: Path) -> str:
    """Returns the page without code."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.M)
    return re.sub(r"`[^`\n]*`", "code", text)


@cache
def anchors(page: Path) -> frozenset[str]:
    """Returns the anchors of headings, as GitHub and the site generate them."""
    found: set[str] = set()
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.M)
    for heading in re.findall(r"^#+ (.+)$", text, flags=re.M):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").lower().strip()
        found.add(re.sub(r"[^\w\- ]", "", plain).replace(" ", "-"))
    return frozenset(found)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page: Path) -> None:
    broken = []
    for target in LINK.findall(text_of(page)):
        if "://" in target or target.startswith("mailto:"):
            continue
        file, _, anchor = target.partition("#")
        path = (page.parent / file).resolve() if file else page
        if not path.exists():
            broken.append(f"{target}: no such file")
        elif anchor and path.suffix == ".md" and anchor not in anchors(path):
            broken.append(f"{target}: no such heading")
    assert not broken, "; ".join(broken)


def test_nothing_installs_wavecomb_from_an_index() -> None:
    """Wavecomb is on no package index, so anybody could register its name on one."""
    files = [*PAGES, *(ROOT / "python").rglob("*.py"), ROOT / "Makefile"]
    said = re.compile(r"pip install (?:-\S+ )*['\"]?wavecomb\b")
    assert [file for file in files if said.search(file.read_text(encoding="utf-8"))] == []


@needs("wavecomb._core")
def test_commands_of_pages_have_their_options(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every option that a page shows for a command exists."""
    import click

    from wavecomb.cli import main

    monkeypatch.syspath_prepend(str(ROOT / "tools" / "site"))
    import reference

    root = click.Context(main, info_name="wavecomb")
    known = {path: {one for param in command.get_params(context) for one in param.opts}
             for path, command, context in reference.walk(main, root)}  # fmt: skip
    wrong, seen = [], 0
    for page in PAGES:
        if page.name == "CHANGELOG.md":
            continue
        text = page.read_text(encoding="utf-8")
        for line in re.findall(r"^(?:    )?wavecomb [^\n|#>]*", text, flags=re.MULTILINE):
            words = line.split()[1:]
            command = " ".join(words[:2]) if " ".join(words[:2]) in known else words[0]
            options = re.findall(r"(?<=\s)(--[a-z][\w-]*)", line)
            seen += len(options)
            wrong += [f"{page.name}: {line.strip()}: {one}" for one in options
                      if one not in known.get(command, ())]  # fmt: skip
    assert not wrong, "\n".join(wrong[:20])
    assert seen > 150


def test_sources_name_pages_that_are_there() -> None:
    """Pages named as docs/NAME.md in comments, messages and tests exist."""
    missing = []
    for folder in ("src", "bindings", "python", "tests", "tools", "benchmarks", "cmake"):
        for path in (ROOT / folder).rglob("*"):
            kinds = (".h", ".cpp", ".inl", ".in", ".py", ".pyi", ".csv", ".cmake", "")
            if path.suffix not in kinds or not path.is_file():
                continue
            text = path.read_text(encoding="utf-8", errors="replace")
            missing += [f"{path.name}: {name}"
                        for name in re.findall(r"\bdocs/[a-z-]{2,}(?:/[a-z-]{2,})?\.md", text)
                        if not (ROOT / name).is_file() and "made-up" not in name]  # fmt: skip
    assert not missing, missing


def test_pages_name_sources_that_are_there() -> None:
    """Paths such as `folder/file.h` in pages exist below the root or a package."""
    folders = ("", "src/wavecomb", "src/wavecomb/material", "python",
               "python/wavecomb", "tests/cpp", "tests/python", "tests/statistics")  # fmt: skip
    name = re.compile(r"`((?:[a-z_]+/)+[a-z_.]+\.(?:h|cpp|inl|py|in|toml|txt|usda))`")
    made_up = ("CHANGELOG.md", "writing-a-policy.md", "writing-a-material.md")
    missing = []
    for page in PAGES:
        if page.name not in made_up:
            for file in name.findall(page.read_text(encoding="utf-8")):
                if not any((ROOT / folder / file).exists() for folder in folders):
                    missing.append(f"{page.name}: {file}")
    assert not missing, missing


PARTS = {
    "command": r"^    \S|^```sh$",
    "image": r"!\[[^\]]+\]\(",
    "table": r"^\| ---",
    "limits": r"^## Limits",
}
"""Patterns of the parts of a page other than its first sentence."""
WITHOUT = {"faq": {"limits"}, "glossary": {"limits"}, "ide": {"image"}}
"""Page parts that pages may omit. docs/decisions/page-parts.md has the reasons."""


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: page.stem)
def test_a_page_has_all_parts(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    first = text.split("\n\n", 2)[1]
    if page.stem != "window-compare":
        assert re.match(r"[A-Z`]", first), f"no sentence of purpose: {first[:60]!r}"
    missing = {name for name, part in PARTS.items() if not re.search(part, text, flags=re.M)}
    assert missing <= WITHOUT.get(page.stem, set())


def test_images_of_pages_are_shown_and_small() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for path in (DOCS / "images" / "pages").iterdir():
        assert f"images/pages/{path.name})" in text, path.name
        assert path.stat().st_size <= 120_000, path.name


def test_images_of_the_gallery_are_wide() -> None:
    images = pytest.importorskip("PIL.Image")
    small = []
    for path in (DOCS / "images" / "gallery").iterdir():
        with images.open(path) as image:
            if image.width < 1280:
                small.append(path.stem)
    assert small == []


def test_every_page_has_a_place_in_the_site() -> None:
    listed = set(
        re.findall(r"^\s+- (?:[\w ]+: )?(\S+\.md)$", (ROOT / "mkdocs.yml").read_text(), flags=re.M)
    )
    made = {"changelog.md", "contributing.md"} | {p for p in listed if p.startswith("reference/")}
    there = {page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")}
    decisions = {page for page in there if page.startswith("decisions/")}
    assert listed - made == there - decisions
    text = (DOCS / "decisions" / "README.md").read_text(encoding="utf-8")
    linked = {f"decisions/{name}" for name in re.findall(r"\]\(([a-z0-9-]+\.md)\)", text)}
    assert linked | {"decisions/README.md"} == decisions


@needs("wavecomb._core")
def test_reference_pages_have_every_row(monkeypatch: pytest.MonkeyPatch) -> None:
    import wavecomb
    from wavecomb.load_options import LoadOptions
    from wavecomb.options import settings
    from wavecomb.run.aovs import core_aovs

    monkeypatch.syspath_prepend(str(ROOT / "tools" / "site"))
    import reference

    pages = reference.pages()
    for name, row in settings().items():
        assert f"| `{name}` |" in pages["settings.md"]
        if name in ("policy", "wave_size", "max_depth", "seed", "guiding"):
            assert f"`{row.option}" in pages["options.md"]
    for name in core_aovs():
        assert f"| `{name}` |" in pages["layers.md"]
    for name in LoadOptions.__dataclass_fields__:
        assert re.search(rf"^\| `{name}` \|.*\w", pages["loading.md"], flags=re.M), name
    for name in wavecomb.__all__:
        assert name == "__version__" or f"## wavecomb.{name}\n" in pages["python.md"]
    for name in ("SceneBuilder.add_mesh", "scenes.cornell", "Renderer.edit"):
        assert f"### {name}\n" in pages["python.md"]
    assert "| `triangles` | `int` | Number of triangles" in pages["python.md"]
    no_code = re.sub(r"^```.*?^```$", "", pages["python.md"], flags=re.DOTALL | re.MULTILINE)
    assert not re.search(r"^\*\*\w+\*\*\n\n    ", no_code, flags=re.MULTILINE)
    assert "| `wavecomb/scene/scene.h` |" in pages["cpp.md"]
    assert "| Exception for errors that invalid input causes. |" in pages["cpp.md"]
    for command in ("render", "farm submit", "bench run", "doctor", "sheet"):
        assert f"## wavecomb {command}\n" in pages["options.md"]
    rows = [line.split(" | ") for line in pages["options.md"].splitlines() if line[:3] == "| `"]
    assert len(rows) > 200
    for row in rows:
        assert len(row) == 4 and len(row[0]) < 36, row  # a narrow first column
    used = pages["options.md"].index("**Most used**")
    assert used < pages["options.md"].index("| `--size`") < pages["options.md"].index("**Camera**")
    assert "RANGE`, 0" not in pages["options.md"] and "&lt;x" not in pages["options.md"]
    assert any(row[0] == "| `--seed`" and "`N`" in row[1] and "0" in row[3] for row in rows)
    for name, text in pages.items():
        widths = {line.replace("\\|", "").count("|") for line in text.splitlines()
                  if line.startswith("| ")}  # fmt: skip
        assert len(widths) <= 2, name


@pytest.mark.slow
@needs("wavecomb._core")
@only_where(importlib.util.find_spec("mkdocs"), "mkdocs is not installed: pip install '.[docs]'")
def test_the_site_is_built_without_warnings(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "index.html").is_file() and (tmp_path / "reference/options.html").is_file()
    assert (tmp_path / "search/search_index.js").is_file()
    home = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert '<script src="iframe-worker.js"' in home and "unpkg.com" not in home
    if shutil.which("doxygen"):
        assert (tmp_path / "cpp/classwavecomb_1_1SceneBuilder.html").is_file()
        assert "../reference/cpp.html" in (tmp_path / "cpp/menudata.js").read_text("utf-8")
        assert "cpp/annotated.html" in (tmp_path / "reference/cpp.html").read_text("utf-8")
    browser = shutil.which("chromium")
    if browser:
        page = f"{(tmp_path / 'index.html').as_uri()}?q=guiding"
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=20000"]
        shown = subprocess.run([browser, *options, "--dump-dom", page], capture_output=True,
                               text=True, timeout=120).stdout  # fmt: skip
        assert "md-search-result__item" in shown
