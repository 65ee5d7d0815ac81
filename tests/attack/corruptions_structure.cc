// Faults of the file as a FlatBuffer: what its own verifier must see, and sharing, which it does not.
#include "tests/attack/corruption.h"

namespace dcloth::testing {
namespace {

namespace fb = flatbuffers;
using format::Model;

void Poke16(uint8_t* place, uint16_t value) { std::memcpy(place, &value, sizeof(value)); }
void Poke32(uint8_t* place, uint32_t value) { std::memcpy(place, &value, sizeof(value)); }

uint8_t* Writable(const void* place) { return const_cast<uint8_t*>(static_cast<const uint8_t*>(place)); }

const Model& ModelIn(AlignedBytes* file) { return *format::GetModel(file->data()); }

// A table as FlatBuffers stores it, whatever its type.
const fb::Table& TableOf(const void* typed) { return *static_cast<const fb::Table*>(typed); }
uint8_t* Field(const void* typed, fb::voffset_t field) { return Writable(TableOf(typed).GetAddressOf(field)); }

// Makes the offset stored at `field` lead to `target`, which lies behind it; before it, the offset wraps.
void Redirect(uint8_t* field, const void* target) {
  Poke32(field, static_cast<uint32_t>(static_cast<const uint8_t*>(target) - field));
}

uint8_t* VTable(const void* typed) {
  int32_t back;
  std::memcpy(&back, typed, sizeof(back));
  return Writable(typed) - back;
}

// Eight bytes of zeros before `place`, which read as a text of no length.
const uint8_t* EmptyTextBefore(AlignedBytes* file, const uint8_t* place) {
  constexpr uint8_t kZeros[8] = {};
  const uint8_t* at = place - sizeof(kZeros);
  while (at > file->data() && std::memcmp(at, kZeros, sizeof(kZeros)) != 0) at -= 4;
  return at;
}

constexpr char kBroken[] =
    "found a bad offset or length, a missing required field, or more than 256 tables; allowed: "
    "an intact file";
constexpr char kRoot[] = "found a broken root table; allowed: a complete .dcloth file";

using Bytes = AlignedBytes;

std::vector<Corruption> BrokenOffsets() {
  return {
      {"identifier_of_another_format", kFormat, "", "found a different file identifier; allowed: DCLO", nullptr,
       [](Bytes* f) { f->data()[4] = 'X'; }},
      {"identifier_missing", kFormat, "", "found a different file identifier", nullptr,
       [](Bytes* f) { Poke32(f->data() + 4, 0); }},
      {"root_offset_zero", kFormat, "", kRoot, nullptr, [](Bytes* f) { Poke32(f->data(), 0); }},
      {"root_offset_past_the_end", kFormat, "", kRoot, nullptr,
       [](Bytes* f) { Poke32(f->data(), static_cast<uint32_t>(f->size())); }},
      {"root_offset_wraps", kFormat, "", kRoot, nullptr, [](Bytes* f) { Poke32(f->data(), 0xFFFFFFF0u); }},
      {"root_offset_odd", kFormat, "", kRoot, nullptr, [](Bytes* f) { f->data()[0] |= 1; }},
      {"root_vtable_past_the_end", kFormat, "", kRoot, nullptr,
       [](Bytes* f) { Poke32(Writable(&ModelIn(f)), 0x80000001u); }},
      {"root_vtable_length_odd", kFormat, "", kRoot, nullptr, [](Bytes* f) { Poke16(VTable(&ModelIn(f)), 31); }},
      {"root_vtable_length_huge", kFormat, "", kRoot, nullptr, [](Bytes* f) { Poke16(VTable(&ModelIn(f)), 0xFFFE); }},
      {"garment_past_the_end", kFormat, "garment: ", kBroken, nullptr,
       [](Bytes* f) { Poke32(Field(&ModelIn(f), Model::VT_GARMENT), 0x7FFFFFF0u); }},
      {"garment_offset_zero", kFormat, "garment: ", kBroken, nullptr,
       [](Bytes* f) { Poke32(Field(&ModelIn(f), Model::VT_GARMENT), 0); }},
      {"garment_offset_backwards", kFormat, "garment: ", kBroken, nullptr,
       [](Bytes* f) { Poke32(Field(&ModelIn(f), Model::VT_GARMENT), 0xFFFFFFFCu); }},
      {"features_odd", kFormat, "features: ", kBroken, nullptr,
       [](Bytes* f) { Field(&ModelIn(f), Model::VT_FEATURES)[0] |= 1; }},
      {"producer_past_the_end", kFormat, "producer: ", kBroken, nullptr,
       [](Bytes* f) { Poke32(Field(&ModelIn(f), Model::VT_PRODUCER), 0x10000000u); }},
      {"producer_longer_than_the_file", kFormat, "producer: ", kBroken, nullptr,
       [](Bytes* f) { Poke32(Writable(ModelIn(f).producer()), 0x0FFFFFFFu); }},
      {"precision_longer_than_the_file", kFormat, "precision: ", kBroken, nullptr,
       [](Bytes* f) { Poke32(Writable(ModelIn(f).precision()), 0x0FFFFFFFu); }},
      {"name_without_terminator", kFormat, "garment: ", kBroken, nullptr,
       [](Bytes* f) {
         const fb::String* name = ModelIn(f).garment()->name();
         Writable(name->c_str())[name->size()] = 'x';
       }},
      {"weights_longer_than_the_file", kFormat, "weights: ", kBroken, nullptr,
       [](Bytes* f) { Poke32(Writable(ModelIn(f).weights()), 0xFFFFFFFFu); }},
      {"weights_off_their_boundary", kFormat,
       "weights: ", "found data that is not aligned to 64 bytes; allowed: data aligned to 64 bytes", nullptr,
       [](Bytes* f) {
         uint8_t* field = Field(&ModelIn(f), Model::VT_WEIGHTS);
         uint8_t* moved = Writable(ModelIn(f).weights()) + 4;
         Poke32(moved, 64);
         Redirect(field, moved);
       }},
      // 0x40000000 offsets of 4 bytes are 2^32 bytes: 0 in 32-bit arithmetic.
      {"joint_names_length_wraps", kFormat, "character: ", kBroken, nullptr,
       [](Bytes* f) { Poke32(Writable(ModelIn(f).character()->joint_names()), 0x40000000u); }},
      {"feature_joints_length_wraps", kFormat, "features: ", kBroken, nullptr,
       [](Bytes* f) { Poke32(Writable(ModelIn(f).features()->joints()), 0x80000000u); }},
      {"shape_length_wraps", kFormat, "features: ", kBroken, nullptr,
       [](Bytes* f) { Poke32(Writable(ModelIn(f).features()->mean()->shape()), 0x40000001u); }},
      {"layers_length_huge", kFormat, "mesh_stage: ", kBroken, nullptr,
       [](Bytes* f) { Poke32(Writable(ModelIn(f).mesh_stage()->layers()), 0x0FFFFFFFu); }},
      // Backwards to an empty text: 32 bits wrap there, 64 lead far outside.
      {"joint_name_offset_wraps", kFormat, "character: ", kBroken, nullptr,
       [](Bytes* f) {
         uint8_t* const element = Writable(ModelIn(f).character()->joint_names()->Data()) + 8;
         Redirect(element, EmptyTextBefore(f, element));
       }},
      {"layer_offset_zero", kFormat, "mesh_stage: ", kBroken, nullptr,
       [](Bytes* f) { Poke32(Writable(ModelIn(f).mesh_stage()->layers()->Data()), 0); }},
      {.name = "mix_length_huge",
       .status = kFormat,
       .field = "patch_stage: ",
       .reason = kBroken,
       .bytes = [](Bytes* f) { Poke32(Writable(ModelIn(f).patch_stage()->mix()), 0x0FFFFFFFu); },
       .patches = 4},
      // Backwards, to a layer that is sound: 32 bits wrap there.
      {.name = "mix_offset_wraps",
       .status = kFormat,
       .field = "patch_stage: ",
       .reason = kBroken,
       .bytes =
           [](Bytes* f) {
             const format::PatchStage* stage = ModelIn(f).patch_stage();
             Redirect(Writable(stage->mix()->Data()), stage->map());
           },
       .patches = 4},
  };
}

std::vector<Corruption> MissingFields() {
  using M = format::ModelT;
  static constexpr char kMissing[] = "found no such field; allowed: this field in every model";
  return {
      {"no_garment", kFormat, "garment: ", kMissing, [](M* m) { m->garment.reset(); }},
      {"no_character", kFormat, "character: ", kMissing, [](M* m) { m->character.reset(); }},
      {"no_features", kFormat, "features: ", kMissing, [](M* m) { m->features.reset(); }},
      {"no_static_stage", kFormat, "static_stage: ", kMissing, [](M* m) { m->static_stage.reset(); }},
      {"no_influence_bones", kFormat, "static_stage: ", kBroken,
       [](M* m) { m->static_stage->influence_bones.reset(); }},
      {"no_inverse_bind", kFormat, "character: ", kBroken, [](M* m) { m->character->inverse_bind.reset(); }},
      {"no_gru_input", kFormat, "skeleton_stage: ", kBroken, [](M* m) { m->skeleton_stage->input.reset(); }},
      {"no_body_points", kFormat, "mesh_stage: ", kBroken, [](M* m) { m->mesh_stage->body_points.reset(); }},
      {"no_basis_weights", kFormat, "displacement: ", kBroken, [](M* m) { m->displacement->basis->weights.reset(); }},
      {.name = "no_enter",
       .status = kFormat,
       .field = "patch_stage: ",
       .reason = kBroken,
       .tables = [](M* m) { m->patch_stage->enter.reset(); },
       .patches = 4},
      {"tables_beyond_count", kFormat, "mesh_stage: ", kBroken,
       [](M* m) {
         while (m->mesh_stage->layers.size() < 30) m->mesh_stage->layers.push_back(Copy(*m->mesh_stage->layers[1]));
       }},
  };
}

// Two fields that lead to one table. FlatBuffers allows it; here every tensor has a range of its own, and a
// stage stored as another one has shapes of its own.
std::vector<Corruption> SharedTables() {
  return {
      {"layer_twice", kSemantics,
       "mesh_stage.layers[2].input_gates.offset: ", "found a range that overlaps the tensor at offset", nullptr,
       [](Bytes* f) {
         const auto* layers = ModelIn(f).mesh_stage()->layers();
         Redirect(Writable(layers->Data()) + 8, layers->Get(1));
       }},
      {"high_is_low", kSemantics, "features.high.offset: ", "found a range that overlaps the tensor at offset", nullptr,
       [](Bytes* f) {
         const format::Features* features = ModelIn(f).features();
         Redirect(Field(features, format::Features::VT_HIGH), features->low());
       }},
      {"gru_product_twice", kSemantics, "skeleton_stage.input.weights.shape: ", "found [49, 57]; allowed: [49, 147]",
       nullptr,
       [](Bytes* f) {
         const format::SkeletonStage* stage = ModelIn(f).skeleton_stage();
         Redirect(Field(stage, format::SkeletonStage::VT_HIDDEN), stage->input());
       }},
      {"mesh_stage_as_skeleton_stage", kFormat, "skeleton_stage: ", kBroken, nullptr,
       [](Bytes* f) { Redirect(Field(&ModelIn(f), Model::VT_SKELETON_STAGE), ModelIn(f).mesh_stage()); }},
      {"names_as_a_tensor", kFormat, "character: ", kBroken, nullptr,
       [](Bytes* f) {
         const format::Character* character = ModelIn(f).character();
         Redirect(Field(character, format::Character::VT_INVERSE_BIND), character->joint_names());
       }},
      {"joint_name_twice_by_offset", kSemantics,
       "character.joint_names[3]: ", "found a name that an earlier joint has; allowed: unique names", nullptr,
       [](Bytes* f) {
         const auto* names = ModelIn(f).character()->joint_names();
         Redirect(Writable(names->Data()) + 12, names->Get(1));
       }},
  };
}

}  // namespace

std::vector<Corruption> StructureCorruptions() {
  std::vector<Corruption> all = BrokenOffsets();
  for (const auto& more : {MissingFields(), SharedTables()}) all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace dcloth::testing
