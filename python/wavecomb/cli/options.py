# SPDX-License-Identifier: Apache-2.0
"""Options that more than one command has, and types of option values."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from wavecomb.usd import LoadedStage
    from wavecomb.usd.stage.choice import RenderChoice

F = TypeVar("F", bound=Callable[..., Any])


class Real(click.ParamType):
    """A finite number, perhaps with a lower bound."""

    name = "number"

    def __init__(self, minimum: float = -math.inf, *, above: bool = False) -> None:
        self._minimum = minimum
        self._above = above

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Text to a float; fails with what it must be."""
        try:
            number = float(value)
        except ValueError:
            self.fail(f"{value!r} is not a number", param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        if number < self._minimum or (self._above and number == self._minimum):
            bound = "above" if self._above else "at least"
            self.fail(f"{value} must be {bound} {self._minimum:g}", param, ctx)
        return number


def examples(*lines: str) -> str:
    """The end of a help text."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


def _isolate(context: click.Context, parameter: click.Parameter, value: str) -> None:
    """Goes on in a child, as early as can be: little is in memory yet."""
    from wavecomb.run.isolate import supervisor

    if not context.resilient_parsing and (
        value == "on" or (value == "auto" and supervisor.is_wise())
    ):
        supervisor.supervise()


def _set_load_limit(
    context: click.Context, parameter: click.Parameter, value: float | None
) -> None:
    from wavecomb.run.isolate import patience

    patience.limit_s = value


def _limit_memory(context: click.Context, parameter: click.Parameter, value: float | None) -> None:
    from wavecomb.run.isolate import memory

    if not context.resilient_parsing:
        memory.limit(value)


def _ask_sandbox(context: click.Context, parameter: click.Parameter, value: str) -> None:
    from wavecomb.run.isolate import box

    box.ask(mode=value)


def isolate_option(command: F) -> F:
    """--isolate, --sandbox and --memory-limit, for commands that read what others wrote."""
    command = click.option(
        "--sandbox",
        type=click.Choice(["auto", "on", "off"]),
        default="auto",
        expose_value=False,
        callback=_ask_sandbox,
        help="What the child may do: read what the stage names, write its outputs; no network, no "
        "programs.  [default: auto: as far as this system can; on: all of it, or an error]",
    )(command)
    command = click.option(
        "--memory-limit",
        type=Real(0, above=True),
        metavar="MB",
        expose_value=False,
        callback=_limit_memory,
        help="Memory that the child process may take.  [default: what the machine has]",
    )(command)
    return click.option(
        "--isolate",
        type=click.Choice(["auto", "on", "off"]),
        default="auto",
        expose_value=False,
        is_eager=True,
        callback=_isolate,
        help="Work in a child process, so that a crash is one line.  "
        "[default: auto: unless called from within a program]",
    )(command)


def isolation_options(command: F) -> F:
    """--isolate and --load-limit, for commands that end when their stage is done."""
    return click.option(
        "--load-limit",
        type=Real(0),
        metavar="S",
        expose_value=False,
        callback=_set_load_limit,
        help="Seconds that USD may compose the stage; 0: any.  "
        "[default: 6, and 1 for each MB of layers]",
    )(isolate_option(command))


def stage_options(command: F) -> F:
    """STAGE, --camera, --frame, --variant, --purpose, --mask, --subdivision, --shutter ..."""
    for option in (
        click.option(
            "--subdivision",
            metavar="off|LEVEL|auto",
            help="Subdivision surfaces: as polygons, refined LEVEL times (0 to 10), or by their "
            "size in the picture.  [default: auto]",
        ),
        click.option(
            "--working-space",
            type=click.Choice(["rec709", "acescg"]),
            help="Linear colours that the picture is computed in.  [default: rec709]",
        ),
        click.option(
            "--texture-limit",
            type=Real(0),
            metavar="MB",
            help="Memory of all textures; what does not fit waits in a temporary file.  "
            "[default: any]",
        ),
        click.option(
            "--session-layer",
            type=click.Path(),
            metavar="FILE",
            help="Layer with opinions stronger than the stage's.",
        ),
        click.option(
            "--mask",
            multiple=True,
            metavar="PATH",
            help="Prim to draw, with all below it and what it needs; may be given again.  "
            "[default: all]",
        ),
        click.option(
            "--depth-of-field",
            type=click.Choice(["on", "off"]),
            help="What is out of focus is blurred, as the camera's fStop says.  "
            "[default: unless the render settings disable it]",
        ),
        click.option(
            "--camera-exposure",
            type=click.Choice(["on", "off"]),
            help="The camera's exposure multiplies light in the picture.  [default: on]",
        ),
        click.option(
            "--camera-projection",
            type=click.Choice(["perspective", "orthographic", "latlong"]),
            help="latlong: all directions in one picture.  [default: the camera's]",
        ),
        click.option(
            "--product",
            metavar="PATH",
            help="Render product, by path or name.  [default: of render all, else the first]",
        ),
        click.option(
            "--render-settings",
            metavar="PATH",
            help="Render settings prim, by path or name.  "
            "[default: the stage's, else the only ones under /Render]",
        ),
        click.option(
            "--motion-steps",
            type=click.IntRange(2, 64),
            metavar="N",
            help="Steps of every motion over the shutter.  [default: as many as it needs, 2 to 8]",
        ),
        click.option(
            "--no-motion-blur", is_flag=True, help="What moves is drawn as it is at the frame."
        ),
        click.option(
            "--shutter",
            type=Real(),
            nargs=2,
            metavar="OPEN CLOSE",
            help="When the shutter opens and closes, time codes from the frame.  "
            "[default: the camera's]",
        ),
        click.option(
            "--lights",
            type=click.Choice(["visible", "hidden"]),
            help="Whether rays meet the shapes of lights; hidden ones shine all the same.  "
            "[default: visible]",
        ),
        click.option(
            "--variant",
            "variants",
            multiple=True,
            metavar="PRIM{SET}=NAME",
            help="Variant to select, may be given again; SET=NAME is of the default prim.",
        ),
        click.option(
            "--purpose",
            "purposes",
            multiple=True,
            type=click.Choice(["default", "render", "proxy", "guide"]),
            help="Geometry to take, may be given again.  "
            "[default: of the render settings, else default and render]",
        ),
        click.option(
            "--frame",
            type=Real(),
            metavar="T",
            help="Time code.  [default: the stage's start]",
        ),
        click.option(
            "--camera",
            metavar="PATH",
            help="Camera prim.  [default: of the render settings, else the first]",
        ),
        click.argument("stage", type=click.Path()),
    ):
        command = option(command)
    return command


def optional_stage(command: Any) -> Any:
    """``stage_options`` with a stage that may be left out."""
    command = stage_options(command)
    for parameter in command.__click_params__:
        if parameter.name == "stage":
            parameter.required = False
    return command


@dataclass(frozen=True)
class StageOptions:
    """What ``stage_options`` gave."""

    camera: str | None
    frame: float | None
    purposes: tuple[str, ...]
    variants: tuple[str, ...]
    mask: tuple[str, ...] = ()
    session_layer: str | None = None
    subdivision: str | None = None
    shutter: tuple[float, float] | None = None
    no_motion_blur: bool = False
    motion_steps: int | None = None
    depth_of_field: str | None = None
    camera_exposure: str | None = None
    camera_projection: str | None = None
    product: str | None = None
    render_settings: str | None = None
    texture_limit: float | None = None
    working_space: str | None = None
    lights: str | None = None

    @classmethod
    def take(cls, options: dict[str, Any]) -> StageOptions:
        """Moves them out of a command's arguments."""
        return cls(**{field.name: options.pop(field.name) for field in fields(cls)})

    def as_dict(self) -> dict[str, Any]:
        """For a file: what ``completed`` takes."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def completed(self, before: dict[str, Any]) -> StageOptions:
        """With what was chosen before in place of what is not chosen here."""
        mine = self.as_dict()
        for name in mine:
            _check_kept(name, before.get(name))
        values: dict[str, Any] = {name: mine[name] or before.get(name) for name in mine}
        if self.frame is not None:
            values["frame"] = self.frame
        for name in ("purposes", "variants", "mask"):
            values[name] = tuple(values[name] or ())
        values["shutter"] = tuple(values["shutter"]) if values["shutter"] else None
        values["no_motion_blur"] = bool(values["no_motion_blur"])
        return StageOptions(**values)

    def load(
        self,
        stage: str,
        threads: int = 0,
        size: tuple[int, int] | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> LoadedStage:
        """Loads a stage as the options say, on ``threads`` threads (0: all), for a picture."""
        from wavecomb.api import load

        options = self.for_load(size)
        # The whole command is in a child, or is not to be (--isolate).
        return load(
            stage, frame=self.frame, threads=threads, progress=progress, isolate=False, **options
        )

    def for_load(self, size: tuple[int, int] | None) -> dict[str, Any]:
        """Arguments of ``wavecomb.load``, but for the frame."""
        from wavecomb.errors import WavecombError

        if self.camera == "":
            raise WavecombError("--camera is empty: give the path of a camera prim")
        return {
            "camera": self.camera,
            "purposes": self.all_purposes(),
            "variants": self.selections() or None,
            "mask": self.mask,
            "session_layer": self.session_layer,
            "subdivision": "auto" if self.subdivision is None else self.subdivision,
            **({} if size is None else {"size": size}),
            "shutter": self.shutter,
            "motion_blur": False if self.no_motion_blur else None,
            "motion_steps": self.motion_steps,
            "depth_of_field": None if self.depth_of_field is None else self.depth_of_field == "on",
            "exposure": self.camera_exposure != "off",
            "projection": self.camera_projection,
            "product": self.product,
            "render_settings": self.render_settings,
            "texture_limit": self.texture_limit,
            "working_space": self.working_space or "rec709",
            "lights": self.lights or "visible",
        }

    def peek(self, stage: str) -> tuple[list[RenderChoice], Any]:
        """What the stage's render settings ask for, a choice for each product.

        Also what is to be kept until the stage is loaded, so that its layers are read once.
        """
        from wavecomb.api import import_usd

        import_usd()
        from wavecomb.usd import peek_products

        return peek_products(stage, self.render_settings, self.product, self.session_layer)

    def selections(self) -> dict[str, str]:
        """Variants as ``wavecomb.load`` takes them."""
        from wavecomb.errors import WavecombError

        variants: dict[str, str] = {}
        for text in self.variants:
            key, equals, value = text.rpartition("=")
            if not (key and equals and value):
                raise WavecombError(f"--variant {text}: must be PRIM{{SET}}=NAME or SET=NAME")
            variants[key] = value
        return variants

    def all_purposes(self) -> tuple[str, ...] | None:
        """Purposes with "default"; None where none was chosen."""
        return tuple(dict.fromkeys(("default", *self.purposes))) if self.purposes else None


_NUMBERS = ("frame", "texture_limit", "shutter", "motion_steps")
_LISTS = ("purposes", "variants", "mask", "shutter")


def _check_kept(name: str, value: Any) -> None:
    """Raises WavecombError where an option, as a file kept it, is not of its type."""
    from wavecomb.errors import WavecombError

    if value is None or value is False:
        return
    wanted: tuple[type, ...] = (int, float) if name in _NUMBERS else (str,)
    if name == "no_motion_blur":
        wanted = (bool,)
    good = isinstance(value, list) == (name in _LISTS)
    for item in value if isinstance(value, list) else [value]:
        good = good and isinstance(item, wanted) and item == item
    if name == "shutter":
        good = good and len(value) == 2
    if not good:
        raise WavecombError(f"the checkpoint's {name} is no good: it is damaged; start anew")


def warn(lines: list[str]) -> None:
    """Prints warnings on stderr, each once."""
    for line in dict.fromkeys(lines):
        click.echo(f"warning: {' '.join(line.split())}", err=True)


def stage_warnings(loaded: LoadedStage) -> list[str]:
    """Warnings of a loaded stage as lines."""
    return [*(finding.line() for finding in loaded.report.warnings), *loaded.scene.warnings]
