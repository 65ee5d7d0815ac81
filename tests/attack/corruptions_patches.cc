// Faults of the patch stage: sizes, places, layers, groups, other stages beside it.
#include "tests/attack/corruption.h"

namespace dcloth::testing {
namespace {

using M = format::ModelT;
using P = format::PatchStageT;

// Of four patches of three points on 60 vertices and 9 joints: twelve groups, 93 inputs, 24 wide.
Corruption Fault(const char* name, const char* field, const char* reason, const std::function<void(M*, P*)>& spoil,
                 format::DType precision = format::DType_I8) {
  return {.name = name,
          .status = kSemantics,
          .field = field,
          .reason = reason,
          .tables = [=](M* m) { spoil(m, m->patch_stage.get()); },
          .precision = precision,
          .patches = 4};
}

std::vector<Corruption> SizeFaults() {
  return {
      Fault("patch_count_none", "patch_stage.patches: ", "found 0; allowed: 1 to 256",
            [](M*, P* p) { p->patches = 0; }),
      Fault("patch_count_many", "patch_stage.patches: ", "found 257; allowed: 1 to 256",
            [](M*, P* p) { p->patches = 257; }),
      Fault("patch_points_none", "patch_stage.points: ", "found 0; allowed: 1 to 16", [](M*, P* p) { p->points = 0; }),
      Fault("patch_points_many", "patch_stage.points: ", "found 17; allowed: 1 to 16",
            [](M*, P* p) { p->points = 17; }),
      Fault("patch_width_none", "patch_stage.width: ", "found 0; allowed: 8 to 256", [](M*, P* p) { p->width = 0; }),
      Fault("patch_width_many", "patch_stage.width: ", "found 264; allowed: 8 to 256",
            [](M*, P* p) { p->width = 264; }),
      Fault("patch_width_odd", "patch_stage.width: ", "found 20; allowed: a multiple of 8",
            [](M*, P* p) { p->width = 20; }),
      Fault("patch_neighbours_many", "patch_stage.neighbours: ", "found 5; allowed: 0 to 4",
            [](M*, P* p) { p->neighbours = 5; }),
      Fault("patch_mix_none", "patch_stage.mix.length: ", "found 0; allowed: 1 to 8", [](M*, P* p) { p->mix.clear(); }),
      Fault("patch_mix_many", "patch_stage.mix.length: ", "found 9; allowed: 1 to 8",
            [](M*, P* p) {
              while (p->mix.size() < 9) p->mix.push_back(std::make_unique<format::LinearT>(*p->mix[0]));
            }),
      Fault("patch_other_patches", "patch_stage.joints.shape: ", "found [4]; allowed: [5]",
            [](M*, P* p) { p->patches = 5; }),
      Fault("patch_other_points", "patch_stage.point_joints.shape: ", "found [12, 4]; allowed: [8, 4]",
            [](M*, P* p) { p->points = 2; }),
      Fault("patch_other_width", "patch_stage.enter.weights.shape: ", "found [93, 24]; allowed: [93, 16]",
            [](M*, P* p) { p->width = 16; }),
      Fault("patch_other_neighbours", "patch_stage.near.shape: ", "found [4, 4]; allowed: [6, 4]",
            [](M*, P* p) { p->neighbours = 3; }),
      Fault("patch_mix_one_less", "patch_stage.near.shape: ", "found [4, 4]; allowed: [2, 4]",
            [](M*, P* p) { p->mix.pop_back(); }),
      Fault("patch_capsules_none", "patch_stage.capsule_joints.shape[0]: ", "found 0; allowed: 1 to 32",
            [](M*, P* p) { p->capsule_joints->shape = {0}; }),
      Fault("patch_capsules_many", "patch_stage.capsule_joints.shape[0]: ", "found 33; allowed: 1 to 32",
            [](M*, P* p) { p->capsule_joints->shape = {33}; }),
      Fault("patch_embedding_none", "patch_stage.embedding.shape[1]: ", "found 0; allowed: 1 to 32",
            [](M*, P* p) { p->embedding->shape[1] = 0; }),
      Fault("patch_embedding_many", "patch_stage.embedding.shape[1]: ", "found 33; allowed: 1 to 32",
            [](M*, P* p) { p->embedding->shape[1] = 33; }),
      Fault("patch_embedding_dropped", "patch_stage.enter.weights.shape: ", "found [93, 24]; allowed: [90, 24]",
            [](M*, P* p) { p->embedding.reset(); }),
      Fault("patch_sources_none", "patch_stage.sources.shape[1]: ", "found 0; allowed: 2 to 32",
            [](M*, P* p) { p->sources->shape[1] = 0; }),
      Fault("patch_sources_many", "patch_stage.sources.shape[1]: ", "found 34; allowed: 2 to 32",
            [](M*, P* p) { p->sources->shape[1] = 34; }),
      Fault("patch_sources_odd", "patch_stage.sources: ", "found 3 points; allowed: an even number of points",
            [](M*, P* p) { p->sources->shape[1] = 3; }),
      Fault("patch_sources_other", "patch_stage.map.weights.shape: ", "found [12, 384]; allowed: [6, 384]",
            [](M*, P* p) { p->sources->shape[1] = 2; }),
  };
}

std::vector<Corruption> PlaceFaults() {
  static constexpr char kJoint[] = "found 9; allowed: indices below 9";
  return {
      Fault("patch_joint_past", "patch_stage.joints[3]: ", kJoint,
            [](M* m, P* p) { *Data<uint8_t>(m, *p->joints, 3) = 9; }),
      Fault("patch_axis_nan", "patch_stage.axes[35]: ", "found NaN",
            [](M* m, P* p) { *Data<float>(m, *p->axes, 35) = kNaN; }),
      Fault("patch_axes_narrow", "patch_stage.axes.shape: ", "found [4, 8]; allowed: [4, 9]",
            [](M*, P* p) { p->axes->shape[1] = 8; }),
      Fault("patch_centre_infinite", "patch_stage.centres[0]: ", "found infinity",
            [](M* m, P* p) { *Data<float>(m, *p->centres) = kInfinity; }),
      Fault("patch_point_joint_past", "patch_stage.point_joints[47]: ", kJoint,
            [](M* m, P* p) { *Data<uint8_t>(m, *p->point_joints, 47) = 9; }),
      Fault("patch_point_part_nan", "patch_stage.point_parts[191]: ", "found NaN",
            [](M* m, P* p) { *Data<float>(m, *p->point_parts, 191) = kNaN; }),
      Fault("patch_capsule_joint_past", "patch_stage.capsule_joints[4]: ", kJoint,
            [](M* m, P* p) { *Data<uint8_t>(m, *p->capsule_joints, 4) = 9; }),
      Fault("patch_capsule_nan", "patch_stage.capsules[39]: ", "found NaN",
            [](M* m, P* p) { *Data<float>(m, *p->capsules, 39) = kNaN; }),
      Fault("patch_limb_past", "patch_stage.limbs[15]: ", "found 5; allowed: indices below 5",
            [](M* m, P* p) { *Data<uint8_t>(m, *p->limbs, 15) = 5; }),
      Fault("patch_limbs_three_capsules", "patch_stage.limbs.shape: ", "found [4, 3]; allowed: [4, 4]",
            [](M*, P* p) { p->limbs->shape[1] = 3; }),
      Fault("patch_neighbour_past", "patch_stage.near[15]: ", "found 4; allowed: indices below 4",
            [](M* m, P* p) { *Data<uint8_t>(m, *p->near, 15) = 4; }),
      Fault("patch_neighbours_missing", "patch_stage.near: ", "found no neighbours; allowed: those that",
            [](M*, P* p) { p->near.reset(); }),
      Fault("patch_neighbours_unwanted", "patch_stage.near: ",
            "found neighbours; allowed: none where patch_stage.neighbours is 0", [](M*, P* p) { p->neighbours = 0; }),
      Fault("patch_embedding_infinite", "patch_stage.embedding[11]: ", "found infinity",
            [](M* m, P* p) { *Data<float>(m, *p->embedding, 11) = -kInfinity; }),
  };
}

std::vector<Corruption> LayerFaults() {
  return {
      Fault("patch_enter_narrow", "patch_stage.enter.weights.shape: ", "found [92, 24]; allowed: [93, 24]",
            [](M*, P* p) { p->enter->weights->shape[0] = 92; }),
      Fault("patch_mix_without_neighbours", "patch_stage.mix[1].weights.shape: ", "found [24, 24]; allowed: [72, 24]",
            [](M*, P* p) { p->mix[1]->weights->shape[0] = 24; }),
      Fault("patch_two_input_gates", "patch_stage.input_gates.weights.shape: ", "found [24, 48]; allowed: [24, 72]",
            [](M*, P* p) { p->input_gates->weights->shape[1] = 48; }),
      Fault("patch_two_hidden_gates", "patch_stage.hidden_gates.weights.shape: ", "found [24, 48]; allowed: [24, 72]",
            [](M*, P* p) { p->hidden_gates->weights->shape[1] = 48; }),
      Fault("patch_hidden_bias", "patch_stage.hidden_gates.bias: ", "found a bias; allowed: no bias",
            [](M*, P* p) { p->hidden_gates->bias = Copy(*p->input_gates->bias); }),
      Fault("patch_out_without_inputs", "patch_stage.out.weights.shape: ", "found [24, 9]; allowed: [117, 9]",
            [](M*, P* p) { p->out->weights->shape[0] = 24; }),
      Fault("patch_map_columns", "patch_stage.map.weights.shape: ", "found [12, 352]; allowed: [12, 384]",
            [](M*, P* p) { p->map->weights->shape[1] = 352; }),
      Fault("patch_row_scales",
            "patch_stage.enter.row_scales: ", "found scales of rows; allowed: scales of columns alone",
            [](M*, P* p) { p->enter->row_scales = Copy(*p->enter->column_scales); }),
      Fault("patch_column_scales_missing", "patch_stage.mix[0].column_scales: ", "found no scales for i8 weights",
            [](M*, P* p) { p->mix[0]->column_scales.reset(); }),
      Fault("patch_column_scale_zero", "patch_stage.map.column_scales[383]: ", "found a scale that is not positive",
            [](M* m, P* p) { *Data<float>(m, *p->map->column_scales, 383) = 0; }),
      Fault(
          "patch_scales_of_floats", "patch_stage.out.column_scales: ", "found scales for float weights",
          [](M*, P* p) { p->out->column_scales = Copy(*p->out->bias); }, format::DType_F16),
      Fault("patch_offsets_nan", "patch_stage.map.bias[0]: ", "found NaN",
            [](M* m, P* p) { *Data<float>(m, *p->map->bias) = kNaN; }),
      Fault("patch_keep_negative", "patch_stage.keep[0]: ", "found a share below 0 or above 1; allowed: 0 to 1",
            [](M* m, P* p) { *Data<float>(m, *p->keep) = -0.001f; }),
      Fault("patch_keep_grows", "patch_stage.keep[2]: ", "found a share below 0 or above 1; allowed: 0 to 1",
            [](M* m, P* p) { *Data<float>(m, *p->keep, 2) = 1.001f; }),
      Fault("patch_keep_nan", "patch_stage.keep[1]: ", "found NaN",
            [](M* m, P* p) { *Data<float>(m, *p->keep, 1) = kNaN; }),
  };
}

std::vector<Corruption> GroupFaults() {
  static constexpr char kRising[] = "found a group start that is not above the one before it";
  return {
      Fault("patch_source_past", "patch_stage.sources[47]: ", "found 12; allowed: indices below 12",
            [](M* m, P* p) { *Data<uint16_t>(m, *p->sources, 47) = 12; }),
      Fault("patch_vertex_past", "patch_stage.vertices[59]: ", "found 60; allowed: indices below 60",
            [](M* m, P* p) { *Data<uint16_t>(m, *p->vertices, 59) = 60; }),
      Fault("patch_vertex_twice",
            "patch_stage.vertices[40]: ", "found a vertex that is there twice; allowed: every garment vertex",
            [](M* m, P* p) { *Data<uint16_t>(m, *p->vertices, 40) = *Data<uint16_t>(m, *p->vertices, 3); }),
      Fault("patch_vertex_twice_in_a_row", "patch_stage.vertices[8]: ", "found a vertex that is there twice",
            [](M* m, P* p) { *Data<uint16_t>(m, *p->vertices, 8) = *Data<uint16_t>(m, *p->vertices, 7); }),
      Fault("patch_vertices_one_less", "patch_stage.vertices.shape: ", "found [59]; allowed: [60]",
            [](M*, P* p) { p->vertices->shape = {59}; }),
      Fault("patch_groups_begin_late",
            "patch_stage.group_starts[0]: ", "found a first group that does not start at 0; allowed: 0",
            [](M* m, P* p) { *Data<uint32_t>(m, *p->group_starts) = 1; }),
      Fault("patch_group_empty", "patch_stage.group_starts[5]: ", kRising,
            [](M* m, P* p) { *Data<uint32_t>(m, *p->group_starts, 5) = *Data<uint32_t>(m, *p->group_starts, 4); }),
      Fault("patch_group_start_huge", "patch_stage.group_starts[8]: ", kRising,
            [](M* m, P* p) { *Data<uint32_t>(m, *p->group_starts, 7) = 0x80000000u; }),
      Fault("patch_groups_end_late", "patch_stage.group_starts[12]: ", "found 61; allowed: 60",
            [](M* m, P* p) { *Data<uint32_t>(m, *p->group_starts, 12) = 61; }),
      Fault("patch_groups_end_all_bits", "patch_stage.group_starts[12]: ", "found 4294967295; allowed: 60",
            [](M* m, P* p) { *Data<uint32_t>(m, *p->group_starts, 12) = ~0u; }),
      Fault("patch_groups_end_early", "patch_stage.group_starts[12]: ", "found 59; allowed: 60",
            [](M* m, P* p) { *Data<uint32_t>(m, *p->group_starts, 12) = 59; }),
      Fault("patch_groups_one_less", "patch_stage.group_starts.shape: ", "found [12]; allowed: [13]",
            [](M*, P* p) { p->group_starts->shape = {12}; }),
  };
}

std::vector<Corruption> OtherStages() {
  const auto add_displacement = [](M* m, P*) { m->displacement = std::make_unique<format::DisplacementT>(); };
  const auto other = [](const auto& take) {
    return [=](M* m, P*) {
      TestModel whole = BuildModel({});
      take(m, whole.tables.get());
    };
  };
  return {
      Fault("patch_skeleton_stage", "skeleton_stage: ", "found a skeleton stage beside a patch stage; allowed: either",
            other([](M* m, M* whole) { m->skeleton_stage = std::move(whole->skeleton_stage); })),
      Fault("patch_mesh_stage", "mesh_stage: ", "found a mesh stage",
            other([](M* m, M* whole) { m->mesh_stage = std::move(whole->mesh_stage); })),
      Fault("patch_displacement", "displacement: ", "found a displacement beside a patch stage; allowed: either",
            add_displacement),
  };
}

}  // namespace

std::vector<Corruption> PatchCorruptions() {
  std::vector<Corruption> all = SizeFaults();
  for (const auto& more : {PlaceFaults(), LayerFaults(), GroupFaults(), OtherStages()})
    all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace dcloth::testing
