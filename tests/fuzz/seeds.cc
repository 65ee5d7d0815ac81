// What fuzzers start from: small sound files of every kind, named corruptions, and what earlier fuzzing left.
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "tests/attack/corruption.h"
#include "tests/attack/variants.h"
#include "tests/fuzz/targets.h"
#include "tests/unit/converter/bundle_builder.h"

namespace dcloth::testing {
namespace {

Seed SeedOf(const std::string& name, const RawFile& file, bool sound = true) {
  const converter::AlignedBytes bytes = file.Bytes();
  const auto* data = reinterpret_cast<const uint8_t*>(bytes.data());
  return {name, {data, data + bytes.size()}, sound};
}

std::vector<Seed> ModelSeeds() {
  std::vector<Seed> seeds;
  for (const Variant& variant : Variants()) {
    const AlignedBytes bytes = BuildModel(variant.spec).Bytes();
    seeds.push_back({variant.name, {bytes.data(), bytes.data() + bytes.size()}, true});
  }
  for (const auto& rung :
       {StructureCorruptions(), GarmentCorruptions(), TensorCorruptions(), StageCorruptions(), BodyCorruptions()}) {
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

// The basis of the skeleton stage as readout [k_S, R] x components [R, n, 3].
RawFile Factored(const BundleSpec& spec, uint32_t rank, float size) {
  const auto ramp = [&](size_t count, float first) {
    std::vector<float> values(count);
    for (size_t i = 0; i < count; ++i) values[i] = size * (first + 0.125f * static_cast<float>(i % 5));
    return values;
  };
  RawFile file = BuildBundle(spec);
  file.Erase("skeleton.basis");
  file.Replace("skeleton.readout", {spec.skeleton_basis, rank}, ramp(size_t{spec.skeleton_basis} * rank, -0.25f));
  file.Replace("skeleton.components", {rank, spec.vertices, 3}, ramp(size_t{3} * rank * spec.vertices, 0.5f));
  return file;
}

std::vector<Seed> FactoredSeeds(const BundleSpec& spec) {
  std::vector<Seed> seeds;
  for (uint32_t rank = 1; rank <= spec.skeleton_basis; ++rank)
    seeds.push_back(SeedOf("factored_" + std::to_string(rank), Factored(spec, rank, 0.25f)));
  const RawFile whole = Factored(spec, 1, 0.25f);
  for (const char* missing : {"skeleton.readout", "skeleton.components"}) {
    RawFile file = whole;
    file.Erase(missing);
    seeds.push_back(SeedOf(std::string("without_") + missing, file, false));
  }
  RawFile both = whole;
  both.Replace("skeleton.basis", {spec.skeleton_basis, spec.vertices, 3},
               std::vector<float>(size_t{3} * spec.skeleton_basis * spec.vertices));
  seeds.push_back(SeedOf("factored_and_whole", both, false));
  seeds.push_back(SeedOf("factored_too_wide", Factored(spec, spec.skeleton_basis + 1, 0.25f), false));
  seeds.push_back(SeedOf("factored_beyond_f32", Factored(spec, 1, 2e20f), false));
  RawFile flat = whole;
  flat.Replace("skeleton.components", {1, size_t{3} * spec.vertices}, std::vector<float>(size_t{3} * spec.vertices));
  seeds.push_back(SeedOf("factored_flat_components", flat, false));
  return seeds;
}

std::vector<Seed> BundleSeeds() {
  std::vector<Seed> seeds;
  BundleSpec spec = SmallBundle();
  seeds.push_back(SeedOf("mesh", BuildBundle(spec)));
  spec.half_weights = true;
  seeds.push_back(SeedOf("half", BuildBundle(spec)));
  for (Seed& seed : FactoredSeeds(SmallBundle())) seeds.push_back(std::move(seed));
  RawFile parts = BuildBundle(SmallBundle());
  parts.SetMasks("body.parts", {1, 3, 3, 2});
  parts.SetMasks("template.touches", {0, 1, 1, 2, 2, 2, 3, 3, 3});
  seeds.push_back(SeedOf("parts", parts));
  spec.mesh = false;
  seeds.push_back(SeedOf("skeleton", BuildBundle(spec)));
  spec.skeleton = false;
  spec.root_motion = converter::RootMotion::kNone;
  seeds.push_back(SeedOf("static", BuildBundle(spec)));
  spec.patches = spec.patch_points = spec.sources = spec.embedding = 2;
  spec.patch_width = 8;
  spec.patch_neighbours = spec.patch_layers = 1;
  seeds.push_back(SeedOf("patches", BuildBundle(spec)));
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

std::vector<uint8_t> Read(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(path.string() + " cannot be read");
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace

std::vector<Seed> Seeds(const std::string& target) {
  if (target == "model") return ModelSeeds();
  if (target == "state") return StateSeeds();
  if (target == "gltf") return GltfSeeds();
  if (target == "scene") return SceneSeeds();
  return target == "bundle" ? BundleSeeds() : SequenceSeeds();
}

std::vector<KeptInput> Findings(const std::string& target) {
  std::vector<KeptInput> findings;
  for (const auto& entry : std::filesystem::directory_iterator(DCLOTH_KEPT_INPUTS)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(target + "-")) findings.push_back({name, Read(entry.path())});
  }
  return findings;
}

std::vector<KeptInput> PackedInputs(const std::string& target) {
  const std::filesystem::path path = std::filesystem::path(DCLOTH_KEPT_INPUTS) / (target + ".pack");
  const std::vector<uint8_t> pack = Read(path);
  std::vector<KeptInput> inputs;
  for (auto next = pack.begin(); next != pack.end();) {
    size_t length = 0, left = static_cast<size_t>(pack.end() - next);
    if (left < 4) throw std::runtime_error(path.string() + " is cut off");
    for (unsigned byte = 0; byte < 4; ++byte) length |= size_t{*next++} << (8 * byte);
    if (left - 4 < length) throw std::runtime_error(path.string() + " is cut off");
    const auto end = next + static_cast<std::ptrdiff_t>(length);
    inputs.push_back({"kept-" + std::to_string(inputs.size()), {next, end}});
    next = end;
  }
  return inputs;
}

}  // namespace dcloth::testing
