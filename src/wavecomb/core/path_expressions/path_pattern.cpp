// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/path_expressions/path_pattern.h"

#include <algorithm>
#include <string_view>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

constexpr uint32_t kMaxRepeats = 64;
constexpr uint32_t kMaxNesting = 64;

/// Returns the symbols that a letter of a light path expression matches, inside or outside of <>.
PathSymbols symbols_of_letter(char letter) {
  PathSymbols s;
  const auto events = [&](std::initializer_list<uint32_t> numbers) {
    for (const uint32_t n : numbers) s.set(kFirstEvent + n);
  };
  const auto ends = [&](std::initializer_list<PathEnd> kinds) {
    for (const PathEnd end : kinds)
      for (uint32_t key = 0; key < kMaxKeys; ++key) s.set(kFirstEnd + path_end(end, key));
  };
  switch (letter) {
    case 'C':
      s.set(kCameraSymbol);
      break;
    case 'R':
      events({0, 1, 2});
      break;
    case 'T':
      events({3, 4, 5});
      break;
    case 'V':
      events({static_cast<uint32_t>(PathEvent::kVolume)});
      break;
    case 'W':
      events({static_cast<uint32_t>(PathEvent::kSubsurface)});
      break;
    case 'D':
      events({kDiffuseEvent, 3 + kDiffuseEvent});
      break;
    case 'G':
      events({kGlossyEvent, 3 + kGlossyEvent});
      break;
    case 'S':
      events({kSingularEvent, 3 + kSingularEvent});
      break;
    case 'L':
      ends({PathEnd::kLight, PathEnd::kBackground});
      break;
    case 'B':
      ends({PathEnd::kBackground});
      break;
    case 'O':
      ends({PathEnd::kObject, PathEnd::kVolume});
      break;
    case 'E':
      ends({PathEnd::kVolume});
      break;
    default:
      break;
  }
  return s;
}

PathSymbols all_symbols() {
  return PathSymbols().set();
}

/// Recursive-descent parser of one expression.
class ExpressionParser {
 public:
  ExpressionParser(const NamedExpression& expression, const std::span<const std::string>* keys)
      : name_(expression.name), text_(expression.text), keys_(keys) {}

  PathPattern whole() {
    PathPattern p = choice();
    if (peek() != 0)
      fail(peek() == ')' ? "')' closes nothing" : "a letter, '.', '<', '[' or '(' is missing here");
    return p;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    const std::string where =
        at_ < text_.size() ? "character " + std::to_string(at_ + 1) + " ('" + text_[at_] + "')"
                           : std::string("its end");
    throw Error("light path expression " + name_ + "=" + std::string(text_) + ": at " + where +
                ": " + what);
  }

  /// Returns the next character that is not a space, or 0 at the end.
  char peek() {
    while (at_ < text_.size() && text_[at_] == ' ') ++at_;
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool take(char c) {
    if (peek() != c) return false;
    ++at_;
    return true;
  }
  void need(char c, const std::string& what) {
    if (!take(c)) fail(what);
  }

  PathPattern choice() {
    if (++depth_ > kMaxNesting) fail("groups are nested too deep");
    PathPattern p{.kind = PathPattern::Kind::kChoice};
    do {
      p.parts.push_back(sequence());
    } while (take('|'));
    --depth_;
    return p.parts.size() == 1 ? std::move(p.parts.front()) : p;
  }

  PathPattern sequence() {
    PathPattern p{.kind = PathPattern::Kind::kSequence};
    for (char c = peek(); c != 0 && c != '|' && c != ')'; c = peek()) p.parts.push_back(repeated());
    if (p.parts.empty()) fail("something to match is missing");
    return p;
  }

  PathPattern repeated() {
    PathPattern p = one();
    for (uint32_t n = 0;; ++n) {
      uint32_t least = 0, most = PathPattern::kUnlimited;
      if (take('+')) {
        least = 1;
      } else if (take('?')) {
        most = 1;
      } else if (take('{')) {
        counts(least, most);
      } else if (!take('*')) {
        return p;
      }
      if (n == kMaxNesting) fail("too many repetitions of repetitions");
      PathPattern outer{.kind = PathPattern::Kind::kRepeat, .least = least, .most = most};
      outer.parts.push_back(std::move(p));
      p = std::move(outer);
    }
  }

  void counts(uint32_t& least, uint32_t& most) {
    least = most = number();
    if (take(',')) most = peek() == '}' ? PathPattern::kUnlimited : number();
    if (most < least) fail("{n,m} counts down");
    need('}', "'}' is missing after the count");
  }
  uint32_t number() {
    if (peek() < '0' || peek() > '9') fail("a number is missing in {n,m}");
    uint32_t n = 0;
    for (; peek() >= '0' && peek() <= '9'; ++at_) {
      n = 10 * n + static_cast<uint32_t>(peek() - '0');
      if (n > kMaxRepeats) fail("a count is at most " + std::to_string(kMaxRepeats));
    }
    return n;
  }

  PathPattern one() {
    if (take('(')) {
      PathPattern p = choice();
      need(')', "')' is missing");
      return p;
    }
    return {.kind = PathPattern::Kind::kSymbols, .symbols = symbol()};
  }

  /// Parses a letter, '.', <...> or [...].
  PathSymbols symbol() {
    if (take('<')) return event();
    if (!take('[')) return letter(".CLOBERTVWDGS");
    const bool is_negated = take('^');
    PathSymbols s;
    while (!take(']')) {
      if (peek() == 0) fail("']' is missing");
      s |= symbol();
    }
    return is_negated ? ~s : s;
  }

  PathSymbols letter(std::string_view known) {
    const char c = peek();
    if (c == 0 || known.find(c) == std::string_view::npos) {
      if (c == 's') fail("there are no events for cut-outs; remove s");
      std::string list;
      for (const char k : known) list.append({' ', k});
      fail("there is no such letter here; there are" + list);
    }
    ++at_;
    return c == '.' ? all_symbols() : symbols_of_letter(c);
  }
  /// Parses one component of an event in <>: a letter from `known`, or several such letters in [].
  PathSymbols parse_position(std::string_view known) {
    if (!take('[')) return letter(known);
    const bool is_negated = take('^');
    PathSymbols s;
    while (!take(']')) {
      if (peek() == 0) fail("']' is missing");
      s |= letter(known);
    }
    return is_negated ? ~s : s;
  }

  /// Parses the part of an event after '<': type of event, type of scattering, and light group.
  PathSymbols event() {
    PathSymbols s = parse_position(".CLOBERTVW");
    // Path ends have no scattering type, so the expression <L.> is equivalent to L.
    if (peek() != '>' && peek() != '\'') {
      const PathSymbols scattered = parse_position(".DGS");
      PathSymbols scattering;
      for (size_t e = 0; e < kPathEvents; ++e) scattering.set(kFirstEvent + e);
      const PathSymbols all = all_symbols();
      s &= scattered == all ? all : scattered & scattering;
    }
    if (take('\'')) s &= key();
    need('>', "'>' is missing");
    return s;
  }

  /// Parses the name of a light group after an opening quote.
  PathSymbols key() {
    const size_t begin = at_;
    const size_t end = text_.find('\'', begin);
    if (end == std::string_view::npos) fail("the name of a light group has no closing quote");
    const std::string_view key = text_.substr(begin, end - begin);
    PathSymbols s;
    if (keys_) {
      const auto found = std::find(keys_->begin(), keys_->end(), key);
      if (found == keys_->end()) {
        std::string list;
        for (const std::string& known : *keys_) list += (list.empty() ? "" : ", ") + known;
        fail("the scene has no light group '" + std::string(key) + "'; it has " + list);
      }
      const auto number = static_cast<uint32_t>(found - keys_->begin());
      for (uint32_t e = 0; e < kPathEnds; ++e)
        s.set(kFirstEnd + path_end(static_cast<PathEnd>(e), number));
    }
    at_ = end + 1;
    return s;
  }

  const std::string& name_;
  std::string_view text_;
  const std::span<const std::string>* keys_;
  size_t at_ = 0;
  uint32_t depth_ = 0;
};

}  // namespace

PathPattern parse_expression(const NamedExpression& expression,
                             const std::span<const std::string>* keys) {
  return ExpressionParser(expression, keys).whole();
}

}  // namespace wavecomb
