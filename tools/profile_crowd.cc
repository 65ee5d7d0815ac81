#include "tools/profile_crowd.h"

#include <Eigen/LU>
#include <algorithm>
#include <barrier>
#include <cmath>
#include <cstdio>
#include <exception>
#include <memory>
#include <thread>
#include <utility>

#include "converter/error.h"
#include "tools/machine.h"
#include "tools/pose_track.h"

namespace dcloth::tools {
namespace {

using converter::OpenModel;
using converter::Sequence;

constexpr double kSettleSeconds = 1;  // from a start or a jump to what is counted, or half of a short sequence
constexpr uint32_t kMostUndrawn = 3;  // frames in a row
constexpr double kLate = 1.05;        // of the budget: what is longer shows

struct LevelNames {
  const char* name;  // null: unused
  uint32_t stages, flags;
};
constexpr std::array<LevelNames, DCLOTH_LEVEL_COUNT> kLevels = {{
    {"frozen", DCLOTH_STAGES_STATIC, DCLOTH_FRAME_HOLD},
    {"static", DCLOTH_STAGES_STATIC, 0},
    {"skeleton", DCLOTH_STAGES_SKELETON, 0},
    {nullptr, 0, 0},
    {"mesh", DCLOTH_STAGES_MESH, 0},
}};
constexpr std::array<const char*, DCLOTH_DRAW_COUNT> kDraws = {"nothing", "coarse", "positions", "full", "plain"};

uint32_t TopLevel(uint32_t stages) {
  uint32_t top = DCLOTH_LEVEL_STATIC;
  for (uint32_t level = 0; level < DCLOTH_LEVEL_COUNT; ++level) {
    if (kLevels[level].name != nullptr && kLevels[level].stages == stages) top = level;
  }
  return top;
}

// What DCLOTH_DRAW_* means for a garment that is drawn fully as `full`. A coarse one is not kept outside of the body.
Drawn DrawnAs(uint32_t draw, Drawn full) {
  if (draw == DCLOTH_DRAW_COARSE) full.flags = DCLOTH_OUTPUT_COARSE;
  if (draw == DCLOTH_DRAW_POSITIONS) full.normals = full.tangents = false;
  if (draw == DCLOTH_DRAW_PLAIN) full.flags &= ~uint32_t{DCLOTH_OUTPUT_OUTSIDE_BODY};
  return full;
}

double MeanDistanceMm(std::span<const float> a, std::span<const float> b, const uint16_t* vertices) {
  const size_t count = a.size() / 3;
  double sum = 0;
  for (size_t i = 0; i < count; ++i) {
    double squared = 0;
    for (size_t c = 0; c < 3; ++c) {
      const size_t at = 3 * (vertices != nullptr ? vertices[i] : i) + c;
      squared += std::pow(static_cast<double>(a[3 * i + c]) - static_cast<double>(b[at]), 2);
    }
    sum += std::sqrt(squared);
  }
  return 1000 * sum / static_cast<double>(count);
}

// The joint that all others hang on: the hips.
size_t TopJoint(const OpenModel& model) {
  uint32_t joint = 0;
  while (joint + 1 < model.info().joint_count && dcloth_model_joint_parent(model.model(), joint) != DCLOTH_JOINT_TOP)
    ++joint;
  return dcloth_model_joint_parent(model.model(), joint) == DCLOTH_JOINT_TOP ? joint : 0;
}

double Median(std::vector<double> values) { return PercentilesOf(values).p50; }

// A cloth of its own.
class Instance {
 public:
  Instance(const OpenModel& model, const CrowdOptions& options)
      : memory_(dcloth_cloth_storage_size(model.model())),
        full_(options.drawn),
        hips_joint_(TopJoint(model)),
        info_(model.info()),
        player_(model, options.stages, options.source, options.drawn, Create(model)) {}

  const dcloth_cloth* get() const { return cloth_; }

  // Milliseconds of an update. `draw` is a DCLOTH_DRAW_*.
  double Update(std::span<const float> pose, double seconds, uint32_t stages, uint32_t flags, uint32_t draw) {
    if (draw != DCLOTH_DRAW_NONE) drawn_ = draw;  // else the vertices of the last drawing stay
    player_.Ask(stages, DrawnAs(drawn_, full_));
    const uint64_t start = NowNanoseconds();
    player_.Update(pose, static_cast<float>(seconds), flags, draw != DCLOTH_DRAW_NONE);
    const uint64_t end = NowNanoseconds();
    hips_ = Eigen::Map<const Matrix>(&pose[16 * hips_joint_]).cast<double>();
    if (draw != DCLOTH_DRAW_NONE) drawn_hips_ = hips_;
    return static_cast<double>(end - start) * 1e-6;
  }

  // Of what is seen after the last update: an older drawing has moved with the hips since.
  double DistanceMm(std::span<const float> truth) const {
    std::vector<float> seen = player_.ReadPositions();
    const bool coarse = drawn_ == DCLOTH_DRAW_COARSE;
    seen.resize(coarse ? 3 * size_t{info_.coarse_vertex_count} : truth.size());
    if (hips_ != drawn_hips_) {
      const Eigen::Matrix4d way = hips_ * drawn_hips_.inverse();
      Eigen::Map<Eigen::Matrix3Xf> at(seen.data(), 3, static_cast<Eigen::Index>(seen.size() / 3));
      at = ((way.topLeftCorner<3, 3>() * at.cast<double>()).colwise() + way.col(3).head<3>()).cast<float>();
    }
    return MeanDistanceMm(seen, truth, coarse ? info_.coarse_vertices : nullptr);
  }
  std::vector<float> positions() const { return player_.ReadPositions(); }

 private:
  dcloth_cloth* Create(const OpenModel& model) {
    if (dcloth_cloth_create(model.model(), memory_.data(), memory_.size(), &cloth_, nullptr) != DCLOTH_OK)
      throw converter::Error({.path = {},
                              .tensor = {},
                              .found = "a cloth that cannot be made",
                              .expected = std::to_string(memory_.size()) + " bytes for each character",
                              .mend = "pass fewer --characters"});
    return cloth_;
  }

  using Matrix = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;

  converter::AlignedBytes memory_;
  dcloth_cloth* cloth_ = nullptr;
  Drawn full_;
  uint32_t drawn_ = DCLOTH_DRAW_FULL;
  size_t hips_joint_;
  Eigen::Matrix4d hips_ = Eigen::Matrix4d::Identity(), drawn_hips_ = Eigen::Matrix4d::Identity();
  dcloth_model_info info_;
  Player player_;
};

class Crowd {
 public:
  Crowd(const OpenModel& model, const Sequence& sequence, const CrowdOptions& options, CrowdProfile* profile)
      : model_(model),
        sequence_(sequence),
        options_(options),
        poses_(sequence, model.joint_names()),
        settle_seconds_(std::min(kSettleSeconds, poses_.duration_seconds() / 2)),
        profile_(*profile) {}

  // One character at each level, a tick a frame.
  void MeasureLevels() {
    const double tick_seconds = 1 / TickRate(model_);
    CrowdOptions plain = options_;
    plain.drawn = {.flags = 0, .normals = false};
    std::array<std::unique_ptr<Instance>, DCLOTH_LEVEL_COUNT> levels;
    for (size_t level = 0; level < levels.size(); ++level) {
      if (kLevels[level].name != nullptr) levels[level] = std::make_unique<Instance>(model_, plain);
    }
    std::array<std::vector<double>, DCLOTH_LEVEL_COUNT> ticks;
    std::vector<float> pose(poses_.joint_count() * 16);
    const auto frames = static_cast<size_t>(std::floor(poses_.duration_seconds() / tick_seconds + 1e-6)) + 1;
    size_t counted = 0;
    for (size_t f = 0; f < frames; ++f) {
      const double seconds = static_cast<double>(f) * tick_seconds;
      poses_.At(seconds, pose);
      for (size_t level = levels.size(); level-- > 0;) {
        if (levels[level] == nullptr) continue;
        const uint32_t stages = kLevels[level].stages & options_.stages;
        ticks[level].push_back(
            levels[level]->Update(pose, f == 0 ? 0 : tick_seconds, stages, kLevels[level].flags, DCLOTH_DRAW_NONE));
        levels[level]->Update(pose, 0, stages, kLevels[level].flags, DCLOTH_DRAW_FULL);
      }
      const std::vector<float> best = levels[DCLOTH_LEVEL_MESH]->positions();
      const std::vector<float> truth = TruthAt(seconds);
      if (seconds < settle_seconds_ || (sequence_.has_truth() && truth.empty())) continue;
      ++counted;
      for (size_t level = 0; level < levels.size(); ++level) {
        if (levels[level] != nullptr)
          profile_.levels[level].error_mm += levels[level]->DistanceMm(truth.empty() ? best : truth);
      }
    }
    for (size_t level = 0; level < levels.size(); ++level) {
      profile_.levels[level].tick_ms = Median(ticks[level]);
      if (counted > 0) profile_.levels[level].error_mm /= static_cast<double>(counted);
    }
  }

  // One thread's part: characters `index`, `index` + workers, ...
  void Work(size_t index, std::barrier<>* together, double* error_mm, size_t* counted) {
    CrowdWorker& worker = profile_.workers[index];
    if (index < options_.cores.size()) PinThread(options_.cores[index]);
    std::vector<std::unique_ptr<Instance>> characters;
    std::vector<size_t> starts;  // frames of the sequence
    for (size_t i = index; i < options_.characters; i += options_.workers) {
      characters.push_back(std::make_unique<Instance>(model_, options_));
      starts.push_back(i * poses_.frame_count() / options_.characters);
    }
    worker.characters = characters.size();
    MeasureDrawing(&characters, &worker);
    converter::AlignedBytes memory(dcloth_scene_storage_size(static_cast<uint32_t>(characters.size())));
    dcloth_scene* scene = nullptr;
    Check(dcloth_scene_create(static_cast<uint32_t>(characters.size()), memory.data(), memory.size(), &scene, nullptr));
    for (size_t i = 0; i < characters.size(); ++i) {
      const dcloth_scene_character character = Describe(worker, *characters[i], index + i * options_.workers);
      Check(dcloth_scene_set(scene, static_cast<uint32_t>(i), &character));
    }
    std::vector<std::vector<float>> poses(characters.size(), std::vector<float>(poses_.joint_count() * 16));
    const size_t settle = static_cast<size_t>(kSettleSeconds * options_.fps), all = settle + options_.frames;
    std::vector<dcloth_scene_choice> choices(characters.size());
    double spent = 0;
    for (size_t frame = 0; frame < all; ++frame) {
      std::vector<bool> jumps(characters.size());
      for (size_t i = 0; i < characters.size(); ++i) {
        const double seconds = At(frame, starts[i]);
        jumps[i] = frame > 0 && seconds < At(frame - 1, starts[i]);
        poses_.At(seconds, poses[i]);
      }
      together->arrive_and_wait();
      const uint64_t worked = ThreadNanoseconds(), start = NowNanoseconds();
      const dcloth_scene_frame plan = {.struct_size = sizeof(plan),
                                       .seconds = static_cast<float>(1 / options_.fps),
                                       .budget_microseconds = Budget(),
                                       .spent_microseconds = static_cast<float>(spent * 1000)};
      Check(dcloth_scene_plan(scene, &plan, nullptr));
      const double planning = static_cast<double>(NowNanoseconds() - start) * 1e-6;
      spent = 0;
      for (size_t i = 0; i < characters.size(); ++i) {
        choices[i].struct_size = sizeof(choices[i]);
        Check(dcloth_scene_get(scene, static_cast<uint32_t>(i), &choices[i]));
        const uint32_t flags = choices[i].flags | (jumps[i] ? uint32_t{DCLOTH_FRAME_JUMPED} : 0U);
        spent += characters[i]->Update(poses[i], 1 / options_.fps, choices[i].stages, flags, choices[i].draw);
      }
      const uint64_t wall = NowNanoseconds() - start, work = ThreadNanoseconds() - worked;
      if (frame < settle) continue;
      (IsInterrupted(wall, work) ? worker.interrupted_ms : worker.frame_ms).push_back(planning + spent);
      for (size_t i = 0; i < characters.size(); ++i) {
        worker.levels[choices[i].level] += 1.0 / static_cast<double>(options_.frames);
        worker.draws[choices[i].draw] += 1.0 / static_cast<double>(options_.frames);
        worker.longest_wait_ms =
            std::max(worker.longest_wait_ms, 1000.0 * static_cast<double>(choices[i].stale_seconds));
        const double seconds = At(frame, starts[i]);
        const std::vector<float> truth = TruthAt(seconds);
        if (truth.empty() || seconds < settle_seconds_) continue;
        *error_mm += characters[i]->DistanceMm(truth);
        ++*counted;
      }
    }
  }

 private:
  static void Check(dcloth_status status) {
    if (status == DCLOTH_OK) return;
    throw converter::Error({.path = {},
                            .tensor = {},
                            .found = std::string("an error of the scene (") + dcloth_status_name(status) + ")",
                            .expected = "a crowd that a scene can plan",
                            .mend = "pass fewer --characters, or a budget below a second"});
  }

  // Where a character is in the sequence, which it repeats.
  double At(size_t frame, size_t start) const {
    const double length = poses_.duration_seconds() + 1 / options_.fps;
    return std::fmod(static_cast<double>(frame) / options_.fps + static_cast<double>(start) / poses_.fps(), length);
  }

  // Straight between frames, as poses are; empty where there is none.
  std::vector<float> TruthAt(double seconds) const {
    const double position = seconds * sequence_.fps + 1e-6, whole = std::floor(position);
    const float share = position - whole < 1e-5 ? 0 : static_cast<float>(position - whole);
    const auto frame = static_cast<size_t>(whole);
    if (!sequence_.has_truth() || frame + (share > 0 ? 1 : 0) >= poses_.frame_count()) return {};
    const std::span<const float> first = sequence_.FrameTruth(frame);
    std::vector<float> found(first.begin(), first.end());
    if (share == 0) return found;
    const std::span<const float> next = sequence_.FrameTruth(frame + 1);
    for (size_t i = 0; i < found.size(); ++i) found[i] += share * (next[i] - found[i]);
    return found;
  }

  float Budget() const { return options_.budget_ms > 0 ? static_cast<float>(1000 * options_.budget_ms) : 1e9f; }

  // Characters take turns, so that the caches hold what they hold in the crowd.
  void MeasureDrawing(std::vector<std::unique_ptr<Instance>>* characters, CrowdWorker* worker) const {
    std::vector<float> pose(poses_.joint_count() * 16);
    poses_.At(0, pose);
    for (auto& character : *characters)
      character->Update(pose, 0, options_.stages, 0, DCLOTH_DRAW_FULL);  // the first tick
    const size_t rounds = 3 + 60 / characters->size();
    for (uint32_t draw = 0; draw < DCLOTH_DRAW_COUNT; ++draw) {
      if (draw == DCLOTH_DRAW_COARSE && model_.info().coarse_vertex_count == 0) continue;
      if (draw == DCLOTH_DRAW_PLAIN && (options_.drawn.flags & DCLOTH_OUTPUT_OUTSIDE_BODY) == 0) continue;
      std::vector<double> times;
      for (size_t round = 0; round < rounds; ++round) {
        for (auto& character : *characters)
          times.push_back(character->Update(pose, 0, options_.stages, DCLOTH_FRAME_HOLD, draw));
      }
      worker->draw_ms[draw] = Median(times);
    }
  }

  dcloth_scene_character Describe(const CrowdWorker& worker, const Instance& instance, size_t place) const {
    const auto microseconds = [](double ms) { return static_cast<float>(1000 * ms); };
    dcloth_scene_character character{};
    character.struct_size = sizeof(character);
    character.top_level = TopLevel(options_.stages);
    character.cloth = instance.get();
    character.importance = 1 / static_cast<float>((1 + place) * (1 + place));  // the share of the screen at a distance
    character.draw_microseconds = microseconds(worker.draw_ms[DCLOTH_DRAW_FULL]);
    character.positions_microseconds = microseconds(worker.draw_ms[DCLOTH_DRAW_POSITIONS]);
    character.coarse_microseconds = microseconds(worker.draw_ms[DCLOTH_DRAW_COARSE]);
    character.plain_microseconds = microseconds(worker.draw_ms[DCLOTH_DRAW_PLAIN]);
    character.undrawn_microseconds = microseconds(worker.draw_ms[DCLOTH_DRAW_NONE]);
    character.most_undrawn = kMostUndrawn;
    for (size_t level = 0; level < DCLOTH_LEVEL_COUNT; ++level) {
      character.tick_microseconds[level] = microseconds(profile_.levels[level].tick_ms);
      character.error_mm[level] = static_cast<float>(profile_.levels[level].error_mm);
    }
    return character;
  }

  const OpenModel& model_;
  const Sequence& sequence_;
  const CrowdOptions& options_;
  PoseTrack poses_;
  double settle_seconds_;
  CrowdProfile& profile_;
};

// All characters of a worker at one level and drawn one way.
struct Setting {
  size_t level, draw;
  double ms;  // the mean frame
};

// Dearest first.
std::vector<Setting> SettingsOf(const CrowdProfile& profile, const CrowdWorker& worker, double tick_rate) {
  std::vector<Setting> settings;
  for (size_t level = 0; level <= TopLevel(profile.options.stages); ++level) {
    if (kLevels[level].name == nullptr) continue;
    const double ticks = level == DCLOTH_LEVEL_FROZEN ? 0 : tick_rate / profile.options.fps;
    for (size_t draw = DCLOTH_DRAW_COARSE; draw < DCLOTH_DRAW_COUNT; ++draw) {
      if (worker.draw_ms[draw] == 0) continue;
      settings.push_back(
          {level, draw,
           static_cast<double>(worker.characters) * (ticks * profile.levels[level].tick_ms + worker.draw_ms[draw])});
    }
  }
  std::sort(settings.begin(), settings.end(), [](const Setting& a, const Setting& b) { return a.ms > b.ms; });
  return settings;
}

size_t Missed(const CrowdWorker& worker, double budget_ms) {
  if (budget_ms <= 0) return 0;
  return static_cast<size_t>(
      std::count_if(worker.frame_ms.begin(), worker.frame_ms.end(), [&](double ms) { return ms > budget_ms; }));
}

}  // namespace

size_t CrowdProfile::missed_frames() const {
  size_t missed = 0;
  for (const CrowdWorker& worker : workers) missed += Missed(worker, options.budget_ms);
  return missed;
}

size_t CrowdProfile::late_frames() const {
  size_t late = 0;
  for (const CrowdWorker& worker : workers) late += Missed(worker, kLate * options.budget_ms);
  return late;
}

CrowdProfile ProfileCrowd(const OpenModel& model, const Sequence& sequence, const CrowdOptions& options) {
  CrowdProfile profile;
  profile.options = options;
  profile.has_truth = sequence.has_truth();
  profile.tick_rate = TickRate(model);
  profile.workers.resize(options.workers);
  Crowd crowd(model, sequence, options, &profile);
  crowd.MeasureLevels();
  std::barrier<> together(static_cast<std::ptrdiff_t>(options.workers));
  std::vector<double> errors(options.workers);
  std::vector<size_t> counted(options.workers);
  std::vector<std::exception_ptr> failures(options.workers);
  const auto work = [&](size_t index) {
    try {
      crowd.Work(index, &together, &errors[index], &counted[index]);
    } catch (...) {
      failures[index] = std::current_exception();
      together.arrive_and_drop();
    }
  };
  std::vector<std::thread> threads;
  for (size_t w = 1; w < options.workers; ++w) threads.emplace_back(work, w);
  work(0);
  for (std::thread& thread : threads) thread.join();
  for (const std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
  for (const CrowdWorker& worker : profile.workers) {
    if (!worker.frame_ms.empty()) continue;
    throw converter::Error(
        {.path = {},
         .tensor = {},
         .found = std::to_string(worker.interrupted_ms.size()) + " frames of a worker, all interrupted",
         .expected = "cores on which a frame can run without something else",
         .mend = "stop what else runs there, or choose another one with --core"});
  }
  size_t count = 0;
  for (size_t w = 0; w < options.workers; ++w) profile.error_mm += errors[w], count += counted[w];
  if (count > 0) profile.error_mm /= static_cast<double>(count);
  return profile;
}

Json CrowdJson(const CrowdProfile& profile) {
  const CrowdOptions& options = profile.options;
  Json json = {{"characters", options.characters},
               {"fps", options.fps},
               {"budget_ms", options.budget_ms > 0 ? Json(options.budget_ms) : Json(nullptr)},
               {"missed_frames", options.budget_ms > 0 ? Json(profile.missed_frames()) : Json(nullptr)},
               {"late_frames", options.budget_ms > 0 ? Json(profile.late_frames()) : Json(nullptr)},
               {"error_mm", profile.has_truth ? Json(profile.error_mm) : Json(nullptr)},
               {"levels", Json::object()},
               {"workers", Json::array()}};
  for (size_t level = 0; level < kLevels.size(); ++level) {
    if (kLevels[level].name == nullptr) continue;
    json["levels"][kLevels[level].name] = {{"tick_ms", profile.levels[level].tick_ms},
                                           {"error_mm", profile.levels[level].error_mm}};
  }
  for (size_t w = 0; w < profile.workers.size(); ++w) {
    const CrowdWorker& worker = profile.workers[w];
    Json row = {{"core", w < options.cores.size() ? Json(options.cores[w]) : Json(nullptr)},
                {"characters", worker.characters},
                {"frames", worker.frame_ms.size()},
                {"frame_ms", ToJson(PercentilesOf(worker.frame_ms))},
                {"interrupted_frames", worker.interrupted_ms.size()},
                {"interrupted_ms", ToJson(PercentilesOf(worker.interrupted_ms))},
                {"missed_frames", options.budget_ms > 0 ? Json(Missed(worker, options.budget_ms)) : Json(nullptr)},
                {"longest_wait_ms", worker.longest_wait_ms},
                {"at_level", Json::object()},
                {"drawn", Json::object()},
                {"draw_ms", Json::object()},
                {"settings", Json::array()}};
    for (size_t level = 0; level < kLevels.size(); ++level) {
      if (kLevels[level].name != nullptr) row["at_level"][kLevels[level].name] = worker.levels[level];
    }
    for (size_t draw = 0; draw < kDraws.size(); ++draw) {
      row["drawn"][kDraws[draw]] = worker.draws[draw];
      row["draw_ms"][kDraws[draw]] = worker.draw_ms[draw];
    }
    for (const Setting& s : SettingsOf(profile, worker, profile.tick_rate)) {
      row["settings"].push_back({{"level", kLevels[s.level].name},
                                 {"draw", kDraws[s.draw]},
                                 {"ms", s.ms},
                                 {"fits", options.budget_ms <= 0 || s.ms <= options.budget_ms},
                                 {"error_mm", profile.levels[s.level].error_mm}});
    }
    json["workers"].push_back(std::move(row));
  }
  return json;
}

void PrintCrowd(const CrowdProfile& profile) {
  const CrowdOptions& options = profile.options;
  std::printf("%zu characters at %g Hz, each core for itself", options.characters, options.fps);
  if (options.budget_ms > 0) std::printf(", in %g ms a frame", options.budget_ms);
  std::printf("\n\n  %-10s %9s %9s %9s %9s   level: tick ms, error mm\n", "draw ms", "coarse", "positions", "plain",
              "full");
  for (size_t w = 0; w < profile.workers.size(); ++w) {
    const CrowdWorker& worker = profile.workers[w];
    std::printf("  worker %-3zu", w);
    for (const auto draw : {DCLOTH_DRAW_COARSE, DCLOTH_DRAW_POSITIONS, DCLOTH_DRAW_PLAIN, DCLOTH_DRAW_FULL})
      std::printf(" %9.4f", worker.draw_ms[draw]);
    std::printf("  ");
    for (size_t level = 0; level < kLevels.size() && w == 0; ++level) {
      if (kLevels[level].name != nullptr)
        std::printf(" %s %.4f, %.2f;", kLevels[level].name, profile.levels[level].tick_ms,
                    profile.levels[level].error_mm);
    }
    std::printf("\n");
  }
  std::printf("\n  %-10s %9s %9s %9s %9s\n", "frame ms", "p50", "p95", "p99", "max");
  for (size_t w = 0; w < profile.workers.size(); ++w) {
    const CrowdWorker& worker = profile.workers[w];
    const Percentiles p = PercentilesOf(worker.frame_ms);
    std::printf("  worker %-3zu %9.4f %9.4f %9.4f %9.4f", w, p.p50, p.p95, p.p99, p.max);
    if (w < options.cores.size()) std::printf("  core %d", options.cores[w]);
    if (options.budget_ms > 0)
      std::printf("  %zu of %zu missed", Missed(worker, options.budget_ms), worker.frame_ms.size());
    if (!worker.interrupted_ms.empty())
      std::printf("  %zu more interrupted, of up to %.4f", worker.interrupted_ms.size(),
                  PercentilesOf(worker.interrupted_ms).max);
    std::printf("\n    in the mean");
    for (size_t level = 0; level < kLevels.size(); ++level) {
      if (kLevels[level].name != nullptr) std::printf(" %s %.1f", kLevels[level].name, worker.levels[level]);
    }
    std::printf("; draws");
    for (size_t draw = 0; draw < kDraws.size(); ++draw) std::printf(" %s %.1f", kDraws[draw], worker.draws[draw]);
    std::printf("; longest wait for a tick %.0f ms\n", worker.longest_wait_ms);
  }
  if (profile.has_truth) std::printf("\nerror to the simulation, of what is seen: mean %.2f mm\n", profile.error_mm);
  if (options.budget_ms <= 0) return;
  std::printf("\nall characters of worker 0 alike, in the mean frame:\n");
  for (const Setting& s : SettingsOf(profile, profile.workers[0], profile.tick_rate)) {
    std::printf("  %-9s %-10s %9.4f ms  %6.2f mm  %s\n", kLevels[s.level].name, kDraws[s.draw], s.ms,
                profile.levels[s.level].error_mm, s.ms <= options.budget_ms ? "fits" : "");
  }
}

}  // namespace dcloth::tools
