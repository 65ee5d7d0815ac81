// Plays a script (player_script.py) with dcloth.h alone. Arguments: MODEL SCRIPT RESULT model|unity.
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "dcloth/dcloth.h"

namespace {

constexpr uint32_t kReset = 4;

struct File {
  File(const char* path, const char* mode) : handle(std::fopen(path, mode)) {}
  ~File() {
    if (handle != nullptr) std::fclose(handle);
  }
  template <typename T>
  T Read() {
    T value{};
    complete &= std::fread(&value, sizeof(value), 1, handle) == 1;
    return value;
  }
  template <typename T>
  void ReadTo(T* values, size_t count) {
    complete &= std::fread(values, sizeof(T), count, handle) == count;
  }
  template <typename T>
  void Write(const T* values, size_t count) {
    complete &= std::fwrite(values, sizeof(T), count, handle) == count;
  }
  std::FILE* handle;
  bool complete = true;
};

// Memory on DCLOTH_ALIGNMENT.
class Block {
 public:
  explicit Block(size_t size) : size_(size), bytes_(size + DCLOTH_ALIGNMENT) {}
  unsigned char* data() {
    const auto address = reinterpret_cast<uintptr_t>(bytes_.data());
    return bytes_.data() + (DCLOTH_ALIGNMENT - address % DCLOTH_ALIGNMENT) % DCLOTH_ALIGNMENT;
  }
  size_t size() const { return size_; }

 private:
  size_t size_;
  std::vector<unsigned char> bytes_;
};

Block ReadWhole(const char* path) {
  File file(path, "rb");
  if (file.handle == nullptr) return Block(0);
  std::fseek(file.handle, 0, SEEK_END);
  Block block(static_cast<size_t>(std::ftell(file.handle)));
  std::rewind(file.handle);
  file.ReadTo(block.data(), block.size());
  return block;
}

std::vector<std::string> ReadNames(File* script) {
  std::string text(static_cast<size_t>(script->Read<int32_t>()), '\0');
  script->ReadTo(text.data(), text.size());
  std::vector<std::string> names(1);
  for (char c : text) {
    if (c == '\n') {
      names.emplace_back();
    } else {
      names.back().push_back(c);
    }
  }
  return names;
}

bool Prepare(dcloth_cloth* cloth, const std::vector<std::string>& names, bool unity) {
  const dcloth_space space = {sizeof(space),
                              uint32_t{unity ? DCLOTH_AXIS_MINUS_X : DCLOTH_AXIS_X},
                              DCLOTH_AXIS_Y,
                              DCLOTH_AXIS_Z,
                              1,
                              DCLOTH_JOINT_FRAMES_CONVERTED};
  std::vector<const char*> pointers;
  for (const std::string& name : names) pointers.push_back(name.c_str());
  return dcloth_cloth_set_space(cloth, &space, nullptr) == DCLOTH_OK &&
         dcloth_cloth_bind_joints(cloth, pointers.data(), static_cast<uint32_t>(pointers.size()), nullptr) == DCLOTH_OK;
}

// Three arrays in place of the interleaved buffer, so that a stride that is wrong on one side shows.
struct Vertices {
  explicit Vertices(size_t count, std::vector<float> texture)
      : positions(3 * count), normals(3 * count), tangents(texture.empty() ? 0 : 4 * count), uv(std::move(texture)) {}
  dcloth_output Output(uint32_t flags) {
    dcloth_output output = {};
    output.struct_size = sizeof(output);
    output.vertex_count = static_cast<uint32_t>(positions.size() / 3);
    output.positions = positions.data();
    output.normals = normals.data();
    output.position_stride_bytes = output.normal_stride_bytes = 3 * sizeof(float);
    if (!uv.empty()) {
      output.tangents = tangents.data();
      output.tangent_stride_bytes = 4 * sizeof(float);
      output.texture_coordinates = uv.data();
      output.texture_stride_bytes = 2 * sizeof(float);
    }
    output.bounds = bounds;
    output.flags = flags;
    return output;
  }
  void Write(File* result) const {
    result->Write(bounds, 6);
    for (size_t i = 0; i < positions.size() / 3; ++i) {
      result->Write(&positions[3 * i], 3);
      result->Write(&normals[3 * i], 3);
      if (!tangents.empty()) result->Write(&tangents[4 * i], 4);
    }
  }
  std::vector<float> positions, normals, tangents, uv;
  float bounds[6] = {};
};

void Frame(dcloth_cloth* cloth, size_t joints, File* script, Vertices* vertices, File* result) {
  const auto seconds = script->Read<float>();
  const auto flags = script->Read<uint32_t>();
  const auto stages = script->Read<uint32_t>();
  const auto output_flags = script->Read<uint32_t>();
  const auto draw = script->Read<uint32_t>();
  std::vector<float> matrices(16 * joints);
  script->ReadTo(matrices.data(), matrices.size());
  const dcloth_pose pose = {sizeof(pose), static_cast<uint32_t>(joints), matrices.data(), 0, 0};
  const dcloth_frame frame = {sizeof(frame), stages, seconds, flags & ~kReset, nullptr};
  if ((flags & kReset) != 0) dcloth_cloth_reset(cloth);
  const dcloth_output output = vertices->Output(output_flags);
  const dcloth_status status = dcloth_cloth_update(cloth, &pose, &frame, draw != 0 ? &output : nullptr, nullptr);
  dcloth_cloth_info info = {};
  info.struct_size = sizeof(info);
  dcloth_cloth_describe(cloth, &info);
  result->Write(&status, 1);
  result->Write(&info.lag_seconds, 1);
  result->Write(&info.tick_share, 1);
  vertices->Write(result);
}

int Run(const char* model_path, const char* script_path, const char* result_path, bool unity) {
  Block bytes = ReadWhole(model_path);
  Block view(dcloth_model_storage_size());
  dcloth_error error = {};
  error.struct_size = sizeof(error);
  dcloth_model* model = nullptr;
  if (dcloth_model_open(bytes.data(), bytes.size(), view.data(), view.size(), &model, &error) != DCLOTH_OK) {
    std::fprintf(stderr, "%s: %s\n", model_path, error.text);
    return 1;
  }
  Block storage(dcloth_cloth_storage_size(model));
  dcloth_cloth* cloth = nullptr;
  if (dcloth_cloth_create(model, storage.data(), storage.size(), &cloth, &error) != DCLOTH_OK) return 1;
  dcloth_model_info info = {};
  info.struct_size = sizeof(info);
  if (dcloth_model_describe(model, &info) != DCLOTH_OK) return 1;

  File script(script_path, "rb"), result(result_path, "wb");
  if (script.handle == nullptr || result.handle == nullptr) return 2;
  const auto joints = static_cast<size_t>(script.Read<int32_t>());
  const auto frames = script.Read<int32_t>();
  if (!Prepare(cloth, ReadNames(&script), unity)) return 1;
  std::vector<float> uv(static_cast<size_t>(script.Read<int32_t>()));
  script.ReadTo(uv.data(), uv.size());
  Vertices vertices(info.vertex_count, std::move(uv));
  for (int32_t f = 0; f < frames; ++f) Frame(cloth, joints, &script, &vertices, &result);
  std::vector<unsigned char> state(dcloth_cloth_state_size(cloth));
  if (dcloth_cloth_save(cloth, state.data(), state.size(), &error) != DCLOTH_OK) return 1;
  result.Write(state.data(), state.size());
  return script.complete && result.complete ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  return Run(argv[1], argv[2], argv[3], std::strcmp(argv[4], "unity") == 0);
}
