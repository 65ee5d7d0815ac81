// Sound scenes as the bytes that DecodeScene reads.
#include <string>

#include "tests/fuzz/targets.h"

namespace dcloth::testing {
namespace {

enum Format : uint8_t { kPlain, kFbx, kBvh };  // the first is FBX, too

class SceneWriter {
 public:
  SceneWriter& Bytes(std::initializer_list<unsigned> bytes) {
    for (const unsigned byte : bytes) bytes_.push_back(static_cast<uint8_t>(byte));
    return *this;
  }

  // Sixteenths from -7 to 7.
  SceneWriter& Numbers(std::initializer_list<double> values) {
    for (const double value : values) {
      const auto sixteenths = static_cast<int>(16 * value);
      Bytes({static_cast<unsigned>(sixteenths < 0 ? 119 - sixteenths : sixteenths)});
    }
    return *this;
  }

  SceneWriter& Move(double x, double y, double z) { return Bytes({1}).Numbers({x, y, z}); }

  // Three nodes, one above the other: n0 at 0, n1 at 1 m, n2 at 2 m.
  SceneWriter& Chain() {
    Bytes({3});
    Bytes({0, 0, 0});                        // name, no transform, no mesh
    Bytes({1, 0}).Move(0, 1, 0).Bytes({0});  // name, parent
    return Bytes({2, 255}).Move(0, 1, 0).Bytes({0});
  }

  // The same where a step of n1's transform is a node of its own, as FBX has it.
  SceneWriter& ChainWithHelper() {
    Bytes({4});
    Bytes({0, 0, 0});
    Bytes({27, 0}).Move(0, 1, 0).Bytes({0});
    Bytes({1, 255, 0, 0});
    return Bytes({2, 255}).Move(0, 1, 0).Bytes({0});
  }

  // A triangle held by n1 and n2.
  SceneWriter& Skin() {
    Bytes({1, 9, 3}).Numbers({0, 1, 0, 0.5, 1.5, 0, 0, 2, 0});
    Bytes({1, 0, 0, 1, 2});
    Bytes({2, 1}).Move(0, -1, 0).Bytes({2, 0}).Numbers({1}).Bytes({1}).Numbers({0.5});
    return Bytes({2}).Move(0, -2, 0).Bytes({2, 1}).Numbers({0.5}).Bytes({2}).Numbers({1});
  }

  // Half a second: n1 moves, n2 turns and grows.
  SceneWriter& Clip() {
    Bytes({1, 8}).Numbers({1}).Bytes({2});
    Bytes({1, 2}).Numbers({0, 0, 1, 0, 0.5, 0, 1.5, 0.25}).Bytes({0, 0});
    Bytes({2, 0, 1}).Numbers({0, 1, 1.25, 1});
    return Bytes({2}).Numbers({0, 1, 0, 0, 0, 0.5, 0.75, 0.75, 0, 0});
  }

  Seed Done(const char* name, bool sound = true) { return {name, std::move(bytes_), sound}; }

 private:
  std::vector<uint8_t> bytes_;
};

SceneWriter Of(Format format) { return std::move(SceneWriter().Bytes({format})); }

}  // namespace

std::vector<Seed> SceneSeeds() {
  constexpr unsigned kNone = 0, kHundred = 246;
  std::vector<Seed> seeds;
  const std::initializer_list<unsigned> nothing_asked = {0, 0, 0, 0, 0};
  seeds.push_back(Of(kPlain).Bytes(nothing_asked).Chain().Bytes({kNone}).Skin().Clip().Done("plain"));
  seeds.push_back(Of(kFbx)
                      .Bytes(nothing_asked)
                      .Chain()
                      .Bytes({1 + 4 + 8 + 16 + 32, kHundred, 0, 0, 1, 0, 2, 0})
                      .Skin()
                      .Clip()
                      .Done("fbx"));
  seeds.push_back(
      Of(kFbx).Bytes(nothing_asked).ChainWithHelper().Bytes({1, kHundred}).Skin().Clip().Done("fbx_helper"));
  seeds.push_back(Of(kBvh).Bytes(nothing_asked).Chain().Bytes({kNone, kNone}).Clip().Done("bvh"));
  seeds.push_back(Of(kPlain).Bytes({0, 0, 2, 20, 1, 21, 2, 0, 0}).Chain().Bytes({kNone}).Skin().Clip().Done("map"));
  seeds.push_back(Of(kBvh)
                      .Bytes({3, 2, 1, 20, 2, 2, 1, 20, 1})
                      .Move(0, 1, 0)
                      .Move(0, 2, 0)
                      .Chain()
                      .Bytes({kNone, kNone})
                      .Clip()
                      .Done("joints_and_bind"));
  seeds.push_back(Of(kFbx).Bytes(nothing_asked).Done("no_nodes", false));
  return seeds;
}

}  // namespace dcloth::testing
