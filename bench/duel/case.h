// What duel/garment.py prepared for one garment and size of proxy: arrays by name, as flat vectors.
#ifndef DCLOTH_BENCH_DUEL_CASE_H_
#define DCLOTH_BENCH_DUEL_CASE_H_

#include <cstring>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "converter/error.h"
#include "converter/safetensors.h"

namespace dcloth::duel {

class Case {
 public:
  explicit Case(const std::filesystem::path& path) : file_(converter::SafeFile::Read(path)) {}

  // T is float or int32_t. Throws converter::Error for a missing array or another dtype.
  template <typename T>
  std::vector<T> Get(std::string_view name) const {
    const converter::SafeTensor& tensor = file_.Require(name);
    const bool floats = std::is_same_v<T, float>;
    if (tensor.type != (floats ? converter::SafeType::kF32 : converter::SafeType::kI32))
      converter::RefuseType(file_, tensor, floats ? "F32" : "I32");
    std::vector<T> out(tensor.count());
    if (!out.empty()) std::memcpy(out.data(), tensor.bytes.data(), tensor.bytes.size());
    return out;
  }
  size_t Rows(std::string_view name) const { return file_.Require(name).shape.at(0); }

 private:
  converter::SafeFile file_;
};

// Settings of a method, "key=value"; each has a default where it is read.
class Options {
 public:
  double& operator[](const std::string& key) { return values_[key]; }
  float Get(const std::string& key, double otherwise) const {
    const auto found = values_.find(key);
    used_[key] = true;
    return static_cast<float>(found == values_.end() ? otherwise : found->second);
  }
  // The first key that nobody has read, or empty: a misspelt one.
  std::string Unread() const {
    for (const auto& [key, value] : values_)
      if (!used_.contains(key)) return key;
    return {};
  }

 private:
  std::map<std::string, double> values_;
  mutable std::map<std::string, bool> used_;
};

}  // namespace dcloth::duel

#endif  // DCLOTH_BENCH_DUEL_CASE_H_
