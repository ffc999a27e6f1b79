# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_core import Fake, install

import wavecomb
from wavecomb.errors import WavecombError
from wavecomb.image.files.image import read_image, read_layers
from wavecomb.load_options import LoadOptions
from wavecomb.run.cost_profile import load_costs, save_costs
from wavecomb.run.stats import COUNTS, MEMORY, PHASES, write_stats


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Fake:
    return install(monkeypatch)


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    path = tmp_path / "stage.usda"
    path.write_text("#usda 1.0\n")
    return path


def test_names() -> None:
    for name in (
        "load",
        "render",
        "compare",
        "SceneBuilder",
        "Settings",
        "Picture",
        "SchedulingPolicy",
    ):
        assert name in wavecomb.__all__
        assert name in dir(wavecomb)
    with pytest.raises(AttributeError, match="nonsense"):
        _ = wavecomb.nonsense


def test_import_is_light() -> None:
    code = "import sys, wavecomb; assert 'numpy' not in sys.modules and callable(wavecomb.compare)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_render_a_path(fake: Fake, stage: Path, tmp_path: Path) -> None:
    calls: list[tuple[int, int]] = []

    def progress(done: int, total: int) -> None:
        calls.append((done, total))

    picture = wavecomb.render(
        stage, size=(32, 16), spp=2, progress=progress, camera="/C", frame=3.0, max_depth=4
    )
    chosen = LoadOptions(camera="/C", frame=3.0, size=(32, 16)).as_dict()
    assert fake.loaded[0] == {"path": stage, "progress": None, **chosen}
    assert fake.rendered[0]["max_depth"] == 4
    assert picture.beauty.shape == picture.albedo.shape == picture.normal.shape == (16, 32, 3)
    assert picture.depth.shape == picture.samples.shape == (16, 32)
    assert calls[-1] == (1024, 1024)
    assert not picture.cancelled
    picture.save(tmp_path / "a.exr")
    picture.save(tmp_path / "a.png", exposure=1, tone_map="neutral")
    assert read_layers(tmp_path / "a.exr")["beauty"].tobytes() == picture.beauty.tobytes()
    assert read_image(tmp_path / "a.png").shape == (16, 32, 3)
    assert wavecomb.compare(picture, tmp_path / "a.exr").equal
    with pytest.raises(ValueError, match=r"\.exr or \.png"):
        picture.save(tmp_path / "a.jpg")


def test_render_a_loaded_stage_and_a_scene(fake: Fake, stage: Path) -> None:
    loaded = wavecomb.load(stage)
    a = wavecomb.render(loaded, size=(4, 4), spp=1)
    b = wavecomb.render(loaded.scene, size=(4, 4), spp=1)
    assert wavecomb.compare(a, b).equal
    assert a.stats["seconds"]["load"] == 0.25
    assert b.stats["seconds"]["load"] == 0.0
    assert len(fake.loaded) == 1
    with pytest.raises(TypeError, match=r"load\(\)"):
        wavecomb.render(loaded, camera="/C")


class Backwards(wavecomb.SchedulingPolicy):
    name = "backwards"

    def order(self, queue: Any, costs: Any, keys: Any) -> None:
        keys[:] = np.arange(keys.size)[::-1]


def test_policy_and_costs_are_passed_on(fake: Fake, stage: Path, tmp_path: Path) -> None:
    policy = Backwards()
    first = wavecomb.render(stage, size=(4, 4), spp=1, policy="material", costs="model")
    assert (fake.rendered[0]["policy"], fake.rendered[0]["costs"]) == ("material", "model")
    assert (fake.policies[0], fake.costs[0]) == (None, None)
    wavecomb.render(stage, size=(4, 4), spp=1, policy=policy, costs=first.costs)
    assert fake.policies[1] is policy
    assert fake.costs[1] == first.costs
    assert not {"policy", "costs"} & set(fake.rendered[1])
    save_costs(tmp_path / "costs.json", first.costs)
    assert load_costs(tmp_path / "costs.json") == first.costs
    with pytest.raises(WavecombError, match="cost of Gold is -1"):
        wavecomb.render(stage, costs={"materials": {"Gold": -1}, "textures": {}})


@pytest.mark.parametrize(
    ("attributes", "says"),
    [
        ({"name": 3}, "name must be a string"),
        ({"columns": "throughput"}, "columns must be a tuple"),
        ({"columns": None}, "columns must be a tuple"),
        ({"columns": ("colour",)}, "column 'colour' is not known"),
        ({"order": None}, "has no method order"),
    ],
)
def test_bad_policies(fake: Fake, stage: Path, attributes: dict[str, Any], says: str) -> None:
    with pytest.raises(WavecombError, match=says):
        wavecomb.render(stage, policy=type("Odd", (Backwards,), attributes)())
    with pytest.raises(WavecombError, match="is the class Backwards"):
        wavecomb.render(stage, policy=Backwards)  # type: ignore[arg-type]
    assert fake.loaded == []


def test_cancel(fake: Fake, stage: Path) -> None:
    picture = wavecomb.render(stage, size=(10, 10), spp=10, progress=lambda done, _: done < 500)
    assert picture.cancelled
    assert picture.stats["cancelled"] is True
    assert picture.stats["counts"]["samples"] == 500


def test_schema(fake: Fake, stage: Path) -> None:
    stats = wavecomb.render(stage, size=(4, 4), spp=1).stats
    assert list(stats) == [
        *("schema", "version", "stage", "camera"),
        *("working_space", "origin", "cancelled", "settings", "seconds"),
        *("phases_s", "sort_overhead", "counts", "passes", "resumed_samples", "error"),
        *("mean_path_length", "depths", "lane_utilisation"),
        *("coherence", "programs", "materials", "cost_prediction", "light_calibration"),
        *("policy_uses", "sharing"),
        *("samples_per_s", "rays_per_s", "memory_bytes", "peak_rss_bytes", "machine"),
        *("unsupported", "warnings"),
    ]
    assert set(stats["memory_bytes"]) == set(MEMORY)
    assert set(stats["phases_s"]) == set(PHASES)
    assert set(stats["counts"]) == set(COUNTS)
    assert stats["machine"]["cores"] >= 1
    assert stats["unsupported"] == ["volumes: /Smoke"]
    assert len(stats["warnings"]) == 2


@pytest.mark.parametrize("size", [(0, 1), (1, -1), (65537, 1), (65536, 65536)])
def test_bad_sizes(fake: Fake, stage: Path, size: tuple[int, int]) -> None:
    with pytest.raises(WavecombError, match="size"):
        wavecomb.render(stage, size=size)
    assert fake.loaded == []


def test_bad_spp(fake: Fake, stage: Path) -> None:
    for spp in (0, -1, 1 << 40):
        with pytest.raises(WavecombError, match="samples per pixel"):
            wavecomb.render(stage, spp=spp)


def test_stats_file_is_plain_json(tmp_path: Path) -> None:
    stats: dict[str, Any] = {
        "a": np.float32(0.5),
        "b": float("nan"),
        "c": (np.int64(3), np.bool_(True)),
        "d": Path("x"),
    }
    write_stats(tmp_path / "s.json", stats)
    document = json.loads((tmp_path / "s.json").read_text())
    assert document == {"a": 0.5, "b": None, "c": [3, True], "d": "x"}


def test_scene_builder_for_real(tmp_path: Path) -> None:
    pytest.importorskip("wavecomb._core")
    builder = wavecomb.SceneBuilder()
    paint = builder.add_material("diffuse", name="Paint", base_color=(0.5, 0.5, 0.5))
    points = np.array([[-9, -9, -2], [9, -9, -2], [9, 9, -2], [-9, 9, -2]], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    builder.add_to_group(0, builder.add_mesh(points, triangles, material=paint, name="Wall"))
    builder.add_light("dome", np.eye(4), color=(1, 1, 1))
    builder.set_camera(np.eye(4), window=(-0.5, 0.5, -0.5, 0.5))
    scene = builder.build()
    picture = wavecomb.render(scene, size=(16, 8), spp=64, filter="box", filter_width=1)
    # A flat wall under an even sky has the radiance albedo times sky, for any sampler.
    assert picture.beauty.mean() == pytest.approx(0.5, rel=0.02)
    assert picture.albedo == pytest.approx(0.5)
    assert picture.depth == pytest.approx(2.0)
    assert (picture.samples == 64).all()
    assert picture.stats["stage"] is None
    assert picture.stats["counts"]["samples"] == 16 * 8 * 64
    picture.save(tmp_path / "a.exr")
    assert wavecomb.compare(picture, tmp_path / "a.exr").equal
    assert picture.stats["machine"]["build"]["isa"]
    for settings in ({"threads": 1}, {"lanes": 1}, {"wave_size": 64}, {"integrator": "reference"}):
        other = wavecomb.render(
            scene, size=(16, 8), spp=64, filter="box", filter_width=1, **settings
        )
        assert wavecomb.compare(other, picture).equal, settings


def test_each_filter_has_its_own_width() -> None:
    """The default width of a box filter is one pixel; other filters have other defaults."""
    core = pytest.importorskip("wavecomb._core")
    widths = {"box": 1.0, "gaussian": 3.0, "blackman-harris": 3.0}
    for name, width in widths.items():
        settings = core.Settings(filter=name)
        assert settings.filter_width == width
        assert settings.to_dict()["filter_width"] == width
    settings = core.Settings(filter_width=2.0, filter="box")
    assert settings.filter_width == 2.0
    settings.filter_width = None
    assert settings.filter_width == 1.0

    builder = wavecomb.SceneBuilder()
    glow = builder.add_material("emissive", emission=(1.0, 1.0, 1.0))
    corners = np.array([[-0.7, -0.7, -2], [0.7, -0.7, -2], [0.7, 0.7, -2]], np.float32)
    mesh = builder.add_mesh(corners, np.array([[0, 1, 2]], np.uint32), material=glow)
    builder.add_to_group(0, mesh)
    builder.set_camera(np.eye(4), window=(-0.5, 0.5, -0.5, 0.5))
    scene = builder.build()
    unset = wavecomb.render(scene, size=(16, 16), spp=16, filter="box")
    one = wavecomb.render(scene, size=(16, 16), spp=16, filter="box", filter_width=1.0)
    wide = wavecomb.render(scene, size=(16, 16), spp=16, filter="box", filter_width=3.0)
    assert wavecomb.compare(unset, one).equal
    assert not wavecomb.compare(unset, wide).equal


def test_progress_for_real() -> None:
    pytest.importorskip("wavecomb._core")
    builder = wavecomb.SceneBuilder()
    builder.add_light("dome", np.eye(4))
    builder.set_camera(np.eye(4), window=(-0.5, 0.5, -0.5, 0.5))
    scene = builder.build()
    calls: list[tuple[int, int]] = []

    def stop(done: int, total: int) -> bool:
        calls.append((done, total))
        return False

    picture = wavecomb.render(scene, size=(256, 256), spp=100000, progress=stop)
    assert picture.cancelled
    assert calls[0][1] == 256 * 256 * 100000

    def fail(done: int, total: int) -> bool:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        wavecomb.render(scene, size=(256, 256), spp=100000, progress=fail)
