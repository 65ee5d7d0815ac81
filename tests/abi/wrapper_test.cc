// The C++ wrapper compiles as C++17 without exceptions and reaches every function of the C ABI.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <type_traits>

#include "dcloth/dcloth.hpp"

static_assert(std::is_trivially_copyable_v<dcloth::Model> && std::is_trivially_destructible_v<dcloth::Cloth>);
static_assert(sizeof(dcloth::Error) == sizeof(dcloth_error) && sizeof(dcloth::Timer) == sizeof(dcloth_timer));

namespace {

alignas(DCLOTH_ALIGNMENT) unsigned char storage[8192];

// Of C++17: not every system's C library has aligned_alloc.
constexpr std::align_val_t kAligned{DCLOTH_ALIGNMENT};

// Argument: a model file.
int Run(const char* path) {
  char version[32];
  std::snprintf(version, sizeof(version), "%d.%d.%d", DCLOTH_VERSION_MAJOR, DCLOTH_VERSION_MINOR, DCLOTH_VERSION_PATCH);
  if (std::strcmp(dcloth_version(), version) != 0) return 1;
  std::FILE* file = std::fopen(path, "rb");
  if (file == nullptr) return 2;
  std::fseek(file, 0, SEEK_END);
  const auto size = static_cast<size_t>(std::ftell(file));
  std::rewind(file);
  void* bytes = ::operator new(size, kAligned, std::nothrow);
  const bool read = std::fread(bytes, 1, size, file) == size;
  std::fclose(file);
  dcloth::Error error;
  dcloth::Model model;
  if (!read || dcloth::Model::StorageSize() > sizeof(storage)) return 2;
  if (model.is_open() || model.ClothStorageSize() != 0 || model.Describe().vertex_count != 0) return 1;
  if (model.Open(bytes, size - 64, storage, sizeof(storage), &error) == dcloth::Status::kOk || error.text[0] == '\0')
    return 1;
  if (model.Open(bytes, size, storage, sizeof(storage), &error) != dcloth::Status::kOk) return 1;
  const dcloth_model_info info = model.Describe();
  if (model.JointName(0) == nullptr || model.JointName(info.joint_count) != nullptr) return 1;

  void* memory = ::operator new(model.ClothStorageSize(), kAligned, std::nothrow);
  dcloth::Cloth cloth;
  if (cloth.Create(model, memory, model.ClothStorageSize()) != dcloth::Status::kOk || !cloth.is_created()) return 1;
  auto* matrices = static_cast<float*>(std::calloc(info.joint_count, 16 * sizeof(float)));
  auto* vertices = static_cast<float*>(std::calloc(info.vertex_count, 6 * sizeof(float)));
  for (uint32_t j = 0; j < info.joint_count; ++j) {
    for (int d = 0; d < 4; ++d) matrices[16 * j + 5 * static_cast<uint32_t>(d)] = 1.0f;
  }
  const dcloth_pose pose = dcloth::MakePose(matrices, info.joint_count, dcloth::MatrixLayout::kColumnMajor);
  const dcloth_output output =
      dcloth::MakeOutput(vertices, vertices + size_t{3} * info.vertex_count, info.vertex_count);
  dcloth::Timer timer(nullptr, nullptr);
  const auto stages = static_cast<dcloth::Stages>(info.stages);
  const char* first = model.JointName(0);
  dcloth_space left_handed = dcloth::MakeSpace(DCLOTH_AXIS_MINUS_X, DCLOTH_AXIS_Y, DCLOTH_AXIS_Z, 1);
  const bool bound = info.joint_count == 1 || cloth.BindJoints(&first, 1, &error) == dcloth::Status::kJoints;
  const bool placed = cloth.SetSpace(left_handed) == dcloth::Status::kOk &&
                      cloth.SetBindPose(pose) == dcloth::Status::kOk && !model.ReadsWind() &&
                      cloth.SetWind({1, 2, 3}) == dcloth::Status::kOk &&
                      cloth.SetWind({0, 101, 0}) == dcloth::Status::kArgument &&
                      cloth.Update(pose, dcloth::MakeFrame(0.01f, stages), &output) == dcloth::Status::kOk &&
                      cloth.Describe().tick_share == 1.0f;
  const bool fitted = cloth.SetFit(bytes, sizeof(void*), &error) == dcloth::Status::kFormat && error.text[0] != '\0';
  if (!fitted) return 1;
  const size_t state_size = cloth.StateSize();
  void* state = std::malloc(state_size);
  const bool kept = cloth.Save(state, state_size, &error) == dcloth::Status::kOk &&
                    cloth.Restore(state, state_size, DCLOTH_RESTORE_OTHER_MODEL) == dcloth::Status::kOk &&
                    cloth.Restore(state, state_size - 1) == dcloth::Status::kFormat;
  std::free(state);
  const bool fine = bound && placed && kept && cloth.Tick(pose, stages, &timer) == dcloth::Status::kOk &&
                    cloth.Skin(pose, 1, output) == dcloth::Status::kOk &&
                    cloth.Tick(dcloth::MakePose(matrices, info.joint_count + 1), stages) == dcloth::Status::kPose &&
                    cloth.Reset() == dcloth::Status::kOk;
  std::free(matrices);
  std::free(vertices);
  ::operator delete(memory, kAligned);
  ::operator delete(bytes, kAligned);
  return fine ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) { return argc == 2 ? Run(argv[1]) : 2; }
