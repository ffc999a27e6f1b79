# SPDX-License-Identifier: Apache-2.0
"""USD files to open stages; what is chosen of a stage before it is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pxr import Sdf, Tf, Usd, UsdGeom

from wavecomb.errors import WavecombError
from wavecomb.usd.diagnostics import commentary
from wavecomb.usd.light import KINDS as LIGHT_KINDS


@dataclass(frozen=True)
class Survey:
    """What a stage holds, seen or not, those inside instances too, in the stage's order.

    Attributes:
        cameras: Prim paths of all cameras.
        lights: Prim paths of all lights that Wavecomb knows.
    """

    cameras: tuple[str, ...] = ()
    lights: tuple[str, ...] = ()


def survey(stage: Usd.Stage) -> Survey:
    """Looks for cameras and lights, in one pass over the stage."""
    cameras: list[str] = []
    lights: list[str] = []
    kinds: dict[str, list[str] | None] = {}
    for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
        name = prim.GetTypeName()
        if name not in kinds:
            camera = cameras if prim.IsA(UsdGeom.Camera) else None
            kinds[name] = lights if name in LIGHT_KINDS else camera
        found = kinds[name]
        if found is not None:
            found.append(str(prim.GetPath()))
    return Survey(tuple(cameras), tuple(lights))


def open_stage(
    file: Path,
    variants: Mapping[str, str] | None = None,
    overrides: Sdf.Layer | None = None,
) -> Usd.Stage:
    """The stage of a file, with all payloads.

    Args:
        file: .usd, .usda, .usdc or .usdz.
        variants: Selections, as ``select_variants`` makes them.
        overrides: Such as another stage's session layer; copied into this one's.

    Raises:
        WavecombError: It is none, or cannot be read, or has no such variants.
    """
    if not file.exists():
        raise WavecombError(f"{file}: no such file")
    if file.is_dir():
        raise WavecombError(f"{file}: is a folder; name the stage in it")
    if not Usd.Stage.IsSupportedFile(str(file)):
        raise WavecombError(f"{file}: not a USD file; use .usd, .usda, .usdc or .usdz")
    try:
        session = Sdf.Layer.CreateAnonymous("session.usda")
        if overrides is not None:
            session.TransferContent(overrides)
        root = Sdf.Layer.FindOrOpen(str(file))
        stage = Usd.Stage.Open(root, session, Usd.Stage.LoadAll) if root else None
    except Tf.ErrorException as error:
        raise WavecombError(f"{file}: cannot be read as USD: {commentary(error)}") from None
    if not stage:
        raise WavecombError(f"{file}: cannot be read as USD")
    select_variants(stage, variants or {})
    return stage


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


def time_code(stage: Usd.Stage, frame: float | None) -> Usd.TimeCode:
    """A frame, else the stage's start, else default values."""
    if frame is not None:
        return Usd.TimeCode(frame)
    if stage.HasAuthoredTimeCodeRange():
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.Default()
