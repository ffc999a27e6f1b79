# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from fake_core import install

import wavecomb
from wavecomb.cli import main
from wavecomb.errors import WavecombError
from wavecomb.image.files.image import read_image, read_layers


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A noisy and a clean image of one stage."""
    pytest.importorskip("wavecomb._core")
    pytest.importorskip("pyoidn")
    from wavecomb.scenes import write_scene

    path: Path = tmp_path_factory.mktemp("stages") / "cornell.usdc"
    write_scene("cornell", path)
    stage = wavecomb.load(path)
    return [wavecomb.render(stage, size=(64, 64), spp=spp, seed=spp) for spp in (8, 512)]


def rmse(a: Any, b: Any) -> float:
    """Returns the RMS error after clipping to the range of a display."""
    return float(np.sqrt(((np.minimum(a, 1) - np.minimum(b, 1)) ** 2).mean()))


@pytest.mark.slow
def test_denoised_is_nearer_to_the_truth(pictures: Any) -> None:
    noisy, clean = pictures
    picture = noisy.with_denoised(threads=1)
    assert picture.denoised.shape == noisy.beauty.shape
    np.testing.assert_array_equal(picture.beauty, noisy.beauty)
    assert rmse(picture.denoised, clean.beauty) < 0.6 * rmse(noisy.beauty, clean.beauty)
    assert picture.denoised.mean() == pytest.approx(noisy.beauty.mean(), rel=0.02)
    assert picture.stats["seconds"]["denoise"] > 0
    assert noisy.denoised is None


@pytest.mark.slow
def test_guides_keep_detail(pictures: Any) -> None:
    """Denoising keeps a pattern that only the albedo guide resolves."""
    from wavecomb.image.denoise import denoise

    rng = np.random.default_rng(1)
    y, x = np.mgrid[0:96, 0:96]
    pattern = np.where(((x // 2 + y // 2) % 2 == 0)[:, :, None], 0.8, 0.2).astype(np.float32)
    albedo = np.repeat(pattern, 3, axis=2)
    normal = np.zeros_like(albedo)
    normal[:, :, 2] = 1
    noisy = (albedo * rng.exponential(1.0, albedo.shape)).astype(np.float32)
    guided = denoise(noisy, albedo, normal)
    blind = denoise(noisy, np.full_like(albedo, 0.5), normal)
    assert rmse(guided, albedo) < 0.5 * rmse(blind, albedo)


def looking_at(program: str, z: float, wall_z: float, **material: Any) -> wavecomb.Picture:
    """Renders a surface at `z`, and a wall of albedo (0.2, 0.6, 0.4) at `wall_z` behind it."""
    builder = wavecomb.SceneBuilder()

    def add(at: float, faces_camera: bool, material: int) -> None:
        corners = [[-9, -9, at], [9, -9, at], [9, 9, at], [-9, 9, at]]
        order = [[0, 1, 2], [0, 2, 3]] if faces_camera else [[0, 2, 1], [0, 3, 2]]
        mesh = builder.add_mesh(
            np.array(corners, np.float32), np.array(order, np.uint32), material=material
        )
        builder.add_to_group(0, mesh)

    add(z, True, builder.add_material(program, **material))
    paint = builder.add_material("diffuse", base_color=(0.2, 0.6, 0.4))
    add(wall_z, wall_z < 0, paint)
    builder.add_light("dome", np.eye(4))
    builder.set_camera(np.eye(4), window=(-0.1, 0.1, -0.1, 0.1))
    names = ["albedo", "normal", "guide_albedo", "guide_normal"]
    return wavecomb.render(builder.build(), size=(8, 8), spp=256, aovs=names, max_depth=4)


WALL = np.array([0.2, 0.6, 0.4])


@pytest.mark.parametrize(
    ("program", "wall_z", "material", "albedo", "normal_z"),
    [
        # Denoiser inputs of a mirror are those of the wall behind the camera, times the mirror's
        # colour.
        ("metal", 2.0, {"roughness": 0.0, "base_color": (0.9, 0.5, 0.8)}, (0.18, 0.3, 0.32), -1.0),
        # For rough metal and diffuse surfaces, the denoiser input is the albedo of the surface.
        ("metal", 2.0, {"roughness": 0.4, "base_color": (0.9, 0.5, 0.8)}, (0.9, 0.5, 0.8), 1.0),
        ("diffuse", 2.0, {"base_color": (0.1, 0.2, 0.3)}, (0.1, 0.2, 0.3), 1.0),
        # Glass reflects 4 % of the sky, a part that enters with the albedo of glass, which is 1.
        ("dielectric", -3.0, {"roughness": 0.0}, 0.96 * WALL + 0.04, 1.0),
    ],
)
def test_guides_see_through_mirrors_and_glass(
    program: str, wall_z: float, material: dict[str, Any], albedo: Any, normal_z: float
) -> None:
    pytest.importorskip("wavecomb._core")
    if program == "dielectric":
        material = {**material, "base_color": (1.0, 1.0, 1.0), "ior": 1.5}
    picture = looking_at(program, -2.0, wall_z, **material)
    guide = picture.aovs["guide_albedo"].mean(axis=(0, 1))
    np.testing.assert_allclose(guide, albedo, atol=0.02)
    normal = picture.aovs["guide_normal"].mean(axis=(0, 1))
    np.testing.assert_allclose(normal, (0, 0, normal_z), atol=0.02)
    assert picture.normal is not None
    np.testing.assert_allclose(picture.normal[..., 2], 1.0, atol=1e-5)


def test_guides_are_kept_from_files_unless_asked_for(tmp_path: Path) -> None:
    pytest.importorskip("wavecomb._core")
    pytest.importorskip("pyoidn")
    from wavecomb.scenes import write_scene

    write_scene("cornell", tmp_path / "a.usdc")
    shared = ["render", tmp_path / "a.usdc", "-o", tmp_path / "a.exr", "--size", 16, 16]
    for options, there in (([], False), (["--aov", "guide_albedo"], True)):
        words = [str(word) for word in (*shared, "--spp", 4, "--denoise", *options)]
        result = CliRunner().invoke(main, words)
        assert result.exit_code == 0, result.output
        layers = read_layers(tmp_path / "a.exr")
        assert "denoised" in layers
        assert ("guide_albedo" in layers) is there
        assert "guide_normal" not in layers


@pytest.mark.slow
def test_broken_pixels_are_filled_in(pictures: Any) -> None:
    from wavecomb.image.denoise import denoise

    noisy, clean = pictures
    beauty = noisy.beauty.copy()
    beauty[40, 40] = np.nan
    beauty[50, 60] = np.inf
    denoised = denoise(beauty, noisy.albedo, noisy.normal)
    assert np.isfinite(denoised).all()
    assert rmse(denoised, clean.beauty) < rmse(noisy.beauty, clean.beauty)


def test_files_have_both(pictures: Any, tmp_path: Path) -> None:
    picture = pictures[0].with_denoised()
    picture.save(tmp_path / "a.exr")
    picture.save(tmp_path / "a.png")
    pictures[0].save(tmp_path / "noisy.png")
    layers = read_layers(tmp_path / "a.exr")
    np.testing.assert_array_equal(layers["beauty"], picture.beauty)
    np.testing.assert_array_equal(layers["denoised"], picture.denoised)
    a, b = read_image(tmp_path / "a.png"), read_image(tmp_path / "noisy.png")
    assert not np.array_equal(a, b), "the PNG is of the denoised picture"


def test_a_missing_extra_is_said_before_anything(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fake = install(monkeypatch)
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    stage = tmp_path / "a.usda"
    stage.write_text("#usda 1.0\n")
    result = CliRunner().invoke(
        main, ["render", str(stage), "-o", str(tmp_path / "a.exr"), "--denoise"]
    )
    assert result.exit_code == 2
    assert "pip install 'pyoidn>=2.5'" in result.stderr
    assert not fake.loaded
    with pytest.raises(WavecombError, match=r"denoising needs pyoidn"):
        from wavecomb.image.denoise import check_denoiser

        check_denoiser()
