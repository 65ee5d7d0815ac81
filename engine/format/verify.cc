#include "engine/format/verify.h"

#include <cstdint>

#include "engine/format/checker.h"
#include "engine/format/schema.h"
#include "engine/format/verify_content.h"

namespace dcloth::format {
namespace {

namespace fb = flatbuffers;

constexpr size_t kSmallestFile = 64;
constexpr size_t kIdentifierOffset = 4;

bool CheckBytes(const void* bytes, size_t size, Diagnostic* diagnostic) {
  if (bytes == nullptr) {
    return diagnostic->Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, nullptr, "a null pointer",
                            "a pointer to the bytes of a model", "load the .dcloth file and pass its bytes");
  }
  if (reinterpret_cast<uintptr_t>(bytes) % kAlignment != 0) {
    return diagnostic->Fail(DCLOTH_ERROR_ALIGNMENT, 0, nullptr, "model bytes that are not aligned to 64 bytes",
                            "an address divisible by 64",
                            "map the file, or allocate its memory with an alignment of 64");
  }
  if (size < kSmallestFile || size > kMaxModelBytes || size % kAlignment != 0) {
    return diagnostic->FailCount(DCLOTH_ERROR_FORMAT, kNoOffset, nullptr, size, " bytes",
                                 "a multiple of 64, from 64 to 2147483646",
                                 "check that this is a .dcloth file and that it is complete");
  }
  if (!fb::BufferHasIdentifier(bytes, ModelIdentifier())) {
    return diagnostic->Fail(DCLOTH_ERROR_FORMAT, kIdentifierOffset, nullptr, "a different file identifier", "DCLO",
                            "this file is not a .dcloth model; dcloth convert writes one");
  }
  return true;
}

fb::Verifier MakeVerifier(const uint8_t* bytes, size_t size) {
  fb::Verifier::Options options;
  options.max_depth = kMaxTableDepth;
  options.max_tables = kMaxTables;
  return fb::Verifier(bytes, size, options);
}

// The root table, far enough verified that its scalars can be read; null where even that fails.
const fb::Table* Root(const uint8_t* bytes, size_t size) {
  fb::Verifier verifier = MakeVerifier(bytes, size);
  const fb::uoffset_t offset = verifier.VerifyOffset(0);
  if (offset == 0) return nullptr;
  const auto* root = reinterpret_cast<const fb::Table*>(bytes + offset);
  if (!root->VerifyTableStart(verifier)) return nullptr;
  const bool readable = root->VerifyField<uint16_t>(verifier, Model::VT_FORMAT_MAJOR, sizeof(uint16_t)) &&
                        root->VerifyField<uint16_t>(verifier, Model::VT_FORMAT_MINOR, sizeof(uint16_t));
  return readable ? root : nullptr;
}

// Before the verifier proper: a file of another major version may have another structure.
bool CheckVersion(const uint8_t* bytes, size_t size, Diagnostic* diagnostic) {
  const fb::Table* root = Root(bytes, size);
  if (root == nullptr) {
    return diagnostic->Fail(DCLOTH_ERROR_FORMAT, 0, nullptr, "a broken root table", "a complete .dcloth file",
                            "the file is damaged or cut off; copy it again");
  }
  const uint16_t major = root->GetField<uint16_t>(Model::VT_FORMAT_MAJOR, 0);
  if (major == kFormatMajor) return true;
  const Path path = {nullptr, "format_major"};
  const auto* place = reinterpret_cast<const uint8_t*>(root);
  return diagnostic->FailCount(DCLOTH_ERROR_VERSION, static_cast<uint64_t>(place - bytes), &path, major, "", "1",
                               "convert the bundle again with the converter of this release");
}

// Whether the offsets of a vector lead forwards and inside. FlatBuffers' verifier follows them unchecked and only looks
// at where it arrives: with 32-bit addresses an offset that wraps leads backwards to a place that may be sound.
template <typename T>
bool OffsetsLeadInside(const uint8_t* bytes, size_t size, const fb::Vector<fb::Offset<T>>& vector) {
  for (uint32_t i = 0; i < vector.size(); ++i) {
    const uint8_t* const place = vector.Data() + i * sizeof(fb::uoffset_t);
    if (fb::ReadScalar<fb::uoffset_t>(place) >= size - static_cast<size_t>(place - bytes)) return false;
  }
  return true;
}

// Of a child that the verifier has passed.
bool VectorsLeadInside(const uint8_t* bytes, size_t size, const fb::Table& root, fb::voffset_t field) {
  if (field == Model::VT_CHARACTER)
    return OffsetsLeadInside(bytes, size, *root.GetPointer<const Character*>(field)->joint_names());
  if (field == Model::VT_MESH_STAGE) {
    const auto* const stage = root.GetPointer<const MeshStage*>(field);
    return stage == nullptr || OffsetsLeadInside(bytes, size, *stage->layers());
  }
  if (field != Model::VT_PATCH_STAGE) return true;
  const auto* const stage = root.GetPointer<const PatchStage*>(field);
  return stage == nullptr || OffsetsLeadInside(bytes, size, *stage->mix());
}

struct Child {
  const char* name;
  fb::voffset_t field;
  bool required;
  bool (*verify)(fb::Verifier& verifier, const fb::Table& root, fb::voffset_t field);
};

template <typename T>
bool VerifyChild(fb::Verifier& verifier, const fb::Table& root, fb::voffset_t field) {
  return root.VerifyOffset(verifier, field) && verifier.VerifyTable(root.GetPointer<const T*>(field));
}

bool VerifyText(fb::Verifier& verifier, const fb::Table& root, fb::voffset_t field) {
  return root.VerifyOffset(verifier, field) && verifier.VerifyString(root.GetPointer<const fb::String*>(field));
}

bool VerifyWeights(fb::Verifier& verifier, const fb::Table& root, fb::voffset_t field) {
  return root.VerifyOffset(verifier, field) &&
         verifier.VerifyVector(root.GetPointer<const fb::Vector<uint8_t>*>(field));
}

constexpr Child kChildren[] = {
    {"producer", Model::VT_PRODUCER, false, VerifyText},
    {"precision", Model::VT_PRECISION, false, VerifyText},
    {"garment", Model::VT_GARMENT, true, VerifyChild<Garment>},
    {"character", Model::VT_CHARACTER, true, VerifyChild<Character>},
    {"features", Model::VT_FEATURES, true, VerifyChild<Features>},
    {"static_stage", Model::VT_STATIC_STAGE, true, VerifyChild<StaticStage>},
    {"skeleton_stage", Model::VT_SKELETON_STAGE, false, VerifyChild<SkeletonStage>},
    {"mesh_stage", Model::VT_MESH_STAGE, false, VerifyChild<MeshStage>},
    {"displacement", Model::VT_DISPLACEMENT, false, VerifyChild<Displacement>},
    {"weights", Model::VT_WEIGHTS, true, VerifyWeights},
    {"body", Model::VT_BODY, false, VerifyChild<Body>},
    {"patch_stage", Model::VT_PATCH_STAGE, false, VerifyChild<PatchStage>},
};

// Of a place in the file. A broken vtable may put a field outside: then that of the root table.
uint64_t OffsetInside(const uint8_t* bytes, size_t size, const uint8_t* place, const fb::Table& root) {
  const uintptr_t offset = reinterpret_cast<uintptr_t>(place) - reinterpret_cast<uintptr_t>(bytes);
  return offset < size ? offset : static_cast<uint64_t>(reinterpret_cast<const uint8_t*>(&root) - bytes);
}

// FlatBuffers' verifier only says no. Goes through the root's children again to say where.
bool FailStructure(const uint8_t* bytes, size_t size, Diagnostic* diagnostic) {
  const fb::Table& root = *Root(bytes, size);
  constexpr char kFix[] = "the file is damaged or incomplete; convert the bundle again";
  for (const Child& child : kChildren) {
    const Path path = {nullptr, child.name};
    const uint8_t* place = root.GetAddressOf(child.field);
    if (child.required && place == nullptr) {
      const auto offset = static_cast<uint64_t>(reinterpret_cast<const uint8_t*>(&root) - bytes);
      return diagnostic->Fail(DCLOTH_ERROR_FORMAT, offset, &path, "no such field", "this field in every model", kFix);
    }
    fb::Verifier verifier = MakeVerifier(bytes, size);
    if (place != nullptr &&
        !(child.verify(verifier, root, child.field) && VectorsLeadInside(bytes, size, root, child.field))) {
      return diagnostic->Fail(DCLOTH_ERROR_FORMAT, OffsetInside(bytes, size, place, root), &path,
                              "a bad offset or length, a missing required field, or more than 256 tables",
                              "an intact file", kFix);
    }
  }
  return diagnostic->Fail(DCLOTH_ERROR_FORMAT, 0, nullptr, "a broken structure, or more than 256 tables",
                          "an intact file", kFix);
}

}  // namespace

bool Verify(const void* bytes, size_t size, ModelView* view, Diagnostic* diagnostic) {
  if (!CheckBytes(bytes, size, diagnostic)) return false;
  const auto* begin = static_cast<const uint8_t*>(bytes);
  if (!CheckVersion(begin, size, diagnostic)) return false;
  fb::Verifier verifier = MakeVerifier(begin, size);
  if (!VerifyModelBuffer(verifier)) return FailStructure(begin, size, diagnostic);
  const fb::Table& root = *Root(begin, size);
  for (const fb::voffset_t field : {Model::VT_CHARACTER, Model::VT_MESH_STAGE, Model::VT_PATCH_STAGE}) {
    if (!VectorsLeadInside(begin, size, root, field)) return FailStructure(begin, size, diagnostic);
  }

  const Model& model = *GetModel(bytes);
  const uint8_t* weights = model.weights()->Data();
  if (reinterpret_cast<uintptr_t>(weights) % kAlignment != 0) {
    const Path path = {nullptr, "weights"};
    return diagnostic->Fail(DCLOTH_ERROR_FORMAT, static_cast<uint64_t>(weights - begin), &path,
                            "data that is not aligned to 64 bytes", "data aligned to 64 bytes",
                            "write the model with FLATBUFFERS_MAX_ALIGNMENT=64");
  }
  Checker checker(begin, weights, model.weights()->size(), diagnostic);
  ModelView result = {};
  if (!VerifyContent(model, &checker, &result)) return false;
  *view = result;
  return true;
}

}  // namespace dcloth::format
