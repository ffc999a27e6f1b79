# SPDX-License-Identifier: Apache-2.0
"""What is read of a results folder, and the suites that can be chosen: no window."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from bench_results import policy_rows, write_folder

from wavecomb.errors import WavecombError
from wavecomb.gui.bench.folder import read_folder
from wavecomb.gui.bench.page import page_html
from wavecomb.gui.bench.suites import Choice, suite_info, suite_infos


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rows = policy_rows(repetitions=2)
    rows[1] |= {"status": "failed", "error": "no light"}
    made = write_folder(tmp_path_factory.mktemp("made") / "results", rows, pictures=True)
    (made / "figures").mkdir()
    for name in ("orders.png", "orders.svg", "costs.svg", "notes.txt"):
        (made / "figures" / name).write_bytes(b"")
    (made / "report.html").write_text(
        '<html><head><style>p {}</style></head><body><a class="skip" href="#x">Skip</a>'
        '<h1>A &amp; B</h1><figure id="figure-orders"><svg><svg></svg><text>in SVG</text></svg>'
        "<figcaption>Caption</figcaption></figure><script>bad()</script>"
        '<img src="data:image/png;base64,AA" alt="a noisy picture"><a href="#y">To y</a></body>'
    )
    return made


def test_everything_in_a_folder(folder: Path) -> None:
    found = read_folder(folder)
    assert (found.name, found.title) == ("made-up", "Times that were made up")
    assert len(found.runs) == 2 * 2 * 9 * 2
    names = [column.name for column in found.columns]
    assert names[:3] == ["run_id", "status", "experiment"] and "cycles" not in names
    assert [(f.name, f.png is not None, f.svg is not None) for f in found.figures] == [
        ("costs", False, True),
        ("orders", True, True),
    ]
    assert [page.name for page in found.pages] == ["report.html", "suite.toml"]
    pairs = [shot for shot in found.shots if shot.golden is not None]
    assert pairs and all(shot.path.parent.name == "images" for shot in pairs)
    assert any(shot.golden is None and shot.name.startswith("golden") for shot in found.shots)
    facts = dict(found.facts)
    assert facts["Memory"] == "8.0 GiB" and "wavecomb 0.1.0" in facts["Versions"]
    assert any("vary by 12%" in line for line in found.warnings)
    assert any("1 runs failed" in line and "no light" in line for line in found.warnings)
    assert read_folder(folder / "runs.csv").path == folder


def test_folders_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(WavecombError, match="no such folder"):
        read_folder(tmp_path / "x")
    with pytest.raises(WavecombError, match=r"no runs\.csv"):
        read_folder(tmp_path)
    (tmp_path / "runs.csv").write_text("run_id,spp\na,many\n")
    with pytest.raises(WavecombError, match=r"runs\.csv: cannot be read"):
        read_folder(tmp_path)


def test_pages_without_what_a_text_view_cannot_show(folder: Path) -> None:
    text = page_html(folder / "report.html")
    assert '<img src="figures/orders.png">' in text and "A &amp; B" in text and "Caption" in text
    assert "<i>a noisy picture</i>" in text and '<a href="#y">' in text
    for gone in ("in SVG", "bad()", "p {}", "Skip"):
        assert gone not in text


def test_suites_and_the_command(tmp_path: Path) -> None:
    infos = suite_infos()
    by_name = {info.name: info for info in infos}
    assert infos[0].name == "quick" and by_name["paper"].repetitions == 3
    quick = by_name["quick"]
    assert quick.stages == ("mixed", "dragon") and sum(n for _, n in quick.experiments) == 32
    one = suite_info("quick", ("dragon",))
    assert 0 < one.configurations < 32 and one.seconds < quick.seconds
    with pytest.raises(WavecombError, match="no such stage"):
        suite_info("quick", ("x",))
    choice = Choice("quick", tmp_path, ("dragon",), tmp_path / "more", 3)
    words = choice.arguments()
    assert words[:5] == ["bench", "run", "quick", "-o", str(tmp_path)]
    assert words[5:9] == ["--stage", "dragon", "--stages", str(tmp_path / "more")]
    assert "--resume" not in words and words[-2:] == ["--progress", "json"]
    (tmp_path / "runs.csv").touch()
    assert "--resume" in choice.arguments(dry=True)
