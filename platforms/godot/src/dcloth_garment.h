// The node: a garment on the character of a Skeleton3D.
#ifndef DCLOTH_PLATFORMS_GODOT_SRC_DCLOTH_GARMENT_H_
#define DCLOTH_PLATFORMS_GODOT_SRC_DCLOTH_GARMENT_H_

#include <godot_cpp/classes/mesh_instance3d.hpp>
#include <godot_cpp/classes/skeleton3d.hpp>
#include <memory>
#include <string>
#include <vector>

#include "dcloth_model.h"
#include "garment/garment.h"

// Vertices are in the world: the node is top level and stays where its origin is. It runs after all animation of the
// frame: poses are taken when the skeleton says that they are final, or kept where it did not move.
class DClothGarment : public godot::MeshInstance3D {
  GDCLASS(DClothGarment, godot::MeshInstance3D)

 public:
  enum Fit { FIT_BODY, FIT_BONES, FIT_NAMES };
  enum Detail { DETAIL_STATIC, DETAIL_SKELETON, DETAIL_MESH };

  DClothGarment();

  void set_model(const godot::Ref<DClothModel>& model);
  godot::Ref<DClothModel> get_model() const { return model_; }
  void set_character(const godot::NodePath& path);
  godot::NodePath get_character() const { return character_; }
  void set_body(const godot::NodePath& path);
  godot::NodePath get_body() const { return body_; }
  void set_fit(Fit fit);
  Fit get_fit() const { return fit_; }
  void set_detail(Detail detail) { detail_ = detail; }
  Detail get_detail() const { return detail_; }
  void set_pipelined(bool on) { frame_.pipelined = on; }
  bool is_pipelined() const { return frame_.pipelined; }
  void set_half_rate_mesh(bool on) { frame_.half_rate_mesh = on; }
  bool is_half_rate_mesh() const { return frame_.half_rate_mesh; }
  void set_freeze_idle(bool on) { frame_.freeze_idle = on; }
  bool is_freeze_idle() const { return frame_.freeze_idle; }
  void set_outside_body(bool on) { frame_.outside_body = on; }
  bool is_outside_body() const { return frame_.outside_body; }
  void set_wind(const godot::Vector3& wind);
  godot::Vector3 get_wind() const { return wind_; }

  void jump();
  void reset();
  bool is_dressed() const { return garment_ != nullptr; }
  godot::String get_error() const { return godot::String::utf8(error_.c_str()); }
  // scale, warnings (bits of DCLOTH_FIT_*), gap_mm, penetration_mm, waist_ratio, hips_ratio; empty without a fit.
  godot::Dictionary get_fit_report() const;

 protected:
  static void _bind_methods();
  void _notification(int what);

 private:
  using Garment = dcloth::platforms::Garment;

  void Undress();  // the next frame tries again
  void Dress();
  void Prepare();  // the mesh that is drawn
  void TakePose();
  void Step(double seconds);
  void Upload();
  void Refuse(const std::string& error);
  godot::Skeleton3D* Character() const;

  godot::Ref<DClothModel> model_;
  godot::NodePath character_, body_;
  Fit fit_ = FIT_BODY;
  Detail detail_ = DETAIL_MESH;
  godot::Vector3 wind_;
  dcloth::platforms::GarmentFrame frame_;

  std::unique_ptr<Garment> garment_;
  uint64_t skeleton_id_ = 0;
  std::vector<godot::Transform3D> pose_;  // bone to skeleton
  godot::PackedByteArray vertices_;       // as the rendering server keeps them
  int64_t position_stride_ = 0, normal_offset_ = 0, normal_stride_ = 0;
  std::string error_;
  bool refused_ = false;
};

VARIANT_ENUM_CAST(DClothGarment::Fit);
VARIANT_ENUM_CAST(DClothGarment::Detail);

#endif  // DCLOTH_PLATFORMS_GODOT_SRC_DCLOTH_GARMENT_H_
