// One garment on one skinned character, as a plugin of a game engine needs it: the model's bytes, the memory that a
// cloth asks for, the character's joints and skin, a frame at a time, vertices to draw. The plugins for Godot and
// Unreal share it; it knows neither. It sees the public headers alone, throws nothing, and starts no thread.
//
// Order of calls: GarmentModel::Open once a file, Garment::Create once a character, then in every frame Follow,
// SetJoint for each joint, Update.
#ifndef DCLOTH_PLATFORMS_GARMENT_GARMENT_H_
#define DCLOTH_PLATFORMS_GARMENT_GARMENT_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "dcloth/dcloth.h"
#include "dcloth/dcloth_fit.h"

namespace dcloth::platforms {

// Memory on DCLOTH_ALIGNMENT. It stays where it is.
class LentMemory {
 public:
  explicit LentMemory(size_t size) : bytes_(size + DCLOTH_ALIGNMENT), size_(size) {
    const size_t past = reinterpret_cast<uintptr_t>(bytes_.data()) % DCLOTH_ALIGNMENT;
    start_ = bytes_.data() + (DCLOTH_ALIGNMENT - past) % DCLOTH_ALIGNMENT;
  }
  LentMemory(const LentMemory&) = delete;
  LentMemory& operator=(const LentMemory&) = delete;

  void* data() { return start_; }
  size_t size() const { return size_; }

 private:
  std::vector<unsigned char> bytes_;
  unsigned char* start_;
  size_t size_;
};

// An opened model. Garments share it and keep it alive.
class GarmentModel {
 public:
  // Copies the bytes of a .dcloth file and checks them. Null if they are refused; `error` then says why.
  static std::shared_ptr<const GarmentModel> Open(const void* bytes, size_t size, std::string* error);

  const dcloth_model* get() const { return model_; }
  const dcloth_model_info& info() const { return info_; }

  // What garments draw: the model's vertices, and once more those at seams of its texture.
  uint32_t vertex_count() const { return is_textured() ? info_.textured_vertex_count : info_.vertex_count; }
  bool is_textured() const { return info_.textured_vertex_count != 0; }
  // [vertex_count, 2] u right and v down from the upper left; null without a texture.
  const float* texture_coordinates() const { return info_.texture_coordinates; }

  // Corners of the triangles, in the order that the engine takes for a front.
  enum class Front {
    kCounterClockwise,  // seen from outside: Unreal
    kClockwise,         // Godot
  };
  std::vector<int32_t> Triangles(Front front) const;

 private:
  explicit GarmentModel(size_t size);

  LentMemory bytes_, view_;
  dcloth_model* model_ = nullptr;
  dcloth_model_info info_ = {};
};

// A character in its bind pose: the pose in which its skin was bound to its joints. All in the engine's axes and units,
// upright, and in the size that the character has in the world.
struct Wearer {
  // Influences that are kept of a vertex of the skin. The fit needs no more.
  static constexpr uint32_t kInfluences = 8;

  std::vector<std::string> joint_names;  // the whole skeleton
  std::vector<float> bind_matrices;      // [joints, 16] joint to world, columns contiguous
  std::vector<float> body_positions;     // [n, 3]; empty: the garment follows bones alone
  std::vector<uint32_t> body_joints;     // [n, kInfluences]
  std::vector<float> body_weights;       // [n, kInfluences]
  std::vector<uint32_t> body_triangles;  // [t, 3]

  uint32_t body_vertex_count() const { return static_cast<uint32_t>(body_positions.size() / 3); }
  void AddJoint(std::string name, const double bind[16]);
  // `joints` and `weights` hold `count` influences, the heaviest first where there are more than kInfluences.
  void AddBodyVertex(const double position[3], const uint32_t* joints, const float* weights, size_t count);
};

// How the garment's joints are found in a skeleton.
enum class Match {
  kBody,   // lays the garment onto bones and skin of any humanoid; takes 0.2 to 1 s, once
  kBones,  // the same by bones alone: for skins that have other clothes in them
  kNames,  // the skeleton is that of training: the same names, axes and lengths
};

// What a frame may change.
struct GarmentFrame {
  float seconds = 0;                     // since the last frame; 0: a pause
  uint32_t stages = DCLOTH_STAGES_MESH;  // fewer cost less
  bool pipelined = false;                // spreads the network's work over frames
  bool half_rate_mesh = false;           // the mesh stage runs in every second tick
  bool freeze_idle = false;              // a character at rest costs drawing alone
  bool outside_body = true;              // pushes vertices out of the body, where the model holds one
  bool draw = true;                      // false: motion goes on, vertices stay as they are
};

// Thread: one garment on one thread at a time; different garments at the same time.
class Garment {
 public:
  // Null if the character cannot wear the garment; `error` then says why and how to mend it.
  static std::unique_ptr<Garment> Create(std::shared_ptr<const GarmentModel> model, const dcloth_space& space,
                                         const Wearer& wearer, Match match, std::string* error);

  // Keeps coordinates small. Vertices count from origin(), a place that stands still close to the character: call it
  // with the character's place before its joints are set. True if the origin has moved: then move what draws the
  // garment there. An origin moves when the character is `reach` away from it along an axis.
  bool Follow(const double place[3], double reach);
  const double* origin() const { return origin_; }

  // `matrix`: joint to world, columns contiguous. Joints are those of the wearer, in its order.
  void SetJoint(size_t joint, const double matrix[16]);

  // Runs what is due and draws. False if the frame was refused (NaN in a joint, negative time); nothing has changed
  // then.
  bool Update(const GarmentFrame& frame, std::string* error);

  // The velocity of the air from now on, in units a second along the engine's axes. False above 100 m/s; the wind
  // before stays. Models that were trained without wind ignore it.
  bool SetWind(const float wind[3], std::string* error);

  // Before the frame in which the character is moved without motion (a portal): the cloth hangs as before.
  void Jump() { jumped_ = true; }
  // Before a cut, a spawn, another costume: forgets all motion.
  void Reset();

  const GarmentModel& model() const { return *model_; }
  dcloth_cloth* cloth() { return cloth_; }  // for calls that are not here: save, restore, describe
  size_t joint_count() const { return matrices_.size() / 16; }
  // How it fits; struct_size is 0 with Match::kNames.
  const dcloth_fit& fit() const { return fit_; }
  // Of the last frame drawn: [vertex_count, 3] each.
  const std::vector<float>& positions() const { return positions_; }
  const std::vector<float>& normals() const { return normals_; }
  // [6] least x, y, z, then greatest.
  const float* bounds() const { return bounds_; }

 private:
  Garment(std::shared_ptr<const GarmentModel> model, size_t joint_count);
  dcloth_status Wear(const Wearer& wearer, Match match, dcloth_error* error);

  std::shared_ptr<const GarmentModel> model_;
  LentMemory memory_;
  std::unique_ptr<LentMemory> fit_memory_;
  dcloth_cloth* cloth_ = nullptr;
  dcloth_fit fit_ = {};
  std::vector<float> matrices_, positions_, normals_;
  float bounds_[6] = {};
  double origin_[3] = {};
  bool followed_ = false, jumped_ = false;
};

}  // namespace dcloth::platforms

#endif  // DCLOTH_PLATFORMS_GARMENT_GARMENT_H_
