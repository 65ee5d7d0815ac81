// One named fault in an otherwise sound model file, and what the verification ladder must say about it.
#ifndef DCLOTH_TESTS_ATTACK_CORRUPTION_H_
#define DCLOTH_TESTS_ATTACK_CORRUPTION_H_

#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <ostream>
#include <vector>

#include "dcloth/dcloth.h"
#include "tests/unit/engine/model_builder.h"

namespace dcloth::testing {

// Each fault spoils either the tables before they are packed or the bytes of the packed file.
struct Corruption {
  const char* name;
  dcloth_status status;
  const char* field;   // must begin the error text; empty where no field is concerned
  const char* reason;  // must occur in it: what was found, what is allowed
  std::function<void(format::ModelT*)> tables = nullptr;
  std::function<void(AlignedBytes*)> bytes = nullptr;
  format::DType precision = format::DType_I8;
  uint32_t stages = DCLOTH_STAGES_MESH;  // of the sound model
  bool integer_layers = false;           // in it
  bool touch = false;                    // a body in parts in it
  bool coarse = false;                   // a coarse mesh in it
  bool texture = false;                  // texture coordinates in it
  uint32_t rank = 0;                     // of its basis, where that is reduced
  uint32_t patches = 0;                  // in it
};

inline void PrintTo(const Corruption& corruption, std::ostream* out) { *out << corruption.name; }

// By the rung of the ladder that refuses them.
std::vector<Corruption> StructureCorruptions();  // offsets, lengths, missing fields, tables that are shared
std::vector<Corruption> GarmentCorruptions();    // version, rates, names, joints, features
std::vector<Corruption> TensorCorruptions();     // dtypes, shapes, ranges, scales
std::vector<Corruption> StageCorruptions();      // indices, rows, layers, stages that do not fit each other
std::vector<Corruption> BodyCorruptions();       // the body, touch classes, a reduced basis
std::vector<Corruption> PatchCorruptions();      // the patch stage

// The file after the fault.
AlignedBytes Corrupted(const Corruption& corruption);
// The same without it.
AlignedBytes SoundTwin(const Corruption& corruption);

constexpr dcloth_status kFormat = DCLOTH_ERROR_FORMAT;
constexpr dcloth_status kSemantics = DCLOTH_ERROR_SEMANTICS;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A stored element of a tensor.
template <typename T>
T* Data(format::ModelT* model, const format::TensorT& tensor, size_t element = 0) {
  return reinterpret_cast<T*>(model->weights.data() + tensor.offset) + element;
}

std::unique_ptr<format::TensorT> Copy(const format::TensorT& tensor);
std::unique_ptr<format::MeshLayerT> Copy(const format::MeshLayerT& layer);

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_ATTACK_CORRUPTION_H_
