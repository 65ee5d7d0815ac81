// A character of two joints, a skin of one triangle and a clip as glTF, in each way that its values may be stored.
#include <bit>
#include <cstring>
#include <string>
#include <vector>

#include "tests/fuzz/targets.h"

namespace dcloth::testing {
namespace {

enum Type : int { kByte = 5120, kUnsignedByte = 5121, kShort = 5122, kUnsignedShort = 5123, kFloat = 5126 };

std::string Base64(const std::string& bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t at = 0; at < bytes.size(); at += 3) {
    uint32_t three = 0;
    for (size_t i = 0; i < 3; ++i)
      three = three << 8 | (at + i < bytes.size() ? static_cast<uint8_t>(bytes[at + i]) : 0);
    for (size_t i = 0; i < 4; ++i) text += at + i > bytes.size() ? '=' : kDigits[three >> (18 - 6 * i) & 63];
  }
  return text;
}

std::string Word(size_t value) {
  std::string bytes;
  for (unsigned i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (8 * i) & 255);
  return bytes;
}

std::string Padded(std::string bytes, char with) {
  while (bytes.size() % 4 != 0) bytes += with;
  return bytes;
}

// Members of the document, as JSON, and the bytes that its accessors name.
struct Document {
  // The number of a new accessor of `values`; integers are normalized unless they count joints or vertices.
  std::string Values(const char* shape, size_t width, Type type, std::vector<double> values, bool counts = false) {
    const size_t first = binary.size();
    for (const double value : values) {
      const uint32_t bits = type == kFloat ? std::bit_cast<uint32_t>(static_cast<float>(value))
                                           : static_cast<uint32_t>(static_cast<int32_t>(value));
      binary += Word(bits).substr(0, type == kFloat ? 4 : type >= kShort ? 2 : 1);
    }
    const std::string number = std::to_string(accessor_count++);
    const char* const comma = number == "0" ? "" : ",";
    views += comma + (R"({"buffer":0,"byteOffset":)" + std::to_string(first)) + R"(,"byteLength":)" +
             std::to_string(binary.size() - first) + "}";
    accessors += comma + (R"({"bufferView":)" + number) + R"(,"componentType":)" + std::to_string(type) +
                 R"(,"count":)" + std::to_string(values.size() / width) + R"(,"type":")" + shape + "\"" +
                 (type == kFloat || counts ? "" : R"(,"normalized":true)") + "}";
    binary = Padded(binary, 0);
    return number;
  }

  std::string Json(const std::string& buffer_uri) const {
    return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,2]}],"nodes":[)" + nodes + R"(],"meshes":[)" +
           R"({"primitives":[{"attributes":{)" + attributes + "}" + primitive + "}]" + mesh +
           R"(}],"skins":[{"joints":)" + joints + skin + R"(}],"animations":[{"samplers":[{"input":)" + times +
           R"(,"output":)" + keys + R"(,"interpolation":")" + interpolation +
           R"("}],"channels":[{"sampler":0,"target":{"node":1,"path":")" + path + R"("}}]}],"accessors":[)" +
           accessors + R"(],"bufferViews":[)" + views + R"(],"buffers":[{"byteLength":)" +
           std::to_string(binary.size()) + buffer_uri + "}]" + more + "}";
  }

  Seed Glb(const char* name, bool sound = true) const {
    const std::string json = Padded(Json(""), ' ');
    std::string file = Word(json.size()) + "JSON" + json + Word(binary.size()) + std::string("BIN\0", 4) + binary;
    file = "glTF" + Word(2) + Word(12 + file.size()) + file;
    return {name, {file.begin(), file.end()}, sound};
  }
  Seed Text(const char* name, bool sound = true) const {
    const std::string json = Json(R"(,"uri":"data:application/octet-stream;base64,)" + Base64(binary) + "\"");
    return {name, {json.begin(), json.end()}, sound};
  }

  std::string binary, accessors, views;
  size_t accessor_count = 0;
  std::string nodes = R"({"name":"Hips","translation":[0,1,0],"children":[1]},{"name":"Leg","translation":[0,-0.5,0],)"
                      R"("rotation":[0,0,0,1]},{"name":"Skin","mesh":0,"skin":0})";
  std::string attributes, primitive, mesh, joints = "[0,1]", skin, times, keys, interpolation = "LINEAR",
                                           path = "rotation", more;
};

struct Stored {
  Type places = kFloat, weights = kFloat, keys = kFloat;
  bool bind = true;
};

Document Character(const Stored& as = {}) {
  Document out;
  const double half = as.places == kFloat ? 0.5 : 16384, weight = as.weights == kFloat ? 1 : 255;
  const double one = as.keys == kFloat ? 1 : 32767, turned = 0.6 * one, other = 0.8 * one;
  const double height = as.bind ? 1 : 0;  // without bind matrices places are the joints' own
  out.attributes =
      R"("POSITION":)" +
      out.Values("VEC3", 3, as.places, {0, 2 * half * height, 0, half, half * height, 0, -half, half * height, 0}) +
      R"(,"JOINTS_0":)" + out.Values("VEC4", 4, kUnsignedByte, {0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, true) +
      R"(,"WEIGHTS_0":)" + out.Values("VEC4", 4, as.weights, {weight, 0, 0, 0, weight, 0, 0, 0, weight, 0, 0, 0});
  out.primitive = R"(,"indices":)" + out.Values("SCALAR", 1, kUnsignedShort, {0, 1, 2}, true);
  std::vector<double> bind;
  for (const double up : {-1.0, -0.5}) {
    for (const double value : {1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, up, 0.0, 1.0})
      bind.push_back(value);
  }
  if (as.bind) out.skin = R"(,"inverseBindMatrices":)" + out.Values("MAT4", 16, kFloat, bind);
  out.times = out.Values("SCALAR", 1, kFloat, {0, 0.5});
  out.keys = out.Values("VEC4", 4, as.keys, {0, 0, 0, one, turned, 0, 0, other});
  return out;
}

}  // namespace

std::vector<Seed> GltfSeeds() {
  std::vector<Seed> seeds = {Character().Glb("binary"), Character().Text("text")};
  seeds.push_back(Character({.places = kShort, .weights = kUnsignedByte, .keys = kShort}).Glb("quantised"));
  seeds.push_back(Character({.bind = false}).Text("no_bind"));
  Document document = Character();
  document.interpolation = "STEP";
  seeds.push_back(document.Glb("step"));
  document.interpolation = "CUBICSPLINE";
  seeds.push_back(document.Text("too_few_for_splines", false));
  document.path = "translation";
  document.keys = document.Values("VEC3", 3, kFloat, {0, 0, 0, 0, -0.5, 0, 1, 0, 0, 1, 0, 0, 0.5, -0.5, 0, 0, 0, 0});
  seeds.push_back(document.Glb("splines"));
  document = Character();
  document.mesh = R"(,"weights":[0.5])";
  document.primitive +=
      R"(,"targets":[{"POSITION":)" + document.Values("VEC3", 3, kFloat, {0, 0.5, 0, 0, 0, 0, 0, 0, 0}) + "}]";
  seeds.push_back(document.Text("morph"));
  document = Character();
  document.attributes += R"(,"TEXCOORD_0":)" + document.Values("VEC2", 2, kFloat, {0, 0, 1, 0, 0, 1}) +
                         R"(,"COLOR_0":)" + document.Values("VEC3", 3, kUnsignedByte, {255, 0, 0, 0, 255, 0, 9, 9, 9});
  document.primitive += R"(,"material":0)";
  document.more = R"(,"materials":[{"alphaMode":"MASK","pbrMetallicRoughness":{"baseColorFactor":[1,0.5,0,1],)"
                  R"("baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":{"offset":[0.5,0],)"
                  R"("rotation":1,"scale":[2,2]}}}}}],"textures":[{"source":0}],"images":[{"mimeType":"image/png",)"
                  R"("uri":"data:image/png;base64,iVBORw0KGgo="}])";
  seeds.push_back(document.Text("looks"));
  document = Character();
  document.accessors +=
      R"(,{"componentType":5126,"count":3,"type":"VEC3","sparse":{"count":1,"indices":{"bufferView":)" +
      document.primitive.substr(11) + R"(,"componentType":5123},"values":{"bufferView":0}}})";
  document.attributes.replace(11, 1, std::to_string(document.accessor_count));
  seeds.push_back(document.Glb("sparse"));
  document = Character();
  document.more =
      R"(,"extensions":{"VRMC_vrm":{"humanoid":{"humanBones":{"hips":{"node":0},"leftUpperLeg":{"node":1}}}},)"
      R"("VRM":{"humanoid":{"humanBones":[{"bone":"hips","node":0}]}}})";
  seeds.push_back(document.Glb("vrm"));

  Seed cut = seeds[0];
  cut.name = "cut", cut.sound = false;
  cut.bytes.resize(cut.bytes.size() - 64);
  seeds.push_back(cut);
  for (const auto& [name, nodes] :
       {std::pair("circle", R"({"name":"Hips","children":[1]},{"children":[0]},{"mesh":0,"skin":0})"),
        std::pair("no_number", R"({"name":"Hips","translation":[NaN,0,0],"children":[1]},{},{})"),
        std::pair("beyond", R"({"name":"Hips","children":[7]},{},{"mesh":0,"skin":0})")}) {
    document = Character();
    document.nodes = nodes;
    seeds.push_back(document.Text(name, false));
  }
  return seeds;
}

}  // namespace dcloth::testing
