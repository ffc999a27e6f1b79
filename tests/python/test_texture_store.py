# SPDX-License-Identifier: Apache-2.0
"""Tests ``--texture-limit`` with a texture store: equal images, memory and errors."""

import ctypes
import errno
import os
import platform
import re
import resource
import struct
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from parts import needs, only_where
from test_texture_limit import NoStore, textured, write_image

import wavecomb
from wavecomb import WavecombError, _core, vdb
from wavecomb.machine import temporary_folder
from wavecomb.run.sequence import Frames
from wavecomb.usd import load_stage
from wavecomb.usd.materials.pixels import ReadAhead

LIMIT_MB = 2.0
TEXTURES, SIZE = 9, 512
CHUNK_KB = 65536
"""Address space that a store reserves at a time."""

needs_store = needs("userfaultfd")


@pytest.fixture(scope="module")
def stage(tmp_path_factory):
    """Nine squares that fill the image, with 12.6 MB of noise textures that also control opacity.

    Opacity is read from the finest level, so that rays access the whole finest level.
    """
    folder = tmp_path_factory.mktemp("textures")
    rng = np.random.default_rng(3)
    text = "#usda 1.0\n"
    for i in range(TEXTURES):
        write_image(folder / f"{i}.png", rng.integers(0, 256, (SIZE, SIZE, 3), np.uint8))
        place = textured(f"M{i}", f"{i}.png", 1)
        at = f"({i % 3 - 1.5}, {i // 3 - 1.5}, -3)"
        place = place.replace(
            "color3f inputs:diffuse",
            f"""float inputs:opacity.connect = </M{i}Mat/T.outputs:r>
            float inputs:opacityThreshold = 0.4
            color3f inputs:diffuse""",
        ).replace("float3 outputs:rgb", "float3 outputs:rgb\n            float outputs:r")
        text += place.replace("(0, 0, -1)\n", f"{at}\n")
    text += """def Camera "C" {
        float focalLength = 20
        float horizontalAperture = 20
        double3 xformOp:translate.timeSamples = {1: (0, 0, 0), 3: (0, 0, -0.5)}
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DistantLight "Sun" {
        float inputs:intensity = 3
    }
    """
    path = folder / "stage.usda"
    path.write_text(text)
    return path


def picture(stage, texture_limit=None, **options):
    loaded = load_stage(stage, texture_limit=texture_limit)
    return wavecomb.render(loaded, size=(96, 96), spp=2, **options)


@pytest.fixture(scope="module")
def whole(stage):
    """Image of the squares without a texture limit."""
    result = picture(stage)
    assert result.stats["texture_store"] is None
    assert len(np.unique(result.beauty)) > 1000
    return result.beauty


@pytest.mark.slow
@needs_store
@pytest.mark.parametrize("policy", ["none", "program", "texture-locality", "random-runs"])
def test_the_picture_is_the_same_within_the_limit(stage, whole, policy):
    result = picture(stage, policy=policy, texture_limit=LIMIT_MB)
    assert np.array_equal(result.beauty, whole)
    store = result.stats["texture_store"]
    assert store["limit_bytes"] == LIMIT_MB * 1e6
    assert store["peak_bytes"] <= LIMIT_MB * 1e6
    assert store["texture_bytes"] > 6 * LIMIT_MB * 1e6
    assert 0 <= store["file_bytes"] - store["texture_bytes"] < TEXTURES * 16384
    assert store["loads"] > store["releases"] > 0 and store["load_s"] > 0
    assert result.stats["memory_bytes"]["textures"] == store["resident_bytes"]


@needs_store
@pytest.mark.slow
def test_what_fits_needs_no_file(stage, whole):
    result = picture(stage, texture_limit=16)
    assert np.array_equal(result.beauty, whole)
    store = result.stats["texture_store"]
    assert store["file_bytes"] == store["loads"] == store["releases"] == 0
    assert store["texture_bytes"] <= store["resident_bytes"] <= 16e6


@needs_store
@pytest.mark.parametrize("size", [256, 4096])
def test_wave_sizes_and_threads_do_not_matter(stage, whole, size):
    result = picture(stage, wave_size=size, threads=1, texture_limit=1)
    assert np.array_equal(result.beauty, whole)


def resident_of_stores():
    """Returns the resident bytes of the address space of all stores, as the kernel counts them."""
    sum_kb, is_store = 0, False
    for line in Path("/proc/self/smaps").read_text().splitlines():
        head = re.match(r"[0-9a-f]+-[0-9a-f]+ (\S+) \S+ 00:00 0 *$", line)
        if head or re.match(r"[0-9a-f]+-[0-9a-f]+ ", line):
            private = head is not None and head[1] == "r--p"
        elif line.startswith("Size:"):
            is_store = private and int(line.split()[1]) == CHUNK_KB
        elif line.startswith("Rss:") and is_store:
            sum_kb += int(line.split()[1])
    return sum_kb * 1024


@pytest.mark.slow
@needs_store
def test_the_kernel_sees_no_more_than_the_limit(stage):
    loaded = load_stage(stage, texture_limit=LIMIT_MB)
    assert resident_of_stores() < 0.2e6
    seen, done = [], threading.Event()

    def watch():
        while not done.is_set():
            seen.append(resident_of_stores())
            done.wait(0.002)

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        result = wavecomb.render(loaded, size=(160, 160), spp=8)
    finally:
        done.set()
        watcher.join()
    assert result.stats["texture_store"]["loads"] > 100
    seen.append(resident_of_stores())
    # The kernel counts page by page, so pages that change meanwhile may count twice.
    assert 0.8 * LIMIT_MB * 1e6 < max(seen) <= 1.05 * LIMIT_MB * 1e6, (len(seen), max(seen))


@needs_store
def test_frames_share_one_store(stage):
    def frames(**options):
        sequence = Frames(stage, size=(48, 48), **options)
        for frame in (1, 2, 3):
            loaded = sequence.load(frame)
            settings = {"width": 48, "height": 48, "spp": 1}
            yield loaded, sequence.render(_core.Settings(**settings))

    for (_, plain), (loaded, stored) in zip(frames(), frames(texture_limit=LIMIT_MB), strict=True):
        assert np.array_equal(plain.beauty, stored.beauty)
        store = stored.stats["texture_store"]
        assert 12e6 < store["texture_bytes"] < 14e6
        assert store["peak_bytes"] <= LIMIT_MB * 1e6
        assert not loaded.leaves_out_levels


@needs_store
def test_a_later_read_shares_the_store_of_the_same_limit(stage):
    first = load_stage(stage, texture_limit=LIMIT_MB, editable=True)
    again = load_stage(stage, texture_limit=LIMIT_MB, editable=True, reuse=first.textures)
    assert again.textures.store is first.textures.store
    assert again.textures.store.statistics["texture_bytes"] < 14e6
    other = load_stage(stage, texture_limit=3, editable=True, reuse=first.textures)
    assert other.textures.store is not first.textures.store


@needs_store
def test_a_file_that_cannot_be_read_back_ends_the_render(stage):
    loaded = load_stage(stage, texture_limit=LIMIT_MB)
    for file in os.listdir("/proc/self/fd"):
        path = f"/proc/self/fd/{file}"
        try:
            if "(deleted)" in os.readlink(path) and os.stat(path).st_size > 12e6:
                os.truncate(path, 4096)
        except OSError:  # the descriptor of listdir is closed by now
            continue
    with pytest.raises(ValueError, match=r"cannot be read back .*; set TMPDIR to another folder"):
        wavecomb.render(loaded, size=(32, 32), spp=1)


def no_memory_for_tiles():
    """Makes the kernel refuse to fill tiles: UFFDIO_COPY fails with ENOMEM."""
    ioctl, copy, allow, fail = 16, 0xC028AA03, 0x7FFF0000, 0x00050000 | errno.ENOMEM
    steps = [(0x20, 0, 0, 0), (0x15, 0, 3, ioctl), (0x20, 0, 0, 24), (0x15, 0, 1, copy),
             (0x06, 0, 0, fail), (0x06, 0, 0, allow)]  # fmt: skip
    program = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *step) for step in steps))
    head = ctypes.create_string_buffer(struct.pack("HP", len(steps), ctypes.addressof(program)))
    prctl = ctypes.CDLL(None).prctl
    no_new_privs, set_seccomp, mode_filter = 38, 22, 2
    assert prctl(no_new_privs, 1, 0, 0, 0) == 0
    assert prctl(set_seccomp, mode_filter, ctypes.byref(head)) == 0


@pytest.mark.slow
@needs_store
@pytest.mark.skipif(platform.machine() != "x86_64", reason="numbers of system calls of x86_64")
@pytest.mark.parametrize("limit", ["1", "2"], ids=["on the store's thread", "on the loader's"])
def test_no_memory_for_a_tile_ends_the_render_in_one_line(stage, limit):
    """At 1 MB, all textures go to the file at once; at 2 MB, the first one stays in memory."""
    done = subprocess.run(
        [sys.executable, "-m", "wavecomb", "render", stage, "-o", stage.parent / "o.exr", "--size",
         "64", "64", "--spp", "1", "--texture-limit", limit, "--isolate", "off"],
        capture_output=True, text=True, timeout=120, check=False, preexec_fn=no_memory_for_tiles,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    last = done.stderr.strip().splitlines()[-1]
    assert re.match("error: .*no memory for textures .Cannot allocate memory.; give a", last), last
    assert "Traceback" not in done.stderr and "terminate" not in done.stderr
    assert not [name for name in os.listdir(stage.parent) if "o.exr" in name or ".part" in name]


def run(stage, *options, file_bytes=None, **environment):
    def bound():
        resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes, file_bytes))

    return subprocess.run(
        [sys.executable, "-m", "wavecomb", "render", stage, "-o", stage.parent / "o.exr", "--size",
         "16", "16", "--spp", "1", *options],
        capture_output=True, text=True, timeout=120, check=False,
        env={**os.environ, **environment}, preexec_fn=bound if file_bytes else None,
    )  # fmt: skip


@pytest.mark.slow
@needs_store
@pytest.mark.parametrize(
    ("options", "trouble", "words"),
    [
        (["2"], {"file_bytes": 3_000_000}, "MB of textures do not fit into .*; set TMPDIR to"),
        (["2"], {"TMPDIR": "/nowhere/at/all"}, "no file for textures can be made in /nowhere/at/"),
        (["0.5"], {}, "texture limit 0.5 MB: give at least 1.0 MB"),
    ],
    ids=["disk full", "no folder", "too little"],
)
def test_what_cannot_be_is_one_line(stage, options, trouble, words):
    done = run(stage, "--texture-limit", *options, **trouble)
    assert done.returncode == 2, done.stderr
    lines = done.stderr.strip().splitlines()
    assert re.search(words, lines[-1]) and "Traceback" not in done.stderr, done.stderr
    assert not (stage.parent / "o.exr").exists()


def test_without_the_system_s_help_levels_are_left_out(stage, monkeypatch):
    monkeypatch.setattr(_core, "TextureStore", NoStore)
    loaded = load_stage(stage, texture_limit=LIMIT_MB, size=(96, 96))
    said = "\n".join(loaded.report.lines())
    assert "kept by leaving out mip levels, as the system allows no userfaultfd" in said
    assert loaded.leaves_out_levels
    assert sum(size for _, size in loaded.scene.textures) <= LIMIT_MB * 1e6


SMOKE = """
def Volume "Smoke" {
    rel field:density = </Smoke/density>
    double3 xformOp:translate = (0, 0, -2)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def OpenVDBAsset "density" {
        asset filePath = @smoke.vdb@
    }
}
"""


@pytest.fixture(scope="module")
def smoky(stage):
    """The squares with 3.5 MB of smoke in front of them."""
    cells = np.stack(np.meshgrid(*[np.arange(10)] * 3, indexing="ij"), -1).reshape(-1, 3)[:900]
    values = np.random.default_rng(1).random((900, 8, 8, 8), np.float32)
    vdb.write(stage.parent / "smoke.vdb", [{
        "name": "density", "origins": 8 * (cells - 5).astype(np.int32), "values": values,
        "index_to_object": np.diag([0.025, 0.025, 0.025, 1.0]),
    }])  # fmt: skip
    path = stage.parent / "smoky.usda"
    path.write_text(stage.read_text() + SMOKE)
    return path


@pytest.mark.slow
@needs_store
@only_where(vdb.is_there(), "this build is without OpenVDB")
def test_grids_leave_less_for_textures(smoky, stage):
    whole = picture(smoky).beauty
    assert not np.array_equal(whole, picture(stage).beauty)
    grid_bytes = 900 * 9**3 * 4
    for limit in (15.9, 5.0):  # without the grid, textures would fit into the first limit
        result = picture(smoky, texture_limit=limit)
        assert np.array_equal(result.beauty, whole)
        store = result.stats["texture_store"]
        assert grid_bytes <= store["grid_bytes"] < 1.6 * grid_bytes
        assert result.stats["memory_bytes"]["volumes"] == store["grid_bytes"]
        assert store["file_bytes"] > 0 and store["loads"] > 0
        assert store["resident_bytes"] + store["grid_bytes"] <= limit * 1e6
    assert picture(stage, texture_limit=15.9).stats["texture_store"]["file_bytes"] == 0


@pytest.mark.slow
@needs_store
@only_where(vdb.is_there(), "this build is without OpenVDB")
def test_grids_that_alone_are_more_are_said(smoky, stage):
    loaded = load_stage(smoky, texture_limit=1)
    (line,) = [line for line in loaded.report.lines() if "grids of volumes" in line]
    assert "texture limit 1 MB: grids of volumes take 2.6 MB, all of which is in memory" in line
    small = wavecomb.render(loaded, size=(24, 24), spp=1)
    plain = wavecomb.render(load_stage(smoky), size=(24, 24), spp=1)
    assert np.array_equal(small.beauty, plain.beauty)
    assert "grids" not in "".join(load_stage(smoky, texture_limit=4).report.lines())


def test_reading_ahead_keeps_to_its_limit(tmp_path):
    files = []
    for i in range(4):
        files.append(str(tmp_path / f"{i}.png"))
        write_image(files[-1], np.full((64, 64, 3), i, np.uint8))
    ahead = ReadAhead(threads=4, limit_bytes=2 * 64 * 64 * 3)
    ahead.want([str(tmp_path / "none.png"), *files])
    most = 0
    for i, file in enumerate(files):
        most = max(most, len(ahead._ready))
        assert (ahead.read(file).take() == i).all()
    ahead.close()
    assert most == 3


def test_the_file_goes_where_it_is_told_to(monkeypatch, tmp_path):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    assert temporary_folder() == str(tmp_path)
    monkeypatch.delenv("TMPDIR")
    assert Path(temporary_folder()).is_dir()


def test_a_limit_is_a_number_above_0(stage):
    with pytest.raises(WavecombError, match="texture limit 0 MB: must be a number above 0"):
        load_stage(stage, texture_limit=0)
