// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/aov.h"

#include "wavecomb/core/error.h"

namespace wavecomb {

std::vector<std::string> AovSet::names() const {
  std::vector<std::string> out;
  for (const AovRow& row : kAovs)
    if (has(row.aov) && row.kind != AovKind::kExpressions) out.emplace_back(row.name);
  return out;
}

Aov AovSet::parse(std::string_view name) {
  std::string list;
  for (const AovRow& row : kAovs) {
    if (row.kind == AovKind::kExpressions) continue;
    if (name == row.name) return row.aov;
    list += (list.empty() ? "" : ", ") + std::string(row.name);
  }
  throw Error("AOV '" + std::string(name) + "' is not known; there are " + list);
}

}  // namespace wavecomb
