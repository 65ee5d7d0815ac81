/* A host in C99: opens the model given as argument, lends memory, runs a second of frames, alone and in a
 * scene. Knows the public headers and nothing else. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dcloth/dcloth_fit.h"
#include "dcloth/dcloth_scene.h"

enum { FRAMES = 60 };

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

/* One vertex of the host: interleaved, half normals and tangents, a texture coordinate of its own. */
typedef struct vertex {
  float position[3];
  uint16_t normal[4]; /* the fourth pads */
  uint16_t tangent[4];
  float texture[2];
} vertex;

/* Every joint at the same place, one metre up, turned about +Y by `yaw`; rows are contiguous. */
static void fill_pose(float* matrices, uint32_t joint_count, float yaw) {
  const float c = cosf(yaw), s = sinf(yaw);
  const float matrix[16] = {c, 0, s, 0, 0, 1, 0, 1, -s, 0, c, 0, 0, 0, 0, 1};
  uint32_t j;
  for (j = 0; j < joint_count; ++j) memcpy(matrices + 16 * (size_t)j, matrix, sizeof(matrix));
}

static void describe_output(dcloth_output* output, vertex* vertices, uint32_t count, float* bounds) {
  memset(output, 0, sizeof(*output));
  output->struct_size = sizeof(*output);
  output->vertex_count = count;
  output->positions = vertices[0].position;
  output->normals = vertices[0].normal;
  output->tangents = vertices[0].tangent;
  output->texture_coordinates = vertices[0].texture;
  output->position_stride_bytes = output->normal_stride_bytes = sizeof(vertex);
  output->tangent_stride_bytes = output->texture_stride_bytes = sizeof(vertex);
  output->normal_format = output->tangent_format = DCLOTH_FORMAT_FLOAT16;
  output->bounds = bounds;
}

static int all_inside(const vertex* vertices, uint32_t count, const float* bounds) {
  uint32_t i;
  int c;
  for (i = 0; i < count; ++i) {
    for (c = 0; c < 3; ++c) {
      const float x = vertices[i].position[c];
      if (!(x >= bounds[c] && x <= bounds[3 + c])) return 0;
      if ((vertices[i].normal[c] & 0x7C00u) == 0x7C00u) return 0; /* infinity or NaN */
    }
  }
  return 1;
}

static int run(dcloth_cloth* cloth, const dcloth_model_info* info, float* matrices, vertex* vertices) {
  const dcloth_pose pose = {sizeof(dcloth_pose), info->joint_count, matrices, 0, 0};
  const dcloth_frame frame = {sizeof(dcloth_frame), info->stages, 1.0f / 60.0f, DCLOTH_FRAME_PIPELINED, NULL};
  dcloth_output output;
  float bounds[6];
  int result = 0, i;
  describe_output(&output, vertices, info->vertex_count, bounds);
  output.scratch_size = dcloth_output_scratch_size(&output);
  output.scratch = malloc((size_t)output.scratch_size);
  if (output.scratch == NULL) return 1;
  for (i = 0; i < FRAMES && result == 0; ++i) {
    fill_pose(matrices, info->joint_count, 0.05f * (float)i);
    result = dcloth_cloth_update(cloth, &pose, &frame, &output, NULL) != DCLOTH_OK ||
             !all_inside(vertices, info->vertex_count, bounds);
  }
  free(output.scratch);
  return result;
}

/* A character of which the garment can make nothing is refused, with a word on why. */
static int run_fit(const dcloth_model* model, dcloth_cloth* cloth, const float* matrices) {
  const char* names[1];
  dcloth_character character;
  dcloth_fit fit;
  dcloth_error error;
  memset(&character, 0, sizeof(character));
  memset(&fit, 0, sizeof(fit));
  memset(&error, 0, sizeof(error));
  error.struct_size = sizeof(error);
  fit.struct_size = sizeof(fit);
  names[0] = "LeftUpLeg";
  character.struct_size = sizeof(character);
  character.joint_count = 1;
  character.joint_names = names;
  character.bind_matrices = matrices;
  return dcloth_role_of_name(names[0]) != DCLOTH_ROLE_LEFT_UPPER_LEG ||
         strcmp(dcloth_role_name(DCLOTH_ROLE_LEFT_UPPER_LEG), "left upper leg") != 0 ||
         dcloth_fit_storage_size(model, &character) == 0 ||
         dcloth_cloth_fit(cloth, &character, NULL, 0, &fit, &error) != DCLOTH_ERROR_ARGUMENT || error.text[0] == 0;
}

/* The same frames, as planned by a scene of one character whose every tick fits. */
static int run_scene(dcloth_cloth* cloth, const dcloth_model_info* info, float* matrices) {
  const dcloth_pose pose = {sizeof(dcloth_pose), info->joint_count, matrices, 0, 0};
  const dcloth_scene_frame scene_frame = {sizeof(dcloth_scene_frame), 1.0f / 60.0f, 1000.0f, 0.0f};
  dcloth_scene_character character;
  dcloth_scene_choice choice;
  dcloth_scene* scene = NULL;
  void* owner = NULL;
  const size_t size = dcloth_scene_storage_size(1);
  void* storage = allocate_aligned(size, &owner);
  int result, i, ticks = 0;
  memset(&character, 0, sizeof(character));
  character.struct_size = sizeof(character);
  character.top_level = DCLOTH_LEVEL_MESH;
  character.cloth = cloth;
  character.importance = 1.0f;
  character.draw_microseconds = 10.0f;
  for (i = 0; i < DCLOTH_LEVEL_COUNT; ++i) {
    character.tick_microseconds[i] = 100.0f * (float)i;
    character.error_mm[i] = 10.0f - (float)i;
  }
  memset(&choice, 0, sizeof(choice));
  choice.struct_size = sizeof(choice);
  result = storage == NULL || dcloth_scene_create(1, storage, size, &scene, NULL) != DCLOTH_OK ||
           dcloth_scene_set(scene, 0, &character) != DCLOTH_OK || dcloth_cloth_reset(cloth) != DCLOTH_OK;
  for (i = 0; i < FRAMES && result == 0; ++i) {
    float planned = 0.0f;
    dcloth_frame frame = {sizeof(dcloth_frame), 0, 1.0f / 60.0f, 0, NULL};
    fill_pose(matrices, info->joint_count, 0.05f * (float)i);
    result = dcloth_scene_plan(scene, &scene_frame, &planned) != DCLOTH_OK || planned > 1000.0f ||
             dcloth_scene_get(scene, 0, &choice) != DCLOTH_OK;
    frame.stages = choice.stages;
    frame.flags = choice.flags;
    result = result || dcloth_cloth_update(cloth, &pose, &frame, NULL, NULL) != DCLOTH_OK;
    ticks += (int)choice.ticks;
  }
  free(owner);
  return result || choice.stages != info->stages || ticks != FRAMES / 2;
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
  vertex* vertices;
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
  vertices = calloc(info.vertex_count, sizeof(vertex));
  result = matrices == NULL || vertices == NULL || run(cloth, &info, matrices, vertices) ||
           run_scene(cloth, &info, matrices) || run_fit(model, cloth, matrices);
  printf("dcloth %s (%s): %s, %u vertices, %d frames: %s\n", dcloth_version(), dcloth_isa_name(), info.name,
         (unsigned)info.vertex_count, FRAMES, result == 0 ? "fine" : "failed");
  free(matrices);
  free(vertices);
  free(owners[0]);
  free(owners[1]);
  free(owners[2]);
  return result;
}
