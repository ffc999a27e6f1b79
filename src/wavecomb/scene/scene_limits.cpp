// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/scene_limits.h"

#include <algorithm>

#include "wavecomb/core/error.h"
#include "wavecomb/geometry/mesh/mesh.h"
#include "wavecomb/geometry/mesh/motion.h"
#include "wavecomb/light/description/light_records.h"
#include "wavecomb/material/description/openpbr_inputs.h"
#include "wavecomb/scene/names.h"
#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {
namespace {

template <typename Record>
constexpr uint64_t words_of = sizeof(Record) / 4;

static_assert((kMaxInstances + 1) * words_of<InstanceRecord> == kGatherWords);

/// Size in 32-bit words of the largest of the records that a material has in tables.
constexpr uint64_t kMaterialWords =
    std::max({words_of<MaterialRecord>, kInputCount * words_of<TextureUseRecord>,
              words_of<OpenPbrRecord>, words_of<ProgramParameterRecord>});

}  // namespace

std::string with_commas(uint64_t n) {
  std::string text = std::to_string(n);
  for (size_t at = text.size(); at > 3; at -= 3) text.insert(at - 3, 1, ',');
  return text;
}

void check_counts(const SceneCounts& counts) {
  const auto check = [](uint64_t count, uint64_t most, const char* what, const char* advice) {
    if (count > most)
      throw Error("the scene has " + with_commas(count) + " " + what + "; " + with_commas(most) +
                  " can be numbered; " + advice);
  };
  check(counts.meshes, kGatherWords / words_of<MeshRecord>, "meshes", "join some");
  check(counts.materials, kGatherWords / kMaterialWords, "materials", "share some");
  check(counts.instances, kMaxInstances, "instances", "use fewer");
  check(counts.grouped, kGatherWords, "meshes in groups", "join some");
  check(counts.instanced_meshes, kGatherWords, "meshes in instances",
        "join the meshes that are instanced together");
  check(counts.placements, uint64_t{kNoName}, "instances of groups of instances", "nest fewer");
  check(counts.steps, kMaxRowWords / words_of<MatrixStep>, "transforms over the shutter",
        "use fewer motion steps");
  check(counts.lights, kGatherWords / words_of<LightRecord>, "lights", "use fewer");
  check(counts.profile_values, kGatherWords, "values of IES profiles", "use smaller files");
  check(counts.link_words, kGatherWords, "words of light links", "link fewer lights");
}

}  // namespace wavecomb
