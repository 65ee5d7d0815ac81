#include "engine/src/update.h"

#include <cstring>
#include <utility>

#include "engine/src/frame.h"
#include "engine/src/network/schedule.h"
#include "engine/src/time/idle.h"
#include "engine/src/time/pose_blend.h"

namespace dcloth::engine {
namespace {

constexpr uint64_t kAllOfIt = UINT64_MAX;

// A pipelined frame does this times its length in ticks of a tick's cost. Work then follows the frame time,
// however frames and ticks fall, and what is left when the next tick is due fits into that frame's own share.
// The little above 1 keeps a host whose frame time wobbles from finishing a frame late. Rejected: equal shares
// over the frames until the next tick, where a wobble of the frame time puts a whole tick into one frame.
constexpr double kPipelinePace = 1.05;

void StartTick(Cloth* cloth, const Affine* pose, uint32_t stages, double elapsed_ticks, Stopwatch* watch) {
  SkinPose skin = {cloth->skin_joints, {}};
  MakeSkinPose(*cloth->model, pose, &skin);
  BeginTick(cloth, skin, stages, elapsed_ticks, watch);
}

bool Freezes(const dcloth_frame& frame) { return (frame.flags & DCLOTH_FRAME_FREEZE_IDLE) != 0; }

// ContinueTick, watched for stillness where that matters.
uint64_t RunTick(Cloth* cloth, uint64_t budget, bool freezes, Stopwatch* watch) {
  const uint32_t newest = cloth->newest;
  const uint64_t spent = ContinueTick(cloth, budget, watch);
  if (freezes && cloth->newest != newest) CountTickDone(cloth);
  return spent;
}

// 0 where frames are too unlike in length for one curve: a hitch, a pause.
double OlderGap(const Cloth& cloth) {
  constexpr double kMostUnlike = 10;
  const double step = cloth.clock.step(), older = cloth.older_step;
  return step > 0 && older < kMostUnlike * step && step < kMostUnlike * older ? older / step : 0;
}

// Finishes what an earlier frame left and starts the ticks that are due. All but the last one run whole, and
// that one too where there is nothing to draw before it.
uint64_t RunDueTicks(Cloth* cloth, const DueTicks& due, const dcloth_frame& frame, Stopwatch* watch) {
  const bool pipelined = (frame.flags & DCLOTH_FRAME_PIPELINED) != 0, freezes = Freezes(frame);
  uint64_t spent = due.count != 0 || !pipelined ? RunTick(cloth, kAllOfIt, freezes, watch) : 0;
  const PoseHistory history = {cloth->pose_older, cloth->pose_before, cloth->pose_now, OlderGap(*cloth)};
  for (uint32_t i = 0; i < due.count; ++i) {
    const Affine* pose = cloth->pose_now;
    if (due.fraction[i] < 1) {
      PoseBetween(history, due.fraction[i], cloth->model->joint_count, cloth->skin_joints);
      pose = cloth->skin_joints;
    }
    if (freezes) CountTickBegun(cloth, pose);
    StartTick(cloth, pose, frame.stages, i == 0 ? 1 + due.skipped + due.waited : 1, watch);
    if (!pipelined || i + 1 < due.count || cloth->tick_count == 0) spent += RunTick(cloth, kAllOfIt, freezes, watch);
  }
  return spent;
}

// This frame's share of the tick in work, less what the frame has already `spent`.
uint64_t RunShare(Cloth* cloth, const dcloth_frame& frame, uint64_t tick_cost, uint64_t spent, Stopwatch* watch) {
  const double budget = kPipelinePace * cloth->clock.step() * static_cast<double>(tick_cost);
  if (budget >= static_cast<double>(tick_cost + spent)) return RunTick(cloth, kAllOfIt, Freezes(frame), watch);
  const auto whole = static_cast<uint64_t>(budget);
  return whole > spent ? RunTick(cloth, whole - spent, Freezes(frame), watch) : 0;
}

// Whether this frame of a frozen cloth is one more. Without time nothing wakes; the frame after it does.
bool StaysFrozen(const Cloth& cloth, const dcloth_frame& frame) {
  if (!Freezes(frame) || !IsFrozen(cloth)) return false;
  if (!(frame.seconds > 0)) return true;
  return (frame.flags & DCLOTH_FRAME_JUMPED) == 0 && frame.stages == cloth.stages && IsStill(cloth, cloth.pose_now);
}

// Time passes: the ticks that this frame runs.
DueTicks PassTime(Cloth* cloth, const dcloth_frame& frame) {
  const double step = static_cast<double>(frame.seconds) * static_cast<double>(cloth->model->tick_rate);
  if ((frame.flags & DCLOTH_FRAME_HOLD) == 0) return cloth->clock.Advance(step);
  cloth->clock.Hold(step);
  return {};
}

// The pose of this frame becomes the last one. A frame without time replaces the last one, so that a pause
// leaves the motion before it in memory.
void RememberPose(Cloth* cloth, bool jumped) {
  if (cloth->clock.step() > 0) {
    std::swap(cloth->pose_older, cloth->pose_before);
    cloth->older_step = jumped ? 0 : cloth->clock.step();
  }
  std::swap(cloth->pose_before, cloth->pose_now);
}

void Draw(Cloth* cloth, const Affine* pose, double behind, const dcloth_output& output, Stopwatch* watch) {
  SkinPose skin = {cloth->skin_joints, {}};
  MakeSkinPose(*cloth->model, pose, &skin);
  watch->Lap(DCLOTH_STEP_POSE, "pose");
  DrawFrame(cloth, skin, behind, output, watch);
}

}  // namespace

bool TickCloth(Cloth* cloth, const dcloth_pose& pose, uint32_t stages, dcloth_timer* timer) {
  Stopwatch watch(timer);
  if (!ReadPose(*cloth->model, cloth->rig, pose, cloth->pose_now)) return false;
  ContinueTick(cloth, kAllOfIt, &watch);
  StartTick(cloth, cloth->pose_now, stages, 1, &watch);
  std::swap(cloth->pose_before, cloth->pose_now);
  ContinueTick(cloth, kAllOfIt, &watch);
  cloth->clock.Restart();
  cloth->older_step = 0;
  cloth->idle_ticks = 0;
  cloth->contact_clock.Pass(1 / cloth->model->tick_rate);
  return true;
}

bool SkinCloth(Cloth* cloth, const dcloth_pose& pose, float blend, const dcloth_output& output, dcloth_timer* timer) {
  Stopwatch watch(timer);
  if (!ReadPose(*cloth->model, cloth->rig, pose, cloth->pose_now)) return false;
  Draw(cloth, cloth->pose_now, 1 - static_cast<double>(blend), output, &watch);
  return true;
}

bool UpdateCloth(Cloth* cloth, const dcloth_pose& pose, const dcloth_frame& frame, const dcloth_output* output,
                 dcloth_timer* timer) {
  Stopwatch watch(timer);
  const format::ModelView& model = *cloth->model;
  if (!ReadPose(model, cloth->rig, pose, cloth->pose_now)) return false;
  if ((frame.flags & DCLOTH_FRAME_JUMPED) != 0) {
    std::memcpy(cloth->pose_before, cloth->pose_now, model.joint_count * sizeof(Affine));
    cloth->root.jumped = cloth->root.started;
    cloth->older_step = 0;
  }
  const bool frozen = StaysFrozen(*cloth, frame);
  uint64_t spent = 0;
  if (frozen) {
    cloth->clock.Rest(static_cast<double>(frame.seconds) * static_cast<double>(model.tick_rate));
    watch.Lap(DCLOTH_STEP_POSE, "pose");
    spent = RunTick(cloth, kAllOfIt, true, &watch);  // what was begun before the freeze
  } else {
    if (IsFrozen(*cloth)) cloth->clock.Rest(0);
    if (IsFrozen(*cloth) || !Freezes(frame)) cloth->idle_ticks = 0;
    const DueTicks due = PassTime(cloth, frame);
    watch.Lap(DCLOTH_STEP_POSE, "pose");
    spent = RunDueTicks(cloth, due, frame, &watch);
    if (TickInWork(*cloth)) spent += RunShare(cloth, frame, TickCost(model, cloth->stages), spent, &watch);
  }
  cloth->work_done = 0;
  if (spent != 0) {
    cloth->work_done =
        static_cast<float>(static_cast<double>(spent) / static_cast<double>(TickCost(model, cloth->stages)));
  }
  cloth->contact_clock.Pass(frame.seconds);
  const double behind = frozen ? 0 : cloth->clock.Behind(TickInWork(*cloth));
  if (output != nullptr) Draw(cloth, cloth->pose_now, behind, *output, &watch);
  RememberPose(cloth, (frame.flags & DCLOTH_FRAME_JUMPED) != 0);
  return true;
}

}  // namespace dcloth::engine
