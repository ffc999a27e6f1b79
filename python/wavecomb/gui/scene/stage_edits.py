# SPDX-License-Identifier: Apache-2.0
"""Plans, applies and lists edits of a stage, which are stored in its session layer.

Independent of Qt.

Edits must be used on the thread that owns the stage. Edits never write to the files of the stage.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pxr import Sdf, Usd

from wavecomb.errors import WavecombError
from wavecomb.gui.scene.visibility import hide, show, uneditable

Key = tuple[Sdf.Path, str]
"""Key of an edit: the path of a prim, and a text. The text is ``.NAME`` for an attribute,
``{NAME}`` for a variant set, or ``!NAME`` for a value that has no attribute on the stage."""


@dataclass(frozen=True)
class Opinion:
    """Value that the session layer contains for an edit key.

    Attributes:
        value: Value of the attribute, or name of the variant.
        type_name: Type of the attribute.
    """

    value: Any
    type_name: Sdf.ValueTypeName | None = None


@dataclass(frozen=True)
class VariantSet:
    """A variant set of a prim; ``choice`` is "" if no variant is selected."""

    name: str
    choices: tuple[str, ...]
    choice: str


@dataclass(frozen=True)
class Solo:
    """Path of the light that is shown alone, or None, and the earlier visibility of all lights."""

    path: str | None = None
    before: Mapping[Key, Opinion | None] = field(default_factory=dict)


@dataclass(frozen=True)
class Step:
    """One undo step.

    Attributes:
        label: Displayed description, such as "intensity of /Key".
        before: Opinions before the step, by edit key; None means that there was no opinion.
        after: Opinions after the step, with the same edit keys.
        solo: Light shown alone before and after the step; None if the step does not change it.
    """

    label: str
    before: Mapping[Key, Opinion | None]
    after: Mapping[Key, Opinion | None]
    solo: tuple[Solo, Solo] | None = None

    def inverse(self) -> Step:
        """Returns a step that reverts this step."""
        solo = self.solo[::-1] if self.solo is not None else None
        return Step(f"undo {self.label}", self.after, self.before, solo)

    def then(self, later: Step) -> Step:
        """Returns this step merged with a later step.

        This step must contain all edit keys of the later step.
        """
        return Step(later.label, self.before, {**self.after, **later.after}, self.solo)

    @property
    def drags(self) -> bool:
        """Whether the step can be merged with other steps of a drag.

        Resetting a value is always a separate step.
        """
        return not self.structural and self.solo is None and None not in self.after.values()

    @property
    def structural(self) -> bool:
        """Whether the stage must be loaded again.

        This is necessary if visibility or variants change.
        """
        return any(what == ".visibility" or what.startswith("{") for _, what in self.after)

    @property
    def prims(self) -> tuple[Sdf.Path, ...]:
        """Paths of the prims that the step edits."""
        return tuple(dict.fromkeys(path for path, _ in self.after))


@dataclass
class StageEdits:
    """Edits of one USD stage, stored in its session layer.

    Attributes:
        stage: The edited stage.
        time: Time code at which the attributes of the stage are read.
        values: Edited values that have no attribute on the stage, by prim and parameter name.
            Values without an attribute affect the image but cannot be saved.
    """

    stage: Usd.Stage
    time: Usd.TimeCode
    values: dict[Key, Any] = field(default_factory=dict)

    # ---- what there is -------------------------------------------------------------------------

    def variant_sets(self, path: Sdf.Path) -> list[VariantSet]:
        """Returns the variant sets of a prim."""
        prim = self.stage.GetPrimAtPath(path)
        if not prim or not prim.HasVariantSets():
            return []
        sets = prim.GetVariantSets()
        out = []
        for name in sets.GetNames():
            one = sets.GetVariantSet(name)
            out.append(VariantSet(name, tuple(one.GetVariantNames()), one.GetVariantSelection()))
        return out

    def opinion(self, key: Key) -> Opinion | None:
        """Returns the edited value of an edit key, or None if there is no edit."""
        path, what = key
        if what.startswith("!"):
            return Opinion(self.values[key]) if key in self.values else None
        spec = self.stage.GetSessionLayer().GetPrimAtPath(path)
        if not spec:
            return None
        if what.startswith("{"):
            name = what[1:-1]
            chosen = _selections(spec)
            return Opinion(chosen[name]) if name in chosen else None
        attribute = spec.attributes.get(what[1:])
        if attribute is None or not attribute.HasInfo("default"):
            return None
        return Opinion(attribute.default, attribute.typeName)

    def edited(self) -> list[Key]:
        """Returns the keys of all edits, sorted in the order of the stage's prims.

        Edits that cannot be saved come last.
        """
        found: list[Key] = []

        def visit(path: Sdf.Path) -> None:
            spec = layer.GetObjectAtPath(path)
            if isinstance(spec, Sdf.AttributeSpec) and spec.HasInfo("default"):
                found.append((path.GetPrimPath(), f".{path.name}"))
            elif isinstance(spec, Sdf.PrimSpec) and spec.HasInfo("variantSelection"):
                found.extend((path, f"{{{name}}}") for name in _selections(spec))

        layer = self.stage.GetSessionLayer()
        layer.Traverse(Sdf.Path.absoluteRootPath, visit)
        return [*sorted(found), *sorted(self.values)]

    def lines(self) -> list[str]:
        """Returns descriptions of the edits, one line each."""
        out = []
        for key in self.edited():
            path, what = key
            known = self.opinion(key)
            value = _text(known.value) if known is not None else ""
            if what.startswith("!"):
                out.append(f"{path} {what[1:]} = {value} (not saved: no attribute can hold it)")
            else:
                out.append(f"{path}{what} = {value}")
        return out

    # ---- changes: each returns a step for ``apply``, or None if nothing would change
    # ------------------

    def visible(self, paths: Iterable[Sdf.Path], visible: bool) -> Step | None:
        """Returns an undo step that shows or hides prims.

        The step authors the same opinions as ``UsdGeom.Imageable.MakeVisible`` or
        ``MakeInvisible``.

        Raises:
            WavecombError: A prim is inside an instance.
        """
        wanted = list(paths)
        opinions: dict[Key, Opinion | None] = {}
        for path in wanted:
            prim = self.stage.GetPrimAtPath(path)
            reason = uneditable(prim)
            if reason:
                raise WavecombError(f"{path}: its visibility cannot be changed: {reason}")
            hidden = {at[0]: one.value == "invisible" for at, one in opinions.items() if one}
            for at, word in (show if visible else hide)(prim, self.time, hidden).items():
                opinions[(at, ".visibility")] = Opinion(word, Sdf.ValueTypeNames.Token)
        name = str(wanted[0]) if len(wanted) == 1 else f"{len(wanted)} prims"
        return self.plan(f"{'show' if visible else 'hide'} {name}", opinions)

    def variant(self, path: Sdf.Path, name: str, choice: str | None) -> Step | None:
        """Returns an undo step that selects a variant; None restores the stage's selection.

        Raises:
            WavecombError: There is no such variant set or variant, or the prim is inside an
                instance.
        """
        prim = self.stage.GetPrimAtPath(path)
        if prim and (prim.IsInstanceProxy() or prim.IsInPrototype()):
            raise WavecombError(f"{path}: is inside an instance: choose variants of the instance")
        sets = {one.name: one for one in self.variant_sets(path)}
        if name not in sets or (choice is not None and choice not in sets[name].choices):
            known = ", ".join(sets[name].choices if name in sets else sets) or "none"
            raise WavecombError(f"{path}{{{name}={choice}}}: there is no such variant, but {known}")
        opinion = None if choice is None else Opinion(choice)
        return self.plan(f"{name} of {path}", {(path, f"{{{name}}}"): opinion})

    def plan(self, label: str, opinions: Mapping[Key, Opinion | None]) -> Step | None:
        """Returns an undo step that sets opinions, and removes those whose value is None."""
        before = {key: self.opinion(key) for key in opinions}
        step = Step(
            label,
            {key: old for key, old in before.items() if old != opinions[key]},
            {key: new for key, new in opinions.items() if before[key] != new},
        )
        return step if step.after else None

    def apply(self, step: Step) -> None:
        """Applies an undo step."""
        layer = self.stage.GetSessionLayer()
        with Sdf.ChangeBlock():
            for (path, what), opinion in step.after.items():
                if what.startswith("!"):
                    if opinion is None:
                        self.values.pop((path, what), None)
                    else:
                        self.values[(path, what)] = opinion.value
                elif opinion is not None:
                    _author(layer, path, what, opinion)
                else:
                    _remove(layer, path, what)


def _selections(spec: Sdf.PrimSpec) -> dict[str, str]:
    """Returns the variant selections that are authored on a prim spec."""
    return dict(spec.GetInfo("variantSelection")) if spec.HasInfo("variantSelection") else {}


def _author(layer: Sdf.Layer, path: Sdf.Path, what: str, opinion: Opinion) -> None:
    prim = Sdf.CreatePrimInLayer(layer, path)
    if what.startswith("{"):
        prim.variantSelections[what[1:-1]] = opinion.value
        return
    name = what[1:]
    spec = prim.attributes.get(name)
    if spec is None:
        spec = Sdf.AttributeSpec(prim, name, opinion.type_name)
    spec.default = opinion.value


def _remove(layer: Sdf.Layer, path: Sdf.Path, what: str) -> None:
    prim = layer.GetPrimAtPath(path)
    if not prim:
        return
    if what.startswith("{"):
        if what[1:-1] in _selections(prim):
            del prim.variantSelections[what[1:-1]]
    elif what[1:] in prim.attributes:
        prim.RemoveProperty(prim.attributes[what[1:]])
    layer.ScheduleRemoveIfInert(prim)


def _text(value: Any) -> str:
    """Formats a value for display. Numbers have four digits."""
    if isinstance(value, str):
        return value
    if hasattr(value, "__len__"):
        return f"({', '.join(_text(part) for part in value)})"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
