#include "engine/src/draw/output.h"

#include <cstdint>
#include <cstring>

namespace dcloth::engine {
namespace {

constexpr uint32_t kPositionElements = 3, kNormalElements = 3, kTangentElements = 4;

struct Attribute {
  void* data;
  uint32_t stride_bytes, format, elements;
};

Attribute Positions(const dcloth_output& o) {
  return {o.positions, o.position_stride_bytes, o.position_format, kPositionElements};
}
Attribute Normals(const dcloth_output& o) {
  return {o.normals, o.normal_stride_bytes, o.normal_format, kNormalElements};
}
Attribute Tangents(const dcloth_output& o) {
  return {o.tangents, o.tangent_stride_bytes, o.tangent_format, kTangentElements};
}

uint32_t ElementBytes(uint32_t format) { return format == DCLOTH_FORMAT_FLOAT16 ? 2 : 4; }

bool IsAligned(const void* pointer, size_t bytes) { return reinterpret_cast<uintptr_t>(pointer) % bytes == 0; }

bool IsUsable(const Attribute& a) {
  if (a.format > DCLOTH_FORMAT_FLOAT16) return false;
  const uint32_t bytes = ElementBytes(a.format);
  return IsAligned(a.data, bytes) && a.stride_bytes >= a.elements * bytes && a.stride_bytes % bytes == 0;
}

bool IsHalf(const Attribute& a) { return a.data != nullptr && a.format == DCLOTH_FORMAT_FLOAT16; }

float* At(float* values, size_t stride_bytes, size_t vertex) {
  return reinterpret_cast<float*>(reinterpret_cast<uint8_t*>(values) + stride_bytes * vertex);
}

// From scratch to the host's buffer.
void Store(const kernels::KernelTable& kernels, const Attribute& attribute, const float* scratch, size_t vertices) {
  if (attribute.format == DCLOTH_FORMAT_FLOAT16) {
    kernels.store_half(
        {scratch, static_cast<uint16_t*>(attribute.data), attribute.stride_bytes, attribute.elements, vertices});
    return;
  }
  auto* to = static_cast<uint8_t*>(attribute.data);
  const size_t bytes = attribute.elements * sizeof(float);
  for (size_t i = 0; i < vertices; ++i)
    std::memcpy(to + i * attribute.stride_bytes, scratch + i * attribute.elements, bytes);
}

}  // namespace

DrawnMesh MeshOf(const format::ModelView& model, const dcloth_output& output) {
  if ((output.flags & DCLOTH_OUTPUT_COARSE) == 0)
    return {nullptr, model.faces, model.vertex_count, model.triangle_count};
  return {model.coarse.vertices, model.coarse.faces, model.coarse.vertex_count, model.coarse.triangle_count};
}

DrawnMesh TexturedMeshOf(const format::ModelView& model, const dcloth_output& output, const DrawnMesh& mesh) {
  if ((output.flags & DCLOTH_OUTPUT_TEXTURED) == 0) return mesh;
  return {nullptr, model.texture.faces, model.texture.vertex_count, model.triangle_count};
}

void RepeatSeams(const format::ModelView& model, const dcloth_output& output, const Surface& surface) {
  if ((output.flags & DCLOTH_OUTPUT_TEXTURED) == 0) return;
  for (uint32_t i = model.vertex_count; i < model.texture.vertex_count; ++i) {
    const uint16_t from = model.texture.seam_vertices[i - model.vertex_count];
    std::memcpy(surface.PositionOf(i), surface.PositionOf(from), kPositionElements * sizeof(float));
    if (surface.normals == nullptr) continue;
    std::memcpy(At(surface.normals, surface.normal_stride_bytes, i),
                At(surface.normals, surface.normal_stride_bytes, from), kNormalElements * sizeof(float));
  }
}

bool CheckOutput(const dcloth_output& output, const format::ModelView& model, format::Diagnostic* diagnostic) {
  const auto refuse = [diagnostic](const char* field, const char* found, const char* allowed) {
    const format::Path parent = {nullptr, "output"}, path = {&parent, field};
    return diagnostic->Fail(DCLOTH_ERROR_ARGUMENT, format::kNoOffset, &path, found, allowed, "");
  };
  constexpr uint32_t kNotCoarse = DCLOTH_OUTPUT_OUTSIDE_BODY | DCLOTH_OUTPUT_TEXTURED,
                     kFlags = kNotCoarse | DCLOTH_OUTPUT_COARSE;
  if ((output.flags & ~kFlags) != 0) return refuse("flags", "an unknown flag", "DCLOTH_OUTPUT_* or 0");
  const bool coarse = (output.flags & DCLOTH_OUTPUT_COARSE) != 0;
  if (coarse && model.coarse.vertex_count == 0)
    return refuse("flags", "DCLOTH_OUTPUT_COARSE, for a model without a coarse mesh",
                  "a model of format 1.6 that has one");
  if (coarse && (output.flags & kNotCoarse) != 0)
    return refuse("flags", "DCLOTH_OUTPUT_COARSE with another flag", "DCLOTH_OUTPUT_COARSE alone, or the others");
  const bool textured = (output.flags & DCLOTH_OUTPUT_TEXTURED) != 0;
  if (textured && model.texture.vertex_count == 0)
    return refuse("flags", "DCLOTH_OUTPUT_TEXTURED, for a model without texture coordinates",
                  "a model of format 1.7 that has some");
  const uint32_t vertex_count = TexturedMeshOf(model, output, MeshOf(model, output)).vertex_count;
  if (output.vertex_count != vertex_count) {
    const format::Path parent = {nullptr, "output"}, path = {&parent, "vertex_count"};
    char allowed[48];
    format::Text(allowed, sizeof(allowed))
        .Add(uint64_t{vertex_count})
        .Add(coarse     ? ", of the model's coarse mesh"
             : textured ? ", of the model's texture"
                        : ", the model's");
    return diagnostic->FailCount(DCLOTH_ERROR_ARGUMENT, format::kNoOffset, &path, output.vertex_count, "", allowed, "");
  }
  constexpr char kAttribute[] = "an invalid pointer, stride or format";
  constexpr char kAttributes[] =
      "DCLOTH_FORMAT_*; address and stride divisible by the size of a number; stride no less than the attribute's "
      "bytes";
  if (output.positions == nullptr) return refuse("positions", "a null pointer", "memory for the positions");
  if (!IsUsable(Positions(output))) return refuse("positions", kAttribute, kAttributes);
  if (output.normals != nullptr && !IsUsable(Normals(output))) return refuse("normals", kAttribute, kAttributes);
  if (output.tangents != nullptr) {
    if (output.normals == nullptr) return refuse("tangents", "tangents without normals", "both, or normals alone");
    if (!IsUsable(Tangents(output))) return refuse("tangents", kAttribute, kAttributes);
    const bool given = output.texture_coordinates != nullptr;
    const bool usable = given && IsAligned(output.texture_coordinates, sizeof(float)) &&
                        output.texture_stride_bytes >= 2 * sizeof(float) &&
                        output.texture_stride_bytes % sizeof(float) == 0;
    if (!usable && (given || !textured)) {
      return refuse("texture_coordinates", "none, or off their alignment",
                    "two floats per vertex, aligned to 4 bytes; tangents need them");
    }
  }
  if (output.bounds != nullptr && !IsAligned(output.bounds, sizeof(float)))
    return refuse("bounds", "a misaligned pointer", "six floats on a multiple of 4");
  const size_t scratch = ScratchBytes(output);
  if (scratch == 0 ||
      (output.scratch != nullptr && IsAligned(output.scratch, sizeof(float)) && output.scratch_size >= scratch)) {
    return true;
  }
  return refuse("scratch", "too few bytes, or a null or misaligned pointer",
                "dcloth_output_scratch_size bytes on a multiple of 4");
}

size_t ScratchBytes(const dcloth_output& output) {
  if (!IsHalf(Positions(output)) && !IsHalf(Normals(output)) && !IsHalf(Tangents(output))) return 0;
  const size_t floats = kPositionElements + (output.normals != nullptr ? kNormalElements : 0) +
                        (output.tangents != nullptr ? kTangentElements : 0);
  return floats * sizeof(float) * output.vertex_count;
}

Surface SurfaceOf(const dcloth_output& output) {
  if (ScratchBytes(output) == 0) {
    return {static_cast<float*>(output.positions), output.position_stride_bytes,
            static_cast<float*>(output.normals),   output.normal_stride_bytes,
            static_cast<float*>(output.tangents),  output.tangent_stride_bytes};
  }
  const size_t n = output.vertex_count;
  Surface surface = {};
  surface.positions = static_cast<float*>(output.scratch);
  surface.position_stride_bytes = kPositionElements * sizeof(float);
  float* next = surface.positions + kPositionElements * n;
  if (output.normals != nullptr) {
    surface.normals = next;
    surface.normal_stride_bytes = kNormalElements * sizeof(float);
    next += kNormalElements * n;
  }
  if (output.tangents != nullptr) {
    surface.tangents = next;
    surface.tangent_stride_bytes = kTangentElements * sizeof(float);
  }
  return surface;
}

void FinishOutput(const kernels::KernelTable& kernels, const float origin[3], bool mirrored, const Surface& surface,
                  const dcloth_output& output) {
  const size_t n = output.vertex_count;
  kernels.move({surface.positions, surface.position_stride_bytes, origin, output.bounds, n});
  if (mirrored && surface.normals != nullptr) {
    for (size_t i = 0; i < n; ++i) {
      float* normal = At(surface.normals, surface.normal_stride_bytes, i);
      for (int c = 0; c < 3; ++c) normal[c] = -normal[c];
    }
  }
  if (ScratchBytes(output) == 0) return;
  Store(kernels, Positions(output), surface.positions, n);
  if (surface.normals != nullptr) Store(kernels, Normals(output), surface.normals, n);
  if (surface.tangents != nullptr) Store(kernels, Tangents(output), surface.tangents, n);
}

}  // namespace dcloth::engine
