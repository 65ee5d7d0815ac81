// Many instances for simulated hours, each living a life of its own: teleports (announced or not), levels of detail,
// other frame rates, hitches, pauses, resets, saves.
//
//   soak MODEL POSES [--hours H] [--instances N] [--threads T] [--strict] [--fault leak|canary|reach|slow|busy]
//
// POSES as for tests/picture. A JSON line after each twentieth of the time, flushed; a last one with a hash of all
// instances' states, which does not depend on the threads. Exit 1 and the reason on stderr where the heap or the
// process grew, a canary that plays the same motion after each part drew other bits, a garment left its character, a
// call failed or, with --strict, the 99th percentile rose by more than a tenth from the first part to the last. Other
// work on the machine raises it, too: it is taken as a multiple of that of controls, instances made anew for each part
// that live the same life every time, here and there among the others. --fault breaks that promise, from the middle on;
// "slow" and "busy" put times of their own in place of the measured ones: characters a sixth slower, or the whole
// machine, which breaks none.
#include <malloc.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <barrier>
#include <cmath>
#include <cstring>
#include <fstream>
#include <memory>
#include <thread>

#include "tests/picture/played_model.h"

namespace {

using dcloth::Status;
using dcloth::testing::Fail;
using dcloth::testing::Hash;
using dcloth::testing::PlayedCloth;
using dcloth::testing::PlayedModel;

constexpr int kParts = 20;
constexpr int kOwnMapping = 32 << 10;  // bytes from which a block has a mapping of its own
constexpr size_t kHeapCaches = 4096;   // bytes that an allocator may hold for itself, over the whole run
constexpr float kLargestReach = 10;    // metres from one end of a garment to the other
constexpr size_t kControlEvery = 11;   // instances; odd, so that each of two threads has its share

struct Options {
  std::string model, poses, fault;
  double hours = 24;
  size_t instances = 100, threads = 2;
  bool strict = false;
};

// SplitMix64: the same numbers on every platform.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  uint64_t Below(uint64_t limit) {
    uint64_t z = (state_ += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return (z ^ (z >> 31)) % limit;
  }
  bool OneIn(uint64_t count) { return Below(count) == 0; }

 private:
  uint64_t state_;
};

// Times in buckets 2 % wide from 0.1 us.
class Times {
 public:
  void Add(double us) {
    const double bucket = std::log(std::max(us, 0.1) / 0.1) / std::log(1.02);
    ++counts_[std::min(kBuckets - 1, static_cast<size_t>(bucket))];
  }
  void Add(const Times& other) {
    for (size_t i = 0; i < kBuckets; ++i) counts_[i] += other.counts_[i];
  }
  uint64_t count() const {
    uint64_t sum = 0;
    for (const uint64_t c : counts_) sum += c;
    return sum;
  }
  double Percentile(double share) const {
    const auto wanted = static_cast<uint64_t>(share * static_cast<double>(count()));
    uint64_t seen = 0;
    for (size_t i = 0; i < kBuckets; ++i) {
      seen += counts_[i];
      if (seen > wanted) return 0.1 * std::pow(1.02, static_cast<double>(i));
    }
    return 0;
  }

 private:
  static constexpr size_t kBuckets = 1024;
  uint64_t counts_[kBuckets] = {};
};

Times Always(double us) {
  Times times;
  times.Add(us);
  return times;
}

double ThreadMicroseconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
}

class Instance {
 public:
  Instance(const PlayedModel& played, uint64_t seed)
      : played_(played),
        player_(played),
        random_(seed),
        matrices_(16 * size_t{played.info.joint_count}),
        positions_(3 * size_t{played.info.vertex_count}),
        state_(player_.memory.size()) {}

  // Lives for `seconds`. An empty string, or what went wrong.
  std::string Live(double seconds, bool reach_fault, Times* times) {
    for (double lived = 0; lived < seconds;) {
      float step = 1.0f / static_cast<float>(rate_);
      uint32_t flags = flags_;
      if (random_.OneIn(static_cast<uint64_t>(4 * rate_)) && !Happen(&step, &flags)) return "a save or restore failed";
      const size_t frame = static_cast<size_t>(at_) % played_.frames;
      const float* matrices = played_.Pose(frame).joint_matrices;
      for (size_t i = 0; i < matrices_.size(); ++i)
        matrices_[i] = matrices[i] + (i % 4 == 3 && i % 16 < 12 ? place_ : 0);
      const dcloth_pose pose = dcloth::MakePose(matrices_.data(), played_.info.joint_count);
      const dcloth_frame time = {sizeof(time), stages_ & played_.info.stages, step, flags, nullptr};
      float bounds[6];
      dcloth_output output = dcloth::MakeOutput(positions_.data(), nullptr, played_.info.vertex_count);
      output.bounds = bounds;
      const bool drawn = ++frames_ % 8 == 0;
      const double start = ThreadMicroseconds();
      if (player_.cloth.Update(pose, time, drawn ? &output : nullptr) != Status::kOk) return "a frame was refused";
      times->Add(ThreadMicroseconds() - start);
      if (drawn && reach_fault) positions_[0] = bounds[3] += 100;
      for (int c = 0; drawn && c < 3; ++c) {
        if (!(bounds[3 + c] - bounds[c] < kLargestReach)) return "a garment left its character";
      }
      at_ += 30.0 * static_cast<double>(step);
      lived += std::max(static_cast<double>(step), 1e-3);
    }
    return "";
  }

  void AddTo(Hash* hash) {
    const size_t size = player_.cloth.StateSize();
    if (player_.cloth.Save(state_.data(), size) != Status::kOk) Fail("a state cannot be saved");
    for (size_t i = 0; i < size; ++i) hash->Add(state_[i]);
  }

 private:
  bool Happen(float* step, uint32_t* flags) {
    constexpr uint32_t kStages[] = {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH};
    constexpr int kRates[] = {24, 30, 50, 60, 72, 90, 120, 144};
    switch (random_.Below(8)) {
      case 0:  // a portal: told of or not
        at_ = static_cast<double>(random_.Below(played_.frames));
        place_ = static_cast<float>(random_.Below(2000)) - 1000;
        if (random_.OneIn(2)) *flags |= DCLOTH_FRAME_JUMPED;
        return true;
      case 1:
        stages_ = kStages[random_.Below(3)];
        return true;
      case 2:
        rate_ = kRates[random_.Below(8)];
        return true;
      case 3:
        flags_ = static_cast<uint32_t>(random_.Below(32)) & ~uint32_t{DCLOTH_FRAME_JUMPED | DCLOTH_FRAME_HOLD};
        return true;
      case 4:
        *step = 0.1f * static_cast<float>(1 + random_.Below(50));  // a hitch
        return true;
      case 5:
        *step = 0;  // a pause
        return true;
      case 6:
        return player_.cloth.Reset() == Status::kOk;
      default: {
        const size_t size = player_.cloth.StateSize();
        return player_.cloth.Save(state_.data(), size) == Status::kOk &&
               player_.cloth.Restore(state_.data(), size) == Status::kOk;
      }
    }
  }

  const PlayedModel& played_;
  PlayedCloth player_;
  Random random_;
  std::vector<float> matrices_, positions_;
  std::vector<uint8_t> state_;
  double at_ = 0;
  float place_ = 0;
  int rate_ = 60;
  uint32_t stages_ = DCLOTH_STAGES_MESH, flags_ = 0;
  uint64_t frames_ = 0;
};

// The same five seconds in new memory: what the process has become must not show.
unsigned long long Canary(const PlayedModel& played, bool fault) {
  PlayedCloth player(played);
  std::vector<float> positions(3 * size_t{played.info.vertex_count});
  const dcloth_output output = dcloth::MakeOutput(positions.data(), nullptr, played.info.vertex_count);
  Hash hash;
  for (size_t frame = 0; frame < 300; ++frame) {
    const dcloth_frame time = {sizeof(time), played.info.stages, fault ? 0.01667f : 0.01666f, 0, nullptr};
    if (player.cloth.Update(played.Pose(frame / 2 % played.frames), time, &output) != Status::kOk)
      Fail("the canary died");
    if (frame % 10 == 9) hash.Add(positions);
  }
  return hash.value();
}

size_t ResidentBytes() {
  size_t total = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> total >> resident;
  return resident * static_cast<size_t>(sysconf(_SC_PAGESIZE));
}

Options Parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto value = [&] { return i + 1 < argc ? argv[++i] : (Fail(word + " without a value"), ""); };
    if (word == "--hours") {
      options.hours = std::atof(value());
    } else if (word == "--instances") {
      options.instances = static_cast<size_t>(std::atoi(value()));
    } else if (word == "--threads") {
      options.threads = static_cast<size_t>(std::atoi(value()));
    } else if (word == "--fault") {
      options.fault = value();
    } else if (word == "--strict") {
      options.strict = true;
    } else {
      (options.model.empty() ? options.model : options.poses) = word;
    }
  }
  if (options.poses.empty() || !(options.hours > 0) || options.instances == 0 || options.threads == 0)
    Fail("usage: soak MODEL POSES [--hours H] [--instances N] [--threads T] [--strict] [--fault NAME]");
  return options;
}

}  // namespace

int main(int argc, char** argv) {
  const Options options = Parse(argc, argv);
  // Or else the allocator keeps the memory of a large garment's controls, after how many parts is its own affair.
  mallopt(M_MMAP_THRESHOLD, kOwnMapping);
  const PlayedModel played(options.model, options.poses);
  std::vector<std::unique_ptr<Instance>> instances;
  for (size_t i = 0; i < options.instances; ++i) instances.push_back(std::make_unique<Instance>(played, i));
  std::vector<std::unique_ptr<Instance>> controls((instances.size() + kControlEvery - 1) / kControlEvery);
  std::vector<Times> times(options.threads), control_times(options.threads);
  std::vector<std::string> wrong(options.threads);
  const double part_seconds = options.hours * 3600 / kParts;
  unsigned long long first_canary = 0;
  size_t first_heap = 0, first_resident = 0;
  double first_p99 = 0, last_p99 = 0, first_control = 0, last_control = 0;
  std::vector<std::string> broken;
  // Started once: a thread's own memory would be taken for growth.
  std::barrier gate(static_cast<std::ptrdiff_t>(options.threads) + 1);
  bool reach_fault = false, done = false;
  std::vector<std::thread> threads;
  for (size_t t = 0; t < options.threads; ++t) {
    threads.emplace_back([&, t] {
      for (;;) {
        gate.arrive_and_wait();
        if (done) return;
        for (size_t i = t; i < instances.size() && wrong[t].empty(); i += options.threads) {
          wrong[t] = instances[i]->Live(part_seconds, reach_fault, &times[t]);
          if (i % kControlEvery == 0 && wrong[t].empty())
            wrong[t] = controls[i / kControlEvery]->Live(part_seconds, false, &control_times[t]);
        }
        gate.arrive_and_wait();
      }
    });
  }
  for (int part = 0; part < kParts; ++part) {
    const bool later = part > kParts / 2;
    for (size_t i = 0; i < controls.size(); ++i) {
      controls[i].reset();  // before the next one, which takes its memory
      controls[i] = std::make_unique<Instance>(played, i);
    }
    for (size_t t = 0; t < options.threads; ++t) times[t] = control_times[t] = Times();
    reach_fault = later && options.fault == "reach";
    gate.arrive_and_wait();
    gate.arrive_and_wait();
    Times all, control;
    for (const Times& t : times) all.Add(t);
    for (const Times& t : control_times) control.Add(t);
    if (options.fault == "slow") all = Always(later ? 14 : 12), control = Always(12);
    if (options.fault == "busy") all = Always(later ? 36 : 12), control = all;
    if (later && options.fault == "leak") *static_cast<volatile char*>(std::malloc(1024)) = 1;
    const unsigned long long canary = Canary(played, later && options.fault == "canary");
    const struct mallinfo2 memory = mallinfo2();
    const size_t heap = memory.uordblks + memory.hblkhd, resident = ResidentBytes();
    last_p99 = all.Percentile(0.99);
    last_control = control.Percentile(0.99);
    std::printf(
        "{\"hours\": %.4f, \"updates\": %llu, \"p50_us\": %.1f, \"p99_us\": %.1f, \"control_p99_us\": %.1f, "
        "\"heap_bytes\": %zu, \"resident_bytes\": %zu, \"canary\": \"%016llx\"}\n",
        options.hours * (part + 1) / kParts, static_cast<unsigned long long>(all.count()), all.Percentile(0.5),
        last_p99, last_control, heap, resident, canary);
    std::fflush(stdout);
    if (part == 0) first_canary = canary, first_p99 = last_p99, first_control = last_control;
    if (part == 1) first_heap = heap, first_resident = resident;  // after the first part's stacks
    if (canary != first_canary) broken.push_back("the canary drew other bits");
    if (part > 1 && heap > first_heap + kHeapCaches)
      broken.push_back("the heap grew by " + std::to_string(heap - first_heap));
    if (part > 1 && resident > first_resident + (1 << 20)) broken.push_back("the process grew");
    for (const std::string& w : wrong) {
      if (!w.empty()) broken.push_back(w);
    }
    if (!broken.empty()) break;
  }
  done = true;
  gate.arrive_and_wait();
  for (std::thread& thread : threads) thread.join();
  if (options.strict && last_p99 * first_control > 1.1 * first_p99 * last_control)
    broken.push_back("the 99th percentile rose");
  Hash hash;
  for (const auto& instance : instances) instance->AddTo(&hash);
  std::printf("{\"instances\": %zu, \"hash\": \"%016llx\"}\n", instances.size(), hash.value());
  for (const std::string& reason : broken) std::fprintf(stderr, "soak: %s\n", reason.c_str());
  return broken.empty() ? 0 : 1;
}
