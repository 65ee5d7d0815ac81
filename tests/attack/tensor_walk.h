// Every tensor of a model's tables, and every field that the schema knows, for attacks that concern them all.
#ifndef DCLOTH_TESTS_ATTACK_TENSOR_WALK_H_
#define DCLOTH_TESTS_ATTACK_TENSOR_WALK_H_

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "tests/unit/engine/model_builder.h"

namespace dcloth::testing {

inline size_t ElementBytes(format::DType dtype) {
  switch (dtype) {
    case format::DType_F32:
    case format::DType_U32:
      return 4;
    case format::DType_F16:
    case format::DType_U16:
      return 2;
    default:
      return 1;
  }
}

// Of any tensor but a linear layer's weights, whose rows and columns are padded.
inline size_t StoredElements(const format::TensorT& tensor) {
  size_t count = 1;
  for (const uint32_t side : tensor.shape) count *= side;
  return count;
}

class TensorWalk {
 public:
  explicit TensorWalk(format::ModelT* m) {
    Add(m->garment->template_positions, m->garment->faces, m->garment->coarse_vertices, m->garment->coarse_faces,
        m->garment->texture_coordinates, m->garment->seam_vertices, m->garment->textured_faces,
        m->character->inverse_bind);
    Add(m->features->mean, m->features->inverse_deviation, m->features->low, m->features->high);
    Add(m->static_stage->pivots, m->static_stage->influence_bones, m->static_stage->influence_weights);
    AddLinear(m->static_stage->hidden, m->static_stage->increments);
    if (m->skeleton_stage) AddLinear(m->skeleton_stage->input, m->skeleton_stage->hidden);
    if (m->mesh_stage) AddMesh(m->mesh_stage.get());
    if (m->patch_stage) AddPatches(m->patch_stage.get());
    if (m->displacement) AddLinear(m->displacement->basis, m->displacement->head);
    if (m->body) {
      Add(m->body->positions, m->body->joints, m->body->weights, m->body->faces, m->body->row_starts, m->body->columns,
          m->body->touch_classes, m->body->touched_by, m->body->garment_order, m->body->sites);
    }
  }

  const std::vector<format::TensorT*>& tensors() const { return tensors_; }
  const std::vector<format::LinearT*>& linears() const { return linears_; }

  // A linear layer's stored bytes, padding included: all up to the next tensor.
  size_t StoredBytes(const format::LinearT& linear, size_t weights_size) const {
    size_t end = weights_size;
    for (const format::TensorT* other : tensors_) {
      if (other->offset > linear.weights->offset) end = std::min(end, static_cast<size_t>(other->offset));
    }
    return end - static_cast<size_t>(linear.weights->offset);
  }

 private:
  template <typename... Tensors>
  void Add(const Tensors&... tensors) {
    for (format::TensorT* tensor : {tensors.get()...}) {
      if (tensor != nullptr) tensors_.push_back(tensor);
    }
  }
  template <typename... Linears>
  void AddLinear(const Linears&... linears) {
    for (format::LinearT* linear : {linears.get()...}) {
      if (linear == nullptr) continue;
      linears_.push_back(linear);
      Add(linear->weights, linear->row_scales, linear->column_scales, linear->bias);
    }
  }
  void AddMesh(format::MeshStageT* mesh) {
    Add(mesh->body_points, mesh->body_joints, mesh->body_weights, mesh->input_mean, mesh->input_inverse_deviation,
        mesh->row_starts, mesh->columns, mesh->embed);
    for (const auto& layer : mesh->layers) {
      Add(layer->input_gates, layer->gate_bias, layer->hidden_gates, layer->hidden_candidate, layer->output,
          layer->output_bias, layer->norm_gain, layer->norm_offset, layer->weights, layer->column_scales,
          layer->input_inverse_steps);
    }
    AddLinear(mesh->hidden, mesh->coefficients);
  }
  void AddPatches(format::PatchStageT* stage) {
    Add(stage->joints, stage->axes, stage->centres, stage->point_joints, stage->point_parts, stage->capsule_joints,
        stage->capsules, stage->limbs, stage->near, stage->embedding, stage->keep, stage->sources, stage->vertices,
        stage->group_starts);
    for (const auto& mix : stage->mix) AddLinear(mix);
    AddLinear(stage->enter, stage->input_gates, stage->hidden_gates, stage->out, stage->map);
  }

  std::vector<format::TensorT*> tensors_;
  std::vector<format::LinearT*> linears_;
};

// Integers in a file, as they lie there.
struct IndexArray {
  std::string path;
  uint8_t* data;
  size_t count;
  size_t width_bytes;

  uint32_t at(size_t i) const {
    uint32_t value = 0;
    std::memcpy(&value, data + i * width_bytes, width_bytes);
    return value;
  }
  void Put(size_t i, uint32_t value) { std::memcpy(data + i * width_bytes, &value, width_bytes); }
};

// All tensors and all vectors of integers that the schema allows, and those that a file has.
class FieldWalk {
 public:
  explicit FieldWalk(AlignedBytes* file)
      : weights_(const_cast<uint8_t*>(format::GetModel(file->data())->weights()->Data())) {
    Visit(*format::ModelTypeTable(), flatbuffers::GetRoot<flatbuffers::Table>(file->data()), "");
  }

  const std::set<std::string>& allowed() const { return allowed_; }
  const std::set<std::string>& present() const { return present_; }
  std::vector<IndexArray>& arrays() { return arrays_; }
  // Of each tensor, by its offset; "mesh_stage.layers.output" is one of any layer.
  const std::map<uint64_t, std::string>& names() const { return names_; }

 private:
  // `table` is null where the file has none.
  void Visit(const flatbuffers::TypeTable& type, const flatbuffers::Table* table, const std::string& parent) {
    for (size_t i = 0; i < type.num_elems; ++i) {
      const flatbuffers::TypeCode code = type.type_codes[i];
      const auto field = flatbuffers::FieldIndexToOffset(static_cast<flatbuffers::voffset_t>(i));
      const std::string path = parent + type.names[i];
      const bool there = table != nullptr && table->CheckField(field);
      if (code.base_type == flatbuffers::ET_SEQUENCE && code.sequence_ref >= 0) {
        const flatbuffers::TypeTable& child = *type.type_refs[code.sequence_ref]();
        if (&child == format::TensorTypeTable()) {
          Note(path, there);
          if (there) AddTensor(path, *table->GetPointer<const format::Tensor*>(field));
        } else if (code.is_repeating == 0) {
          Visit(child, there ? table->GetPointer<const flatbuffers::Table*>(field) : nullptr, path + ".");
        } else {
          Visit(child, nullptr, path + ".");
          const auto* tables =
              there ? table->GetPointer<const flatbuffers::Vector<flatbuffers::Offset<flatbuffers::Table>>*>(field)
                    : nullptr;
          for (uint32_t k = 0; tables != nullptr && k < tables->size(); ++k) Visit(child, tables->Get(k), path + ".");
        }
      } else if (code.is_repeating != 0 && code.base_type != flatbuffers::ET_STRING && path != "weights") {
        Note(path, there);
        ASSERT_EQ(code.base_type, flatbuffers::ET_USHORT) << path << ": say here how wide its integers are";
        if (!there) continue;
        auto* vector =
            const_cast<flatbuffers::Vector<uint16_t>*>(table->GetPointer<const flatbuffers::Vector<uint16_t>*>(field));
        arrays_.push_back({path, vector->Data(), vector->size(), 2});
      }
    }
  }
  void Note(const std::string& path, bool there) {
    allowed_.insert(path);
    if (there) present_.insert(path);
  }
  void AddTensor(const std::string& path, const format::Tensor& tensor) {
    names_[tensor.offset()] = path;
    const format::DType dtype = tensor.dtype();
    if (dtype != format::DType_U8 && dtype != format::DType_U16 && dtype != format::DType_U32) return;
    size_t count = 1;
    for (const uint32_t side : *tensor.shape()) count *= side;
    arrays_.push_back({path, weights_ + tensor.offset(), count,
                       size_t{dtype == format::DType_U8    ? 1u
                              : dtype == format::DType_U16 ? 2u
                                                           : 4u}});
  }

  uint8_t* weights_;
  std::set<std::string> allowed_, present_;
  std::vector<IndexArray> arrays_;
  std::map<uint64_t, std::string> names_;
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_ATTACK_TENSOR_WALK_H_
