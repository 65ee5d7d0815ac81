// A pipelined tick on the bundled garments: how even its slices are, by counted work rather than by the clock.
//
// What a slice runs is read off the cloth's own position in the tick; what that is in operations and bytes is counted
// by converter/model_work.h, which knows nothing of the engine's cost model. A part takes the longer of operations over
// 100 GFLOP/s (int8 twice as many) and bytes over 45 GB/s: what a core of a desktop does, of which only the ratio
// matters.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "converter/model_work.h"
#include "dcloth/dcloth.hpp"
#include "engine/src/cloth.h"
#include "engine/src/network/schedule.h"
#include "tests/stability/stability_case.h"

namespace dcloth::stability {
namespace {

using converter::WorkPart;
using engine::TickPart;

constexpr double kFlopsPerSecond = 100e9, kBytesPerSecond = 45e9;

struct Work {
  double flops = 0, bytes = 0, seconds = 0;
  void Add(const Work& other, double share) {
    flops += share * other.flops;
    bytes += share * other.bytes;
    seconds += share * other.seconds;
  }
};

Work Counted(const converter::PartWork& part) {
  const auto flops = static_cast<double>(part.flops), bytes = static_cast<double>(part.bytes());
  return {flops, bytes, std::max(flops / (kFlopsPerSecond * (part.int8 ? 2 : 1)), bytes / kBytesPerSecond)};
}

// A tick as a row of items, each with the work of one.
std::vector<Work> ItemsOf(const converter::OpenModel& model, const engine::Cloth& cloth) {
  const converter::ModelWork counted = converter::CountWork(model.bytes());
  std::vector<Work> items;
  for (size_t p = 0; p < format::kTickPartCount; ++p) {
    const auto part = static_cast<TickPart>(p);
    const uint64_t count = engine::TickItems(*cloth.model, {DCLOTH_STAGES_MESH}, part);
    const Work whole = Counted(counted[p]);
    const size_t layers = part == TickPart::kMeshLayers ? cloth.model->mesh_stage.layer_count : 1;
    const auto width = static_cast<double>(cloth.model->mesh_stage.feature_width);
    // A layer's multiply-adds by what it reads of a vertex (3 numbers, later F), as model_work.cc counts them.
    const auto weight = [&](size_t layer) {
      return layers == 1 ? 1.0 : 3 * (layer == 0 ? 3 : width) * width + 4 * width * width + 40 * width;
    };
    double weights = 0;
    for (size_t layer = 0; layer < layers; ++layer) weights += weight(layer);
    for (uint64_t i = 0; i < count; ++i) {
      Work item;
      const size_t layer = static_cast<size_t>(i * layers / count);
      item.Add(whole, weight(layer) / weights * static_cast<double>(layers) / static_cast<double>(count));
      items.push_back(item);
    }
  }
  return items;
}

size_t PositionOf(const engine::Cloth& cloth, size_t items) {
  size_t position = 0;
  for (size_t p = 0; p < static_cast<size_t>(cloth.work.part); ++p)
    position += static_cast<size_t>(engine::TickItems(*cloth.model, {DCLOTH_STAGES_MESH}, static_cast<TickPart>(p)));
  return cloth.work.part == TickPart::kDone ? items : position + cloth.work.items_done;
}

struct Spread {
  double p50 = 0, p99 = 0, largest = 0;
};

Spread SpreadOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return {values[values.size() / 2], values[values.size() * 99 / 100], values.back()};
}

// Work of each frame, drawing too. The first one, which has a whole tick in any mode, is not counted.
std::vector<Work> Frames(const converter::OpenModel& model, const Motion& motion, double rate, uint32_t flags) {
  converter::AlignedBytes memory(dcloth_cloth_storage_size(model.model()));
  dcloth_cloth* cloth = nullptr;
  EXPECT_EQ(dcloth_cloth_create(model.model(), memory.data(), memory.size(), &cloth, nullptr), DCLOTH_OK);
  const auto& inside = *reinterpret_cast<const engine::Cloth*>(cloth);
  const std::vector<Work> items = ItemsOf(model, inside);
  const converter::ModelWork counted = converter::CountWork(model.bytes());
  Work drawing = Counted(counted[static_cast<size_t>(WorkPart::kSkinning)]);
  drawing.Add(Counted(counted[static_cast<size_t>(WorkPart::kNormals)]), 1);
  std::vector<Work> frames;
  for (size_t frame = 0; frame < 600; ++frame) {
    const auto at = static_cast<size_t>(static_cast<double>(frame) / rate * 30);
    std::vector<float> matrices;
    for (const Matrix& joint : motion[at % motion.size()]) {
      for (int i = 0; i < 16; ++i) matrices.push_back(static_cast<float>(joint(i / 4, i % 4)));
    }
    const size_t before = PositionOf(inside, items.size());
    const dcloth_pose pose = MakePose(matrices.data(), static_cast<uint32_t>(matrices.size() / 16));
    const dcloth_frame update = {sizeof(update), DCLOTH_STAGES_MESH, static_cast<float>(1 / rate), flags, nullptr};
    EXPECT_EQ(dcloth_cloth_update(cloth, &pose, &update, nullptr, nullptr), DCLOTH_OK);
    dcloth_cloth_info info = {};
    info.struct_size = sizeof(info);
    EXPECT_EQ(dcloth_cloth_describe(cloth, &info), DCLOTH_OK);
    const size_t after = PositionOf(inside, items.size());
    if (frame == 0) continue;
    Work work = drawing;
    // Where it stands behind where it stood, or did a whole tick, the tick in work was completed and the next one
    // begun.
    const bool begun = after < before || (after == before && info.tick_share > 0);
    for (size_t i = before; i < (begun ? items.size() : after); ++i) work.Add(items[i], 1);
    for (size_t i = 0; begun && i < after; ++i) work.Add(items[i], 1);
    frames.push_back(work);
  }
  return frames;
}

Spread SecondsOf(const std::vector<Work>& frames) {
  std::vector<double> seconds;
  for (const Work& work : frames) seconds.push_back(work.seconds);
  return SpreadOf(seconds);
}

using SlicesTest = StabilityCase;

TEST_P(SlicesTest, NoFramePaysForAllOfATick) {
  const converter::OpenModel& model = garment().model(precision());
  ASSERT_EQ(model.info().stages, DCLOTH_STAGES_MESH);
  const Motion& motion = garment().clips.front().motion;
  double largest = 0;
  for (const double rate : {60.0, 59.94, 90.0, 120.0, 144.0}) {
    const std::vector<Work> frames = Frames(model, motion, rate, DCLOTH_FRAME_PIPELINED);
    const Spread spread = SecondsOf(frames);
    Work total;
    for (const Work& work : frames) total.Add(work, 1.0 / static_cast<double>(frames.size()));
    std::printf("%s, %g Hz: p50 %.0f us counted, p99 / p50 %.3f, largest / p50 %.3f; %.1f MFLOP, %.2f MB a frame\n",
                model.info().precision, rate, spread.p50 * 1e6, spread.p99 / spread.p50, spread.largest / spread.p50,
                total.flops * 1e-6, total.bytes * 1e-6);
    EXPECT_LE(spread.p99, 1.5 * spread.p50) << rate;
    EXPECT_LE(spread.largest, 1.5 * spread.p50) << rate;
    largest = std::max(largest, spread.largest);
  }
  const Spread whole = SecondsOf(Frames(model, motion, 60, 0));
  EXPECT_GT(whole.largest, 1.5 * largest) << "a whole tick in a frame is no more than a slice";
}

DCLOTH_STABILITY_SUITE(SlicesTest);

}  // namespace
}  // namespace dcloth::stability
