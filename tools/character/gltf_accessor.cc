#include "tools/character/gltf_accessor.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "tools/character/matrix_values.h"

namespace dcloth::tools {
namespace {

constexpr size_t kMostZeros = size_t{1} << 24;  // values of an accessor that has no bytes

template <typename Number>
double Load(const std::byte* at) {
  Number number;
  std::memcpy(&number, at, sizeof(number));
  return static_cast<double>(number);
}

double Component(const std::byte* at, int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return Load<int8_t>(at);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return Load<uint8_t>(at);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return Load<int16_t>(at);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return Load<uint16_t>(at);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return Load<uint32_t>(at);
    default:
      return Load<float>(at);
  }
}

// glTF 2.0, 3.11: what an integer is divided by.
double Largest(int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return std::numeric_limits<int8_t>::max();
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return std::numeric_limits<uint8_t>::max();
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return std::numeric_limits<int16_t>::max();
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return std::numeric_limits<uint16_t>::max();
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return std::numeric_limits<uint32_t>::max();
    default:
      return 1;
  }
}

bool IsComponent(int type) {
  return (type >= TINYGLTF_COMPONENT_TYPE_BYTE && type <= TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT) ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT || type == TINYGLTF_COMPONENT_TYPE_FLOAT;
}

bool IsUnsigned(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE || type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

size_t Bytes(int type) { return static_cast<size_t>(tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(type))); }

}  // namespace

const tinygltf::Accessor& GltfAccessors::Find(int accessor, const std::string& where) const {
  if (accessor < 0 || static_cast<size_t>(accessor) >= model_.accessors.size()) {
    Refuse(file_, "accessor " + std::to_string(accessor) + " for " + where,
           "one of the file's " + std::to_string(model_.accessors.size()), "the file is damaged; export it again");
  }
  return model_.accessors[static_cast<size_t>(accessor)];
}

int GltfAccessors::Width(int accessor, const std::string& where) const {
  return tinygltf::GetNumComponentsInType(static_cast<uint32_t>(Find(accessor, where).type));
}

std::span<const std::byte> GltfAccessors::View(int view, const std::string& where) const {
  const auto refuse = [&](const std::string& found, const std::string& expected) {
    Refuse(file_, found + " for " + where, expected, "the file is damaged or cut off; export it again");
  };
  const std::string name = "buffer view " + std::to_string(view);
  if (view < 0 || static_cast<size_t>(view) >= model_.bufferViews.size())
    refuse(name, "one of the file's " + std::to_string(model_.bufferViews.size()));
  const tinygltf::BufferView& found = model_.bufferViews[static_cast<size_t>(view)];
  if (found.buffer < 0 || static_cast<size_t>(found.buffer) >= model_.buffers.size())
    refuse(name + " in buffer " + std::to_string(found.buffer), std::to_string(model_.buffers.size()) + " buffers");
  const std::vector<unsigned char>& data = model_.buffers[static_cast<size_t>(found.buffer)].data;
  if (found.byteOffset > data.size() || found.byteLength > data.size() - found.byteOffset) {
    refuse(
        name + " of " + std::to_string(found.byteLength) + " bytes at byte " + std::to_string(found.byteOffset),
        "a range of buffer " + std::to_string(found.buffer) + ", which has " + std::to_string(data.size()) + " bytes");
  }
  return std::as_bytes(std::span(data)).subspan(found.byteOffset, found.byteLength);
}

template <typename Value, typename Convert>
std::vector<Value> GltfAccessors::Read(int accessor, int width, const std::string& where,
                                       const Convert& convert) const {
  const tinygltf::Accessor& from = Find(accessor, where);
  const std::string name = "accessor " + std::to_string(accessor);
  const auto refuse = [&](const std::string& found, const std::string& expected) {
    Refuse(file_, name + " with " + found + " for " + where, expected, "the file is damaged; export it again");
  };
  if (Width(accessor, where) != width || !IsComponent(from.componentType)) {
    refuse(std::to_string(Width(accessor, where)) + " components of type " + std::to_string(from.componentType),
           std::to_string(width) + " components of glTF's types");
  }
  const auto components = static_cast<size_t>(width);
  const size_t component = Bytes(from.componentType), element = components * component, count = from.count;
  // Values that follow one another in a view, each at `stride`.
  const auto values_of = [&](int view, size_t offset, size_t stride, size_t size, size_t wanted) {
    const std::span<const std::byte> bytes = View(view, where);
    if (stride < size || offset > bytes.size() || (wanted != 0 && bytes.size() - offset < size) ||
        (wanted > 1 && (bytes.size() - offset - size) / stride < wanted - 1)) {
      refuse(
          std::to_string(wanted) + " values of " + std::to_string(size) + " bytes at byte " + std::to_string(offset),
          "a range of buffer view " + std::to_string(view) + ", which has " + std::to_string(bytes.size()) + " bytes");
    }
    return bytes.data() + offset;
  };
  if (from.bufferView < 0 && count > kMostZeros / components)
    refuse(std::to_string(count) + " values and no bytes", "at most " + std::to_string(kMostZeros) + " numbers");
  std::vector<Value> out;
  if (from.bufferView < 0) out.resize(count * components);
  const auto decode = [&](const std::byte* at, Value* to) {
    for (size_t c = 0; c < components; ++c) to[c] = convert(Component(at + c * component, from.componentType), from);
  };
  if (from.bufferView >= 0) {
    View(from.bufferView, where);  // before its stride is read
    const size_t told = model_.bufferViews[static_cast<size_t>(from.bufferView)].byteStride;
    const size_t stride = told == 0 ? element : told;
    const std::byte* const first = values_of(from.bufferView, from.byteOffset, stride, element, count);
    out.resize(count * components);
    for (size_t i = 0; i < count; ++i) decode(first + i * stride, out.data() + i * components);
  }
  if (!from.sparse.isSparse) return out;
  const auto changed = static_cast<size_t>(std::max(from.sparse.count, 0));
  const int type = from.sparse.indices.componentType;
  if (changed > count || !IsUnsigned(type) || from.sparse.indices.byteOffset < 0 || from.sparse.values.byteOffset < 0)
    refuse("sparse values that cannot be", "at most as many as the accessor has, by unsigned indices");
  const std::byte* const indices =
      values_of(from.sparse.indices.bufferView, static_cast<size_t>(from.sparse.indices.byteOffset), Bytes(type),
                Bytes(type), changed);
  const std::byte* const values = values_of(
      from.sparse.values.bufferView, static_cast<size_t>(from.sparse.values.byteOffset), element, element, changed);
  for (size_t i = 0; i < changed; ++i) {
    const auto index = static_cast<size_t>(Component(indices + i * Bytes(type), type));
    if (index >= count) refuse("a sparse index of " + std::to_string(index), "below " + std::to_string(count));
    decode(values + i * element, out.data() + index * components);
  }
  return out;
}

std::vector<float> GltfAccessors::Floats(int accessor, int width, const std::string& where) const {
  return Read<float>(accessor, width, where, [](double value, const tinygltf::Accessor& from) {
    if (!from.normalized || from.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT) return static_cast<float>(value);
    return static_cast<float>(std::max(value / Largest(from.componentType), -1.0));
  });
}

std::vector<uint32_t> GltfAccessors::Indices(int accessor, int width, const std::string& where) const {
  if (!IsUnsigned(Find(accessor, where).componentType)) {
    Refuse(file_, "accessor " + std::to_string(accessor) + " of another component type for " + where,
           "unsigned integers", "the file is damaged; export it again");
  }
  return Read<uint32_t>(accessor, width, where,
                        [](double value, const tinygltf::Accessor&) { return static_cast<uint32_t>(value); });
}

}  // namespace dcloth::tools
