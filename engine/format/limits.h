// What a model may hold at most. Each limit is far above any garment seen and keeps every size in this library below
// 2^31: the largest cloth, 65535 vertices with 8 layers of width 64, needs less than 256 MB (see cloth.cc).
#ifndef DCLOTH_ENGINE_FORMAT_LIMITS_H_
#define DCLOTH_ENGINE_FORMAT_LIMITS_H_

#include <cstdint>

namespace dcloth::format {

constexpr float kLargestFloat = 3.402823466e38f;  // all that is neither infinite nor NaN

constexpr uint32_t kFormatMajor = 1;
constexpr uint64_t kAlignment = 64;               // of the file, of its size and of every tensor
constexpr uint64_t kMaxModelBytes = 0x7FFFFFFEu;  // FlatBuffers' offsets are signed 32-bit

constexpr uint32_t kMinVertices = 3;
constexpr uint32_t kMaxVertices = 65535;  // u16 indices
constexpr uint32_t kMaxTriangles = 1u << 20;
constexpr uint32_t kMaxEdges = 1u << 24;  // entries of the mesh graph
constexpr uint32_t kMaxJoints = 256;      // u8 indices
constexpr uint32_t kNoParent = 0xFFFF;    // Character.parents
constexpr uint32_t kMaxNameBytes = 255;
constexpr uint32_t kMaxWidth = 16384;        // hidden units of a perceptron
constexpr uint32_t kMaxCoefficients = 4096;  // basis size of a stage
constexpr uint32_t kMinBodyVertices = 3;
constexpr uint32_t kMaxBodyVertices = 8192;
constexpr uint32_t kMaxBodyFaces = 16384;
constexpr uint32_t kMaxBodyRing = 32;     // faces around a vertex: bounds the work of a local search
constexpr uint32_t kMaxTouchClasses = 8;  // of garment vertices: bits of a byte
constexpr float kMinClearance = 1e-4f;    // metres
constexpr float kMaxClearance = 0.1f;
constexpr float kMaxReach = 10.0f;
constexpr uint32_t kMaxLayers = 8;
constexpr uint32_t kMaxFeatureWidth = 64;
constexpr uint32_t kFeatureWidthStep = 8;
constexpr uint32_t kMaxPatches = 256;  // u8 indices
constexpr uint32_t kMaxPatchPoints = 16;
constexpr uint32_t kMaxPatchWidth = 256;
constexpr uint32_t kPatchWidthStep = 8;
constexpr uint32_t kMaxMixes = 8;
constexpr uint32_t kMaxPatchNeighbours = 4;
constexpr uint32_t kMaxCapsules = 32;
constexpr uint32_t kMaxEmbedding = 32;
constexpr uint32_t kMaxSources = 32;
constexpr uint32_t kPointInfluences = 4, kLimbsAPatch = 2, kCapsulesALimb = 2;
constexpr uint32_t PatchInputs(uint32_t points, uint32_t embedding) { return 19 * points + 33 + embedding; }
constexpr uint32_t kFeaturesPerJoint = 9;
constexpr uint32_t kHipsFeatures = 4;  // of RootMotion
constexpr uint32_t kAirFeatures = 7;
constexpr float kMinTickRate = 0.001f;  // Hz; far below it a tick's length would be infinite
constexpr float kMaxTickRate = 1000.0f;

// Structural limits of the FlatBuffers verifier: Model > MeshStage > Linear > Tensor, and no more tables than the
// widest model of this major version has, with room for fields to come.
constexpr uint32_t kMaxTableDepth = 4;
constexpr uint32_t kMaxTables = 256;
constexpr uint32_t kMaxTensors = 160;

}  // namespace dcloth::format

#endif  // DCLOTH_ENGINE_FORMAT_LIMITS_H_
