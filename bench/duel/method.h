// What every contestant does in a frame, all in: network or simulation, contact, the drawn mesh and its normals.
#ifndef DCLOTH_BENCH_DUEL_METHOD_H_
#define DCLOTH_BENCH_DUEL_METHOD_H_

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "bench/duel/case.h"

namespace dcloth::duel {

using Pose = std::span<const float>;  // [joints, 16] joint to world, rows contiguous

class Method {
 public:
  virtual ~Method() = default;
  // The first pose of a clip, and the garment's true shape [n, 3] in it: simulations start there, at rest.
  virtual void Start(Pose pose, std::span<const float> truth) = 0;
  virtual void Frame(Pose pose, float seconds, bool jumped) = 0;
  virtual std::span<const float> positions() const = 0;  // [n, 3] world, of the last frame
  virtual size_t instance_bytes() const = 0;             // one more character of the same kind
  virtual size_t shared_bytes() const = 0;               // what all of a kind read
};

// joints: of the poses to come.
std::unique_ptr<Method> MakeNetwork(const std::filesystem::path& model, const Options& options,
                                    const std::vector<std::string>& joints);
std::unique_ptr<Method> MakeSprings(const Case& data, const Options& options);
std::unique_ptr<Method> MakeSolver(const Case& data, const Options& options);
std::unique_ptr<Method> MakeJolt(const Case& data, const Options& options);  // null where built without Jolt

// How a game's fixed step sees a frame: so many equal steps, none longer than a 60th of a second, six at most.
inline int Steps(float seconds) { return std::clamp(static_cast<int>(std::ceil(seconds * 60 - 0.05F)), 1, 6); }

}  // namespace dcloth::duel

#endif  // DCLOTH_BENCH_DUEL_METHOD_H_
