// No allocation, on any thread, in a long run: malloc, calloc, realloc, aligned blocks, operator new.
#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <iostream>
#include <limits>
#include <new>
#include <thread>

#include "tests/attack/variants.h"
#include "tests/unit/engine/allocation_trap.h"
#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {
namespace {

constexpr int kFrames = 10000;  // of each thread

// Keeps the optimiser from removing an allocation that is freed at once.
template <typename T>
T* Used(T* pointer) {
  __asm__ volatile("" : "+r"(pointer) : : "memory");
  return pointer;
}

// The trap must see each way to memory, from another thread too, or its silence says nothing.
TEST(Allocation, TheTrapSeesEveryWay) {
  const auto seen = [](auto allocate) {
    AllocationTrap trap;
    allocate();
    return trap.count();
  };
  constexpr std::align_val_t kLine{64};
  EXPECT_EQ(seen([] {}), 0u);
  EXPECT_GT(seen([] { delete Used(new int); }), 0u);
  EXPECT_GT(seen([] { delete[] Used(new char[100]); }), 0u);
  EXPECT_GT(seen([&] { ::operator delete(Used(static_cast<char*>(::operator new(100, kLine))), kLine); }), 0u);
  EXPECT_GT(seen([] { std::free(Used(static_cast<char*>(std::malloc(100)))); }), 0u);
  EXPECT_GT(seen([] { std::free(Used(static_cast<char*>(std::calloc(100, 1)))); }), 0u);
  EXPECT_GT(seen([] { std::free(Used(static_cast<char*>(std::realloc(nullptr, 100)))); }), 0u);
  EXPECT_GT(seen([] { std::free(Used(static_cast<char*>(std::aligned_alloc(64, 640)))); }), 0u);
  std::atomic<int> step{0};
  std::thread other([&] {
    while (step != 1) std::this_thread::yield();
    delete[] Used(new char[100]);
    step = 2;
  });
  EXPECT_GT(seen([&] {
              step = 1;
              while (step != 2) std::this_thread::yield();
            }),
            0u);
  other.join();
}

// Two characters on two threads share a model; stages, resets, refused poses and hops of level of detail on
// the way.
TEST(Allocation, NoneInTenThousandFramesOnTwoThreads) {
  ModelSpec spec = Variants()[6].spec;
  ASSERT_EQ(spec.precision, format::DType_I8);
  const TestModel model = BuildModel(spec);
  const OpenedModel opened(model);
  OwnedCloth first(opened), second(opened);
  std::vector<std::vector<float>> poses;
  for (int tick = 0; tick < 100; ++tick) poses.push_back(PoseAt(model.numbers, tick / 30.0));
  std::vector<float> bad = poses[0];
  bad[5] = std::numeric_limits<float>::quiet_NaN();
  std::atomic<int> ready{0};
  std::atomic<bool> go{false};
  std::atomic<int> done{0};
  std::atomic<int> wrong{0};
  const auto play = [&](OwnedCloth* cloth) {
    ++ready;
    while (!go) std::this_thread::yield();
    constexpr uint32_t kStages[] = {DCLOTH_STAGES_MESH, DCLOTH_STAGES_MESH, DCLOTH_STAGES_SKELETON,
                                    DCLOTH_STAGES_STATIC};
    for (int frame = 0; frame < kFrames; ++frame) {
      const std::vector<float>& pose = poses[static_cast<size_t>(frame) % poses.size()];
      wrong += cloth->Tick(pose, kStages[frame / 50 % 4]) != DCLOTH_OK;
      wrong += cloth->Skin(pose, 0.5f) != DCLOTH_OK;
      if (frame % 97 == 0) wrong += cloth->Tick(bad, DCLOTH_STAGES_MESH) != DCLOTH_ERROR_POSE;
      if (frame % 1000 == 999) wrong += dcloth_cloth_reset(cloth->get()) != DCLOTH_OK;
    }
    ++done;
  };
  std::thread a(play, &first), b(play, &second);
  while (ready != 2) std::this_thread::yield();
  size_t seen = 0;
  {
    AllocationTrap trap;
    go = true;
    while (done != 2) std::this_thread::yield();
    seen = trap.count();
  }
  a.join();
  b.join();
  EXPECT_EQ(seen, 0u);
  EXPECT_EQ(wrong, 0);
  std::cout << "allocations in 2 x " << kFrames << " frames: " << seen << "\n";
}

// Opening allocates nothing either, whether the model is sound, damaged or no model at all.
TEST(Allocation, NoneInOpeningDescribingCreating) {
  const AlignedBytes whole = BuildModel(Variants()[6].spec).Bytes();
  AlignedBytes damaged = whole, storage(dcloth_model_storage_size()), memory(1 << 20);
  dcloth_model* model = nullptr;
  dcloth_cloth* cloth = nullptr;
  dcloth_error error = EmptyError();
  dcloth_model_info info = {};
  info.struct_size = sizeof(info);
  size_t seen = 0, refused = 0, opened = 0;
  {
    AllocationTrap trap;
    for (size_t byte = 0; byte < whole.size(); byte += 3) {
      damaged.data()[byte] ^= 0x80;
      const dcloth_status status =
          dcloth_model_open(damaged.data(), damaged.size(), storage.data(), storage.size(), &model, &error);
      damaged.data()[byte] ^= 0x80;
      if (status != DCLOTH_OK) {
        ++refused;
        continue;
      }
      ++opened;
      dcloth_model_describe(model, &info);
      if (dcloth_cloth_storage_size(model) <= memory.size())
        dcloth_cloth_create(model, memory.data(), memory.size(), &cloth, &error);
    }
    seen = trap.count();
  }
  EXPECT_EQ(seen, 0u);
  EXPECT_GT(refused, 100u);
  EXPECT_GT(opened, 100u);
}

}  // namespace
}  // namespace dcloth::testing
