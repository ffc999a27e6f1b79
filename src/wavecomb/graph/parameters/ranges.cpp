// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/graph/parameters/ranges.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/core/lanes/lanes.h"

namespace wavecomb {
namespace {

ValueRange exactly(float value) {
  return {value, value, std::isnan(value)};
}
ValueRange hull(const ValueRange& a, const ValueRange& b) {
  return {std::min(a.low, b.low), std::max(a.high, b.high), a.nan || b.nan};
}
bool bounded(const ValueRange& r) {
  return std::isfinite(r.low) && std::isfinite(r.high);
}

/// Returns the range of a function that is monotonic in each operand while the others are fixed,
/// such as a sum or product. The extremes then lie at the ends of the operands' ranges, since
/// rounding preserves order.
template <typename Function>
ValueRange at_ends(const Function& f, const ValueRange& a, const ValueRange& b,
                   const ValueRange& c = exactly(0)) {
  if (!bounded(a) || !bounded(b) || !bounded(c)) return {};
  ValueRange r = exactly(f(a.low, b.low, c.low));
  for (const float x : {a.low, a.high})
    for (const float y : {b.low, b.high})
      for (const float z : {c.low, c.high}) r = hull(r, exactly(f(x, y, z)));
  if (!bounded(r)) return {};  // an infinite intermediate result may become NaN later
  r.nan = a.nan || b.nan || c.nan;
  return r;
}

// Ranges of min and max of core/lanes/lanes.h, which return `b` if either operand is NaN.
ValueRange min_of(const ValueRange& a, const ValueRange& b) {
  const ValueRange r{std::min(a.low, b.low), std::min(a.high, b.high), b.nan};
  return a.nan ? hull(r, b) : r;
}
ValueRange max_of(const ValueRange& a, const ValueRange& b) {
  const ValueRange r{std::max(a.low, b.low), std::max(a.high, b.high), b.nan};
  return a.nan ? hull(r, b) : r;
}

ValueRange abs_of(const ValueRange& a) {
  const float most = std::max(std::abs(a.low), std::abs(a.high));
  const bool crosses = a.low <= 0 && a.high >= 0;
  return {crosses ? 0.f : std::min(std::abs(a.low), std::abs(a.high)), most, a.nan};
}

/// Returns the range of "`b` if `a` is not 0, else `c`".
ValueRange select_of(const ValueRange& a, const ValueRange& b, const ValueRange& c) {
  if (!a.nan && a.low == 0 && a.high == 0) return c;
  return a.low > 0 || a.high < 0 ? b : hull(b, c);
}

/// Returns the range of "1 if `a` is below `b`, else 0".
ValueRange less_of(const ValueRange& a, const ValueRange& b) {
  if (!a.nan && !b.nan && a.high < b.low) return exactly(1);
  return {0, a.low >= b.high ? 0.f : 1.f, false};
}

ValueRange divide_of(const ValueRange& a, const ValueRange& b) {
  // The quotient is monotonic only if the range of the divisor does not contain a change of sign.
  if (b.low <= 0 && b.high >= 0) return {};
  return at_ends([](float x, float y, float) { return x / y; }, a, b);
}

ValueRange sqrt_of(const ValueRange& a) {
  const auto root = [](float x) { return safe_sqrt(x); };
  return a.nan || !bounded(a) ? ValueRange{} : ValueRange{root(a.low), root(a.high), false};
}

class Interpreter {
 public:
  Interpreter(const GraphSet& graphs, const GraphProgram& program,
              std::span<const TexturePtr> textures)
      : graphs_(graphs), program_(program), textures_(textures) {
    for (uint32_t i = 0; i < program.op_count; ++i) run(graphs.ops[program.first_op + i]);
  }
  ValueRange value(uint32_t from) const {
    if ((from & kGraphConstant) == 0) return registers_[from];
    return exactly(graphs_.constants[program_.first_constant + (from & (kGraphConstant - 1u))]);
  }

 private:
  void run(const GraphOp& op) {
    const auto in = [&](uint32_t k, uint32_t i) {
      return value(op.from[k] + ((op.steps >> k & 1u) != 0 ? i : 0u));
    };
    const uint32_t results = static_cast<GraphCode>(op.code) == GraphCode::kDot ? 1 : op.width;
    for (uint32_t i = 0; i < results; ++i) registers_[op.to + i] = component(op, i, in);
  }

  template <typename In>
  ValueRange component(const GraphOp& op, uint32_t i, const In& in) const {
    switch (static_cast<GraphCode>(op.code)) {
      case GraphCode::kCopy:
        return in(i, 0);
      case GraphCode::kImage: {
        const uint32_t texture = graphs_.images[program_.first_image + op.number].texture;
        if (texture >= textures_.size()) return {};
        const TexelRange& range = textures_[texture]->range();
        return {range.low[i], range.high[i], false};
      }
      case GraphCode::kAdd:
        return at_ends([](float a, float b, float) { return a + b; }, in(0, i), in(1, i));
      case GraphCode::kSubtract:
        return at_ends([](float a, float b, float) { return a - b; }, in(0, i), in(1, i));
      case GraphCode::kMultiply:
        return at_ends([](float a, float b, float) { return a * b; }, in(0, i), in(1, i));
      case GraphCode::kMix: {
        const ValueRange across =
            at_ends([](float a, float b, float) { return b - a; }, in(0, i), in(1, i));
        return at_ends([](float d, float c, float a) { return fma(d, c, a); }, across, in(2, i),
                       in(0, i));
      }
      case GraphCode::kMin:
        return min_of(in(0, i), in(1, i));
      case GraphCode::kMax:
        return max_of(in(0, i), in(1, i));
      case GraphCode::kClamp:
        return min_of(max_of(in(0, i), in(1, i)), in(2, i));
      case GraphCode::kSelect:
        return select_of(in(0, i), in(1, i), in(2, i));
      case GraphCode::kDivide:
        return divide_of(in(0, i), in(1, i));
      case GraphCode::kLess:
        return less_of(in(0, i), in(1, i));
      case GraphCode::kEqual:
        return {0, 1, false};
      case GraphCode::kSqrt:
        return sqrt_of(in(0, i));
      case GraphCode::kDot: {
        const auto times = [](float a, float b, float sum) { return fma(a, b, sum); };
        ValueRange sum = at_ends([](float a, float b, float) { return a * b; }, in(0, 0), in(1, 0));
        for (uint32_t k = 1; k < op.width; ++k) sum = at_ends(times, in(0, k), in(1, k), sum);
        return sum;
      }
      case GraphCode::kAbs:
        return abs_of(in(0, i));
      default:
        return {};
    }
  }

  const GraphSet& graphs_;
  const GraphProgram& program_;
  std::span<const TexturePtr> textures_;
  std::array<ValueRange, kMaxGraphRegisters> registers_;
};

}  // namespace

DrivenRanges driven_ranges(const GraphSet& graphs, uint32_t graph,
                           std::span<const TexturePtr> textures) {
  DrivenRanges ranges;
  if (graph == kNoGraph) return ranges;
  const GraphProgram& program = graphs.programs[graph];
  const Interpreter results(graphs, program, textures);
  for (uint32_t i = 0; i < program.output_count; ++i) {
    const GraphOutput& output = graphs.outputs[program.first_output + i];
    const uint32_t p = output.parameter;
    ranges[p] = min_of(max_of(results.value(output.from), exactly(kGraphRanges.low[p])),
                       exactly(kGraphRanges.high[p]));
  }
  return ranges;
}

}  // namespace wavecomb
