// Safetensors: an 8-byte header length, a JSON header, then tensors without holes. The reader treats a file as hostile:
// truncation, overlap, holes, trailing bytes, duplicate names, unknown dtypes, sizes that do not match shapes, products
// that wrap, headers beyond 100 MB, bad UTF-8 and unknown fields are all refused. Files are little-endian, as the host
// is.
#ifndef DCLOTH_CONVERTER_SAFETENSORS_H_
#define DCLOTH_CONVERTER_SAFETENSORS_H_

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "converter/file.h"

namespace dcloth::converter {

enum class SafeType { kBool, kU8, kI8, kU16, kI16, kF16, kBF16, kU32, kI32, kF32, kU64, kI64, kF64 };

const char* SafeTypeName(SafeType type);  // "F32"
size_t SafeTypeSize(SafeType type);       // bytes of one element

using Shape = std::vector<uint64_t>;
std::string ShapeText(const Shape& shape);  // "[3, 4]"

// By the file's beginning: the length of a header that fits, and the header's brace.
bool LooksLikeSafetensors(std::span<const std::byte> file);

// A named array; `bytes` belongs to someone else and may lie on any address.
struct SafeTensor {
  std::string name;
  SafeType type;
  Shape shape;
  std::span<const std::byte> bytes;

  uint64_t count() const;  // elements
};

using Metadata = std::map<std::string, std::string, std::less<>>;

class SafeFile {
 public:
  // Throws Error. `path` of Parse only names the source in errors.
  static SafeFile Read(const std::filesystem::path& path);
  static SafeFile Parse(AlignedBytes bytes, std::filesystem::path path);

  SafeFile(SafeFile&&) = default;
  SafeFile& operator=(SafeFile&&) = default;

  const std::filesystem::path& path() const { return path_; }
  const std::vector<SafeTensor>& tensors() const { return tensors_; }  // in file order
  const Metadata& metadata() const { return metadata_; }

  const SafeTensor* Find(std::string_view name) const;     // null when absent
  const SafeTensor& Require(std::string_view name) const;  // throws Error
  const std::string& RequireMetadata(std::string_view key) const;

 private:
  SafeFile() = default;

  std::filesystem::path path_;
  AlignedBytes bytes_;
  std::vector<SafeTensor> tensors_;
  Metadata metadata_;
};

// What mends a file with PyTorch: "run python3 -c ...", a copy whose tensors are `items`, of each name k and tensor v.
std::string RewriteCommand(const std::string& items);

// Throws Error: the tensor's dtype, and the command that casts all of a dtype that no file of ours has.
[[noreturn]] void RefuseType(const SafeFile& file, const SafeTensor& tensor, const std::string& expected);

// The numbers of an F32 or F16 tensor, exact; throws Error for other dtypes and for NaN or infinity.
std::vector<float> FloatsOf(const SafeFile& file, const SafeTensor& tensor);

// The file's header, spaces added so that data start on 8 bytes; tensors follow in the order given (widest dtypes first
// keeps each on its own width). The same input gives the same bytes. Throws Error for names or shapes the reader
// refuses.
std::string SafeHeader(std::span<const SafeTensor> tensors, const Metadata& metadata);

// Writes atomically. Throws Error.
void WriteSafetensors(const std::filesystem::path& path, std::span<const SafeTensor> tensors, const Metadata& metadata);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_SAFETENSORS_H_
