#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <string>

#include "kernels/kernels.h"

namespace dcloth::kernels {
namespace {

TEST(Dispatch, TablesAreCompleteDistinctAndEndWithScalar) {
  const size_t count = KernelTableCount();
  ASSERT_GE(count, 1u);
  std::set<std::string> names;
  for (size_t i = 0; i < count; ++i) {
    const KernelTable* table = KernelTableAt(i);
    ASSERT_NE(table, nullptr);
    EXPECT_TRUE(names.insert(table->name).second) << table->name;
    EXPECT_EQ(FindKernels(table->name), table);
    EXPECT_EQ(table->counts_subnormals, std::string(table->name) == "reproducible") << table->name;
#define DCLOTH_EXPECT_ENTRY(Function, member) EXPECT_NE(table->member, nullptr) << table->name << " lacks " #Function;
    DCLOTH_KERNEL_LIST(DCLOTH_EXPECT_ENTRY)
#undef DCLOTH_EXPECT_ENTRY
  }
  // After it at most the reproducible table, where that is scalar code too.
  const bool scalar_reproducible = KernelTableAt(count - 1) == FindKernels("reproducible");
  ASSERT_GT(count, size_t{scalar_reproducible});
  EXPECT_STREQ(KernelTableAt(count - 1 - scalar_reproducible)->name, "scalar");
  EXPECT_EQ(KernelTableAt(count), nullptr);
  EXPECT_EQ(BestKernels(), KernelTableAt(0));
}

TEST(Dispatch, TwoTablesShareNoKernel) {
  for (size_t i = 1; i < KernelTableCount(); ++i) {
    const KernelTable* best = KernelTableAt(0);
    const KernelTable* other = KernelTableAt(i);
    if (other == FindKernels("reproducible")) continue;  // another name of the 128-bit table where that fuses nothing
#define DCLOTH_EXPECT_OTHER(Function, member) EXPECT_NE(best->member, other->member) << other->name << " " #Function;
    DCLOTH_KERNEL_LIST(DCLOTH_EXPECT_OTHER)
#undef DCLOTH_EXPECT_OTHER
  }
}

TEST(Dispatch, RefusesUnknownNames) {
  EXPECT_EQ(FindKernels(nullptr), nullptr);
  EXPECT_EQ(FindKernels(""), nullptr);
  EXPECT_EQ(FindKernels("avx"), nullptr);
  EXPECT_EQ(FindKernels("scalar2"), nullptr);
}

// Without this the other tests would pass by testing the reference alone.
TEST(Dispatch, OffersWhatTheCompilerSaysTheCpuHas) {
#if (defined(__x86_64__) || defined(__i386__)) && defined(__GNUC__)
  __builtin_cpu_init();
  EXPECT_EQ(FindKernels("sse4") != nullptr, __builtin_cpu_supports("sse4.2") != 0);
  EXPECT_EQ(FindKernels("reproducible") != nullptr, FindKernels("sse4") != nullptr);
#if defined(__x86_64__)
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
                    __builtin_cpu_supports("bmi2");
  EXPECT_EQ(FindKernels("avx2") != nullptr, avx2);
#if defined(DCLOTH_AVX512)
  const bool avx512 = avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
                      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
                      __builtin_cpu_supports("avx512vbmi2") && __builtin_cpu_supports("avx512vnni");
#else
  const bool avx512 = false;
#endif
  EXPECT_EQ(FindKernels("avx3") != nullptr, avx512);
#endif
#elif defined(__aarch64__)
  EXPECT_NE(FindKernels("neon"), nullptr);
  EXPECT_NE(FindKernels("reproducible"), nullptr);
#elif defined(__wasm_simd128__)
  EXPECT_NE(FindKernels("wasm"), nullptr);
  EXPECT_NE(FindKernels("reproducible"), nullptr);
#else
  EXPECT_NE(FindKernels("reproducible"), nullptr);
#endif
}

}  // namespace
}  // namespace dcloth::kernels
