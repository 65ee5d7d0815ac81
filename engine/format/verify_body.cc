#include "engine/format/verify_body.h"

#include "engine/format/scan.h"
#include "kernels/nearest/nearest_order.h"
#include "kernels/skinning/skinning.h"

namespace dcloth::format {
namespace {

// False for NaN too. `allowed` says in words what low and high are.
bool Within(const Path& path, const Body& body, float value, float low, float high, const char* allowed,
            Checker* check) {
  if (value >= low && value <= high) return true;
  char found[48];
  Text(found, sizeof(found)).AddNumber(static_cast<double>(value)).Add(" m");
  return check->Fail(path, &body, found, allowed);
}

// The lists hold as many entries as faces have corners, so that where each entry is a corner of its own, none is
// missing.
bool VerifyRing(const Path& path, uint32_t vertex, Checker* check, const BodyView& view) {
  for (uint32_t i = view.row_starts[vertex]; i < view.row_starts[vertex + 1]; ++i) {
    const uint16_t face = view.columns[i], *corners = view.faces + size_t{3} * face;
    int left = 0;
    for (size_t k = 0; k < 3; ++k) left += corners[k] == vertex ? 1 : 0;
    for (uint32_t before = view.row_starts[vertex]; before < i; ++before) left -= view.columns[before] == face ? 1 : 0;
    if (left > 0) continue;
    return check->FailElement(path, view.columns, i, sizeof(uint16_t), "a face that is not around its vertex, or twice",
                              "the faces that have the vertex as a corner, each once");
  }
  return true;
}

// The faces around each vertex.
bool VerifyRings(const Body& body, const Path& parent, Checker* check, BodyView* view) {
  const Path path = {&parent, "row_starts"};
  const uint32_t b = view->vertex_count, corners = 3 * view->face_count;
  if (!check->Words(path, body.row_starts(), {b + 1}, &view->row_starts)) return false;
  const uint32_t* starts = view->row_starts;
  if (starts[0] != 0)
    return check->FailElement(path, starts, 0, sizeof(uint32_t), "a first row that does not start at 0", "0");
  const size_t bad = FindNotRising(starts, b);
  if (bad != b) {
    return check->FailElement(path, starts, bad + 1, sizeof(uint32_t),
                              "a row start that is not above the one before it",
                              "increasing row starts: each vertex has a face");
  }
  for (uint32_t i = 0; i < b; ++i) {
    if (starts[i + 1] - starts[i] <= kMaxBodyRing) continue;
    return check->FailElement(path, starts, i + 1, sizeof(uint32_t), "more than 32 faces around a vertex",
                              "1 to 32 faces", "split the triangle fans of the body's mesh");
  }
  const Path last = {&path, nullptr, b};
  const Path columns = {&parent, "columns"};
  if (!check->Count(last, starts + b, starts[b], corners, corners) ||
      !check->Indices(columns, body.columns(), {corners}, view->face_count, &view->columns)) {
    return false;
  }
  for (uint32_t i = 0; i < b; ++i) {
    if (!VerifyRing(columns, i, check, *view)) return false;
  }
  return true;
}

// A bit without a face would draw the search to a vertex that has nothing to offer.
bool VerifyTouched(const Path& path, Checker* check, BodyView* view) {
  for (uint32_t i = 0; i < view->vertex_count; ++i) {
    uint32_t bare = view->touched_by[i];
    for (uint32_t c = view->row_starts[i]; c < view->row_starts[i + 1] && bare != 0; ++c) {
      const uint16_t* face = view->faces + size_t{3} * view->columns[c];
      bare &= ~(uint32_t{view->touched_by[face[0]]} & view->touched_by[face[1]] & view->touched_by[face[2]]);
    }
    if (bare == 0) continue;
    return check->FailElement(path, view->touched_by, i, 1,
                              "a touch class that no face around this vertex has at all corners",
                              "classes that one of these faces has at all corners");
  }
  return true;
}

// Which cloth touches which part of the body.
bool VerifyTouch(const Body& body, const Path& parent, uint32_t garment_vertices, Checker* check, BodyView* view) {
  const Path classes = {&parent, "touch_classes"}, touched = {&parent, "touched_by"};
  const Tensor *of_garment = body.touch_classes(), *of_body = body.touched_by();
  if (of_garment == nullptr && of_body == nullptr) return true;
  if (of_garment == nullptr)
    return check->Fail(classes, &body, "no classes, but body.touched_by", "both fields, or neither");
  if (of_body == nullptr)
    return check->Fail(touched, &body, "no bits, but body.touch_classes", "both fields, or neither");
  constexpr uint32_t kAnyBits = 256;
  return check->Indices(classes, of_garment, {garment_vertices}, kMaxTouchClasses, &view->touch_classes) &&
         check->Indices(touched, of_body, {view->vertex_count}, kAnyBits, &view->touched_by) &&
         VerifyTouched(touched, check, view);
}

// All vertices of the garment, those of a class together.
bool VerifyGarmentOrder(const Body& body, const Path& path, uint32_t garment_vertices, Checker* check, BodyView* view) {
  if (!check->Permutation(path, body.garment_order(), garment_vertices, &view->garment_order)) return false;
  const uint16_t* order = view->garment_order;
  for (uint32_t i = 1; i < garment_vertices && view->touch_classes != nullptr; ++i) {
    if (view->touch_classes[order[i]] >= view->touch_classes[order[i - 1]]) continue;
    return check->FailElement(path, order, i, sizeof(uint16_t), "a vertex of a lower class than the one before it",
                              "vertices by rising class");
  }
  return true;
}

// For each value of touched_by the vertices that have it, each once, then the last one again until its group is full.
bool VerifySites(const Body& body, const Path& path, Checker* check, BodyView* view) {
  constexpr uint32_t kGroup = kernels::kNearestGroup;
  const auto groups = static_cast<uint32_t>(kernels::CountSiteGroups(view->touched_by, view->vertex_count));
  if (!check->Indices(path, body.sites(), {groups, kGroup}, view->vertex_count, &view->sites)) return false;
  uint16_t left[256] = {};  // of the vertices with each value
  for (uint32_t v = 0; v < view->vertex_count; ++v) ++left[view->touched_by[v]];
  left[0] = 0;
  size_t bad = FindRepeated(view->sites, size_t{groups} * kGroup, view->vertex_count);
  for (uint32_t i = 0, value = 0; i < groups * kGroup; ++i) {
    while (i % kGroup == 0 && left[value] == 0) ++value;
    const bool fills = left[value] == 0, same = i != 0 && view->sites[i] == view->sites[i - 1];
    if (fills != same || view->touched_by[view->sites[i]] != value) bad = i < bad ? i : bad;
    left[value] -= fills ? 0 : 1;
  }
  if (bad == size_t{groups} * kGroup) return true;
  return check->FailElement(path, view->sites, bad, sizeof(uint16_t), "a vertex out of its place, or twice",
                            "the vertices of each touched_by, by rising value, the last one again to fill a group");
}

// The orders that the search wants. Whether neighbours are together is not looked at: others make a slow search.
bool VerifyOrders(const Body& body, const Path& parent, uint32_t garment_vertices, Checker* check, BodyView* view) {
  const Path sites = {&parent, "sites"};
  if (body.garment_order() != nullptr &&
      !VerifyGarmentOrder(body, {&parent, "garment_order"}, garment_vertices, check, view)) {
    return false;
  }
  if (body.sites() == nullptr) return true;
  if (view->touched_by == nullptr)
    return check->Fail(sites, &body, "sites, but no body.touched_by", "sites only with touch classes");
  return VerifySites(body, sites, check, view);
}

}  // namespace

bool VerifyBody(const Body& body, Checker* check, ModelView* model) {
  const Path path = {nullptr, "body"};
  BodyView* view = &model->body;
  view->influences = body.influences();
  view->clearance = body.clearance();
  view->reach = body.reach();
  if (!check->Count({&path, "influences"}, &body, view->influences, 1, kernels::kMaxInfluences) ||
      !Within({&path, "clearance"}, body, view->clearance, kMinClearance, kMaxClearance, "0.0001 to 0.1 m", check) ||
      !Within({&path, "reach"}, body, view->reach, view->clearance, kMaxReach, "from body.clearance to 10 m", check)) {
    return false;
  }
  const Path positions = {&path, "positions"}, faces = {&path, "faces"};
  uint32_t b = 0, f = 0;
  if (!check->Dimension(positions, body.positions(), 0, kMinBodyVertices, kMaxBodyVertices, &b) ||
      !check->Dimension(faces, body.faces(), 0, 1, kMaxBodyFaces, &f)) {
    return false;
  }
  const Shape influences = {b, view->influences};
  view->face_count = f;
  view->vertex_count = b;
  return check->Floats(positions, body.positions(), {b, 3}, &view->positions) &&
         check->Indices({&path, "joints"}, body.joints(), influences, model->joint_count, &view->joints) &&
         check->WeightRows({&path, "weights"}, body.weights(), influences, &view->weights) &&
         check->Indices(faces, body.faces(), {f, 3}, b, &view->faces) && VerifyRings(body, path, check, view) &&
         VerifyTouch(body, path, model->vertex_count, check, view) &&
         VerifyOrders(body, path, model->vertex_count, check, view);
}

}  // namespace dcloth::format
