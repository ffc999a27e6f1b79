// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/path_expressions/path_expression.h"

#include <gtest/gtest.h>

#include <regex>
#include <string>
#include <vector>

#include "wavecomb/core/error.h"
#include "wavecomb/core/path_expressions/backward_automaton.h"

namespace wavecomb {
namespace {

const std::vector<std::string> kKeys{"other", "key"};
/// Letters that stand for path events and path ends in regular expressions. Upper-case ends have
/// the key "key": lights, domes, objects, volumes.
constexpr std::string_view kEventLetters = "abcdefvw", kEndLetters = "lgoeLGOE";

/// A light path expression, and the equivalent regular expression over the letters of events and
/// ends.
struct Pair {
  const char *expression, *regex;
};
constexpr Pair kPairs[] = {
    {"C.*", ".*"},
    {"C<RD>.*", "a.*"},
    {"C[LO]", "[lgoeLGOE]"},
    {"CB", "[gG]"},
    {"C.*<L.'key'>", ".*[LG]"},
    {"C.*[^<L.'key'>]", ".*[^LG]"},
    {"C[^D]*D+[LO]", "[^ad]*[ad]+[lgoeLGOE]"},
    {"C<R[GS]>(<T.><T.>)*.", "[bc]([def][def])*."},
    {"C.{1,2}O", ".{1,2}[oeOE]"},
    {"C(V.*|E)", "v.*|[eE]"},
    {"C.*<E.'key'>", ".*E"},
    {"CV?<.S>{2,}.", "v?[cf]{2,}."},
    {"C(D|S|V)+L", "([ad]|[cf]|v)+[lgLG]"},
    {"C < T D > . *", "d.*"},
};

uint32_t state_after(const PathAutomaton& a, const std::vector<uint32_t>& events) {
  uint32_t state = 0;
  for (const uint32_t e : events) state = a.next[state * PathAutomaton::kNextWords + e];
  return state;
}

std::string message_of(const std::string& name, const std::string& text) {
  try {
    check_expressions(std::vector<NamedExpression>{{name, text}});
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(PathExpression, MatchesAsARegularExpressionDoes) {
  std::vector<NamedExpression> all;
  std::vector<std::regex> regexes;
  for (const Pair& pair : kPairs) {
    all.push_back({"e" + std::to_string(all.size()), pair.expression});
    regexes.emplace_back(pair.regex);
  }
  const PathAutomaton automaton(all, kKeys);
  ASSERT_EQ(automaton.expressions, all.size());
  ASSERT_EQ(automaton.ends, kEndLetters.size());
  for (uint32_t length = 0; length <= 3; ++length) {
    uint32_t count = 1;
    for (uint32_t i = 0; i < length; ++i) count *= kPathEvents;
    for (uint32_t number = 0; number < count; ++number) {
      std::vector<uint32_t> events;
      std::string text;
      for (uint32_t i = 0, rest = number; i < length; ++i, rest /= kPathEvents) {
        events.push_back(rest % kPathEvents);
        text += kEventLetters[events.back()];
      }
      const uint32_t state = state_after(automaton, events);
      for (uint32_t end = 0; end < automaton.ends; ++end)
        for (size_t e = 0; e < all.size(); ++e)
          ASSERT_EQ(automaton.matched[state * automaton.ends + end] >> e & 1u,
                    std::regex_match(text + kEndLetters[end], regexes[e]))
              << all[e].text << " and " << text << kEndLetters[end];
    }
  }
}

TEST(PathExpression, IsTheLeastAutomaton) {
  const auto states = [](const char* text) {
    return PathAutomaton(std::vector<NamedExpression>{{"a", text}}, kKeys).states();
  };
  EXPECT_EQ(states("C.*"), 1u);
  EXPECT_EQ(states("C[LO]"), 2u);
  EXPECT_EQ(states("C(.|.)*.*(D*.*)*"), 1u);
  EXPECT_EQ(states("C<RD>.*[LO]"), 3u);
}

TEST(PathExpression, PartitionsCoverEveryPathOnce) {
  const PathAutomaton a(
      std::vector<NamedExpression>{
          {"emission", "C[LO]"}, {"diffuse", "CD.*[LO]"}, {"other", "C[^D].*[LO]"}},
      kKeys);
  for (uint32_t s = 0; s < a.states(); ++s)
    for (uint32_t end = 0; end < a.ends; ++end) {
      const uint32_t bits = a.matched[s * a.ends + end];
      EXPECT_TRUE(bits == 1 || bits == 2 || bits == 4) << s << " " << end;
    }
}

TEST(PathExpression, ErrorsNameThePlace) {
  EXPECT_EQ(message_of("a", "C<RX>L"),
            "light path expression a=C<RX>L: at character 4 ('X'): there is no such letter here; "
            "there are . D G S");
  EXPECT_EQ(message_of("a", "C(D|"),
            "light path expression a=C(D|: at its end: something to match is missing");
  EXPECT_NE(message_of("a", "C)").find("character 2 (')'): ')' closes nothing"), std::string::npos);
  EXPECT_NE(message_of("a", "C<RDL").find("'>' is missing"), std::string::npos);
  EXPECT_NE(message_of("a", "C[DS").find("']' is missing"), std::string::npos);
  EXPECT_NE(message_of("a", "C{3,2}").find("counts down"), std::string::npos);
  EXPECT_NE(message_of("a", "C{99}").find("at most 64"), std::string::npos);
  EXPECT_NE(message_of("a", "<RD>L").find("write C first"), std::string::npos);
  EXPECT_NE(message_of("a b", "C.*").find("letters, digits and underscores"), std::string::npos);
  EXPECT_NE(message_of("a", "CsL").find("cut-outs"), std::string::npos);
  EXPECT_NE(message_of("a", std::string(200, '(')).find("nested too deep"), std::string::npos);
  EXPECT_EQ(message_of("a", "C.*<L.'nobody'>"), "");
  EXPECT_THROW(PathAutomaton(std::vector<NamedExpression>{{"a", "C.*<L.'nobody'>"}}, kKeys), Error);
  EXPECT_THROW(check_expressions(std::vector<NamedExpression>{{"a", "C.*"}, {"a", "CL"}}), Error);
}

TEST(PathExpression, TooMuchIsRefused) {
  const std::vector<NamedExpression> wide{{"a", "C.*D.{10}[LO]"}};
  EXPECT_THROW(PathAutomaton(wide, kKeys), Error);
}

/// A path is read backwards from its end to some vertex, and forwards from the camera to the same
/// vertex. The combination matches exactly if the forward automaton matches the whole path.
TEST(BackwardAutomaton, MeetsTheForwardOneAnywhere) {
  std::vector<NamedExpression> all;
  for (const Pair& pair : kPairs)
    all.push_back({"e" + std::to_string(all.size()), pair.expression});
  const PathAutomaton forward(all, kKeys);
  const BackwardAutomaton backward(forward);
  ASSERT_EQ(backward.begin.size(), forward.ends);
  EXPECT_LT(backward.states(), 200u);
  for (uint32_t number = 0; number < kPathEvents * kPathEvents * kPathEvents; ++number) {
    const std::vector<uint32_t> events{number % kPathEvents, number / kPathEvents % kPathEvents,
                                       number / kPathEvents / kPathEvents};
    for (uint32_t end = 0; end < forward.ends; ++end) {
      const uint32_t expected = forward.matched[state_after(forward, events) * forward.ends + end];
      uint32_t state = backward.begin[end];
      for (size_t i = events.size();; --i) {
        const uint32_t before =
            state_after(forward, {events.begin(), events.begin() + static_cast<std::ptrdiff_t>(i)});
        ASSERT_EQ(backward.matched[state * backward.forward_states + before], expected)
            << number << " " << end << " " << i;
        if (i == 0) break;
        state = backward.next[state * PathAutomaton::kNextWords + events[i - 1]];
      }
    }
  }
}

/// The expression depends on which of the last eleven events were diffuse, so the backward
/// automaton has 2^11 states and the forward automaton only a few.
TEST(BackwardAutomaton, RefusesWhatIsTooMuch) {
  const PathAutomaton forward(std::vector<NamedExpression>{{"a", "C.{10}D.*[LO]"}}, kKeys);
  EXPECT_LT(forward.states(), 20u);
  EXPECT_THROW(BackwardAutomaton{forward}, Error);
  const PathAutomaton one(std::vector<NamedExpression>{{"a", "C.{3}D.*[LO]"}}, kKeys);
  EXPECT_GT(BackwardAutomaton(one).states(), 0u);
}

}  // namespace
}  // namespace wavecomb
