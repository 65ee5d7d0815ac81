#include "converter/model_maker.h"

#include <gtest/gtest.h>

#include "converter/convert.h"
#include "tests/unit/converter/bundle_builder.h"
#include "tests/unit/converter/error_text.h"
#include "tests/unit/converter/low_rank.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::BundleSpec;
using dcloth::testing::ErrorText;
using dcloth::testing::LowerRank;
using dcloth::testing::Mentions;
using dcloth::testing::ParseBundle;

// 40 + 16 rows of rank 6.
Bundle LowRank() {
  const BundleSpec spec{.skeleton_basis = 40, .mesh_basis = 16};
  Bundle bundle = ParseBundle(spec);
  LowerRank(&bundle, 6);
  return bundle;
}

TEST(ModelMakerTest, RowsAreThoseOfTheBasis) {
  const Bundle bundle = LowRank();
  ModelMaker maker(bundle, {});
  EXPECT_EQ(maker.full_rows(), 56u);
  EXPECT_EQ(maker.exact_rank(), 6u);
  EXPECT_EQ(maker.DefaultRank(Precision::kFp32), 6u);
  EXPECT_EQ(maker.Make(Precision::kFp32, RankMaker::kFullRank).rows, 56u);
  EXPECT_EQ(maker.Make(Precision::kFp32, 6).rows, 6u);
  const Bundle full = ParseBundle({});
  EXPECT_EQ(ModelMaker(full, {}).DefaultRank(Precision::kFp32), RankMaker::kFullRank);
  const BundleSpec still{.skeleton = false, .mesh = false};
  const Bundle none = ParseBundle(still);
  EXPECT_EQ(ModelMaker(none, {}).Make(Precision::kFp32, RankMaker::kFullRank).rows, 0u);
}

TEST(ModelMakerTest, MakesWhatConvertWrites) {
  const Bundle bundle = LowRank();
  ModelMaker maker(bundle, {});
  for (const RankMode mode : {RankMode::kFull, RankMode::kExact}) {
    const ConvertOptions options{.precision = Precision::kFp16, .rank = {.mode = mode}};
    const uint32_t rank = mode == RankMode::kFull ? RankMaker::kFullRank : maker.DefaultRank(Precision::kFp16);
    const MadeModel made = maker.Make(Precision::kFp16, rank);
    EXPECT_TRUE(std::ranges::equal(made.model.bytes(), Convert(bundle, options).bytes));
  }
}

// Rows are told of a reduced basis alone, and the basis is left with what else is folded.
TEST(ModelMakerTest, WritesARankOrTheWholeBasis) {
  const Bundle bundle = LowRank();
  FoldedBundle folded = FoldBundle(bundle, 8, 8);
  RankMaker ranks(bundle, folded, {});
  const WrittenModel reduced = WriteRanked(bundle, &ranks, 6, {Precision::kFp32, {}, {}}, &folded);
  EXPECT_EQ(reduced.rows, 6u);
  ASSERT_TRUE(folded.reduced);
  EXPECT_EQ(folded.reduced->basis.rows(), 6);
  const WrittenModel whole = WriteRanked(bundle, &ranks, RankMaker::kFullRank, {Precision::kFp32, {}, {}}, &folded);
  EXPECT_EQ(whole.rows, 0u);
  EXPECT_FALSE(folded.reduced);
  EXPECT_GT(whole.bytes.size(), reduced.bytes.size());
}

TEST(ModelMakerTest, ErrorsNameTheBundle) {
  Bundle bundle = LowRank();
  bundle.mesh->hidden.weight(2, 1) = 1e6f;  // no half
  ModelMaker maker(bundle, {});
  EXPECT_TRUE(Mentions(ErrorText([&] { maker.Make(Precision::kFp16, RankMaker::kFullRank); }),
                       bundle.path.string() + ": tensor mesh.mlp.0.weight: found the weight 1e+06", "element [2, 1]"));
}

}  // namespace
}  // namespace dcloth::converter
