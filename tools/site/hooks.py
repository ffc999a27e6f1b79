# SPDX-License-Identifier: Apache-2.0
"""Hooks of MkDocs that add pages from outside docs/ to the site."""

from __future__ import annotations

import functools
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).parent))

import reference  # noqa: E402

PAGES = {"CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}
"""Maps pages of the repository root to their names in the site."""
LINK = re.compile(r"(!?\[[^\]]*\])\(([^)\s]+)\)")
CODE = re.compile(r"^(```.*?^```$|    .*?$)", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"`[^`\n]+`")
DOXYGEN = {
    "PROJECT_NAME": "Wavecomb", "PROJECT_BRIEF": '"The C++ core"', "HTML_OUTPUT": ".",
    "GENERATE_LATEX": "NO", "EXTRACT_ALL": "YES", "HIDE_UNDOC_RELATIONS": "YES",
    "JAVADOC_AUTOBRIEF": "YES", "QUIET": "YES", "WARNINGS": "NO", "HAVE_DOT": "NO",
    "HTML_TIMESTAMP": "NO", "SORT_MEMBER_DOCS": "NO", "SHOW_INCLUDE_FILES": "NO",
}  # fmt: skip
"""Settings of Doxygen, except paths."""
BACK = (
    '<tab type="mainpage" visible="no" title=""/>'
    '<tab type="user" visible="yes" url="../reference/cpp.html" title="Documentation"/>'
)
"""Tab of Doxygen's pages that leads to the site, instead of an empty main page."""
STYLE = """
.md-typeset table:not([class]) { font-size: .68rem; }
.md-typeset img { border-radius: 2px; }
.md-typeset img[src$=".svg"] { background: #f7f7f4; }
.md-typeset td:first-child code { white-space: nowrap; }
.md-typeset td:not(:first-child) code { white-space: normal; overflow-wrap: break-word; }
.md-typeset pre > code { white-space: pre-wrap; overflow-wrap: anywhere; }
.md-grid { max-width: 68rem; }
"""


def on_config(config: Any) -> Any:
    """List all decisions in the navigation, in the order of docs/decisions/README.md."""
    text = (ROOT / "docs" / "decisions" / "README.md").read_text(encoding="utf-8")
    pages = ["decisions/README.md"]
    pages += [f"decisions/{name}" for name in re.findall(r"\]\(([a-z0-9-]+\.md)\)", text)]
    for section in config.nav:
        for entry in next(iter(section.values())):
            if isinstance(entry, dict) and "Decisions" in entry:
                entry["Decisions"] = list(dict.fromkeys(pages))
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add files that are not in docs/."""
    made = {f"reference/{name}": text for name, text in reference.pages().items()}
    made["site.css"] = STYLE
    made["iframe-worker.js"] = Path(__file__).with_name("iframe-worker.js").read_text("utf-8")
    for source, name in PAGES.items():
        made[name] = (ROOT / source).read_text(encoding="utf-8")
    for name, text in made.items():
        files.append(File.generated(config, name, content=text))
    return files


def on_post_build(config: Any) -> None:
    """Add the C++ reference if Doxygen is installed."""
    if not shutil.which("doxygen"):
        return
    folder = Path(config["site_dir"]) / "cpp"
    folder.mkdir(parents=True, exist_ok=True)
    settings = DOXYGEN | {
        "INPUT": " ".join(f'"{path}"' for path in reference.public_headers()),
        "OUTPUT_DIRECTORY": f'"{folder}"',
        "INCLUDE_PATH": f'"{ROOT}/src"',
        "STRIP_FROM_PATH": f'"{ROOT}/src"',
        "STRIP_FROM_INC_PATH": f'"{ROOT}/src"',
    }
    with tempfile.TemporaryDirectory() as scratch:
        layout = Path(scratch, "layout.xml")
        run = functools.partial(subprocess.run, text=True, check=True, stdout=subprocess.DEVNULL)
        run(["doxygen", "-l", str(layout)])
        first, count = re.subn(r'<tab type="mainpage"[^>]*>', BACK, layout.read_text("utf-8"))
        assert count == 1, "the layout of Doxygen has a main page"
        layout.write_text(first, "utf-8")
        settings["LAYOUT_FILE"] = f'"{layout}"'
        text = "".join(f"{name} = {value}\n" for name, value in settings.items())
        run(["doxygen", "-"], input=text)


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Adapt links from and to pages of the repository root."""
    name = page.file.src_uri
    at_root = name in PAGES.values()

    def link(match: re.Match[str]) -> str:
        text, target = match.groups()
        if at_root and target.startswith("docs/"):
            return f"{text}({target.removeprefix('docs/')})"
        file = target.lstrip("./").partition("#")[0]
        if target.startswith("../") and file in PAGES:
            return f"{text}({'../' * name.count('/')}{PAGES[file]})"
        if not target.startswith("#") and "://" not in target and _is_elsewhere(name, target):
            return text[1:-1]  # links to files that are not pages become text
        return match[0]

    # GitHub requires "\|" in code inside tables, but MkDocs would show the backslash.
    markdown = INLINE.sub(lambda match: match[0].replace("\\|", "|"), markdown)
    parts = CODE.split(markdown)
    return "".join(part if k % 2 else LINK.sub(link, part) for k, part in enumerate(parts))


def _is_elsewhere(page: str, target: str) -> bool:
    """Whether a link points to a file of the repository outside docs/."""
    folder = ROOT if page in PAGES.values() else (ROOT / "docs" / page).parent
    path = (folder / target.partition("#")[0]).resolve()
    return path.exists() and ROOT / "docs" not in path.parents
