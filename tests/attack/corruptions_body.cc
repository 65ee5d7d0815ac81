// Faults of the body that cloth is kept out of, and of a reduced basis: the head between coefficients and rows.
#include <utility>

#include "tests/attack/corruption.h"

namespace dcloth::testing {
namespace {

using M = format::ModelT;
using B = format::BodyT;
constexpr char kRising[] = "found a row start that is not above the one before it";

// Of the egg's 17 vertices and 30 faces, on 9 joints, and the garment's 60 vertices in three classes of touch.
Corruption Body(const char* name, const char* field, const char* reason, const std::function<void(M*, B*)>& spoil) {
  return {.name = name,
          .status = kSemantics,
          .field = field,
          .reason = reason,
          .tables = [=](M* m) { spoil(m, m->body.get()); },
          .touch = true};
}

std::vector<Corruption> Skin() {
  return {
      Body("skin_influences_zero", "body.influences: ", "found 0; allowed: 1 to 8",
           [](M*, B* b) { b->influences = 0; }),
      Body("skin_influences_nine", "body.influences: ", "found 9; allowed: 1 to 8",
           [](M*, B* b) { b->influences = 9; }),
      Body("clearance_zero", "body.clearance: ", "allowed: 0.0001 to 0.1 m", [](M*, B* b) { b->clearance = 0; }),
      Body("clearance_negative", "body.clearance: ", "found -2.00000e-3 m", [](M*, B* b) { b->clearance = -0.002f; }),
      Body("clearance_nan", "body.clearance: ", "found NaN", [](M*, B* b) { b->clearance = kNaN; }),
      Body("clearance_wide", "body.clearance: ", "found 2.00000e-1 m", [](M*, B* b) { b->clearance = 0.2f; }),
      Body("reach_below_clearance", "body.reach: ", "found 1.00000e-3 m", [](M*, B* b) { b->reach = 0.001f; }),
      Body("reach_infinite", "body.reach: ", "found infinity", [](M*, B* b) { b->reach = kInfinity; }),
      Body("reach_nan", "body.reach: ", "found NaN", [](M*, B* b) { b->reach = kNaN; }),
      Body("skin_joint_one_past", "body.joints[33]: ", "found 9; allowed: indices below 9",
           [](M* m, B* b) { *Data<uint8_t>(m, *b->joints, 33) = 9; }),
      Body("skin_weights_sum", "body.weights[4]: ", "found a row with a negative weight",
           [](M* m, B* b) { *Data<float>(m, *b->weights, 8) += 0.01f; }),
      Body("skin_weight_nan_behind_a_sum", "body.weights[20]: ", "found NaN",  // numbers first, then rows
           [](M* m, B* b) {
             *Data<float>(m, *b->weights, 8) += 0.01f;
             *Data<float>(m, *b->weights, 20) = kNaN;
           }),
  };
}

std::vector<Corruption> Faces() {
  static constexpr char kLong[] = "found more than 32 faces around a vertex; allowed: 1 to 32";
  static constexpr char kOther[] = "found a face that is not around its vertex, or twice; allowed: ";
  const auto lengthen = [](size_t from) {
    return [from](M* m, B* b) {
      for (size_t i = from; i <= 17; ++i) *Data<uint32_t>(m, *b->row_starts, i) += 40;
    };
  };
  return {
      Body("skin_positions_few", "body.positions.shape[0]: ", "found 2; allowed: 3 to 8192",
           [](M*, B* b) { b->positions->shape[0] = 2; }),
      Body("skin_faces_none", "body.faces.shape[0]: ", "found 0; allowed: 1 to 16384",
           [](M*, B* b) { b->faces->shape[0] = 0; }),
      Body("skin_faces_many", "body.faces.shape[0]: ", "found 16385; allowed: 1 to 16384",
           [](M*, B* b) { b->faces->shape[0] = 16385; }),
      Body("skin_face_one_past", "body.faces[89]: ", "found 17; allowed: indices below 17",
           [](M* m, B* b) { *Data<uint16_t>(m, *b->faces, 89) = 17; }),
      Body("skin_rows_begin_late", "body.row_starts[0]: ", "found a first row that does not start at 0; allowed: 0",
           [](M* m, B* b) { *Data<uint32_t>(m, *b->row_starts) = 1; }),
      Body("skin_row_empty", "body.row_starts[10]: ", kRising,
           [](M* m, B* b) { Data<uint32_t>(m, *b->row_starts)[10] = Data<uint32_t>(m, *b->row_starts)[9]; }),
      Body("skin_row_start_huge", "body.row_starts[13]: ", kRising,
           [](M* m, B* b) { *Data<uint32_t>(m, *b->row_starts, 12) = 0x80000000u; }),
      Body("skin_row_long", "body.row_starts[10]: ", kLong, lengthen(10)),
      Body("skin_row_long_first", "body.row_starts[1]: ", kLong, lengthen(1)),
      Body("skin_row_long_last", "body.row_starts[17]: ", kLong, lengthen(17)),
      Body("skin_row_end_one_less", "body.row_starts[17]: ", "found 89; allowed: 90",
           [](M* m, B* b) { *Data<uint32_t>(m, *b->row_starts, 17) -= 1; }),
      Body("skin_column_one_past", "body.columns[3]: ", "found 30; allowed: indices below 30",
           [](M* m, B* b) { *Data<uint16_t>(m, *b->columns, 3) = 30; }),
      Body("skin_column_of_another_vertex", "body.columns[0]: ", kOther,
           [](M* m, B* b) { *Data<uint16_t>(m, *b->columns) = 29; }),
      Body("skin_column_twice", "body.columns[89]: ", kOther,
           [](M* m, B* b) { Data<uint16_t>(m, *b->columns)[89] = Data<uint16_t>(m, *b->columns)[88]; }),
  };
}

std::vector<Corruption> Touch() {
  static constexpr char kSite[] =
      "found a vertex out of its place, or twice; allowed: the vertices of each touched_by, by rising value";
  return {
      Body("garment_order_beyond", "body.garment_order[59]: ", "found 60; allowed: indices below 60",
           [](M* m, B* b) { *Data<uint16_t>(m, *b->garment_order, 59) = 60; }),
      Body("garment_order_repeats",
           "body.garment_order[5]: ", "found a vertex that is there twice; allowed: every garment vertex once",
           [](M* m, B* b) { Data<uint16_t>(m, *b->garment_order)[5] = Data<uint16_t>(m, *b->garment_order)[4]; }),
      Body("garment_order_mixes_classes", "body.garment_order[1]: ",
           "found a vertex of a lower class than the one before it; allowed: vertices by rising class",
           [](M* m, B* b) {
             uint16_t* order = Data<uint16_t>(m, *b->garment_order);
             std::swap(order[0], order[59]);
           }),
      Body("sites_repeat", "body.sites[1]: ", kSite,
           [](M* m, B* b) { Data<uint16_t>(m, *b->sites)[1] = Data<uint16_t>(m, *b->sites)[0]; }),
      Body("sites_of_another_value", "body.sites[0]: ", kSite,
           [](M* m, B* b) { Data<uint16_t>(m, *b->sites)[0] = Data<uint16_t>(m, *b->sites)[16]; }),
      Body("sites_filled_with_another", "body.sites[15]: ", kSite,
           [](M* m, B* b) { Data<uint16_t>(m, *b->sites)[15] = Data<uint16_t>(m, *b->sites)[0]; }),
      Body("sites_beyond", "body.sites[31]: ", "found 17; allowed: indices below 17",
           [](M* m, B* b) { *Data<uint16_t>(m, *b->sites, 31) = 17; }),
      Body("sites_without_classes",
           "body.sites: ", "found sites, but no body.touched_by; allowed: sites only with touch classes",
           [](M*, B* b) { b->touch_classes.reset(), b->touched_by.reset(); }),
      Body("touch_classes_alone", "body.touched_by: ", "found no bits, but body.touch_classes; allowed: both",
           [](M*, B* b) { b->touched_by.reset(); }),
      Body("touched_by_alone", "body.touch_classes: ", "found no classes, but body.touched_by; allowed: both",
           [](M*, B* b) { b->touch_classes.reset(); }),
      Body("touch_class_ninth", "body.touch_classes[59]: ", "found 8; allowed: indices below 8",
           [](M* m, B* b) { *Data<uint8_t>(m, *b->touch_classes, 59) = 8; }),
      Body("touched_without_a_face", "body.touched_by[16]: ", "found a touch class that no face around this vertex has",
           [](M* m, B* b) { *Data<uint8_t>(m, *b->touched_by, 16) |= 0x80; }),
      Body("touched_on_one_edge", "body.touched_by[2]: ", "found a touch class that no face around this vertex has",
           [](M* m, B* b) {
             for (const size_t corner : {2, 3}) *Data<uint8_t>(m, *b->touched_by, corner) |= 4;
           }),
  };
}

// Of an int8 model with a basis reduced to 14 rows, made by coefficients of the skeleton stage and a head.
Corruption Head(const char* name, const char* field, const char* reason, const std::function<void(M*)>& spoil) {
  return {.name = name, .status = kSemantics, .field = field, .reason = reason, .tables = spoil, .rank = 14};
}

std::vector<Corruption> ReducedBasis() {
  const auto head = [](M* m) -> format::TensorT& { return *m->displacement->head->weights; };
  return {
      // What a reader that knows no heads sees, as one of format 1.0.
      Head("head_dropped", "displacement.skeleton_rows", "", [](M* m) { m->displacement->head.reset(); }),
      Head("head_alone", "displacement.head", "",
           [](M* m) {
             m->skeleton_stage.reset();
             m->mesh_stage.reset();
           }),
      Head("head_columns_odd", "displacement.head.weights", "", [=](M* m) { head(m).shape[1] = 13; }),
      Head("head_columns_none", "displacement.head.weights.shape[1]", "", [=](M* m) { head(m).shape[1] = 0; }),
      // Nothing else needs a basis then.
      Head("head_columns_none_and_no_basis", "displacement.head.weights.shape[1]", "",
           [=](M* m) {
             head(m).shape[1] = 0;
             m->mesh_stage.reset();
             m->displacement->basis.reset();
             m->displacement->skeleton_rows = 0;
           }),
      Head("head_columns_not_the_meshs", "displacement.head.weights", "", [=](M* m) { head(m).shape[1] = 16; }),
      Head("mesh_columns_not_the_heads", "displacement.head.weights", "found 14 columns",
           [](M* m) { m->mesh_stage->coefficients->weights->shape[1] = 16; }),
      Head("mesh_columns_of_one_layer_not_the_heads", "displacement.head.weights", "found 14 columns",
           [](M* m) {
             m->mesh_stage->layers.resize(1);
             m->mesh_stage->coefficients->weights->shape[1] = 16;
           }),
      Head("head_bias", "displacement.head.bias", "",
           [](M* m) { m->displacement->head->bias = Copy(*m->mesh_stage->coefficients->bias); }),
      Head("head_scales", "displacement.head.row_scales", "", [](M* m) { m->displacement->head->row_scales.reset(); }),
      Head("skeleton_rows_with_head", "displacement.skeleton_rows", "",
           [](M* m) { m->displacement->skeleton_rows = 20; }),
      Head("mesh_rows_with_head", "displacement.mesh_rows", "", [](M* m) { m->displacement->mesh_rows = 14; }),
      Head("no_basis_with_head", "displacement.basis", "", [](M* m) { m->displacement->basis.reset(); }),
  };
}

}  // namespace

std::vector<Corruption> BodyCorruptions() {
  std::vector<Corruption> all = Skin();
  for (const auto& more : {Faces(), Touch(), ReducedBasis()}) all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace dcloth::testing
