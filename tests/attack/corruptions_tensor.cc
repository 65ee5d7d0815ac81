// Faults of tensors: dtype, shape, range in the weight vector, scales.
#include "tests/attack/corruption.h"

namespace dcloth::testing {
namespace {

using M = format::ModelT;

std::vector<Corruption> TypesAndShapes() {
  static constexpr char kLinearTypes[] = "allowed: f32, f16 or i8";
  return {
      {"dtype_next_after_the_last", kSemantics, "static_stage.hidden.weights.dtype: found an unknown dtype",
       kLinearTypes, [](M* m) { m->static_stage->hidden->weights->dtype = static_cast<format::DType>(6); }},
      {"dtype_all_bits", kSemantics, "static_stage.hidden.weights.dtype: found an unknown dtype", kLinearTypes,
       [](M* m) { m->static_stage->hidden->weights->dtype = static_cast<format::DType>(255); }},
      {"dtype_of_indices_for_weights", kSemantics, "displacement.basis.weights.dtype: found u32", kLinearTypes,
       [](M* m) { m->displacement->basis->weights->dtype = format::DType_U32; }},
      {"shape_without_dimensions", kSemantics, "garment.faces.shape: ", "found 0 dimensions; allowed: 1 or 2",
       [](M* m) { m->garment->faces->shape.clear(); }},
      {"shape_of_one_for_two", kSemantics, "garment.template_positions.shape: ", "found [180]; allowed: [60, 3]",
       [](M* m) { m->garment->template_positions->shape = {180}; }},
      {"shape_of_three_for_two", kSemantics, "garment.template_positions.shape: ", "found [60, 3, 1]; allowed: [60, 3]",
       [](M* m) {
         m->garment->template_positions->shape = {60, 3, 1};
       }},
      {"shape_of_many", kSemantics, "features.mean.shape: ", "found [1, 1, 1, ...]; allowed: [49]",
       [](M* m) { m->features->mean->shape.assign(1000, 1); }},
      {"shape_transposed", kSemantics, "garment.template_positions.shape: ", "found [3, 60]; allowed: [60, 3]",
       [](M* m) {
         m->garment->template_positions->shape = {3, 60};
       }},
      // 2^16 x 2^16 and 2^31 x 2 elements are none at all in 32-bit arithmetic.
      {"shape_product_wraps", kSemantics, "static_stage.hidden.weights.shape[1]: ", "found 65536; allowed: 1 to 16384",
       [](M* m) {
         m->static_stage->hidden->weights->shape = {65536, 65536};
       }},
      {"shape_width_huge", kSemantics, "static_stage.hidden.weights.shape[1]: ",
       "found 2147483648; allowed: 1 to 16384", [](M* m) { m->static_stage->hidden->weights->shape[1] = 1u << 31; }},
      {"shape_width_zero", kSemantics, "mesh_stage.hidden.weights.shape[1]: ", "found 0; allowed: 1 to 16384",
       [](M* m) { m->mesh_stage->hidden->weights->shape[1] = 0; }},
      {"shape_rows_one_more", kSemantics, "static_stage.hidden.weights.shape: ", "found [50, 21]; allowed: [49, 21]",
       [](M* m) { m->static_stage->hidden->weights->shape[0] += 1; }},
      {"shape_columns_one_less", kSemantics, "static_stage.increments.weights.shape: ",
       "found [21, 14]; allowed: [21, 15]", [](M* m) { m->static_stage->increments->weights->shape[1] = 14; }},
      {"shape_faces_none", kSemantics, "garment.faces.shape[0]: ", "found 0; allowed: 1 to 1048576",
       [](M* m) { m->garment->faces->shape[0] = 0; }},
      {"shape_faces_many", kSemantics, "garment.faces.shape[0]: ", "found 4294967295; allowed: 1 to 1048576",
       [](M* m) { m->garment->faces->shape[0] = ~0u; }},
      {"shape_faces_more_than_stored", kSemantics, "garment.faces.offset: ", "a range within the",
       [](M* m) { m->garment->faces->shape[0] = 1u << 20; }},
      {"bias_without_padding", kSemantics, "static_stage.hidden.bias.shape: ", "found [21]; allowed: [32]",
       [](M* m) { m->static_stage->hidden->bias->shape = {21}; }},
      {"weights_i8_called_f16", kSemantics,
       "skeleton_stage.input.row_scales: ", "found scales for float weights; allowed: scales only for i8 weights",
       [](M* m) {
         format::LinearT& input = *m->skeleton_stage->input;
         input.weights->dtype = format::DType_F16;
         input.weights->offset = m->weights.size();
         m->weights.resize(m->weights.size() + 49 * 64 * 2);
       }},
  };
}

std::vector<Corruption> Ranges() {
  static constexpr char kMultiples[] = "allowed: a multiple of 64";
  return {
      {"offset_off_its_boundary", kSemantics, "features.mean.offset: ", kMultiples,
       [](M* m) { m->features->mean->offset += 4; }},
      {"offset_all_bits", kSemantics, "features.mean.offset: ", kMultiples,
       [](M* m) { m->features->mean->offset = ~uint64_t{0}; }},
      // Offset + size wraps around to a small number.
      {"offset_end_wraps", kSemantics, "features.mean.offset: found ",
       "bytes at offset 18446744073709551552; allowed: a range within the",
       [](M* m) { m->features->mean->offset = ~uint64_t{63}; }},
      {"range_inside_another", kSemantics,
       "mesh_stage.columns.offset: ", "found a range that overlaps the tensor at offset",
       [](M* m) { m->mesh_stage->columns->offset = m->static_stage->influence_weights->offset + 64; }},
      {"weights_vector_cut", kSemantics, "displacement.basis.", "a range within the",
       [](M* m) { m->weights.resize(m->weights.size() - 64); }},
      {"weights_vector_one_line", kSemantics, "garment.template_positions.offset: ",
       "allowed: a range within the 64 bytes of weights", [](M* m) { m->weights.resize(64); }},
  };
}

Corruption Scale(const char* name, const char* field, const char* reason, bool of_rows, size_t element, float value) {
  return {name, kSemantics, field, reason, [=](M* m) {
            format::LinearT& linear = of_rows ? *m->skeleton_stage->input : *m->skeleton_stage->hidden;
            *Data<float>(m, of_rows ? *linear.row_scales : *linear.column_scales, element) = value;
          }};
}

std::vector<Corruption> Scales() {
  static constexpr char kNotPositive[] = "found a scale that is not positive; allowed: positive normal numbers";
  return {
      Scale("row_scale_zero", "skeleton_stage.input.row_scales[1]: ", kNotPositive, true, 1, 0.0f),
      Scale("row_scale_negative", "skeleton_stage.input.row_scales[0]: ", kNotPositive, true, 0, -1.0f),
      Scale("row_scale_subnormal", "skeleton_stage.input.row_scales[48]: ", kNotPositive, true, 48, 1e-40f),
      Scale("column_scale_zero", "skeleton_stage.hidden.column_scales[56]: ", kNotPositive, false, 56, 0.0f),
      Scale("column_scale_minus_zero", "skeleton_stage.hidden.column_scales[5]: ", kNotPositive, false, 5, -0.0f),
      Scale("column_scale_zero_in_padding", "skeleton_stage.hidden.column_scales[63]: ", kNotPositive, false, 63, 0.0f),
      {"no_row_scales", kSemantics, "skeleton_stage.input.row_scales: ",
       "found no scales for i8 weights; allowed: scales", [](M* m) { m->skeleton_stage->input->row_scales.reset(); }},
      {"no_column_scales", kSemantics, "displacement.basis.column_scales: ",
       "found no scales for i8 weights; allowed: scales", [](M* m) { m->displacement->basis->column_scales.reset(); }},
      {"column_scales_without_padding", kSemantics, "skeleton_stage.hidden.column_scales.shape: ",
       "found [57]; allowed: [64]", [](M* m) { m->skeleton_stage->hidden->column_scales->shape = {57}; }},
      {"scales_beside_floats", kSemantics,
       "static_stage.hidden.row_scales: ", "found scales for float weights; allowed: scales only for i8 weights",
       [](M* m) { m->static_stage->hidden->row_scales = Copy(*m->features->mean); }, nullptr, format::DType_F32},
  };
}

}  // namespace

std::vector<Corruption> TensorCorruptions() {
  std::vector<Corruption> all = TypesAndShapes();
  for (const auto& more : {Ranges(), Scales()}) all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace dcloth::testing
