// Faults of what a garment says of itself: version, rate, names, joints, features.
#include "tests/attack/corruption.h"

namespace dcloth::testing {

std::vector<Corruption> GarmentCorruptions() {
  using M = format::ModelT;
  constexpr dcloth_status kVersion = DCLOTH_ERROR_VERSION;
  static constexpr char kRate[] = "allowed: 0.001 to 1000 Hz";
  static constexpr char kJoint[] = "allowed: an index into character.joint_names";
  return {
      {"version_zero", kVersion, "format_major: ", "found 0; allowed: 1", [](M* m) { m->format_major = 0; }},
      {"version_next", kVersion, "format_major: ", "found 2; allowed: 1", [](M* m) { m->format_major = 2; }},
      {"version_last", kVersion, "format_major: ", "found 65535; allowed: 1", [](M* m) { m->format_major = 65535; }},
      {"tick_rate_zero", kSemantics, "tick_rate: ", kRate, [](M* m) { m->tick_rate = 0; }},
      {"tick_rate_negative", kSemantics, "tick_rate: found -3.00000e1 Hz", kRate, [](M* m) { m->tick_rate = -30; }},
      {"tick_rate_nan", kSemantics, "tick_rate: found NaN Hz", kRate, [](M* m) { m->tick_rate = kNaN; }},
      {"tick_rate_infinite", kSemantics, "tick_rate: found infinity Hz", kRate, [](M* m) { m->tick_rate = kInfinity; }},
      {"tick_rate_huge", kSemantics, "tick_rate: found 1.00100e3 Hz", kRate, [](M* m) { m->tick_rate = 1001; }},
      // Its reciprocal, the tick's length, would be infinite.
      {"tick_rate_tiny", kSemantics, "tick_rate: found 9.99995e-41 Hz", kRate, [](M* m) { m->tick_rate = 1e-40f; }},
      {"vertices_zero", kSemantics, "garment.vertices: ", "found 0; allowed: 3 to 65535",
       [](M* m) { m->garment->vertices = 0; }},
      // Without a vertex no other tensor of a static garment has a row.
      {"vertices_zero_and_no_rows", kSemantics, "garment.vertices: ", "found 0; allowed: 3 to 65535",
       [](M* m) {
         m->garment->vertices = 0;
         m->static_stage->influence_bones->shape[0] = m->static_stage->influence_weights->shape[0] = 0;
       },
       nullptr, format::DType_I8, DCLOTH_STAGES_STATIC},
      {"vertices_two", kSemantics, "garment.vertices: ", "found 2; allowed: 3 to 65535",
       [](M* m) { m->garment->vertices = 2; }},
      {"vertices_beyond_u16", kSemantics, "garment.vertices: ", "found 65536; allowed: 3 to 65535",
       [](M* m) { m->garment->vertices = 65536; }},
      {"vertices_all_bits", kSemantics, "garment.vertices: ", "found 4294967295; allowed: 3 to 65535",
       [](M* m) { m->garment->vertices = ~0u; }},
      {"vertices_one_more", kSemantics, "garment.template_positions.shape: ", "found [60, 3]; allowed: [61, 3]",
       [](M* m) { m->garment->vertices = 61; }},
      {"garment_name_empty", kSemantics, "garment.name.length: ", "found 0; allowed: 1 to 255",
       [](M* m) { m->garment->name = ""; }},
      {"garment_name_long", kSemantics, "garment.name.length: ", "found 256; allowed: 1 to 255",
       [](M* m) { m->garment->name.assign(256, 'n'); }},
      {"garment_name_with_zero", kSemantics, "garment.name: ", "found a zero byte inside the text; allowed: text",
       [](M* m) { m->garment->name = std::string("a\0b", 3); }},
      {"no_joints", kSemantics, "character.joint_names.length: ", "found 0; allowed: 1 to 256",
       [](M* m) { m->character->joint_names.clear(); }},
      {"joints_beyond_u8", kSemantics, "character.joint_names.length: ", "found 257; allowed: 1 to 256",
       [](M* m) {
         while (m->character->joint_names.size() < 257)
           m->character->joint_names.push_back("more_" + std::to_string(m->character->joint_names.size()));
       }},
      {"joint_name_empty", kSemantics, "character.joint_names[5].length: ", "found 0; allowed: 1 to 255",
       [](M* m) { m->character->joint_names[5] = ""; }},
      {"joint_name_long", kSemantics, "character.joint_names[2].length: ", "found 256; allowed: 1 to 255",
       [](M* m) { m->character->joint_names[2].assign(256, 'x'); }},
      {"joint_name_twice", kSemantics, "character.joint_names[4]: ", "found a name that an earlier joint has",
       [](M* m) { m->character->joint_names[4] = "joint_1"; }},
      {"joint_name_of_the_first", kSemantics, "character.joint_names[8]: ", "found a name that an earlier joint has",
       [](M* m) { m->character->joint_names[8] = "joint_0"; }},
      {"joint_name_first_empty", kSemantics, "character.joint_names[0].length: ", "found 0; allowed: 1 to 255",
       [](M* m) { m->character->joint_names[0] = ""; }},
      {"joint_name_with_zero", kSemantics, "character.joint_names[8]: ", "found a zero byte inside the text",
       [](M* m) { m->character->joint_names[8] = std::string("\0", 1); }},
      {"hips_beyond_joints", kSemantics, "character.hips: found 9", kJoint, [](M* m) { m->character->hips = 9; }},
      {"hips_all_bits", kSemantics, "character.hips: found 65535", kJoint, [](M* m) { m->character->hips = 65535; }},
      {"parents_few", kSemantics, "character.parents.length: ", "found 8; allowed: 9",
       [](M* m) { m->character->parents.assign(8, 65535); }},
      {"parents_many", kSemantics, "character.parents.length: ", "found 10; allowed: 9",
       [](M* m) { m->character->parents.assign(10, 65535); }},
      {"parent_beyond_joints", kSemantics, "character.parents[8]: found 9; allowed: ", "or 65535",
       [](M* m) {
         m->character->parents.assign(9, 65535);
         m->character->parents[8] = 9;
       }},
      {"parent_is_itself", kSemantics,
       "character.parents[3]: ", "found a joint that is its own ancestor; allowed: parents that lead",
       [](M* m) {
         m->character->parents.assign(9, 65535);
         m->character->parents[3] = 3;
       }},
      {"parents_in_a_circle", kSemantics, "character.parents[0]: ", "found a joint that is its own ancestor",
       [](M* m) { m->character->parents = {1, 2, 0, 65535, 3, 4, 5, 6, 7}; }},
      {"inverse_bind_last_nan", kSemantics, "character.inverse_bind[107]: ", "found NaN; allowed: finite numbers",
       [](M* m) { *Data<float>(m, *m->character->inverse_bind, 107) = kNaN; }},
      {"feature_joint_beyond_joints", kSemantics, "features.joints[1]: found 9", kJoint,
       [](M* m) { m->features->joints[1] = 9; }},
      {"feature_joints_many", kSemantics, "features.joints.length: ", "found 257; allowed: 0 to 256",
       [](M* m) { m->features->joints.assign(257, 0); }},
      {"feature_joint_missing", kSemantics, "features.mean.shape: ", "found [49]; allowed: [40]",
       [](M* m) { m->features->joints.pop_back(); }},
      {"root_motion_off", kSemantics, "features.mean.shape: ", "found [49]; allowed: [45]",
       [](M* m) { m->features->root_motion = format::RootMotion_None; }},
      {"root_motion_of_air", kSemantics, "features.mean.shape: ", "found [49]; allowed: [52]",
       [](M* m) { m->features->root_motion = format::RootMotion_Air; }},
      {"root_motion_unknown", kSemantics, "features.root_motion: ", "found 3; allowed: 0 (none), 1 (hips) or 2 (air)",
       [](M* m) { m->features->root_motion = static_cast<format::RootMotion>(3); }},
      {"feature_bounds_crossed", kSemantics, "features.low[3]: ", "found a value above features.high",
       [](M* m) { *Data<float>(m, *m->features->low, 3) = 10; }},
      {"feature_bounds_crossed_first", kSemantics, "features.low[0]: ", "found a value above features.high",
       [](M* m) { *Data<float>(m, *m->features->low) = 10; }},
  };
}

}  // namespace dcloth::testing
