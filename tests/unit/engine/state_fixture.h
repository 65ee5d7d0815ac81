// Saved states as bytes, and ways to change them.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_STATE_FIXTURE_H_
#define DCLOTH_TESTS_UNIT_ENGINE_STATE_FIXTURE_H_

#include <algorithm>
#include <cstring>
#include <vector>

#include "engine/format/checksum.h"
#include "engine/src/state/state.h"
#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {

using StateBytes = std::vector<uint8_t>;

inline StateBytes Save(OwnedCloth* cloth) {
  StateBytes bytes(dcloth_cloth_state_size(cloth->get()));
  dcloth_error error = EmptyError();
  EXPECT_EQ(dcloth_cloth_save(cloth->get(), bytes.data(), bytes.size(), &error), DCLOTH_OK) << error.text;
  return bytes;
}

inline dcloth_status Restore(OwnedCloth* cloth, const StateBytes& bytes, uint32_t flags = 0,
                             dcloth_error* error = nullptr) {
  return dcloth_cloth_restore(cloth->get(), bytes.data(), bytes.size(), flags, error);
}

inline engine::StateHead HeadOf(const StateBytes& bytes) {
  engine::StateHead head;
  std::memcpy(&head, bytes.data(), sizeof(head));
  return head;
}

inline bool InWork(const StateBytes& bytes) {
  return HeadOf(bytes).part != format::FactsOf(engine::TickPart::kDone).number;
}

// As someone who knows the format does after changing bytes.
inline void Seal(StateBytes* bytes) {
  const uint64_t sum =
      format::Checksum(bytes->data() + engine::kStateSummedFrom, bytes->size() - engine::kStateSummedFrom);
  std::memcpy(bytes->data() + offsetof(engine::StateHead, checksum), &sum, sizeof(sum));
}

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_STATE_FIXTURE_H_
