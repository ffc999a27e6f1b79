// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/film/layer_ids.h"

#include <string>

#include "wavecomb/core/error.h"

namespace wavecomb {

void check_id_layers(const AovSet& set, uint64_t instances, uint64_t materials) {
  const auto check = [&](Aov aov, uint64_t count, const char* what, const char* instead) {
    if (set.has(aov) && count > kMaxLayerIds)
      throw Error(std::string("AOV ") + aov_name(aov) + ": the scene has " + std::to_string(count) +
                  " " + what + ", but a float layer can distinguish only " +
                  std::to_string(kMaxLayerIds) + "; remove it, or use " + instead);
  };
  check(Aov::kInstanceId, instances, "instances", "crypto_object");
  check(Aov::kMaterialId, materials, "materials", "crypto_material");
}

}  // namespace wavecomb
