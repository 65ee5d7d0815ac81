/* A host in C99: opens the model given as argument, lends memory, runs a second of frames. Knows dcloth.h and nothing else. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dcloth/dcloth.h"

enum { TICKS = 30 };

/* A block on DCLOTH_ALIGNMENT inside `*owner`, which the caller frees. */
static void* allocate_aligned(size_t size, void** owner) {
  unsigned char* block = malloc(size + DCLOTH_ALIGNMENT);
  *owner = block;
  if (block == NULL) return NULL;
  return block + (DCLOTH_ALIGNMENT - (uintptr_t)block % DCLOTH_ALIGNMENT) % DCLOTH_ALIGNMENT;
}

static void* read_file(const char* path, size_t* size, void** owner) {
  FILE* file = fopen(path, "rb");
  void* bytes = NULL;
  long length;
  if (file == NULL) return NULL;
  if (fseek(file, 0, SEEK_END) == 0 && (length = ftell(file)) > 0 && fseek(file, 0, SEEK_SET) == 0) {
    bytes = allocate_aligned((size_t)length, owner);
    *size = (size_t)length;
    if (bytes != NULL && fread(bytes, 1, *size, file) != *size) bytes = NULL;
  }
  fclose(file);
  return bytes;
}

/* Every joint at the same place, one metre up, turned about +Y by `yaw`; rows are contiguous. */
static void fill_pose(float* matrices, uint32_t joint_count, float yaw) {
  const float c = cosf(yaw), s = sinf(yaw);
  const float matrix[16] = {c, 0, s, 0, 0, 1, 0, 1, -s, 0, c, 0, 0, 0, 0, 1};
  uint32_t j;
  for (j = 0; j < joint_count; ++j) memcpy(matrices + 16 * (size_t)j, matrix, sizeof(matrix));
}

static int all_finite(const float* values, size_t count) {
  size_t i;
  for (i = 0; i < count; ++i) {
    if (!isfinite(values[i])) return 0;
  }
  return 1;
}

static int run(dcloth_cloth* cloth, const dcloth_model_info* info, float* matrices, float* vertices) {
  const dcloth_pose pose = {sizeof(dcloth_pose), info->joint_count, matrices, 0};
  const dcloth_output output = {sizeof(dcloth_output), info->vertex_count, vertices, 24, 24, vertices + 3};
  int tick;
  for (tick = 0; tick < TICKS; ++tick) {
    fill_pose(matrices, info->joint_count, 0.05f * (float)tick);
    if (dcloth_cloth_tick(cloth, &pose, info->stages, NULL) != DCLOTH_OK) return 1;
    if (dcloth_cloth_skin(cloth, &pose, 0.5f, &output, NULL) != DCLOTH_OK) return 1;
    if (!all_finite(vertices, 6 * (size_t)info->vertex_count)) return 1;
  }
  return 0;
}

int main(int argc, char** argv) {
  dcloth_error error;
  dcloth_model_info info;
  dcloth_model* model = NULL;
  dcloth_cloth* cloth = NULL;
  void* owners[3] = {NULL, NULL, NULL};
  void* bytes;
  void* storage;
  float* matrices;
  float* vertices;
  size_t size = 0;
  int result;
  if (argc != 2) {
    fprintf(stderr, "usage: %s MODEL\n", argv[0]);
    return 2;
  }
  memset(&error, 0, sizeof(error));
  error.struct_size = sizeof(error);
  bytes = read_file(argv[1], &size, &owners[0]);
  if (bytes == NULL) {
    fprintf(stderr, "%s: cannot be read\n", argv[1]);
    return 2;
  }
  storage = allocate_aligned(dcloth_model_storage_size(), &owners[1]);
  if (storage == NULL ||
      dcloth_model_open(bytes, size, storage, dcloth_model_storage_size(), &model, &error) != DCLOTH_OK) {
    fprintf(stderr, "%s: %s\n", argv[1], error.text);
    return 1;
  }
  memset(&info, 0, sizeof(info));
  info.struct_size = sizeof(info);
  if (dcloth_model_describe(model, &info) != DCLOTH_OK) return 1;
  storage = allocate_aligned(dcloth_cloth_storage_size(model), &owners[2]);
  if (storage == NULL ||
      dcloth_cloth_create(model, storage, dcloth_cloth_storage_size(model), &cloth, &error) != DCLOTH_OK) {
    fprintf(stderr, "%s: %s\n", argv[1], error.text);
    return 1;
  }
  matrices = malloc(16 * sizeof(float) * info.joint_count);
  vertices = malloc(6 * sizeof(float) * info.vertex_count);
  result = matrices == NULL || vertices == NULL || run(cloth, &info, matrices, vertices);
  printf("dcloth %s (%s): %s, %u vertices, %d ticks: %s\n", dcloth_version(), dcloth_isa_name(), info.name,
         (unsigned)info.vertex_count, TICKS, result == 0 ? "fine" : "failed");
  free(matrices);
  free(vertices);
  free(owners[0]);
  free(owners[1]);
  free(owners[2]);
  return result;
}
