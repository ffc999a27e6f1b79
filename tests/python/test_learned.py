# SPDX-License-Identifier: Apache-2.0
"""Tests learned data given to other renders: crops, sequences, farms and invalid files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import wavecomb
from wavecomb.cli import main
from wavecomb.errors import WavecombError
from wavecomb.image.files.image import read_image
from wavecomb.run.guiding_file import load_learned, save_learned
from wavecomb.scenes import write_scene

pytest.importorskip("wavecomb._core")

SIZE = 64
SPP = 32
"""Smallest sample count for which an eighth of the samples suffices to train a guiding field."""


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("learned") / "cornell.usda"
    write_scene("cornell", path)
    return path


@pytest.fixture(scope="module")
def cornell(stage: Path) -> Any:
    return wavecomb.load(stage).scene


@pytest.fixture(scope="module")
def taught(cornell: Any) -> wavecomb.Picture:
    return render(cornell)


def render(scene: Any, **settings: Any) -> wavecomb.Picture:
    return wavecomb.render(scene, **{"size": (SIZE, SIZE), "spp": SPP, "guiding": "on", **settings})


def run(*words: object) -> Any:
    return CliRunner().invoke(main, [str(word) for word in words])


def test_it_guides_as_what_is_learned_anew(
    cornell: Any, taught: wavecomb.Picture, tmp_path: Path
) -> None:
    taught.save_learned(tmp_path / "a.learned")
    again = render(cornell, learn_from=tmp_path / "a.learned")
    assert np.array_equal(again.beauty, taught.beauty)
    assert again.stats["guiding"]["kept"] and not taught.stats["guiding"]["kept"]
    assert again.learned == taught.learned != b""
    plain = render(cornell, guiding="off")
    assert not np.array_equal(again.beauty, plain.beauty) and plain.learned == b""


def test_parts_and_short_renders_are_guided_alike(cornell: Any, taught: wavecomb.Picture) -> None:
    """A render that is given a field does not train, even with too few samples for training."""
    few = render(cornell, spp=2, learn_from=taught)
    assert few.stats["guiding"]["guided_share"] > 0
    assert render(cornell, spp=2).stats["guiding"] is None
    part = render(cornell, spp=2, learn_from=taught, region=(16, 8, 40, 30))
    assert np.array_equal(part.beauty[8:30, 16:40], few.beauty[8:30, 16:40])


def test_one_picture_whatever_the_schedule(cornell: Any, taught: wavecomb.Picture) -> None:
    ways: list[dict[str, Any]] = [
        {}, {"lanes": 1, "threads": 1}, {"wave_size": 64}, {"integrator": "reference"},
    ]  # fmt: skip
    some = [render(cornell, spp=4, seed=3, learn_from=taught, **way).beauty for way in ways]
    assert all(np.array_equal(one, some[0]) for one in some)


def test_another_size_and_camera_have_the_same_mean(cornell: Any, taught: wavecomb.Picture) -> None:
    given = render(cornell, size=(32, 32), spp=256, learn_from=taught, max_depth=4).beauty
    alone = render(cornell, size=(32, 32), spp=256, guiding="off", max_depth=4).beauty
    assert given.mean() == pytest.approx(alone.mean(), rel=0.01)


@pytest.mark.slow
def test_what_is_no_good_ends_in_a_line(
    stage: Path, cornell: Any, taught: wavecomb.Picture, tmp_path: Path
) -> None:
    with pytest.raises(WavecombError, match="learn_from: this render trains no guiding field"):
        render(cornell, guiding="off", learn_from=taught)
    with pytest.raises(WavecombError, match="nothing was learned"):
        render(cornell, guiding="off").save_learned(tmp_path / "none.learned")
    write_scene("spread", tmp_path / "other.usdc", triangles=10000, texture_mb=0.0)
    other = wavecomb.load(tmp_path / "other.usdc").scene
    with pytest.raises(wavecomb._core.Error, match="the saved guiding field does not fit"):
        render(other, spp=1, learn_from=taught)
    file = tmp_path / "a.learned"
    save_learned(file, taught.learned)
    whole = file.read_bytes()
    for broken in (b"", whole[: len(whole) // 2], whole[:-200] + b"x" * 200):
        file.write_bytes(broken)
        with pytest.raises(WavecombError, match="holds no guiding field, or is damaged"):
            load_learned(file)
    out = tmp_path / "a.exr"
    done = run("render", stage, "-o", out, "--guiding", "on", "--learn-from", tmp_path / "gone")
    assert done.exit_code == 2 and "no such file" in done.output and not out.exists()
    done = run("render", stage, "-o", out, "--guiding", "on", "--learn-from", "before")
    assert done.exit_code == 2 and "also give --frames" in done.output
    done = run(
        "render", stage, "-o", out, "--quality", "plain", "--learn-to", tmp_path / "b.learned"
    )
    assert done.exit_code == 2 and "this render trains no guiding field" in done.output


@pytest.mark.slow
def test_a_command_keeps_it_and_another_starts_from_it(stage: Path, tmp_path: Path) -> None:
    size = ("--size", SIZE, SIZE, "--guiding", "on")
    kept = tmp_path / "a.learned"
    done = run("render", stage, "-o", tmp_path / "a.exr", "--spp", SPP, *size, "--learn-to", kept)
    assert done.exit_code == 0, done.output
    words = ("--spp", 2, *size, "--learn-from", kept)
    done = run("render", stage, "-o", tmp_path / "b.exr", "--verbose", *words)
    assert done.exit_code == 0 and "before" in done.output, done.output
    folder = tmp_path / "job"
    done = run(
        "farm", "submit", stage, "-o", tmp_path / "c.exr", *words, "--tiles", "2x2",
        "--job", folder, "--on", "local:1",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    whole, tiled = (read_image(tmp_path / f"{name}.exr") for name in "bc")
    assert np.array_equal(whole, tiled)


def test_frames_start_from_the_frame_before(stage: Path, tmp_path: Path) -> None:
    done = run(
        "render", stage, "-o", tmp_path / "f.##.exr", "--stats", tmp_path / "f.##.json",
        "--frames", "1-3", "--spp", SPP, "--size", SIZE, SIZE, "--guiding", "on",
        "--learn-from", "before", "--learn-to", tmp_path / "last.learned",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    kept = [
        json.loads((tmp_path / f"f.{frame:02}.json").read_text())["guiding"]["kept"]
        for frame in (1, 2, 3)
    ]
    assert kept == [False, True, True]
    assert load_learned(tmp_path / "last.learned")
