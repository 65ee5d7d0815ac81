// A verified model as plain pointers and counts: all that the engine sees of a file. Pointers lead into the model
// bytes; only Verify fills a view, and every rule it checked holds here. Shapes in brackets, as in dcloth.fbs.
#ifndef DCLOTH_ENGINE_FORMAT_VIEW_H_
#define DCLOTH_ENGINE_FORMAT_VIEW_H_

#include <cstdint>

#include "engine/format/limits.h"

namespace dcloth::format {

enum class WeightType : uint8_t { kF32, kF16, kI8 };

// y[c] = sum_j x[j] W[j][c] + bias[c]. Weights are any bits at all: NaN weights give NaN vertices, never a fault.
struct LinearView {
  const void* weights;         // panels, or pair panels for kI8
  const float* row_scales;     // [rows], kI8 only; null for ones in a patch stage
  const float* column_scales;  // [padded columns], kI8 only
  const float* bias;           // [padded columns], or null for zero
  uint32_t rows;
  uint32_t columns;
  WeightType type;
};

// RootMotion of the file.
enum class RootKind : uint8_t { kNone, kHips, kAir };

constexpr uint32_t RootFeatures(RootKind kind) {
  return kind == RootKind::kAir ? kAirFeatures : kind == RootKind::kHips ? kHipsFeatures : 0;
}

struct FeaturesView {
  const uint16_t* joints;  // [joint_count]
  const float* mean;       // [length], as the next three
  const float* inverse_deviation;
  const float* low;
  const float* high;
  uint32_t joint_count;
  uint32_t length;  // d
  RootKind root;
};

struct StaticStageView {
  const uint16_t* bones;           // [bone_count], joint of each bone
  const uint8_t* influence_bones;  // [n, influences]
  const float* influence_weights;  // [n, influences]
  LinearView hidden;               // d -> width
  LinearView increments;           // width -> 3 m
  uint32_t bone_count;             // m
  uint32_t influences;             // K
};

struct SkeletonStageView {
  LinearView input;   // d -> 3 k
  LinearView hidden;  // k -> 3 k
  uint32_t units;     // k, 0 where the model has no such stage
};

// Float matrices, or `integers` in place of all but the first layer's input_gates.
struct MeshLayerView {
  const float* input_gates;
  const float* gate_bias;
  const float* hidden_gates;
  const float* hidden_candidate;
  const float* output;
  const float* output_bias;
  const float* norm_gain;
  const float* norm_offset;
  const int8_t* integers;            // [F, 7 F], in layer 0 [F, 4 F]; or null
  const float* column_scales;        // [7 F] or [4 F]
  const float* input_inverse_steps;  // [F], not in layer 0
  float prelu_slope;
};

struct MeshStageView {
  const float* body_points;              // [n, 3]
  const uint8_t* body_joints;            // [n, body_influences]
  const float* body_weights;             // [n, body_influences]
  const float* input_mean;               // [3]
  const float* input_inverse_deviation;  // [3]
  const uint32_t* row_starts;            // [n + 1]
  const uint16_t* columns;
  const float* embed;       // [F]
  LinearView hidden;        // n -> h
  LinearView coefficients;  // h -> k_M, or r with a head
  MeshLayerView layers[kMaxLayers];
  uint32_t layer_count;  // 0 where the model has no such stage
  uint32_t body_influences;
  uint32_t feature_width;  // F
  float embed_bias;
};

struct DisplacementView {
  LinearView basis;        // [skeleton_rows + mesh_rows, 3 n]
  LinearView head;         // k_S -> r, r = skeleton_rows; no rows where the basis is not reduced
  uint32_t skeleton_rows;  // 0 without a skeleton stage
  uint32_t mesh_rows;      // 0 without a mesh stage or with a head
};

// NETWORK.md, Patch stage: K patches of R points, L mixing layers, S neighbours, P = K R.
struct PatchStageView {
  const uint8_t* joints;          // [K]
  const float* axes;              // [K, 3, 3]
  const float* centres;           // [K, 3]
  const uint8_t* point_joints;    // [P, 4]
  const float* point_parts;       // [P, 4, 4]
  const uint8_t* capsule_joints;  // [C]
  const float* capsules;          // [C, 8]
  const uint8_t* limbs;           // [K, 2, 2]
  const uint8_t* near;            // [L, S, K], null where S is 0
  const float* embedding;         // [K, E], null where E is 0
  const float* keep;              // [R]
  const uint16_t* sources;        // [P, M]
  const uint16_t* vertices;       // [n], a permutation
  const uint32_t* group_starts;   // [P + 1], rising
  LinearView enter;               // 19 R + 33 + E -> W
  LinearView mix[kMaxMixes];      // (1 + S) W -> W
  LinearView input_gates;         // W -> 3 W
  LinearView hidden_gates;        // W -> 3 W
  LinearView out;                 // W + 19 R + 33 + E -> 3 R
  LinearView map;                 // 3 M -> the groups' columns, each group's padded
  uint32_t patch_count;           // K, 0 where the model has no such stage
  uint32_t point_count;           // R
  uint32_t width;                 // W
  uint32_t neighbour_count;       // S
  uint32_t layer_count;           // L
  uint32_t embedding_size;        // E
  uint32_t capsule_count;         // C
  uint32_t source_count;          // M
};

// The colliding surface; all null and zero where the model has none.
struct BodyView {
  const float* positions;      // [vertex_count, 3]
  const uint8_t* joints;       // [vertex_count, influences]
  const float* weights;        // [vertex_count, influences]
  const uint16_t* faces;       // [face_count, 3]
  const uint32_t* row_starts;  // [vertex_count + 1], into columns; 1 to kMaxBodyRing apart
  const uint16_t* columns;     // [3 face_count], faces around each vertex
  uint32_t vertex_count;       // b
  uint32_t face_count;
  uint32_t influences;
  const uint8_t* touch_classes;   // [n], class of each garment vertex; null where every one touches all of the body
  const uint8_t* touched_by;      // [vertex_count], bit c: touched by class c; null with the one before
  const uint16_t* garment_order;  // [n], indices; null before 1.5
  const uint16_t* sites;          // [groups, 16], indices of body vertices; null before 1.5 and without classes
  float clearance;                // metres
  float reach;                    // metres
};

// Some of the garment's vertices, and triangles between them: what is drawn at a distance. All null and zero where the
// model has none.
struct CoarseMeshView {
  const uint16_t* vertices;  // [vertex_count], rising
  const uint16_t* faces;     // [triangle_count, 3], indices into `vertices`
  uint32_t vertex_count;
  uint32_t triangle_count;
};

// Where the garment's surface lies in a texture; all null and zero where the model does not say.
struct TextureView {
  const float* coordinates;       // [vertex_count, 2]
  const uint16_t* seam_vertices;  // [vertex_count - n]: the garment's vertex that vertex n + i repeats; null for none
  const uint16_t* faces;          // [triangle_count, 3], indices of drawn vertices
  uint32_t vertex_count;          // n and the seams'
};

struct ModelView {
  const char* name;
  const char* precision;
  const void* joint_names;          // read through JointName
  const uint16_t* parents;          // [joint_count], kNoParent at the top; null where the file has none
  const float* inverse_bind;        // [joint_count, 12]
  const float* template_positions;  // [n, 3]
  const uint16_t* faces;            // [triangle_count, 3]
  FeaturesView features;
  StaticStageView static_stage;
  SkeletonStageView skeleton_stage;
  MeshStageView mesh_stage;
  DisplacementView displacement;
  PatchStageView patch_stage;  // since 1.8
  BodyView body;
  CoarseMeshView coarse;  // since 1.6
  TextureView texture;    // since 1.7
  uint32_t joint_count;
  uint32_t hips;
  uint32_t vertex_count;  // n
  uint32_t triangle_count;
  uint32_t format_major;
  uint32_t format_minor;
  float tick_rate;    // Hz
  uint64_t identity;  // told by the file's writer; 0 before 1.2
};

// Terminated; null past the end.
const char* JointName(const ModelView& model, uint32_t index);

}  // namespace dcloth::format

#endif  // DCLOTH_ENGINE_FORMAT_VIEW_H_
