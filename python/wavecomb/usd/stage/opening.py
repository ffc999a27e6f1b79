# SPDX-License-Identifier: Apache-2.0
"""USD files to open stages; what is chosen of a stage before it is read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from pxr import Sdf, Tf, Usd, UsdGeom, UsdRender, UsdUtils

from wavecomb.errors import WavecombError
from wavecomb.path_maps import mapped, own_maps
from wavecomb.picture.files import check_name, check_regular
from wavecomb.run.isolate import patience, trail
from wavecomb.usd import mtlx
from wavecomb.usd.lights.light import KINDS as LIGHT_KINDS
from wavecomb.usd.stage.diagnostics import captured, commentary
from wavecomb.usd.stage.fifos import refused_fifos
from wavecomb.usd.stage.population import every, load_payloads, populate
from wavecomb.usd.stage.report import LoadReport

MAX_SURVEYED = 4096
"""Cameras and lights that are listed; instances may multiply them."""


@dataclass(frozen=True)
class Survey:
    """What a stage holds, seen or not, those inside instances too, in the stage's order.

    Attributes:
        cameras: Prim paths of all cameras.
        lights: Prim paths of all lights that Wavecomb knows; of both together ``MAX_SURVEYED``.
    """

    cameras: tuple[str, ...] = ()
    lights: tuple[str, ...] = ()


def survey(stage: Usd.Stage) -> Survey:
    """Looks for cameras and lights, in one pass over the stage."""
    cameras: list[str] = []
    lights: list[str] = []
    kinds: dict[str, list[str] | None] = {}

    def kind(prim: Usd.Prim) -> list[str] | None:
        name = prim.GetTypeName()
        if name not in kinds:
            camera = cameras if prim.IsA(UsdGeom.Camera) else None
            kinds[name] = lights if name in LIGHT_KINDS else camera
        return kinds[name]

    for prim in islice(every(stage, lambda prim: kind(prim) is not None), MAX_SURVEYED):
        found = kind(prim)
        if found is not None:
            found.append(str(prim.GetPath()))
    return Survey(tuple(cameras), tuple(lights))


_RENDER_RELATIONS = ("products", "orderedVars", "camera")


def open_render_settings(
    file: Path, wanted: str | None = None, session_layer: Path | None = None
) -> Usd.Stage:
    """The stage of a file with nothing but its render settings and the cameras they name.

    Who holds it while the stage is opened whole saves reading the layers again.

    Args:
        file: .usd, .usda, .usdc or .usdz.
        wanted: Path of settings that are not under /Render.
        session_layer: As ``open_stage`` takes it.

    Raises:
        WavecombError: A file is none, or cannot be read.
    """
    with refused_fifos(), _layers(file, session_layer) as (root, session):
        paths = {"/Render", wanted or "", _settings_path(root), _settings_path(session)}
        kept = {path for path in map(_prim_path, paths) if path is not None}
        mask = Usd.StagePopulationMask(sorted(kept))
        stage = Usd.Stage.OpenMasked(root, session, mask, Usd.Stage.LoadAll)
        # Settings name products, these name vars, and both name cameras. (ExpandPopulationMask
        # with predicates of Python's can wait for itself.)
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
    """Root and session layer of a stage, to be composed within the time that it may take.

    Arguments are those of ``open_stage``; errors of USD become WavecombError.
    """
    _check_file(file)
    if session_layer is not None:
        _check_file(session_layer)
    trail.note("opening", file)
    try:
        session = Sdf.Layer.CreateAnonymous("session.usda")
        if overrides is not None:
            session.TransferContent(overrides)
        if session_layer is not None:
            session.subLayerPaths.append(_session(session_layer).identifier)
        with patience.watched(file):
            root = Sdf.Layer.FindOrOpen(str(file))
            if not root:
                raise WavecombError(f"{file}: cannot be read as USD")
            change_layers((root, session))
            yield root, session
    except Tf.ErrorException as error:
        raise WavecombError(f"{file}: cannot be read as USD: {commentary(error)}") from None


def _named_by(stage: Usd.Stage) -> set[Sdf.Path]:
    """Prims that render settings and products point to."""
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
    """The path of a prim in the world; None for any other text."""
    if not text.startswith("/") or not Sdf.Path.IsValidPathString(text):
        return None
    path = Sdf.Path(text)
    return path if path.IsPrimPath() else None


def open_stage(
    file: Path,
    variants: Mapping[str, str] | None = None,
    overrides: Sdf.Layer | None = None,
    mask: Sequence[str] = (),
    session_layer: Path | None = None,
    payloads: Sequence[str] = (),
) -> Usd.Stage:
    """The stage of a file.

    Args:
        file: .usd, .usda, .usdc or .usdz.
        variants: Selections, as ``select_variants`` makes them.
        overrides: Such as another stage's session layer; copied into this one's.
        mask: Paths of prims to keep, with what they need; none: all (``populate``).
        session_layer: File with opinions that are stronger than the stage's; variants that are
            selected here are stronger still.
        payloads: Patterns of prims whose payloads are loaded (``load_payloads``); none: all.

    Raises:
        WavecombError: A file is none, or cannot be read; there are no such variants, prims or
            payloads.
    """
    rule = Usd.Stage.LoadNone if payloads else Usd.Stage.LoadAll
    with refused_fifos():
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
    """The stage of a file, to be looked at and edited while another one of it is loaded.

    It is the stage that ``open_stage`` opens. MaterialX files are resolved in variants that are not
    selected, too: selecting them later changes no layer, on whatever thread another stage reads.

    Args:
        file: As ``open_stage`` takes it.
        variants: Likewise.
        report: Is told what USD says; None: nobody is.
    """
    with captured(LoadReport() if report is None else report):
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
    """The layer of a file, which a stage that names it keeps open."""
    try:
        layer = Sdf.Layer.FindOrOpen(str(file))
    except Tf.ErrorException as error:
        raise WavecombError(f"{file}: cannot be read as USD: {commentary(error)}") from None
    if not layer:
        raise WavecombError(f"{file}: cannot be read as USD")
    return layer


def select_variants(stage: Usd.Stage, variants: Mapping[str, str]) -> None:
    """Makes variant selections in the session layer: ``{"/World/Car{paint}": "red"}``.

    Raises:
        WavecombError: There is no such prim, set or variant.
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
"""By identifier. Held as long as the process: a layer that is let go would be read anew."""


def change_layers(layers: Iterable[Sdf.Layer]) -> None:
    """Changes names in layers, and in all that they name, where this process has maps.

    Layers are changed in memory only, before they are composed: each absolute name in them, of
    layers, textures and all other files. Names that are relative need nothing.
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
                # Of one that cannot be read the stage tells when it is composed.
                with suppress(Tf.ErrorException):
                    other = Sdf.Layer.FindOrOpenRelativeToLayer(layer, name)
                    if other:
                        left.append(other)
