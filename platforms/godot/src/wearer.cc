#include "wearer.h"

#include <algorithm>
#include <godot_cpp/classes/mesh.hpp>
#include <godot_cpp/classes/skin.hpp>
#include <numeric>

using namespace godot;
using dcloth::platforms::Wearer;

namespace {

// For each bind of a skin its bone; -1 where the skeleton has none.
std::vector<int> BonesOf(const Skin& skin, const Skeleton3D& skeleton) {
  std::vector<int> bones;
  for (int b = 0; b < skin.get_bind_count(); ++b) {
    const StringName name = skin.get_bind_name(b);
    bones.push_back(name.is_empty() ? skin.get_bind_bone(b) : skeleton.find_bone(name));
    if (bones.back() >= skeleton.get_bone_count()) bones.back() = -1;
  }
  return bones;
}

// The vertices of one surface. Morphs are left out: the skin at rest has none.
void AddSurface(const Mesh& mesh, int surface, const std::vector<int>& bones, const Transform3D& to_world,
                Wearer* wearer) {
  const Array arrays = mesh.surface_get_arrays(surface);
  const PackedVector3Array points = arrays[Mesh::ARRAY_VERTEX];
  const PackedInt32Array binds = arrays[Mesh::ARRAY_BONES];
  const PackedFloat32Array weights = arrays[Mesh::ARRAY_WEIGHTS];
  const PackedInt32Array corners = arrays[Mesh::ARRAY_INDEX];
  if (points.is_empty() || binds.size() != weights.size() || binds.size() % points.size() != 0) return;
  const auto influences = static_cast<size_t>(binds.size() / points.size());
  if (influences == 0 || influences > Wearer::kInfluences) return;

  const uint32_t first = wearer->body_vertex_count();
  for (int64_t v = 0; v < points.size(); ++v) {
    uint32_t joints[Wearer::kInfluences];
    float shares[Wearer::kInfluences];
    for (size_t i = 0; i < influences; ++i) {
      const int64_t at = v * static_cast<int64_t>(influences) + static_cast<int64_t>(i);
      const int32_t bind = binds[at];
      const int bone = bind >= 0 && static_cast<size_t>(bind) < bones.size() ? bones[static_cast<size_t>(bind)] : -1;
      joints[i] = static_cast<uint32_t>(std::max(bone, 0));
      shares[i] = bone < 0 ? 0.0f : weights[at];
    }
    const Vector3 p = to_world.xform(points[v]);
    const double place[3] = {p.x, p.y, p.z};
    wearer->AddBodyVertex(place, joints, shares, influences);
  }
  std::vector<uint32_t> triangles(static_cast<size_t>(corners.is_empty() ? points.size() : corners.size()));
  if (corners.is_empty()) {
    std::iota(triangles.begin(), triangles.end(), first);
  } else {
    std::transform(corners.ptr(), corners.ptr() + corners.size(), triangles.begin(),
                   [first](int32_t corner) { return first + static_cast<uint32_t>(corner); });
  }
  wearer->body_triangles.insert(wearer->body_triangles.end(), triangles.begin(), triangles.end());
}

}  // namespace

void PutColumns(const Transform3D& transform, double columns[16]) {
  for (int c = 0; c < 4; ++c) {
    const Vector3 column = c < 3 ? transform.basis.get_column(c) : transform.origin;
    columns[4 * c] = column.x;
    columns[4 * c + 1] = column.y;
    columns[4 * c + 2] = column.z;
    columns[4 * c + 3] = c < 3 ? 0 : 1;
  }
}

Wearer WearerOf(const Skeleton3D& skeleton, const std::vector<const MeshInstance3D*>& bodies, bool skins) {
  const Transform3D to_world(skeleton.get_global_transform().basis, Vector3());
  std::vector<Transform3D> binds;
  for (int b = 0; b < skeleton.get_bone_count(); ++b) binds.push_back(skeleton.get_bone_global_rest(b));
  Wearer wearer;
  for (const MeshInstance3D* body : bodies) {
    const Ref<Skin> skin = body->get_skin();
    const Ref<Mesh> mesh = body->get_mesh();
    if (skin.is_null() || mesh.is_null()) continue;
    const std::vector<int> bones = BonesOf(**skin, skeleton);
    for (size_t b = 0; b < bones.size(); ++b) {
      if (bones[b] < 0) continue;
      binds[static_cast<size_t>(bones[b])] = skin->get_bind_pose(static_cast<int32_t>(b)).affine_inverse();
    }
    for (int s = 0; skins && s < mesh->get_surface_count(); ++s) AddSurface(**mesh, s, bones, to_world, &wearer);
  }
  for (size_t b = 0; b < binds.size(); ++b) {
    double columns[16];
    PutColumns(to_world * binds[b], columns);
    wearer.AddJoint(skeleton.get_bone_name(static_cast<int32_t>(b)).utf8().get_data(), columns);
  }
  return wearer;
}
