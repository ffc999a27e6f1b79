# SPDX-License-Identifier: Apache-2.0
"""Tests ``wavecomb merge``: weights by sample counts, and images that cannot be merged."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import wavecomb
from wavecomb.cli import main
from wavecomb.errors import WavecombError
from wavecomb.image import cryptomatte
from wavecomb.image.files.image import read_layers, read_metadata, write_exr
from wavecomb.image.merge import merge

_core = pytest.importorskip("wavecomb._core")

AOVS = ["all"]


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from wavecomb.scenes import write_scene

    path = tmp_path_factory.mktemp("merge") / "cornell.usdc"
    write_scene("cornell", path)
    return path


@pytest.fixture(scope="module")
def pictures(stage: Path) -> list[wavecomb.Picture]:
    return [
        wavecomb.render(stage, size=(32, 24), spp=spp, seed=seed, aovs=AOVS)
        for seed, spp in ((1, 4), (2, 12))
    ]


@pytest.fixture
def files(pictures: list[wavecomb.Picture], tmp_path: Path) -> list[Path]:
    names = [tmp_path / "a.exr", tmp_path / "b.exr"]
    for picture, name in zip(pictures, names, strict=True):
        picture.save(name)
    return names


def test_means_are_weighted_by_samples(files: list[Path], tmp_path: Path) -> None:
    output = tmp_path / "out.exr"
    result = CliRunner().invoke(main, ["merge", *map(str, files), "-o", str(output)])
    assert result.exit_code == 0, result.output
    assert "seeds 1, 2: 16 samples per pixel" in result.output
    a, b, sum_ = (read_layers(name) for name in (*files, output))
    assert list(sum_) == list(a)
    assert (sum_["samples"] == 16).all()
    for layer in ("beauty", "albedo", "direct", "indirect", "light_other"):
        expected = (a[layer] * 4.0 + b[layer] * 12.0) / 16
        assert sum_[layer] == pytest.approx(expected, rel=1e-6, abs=1e-7), layer
    assert sum_["cost"] == pytest.approx(a["cost"] + b["cost"])
    assert sum_["position"].tobytes() == a["position"].tobytes()
    both = np.isfinite(a["depth"]) & np.isfinite(b["depth"])
    expected = (a["depth"] * 4.0 + b["depth"] * 12.0) / 16
    assert sum_["depth"][both] == pytest.approx(expected[both], rel=1e-6)
    one = np.isfinite(a["depth"]) != np.isfinite(b["depth"])
    assert sum_["depth"][one] == pytest.approx(np.minimum(a["depth"], b["depth"])[one], rel=1e-6)
    pairs = [cryptomatte.gather(layers)["crypto_object"] for layers in (a, b, sum_)]
    manifest = cryptomatte.manifests(read_metadata(output))["crypto_object"]
    assert len(manifest) >= 8
    for number in manifest.values():
        x, y, z = (cryptomatte.matte(one, number) for one in pairs)
        assert z == pytest.approx((x * 4.0 + y * 12.0) / 16, abs=1e-6)
    assert json.loads(read_metadata(output)["wavecomb:seeds"]) == [1, 2]


def test_a_merged_picture_merges_on(files: list[Path], stage: Path, tmp_path: Path) -> None:
    def save(name: str, paths: list[Path]) -> Path:
        merged = merge(paths)
        write_exr(tmp_path / name, merged.layers, metadata=merged.metadata)
        return tmp_path / name

    third = tmp_path / "c.exr"
    wavecomb.render(stage, size=(32, 24), spp=4, seed=3, aovs=AOVS).save(third)
    steps = merge([save("ab.exr", files), third])
    whole = merge([*files, third])
    assert steps.seeds == whole.seeds == (1, 2, 3)
    assert steps.layers["beauty"] == pytest.approx(whole.layers["beauty"], rel=1e-5)
    with pytest.raises(WavecombError, match=r"ab\.exr has"):
        merge([tmp_path / "ab.exr", files[0]])


def test_variance_is_of_the_sum(tmp_path: Path) -> None:
    """The variance of merged images of white noise is correct."""
    rng = np.random.default_rng(4)
    names = []
    for seed, samples in enumerate((4, 12, 16)):
        names.append(tmp_path / f"{seed}.exr")
        settings = {"seed": seed, "width": 200, "height": 200}
        layers = {
            "beauty": rng.normal(1, 0.5 / np.sqrt(samples), (200, 200, 3)),
            "variance": np.full((200, 200, 3), 0.25 / samples),
            "error": np.full((200, 200), 0.5 / np.sqrt(samples)),
            "samples": np.full((200, 200), samples),
        }
        write_exr(names[-1], layers, metadata={"wavecomb:settings": json.dumps(settings)})
    merged = merge(names).layers
    assert merged["variance"] == pytest.approx(0.25 / 32, rel=1e-5)
    assert merged["error"] == pytest.approx(0.5 / np.sqrt(32), rel=1e-5)
    assert merged["beauty"].var() == pytest.approx(0.25 / 32, rel=0.03)


def test_pixels_without_samples_or_errors_say_nothing(tmp_path: Path) -> None:
    """Pixels without samples have no weight, and an unknown error stays unknown."""
    inf, nan = np.inf, np.nan
    names = []
    for seed, (samples, beauty, variance) in enumerate(
        [((4, 0, 8), (1, nan, 3), (inf, inf, 0.5)), ((4, 8, 0), (2, 5, inf), (1, 0.25, inf))]
    ):
        names.append(tmp_path / f"{seed}.exr")
        layers = {
            "beauty": np.repeat(np.array(beauty, np.float32).reshape(1, 3, 1), 3, axis=2),
            "variance": np.repeat(np.array(variance, np.float32).reshape(1, 3, 1), 3, axis=2),
            "error": np.array([variance], np.float32),
            "samples": np.array([samples], np.float32),
        }
        settings = {"seed": seed, "width": 3, "height": 1}
        write_exr(names[-1], layers, metadata={"wavecomb:settings": json.dumps(settings)})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        merged = merge(names).layers
    assert merged["beauty"][0, :, 0].tolist() == [1.5, 5.0, 3.0]
    assert merged["variance"][0, :, 0].tolist() == [inf, 0.25, 0.5]
    assert merged["error"].ravel().tolist() == [inf, 0.25, 0.5]


def test_parts_are_as_good_as_the_whole(stage: Path, tmp_path: Path) -> None:
    """Four merged renders have the mean, variance and error of one render with all samples."""
    names = []
    settings: dict[str, Any] = {"size": (32, 24), "error": True, "sampler": "independent"}
    for seed, spp in enumerate((16, 48, 64, 128)):
        names.append(tmp_path / f"{seed}.exr")
        wavecomb.render(stage, spp=spp, seed=seed, **settings).save(names[-1])
    merged = merge(names).layers
    whole = wavecomb.render(stage, spp=256, seed=9, **settings)
    assert whole.variance is not None and whole.error is not None
    assert (merged["samples"] == 256).all()
    seen = whole.variance > 0
    difference = merged["beauty"] - whole.beauty
    z = difference[seen] / np.sqrt((merged["variance"] + whole.variance)[seen])
    assert abs(z.mean()) < 0.15
    assert z.var() == pytest.approx(1, rel=0.15)
    assert np.median(merged["variance"]) == pytest.approx(np.median(whole.variance), rel=0.1)
    assert merged["error"].mean() == pytest.approx(whole.error.mean(), rel=0.1)


def test_a_stage_that_was_edited_is_refused(tmp_path: Path) -> None:
    names = []
    for seed, (light, grey) in enumerate(((2, 0.5), (3, 0.5), (2, 0.6))):
        stage = tmp_path / str(seed) / "shot.usda"
        stage.parent.mkdir()
        stage.write_text(
            f"""#usda 1.0
            def DomeLight "Sky" {{
                float inputs:intensity = {light}
            }}
            def Sphere "Ball" {{
                color3f[] primvars:displayColor = [({grey}, 0.5, 0.5)]
            }}
            """
        )
        names.append(tmp_path / f"{seed}.exr")
        wavecomb.render(stage, size=(8, 8), spp=1, seed=seed).save(names[-1])
    for other in names[1:]:
        with pytest.raises(WavecombError, match=r"other prims, lights, materials, camera or frame"):
            merge([names[0], other])


def change(settings: dict[str, Any]) -> Any:
    def edit(metadata: dict[str, Any], layers: dict[str, Any]) -> None:
        old = json.loads(metadata["wavecomb:settings"])
        metadata["wavecomb:settings"] = json.dumps({**old, **settings})

    return edit


def set_(key: str, value: Any) -> Any:
    return lambda metadata, layers: metadata.update({key: value})


def drop_settings(metadata: dict[str, Any], layers: dict[str, Any]) -> None:
    del metadata["wavecomb:settings"]


def drop_layer(metadata: dict[str, Any], layers: dict[str, Any]) -> None:
    del layers["albedo"]


def drop_samples(metadata: dict[str, Any], layers: dict[str, Any]) -> None:
    del layers["samples"]


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (change({"seed": 1}), "b.exr: has seed 1, as "),
        (change({"max_depth": 3}), "b.exr: max_depth is 3, that of "),
        (change({"width": 31}), "b.exr: width is 31, that of "),
        (change({"merge_radius": 1.0}), "b.exr: merge_radius is 1.0, that of "),
        (change({"firefly": "reweight"}), "b.exr: firefly is reweight, that of "),
        (change({"texture_filter": "whole"}), "b.exr: texture_filter is whole, that of "),
        (change({"alpha": True}), "b.exr: alpha is True, that of "),
        (set_("wavecomb:stage", "other.usd"), "b.exr: the stage is other.usd, that of "),
        (set_("wavecomb:scene", "0123"), "b.exr: its stage is not that of "),
        (drop_settings, "b.exr: has no render settings"),
        (drop_layer, "b.exr: has no layer albedo, which the other image has"),
        (drop_samples, "b.exr: has no layer samples, which merging needs"),
    ],
)
def test_what_does_not_fit_is_refused(
    pictures: list[wavecomb.Picture], files: list[Path], edit: Any, message: str
) -> None:
    metadata, layers = pictures[1].file_metadata(), pictures[1].layers()
    edit(metadata, layers)
    write_exr(files[1], layers, metadata=metadata)
    output = files[0].with_name("out.exr")
    result = CliRunner().invoke(main, ["merge", *map(str, files), "-o", str(output)])
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1 and message in result.stderr
    assert not output.exists()


def test_settings_that_only_change_noise_may_differ(
    pictures: list[wavecomb.Picture], files: list[Path]
) -> None:
    others = {
        "sampler": "independent", "roulette": "off", "transport": "light", "guiding": "on",
        "cosine_sampling": True, "light_selection": "power",
    }  # fmt: skip
    metadata, layers = pictures[1].file_metadata(), pictures[1].layers()
    change(others)(metadata, layers)
    write_exr(files[1], layers, metadata=metadata)
    assert len(merge(files[:2]).seeds) == 2


def test_files_of_builds_without_a_setting_have_its_default(
    pictures: list[wavecomb.Picture], files: list[Path]
) -> None:
    metadata, layers = pictures[1].file_metadata(), pictures[1].layers()
    old = json.loads(metadata["wavecomb:settings"])
    del old["merge_radius"]
    metadata["wavecomb:settings"] = json.dumps(old)
    write_exr(files[1], layers, metadata=metadata)
    assert len(merge(files[:2]).seeds) == 2


def test_files_are_kept_from_harm(files: list[Path]) -> None:
    before = files[0].read_bytes()
    for arguments, message in (
        ([*map(str, files), "-o", str(files[0])], "is one of the pictures"),
        ([str(files[0]), "-o", "out.exr"], "at least two images"),
        ([*map(str, files), "-o", "out.png"], "must end in .exr"),
        ([str(files[0])] * 2 + ["-o", "out.exr"], "has seed 1, as "),
    ):
        result = CliRunner().invoke(main, ["merge", *arguments])
        assert result.exit_code == 2 and message in result.stderr
    assert files[0].read_bytes() == before
