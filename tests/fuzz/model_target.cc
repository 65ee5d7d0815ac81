#include <cstring>

#include "engine/format/checksum.h"
#include "tests/attack/open_and_run.h"
#include "tests/fuzz/chosen_isa.h"
#include "tests/fuzz/targets.h"
#include "tests/unit/engine/aligned_bytes.h"

namespace dcloth::testing {

Verdict FuzzModel(const uint8_t* bytes, size_t size) {
  constexpr size_t kStorageLimit = 64 << 20;  // larger garments only cost time
  AlignedBytes file((size + 63) / 64 * 64);
  std::memset(file.data(), 0, file.size());
  if (size != 0) std::memcpy(file.data(), bytes, size);
  const ChosenIsa isa(format::Checksum(bytes, size) >> 32);
  const Outcome outcome = OpenAndRun(file.data(), file.size(), kStorageLimit);
  return {outcome.broken_promise, outcome.status == DCLOTH_OK};
}

}  // namespace dcloth::testing
