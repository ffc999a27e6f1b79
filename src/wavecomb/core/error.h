// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

namespace wavecomb {

/// Exception for errors that invalid input causes. The message is one line that names the prim,
/// file or option and states what to do.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace wavecomb
