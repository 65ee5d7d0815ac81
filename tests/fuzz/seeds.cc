#include "tests/attack/corruption.h"
#include "tests/attack/variants.h"
#include "tests/fuzz/targets.h"
#include "tests/unit/converter/bundle_builder.h"

namespace dcloth::testing {
namespace {

Seed SeedOf(const std::string& name, const RawFile& file) {
  const converter::AlignedBytes bytes = file.Bytes();
  const auto* data = reinterpret_cast<const uint8_t*>(bytes.data());
  return {name, {data, data + bytes.size()}, true};
}

std::vector<Seed> ModelSeeds() {
  std::vector<Seed> seeds;
  for (const Variant& variant : Variants()) {
    const AlignedBytes bytes = BuildModel(variant.spec).Bytes();
    seeds.push_back({variant.name, {bytes.data(), bytes.data() + bytes.size()}, true});
  }
  for (const auto& rung :
       {StructureCorruptions(), GarmentCorruptions(), TensorCorruptions(), StageCorruptions()}) {
    for (const Corruption& corruption : rung) {
      const AlignedBytes bytes = Corrupted(corruption);
      seeds.push_back({corruption.name, {bytes.data(), bytes.data() + bytes.size()}, false});
    }
  }
  return seeds;
}

BundleSpec SmallBundle() {
  BundleSpec spec;
  spec.vertices = 9;
  spec.joints = 3;
  spec.feature_joints = 1;
  spec.bones = 2;
  spec.body_vertices = 4;
  spec.static_width = 2;
  spec.skeleton_basis = 2;
  spec.mesh_basis = 2;
  spec.layers = 1;
  spec.mesh_width = 2;
  return spec;
}

std::vector<Seed> BundleSeeds() {
  std::vector<Seed> seeds;
  BundleSpec spec = SmallBundle();
  seeds.push_back(SeedOf("mesh", BuildBundle(spec)));
  spec.half_weights = true;
  seeds.push_back(SeedOf("half", BuildBundle(spec)));
  spec.mesh = false;
  seeds.push_back(SeedOf("skeleton", BuildBundle(spec)));
  spec.skeleton = spec.root_motion = false;
  seeds.push_back(SeedOf("static", BuildBundle(spec)));
  return seeds;
}

std::vector<Seed> SequenceSeeds() {
  const BundleSpec spec = SmallBundle();
  std::vector<Seed> seeds;
  seeds.push_back(SeedOf("poses", BuildSequence(spec, 2)));
  seeds.push_back(SeedOf("truth", BuildSequence(spec, 2, true, 29.97)));
  RawFile half = BuildSequence(spec, 2, true);
  RawTensor& truth = half.At("truth");
  truth.type = converter::SafeType::kF16;
  truth.bytes.assign(truth.bytes.size() / 2, std::byte{0x3C});
  half.Replace("truth_origin", {2, 3}, {1, 2, 3, 4, 5, 6});
  seeds.push_back(SeedOf("half_truth", half));
  return seeds;
}

}  // namespace

std::vector<Seed> Seeds(const std::string& target) {
  if (target == "model") return ModelSeeds();
  if (target == "state") return StateSeeds();
  return target == "bundle" ? BundleSeeds() : SequenceSeeds();
}

}  // namespace dcloth::testing
