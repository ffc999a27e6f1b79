# SPDX-License-Identifier: Apache-2.0
"""Tests a persistent renderer: edits, concurrent renders, stops, picking, snapshots, regions."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wavecomb

_core = pytest.importorskip("wavecomb._core")

MATERIALS: list[dict[str, Any]] = [
    {"program": "diffuse", "name": "/floor", "base_color": (0.6, 0.5, 0.4)},
    {"program": "principled", "name": "/card", "base_color": (0.2, 0.4, 0.7), "presence": True},
]
LIGHTS: list[dict[str, Any]] = [
    {"kind": "dome", "name": "/sky", "color": (0.3, 0.3, 0.4)},
    {"kind": "sphere", "name": "/bulb", "color": (9.0, 8.0, 7.0), "radius": 0.2},
]


def moved(x: float, y: float, z: float) -> Any:
    matrix = np.eye(4)
    matrix[3, :3] = x, y, z
    return matrix


def quad(corner: Any, u: Any, v: Any) -> Any:
    p, u, v = (np.asarray(a, np.float32) for a in (corner, u, v))
    return np.stack([p, p + u, p + u + v, p + v]), np.asarray([[0, 1, 2], [0, 2, 3]], np.uint32)


def build(
    camera: dict[str, Any] | None = None,
    materials: dict[int, dict[str, Any]] | None = None,
    lights: dict[int, dict[str, Any]] | None = None,
) -> Any:
    """Returns the scene with some values replaced."""
    builder = _core.SceneBuilder()
    checks = np.tile(np.asarray([[0, 255], [255, 0]], np.uint8), (4, 4))
    builder.add_texture(checks, srgb=False, name="/checks.png")
    for i, values in enumerate(MATERIALS):
        given = {**values, **(materials or {}).get(i, {})}
        if i == 0:
            given["textures"] = {"roughness": {"texture": 0, "channel": "r"}}
        builder.add_material(**given)
    shapes = {
        "/World/Floor": (0, quad((-3, -1, 3), (6, 0, 0), (0, 0, -6))),
        "/World/Card": (1, quad((-1, -1, 0), (2, 0, 0), (0, 2, 0))),
    }
    for name, (material, (points, indices)) in shapes.items():
        builder.add_to_group(0, builder.add_mesh(points, indices, material=material, name=name))
    for i, values in enumerate(LIGHTS):
        given = {"transform": moved(1, 1.2, 1), **values, **(lights or {}).get(i, {})}
        builder.add_light(**given)
    window = {"transform": moved(0, 0, 4), "window": (-0.4, 0.4, -0.3, 0.3)}
    builder.set_camera(**{**window, **(camera or {})})
    return builder.build()


def settings(**more: Any) -> Any:
    return wavecomb.Settings(**{"width": 40, "height": 30, "spp": 4, **more})


def beauty(renderer: Any) -> bytes:
    return renderer.render(settings()).beauty.tobytes()


@pytest.mark.parametrize(
    "edit",
    [
        {"camera": {"transform": moved(0.5, 0.3, 3.5)}},
        {"camera": {"lens_radius": 0.1, "focus_distance": 3.0}},
        {"materials": {0: {"base_color": (0.1, 0.9, 0.2)}, 1: {"roughness": 0.1}}},
        {"materials": {1: {"emission": (1, 2, 3)}}},
        {"materials": {1: {"opacity": 0.4}}},
        {"lights": {0: {"color": (0.9, 0.1, 0.1)}}},
        {"lights": {1: {"transform": moved(-0.6, 0.8, 1.1), "radius": 0.4, "normalize": True}}},
    ],
)
def test_an_edited_scene_is_the_scene_built_anew(edit: dict[str, Any]) -> None:
    renderer = _core.Renderer(build())
    before, scene = beauty(renderer), renderer.scene
    renderer.edit(**edit)
    assert renderer.version == 1
    assert renderer.scene is not scene
    assert beauty(renderer) == beauty(_core.Renderer(build(**edit))) != before
    # Edit back to the values that the first scene reported.
    renderer.edit(camera=scene.camera)
    for kind, values in (("material", scene.material), ("light", scene.light)):
        fixed = {"name", "program", "textures", "kind", "texture", "group", "ies"}
        whole = {i: {k: v for k, v in values(i).items() if k not in fixed} for i in range(2)}
        renderer.edit(**{kind + "s": whole})
    assert beauty(renderer) == before


def test_values_of_a_scene() -> None:
    scene = build()
    floor = scene.material(0)
    assert floor["program"] == "diffuse"
    assert floor["base_color"] == pytest.approx((0.6, 0.5, 0.4))
    assert floor["textures"]["roughness"]["name"] == "/checks.png"
    assert floor["textures"]["roughness"]["channel"] == "r"
    bulb = scene.light(1)
    assert (bulb["kind"], bulb["name"], bulb["group"]) == ("sphere", "/bulb", "other")
    assert bulb["texture"] is None
    assert np.asarray(bulb["transform"])[3] == pytest.approx((1, 1.2, 1, 1))
    with pytest.raises(_core.Error, match="material 3 is not there; the scene has 3"):
        scene.material(3)
    with pytest.raises(_core.Error, match="light 2"):
        scene.light(2)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        ({"materials": {0: {"gloss": 1}}}, r"material '/floor' has no parameter 'gloss'.*ior"),
        ({"materials": {0: {"program": "metal"}}}, "no parameter 'program' that can be changed"),
        ({"materials": {0: {"roughness": "rough"}}}, "'/floor': roughness must be a number"),
        ({"materials": {0: {"base_color": (1, 2)}}}, "base_color must be 3 numbers"),
        ({"materials": {0: {"ior": -1.0}}}, "'/floor' has an ior of 0 or less"),
        ({"materials": {9: {}}}, "material 9 is not there"),
        ({"materials": {"floor": {}}}, "material index"),
        ({"lights": {1: {"color": (-1, 0, 0)}}}, r"'/bulb': color is \(-1, 0, 0\); each must be 0"),
        ({"lights": {1: {"radius": "big"}}}, "'/bulb': radius must be a number"),
        ({"lights": {1: {"texture": 0}}}, "'/bulb' has no parameter 'texture' that can be"),
        ({"lights": {1: {"transform": [[1, 2], [3, 4]]}}}, "transform must be 4 x 4 numbers"),
        ({"camera": {"window": (1, 0, 0, 1)}}, "camera's window is empty"),
        ({"camera": {"fov": 30}}, "camera has no parameter 'fov'"),
    ],
)
def test_bad_edits_change_nothing(edit: dict[str, Any], message: str) -> None:
    renderer = _core.Renderer(build())
    scene = renderer.scene
    with pytest.raises(_core.Error, match=message) as caught:
        renderer.edit(**edit)
    assert "\n" not in str(caught.value)
    assert renderer.scene is scene
    assert renderer.version == 0


class Snapshots:
    """A watcher that requests snapshots all the time, and can stop the render."""

    def __init__(self, take: Any, wanted: int = 1000) -> None:
        self.take, self.wanted, self.seen = take, wanted, 0

    def progress(self, status: dict[str, Any]) -> str:
        return "stop" if self.seen >= self.wanted else "snapshot"

    def snapshot(self, snapshot: Any) -> None:
        self.seen += 1
        self.take(snapshot)


def test_snapshots_have_layers_and_figures() -> None:
    kept: list[Any] = []
    renderer = _core.Renderer(build())
    chosen = settings(
        width=256, height=256, spp=1 << 16, progressive=True, aovs=["depth", "cost"], error=True
    )

    def take(snapshot: Any) -> None:
        for name in ("beauty", "depth", "cost", "error", "variance"):
            layer = snapshot.layer(name)
            assert layer.shape[:2] == (256, 256)
            assert layer.dtype == np.float32
        assert snapshot.layer("normal") is None
        assert np.array_equal(snapshot.layer("samples"), snapshot.samples())
        assert snapshot.samples().sum() == snapshot.stats["counts"]["samples"]
        kept.append((snapshot, snapshot.beauty(), snapshot.samples(), snapshot.stats))

    result = renderer.render(chosen, watcher=Snapshots(take, 3), interval=0.002)
    assert len(kept) >= 3
    assert result.cancelled
    snapshot, picture, samples, stats = kept[-1]
    assert stats.keys() == result.stats.keys()
    assert stats["settings"]["progressive"] is True
    assert stats["materials"][0].keys() == result.stats["materials"][0].keys()
    assert np.array_equal(picture, result.beauty), "the last one is of the end, and a copy"
    assert np.array_equal(samples, result.samples)
    with pytest.raises(_core.Error, match="the snapshot is over"):
        snapshot.beauty()


def test_stop_from_another_thread_and_twins_that_go_on() -> None:
    renderer = _core.Renderer(build())
    twin = renderer.twin()
    twin.edit(materials={0: {"base_color": (0, 1, 0)}})
    assert (renderer.version, twin.version) == (0, 1)
    expected = beauty(twin)
    began = threading.Event()
    results: list[Any] = []

    def go_on(done: int, total: int) -> None:
        if done:
            began.set()

    thread = threading.Thread(
        target=lambda: results.append(
            renderer.render(settings(width=600, height=600, spp=1 << 16), go_on, interval=0.01)
        )
    )
    thread.start()
    assert began.wait(60)
    with pytest.raises(_core.Error, match="a render goes on"):
        renderer.edit(materials={})
    with pytest.raises(_core.Error, match="a render goes on"):
        renderer.render(settings())
    assert renderer.pick(20, 15, 40, 30)["object"] == "/World/Card"
    assert beauty(twin) == expected
    start = time.perf_counter()
    renderer.stop()
    thread.join()
    assert time.perf_counter() - start < 5
    assert results[0].cancelled
    renderer.stop()
    assert not renderer.render(settings()).cancelled


def test_picks() -> None:
    renderer = _core.Renderer(build())
    card = renderer.pick(20, 15, 40, 30)
    assert card["object"] == "/World/Card"
    assert (card["material"], card["material_name"], card["instance"]) == (1, "/card", 1)
    assert card["position"] == pytest.approx((0, 0, 0), abs=1e-5)
    assert card["normal"] == pytest.approx((0, 0, 1), abs=1e-5)
    assert card["depth"] == pytest.approx(4, abs=1e-5)
    assert card["distance"] == pytest.approx(4, abs=1e-5)
    assert "light" not in card
    assert renderer.pick(-500, -500, 40, 30) is None
    renderer.edit(camera={"transform": moved(1, 1.2, 3)})
    bulb = renderer.pick(20, 15, 40, 30)
    assert (bulb["light"], bulb["object"]) == (1, "/bulb")
    assert "material" not in bulb


def test_a_profile_of_costs_spares_calibration() -> None:
    renderer = _core.Renderer(build())
    first = renderer.render(settings())
    assert first.stats["cost_prediction"]["calibration_s"] > 0
    again = renderer.render(settings(), costs=first.costs)
    assert again.stats["cost_prediction"]["calibration_s"] == 0
    assert again.beauty.tobytes() == first.beauty.tobytes()


def test_regions() -> None:
    renderer = _core.Renderer(build())
    whole = renderer.render(settings())
    chosen = settings(region=(4, 3, 17, 21))
    assert chosen.region == chosen.to_dict()["region"] == (4, 3, 17, 21)
    part = renderer.render(chosen)
    inside = np.zeros((30, 40), bool)
    inside[3:21, 4:17] = True
    assert np.array_equal(part.samples, np.where(inside, 4, 0))
    assert np.array_equal(part.beauty, np.where(inside[..., None], whole.beauty, 0))
    chosen.region = None
    assert renderer.render(chosen).beauty.tobytes() == whole.beauty.tobytes()
    for bad in [(1, 2, 3), "abcd", (0, 0, -1, 4), 7]:
        with pytest.raises(_core.Error, match="region"):
            chosen.region = bad


def test_a_render_without_a_picture_has_its_figures() -> None:
    renderer = _core.Renderer(build())
    result = renderer.render(settings(), picture=False)
    assert result.beauty is None
    assert result.samples is None
    assert result.stats["counts"]["samples"] == 40 * 30 * 4
    assert set(result.costs["materials"]) >= {"/floor", "/card"}


@pytest.fixture(scope="module")
def cornell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from wavecomb.scenes import write_scene

    path = tmp_path_factory.mktemp("stages") / "cornell.usdc"
    write_scene("cornell", path)
    return path


def run_cli(*arguments: str) -> Any:
    from click.testing import CliRunner

    from wavecomb.cli import main

    return CliRunner().invoke(main, list(arguments))


@pytest.mark.parametrize(
    ("region", "message"),
    [
        (("5", "5", "5", "9"), "region 5 5 5 9 has no pixels; give X0 Y0 X1 Y1"),
        (("0", "0", "17", "16"), "region 0 0 17 16 is not within the picture; X1 is at most 16"),
        (("-1", "0", "4", "4"), "region has the edge -1"),
    ],
)
def test_regions_that_cannot_be(
    cornell: Path, tmp_path: Path, region: tuple[str, ...], message: str
) -> None:
    out = tmp_path / "part.exr"
    result = run_cli(
        "render", str(cornell), "-o", str(out), "--size", "16", "16", "--region", *region
    )
    assert result.exit_code == 2
    assert message in result.output
    assert result.output.strip().count("\n") == 0
    assert not out.exists()


def test_a_checkpoint_is_of_its_region(cornell: Path, tmp_path: Path) -> None:
    from wavecomb.image.files.image import read_layers

    out, state = tmp_path / "part.exr", tmp_path / "part.ckpt"
    given = ["render", str(cornell), "-o", str(out), "--quiet", "--size", "16", "16"]
    region = ["--region", "2", "3", "9", "12"]
    first = run_cli(*given, *region, "--spp", "2", "--checkpoint", str(state))
    assert first.exit_code == 0, first.output
    other = run_cli(*given, "--region", "2", "3", "9", "13", "--resume", str(state))
    assert other.exit_code == 2
    assert "was made with region" in other.output
    more = run_cli(*given, "--resume", str(state), "--spp", "4")
    assert more.exit_code == 0, more.output
    samples = read_layers(out)["samples"]
    assert samples[3:12, 2:9].min() == 4
    assert samples.sum() == 4 * 9 * 7
    timed = run_cli(*given[:4], *given[5:], *region, "--spp", "4", "--time-limit", "60")
    assert "4 per pixel" in timed.output, timed.output
