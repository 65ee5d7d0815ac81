// How deep the library's calls go into the host's stack: each runs on a painted stack of its own, and what it
// touched is counted. Consoles and fibres give a job 16 to 64 KB.
#include <sys/mman.h>
#include <ucontext.h>

#include <functional>
#include <iostream>

#include "tests/attack/corruption.h"
#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {
namespace {

constexpr size_t kStackBytes = 256 << 10;
constexpr uint8_t kPaint = 0x5A;

// What a call may take: half of the smallest stack above. Opening keeps the ranges of all tensors there.
constexpr size_t kBound = 8192;

const std::function<void()>* g_call;
ucontext_t g_caller, g_callee;

void Enter() { (*g_call)(); }

// Bytes of stack under `call`, the glue of the context included (some hundred bytes).
size_t StackDepth(const std::function<void()>& call) {
  void* stack = mmap(nullptr, kStackBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  EXPECT_NE(stack, MAP_FAILED);
  std::memset(stack, kPaint, kStackBytes);
  g_call = &call;
  getcontext(&g_callee);
  g_callee.uc_stack.ss_sp = stack;
  g_callee.uc_stack.ss_size = kStackBytes;
  g_callee.uc_link = &g_caller;
  makecontext(&g_callee, Enter, 0);
  swapcontext(&g_caller, &g_callee);
  size_t untouched = 0;
  while (untouched < kStackBytes && static_cast<uint8_t*>(stack)[untouched] == kPaint) ++untouched;
  munmap(stack, kStackBytes);
  return kStackBytes - untouched;
}

// Measures after a first call, which may make the dynamic linker resolve names on the same stack.
size_t SettledDepth(const std::function<void()>& call) {
  call();
  return StackDepth(call);
}

TEST(Stack, TheMeasureMeasures) {
  const auto use = [](size_t bytes) {
    return StackDepth([bytes] {
      void* block = __builtin_alloca(bytes);
      std::memset(block, 1, bytes);
      __asm__ volatile("" : : "r"(block) : "memory");  // or the optimiser drops what nobody reads
    });
  };
  EXPECT_LT(use(16), 1024u);
  EXPECT_NEAR(static_cast<double>(use(40000) - use(20000)), 20000, 64);
}

TEST(Stack, EveryCallStaysShallow) {
  ModelSpec spec;
  spec.feature_width = 64;
  spec.layers = 8;
  spec.joints = 256;
  spec.bones = 256;
  spec.influences = spec.body_influences = 8;
  spec.parents = spec.body = spec.touch = spec.coarse = spec.texture = true;
  size_t deepest = 0;
  const auto check = [&](const std::string& name, const std::function<void()>& call) {
    const size_t depth = SettledDepth(call);
    EXPECT_LE(depth, kBound) << name;
    EXPECT_GT(depth, 64u) << name << " was not called";
    deepest = std::max(deepest, depth);
    std::cout << name << ": " << depth << " bytes of stack\n";
  };
  for (const format::DType precision : {format::DType_F32, format::DType_F16, format::DType_I8}) {
    spec.precision = precision;
    const TestModel model = BuildModel(spec);
    const OpenedModel opened(model);
    ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
    const std::vector<float> pose = PoseAt(model.numbers, 1);
    for (const std::string& isa : UsableIsas()) {
      ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
      OwnedCloth cloth(opened);
      const std::string name = format::EnumNameDType(precision) + (" on " + isa);
      check("tick, " + name, [&] { EXPECT_EQ(cloth.Tick(pose, DCLOTH_STAGES_MESH), DCLOTH_OK); });
      check("skin, " + name, [&] { EXPECT_EQ(cloth.Skin(pose, 0.5f), DCLOTH_OK); });
      std::vector<uint8_t> state(dcloth_cloth_state_size(cloth.get()));
      check("save, " + name,
            [&] { EXPECT_EQ(dcloth_cloth_save(cloth.get(), state.data(), state.size(), nullptr), DCLOTH_OK); });
      check("restore, " + name,
            [&] { EXPECT_EQ(dcloth_cloth_restore(cloth.get(), state.data(), state.size(), 0, nullptr), DCLOTH_OK); });
      dcloth_error refusal = EmptyError();
      std::fill(state.end() - 4, state.end(), uint8_t{0xFF});
      check("restore, refused, " + name, [&] {
        EXPECT_EQ(dcloth_cloth_restore(cloth.get(), state.data(), state.size(), 0, &refusal), DCLOTH_ERROR_FORMAT);
      });
    }
    dcloth_isa_select(nullptr);
    AlignedBytes view(dcloth_model_storage_size()), memory(dcloth_cloth_storage_size(opened.get()));
    dcloth_error error = EmptyError();
    const auto open = [&](const AlignedBytes& bytes) {
      dcloth_model* result = nullptr;
      return dcloth_model_open(bytes.data(), bytes.size(), view.data(), view.size(), &result, &error);
    };
    check("open", [&] { EXPECT_EQ(open(opened.bytes()), DCLOTH_OK); });
    dcloth_cloth* placed = nullptr;
    check("create", [&] {
      EXPECT_EQ(dcloth_cloth_create(opened.get(), memory.data(), memory.size(), &placed, nullptr), DCLOTH_OK);
    });
    check("reset", [&] { EXPECT_EQ(dcloth_cloth_reset(placed), DCLOTH_OK); });
    // The fault at the end of the longest chain of checks, its text written on the way.
    const AlignedBytes spoilt = Corrupted(
        {"", kSemantics, "", "", [](format::ModelT* m) { m->displacement->basis->weights->offset = ~uint64_t{63}; }});
    check("open, refused", [&] { EXPECT_EQ(open(spoilt), kSemantics); });
  }
  std::cout << "deepest: " << deepest << " bytes\n";
}

}  // namespace
}  // namespace dcloth::testing
