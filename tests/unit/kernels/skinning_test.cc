#include <cstring>

#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

class SkinningTest : public KernelTest {
 protected:
  void Check(size_t vertices, size_t influences, size_t stride_floats, bool with_delta, size_t bone_count) {
    SCOPED_TRACE(testing::Message() << table().name << " vertices " << vertices << " influences " << influences
                                    << " stride " << stride_floats << " delta " << with_delta);
    Random random(static_cast<uint32_t>(vertices * 64 + influences * 8 + stride_floats));
    const GuardedBuffer<float> matrices(random.Floats(12 * bone_count, -2.0f, 2.0f));
    const GuardedBuffer<float> positions(random.Floats(3 * vertices, -2.0f, 2.0f));
    const GuardedBuffer<float> delta0(random.Floats(3 * vertices, -0.2f, 0.2f));
    const GuardedBuffer<float> delta1(random.Floats(3 * vertices, -0.2f, 0.2f));
    GuardedBuffer<uint8_t> bones(vertices * influences);
    for (size_t i = 0; i < bones.size(); ++i)
      bones[i] = static_cast<uint8_t>(random.Below(static_cast<uint32_t>(bone_count)));
    const GuardedBuffer<float> weights(random.Floats(vertices * influences, 0.0f, 1.0f));
    // The last vertex ends where the buffer ends.
    GuardedBuffer<float> out((vertices - 1) * stride_floats + 3);
    std::vector<float> gaps(out.size());
    for (size_t i = 0; i < out.size(); ++i) gaps[i] = out[i] = static_cast<float>(i) + 0.25f;
    const float blend = 0.375f;
    table().skinning({matrices.data(), positions.data(), with_delta ? delta0.data() : nullptr,
                      with_delta ? delta1.data() : nullptr, bones.data(), weights.data(), out.data(), 4 * stride_floats,
                      vertices, influences, blend,
                      /*ahead=*/positions.data() + positions.size()});  // the guard page and beyond
    ASSERT_TRUE(out.SlackUntouched());
    for (size_t i = 0; i < vertices; ++i) {
      double p[4], size[4];
      for (size_t c = 0; c < 3; ++c) {
        const size_t at = 3 * i + c;
        p[c] = positions[at];
        size[c] = std::fabs(p[c]);
        if (!with_delta) continue;
        p[c] += delta0[at] + double{blend} * (double{delta1[at]} - delta0[at]);
        size[c] += std::fabs(delta0[at]) * (1 + blend) + std::fabs(delta1[at]) * blend;
      }
      p[3] = size[3] = 1;
      for (size_t row = 0; row < 3; ++row) {
        double exact = 0, magnitude = 0;
        for (size_t k = 0; k < influences; ++k) {
          const double weight = weights[i * influences + k];
          const float* a = matrices.data() + size_t{12} * bones[i * influences + k] + 4 * row;
          for (size_t c = 0; c < 4; ++c) {
            exact += weight * a[c] * p[c];
            magnitude += std::fabs(weight * a[c]) * size[c];
          }
        }
        // Roundings on the longest way: 4 of T + delta, K of the blended row, the product, 2 of the row sum.
        ASSERT_LE(std::fabs(out[i * stride_floats + row] - exact),
                  Gamma(static_cast<double>(influences) + 7) * magnitude)
            << "vertex " << i << " row " << row;
      }
      for (size_t gap = i * stride_floats + 3; gap < (i + 1) * stride_floats && gap < out.size(); ++gap) {
        ASSERT_EQ(std::memcmp(&out[gap], &gaps[gap], 4), 0) << "wrote outside the 12 bytes of vertex " << i;
      }
    }
  }
};
DCLOTH_TEST_EVERY_TABLE(SkinningTest);

TEST_P(SkinningTest, EveryVertexCount) {
  for (size_t vertices : InterestingSizes()) Check(vertices, 4, 3, vertices % 2 == 0, 24);
}

TEST_P(SkinningTest, EveryInfluenceCountStrideAndBoneCount) {
  for (size_t influences = 1; influences <= kMaxInfluences; ++influences) {
    for (size_t stride : {3, 4, 5, 8, 13}) Check(11, influences, stride, stride % 2 == 0, influences == 1 ? 1 : 256);
  }
}

// What is drawn of some vertices is what is drawn of all, to the bit: of every second one, of those at the ends, of
// all.
TEST_P(SkinningTest, ChosenVerticesAsOfAll) {
  const size_t vertices = 301;
  for (const size_t influences : {size_t{1}, size_t{4}, kMaxInfluences}) {
    Random random(static_cast<uint32_t>(influences));
    const GuardedBuffer<float> matrices(random.Floats(12 * 24, -2.0f, 2.0f));
    const GuardedBuffer<float> positions(random.Floats(3 * vertices, -2.0f, 2.0f));
    const GuardedBuffer<float> delta0(random.Floats(3 * vertices, -0.2f, 0.2f));
    const GuardedBuffer<float> delta1(random.Floats(3 * vertices, -0.2f, 0.2f));
    GuardedBuffer<uint8_t> bones(vertices * influences);
    for (size_t i = 0; i < bones.size(); ++i) bones[i] = static_cast<uint8_t>(random.Below(24));
    const GuardedBuffer<float> weights(random.Floats(vertices * influences, 0.0f, 1.0f));
    std::vector<float> all(3 * vertices);
    SkinningJob job = {matrices.data(), positions.data(), delta0.data(), delta1.data(),
                       bones.data(),    weights.data(),   all.data(),    12,
                       vertices,        influences,       0.375f};
    table().skinning(job);
    for (const size_t step : {size_t{1}, size_t{2}, size_t{7}, size_t{300}}) {
      std::vector<uint16_t> rising;
      for (size_t v = 0; v < vertices; v += step) rising.push_back(static_cast<uint16_t>(v));
      GuardedBuffer<uint16_t> chosen(rising.size());
      std::copy(rising.begin(), rising.end(), &chosen[0]);
      GuardedBuffer<float> out(5 * (rising.size() - 1) + 3);
      job.chosen = chosen.data();
      job.vertices = rising.size();
      job.out = &out[0];
      job.out_stride_bytes = 5 * sizeof(float);
      table().skinning(job);
      ASSERT_TRUE(out.SlackUntouched());
      for (size_t i = 0; i < rising.size(); ++i)
        ASSERT_EQ(std::memcmp(&out[5 * i], &all[size_t{3} * rising[i]], 12), 0)
            << table().name << " step " << step << " " << i;
    }
  }
}

}  // namespace
}  // namespace dcloth::kernels
