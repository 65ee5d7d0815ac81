#include "converter/safetensors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <set>
#include <string>

#include "converter/safetensors_header.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

AlignedBytes File(const std::string& header, size_t data_bytes) {
  AlignedBytes bytes(8 + header.size() + data_bytes);
  const uint64_t size = header.size();
  std::memcpy(bytes.data(), &size, 8);
  std::memcpy(bytes.data() + 8, header.data(), header.size());
  return bytes;
}

std::string Refusal(const std::string& header, size_t data_bytes) {
  return ErrorText([&] { SafeFile::Parse(File(header, data_bytes), "f.safetensors"); });
}

TEST(SafetensorsTest, ReadsWhatItWrites) {
  const std::vector<float> a = {1.5f, -2.25f, 3};
  const std::vector<int8_t> b = {-1, 2};
  const SafeTensor tensors[] = {{"a", SafeType::kF32, {1, 3}, std::as_bytes(std::span(a))},
                                {"b \"\xC3\xBC\"", SafeType::kI8, {2}, std::as_bytes(std::span(b))},
                                {"none", SafeType::kF64, {0, 7}, {}},
                                {"scalar", SafeType::kF32, {}, std::as_bytes(std::span(a).first(1))}};
  const std::filesystem::path path = std::filesystem::path(::testing::TempDir()) / "dcloth_safetensors_test";
  WriteSafetensors(path, tensors, {{"k", "v"}, {"list", "[\"x\"]"}});
  const SafeFile file = SafeFile::Read(path);
  std::filesystem::remove(path);
  ASSERT_EQ(file.tensors().size(), 4u);
  for (size_t i = 0; i < 4; ++i) {
    const SafeTensor& read = file.tensors()[i];
    EXPECT_EQ(read.type, tensors[i].type);
    EXPECT_EQ(read.shape, tensors[i].shape);
    ASSERT_EQ(read.bytes.size(), tensors[i].bytes.size());
    EXPECT_TRUE(std::equal(read.bytes.begin(), read.bytes.end(), tensors[i].bytes.begin()));
  }
  EXPECT_EQ(file.RequireMetadata("list"), "[\"x\"]");
  EXPECT_EQ(FloatsOf(file, file.Require("a")), a);
  EXPECT_EQ(file.Find("z"), nullptr);
  EXPECT_TRUE(Mentions(ErrorText([&] { file.Require("z"); }), "tensor z: found no such tensor"));
  EXPECT_TRUE(Mentions(ErrorText([&] { file.RequireMetadata("z"); }), "no metadata 'z'"));
}

// Data start on eight bytes whatever the header says.
TEST(SafetensorsTest, HeadersAreMultiplesOfEight) {
  const float one = 1;
  const auto bytes = std::as_bytes(std::span(&one, 1));
  std::set<size_t> spaces;
  for (size_t length = 1; length <= 8; ++length) {
    const SafeTensor tensor[] = {{std::string(length, 'n'), SafeType::kF32, {1}, bytes}};
    const std::string header = SafeHeader(tensor, {});
    EXPECT_EQ(header.size() % 8, 0u);
    spaces.insert(header.size() - header.find_last_not_of(' '));
  }
  EXPECT_EQ(spaces.size(), 8u) << "no more than needed";
}

TEST(SafetensorsTest, HalvesBecomeFloats) {
  const std::string header = R"({"h":{"dtype":"F16","shape":[4],"data_offsets":[0,8]}})";
  AlignedBytes bytes = File(header, 8);
  const uint16_t halves[] = {0x3C00, 0xC100, 0x0001, 0x7BFF};
  std::memcpy(bytes.data() + 8 + header.size(), halves, sizeof(halves));
  const SafeFile file = SafeFile::Parse(std::move(bytes), "f.safetensors");
  EXPECT_EQ(FloatsOf(file, file.Require("h")), (std::vector<float>{1, -2.5f, 0x1p-24f, 65504}));
}

// Each prefix in a block of exactly its size, so that a sanitizer sees any read past it.
TEST(SafetensorsTest, EveryTruncatedPrefixIsRefused) {
  RawFile raw;
  raw.metadata = {{"k", "v"}};
  raw.Replace("a", {3, 2}, {1, 2, 3, 4, 5, 6});
  raw.Replace("b", {1}, {7});
  const AlignedBytes whole = raw.Bytes();
  EXPECT_EQ(ErrorText([&] { SafeFile::Parse(whole, "f"); }), "");
  for (size_t size = 0; size < whole.size(); ++size) {
    AlignedBytes prefix(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    prefix.shrink_to_fit();
    ASSERT_TRUE(Mentions(ErrorText([&] { SafeFile::Parse(prefix, "f"); }), "f: ")) << size;
  }
  AlignedBytes longer = whole;
  longer.push_back(std::byte{0});
  EXPECT_TRUE(Mentions(ErrorText([&] { SafeFile::Parse(longer, "f"); }), "1 bytes after the last tensor"));
}

// No single changed header byte may crash; most must be refused, all parse deterministically.
TEST(SafetensorsTest, ChangedBytesNeverCrash) {
  RawFile raw;
  raw.Replace("a", {3, 2}, {1, 2, 3, 4, 5, 6});
  const AlignedBytes whole = raw.Bytes();
  size_t refused = 0, tried = 0;
  for (size_t at = 0; at + 24 < whole.size(); ++at) {
    for (const uint8_t value : {0x00, 0x22, 0x2D, 0x30, 0x39, 0x5B, 0x7B, 0x7D, 0x80, 0xFF}) {
      AlignedBytes changed = whole;
      if (changed[at] == std::byte{value}) continue;
      changed[at] = std::byte{value};
      ++tried;
      refused += ErrorText([&] { SafeFile::Parse(changed, "f"); }).empty() ? 0 : 1;
    }
  }
  EXPECT_GT(tried, 500u);
  EXPECT_GT(refused, tried * 8 / 10);
}

struct BadHeader {
  const char* name;
  std::string header;
  size_t data_bytes;
  const char* expected;
};

class BadHeaderTest : public ::testing::TestWithParam<BadHeader> {};

TEST_P(BadHeaderTest, IsRefusedByName) {
  EXPECT_TRUE(Mentions(Refusal(GetParam().header, GetParam().data_bytes), "f.safetensors", GetParam().expected));
}

std::string Tensor(const std::string& dtype, const std::string& shape, const std::string& offsets) {
  return R"({"dtype":")" + dtype + R"(","shape":)" + shape + R"(,"data_offsets":)" + offsets + "}";
}

const BadHeader kBadHeaders[] = {
    {"NotJson", "{\"a\":", 0, "not JSON"},
    {"NotAnObject", "[1]", 0, "without '{'"},
    {"Empty", "", 0, "without '{'"},
    {"LeadingSpace", " {}", 0, "without '{'"},
    {"Trailing", "{}x", 0, "not JSON"},
    {"BadUtf8", "{\"a\xFF\":{}}", 0, "not JSON"},
    {"ZeroByte", std::string("{}\0x", 4), 0, "a zero byte"},
    {"NameTwice", "{\"a\":" + Tensor("U8", "[1]", "[0,1]") + ",\"a\":" + Tensor("U8", "[1]", "[1,2]") + "}", 2,
     "a name that"},
    {"FieldTwice", R"({"a":{"dtype":"U8","dtype":"U8","shape":[1],"data_offsets":[0,1]}})", 1, "'dtype' twice"},
    {"MetadataTwice", R"({"__metadata__":{"k":"v","k":"w"}})", 0, "'k' twice"},
    {"MetadataNumber", R"({"__metadata__":{"k":1}})", 0, "expected texts only"},
    {"MetadataNested", R"({"__metadata__":{"k":{}}})", 0, "expected texts only"},
    {"MetadataList", R"({"__metadata__":[]})", 0, "a list"},
    {"UnknownDtype", "{\"a\":" + Tensor("F8", "[1]", "[0,1]") + "}", 1, "dtype 'F8'"},
    {"UnknownField", R"({"a":{"dtype":"U8","shape":[1],"data_offsets":[0,1],"x":1}})", 1, "the field 'x'"},
    {"MissingField", R"({"a":{"dtype":"U8","shape":[1]}})", 0, "2 fields"},
    {"NotATensor", R"({"a":7})", 0, "the number 7"},
    {"NegativeExtent", "{\"a\":" + Tensor("U8", "[-1]", "[0,1]") + "}", 1, "the number -1"},
    {"FractionalExtent", "{\"a\":" + Tensor("U8", "[1.0]", "[0,1]") + "}", 1, "the number 1.0"},
    {"HugeExtent", "{\"a\":" + Tensor("U8", "[18446744073709551616]", "[0,1]") + "}", 1, "tensor a: found the number"},
    {"NestedShape", "{\"a\":" + Tensor("U8", "[[1]]", "[0,1]") + "}", 1, "a list"},
    {"BooleanExtent", "{\"a\":" + Tensor("U8", "[true]", "[0,1]") + "}", 1, "a boolean"},
    {"NullExtent", "{\"a\":" + Tensor("U8", "[null]", "[0,1]") + "}", 1, "null"},
    {"DtypeList", R"({"a":{"dtype":["U8"],"shape":[1],"data_offsets":[0,1]}})", 1, "a list"},
    {"ShapeText", R"({"a":{"dtype":"U8","shape":"[1]","data_offsets":[0,1]}})", 1, "the text"},
    {"ManyDimensions", "{\"a\":" + Tensor("U8", "[1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1]", "[0,1]") + "}", 1,
     "too many numbers in shape"},
    {"OneOffset", "{\"a\":" + Tensor("U8", "[0]", "[0]") + "}", 0, "1 data_offsets"},
    {"ThreeOffsets", "{\"a\":" + Tensor("U8", "[1]", "[0,1,2]") + "}", 1, "too many numbers in data_offsets"},
    {"OffsetsBackwards", "{\"a\":" + Tensor("U8", "[1]", "[1,0]") + "}", 1, "bytes 1 to 0"},
    {"OffsetsWrapped", "{\"a\":" + Tensor("U8", "[18446744073709551615]", "[1,0]") + "}", 1, "bytes 1 to 0"},
    {"SizeMismatch", "{\"a\":" + Tensor("F32", "[2]", "[0,4]") + "}", 4, "8 bytes for F32 [2]"},
    // 2^33 * 2^31 * 4 wraps to 0 in 64 bits.
    {"WrappedProduct", "{\"a\":" + Tensor("F32", "[8589934592,2147483648]", "[0,0]") + "}", 0, "fits in 64 bits"},
    {"WrappedBeforeZero", "{\"a\":" + Tensor("F32", "[8589934592,2147483648,0]", "[0,0]") + "}", 0, "fits in 64 bits"},
    {"PastTheEnd", "{\"a\":" + Tensor("U8", "[2]", "[0,2]") + "}", 1, "the file is cut off"},
    {"Overlap", "{\"a\":" + Tensor("U8", "[2]", "[0,2]") + ",\"b\":" + Tensor("U8", "[2]", "[1,3]") + "}", 3,
     "overlap"},
    {"Shared", "{\"a\":" + Tensor("U8", "[2]", "[0,2]") + ",\"b\":" + Tensor("U8", "[2]", "[0,2]") + "}", 2, "overlap"},
    {"Hole", "{\"a\":" + Tensor("U8", "[1]", "[0,1]") + ",\"b\":" + Tensor("U8", "[1]", "[2,3]") + "}", 3, "a hole"},
    {"LeadingHole", "{\"a\":" + Tensor("U8", "[1]", "[1,2]") + "}", 2, "a hole"},
    {"TrailingBytes", "{\"a\":" + Tensor("U8", "[1]", "[0,1]") + "}", 2, "1 bytes after"},
    {"NoTensorsButBytes", "{}", 3, "3 bytes after"},
};
INSTANTIATE_TEST_SUITE_P(Safetensors, BadHeaderTest, ::testing::ValuesIn(kBadHeaders),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(SafetensorsTest, DeepNestingIsRefusedWithoutRecursion) {
  EXPECT_TRUE(Mentions(Refusal("{\"a\":" + std::string(1 << 20, '['), 0), "a list"));
  EXPECT_TRUE(Mentions(Refusal("{\"a\":{\"shape\":" + std::string(1 << 20, '['), 0), "a list"));
}

// By the first nine bytes: a header's length that fits, then the header's first character.
TEST(SafetensorsTest, LooksLikeOneByLengthAndBrace) {
  AlignedBytes bytes = File("{}", 3);
  const auto looks = [&](size_t size) { return LooksLikeSafetensors(std::span(bytes).first(size)); };
  EXPECT_TRUE(looks(bytes.size()));
  EXPECT_TRUE(looks(10));
  EXPECT_FALSE(looks(9)) << "half of the header";
  bytes[8] = std::byte{'['};
  EXPECT_FALSE(looks(bytes.size()));
  bytes = File("{", 0);
  EXPECT_TRUE(looks(9));
  bytes[0] = std::byte{0};
  for (size_t size = 0; size <= 8; ++size) EXPECT_FALSE(looks(size)) << size;
  EXPECT_TRUE(looks(9)) << "the rest is the parser's";
}

TEST(SafetensorsTest, SizesFitIn64Bits) {
  EXPECT_EQ(CheckedSize(SafeType::kU8, {UINT64_MAX / 3, 3}), UINT64_MAX);
  EXPECT_EQ(CheckedSize(SafeType::kU8, {UINT64_MAX / 3 + 1, 3}), std::nullopt);
  EXPECT_EQ(CheckedSize(SafeType::kF64, {UINT64_MAX / 8}), UINT64_MAX - 7);
  EXPECT_EQ(CheckedSize(SafeType::kF64, {UINT64_MAX / 8 + 1}), std::nullopt);
  EXPECT_EQ(CheckedSize(SafeType::kF32, {}), 4u);
  EXPECT_EQ(CheckedSize(SafeType::kF32, {0, UINT64_MAX}), 0u);
}

TEST(SafetensorsTest, HeaderLengthIsBounded) {
  for (const uint64_t length : {uint64_t{3}, uint64_t{100'000'001}, UINT64_MAX, UINT64_MAX - 7}) {
    AlignedBytes bytes = File("{}", 0);
    std::memcpy(bytes.data(), &length, 8);
    EXPECT_TRUE(Mentions(ErrorText([&] { SafeFile::Parse(bytes, "f"); }), "a header of " + std::to_string(length)))
        << length;
  }
  AlignedBytes large(8 + kMaxHeaderBytes + 1, std::byte{' '});
  const uint64_t length = kMaxHeaderBytes + 1;
  std::memcpy(large.data(), &length, 8);
  EXPECT_TRUE(Mentions(ErrorText([&] { SafeFile::Parse(std::move(large), "f"); }), "at most 100000000"));
}

TEST(SafetensorsTest, NumbersThatAreNoneAreRefusedWithTheirPlace) {
  RawFile raw;
  raw.Replace("a", {3}, {1, NAN, 3});
  raw.Replace("b", {2}, {1, -INFINITY});
  raw.Replace("c", {2}, {NAN, NAN});
  const SafeFile file = SafeFile::Parse(raw.Bytes(), "f");
  EXPECT_TRUE(Mentions(ErrorText([&] { FloatsOf(file, file.Require("a")); }), "tensor a: found NaN at element 1"));
  EXPECT_TRUE(Mentions(ErrorText([&] { FloatsOf(file, file.Require("b")); }), "infinity at element 1"));
  EXPECT_TRUE(Mentions(ErrorText([&] { FloatsOf(file, file.Require("c")); }), "NaN at element 0"));
  const SafeFile integers = SafeFile::Parse(File("{\"i\":" + Tensor("I32", "[1]", "[0,4]") + "}", 4), "f");
  EXPECT_TRUE(
      Mentions(ErrorText([&] { FloatsOf(integers, integers.Require("i")); }), "dtype I32, expected F32 or F16"));
}

TEST(SafetensorsTest, WriterRefusesWhatTheReaderWould) {
  const std::vector<float> a = {1, 2};
  const auto bytes = std::as_bytes(std::span(a));
  const SafeTensor twice[] = {{"a", SafeType::kF32, {2}, bytes}, {"a", SafeType::kF32, {2}, bytes}};
  EXPECT_TRUE(Mentions(ErrorText([&] { SafeHeader(twice, {}); }), "a name that"));
  const SafeTensor wrong[] = {{"a", SafeType::kF32, {3}, bytes}};
  EXPECT_TRUE(Mentions(ErrorText([&] { SafeHeader(wrong, {}); }), "8 bytes, expected the bytes of F32 [3]"));
  Shape deepest(kMaxDimensions, 1);
  deepest[0] = 2;
  SafeTensor deep[] = {{"a", SafeType::kF32, deepest, bytes}};
  const std::string header = SafeHeader(deep, {});
  EXPECT_EQ(SafeFile::Parse(File(header, 8), "f").Require("a").shape, deepest);
  deep[0].shape.push_back(1);
  EXPECT_TRUE(Mentions(ErrorText([&] { SafeHeader(deep, {}); }), "expected the bytes of F32 [2, 1"));
  const SafeTensor reserved[] = {{"__metadata__", SafeType::kF32, {2}, bytes}};
  EXPECT_TRUE(Mentions(ErrorText([&] { SafeHeader(reserved, {}); }), "reserved"));
  const SafeTensor latin[] = {{"\xE9", SafeType::kF32, {2}, bytes}};
  EXPECT_TRUE(Mentions(ErrorText([&] { SafeHeader(latin, {}); }), "not UTF-8"));
}

}  // namespace
}  // namespace dcloth::converter
