# SPDX-License-Identifier: Apache-2.0
"""Load options of a stage: a table with a row for each field of ``LoadOptions``.

The rows determine the keyword arguments of ``load``, ``render``, ``render_frames`` and
``load_stage``, the options of commands, and the values in checkpoints.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields, replace
from numbers import Integral, Real
from typing import Any, cast

from wavecomb.errors import WavecombError

PURPOSES = ("default", "render", "proxy", "guide")
PROJECTIONS = ("perspective", "orthographic", "latlong")
WORKING_SPACES = ("rec709", "acescg")
LIGHT_SHAPES = ("visible", "hidden")
CATCH = ("through", "lit", "bare")


@dataclass(frozen=True)
class Row:
    """Description of a load option, for command lines and for checkpoints.

    Attributes:
        help: Description of the option in one sentence.
        kind: "text", "file", "number", "integer", "pair", "choice", "switch" (on or off), or "not"
            (a flag that disables something).
        unset: Description of the default value.
        option: Name of the command-line option; "" if there is none.
        metavar: Placeholder of the option's value in the help text.
        choices: Valid values.
        many: Whether the option may be repeated.
        least: Smallest number.
        most: Largest number.
        above: Whether valid numbers must be larger than ``least``, not equal to it.
        unit: Unit of the option's number.
    """

    help: str
    kind: str
    unset: str = ""
    option: str = ""
    metavar: str | None = None
    choices: tuple[str, ...] = ()
    many: bool = False
    least: float = -math.inf
    most: float = math.inf
    above: bool = False
    unit: str = ""

    def check(self, name: str, value: Any) -> None:
        """Raises WavecombError with ``name`` if a value is invalid. None is always valid."""
        if value is None:
            return
        for one in value if self.many and self.choices else (value,):
            if self.choices and one not in self.choices:
                raise WavecombError(f"no {name} {one!r}; there are {', '.join(self.choices)}")
        numbers = value if self.kind == "pair" else (value,)
        counts = {"number": 1, "integer": 1, "pair": 2}
        if self.kind not in counts:
            return
        is_whole = self.kind == "integer"
        good = len(numbers) == counts[self.kind] and all(
            isinstance(one, Integral if is_whole else Real) and self._is_in_range(one)
            for one in numbers
        )
        if not good:
            what = (
                "two numbers"
                if self.kind == "pair"
                else "a whole number"
                if is_whole
                else "a number"
            )
            unit = f" {self.unit}" if self.unit else ""
            raise WavecombError(f"{name} {value}{unit}: must be {what}{self._range_text()}")

    def _is_in_range(self, number: Any) -> bool:
        return bool(math.isfinite(number) and self.least <= number <= self.most) and not (
            self.above and number == self.least
        )

    def _range_text(self) -> str:
        if math.isfinite(self.most):
            return f" from {self.least:g} to {self.most:g}"
        if math.isfinite(self.least):
            return f" above {self.least:g}" if self.above else f" of at least {self.least:g}"
        return ""

    @property
    def key(self) -> str:
        """Key of the option in the arguments of a command and in checkpoints."""
        return self.option.removeprefix("--").replace("-", "_") + "s" * (
            self.many and self.option not in ("--mask", "--payloads")
        )


def _row(default: Any, text: str, kind: str, option: str = "", **more: Any) -> Any:
    return field(default=default, metadata={"row": Row(text, kind, option=option, **more)})


@dataclass(frozen=True)
class LoadOptions:
    """Load options of a stage. None means that the stage determines the value.

    Attributes:
        camera: Path or unique name of a camera prim. None uses the camera of the render settings,
            else the first camera of the stage, else a camera that frames the whole scene.
        frame: Time code. None means the stage's start time code, or default values if it has none.
        purposes: Purposes of the geometry: "default", "render", "proxy", "guide". None uses the
            purposes in the render settings, else "default" and "render".
        variants: Selected variants, such as {"/World/Car{paint}": "red"}. A key without a path
            means the default prim.
        mask: Paths or patterns (docs/stages.md) of the prims to render, with their descendants and
            everything they need. The default is all prims.
        payloads: Patterns of prims whose payloads are loaded, or only "none". All by default.
        holdouts: Prims that, with their descendants, cut black holes with alpha 0 into the image.
        catchers: Prims that, with descendants, show only received shadows (docs/visibility.md).
        catch: Kind of render, for a stage with shadow catchers. "through" is the main render,
            in which the camera does not see catchers. "lit" and "bare" are the renders of catchers
            with and without other objects.
        session_layer: Layer file whose opinions are stronger than the stage's opinions.
        subdivision: "off", a level from 0 to 10 for all subdivision surfaces, or "auto" to choose
            levels by the size of edges in the image (docs/subdivision.md).
        strand_pixels: Width in pixels below which curves are thinned out and the remaining curves
            are widened to this width (docs/hair.md). 0 disables thinning.
        shutter: Opening and closing time relative to the frame, in time codes; None uses the
            camera's shutter.
        motion_blur: Whether to render motion blur; None enables it unless the render settings
            disable it.
        motion_steps: Time steps of every motion, from 2 to 64. None chooses up to 8 as needed.
        depth_of_field: Whether to render depth of field; None enables it unless the render settings
            disable it.
        projection: "perspective", "orthographic" or "latlong"; None uses the camera's projection.
        exposure: Whether the camera's exposure scales the image.
        lens_settings: Lens settings such as {"lens_k1": "-0.1", "rolling_shutter": "top"}, which
            override the camera's attributes (docs/cameras.md).
        st_map: ST map image of the lens distortion, which replaces the distortion coefficients.
        render_settings: Path or name of a RenderSettings prim. None uses the prim that the stage
            names, else the only one below /Render (docs/cameras.md).
        product: Path or name of a product of the render settings; None uses the first product.
        texture_limit: Memory limit of textures and volume grids in MB (10^6 bytes); None means no
            limit. Textures beyond the limit are swapped to a temporary file (docs/textures.md).
        working_space: Working colour space: "rec709" or "acescg" (docs/textures.md).
        lights: "visible", or "hidden" to make the shapes of lights invisible to all rays while they
            still emit (docs/decisions/light-shapes.md).
        size: Width and height of the image for which "auto" chooses subdivision levels.
        threads: Number of threads for images, textures and subdivision; 0 uses all cores.
    """

    camera: str | None = _row(
        None,
        "Camera prim to render from, by path or unique name.",
        "text", "--camera", metavar="PATH",
        unset="of the render settings, else the first",
    )  # fmt: skip
    frame: float | None = _row(
        None,
        "Time code of the frame to render.",
        "number",
        "--frame",
        metavar="T",
        unset="the stage's start",
    )
    purposes: tuple[str, ...] | None = _row(
        None, "USD purpose of geometry to render (repeatable).", "choice", "--purpose", many=True,
        choices=PURPOSES, unset="of the render settings, else default and render",
    )  # fmt: skip
    variants: Mapping[str, str] | None = _row(
        None, "Variant to select (repeatable); SET=NAME alone applies to the default prim.", "text",
        "--variant", many=True, metavar="PRIM{SET}=NAME",
    )  # fmt: skip
    lights: str = _row(
        "visible",
        "Whether the shapes of lights are visible in the image; hidden lights still emit.",
        "choice", "--lights", choices=LIGHT_SHAPES, unset="visible",
    )  # fmt: skip
    shutter: tuple[float, float] | None = _row(
        None, "Opening and closing time of the shutter, in time codes relative to the frame.",
        "pair", "--shutter", metavar="OPEN CLOSE", unset="the camera's",
    )  # fmt: skip
    motion_blur: bool | None = _row(None, "Render without motion blur.", "not", "--no-motion-blur")
    motion_steps: int | None = _row(
        None,
        "Number of motion steps over the shutter interval.",
        "integer", "--motion-steps", metavar="N",
        least=2, most=64, unset="as needed, 2 to 8",
    )  # fmt: skip
    render_settings: str | None = _row(
        None,
        "Render settings prim to use, by path or name.",
        "text", "--render-settings", metavar="PATH",
        unset="the stage's, else the only ones under /Render",
    )  # fmt: skip
    product: str | None = _row(
        None,
        "Render product prim to render, by path or name.",
        "text", "--product", metavar="PATH",
        unset="all for render, else the first",
    )  # fmt: skip
    projection: str | None = _row(
        None, "Projection of the camera; latlong shows all directions in one image.", "choice",
        "--camera-projection", choices=PROJECTIONS, unset="the camera's",
    )  # fmt: skip
    exposure: bool = _row(
        True, "Whether the camera's exposure scales the image.", "switch",
        "--camera-exposure", unset="on",
    )  # fmt: skip
    depth_of_field: bool | None = _row(
        None, "Whether to render depth of field as defined by the camera's fStop.", "switch",
        "--depth-of-field", unset="unless the render settings disable it",
    )  # fmt: skip
    lens_settings: Mapping[str, str] | None = _row(
        None,
        "Camera setting for lens distortion, aperture or rolling shutter (repeatable).",
        "text",
        "--lens-setting", many=True, metavar="NAME=VALUE", unset="the camera's",
    )  # fmt: skip
    st_map: str | None = _row(
        None,
        "ST map image that defines the lens distortion.",
        "file",
        "--st-map",
        metavar="FILE.exr",
    )
    mask: tuple[str, ...] = _row(
        (),
        "Prim or path pattern to render, with descendants and all dependencies (repeatable).",
        "text", "--mask", many=True, metavar="PATH", unset="all",
    )  # fmt: skip
    payloads: tuple[str, ...] = _row(
        (), "Pattern of prims whose payloads are loaded, or `none` (repeatable).", "text",
        "--payloads", many=True, metavar="PATTERN", unset="all",
    )  # fmt: skip
    holdouts: tuple[str, ...] = _row(
        (), "Prim whose subtree is a holdout, which renders as black with alpha 0 "
        "(repeatable).", "text", "--holdout", many=True, metavar="PATH", unset="as the stage says",
    )  # fmt: skip
    catchers: tuple[str, ...] = _row(
        (), "Prim whose subtree is a shadow catcher, which renders only received shadows, as alpha "
        "(repeatable).", "text", "--catcher", many=True, metavar="PATH", unset="as the stage says",
    )  # fmt: skip
    catch: str = _row(
        "through",
        "Step of rendering shadow catchers: image without catchers, catchers with other objects, "
        "or catchers alone.",
        "choice",
        choices=CATCH,
    )
    session_layer: str | None = _row(
        None,
        "USD layer whose opinions override the stage.",
        "file", "--session-layer",
        metavar="FILE",
    )  # fmt: skip
    texture_limit: float | None = _row(
        None,
        "Memory limit of textures and volume grids; above it, textures are read from a temporary "
        "file.",
        "number",
        "--texture-limit", metavar="MB", least=0, above=True, unit="MB", unset="any",
    )  # fmt: skip
    working_space: str = _row(
        "rec709",
        "Linear colour space in which the image is rendered.",
        "choice", "--working-space",
        choices=WORKING_SPACES, unset="rec709",
    )  # fmt: skip
    subdivision: str | int = _row(
        "auto",
        "Refinement of subdivision surfaces: off, a level from 0 to 10, or auto to choose levels "
        "by size in the image.",
        "text", "--subdivision", metavar="off|LEVEL|auto", unset="auto",
    )  # fmt: skip
    strand_pixels: float = _row(
        0.0,
        "Width in pixels below which curves are randomly removed and the remaining curves widened; "
        "0 keeps all curves.",
        "number", "--strand-pixels", metavar="X", least=0, unset="0",
    )  # fmt: skip
    size: tuple[int, int] = _row(
        (600, 600), "Width and height of the image in pixels.", "pair", least=1
    )
    threads: int = _row(
        0, "Number of threads for reading the stage; 0 uses all cores.", "integer", least=0
    )

    @classmethod
    def of(cls, options: LoadOptions | None, changes: Mapping[str, Any]) -> LoadOptions:
        """Returns a copy with some values replaced; values may have all types that callers use.

        Raises:
            TypeError: There is no option of that name.
        """
        known = {one.name for one in fields(cls)}
        unknown = [name for name in changes if name not in known]
        if unknown:
            raise TypeError(
                f"no option {unknown[0]!r} of loading; there are {', '.join(sorted(known))}"
            )
        plain = dict(changes)
        for name in ("session_layer", "st_map"):
            if plain.get(name) is not None:
                plain[name] = os.fspath(plain[name])
        if plain.get("lens_settings") is not None:
            plain["lens_settings"] = {k: str(v) for k, v in plain["lens_settings"].items()}
        for name in ("purposes", "mask", "payloads", "holdouts", "catchers", "size", "shutter"):
            if plain.get(name) is not None:
                plain[name] = tuple(plain[name])
        return replace(options or cls(), **plain)

    @property
    def chooses_what_opens(self) -> bool:
        """Whether an option is set that affects how the stage's files are opened."""
        return bool(self.mask or self.payloads or self.session_layer is not None)

    def as_dict(self) -> dict[str, Any]:
        """Returns all options by name."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    def check(self) -> None:
        """Raises WavecombError if a value is invalid for every stage."""
        for one in fields(self):
            row = row_of(one)
            row.check(row.option[2:].replace("-", " ") or one.name, getattr(self, one.name))


def row_of(option: Field[Any]) -> Row:
    """Returns the table row of a field of ``LoadOptions``."""
    return cast(Row, option.metadata["row"])


def rows() -> dict[str, Row]:
    """Returns the table rows of all options that commands have, by field name."""
    return {one.name: row_of(one) for one in fields(LoadOptions) if row_of(one).option}


def split(
    options: Mapping[str, Any], without: Iterable[str] = ()
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Splits keyword arguments into load options and all others.

    >>> split({"camera": "/Cam", "seed": 3})
    ({'camera': '/Cam'}, {'seed': 3})
    """
    known = {one.name for one in fields(LoadOptions)} - set(without)
    mine = {name: value for name, value in options.items() if name in known}
    return mine, {name: value for name, value in options.items() if name not in known}


def given(values: Mapping[str, Any]) -> dict[str, Any]:
    """Converts a command's arguments, by ``Row.key``, to fields. Leaves out missing arguments.

    Raises:
        WavecombError: A value is invalid.
    """
    out: dict[str, Any] = {}
    for name, row in rows().items():
        value = values.get(row.key)
        if value is None or value == () or (row.kind == "not" and not value):
            continue
        if row.kind == "not":
            out[name] = False
        elif row.kind == "switch":
            out[name] = value == "on"
        elif name == "variants":
            out[name] = selections(value)
        elif name == "lens_settings":
            out[name] = _named_values(row.option, (text.partition("=") for text in value))
        elif name == "purposes":
            out[name] = tuple(dict.fromkeys(("default", *value)))
        else:
            out[name] = value
    if out.get("camera") == "":
        raise WavecombError("--camera is empty: give the path of a camera prim")
    return out


def _named_values(
    option: str, parts: Iterable[tuple[str, str, str]], form: str = "NAME=VALUE"
) -> dict[str, str]:
    """Converts (name, "=", value) parts to a mapping. Raises WavecombError if a part is missing."""
    values: dict[str, str] = {}
    for name, equals, value in parts:
        if not (name and equals and value):
            raise WavecombError(f"{option} {name}{equals}{value}: must be {form}")
        values[name] = value
    return values


def selections(variants: Sequence[str]) -> dict[str, str]:
    """Converts "PRIM{SET}=NAME" texts to a mapping. Raises WavecombError for other texts."""
    parts = (text.rpartition("=") for text in variants)
    return _named_values("--variant", parts, "PRIM{SET}=NAME or SET=NAME")
