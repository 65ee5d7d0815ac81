// Structs of hosts that were compiled with another version's headers, shorter or longer than today's.
//
// A struct only grows at its end. What a host does not know reads as zero; what it has no room for is not written. A
// struct is refused where not even its first version fits: that ended with its last field, whatever padding followed.
#ifndef DCLOTH_ENGINE_SRC_BASE_HOST_STRUCT_H_
#define DCLOTH_ENGINE_SRC_BASE_HOST_STRUCT_H_

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "dcloth/dcloth_scene.h"

namespace dcloth::engine {

// Never changed: a struct that is not among these is new.
template <typename T>
inline constexpr size_t kFirstBytes = sizeof(T);
#define DCLOTH_FIRST_VERSION(type, last_field) \
  template <>                                  \
  inline constexpr size_t kFirstBytes<type> = offsetof(type, last_field) + sizeof(type::last_field)
DCLOTH_FIRST_VERSION(dcloth_error, text);
DCLOTH_FIRST_VERSION(dcloth_model_info, triangles);
DCLOTH_FIRST_VERSION(dcloth_space, joint_frames);
DCLOTH_FIRST_VERSION(dcloth_pose, column_major);
DCLOTH_FIRST_VERSION(dcloth_frame, flags);
DCLOTH_FIRST_VERSION(dcloth_cloth_info, tick_waits);
DCLOTH_FIRST_VERSION(dcloth_output, scratch_size);
DCLOTH_FIRST_VERSION(dcloth_timer, elapsed);
DCLOTH_FIRST_VERSION(dcloth_scene_character, error_mm);
DCLOTH_FIRST_VERSION(dcloth_scene_frame, spent_microseconds);
DCLOTH_FIRST_VERSION(dcloth_scene_choice, stale_seconds);
#undef DCLOTH_FIRST_VERSION

template <typename T>
bool IsWhole(const T* given) {
  return given != nullptr && given->struct_size >= kFirstBytes<T>;
}

template <typename T>
size_t SharedBytes(const T& given) {
  return given.struct_size < sizeof(T) ? given.struct_size : sizeof(T);
}

template <typename T>
T ReadStruct(const T& given) {
  T read = {};
  std::memcpy(&read, &given, SharedBytes(given));
  return read;
}

// struct_size stays the host's.
template <typename T>
void WriteStruct(const T& filled, T* given) {
  constexpr size_t kSize = sizeof(given->struct_size);
  std::memcpy(reinterpret_cast<uint8_t*>(given) + kSize, reinterpret_cast<const uint8_t*>(&filled) + kSize,
              SharedBytes(*given) - kSize);
}

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BASE_HOST_STRUCT_H_
