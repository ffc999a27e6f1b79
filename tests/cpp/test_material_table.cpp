// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/material/description/material_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

#include "wavecomb/core/error.h"
#include "wavecomb/material/description/variants.h"
#include "wavecomb/scene/scene_checks.h"

namespace wavecomb {
namespace {

TEST(ProgramList, ModelCostsAreThoseOfBeforeThereWasAList) {
  const float ns[] = {60, 75, 70, 85, 20, 110, 300};
  const char* names[] = {"diffuse",  "metal",      "dielectric", "plastic",
                         "emissive", "principled", "openpbr"};
  ASSERT_GE(kProgramCount, std::size(names));
  for (size_t i = 0; i < std::size(names); ++i) {
    EXPECT_STREQ(kPrograms[i].name, names[i]);
    EXPECT_STREQ(kProgramNames[i], names[i]);
    EXPECT_EQ(kPrograms[i].model_ns, ns[i]);
    EXPECT_EQ(can_emit(static_cast<ProgramId>(i)), i >= 4);
    EXPECT_EQ(kPrograms[i].own_count(), 0u);
  }
  for (uint32_t i = 0; i < kProgramCount; ++i)
    EXPECT_EQ(program_of(i), static_cast<ProgramId>(i)) << kVariants[i].name;
}

TEST(MaterialTable, WhatProgramsHaveToThemselvesIsInTheTable) {
  std::set<std::string> names;
  size_t own = 0;
  for (const MaterialParameter& p : material_table()) {
    EXPECT_TRUE(names.insert(p.name).second) << p.name;
    if (!p.own()) continue;
    ++own;
    const ProgramParameter& info = p.own()->info();
    EXPECT_STREQ(p.name, info.name);
    EXPECT_LT(info.least, info.most) << p.name;
    Material material;
    material.program = p.own()->program;
    const auto value = [&](float given) {
      material.own[p.own()->index] = given;
      check_material(material, 0, 0);
      return material.own_value(p.own()->index);
    };
    EXPECT_EQ(material.own_value(p.own()->index), value(info.standard)) << p.name;
    EXPECT_EQ(value(info.most), info.most) << p.name;
    EXPECT_THROW(value(info.most + 1), Error) << p.name;
    EXPECT_THROW(value(std::nanf("")), Error) << p.name;
  }
  size_t expected = 0;
  for (const ProgramInfo& program : kPrograms) expected += program.own_count();
  EXPECT_EQ(own, expected);
}

}  // namespace
}  // namespace wavecomb
