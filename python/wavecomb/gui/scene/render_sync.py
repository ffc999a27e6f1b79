# SPDX-License-Identifier: Apache-2.0
"""Applies edits of a stage to the rendered scene, without loading the stage again if possible.

Edits of visibility and variants add or remove objects of the scene, so the stage is loaded again.
Edits of transforms move objects of the scene if it can follow the edit (``transforms``). Edits of
constants inside a material graph or a texture reader also load the stage again.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Sdf, Usd

from wavecomb.gui.scene.light_inputs import BRIGHTNESS, LightInput, inputs_of, light_inputs
from wavecomb.gui.scene.stage_edits import Key, StageEdits, Step
from wavecomb.gui.scene.transforms import Placements, changed_transforms, moves_alone
from wavecomb.gui.viewport.engine import Edit
from wavecomb.usd.materials.parameters import (
    IN_INSTANCE,
    Parameter,
    as_stored,
    light_transform,
    light_values,
    material_parameters,
    surface_values,
)
from wavecomb.usd.stage.context import to_scene_space

if TYPE_CHECKING:
    from wavecomb.gui.viewport.session import Session


class RenderSync:
    """Base class of ``SceneEdits``. Reads the stage's materials and lights and updates the render.

    Attributes:
        session: The session whose rendered scene is updated.
        stage_edits: Edits of the session's open stage.
        placements: Prims that were moved since the stage was loaded.
        dragging: Whether further changes of a transform will follow, so that reduced images
            suffice.
    """

    session: Session
    stage_edits: StageEdits
    placements: Placements
    dragging = False

    @property
    def time(self) -> Usd.TimeCode:
        """Time code at which the attributes of the stage are read."""
        return self.stage_edits.time

    def prim(self, path: str) -> Usd.Prim:
        """Returns the prim at a path, or an invalid prim if there is none."""
        if not path or not Sdf.Path.IsValidPathString(path):
            return Usd.Prim()
        return self.stage_edits.stage.GetPrimAtPath(path)

    # ---- materials -----------------------------------------------------------------------------

    def parameters(self, path: str) -> dict[str, Parameter]:
        """Returns the parameters of a material by name; none if the material does not exist."""
        prim = self.prim(path)
        return material_parameters(prim, self.time) if prim else {}

    def parameter_value(self, path: str, parameter: Parameter) -> Any:
        """Returns the current value of a material parameter."""
        return self.stage_edits.values.get((Sdf.Path(path), f"!{parameter.name}"), parameter.value)

    def is_edited(self, path: str, parameter: Parameter) -> bool:
        """Returns whether a material parameter was edited in this window."""
        attribute = parameter.attribute
        if attribute is None:
            return (Sdf.Path(path), f"!{parameter.name}") in self.stage_edits.values
        return self.stage_edits.opinion((attribute.GetPrimPath(), f".{attribute.name}")) is not None

    def material_ids(self, path: str) -> list[int]:
        """Returns the indices of the scene's materials that come from a material prim.

        A prim has several materials if primvars of meshes provide different values.
        """
        stage = self.session.stage
        paths = stage.material_paths if stage is not None else ()
        return [i for i, one in enumerate(paths) if one == path]

    # ---- lights --------------------------------------------------------------------------------

    def light_reason(self, path: str) -> str:
        """Returns why edits of a light cannot be saved, or "" if they can."""
        prim = self.prim(path)
        if not prim:
            return "it is not on the stage"
        return IN_INSTANCE if prim.IsInstanceProxy() else ""

    def light_value(self, path: str, name: str) -> Any:
        """Returns the current value of a light input, one of ``light_inputs()``.

        If the edits of a light cannot be saved, the value is a factor on the light's authored
        colour.
        """
        known = light_inputs()[name]
        if self.light_reason(path):
            return self.stage_edits.values.get((light_prim(path), f"!{name}"), known.default)
        return known.read(self.prim(path), self.time)

    def light_fields(self, path: str) -> list[LightInput]:
        """Returns the editable inputs of a light.

        Only brightness is editable if edits cannot be saved.
        """
        return list(BRIGHTNESS) if self.light_reason(path) else inputs_of(self.prim(path))

    def light_key(self, path: str, name: str) -> Key:
        """Returns the edit key of a light's input."""
        if self.light_reason(path):
            return light_prim(path), f"!{name}"
        return Sdf.Path(path), f".{light_inputs()[name].attribute}"

    def light_is_edited(self, path: str, name: str) -> bool:
        """Returns whether an input of a light was edited in this window."""
        return self.stage_edits.opinion(self.light_key(path, name)) is not None

    # ---- into the render -----------------------------------------------------------------------

    def make_step(self, step: Step) -> None:
        """Applies an undo step to the stage and updates the render."""
        before = {} if step.structural else self.structures(step.prims)
        moved = {path for path, what in step.after if ".xformOp" in what}
        follows = all(self.can_follow(path) for path in moved)
        objects = {path for path in moved if not moves_alone(self.prim(str(path)), self.time)}
        for path in objects if follows else ():
            self.placements.begin(path)
        changed = changed_transforms(self.stage_edits.stage, partial(self.stage_edits.apply, step))
        structural = step.structural or not follows or not changed <= moved
        if structural or self.structures(step.prims) != before:
            self.session.rebuild(step.label)
            return
        self.show_step(step)
        if objects:
            self._move(objects)

    def can_follow(self, path: Sdf.Path) -> bool:
        """Returns whether the render can follow a prim's transform without loading the stage."""
        if moves_alone(self.prim(str(path)), self.time):
            return True
        return not self.session.is_reading and self.placements.can_follow(path, self._is_rendered)

    def _is_rendered(self, path: str) -> bool:
        scene, stage = self.session.scene, self.session.stage
        if scene is None or stage is None:
            return False
        lights = (one for one in stage.light_paths if one == path or one.startswith(path + "/"))
        return scene.bounds_of(path) is not None or any(lights)

    def _move(self, prims: Iterable[Sdf.Path]) -> None:
        """Moves the rendered objects and lights at or below prims to their current positions."""
        stage = self.session.stage
        if stage is None:
            return
        edit = Edit(moves=self.placements.moves(stage.origin))
        for number, light in enumerate(stage.light_paths):
            # Lights may also have moved on their own, which the moves of the scene do not include.
            below = light and any(Sdf.Path(light).HasPrefix(path) for path in prims)
            if below and not self.light_reason(light):
                now = light_transform(self.prim(light), self.time)
                edit.lights[number] = {"transform": to_scene_space(now, stage.origin)}
        self.session.edit_all(edit, moving=self.dragging)

    def load_refused(self, reason: str) -> None:
        """Loads the stage again, because the scene could not follow a transform."""
        self.placements.refuse()
        self.session.rebuild("moved objects")

    def _materials_of(self, prim: Sdf.Path) -> set[str]:
        """Returns the scene's materials whose prim is the given prim or one of its ancestors."""
        path, stage = str(prim), self.session.stage
        known = {one for one in stage.material_paths if one} if stage is not None else set()
        return {one for one in known if path == one or path.startswith(one + "/")}

    def live_values(self, path: str) -> dict[str, Any]:
        """Returns the edited material values that have no attribute on the stage."""
        own = Sdf.Path(path)
        known = self.stage_edits.values.items()
        return {what[1:]: value for (prim, what), value in known if prim == own}

    def can_show(self, path: str, name: str, value: Any) -> bool:
        """Returns whether the render can show an edited value without loading the stage again."""
        known = self.live_values(path)
        before = surface_values(self.prim(path), self.time, known)
        after = surface_values(self.prim(path), self.time, {**known, name: value})
        return before is None or after is None or before.structure == after.structure

    def structures(self, prims: Iterable[Sdf.Path]) -> dict[str, str]:
        """Returns a text for each affected material that identifies its textures and graphs.

        An existing scene cannot change textures and graphs.
        """
        out = {}
        for path in {one for prim in prims for one in self._materials_of(prim)}:
            found = surface_values(self.prim(path), self.time)
            if found is not None:
                out[path] = found.structure
        return out

    def show_step(self, step: Step) -> None:
        """Updates the rendered scene after an undo step."""
        stage = self.session.stage
        if stage is None:
            return
        emission = any("emissi" in what for _, what in step.after)
        if emission and not stage.lights:
            # The loader adds a default dome light to a stage without lights and emissive materials.
            # Load the stage again, since the edit may have changed this condition.
            self.session.rebuild(step.label)
        for prim in step.prims:
            for light in {one for one in stage.light_paths if light_prim(one) == prim}:
                self._sync_light(light)
            for material in self._materials_of(prim):
                self._sync_material(material)

    def _sync_material(self, path: str) -> None:
        """Updates the scene's materials that come from a prim with the stage's current values."""
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
            # Leave out values that a value graph computes, since a primvar of a mesh may replace
            # them.
            values = {
                name: value
                for name, value in wanted.items()
                if name not in have.get("driven", ()) and as_stored(have[name]) != value
            }
            if values:
                self.session.edit_material(number, **values)
            # The edit is in the USD stage, so it need not be repeated after the stage is loaded
            # again.
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
            if on_stage is not None:
                now = to_scene_space(light_transform(self.prim(path), self.time), stage.origin)
                if not np.allclose(now, have["transform"], rtol=1e-5, atol=1e-6):
                    values["transform"] = now
            if values:
                self.session.edit_light(number, moving=self.dragging, **values)
        self.session.light_edits.clear()


def light_prim(path: str) -> Sdf.Path:
    """Returns the edit key of a light. The default dome light gets a path that no prim has."""
    return Sdf.Path(path) if path else Sdf.Path("/soft_dome_of_wavecomb")
