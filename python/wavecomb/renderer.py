# SPDX-License-Identifier: Apache-2.0
"""Renderer for a scene that is edited between renders."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np

from wavecomb.api import is_unread, load, picture_from
from wavecomb.arguments import check_arguments, check_source
from wavecomb.errors import ArgumentError, WavecombError
from wavecomb.image.rendered import Picture
from wavecomb.run.settings import DEFAULT_SIZE, prepare

if TYPE_CHECKING:
    from pxr import Usd
    from typing_extensions import Unpack

    from wavecomb._core import Scene
    from wavecomb.keywords import SettingKeywords, StageKeywords
    from wavecomb.usd import LoadedStage

Key = str | int
Values = Mapping[str, Any]


class Renderer:
    """A scene with its acceleration structures, which can be edited and then rendered again.

    Editing the camera, a material, a light or a transform takes milliseconds. The next render
    starts without loading the stage. Only one thread may use a ``Renderer``.

    >>> renderer = wavecomb.Renderer("shot.usd", size=(640, 360))  # doctest: +SKIP
    >>> renderer.edit(materials={"/World/Looks/Car": {"roughness": 0.1}})  # doctest: +SKIP
    >>> renderer.render(spp=16).save("shiny.png")  # doctest: +SKIP
    """

    def __init__(
        self,
        source: str | os.PathLike[str] | Usd.Stage | LoadedStage | Scene,
        *,
        size: tuple[int, int] | None = None,
        threads: int = 0,
        **options: Unpack[StageKeywords],
    ) -> None:
        """Builds acceleration structures, after loading the stage if it is not loaded yet.

        Args:
            source: A path, a ``Usd.Stage``, a result of ``load``, or a ``Scene``.
            size: Width and height of images in pixels; the default is 600 x 600.
            threads: Number of threads for loading, building and editing; 0 uses all cores.
            **options: Fields of ``LoadOptions``, if ``source`` is a path or a ``Usd.Stage``.

        Raises:
            wavecomb.Error: The stage cannot be rendered, or an argument is invalid.
        """
        from wavecomb import _core

        check_source(source, also=("scene", "instanced_triangles"))
        check_arguments(size, 1, None, options)
        self._size = size or DEFAULT_SIZE
        self._loaded: LoadedStage | None = None
        if is_unread(source):
            source = load(source, size=self._size, threads=threads, **options)
        elif options:
            raise ArgumentError(f"{', '.join(options)}: give this to load(); the scene is loaded")
        scene: Any = source
        if hasattr(scene, "report"):
            self._loaded, scene = scene, scene.scene
        if self._loaded is not None and self._loaded.catchers:
            raise WavecombError("a stage with shadow catchers takes three renders: use render()")
        self._core = _core.Renderer(scene, threads)
        self._is_built = True

    @property
    def scene(self) -> Scene:
        """The edited scene.

        Each edit creates a new object, which shares unchanged data with the previous one.
        """
        return self._core.scene

    @property
    def materials(self) -> dict[str, list[int]]:
        """Ids of materials by name.

        The names are paths of material prims, or names given to a ``SceneBuilder``.

        A material prim has several ids if meshes provide different primvars to it.
        """
        paths = () if self._loaded is None else self._loaded.material_paths
        return _ids(paths or (name for name, _ in self.scene.materials))

    @property
    def lights(self) -> dict[str, list[int]]:
        """Ids of lights by name.

        The names are paths of light prims, or names given to a ``SceneBuilder``.
        """
        paths = () if self._loaded is None else self._loaded.light_paths
        return _ids(paths or (name for name, _ in self.scene.lights))

    def edit(
        self,
        *,
        camera: Values | None = None,
        materials: Mapping[Key, Values] | None = None,
        lights: Mapping[Key, Values] | None = None,
        moves: Mapping[str, Any] | None = None,
    ) -> None:
        """Edits the scene. Parameters that are not given keep their values.

        Transforms are (4, 4) matrices for row vectors, as in USD.

        Args:
            camera: Arguments of ``SceneBuilder.set_camera``: ``transform``, ``window``,
                ``lens_radius`` ...
            materials: Maps the name or id of a material to new values for arguments of
                ``SceneBuilder.add_material``. Program, name and textures cannot change.
            lights: Maps the name or id of a light to new values for arguments of
                ``SceneBuilder.add_light``, such as ``transform`` (object to world), ``color`` and
                ``radius``. Kind, name, texture and group cannot change.
            moves: World space transforms by prim path. A transform moves all objects and lights at
                or below the prim, relative to their positions when loaded; the identity restores
                the positions. An instance can only be moved as a whole, and volumes cannot be
                moved.

        Raises:
            wavecomb.Error: A name, a parameter or a value is invalid. The scene is then unchanged.
        """
        self._core.edit(
            camera=None if camera is None else dict(camera),
            materials=_by_id("material", materials, self.materials),
            lights=_by_id("light", lights, self.lights),
            moves={path: self._in_scene(move) for path, move in (moves or {}).items()},
        )

    def _in_scene(self, move: Any) -> Any:
        """Converts a world space transform to the space of the scene, whose origin may differ."""
        origin = (0.0, 0.0, 0.0) if self._loaded is None else self._loaded.origin
        if not any(origin) or np.shape(move) != (4, 4):
            return move
        there, back = np.eye(4), np.eye(4)
        there[3, :3], back[3, :3] = origin, np.negative(origin)
        return there @ np.asarray(move, np.float64) @ back

    def render(
        self,
        *,
        size: tuple[int, int] | None = None,
        spp: int = 64,
        aovs: Iterable[str] | None = None,
        **settings: Unpack[SettingKeywords],
    ) -> Picture:
        """Renders the scene in its current state.

        Args:
            size: Width and height in pixels; the default is the size given to the constructor.
            spp: Samples per pixel. With ``adaptive`` or ``noise``, this is the maximum.
            aovs: Layers in addition to the beauty, as in ``wavecomb.render``.
            **settings: Fields of ``wavecomb.Settings``.

        Returns:
            The image, which is bit-identical to the image of a new scene with the edited values.

        Raises:
            wavecomb.Error: An argument is invalid.
        """
        check_arguments(size, spp, aovs, settings)
        own, costs, names, chosen = prepare(
            size or self._size, spp, None, None, aovs, dict(settings)
        )
        result = self._core.render(chosen, None, own, costs)
        is_built, self._is_built = self._is_built, False
        return picture_from(result, names, self.scene, loaded=self._loaded, is_built=is_built)

    def __repr__(self) -> str:
        return f"<wavecomb.Renderer of {self._loaded or self.scene}>"


def _ids(names: Iterable[str]) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for index, name in enumerate(names):
        if name:
            found.setdefault(name, []).append(index)
    return found


def _by_id(
    kind: str, given: Mapping[Key, Values] | None, known: Mapping[str, list[int]]
) -> dict[int, dict[str, Any]]:
    """Replaces names by ids. Raises WavecombError if a name is unknown."""
    out: dict[int, dict[str, Any]] = {}
    for key, values in (given or {}).items():
        if isinstance(key, str) and key not in known:
            near = get_close_matches(key, known, n=3, cutoff=0.4) or list(known)[:5]
            raise WavecombError(f"no {kind} {key}; there are {', '.join(near) or 'none'}")
        for index in known[key] if isinstance(key, str) else [key]:
            out[index] = dict(values)
    return out
