# SPDX-License-Identifier: Apache-2.0
"""Tests the benchmark report and its figures with generated results of every kind."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import html5lib
import numpy as np
import pytest
from bench_results import everything, policy_rows, runs_of, write_folder

from wavecomb.bench.analysis.data import load
from wavecomb.bench.reports.page import LARGEST_PNG, LARGEST_SVG, build, equality, warnings_of
from wavecomb.bench.reports.parts import number, table
from wavecomb.image.files.image import read_image

HTML = "{http://www.w3.org/1999/xhtml}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result folder with its report, and docs/made-up.md beside it."""
    path = write_folder(tmp_path_factory.mktemp("bench") / "made up", everything(), pictures=True)
    assert build(path, path.parent / "docs" / "made-up.md") == path / "report.html"
    return path


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def tree(page: str) -> ElementTree.Element:
    """The report page, parsed strictly: any HTML error fails the test."""
    return html5lib.HTMLParser(strict=True).parse(page)


def texts(tree: ElementTree.Element, tag: str) -> list[str]:
    return ["".join(element.itertext()) for element in tree.iter(HTML + tag)]


def check_sound(tree: ElementTree.Element) -> None:
    """Checks ids, links, and attributes that a screen reader needs."""
    ids = [element.get("id") for element in tree.iter() if element.get("id")]
    assert len(ids) == len(set(ids))
    for element in tree.iter():
        for name in ("aria-labelledby", "href"):
            value = element.get(name) or ""
            if name == "href" and not value.startswith("#"):
                assert value == ""
                continue
            assert all(key.lstrip("#") in ids for key in value.split()), value
    assert all(image.get("alt") for image in tree.iter(HTML + "img"))
    assert all(
        cell.get("scope") for head in tree.iter(HTML + "tr") for cell in head.iter(HTML + "th")
    )
    assert len(list(tree.iter(HTML + "caption"))) == len(list(tree.iter(HTML + "table")))
    root = tree if tree.tag == HTML + "html" else tree.find(HTML + "html")
    assert root is not None
    assert root.get("lang") == "en"
    for control in (*tree.iter(HTML + "select"), *tree.iter(HTML + "input")):
        assert any(control in list(label) for label in tree.iter(HTML + "label"))


@pytest.mark.slow
def test_page_is_sound_and_can_be_read_by_all(tree: ElementTree.Element) -> None:
    check_sound(tree)


@pytest.mark.slow
def test_page_needs_nothing_else(page: str) -> None:
    without_names = re.sub(r'xmlns(:\w+)?="[^"]*"', "", page)
    assert not re.search(r"""(src|href|xlink:href)=["'](?!#|data:)""", without_names)
    assert "@import" not in page
    assert "url(" not in re.sub(r"url\(#", "", page)
    assert "currentColor" in page


@pytest.mark.slow
def test_page_says_what_it_must(tree: ElementTree.Element, page: str) -> None:
    headings = texts(tree, "h2")
    for wanted in (
        *("Read the figures with care", "Findings", "Experiment policies"),
        *("Roulette apart from order", "Effects of the factors", "Predicted cost", "Pictures"),
        *("How to repeat the benchmark", "Machine"),
    ):
        assert wanted in headings
    captions = texts(tree, "caption")
    assert "Renderers, ratio of means to Wavecomb" in captions
    assert "Variance and efficiency" in captions
    assert "equal runs vary by 12% (made up)" in page
    assert "wavecomb bench run made-up.toml -o results" in page
    assert "counters that are not available here: cycles: perf_event_paranoid is 3" in page
    assert "Made-up CPU &lt;4 GHz&gt; &amp; friends" in page
    findings = " ".join(texts(tree, "li"))
    assert "policies, 16 lanes: 6 of 6 orders are quicker than arrival order" in findings
    assert "policies, 1 lane: no order is shown to be quicker" in findings
    assert "it is not shown to beat it" in findings
    assert "adaptive takes" in findings


@pytest.mark.slow
def test_cases_are_compared_with_off(folder: Path) -> None:
    """Cases with equal time limits are compared by error, time and efficiency."""
    text = (folder.parent / "docs" / "made-up.md").read_text(encoding="utf-8")
    rows = [line.split("|") for line in text.splitlines() if re.search(r"\| aimed +\|", line)]
    found = [[float(cell.split()[0]) for cell in row[3:6]] for row in rows if "more" in row[-2]]
    assert found == [[0.5, 1.0, 2.0]], rows
    assert "parts-cases-efficiency" in text


def test_viewers(tree: ElementTree.Element) -> None:
    viewers = [e for e in tree.iter(HTML + "div") if e.get("class") == "viewer"]
    assert len(viewers) == 2
    for viewer in viewers:
        pictures = list(viewer.iter(HTML + "img"))
        assert len(pictures) == 3
        for select in viewer.iter(HTML + "select"):
            assert len(list(select)) == len(pictures)
    named = "".join(viewers[0].itertext())
    assert "none, program, material" in named


@pytest.mark.slow
def test_figures_open_and_are_not_blank(folder: Path) -> None:
    names = {path.stem for path in (folder / "figures").iterdir()}
    for part in (
        *("policies-shade", "policies-policies", "policies-pipeline"),
        *("policies-coherence", "policies-order"),
        *("policies-regret", "policies-mixed-lanes", "scaling-threads-mixed-curve"),
        *("scaling-wave-size-mixed-curve", "error-error", "effects-render-time", "costs"),
        *("difference-mixed", "peers-renderers-efficiency"),
    ):
        assert part in names
    for name in names:
        pixels = read_image(folder / "figures" / f"{name}.png")[:, :, :3]
        assert pixels.shape[1] > 800
        ink = (np.abs(pixels - 1.0) > 0.1).any(axis=2)
        assert 0.003 < ink.mean() < 0.95, name
        # Three of the figure's four quadrants must contain a plot; the fourth may be empty.
        half_y, half_x = ink.shape[0] // 2, ink.shape[1] // 2
        for quarter in (ink[:half_y, :half_x], ink[:half_y, half_x:], ink[half_y:, :half_x]):
            assert quarter.any(), name
        drawing = ElementTree.parse(folder / "figures" / f"{name}.svg").getroot()
        assert drawing.tag.endswith("svg")
        shapes = [e for e in drawing.iter() if e.tag.endswith(("path", "text", "image", "use"))]
        assert len(shapes) > 20


@pytest.mark.slow
def test_markdown_page(folder: Path) -> None:
    target = folder.parent / "docs" / "made-up.md"
    text = target.read_text(encoding="utf-8")
    assert text.startswith("# Wavecomb benchmark: made-up\n")
    assert "## Findings" in text and "equal runs vary by 12% (made up)" in text
    shown = re.findall(r"!\[[^]]+\]\(made-up/([^)]+)\)", text)
    assert len(shown) > 10 and any("difference-mixed" in name for name in shown)
    files = {path.name for path in target.with_suffix("").iterdir()}
    assert set(shown) == files
    for path in target.with_suffix("").iterdir():
        limit = LARGEST_SVG if path.suffix == ".svg" else LARGEST_PNG
        assert 0 < path.stat().st_size <= limit, path.name
    # Each row of a table has as many cells as its head.
    tables = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    assert len(tables) > 5
    for lines in tables:
        assert len({line.count(" | ") for line in lines.splitlines() if "---" not in line}) == 1
    assert "| dragon, 16 lanes | oracle |" in text
    assert not re.search(r"</?(p|td|th|tr|table|details|span|svg)\b", text)


@pytest.mark.slow
def test_markdown_says_what_the_page_says(folder: Path, tree: ElementTree.Element) -> None:
    """The Markdown has the headings, findings, captions and visible tables of the HTML page."""
    text = " ".join((folder.parent / "docs" / "made-up.md").read_text(encoding="utf-8").split())
    silent = ("Read the figures with care", "Words")
    for heading in texts(tree, "h2"):
        assert heading in silent or f"## {heading}" in text
    viewers = [e for e in tree.iter(HTML + "div") if e.get("class") == "viewer"]
    flipped = {name for viewer in viewers for name in texts(viewer, "figcaption")}
    captions = [text for text in texts(tree, "figcaption") if text not in flipped]
    for words in (*texts(tree, "li"), *captions, *texts(tree, "h3")):
        plain = " ".join(words.replace("\u00a0", " ").split()).replace("<", "&lt;")
        assert plain in text or plain in texts(tree, "h2"), plain
    folded = {c for part in tree.iter(HTML + "details") for c in texts(part, "caption")}
    assert folded and not any(f"**{caption}**" in text for caption in folded)
    assert all(f"**{c}**" in text for c in texts(tree, "caption") if c not in folded)


@pytest.mark.slow
def test_frames_of_one_stage_are_told_apart(tmp_path: Path) -> None:
    """Each renderer of a stage has its own golden image, viewer and difference map."""
    vary = {"renderer": ["wavecomb", "cycles"]}
    rows = runs_of(vary, lambda renderer: 1.0, repetitions=1, lanes=16)
    folder = write_folder(tmp_path / "r", rows, pictures=True)
    html5lib.HTMLParser(strict=True).parse(build(folder).read_text(encoding="utf-8"))
    names = {path.stem for path in (folder / "figures").glob("difference-*.svg")}
    assert names == {"difference-mixed-wavecomb", "difference-mixed-cycles"}


@pytest.mark.slow
def test_pictures_that_must_be_equal_and_are_not(tmp_path: Path) -> None:
    rows = runs_of({"policy": ["none", "material"]}, lambda policy: 1.0, repetitions=2)
    rows[3]["picture_sha256"] = "1" * 64
    text = build(write_folder(tmp_path / "r", rows)).read_text(encoding="utf-8")
    assert "Pictures that must be equal differ, in 1 groups" in text
    assert "mixed, roulette throughput, 16 spp, seed 1: 2 different pictures" in text


EVIL = "<b>|x<i> & 'y' \"z\""
"""Name of a stage and of an experiment with markup of HTML and Markdown."""


@pytest.fixture(scope="module")
def one_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """HTML and Markdown report of one run of each policy, with names that contain markup."""
    folder = tmp_path_factory.mktemp("one_run")
    rows = runs_of({"policy": ["none", "material"]}, lambda policy: 1.0, repetitions=1)
    for row in rows:
        row["stage"] = row["experiment"] = EVIL
    rows.append({**rows[0], "run_id": "x", "status": "failed", "error": "no <memory> left"})
    target = folder / "page.md"
    text = build(write_folder(folder / "r", rows, pictures=True), target).read_text("utf-8")
    return text, target.read_text("utf-8")


@pytest.mark.slow
def test_one_run_makes_a_report(one_run: tuple[str, str]) -> None:
    check_sound(html5lib.HTMLParser(strict=True).parse(one_run[0]))
    assert "Some configurations ran only once" in one_run[0]
    assert "no &lt;memory&gt; left" in one_run[0]


@pytest.mark.slow
def test_text_of_results_cannot_be_markup(one_run: tuple[str, str]) -> None:
    """Names and messages from result files never become HTML or table cells."""
    text, markdown = one_run
    assert "<b>" not in text and "&lt;b&gt;|x&lt;i&gt; &amp;" in text
    assert "<b>" not in markdown
    assert "| &lt;b>\\|x&lt;i> & 'y' \"z\" |" in markdown


def test_parts() -> None:
    assert [number(v) for v in (0.0, 123456.0, 0.5, 1e-9)] == ["0", "123,000", "0.500", "1.00e-09"]
    made = table("Caption", ["a", "b"], [["x", "1"], ["x", "2"], ["y", "3"]])
    assert [(head, len(rows)) for head, rows in made.groups()] == [("x", 2), ("y", 1)]
    assert made.summary == "" and not made.is_word(1)
    assert table("Long", ["a"], [["x"]] * 61).summary == "Long (61 rows)"


def test_warnings(tmp_path: Path) -> None:
    rows = policy_rows(repetitions=2)
    rows[1] |= {"status": "failed", "error": "no light"}

    def of(rows: list, **machine: object) -> list[str]:
        found = load(write_folder(tmp_path / "r", rows))
        return warnings_of(replace(found, machine=machine))

    assert any("ran only once" in line for line in of(rows))
    assert any("1 runs failed" in line and "no light" in line for line in of(rows))
    assert "changed after the commit" in of(rows, dirty=True)[-1]
    noisy = [row | {"noisy": True} for row in rows]
    assert any("71 of 71 runs were disturbed" in line for line in of(noisy))
    assert any("vary" in line for line in of(noisy, noise={"lines": ["equal runs vary"]}))
    rows[0]["picture_sha256"] = "1" * 64
    assert of(rows)[0].startswith("Pictures that must be equal differ, in 1 groups")
    count, different = equality(load(tmp_path / "r").runs)
    assert count > 1 and len(different) == 1
    different_work = {"policy": "material", "threads": 3, "lanes": 1, "wave_size": 64}
    work = different_work | {"ray_order": "direction", "shadow_order": "direction"}
    first = rows[2] | {"picture_sha256": "2" * 64}
    pair = [first, first | work | {"run_id": "other", "picture_sha256": "3" * 64}]
    count, different = equality(load(write_folder(tmp_path / "r", pair)).runs)
    assert (count, len(different)) == (1, 1)
    for name, value in (("max_depth", 1), ("roulette", "off"), ("spp", 2), ("seed", 9)):
        pair = [first, first | {name: value, "run_id": "other", "picture_sha256": "3" * 64}]
        assert equality(load(write_folder(tmp_path / "r", pair)).runs) == (0, []), name
    rows = [row | {"time_limit": 5.0} for row in rows]
    assert equality(load(write_folder(tmp_path / "r", rows)).runs) == (0, [])


def test_nothing_heavy_is_imported_for_a_render() -> None:
    code = (
        "import sys, wavecomb.cli, wavecomb.image.compare.comparison, wavecomb.bench; "
        "print([m for m in ('pandas', 'matplotlib', 'scipy', 'jinja2') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
