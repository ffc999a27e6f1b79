# SPDX-License-Identifier: Apache-2.0
"""Compare renders of random stages with pairs of settings that must agree in expectation.

    .venv/bin/python tests/statistics/pairs.py 17                    # one seed, with its images
    .venv/bin/python tests/statistics/pairs.py --from 0 --count 500  # many; exit code 1 on a fault

A stage is rendered with plain settings and with each of ``variants``: light paths, guiding, cosine
sampling, roulettes, the choice of lights, hidden lights, and random combinations of all of them.
Both renders are sets of batches that have different seeds. ``judge`` compares block means and the
image mean by Welch's t. A comparison with |z| of 3.3 or more is repeated with 12 and then with 60
times as many samples and other seeds. A difference is a fault if |z| is too large each time, at the
level that Sidak's correction leaves of 1 % for all comparisons of a run.

Where a few paths carry most of the light, z is not normal: a render that has found none of these
paths has a small variance. A difference is then a fault only if it is larger than the chance effect
of a few paths (``Comparison.is_sure``). Comparisons of smaller differences are repeated with
``FURTHER`` times as many samples. If the difference is too large even then, the comparison is
undecided. A run in which more than ``MOST_UNDECIDED`` of the stages have such comparisons fails.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "statistics")]

from agreement import Array  # noqa: E402
from naive import BATCHES, BLOCK, MORE, SIZE, SUSPICION, Comparison, judge  # noqa: E402
from random_scenes import RandomScene, make_scene  # noqa: E402

SPP = 64
"""Samples per pixel of a batch."""
TRAINING_SPP = 1024
"""Samples of the render that trains the guiding field; fewer would not suffice for training."""
PLAIN: dict[str, Any] = {
    "transport": "path",
    "guiding": "off",
    "cosine_sampling": False,
    "roulette": "off",
    "roulette_depth": 1,
    "light_selection": "auto",
    "light_weights": "calibrated",
    "shadow_roulette": "off",
    "sampler": "sobol",
    # Stochastic lookup of a single texel changes the mean where shading is not linear.
    "texture_filter": "whole",
    "filter": "box",
    "filter_width": 1.0,
    "costs": "model",
}
SINGLE: dict[str, dict[str, Any]] = {
    "guiding": {"guiding": "on"},
    "cosine": {"cosine_sampling": True},
    "guiding cosine": {"guiding": "on", "cosine_sampling": True},
    "power": {"light_selection": "power"},
    "tree, power weights": {"light_selection": "tree", "light_weights": "power"},
    "roulette": {"roulette": "throughput"},
    "efficient": {"roulette": "efficient"},
    "light": {"transport": "light"},
    "bdpt": {"transport": "bdpt"},
    "merged": {"transport": "light", "merge_radius": 0.25},
    "guided light": {"guiding": "on", "transport": "light"},
    "guided bdpt": {"guiding": "on", "transport": "bdpt"},
    "guided merged": {"guiding": "on", "transport": "light", "merge_radius": 0.25},
}
CHOICES: dict[str, tuple[Any, ...]] = {
    "roulette": ("off", "throughput", "cost-aware", "efficient"),
    "light_selection": ("auto", "tree", "power"),
    "light_weights": ("calibrated", "power"),
    "shadow_roulette": ("off", "on"),
    "sampler": ("sobol", "independent"),
}
FURTHER = 300
"""Factor of the samples in the last repeat, for differences that a few rare paths may cause."""
MOST_UNDECIDED = 0.01
"""Fraction of the stages of a run that may have undecided comparisons; one is always allowed."""
MERGED_TOLERANCE = 0.03
"""Relative loss of the image mean that a blurred caustic may cause at edges."""
SMOOTH_TOLERANCE = 0.01
"""Relative difference that light paths may cause on smooth coarse meshes.

A ball of 8 rings of faces differs by up to 0.5 %, a ball of 16 rings by up to 0.13 %
(docs/light-paths.md).
"""


@dataclass(frozen=True)
class Variant:
    """Settings to compare with the plain settings.

    Attributes:
        name: Short name for messages.
        settings: Settings that differ from ``PLAIN``.
        load: Load options that differ from the scene's.
    """

    name: str
    settings: dict[str, Any]
    load: dict[str, Any]


@dataclass(frozen=True)
class Result:
    """Outcome of one comparison.

    Attributes:
        variant: The variant that was compared.
        found: The comparison; None if the renderer refuses the settings for this stage.
        refusal: The renderer's message if it refuses the settings.
        tries: Number of comparisons made, with growing numbers of samples.
    """

    variant: Variant
    found: Comparison | None
    refusal: str = ""
    tries: int = 1

    def is_fault(self, tests: int) -> bool:
        """Whether the difference is too large to be chance, given the number of comparisons."""
        return self.found is not None and self.found.is_sure(tests)

    def is_undecided(self, tests: int) -> bool:
        """Whether a few rare paths, but not normal noise, can cause the difference."""
        return self.found is not None and is_open(self.found, tests)


def is_open(found: Comparison, tests: int) -> bool:
    """Whether Welch's t reports a fault although a few rare paths can cause the difference."""
    return found.is_fault(tests) and not found.is_sure(tests)


def most_undecided(stages: int) -> int:
    """Number of stages of a run that may have undecided comparisons."""
    return max(1, int(MOST_UNDECIDED * stages))


def variants(scene: RandomScene, seed: int) -> list[Variant]:
    """All variants of a stage: single changes, two random combinations, hidden lights."""
    found = [Variant(name, settings, {}) for name, settings in SINGLE.items()]
    random = np.random.default_rng((54, seed))
    for k in range(2):
        mixed = {
            name: values[int(random.integers(len(values)))] for name, values in CHOICES.items()
        }
        way = int(random.integers(5))
        if way < 2:
            mixed["transport"] = ("light", "bdpt")[way]
            mixed["light_aim"] = ("on", "off")[int(random.integers(2))]
        mixed["guiding"] = ("off", "on")[int(random.integers(2))]
        if way >= 2:
            mixed["cosine_sampling"] = bool(random.integers(2))
        found.append(Variant(f"mixed {k}", mixed, {}))
    if scene.single_light:
        other = "visible" if scene.load.get("lights") == "hidden" else "hidden"
        found.append(Variant(f"lights {other}", {}, {"lights": other}))
    return found


class Renders:
    """Renders batches of one scene and keeps its loaded stages and plain batches."""

    def __init__(self, scene: RandomScene) -> None:
        self.scene = scene
        self.stages: dict[str, Any] = {}
        self.references: dict[tuple[str, int], Array] = {}
        self.trained: dict[str, Any] = {}

    def stage(self, load: dict[str, Any]) -> Any:
        """Return the stage, loaded with these options in addition to the scene's."""
        import wavecomb

        key = str(sorted(load.items()))
        if key not in self.stages:
            self.stages[key] = wavecomb.load(self.scene.stage, **(self.scene.load | load))
        return self.stages[key]

    def settings(self, changes: dict[str, Any]) -> dict[str, Any]:
        """Return all settings of a render except samples and seed."""
        fresnel = "schlick" if self.scene.schlick else "exact"
        common = {"size": (SIZE, SIZE), "threads": 1, "max_depth": self.scene.depth}
        return {**PLAIN, **common, "fresnel": fresnel, **changes}

    def reference(self, variant: Variant) -> Variant:
        """Returns the settings to compare a variant with: plain ones, or light paths.

        Camera paths cannot find point or distant lights through a smooth lobe; light paths can.
        If a stage has such lights and lobes, only renders with light paths agree with each other.
        """
        transport = variant.settings.get("transport", "path")
        unseen = {"sun light", "point light"} & set(self.scene.features)
        hidden = self.scene.delta and unseen and transport != "path"
        return Variant("light", {"transport": "light"}, {}) if hidden else Variant("plain", {}, {})

    def reference_batches(self, variant: Variant, more: int, first: int) -> Array:
        """Render the batches of ``reference`` once, and return them."""
        reference = self.reference(variant)
        key = reference.name, more
        if key not in self.references:
            self.references[key] = self.batches(reference, more, first)
        return self.references[key]

    def batches(self, variant: Variant, more: int, first: int) -> Array:
        """Render ``BATCHES`` images of a variant, (n, height, width, 3)."""
        import wavecomb

        stage = self.stage(variant.load)
        settings = self.settings(variant.settings)
        if settings["guiding"] == "on":
            settings["learn_from"] = self.field(stage, settings)
        # Light selection and roulettes learn from pilot renders whose size depends on the samples.
        renders = [
            wavecomb.render(stage, spp=SPP * more, seed=seed, **settings).beauty
            for seed in range(first, first + BATCHES)
        ]
        return np.stack([np.asarray(one, np.float64) for one in renders])

    def field(self, stage: Any, settings: dict[str, Any]) -> Any:
        """Return a render that has trained a guiding field with these settings."""
        import wavecomb

        names = ("cosine_sampling", "transport", "light_aim", "merge_radius")
        key = str([settings.get(name) for name in names])
        if key not in self.trained:
            self.trained[key] = wavecomb.render(stage, spp=TRAINING_SPP, seed=99_999, **settings)
        return self.trained[key]

    def sees_lights(self) -> bool:
        """Whether the camera sees the shape of a light, or at least the dark back of the shape."""
        import wavecomb

        def seen(lights: str) -> Any:
            stage = self.stage({"lights": lights})
            layers = {"spp": 256, "aovs": ["emission", "albedo", "depth"]}
            image = wavecomb.render(stage, **layers, **self.settings({}))
            return image.aovs["emission"], image.albedo, image.depth

        visible, hidden = seen("visible"), seen("hidden")
        same = all(np.array_equal(a, b) for a, b in zip(visible, hidden, strict=True))
        return bool(visible[0].any()) or not same

    def tolerance(self, variant: Variant) -> float:
        """Relative difference of means that the documentation permits for a variant."""
        if variant.settings.get("transport", "path") == "path":
            return 0.0
        if "merge_radius" in variant.settings:
            return MERGED_TOLERANCE
        smooth = {"smooth ball", "smooth shell", "gprim", "cage"}
        return SMOOTH_TOLERANCE if smooth & set(self.scene.features) else 0.0

    def compare(self, variant: Variant, turn: int, contribution: Array | float = 0.0) -> Comparison:
        """Compares a variant with plain settings.

        Args:
            variant: Settings to compare.
            turn: Number of the comparison; later ones have more samples and other seeds.
            contribution: Largest contribution that earlier turns have found (naive.judge).
        """
        more = (1, *MORE, FURTHER)[turn]
        found = judge(
            self.batches(variant, more, 1000 * turn + 500),
            self.reference_batches(variant, more, 1000 * turn),
            tolerance=self.tolerance(variant),
            samples=SPP * more,
            contribution=contribution,
        )
        # Merging of light path vertices blurs reflections in mirrors, but keeps the mean of the
        # image, so only the means are compared.
        return found.of_mean() if "merge_radius" in variant.settings else found


def examine(
    scene: RandomScene, seed: int, repeats: int = len(MORE), tests: int = len(SINGLE)
) -> Iterator[Result]:
    """Compares all variants of a scene.

    Args:
        scene: The scene.
        seed: Its seed.
        repeats: Number of repeats of suspicious comparisons; undecided comparisons have up to
            ``len(MORE)`` repeats.
        tests: Number of comparisons of the run.
    """
    from wavecomb import _core

    renders = Renders(scene)
    for variant in variants(scene, seed):
        if variant.load and renders.sees_lights():
            continue
        try:
            found = renders.compare(variant, 0)
            turn = 0
            while found.worst >= SUSPICION and (
                turn < repeats or (turn <= len(MORE) and is_open(found, tests))
            ):
                turn += 1
                found = renders.compare(variant, turn, found.contribution)
        except _core.Error as error:
            if variant.settings.get("transport", "path") == "path":
                raise
            yield Result(variant, None, str(error))
            continue
        yield Result(variant, found, tries=turn + 1)


def save(result: Result, folder: Path) -> None:
    """Write the variant's image, the plain image and z side by side."""
    from agreement import picture_of

    assert result.found is not None
    count = (SIZE // BLOCK) ** 2
    z = result.found.z
    z = z[: 3 * count] if z.size > 3 else np.tile(z, count)
    z = z.reshape(SIZE // BLOCK, SIZE // BLOCK, 3)
    z = np.repeat(np.repeat(z, BLOCK, axis=0), BLOCK, axis=1)
    name = result.variant.name.replace(" ", "-").replace(",", "")
    picture_of(folder / f"{name}.png", result.found.ours, result.found.naive, z)


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("seed", nargs="?", type=int, help="of one stage")
    parser.add_argument("--from", dest="first", type=int, default=0, metavar="SEED")
    parser.add_argument("--count", type=int, default=30, help="stages, where no seed is given")
    parser.add_argument(
        "--repeats", type=int, default=len(MORE), choices=range(len(MORE) + 1),
        help="of what looks suspicious, with more samples; fewer are quicker and less sure",
    )  # fmt: skip
    parser.add_argument("--minutes", type=float, help="start no stage after so many minutes")
    parser.add_argument("-o", "--out", type=Path, default=ROOT / "out" / "pairs")
    options = parser.parse_args()
    one = options.seed is not None
    seeds = [options.seed] if one else range(options.first, options.first + options.count)
    tests = len(SINGLE) * len(seeds)
    faults = undecided = stages = refused = compared = 0
    begin = time.monotonic()
    for seed in seeds:
        if options.minutes and time.monotonic() - begin > 60 * options.minutes:
            break
        with tempfile.TemporaryDirectory() as temporary:
            folder = options.out / str(seed) if one else Path(temporary)
            folder.mkdir(parents=True, exist_ok=True)
            for old in folder.iterdir():
                old.unlink()
            scene = make_scene(seed, folder, enclosure=True)
            bad = is_left_open = False
            for result in examine(scene, seed, options.repeats, tests):
                compared += 1
                refused += result.found is None
                fault, is_undecided = result.is_fault(tests), result.is_undecided(tests)
                faults += fault
                bad = bad or fault
                is_left_open = is_left_open or is_undecided
                if fault or is_undecided or one:
                    verdict = "FAULT: " * fault + "UNDECIDED: " * is_undecided
                    words = f"{verdict}{result.found or result.refusal}"
                    print(f"{seed}: {result.variant.name}: {words}", flush=True)
                if one and result.found is not None:
                    save(result, folder)
            stages += 1
            undecided += is_left_open
            if bad or is_left_open or one:
                print(f"    {', '.join(scene.features)}; depth {scene.depth}", flush=True)
    place = f"; {options.out / str(seeds[0])}" if one else ""
    print(
        f"{stages} stages, {compared} comparisons, {refused} refused, {faults} faults, "
        f"{undecided} stages undecided{place}"
    )
    if undecided > most_undecided(stages):
        print(f"too many are undecided: at most {most_undecided(stages)} may be")
    return 1 if faults or undecided > most_undecided(stages) else 0


if __name__ == "__main__":
    sys.exit(main())
