# SPDX-License-Identifier: Apache-2.0
"""Additions of a program, a light, a setting, an AOV and a transport edit few files and compile.

Each example edits a copy of the sources as the pages of docs/ describe. A hand-written list
anywhere else would increase the number of files or break compilation.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import syntax

ROOT = Path(__file__).resolve().parents[2]
CORE = "src/wavecomb"

Change = dict[str, tuple[str, ...]]
"""Maps a file to texts and their replacements in turn. The text of a new file is ""."""


def header(name: str) -> str:
    """Returns the include line of a core header, in any folder."""
    (path,) = (ROOT / CORE).rglob(name)
    return f'#include "wavecomb/{path.relative_to(ROOT / CORE)}"\n'


def last_row(file: str, table: str, more: str) -> tuple[str, str]:
    """Returns the last row of a macro table, and the same row followed by an additional row."""
    text = (ROOT / CORE / file).read_text("utf-8")
    start = text.index(f"#define {table}(")
    lines = text[start:].splitlines()
    count = next(i for i, line in enumerate(lines) if not line.endswith("\\"))
    return lines[count], f"{lines[count]} \\\n{more}"


def page(name: str, language: str = "cpp") -> list[str]:
    """Returns the blocks of code of a page."""
    text = (ROOT / "docs" / f"{name}.md").read_text("utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def program(row: str) -> Change:
    """Returns the program of docs/writing-a-material.md, with a row of the table."""
    table = "material/description/programs.h"
    hair = '#include "wavecomb/material/programs/hair.h"\n'
    return {
        f"{CORE}/material/programs/minnaert.h": ("", page("writing-a-material")[0]),
        f"{CORE}/{table}": last_row(table, "WAVECOMB_PROGRAMS", row),
        f"{CORE}/material/program_table.h": (hair, f"{hair}{hair.replace('hair', 'minnaert')}"),
    }


USES_PROGRAM = (
    header("program_table.h")
    + """
namespace wavecomb {
template class MinnaertBsdf<float>;
static_assert(Programs<float>::kSize == kSurfaceProgramCount);
static_assert(has_trait(ProgramId::kMinnaert, program_trait::kNests) == NESTS);
static_assert(std::is_same_v<Program<ProgramId::kMinnaert, float>, MinnaertBsdf<float>>);
}
"""
)

RING = """// SPDX-License-Identifier: Apache-2.0
/// Ring lights: the part of a disk beyond half its radius.
#pragma once

namespace wavecomb {

struct RingKind : FlatKind {
  static LightKindInfo describe() {
    LightKindInfo kind = DiskKind::describe();
    kind.name = "ring";
    kind.prims = {};
    kind.make = [](LightBuild& out, const Light& light, LightBuildContext& /*context*/) {
      using namespace record_builder;
      const double radius = std::fabs(double{light.radius});
      put(out.record.p, to_double(light.to_world.t));
      finish_flat(out, light, to_double(light.to_world.axis(0)) * radius,
                  to_double(light.to_world.axis(1)) * radius, 0.75 * kPiD);
    };
    return kind;
  }
  template <typename F>
  static Vec3<F> point(const detail::LightReader<F>& light, const F& u, const F& v) {
    const Vec2<F> disk = square_to_disk(F(fma(u, F(0.75f), F(0.25f))), v);
    return fma(light.u(), disk.x, fma(light.v(), disk.y, light.p()));
  }
  template <typename F>
  static detail::KindSample<F> sample(const detail::LightQuery<F>& q) {
    const detail::Direction<F> d = detail::make_direction<F>(point(q.light, q.u, q.v) - q.from);
    const F cos_light = -dot(d.wi, q.light.n());
    const F pdf = detail::area_to_solid_angle<F>(d.length2, cos_light, q.light.area());
    return {d.wi, d.length, q.light.radiance(), pdf, Mask<F>(false)};
  }
  template <typename F>
  static detail::KindHit<F> hit(const detail::LightHitQuery<F>& m) {
    return DiskKind::hit<F>(m);
  }
  template <typename F>
  static detail::KindEmission<F> emit(const detail::EmissionQuery<F>& q) {
    return detail::emit_by_cosine<F>(point(q.light, q.u, q.v), q.light.n(), q.s, q.t,
                                     q.light.radiance(),
                                     detail::uniform_emission_density<F>(q.light.area()));
  }
  template <typename F>
  static F emission_density(const detail::LightHitQuery<F>& m) {
    return detail::uniform_emission_density<F>(m.light.area());
  }
};

}  // namespace wavecomb
"""


def light(text: str) -> Change:
    """Returns a kind of light in one header, and its entry in the list."""
    includes = header("disk.h") + header("record_builder.h")
    kinds = f"{CORE}/light/kinds/kinds.h"
    before = (ROOT / kinds).read_text("utf-8")
    (row,) = re.findall(r"#define WAVECOMB_LIGHT_KINDS\(X\) .*\n", before)
    first = '#include "wavecomb/light/kinds/cylinder.h"\n'
    middle = before[before.index(first) + len(first) : before.index(row)]
    return {
        f"{CORE}/light/kinds/ring.h": (
            "",
            text.replace("#pragma once\n", f"#pragma once\n{includes}"),
        ),
        kinds: (
            f"{first}{middle}{row}",
            f"{first}{first.replace('cylinder', 'ring')}{middle}{row.rstrip()} X(Ring)\n",
        ),
    }


USES_LIGHT = (
    header("kinds.h")
    + """
namespace wavecomb {
static_assert(kLightKindCount == static_cast<uint32_t>(LightKind::kRing) + 1);
bool is_ring_delta(LightKind kind, const detail::LightReader<float>& light) {
  return visit(kind, [&](auto one) { return decltype(one)::template is_delta<float>(light); });
}
}
"""
)

SETTING: Change = {
    f"{CORE}/core/settings.h": (
        "  float merge_radius = 0;\n",
        "  float merge_radius = 0;\n  float tea_time = 4.5f;  ///< in hours; 0 means never\n",
    ),
    f"{CORE}/core/settings_table.cpp": (
        '      number<&S::seed>("seed"',
        '      number<&S::tea_time>("tea_time", "Tea", 0, 24, "Time of tea.", "never"),\n'
        '      number<&S::seed>("seed"',
    ),
}  # fmt: skip


def aov(row: str, file: str, before: str, after: str) -> Change:
    """Returns a row of the table of AOVs, and the line with its value."""
    return {
        f"{CORE}/core/aov.h": last_row("core/aov.h", "WAVECOMB_AOVS", row),
        f"{CORE}/{file}": (before, after),
    }


OF_HIT = aov(
    '  X(Height, "height", 1, "", kValue, kNearest, kHit, "Height")',
    "aov/rows.h",
    "  put(Aov::kDistance, hit.distance);\n",
    "  put(Aov::kDistance, hit.distance);\n  put(Aov::kHeight, hit.position.y);\n",
)
OF_TECHNIQUE = aov(
    '  X(ByCamera, "by_camera", 3, "RGB", kLight, kMean, kMis, "Found by camera paths")',
    "aov/path_aovs.cpp",
    "  if (light_samples_) {\n",
    "  if (double* sums = film.sums(Aov::kByCamera, pixel))\n"
    "    slots.for_each([&](uint32_t slot) {\n"
    "      for (size_t c = 0; c < 3; ++c) sums[c] += double{radiance[slot * kRadianceWords + c]};\n"
    "    });\n"
    "  if (light_samples_) {\n",
)


# A longest connection.
OF_LIGHT_PATHS: Change = {
    f"{CORE}/core/settings.h": (
        "  float merge_radius = 0;\n",
        "  float merge_radius = 0;\n  float longest_connection = 0;  ///< 0 means no limit\n",
    ),
    f"{CORE}/core/settings_table.cpp": (
        '      number<&S::seed>("seed"',
        '      number<&S::longest_connection>("longest_connection", "Longest", 0, 1e30,\n'
        '                                     "Length of the longest connection.", "any"),\n'
        '      number<&S::seed>("seed"',
    ),
    f"{CORE}/light_paths/context.h": (
        "        connects(settings.connects()),\n",
        "        connects(settings.connects()),\n"
        "        longest2(settings.longest_connection > 0\n"
        "                     ? settings.longest_connection * settings.longest_connection\n"
        "                     : kInfinity),\n",
        "  float share = 1;",
        "  float longest2 = kInfinity;\n  float share = 1;",
    ),
    f"{CORE}/light_paths/coupling.h": (
        "      if (context_.connects) [[unlikely]]\n        offer_connection(c, joint_, offer_);\n",
        "      if (context_.connects) [[unlikely]] {\n"
        "        offer_connection(c, joint_, offer_);\n"
        "        const F d2 = length_squared(offer_.to - c.at.s.p);\n"
        "        Color<F>& l = offer_.row.light;\n"
        "        l = select<F>(d2 <= context_.longest2, l, Color<F>(F(0.f)));\n"
        "      }\n",
    ),
}  # fmt: skip
USES_TRANSPORT = """#include "wavecomb/light_paths/coupling.h"
#include "wavecomb/material/programs/diffuse.h"
#include "wavecomb/path/vertex.h"
namespace wavecomb {
template VertexResult<float> shade_vertex<DiffuseBsdf<float>, float, kEverything, CLASS>(
    const Vertex<float>&, CLASS::Coupling<float>&);
}
"""


@pytest.fixture(scope="module")
def compiler() -> list[str]:
    """The library's compiler command for a syntax check, without the folder of headers."""
    return syntax.command()


def applied(tree: Path, change: Change) -> None:
    """Copies the C++ sources and edits the copy."""
    shutil.copytree(ROOT / "src", tree / "src", dirs_exist_ok=True)
    for name, texts in change.items():
        path = tree / name
        for before, after in zip(texts[::2], texts[1::2], strict=True):
            if before:
                text = path.read_text("utf-8")
                assert text.count(before) == 1, name
                after = text.replace(before, after)
            else:
                assert not path.exists()
            path.write_text(after, "utf-8")


def compiled(
    tree: Path, compiler: list[str], *files: str, text: str = ""
) -> subprocess.CompletedProcess[str]:
    """Checks the syntax of named files of a source tree, or of a text."""
    (tree / "use.cpp").write_text(text)
    found = [path for file in files for path in (tree / CORE).rglob(file)]
    assert len(found) == len(files)
    names = [str(path) for path in found] or [str(tree / "use.cpp")]
    return subprocess.run(
        [*compiler, "-I", str(tree / "src"), *names], capture_output=True, text=True, check=False
    )


@pytest.mark.slow
@pytest.mark.parametrize("nests", [False, True])
def test_a_program(tmp_path: Path, compiler: list[str], nests: bool) -> None:
    traits = "kEmits | kGlossy | kNests | kSubsurface" if nests else "0"
    change = program(f"  X(minnaert, Minnaert, {traits}, 65)")
    assert len(change) <= 3
    applied(tmp_path, change)
    done = compiled(
        tmp_path, compiler, text=USES_PROGRAM.replace("NESTS", "true" if nests else "false")
    )
    assert done.returncode == 0, done.stderr
    others = ("scene_materials.cpp", "mesh_medium.cpp")
    done = compiled(tmp_path, compiler, *others)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_a_kind_of_light(tmp_path: Path, compiler: list[str]) -> None:
    change = light(RING)
    assert len(change) <= 2
    applied(tmp_path, change)
    done = compiled(tmp_path, compiler, text=USES_LIGHT)
    assert done.returncode == 0, done.stderr
    done = compiled(tmp_path, compiler, "kinds.cpp")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("member", ["describe", "sample", "emission_density"])
def test_a_light_that_lacks_something_does_not_compile(
    tmp_path: Path, compiler: list[str], member: str
) -> None:
    text = RING.replace(f" {member}(", f" un{member}(").replace("DiskKind::un", "DiskKind::")
    applied(tmp_path, light(text))
    done = compiled(tmp_path, compiler, text=USES_LIGHT)
    assert done.returncode != 0
    assert "a kind of light lacks a member of LightKindClass" in done.stderr


@pytest.mark.slow
def test_a_setting(tmp_path: Path, compiler: list[str]) -> None:
    """A new setting compiles, and so does code that reads the setting."""
    assert len(SETTING) <= 2
    applied(tmp_path, SETTING)
    done = compiled(tmp_path, compiler, "settings_table.cpp", "settings.cpp")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "change", [OF_HIT, OF_TECHNIQUE], ids=["of_the_first_hit", "of_a_technique"]
)
def test_an_aov(tmp_path: Path, compiler: list[str], change: Change) -> None:
    assert len(change) <= 2
    applied(tmp_path, change)
    done = compiled(tmp_path, compiler, "path_aovs.cpp")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_a_parameter_of_light_paths(tmp_path: Path, compiler: list[str]) -> None:
    assert len(OF_LIGHT_PATHS) <= 6
    applied(tmp_path, OF_LIGHT_PATHS)
    done = compiled(tmp_path, compiler, text=USES_TRANSPORT.replace("CLASS", "LightPaths"))
    assert done.returncode == 0, done.stderr
    done = compiled(tmp_path, compiler, "settings_table.cpp")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_a_transport(tmp_path: Path, compiler: list[str]) -> None:
    """The example of docs/writing-a-transport.md compiles as a class of the vertex steps."""
    file = f"{CORE}/vertex_counts/vertex_counts.h"
    (tmp_path / file).parent.mkdir(parents=True)
    applied(tmp_path, {file: ("", page("writing-a-transport")[0])})
    text = USES_TRANSPORT.replace("CLASS", "VertexCounts")
    text = text.replace("light_paths/coupling.h", "vertex_counts/vertex_counts.h")
    done = compiled(tmp_path, compiler, text=text)
    assert done.returncode == 0, done.stderr
