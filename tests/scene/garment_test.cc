// The bundled garments at each level: error against the simulated truth and against the full network, cost of a tick,
// and the freeze of an idle character. Times depend on what else the machine does: they are printed; errors are bound.
#include "tests/stability/garment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <vector>

#include "dcloth/dcloth.hpp"
#include "tests/stability/player.h"

namespace dcloth::stability {
namespace {

constexpr Precision kPrecision = Precision::kInt8;
constexpr float kTick = 1 / 30.0f;
constexpr double kClockRoundingMm = 1e-4;  // a float's step at arm's length

struct Level {
  const char* name;
  uint32_t stages, flags;
};
// By DCLOTH_LEVEL_*; the unused one has no name.
constexpr std::array<Level, DCLOTH_LEVEL_COUNT> kLevels = {{
    {"frozen", DCLOTH_STAGES_STATIC, DCLOTH_FRAME_HOLD},
    {"static", DCLOTH_STAGES_STATIC, 0},
    {"skeleton", DCLOTH_STAGES_SKELETON, 0},
    {nullptr, DCLOTH_STAGES_SKELETON, 0},
    {"mesh", DCLOTH_STAGES_MESH, 0},
}};

std::vector<float> Flat(const Pose& pose) {
  std::vector<float> matrices;
  for (const Matrix& joint : pose) {
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) matrices.push_back(static_cast<float>(joint(r, c)));
    }
  }
  return matrices;
}

// Of this thread alone: what others run on the machine shows through the caches only.
double ProcessorMicroseconds() {
#ifdef CLOCK_THREAD_CPUTIME_ID
  timespec now = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
#else
  return static_cast<double>(std::clock()) * (1e6 / CLOCKS_PER_SEC);
#endif
}

class Character {
 public:
  explicit Character(const converter::OpenModel& model)
      : memory_(dcloth_cloth_storage_size(model.model())),
        positions_(3 * size_t{model.info().vertex_count}),
        normals_(positions_.size()) {
    EXPECT_EQ(dcloth_cloth_create(model.model(), memory_.data(), memory_.size(), &cloth_, nullptr), DCLOTH_OK);
  }

  // Microseconds that it took.
  double Update(const std::vector<float>& matrices, float seconds, uint32_t stages, uint32_t flags) {
    const dcloth_pose pose = MakePose(matrices.data(), static_cast<uint32_t>(matrices.size() / 16));
    const dcloth_frame frame = {sizeof(frame), stages, seconds, flags, nullptr};
    const dcloth_output output =
        MakeOutput(positions_.data(), normals_.data(), static_cast<uint32_t>(positions_.size() / 3));
    const double start = ProcessorMicroseconds();
    EXPECT_EQ(dcloth_cloth_update(cloth_, &pose, &frame, &output, nullptr), DCLOTH_OK);
    return ProcessorMicroseconds() - start;
  }

  dcloth_cloth_info Describe() const {
    dcloth_cloth_info info = {};
    info.struct_size = sizeof(info);
    EXPECT_EQ(dcloth_cloth_describe(cloth_, &info), DCLOTH_OK);
    return info;
  }
  const std::vector<float>& positions() const { return positions_; }

 private:
  converter::AlignedBytes memory_;
  dcloth_cloth* cloth_ = nullptr;
  std::vector<float> positions_, normals_;
};

struct Distance {
  double mean = 0, largest = 0;  // mm
};

Distance DistanceMm(const float* a, const float* b, size_t floats) {
  Distance distance;
  for (size_t i = 0; i < floats; i += 3) {
    double square = 0;
    for (size_t c = 0; c < 3; ++c) square += std::pow(static_cast<double>(a[i + c]) - static_cast<double>(b[i + c]), 2);
    distance.mean += std::sqrt(square) * 3e3 / static_cast<double>(floats);
    distance.largest = std::max(distance.largest, 1e3 * std::sqrt(square));
  }
  return distance;
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

struct LevelFigures {
  double error_mm = 0;    // mean distance to the truth
  double to_mesh_mm = 0;  // and to the full network, played by dcloth_cloth_tick and dcloth_cloth_skin
  double tick_us = 0;     // median
};

// At 30 Hz, after a second to settle.
std::array<LevelFigures, DCLOTH_LEVEL_COUNT> Measure(const Garment& garment, double* draw_us) {
  std::array<LevelFigures, DCLOTH_LEVEL_COUNT> figures;
  std::array<std::vector<double>, DCLOTH_LEVEL_COUNT> times;
  std::vector<double> draws;
  size_t frames = 0;
  for (const Clip& clip : garment.clips) {
    Player full(garment, kPrecision);
    std::vector<std::unique_ptr<Character>> levels;
    for (size_t level = 0; level < kLevels.size(); ++level)
      levels.push_back(std::make_unique<Character>(garment.model(kPrecision)));
    for (size_t frame = 0; frame < clip.motion.size(); ++frame) {
      const std::vector<float> pose = Flat(clip.motion[frame]);
      for (size_t level = 0; level < kLevels.size(); ++level) {
        const double us = levels[level]->Update(pose, kTick, kLevels[level].stages, kLevels[level].flags);
        draws.push_back(levels[level]->Update(pose, 0, kLevels[level].stages, kLevels[level].flags));
        times[level].push_back(us - draws.back());
      }
      const std::vector<float>& mesh = full.Step(clip.motion[frame]);
      if (frame < 30) continue;
      ++frames;
      const size_t floats = 3 * garment.vertex_count();
      for (size_t level = 0; level < kLevels.size(); ++level) {
        const std::vector<float>& drawn = levels[level]->positions();
        figures[level].error_mm += DistanceMm(drawn.data(), clip.truth.data() + frame * floats, floats).mean;
        figures[level].to_mesh_mm += DistanceMm(drawn.data(), mesh.data(), floats).mean;
      }
    }
  }
  EXPECT_GT(frames, 100u);
  *draw_us = Median(draws);
  for (size_t level = 0; level < kLevels.size(); ++level) {
    figures[level].error_mm /= static_cast<double>(frames);
    figures[level].to_mesh_mm /= static_cast<double>(frames);
    figures[level].tick_us = std::max(0.0, Median(times[level]));
  }
  return figures;
}

class GarmentSceneTest : public testing::TestWithParam<std::string> {
 protected:
  const Garment& garment() const { return LoadGarment(GetParam()); }
};

struct Rest {
  double frozen_after = -1;             // seconds, below 0 for never
  double error_mm = 0;                  // frozen, mean distance to the truth of that frame
  double at_rest_mm = 0, awake_mm = 0;  // to the garment that never froze, of the vertex farthest off
};

// A character stands at frame `stop` of a clip for eight seconds, then walks back.
Rest StandAt(const Garment& garment, const Clip& clip, size_t stop) {
  Rest rest;
  Character idle(garment.model(kPrecision)), twin(garment.model(kPrecision));
  const size_t back = std::min(stop, size_t{75}), still = stop + 240;
  for (size_t tick = stop - back; tick < still + back; ++tick) {
    const size_t at = tick < still ? std::min(tick, stop) : stop - (tick - still);
    const std::vector<float> pose = Flat(clip.motion[at]);
    idle.Update(pose, kTick, DCLOTH_STAGES_MESH, DCLOTH_FRAME_FREEZE_IDLE);
    twin.Update(pose, kTick, DCLOTH_STAGES_MESH, 0);
    const double off = DistanceMm(idle.positions().data(), twin.positions().data(), idle.positions().size()).largest;
    if (idle.Describe().frozen != 0) {
      const size_t floats = idle.positions().size();
      if (rest.frozen_after < 0) {
        rest.frozen_after = static_cast<double>(tick - stop) / 30;
        rest.error_mm = DistanceMm(idle.positions().data(), clip.truth.data() + stop * floats, floats).mean;
      }
      rest.at_rest_mm = std::max(rest.at_rest_mm, off);
    } else {
      rest.awake_mm = std::max(rest.awake_mm, off);
    }
  }
  return rest;
}

// For scripts/levels.sh: a line of JSON for each garment, into the file that DCLOTH_LEVELS_JSON names.
void RecordLevels(const std::string& garment, const std::array<LevelFigures, DCLOTH_LEVEL_COUNT>& figures,
                  double draw_us, double idle_mm) {
  const char* path = std::getenv("DCLOTH_LEVELS_JSON");
  if (path == nullptr) return;
  std::FILE* file = std::fopen(path, "a");
  ASSERT_NE(file, nullptr) << path << ": cannot be written";
  std::fprintf(file, "{\"garment\": \"%s\", \"version\": \"%s\", \"isa\": \"%s\", \"draw_us\": %.1f, \"idle_mm\": %.3f",
               garment.c_str(), dcloth_version(), dcloth_isa_name(), draw_us, idle_mm);
  std::fprintf(file, ", \"levels\": [");
  for (size_t level = 0; level < kLevels.size(); ++level) {
    if (kLevels[level].name == nullptr) continue;
    std::fprintf(file, "%s{\"name\": \"%s\", \"error_mm\": %.3f, \"to_mesh_mm\": %.3f, \"tick_us\": %.1f}",
                 level == 0 ? "" : ", ", kLevels[level].name, figures[level].error_mm, figures[level].to_mesh_mm,
                 figures[level].tick_us);
  }
  std::fprintf(file, "]}\n");
  EXPECT_EQ(std::fclose(file), 0);
}

// Each level is nearer to the full network than the one below; whether that is nearer to the truth is the garment's
// affair. At the full level an update at 30 Hz draws what a tick and a
// skinning of their own draw, but for the rounding of the clock.
TEST_P(GarmentSceneTest, LevelsByErrorAndCost) {
  double draw_us = 0;
  const auto figures = Measure(garment(), &draw_us);
  std::printf("drawing %.0f us\n", draw_us);
  for (size_t level = 0; level < kLevels.size(); ++level) {
    if (kLevels[level].name == nullptr) continue;
    std::printf("%-14s: error %.2f mm, %.3f mm from mesh, tick %.0f us\n", kLevels[level].name, figures[level].error_mm,
                figures[level].to_mesh_mm, figures[level].tick_us);
  }
  double idle_mm = 0;
  for (const Clip& clip : garment().clips)
    idle_mm += StandAt(garment(), clip, clip.motion.size() - 1).error_mm / static_cast<double>(garment().clips.size());
  std::printf("idle          : error %.2f mm where the clips end\n", idle_mm);
  RecordLevels(GetParam(), figures, draw_us, idle_mm);
  // A static stage that is bolted to the hips looks the same at any rate.
  EXPECT_LE(figures[DCLOTH_LEVEL_STATIC].to_mesh_mm, figures[DCLOTH_LEVEL_FROZEN].to_mesh_mm);
  EXPECT_LT(figures[DCLOTH_LEVEL_SKELETON].to_mesh_mm, figures[DCLOTH_LEVEL_STATIC].to_mesh_mm);
  EXPECT_LT(figures[DCLOTH_LEVEL_MESH].to_mesh_mm, kClockRoundingMm);
}

// At the end of a clip, where a character stands, the garment freezes. In the middle of a step it may creep on for long
// and stay awake. Wherever it freezes, it stays within a millimetre of the one that does not, then and after.
TEST_P(GarmentSceneTest, IdleStaysNear) {
  for (const Clip& clip : garment().clips) {
    for (size_t quarter = 1; quarter <= 4; ++quarter) {
      const size_t stop = clip.motion.size() * quarter / 4 - (quarter == 4 ? 1 : 0);
      const Rest rest = StandAt(garment(), clip, stop);
      std::printf("%s, stands at frame %zu: frozen after %.2f s, at rest up to %.3f mm off, awake %.3f mm\n",
                  clip.name.c_str(), stop, rest.frozen_after, rest.at_rest_mm, rest.awake_mm);
      EXPECT_LE(rest.at_rest_mm, 1);
      EXPECT_LE(rest.awake_mm, 1);
      if (quarter < 4) continue;
      EXPECT_GE(rest.frozen_after, 0) << "never frozen";
      EXPECT_LE(rest.frozen_after, 5);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Bundled, GarmentSceneTest, testing::ValuesIn(GarmentNames()),
                         [](const auto& garment) { return garment.param; });

}  // namespace
}  // namespace dcloth::stability
