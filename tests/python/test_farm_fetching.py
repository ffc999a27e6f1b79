# SPDX-License-Identifier: Apache-2.0
"""Files of a stage on workers that lack them: copies through the job's folder, path maps."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any

import forks
import numpy as np
import pytest
from farm_jobs import TIMES, same
from parts import needs
from test_farm_assets import LOOK
from test_texture_limit import textured, write_image

from wavecomb import farm
from wavecomb.errors import WavecombError
from wavecomb.farm.fetching import copy_into, fetch, store_name
from wavecomb.farm.files import write_json
from wavecomb.farm.folder import TODO
from wavecomb.farm.hashes import Hashes
from wavecomb.farm.maps import here, parse_maps, place

pytestmark = needs("wavecomb._core", "MaterialX")

BUT = (*TIMES, "wavecomb:scene")
"""Of a header: the scene's hash is of the names of files, too, as they are on a machine."""
SIZE = ("--size", "24", "16", "--spp", "2", "--threads", "1")


def colours(path: Path, seed: int, size: int = 8) -> None:
    write_image(path, np.random.default_rng(seed).integers(0, 256, (size, size, 3), np.uint8))


def quad(text: str, x: float, material: str) -> str:
    """A square of ``textured``, beside others."""
    return f"""
def Mesh "Q{material}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    point3f[] points = [({x}, -1, 0), ({x + 1}, -1, 0), ({x + 1}, 1, 0), ({x}, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    texCoord2f[] primvars:st = [(0, 0), (2, 0), (2, 1), (0, 1)] ( interpolation = "vertex" )
    rel material:binding = <{text}>
}}
"""


@pytest.fixture
def share(tmp_path: Path) -> Path:
    """A stage with absolute and relative names: layers, a UDIM, a profile, images in MaterialX."""
    folder = tmp_path / "here" / "share"
    (folder / "maps").mkdir(parents=True)
    for seed, name in enumerate(("a.png", "b.png", "t.1001.png", "t.1002.png", "sky.png")):
        colours(folder / "maps" / name, seed)
    profile = "IESNA:LM-63-1995\nTILT=NONE\n1 -1 1 3 1 1 1 0 0 0\n1 1 1\n0 45 90\n0\n9 5 1\n"
    (folder / "lamp.ies").write_text(profile)
    look = LOOK.replace('value="b.png"', f'value="{folder}/maps/b.png"')
    (folder / "look.mtlx").write_text(look)
    (folder / "sub.usda").write_text("#usda 1.0\n" + textured("M", f"{folder}/maps/a.png", 1))
    udim = textured("U", f"{folder}/maps/t.<UDIM>.png", 1)
    (folder / "stage.usda").write_text(
        f"#usda 1.0\n( subLayers = [@{folder}/sub.usda@] )\n"
        + udim
        + quad("/UMat", -2.0, "UDIM")
        + 'def "Looks" (references = @./look.mtlx@</MaterialX>) {}\n'
        + quad("/Looks/Materials/M", 1.0, "L")
        + f"""
def DomeLight "D" {{
    asset inputs:texture:file = @{folder}/maps/sky.png@
}}
def SphereLight "S" (prepend apiSchemas = ["ShapingAPI"]) {{
    float inputs:radius = 0.2
    float inputs:intensity = 3
    asset inputs:shaping:ies:file = @lamp.ies@
    double3 xformOp:translate = (0, 0, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
    )
    return folder


def render(stage: Path, output: Path) -> Path:
    done = forks.wavecomb("render", stage, "-o", output, *SIZE)
    assert done.returncode == 0 and "cannot be read" not in done.stderr, done.stderr
    return output


@pytest.mark.slow
@pytest.mark.parametrize("boxed", [pytest.param("0", marks=pytest.mark.long), "1"])
def test_copies(share: Path, tmp_path: Path, boxed: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker that lacks all files renders the same bits from copies, also in a sandbox."""
    cache, out = tmp_path / "cache", tmp_path / "out"
    monkeypatch.setenv("WAVECOMB_CACHE", str(cache))
    monkeypatch.setenv("WAVECOMB_ISOLATE", boxed)
    out.mkdir()
    one = render(share / "stage.usda", tmp_path / "one.exr")
    words = ["farm", "submit", share / "stage.usda", "-o", out / "a.exr", *SIZE, "--on", "none"]
    done = forks.wavecomb(*words, "--assets", "copy")
    assert done.returncode == 0, done.stderr
    job = farm.Folder(out / "a.farm")
    names = {Path(file["path"]).name for file in job.assets()}
    assert names == {
        "a.png", "b.png", "t.1001.png", "t.1002.png", "sky.png", "lamp.ies", "look.mtlx",
        "sub.usda", "stage.usda",
    }  # fmt: skip
    share.parent.rename(tmp_path / "elsewhere")
    done = forks.wavecomb("farm", "worker", job.path)
    assert done.returncode == 0 and farm.status(job)["state"] == "done", done.stdout
    same(out / "a.exr", one, BUT)
    tree = cache / "farm" / "jobs" / job.spec.id
    assert {file.name for file in tree.rglob("*") if file.is_file()} == names
    # What it fetched serves again; what is damaged in the folder is named.
    damaged = store_name(job.path / "files", job.assets()[0]["sha256"])
    damaged.write_bytes(b"x")
    (out / "a.exr").unlink()
    assert forks.wavecomb("farm", "resume", job.path, "--quiet").returncode == 0
    (out / "a.exr").unlink()
    monkeypatch.setenv("WAVECOMB_CACHE", str(tmp_path / "other"))
    done = forks.wavecomb("farm", "resume", job.path)
    assert done.returncode == 2 and damaged.name in done.stderr, done.stderr
    assert "or is damaged" in done.stderr and done.stderr.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("of", [pytest.param("job", marks=pytest.mark.long), "worker"])
def test_maps(share: Path, tmp_path: Path, of: str) -> None:
    """The same share under another name: stage, all that it names, and the pictures."""
    one = render(share / "stage.usda", tmp_path / "one.exr")
    stage, first, other = share / "stage.usda", share.parent, tmp_path / "elsewhere"
    words = ["farm", "submit", stage, "-o", first / "out" / "a.exr", *SIZE, "--on", "none"]
    (first / "out").mkdir()
    pair = f"{first}={other}"
    done = forks.wavecomb(*words, *(["--map", pair] if of == "job" else []))
    assert done.returncode == 0, done.stderr
    first.rename(other)
    job = other / "out" / "a.farm"
    if of == "worker":
        lacking = forks.wavecomb("farm", "worker", job)
        assert lacking.returncode == 2 and "is not on this machine" in lacking.stderr
    done = forks.wavecomb("farm", "worker", job, *(["--map", pair] if of == "worker" else []))
    assert done.returncode == 0, done.stderr
    same(other / "out" / "a.exr", one, BUT)
    assert not first.exists()


def test_what_maps_say(tmp_path: Path) -> None:
    for text in ("x", "/a", "/a=b", "a=/b", "="):
        with pytest.raises(WavecombError, match="must be FROM=TO"):
            parse_maps([text])
    pairs = parse_maps(["/a/=/x", "/a/b=/y/"])
    assert pairs == (("/a", "/x"), ("/a/b", "/y"))
    assert place("/a/bc", pairs) == "/x/bc" and place("/a/b/c", pairs) == "/y/c"
    assert place("a/b", pairs) == "a/b" and place("/ab", pairs) == "/ab"
    there = (str(tmp_path), "/x")
    assert here([there, ("/is-not-there", "/x")]) == [("/is-not-there", "/x")]


def test_a_store(tmp_path: Path) -> None:
    """By content: a file that changed is refused, one that is there is not copied again."""
    source, store = tmp_path / "a", tmp_path / "store"
    source.write_bytes(b"hello")
    told = "2cf24dba5fb0a30e26e83b2ac5b9e29e1b161e5c1fa7425e73043362938b9824"
    assert copy_into(store, source, told) and not copy_into(store, source, told)
    source.write_bytes(b"other")
    with pytest.raises(WavecombError, match="changed while it was copied"):
        copy_into(store, source, "0" * 64)
    assert [file.name for file in store.rglob("*") if file.is_file()] == [told]
    with pytest.raises(WavecombError, match="is no absolute name"):
        fetch(tmp_path, "x", [{"path": "../../a", "sha256": told, "bytes": 5}])


def test_hashes_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Until a file changes in any way; of one that has just changed nothing is kept."""
    read: list[str] = []

    def count(path: str) -> str:
        read.append(path)
        return Path(path).read_text()

    monkeypatch.setattr("wavecomb.farm.assets.file_hash", count)
    file = tmp_path / "a"

    def ask() -> tuple[str, int]:
        before, hashes = len(read), Hashes(tmp_path)
        told = hashes.of(str(file))
        hashes.save()
        return told, len(read) - before

    file.write_text("one")
    assert ask() == ("one", 1) and ask() == ("one", 1), "it has just changed"
    real = time.time_ns
    monkeypatch.setattr("time.time_ns", lambda: real() + 10**10)
    assert ask() == ("one", 1) and ask() == ("one", 0)
    past = file.stat()
    file.write_text("two")
    os.utime(file, ns=(past.st_atime_ns, past.st_mtime_ns))
    assert ask() == ("two", 1), "size and time are what they were"
    for damaged in ("x", "[]", json.dumps({str(file): "y"})):
        next((tmp_path / "hashes").iterdir()).write_text(damaged)
        assert ask() == ("two", 1)


def test_a_job_of_before(share: Path, tmp_path: Path) -> None:
    """Knows nothing of maps and copies, and is read."""
    options: dict[str, Any] = {"size": (8, 8), "spp": 1, "strict": False}
    job = farm.submit(share / "stage.usda", tmp_path / "a.exr", **options)
    text = json.loads((job.path / "job.json").read_text())
    for name in ("maps", "assets", "slow"):
        del text[name]
    write_json(job.path / "job.json", text)
    again = farm.Folder(job.path)
    assert again.spec == job.spec and again.entries(TODO)
    with pytest.raises(WavecombError, match="assets: must be shared or copy"):
        farm.submit(share / "stage.usda", tmp_path / "b.exr", assets="x", **options)
    with pytest.raises(WavecombError, match="leave out --no-strict"):
        farm.submit(share / "stage.usda", tmp_path / "b.exr", assets="copy", **options)
