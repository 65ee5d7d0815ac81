// Metadata of bundles and sequences: texts, numbers and lists of names out of strings.
#ifndef DCLOTH_CONVERTER_BUNDLE_METADATA_H_
#define DCLOTH_CONVERTER_BUNDLE_METADATA_H_

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "converter/safetensors.h"

namespace dcloth::converter {

// All throw Error with the key, what it holds and what is allowed.
std::vector<std::string> UniqueNames(const SafeFile& file,
                                     std::string_view key);                       // JSON list, not empty, no name twice
double PositiveNumber(const SafeFile& file, std::string_view key, double limit);  // in (0, limit]
size_t OneOf(const SafeFile& file, std::string_view key, std::span<const std::string_view> allowed);  // its index
std::string JsonObject(const SafeFile& file, std::string_view key);  // "{}" where absent

// JSON list of `joints` indices below that number, or -1, that lead up without a circle; empty where absent.
std::vector<int32_t> Parents(const SafeFile& file, std::string_view key, size_t joints);

// Index of a name that `key` holds among `names`.
uint32_t IndexOf(const SafeFile& file, std::string_view key, const std::string& name,
                 const std::vector<std::string>& names);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_BUNDLE_METADATA_H_
