# SPDX-License-Identifier: Apache-2.0
"""Tests contact sheets, pages of sequences, wipes, and comparisons of folders."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

import forks
import numpy as np
import pytest
from click.testing import CliRunner, Result

from wavecomb.cli import main
from wavecomb.image.compare.folders import collect, images_of, pair_up
from wavecomb.image.files.image import display, read_codes, write_exr, write_png
from wavecomb.image.thumbnails import DisplayOptions, contact_sheet, fit_image, wipe
from wavecomb.run.frame_names import matching

RED, GREEN, BLUE = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


def flat(colour: Any, width: int = 48, height: int = 27) -> np.ndarray:
    return np.broadcast_to(np.array(colour, np.float32), (height, width, 3)).copy()


def run(*arguments: Any) -> Result:
    result = CliRunner().invoke(main, [str(one) for one in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def failed(*arguments: Any) -> str:
    result = run(*arguments)
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("error: ") and len(result.stderr.splitlines()) == 1
    return result.stderr


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    """Frames 8 to 11 in different colours."""
    folder = tmp_path / "out"
    folder.mkdir()
    for frame, colour in zip(range(8, 12), (RED, GREEN, BLUE, RED), strict=True):
        layers = {"beauty": flat(colour), "depth": np.full((27, 48), frame, np.float32)}
        write_exr(folder / f"shot.{frame:04d}.exr", layers)
    return folder


# ---- which pictures ------------------------------------------------------------------------------


def test_frames_that_are_there(tmp_path: Path) -> None:
    for name in ("a.0002.exr", "a.0010.exr", "a.-003.exr", "a.1.5.exr", "a.x.exr", "b.0001.exr",
                 "a.2.exr"):  # fmt: skip
        (tmp_path / name).touch()
    found = matching(str(tmp_path / "a.####.exr"))
    assert list(found) == [-3.0, 1.5, 2.0, 10.0]
    assert found[2.0].endswith("a.0002.exr")
    assert list(matching(str(tmp_path / "b%04d.exr"))) == []
    assert list(matching(str(tmp_path / "b.<frame>.exr"))) == [1.0]


def test_pictures_of_folders_and_files(frames: Path, tmp_path: Path) -> None:
    (frames / ".hidden.exr").touch()
    (frames / "notes.txt").touch()
    assert list(images_of(str(frames))) == [f"shot.{k:04d}.exr" for k in (8, 9, 10, 11)]
    assert list(images_of(str(frames / "shot.####.exr"))) == ["8", "9", "10", "11"]
    one = str(frames / "shot.0009.exr")
    assert list(collect([one])) == [one]
    assert "no such file" in failed("sheet", tmp_path / "no.exr", "-o", tmp_path / "a.png")
    assert "there is no such file" in failed(
        "sheet", frames / "other.####.exr", "-o", tmp_path / "a.png"
    )
    (tmp_path / "empty").mkdir()
    assert "no image in it" in failed("sheet", tmp_path / "empty", "-o", tmp_path / "a.png")


# ---- sheets and pages ----------------------------------------------------------------------------


def test_contact_sheet_has_each_picture_in_its_place(frames: Path, tmp_path: Path) -> None:
    out = tmp_path / "sheet.png"
    result = run("sheet", frames / "shot.####.exr", "-o", out, "--columns", 3, "--width", 48)
    assert result.exit_code == 0 and "4 images" in result.stdout, result.output
    sheet = read_codes(out)
    assert sheet.shape == (2 * (27 + 20 + 12) + 12, 3 * 60 + 12, 3)
    for k, colour in enumerate((RED, GREEN, BLUE, RED)):
        x, y = 12 + k % 3 * 60, 12 + k // 3 * 59
        assert (sheet[y : y + 27, x : x + 48] == np.array(colour) * 255).all()
        assert sheet[y + 28 : y + 44, x : x + 48].max() > 150  # the file name
    assert (sheet[59 + 12 : 59 + 39, 60 + 12 :] == 24).all()


def test_sheet_is_as_the_layer_is_shown(frames: Path) -> None:
    files = {"a": str(frames / "shot.0008.exr")}
    plain = contact_sheet(files, DisplayOptions(), width=48)
    dark = contact_sheet(files, DisplayOptions(exposure=-1.0), width=48)
    assert plain[20, 20].tolist() == [255, 0, 0] and dark[20, 20].tolist() == [188, 0, 0]
    depth = contact_sheet(files, DisplayOptions("depth"), width=48)
    assert len(set(depth[20, 20].tolist())) > 1  # false colours
    with pytest.raises(Exception, match="has no layer normal; there are beauty, depth"):
        contact_sheet(files, DisplayOptions("normal"), width=48)


def test_pictures_are_made_smaller_in_linear_light() -> None:
    stripes = np.zeros((40, 80, 3), np.uint8)
    stripes[:, ::2] = 255
    small = fit_image(stripes, 20, 100)
    assert small.shape == (10, 20, 3)
    assert abs(int(small[5, 10, 0]) - 188) <= 2
    assert fit_image(stripes, 100, 100) is stripes


def test_page_holds_all_pictures_and_fetches_nothing(frames: Path, tmp_path: Path) -> None:
    html5lib = pytest.importorskip("html5lib")
    out = tmp_path / "shot.html"
    result = run("sheet", frames / "shot.####.exr", "-o", out, "--fps", 12.5, "--lossless",
                 "--title", "Shot <1>")  # fmt: skip
    assert result.exit_code == 0, result.output
    text = out.read_text()
    html5lib.HTMLParser(strict=True).parse(text)
    assert "Shot &lt;1&gt;" in text and "4 pictures, 48 x 27" in text
    assert "<option selected>12.5</option>" in text and "http://" not in text
    assert "https://" not in text and "default-src 'none'" in text
    sources = re.findall(r'src="data:image/png;base64,([^"]+)"', text)
    assert len(sources) == 4
    picture = tmp_path / "second.png"
    picture.write_bytes(base64.b64decode(sources[1]))
    assert (read_codes(picture) == np.array(GREEN) * 255).all()
    assert run("sheet", frames / "shot.####.exr", "-o", out).exit_code == 0
    assert 'src="data:image/jpeg;base64,' in out.read_text()


def test_sheet_refuses(frames: Path, tmp_path: Path) -> None:
    assert "must end in .png or .html" in failed("sheet", frames, "-o", tmp_path / "a.gif")
    png = frames / "a.png"
    write_png(png, flat(RED))
    assert "is one of the pictures" in failed("sheet", frames, "-o", png)


# ---- wipes and folders ---------------------------------------------------------------------------


def test_wipe_has_a_line() -> None:
    a, b = display(flat(RED, 100, 60)), display(flat(BLUE, 100, 60))
    made = wipe(a, b, 0.3)
    assert (made[40, :29] == (255, 0, 0)).all() and (made[40, 31:] == (0, 0, 255)).all()
    assert (made[40, 29:31] == 255).all()
    assert np.array_equal(wipe(a, b, 1.0)[40], a[40]) and np.array_equal(wipe(a, b, 0.0)[40], b[40])


@pytest.fixture
def others(frames: Path, tmp_path: Path) -> Path:
    """Copies of the frames, but 9 differs, 10 has another size, 11 is missing, and 12 is new."""
    folder = tmp_path / "reference"
    folder.mkdir()
    layers = {"depth": np.full((27, 48), 8, np.float32)}
    write_exr(folder / "shot.0008.exr", {"beauty": flat(RED), **layers})
    changed = flat(GREEN)
    changed[3, 5] += 0.25
    write_exr(folder / "shot.0009.exr", {"beauty": changed})
    write_exr(folder / "shot.0010.exr", {"beauty": flat(BLUE, 40)})
    write_exr(folder / "shot.0012.exr", {"beauty": flat(BLUE)})
    return folder


@pytest.mark.parametrize("pattern", ["", "shot.####.exr"])
def test_folders_and_sequences(frames: Path, others: Path, tmp_path: Path, pattern: str) -> None:
    a, b = frames / pattern, others / pattern
    page = tmp_path / "differences.html"
    result = run("compare", a, b, "--page", page)
    assert result.exit_code == 1, result.output
    name = (lambda k: f"shot.{k:04d}.exr") if not pattern else str
    lines = result.stdout.splitlines()
    assert lines[0] == f"{name(8)}: equal, bit for bit"
    assert lines[1].startswith(f"{name(9)}: different: 0.0772 % of pixels")
    assert "only images of the same size" in lines[2]
    assert lines[3:] == [f"{name(11)}: only in A", f"{name(12)}: only in B",
                         "1 of 3 pairs pass; 2 have no other"]  # fmt: skip
    text = page.read_text()
    assert text.count("<figure>") == 3
    assert "1 of 3 pairs pass, 2 images have no counterpart" in text
    document = json.loads(run("compare", a, b, "--json").stdout)
    assert [one["passed"] for one in document["pairs"]] == [True, False, False]
    assert document["only_a"] == [name(11)] and document["passed"] is False


def test_folders_that_agree(frames: Path, tmp_path: Path) -> None:
    page = tmp_path / "same.html"
    result = run("compare", frames, frames, "--page", page)
    assert result.exit_code == 0 and "4 of 4 pairs pass" in result.stdout
    assert "<figure>" not in page.read_text()
    assert len(pair_up(str(frames), str(frames)).pairs) == 4


def test_folders_within_a_tolerance(frames: Path, others: Path) -> None:
    for name in ("shot.0010.exr", "shot.0012.exr"):
        (others / name).unlink()
    for name in ("shot.0010.exr", "shot.0011.exr"):
        (frames / name).unlink()
    assert run("compare", frames, others).exit_code == 1
    result = run("compare", frames, others, "--tolerance", 0.3)
    assert result.exit_code == 0 and "within the tolerance" in result.stdout


def test_pair_has_a_page_and_a_wipe(frames: Path, tmp_path: Path) -> None:
    html5lib = pytest.importorskip("html5lib")
    a, b = frames / "shot.0008.exr", frames / "shot.0009.exr"
    page, png = tmp_path / "pair.html", tmp_path / "wipe.png"
    result = run("compare", a, b, "--page", page, "--wipe", png, "--at", 0.25)
    assert result.exit_code == 1
    text = page.read_text()
    html5lib.HTMLParser(strict=True).parse(text)
    assert text.count("<figure>") == 3 and "shot.0008.exr and shot.0009.exr" in text
    shown = read_codes(png)
    assert shown[24, 5].tolist() == [255, 0, 0] and shown[24, 40].tolist() == [0, 255, 0]


def test_compare_refuses(frames: Path, others: Path, tmp_path: Path) -> None:
    assert "--heatmap is only for two images" in failed(
        "compare", frames, others, "--heatmap", tmp_path / "h.png"
    )
    one = frames / "shot.0008.exr"
    assert "must end in .html" in failed("compare", one, one, "--page", tmp_path / "a.txt")
    (tmp_path / "elsewhere").mkdir()
    write_png(tmp_path / "elsewhere" / "a.png", flat(RED))
    assert "no images with the same name" in failed("compare", frames, tmp_path / "elsewhere")
    assert "is one image, but" in failed("compare", frames, one)


@pytest.mark.slow
def test_both_work_in_their_sandbox(frames: Path, others: Path, tmp_path: Path) -> None:
    """``sheet`` and ``compare`` run in a sandbox in which only their outputs can be written."""
    page, sheet = tmp_path / "a.html", tmp_path / "b.html"
    done = forks.wavecomb("sheet", frames / "shot.####.exr", "-o", sheet)
    assert (done.returncode, done.stderr) == (0, "")
    done = forks.wavecomb("compare", frames, others, "--page", page)
    assert (done.returncode, done.stderr) == (1, "")
    assert sheet.read_text().count("<li>") == 4 and page.read_text().count("<figure>") == 3
    pair = [frames / f"shot.{k:04d}.exr" for k in (8, 9)]
    done = forks.wavecomb("compare", *pair, "--wipe", tmp_path / "w.png", "--page", page)
    assert (done.returncode, done.stderr) == (1, "")
