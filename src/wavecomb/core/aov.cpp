// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/aov.h"

#include <bit>

#include "wavecomb/core/error.h"

namespace wavecomb {

const char* const kAovNames[kAovCount] = {
    "albedo",       "normal",      "depth",         "position",        "uv",
    "material_id",  "instance_id", "crypto_object", "crypto_material", "crypto_asset",
    "emission",     "direct",      "indirect",      "light_groups",    "cost",
    "guide_albedo", "guide_normal"};

const char* aov_name(Aov aov) {
  return kAovNames[std::countr_zero(static_cast<uint32_t>(aov))];
}

std::vector<std::string> AovSet::names() const {
  std::vector<std::string> out;
  for (uint32_t i = 0; i < kAovCount; ++i)
    if ((bits >> i & 1u) != 0) out.emplace_back(kAovNames[i]);
  return out;
}

Aov AovSet::parse(std::string_view name) {
  std::string list;
  for (uint32_t i = 0; i < kAovCount; ++i) {
    if (name == kAovNames[i]) return static_cast<Aov>(1u << i);
    list += (list.empty() ? "" : ", ") + std::string(kAovNames[i]);
  }
  throw Error("AOV '" + std::string(name) + "' is not known; there are " + list);
}

}  // namespace wavecomb
