# SPDX-License-Identifier: Apache-2.0
"""Tests cropped images, and images that are rendered and written in bands of rows."""

from __future__ import annotations

import contextlib
import json
import signal
import sys
import time
from pathlib import Path

import forks
import numpy as np
import pytest

import wavecomb
from wavecomb.image.files.image import read_layers
from wavecomb.scenes import write_scene

SIZE = (150, 200)
WORDS = ("--size", "150", "200", "--spp", "4")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bands") / "cornell.usda"
    write_scene("cornell", path)
    return path


@pytest.fixture(scope="module")
def whole(stage: Path) -> Path:
    """The image rendered in one piece."""
    file = stage.with_name("whole.exr")
    done = forks.wavecomb(
        "render", str(stage), "-o", str(file), "--png", str(file.with_suffix(".png")),
        "--stats", str(file.with_suffix(".json")), *WORDS, "--film-memory", "100",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return file


def same(a: Path, b: Path) -> bool:
    """Returns whether all layers are equal bit for bit."""
    left, right = read_layers(a), read_layers(b)
    return left.keys() == right.keys() and all(
        np.array_equal(left[name], right[name]) for name in left
    )


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--exr-tile", "32"),
        ("--half", "--compression", "piz"),
        ("--aov", "position", "--aov", "light_groups"),
    ],
    ids=["scanlines", "tiles", "half", "layers"],
)
def test_bands_are_the_whole_picture(stage: Path, tmp_path: Path, words: tuple[str, ...]) -> None:
    files = []
    for name, memory in (("whole", "100"), ("bands", "1")):
        files.append(tmp_path / f"{name}.exr")
        done = forks.wavecomb(
            "render", str(stage), "-o", str(files[-1]), *WORDS, "--film-memory", memory, *words
        )
        assert done.returncode == 0, done.stderr
    assert same(*files)


@pytest.mark.slow
def test_files_beside_it(stage: Path, whole: Path, tmp_path: Path) -> None:
    """A render in bands has the PNG, AOV files and statistics of a render in one piece."""
    file, png, stats = (tmp_path / name for name in ("a.exr", "a.png", "a.json"))
    done = forks.wavecomb(
        "render", str(stage), "-o", str(file), "--png", str(png), "--stats", str(stats), *WORDS,
        "--film-memory", "1", "--split-aovs",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert png.read_bytes() == whole.with_suffix(".png").read_bytes()
    parts = {k: v for f in tmp_path.glob("*.exr") for k, v in read_layers(f).items()}
    assert parts.keys() == read_layers(whole).keys()
    assert all(np.array_equal(parts[k], v) for k, v in read_layers(whole).items())
    ours, theirs = (json.loads(f.read_text()) for f in (stats, whole.with_suffix(".json")))
    assert ours["bands"] == 4  # 64 rows each
    assert "bands" not in theirs
    for name in ("samples", "rays", "shadow_rays", "records"):
        assert ours["counts"][name] == theirs["counts"][name]
    assert ours["depths"] == theirs["depths"]
    assert ours["settings"] == theirs["settings"]
    assert ours["programs"]["diffuse"]["records"] == theirs["programs"]["diffuse"]["records"]
    assert ours["memory_bytes"]["film"] < theirs["memory_bytes"]["film"]


@pytest.mark.slow
def test_a_cropped_picture_says_where_it_lies(stage: Path, whole: Path, tmp_path: Path) -> None:
    import OpenImageIO as oiio

    crop = ("--region", "30", "20", "110", "180", "--crop")
    for memory in ("100", "0.5"):
        file = tmp_path / f"{memory}.exr"
        done = forks.wavecomb(
            "render", str(stage), "-o", str(file), *WORDS, "--film-memory", memory, *crop
        )
        assert done.returncode == 0, done.stderr
        spec = oiio.ImageBuf(str(file)).spec()
        assert (spec.x, spec.y, spec.width, spec.height) == (30, 20, 80, 160)
        assert (spec.full_x, spec.full_y, spec.full_width, spec.full_height) == (0, 0, *SIZE)
        for name, layer in read_layers(whole).items():
            assert np.array_equal(read_layers(file)[name], layer[20:180, 30:110])


@pytest.mark.slow
def test_a_cropped_picture_in_memory(stage: Path) -> None:
    """Cropped renders in memory, including adaptive ones, equal that part of a full-size image."""
    region = (30, 20, 110, 180)
    for more in ({}, {"noise": 0.2, "spp": 64}):
        options = {"size": SIZE, "spp": 4, "region": region, **more}
        picture = wavecomb.render(stage, crop=True, **options)
        full = wavecomb.render(stage, **options)
        assert picture.beauty.shape == (160, 80, 3)
        assert np.array_equal(picture.beauty, full.beauty[20:180, 30:110])
        assert np.array_equal(picture.samples, full.samples[20:180, 30:110])
        assert picture.stats["memory_bytes"]["film"] < full.stats["memory_bytes"]["film"]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--noise", "0.1", "--spp", "64"), "--noise"),
        (("--time-limit", "5"), "--time-limit"),
        (("--checkpoint", "a.ckpt"), "--checkpoint"),
        (("--preview", "a.png"), "--preview"),
        (("--aov", "crypto"), "Cryptomatte"),
        (("--region", "0", "0", "100", "100"), "--region without --crop"),
    ],
)
def test_what_needs_the_whole_picture(
    stage: Path, tmp_path: Path, words: tuple[str, ...], named: str
) -> None:
    words = tuple(str(tmp_path / word) if word.startswith("a.") else word for word in words)
    done = forks.wavecomb(
        "render", str(stage), "-o", str(tmp_path / "a.exr"), *WORDS, "--film-memory", "1", *words
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and named in done.stderr and "--film-memory" in done.stderr
    assert not list(tmp_path.iterdir())


def test_sequences_in_bands(stage: Path, whole: Path, tmp_path: Path) -> None:
    names = str(tmp_path / "a.##.exr")
    done = forks.wavecomb(
        "render", str(stage), "-o", names, "--frames", "1-2", *WORDS, "--film-memory", "1"
    )
    assert done.returncode == 0, done.stderr
    assert same(tmp_path / "a.01.exr", whole) and same(tmp_path / "a.02.exr", whole)


def grows(folder: Path) -> bool:
    """Returns whether the command has written a first band to its temporary folder."""
    with contextlib.suppress(FileNotFoundError):
        return any(one.suffix == ".exr" and one.stat().st_size for one in folder.rglob("*"))
    return False


@pytest.mark.slow
@pytest.mark.parametrize("frames", [False, True])
def test_a_stopped_picture(stage: Path, tmp_path: Path, frames: bool) -> None:
    """A stopped single image gets empty rows; a stopped sequence frame is not written."""
    file = tmp_path / ("a.1.exr" if frames else "a.exr")
    name = str(tmp_path / "a.#.exr") if frames else str(file)
    words = ["--frames", "1-2"] if frames else []
    process = forks.Popen(
        [
            *(sys.executable, "-m", "wavecomb", "render", str(stage), "-o", name, "--quiet"),
            *("--size", "256", "1024", "--spp", "500", "--film-memory", "1", *words),
        ],
    )
    end = time.monotonic() + 60
    while not grows(tmp_path) and process.poll() is None:
        assert time.monotonic() < end
        time.sleep(0.02)
    # Interrupt the render after the first band is written; the remaining bands take ten times as
    # long.
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 130
    if frames:
        assert not list(tmp_path.iterdir())
        return
    samples = read_layers(file)["samples"]
    assert samples.shape[:2] == (1024, 256)
    assert samples[:64].max() > 0 and (samples[-64:] == 0).all()
