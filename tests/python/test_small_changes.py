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
"""Maps a file to an alternating sequence of texts and their replacements. The text of a new file is
""."""


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


PROGRAMS = {
    "minnaert": ("minnaert", "Minnaert", "0", 65),
    "nests": ("minnaert", "Minnaert", "kEmits | kGlossy | kNests | kSubsurface", 65),
    "transmits": ("leaf", "Leaf", "0", 60),
    "layers": ("lacquer", "Lacquer", "kLayered", 90),
}
"""Programs of docs/writing-a-material.md: name, class, traits and cost of their rows."""
EXAMPLES = ROOT / "examples" / "programs"


def program(name: str, klass: str, traits: str, cost: int) -> Change:
    """Returns a program with a row of the table."""
    table = "material/description/programs.h"
    hair = '#include "wavecomb/material/programs/hair.h"\n'
    own = EXAMPLES / f"{name}.h"
    text = own.read_text("utf-8") if own.exists() else page("writing-a-material")[0]
    row = f"  X({name}, {klass}, {traits}, {cost})"
    return {
        f"{CORE}/material/programs/{name}.h": ("", text),
        f"{CORE}/{table}": last_row(table, "WAVECOMB_PROGRAMS", row),
        f"{CORE}/material/program_table.h": (hair, f"{hair}{hair.replace('hair', name)}"),
    }


USES_PROGRAM = (
    header("program_table.h")
    + header("openpbr_params.h")
    + """
#include <cmath>
#include <cstdio>
namespace wavecomb {
template class CLASSBsdf<float>;
static_assert(Programs<float>::kSize == kSurfaceProgramCount);
static_assert(has_trait(ProgramId::kCLASS, program_trait::kNests) == NESTS);
static_assert(std::is_same_v<Program<ProgramId::kCLASS, float>, CLASSBsdf<float>>);

Vec3<float> direction(float z, float phi) {
  const float r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}
int faults = 0;
void expect(bool holds, const char* what, float z) {
  if (holds) return;
  std::printf("%s, at cosine %g\\n", what, double{z});
  ++faults;
}

// The density integrates to the probability of the lobes that are not delta lobes, samples agree
// with eval, directions can be exchanged, and a white surface reflects at most what arrives.
void check(const CLASSBsdf<float>& bsdf, float z) {
  const Vec3<float> wo = direction(z, 0.4f);
  constexpr int kSteps = 200;
  double integral = 0, furnace = 0;
  bool agrees = true, is_reciprocal = true;
  for (int i = 0; i < kSteps; ++i)
    for (int k = 0; k < kSteps; ++k) {
      const float u = (i + 0.5f) / kSteps, v = (k + 0.5f) / kSteps;
      const float lobe = std::fmod(0.618034f * (i * kSteps + k), 1.f);
      const Vec3<float> wi = direction(2 * u - 1, 6.2831853f * v);
      const BsdfEval<float> e = bsdf.eval(wo, wi), back = bsdf.eval(wi, wo);
      integral += double{e.pdf};
      is_reciprocal &= std::abs(e.f_cos.x * std::abs(z) - back.f_cos.x * std::abs(wi.z)) < 1e-5f;
      const BsdfSample<float> s = bsdf.sample(wo, lobe, u, v);
      furnace += double{s.weight.x};
      const BsdfEval<float> at = bsdf.eval(wo, s.wi);
      agrees &= s.is_delta || (std::abs(at.pdf - s.pdf) < 1e-4f &&
                               std::abs(s.weight.x * s.pdf - at.f_cos.x) < 1e-4f);
    }
  integral *= 4 * 3.14159265 / (kSteps * kSteps);
  const double rest = 1 - double{bsdf.delta_probability(wo)};
  expect(std::abs(integral - rest) < 2e-3, "the density does not integrate to 1", z);
  expect(furnace < 1.001 * kSteps * kSteps, "the program gains energy", z);
  expect(is_reciprocal, "the program is not reciprocal", z);
  expect(agrees, "a sample does not agree with eval", z);
}
}

int main() {
  using namespace wavecomb;
  for (float amount : {0.f, 0.3f, 1.f}) {
    OpenPbrParams<float> p{};
    p.base_color = {1, 1, 1};
    p.roughness = p.opacity = p.clearcoat = amount;
    p.coat_ior = 1.5f;
    for (float z : {-0.9f, 0.05f, 0.5f, 1.f}) check(CLASSBsdf<float>(p, false), z);
  }
  return faults > 0;
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
        "  float merge_radius = 0;\n"
        "  float tea_time = 4.5f;  ///< in hours; 0 means never\n",
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
    '  X(ByConnections, "by_connections", 3, "RGB", kLight, kMean, kTechnique, "Connections")',
    "aov/path_aovs.h",
    "    {Aov::kByLightSamples, Technique::kLightSample | Technique::kConnection},\n",
    "    {Aov::kByLightSamples, Technique::kLightSample | Technique::kConnection},\n"
    "    {Aov::kByConnections, Technique::kConnection},\n",
)


# A longest connection.
OF_LIGHT_PATHS: Change = {
    f"{CORE}/core/settings.h": (
        "  float merge_radius = 0;\n",
        "  float merge_radius = 0;\n"
        "  float longest_connection = 0;  ///< 0 means no limit\n",
    ),
    f"{CORE}/core/settings_table.cpp": (
        '      number<&S::seed>("seed"',
        '      number<&S::longest_connection>("longest_connection", "Longest", 0, 1e30,\n'
        '                                     "Length of the longest connection.", "any"),\n'
        '      number<&S::seed>("seed"',
    ),
    f"{CORE}/light_paths/context.h": (
        "  float share = 1;",
        "  float longest2 = std::numeric_limits<float>::infinity();\n  float share = 1;",
        "#pragma once\n",
        "#pragma once\n\n#include <limits>\n",
    ),
    f"{CORE}/light_paths/setup.cpp": (
        "      connects(settings.connects()),\n",
        "      connects(settings.connects()),\n"
        "      longest2(settings.longest_connection > 0\n"
        "                   ? settings.longest_connection * settings.longest_connection\n"
        "                   : std::numeric_limits<float>::infinity()),\n",
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
    """Checks the syntax of the named files of a source tree, or of the C++ text `text`.

    The compiler reads the files as one unit, as with WAVECOMB_BATCH, and parses headers once.
    """
    found = [path for file in files for path in (tree / CORE).rglob(file)]
    assert len(found) == len(files)
    (tree / "use.cpp").write_text(text + "".join(f'#include "{path}"\n' for path in found))
    return subprocess.run(
        [*compiler, "-I", str(tree / "src"), str(tree / "use.cpp")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program(tmp_path: Path, compiler: list[str], name: str) -> None:
    """Programs that nest, transmit or layer take three files, compile, and are valid BSDFs."""
    row = PROGRAMS[name]
    change = program(*row)
    assert len(change) <= 3
    applied(tmp_path, change)
    nests = "true" if "kNests" in row[2] else "false"
    text = USES_PROGRAM.replace("CLASS", row[1]).replace("NESTS", nests)
    (tmp_path / "use.cpp").write_text(text)
    command = [*syntax.command(check_only=False), "-I", str(tmp_path / "src")]
    built = [*command, str(tmp_path / "use.cpp"), "-o", str(tmp_path / "use")]
    done = subprocess.run(built, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    done = subprocess.run([tmp_path / "use"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    done = compiled(tmp_path, compiler, "scene_materials.cpp", "mesh_medium.cpp")
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
    done = compiled(tmp_path, compiler, "settings_table.cpp", "setup.cpp")
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
