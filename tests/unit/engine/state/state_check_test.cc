// The rungs of a saved state's check one by one: limits themselves are allowed, what is next to them is not, and errors
// name the byte.
#include "engine/src/state/state_check.h"

#include <cmath>
#include <functional>
#include <limits>

#include "engine/src/network/schedule.h"
#include "engine/src/time/idle.h"
#include "tests/unit/engine/state_fixture.h"
#include "tests/unit/kernels/guarded_buffer.h"

namespace dcloth::engine {
namespace {

using testing::BuildModel;
using testing::EmptyError;
using testing::OpenedModel;
using testing::OwnedCloth;

constexpr double kEndless = std::numeric_limits<double>::infinity();

class StateCheckTest : public ::testing::Test {
 protected:
  StateCheckTest() {
    for (int tick = 0; tick < 4; ++tick)
      EXPECT_EQ(cloth_.Tick(testing::PoseAt(model_.numbers, tick / 30.0), DCLOTH_STAGES_MESH), DCLOTH_OK);
    sound_ = testing::HeadOf(testing::Save(&cloth_));
  }

  const format::ModelView& view() { return *reinterpret_cast<const Cloth*>(cloth_.get())->model; }

  bool Holds(const StateHead& head) {
    error_ = EmptyError();
    format::Diagnostic diagnostic(&error_);
    const bool holds = CheckStateHead(head, view(), &diagnostic);
    EXPECT_EQ(holds, diagnostic.status() == DCLOTH_OK);
    return holds;
  }

  // The field itself and its neighbour outside of the range, at both ends.
  void ExpectRange(double StateHead::*field, double low, double high) {
    for (const bool top : {false, true}) {
      StateHead head = sound_;
      head.*field = top ? high : low;
      EXPECT_TRUE(Holds(head)) << error_.text;
      head.*field = std::nextafter(head.*field, top ? kEndless : -kEndless);
      EXPECT_FALSE(Holds(head)) << head.*field;
      StateHead origin;
      EXPECT_EQ(error_.offset_bytes,
                static_cast<uint64_t>(reinterpret_cast<char*>(&(origin.*field)) - reinterpret_cast<char*>(&origin)));
    }
  }

  testing::TestModel model_ = BuildModel({});
  OpenedModel opened_{model_};
  OwnedCloth cloth_{opened_};
  StateHead sound_;
  dcloth_error error_;
};

TEST_F(StateCheckTest, CountsOfTheHead) {
  ASSERT_TRUE(Holds(sound_)) << error_.text;
  const auto with = [&](const std::function<void(StateHead*)>& change) {
    StateHead head = sound_;
    change(&head);
    return Holds(head);
  };
  constexpr auto kDone = static_cast<uint32_t>(TickPart::kDone);
  for (uint32_t ticks = 1; ticks <= 4; ++ticks)
    EXPECT_EQ(with([=](StateHead* h) { h->tick_count = ticks; }), ticks <= kTickSlots) << ticks;
  for (uint32_t stages = 0; stages < 20; ++stages) {
    const bool known =
        stages == DCLOTH_STAGES_STATIC || stages == DCLOTH_STAGES_SKELETON || stages == DCLOTH_STAGES_MESH;
    EXPECT_EQ(with([=](StateHead* h) { h->stages = stages; }), known) << stages;
  }
  for (uint32_t jumped = 0; jumped <= 3; ++jumped)
    EXPECT_EQ(with([=](StateHead* h) { h->jumped = jumped; }), jumped <= 1) << jumped;
  for (uint32_t ticks = 0; ticks <= kIdleTicks + 1; ++ticks) {
    const bool counting = ticks != 0 && ticks != kIdleTicks;
    for (const uint64_t floats : {uint64_t{0}, uint64_t{1}, uint64_t{1} << 24, (uint64_t{1} << 24) + 1, UINT64_MAX}) {
      const bool fits = counting ? floats != 0 && floats <= uint64_t{1} << 24 : floats == 0;
      EXPECT_EQ(with([=](StateHead* h) { h->idle_ticks = ticks, h->idle_floats = floats; }),
                ticks <= kIdleTicks && fits)
          << ticks << " " << floats;
    }
  }
  for (uint32_t number = 0; number <= 2 * kDone; ++number) {
    TickPart part{};
    const bool known = format::FindTickPart(number, &part), idle = known && part == TickPart::kDone;
    const uint64_t items = known ? TickItems(view(), DCLOTH_STAGES_MESH, part) : 0;
    for (const uint64_t done : {uint64_t{0}, uint64_t{1}, items - 1, items, items + 1}) {
      const bool allowed = idle ? done == 0 : done < items;
      EXPECT_EQ(with([=](StateHead* h) { h->part = number, h->items_done = static_cast<uint32_t>(done); }), allowed)
          << number << " " << done << " of " << items;
    }
  }
}

// Before the first tick there is nothing but zeros.
TEST_F(StateCheckTest, AFreshHead) {
  ASSERT_EQ(dcloth_cloth_reset(cloth_.get()), DCLOTH_OK);
  sound_ = testing::HeadOf(testing::Save(&cloth_));
  ASSERT_TRUE(Holds(sound_)) << error_.text;
  const std::function<void(StateHead*)> changes[] = {
      [](StateHead* h) { h->stages = DCLOTH_STAGES_SKELETON; }, [](StateHead* h) { h->part = 0; },
      [](StateHead* h) { h->idle_ticks = 1, h->idle_floats = 1; }, [](StateHead* h) { h->idle_ticks = kIdleTicks; },
      [](StateHead* h) { h->jumped = 1; }};
  for (const auto& change : changes) {
    StateHead head = sound_;
    change(&head);
    EXPECT_FALSE(Holds(head)) << error_.text;
  }
}

TEST_F(StateCheckTest, NumbersOfTheHead) {
  ExpectRange(&StateHead::since, -1e-3 - 1e-9, 1);
  ExpectRange(&StateHead::waited, -1, 1 << 20);
  ExpectRange(&StateHead::lag, 0, 2);
  ExpectRange(&StateHead::older_step, 0, 1 << 20);
  const auto largest = static_cast<double>(kLargestSaved);
  ExpectRange(&StateHead::yaw_rate, -largest, largest);
  ExpectRange(&StateHead::velocity_age, 0, 1e18);
  for (double(StateHead::*field)[3] : {&StateHead::position, &StateHead::velocity, &StateHead::wind}) {
    for (size_t i = 0; i < 3; ++i) {
      for (const double side : {-1.0, 1.0}) {
        StateHead head = sound_;
        (head.*field)[i] = side * largest;
        EXPECT_TRUE(Holds(head)) << error_.text;
        (head.*field)[i] = side * std::nextafter(largest, kEndless);
        EXPECT_FALSE(Holds(head)) << i;
      }
    }
  }
  StateHead head = sound_;
  head.tick_share = kLargestSaved;
  EXPECT_TRUE(Holds(head)) << error_.text;
  head.tick_share = std::nextafter(kLargestSaved, 1e30f);
  EXPECT_FALSE(Holds(head));
}

TEST_F(StateCheckTest, TheHeadingIsAUnitVector) {
  for (const double turn : {0.0, 0.5, 1.0, 2.0, 3.0, 4.0}) {
    for (const double length : {1 - 4e-13, 1.0, 1 + 4e-13, 1 - 6e-13, 1 + 6e-13}) {
      StateHead head = sound_;
      head.heading[0] = length * std::cos(turn);
      head.heading[1] = length * std::sin(turn);
      EXPECT_EQ(Holds(head), std::abs(length - 1) < 5e-13) << turn << " " << length;
    }
  }
}

// Poses of doubles: each of its numbers and none behind.
TEST_F(StateCheckTest, EveryNumberOfThePoses) {
  StateHead head = sound_;
  head.joint_count = 3;
  head.older_step = 0;
  const size_t numbers = StatePoseBytes(head) / sizeof(double);
  ASSERT_EQ(numbers, 2u * 3 * 12);
  kernels::GuardedBuffer<uint8_t> bytes(sizeof(StateHead) + StatePoseBytes(head));
  const auto put = [&](size_t i, double value) { std::memcpy(bytes.data() + sizeof(StateHead) + i * 8, &value, 8); };
  for (size_t i = 0; i < numbers; ++i) put(i, i % 2 == 0 ? 1e12 : -1e12);
  const auto holds = [&] {
    error_ = EmptyError();
    format::Diagnostic diagnostic(&error_);
    return CheckStatePoses(bytes.data(), head, &diagnostic);
  };
  EXPECT_TRUE(holds()) << error_.text;
  for (size_t i = 0; i < numbers; ++i) {
    for (const double bad : {std::nextafter(1e12, kEndless), -kEndless, std::nan("")}) {
      put(i, bad);
      ASSERT_FALSE(holds()) << i;
      ASSERT_EQ(error_.offset_bytes, sizeof(StateHead) + i * 8);
      ASSERT_EQ(std::string(error_.text).find("pose[" + std::to_string(i % 36) + "]: found "), 0u) << error_.text;
    }
    put(i, 0);
  }
}

// Floats as saved, and as they lie in a cloth, in rows with gaps that are not looked at.
TEST_F(StateCheckTest, EveryNumberOfTheSpans) {
  constexpr size_t kRows = 3, kColumns = 5, kStride = 8, kOffset = 12;
  for (const float largest : {kLargestHidden, kLargestSaved}) {
    for (const bool in_cloth : {false, true}) {
      std::vector<float> memory(kRows * kStride, NAN);
      kernels::GuardedBuffer<uint8_t> bytes(kOffset + kRows * kColumns * sizeof(float));
      const auto put = [&](size_t i, float value) {
        memory[i / kColumns * kStride + i % kColumns] = value;
        std::memcpy(bytes.data() + kOffset + i * sizeof(float), &value, sizeof(float));
      };
      StateSpans spans;
      spans.Add("mesh_state", memory.data(), kRows, kColumns, kStride, largest);
      spans.Add("no rows", nullptr, 0, kColumns, kStride, largest);
      spans.Add("no columns", nullptr, kRows, 0, kStride, largest);
      ASSERT_EQ(spans.count, 1u);
      ASSERT_EQ(spans.Floats(), kRows * kColumns);
      const auto holds = [&] {
        error_ = EmptyError();
        format::Diagnostic diagnostic(&error_);
        return CheckStateSpans(in_cloth ? nullptr : bytes.data(), kOffset, spans, &diagnostic);
      };
      for (size_t i = 0; i < kRows * kColumns; ++i) put(i, i % 2 == 0 ? largest : -largest);
      EXPECT_TRUE(holds()) << error_.text;
      for (size_t i = 0; i < kRows * kColumns; ++i) {
        for (const float bad : {std::nextafter(largest, 1e30f), -std::nextafter(largest, 1e30f), NAN}) {
          put(i, bad);
          ASSERT_FALSE(holds()) << i;
          ASSERT_EQ(error_.offset_bytes, kOffset + i * sizeof(float)) << error_.text;
          ASSERT_EQ(std::string(error_.text).find("mesh_state[" + std::to_string(i % kColumns) + "]: found "), 0u);
          ASSERT_NE(std::string(error_.text).find(largest == kLargestHidden ? "-1 to 1" : "-1e18 to 1e18"),
                    std::string::npos);
        }
        put(i, 0);
      }
    }
  }
}

}  // namespace
}  // namespace dcloth::engine
