# SPDX-License-Identifier: Apache-2.0
"""Tests that tools/check_sizes finds files, functions and parameter lists that are too long."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOOL = ROOT / "tools" / "check_sizes"
BODY = "".join(f"  use({i});\n" for i in range(79))
EIGHT = "int a, int b, int c, int d, int e, int f, int g, int h"


def run(root: Path) -> subprocess.CompletedProcess[str]:
    """Runs the tool on a tree."""
    return subprocess.run(
        [sys.executable, str(TOOL), str(root)], capture_output=True, text=True, check=False
    )


def found(root: Path, name: str, text: str) -> list[str]:
    """Returns the violations in a tree of one file, which is removed again."""
    path = root / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    done = run(root)
    path.unlink()
    assert done.returncode == bool(done.stderr), done
    return done.stderr.splitlines()


@pytest.mark.slow
def test_this_tree_is_clean() -> None:
    done = run(ROOT)
    assert done.returncode == 0, done.stderr


def test_nothing_to_check_is_an_error(tmp_path: Path) -> None:
    assert run(tmp_path).returncode == 2


@pytest.mark.parametrize(
    "head",
    [
        "void f() {",
        "template <typename F, uint32_t kParts = (1u << 3)>\nstd::vector<F> f(const F& a) const {",
        "Thing::f(int a, int b) : a_{a}, b_(b) {",
        "auto f() -> std::pair<int, int> {",
        "bool operator<(const A& a, const B& b) {",
        "[[gnu::noinline]] void f(Options o = {}) noexcept {",
        "template <class T>\n  requires(sizeof(T) > 4)\nvoid f(T a) {",
        "struct S {\n  int a = 3;\n  void f() {",
        "namespace a::b {\nclass C final : public D<int> {\n public:\n  C(int x) : D(x), x_{x} {",
    ],
)
def test_long_functions(tmp_path: Path, head: str) -> None:
    """Functions may have 80 lines but not 81, for every form of declaration."""
    before = head.splitlines()[:-1]
    outer = sum(line.endswith("{") for line in before)
    own = 0 if outer else len(before)
    inner = BODY.splitlines(keepends=True)[: 78 - own]
    close = "}\n" + "};\n" * outer
    assert found(tmp_path, "src/a.h", f"{head}\n{''.join(inner)}{close}") == []
    (line,) = found(tmp_path, "src/a.h", f"{head}\n{''.join(inner)}  use(0);\n{close}")
    assert "has 81 lines; at most 80" in line


def test_braces_in_comments_and_literals_do_not_count(tmp_path: Path) -> None:
    text = (
        "// {\n/* { */\n#define OPEN {\nvoid f() {\n  const char* a = \"{\", b = '{';\n"
        "  g(R\"(}}}{)\");\n  const int n = 1'000'000;\n" + "  h();\n" * 77 + "}\n"
    )
    (line,) = found(tmp_path, "src/a.cpp", text)
    assert line == "src/a.cpp:4: f has 82 lines; at most 80"


def test_code_that_is_no_function(tmp_path: Path) -> None:
    rows = "".join(f"  {{{i}, f({i})}},\n" for i in range(100))
    text = f"const Row kRows[] = {{\n{rows}}};\nenum class A : int {{\n{'  k,' * 90}\n}};\n"
    assert found(tmp_path, "src/a.h", text) == []


@pytest.mark.parametrize(
    "text",
    [
        f"void f({EIGHT}) {{}}\n",
        f"class A {{\n  virtual void f({EIGHT}) = 0;\n}};\n",
        f"template <int N>\nvoid f({EIGHT.replace('int h', 'std::array<int, 3> h = {1, 2}')});\n",
        f"A::f({EIGHT}) : a_{{a}} {{}}\n",
    ],
)
def test_many_parameters(tmp_path: Path, text: str) -> None:
    (line,) = found(tmp_path, "src/a.h", text)
    assert "f has 8 parameters; at most 7" in line
    for one in ("int h", "std::array<int, 3> h = {1, 2}"):
        text = text.replace(f", {one}", "")
    assert found(tmp_path, "src/a.h", text) == []


def test_types_with_commas_are_one_parameter(tmp_path: Path) -> None:
    text = "void f(std::map<int, int> a, std::function<void(int, int)> b, int c = g(1, 2, 3, 4));\n"
    assert found(tmp_path, "src/a.h", text * 2) == []


def test_python(tmp_path: Path) -> None:
    """In Python, keyword-only parameters and self do not count, and functions may be long."""
    seven = "a, b, c, d, e, f, g"
    good = f"class A:\n    def f(self, {seven}, *, h, i):\n" + "        pass\n" * 90
    assert found(tmp_path, "python/a.py", good) == []
    (line,) = found(tmp_path, "python/a.py", f"def f({seven}, h):\n    pass\n")
    assert line == "python/a.py:1: f has 8 parameters; at most 7"


def test_files_and_folders(tmp_path: Path) -> None:
    (line,) = found(tmp_path, "src/a.h", "//\n" * 401)
    assert line == "src/a.h:1: 401 lines; a file has at most 400"
    for i in range(23):
        (tmp_path / f"src/b{i}.h").write_text("")
    assert run(tmp_path).returncode == 0
    (line,) = found(tmp_path, "src/c.h", "")
    assert line == "src: 24 files; at most 23"
