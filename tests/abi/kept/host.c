/* A host compiled with the headers of an earlier release, run with today's library. Each struct is as long as that
 * version knew it, and what lies behind it is watched. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dcloth/dcloth_scene.h"

enum { GUARD = 512, POISON = 0xA5 };

/* `size` bytes as the host knows them, then bytes that are not the library's; all of it poison at first. */
static void* guarded(size_t size) {
  unsigned char* block = malloc(size + GUARD);
  if (block == NULL) exit(2);
  memset(block, POISON, size + GUARD);
  *(uint32_t*)(void*)block = (uint32_t)size;
  return block;
}

/* The same, but fields that are not set are zero. */
static void* given(size_t size) {
  unsigned char* block = guarded(size);
  memset(block + sizeof(uint32_t), 0, size - sizeof(uint32_t));
  return block;
}

static int untouched(const void* block, size_t size) {
  const unsigned char* behind = (const unsigned char*)block + size;
  int i;
  for (i = 0; i < GUARD; ++i) {
    if (behind[i] != POISON) return 0;
  }
  return 1;
}

static int failures = 0;
static void expect(int holds, const char* what) {
  if (holds) return;
  fprintf(stderr, "old host: %s\n", what);
  ++failures;
}

static void* aligned(size_t size) {
  unsigned char* block = malloc(size + DCLOTH_ALIGNMENT); /* lives as long as the program */
  if (block == NULL) exit(2);
  return block + (DCLOTH_ALIGNMENT - (uintptr_t)block % DCLOTH_ALIGNMENT) % DCLOTH_ALIGNMENT;
}

static uint64_t clock_of_ones(void* context) { return ++*(uint64_t*)context; }

static void run(dcloth_cloth* cloth, const dcloth_model_info* info) {
  float* matrices = calloc((size_t)16 * info->joint_count, sizeof(float));
  float* positions = calloc((size_t)3 * info->vertex_count, sizeof(float));
  dcloth_pose* pose = given(sizeof(dcloth_pose));
  dcloth_frame* frame = given(sizeof(dcloth_frame));
  dcloth_output* output = given(sizeof(dcloth_output));
  dcloth_timer* timer = given(sizeof(dcloth_timer));
  dcloth_cloth_info* after = guarded(sizeof(dcloth_cloth_info));
  dcloth_space* space = given(sizeof(dcloth_space));
  uint64_t ticks = 0, sum = 0;
  uint32_t j;
  int i;
  if (matrices == NULL || positions == NULL) exit(2);
  for (j = 0; j < 4 * info->joint_count; ++j) matrices[4 * j + j % 4] = 1;
  space->left = DCLOTH_AXIS_X, space->up = DCLOTH_AXIS_Y, space->forward = DCLOTH_AXIS_Z;
  space->metres_per_unit = 1, space->joint_frames = DCLOTH_JOINT_FRAMES_CONVERTED;
  expect(dcloth_cloth_set_space(cloth, space, NULL) == DCLOTH_OK, "its space is refused");
  pose->joint_count = info->joint_count, pose->joint_matrices = matrices, pose->column_major = 0;
  frame->seconds = 1.0f / 60.0f, frame->flags = 0;
  output->vertex_count = info->vertex_count;
  output->positions = positions;
  output->position_stride_bytes = 3 * sizeof(float);
  timer->now = clock_of_ones, timer->context = &ticks;
  for (i = 0; i < 8; ++i) {
    frame->stages = i % 2 == 0 ? DCLOTH_STAGES_MESH : info->stages;
    expect(dcloth_cloth_update(cloth, pose, frame, output, timer) == DCLOTH_OK, "a frame is refused");
  }
  frame->seconds = -1;
  expect(dcloth_cloth_update(cloth, pose, frame, output, timer) == DCLOTH_ERROR_ARGUMENT, "time runs backwards");
  for (i = 0; i < DCLOTH_STEP_COUNT; ++i) sum += timer->elapsed[i];
  expect(sum > 0 && sum <= ticks, "its timer shows no time");
  expect(dcloth_cloth_describe(cloth, after) == DCLOTH_OK && after->in_work == 0 && after->frozen == 0,
         "its cloth_info is refused");
  expect(after->struct_size == sizeof(dcloth_cloth_info), "struct_size is written");
  after->struct_size -= 4; /* it has not grown since */
  expect(dcloth_cloth_describe(cloth, after) == DCLOTH_ERROR_ARGUMENT, "less than the first version is taken");
  expect(untouched(pose, sizeof(*pose)) && untouched(frame, sizeof(*frame)) && untouched(output, sizeof(*output)) &&
             untouched(timer, sizeof(*timer)) && untouched(after, sizeof(*after)),
         "bytes behind a struct are written");
}

static void run_scene(const dcloth_cloth* cloth) {
  dcloth_scene_character* character = given(sizeof(dcloth_scene_character));
  dcloth_scene_frame* frame = given(sizeof(dcloth_scene_frame));
  dcloth_scene_choice* choice = guarded(sizeof(dcloth_scene_choice));
  const size_t size = dcloth_scene_storage_size(1);
  dcloth_scene* scene = NULL;
  int i;
  expect(dcloth_scene_create(1, aligned(size), size, &scene, NULL) == DCLOTH_OK, "no scene");
  character->top_level = DCLOTH_LEVEL_MESH, character->cloth = cloth;
  character->importance = character->draw_microseconds = 1;
  for (i = 0; i < DCLOTH_LEVEL_COUNT; ++i) character->tick_microseconds[i] = character->error_mm[i] = 1;
  frame->seconds = 1.0f / 60.0f, frame->budget_microseconds = 1000, frame->spent_microseconds = 0;
  expect(dcloth_scene_set(scene, 0, character) == DCLOTH_OK, "its character is refused");
  expect(dcloth_scene_plan(scene, frame, NULL) == DCLOTH_OK, "its frame is refused");
  expect(dcloth_scene_get(scene, 0, choice) == DCLOTH_OK && choice->level < DCLOTH_LEVEL_COUNT, "no choice");
  expect(untouched(character, sizeof(*character)) && untouched(frame, sizeof(*frame)) &&
             untouched(choice, sizeof(*choice)),
         "bytes behind a struct of the scene are written");
}

int main(int argc, char** argv) {
  dcloth_error* error = guarded(sizeof(dcloth_error));
  dcloth_model_info* info = guarded(sizeof(dcloth_model_info));
  dcloth_model* model = NULL;
  dcloth_cloth* cloth = NULL;
  const size_t view = dcloth_model_storage_size();
  void* bytes = aligned((size_t)1 << 22);
  size_t size;
  FILE* file = argc == 2 ? fopen(argv[1], "rb") : NULL;
  if (file == NULL) {
    fprintf(stderr, "usage: %s MODEL\n", argv[0]);
    return 2;
  }
  size = fread(bytes, 1, (size_t)1 << 22, file);
  fclose(file);
  expect(dcloth_model_open(bytes, 64, aligned(view), view, &model, error) != DCLOTH_OK && error->status != DCLOTH_OK &&
             memchr(error->text, 0, sizeof(error->text)) != NULL,
         "no text for a broken model");
  expect(untouched(error, sizeof(*error)) && error->struct_size == sizeof(*error), "bytes behind the error are written");
  if (dcloth_model_open(bytes, size, aligned(view), view, &model, error) != DCLOTH_OK) return 1;
  expect(dcloth_model_describe(model, info) == DCLOTH_OK && info->vertex_count > 0, "its model_info is refused");
  expect(untouched(info, sizeof(*info)) && info->struct_size == sizeof(*info), "bytes behind the info are written");
  size = dcloth_cloth_storage_size(model);
  expect(dcloth_cloth_create(model, aligned(size), size, &cloth, error) == DCLOTH_OK, "no cloth");
  if (cloth != NULL) run(cloth, info);
  if (cloth != NULL) run_scene(cloth);
  printf("a host of %d.%d.%d with dcloth %s: %s\n", DCLOTH_VERSION_MAJOR, DCLOTH_VERSION_MINOR, DCLOTH_VERSION_PATCH,
         dcloth_version(), failures == 0 ? "fine" : "failed");
  return failures != 0;
}
