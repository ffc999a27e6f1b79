# SPDX-License-Identifier: Apache-2.0
"""What is known of a stage beside its scene, as plain data and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wavecomb.run.boxed import calls
from wavecomb.run.boxed.calls import flag, many, maybe, named, number, row, text, whole
from wavecomb.run.boxed.wire import Array, Refused
from wavecomb.usd.looks.texture_cache import Image, TextureCache
from wavecomb.usd.stage.choice import RenderChoice
from wavecomb.usd.stage.loaded import LoadedStage
from wavecomb.usd.stage.report import Finding, LoadReport
from wavecomb.usd.volumes.info import GridFacts, VolumeFacts

if TYPE_CHECKING:
    from wavecomb import _core


def size(value: Any, arrays: Sequence[Array]) -> int:
    """A whole number that may be large."""
    if type(value) is not int or not 0 <= value < 1 << 63:
        raise Refused("something for a size")
    return value


_PAIR = row(number, number)
_TEXTS = many(text)
_CHOICE = calls.fields(
    settings=maybe(text), product=maybe(text), camera=maybe(text),
    resolution=maybe(row(whole, whole)), pixel_aspect=number, conform=text,
    data_window=maybe(row(number, number, number, number)), purposes=maybe(_TEXTS),
    material_purposes=maybe(_TEXTS), motion_blur=flag, depth_of_field=flag, aovs=maybe(_TEXTS),
    output=maybe(text),
)  # fmt: skip
_FINDINGS = many(row(text, size, _TEXTS))
_REPORT = calls.fields(
    notes=_FINDINGS, warnings=_FINDINGS, unsupported=_FINDINGS, counts=named(size),
    aliases=named(text),
)  # fmt: skip
_POINT = row(number, number, number)
_GRID = calls.fields(
    use=text, field=text, file=text, grid=text, value=text, voxels=size, bytes=size,
)  # fmt: skip
_VOLUME = calls.fields(name=text, count=size, low=_POINT, high=_POINT, grids=many(_GRID))
_STAGE = calls.fields(
    report=_REPORT, camera_path=maybe(text), cameras=_TEXTS, lights=_TEXTS, material_paths=_TEXTS,
    light_paths=_TEXTS, frame=maybe(number), shutter=maybe(_PAIR), render=_CHOICE,
    leaves_out_levels=flag, outline=maybe(calls.array("<f8", 2)), volumes=many(_VOLUME),
    catchers=_TEXTS,
)  # fmt: skip
_IMAGE = calls.fields(
    size=row(whole, whole), channels=whole, dtype=text, stamp=maybe(row(size, size)),
    wraps=row(text, text), encoded=maybe(flag),
)  # fmt: skip
_PLAIN_KEY = row(text, text, text, text, whole)
_TILES_KEY = row(text, many(row(whole, whole)), row(number, number, number, number))
_KEY = calls.one_of(_PLAIN_KEY, _TILES_KEY, row(text, text))
_CACHE = calls.fields(images=named(_IMAGE), ids=many(row(_KEY, whole)))

_FOUND = ("notes", "warnings", "unsupported")


def of_choice(choice: RenderChoice) -> dict[str, Any]:
    """A choice of render settings as plain data."""
    return {field.name: getattr(choice, field.name) for field in fields(choice)}


def read_choice(value: Any, arrays: Sequence[Array] = ()) -> RenderChoice:
    """A choice of plain data. Raises Refused."""
    read = _CHOICE(value, arrays)
    for name in ("purposes", "material_purposes", "aovs"):
        if read.get(name) is not None:
            read[name] = tuple(read[name])
    return RenderChoice(**read)


def of_report(report: LoadReport) -> dict[str, Any]:
    """A report as plain data."""
    found = {
        name: [(one.what, one.count, one.all_places) for one in getattr(report, name)]
        for name in _FOUND
    }
    return {**found, "counts": report.counts, "aliases": report.aliases}


def read_report(value: Any, arrays: Sequence[Array] = ()) -> LoadReport:
    """A report of plain data. Raises Refused."""
    read = _complete(_REPORT(value, arrays), (*_FOUND, "counts", "aliases"))
    findings = {
        name: [Finding(what, count, places) for what, count, places in read[name]]
        for name in _FOUND
    }
    return LoadReport.of(**findings, counts=read["counts"], aliases=read["aliases"])


def of_stage(loaded: LoadedStage) -> dict[str, Any]:
    """What was read, but for scene and textures, as plain data."""
    names = ("camera_path", "cameras", "lights", "material_paths", "light_paths", "frame",
             "shutter", "leaves_out_levels", "outline", "catchers")  # fmt: skip
    return {
        **{name: getattr(loaded, name) for name in names},
        "volumes": [
            {**vars(one), "grids": [dict(vars(grid)) for grid in one.grids]}
            for one in loaded.volumes
        ],
        "report": of_report(loaded.report),
        "render": of_choice(loaded.render),
    }


def read_stage(
    value: Any, arrays: Sequence[Array], scene: _core.Scene, path: Path, working_space: str
) -> LoadedStage:
    """What was read, of plain data and the scene that was built. Raises Refused."""
    wanted = ("report", "camera_path", "cameras", "lights", "material_paths", "light_paths",
              "frame", "shutter", "render", "leaves_out_levels", "outline",
              "volumes", "catchers")  # fmt: skip
    read = _complete(_STAGE(value, arrays), wanted)
    outline = read["outline"]
    if outline is not None and outline.shape[1] != 3:
        raise Refused("points that are not in space")
    if len(read["material_paths"]) > len(scene.materials):
        raise Refused("more materials than the scene has")
    if len(read["light_paths"]) > len(scene.lights):
        raise Refused("more lights than the scene has")
    return LoadedStage(
        scene,
        read_report(value["report"]),
        read["camera_path"],
        0.0,
        path,
        tuple(read["cameras"]),
        tuple(read["lights"]),
        tuple(read["material_paths"]),
        tuple(read["light_paths"]),
        read["frame"],
        None,
        read["shutter"],
        read_choice(value["render"]),
        working_space,
        read["leaves_out_levels"],
        outline,
        tuple(_volume(one) for one in read["volumes"]),
        tuple(read["catchers"]),
    )


def _volume(value: Mapping[str, Any]) -> VolumeFacts:
    one = _complete(value, [field.name for field in fields(VolumeFacts)])
    wanted = [field.name for field in fields(GridFacts)]
    grids = tuple(GridFacts(**_complete(grid, wanted)) for grid in one["grids"])
    return VolumeFacts(**{**one, "grids": grids})


def of_cache(cache: TextureCache) -> dict[str, Any]:
    """What textures were made of as plain data; the scene that holds them is named elsewhere."""
    images = {
        path: {
            "size": image.size, "channels": image.channels, "dtype": np.dtype(image.dtype).str,
            "stamp": image.stamp, "wraps": image.wraps, "encoded": image.encoded,
        }
        for path, image in cache.images.items()
    }  # fmt: skip
    return {"images": images, "ids": list(cache.ids.items())}


def read_cache(value: Any, scene: Any, store: Any, textures: int | None = None) -> TextureCache:
    """A cache of plain data.

    Args:
        value: As ``of_cache`` gives it.
        scene: That holds the textures, or what stands for it.
        store: What keeps them.
        textures: That the scene has; None: not known.

    Raises:
        Refused: It is none.
    """
    read = _complete(_CACHE(value, ()), ("images", "ids"))
    ids = {_frozen(key): at for key, at in read["ids"]}
    if textures is not None and any(at >= textures for at in ids.values()):
        raise Refused("textures that the scene does not have")
    images = {path: _image(entry) for path, entry in read["images"].items()}
    return TextureCache(scene, images, ids, store)


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, (list, tuple)) else value


def _image(entry: Mapping[str, Any]) -> Image:
    """An image without pixels."""
    read = _complete(entry, ("size", "channels", "dtype", "stamp", "wraps", "encoded"))
    if read["dtype"] not in ("|u1", "<f2", "<f4") or not 1 <= read["channels"] <= 4:
        raise Refused("an image of impossible pixels")
    shape = (*read["size"], read["channels"])
    nothing = np.lib.stride_tricks.as_strided(np.zeros(1, read["dtype"]), shape, (0, 0, 0))
    image = Image(nothing, read["stamp"], read["wraps"], read["encoded"])
    image.take()
    return image


def _complete(read: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    missing = [name for name in names if name not in read]
    if missing:
        raise Refused(f"data without {missing[0]}")
    return dict(read)


_MATRIX = calls.array("<f8 <f4", 2)
_SEEN = calls.fields(
    camera=maybe(calls.fields(transform=_MATRIX, **calls.CAMERA)),
    shutter=maybe(_PAIR), camera_path=maybe(text), render=_CHOICE, frame=maybe(number),
)  # fmt: skip


def of_seen(seen: Mapping[str, Any]) -> dict[str, Any]:
    """What another frame shows, by name, as plain data."""
    return {**seen, "render": of_choice(seen["render"])}


def read_seen(value: Any, arrays: Sequence[Array]) -> dict[str, Any] | None:
    """What another frame shows of the same scene; None: it is another. Raises Refused."""
    if value is None:
        return None
    read = _complete(_SEEN(value, arrays), ("camera", "shutter", "camera_path", "render", "frame"))
    return {**read, "render": read_choice(value["render"])}
