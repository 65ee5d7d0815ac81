#include "bench/peers/engine.h"

#include <algorithm>
#include <memory>
#include <string>

#include "converter/file.h"
#include "converter/rollout.h"
#include "tools/playback.h"
#include "tools/pose_track.h"
#include "tools/timing.h"

static_assert(DCLOTH_STEP_COUNT == 8, "PeersTimes holds as many steps as the engine has");

namespace {

using dcloth::tools::NowNanoseconds;

std::string last_error;

struct Engine {
  Engine(const char* model_path, const char* sequence_path)
      : model(dcloth::tools::OpenModelFile(model_path)),
        poses(dcloth::converter::ReadSequence(sequence_path), model.joint_names()),
        player(model, model.info().stages, sequence_path) {}

  dcloth::converter::OpenModel model;
  dcloth::tools::PoseTrack poses;
  dcloth::tools::Player player;
  dcloth::tools::StepTimer timer;
};

Engine& EngineOf(void* handle) { return *static_cast<Engine*>(handle); }

// No exception leaves for Python.
template <typename Body>
bool Guard(const Body& body) {
  try {
    body();
    return true;
  } catch (const std::exception& error) {
    last_error = error.what();
    return false;
  }
}

dcloth::tools::CacheEvictor& Evictor() {
  static dcloth::tools::CacheEvictor evictor;
  return evictor;
}

}  // namespace

const char* peers_error() { return last_error.c_str(); }

void* peers_open(const char* model, const char* sequence) {
  std::unique_ptr<Engine> engine;
  Guard([&] { engine = std::make_unique<Engine>(model, sequence); });
  return engine.release();
}

int peers_open_times(const char* path, int cold, uint32_t count, double* ms) {
  return Guard([&] {
    const dcloth::converter::AlignedBytes bytes = dcloth::converter::ReadFile(path);
    dcloth::converter::AlignedBytes view(dcloth_model_storage_size());
    for (uint32_t i = 0; i < count; ++i) {
      if (cold != 0) Evictor().EvictAll();
      dcloth_model* model = nullptr;
      const uint64_t start = NowNanoseconds();
      const dcloth_status status =
          dcloth_model_open(bytes.data(), bytes.size(), view.data(), view.size(), &model, nullptr);
      ms[i] = static_cast<double>(NowNanoseconds() - start) * 1e-6;
      if (status != DCLOTH_OK) dcloth::tools::OpenModelFile(path);  // says what is wrong
    }
  })
             ? 0
             : 1;
}

uint64_t peers_model_bytes(void* engine) { return EngineOf(engine).model.bytes().size(); }
uint64_t peers_instance_bytes(void* engine) { return EngineOf(engine).model.instance_bytes(); }
const char* peers_isa() { return dcloth_isa_name(); }

int peers_reset(void* engine) {
  return Guard([&] { EngineOf(engine).player.Reset(); }) ? 0 : 1;
}

int peers_tick(void* handle, uint32_t frame, PeersTimes* times) {
  return Guard([&] {
    Engine& engine = EngineOf(handle);
    const std::span<const float> pose = engine.poses.Frame(frame);
    engine.timer.Take();
    const uint64_t start = NowNanoseconds();
    engine.player.Tick(pose, engine.timer.get());
    engine.player.Skin(pose, 1, engine.timer.get());
    times->whole = NowNanoseconds() - start;
    std::ranges::copy(engine.timer.Take(), times->steps);
  })
             ? 0
             : 1;
}

const float* peers_positions(void* engine, uint32_t* vertex_count) {
  *vertex_count = EngineOf(engine).model.info().vertex_count;
  return EngineOf(engine).player.positions().data();
}

void peers_evict() { Evictor().EvictAll(); }
uint64_t peers_evicted_bytes() { return dcloth::tools::CacheEvictor::AllBytes(); }
