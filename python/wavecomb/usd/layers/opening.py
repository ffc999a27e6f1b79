# SPDX-License-Identifier: Apache-2.0
"""Opens USD files as stages, with variants, masks, payloads and session layers."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from pxr import Sdf, Tf, Usd, UsdGeom, UsdRender, UsdUtils

from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import check_name, check_regular
from wavecomb.path_maps import mapped, own_maps
from wavecomb.run.isolation import progress_notes, time_limit
from wavecomb.usd import mtlx
from wavecomb.usd.layers.fifos import abort_on_fifo
from wavecomb.usd.layers.population import load_payloads, matching_prims, populate
from wavecomb.usd.lights.light import KINDS as LIGHT_KINDS
from wavecomb.usd.stage.report import LoadReport, capture_diagnostics, first_message

MAX_SURVEYED = 4096
"""Maximum number of cameras and lights in a survey, since instancing can multiply them."""


@dataclass(frozen=True)
class StageContents:
    """Cameras and lights of a stage in stage order, including invisible and instanced prims.

    Attributes:
        cameras: Prim paths of all cameras.
        lights: Prim paths of all supported lights. Both lists together have at most
            ``MAX_SURVEYED`` paths.
    """

    cameras: tuple[str, ...] = ()
    lights: tuple[str, ...] = ()

    @property
    def may_have_cameras(self) -> bool:
        """Whether the stage has cameras, or may have cameras that are missing in the full list."""
        return bool(self.cameras) or len(self.lights) == MAX_SURVEYED


def list_contents(stage: Usd.Stage) -> StageContents:
    """Lists cameras and lights in one pass over the stage."""
    cameras: list[str] = []
    lights: list[str] = []
    kinds: dict[str, list[str] | None] = {}

    def kind(prim: Usd.Prim) -> list[str] | None:
        name = prim.GetTypeName()
        if name not in kinds:
            camera = cameras if prim.IsA(UsdGeom.Camera) else None
            kinds[name] = lights if name in LIGHT_KINDS else camera
        return kinds[name]

    for prim in islice(matching_prims(stage, lambda prim: kind(prim) is not None), MAX_SURVEYED):
        found = kind(prim)
        if found is not None:
            found.append(str(prim.GetPath()))
    return StageContents(tuple(cameras), tuple(lights))


_RENDER_RELATIONS = ("products", "orderedVars", "camera")


def open_render_settings(
    file: Path, wanted: str | None = None, session_layer: Path | None = None
) -> Usd.Stage:
    """Opens only a file's render settings and the cameras that the settings name.

    Keep the returned stage alive until the whole stage is opened; otherwise its layers are read
    twice.

    Args:
        file: USD file with ending .usd, .usda, .usdc or .usdz.
        wanted: Path of render settings outside of /Render.
        session_layer: File whose opinions are stronger than the opinions of the stage.

    Raises:
        WavecombError: A file does not exist or cannot be read.
    """
    with abort_on_fifo(), _layers(file, session_layer) as (root, session):
        paths = {"/Render", wanted or "", _settings_path(root), _settings_path(session)}
        kept = {path for path in map(_prim_path, paths) if path is not None}
        mask = Usd.StagePopulationMask(sorted(kept))
        stage = Usd.Stage.OpenMasked(root, session, mask, Usd.Stage.LoadAll)
        # RenderSettings prims refer to products, products refer to RenderVar prims, and settings
        # and products refer to cameras, so two passes are needed. ExpandPopulationMask is not used,
        # since it can deadlock with predicates written in Python.
        for _ in range(2):
            named = {path for path in _named_by(stage) if not mask.Includes(path)}
            if not named:
                break
            for path in named:
                mask.Add(path)
            stage.SetPopulationMask(mask)
    return stage


@contextmanager
def _layers(
    file: Path, session_layer: Path | None, overrides: Sdf.Layer | None = None
) -> Iterator[tuple[Sdf.Layer, Sdf.Layer]]:
    """Opens the root and session layer of a stage for the ``with`` block, within the time limit.

    Parameters are the same as for ``open_stage``. USD errors in the block become WavecombError.
    """
    _check_file(file)
    if session_layer is not None:
        _check_file(session_layer)
    progress_notes.note("opening", file)
    try:
        session = Sdf.Layer.CreateAnonymous("session.usda")
        if overrides is not None:
            session.TransferContent(overrides)
        if session_layer is not None:
            session.subLayerPaths.append(_session(session_layer).identifier)
        with time_limit.limit_composition(file):
            root = Sdf.Layer.FindOrOpen(str(file))
            if not root:
                raise WavecombError(f"{file}: cannot be read as USD")
            change_layers((root, session))
            yield root, session
    except Tf.ErrorException as error:
        raise WavecombError(f"{file}: cannot be read as USD: {first_message(error)}") from None


def _named_by(stage: Usd.Stage) -> set[Sdf.Path]:
    """Returns the paths of prims to which render settings and render products refer."""
    return {
        target.GetPrimPath()
        for prim in stage.Traverse()
        if prim.IsA(UsdRender.SettingsBase)
        for name in _RENDER_RELATIONS
        if prim.HasRelationship(name)
        for target in prim.GetRelationship(name).GetForwardedTargets()
    }


def _settings_path(layer: Sdf.Layer) -> str:
    value = layer.pseudoRoot.GetInfo("renderSettingsPrimPath")
    return value if isinstance(value, str) else ""


def _prim_path(text: str) -> Sdf.Path | None:
    """Parses an absolute prim path; returns None for other text."""
    if not text.startswith("/") or not Sdf.Path.IsValidPathString(text):
        return None
    path = Sdf.Path(text)
    return path if path.IsPrimPath() else None


def open_stage(
    file: str | os.PathLike[str],
    variants: Mapping[str, str] | None = None,
    overrides: Sdf.Layer | None = None,
    mask: Sequence[str] = (),
    session_layer: Path | None = None,
    payloads: Sequence[str] = (),
) -> Usd.Stage:
    """Opens the stage of a file.

    Args:
        file: USD file with ending .usd, .usda, .usdc or .usdz.
        variants: Variant selections (``select_variants``).
        overrides: Layer whose content is copied into the session layer, such as another stage's
            session layer.
        mask: Paths of prims to keep, with everything that they need (see ``populate``); if empty,
            all prims are kept.
        session_layer: File whose opinions are stronger than the opinions of the stage; ``variants``
            override both.
        payloads: Patterns of prims whose payloads are loaded (see ``load_payloads``); if empty, all
            payloads are loaded.

    Raises:
        WavecombError: A file cannot be read, or a variant, prim or payload does not exist.
    """
    file = Path(file)
    rule = Usd.Stage.LoadNone if payloads else Usd.Stage.LoadAll
    with abort_on_fifo():
        with _layers(file, session_layer, overrides) as (root, session):
            stage = Usd.Stage.Open(root, session, rule)
        if not stage:
            raise WavecombError(f"{file}: cannot be read as USD")
        mtlx.resolve(stage)
        select_variants(stage, variants or {})
        if variants:
            mtlx.resolve(stage)
        if payloads:
            load_payloads(stage, payloads)
            mtlx.resolve(stage)
        if mask:
            populate(stage, mask)
    return stage


def open_editable(
    file: Path, variants: Mapping[str, str] | None = None, report: LoadReport | None = None
) -> Usd.Stage:
    """Opens a stage that can be inspected and edited while another copy of it is loaded.

    In addition to ``open_stage``, this function resolves MaterialX files in unselected variants.
    Selecting other variants later therefore does not change layers that another thread reads.

    Args:
        file: USD file with ending .usd, .usda, .usdc or .usdz.
        variants: Variant selections (``select_variants``).
        report: Receives USD's messages; None discards them.
    """
    with capture_diagnostics(LoadReport() if report is None else report):
        stage = open_stage(file, variants)
        mtlx.resolve(stage, everywhere=True)
        return stage


def _check_file(file: Path) -> None:
    try:
        check_name(file)
        check_regular(file)
    except OSError as error:
        raise WavecombError(str(error)) from None
    if not file.exists():
        raise WavecombError(f"{file}: no such file")
    if file.is_dir():
        raise WavecombError(f"{file}: is a folder; name the stage in it")
    if not Usd.Stage.IsSupportedFile(str(file)):
        raise WavecombError(f"{file}: not a USD file; use .usd, .usda, .usdc or .usdz")


def _session(file: Path) -> Sdf.Layer:
    """Returns the layer of a file; the layer remains open while a stage refers to it."""
    try:
        layer = Sdf.Layer.FindOrOpen(str(file))
    except Tf.ErrorException as error:
        raise WavecombError(f"{file}: cannot be read as USD: {first_message(error)}") from None
    if not layer:
        raise WavecombError(f"{file}: cannot be read as USD")
    return layer


def select_variants(stage: Usd.Stage, variants: Mapping[str, str]) -> None:
    """Selects variants in the session layer, such as ``{"/World/Car{paint}": "red"}``.

    Raises:
        WavecombError: The prim, variant set or variant does not exist.
    """
    if variants:
        stage.SetEditTarget(stage.GetSessionLayer())
    for key, choice in variants.items():
        where, _, name = key.rpartition("{") if "{" in key else ("", "", key)
        name = name.rstrip("}")
        if where and not Sdf.Path.IsValidPathString(where):
            raise WavecombError(f"variant {key}: {where} is not a prim path")
        prim = stage.GetPrimAtPath(where) if where else stage.GetDefaultPrim()
        if not prim:
            raise WavecombError(f"variant {key}: no prim {where or '(the stage has no default)'}")
        sets = prim.GetVariantSets()
        if name not in sets.GetNames():
            known = ", ".join(sets.GetNames()) or "none"
            raise WavecombError(f"variant {key}: {prim.GetPath()} has the sets: {known}")
        variant_set = sets.GetVariantSet(name)
        if choice not in variant_set.GetVariantNames():
            known = ", ".join(variant_set.GetVariantNames()) or "none"
            raise WavecombError(f"variant {key}={choice}: there are {known}")
        variant_set.SetVariantSelection(choice)


_changed: dict[str, Sdf.Layer] = {}
"""Layers that this process has changed, by identifier. These layers are never released, since USD
would otherwise reload them without the changes."""


def change_layers(layers: Iterable[Sdf.Layer]) -> None:
    """Applies the path maps of this process to layers and to all layers to which these refer.

    Call this function before composition. It changes the absolute paths of layers, textures and
    other files in memory only. Relative paths need no change.
    """
    pairs = own_maps()
    if not pairs:
        return
    left = list(layers)
    while left:
        layer = left.pop()
        if layer.identifier in _changed:
            continue
        _changed[layer.identifier] = layer
        if layer.permissionToEdit:
            UsdUtils.ModifyAssetPaths(layer, lambda path: mapped(path, pairs))
        for name in layer.GetCompositionAssetDependencies():
            if name and not name.lower().endswith(".mtlx"):
                # USD reports unreadable layers when it composes the stage.
                with suppress(Tf.ErrorException):
                    other = Sdf.Layer.FindOrOpenRelativeToLayer(layer, name)
                    if other:
                        left.append(other)
