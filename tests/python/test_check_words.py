# SPDX-License-Identifier: Apache-2.0
"""Tests tools/check_words: prose that it rejects, prose that it permits, and its speed."""

from __future__ import annotations

import importlib
import os
import pathlib
import shutil
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOOL = ROOT / "tools" / "check_words"
GLOSSARY = "# Glossary\n\n## Terms\n\n| term | meaning |\n| --- | --- |\n| wave | a batch |\n"


def run(root: pathlib.Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(TOOL), str(root), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def tree(root: pathlib.Path, files: dict[str, str], pending: str = "") -> pathlib.Path:
    shutil.copytree(ROOT / "tools" / "words", root / "tools" / "words")
    (root / "tools" / "words" / "pending.txt").write_text(pending)
    for name, text in {"docs/glossary.md": GLOSSARY, **files}.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


@pytest.mark.slow
def test_this_tree_is_clean_in_five_seconds() -> None:
    before = os.times()
    result = run(ROOT)
    after = os.times()
    assert result.returncode == 0, result.stderr
    assert after.children_user - before.children_user < 5


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("src/wavecomb/core/a.h", "/// A seed of no good.\n", ':1: "no good": write invalid'),
        ("src/wavecomb/core/a.h", "int a;  // goes on after b\n", '"goes on": write continue'),
        ("python/wavecomb/a.py", '"""Docs.\n\nMends a stage."""\n', ':3: "Mends": write fix'),
        ("python/wavecomb/a.py", "x = 1  # the dearest one\n", '"dearest": write expensive'),
        ("python/wavecomb/a.py", 'o(help="A lamp "\n  "or sun.")\n', '"lamp": write light'),
        ("python/wavecomb/a.py", 'option("--a", "flag", "A lamp in use.")\n', '"lamp"'),
        ("python/wavecomb/a.py", '_row(\n  None, "A lamp in use.", "text")\n', ':2: "lamp"'),
        ("src/wavecomb/core/s_table.cpp", 'row("a", "The lamp in use.")\n', '"lamp"'),
        ("Makefile", "# What is asked for.\n", '"What is asked for.": name the subject'),
        ("tests/python/test_a.py", "def f():\n    # Who dies.\n", ":2: "),
        ("docs/a.md", "# A\n\nThis one is cheap.\n", 'a.md:3: "cheap"'),
        ("docs/a.md", "| a | b |\n| --- | --- |\n| c | of its own |\n", "a.md:3: "),
        ("docs/a.md", "It takes 1.7 times as long.\n", "figures stand on benchmark pages"),
        ("docs/a.md", "word " * 30 + "\n", "columns of prose"),
        ("src/wavecomb/core/a.cpp", "// " + "word " * 30 + "\n", "columns of prose"),
        ("tools/setup", "# " + "word " * 30 + "\n", "columns of prose"),
        ("src/wavecomb/render/renderer.h", "/// Fills a packet.\n", "glossary.md does not define"),
        ("python/wavecomb/a.py", 'o(help="Length of a packet.")\n', '"packet": docs/glossary'),
        ("docs/a.md", "word\n" * 60_001, "docs: 600"),
        ("docs/decisions/a.md", "word\n" * 20_001, "docs/decisions: 20001 words"),
        ("docs/decisions/a.md", "word\n" * 351, "docs/decisions/a.md: 351 words; 350"),
    ],
)
def test_refused(tmp_path: pathlib.Path, name: str, text: str, message: str) -> None:
    result = run(tree(tmp_path, {name: text}))
    assert result.returncode == 1
    assert message in result.stderr, result.stderr


@pytest.mark.parametrize(
    ("name", "text"),
    [
        (
            "src/wavecomb/core/a.h",
            'auto a = "goes on";  // the text\nauto url = "https://mend.a";\n',
        ),
        ("src/wavecomb/core/a.h", "/// A lamp: public headers alone may not name it.\n"),
        ("src/wavecomb/core/a.h", "/// Fills a packet of lanes.\n"),
        ("python/wavecomb/a.py", 'text = "no good"\nprint("what # mends it")\n'),
        ("python/wavecomb/a.py", 'o(help="Paths in a wave. What may I do?")\n'),
        ("docs/a.md", "```sh\nmend it # " + "word " * 30 + "\n```\n\n    goes on\n"),
        ("docs/a.md", "| a | " + "word " * 40 + "|\n"),
        ("docs/a.md", "See https://example.com/" + "a" * 100 + "\n"),
        ("docs/a.md", "See [the page](images/" + "a" * 100 + ".md) about it.\n"),
        ("docs/benchmarks.md", "It takes 1.7 times as long.\n"),
        ("docs/decisions/a.md", "It takes 1.7 times as long.\n"),
        ("CHANGELOG.md", "# C\n\n## 2\n\n- " + "word " * 40 + "\n\n## 1\n\n- This goes on.\n"),
        ("benchmarks/results/a.md", "This one is cheap.\n"),
    ],
)
def test_left_alone(tmp_path: pathlib.Path, name: str, text: str) -> None:
    result = run(tree(tmp_path, {name: text}))
    assert result.returncode == 0, result.stderr


def test_a_folder_may_have_what_is_pending_and_no_more(tmp_path: pathlib.Path) -> None:
    files = {"src/wavecomb/core/a.h": "/// This goes on.\n\n/// It is worn.\n"}
    root = tree(tmp_path, files, pending="# pending\n    2 src/wavecomb/core\n")
    assert run(root).returncode == 0
    assert run(root, "--pending").stdout.split() == ["2", "src/wavecomb/core"]
    (root / "src/wavecomb/core/b.h").write_text("/// No good.\n")
    result = run(root)
    assert result.returncode == 1
    assert "src/wavecomb/core: 3 findings; tools/words/pending.txt allows 2" in result.stderr


def test_subjects_of_commits_since_the_tool(tmp_path: pathlib.Path) -> None:
    def git(*words: str) -> None:
        who = ["-c", "user.name=A", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false"]
        subprocess.run(["git", *who, *words], cwd=tmp_path, check=True, capture_output=True)

    root = tree(tmp_path, {})
    git("init", "-q")
    git("commit", "-q", "--allow-empty", "-m", "b" * 80)
    shutil.copy(TOOL, root / "tools" / "check_words")
    git("add", "-A")
    git("commit", "-q", "-m", "Add the tool")
    assert run(root).returncode == 0
    git("commit", "-q", "--allow-empty", "-m", "c" * 72)
    assert run(root).returncode == 0
    git("commit", "-q", "--allow-empty", "-m", "d" * 73)
    result = run(root)
    assert result.returncode == 1
    assert "a subject of 73 characters" in result.stderr


@pytest.mark.slow
def test_a_sample_is_sixty_sentences_and_the_same_again(tmp_path: pathlib.Path) -> None:
    names = [
        "docs/building.md", "python/wavecomb/api.py", "src/wavecomb/core/settings.h",
        "src/wavecomb/core/settings_table.cpp",
    ]  # fmt: skip
    tree(tmp_path, {name: (ROOT / name).read_text(encoding="utf-8") for name in names})
    first = run(tmp_path, "--sample", "7")
    assert first.returncode == 0 and len(first.stdout.splitlines()) == 60
    assert first.stdout == run(tmp_path, "--sample", "7").stdout
    assert first.stdout != run(tmp_path, "--sample", "8").stdout


def test_entries_of_sections_are_items_and_code_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "tools" / "words"))
    docstring_blocks = importlib.import_module("prose").docstring_blocks
    text = """Does a thing.

    tool --option FILE    # code

Args:
    one: The first
        number. It is even.
    two: Another one.

Returns:
    A number that
    is even.

- An item.
- Another item.

>>> code()
"""
    assert list(docstring_blocks(text)) == [
        (0, "Does a thing."),
        (5, "one: The first number. It is even."),
        (7, "two: Another one."),
        (10, "A number that is even."),
        (13, "An item."),
        (14, "Another item."),
    ]


def test_tags_in_code_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "tools" / "words"))
    plain = importlib.import_module("prose").plain
    assert plain("Tiles of `a.<UDIM>.png` <b>or</b> [more](b.md).") == (
        "Tiles of `a.<UDIM>.png` or more."
    )


def test_brackets_of_links_alone_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "tools" / "words"))
    plain = importlib.import_module("prose").plain
    assert plain("Bits differ ([decision](a.md)).") == "Bits differ."
    assert plain("Lenses bend rays ([lens](a.md#b),\n[visibility](c.md)), twice.") == (
        "Lenses bend rays, twice."
    )
    assert plain("Bits differ (see [why](a.md)).") == "Bits differ (see why)."


def test_words_are_counted_by_page(tmp_path: pathlib.Path) -> None:
    root = tree(tmp_path, {"docs/a.md": "one two\n", "docs/decisions/b.md": "three\n"})
    lines = run(root, "--count").stdout.splitlines()
    assert "      2 docs/a.md" in lines and "      1 docs/decisions/b.md" in lines
    assert lines[-1] == "      1 docs/decisions (of 20000)"


def test_glossary_defines_every_private_word() -> None:
    text = (ROOT / "tools/words/private.txt").read_text(encoding="utf-8")
    words = [line for line in text.splitlines() if line and not line.startswith("#")]
    terms = (ROOT / "docs/glossary.md").read_text(encoding="utf-8").lower().partition("## terms")[2]
    assert [word for word in words if f"| {word} " not in terms and f", {word} |" not in terms
            and f" {word}, " not in terms] == []  # fmt: skip
