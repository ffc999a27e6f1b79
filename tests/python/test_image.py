# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from wavecomb.image.files import image
from wavecomb.image.files.output_file import check_writable, remove_abandoned, replacing


@pytest.fixture
def layers() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    depth = rng.random((5, 7), np.float32) * 1e5
    depth[0, 0] = np.inf
    return {
        "beauty": rng.random((5, 7, 3), np.float32) * 1e5,
        "albedo": rng.random((5, 7, 3), np.float32),
        "normal": rng.random((5, 7, 3), np.float32) * 2 - 1,
        "depth": depth,
        "samples": np.full((5, 7), 70001, np.uint32),
    }


def test_exr_float_is_exact(tmp_path: Path, layers: dict[str, np.ndarray]) -> None:
    layers["beauty"][0, 0] = [np.nan, np.inf, -0.0]
    image.write_exr(tmp_path / "a.exr", layers)
    back = image.read_layers(tmp_path / "a.exr")
    assert list(back) == list(layers)
    for name, pixels in layers.items():
        want = pixels.astype(np.float32)
        assert back[name].reshape(want.shape).tobytes() == want.tobytes()


@pytest.mark.parametrize("ending", ["exr", "png"])
def test_writing_holds_no_copy(tmp_path: Path, ending: str) -> None:
    beauty = np.full((2048, 256, 3), 0.5, np.float32)
    layers = {"beauty": beauty, "normal": beauty, "depth": beauty[:, :, 0]}
    # Write a first image to import modules and make all allocations that happen only once.
    image.write_exr(tmp_path / "first.exr", layers)
    tracemalloc.start()
    try:
        if ending == "exr":
            image.write_exr(tmp_path / "a.exr", layers, half=True)
        else:
            image.write_png(tmp_path / "a.png", beauty, tone_map="neutral")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 0.5 * beauty.nbytes


def test_bands_meet(tmp_path: Path) -> None:
    rows = np.arange(150, dtype=np.float32)[:, None, None] * np.ones((1, 3, 3), np.float32)
    image.write_exr(tmp_path / "a.exr", {"beauty": rows})
    assert np.array_equal(image.read_image(tmp_path / "a.exr"), rows)
    image.write_png(tmp_path / "a.png", rows / 150.0)
    pixels = oiio.ImageBuf(str(tmp_path / "a.png")).get_pixels(oiio.UINT8)
    assert np.array_equal(pixels, image.display(rows / 150.0))


def test_exr_channel_names(tmp_path: Path, layers: dict[str, np.ndarray]) -> None:
    image.write_exr(tmp_path / "a.exr", layers, metadata={"wavecomb:stage": "s.usd", "n": 3})
    source = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    spec = source.spec()
    assert sorted(spec.channelnames) == sorted(
        [
            "R",
            "G",
            "B",
            "albedo.R",
            "albedo.G",
            "albedo.B",
            "normal.X",
            "normal.Y",
            "normal.Z",
            "depth.Z",
            "samples",
        ]
    )
    metadata = image.read_metadata(tmp_path / "a.exr")
    assert metadata["compression"] == "zip"
    assert metadata["Software"] == "Wavecomb"
    assert metadata["wavecomb:stage"] == "s.usd"


def test_exr_half(tmp_path: Path, layers: dict[str, np.ndarray]) -> None:
    image.write_exr(tmp_path / "a.exr", layers, half=True)
    back = image.read_layers(tmp_path / "a.exr")
    assert np.isfinite(back["beauty"]).all()
    assert back["beauty"].max() == 65504
    assert np.abs(back["normal"] - layers["normal"]).max() < 1e-3
    assert back["depth"][:, :, 0].tobytes() == layers["depth"].tobytes()
    assert (back["samples"] == 70001).all()


def test_read_image_is_linear(tmp_path: Path) -> None:
    linear = np.linspace(0, 1, 64, dtype=np.float32).reshape(8, 8, 1).repeat(3, axis=2)
    image.write_png(tmp_path / "a.png", linear)
    assert np.abs(image.read_image(tmp_path / "a.png") - linear).max() < 0.005
    image.write_exr(tmp_path / "a.exr", {"beauty": linear})
    assert image.read_image(tmp_path / "a.exr").tobytes() == linear.tobytes()


def test_png_with_alpha_is_read_as_stored(tmp_path: Path) -> None:
    spec = oiio.ImageSpec(1, 1, 4, "uint8")
    spec.attribute("oiio:UnassociatedAlpha", 1)
    output = oiio.ImageOutput.create(str(tmp_path / "a.png"))
    output.open(str(tmp_path / "a.png"), spec)
    output.write_image(np.array([[[255, 128, 0, 128]]], np.uint8))
    output.close()
    pixel = image.read_image(tmp_path / "a.png")[0, 0]
    assert pixel == pytest.approx([1.0, 0.2159, 0.0, 128 / 255], abs=1e-3)


def test_display_values() -> None:
    pixels = np.array([[[0, 0.18, 1], [2, -1, 0.0031308], [np.inf, -np.inf, 0.5]]], np.float32)
    assert image.display(pixels).tolist() == [[[0, 118, 255], [255, 0, 10], [255, 0, 188]]]
    assert image.display(pixels, exposure=1)[0, 0, 1] == 162


def test_display_shows_nan() -> None:
    assert image.display(np.full((1, 1, 3), np.nan, np.float32)).tolist() == [[[255, 0, 255]]]


def test_codes_equal_the_rounded_transfer_function():
    bits = np.arange(0x30000000, 0x3F800001, 37, dtype=np.uint32)
    values = np.concatenate([[0.0, 1.0], bits.view(np.float32)]).astype(np.float32)
    expected = np.floor(image.srgb_from_linear(values) * 255.0 + 0.5).astype(np.uint8)
    assert np.array_equal(image.srgb_codes(values), expected)
    others = np.array([-0.0, -2.0, 2.0, np.inf, np.nan], np.float32)
    assert image.srgb_codes(others).tolist() == [0, 0, 255, 255, 0]
    bright = np.full((1, 2, 3), 3e38, np.float32)  # The sum of the values overflows.
    assert image.display(bright).min() == 255


def test_neutral_tone_map() -> None:
    grey = np.linspace(0, 50, 4001, dtype=np.float32).reshape(1, -1, 1).repeat(3, axis=2)
    mapped = image.display(grey, tone_map="neutral")[0, :, 0].astype(int)
    assert (np.diff(mapped) >= 0).all()
    assert mapped[-1] == 255
    plain = image.display(grey[:, :50], tone_map="clamp")[0, :, 0].astype(int)
    assert np.abs(mapped[20:50] - plain[20:50]).max() <= 15
    red = image.display(np.array([[[20.0, 0.1, 0.1]]], np.float32), tone_map="neutral")[0, 0]
    assert red[0] > red[1] > 100


def test_unknown_tone_map() -> None:
    with pytest.raises(ValueError, match="none of clamp, neutral"):
        image.display(np.zeros((1, 1, 3)), tone_map="x")  # type: ignore[arg-type]


def test_errors_name_the_file(tmp_path: Path) -> None:
    picture = {"beauty": np.zeros((2, 2, 3), np.float32)}
    with pytest.raises(ValueError, match=r"a\.png.*\.exr"):
        image.write_exr("a.png", picture)
    with pytest.raises(ValueError, match=r"a\.exr.*\.png"):
        image.write_png("a.exr", picture["beauty"])
    with pytest.raises(ValueError, match="depth"):
        image.write_exr(tmp_path / "a.exr", {**picture, "depth": np.zeros((3, 2))})
    with pytest.raises(OSError, match=r"no\.exr: no such file"):
        image.read_image("no.exr")
    with pytest.raises(OSError, match="is a folder"):
        image.read_image(tmp_path)
    bad = tmp_path / "bad.exr"
    bad.write_bytes(b"\x76\x2f\x31\x01 nonsense")
    with pytest.raises(OSError, match=r"bad\.exr: "):
        image.read_image(bad)


def test_damaged_file(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    noise = np.random.default_rng(0).random((64, 64, 3), np.float32)
    image.write_exr(path, {"beauty": noise})
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(OSError, match=r"a\.exr: "):
        image.read_image(path)


def test_replacing_is_all_or_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError), replacing(path) as part:
        part.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    with replacing(path) as part:
        part.write_text("new")
    assert path.read_text() == "new"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_links_are_followed(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link.txt").symlink_to(tmp_path / "real" / "a.txt")
    with replacing(tmp_path / "link.txt") as part:
        part.write_text("new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real" / "a.txt").read_text() == "new"


def test_an_abandoned_folder_is_removed(tmp_path: Path) -> None:
    """The temporary folder of a killed process is not locked and can therefore be removed."""
    code = (
        "import os, sys; from pathlib import Path\n"
        "from wavecomb.image.files.output_file import replacing\n"
        "with replacing(sys.argv[1]) as part:\n"
        "    part.write_text('cut off'); os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "b.txt")], check=False)
    (left,) = os.listdir(tmp_path)
    assert left.startswith(".wavecomb-") and left.endswith(".part")
    with replacing(tmp_path / "a.txt") as part:
        part.write_text("new")
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_folder_in_use_stays(tmp_path: Path) -> None:
    """A locked folder is kept even if its owner's id is unknown, as from another container."""
    with replacing(tmp_path / "a.txt") as part:
        part.write_text("first")
        with replacing(tmp_path / "b.txt") as other:
            other.write_text("second")
        remove_abandoned(tmp_path)
        assert part.read_text() == "first"
    assert sorted(os.listdir(tmp_path)) == ["a.txt", "b.txt"]


def test_a_folder_that_is_not_locked_yet_stays_for_a_minute(tmp_path: Path) -> None:
    folder = tmp_path / ".wavecomb-00.part"
    folder.mkdir()
    remove_abandoned(tmp_path)
    assert folder.is_dir()
    old = time.time() - 120
    os.utime(folder, (old, old))
    remove_abandoned(tmp_path)
    assert not folder.exists()


@pytest.mark.parametrize("stem", ["n" * 251, "\u9375" * 80])
def test_temporary_names_of_long_names(tmp_path: Path, stem: str) -> None:
    path = tmp_path / f"{stem}.exr"
    check_writable(path)
    with replacing(path) as part, replacing(path.with_name(f"{stem[:-1]}x.exr")) as other:
        assert part != other
        part.write_text("a")
        other.write_text("b")
    assert path.read_text() == "a"


def test_check_writable_leaves_nothing(tmp_path: Path) -> None:
    check_writable(tmp_path / "a.exr")
    assert os.listdir(tmp_path) == []
    check_writable(tmp_path / "new" / "a.exr")
    assert os.listdir(tmp_path / "new") == [], "missing folders are created"
    with pytest.raises(OSError, match="cannot be written"):
        check_writable("/proc/a.exr")
