// A host with one garment: ticks, draws, measures, and looks at what a host cannot see, the recurrent state.
#ifndef DCLOTH_TESTS_STABILITY_PLAYER_H_
#define DCLOTH_TESTS_STABILITY_PLAYER_H_

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "tests/stability/garment.h"

namespace dcloth::stability {

class Player {
 public:
  // A cloth of its own on the garment's model; `garment` outlives the player. Not copyable: a cloth knows its
  // memory.
  Player(const Garment& garment, Precision precision);
  Player(const Player&) = delete;
  Player& operator=(const Player&) = delete;

  void Reset();

  // A refused call is a test failure. The tick's time is kept.
  void Tick(const Pose& pose);

  // World positions [n, 3] as the pose draws them, valid until the next call. The finite check and the
  // distance to the hips go into worst_reach_m.
  const std::vector<float>& Skin(const Pose& pose);

  const std::vector<float>& Step(const Pose& pose) {
    Tick(pose);
    return Skin(pose);
  }

  // Farthest vertex from the hips over everything drawn; infinity once a position was not finite.
  double worst_reach_m() const { return worst_reach_m_; }
  void ForgetReach() { worst_reach_m_ = 0; }

  // Largest |h| of all recurrent stages, padding included; infinity where one is not finite.
  double LargestState() const;
  double LargestSkeletonState() const;
  void FillState(const std::function<float()>& value);

  // All of the cloth's memory: restored, it goes on as if nothing had happened in between.
  std::vector<std::byte> Save() const { return {memory_.begin(), memory_.end()}; }
  void Restore(const std::vector<std::byte>& saved);

  const std::vector<double>& tick_ms() const { return tick_ms_; }

 private:
  std::span<float> SkeletonState() const;
  std::span<float> MeshState() const;
  std::span<float> PatchState() const;
  dcloth_pose Load(const Pose& pose);

  const Garment& garment_;
  const converter::OpenModel& model_;
  converter::AlignedBytes memory_;
  dcloth_cloth* cloth_ = nullptr;
  std::vector<float> matrices_, positions_;
  double worst_reach_m_ = 0;
  std::vector<double> tick_ms_;
};

// Mean vertex distance in mm.
double MeanDistanceMm(std::span<const float> a, std::span<const float> b);
double LargestDistanceMm(std::span<const float> a, std::span<const float> b);

}  // namespace dcloth::stability

#endif  // DCLOTH_TESTS_STABILITY_PLAYER_H_
