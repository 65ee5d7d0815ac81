// Two models and many instances on many threads at once, the library's first use among them: each thread draws the bits
// that one alone draws. scripts/test_threads.sh runs it under ThreadSanitizer.
#include <algorithm>
#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "tests/attack/variants.h"
#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/engine/state_fixture.h"

namespace dcloth::testing {
namespace {

constexpr size_t kThreads = 8, kInstances = 4;  // of each thread, of two models in turn
constexpr int kFrames = 600;

struct Played {
  std::vector<float> drawn;
  int wrong = 0;
};

// Instances at rates and offsets of their own: pipelined ticks, resets, levels, saved states that go on in another
// instance. `opened` are shared; the thread opens their bytes once more for itself.
Played Play(const std::vector<const OpenedModel*>& opened, const std::vector<const Numbers*>& numbers, size_t thread) {
  Played played;
  std::vector<std::unique_ptr<OpenedModel>> own;
  for (const OpenedModel* model : opened) own.push_back(std::make_unique<OpenedModel>(model->bytes()));
  std::vector<std::unique_ptr<OwnedCloth>> cloths;
  for (size_t i = 0; i < kInstances; ++i) {
    const size_t model = i % opened.size();
    cloths.push_back(std::make_unique<OwnedCloth>(i < opened.size() ? *opened[model] : *own[model]));
  }
  constexpr uint32_t kLevels[] = {DCLOTH_STAGES_MESH, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_STATIC};
  for (int frame = 0; frame < kFrames; ++frame) {
    for (size_t i = 0; i < kInstances; ++i) {
      OwnedCloth& cloth = *cloths[i];
      const float seconds = 1.0f / static_cast<float>(24 + 17 * (i + thread));
      const std::vector<float> pose = PoseAt(*numbers[i % opened.size()], frame * static_cast<double>(seconds));
      const uint32_t flags = i % 2 == 0 ? DCLOTH_FRAME_PIPELINED : DCLOTH_FRAME_FREEZE_IDLE;
      played.wrong += cloth.Update(pose, seconds, kLevels[frame / 20 % 3], flags) != DCLOTH_OK;
      if (frame % 30 == 29) played.wrong += dcloth_cloth_reset(cloth.get()) != DCLOTH_OK;
      played.drawn.insert(played.drawn.end(), cloth.positions().begin(), cloth.positions().end());
      played.drawn.insert(played.drawn.end(), cloth.normals().begin(), cloth.normals().end());
    }
    if (frame % 10 == 9) {
      for (size_t i = opened.size(); i < kInstances; ++i) {
        played.wrong += Restore(cloths[i].get(), Save(cloths[i - opened.size()].get())) != DCLOTH_OK;
      }
    }
  }
  return played;
}

TEST(Threads, DrawWhatOneDraws) {
  std::vector<ModelSpec> specs;
  for (const Variant& variant : Variants()) {
    if (variant.name == "F32_mesh" || variant.name == "I8_integer_layers") specs.push_back(variant.spec);
  }
  ASSERT_EQ(specs.size(), 2u);
  std::vector<TestModel> models;
  for (const ModelSpec& spec : specs) models.push_back(BuildModel(spec));
  std::vector<std::unique_ptr<OpenedModel>> owned;
  std::vector<const OpenedModel*> opened;
  std::vector<const Numbers*> numbers;
  for (const TestModel& model : models) {
    owned.push_back(std::make_unique<OpenedModel>(model));
    ASSERT_EQ(owned.back()->status(), DCLOTH_OK) << owned.back()->error().text;
    opened.push_back(owned.back().get());
    numbers.push_back(&model.numbers);
  }

  std::vector<Played> played(kThreads);
  std::vector<std::thread> threads;
  std::atomic<size_t> ready{0};
  for (size_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      ++ready;
      while (ready < kThreads) std::this_thread::yield();
      played[t] = Play(opened, numbers, t);
    });
  }
  for (std::thread& thread : threads) thread.join();

  for (size_t t = 0; t < kThreads; ++t) {
    EXPECT_EQ(played[t].wrong, 0) << "thread " << t;
    const Played alone = Play(opened, numbers, t);
    ASSERT_EQ(played[t].drawn.size(), alone.drawn.size());
    EXPECT_TRUE(std::equal(alone.drawn.begin(), alone.drawn.end(), played[t].drawn.begin())) << "thread " << t;
  }
}

}  // namespace
}  // namespace dcloth::testing
