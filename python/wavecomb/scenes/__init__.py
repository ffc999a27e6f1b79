# SPDX-License-Identifier: Apache-2.0
"""Procedural USD stages, for tests and examples that need no download.

``write_scene("mixed", Path("mixed.usdc"))`` writes a stage, with its textures beside it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavecomb.errors import SceneError
from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.caustics import (
    build_caustics,
    build_landscape,
    build_lens,
    build_pool,
    build_prism,
)
from wavecomb.scenes.drinks import build_candles, build_drinks
from wavecomb.scenes.hair import build_fur, build_head
from wavecomb.scenes.heavy import build_heavy
from wavecomb.scenes.lights import build_lights, build_studio
from wavecomb.scenes.mixed import build_cornell, build_cornell_dragon, build_dragon, build_mixed
from wavecomb.scenes.options import SceneOptions
from wavecomb.scenes.rooms.kitchen import build_kitchen
from wavecomb.scenes.rooms.room import build_room
from wavecomb.scenes.splats import build_splats
from wavecomb.scenes.spread import build_spread
from wavecomb.scenes.volumes import build_clouds, build_fog, build_smoke

if TYPE_CHECKING:
    from pxr import Usd

__all__ = ["SCENES", "SceneError", "SceneInfo", "SceneOptions", "cornell", "write_scene"]


@dataclass(frozen=True)
class SceneInfo:
    """Description of a procedural scene for ``write_scene``.

    Attributes:
        summary: One line that describes the scene in a list of scenes.
        metres_per_unit: Length of a scene unit, in metres.
        build: Function that fills a stage.
    """

    summary: str
    metres_per_unit: float
    build: Callable[[StageWriter, SceneOptions], None]


SCENES: dict[str, SceneInfo] = {
    "cornell": SceneInfo("the Cornell box, as measured", 0.001, build_cornell),
    "cornell-dragon": SceneInfo("the Cornell box with a dragon", 0.001, build_cornell_dragon),
    "mixed": SceneInfo("45 teapots, 45 dragons and a mirror", 0.1, build_mixed),
    "dragon": SceneInfo("90 dragons and a mirror", 0.1, build_dragon),
    "spread": SceneInfo("a field of stones, for scaling: see --materials", 0.1, build_spread),
    "heavy": SceneInfo("the field with layered MaterialX materials", 0.1, build_heavy),
    "studio": SceneInfo("90 objects, a key, a fill and a dim dome", 0.1, build_studio),
    "room": SceneInfo("a dining room, lit through a door ajar", 1.0, build_room),
    "kitchen": SceneInfo("a kitchen with mostly glossy materials", 1.0, build_kitchen),
    "smoke": SceneInfo("a grid of smoke over an ember: see --voxels", 1.0, build_smoke),
    "clouds": SceneInfo("a grid of clouds over the sea: see --voxels", 100.0, build_clouds),
    "fog": SceneInfo("a street lamp in homogeneous fog", 1.0, build_fog),
    "candles": SceneInfo("wax and marble with subsurface scattering", 0.01, build_candles),
    "drinks": SceneInfo("glasses of absorbing and scattering drinks", 0.01, build_drinks),
    "caustics": SceneInfo("a glass ball and a gold ring under a small light", 0.1, build_caustics),
    "pool": SceneInfo("waves on a pool under the sun", 1.0, build_pool),
    "lens": SceneInfo("a lens that images a small light on a wall", 0.1, build_lens),
    "prism": SceneInfo("a prism in the sun beside a matt wall", 0.1, build_prism),
    "landscape": SceneInfo("a glass ring in wide hills in the sun", 1.0, build_landscape),
    "fur": SceneInfo("a striped, furry egg: see --strands", 0.1, build_fur),
    "head": SceneInfo("a head of brown hair: see --strands", 0.1, build_head),
    "splats": SceneInfo("a dragon of Gaussian splats: see --splats", 0.1, build_splats),
    "lights": SceneInfo("a street at night with 1000 lights: see --lights", 1.0, build_lights),
}
"""All built-in scenes by name."""


def write_scene(name: str, path: Path, **options: Any) -> None:
    """Writes a procedural stage; textures and volumes go to folders ``<stem>_...`` next to it.

    Args:
        name: A key of ``SCENES``.
        path: File to write: .usda (text), .usdc or .usd (binary).
        **options: Fields of ``SceneOptions``.

    Raises:
        SceneError: The scene name, the file's ending, an option or an imported mesh is invalid, or
            a file cannot be written. SceneError is also a ValueError.
    """
    if name not in SCENES:
        raise SceneError(f"no scene {name!r}; there are {', '.join(SCENES)}")
    known = [field.name for field in dataclasses.fields(SceneOptions)]
    for key in options:
        if key not in known:
            raise SceneError(f"scene {name!r} has no option {key!r}; there are {', '.join(known)}")
    settings = SceneOptions(**options)
    info = SCENES[name]
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        writer = StageWriter(
            path, info.metres_per_unit, settings.texture_size, settings.seed, settings.plain
        )
        info.build(writer, settings)
        writer.save(f"Wavecomb scene {name}: {info.summary}")
    except OSError as error:
        raise SceneError(f"{path}: cannot write the scene: {error}") from error


def cornell() -> Usd.Stage:
    """Returns the Cornell box as a stage in memory.

    >>> import wavecomb
    >>> image = wavecomb.render(wavecomb.scenes.cornell())  # doctest: +SKIP
    >>> image.save("cornell.png")  # doctest: +SKIP
    """
    writer = StageWriter(Path("cornell.usda"), SCENES["cornell"].metres_per_unit)
    build_cornell(writer, SceneOptions())
    return writer.stage
