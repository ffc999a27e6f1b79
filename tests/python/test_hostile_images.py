# SPDX-License-Identifier: Apache-2.0
"""Tests malicious images: memory limits, temporary files, and names inside packages."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from parts import only_where

from wavecomb.usd.materials import pixels
from wavecomb.usd.materials.pixels import TextureError, read_image

WIDTH, HEIGHT = 70, 150


def write(path: Path, kind: str, channels: int = 3, tile: int = 0) -> np.ndarray:
    values = np.random.default_rng(1).random((HEIGHT, WIDTH, channels)).astype(np.float32)
    spec = oiio.ImageSpec(WIDTH, HEIGHT, channels, kind)
    if tile:
        spec.tile_width = spec.tile_height = tile
        spec.tile_depth = 1
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec) and output.write_image(values) and output.close()
    return values


def package(path: Path, inner: str, data: bytes) -> str:
    """Writes a .usdz package with one more file. Returns the asset path of the added file."""
    with zipfile.ZipFile(path, "w") as file:
        for name, content in (("s.usda", b"#usda 1.0\n"), (inner, data)):
            info = zipfile.ZipInfo(name)
            offset = file.fp.tell() + 30 + len(name)
            info.extra = b"\x86\x19" + (-(offset + 4) % 64).to_bytes(2, "little")
            info.extra += bytes(-(offset + 4) % 64)
            file.writestr(info, content)
    return f"{path}[{inner}]"


@pytest.mark.parametrize(
    ("name", "kind", "channels", "tile", "bytes_"),
    [
        ("a.png", "uint8", 3, 0, 6),
        ("a.exr", "half", 4, 0, 16),
        ("a.exr", "half", 9, 0, 18 + 8),
        ("a.tif", "uint16", 3, 0, 6 + 6),
        ("a.tif", "uint16", 3, 16, 6 + 12 + 6),
        ("a.exr", "float", 3, 0, 24),
    ],
)
def test_what_decoding_takes_is_what_is_limited(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    kind: str,
    channels: int,
    tile: int,
    bytes_: int,
) -> None:
    path = tmp_path / name
    values = write(path, kind, channels, tile)
    monkeypatch.setattr(pixels, "MAX_BYTES", WIDTH * HEIGHT * bytes_)
    image = read_image(str(path)).take().astype(np.float32)
    scale = 255 if kind == "uint8" else 1
    assert np.abs(image / scale - values[:, :, :4]).max() < (0.003 if scale > 1 else 0.001)
    monkeypatch.setattr(pixels, "MAX_BYTES", WIDTH * HEIGHT * bytes_ - 1)
    with pytest.raises(TextureError, match="70 x 150 is too large"):
        read_image(str(path))


@pytest.mark.parametrize("inner", ["t/a.png", "a.evil; rm -rf", "a." + "x" * 90, "a.png.EXR", "a"])
def test_the_package_names_no_file_of_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, inner: str
) -> None:
    png = tmp_path / "a.png"
    write(png, "uint8")
    path = package(tmp_path / "p.usdz", inner, png.read_bytes())
    made: list[str] = []
    monkeypatch.setattr(pixels.tempfile, "mkstemp", lambda **k: made.append(str(k)))
    assert np.array_equal(read_image(path).take(), read_image(str(png)).take())
    assert not made


def test_jpeg_2000_has_an_ending_of_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenImageIO detects JPEG 2000 by the file name, so it needs a file; other formats do not."""
    file = tmp_path / "a.jp2"
    write(file, "uint8")
    endings: list[str] = []
    make = pixels.tempfile.mkstemp

    def watched(**options: str) -> tuple[int, str]:
        endings.append(options["suffix"])
        return make(**options, dir=tmp_path)

    monkeypatch.setattr(pixels.tempfile, "mkstemp", watched)
    path = package(tmp_path / "p.usdz", "a.JP2", file.read_bytes())
    assert np.array_equal(read_image(path).take(), read_image(str(file)).take())
    assert endings == [".jp2"] and sorted(os.listdir(tmp_path)) == ["a.jp2", "p.usdz"]


@only_where(sys.platform == "linux", "files without a name are Linux's")
def test_a_decoder_that_crashes_leaves_nothing(tmp_path: Path) -> None:
    write(tmp_path / "a.png", "uint8")
    path = package(tmp_path / "p.usdz", "a.png", (tmp_path / "a.png").read_bytes())
    code = (
        "import os, signal, sys, OpenImageIO as oiio\n"
        "from wavecomb.usd.materials import pixels\n"
        "oiio.ImageInput.open = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
        "pixels.read_image(sys.argv[1])"
    )
    folder = tmp_path / "tmp"
    folder.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", code, path], env={**os.environ, "TMPDIR": str(folder)}, timeout=60
    )
    assert done.returncode == -signal.SIGKILL
    assert not os.listdir(folder)
