# SPDX-License-Identifier: Apache-2.0
"""What is read of a results folder, and the suites that can be chosen: no window."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from bench_results import policy_rows, write_folder

from wavecomb.bench.report_facts import equality, machine_parts, warnings_of
from wavecomb.bench.report_parts import Figure, Markup, Report, Section, Viewer, read_report
from wavecomb.errors import WavecombError
from wavecomb.gui.bench.folder import read_folder
from wavecomb.gui.bench.page import page_html, section_html
from wavecomb.gui.bench.suites import Choice, suite_info, suite_infos
from wavecomb.picture.image import read_codes

REPORT = Report(
    "Made up",
    '<p class="facts">One machine</p>',
    ["Take care."],
    [
        Section(
            "verdicts",
            "Verdicts",
            [
                Markup('<table><tr><th>policy</th><td class="better">faster</td></tr></table>'),
                Figure("orders", "Orders", "Times < 1", "<svg/>"),
                Figure("costs", "Costs", "Predicted"),
            ],
        ),
        Section("pictures", "Pictures", [Viewer("<div>flip</div>"), Markup("<p>All equal.</p>")]),
        Section("empty", "Empty"),
    ],
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rows = policy_rows(repetitions=2)
    rows[1] |= {"status": "failed", "error": "no light"}
    made = write_folder(tmp_path_factory.mktemp("made") / "results", rows, pictures=True)
    (made / "figures").mkdir()
    (made / "figures" / "orders.png").write_bytes(b"")
    REPORT.write(made)
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
    assert found.report is not None and found.report.figures() == REPORT.figures()
    assert [page.name for page in found.pages] == ["suite.toml"], "the report has its own place"
    pairs = [shot for shot in found.shots if shot.golden is not None]
    assert pairs and all(shot.path.parent.name == "images" for shot in pairs)
    assert any(shot.golden is None and shot.name.startswith("golden") for shot in found.shots)
    machine = json.loads((folder / "machine.json").read_text())
    assert found.machine == "".join(machine_parts(machine)) and "0.1.0" in found.machine
    assert list(found.warnings) == warnings_of(machine, found.runs)
    assert any("vary by 12%" in line for line in found.warnings)
    assert any("1 runs failed" in line and "no light" in line for line in found.warnings)
    assert read_folder(folder / "runs.csv").path == folder


def test_a_report_comes_back_as_it_was_kept(folder: Path) -> None:
    again = read_report(folder)
    assert again is not None
    assert (again.title, again.lead, again.warnings) == (REPORT.title, REPORT.lead, ["Take care."])
    assert [section.title for section in again.sections] == ["Verdicts", "Pictures"]
    assert again.sections[0].parts == REPORT.sections[0].parts
    assert again.sections[1].parts == [Markup("<p>All equal.</p>")], "viewers are for browsers"


def test_a_section_in_a_text_view(folder: Path) -> None:
    (verdicts, _) = REPORT.sections
    text = section_html(verdicts, folder)
    assert "<h2>Verdicts</h2>" in text and "<b>faster</b>" not in text and "faster" in text
    assert '<img src="figures/orders.png">' in text and "Times &lt; 1" in text
    assert "costs.png" not in text and "Costs" in text, "a file that is missing leaves its words"


@pytest.mark.parametrize(
    ("text", "words"),
    [("{", "cannot be read"), ('{"schema": "other"}', "schema"), ("[]", "cannot be read")],
)
def test_a_report_that_is_damaged_leaves_the_runs(tmp_path: Path, text: str, words: str) -> None:
    made = write_folder(tmp_path / "results", policy_rows(repetitions=1))
    (made / "report.json").write_text(text)
    found = read_folder(made)
    assert found.report is None and len(found.runs) > 0
    assert words in found.warnings[-1] and "bench report" in found.warnings[-1]


def test_no_figure_is_outside_of_its_folder(tmp_path: Path) -> None:
    made = write_folder(tmp_path / "results", policy_rows(repetitions=1))
    Report("T", "", [], [Section("a", "A", [Figure("../../secret", "S", "C")])]).write(made)
    with pytest.raises(WavecombError, match="a figure is called"):
        read_report(made)


def test_warnings_before_anything_is_analysed() -> None:
    rows = policy_rows(repetitions=2)
    assert any("ran only 2 times" in line for line in warnings_of({}, rows))
    assert warnings_of({}, []) == ["No run has come to an end yet."]
    assert "changed after the commit" in warnings_of({"dirty": True}, rows)[-1]
    count, different = equality(rows)
    assert count > 0 and different == []
    rows[0]["picture_sha256"] = "1" * 64
    assert warnings_of({}, rows)[0].startswith("Pictures that must be equal differ, in 1 groups")
    rows[0]["status"] = "failed"
    rows[0]["error"] = "no light"
    assert equality(rows)[1] == []
    noisy = warnings_of({}, [row | {"noisy": True} for row in rows])
    assert any("were disturbed by other work" in line for line in noisy)


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


def test_pictures_as_a_screen_shows_them(tmp_path: Path) -> None:
    import OpenImageIO as oiio

    codes = np.array([[[10, 20, 30, 255], [200, 100, 0, 0]]], np.uint8)
    for channels, wanted in ((4, [[10, 20, 30], [255, 255, 255]]), (1, [[10] * 3, [200] * 3])):
        path = str(tmp_path / f"{channels}.png")
        out = oiio.ImageOutput.create(path)
        assert out.open(path, oiio.ImageSpec(2, 1, channels, "uint8"))
        assert out.write_image(np.ascontiguousarray(codes[:, :, :channels]))
        out.close()
        assert read_codes(path).tolist() == [wanted]
    with pytest.raises(OSError, match="no such file"):
        read_codes(tmp_path / "none.png")
