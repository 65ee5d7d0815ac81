// The tables come in the order in which sizes follow from each other.
#include "engine/format/verify_content.h"

#include "engine/format/scan.h"
#include "engine/format/verify_body.h"
#include "engine/format/verify_patches.h"
#include "kernels/skinning/skinning.h"

namespace dcloth::format {
namespace {

uint32_t PaddedToEven(uint32_t count) { return count + (count & 1u); }

// Rising, so that a vertex is drawn once and the last one alone may lie at the end of its arrays.
bool VerifyRising(const Path& path, const uint16_t* values, uint32_t count, Checker* check) {
  for (uint32_t i = 1; i < count; ++i) {
    if (values[i] > values[i - 1]) continue;
    return check->FailElement(path, values, i, sizeof(uint16_t), "an index that does not rise",
                              "indices in rising order, each once");
  }
  return true;
}

bool VerifyCoarseMesh(const Garment& garment, const Path& path, Checker* check, ModelView* view) {
  view->coarse = {};
  const Path vertices = {&path, "coarse_vertices"}, faces = {&path, "coarse_faces"};
  const Tensor *const kept = garment.coarse_vertices(), *const triangles = garment.coarse_faces();
  if (kept == nullptr && triangles == nullptr) return true;
  if (kept == nullptr || triangles == nullptr) {
    return check->Fail(kept == nullptr ? vertices : faces, &garment, "nothing", "both coarse_vertices and coarse_faces",
                       "convert the bundle again");
  }
  CoarseMeshView* const coarse = &view->coarse;
  return check->Dimension(vertices, kept, 0, kMinVertices, view->vertex_count, &coarse->vertex_count) &&
         check->Indices(vertices, kept, {coarse->vertex_count}, view->vertex_count, &coarse->vertices) &&
         VerifyRising(vertices, coarse->vertices, coarse->vertex_count, check) &&
         check->Dimension(faces, triangles, 0, 1, kMaxTriangles, &coarse->triangle_count) &&
         check->Indices(faces, triangles, {coarse->triangle_count, 3}, coarse->vertex_count, &coarse->faces);
}

bool VerifyTexture(const Garment& garment, const Path& path, Checker* check, ModelView* view) {
  view->texture = {};
  const Path coordinates = {&path, "texture_coordinates"}, seams = {&path, "seam_vertices"},
             faces = {&path, "textured_faces"};
  const Tensor *const places = garment.texture_coordinates(), *const repeated = garment.seam_vertices(),
                      *const triangles = garment.textured_faces();
  if ((repeated == nullptr) != (triangles == nullptr) || (places == nullptr && repeated != nullptr)) {
    return check->Fail(places == nullptr     ? coordinates
                       : repeated == nullptr ? seams
                                             : faces,
                       &garment, "nothing", "texture_coordinates, and both seam_vertices and textured_faces or neither",
                       "convert the bundle again");
  }
  if (places == nullptr) return true;
  TextureView* const texture = &view->texture;
  const uint32_t n = view->vertex_count;
  uint32_t seam_count = 0;
  if (repeated != nullptr && (!check->Dimension(seams, repeated, 0, 1, kMaxVertices - n, &seam_count) ||
                              !check->Indices(seams, repeated, {seam_count}, n, &texture->seam_vertices))) {
    return false;
  }
  texture->vertex_count = n + seam_count;
  texture->faces = view->faces;
  return check->Floats(coordinates, places, {texture->vertex_count, 2}, &texture->coordinates) &&
         (triangles == nullptr ||
          check->Indices(faces, triangles, {view->triangle_count, 3}, texture->vertex_count, &texture->faces));
}

bool VerifyGarment(const Garment& garment, Checker* check, ModelView* view) {
  const Path path = {nullptr, "garment"};
  const uint32_t n = garment.vertices();
  if (!check->Name({&path, "name"}, garment.name()) ||
      !check->Count({&path, "vertices"}, &garment, n, kMinVertices, kMaxVertices)) {
    return false;
  }
  view->name = garment.name()->c_str();
  view->vertex_count = n;
  const Path faces = {&path, "faces"};
  return check->Floats({&path, "template_positions"}, garment.template_positions(), {n, 3},
                       &view->template_positions) &&
         check->Dimension(faces, garment.faces(), 0, 1, kMaxTriangles, &view->triangle_count) &&
         check->Indices(faces, garment.faces(), {view->triangle_count, 3}, n, &view->faces) &&
         VerifyCoarseMesh(garment, path, check, view) && VerifyTexture(garment, path, check, view);
}

bool SameName(const flatbuffers::String& a, const flatbuffers::String& b) {
  if (a.size() != b.size()) return false;
  for (uint32_t i = 0; i < a.size(); ++i) {
    if (a.Get(i) != b.Get(i)) return false;
  }
  return true;
}

bool VerifyJointNames(const Character& character, Checker* check) {
  const Path parent = {nullptr, "character"};
  const auto& names = *character.joint_names();
  if (!check->Count({&parent, "joint_names.length"}, &names, names.size(), 1, kMaxJoints)) return false;
  for (uint32_t i = 0; i < names.size(); ++i) {
    const Path path = {&parent, "joint_names", i};
    if (!check->Name(path, names.Get(i))) return false;
    for (uint32_t j = 0; j < i; ++j) {
      if (SameName(*names.Get(j), *names.Get(i))) {
        return check->Fail(path, names.Get(i), "a name that an earlier joint has", "unique names");
      }
    }
  }
  return true;
}

// Parents end at a root: no cycles.
bool VerifyParents(const Character& character, Checker* check, ModelView* view) {
  const flatbuffers::Vector<uint16_t>* const parents = character.parents();
  view->parents = nullptr;
  if (parents == nullptr) return true;
  const Path character_path = {nullptr, "character"};
  const Path path = {&character_path, "parents"};
  const uint32_t count = view->joint_count;
  if (!check->Count({&path, "length"}, parents, parents->size(), count, count)) return false;
  for (uint32_t j = 0; j < count; ++j) {
    const Path at = {&path, nullptr, j};
    const uint8_t* const place = parents->Data() + size_t{j} * 2;
    if (parents->Get(j) != kNoParent && parents->Get(j) >= count)
      return check->FailCount(at, place, parents->Get(j), "",
                              "an index into character.joint_names, or 65535 for a root");
  }
  for (uint32_t j = 0; j < count; ++j) {
    uint32_t above = parents->Get(j), steps = 0;
    while (above != kNoParent && steps++ < count) above = parents->Get(above);
    if (above != kNoParent) {
      const Path at = {&path, nullptr, j};
      return check->Fail(at, parents->Data() + size_t{j} * 2, "a joint that is its own ancestor",
                         "parents that lead to a root (65535)");
    }
  }
  view->parents = parents->data();
  return true;
}

bool VerifyCharacter(const Character& character, Checker* check, ModelView* view) {
  const Path path = {nullptr, "character"};
  if (!VerifyJointNames(character, check)) return false;
  view->joint_names = character.joint_names();
  view->joint_count = character.joint_names()->size();
  view->hips = character.hips();
  if (view->hips >= view->joint_count) {
    return check->FailCount({&path, "hips"}, &character, view->hips, "", "an index into character.joint_names");
  }
  if (!VerifyParents(character, check, view)) return false;
  return check->Floats({&path, "inverse_bind"}, character.inverse_bind(), {view->joint_count, 12}, &view->inverse_bind);
}

bool VerifyFeatures(const Features& features, Checker* check, ModelView* model) {
  const Path path = {nullptr, "features"};
  FeaturesView* view = &model->features;
  static_assert(RootMotion_MAX == static_cast<int>(RootKind::kAir), "the view's kinds are the file's");
  if (features.root_motion() > RootMotion_MAX) {
    return check->FailCount({&path, "root_motion"}, &features, features.root_motion(), "",
                            "0 (none), 1 (hips) or 2 (air)",
                            "if a newer converter wrote the file, use the library of that release");
  }
  view->root = static_cast<RootKind>(features.root_motion());
  const uint32_t root_features = RootFeatures(view->root);
  if (!check->Joints({&path, "joints"}, features.joints(), root_features != 0 ? 0 : 1, model->joint_count))
    return false;
  view->joints = features.joints()->data();
  view->joint_count = features.joints()->size();
  view->length = kFeaturesPerJoint * view->joint_count + root_features;
  const Shape shape = {view->length};
  if (!check->Floats({&path, "mean"}, features.mean(), shape, &view->mean) ||
      !check->Floats({&path, "inverse_deviation"}, features.inverse_deviation(), shape, &view->inverse_deviation) ||
      !check->Floats({&path, "low"}, features.low(), shape, &view->low) ||
      !check->Floats({&path, "high"}, features.high(), shape, &view->high)) {
    return false;
  }
  for (uint32_t i = 0; i < view->length; ++i) {
    if (view->low[i] > view->high[i]) {
      return check->FailElement({&path, "low"}, view->low, i, sizeof(float), "a value above features.high",
                                "at most features.high");
    }
  }
  return true;
}

bool VerifyStaticStage(const StaticStage& stage, Checker* check, ModelView* model) {
  const Path path = {nullptr, "static_stage"};
  StaticStageView* view = &model->static_stage;
  if (!check->Joints({&path, "bones"}, stage.bones(), 1, model->joint_count)) return false;
  view->bones = stage.bones()->data();
  view->bone_count = stage.bones()->size();
  view->influences = stage.influences();
  if (!check->Count({&path, "influences"}, &stage, view->influences, 1, kernels::kMaxInfluences)) return false;
  const uint32_t n = model->vertex_count, m = view->bone_count;
  const Shape influences = {n, view->influences};
  const Path hidden = {&path, "hidden"};
  const float* pivots = nullptr;  // the run path needs only their increments, see skinning.h
  uint32_t width = 0;
  return check->Floats({&path, "pivots"}, stage.pivots(), {m, 3}, &pivots) &&
         check->Dimension({&hidden, "weights"}, stage.hidden()->weights(), 1, 1, kMaxWidth, &width) &&
         check->Linear(hidden, stage.hidden(), model->features.length, width, &view->hidden) &&
         check->Linear({&path, "increments"}, stage.increments(), width, 3 * m, &view->increments) &&
         check->Indices({&path, "influence_bones"}, stage.influence_bones(), influences, m, &view->influence_bones) &&
         check->WeightRows({&path, "influence_weights"}, stage.influence_weights(), influences,
                           &view->influence_weights);
}

bool VerifySkeletonStage(const SkeletonStage& stage, Checker* check, ModelView* model) {
  const Path path = {nullptr, "skeleton_stage"};
  SkeletonStageView* view = &model->skeleton_stage;
  const Path hidden = {&path, "hidden"};
  uint32_t units = 0;
  if (!check->Dimension({&hidden, "weights"}, stage.hidden()->weights(), 0, 1, kMaxCoefficients, &units) ||
      !check->Linear({&path, "input"}, stage.input(), model->features.length, 3 * units, &view->input) ||
      !check->Linear(hidden, stage.hidden(), units, 3 * units, &view->hidden)) {
    return false;
  }
  view->units = units;
  return true;
}

// Rows of the mesh graph: none empty, as each holds its own vertex, and all inside `columns`.
bool VerifyGraph(const MeshStage& stage, Checker* check, ModelView* model) {
  const Path parent = {nullptr, "mesh_stage"};
  const Path path = {&parent, "row_starts"};
  MeshStageView* view = &model->mesh_stage;
  const uint32_t n = model->vertex_count;
  if (!check->Words(path, stage.row_starts(), {n + 1}, &view->row_starts)) return false;
  const uint32_t* starts = view->row_starts;
  if (starts[0] != 0)
    return check->FailElement(path, starts, 0, sizeof(uint32_t), "a first row that does not start at 0", "0");
  const size_t bad = FindNotRising(starts, n);
  if (bad != n) {
    return check->FailElement(path, starts, bad + 1, sizeof(uint32_t),
                              "a row start that is not above the one before it",
                              "increasing row starts: each vertex is its own neighbour");
  }
  const Path last = {&path, nullptr, n};
  return check->Count(last, starts + n, starts[n], n, kMaxEdges) &&
         check->Indices({&parent, "columns"}, stage.columns(), {starts[n]}, n, &view->columns);
}

// A matrix of floats, which is there where no integers take its place.
bool VerifyMatrix(const Path& path, const MeshLayer& layer, const Tensor* tensor, bool wanted, Shape shape,
                  Checker* check, const float** values) {
  if (wanted == (tensor != nullptr)) return !wanted || check->Floats(path, tensor, shape, values);
  return wanted ? check->Fail(path, &layer, "no weights", "f32 weights here, or i8 weights for the whole layer")
                : check->Fail(path, tensor, "float weights in a layer with i8 weights", "one kind of weights");
}

bool VerifyIntegers(const MeshLayer& layer, const Path& path, bool first, uint32_t width, Checker* check,
                    MeshLayerView* view) {
  const uint32_t columns = (first ? 4 : 7) * width;
  const Path scales = {&path, "column_scales"}, steps = {&path, "input_inverse_steps"};
  if (layer.weights() == nullptr) {
    if (layer.column_scales() != nullptr)
      return check->Fail(scales, &layer, "scales in a layer with float weights", "scales only with i8 weights");
    return layer.input_inverse_steps() == nullptr ||
           check->Fail(steps, &layer, "steps in a layer with float weights", "steps only with i8 weights");
  }
  if (!check->Integers({&path, "weights"}, layer.weights(), {width, columns}, &view->integers) ||
      !check->Scales(scales, &layer, layer.column_scales(), columns, &view->column_scales)) {
    return false;
  }
  if (!first) return check->Scales(steps, &layer, layer.input_inverse_steps(), width, &view->input_inverse_steps);
  return layer.input_inverse_steps() == nullptr ||
         check->Fail(steps, &layer, "steps in the first layer", "none here: the inputs of this layer are not rounded");
}

bool VerifyLayer(const MeshLayer& layer, const Path& path, uint32_t input_width, uint32_t width, Checker* check,
                 MeshLayerView* view) {
  const bool floats = layer.weights() == nullptr, first = input_width == 3;
  view->prelu_slope = layer.prelu_slope();
  return VerifyMatrix({&path, "input_gates"}, layer, layer.input_gates(), floats || first, {input_width, 3 * width},
                      check, &view->input_gates) &&
         check->Floats({&path, "gate_bias"}, layer.gate_bias(), {3 * width}, &view->gate_bias) &&
         VerifyMatrix({&path, "hidden_gates"}, layer, layer.hidden_gates(), floats, {width, 2 * width}, check,
                      &view->hidden_gates) &&
         VerifyMatrix({&path, "hidden_candidate"}, layer, layer.hidden_candidate(), floats, {width, width}, check,
                      &view->hidden_candidate) &&
         VerifyMatrix({&path, "output"}, layer, layer.output(), floats, {width, width}, check, &view->output) &&
         VerifyIntegers(layer, path, first, width, check, view) &&
         check->Floats({&path, "output_bias"}, layer.output_bias(), {width}, &view->output_bias) &&
         check->Floats({&path, "norm_gain"}, layer.norm_gain(), {width}, &view->norm_gain) &&
         check->Floats({&path, "norm_offset"}, layer.norm_offset(), {width}, &view->norm_offset) &&
         check->Finite({&path, "prelu_slope"}, &layer, view->prelu_slope);
}

bool VerifyLayers(const MeshStage& stage, Checker* check, MeshStageView* view) {
  const Path path = {nullptr, "mesh_stage"};
  const uint32_t width = stage.feature_width();
  if (!check->Count({&path, "feature_width"}, &stage, width, kFeatureWidthStep, kMaxFeatureWidth)) return false;
  if (width % kFeatureWidthStep != 0) {
    return check->FailCount({&path, "feature_width"}, &stage, width, "", "a multiple of 8");
  }
  view->feature_width = width;
  view->layer_count = stage.layers()->size();
  if (!check->Count({&path, "layers.length"}, stage.layers(), view->layer_count, 1, kMaxLayers)) return false;
  for (uint32_t l = 0; l < view->layer_count; ++l) {
    const Path layer = {&path, "layers", l};
    if (!VerifyLayer(*stage.layers()->Get(l), layer, l == 0 ? 3 : width, width, check, &view->layers[l])) return false;
  }
  view->embed_bias = stage.embed_bias();
  return check->Floats({&path, "embed"}, stage.embed(), {width}, &view->embed) &&
         check->Finite({&path, "embed_bias"}, &stage, view->embed_bias);
}

bool VerifyMeshStage(const MeshStage& stage, Checker* check, ModelView* model) {
  const Path path = {nullptr, "mesh_stage"};
  MeshStageView* view = &model->mesh_stage;
  view->body_influences = stage.body_influences();
  if (!check->Count({&path, "body_influences"}, &stage, view->body_influences, 1, kernels::kMaxInfluences))
    return false;
  const uint32_t n = model->vertex_count;
  const Shape influences = {n, view->body_influences};
  const Path hidden = {&path, "hidden"}, coefficients = {&path, "coefficients"};
  uint32_t width = 0, basis = 0;
  return check->Floats({&path, "body_points"}, stage.body_points(), {n, 3}, &view->body_points) &&
         check->Indices({&path, "body_joints"}, stage.body_joints(), influences, model->joint_count,
                        &view->body_joints) &&
         check->WeightRows({&path, "body_weights"}, stage.body_weights(), influences, &view->body_weights) &&
         check->Floats({&path, "input_mean"}, stage.input_mean(), {3}, &view->input_mean) &&
         check->Floats({&path, "input_inverse_deviation"}, stage.input_inverse_deviation(), {3},
                       &view->input_inverse_deviation) &&
         VerifyGraph(stage, check, model) && VerifyLayers(stage, check, view) &&
         check->Dimension({&hidden, "weights"}, stage.hidden()->weights(), 1, 1, kMaxWidth, &width) &&
         check->Linear(hidden, stage.hidden(), n, width, &view->hidden) &&
         check->Dimension({&coefficients, "weights"}, stage.coefficients()->weights(), 1, 1, kMaxCoefficients,
                          &basis) &&
         check->Linear(coefficients, stage.coefficients(), width, basis, &view->coefficients);
}

// A reduced basis: its rank is the head's width, and the mesh stage speaks in the same coefficients.
bool VerifyHead(const Linear& head, const Path& path, Checker* check, ModelView* view) {
  const Path weights = {&path, "weights"};
  const uint32_t units = view->skeleton_stage.units;
  if (units == 0) return check->Fail(path, &head, "a head without a skeleton stage", "a skeleton stage, or no head");
  if (head.bias() != nullptr) return check->Fail({&path, "bias"}, &head, "a bias", "no bias in a head");
  uint32_t rank = 0;
  if (!check->Dimension(weights, head.weights(), 1, 2, kMaxCoefficients, &rank)) return false;
  if (rank % 2 != 0) return check->FailCount(weights, head.weights(), rank, " columns", "an even number of columns");
  if (view->mesh_stage.layer_count != 0 && view->mesh_stage.coefficients.columns != rank) {
    return check->FailCount(weights, head.weights(), rank, " columns", "as many as mesh_stage.coefficients has",
                            "both stages share the basis; convert the bundle again");
  }
  return check->Linear(path, &head, units, rank, &view->displacement.head);
}

bool VerifyDisplacement(const Model& model, Checker* check, ModelView* view) {
  const Path path = {nullptr, "displacement"};
  const Displacement* displacement = model.displacement();
  const Linear* head = displacement != nullptr ? displacement->head() : nullptr;
  if (head != nullptr && !VerifyHead(*head, {&path, "head"}, check, view)) return false;
  const uint32_t skeleton_rows =
      head != nullptr ? view->displacement.head.columns : PaddedToEven(view->skeleton_stage.units);
  const uint32_t mesh_rows = head != nullptr ? 0 : PaddedToEven(view->mesh_stage.coefficients.columns);
  const uint32_t found_skeleton = displacement != nullptr ? displacement->skeleton_rows() : 0;
  const uint32_t found_mesh = displacement != nullptr ? displacement->mesh_rows() : 0;
  const void* place = displacement != nullptr ? static_cast<const void*>(displacement) : &model;
  if (!check->Count({&path, "skeleton_rows"}, place, found_skeleton, skeleton_rows, skeleton_rows) ||
      !check->Count({&path, "mesh_rows"}, place, found_mesh, mesh_rows, mesh_rows)) {
    return false;
  }
  view->displacement.skeleton_rows = skeleton_rows;
  view->displacement.mesh_rows = mesh_rows;
  const Path basis_path = {&path, "basis"};
  const Linear* basis = displacement != nullptr ? displacement->basis() : nullptr;
  if (skeleton_rows == 0)
    return basis == nullptr ||
           check->Fail(basis_path, basis, "a basis without a skeleton stage", "a skeleton stage, or no basis");
  if (basis == nullptr)
    return check->Fail(basis_path, place, "no basis for the skeleton stage", "a basis, or no skeleton stage");
  if (basis->bias() != nullptr) return check->Fail({&basis_path, "bias"}, basis, "a bias", "no bias in the basis");
  return check->Linear(basis_path, basis, skeleton_rows + mesh_rows, 3 * view->vertex_count, &view->displacement.basis);
}

// Patches move the garment's vertices themselves.
bool VerifyOneMovingStage(const Model& model, Checker* check) {
  if (model.patch_stage() == nullptr) return true;
  const struct {
    const char* name;
    const void* table;
    const char* found;
  } others[] = {{"skeleton_stage", model.skeleton_stage(), "a skeleton stage beside a patch stage"},
                {"mesh_stage", model.mesh_stage(), "a mesh stage beside a patch stage"},
                {"displacement", model.displacement(), "a displacement beside a patch stage"}};
  for (const auto& other : others) {
    if (other.table == nullptr) continue;
    return check->Fail({nullptr, other.name}, other.table, other.found, "either a patch stage or this");
  }
  return true;
}

}  // namespace

bool VerifyContent(const Model& model, Checker* check, ModelView* view) {
  view->format_major = model.format_major();
  view->format_minor = model.format_minor();
  view->precision = model.precision() != nullptr ? model.precision()->c_str() : "";
  view->tick_rate = model.tick_rate();
  view->identity = model.identity();
  if (!(view->tick_rate >= kMinTickRate && view->tick_rate <= kMaxTickRate)) {
    char found[48];
    Text(found, sizeof(found)).AddNumber(static_cast<double>(view->tick_rate)).Add(" Hz");
    return check->Fail({nullptr, "tick_rate"}, &model, found, "0.001 to 1000 Hz");
  }
  if (model.mesh_stage() != nullptr && model.skeleton_stage() == nullptr) {
    return check->Fail({nullptr, "mesh_stage"}, model.mesh_stage(), "a mesh stage without a skeleton stage",
                       "both stages, or no mesh stage");
  }
  if (!VerifyOneMovingStage(model, check)) return false;
  return VerifyGarment(*model.garment(), check, view) && VerifyCharacter(*model.character(), check, view) &&
         VerifyFeatures(*model.features(), check, view) && VerifyStaticStage(*model.static_stage(), check, view) &&
         (model.skeleton_stage() == nullptr || VerifySkeletonStage(*model.skeleton_stage(), check, view)) &&
         (model.mesh_stage() == nullptr || VerifyMeshStage(*model.mesh_stage(), check, view)) &&
         (model.patch_stage() == nullptr || VerifyPatchStage(*model.patch_stage(), check, view)) &&
         VerifyDisplacement(model, check, view) && (model.body() == nullptr || VerifyBody(*model.body(), check, view));
}

}  // namespace dcloth::format
