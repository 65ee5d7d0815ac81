// The bundled garments at each level: error against the simulated truth and against the full network, cost of a tick,
// the freeze of an idle character, and fifty characters in a budget. Times depend on what else the machine does: they
// are printed, and planned from only where the machine is left alone (scripts/levels.sh); errors and plans are bound.
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
constexpr float kFrame = 1 / 60.0f, kTick = 1 / 30.0f;
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
        normals_(positions_.size()),
        info_(model.info()) {
    EXPECT_EQ(dcloth_cloth_create(model.model(), memory_.data(), memory_.size(), &cloth_, nullptr), DCLOTH_OK);
  }

  // Microseconds that it took. `draw` is a DCLOTH_DRAW_*.
  double Update(const std::vector<float>& matrices, float seconds, uint32_t stages, uint32_t flags,
                uint32_t draw = DCLOTH_DRAW_FULL) {
    const dcloth_pose pose = MakePose(matrices.data(), static_cast<uint32_t>(matrices.size() / 16));
    const dcloth_frame frame = {sizeof(frame), stages, seconds, flags, nullptr};
    const bool coarse = draw == DCLOTH_DRAW_COARSE;
    dcloth_output output = MakeOutput(positions_.data(), draw == DCLOTH_DRAW_POSITIONS ? nullptr : normals_.data(),
                                      coarse ? info_.coarse_vertex_count : info_.vertex_count);
    if (coarse) output.flags = DCLOTH_OUTPUT_COARSE;
    const double start = ProcessorMicroseconds();
    EXPECT_EQ(dcloth_cloth_update(cloth_, &pose, &frame, draw == DCLOTH_DRAW_NONE ? nullptr : &output, nullptr),
              DCLOTH_OK);
    return ProcessorMicroseconds() - start;
  }

  dcloth_cloth_info Describe() const {
    dcloth_cloth_info info = {};
    info.struct_size = sizeof(info);
    EXPECT_EQ(dcloth_cloth_describe(cloth_, &info), DCLOTH_OK);
    return info;
  }
  const std::vector<float>& positions() const { return positions_; }
  const dcloth_cloth* get() const { return cloth_; }

 private:
  converter::AlignedBytes memory_;
  dcloth_cloth* cloth_ = nullptr;
  std::vector<float> positions_, normals_;
  dcloth_model_info info_;
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

// Median microseconds of a frame without a tick, by DCLOTH_DRAW_*. Characters take turns, so that the caches hold what
// they hold in a crowd.
std::array<float, DCLOTH_DRAW_COUNT> MeasureDrawing(const Garment& garment,
                                                    std::vector<std::unique_ptr<Character>>* characters) {
  const std::vector<float> pose = Flat(garment.clips[0].motion[0]);
  std::array<float, DCLOTH_DRAW_COUNT> costs = {};
  for (uint32_t draw = 0; draw < DCLOTH_DRAW_COUNT; ++draw) {
    std::vector<double> times;
    for (int round = 0; round < 4; ++round) {
      for (auto& character : *characters)
        times.push_back(character->Update(pose, 0, DCLOTH_STAGES_MESH, DCLOTH_FRAME_HOLD, draw));
    }
    costs[draw] = static_cast<float>(Median(times));
  }
  return costs;
}

// Of 3,000 frames of the same work, as long as `budget`: how many took 1.2 times their median. No plan can know of what
// else the machine does.
size_t DisturbedFrames(const Garment& garment, float budget, float draw_us,
                       std::vector<std::unique_ptr<Character>>* characters) {
  constexpr double kDisturbed = 1.2;
  const std::vector<float> pose = Flat(garment.clips[0].motion[0]);
  const auto updates = static_cast<size_t>(budget / draw_us) + 1;
  std::vector<double> times;
  for (int frame = 0; frame < 3000; ++frame) {
    double sum = 0;
    for (size_t i = 0; i < updates; ++i) {
      sum += (*characters)[i % characters->size()]->Update(pose, 0, DCLOTH_STAGES_MESH, DCLOTH_FRAME_HOLD,
                                                           DCLOTH_DRAW_FULL);
    }
    times.push_back(sum);
  }
  const double most = kDisturbed * Median(times);
  return static_cast<size_t>(std::count_if(times.begin(), times.end(), [&](double us) { return us > most; }));
}

struct Crowd {
  uint32_t characters = 0;
  size_t disturbed = 0;  // DisturbedFrames, on a machine left alone
  float budget_us = 0;
  std::array<float, DCLOTH_DRAW_COUNT> drawing_us = {};
  std::vector<double> shares;                          // of the budget, by frame, sorted
  std::array<double, DCLOTH_LEVEL_COUNT> levels = {};  // characters at each, in the mean
  std::array<double, DCLOTH_DRAW_COUNT> draws = {};    // characters drawn so, in the mean
  double error_mm = 0;                                 // of the vertices drawn, mean distance to the truth

  double At(double share) const { return shares[static_cast<size_t>(share * static_cast<double>(shares.size() - 1))]; }
  size_t Over() const {
    return static_cast<size_t>(shares.end() - std::upper_bound(shares.begin(), shares.end(), 1.05));
  }
};

// As RecordLevels does.
void RecordCrowd(const std::string& garment, const Crowd& crowd) {
  const char* path = std::getenv("DCLOTH_LEVELS_JSON");
  if (path == nullptr) return;
  std::FILE* file = std::fopen(path, "a");
  ASSERT_NE(file, nullptr) << path << ": cannot be written";
  const auto list = [file](const char* name, const auto& values) {
    std::fprintf(file, ", \"%s\": [", name);
    for (size_t i = 0; i < values.size(); ++i)
      std::fprintf(file, "%s%.1f", i == 0 ? "" : ", ", static_cast<double>(values[i]));
    std::fprintf(file, "]");
  };
  std::fprintf(file, "{\"crowd_of\": \"%s\", \"characters\": %u, \"budget_us\": %.0f, \"frames\": %zu", garment.c_str(),
               crowd.characters, static_cast<double>(crowd.budget_us), crowd.shares.size());
  std::fprintf(
      file, ", \"p50\": %.3f, \"p99\": %.3f, \"largest\": %.3f, \"over\": %zu, \"error_mm\": %.2f, \"disturbed\": %zu",
      crowd.At(0.5), crowd.At(0.99), crowd.shares.back(), crowd.Over(), crowd.error_mm, crowd.disturbed);
  list("levels", crowd.levels);
  list("draws", crowd.draws);
  list("drawing_us", crowd.drawing_us);
  std::fprintf(file, "}\n");
  EXPECT_EQ(std::fclose(file), 0);
}

// What a crowd is planned from where the machine is not left alone: the robe's medians on a quiet desktop core, rounded
// up, in microseconds. Costs measured beside other work may leave a budget that moves nobody.
constexpr std::array<float, DCLOTH_DRAW_COUNT> kStatedDrawing = [] {
  std::array<float, DCLOTH_DRAW_COUNT> costs = {};
  costs[DCLOTH_DRAW_NONE] = 2;
  costs[DCLOTH_DRAW_COARSE] = 75;
  costs[DCLOTH_DRAW_POSITIONS] = 60;
  costs[DCLOTH_DRAW_FULL] = 130;
  return costs;
}();
constexpr std::array<float, DCLOTH_LEVEL_COUNT> kStatedTick = {15, 25, 190, 0, 1200};

// `count` characters on the clips, each at another place of it, in `budget` microseconds a frame at 60 Hz. `alone`: the
// scene plans from costs measured here and is told what its frames took; else from the stated ones, and that frames
// took what was planned.
Crowd RunCrowd(const Garment& garment, uint32_t count, float budget,
               const std::array<LevelFigures, DCLOTH_LEVEL_COUNT>& figures, int frames, bool alone) {
  converter::AlignedBytes memory(dcloth_scene_storage_size(count));
  Scene scene;
  EXPECT_EQ(scene.Create(count, memory.data(), memory.size()), Status::kOk);
  std::vector<std::unique_ptr<Character>> characters;
  for (uint32_t i = 0; i < count; ++i) characters.push_back(std::make_unique<Character>(garment.model(kPrecision)));
  auto drawing = MeasureDrawing(garment, &characters);
  std::printf("drawing: nothing %.1f us, coarse %.1f, positions %.1f, everything %.1f\n",
              static_cast<double>(drawing[0]), static_cast<double>(drawing[1]), static_cast<double>(drawing[2]),
              static_cast<double>(drawing[3]));
  if (!alone) drawing = kStatedDrawing;
  for (uint32_t i = 0; i < count; ++i) {
    dcloth_scene_character character = {};
    character.struct_size = sizeof(character);
    character.top_level = DCLOTH_LEVEL_MESH;
    character.cloth = characters[i]->get();
    character.importance = 1.0f / static_cast<float>((1 + i) * (1 + i));  // the share of the screen at a distance
    character.draw_microseconds = drawing[DCLOTH_DRAW_FULL];
    character.positions_microseconds = drawing[DCLOTH_DRAW_POSITIONS];
    character.coarse_microseconds = drawing[DCLOTH_DRAW_COARSE];
    character.undrawn_microseconds = drawing[DCLOTH_DRAW_NONE];
    character.most_undrawn = 3;
    for (size_t level = 0; level < kLevels.size(); ++level) {
      character.tick_microseconds[level] = alone ? static_cast<float>(figures[level].tick_us) : kStatedTick[level];
      character.error_mm[level] = static_cast<float>(figures[level].error_mm);
    }
    EXPECT_EQ(scene.Set(i, character), Status::kOk);
  }
  constexpr int kSampled = 20;  // frames from one measured error to the next
  const dcloth_model_info info = garment.model(kPrecision).info();
  Crowd crowd;
  if (alone) crowd.disturbed = DisturbedFrames(garment, budget, drawing[DCLOTH_DRAW_FULL], &characters);
  crowd.characters = count;
  crowd.budget_us = budget;
  crowd.drawing_us = drawing;
  double drawn = 0;
  float spent = 0;
  for (int frame = 0; frame < frames; ++frame) {
    float planned = 0;
    const double start = ProcessorMicroseconds();
    EXPECT_EQ(scene.Plan(kFrame, budget, spent, &planned), Status::kOk);
    double sum = ProcessorMicroseconds() - start;
    if (!alone) {
      EXPECT_LE(planned, budget * 1.0001f) << "frame " << frame;
    }
    for (uint32_t i = 0; i < count; ++i) {
      const Clip& clip = garment.clips[i % garment.clips.size()];
      const dcloth_scene_choice choice = scene.Get(i);
      const size_t at = (static_cast<size_t>(frame / 2) + 3 * i) % clip.motion.size();
      sum += characters[i]->Update(Flat(clip.motion[at]), kFrame, choice.stages, choice.flags, choice.draw);
      crowd.levels[choice.level] += 1.0 / frames;
      crowd.draws[choice.draw] += 1.0 / frames;
      if (frame < 60 || frame % kSampled != 0 || choice.draw == DCLOTH_DRAW_NONE) continue;
      const float* truth = clip.truth.data() + at * 3 * garment.vertex_count();
      std::vector<float> seen(truth, truth + 3 * garment.vertex_count());
      if (choice.draw == DCLOTH_DRAW_COARSE) {
        for (size_t v = 0; v < info.coarse_vertex_count; ++v)
          std::copy_n(truth + size_t{3} * info.coarse_vertices[v], 3, &seen[3 * v]);
        seen.resize(size_t{3} * info.coarse_vertex_count);
      }
      crowd.error_mm += DistanceMm(characters[i]->positions().data(), seen.data(), seen.size()).mean;
      ++drawn;
    }
    spent = alone ? static_cast<float>(sum) : planned;
    crowd.shares.push_back(sum / static_cast<double>(budget));
  }
  crowd.error_mm /= drawn;
  std::sort(crowd.shares.begin(), crowd.shares.end());
  return crowd;
}

// Crowds for which drawing alone would take more than the budget. Where frames take what was planned, no plan exceeds
// it and a tenth of the crowd moves; on a machine left alone (scripts/levels.sh) what is measured is over by 5 % in one
// frame of a thousand at most, if the machine itself holds the same work in all others.
TEST_P(GarmentSceneTest, CrowdsKeepTheirBudget) {
  constexpr size_t kMostOver = 3;  // of 3,000
  const bool alone = std::getenv("DCLOTH_LEVELS_JSON") != nullptr;
  double draw_us = 0;
  const auto figures = Measure(garment(), &draw_us);
  struct Case {
    uint32_t characters;
    float budget;
  };
  for (const Case& c : {Case{50, 4000}, Case{50, 2000}, Case{20, 2000}}) {
    const int frames = alone ? 3000 : 300;
    const Crowd crowd = RunCrowd(garment(), c.characters, c.budget, figures, frames, alone);
    RecordCrowd(GetParam(), crowd);
    std::printf(
        "%u characters in %.0f us: frames took %.3f of it at p50, %.3f at p99, %.3f at p99.9, %.3f at most; "
        "over by 5%% in %zu of %d; error %.2f mm\n",
        c.characters, static_cast<double>(c.budget), crowd.At(0.5), crowd.At(0.99), crowd.At(0.999),
        crowd.shares.back(), crowd.Over(), frames, crowd.error_mm);
    std::printf("  in a mean frame: %.1f frozen, %.1f static, %.1f skeleton, %.1f mesh; ", crowd.levels[0],
                crowd.levels[1], crowd.levels[2], crowd.levels[DCLOTH_LEVEL_MESH]);
    std::printf("%.1f not drawn, %.1f coarse, %.1f without normals, %.1f drawn fully\n", crowd.draws[0], crowd.draws[1],
                crowd.draws[2], crowd.draws[3]);
    const double moving = crowd.levels[DCLOTH_LEVEL_SKELETON] + crowd.levels[DCLOTH_LEVEL_MESH];
    EXPECT_GT(moving, 0.1 * c.characters) << "the crowd stands still";
    if (alone) {
      std::printf("  of 3000 frames of the same work %zu took 1.2 times their median\n", crowd.disturbed);
      if (crowd.disturbed <= kMostOver) {
        EXPECT_LE(crowd.Over(), kMostOver);
      } else {
        std::printf("  not judged: the machine does not hold even these\n");
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Bundled, GarmentSceneTest, testing::ValuesIn(GarmentNames()),
                         [](const auto& garment) { return garment.param; });

}  // namespace
}  // namespace dcloth::stability
