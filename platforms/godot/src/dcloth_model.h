// A .dcloth file as a resource of Godot, and what loads it.
#ifndef DCLOTH_PLATFORMS_GODOT_SRC_DCLOTH_MODEL_H_
#define DCLOTH_PLATFORMS_GODOT_SRC_DCLOTH_MODEL_H_

#include <godot_cpp/classes/resource.hpp>
#include <godot_cpp/classes/resource_format_loader.hpp>
#include <memory>

#include "garment/garment.h"

// Functions that the engine calls have its names.
class DClothModel : public godot::Resource {
  GDCLASS(DClothModel, godot::Resource)

 public:
  // Null where the file was refused.
  const std::shared_ptr<const dcloth::platforms::GarmentModel>& model() const { return model_; }
  // Empty on success, else why the bytes were refused.
  godot::String open(const godot::PackedByteArray& bytes);

  godot::String get_garment_name() const;
  int64_t get_vertex_count() const;
  godot::PackedStringArray get_joint_names() const;
  bool reads_wind() const;

 protected:
  static void _bind_methods();

 private:
  std::shared_ptr<const dcloth::platforms::GarmentModel> model_;
};

class DClothModelLoader : public godot::ResourceFormatLoader {
  GDCLASS(DClothModelLoader, godot::ResourceFormatLoader)

 public:
  godot::PackedStringArray _get_recognized_extensions() const override;
  bool _handles_type(const godot::StringName& type) const override;
  godot::String _get_resource_type(const godot::String& path) const override;
  godot::Variant _load(const godot::String& path, const godot::String& original_path, bool use_sub_threads,
                       int32_t cache_mode) const override;

 protected:
  static void _bind_methods() {}
};

#endif  // DCLOTH_PLATFORMS_GODOT_SRC_DCLOTH_MODEL_H_
