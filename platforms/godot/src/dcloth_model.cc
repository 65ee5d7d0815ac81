#include "dcloth_model.h"

#include <godot_cpp/classes/file_access.hpp>
#include <godot_cpp/core/class_db.hpp>
#include <godot_cpp/variant/utility_functions.hpp>
#include <string>

using namespace godot;

String DClothModel::open(const PackedByteArray& bytes) {
  std::string error;
  model_ = dcloth::platforms::GarmentModel::Open(bytes.ptr(), static_cast<size_t>(bytes.size()), &error);
  emit_changed();
  return String::utf8(error.c_str());
}

String DClothModel::get_garment_name() const {
  return model_ == nullptr ? String() : String::utf8(model_->info().name);
}

int64_t DClothModel::get_vertex_count() const { return model_ == nullptr ? 0 : model_->info().vertex_count; }

PackedStringArray DClothModel::get_joint_names() const {
  PackedStringArray names;
  for (uint32_t j = 0; model_ != nullptr && j < model_->info().joint_count; ++j) {
    names.push_back(String::utf8(dcloth_model_joint_name(model_->get(), j)));
  }
  return names;
}

bool DClothModel::reads_wind() const { return model_ != nullptr && dcloth_model_reads_wind(model_->get()) != 0; }

void DClothModel::_bind_methods() {
  ClassDB::bind_method(D_METHOD("open", "bytes"), &DClothModel::open);
  ClassDB::bind_method(D_METHOD("get_garment_name"), &DClothModel::get_garment_name);
  ClassDB::bind_method(D_METHOD("get_vertex_count"), &DClothModel::get_vertex_count);
  ClassDB::bind_method(D_METHOD("get_joint_names"), &DClothModel::get_joint_names);
  ClassDB::bind_method(D_METHOD("reads_wind"), &DClothModel::reads_wind);
}

PackedStringArray DClothModelLoader::_get_recognized_extensions() const {
  PackedStringArray extensions;
  extensions.push_back("dcloth");
  return extensions;
}

bool DClothModelLoader::_handles_type(const StringName& type) const {
  return type == StringName("DClothModel") || type == StringName("Resource");
}

String DClothModelLoader::_get_resource_type(const String& path) const {
  return path.get_extension().to_lower() == "dcloth" ? "DClothModel" : "";
}

Variant DClothModelLoader::_load(const String& path, const String& original_path, bool use_sub_threads,
                                 int32_t cache_mode) const {
  const PackedByteArray bytes = FileAccess::get_file_as_bytes(path);
  if (bytes.is_empty()) return FileAccess::get_open_error() == OK ? ERR_FILE_CORRUPT : FileAccess::get_open_error();
  Ref<DClothModel> model;
  model.instantiate();
  const String error = model->open(bytes);
  if (error.is_empty()) return model;
  UtilityFunctions::push_error("dcloth: ", path, ": ", error);
  return ERR_FILE_CORRUPT;
}
