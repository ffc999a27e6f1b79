// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/path/program_reads.h"

#include "wavecomb/material/program_list.h"

namespace wavecomb {

ProgramReads reads_of(ProgramId program) {
  return [&]<typename... Bsdf>(ProgramList<Bsdf...>) {
    ProgramReads (*const all[])() = {&program_reads<Bsdf>...};
    return all[static_cast<size_t>(program)]();
  }(Programs<float>{});
}

}  // namespace wavecomb
