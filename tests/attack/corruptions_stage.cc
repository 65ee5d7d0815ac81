// Faults of the stages: indices, skin weights, the mesh graph's rows, layers, stages missing or that do not
// fit.
#include "tests/attack/corruption.h"

namespace dcloth::testing {
namespace {

using M = format::ModelT;

std::vector<Corruption> IndicesAndWeights() {
  static constexpr char kJoint[] = "allowed: an index into character.joint_names";
  static constexpr char kRow[] =
      "found a row with a negative weight, or with a sum other than 1; allowed: weights of 0 or more whose sum is 1 "
      "within 1e-4";
  return {
      {"face_index_one_past", kSemantics, "garment.faces[5]: ", "found 60; allowed: indices below 60",
       [](M* m) { *Data<uint16_t>(m, *m->garment->faces, 5) = 60; }},
      {"bone_all_bits", kSemantics, "static_stage.bones[0]: found 65535", kJoint,
       [](M* m) { m->static_stage->bones[0] = 65535; }},
      {"bones_none", kSemantics, "static_stage.bones.length: ", "found 0; allowed: 1 to 256",
       [](M* m) { m->static_stage->bones.clear(); }},
      {"bones_many", kSemantics, "static_stage.bones.length: ", "found 257; allowed: 1 to 256",
       [](M* m) { m->static_stage->bones.assign(257, 0); }},
      {"bone_one_more", kSemantics, "static_stage.pivots.shape: ", "found [5, 3]; allowed: [6, 3]",
       [](M* m) { m->static_stage->bones.push_back(0); }},
      {"influences_zero", kSemantics, "static_stage.influences: ", "found 0; allowed: 1 to 8",
       [](M* m) { m->static_stage->influences = 0; }},
      {"influences_nine", kSemantics, "static_stage.influences: ", "found 9; allowed: 1 to 8",
       [](M* m) { m->static_stage->influences = 9; }},
      {"influences_other_than_stored", kSemantics, "static_stage.influence_bones.shape: ",
       "found [60, 4]; allowed: [60, 5]", [](M* m) { m->static_stage->influences = 5; }},
      {"influence_bone_one_past", kSemantics, "static_stage.influence_bones[11]: ", "found 5; allowed: indices below 5",
       [](M* m) { *Data<uint8_t>(m, *m->static_stage->influence_bones, 11) = 5; }},
      {"influence_weight_negative", kSemantics, "static_stage.influence_weights[0]: ", kRow,
       [](M* m) { *Data<float>(m, *m->static_stage->influence_weights) = -0.1f; }},
      {"influence_weights_sum", kSemantics, "static_stage.influence_weights[2]: ", kRow,
       [](M* m) { *Data<float>(m, *m->static_stage->influence_weights, 9) += 0.01f; }},
      {"body_influences_zero", kSemantics, "mesh_stage.body_influences: ", "found 0; allowed: 1 to 8",
       [](M* m) { m->mesh_stage->body_influences = 0; }},
      {"body_influences_all_bits", kSemantics, "mesh_stage.body_influences: ", "found 255; allowed: 1 to 8",
       [](M* m) { m->mesh_stage->body_influences = 255; }},
      {.name = "body_influences_nine_of_a_reduced_basis",
       .status = kSemantics,
       .field = "mesh_stage.body_influences: ",
       .reason = "found 9; allowed: 1 to 8",
       .tables = [](M* m) { m->mesh_stage->body_influences = 9; },
       .rank = 12},
      {"body_joint_one_past", kSemantics, "mesh_stage.body_joints[0]: ", "found 9; allowed: indices below 9",
       [](M* m) { *Data<uint8_t>(m, *m->mesh_stage->body_joints) = 9; }},
      {"body_weights_zero", kSemantics, "mesh_stage.body_weights[1]: ", kRow,
       [](M* m) {
         for (size_t k = 3; k < 6; ++k) *Data<float>(m, *m->mesh_stage->body_weights, k) = 0;
       }},
  };
}

std::vector<Corruption> GraphRows() {
  static constexpr char kRising[] =
      "found a row start that is not above the one before it; allowed: increasing row starts";
  return {
      {"rows_begin_late", kSemantics,
       "mesh_stage.row_starts[0]: ", "found a first row that does not start at 0; allowed: 0",
       [](M* m) { *Data<uint32_t>(m, *m->mesh_stage->row_starts) = 1; }},
      {"row_empty", kSemantics, "mesh_stage.row_starts[10]: ", kRising,
       [](M* m) {
         uint32_t* starts = Data<uint32_t>(m, *m->mesh_stage->row_starts);
         starts[10] = starts[9];
       }},
      {"rows_fall", kSemantics, "mesh_stage.row_starts[9]: ", kRising,
       [](M* m) { *Data<uint32_t>(m, *m->mesh_stage->row_starts, 9) = 2; }},
      {"row_end_all_bits", kSemantics, "mesh_stage.row_starts[60]: ", "found 4294967295; allowed: 60 to 16777216",
       [](M* m) { *Data<uint32_t>(m, *m->mesh_stage->row_starts, 60) = ~0u; }},
      {"row_start_huge", kSemantics, "mesh_stage.row_starts[31]: ", kRising,
       [](M* m) { *Data<uint32_t>(m, *m->mesh_stage->row_starts, 30) = 0x80000000u; }},
      {"row_end_one_more", kSemantics, "mesh_stage.columns.shape: ", "allowed: [",
       [](M* m) { *Data<uint32_t>(m, *m->mesh_stage->row_starts, 60) += 1; }},
      {"row_end_one_less", kSemantics, "mesh_stage.columns.shape: ", "allowed: [",
       [](M* m) { *Data<uint32_t>(m, *m->mesh_stage->row_starts, 60) -= 1; }},
      {"column_one_past", kSemantics, "mesh_stage.columns[3]: ", "found 60; allowed: indices below 60",
       [](M* m) { *Data<uint16_t>(m, *m->mesh_stage->columns, 3) = 60; }},
  };
}

std::vector<Corruption> Layers() {
  return {
      {"feature_width_zero", kSemantics, "mesh_stage.feature_width: ", "found 0; allowed: 8 to 64",
       [](M* m) { m->mesh_stage->feature_width = 0; }},
      {"feature_width_odd", kSemantics, "mesh_stage.feature_width: ", "found 12; allowed: a multiple of 8",
       [](M* m) { m->mesh_stage->feature_width = 12; }},
      {"feature_width_wide", kSemantics, "mesh_stage.feature_width: ", "found 72; allowed: 8 to 64",
       [](M* m) { m->mesh_stage->feature_width = 72; }},
      {"feature_width_other_than_stored", kSemantics, "mesh_stage.layers[0].input_gates.shape: ",
       "found [3, 48]; allowed: [3, 24]", [](M* m) { m->mesh_stage->feature_width = 8; }},
      {"layers_none", kSemantics, "mesh_stage.layers.length: ", "found 0; allowed: 1 to 8",
       [](M* m) { m->mesh_stage->layers.clear(); }},
      {"layers_nine", kSemantics, "mesh_stage.layers.length: ", "found 9; allowed: 1 to 8",
       [](M* m) {
         while (m->mesh_stage->layers.size() < 9) m->mesh_stage->layers.push_back(Copy(*m->mesh_stage->layers[1]));
       }},
      {"layer_copied", kSemantics,
       "mesh_stage.layers[3].input_gates.offset: ", "found a range that overlaps the tensor at offset",
       [](M* m) { m->mesh_stage->layers.push_back(Copy(*m->mesh_stage->layers[1])); }},
      {"layers_swapped", kSemantics, "mesh_stage.layers[0].input_gates.shape: ", "found [16, 48]; allowed: [3, 48]",
       [](M* m) { std::swap(m->mesh_stage->layers[0], m->mesh_stage->layers[1]); }},
      {"layer_without_output", kSemantics, "mesh_stage.layers[1].output: ",
       "found no weights; allowed: f32 weights here, or i8 weights for the whole layer",
       [](M* m) { m->mesh_stage->layers[1]->output.reset(); }},
      {"layer_scales_beside_floats", kSemantics, "mesh_stage.layers[1].column_scales: ",
       "found scales in a layer with float weights; allowed: scales only with i8 weights",
       [](M* m) { m->mesh_stage->layers[1]->column_scales = Copy(*m->mesh_stage->layers[1]->norm_gain); }},
      {"slope_infinite", kSemantics, "mesh_stage.layers[0].prelu_slope: ", "found infinity; allowed: a finite number",
       [](M* m) { m->mesh_stage->layers[0]->prelu_slope = kInfinity; }},
      {"embed_bias_nan", kSemantics, "mesh_stage.embed_bias: ", "found NaN; allowed: a finite number",
       [](M* m) { m->mesh_stage->embed_bias = kNaN; }},
  };
}

std::vector<Corruption> StagesThatDoNotFit() {
  return {
      {"mesh_stage_alone", kSemantics, "mesh_stage: ",
       "found a mesh stage without a skeleton stage; allowed: both stages", [](M* m) { m->skeleton_stage.reset(); }},
      {"skeleton_stage_missing", kSemantics, "displacement.skeleton_rows: ", "found 20; allowed: 0",
       [](M* m) {
         m->skeleton_stage.reset();
         m->mesh_stage.reset();
       }},
      {"mesh_stage_missing", kSemantics, "displacement.mesh_rows: ", "found 14; allowed: 0",
       [](M* m) { m->mesh_stage.reset(); }},
      {"displacement_missing", kSemantics, "displacement.skeleton_rows: ", "found 0; allowed: 20",
       [](M* m) { m->displacement.reset(); }},
      {"basis_missing", kSemantics, "displacement.basis: ", "found no basis for the skeleton stage; allowed: a basis",
       [](M* m) { m->displacement->basis.reset(); }},
      {"basis_with_bias", kSemantics, "displacement.basis.bias: ", "found a bias; allowed: no bias in the basis",
       [](M* m) { m->displacement->basis->bias = Copy(*m->features->mean); }},
      {"basis_rows_not_even", kSemantics, "displacement.skeleton_rows: ", "found 19; allowed: 20",
       [](M* m) { m->displacement->skeleton_rows = 19; }},
      {"basis_mesh_rows_all_bits", kSemantics, "displacement.mesh_rows: ", "found 4294967295; allowed: 14",
       [](M* m) { m->displacement->mesh_rows = ~0u; }},
      {"basis_without_stages", kSemantics,
       "displacement.basis: ", "found a basis without a skeleton stage; allowed: a skeleton stage, or no basis",
       [](M* m) {
         m->displacement = std::make_unique<format::DisplacementT>();
         m->displacement->basis = std::make_unique<format::LinearT>();
         m->displacement->basis->weights = Copy(*m->features->mean);
       },
       nullptr, format::DType_F32, DCLOTH_STAGES_STATIC},
      {"gru_empty", kSemantics, "skeleton_stage.hidden.weights.shape[0]: ", "found 0; allowed: 1 to 4096",
       [](M* m) { m->skeleton_stage->hidden->weights->shape[0] = 0; }},
      {"gru_units_huge", kSemantics, "skeleton_stage.hidden.weights.shape[0]: ", "found 4097; allowed: 1 to 4096",
       [](M* m) { m->skeleton_stage->hidden->weights->shape[0] = 4097; }},
      {"gru_two_gates", kSemantics, "skeleton_stage.hidden.weights.shape: ", "found [19, 38]; allowed: [19, 57]",
       [](M* m) { m->skeleton_stage->hidden->weights->shape[1] = 38; }},
      {"gru_two_gates_without_a_basis", kSemantics,
       "skeleton_stage.hidden.weights.shape: ", "found [19, 38]; allowed: [19, 57]",
       [](M* m) {
         m->skeleton_stage->hidden->weights->shape[1] = 38;
         m->displacement.reset();
         m->mesh_stage.reset();
       }},
      {"gru_of_another_pose", kSemantics, "skeleton_stage.input.weights.shape: ", "found [45, 57]; allowed: [49, 57]",
       [](M* m) { m->skeleton_stage->input->weights->shape[0] = 45; }},
      {"vertex_network_of_another_mesh", kSemantics, "mesh_stage.hidden.weights.shape: ",
       "found [61, 37]; allowed: [60, 37]", [](M* m) { m->mesh_stage->hidden->weights->shape[0] = 61; }},
      {"coefficients_of_another_width", kSemantics, "mesh_stage.coefficients.weights.shape: ",
       "found [38, 13]; allowed: [37, 13]", [](M* m) { m->mesh_stage->coefficients->weights->shape[0] = 38; }},
      {"coefficients_many", kSemantics, "mesh_stage.coefficients.weights.shape[1]: ", "found 4097; allowed: 1 to 4096",
       [](M* m) { m->mesh_stage->coefficients->weights->shape[1] = 4097; }},
  };
}

std::vector<Corruption> IntegerLayers() {
  using L = format::MeshLayerT;
  const auto spoil = [](const char* name, const char* field, const char* reason, size_t layer, void (*change)(M*, L*)) {
    return Corruption{name,
                      kSemantics,
                      field,
                      reason,
                      [=](M* m) { change(m, m->mesh_stage->layers[layer].get()); },
                      nullptr,
                      format::DType_I8,
                      DCLOTH_STAGES_MESH,
                      true};
  };
  return {
      spoil("integers_beside_floats", "mesh_stage.layers[1].output: ",
            "found float weights in a layer with i8 weights; allowed: one kind of weights", 1,
            [](M*, L* layer) { layer->output = Copy(*layer->weights); }),
      spoil("integers_of_first_layer_without_its_floats", "mesh_stage.layers[0].input_gates: ", "found no weights", 0,
            [](M*, L* layer) { layer->input_gates.reset(); }),
      spoil("integer_lowest", "mesh_stage.layers[2].weights[5]: ", "found -128; allowed: -127 to 127", 2,
            [](M* m, L* layer) { *Data<int8_t>(m, *layer->weights, 5) = -128; }),
      spoil("integer_scales_missing", "mesh_stage.layers[1].column_scales: ", "found no scales", 1,
            [](M*, L* layer) { layer->column_scales.reset(); }),
      spoil("integer_scale_zero", "mesh_stage.layers[1].column_scales[7]: ", "found a scale that is not positive", 1,
            [](M* m, L* layer) { *Data<float>(m, *layer->column_scales, 7) = 0; }),
      spoil("integer_steps_missing", "mesh_stage.layers[1].input_inverse_steps: ", "found no scales", 1,
            [](M*, L* layer) { layer->input_inverse_steps.reset(); }),
      spoil("integer_steps_of_first_layer",
            "mesh_stage.layers[0].input_inverse_steps: ", "found steps in the first layer; allowed: none", 0,
            [](M*, L* layer) { layer->input_inverse_steps = Copy(*layer->norm_gain); }),
      spoil("integers_overlap",
            "mesh_stage.layers[2].weights.offset: ", "found a range that overlaps the tensor at offset", 2,
            [](M* m, L* layer) { layer->weights->offset = m->mesh_stage->layers[1]->weights->offset; }),
  };
}

using SpoilGarment = std::function<void(M*, format::GarmentT*)>;

// Of a model with a part that not every garment has: Corruption::coarse or ::texture.
Corruption SpoiltGarment(bool Corruption::*part, const char* name, const char* field, const char* reason,
                         const SpoilGarment& how) {
  Corruption corruption{name, kSemantics, field, reason, [how](M* m) { how(m, m->garment.get()); }};
  corruption.*part = true;
  return corruption;
}

// Of every second of 60 vertices.
std::vector<Corruption> CoarseMesh() {
  using G = format::GarmentT;
  const auto spoil = [](const char* name, const char* field, const char* reason, const SpoilGarment& how) {
    return SpoiltGarment(&Corruption::coarse, name, field, reason, how);
  };
  return {
      spoil("coarse_vertex_beyond", "garment.coarse_vertices[29]: ", "found 60; allowed: indices below 60",
            [](M* m, G* g) { *Data<uint16_t>(m, *g->coarse_vertices, 29) = 60; }),
      spoil("coarse_vertex_twice", "garment.coarse_vertices[7]: ", "found an index that does not rise",
            [](M* m, G* g) { *Data<uint16_t>(m, *g->coarse_vertices, 7) = 12; }),
      spoil("coarse_vertices_two", "garment.coarse_vertices.shape[0]: ", "found 2; allowed: 3 to 60",
            [](M*, G* g) { g->coarse_vertices->shape[0] = 2; }),
      spoil("coarse_vertices_alone", "garment.coarse_faces: ", "allowed: both coarse_vertices and coarse_faces",
            [](M*, G* g) { g->coarse_faces.reset(); }),
      spoil("coarse_faces_alone", "garment.coarse_vertices: ", "allowed: both coarse_vertices and coarse_faces",
            [](M*, G* g) { g->coarse_vertices.reset(); }),
      // Below the garment's vertices, not below the coarse mesh's.
      spoil("coarse_face_beyond", "garment.coarse_faces[83]: ", "found 30; allowed: indices below 30",
            [](M* m, G* g) { *Data<uint16_t>(m, *g->coarse_faces, 83) = 30; }),
      spoil("coarse_faces_none", "garment.coarse_faces.shape[0]: ", "found 0; allowed: 1 to 1048576",
            [](M*, G* g) { g->coarse_faces->shape[0] = 0; }),
  };
}

// 60 vertices, the six of the seam once more.
std::vector<Corruption> Texture() {
  using G = format::GarmentT;
  const auto spoil = [](const char* name, const char* field, const char* reason, const SpoilGarment& how) {
    return SpoiltGarment(&Corruption::texture, name, field, reason, how);
  };
  static constexpr char kAll[] = "allowed: texture_coordinates, and both seam_vertices and textured_faces or neither";
  return {
      spoil("texture_short", "garment.texture_coordinates.shape: ", "found [65, 2]; allowed: [66, 2]",
            [](M*, G* g) { g->texture_coordinates->shape[0] = 65; }),
      spoil("texture_without_coordinates", "garment.texture_coordinates: ", kAll,
            [](M*, G* g) { g->texture_coordinates.reset(); }),
      spoil("texture_without_seam", "garment.seam_vertices: ", kAll, [](M*, G* g) { g->seam_vertices.reset(); }),
      spoil("texture_without_faces", "garment.textured_faces: ", kAll, [](M*, G* g) { g->textured_faces.reset(); }),
      spoil("seam_beyond", "garment.seam_vertices[5]: ", "found 60; allowed: indices below 60",
            [](M* m, G* g) { *Data<uint16_t>(m, *g->seam_vertices, 5) = 60; }),
      spoil("seam_none", "garment.seam_vertices.shape[0]: ", "found 0; allowed: 1 to 65475",
            [](M*, G* g) { g->seam_vertices->shape[0] = 0; }),
      spoil("seam_too_long", "garment.seam_vertices.shape[0]: ", "found 65476; allowed: 1 to 65475",
            [](M*, G* g) { g->seam_vertices->shape[0] = 65476; }),
      spoil("textured_face_beyond", "garment.textured_faces[299]: ", "found 66; allowed: indices below 66",
            [](M* m, G* g) { *Data<uint16_t>(m, *g->textured_faces, 299) = 66; }),
  };
}

}  // namespace

std::vector<Corruption> StageCorruptions() {
  std::vector<Corruption> all = IndicesAndWeights();
  for (const auto& more : {GraphRows(), Layers(), IntegerLayers(), CoarseMesh(), Texture(), StagesThatDoNotFit()})
    all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace dcloth::testing
