# SPDX-License-Identifier: Apache-2.0
"""Brings edits of a stage into the scene that is rendered, without reading it again.

What is visible and which variants are chosen decides what is in the scene: that is read again.
So are constants that are part of a graph, or of how a texture is read.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from pxr import Sdf, Usd

from wavecomb.gui.scene.light_inputs import BRIGHTNESS, LightInput, inputs_of, light_inputs
from wavecomb.gui.scene.stage_edits import Key, StageEdits, Step
from wavecomb.usd.looks.parameters import (
    IN_INSTANCE,
    Parameter,
    as_stored,
    light_values,
    material_parameters,
)
from wavecomb.usd.looks.surface_values import surface_values

if TYPE_CHECKING:
    from wavecomb.gui.viewport.session import Session


class RenderSync:
    """Base of ``SceneEdits``: materials and lights of the edited stage, and their render.

    Attributes:
        session: The session whose scene follows the edits.
        stage_edits: Edits of the stage that it has open.
    """

    session: Session
    stage_edits: StageEdits

    @property
    def time(self) -> Usd.TimeCode:
        """Time code at which attributes are read."""
        return self.stage_edits.time

    def prim(self, path: str) -> Usd.Prim:
        """Returns a prim by path, an invalid one if there is none."""
        if not path or not Sdf.Path.IsValidPathString(path):
            return Usd.Prim()
        return self.stage_edits.stage.GetPrimAtPath(path)

    # ---- materials -----------------------------------------------------------------------------

    def parameters(self, path: str) -> dict[str, Parameter]:
        """Parameters of a material by name; empty of one that no prim is there for."""
        prim = self.prim(path)
        return material_parameters(prim, self.time) if prim else {}

    def parameter_value(self, path: str, parameter: Parameter) -> Any:
        """What a parameter is now."""
        return self.stage_edits.values.get((Sdf.Path(path), f"!{parameter.name}"), parameter.value)

    def is_edited(self, path: str, parameter: Parameter) -> bool:
        """Whether a parameter was changed here."""
        attribute = parameter.attribute
        if attribute is None:
            return (Sdf.Path(path), f"!{parameter.name}") in self.stage_edits.values
        return self.stage_edits.opinion((attribute.GetPrimPath(), f".{attribute.name}")) is not None

    def material_ids(self, path: str) -> list[int]:
        """The materials that a prim gave: several where meshes bring values of their own."""
        stage = self.session.stage
        paths = stage.material_paths if stage is not None else ()
        return [i for i, one in enumerate(paths) if one == path]

    # ---- lights --------------------------------------------------------------------------------

    def light_reason(self, path: str) -> str:
        """Why edits of a light cannot be saved; "" where they can."""
        prim = self.prim(path)
        if not prim:
            return "it is not on the stage"
        return IN_INSTANCE if prim.IsInstanceProxy() else ""

    def light_value(self, path: str, name: str) -> Any:
        """One of ``light_inputs()`` as it is now.

        Of a light whose edits cannot be saved: what its colour on the stage is multiplied by.
        """
        known = light_inputs()[name]
        if self.light_reason(path):
            return self.stage_edits.values.get((light_prim(path), f"!{name}"), known.default)
        return known.read(self.prim(path), self.time)

    def light_fields(self, path: str) -> list[LightInput]:
        """What of a light can be edited: where that cannot be saved, its brightness alone."""
        return list(BRIGHTNESS) if self.light_reason(path) else inputs_of(self.prim(path))

    def light_key(self, path: str, name: str) -> Key:
        """Where an input of a light is edited."""
        if self.light_reason(path):
            return light_prim(path), f"!{name}"
        return Sdf.Path(path), f".{light_inputs()[name].attribute}"

    def light_is_edited(self, path: str, name: str) -> bool:
        """Whether an input of a light was changed here."""
        return self.stage_edits.opinion(self.light_key(path, name)) is not None

    # ---- into the render -----------------------------------------------------------------------

    def make_step(self, step: Step) -> None:
        """Makes a step on the stage and updates the render."""
        before = {} if step.structural else self.structures(step.prims)
        self.stage_edits.apply(step)
        if step.structural or self.structures(step.prims) != before:
            self.session.rebuild(step.label)
        else:
            self.show_step(step)

    def _materials_of(self, prim: Sdf.Path) -> set[str]:
        """Materials in use that a prim is, or is in."""
        path, stage = str(prim), self.session.stage
        known = {one for one in stage.material_paths if one} if stage is not None else set()
        return {one for one in known if path == one or path.startswith(one + "/")}

    def live_values(self, path: str) -> dict[str, Any]:
        """What was changed of a material and no attribute holds."""
        own = Sdf.Path(path)
        known = self.stage_edits.values.items()
        return {what[1:]: value for (prim, what), value in known if prim == own}

    def can_show(self, path: str, name: str, value: Any) -> bool:
        """Whether a value that no attribute can hold can be brought into the picture."""
        known = self.live_values(path)
        before = surface_values(self.prim(path), self.time, known)
        after = surface_values(self.prim(path), self.time, {**known, name: value})
        return before is None or after is None or before.structure == after.structure

    def structures(self, prims: Iterable[Sdf.Path]) -> dict[str, str]:
        """What of materials cannot be edited in the scene that there is."""
        out = {}
        for path in {one for prim in prims for one in self._materials_of(prim)}:
            found = surface_values(self.prim(path), self.time)
            if found is not None:
                out[path] = found.structure
        return out

    def show_step(self, step: Step) -> None:
        """Brings a step into the scene that is rendered."""
        stage = self.session.stage
        if stage is None:
            return
        emission = any("emissi" in what for _, what in step.after)
        if emission and not stage.lights:
            # Whether a stage without lights gets the soft dome goes by what its materials emit.
            self.session.rebuild(step.label)
        for prim in step.prims:
            for light in {one for one in stage.light_paths if light_prim(one) == prim}:
                self._sync_light(light)
            for material in self._materials_of(prim):
                self._sync_material(material)

    def _sync_material(self, path: str) -> None:
        """Gives the materials of a prim the values that the stage has now."""
        scene = self.session.scene
        if scene is None:
            return
        surface = surface_values(self.prim(path), self.time, self.live_values(path))
        if surface is not None:
            wanted = {name: as_stored(value) for name, value in surface.constants.items()}
        else:
            wanted = {
                name: as_stored(self.parameter_value(path, parameter))
                for name, parameter in self.parameters(path).items()
                if not parameter.driven_by
            }
        for number in self.material_ids(path):
            if number >= len(scene.materials):
                continue
            have = scene.material(number)
            have |= have.get("openpbr", {})
            # A mesh may bring a value for a name, which a graph reads then.
            values = {
                name: value
                for name, value in wanted.items()
                if name not in have.get("driven", ()) and as_stored(have[name]) != value
            }
            if values:
                self.session.edit_material(number, **values)
            # The stage holds the edit: it comes with the next reading.
            self.session.material_edits.pop(have["name"], None)

    def _sync_light(self, path: str) -> None:
        scene, stage = self.session.scene, self.session.stage
        if scene is None or stage is None:
            return
        on_stage = None
        if not self.light_reason(path):
            on_stage = light_values(self.prim(path), self.time)
        for number, one in enumerate(stage.light_paths):
            if one != path or number >= scene.light_count:
                continue
            wanted = on_stage
            if wanted is None:
                tint = self.light_value(path, "color")
                power = self.light_value(path, "intensity") * 2.0 ** self.light_value(
                    path, "exposure"
                )
                base = stage.scene.light(number)["color"]
                wanted = {"color": tuple(b * t * power for b, t in zip(base, tint, strict=True))}
            have = scene.light(number)
            values = {
                name: value
                for name, value in wanted.items()
                if as_stored(have[name]) != as_stored(value)
            }
            if values:
                self.session.edit_light(number, **values)
        self.session.light_edits.clear()


def light_prim(path: str) -> Sdf.Path:
    """The key of a light; of the soft dome, which is no prim, one that no prim has."""
    return Sdf.Path(path) if path else Sdf.Path("/soft_dome_of_wavecomb")
