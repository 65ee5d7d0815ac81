// A character of Godot as the garment takes it: the bones of a Skeleton3D and the skin of meshes that it moves.
#ifndef DCLOTH_PLATFORMS_GODOT_SRC_WEARER_H_
#define DCLOTH_PLATFORMS_GODOT_SRC_WEARER_H_

#include <godot_cpp/classes/mesh_instance3d.hpp>
#include <godot_cpp/classes/skeleton3d.hpp>
#include <godot_cpp/variant/transform3d.hpp>
#include <vector>

#include "garment/garment.h"

// Columns of a transform, one after the other.
void PutColumns(const godot::Transform3D& transform, double columns[16]);

// Bones stand as the skins of `bodies` bound them, or at rest where none binds them. `skins` false leaves the vertices
// out. The skeleton's turn and scale in the world count; its place does not.
dcloth::platforms::Wearer WearerOf(const godot::Skeleton3D& skeleton,
                                   const std::vector<const godot::MeshInstance3D*>& bodies, bool skins);

#endif  // DCLOTH_PLATFORMS_GODOT_SRC_WEARER_H_
