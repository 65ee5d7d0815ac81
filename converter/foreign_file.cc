#include "converter/foreign_file.h"

#include <algorithm>
#include <string_view>

namespace dcloth::converter {
namespace {

constexpr const char* kSaveTensors =
    "run python3 -c \"import torch; from safetensors.torch import save_file; save_file(torch.load('old.pt', "
    "weights_only=True), 'new.safetensors')\" and add what converter/BUNDLE.md lists";

struct Magic {
  std::string_view bytes;
  std::string_view within;  // what the first bytes hold besides; empty where `bytes` are enough
  ForeignFile file;
};

constexpr Magic kMagics[] = {
    {"version https://git-lfs.github.com/spec/", {}, {"a Git LFS pointer", "run git lfs pull where it was cloned"}},
    {"PK\x03\x04", "data.pkl", {"a file of torch.save", kSaveTensors}},
    {"PK\x03\x04", {}, {"a zip archive", "unpack it and pass the file in it"}},
    {"\x80\x02", {}, {"a pickle, as torch.save writes", kSaveTensors}},
    {"\x80\x03", {}, {"a pickle, as torch.save writes", kSaveTensors}},
    {"\x80\x04", {}, {"a pickle, as torch.save writes", kSaveTensors}},
    {"\x80\x05", {}, {"a pickle, as torch.save writes", kSaveTensors}},
    {"<!DOCTYPE html", {}, {"a web page", "download the file itself, not the page that shows it"}},
};

// A ModelProto starts with field 1, its ir_version, then has the producer (2 to 4), the graph (7) or opset (8).
bool IsOnnx(std::string_view text) {
  constexpr std::string_view kNextFields = "\x12\x1A\x22\x3A\x42";
  return text.size() > 2 && text[0] == '\x08' && text[1] > 0 && kNextFields.find(text[2]) != std::string_view::npos;
}

}  // namespace

ForeignFile ForeignFileOf(std::span<const std::byte> bytes) {
  constexpr size_t kHead = 256;
  const std::string_view head(reinterpret_cast<const char*>(bytes.data()), std::min(bytes.size(), kHead));
  for (const Magic& magic : kMagics) {
    if (head.starts_with(magic.bytes) && head.find(magic.within) != std::string_view::npos) return magic.file;
  }
  if (IsOnnx(head)) return {"an ONNX file", "export the bundle from the PyTorch weights (converter/BUNDLE.md)"};
  return {nullptr, nullptr};
}

}  // namespace dcloth::converter
