// SPDX-License-Identifier: Apache-2.0
/// Tests with a missing requirement are skipped, and fail in CI.
#include "parts.h"

#include <gtest/gtest-spi.h>
#include <gtest/gtest.h>

namespace wavecomb {
namespace {

/// Sets or removes an environment variable for the duration of a scope.
class Variable {
 public:
  Variable(const char* name, const char* value) : name_(name) {
    if (const char* given = std::getenv(name)) old_ = given, had_ = true;
    value ? ::setenv(name, value, 1) : ::unsetenv(name);
  }
  ~Variable() { had_ ? ::setenv(name_, old_.c_str(), 1) : ::unsetenv(name_); }

 private:
  const char* name_;
  std::string old_;
  bool had_ = false;
};

void lacks_engine() {
  WAVECOMB_NEEDS("engine", "it was sold");
}

TEST(Parts, FlagsAreRead) {
  for (const char* value : {"1", "true", "Yes"}) {
    const Variable v("WAVECOMB_SOME_FLAG", value);
    EXPECT_TRUE(is_on("WAVECOMB_SOME_FLAG")) << value;
  }
  for (const char* value : {"", "0", "False", "no", "off"}) {
    const Variable v("WAVECOMB_SOME_FLAG", value);
    EXPECT_FALSE(is_on("WAVECOMB_SOME_FLAG")) << value;
  }
  EXPECT_FALSE(is_on("WAVECOMB_SOME_OTHER_FLAG"));
}

TEST(Parts, CiIsStrictUnlessToldOtherwise) {
  {
    const Variable ci("CI", "true"), strict("WAVECOMB_STRICT", nullptr);
    EXPECT_TRUE(is_strict());
    const Variable told("WAVECOMB_STRICT", "0");
    EXPECT_FALSE(is_strict());
  }
  const Variable ci("CI", nullptr), strict("WAVECOMB_STRICT", nullptr);
  EXPECT_FALSE(is_strict());
  const Variable told("WAVECOMB_STRICT", "1");
  EXPECT_TRUE(is_strict());
}

TEST(Parts, AMissingPartIsAFailureWhereStrict) {
  const Variable strict("WAVECOMB_STRICT", "1");
  EXPECT_FATAL_FAILURE(lacks_engine(), "needs engine: it was sold");
}

TEST(Parts, AMissingPartIsASkipElsewhere) {
  const Variable strict("WAVECOMB_STRICT", "0");
  testing::TestPartResultArray results;
  {
    testing::ScopedFakeTestPartResultReporter reporter(
        testing::ScopedFakeTestPartResultReporter::INTERCEPT_ONLY_CURRENT_THREAD, &results);
    lacks_engine();
  }
  ASSERT_EQ(results.size(), 1);
  EXPECT_TRUE(results.GetTestPartResult(0).skipped());
  EXPECT_STREQ(results.GetTestPartResult(0).message(), "needs engine: it was sold");
}

}  // namespace
}  // namespace wavecomb
